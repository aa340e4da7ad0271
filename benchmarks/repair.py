"""What repairMotion makes of clips of other people: the table of docs/repair.md, in Markdown.

Usage: repair.py [DATA [NAME ...]]

DATA is ../shared/data by default; of its clips those whose names have one of NAME in them.

A clip is examined as ever, its filtered configurations are repaired with the contacts that were
found, and what comes out is examined once more, without a filter, as if it were a file. Where its
contacts cannot give what every frame needs, it is repaired once more with the contacts that were
found then, up to ROUNDS times.
"""

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import truth_clips

import dynacom

ROOT = Path(__file__).parents[1]
ROUNDS = 3
DONE = {"Solved", "NoContact"}


def solved(found):
    """Which part of the frames contacts can give, or are in flight and need nothing [%]."""
    weight = found.statistics.weight
    residual = np.linalg.norm(found.analysis.residual, axis=1) / weight
    names = [status.name for status in found.analysis.status]
    good = [name in DONE and size < 1e-3 for name, size in zip(names, residual, strict=True)]
    return 100.0 * np.mean(good)


def examine(clip, robot, **options):
    return dynacom.analyze(
        clip, robot, options=dynacom.AnalysisOptions(**options), sensitivity=False
    ).examination


def repair(clip, robot, settings):
    """Figures of a clip."""
    found = before = examine(clip, robot)
    motion = found.derived.motion
    spent, rounds = 0.0, 0
    for _ in range(ROUNDS):
        rounds += 1
        start = time.process_time()
        parts = dynacom.splitContacts(robot.dynacom(), found.links)
        repaired = dynacom.repairMotion(parts, motion, found.inference.schedule, settings)
        spent += time.process_time() - start
        motion = repaired.motion
        written = replace(clip, q=np.asarray(motion.q), v=None, a=None)
        found = examine(written, robot, cutoff=0.0)
        if solved(found) == 100.0:
            break
    model = robot.model
    pairs = zip(before.derived.motion.q, motion.q, strict=True)
    change = np.array([pinocchio.difference(model, *pair) for pair in pairs])
    root = 1e3 * np.linalg.norm(change[:, :3], axis=1)
    joints = np.degrees(np.sqrt(np.mean(change[:, 6:] ** 2)))
    return [
        f"{solved(before):.0f}",
        f"{solved(found):.1f}",
        str(rounds),
        f"{np.sqrt(np.mean(root**2)):.1f} / {root.max():.0f}",
        f"{joints:.2f}",
        found.verdict.outcome,
        ", ".join(code for code in found.verdict.codes if code != "feasible"),
        f"{1e6 * spent / rounds / len(root):.0f}",
    ]


def main():
    data, *names = sys.argv[1:] or [ROOT.parent / "shared" / "data"]
    head = ["clip", "feet", "before [%]", "after [%]", "rounds", "root [mm]", "joints [°]"]
    head += ["verdict", "codes", "µs a frame"]
    for cells in (head, ["---"] * len(head)):
        print(f"| {' | '.join(cells)} |", flush=True)
    for sample in truth_clips.SAMPLES:
        if names and not any(name in sample.name for name in names):
            continue
        try:
            robot = truth_clips.load_robot(sample.robot, Path(data) / "clips")
            clip = dynacom.read_motion(Path(data) / sample.path, robot, **sample.options)
        except dynacom.DynacomError as error:
            print(error, file=sys.stderr)
            continue
        for feet in ("moved", "held"):
            settings = dynacom.RepairSettings()
            if feet == "moved":
                settings.largest_drift = 0.0
            cells = [sample.name, feet, *repair(clip, robot, settings)]
            print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
