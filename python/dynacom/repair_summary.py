# SPDX-License-Identifier: BSD-2-Clause
"""What a repair did, in numbers and in words: the entry ``repair`` of a summary."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from dynacom.dynacom_pywrap import (
    MotionExamination,
    MotionRepair,
    RepairChange,
    RepairReason,
    RepairStep,
)
from dynacom.robots import Robot

# What may help against what is left.
_HINTS = {
    "foot_sliding": "feet that slide in earnest need another motion; repair.largest_drift and "
    "repair.largest_shift say how far they may be moved",
    "contact_needed": "a contact may be missing that --schedule can tell, or time may be stretched",
    "out_of_reach": "time may be stretched (--stretch), or a contact is missing (--schedule)",
    "bound": "time may be stretched (--stretch); ladder.largest_displacement and "
    "ladder.largest_turn say how much is allowed",
    "ground_penetration": "the height of the ground may be told (--ground-height)",
    "feet_not_held": "repair.largest_drift says up to which drift contacts are held; those that "
    "drift farther make a step, or roll, which needs another motion",
    "discontinuity": "the clip may be cut there",
    "downward_normal": "the contacts of the robot's file may be turned",
}

# Joints that are no farther beyond their limits need no word [rad], [m].
_NEAR_LIMITS = 1e-3

#: What is told of contacts, before and after: as in RepairedFeet, what it is called, unit.
FEET = {
    "speed": ("Contacts slide by up to", "m/s"),
    "drift": ("Contacts drift by up to", "m"),
    "sunk": ("Contacts are below the ground by up to", "m"),
    "floating": ("Contacts that carry are above it by up to", "m"),
}

#: Changes of the motion: key in the summary, what it is called, unit.
CHANGES = (
    ("root", "Root displaced", "m"),
    ("com", "Centre of mass displaced", "m"),
    ("turn", "Root turned", "rad"),
    ("joints", "Joints turned", "rad"),
)


def repair_summary(robot: Robot, repair: MotionRepair) -> dict[str, Any]:
    """The entry, see docs/repair.md, but for the file that the motion is written to."""
    before, after = repair.before, repair.after
    rungs = [_rung(step, before) for step in repair.steps]
    found = {"outcome": repair.outcome}
    for ending, examination in (("_before", before), ("", after), ("_filtered", repair.filtered)):
        found[f"verdict{ending}"] = examination.verdict.outcome
        found[f"codes{ending}"] = examination.verdict.codes
    return found | {
        "missing_before": _missing(before, repair.missing_before),
        "missing": _missing(after, repair.missing),
        "stretch": repair.stretch,
        "ground_offset": repair.ground_offset,
        "ground_tilt": repair.ground_tilt,
        "root": _change(repair, repair.root),
        "turn": _change(repair, repair.turn),
        "joints": _change(repair, repair.joints) | {"joint": repair.joints.joint or None},
        "com": _change(repair, repair.com),
        "stances": _stances(robot, repair),
        "limits": {"before": repair.joint_excess_before, "after": repair.joint_excess},
        "rungs": rungs,
        "reasons": [
            {
                "code": reason.code,
                "time": reason.time,
                "text": reason.text,
                "hint": _hint(reason, repair),
            }
            for reason in repair.reasons
        ],
    }


def _hint(reason: RepairReason, repair: MotionRepair) -> str | None:
    """What may help, if anything is known to."""
    if reason.code != "joint_limits":
        return _HINTS.get(reason.code)
    if "joints" not in [step.rung for step in repair.steps]:
        return "nobody asked for limits: without --balance-only, with repair.joints, they count"
    if repair.joint_excess <= repair.joint_excess_before + _NEAR_LIMITS:
        return "the joints may be in another order than the file's: see the notes"
    return None


def _missing(found: MotionExamination, frames: int) -> dict[str, Any]:
    return {
        "force_rms": found.statistics.residual_force_rms,
        "torque_rms": found.statistics.residual_torque_rms,
        "frames": frames,
    }


def _change(repair: MotionRepair, change: RepairChange) -> dict[str, Any]:
    time = float(repair.recorded.time[change.frame])
    return {"rms": change.rms, "largest": change.largest, "frame": change.frame, "time": time}


def left_notes(repair: Mapping[str, Any]) -> Iterator[str]:
    """What is to be said of a motion that was left as it was, though joints are beyond limits.

    Args:
        repair: the entry.
    """
    excess = repair["limits"]["after"]
    if repair["outcome"] == "feasible" and excess > _NEAR_LIMITS:
        yield (
            f"A joint is beyond its limits by up to {np.degrees(excess):.1f}°. The verdict does "
            "not look at that: the motion is feasible, and was left as it is."
        )


# Stances.


def _stances(robot: Robot, repair: MotionRepair) -> dict[str, Any]:
    """Those of the last step, of the robot's contacts, and how these stand."""
    stances = [stance for stance in repair.stances if stance.contact < len(robot.contacts)]
    found = {"count": len(stances), "held": sum(stance.is_still for stance in stances)}
    for ending, feet in (("_before", repair.feet_before), ("", repair.feet)):
        found |= {f"largest_{name}{ending}": getattr(feet, name) for name in FEET}
    return found


