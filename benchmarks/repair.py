"""What repairMotion makes of motions of other people: the tables of docs/repair.md, in Markdown.

A clip is examined as ever, its filtered configurations are repaired with the contacts that were
found, and what comes out is examined once more, without a filter, as if it were a file. Where its
contacts cannot give what every frame needs, it is repaired once more with the contacts that were
found then, up to ROUNDS times.

Motions whose forces were measured are repaired once, and analysed with the same contacts; nothing
is asked of frames that are unsure.
"""

import argparse
import sys
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio
import repair_derived
import truth_clips
import truth_trials

import dynacom

DATA = Path(__file__).resolve().parents[1].parent / "shared" / "data"
ROUNDS = 3
DONE = {"Solved", "NoContact"}


def settings_for(feet):
    """Of feet that are "held" where they drift by little, or move as they did."""
    settings = dynacom.RepairSettings()
    if feet == "moved":
        settings.largest_drift = 0.0
    return settings


def rms(values):
    """Of each column."""
    return np.sqrt(np.mean(np.square(values), axis=0))


def print_row(cells):
    print(f"| {' | '.join(cells)} |", flush=True)


def print_head(cells):
    print_row(cells)
    print_row(["---"] * len(cells))


def length(vectors):
    """RMS and largest of the norms of rows [mm], from metres."""
    norms = 1e3 * np.linalg.norm(vectors, axis=1)
    return f"{rms(norms):.1f} / {norms.max():.0f}"


def change(model, before, after):
    """Of configurations, in the tangent space before: (T, nv)."""
    return np.array(
        [pinocchio.difference(model, *pair) for pair in zip(before, after, strict=True)]
    )


def joints(model, steps):
    """RMS of the changes of the joints that turn [°]."""
    turning = ~truth_trials.find_sliding(model)
    turning[:6] = False
    return f"{np.degrees(rms(steps[:, turning].ravel())):.2f}"


# ---- Clips ----


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


@dataclass
class Outcome:
    """Of a clip's repair."""

    before: dynacom.MotionExamination
    again: dynacom.MotionExamination  # of the filtered motion, without repair
    after: dynacom.MotionExamination
    within_reach: bool  # of the contacts that it was repaired with last
    rounds: int
    seconds: float  # of CPU, for all of them

    def cells(self, model):
        steps = change(model, self.before.derived.motion.q, self.after.derived.motion.q)
        verdict = self.after.verdict
        return [
            f"{solved(self.before):.0f}",
            f"{solved(self.again):.0f}",
            f"{solved(self.after):.1f}",
            str(self.rounds),
            length(steps[:, :3]),
            joints(model, steps),
            verdict.outcome,
            ", ".join(code for code in verdict.codes if code != "feasible"),
        ]


def reexamine(clip, robot, motion):
    """As if a file held these configurations, which need no filter."""
    written = repair_derived.with_configurations(clip, np.asarray(motion.q))
    return examine(written, robot, cutoff=0.0)


def repair(clip, robot, settings):
    found = before = examine(clip, robot)
    motion = found.derived.motion
    again = reexamine(clip, robot, motion)
    seconds, rounds = 0.0, 0
    for _ in range(ROUNDS):
        rounds += 1
        start = time.process_time()
        parts = dynacom.splitContacts(robot.dynacom(), found.links)
        repaired = dynacom.repairMotion(parts, motion, found.inference.schedule, settings)
        seconds += time.process_time() - start
        motion = repaired.motion
        found = reexamine(clip, robot, motion)
        if solved(found) == 100.0:
            break
    return Outcome(before, again, found, repaired.within_reach, rounds, seconds)


def read_samples(data, names):
    """Clips that can be read, with their names and robots."""
    for sample in truth_clips.SAMPLES:
        if names and not any(name in sample.name for name in names):
            continue
        try:
            robot = truth_clips.load_robot(sample.robot, data / "clips")
            clip = dynacom.read_motion(data / sample.path, robot, **sample.options)
        except dynacom.DynacomError as error:
            print(error, file=sys.stderr)
            continue
        yield sample.name, robot, clip


