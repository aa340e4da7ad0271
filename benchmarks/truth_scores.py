"""What a report of dynacom is worth, beside measured forces."""

import numpy as np
import truth_metrics as metrics
from truth_metrics import share


def rotate(quaternions, vectors):
    """Vectors (T, 3), each turned by its quaternion (T, 4), x y z w."""
    axes, w = quaternions[:, :3], quaternions[:, 3:]
    return vectors + 2 * np.cross(axes, np.cross(axes, vectors) + w * vectors)


def contact_force(report, name):
    """Force of a contact in the world, (T, 3) [N]."""
    return np.nan_to_num(
        rotate(report[f"contact.{name}.rotation"], report[f"contact.{name}.force"])
    )


def contact_place(report, name):
    """Where a contact presses, in the world; its origin where it does not, (T, 3) [m]."""
    cop = np.nan_to_num(report[f"contact.{name}.cop"])
    offset = np.column_stack([cop, np.zeros(len(cop))])
    return report[f"contact.{name}.position"] + rotate(report[f"contact.{name}.rotation"], offset)


def foot_active(report, trial, foot):
    """Whether any part of a foot is active, (T,)."""
    return np.any([report[f"contact.{name}.active"] for name in trial.contacts(foot)], axis=0)


def presses(force, place):
    """Vertical force, and that times x and y of where it presses, (T, 3) [N], [N m]."""
    return np.column_stack([force[:, 2], force[:, 2:] * np.nan_to_num(place[:, :2])])


def score_contacts(report, trial):
    """Changes of contact, and frames that are wrong: of all feet together."""
    errors, lost, made, active = [], [], [], []
    for index, foot in enumerate(trial.feet):
        touch = None if trial.touch is None else trial.touch[:, index]
        truth = metrics.true_contact(trial.force[:, index, 2], trial.time, trial.weight, touch)
        found = foot_active(report, trial, foot)
        errors += metrics.change_errors(found, truth, trial.time, trial.measured)
        wrong = metrics.wrong_frames(found, truth, trial.time, trial.measured)
        lost.append(share(*wrong[:2]))
        made.append(share(*wrong[2:]))
        active.append(share(int(found.sum()), len(found)))
    seen = 1e3 * np.array([error for error in errors if np.isfinite(error)])
    return {
        "changes": len(errors),
        "missed": len(errors) - len(seen),
        "median": float(np.median(seen)) if len(seen) else None,
        "worst": float(seen.max()) if len(seen) else None,
        "lost": max(lost),
        "made_up": max(made),
        "active": active,
    }


def score_forces(report, trial):
    """Vertical force of each foot, the whole force, and where it presses."""
    time, measured = trial.time, trial.measured
    feet = []
    whole, known = np.zeros((2, len(time), 3))
    pressed, known_pressed = np.zeros((2, len(time), 3))
    for index, foot in enumerate(trial.feet):
        forces = {name: contact_force(report, name) for name in trial.contacts(foot)}
        total, truth = sum(forces.values()), trial.force[:, index]
        vertical = metrics.force_error(total[:, 2], np.nan_to_num(truth[:, 2]), time, measured)
        feet.append(vertical)
        whole, known = whole + total, known + truth
        for name, force in forces.items():
            pressed += presses(force, contact_place(report, name))
        known_pressed += np.nan_to_num(presses(truth, trial.cop[:, index]))
    missing = ~np.isfinite(known[measured]).all(axis=0)
    error = metrics.filtered(whole - np.nan_to_num(known), time, measured)
    axes = np.where(missing, np.nan, metrics.rms(error) / trial.mass)
    cop = np.full(2, np.nan)
    if np.isfinite(trial.cop).any():
        cop = metrics.cop_error(pressed, known_pressed, time, measured, trial.weight)
    return {
        "feet": [float(value) for value in feet],
        "whole": [number(value) for value in axes],
        "cop": [number(1e3 * value) for value in cop],
    }


def score(report, trial):
    """All figures of a report: times in ms, forces in % or N/kg, places in mm, shares in %."""
    statuses = {
        name: share(count, len(trial.time)) for name, count in report.summary["statuses"].items()
    }
    return {
        **score_contacts(report, trial),
        **score_forces(report, trial),
        "statuses": {name: value for name, value in statuses.items() if value},
        **score_verdict(report),
    }


def score_verdict(report):
    """Verdict, codes, and the root mean square of the distance to a feasible motion [mm]."""
    distance = report.summary["distance"]
    return {
        "verdict": report.summary["verdict"],
        "codes": list(report.summary["codes"]),
        "distance": None if distance is None else 1e3 * distance["rms"],
    }


def number(value):
    """What JSON can hold: None for NaN."""
    return float(value) if np.isfinite(value) else None