# Steps.


def _rung(step: RepairStep, before: MotionExamination) -> dict[str, Any]:
    return {
        "name": step.rung,
        "before": step.before,
        "after": step.after,
        "kept": step.is_kept,
        "text": " ".join(_rung_texts(step, before)),
    }


def _rung_texts(step: RepairStep, before: MotionExamination) -> Iterator[str]:
    """What a step did, and what it gained."""
    if step.rung == "ground":
        yield (
            f"All of it was lifted by {-1e3 * step.before:.0f} mm, to the height that the ground "
            "is told to have."
        )
    elif step.rung == "filter":
        yield (
            f"The motion was filtered at {before.derived.cutoff:g} Hz, which moved the root by "
            f"{_millimetres(step.after)} (RMS)."
        )
    elif step.rung == "schedule":
        yield (
            "Contacts were found anew, as in an exact motion: the distance to a feasible one is "
            f"{_millimetres(step.after)} with these, and was {_millimetres(step.before)}."
        )
    elif step.rung == "balance":
        yield (
            f"Wrenches were to be brought within reach: {step.after:.0f} frames are out of reach, "
            f"and {step.before:.0f} were before."
        )
    elif step.rung == "feet":
        yield (
            "Contacts were to stand still, or slide slowly, level with their ground: they slide by "
            f"up to {1e3 * step.after:.0f} mm/s, and by {1e3 * step.before:.0f} mm/s before."
        )
    elif step.rung == "joints":
        yield (
            "Joints were to keep within their limits: one is up to "
            f"{np.degrees(step.after):.1f}° beyond, and was {np.degrees(step.before):.1f}° before."
        )
    else:
        yield f"Time was stretched by a factor of {step.after:g}."
    if not step.is_kept:
        yield (
            "That does not count, since something else is worse then, or too much would have to be "
            "changed: the motion stays as it was before this step."
        )


def _millimetres(value: float) -> str:
    return "not known" if np.isnan(value) else f"{1e3 * value:.{1 if value < 0.01 else 0}f} mm"


# What it says, for those who show it.


def compared_values(repair: Mapping[str, Any]) -> Iterator[tuple[str, str, Any, Any]]:
    """What there was before and is after.

    Args:
        repair: the entry, anything of which may be unknown.

    Yields:
        What it is called, its unit, and both values, None where they are not known. Frames are
        counts, their unit is ``frames``.
    """
    before, after, stances, limits = (
        repair.get(name) or {} for name in ("missing_before", "missing", "stances", "limits")
    )
    for title, key, unit in (
        ("Residual force (RMS)", "force_rms", "m g"),
        ("Residual moment (RMS)", "torque_rms", "m g m"),
        ("Frames out of reach", "frames", "frames"),
    ):
        yield title, unit, before.get(key), after.get(key)
    for name, (title, unit) in FEET.items():
        yield title, unit, stances.get(f"largest_{name}_before"), stances.get(f"largest_{name}")
    if any(limits.values()):
        yield "Joints beyond limits by", "rad", limits.get("before"), limits.get("after")


def moves(repair: Mapping[str, Any]) -> Iterator[tuple[str, str, float]]:
    """What was done to all of the motion, besides its changes.

    Args:
        repair: the entry, anything of which may be unknown.

    Yields:
        What it is called, the unit of by how much, and that.
    """
    for key, title, unit, nothing in (
        ("ground_offset", "Lifted to the ground", "m", 0.0),
        ("ground_tilt", "Turned to the ground", "rad", 0.0),
        ("stretch", "Time stretched", "", 1.0),
    ):
        value = repair.get(key)
        if value is not None and value != nothing:
            yield title, unit, value
