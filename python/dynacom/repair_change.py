# SPDX-License-Identifier: BSD-2-Clause
"""A motion as it was before repair, and by how much repair has changed it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from dynacom.robots import Robot


@dataclass(frozen=True, eq=False)
class Before:
    """A motion before repair, at the same frames as after it."""

    #: (T, nq), its configurations.
    q: np.ndarray
    #: Of its report: MotionReport.arrays.
    arrays: Mapping[str, np.ndarray]
    #: Of its report: MotionReport.summary.
    summary: Mapping[str, Any]

    def __post_init__(self) -> None:
        """Raises ValueError where the arrays have another number of frames."""
        frames = len(self.arrays["time"])
        if len(self.q) != frames:
            raise ValueError(f"Before.q must have {frames} frames as its arrays, got {len(self.q)}")


def change_arrays(robot: Robot, before: Before, q: np.ndarray) -> dict[str, np.ndarray]:
    """By how much configurations differ, frame by frame, by Pinocchio's ``difference``.

    Args:
        q: (T, nq), the configurations after repair.

    Returns:
        ``root``: (T,), how far the free-flyer is displaced [m]. ``joints``: (T,), the largest
        change of a joint that turns [rad]. ``joint``: (T,), the name of that joint. Of joints that
        slide nothing is told. A robot whose joints all slide has zeros, and no names.

    Raises:
        ValueError: the motions have other sizes.
    """
    model = robot.model
    for name, values in (("q", q), ("before.q", before.q)):
        if np.shape(values) != (len(q), model.nq):
            raise ValueError(
                f"{name} must have the shape ({len(q)}, {model.nq}), got {np.shape(values)}"
            )
    pairs = zip(before.q, q, strict=True)
    change = np.array([pin.difference(model, *pair) for pair in pairs]).reshape(-1, model.nv)
    names = np.array(robot.joints.names, dtype=str)[robot.joints.turns]
    columns = [model.idx_vs[model.getJointId(name)] for name in names]
    # A column more, of which nothing is larger: for robots whose joints all slide.
    turned = np.column_stack([np.abs(change[:, columns]), np.zeros(len(q))])
    which = turned.argmax(axis=1)
    return {
        "root": np.linalg.norm(change[:, :3], axis=1),
        "joints": turned.max(axis=1),
        "joint": np.append(names, "")[which],
    }


def com_change(before: Before, arrays: Mapping[str, np.ndarray]) -> np.ndarray:
    """(T,), how far the centre of mass is displaced [m].

    Args:
        arrays: of the report after repair.
    """
    return np.linalg.norm(arrays["com"] - before.arrays["com"], axis=1)
