"""Measures how true contacts and forces of dynacom.analyze are, beside measured and simulated ones.

usage: truth.py [--only NAMES] [--quick [--measured]] [FOLDER]

FOLDER has trials and robots, ../shared/data/forces by default.
"""

import argparse
from pathlib import Path

import numpy as np
import truth_trials
from truth_scores import score

FOLDER = Path(__file__).resolve().parents[1].parent / "shared" / "data" / "forces"


def text(value, form="5.1f"):
    """A number that may not exist."""
    return format(value if value is not None else float("nan"), form)


def line(label, figures):
    """The figures of a trial for a terminal."""
    feet = " ".join(f"{value:4.1f}" for value in figures["feet"])
    changes = (
        f"{text(figures['median'], '4.0f')} /{text(figures['worst'], '4.0f')} ms, "
        f"missed {figures['missed']:2d} of {figures['changes']:2d}"
    )
    return (
        f"{label:28s} {changes}, lost {figures['lost']:5.1f}, made up {figures['made_up']:5.1f} %, "
        f"f_z {feet:19s} %, Solved {figures['statuses'].get('Solved', 0):3.0f} %, "
        f"{','.join(figures['codes'])}"
    )


def medians(label, rows):
    """The medians of all trials for a terminal."""

    def median(key):
        values = [row[key] for row in rows if row[key] is not None]
        return np.median(values) if values else float("nan")

    feet = np.median(np.concatenate([row["feet"] for row in rows]))
    missed, changes = (sum(row[key] for row in rows) for key in ("missed", "changes"))
    return (
        f"{label:28s} {median('median'):4.0f} /{median('worst'):4.0f} ms, "
        f"missed {missed:2d} of {changes:2d}, lost {median('lost'):5.1f}, "
        f"made up {median('made_up'):5.1f} %, f_z {feet:4.1f} %"
    )


def quick(trials, with_measured):
    """A line per trial at the cut-off of its kind, and their medians; writes nothing."""
    found, given = [], []
    for trial in trials:
        found.append(score(truth_trials.analyze(trial, trial.cutoff), trial))
        print(line(trial.name, found[-1]), flush=True)
        if with_measured:
            schedule = truth_trials.measured_schedule(trial)
            given.append(score(truth_trials.analyze(trial, trial.cutoff, schedule), trial))
            print(line("  with the measured contacts", given[-1]), flush=True)
    print(medians("medians", found))
    if with_measured:
        print(medians("  with the measured contacts", given))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("folder", type=Path, nargs="?", default=FOLDER)
    parser.add_argument("--only", metavar="NAMES", help="of trials, with commas between them")
    parser.add_argument("--quick", action="store_true", help="print a line each, write nothing")
    parser.add_argument("--measured", action="store_true", help="and with the measured contacts")
    arguments = parser.parse_args()
    paths = sorted(arguments.folder.glob("*.npz"))
    if arguments.only:
        wanted = arguments.only.split(",")
        if unknown := set(wanted) - {path.stem for path in paths}:
            parser.error(f"no trial {', '.join(sorted(unknown))} in {arguments.folder}")
        paths = [path for path in paths if path.stem in wanted]
    trials = map(truth_trials.read_trial, paths)
    if arguments.quick:
        quick(trials, arguments.measured)


if __name__ == "__main__":
    main()
