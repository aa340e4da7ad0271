"""A batch in a process of its own: prints a JSON object that says when its results came.

Usage: timed_batch.py OUT ENGINE JOBS FPS FOLDER [repair]
"""

import json
import resource
import sys
import time

import dynacom
from dynacom.batch import run_batch


def main():
    out, engine, jobs, fps, folder, *others = sys.argv[1:]
    repairs = others == ["repair"]
    first = last = None

    def keep(state):
        nonlocal first, last
        last = time.monotonic(), state
        first = first or last

    found = run_batch(
        folder,
        "g1",
        out,
        # By the distance repair chooses contacts; analysis can do without.
        options=dynacom.AnalysisOptions(distance=repairs),
        engine=engine,
        jobs=int(jobs),
        fps=float(fps),
        repair=repairs,
        progress=keep,
    )
    (first_time, before), (last_time, state) = first, last
    result = {
        # Of the system's clock, which is that of the caller, too [s].
        "first": first_time,
        "last": last_time,
        # Between the two.
        "frames": state.frames - before.frames,
        "clips": state.clips,
        "errors": state.errors,
    }
    if repairs:
        workers = resource.getrusage(resource.RUSAGE_CHILDREN)
        result |= {
            "outcomes": found.outcomes,
            # Of a core, starting included.
            "frames_a_second": state.frames / (workers.ru_utime + workers.ru_stime),
        }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
