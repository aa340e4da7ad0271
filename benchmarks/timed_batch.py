"""A batch in a process of its own: prints a JSON object that says when its results came.

Usage: timed_batch.py OUT ENGINE JOBS FPS FOLDER
"""

import json
import sys
import time

import dynacom
from dynacom.batch import run_batch


def main():
    out, engine, jobs, fps, folder = sys.argv[1:]
    first = last = None

    def keep(state):
        nonlocal first, last
        last = time.monotonic(), state
        first = first or last

    run_batch(
        folder,
        "g1",
        out,
        options=dynacom.AnalysisOptions(distance=False),
        engine=engine,
        jobs=int(jobs),
        fps=float(fps),
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
    print(json.dumps(result))


if __name__ == "__main__":
    main()
