# SPDX-License-Identifier: BSD-2-Clause
"""Reports to show: the arrays and the summary that an analysis of a motion comes to."""

from collections import Counter
from typing import Any

import numpy as np
import pinocchio as pin

import dynacom
from dynacom import Contact6DSettings, ContactSchedule, Motion
from dynacom.robots import Robot
from helpers import WALKS

Arrays = dict[str, np.ndarray]
Summary = dict[str, Any]

CODES = {
    "residual_force": ("the contacts cannot give the force", "m g", 0.1),
    "residual_torque": ("the contacts cannot give the moment", "m g·m", 0.05),
    "cop_outside": ("the centre of pressure is needed outside", "m", 0.02),
    "flight_with_support_needed": ("no contact is active, and a wrench is needed", "m g", 0.05),
    "ground_penetration": ("a contact is below the ground", "m", 0.02),
    "foot_sliding": ("an active contact slides", "m/s", 0.2),
    "discontinuity": ("the motion jumps", "of the greatest speed", 1.0),
}


def walk_report(robot: Robot, **changes: np.ndarray) -> tuple[np.ndarray, Arrays, Summary]:
    """The configurations of Talos' bundled walk, the arrays and the summary of its report.

    Args:
        changes: arrays of the file, to be replaced.
    """
    with np.load(WALKS / "talos_walk.npz") as file:
        walk = {name: file[name] for name in file.files} | changes
    names = walk["contact_names"].tolist()
    motion = Motion(*(walk[name] for name in ("t", "q", "v", "a")))
    arrays, summary = report(robot, motion, ContactSchedule(names, walk["contacts"]))
    for number, name in enumerate(names):
        arrays[f"contact.{name}.measured_force"] = walk["contact_wrenches"][:, number, :3]
        arrays[f"contact.{name}.measured_torque"] = walk["contact_wrenches"][:, number, 3:]
        summary["measured"][name] = {
            "bias": [0.1, -0.2, 1.5, 0.01, 0.02, 0.0],
            "rms": [2.1, 3.2, 11.5, 0.4, 0.5, 0.1],
            "correlation": [0.98, 0.97, 0.999, 0.95, 0.96, None],
        }
    return walk["q"], arrays, summary


def report(robot: Robot, motion: Motion, schedule: ContactSchedule) -> tuple[Arrays, Summary]:
    """The arrays and the summary of a motion's report, which are as those of a real one."""
    dynamics = robot.dynacom()
    analysis = dynacom.analyzeMotion(dynamics, motion, schedule)
    weight = 9.81 * dynamics.getMass()
    names = ("com", "vcom", "acom", "am", "dam", "ground_force", "ground_torque", "cop", "vrp")
    arrays = {name: getattr(analysis, name) for name in ("time", *names, "nl", "residual")}
    arrays["status"] = np.array([status.name for status in analysis.status])
    displacement = _find_displacement(dynamics, motion, schedule)
    arrays["distance"] = np.linalg.norm(displacement, axis=1)
    arrays["feasible_com"] = analysis.com + displacement
    arrays["dcm"] = arrays["com"][:, :2] + arrays["vcom"][:, :2] / analysis.omega

    poses = {name: [] for name in robot.contacts}
    for q in motion.q:
        dynamics.computeDynamics(q, np.zeros(robot.model.nv), np.zeros(robot.model.nv))
        for name, placed in poses.items():
            placed.append(dynamics.getContact(name).getSurfacePose().copy())
    for contact in analysis.contacts:
        settings = robot.contacts[contact.name]
        arrays |= {
            f"contact.{contact.name}.{name}": array
            for name, array in _contact_arrays(contact, settings, poses[contact.name]).items()
        }
    return arrays, _summary(robot, arrays, weight, analysis.omega)


def _find_displacement(
    robot: dynacom.DynaCoM, motion: Motion, schedule: ContactSchedule
) -> np.ndarray:
    """Of the CoM to the closest feasible motion, where soles carry with all their corners."""
    split = dynacom.splitContacts(robot)
    none = ContactSchedule([], np.zeros((len(motion.time), 0), dtype=bool))
    active = {name: np.asarray(schedule.active)[:, k] for k, name in enumerate(schedule.names)}
    parts = ContactSchedule(
        [part.name for part in split.parts],
        np.column_stack([active[part.name.partition(".")[0]] for part in split.parts]),
    )
    return dynacom.distanceToFeasible(
        split,
        dynacom.computeContactMotions(split.robot, motion),
        dynacom.analyzeMotion(split.robot, motion, none),
        parts,
    ).com


