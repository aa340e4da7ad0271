# SPDX-License-Identifier: BSD-2-Clause
"""Motions from and into NumPy archives; elsewhere, those of whole_body_tracking."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from dynacom.errors import DynacomError
from dynacom.motion_arrays import Arrays, open_archive, rewrite
from dynacom.motion_change import Change
from dynacom.motion_checks import make_time
from dynacom.motion_clip import (
    Clip,
    Options,
    check_contacts,
    clip_from_configurations,
    is_point,
    schedule_from_masks,
)
from dynacom.motion_tracking import changed_tracking, read_tracking
from dynacom.robots import Robot


def read_npz(path: Path, robot: Robot, options: Options) -> Clip:
    """Reads .npz.

    Raises:
        DynacomError: as :func:`read_motion`.
        OSError: the file cannot be read.
    """
    with open_archive(path) as arrays:
        read = read_tracking if _is_tracking(arrays) else _read_plain
        return read(path, robot, arrays, options)


def write_npz(change: Change) -> bytes:
    """The file with a change; numbers keep their types.

    Raises:
        DynacomError: as :func:`write_motion`.
        OSError: the file cannot be read.
    """
    path = change.clip.path
    with open_archive(path) as arrays:
        changes = (changed_tracking if _is_tracking(arrays) else _changed_plain)(change, arrays)
    return rewrite(path, changes, change.mark)


def _is_tracking(arrays: Arrays) -> bool:
    return "joint_pos" in arrays


def _read_plain(path: Path, robot: Robot, arrays: Arrays, options: Options) -> Clip:
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
        options,
        names=robot.joints.names,
        order="xyzw",
        notes=notes,
        v=v,
        a=a,
        schedule=schedule,
        forces=forces,
        exact=arrays.is_exact(),
    )


def _changed_plain(change: Change, arrays: Arrays) -> dict[str, np.ndarray | None]:
    """What a change makes of the arrays: those that are others then; None is left out."""
    frames = len(change.rows)
    changes: dict[str, np.ndarray | None] = {}
    old = arrays.numbers("q", frames, change.model.nq)
    if change.moves:
        root = [change.position(old[:, :3]), change.quaternion(old[:, 3:7])]
        new = np.hstack([*root, change.q[:, 7:]])
        changes["q"] = q = arrays.cast("q", new, change.notes)
        if change.stretch != 1.0:
            time = change.stretched(arrays.numbers("t", frames))
            changes["t"] = arrays.cast("t", time, change.notes)
        motion = change.derivatives(change.as_read(q.astype(float)))
        for name, values in (("v", motion.v), ("a", motion.a)):
            if name in arrays:
                changes[name] = arrays.cast(name, values[change.rows], change.notes)
        change.note_rounding(float(np.spacing(np.abs(q).max())))
    if "contact_names" not in arrays:
        return changes
    names = arrays.texts("contact_names")
    if change.schedule is not None:
        masks = arrays.masks("contacts", frames, len(names))
        unsure = not np.isin(masks, (0.0, 1.0)).all()
        new = np.array([change.mask(name, unsure) for name in names])
        changes["contacts"] = new.reshape(len(names), frames).T.astype(masks.dtype)
        change.note_masks(names)
    if "contact_wrenches" in arrays and (change.moves or change.forces):
        framed = "contact_frames" in arrays
        frames_of = arrays.texts("contact_frames", len(names)) if framed else None
        wrenches = _frame_wrenches(change, names, frames_of)
        if wrenches is not None:
            changes["contact_wrenches"] = arrays.cast("contact_wrenches", wrenches, change.notes)
        elif change.moves:
            changes |= {"contact_wrenches": None, "contact_frames": None}
            change.note_forces(names)
    return changes


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
    forces, notes = {}, []
    for index, contact in enumerate(contacts):
        settings = robot.contacts[contact]
        name = settings.frame_name if frames is None else frames[index]
        placement = _placement(robot.model, settings.frame_name, name)
        if isinstance(placement, str):
            notes.append(
                f"The forces of {contact} are left out: they are in '{name}', {placement}."
            )
            continue
        force = wrenches[:, index]
        if not placement.isIdentity(1e-12):
            force = force @ placement.toDualActionMatrix().T
        if is_point(robot, contact):
            force = force[:, :3]
            if settings.world_aligned:
                rotation = _frame_rotations(robot.model, settings.frame_name, q)
                force = np.einsum("tij,tj->ti", rotation, force)
        forces[contact] = force
    return forces, notes


def _frame_wrenches(
    change: Change, contacts: Sequence[str], frames: Sequence[str] | None
) -> np.ndarray | None:
    """The inverse of :func:`_surface_forces`: (F, C, 6), of the change's forces.

    None if there are none of a contact, or they cannot be taken to its frame.

    Raises:
        DynacomError: the forces of a contact are not of its kind.
    """
    robot = change.clip.robot
    wrenches = np.zeros((len(change.rows), len(contacts), 6))
    for index, contact in enumerate(contacts):
        settings = robot.contacts[contact]
        name = settings.frame_name if frames is None else frames[index]
        placement = _placement(robot.model, settings.frame_name, name)
        if isinstance(placement, str) or contact not in change.forces:
            return None
        force = change.forces[contact][change.rows]
        if is_point(robot, contact) and settings.world_aligned:
            rotation = _frame_rotations(robot.model, settings.frame_name, change.q)
            force = np.einsum("tji,tj->ti", rotation, force)
        wrenches[:, index, : force.shape[1]] = force
        if not placement.isIdentity(1e-12):
            wrenches[:, index] @= placement.inverse().toDualActionMatrix().T
    return wrenches


def _placement(model: pin.Model, own: str, name: str) -> pin.SE3 | str:
    """Of a frame in a contact's own, or why there is none."""
    if not model.existFrame(name):
        return "no frame"
    frame, other = (model.frames[model.getFrameId(which)] for which in (own, name))
    if other.parentJoint != frame.parentJoint:
        return "which does not move with the contact's frame"
    return frame.placement.actInv(other.placement)


def _frame_rotations(model: pin.Model, frame: str, q: np.ndarray) -> np.ndarray:
    """(T, 3, 3), of a frame in the world."""
    data = model.createData()
    index = model.getFrameId(frame)
    rotation = np.empty((len(q), 3, 3))
    for row, configuration in enumerate(q):
        pin.forwardKinematics(model, data, pin.normalize(model, configuration))
        rotation[row] = pin.updateFramePlacement(model, data, index).rotation
    return rotation
