"""What must not change the contacts: constants that are other ones, and a minute of standing; and
what changes how contacts share the load: weights."""

import copy
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import truth_clips
import truth_trials
from truth_metrics import compare_changes
from truth_scores import score

import dynacom

FACTORS = 0.6, 1.6
# How long the first and the last pose are held [s], and up to which distance from there changes are
# not compared: a clip that was cut in motion stops there with a jerk [s].
STANDING, SEAM = 60.0, 0.25
# By how much frames may be off.
SAME = 1
# A clip is at rest at its ends if its root is slower there [m/s], over this time [s].
AT_REST, AT_REST_FOR = 0.1, 0.1


# ---- Constants ----


def constants(settings):
    """Names of what may be scaled: the numbers that a settings object has."""
    kind = type(settings)
    return [
        name
        for name in dir(kind)
        if isinstance(getattr(kind, name), property)
        and type(value := getattr(settings, name)) in (int, float)
        and np.isfinite(value)
        and value != 0
    ]


def scaled(name, factor):
    """Options whose detection has one constant scaled."""
    options = dynacom.AnalysisOptions()
    value = getattr(options.detection, name)
    setattr(options.detection, name, type(value)(round(value * factor, 12)))
    return options


def measure_constants(trials):
    """Each constant of the detection, scaled: name -> factor -> the worst trials."""
    figures = {}
    for name in constants(dynacom.AnalysisOptions().detection):
        figures[name] = {}
        for factor in FACTORS:
            try:
                rows = {
                    trial.name: score(
                        truth_trials.analyze(trial, trial.cutoff, options=scaled(name, factor)),
                        trial,
                    )
                    for trial in trials
                }
            except (ValueError, dynacom.DynacomError) as error:
                figures[name][str(factor)] = {"error": str(error)[:200]}
                continue
            figures[name][str(factor)] = worst_rows(rows)
    return figures


def worst_rows(rows):
    """Of the figures of all trials, the largest median error [ms] and most missed, and where."""
    slowest = max(rows, key=lambda trial: rows[trial]["median"] or 0.0)
    most = max(rows, key=lambda trial: rows[trial]["missed"])
    return {
        "median": rows[slowest]["median"] or 0.0,
        "median_of": slowest,
        "missed": rows[most]["missed"],
        "missed_of": most,
        "force": float(np.median(np.concatenate([row["feet"] for row in rows.values()]))),
    }


# ---- Shares ----


def ramped(**settings):
    """With other settings of the detection."""

    def change(trial, options):
        for name, value in settings.items():
            setattr(options.detection, name, value)
        return trial

    return change


def weighted(factor):
    """With other weights of the forces along the ground."""

    def change(trial, options):
        contacts = {}
        for name, settings in trial.robot.contacts.items():
            contacts[name] = copy.copy(settings)
            weights = np.array(settings.weights, dtype=float)
            weights[:2] *= factor
            contacts[name].weights = weights
        return replace(trial, robot=replace(trial.robot, contacts=contacts))

    return change


# What weights may be, by how the page calls it.
SHARES = {
    "as they are": ramped(),
    "no ramp": ramped(ramp_least=1.0),
    "ramp from 0.1": ramped(ramp_least=0.1),
    "over 0.05 s": ramped(ramp=0.05),
    "over 0.2 s": ramped(ramp=0.2),
    "along × 0.1": weighted(0.1),
    "along × 10": weighted(10.0),
}


def measure_shares(trials):
    """The vertical force's error, mean of the feet [%]: by trial, and by weights."""
    figures = {}
    for trial in trials:
        figures[trial.name] = {}
        for name, change in SHARES.items():
            options = dynacom.AnalysisOptions()
            changed = change(trial, options)
            found = score(truth_trials.analyze(changed, trial.cutoff, options=options), changed)
            figures[trial.name][name] = float(np.mean(found["feet"]))
    return figures


# ---- Standing ----


@dataclass(frozen=True)
class Poses:
    """Configurations q (T, nq) at even times."""

    name: str
    robot: dynacom.Robot
    rate: float
    q: np.ndarray
    options: dynacom.AnalysisOptions


def poses_of_trial(trial):
    options = dynacom.AnalysisOptions()
    options.cutoff = trial.cutoff
    rate = 1 / np.median(np.diff(trial.time))
    return Poses(trial.name, trial.robot, rate, trial.q, options)


def poses_of_samples(data, names=None):
    """The clips that can be read; those of `names`, or all."""
    for sample in truth_clips.SAMPLES:
        if names and sample.name not in names:
            continue
        try:
            clip = truth_clips.analyze_sample(sample, data).clip
        except dynacom.DynacomError:
            continue
        rate = 1 / np.median(np.diff(clip.time))
        robot = truth_clips.load_robot(sample.robot, data / "clips")
        yield Poses(sample.name, robot, rate, clip.q, dynacom.AnalysisOptions())


def find_contacts(poses, q):
    """Which contacts of the robot are active: (T, C)."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "motion.npz"
        np.savez(path, t=np.arange(len(q)) / poses.rate, q=q)
        report = dynacom.analyze(path, poses.robot, options=poses.options, sensitivity=False)
    return np.column_stack(
        [report[f"contact.{name}.active"] for name in poses.robot.contacts]
    ).astype(bool)


def ends_at_rest(poses):
    """Whether the root is slow at both ends."""
    root, frames = poses.q[:, :3], max(1, round(AT_REST_FOR * poses.rate))
    steps = np.array([root[frames] - root[0], root[-1] - root[-1 - frames]])
    return bool((np.linalg.norm(steps, axis=1) < AT_REST * frames / poses.rate).all())


def measure_standing(poses):
    """How the contacts of a clip change when it stands for a minute before and after."""
    held, seam = round(STANDING * poses.rate), round(SEAM * poses.rate)
    frames = len(poses.q)
    alone = find_contacts(poses, poses.q)
    ends = np.repeat(poses.q[:1], held, axis=0), np.repeat(poses.q[-1:], held, axis=0)
    longer = find_contacts(poses, np.concatenate([ends[0], poses.q, ends[1]]))
    inner = slice(seam, frames - seam)
    figures = compare_changes(longer[held : held + frames][inner], alone[inner], SAME)
    standing = longer[: held - seam], longer[held + frames + seam :]
    figures["while_standing"] = sum(int((part[1:] != part[:-1]).sum()) for part in standing)
    figures["at_rest"] = ends_at_rest(poses)
    return figures