def _contact_arrays(contact: Any, settings: Any, poses: list[pin.SE3]) -> Arrays:
    force, torque = contact.wrench[:, :3], contact.wrench[:, 3:]
    loaded = force[:, 2] > 1.0
    normal = np.where(loaded, force[:, 2], np.nan)
    cop = np.stack([-torque[:, 1] / normal, torque[:, 0] / normal], axis=1)
    is_sole = isinstance(settings, Contact6DSettings)
    position = np.array([pose.translation for pose in poses])
    half = [settings.half_length, settings.half_width] if is_sole else [0.0, 0.0]
    return {
        "active": np.asarray(contact.active, dtype=bool),
        "confidence": np.asarray(contact.active, dtype=float),
        "force": force,
        "torque": torque,
        "cop": cop,
        "friction_usage": np.abs(force[:, :2]).max(axis=1) / (settings.mu * normal),
        "cone_usage": np.linalg.norm(force[:, :2], axis=1) / (settings.mu * normal),
        "yaw_usage": np.abs(torque[:, 2]) / (settings.gu * normal) if is_sole else normal * np.nan,
        "cop_margin": (half - np.abs(cop)).min(axis=1) if is_sole else normal * np.nan,
        "position": position,
        "rotation": np.array([pin.Quaternion(pose.rotation).coeffs() for pose in poses]),
        "height": position[:, 2],
        "speed": np.zeros(len(position)),
    }


def _verdict(arrays: Arrays, reasons: list[dict[str, Any]]) -> str:
    distance = arrays["distance"]
    if not any(reason["holds"] for reason in reasons):
        return "feasible"
    is_near = np.sqrt(np.mean(distance**2)) <= 0.01 and distance.max() <= 0.05
    return "repairable" if is_near else "not feasible"


def _summary(robot: Robot, arrays: Arrays, weight: float, omega: float) -> Summary:
    time = arrays["time"]
    force = np.linalg.norm(arrays["residual"][:, :3], axis=1) / weight
    torque = np.linalg.norm(arrays["residual"][:, 3:], axis=1) / weight
    values = {"residual_force": force, "residual_torque": torque}
    reasons = []
    for code, (text, unit, threshold) in CODES.items():
        value = values.get(code, np.zeros(len(time)))
        frames = int(np.count_nonzero(value > threshold))
        worst = int(np.argmax(value))
        reasons.append(
            {
                "code": code,
                "holds": frames > 0.05 * len(time),
                "frames": frames,
                "share": frames / len(time),
                "worst": float(value[worst]),
                "unit": unit,
                "time": float(time[worst]),
                "threshold": threshold,
                "allowed_share": 0.05,
                "text": text,
            }
        )
    contacts = {
        name: {
            "active_share": float(arrays[f"contact.{name}.active"].mean()),
            "weight_share": float(arrays[f"contact.{name}.force"][:, 2].mean() / weight),
            "largest_vertical_force": float(arrays[f"contact.{name}.force"][:, 2].max() / weight),
        }
        for name in robot.contacts
    }
    return {
        "clip": "clip.npz",
        "robot": robot.name,
        "mass": weight / 9.81,
        "frames": len(time),
        "duration": float(time[-1] - time[0]),
        "frame_rate": (len(time) - 1) / float(time[-1] - time[0]),
        "omega": omega,
        "verdict": _verdict(arrays, reasons),
        "distance": {
            "rms": float(np.sqrt(np.mean(arrays["distance"] ** 2))),
            "largest": float(arrays["distance"].max()),
            "time": float(time[np.argmax(arrays["distance"])]),
            "converged": True,
        },
        "reasons": reasons,
        "feasible_share": 0.75,
        "windows": [[float(time[0]), float(time[len(time) // 4])], [0.5 * time[-1], time[-1]]],
        "statuses": dict(Counter(arrays["status"].tolist())),
        "notes": ["The file's own velocities and accelerations are used."],
        "derivatives": "recomputed: Butterworth, 4th order, forward and backward, 6 Hz",
        "cutoff": 6.0,
        "cutoff_sensitivity": [
            {
                "cutoff": cutoff,
                "residual_force_rms": factor * float(np.sqrt(np.mean(force**2))),
                "residual_torque_rms": factor * float(np.sqrt(np.mean(torque**2))),
                "relaxed_share": float(np.mean(arrays["status"] == "Relaxed")),
            }
            for cutoff, factor in ((3.0, 0.5), (6.0, 1.0), (12.0, 2.5))
        ],
        "ground": {name: 0.0 for name in robot.contacts},
        "contacts": contacts,
        "bodies": {},
        "mean_vertical_force": float(arrays["ground_force"][:, 2].mean() / weight),
        "measured": {},
    }
