"""Measures how true contacts and forces of dynacom.analyze are, beside measured and simulated ones.

Figures are kept in docs/truth.json, and docs/truth.md is written from those.
"""

import argparse
import datetime
import json
from pathlib import Path

import truth_clips
import truth_page
import truth_quick
import truth_robustness
import truth_trials
from truth_scores import score

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT.parent / "shared" / "data" / "forces"
WALKS = ROOT / "examples" / "data"
DIGITS = 4  # of what is kept
LONGEST_LINE = 600


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
    figures = {"trials": {}}
    for trial in trials:
        print(f"{trial.name} ...", flush=True)
        figures["trials"][trial.name] = measure_trial(trial)
    print("clips ...", flush=True)
    figures["clips"] = truth_clips.measure(folder.parent)
    figures["walks"] = truth_clips.measure_walks(WALKS)
    print("shares ...", flush=True)
    figures["shares"] = truth_robustness.measure_shares(trials)
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
    """Keeps the figures with today's date; sections that were not measured now stay as they are."""
    kept = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    dates = kept.get("dates", {}) | dict.fromkeys(figures, datetime.date.today().isoformat())
    figures = {"dates": dates} | figures
    path.write_text(written(kept | rounded(figures)) + "\n", encoding="utf-8")


def quick(parser, arguments):
    """Prints a line for each motion that is asked for."""
    folder, names = arguments.folder, arguments.only.split(",") if arguments.only else []
    paths = sorted(folder.glob("*.npz"))
    known = {path.stem for path in paths} | {sample.name for sample in truth_clips.SAMPLES}
    if unknown := sorted(set(names) - known):
        parser.error(f"{', '.join(unknown)} is none of {', '.join(sorted(known))}")
    chosen = [path for path in paths if not names or path.stem in names]
    trials = map(truth_trials.read_trial, chosen)
    if arguments.clips:
        truth_quick.print_clips(folder.parent, names)
    elif arguments.standing:
        truth_quick.print_standing(trials, folder.parent, names)
    elif chosen:
        truth_quick.print_trials(trials, arguments.cutoff, arguments.noise, arguments.measured)
    else:
        parser.error(f"no trials in {folder}")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add(
        "folder",
        type=Path,
        nargs="?",
        default=FOLDER,
        help="has trials and robots, and the folder above it clips (%(default)s)",
    )
    add("--json", type=Path, metavar="FILE", help="keep the figures here, and write no page")
    add("--sensitivity", action="store_true", help="what constants and a minute of standing change")
    add("--page", action="store_true", help="measure nothing, but write the page again")
    add("--quick", action="store_true", help="print a line per trial, and write nothing")
    add("--only", metavar="NAMES", help="quick: of these, with commas between them")
    add("--clips", action="store_true", help="quick: clips instead of trials")
    add("--standing", action="store_true", help="quick: both, with a minute of standing")
    add("--measured", action="store_true", help="quick: with the measured contacts, too")
    add("--noise", action="store_true", help="quick: with noise on the poses")
    add("--cutoff", type=float, metavar="HZ", help="quick: of the filter, 0 for none")
    arguments = parser.parse_args()
    if arguments.quick:
        quick(parser, arguments)
        return
    for name in ("only", "clips", "standing", "measured", "noise", "cutoff"):
        if getattr(arguments, name) not in (None, False):
            parser.error(f"--{name} is for --quick")
    if not arguments.page:
        if not list(arguments.folder.glob("*.npz")):
            parser.error(f"no trials in {arguments.folder}")
        figures = measure(arguments.folder, arguments.sensitivity)
        record(figures, arguments.json or truth_page.FIGURES)
    if not arguments.json:
        truth_page.write()


if __name__ == "__main__":
    main()
