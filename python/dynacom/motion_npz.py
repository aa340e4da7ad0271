# SPDX-License-Identifier: BSD-2-Clause
"""Motions from NumPy archives: plain ones, and those of whole_body_tracking."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from dynacom.errors import DynacomError
from dynacom.motion_bodies import (
    BodySample,
    check_bodies,
    find_order,
    root_link,
    sample_bodies,
)
from dynacom.motion_checks import (
    QUATERNION_ERROR,
    check_angles,
    check_finite,
    make_time,
    normalize,
    to_xyzw,
)
from dynacom.motion_clip import (
    Clip,
    Options,
    check_contacts,
    clip_from_configurations,
    clip_from_joints,
    is_point,
    schedule_from_masks,
)
from dynacom.motion_joints import (
    joint_counts,
    match_joints,
    order_without_names,
    rotations,
)
from dynacom.robots import Robot


def read_npz(path: Path, robot: Robot, options: Options) -> Clip:
    """Reads .npz.

    Raises:
        DynacomError: as :func:`read_motion`.
        OSError: the file cannot be read.
    """
    with path.open("rb") as file:
        try:
            archive = np.load(file, allow_pickle=False)
        except Exception as error:  # NumPy promises no type for what is no archive, or a broken one
            raise DynacomError(
                f"{path}: must be a NumPy archive (.npz), got another file"
            ) from error
        if not isinstance(archive, np.lib.npyio.NpzFile):
            raise DynacomError(f"{path}: must be a NumPy archive (.npz), got a single array")
        with archive:
            arrays = _Arrays(path, archive)
            read = _read_tracking if "joint_pos" in archive else _read_plain
            return read(path, robot, arrays, options)


class _Arrays:
    """The archive's arrays, checked as they are taken."""

    def __init__(self, path: Path, archive: np.lib.npyio.NpzFile) -> None:
        self._path = path
        self._archive = archive

    def __contains__(self, name: str) -> bool:
        return name in self._archive

    def numbers(self, name: str, *shape: int | str) -> np.ndarray:
        """An array of finite numbers.

        Args:
            shape: sizes that it must have, or letters for those that it may choose.
        """
        array = self._take(name, "iuf", "real numbers").astype(float, copy=False)
        if array.ndim != len(shape) or any(
            isinstance(size, int) and got != size
            for size, got in zip(shape, array.shape, strict=True)
        ):
            raise DynacomError(
                f"{self._path}: {name} must have shape ({', '.join(map(str, shape))}"
                f"{',' if len(shape) == 1 else ''}), got {array.shape}"
            )
        check_finite(self._path, name, array)
        return array

    def number(self, name: str) -> float:
        """A single number, in an array of any shape."""
        array = self._take(name, "iuf", "real numbers")
        if array.size != 1:
            raise DynacomError(f"{self._path}: {name} must be one number, got shape {array.shape}")
        return float(array.item())

    def texts(self, name: str, count: int | None = None) -> tuple[str, ...]:
        """Texts: so many, or any number."""
        array = self._take(name, "U", "texts")
        if array.ndim != 1 or (count is not None and len(array) != count):
            raise DynacomError(
                f"{self._path}: {name} must have shape ({count or 'names'},), got {array.shape}"
            )
        return tuple(array.tolist())

    def masks(self, name: str, *shape: int) -> np.ndarray:
        """An array of bool, or of numbers from 0 to 1."""
        array = self._take(name, "biuf", "bool or numbers")
        if array.shape != shape:
            raise DynacomError(f"{self._path}: {name} must have shape {shape}, got {array.shape}")
        if not ((array >= 0) & (array <= 1)).all():
            check_finite(self._path, name, array)
            wrong = array[(array < 0) | (array > 1)]
            raise DynacomError(f"{self._path}: {name} must be from 0 to 1, got {wrong[0]:g}")
        return array

    def _take(self, name: str, kinds: str, expected: str) -> np.ndarray:
        if name not in self._archive:
            raise DynacomError(
                f"{self._path}: missing array '{name}', got "
                f"{', '.join(self._archive.files) or 'none'}"
            )
        try:
            array = np.asarray(self._archive[name])
        except Exception as error:  # as above
            raise DynacomError(f"{self._path}: {name} cannot be read ({error})") from error
        if array.dtype.kind not in kinds:
            raise DynacomError(f"{self._path}: {name} must be of {expected}, got {array.dtype}")
        return array


