"""Measures how true contacts and forces of dynacom.analyze are, beside measured and simulated ones.

usage: truth.py [--sensitivity] [--json FILE] [FOLDER]
       truth.py --quick [--only NAMES] [--measured] [--noise] [--cutoff HZ] [FOLDER]
       truth.py --page

FOLDER has trials and robots, ../shared/data/forces by default; the folders above it have clips.
Figures go to docs/truth.json and from there to docs/truth.md, or else to FILE alone. --sensitivity
measures also what constants and a minute of standing change; without it, those figures are kept.
--page measures nothing, but writes docs/truth.md again. --quick prints a line per trial, with what
is found at the cut-off that suits it, or HZ (0: no filter), perhaps with --noise on its poses, and
--measured another one, with the measured contacts; it writes nothing.
"""

import argparse
import datetime
import json
from pathlib import Path

import numpy as np
import truth_clips
import truth_page
import truth_robustness
import truth_trials
from truth_scores import score

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT.parent / "shared" / "data" / "forces"
WALKS = ROOT / "examples" / "data"
DIGITS = 4  # of what is kept
LONGEST_LINE = 600


# ---- Quickly ----


def text(value, form):
    """A number that may not exist."""
    return format(float("nan") if value is None else value, form)


def line(label, figures):
    """The figures of a trial for a terminal."""
    feet = " ".join(f"{value:4.1f}" for value in figures["feet"])
    return (
        f"{label:28s} {text(figures['median'], '4.0f')} /{text(figures['worst'], '4.0f')} ms, "
        f"missed {figures['missed']:2d} of {figures['changes']:3d}, lost {figures['lost']:5.1f}, "
        f"made up {figures['made_up']:5.1f} %, f_z {feet:19s} %, "
        f"Solved {figures['statuses'].get('Solved', 0):3.0f} %, {','.join(figures['codes'])}"
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
        f"missed {missed:2d} of {changes:3d}, lost {median('lost'):5.1f}, "
        f"made up {median('made_up'):5.1f} %, f_z {feet:4.1f} %"
    )


def quick(trials, arguments):
    """A line per trial, and their medians."""
    found, given = [], []
    for trial in trials:
        cutoff = trial.noisy_cutoff if arguments.noise else trial.cutoff
        if arguments.cutoff is not None:
            cutoff = arguments.cutoff or None
        moved = truth_trials.with_noise(trial) if arguments.noise else trial
        found.append(score(truth_trials.analyze(moved, cutoff), trial))
        print(line(trial.name, found[-1]), flush=True)
        if arguments.measured:
            schedule = truth_trials.measured_schedule(trial)
            given.append(score(truth_trials.analyze(moved, cutoff, schedule), trial))
            print(line("  with the measured contacts", given[-1]), flush=True)
    print(medians("medians", found))
    if given:
        print(medians("  with the measured contacts", given))


# ---- Thoroughly ----


def measure_trial(trial):
    """Figures of what is found and with the measured contacts, at each cut-off and with noise."""
    schedule = truth_trials.measured_schedule(trial)
    noisy = truth_trials.with_noise(trial)
    cases = {key: (trial, cutoff) for key, cutoff in truth_page.CUTOFFS.items()}
    cases |= {"default": (trial, trial.cutoff), "noise": (noisy, trial.noisy_cutoff)}
    return {
        "cutoff": trial.cutoff,
        "found": {
            key: score(truth_trials.analyze(moved, cutoff), trial)
            for key, (moved, cutoff) in cases.items()
        },
        "measured": {
            key: score(truth_trials.analyze(moved, cutoff, schedule), trial)
            for key, (moved, cutoff) in cases.items()
        },
    }


def measure(folder, sensitivity):
    """All figures: section -> name -> figures."""
    trials = [truth_trials.read_trial(path) for path in sorted(folder.glob("*.npz"))]
    figures = {"date": datetime.date.today().isoformat(), "trials": {}}
    for trial in trials:
        print(f"{trial.name} ...", flush=True)
        figures["trials"][trial.name] = measure_trial(trial)
    print("clips ...", flush=True)
    figures["clips"] = truth_clips.measure(folder.parent)
    figures["walks"] = truth_clips.measure_walks(WALKS)
    if not sensitivity:
        return figures
    figures["standing"] = {}
    poses = map(truth_robustness.poses_of_trial, trials)
    for motion in (*poses, *truth_robustness.poses_of_samples(folder.parent)):
        print(f"{motion.name}, standing before and after ...", flush=True)
        figures["standing"][motion.name] = truth_robustness.measure_standing(motion)
    print("constants ...", flush=True)
    figures["constants"] = truth_robustness.measure_constants(trials)
    return figures


def rounded(value):
    """The same, with floats of a few digits."""
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    if isinstance(value, list):
        return [rounded(item) for item in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def written(value, indent=0):
    """JSON with a line for everything that is short enough."""
    line = json.dumps(value, ensure_ascii=False, allow_nan=False)
    if not isinstance(value, dict) or len(line) <= LONGEST_LINE:
        return line
    inner = " " * (indent + 1)
    lines = (
        f"{inner}{json.dumps(key)}: {written(item, indent + 1)}" for key, item in value.items()
    )
    return "{\n" + ",\n".join(lines) + "\n" + " " * indent + "}"


def record(figures, path):
    """Keeps the figures; sections that were not measured now stay as they are."""
    kept = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    path.write_text(written(kept | rounded(figures)) + "\n", encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, usage="see below"
    )
    parser.add_argument("folder", type=Path, nargs="?", default=FOLDER)
    parser.add_argument("--json", type=Path, metavar="FILE")
    for flag in ("--sensitivity", "--page", "--quick", "--measured", "--noise"):
        parser.add_argument(flag, action="store_true")
    parser.add_argument("--only", metavar="NAMES")
    parser.add_argument("--cutoff", type=float, metavar="HZ")
    arguments = parser.parse_args()
    if not arguments.quick and (arguments.only or arguments.measured or arguments.noise):
        parser.error("--only, --measured and --noise are for --quick")
    if arguments.quick:
        paths = sorted(arguments.folder.glob("*.npz"))
        wanted = arguments.only.split(",") if arguments.only else [path.stem for path in paths]
        if not paths or set(wanted) - {path.stem for path in paths}:
            parser.error(f"not all of {', '.join(wanted) or 'the trials'} in {arguments.folder}")
        chosen = [path for path in paths if path.stem in wanted]
        quick(map(truth_trials.read_trial, chosen), arguments)
        return
    if not arguments.page:
        figures = measure(arguments.folder, arguments.sensitivity)
        record(figures, arguments.json or truth_page.FIGURES)
    if not arguments.json:
        truth_page.write()


if __name__ == "__main__":
    main()
