"""What repair makes of motions of other people: the tables of docs/repair.md, in Markdown.

Clips are repaired by dynacom.repair, once with wrenches only, and once with feet and joints;
--feet tells how still and how high feet stand then, of these and of robots that lean.
Motions whose forces were measured are repaired by repairMotion, wrenches only, with the contacts
that were found in them, and analysed with the same; nothing is asked of frames that are unsure.
"""

import argparse
import resource
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pinocchio
import repair_derived
import truth_clips
import truth_trials

import dynacom

DATA = Path(__file__).resolve().parents[1].parent / "shared" / "data"


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


def share(missing, found):
    """Which part of the frames is within reach [%]."""
    return 100.0 * (1.0 - missing / found.statistics.frames)


def span(change, factor, digits):
    """RMS and largest."""
    return f"{factor * change.rms:.{digits}f} / {factor * change.largest:.0f}"


def slide(found):
    """In which part of the frames a contact slides faster than a verdict allows [%]."""
    finding = found.verdict.findings["foot_sliding"]
    return 100.0 * finding.frames / found.statistics.frames


def solved(report):
    """Which part of the judged frames is Solved, with nothing missing but rounding [%]."""
    status = np.array([str(status) for status in report["status"]])
    judged = ~np.asarray(report.examination.verdict.unsure)
    return f"{100.0 * np.mean(status[judged] == 'Solved'):.1f}"


def solved_written(report):
    """The same of the file, read again."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / report.clip.path.name
        report.write(path)
        return solved(report.examine_written(report.read_again(path)))


def cells(report):
    """Of a clip's repair."""
    made = report.repair
    before, after = made.before, made.after
    return [
        f"{share(made.missing_before, before):.0f}",
        f"{share(made.missing, after):.1f}",
        solved(report.after),
        solved_written(report),
        f"{slide(before):.1f}",
        f"{slide(after):.1f}",
        span(made.root, 1e3, 1),
        span(made.joints, np.degrees(1.0), 2),
        after.verdict.outcome,
        ", ".join(sorted({reason.code for reason in made.reasons})),
    ]


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
    "reach before [%]",
    "after [%]",
    "Solved [%]",
    "in the file [%]",
    "slides before [%]",
    "after [%]",
    "root [mm]",
    "joints [°]",
    "after",
    "what is left",
]


def repair_clip(clip, robot, balance_only):
    start = time.process_time()
    report = dynacom.repair(clip, robot, balance_only=balance_only, threads=1)
    return report, 1e6 * (time.process_time() - start) / len(clip.time)


def print_clips(data, names):
    print_head(["clip", "before", "mended", *REPAIRED, "µs a frame"])
    for name, robot, clip in read_samples(data, names):
        for balance_only in (True, False):
            report, spent = repair_clip(clip, robot, balance_only)
            mended = "wrenches" if balance_only else "all"
            before = report.repair.before.verdict.outcome
            print_row([name, before, mended, *cells(report), f"{spent:.0f}"])


# ---- Feet ----

# Frames so near to one in which a part of the foot touches down or lifts off are not inside.
AROUND = 2


def inside(active, stance):
    """Frames of a stance around which the same parts of its foot carry: active is (T, parts)."""
    frames = range(stance.first + AROUND, stance.behind - AROUND)
    return [
        frame
        for frame in frames
        if (active[frame - AROUND : frame + AROUND + 1] == active[frame]).all()
    ]


def measure_held(report):
    """Speeds [mm/s] and heights over the ground [mm] of parts that carry inside stances that are
    held still, by differences of two frames, and how many stances these are."""
    found, stances = report.after.examination, report.repair.stances
    held = [s for s in stances if s.is_still and s.contact < len(report.robot.contacts)]
    active = np.asarray(found.inference.schedule.active)
    time = found.derived.motion.time
    parts = dynacom.splitContacts(report.robot.dynacom(), found.links)
    ground = dynacom.findRepairGround(parts, found.inference, time)
    speeds, heights = [], []
    for stance in held:
        own = [k for k, part in enumerate(found.parts) if part.contact == stance.contact]
        for frame in inside(active[:, own], stance):
            for part in np.array(own)[active[frame, own]]:
                places = found.part_motions[part].position[frame - 1 : frame + 2]
                step = (places[2] - places[0]) / (time[frame + 1] - time[frame - 1])
                speeds.append(1e3 * np.linalg.norm(step - found.inference.ground_velocity))
                heights.append(1e3 * (places[1, 2] - ground.height[frame, part]))
    return len(held), np.array(speeds), np.array(heights)


def largest_and_share(values, limit):
    """The largest and which part is no larger than a limit [%]."""
    return [f"{np.nanmax(values):.2g}", f"{100.0 * np.mean(values <= limit):.1f}"]