def _read_plain(path: Path, robot: Robot, arrays: _Arrays, options: Options) -> Clip:
    """t, q, perhaps v and a, contacts with contact_names, and contact_wrenches."""
    model = robot.model
    time = arrays.numbers("t", "T")
    frames = len(time)
    time, notes = make_time(path, frames, time=time, fps=options.fps)
    q = arrays.numbers("q", frames, "nq")
    if q.shape[1] != model.nq:
        raise DynacomError(
            f"{path}: q must have {model.nq} columns, nq of {robot.name}, got {q.shape[1]}"
        )
    v, a = (
        arrays.numbers(name, frames, model.nv) if name in arrays else None for name in ("v", "a")
    )
    if options.quat is not None:
        notes.append("The order in q is Pinocchio's: --quat is not used.")

    schedule, forces = None, {}
    if any(name in arrays for name in ("contacts", "contact_names", "contact_wrenches")):
        names = arrays.texts("contact_names")
        check_contacts(path, robot, names)
        schedule = schedule_from_masks(names, arrays.masks("contacts", frames, len(names)))
    if "contact_wrenches" in arrays:
        wrenches = arrays.numbers("contact_wrenches", frames, len(names), 6)
        framed = "contact_frames" in arrays
        contact_frames = arrays.texts("contact_frames", len(names)) if framed else None
        forces, more = _surface_forces(robot, q, names, contact_frames, wrenches)
        notes += more
    return clip_from_configurations(
        path,
        robot,
        time,
        q,
        names=robot.joints.names,
        order="xyzw",
        notes=notes,
        v=v,
        a=a,
        schedule=schedule,
        forces=forces,
    )


def _surface_forces(
    robot: Robot,
    q: np.ndarray,
    contacts: Sequence[str],
    frames: Sequence[str] | None,
    wrenches: np.ndarray,
) -> tuple[dict[str, np.ndarray], list[str]]:
    """Wrenches in frames of the file's choice, taken to the contacts' surfaces, and notes.

    Args:
        q: (T, nq), with quaternions of any norm.
        contacts: C names.
        frames: C names of frames, in and about whose origins the wrenches are; None for those of
            the contacts.
        wrenches: (T, C, 6), force first.
    """
    model = robot.model
    forces, notes = {}, []
    for index, contact in enumerate(contacts):
        settings = robot.contacts[contact]
        own = model.frames[model.getFrameId(settings.frame_name)]
        name = settings.frame_name if frames is None else frames[index]
        if not model.existFrame(name):
            notes.append(f"The forces of {contact} are left out: they are in '{name}', no frame.")
            continue
        other = model.frames[model.getFrameId(name)]
        if other.parentJoint != own.parentJoint:
            notes.append(
                f"The forces of {contact} are left out: they are in '{name}', which does not move "
                f"with the contact's frame."
            )
            continue
        placement = own.placement.actInv(other.placement)
        force = wrenches[:, index]
        if not placement.isIdentity(1e-12):
            force = force @ placement.toDualActionMatrix().T
        if is_point(robot, contact):
            force = force[:, :3]
            if settings.world_aligned:
                rotation = _frame_rotations(model, settings.frame_name, q)
                force = np.einsum("tij,tj->ti", rotation, force)
        forces[contact] = force
    return forces, notes


def _frame_rotations(model: pin.Model, frame: str, q: np.ndarray) -> np.ndarray:
    """(T, 3, 3), of a frame in the world."""
    data = model.createData()
    index = model.getFrameId(frame)
    rotation = np.empty((len(q), 3, 3))
    for row, configuration in enumerate(q):
        pin.forwardKinematics(model, data, pin.normalize(model, configuration))
        rotation[row] = pin.updateFramePlacement(model, data, index).rotation
    return rotation


