# SPDX-License-Identifier: BSD-2-Clause
"""Motions from and into the archives of whole_body_tracking: joints, and the poses of bodies."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from dynacom.errors import DynacomError
from dynacom.motion_arrays import Arrays
from dynacom.motion_bodies import (
    BodySample,
    carry_bodies,
    check_bodies,
    find_order,
    root_link,
    sample_bodies,
)
from dynacom.motion_change import Change, aligned
from dynacom.motion_checks import (
    QUATERNION_ERROR,
    check_angles,
    from_xyzw,
    make_time,
    normalize,
    to_xyzw,
)
from dynacom.motion_clip import Clip, Options, clip_from_joints
from dynacom.motion_joints import (
    brief,
    configurations,
    joint_counts,
    match_joints,
    order_without_names,
    rotations,
)
from dynacom.robots import Robot

_POSES = ("body_pos_w", "body_quat_w")
_VELOCITIES = ("body_lin_vel_w", "body_ang_vel_w")
# Bodies' velocities were others than those of their origins if they differ by such a share.
_OTHER_VELOCITY = 0.1


def read_tracking(path: Path, robot: Robot, arrays: Arrays, options: Options) -> Clip:
    """The layout of whole_body_tracking: joint_pos, body_pos_w, body_quat_w, fps, and names.

    joint_pos may hold the root's pose too, before the joints.

    Raises:
        DynacomError: as :func:`read_motion`.
    """
    frames = len(arrays.numbers("joint_pos", "T", "n"))
    file_fps = arrays.number("fps") if "fps" in arrays else None
    time, notes = make_time(path, frames, file_fps=file_fps, fps=options.fps)
    layout = _find_layout(path, robot, arrays, options)
    return clip_from_joints(
        path,
        robot,
        time,
        layout.position,
        layout.quaternion,
        layout.names,
        layout.angles,
        options,
        order=layout.order,
        option=True,
        notes=[*notes, *layout.notes],
        v=_read_velocities(path, robot, arrays, layout),
        exact=arrays.is_exact(),
    )


def changed_tracking(change: Change, arrays: Arrays) -> dict[str, np.ndarray | None]:
    """What a change makes of the arrays: those that are others then; None is left out.

    Raises:
        DynacomError: the file is not the one that was read.
    """
    if not change.moves:
        return {}
    clip, robot, notes = change.clip, change.clip.robot, change.notes
    layout = _find_layout(clip.path, robot, arrays, clip.options)
    position, quaternion = change.position(layout.position), change.quaternion(layout.quaternion)
    root = np.hstack([position, from_xyzw(quaternion, layout.order)])
    joint_pos = arrays.numbers("joint_pos", "T", "n").copy()
    if layout.with_root:
        joint_pos[:, :7] = root
    columns = layout.joint_pos_columns
    joint_pos[:, columns] = change.angles(layout.names, layout.angles)
    changes: dict[str, np.ndarray | None] = {
        "joint_pos": arrays.cast("joint_pos", joint_pos, notes)
    }
    old_rate = arrays.number("fps") if "fps" in arrays else None
    if (rate := change.frame_rate(old_rate)) != old_rate:
        changes["fps"] = arrays.cast("fps", arrays.filled("fps", rate), notes)
    joint_pos = changes["joint_pos"].astype(float)
    if layout.bodies:
        changes |= _changed_bodies(change, arrays, layout, position, quaternion)
    if layout.with_root:
        root = joint_pos[:, :7]
    else:
        root = np.hstack([changes[name][:, layout.bodies.root] for name in _POSES]).astype(float)
    largest = max(np.abs(root).max(), np.abs(joint_pos).max())
    change.note_rounding(float(np.spacing(largest.astype(changes["joint_pos"].dtype))))
    if "joint_vel" in arrays:
        q = configurations(
            robot,
            root[:, :3],
            to_xyzw(root[:, 3:], layout.order),
            layout.names,
            joint_pos[:, columns],
        )
        q = change.as_read(q)
        v = change.derivatives(q).v[change.rows]
        joint_vel = arrays.numbers("joint_vel", len(v), "n").copy()
        extra = joint_vel.shape[1] - layout.count
        joint_vel[:, extra + np.array(layout.columns, dtype=int)] = v[
            :, _velocity_columns(robot, layout.names)
        ]
        if extra:
            joint_vel[:, :6] = _in_world(q[change.rows, 3:7], v[:, :6])
        changes["joint_vel"] = arrays.cast("joint_vel", joint_vel, notes)
    return changes


def _changed_bodies(
    change: Change,
    arrays: Arrays,
    layout: "_Layout",
    position: np.ndarray,
    quaternion: np.ndarray,
) -> dict[str, np.ndarray | None]:
    """Poses and velocities of the bodies, where the root is there: (F, 3) and (F, 4), x y z w."""
    bodies, notes = layout.bodies, change.notes
    names = bodies.names
    pose, others = carry_bodies(
        change.clip.robot, change.before, change.q, bodies.position, bodies.quaternion, names
    )
    if others and names is None and layout.with_root:
        notes.append(
            f"The bodies are left out: {len(others)} of {bodies.position.shape[1]} move with none "
            "of the robot's links, and nobody knows which they are."
        )
        return dict.fromkeys((*_POSES, *_VELOCITIES))
    if others:
        which = [names[body] if names else str(body) for body in others]
        notes.append(
            f"Bodies that move with none of the robot's links stay as they were: {brief(which)}."
        )
    if not layout.with_root:
        pose[:, bodies.root] = np.hstack([position, quaternion])
    unit = aligned(pose[..., 3:], bodies.quaternion)
    changes = {
        "body_pos_w": arrays.cast("body_pos_w", pose[..., :3], notes),
        "body_quat_w": arrays.cast("body_quat_w", from_xyzw(unit, layout.order), notes),
    }
    if not any(name in arrays for name in _VELOCITIES):
        return changes
    written = [changes[name].astype(float) for name in _POSES]
    written = np.dstack([written[0], to_xyzw(written[1], layout.order)])
    moved = [body for body in range(len(written[0])) if body not in others]
    velocity = _body_velocities(change, written[:, moved])
    was = np.dstack([bodies.position, bodies.quaternion])[:, moved]
    before = _body_velocities(change, was, before=True)
    for name, part in zip(_VELOCITIES, (slice(0, 3), slice(3, 6)), strict=True):
        if name in arrays:
            values = arrays.numbers(name, *bodies.position.shape).copy()
            error = np.sqrt(np.mean((values[:, moved] - before[..., part]) ** 2))
            if not error <= _OTHER_VELOCITY * np.sqrt(np.mean(before[..., part] ** 2)):
                notes.append(
                    f"What was in {name} was not the velocity of the bodies' frames, as it is now."
                )
            values[:, moved] = velocity[..., part]
            changes[name] = arrays.cast(name, values, notes)
    return changes


def _body_velocities(change: Change, pose: np.ndarray, *, before: bool = False) -> np.ndarray:
    """Linear and angular, in the world's axes, (F, B, 6), of poses (F, B, 7).

    Args:
        before: whether at the pace that the clip had.
    """
    model = pin.Model()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    velocity = np.empty((*pose.shape[:2], 6))
    for body in range(pose.shape[1]):
        q = change.as_read(pose[:, body], model)
        v = change.derivatives(q, model, before=before).v[change.rows]
        velocity[:, body] = _in_world(q[change.rows, 3:], v)
    return velocity


@dataclass(frozen=True)
class _Layout:
    """What is where."""

    #: Of the root, (T, 3) and (T, 4), x y z w, as in the file.
    position: np.ndarray
    quaternion: np.ndarray
    #: Of the quaternions in the file.
    order: str
    #: Whether joint_pos holds the root's pose.
    with_root: bool
    #: How many joints the file has, of which some are not the robot's.
    count: int
    #: The robot's joints, which of the file's they are, and their angles, (T, k).
    names: Sequence[str]
    columns: Sequence[int]
    angles: np.ndarray
    bodies: "_Bodies | None"
    notes: Sequence[str]

    @property
    def joint_pos_columns(self) -> np.ndarray:
        """Where the angles are in joint_pos."""
        return np.array(self.columns, dtype=int) + (7 if self.with_root else 0)


def _find_layout(path: Path, robot: Robot, arrays: Arrays, options: Options) -> _Layout:
    joint_pos = arrays.numbers("joint_pos", "T", "n")
    frames, width = joint_pos.shape
    order = options.quat or "wxyz"
    names = arrays.texts("joint_names") if "joint_names" in arrays else None
    counts = joint_counts(robot) if names is None else {len(names)}
    with_root = width not in counts and width - 7 in counts
    angles = joint_pos[:, 7:] if with_root else joint_pos
    if names is not None and len(names) != angles.shape[1]:
        raise DynacomError(
            f"{path}: joint_names must name the {width} columns of joint_pos, or all but the "
            f"root's 7, got {len(names)}"
        )

    bodies = None
    if "body_pos_w" in arrays or not with_root:
        bodies = _read_bodies(path, robot, arrays, frames, order)
    if with_root:
        position, quaternion = joint_pos[:, :3], to_xyzw(joint_pos[:, 3:7], order)
    else:
        position, quaternion = bodies.position[:, bodies.root], bodies.quaternion[:, bodies.root]
    unit, _, _ = normalize(path, quaternion, order, True, options.quat is not None)
    root = np.hstack([position, unit])

    count = angles.shape[1]
    columns = list(range(count))
    notes: list[str] = []
    if names is not None:
        columns, notes = match_joints(path, robot, names)
        names, angles = [names[column] for column in columns], angles[:, columns]
        if bodies:
            check_angles(path, robot, names, angles)
            notes += check_bodies(path, robot, names, angles, bodies.sample(root))
    else:
        names, notes = (
            find_order(path, robot, angles, bodies.sample(root))
            if bodies
            else order_without_names(path, robot, count)
        )
    return _Layout(
        position, quaternion, order, with_root, count, names, columns, angles, bodies, notes
    )


@dataclass(frozen=True)
class _Bodies:
    """body_pos_w (T, B, 3), body_quat_w (T, B, 4) as x y z w, and body_names, if there."""

    position: np.ndarray
    quaternion: np.ndarray
    names: tuple[str, ...] | None
    #: Index of the body that the free-flyer moves.
    root: int

    def sample(self, root: np.ndarray) -> BodySample:
        return sample_bodies(self.position, self.quaternion, root, self.names)


def _read_bodies(path: Path, robot: Robot, arrays: Arrays, frames: int, order: str) -> _Bodies:
    position = arrays.numbers("body_pos_w", frames, "B", 3)
    count = position.shape[1]
    if count == 0:
        raise DynacomError(f"{path}: body_pos_w must have at least one body, got none")
    quaternion = to_xyzw(arrays.numbers("body_quat_w", frames, count, 4), order)
    norm = np.linalg.norm(quaternion, axis=-1)
    error = np.abs(norm - 1.0)
    if not error.max() <= QUATERNION_ERROR:
        frame, body = np.unravel_index(np.argmax(error), error.shape)
        raise DynacomError(
            f"{path}: body_quat_w must have norm 1, got {norm[frame, body]:.4g} in frame {frame} "
            f"of body {body}"
        )
    names = arrays.texts("body_names", count) if "body_names" in arrays else None
    base = root_link(robot)
    return _Bodies(position, quaternion, names, names.index(base) if base in (names or ()) else 0)


def _read_velocities(
    path: Path, robot: Robot, arrays: Arrays, layout: _Layout
) -> np.ndarray | None:
    """Velocities (T, nv), if there.

    Those of the joints are in joint_vel. Those of the root, linear and angular, in the world's
    axes, are before them, or are those of its body in body_lin_vel_w and body_ang_vel_w.
    """
    if "joint_vel" not in arrays:
        return None
    frames, count, bodies = len(layout.position), layout.count, layout.bodies
    joint_vel = arrays.numbers("joint_vel", frames, "n")
    if joint_vel.shape[1] == 6 + count:
        root, joint_vel = np.split(joint_vel, [6], axis=1)
    elif joint_vel.shape[1] != count:
        raise DynacomError(
            f"{path}: joint_vel must have {count} or 6 + {count} columns, got {joint_vel.shape[1]}"
        )
    elif bodies and all(name in arrays for name in _VELOCITIES):
        shape = bodies.position.shape
        root = np.hstack([arrays.numbers(name, *shape)[:, bodies.root] for name in _VELOCITIES])
    else:
        return None
    v = np.zeros((frames, robot.model.nv))
    unit, _, _ = normalize(path, layout.quaternion)
    v[:, :6] = _turned(np.swapaxes(rotations(unit), 1, 2), root)
    v[:, _velocity_columns(robot, layout.names)] = joint_vel[:, layout.columns]
    return v


def _velocity_columns(robot: Robot, names: Sequence[str]) -> list[int]:
    """Where the joints' velocities are in v."""
    model = robot.model
    return [model.joints[model.getJointId(name)].idx_v for name in names]


def _in_world(quaternion: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Velocities (T, 6) in the axes of a body, which has these quaternions, in the world's."""
    return _turned(rotations(quaternion), velocity)


def _turned(rotation: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Linear and angular velocities, (T, 6), in other axes."""
    pairs = velocity.reshape(-1, 2, 3)
    return np.einsum("tij,tkj->tki", rotation, pairs).reshape(-1, 6)