REPAIRED = [
    "before [%]",
    "again [%]",
    "after [%]",
    "rounds",
    "root [mm]",
    "joints [°]",
    "verdict",
    "codes",
]


def print_clips(data, names):
    print_head(["clip", "feet", *REPAIRED, "µs a frame"])
    for name, robot, clip in read_samples(data, names):
        for feet in ("moved", "held"):
            outcome = repair(clip, robot, settings_for(feet))
            share = 1e6 * outcome.seconds / outcome.rounds / len(clip.time)
            print_row([name, feet, *outcome.cells(robot.model), f"{share:.0f}"])


# ---- Motions made from clips ----


def print_derived(data, names):
    print_head(["clip", "made", "verdict before", *REPAIRED])
    motions, repairable, reached, solved_all = Counter(), Counter(), Counter(), Counter()
    for name, robot, clip in read_samples(data, names):
        for made, derive in repair_derived.DERIVED.items():
            outcome = repair(derive(clip, robot.model), robot, settings_for("moved"))
            verdict = outcome.before.verdict.outcome
            print_row([name, made, verdict, *outcome.cells(robot.model)])
            motions[made] += 1
            if verdict == "repairable":
                repairable[made] += 1
                reached[made] += outcome.within_reach
                solved_all[made] += solved(outcome.after) == 100.0
    print()
    within = "all frames within reach of "
    head = [within + "the contacts before", within + "those found after"]
    print_head(["made", "motions", "repairable", *head])
    for made in repair_derived.DERIVED:
        counts = (motions, repairable, reached, solved_all)
        print_row([made, *(str(count[made]) for count in counts)])


# ---- Motions whose forces were measured ----


def axes(forces, digits):
    """RMS of each axis."""
    smallest = 10.0**-digits
    return " / ".join(
        f"{value:.{digits}f}" if value >= smallest else f"< {smallest:g}" for value in rms(forces)
    )


def balance(trial):
    """A row: what contacts cannot give and how far forces are from the measured ones, where these
    are known, before and after, in frames that are not unsure; and how it was moved."""
    found = truth_trials.analyze(trial, trial.cutoff).examination
    unsure = np.asarray(found.verdict.unsure)
    parts = dynacom.splitContacts(trial.robot.dynacom(), found.links)
    schedule, motion = found.inference.schedule, found.derived.motion
    repaired = dynacom.repairMotion(parts, motion, schedule, settings_for("moved"), unsure)
    before, after = (
        dynacom.analyzeMotion(parts.robot, moved, schedule) for moved in (motion, repaired.motion)
    )
    judged = ~unsure
    total = trial.force.sum(axis=1)
    known = judged & trial.measured & np.isfinite(total).all(axis=1)
    steps = change(trial.robot.model, motion.q, repaired.motion.q)
    return [
        trial.name,
        f"{judged.sum()} of {len(judged)}",
        axes(before.residual[judged, :3], 1),
        axes(after.residual[judged, :3], 3),
        *(
            axes((analysis.ground_force - total)[known], 0) if known.any() else ""
            for analysis in (before, after)
        ),
        length(steps[:, :3]),
        length(after.com - before.com),
        joints(trial.robot.model, steps),
    ]


def print_forces(data, names):
    head = ["motion", "frames judged"]
    for what in ("beyond contacts", "off measured"):
        head += [f"{what}, {when} [N]" for when in ("before", "after")]
    head += ["root [mm]", "CoM [mm]", "joints [°]"]
    print_head(head)
    for path in sorted((data / "forces").glob("*.npz")):
        if not names or any(name in path.stem for name in names):
            print_row(balance(truth_trials.read_trial(path)))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("data", type=Path, nargs="?", default=DATA, help="has clips and forces/ (%(default)s)")
    add("names", nargs="*", help="only what has one of these in its name")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--forces", action="store_true", help="motions with measured forces")
    which.add_argument("--derived", action="store_true", help="motions made from clips")
    arguments = parser.parse_args()
    table = print_clips
    if arguments.forces:
        table = print_forces
    elif arguments.derived:
        table = print_derived
    table(arguments.data, arguments.names)


if __name__ == "__main__":
    main()