def _read_tracking(path: Path, robot: Robot, arrays: _Arrays, options: Options) -> Clip:
    """The layout of whole_body_tracking: joint_pos, body_pos_w, body_quat_w, fps, and names.

    joint_pos may hold the root's pose too, before the joints.
    """
    joint_pos = arrays.numbers("joint_pos", "T", "n")
    frames, width = joint_pos.shape
    file_fps = arrays.number("fps") if "fps" in arrays else None
    time, notes = make_time(path, frames, file_fps=file_fps, fps=options.fps)
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
    believed = options.quat is not None
    unit, _, _ = normalize(path, quaternion, order, True, believed)
    root = np.hstack([position, unit])

    count = angles.shape[1]
    columns = list(range(count))
    if names is not None:
        columns, more = match_joints(path, robot, names)
        notes += more
        names, angles = [names[column] for column in columns], angles[:, columns]
        if bodies:
            check_angles(path, robot, names, angles)
            notes += check_bodies(path, robot, names, angles, bodies.sample(root))
    else:
        names, more = (
            find_order(path, robot, angles, bodies.sample(root))
            if bodies
            else order_without_names(path, robot, count)
        )
        notes += more
    return clip_from_joints(
        path,
        robot,
        time,
        position,
        quaternion,
        names,
        angles,
        order=order,
        option=True,
        believed=believed,
        notes=notes,
        v=_read_velocities(path, robot, arrays, names, columns, count, unit, bodies),
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


def _read_bodies(path: Path, robot: Robot, arrays: _Arrays, frames: int, order: str) -> _Bodies:
    position = arrays.numbers("body_pos_w", frames, "B", 3)
    count = position.shape[1]
    if count == 0:
        raise DynacomError(f"{path}: body_pos_w must have at least one body, got none")
    quaternion = to_xyzw(arrays.numbers("body_quat_w", frames, count, 4), order)
    norm = np.linalg.norm(quaternion, axis=-1)
    error = np.abs(norm - 1.0)
    if error.max() > QUATERNION_ERROR:
        frame, body = np.unravel_index(np.argmax(error), error.shape)
        raise DynacomError(
            f"{path}: body_quat_w must have norm 1, got {norm[frame, body]:.4g} in frame {frame} "
            f"of body {body}"
        )
    names = arrays.texts("body_names", count) if "body_names" in arrays else None
    base = root_link(robot)
    return _Bodies(position, quaternion, names, names.index(base) if base in (names or ()) else 0)


def _read_velocities(
    path: Path,
    robot: Robot,
    arrays: _Arrays,
    names: Sequence[str],
    columns: Sequence[int],
    count: int,
    quaternion: np.ndarray,
    bodies: _Bodies | None,
) -> np.ndarray | None:
    """Velocities (T, nv), if there.

    Those of the joints are in joint_vel. Those of the root, linear and angular, in the world's
    axes, are before them, or are those of its body in body_lin_vel_w and body_ang_vel_w.

    Args:
        names: of the joints in these columns, among so many joints.
        quaternion: of the root, (T, 4), x y z w, of norm 1.
    """
    if "joint_vel" not in arrays:
        return None
    frames = len(quaternion)
    joint_vel = arrays.numbers("joint_vel", frames, "n")
    if joint_vel.shape[1] == 6 + count:
        root, joint_vel = np.split(joint_vel, [6], axis=1)
    elif joint_vel.shape[1] != count:
        raise DynacomError(
            f"{path}: joint_vel must have {count} or 6 + {count} columns, got {joint_vel.shape[1]}"
        )
    elif bodies and "body_lin_vel_w" in arrays and "body_ang_vel_w" in arrays:
        shape = bodies.position.shape
        root = np.hstack(
            [
                arrays.numbers(name, *shape)[:, bodies.root]
                for name in ("body_lin_vel_w", "body_ang_vel_w")
            ]
        )
    else:
        return None
    v = np.zeros((frames, robot.model.nv))
    to_local = np.swapaxes(rotations(quaternion), 1, 2)
    v[:, :3] = np.einsum("tij,tj->ti", to_local, root[:, :3])
    v[:, 3:6] = np.einsum("tij,tj->ti", to_local, root[:, 3:])
    for name, values in zip(names, joint_vel[:, columns].T, strict=True):
        v[:, robot.model.joints[robot.model.getJointId(name)].idx_v] = values
    return v
