"""What truth.py prints while one works on the detection: a line for each motion."""

import json

import numpy as np
import truth_clips
import truth_page
import truth_robustness
import truth_trials
from truth_goals import check_standing
from truth_scores import score

import dynacom


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


def print_trials(trials, cutoff, noise, measured):
    """Contacts and forces of trials, perhaps with the measured contacts, too, and their medians.

    Args:
        cutoff: [Hz], 0 for none; None for what suits each trial.
        noise: whether to add noise to the poses.
    """
    found, given = [], []
    for trial in trials:
        filtered = trial.noisy_cutoff if noise else trial.cutoff
        if cutoff is not None:
            filtered = cutoff or None
        moved = truth_trials.with_noise(trial) if noise else trial
        found.append(score(truth_trials.analyze(moved, filtered), trial))
        print(line(trial.name, found[-1]), flush=True)
        if measured:
            schedule = truth_trials.measured_schedule(trial)
            given.append(score(truth_trials.analyze(moved, filtered, schedule), trial))
            print(line("  with the measured contacts", given[-1]), flush=True)
    print(medians("medians", found))
    if given:
        print(medians("  with the measured contacts", given))


def print_clips(data, names):
    """Residuals of clips, what they were with thresholds, and the median of the ratios."""
    before = {}
    if truth_page.THRESHOLDS.exists():
        before = json.loads(truth_page.THRESHOLDS.read_text(encoding="utf-8"))["clips"]
    ratios = []
    for sample in truth_clips.SAMPLES:
        if names and sample.name not in names:
            continue
        try:
            row = truth_clips.score_sample(truth_clips.analyze_sample(sample, data))
        except dynacom.DynacomError as error:
            print(f"{sample.name[:28]:28s} {str(error)[:160]}", flush=True)
            continue
        then = before.get(sample.name, {}).get("force_rms", float("nan"))
        ratios.append(row["force_rms"] / then)
        print(
            f"{sample.name[:28]:28s} force {row['force_rms']:.3f}, was {then:.3f} m g: "
            f"{ratios[-1]:5.2f}, moment {row['torque_rms']:.3f} m g m, "
            f"within limits {row['within']:3.0f} %, fast {row['fast']:4.1f} %, "
            f"{','.join(row['codes'])}",
            flush=True,
        )
    print(f"median ratio {np.nanmedian(ratios):.2f}")


def print_standing(trials, data, names):
    """How contacts change when motions stand for a minute before and after."""
    poses = [truth_robustness.poses_of_trial(trial) for trial in trials]
    for motion in (*poses, *truth_robustness.poses_of_samples(data, names)):
        figures = truth_robustness.measure_standing(motion)
        text, _ = check_standing(motion.name, figures)
        rest = "" if figures["at_rest"] else ", cut in motion"
        print(f"{text} of {figures['changes']} changes{rest}", flush=True)
