# SPDX-License-Identifier: BSD-2-Clause
"""What tools for retargeting keep beside a motion, although it follows from it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynacom.motion_bodies import axis_vectors, carry_points
from dynacom.motion_change import Change

# Up to this [rad] what a file has is what it is taken for.
_ALIKE = 1e-3
# The same of velocities, as a share.
_SAME_VELOCITY = 0.1


@dataclass(frozen=True)
class Joints:
    """The joints of a file, all of which may not be the robot's."""

    #: Of k joints of the robot, among n.
    names: Sequence[str]
    columns: Sequence[int]
    #: (F, n), before and after.
    before: np.ndarray
    after: np.ndarray

    @property
    def are_known(self) -> bool:
        """Whether they are all the robot's."""
        return len(self.columns) == self.before.shape[1]


def derived(
    key: str, change: Change, clip: Mapping[str, Any], joints: Joints, velocity: np.ndarray
) -> np.ndarray | None:
    """What is under a key of :data:`DERIVED` after a change, None if that cannot be told.

    It can where it is known how the numbers before come from the motion before.

    Args:
        clip: what is in the file, before.
        velocity: after, (F, nv).
    """
    compute = DERIVED[key]
    if compute is None:
        return None
    try:
        old = np.asarray(clip[key], dtype=float)
    except (TypeError, ValueError):
        return None
    if len(old.shape) < 2 or len(old) != len(change.rows) or not np.isfinite(old).all():
        return None
    return compute(old, change, clip, joints, velocity)


def _local_positions(
    old: np.ndarray, change: Change, clip: Mapping[str, Any], *_: object
) -> np.ndarray | None:
    """Of the links that ``link_body_list`` names, in the root's frame."""
    names = clip.get("link_body_list")
    if not isinstance(names, list | tuple | np.ndarray) or old.shape[1:] != (len(names), 3):
        return None
    in_root = [np.array(q) for q in (change.before, change.q)]
    for q in in_root:
        q[:, :7] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0
    return carry_points(change.clip.robot, *in_root, old, [str(name) for name in names])


def _axis_angles(
    old: np.ndarray, change: Change, clip: Mapping[str, Any], joints: Joints, *_: object
) -> np.ndarray | None:
    """Rotations as vectors: of the root, of each joint, and perhaps others."""
    count = joints.before.shape[1]
    if not joints.are_known or old.ndim != 3 or old.shape[1] <= count or old.shape[2] != 3:
        return None
    of_joints = [
        axis_vectors(change.clip.robot, joints.names, angles)
        for angles in (joints.before, joints.after)
    ]
    of_root = [_vectors(q[:, 3:7], old[:, 0]) for q in (change.before, change.q)]
    if of_joints[0] is None:
        return None
    before, after = (
        np.concatenate([root[:, None], others], axis=1)
        for root, others in zip(of_root, of_joints, strict=True)
    )
    if not np.abs(old[:, : count + 1] - before).max() <= _ALIKE:
        return None
    return np.concatenate([after, old[:, count + 1 :]], axis=1)


def _vectors(quaternion: np.ndarray, old: np.ndarray) -> np.ndarray:
    """Rotations as vectors (T, 3), by the angle that is close to old ones."""
    norm = np.linalg.norm(quaternion[:, :3], axis=1)
    angle = 2.0 * np.arctan2(norm, quaternion[:, 3])
    axis = quaternion[:, :3] / np.where(norm > 0.0, norm, 1.0)[:, None]
    turns = np.rint((np.einsum("ti,ti->t", axis, old) - angle) / (2.0 * np.pi))
    return (angle + 2.0 * np.pi * turns)[:, None] * axis


def _joint_velocities(
    old: np.ndarray,
    change: Change,
    clip: Mapping[str, Any],
    joints: Joints,
    velocity: np.ndarray,
) -> np.ndarray | None:
    """Of all joints, in their order."""
    if not joints.are_known or old.size != joints.before.size:
        return None
    model = change.model
    columns = [model.joints[model.getJointId(name)].idx_v for name in joints.names]
    before = change.derivatives(change.clip.q, before=True).v[change.rows][:, columns]
    error = np.sqrt(np.mean((old.reshape(before.shape) - before) ** 2))
    if not error <= _SAME_VELOCITY * np.sqrt(np.mean(before**2)):
        return None
    return velocity[:, columns]


#: The keys, and what computes what is there; None where nobody can say in which axes it is.
DERIVED: dict[str, Callable[..., np.ndarray | None] | None] = {
    "local_body_pos": _local_positions,
    "pose_aa": _axis_angles,
    "dof_vel": _joint_velocities,
    "joint_vel": _joint_velocities,
    **dict.fromkeys(
        (
            "root_vel",
            "root_lin_vel",
            "root_ang_vel",
            "local_body_rot",
            "body_pos",
            "body_rot",
            "body_pos_w",
            "body_quat_w",
            "body_lin_vel_w",
            "body_ang_vel_w",
            "global_translation",
            "global_rotation",
            "global_velocity",
            "global_angular_velocity",
            "dof_acc",
        )
    ),
}