def print_feet(data, names):
    print_head(
        ["motion", "outcome", "held", "largest speed [mm/s]", "≤ 3 mm/s [%]"]
        + ["farthest from the ground [mm]", "≤ 1 mm [%]"]
    )
    for name, robot, clip in [*read_samples(data, names), *read_cases(data, names)]:
        report = dynacom.repair(clip, robot, threads=1)
        held, speeds, heights = measure_held(report)
        count = report.summary["repair"]["stances"]["count"]
        cells = ["", "", "", ""]
        if len(speeds):
            cells = largest_and_share(speeds, 3.0) + largest_and_share(np.abs(heights), 1.0)
        print_row([name, report.outcome, f"{held} of {count}", *cells])


def read_cases(data, names):
    """Robots that lean, statically, with their names."""
    robot = dynacom.load_robot("talos")
    for name in ("lean_05cm", "fallonefoot_05cm", "tiptoe30_heel"):
        if not names or any(part in name for part in names):
            yield name, robot, dynacom.read_motion(data / "cases" / f"{name}.npz", robot)


# ---- Growth with the length ----


def back_and_forth(clip, times):
    """The times and configurations of a clip that is played so often, every other time backward."""
    q = np.concatenate([clip.q if turn % 2 == 0 else clip.q[::-1] for turn in range(times)])
    return np.arange(len(q)) * np.diff(clip.time).mean(), q


def largest_memory():
    """Of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def print_growth(data, names):
    print_head(["clip", "frames", "minutes", "µs a frame", "memory [MB]", "a minute more [MB]"])
    for name, robot, clip in read_samples(data, names or ["J_Dance0"]):
        examiner = dynacom.MotionExaminer(robot.dynacom(), threads=1, sensitivity=False)
        repairer = dynacom.MotionRepairer(robot.dynacom(), examiner)
        earlier = None
        for times in (1, 4, 16):
            recorded = dynacom.RecordedMotion(*back_and_forth(clip, times))
            start = time.process_time()
            repairer.repair(recorded)
            frames, minutes = len(recorded.time), recorded.time[-1] / 60.0
            spent = 1e6 * (time.process_time() - start) / frames
            memory = largest_memory()
            more = "" if earlier is None else (memory - earlier[0]) / (minutes - earlier[1])
            earlier = memory, minutes
            cells = [str(frames), f"{minutes:.1f}", f"{spent:.0f}", f"{memory:.0f}"]
            print_row([name, *cells, f"{more:.1f}" if more else ""])


def print_filter(data, names):
    """The centroidal filter alone, with contacts that are known, on one core."""
    print_head(["clip", "frames", "iterations", "distance [mm]", "frames a second"])
    for name, robot, clip in read_samples(data, names):
        found = dynacom.analyze(clip, robot, sensitivity=False, threads=1).examination
        parts = dynacom.splitContacts(robot.dynacom(), found.links)
        dynamics = dynacom.analyzeMotion(
            parts.robot, found.derived.motion, found.inference.schedule
        )
        seconds = []
        for _ in range(5):
            start = time.process_time()
            change = dynacom.distanceToFeasible(
                parts, found.part_motions, dynamics, found.inference.schedule, threads=1
            )
            seconds.append(time.process_time() - start)
        frames = len(clip.time)
        cells = [str(frames), str(change.iterations), f"{1e3 * change.rms:.1f}"]
        print_row([name, *cells, f"{frames / np.median(seconds):.0f}"])


# ---- Motions made from clips ----


def print_derived(data, names):
    counts = {made: Counter() for made in repair_derived.DERIVED}
    for _, robot, clip in read_samples(data, names):
        for made, derive in repair_derived.DERIVED.items():
            derived = derive(clip, robot.model)
            balanced = dynacom.repair(derived, robot, balance_only=True).repair
            count = counts[made]
            count["motions"] += 1
            if balanced.before.verdict.outcome != "repairable":
                continue
            count["repairable"] += 1
            count["within reach"] += balanced.missing == 0
            count["repaired"] += dynacom.repair(derived, robot).outcome == "repaired"
    columns = ["motions", "repairable", "within reach", "repaired"]
    print_head(["made", *columns])
    for made, count in counts.items():
        print_row([made, *(str(count[column]) for column in columns)])


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
    settings = dynacom.RepairSettings()
    settings.feet = settings.joints = False
    repaired = dynacom.repairMotion(parts, motion, schedule, settings, unsure)
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
    which.add_argument("--feet", action="store_true", help="how feet stand in repaired clips")
    which.add_argument("--growth", action="store_true", help="time and memory of long motions")
    which.add_argument("--filter", action="store_true", help="the centroidal filter alone")
    which.add_argument("--derived", action="store_true", help="motions made from clips")
    arguments = parser.parse_args()
    table = print_clips
    if arguments.forces:
        table = print_forces
    elif arguments.feet:
        table = print_feet
    elif arguments.growth:
        table = print_growth
    elif arguments.filter:
        table = print_filter
    elif arguments.derived:
        table = print_derived
    table(arguments.data, arguments.names)


if __name__ == "__main__":
    main()
