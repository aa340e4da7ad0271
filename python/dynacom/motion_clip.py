# SPDX-License-Identifier: BSD-2-Clause
"""What a motion file holds, in the robot's coordinates, and how it is put together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dynacom.dynacom_pywrap import ContactPointSettings, ContactSchedule
from dynacom.errors import DynacomError
from dynacom.motion_checks import QUATERNION_NOTED, check_angles, normalize
from dynacom.motion_gaps import Gaps
from dynacom.motion_joints import brief, configurations, joint_angles
from dynacom.robots import Robot


@dataclass(frozen=True)
class Options:
    """What the caller of ``read_motion`` knows of the file."""

    fps: float | None = None
    quat: str | None = None
    trust: bool = False
    clip: str | None = None


@dataclass(frozen=True, eq=False)
class Clip:
    """What a motion file holds, in the robot's coordinates: T frames."""

    path: Path
    #: (T,), strictly increasing [s].
    time: np.ndarray = field(repr=False)
    #: Configurations as in Pinocchio, (T, nq); quaternions (x, y, z, w) of norm 1.
    q: np.ndarray = field(repr=False)
    #: Velocities as in Pinocchio, (T, nv); None where the file has none.
    v: np.ndarray | None = field(repr=False)
    #: Accelerations as in Pinocchio, (T, nv); None where the file has none.
    a: np.ndarray | None = field(repr=False)
    #: The robot's joints that the file gives, in the model's order; the others are at its default.
    joint_names: tuple[str, ...] = field(repr=False)
    #: None where the file does not say when which contact is active.
    schedule: ContactSchedule | None
    #: Contact's name -> its force, measured or planned, in its surface's frame: (T, 6), force and
    #: moment, or (T, 3).
    forces: Mapping[str, np.ndarray] = field(repr=False)
    #: |norm - 1| of the root's quaternion in the file, (T,).
    quaternion_error: np.ndarray = field(repr=False)
    #: What was assumed, mapped, held, normalised: sentences.
    notes: tuple[str, ...]
    #: Where the file has dropped frames, which are made anew here; None where it has not.
    gaps: Gaps | None = None
    #: Whether the file is marked as exact, so that it need not be filtered.
    exact: bool = False
    #: How the file was read, and whose motion it is: for :func:`write_motion`. None where the clip
    #: is not from a file.
    options: Options | None = field(default=None, repr=False)
    robot: Robot | None = field(default=None, repr=False)


def clip_from_joints(
    path: Path,
    robot: Robot,
    time: np.ndarray,
    position: np.ndarray,
    quaternion: np.ndarray,
    names: Sequence[str],
    angles: np.ndarray,
    options: Options,
    **others: object,
) -> Clip:
    """A clip of what the file says of the root and of some joints.

    Args:
        position: (T, 3).
        quaternion: (T, 4), x y z w.
        names: of k joints of the robot.
        angles: (T, k).
        others: those of :func:`clip_from_configurations`.

    Raises:
        DynacomError: as there.
    """
    q = configurations(robot, position, quaternion, names, angles)
    return clip_from_configurations(path, robot, time, q, options, names=names, **others)


def clip_from_configurations(
    path: Path,
    robot: Robot,
    time: np.ndarray,
    q: np.ndarray,
    options: Options,
    *,
    names: Sequence[str],
    order: str | None,
    option: bool = False,
    notes: Sequence[str] = (),
    v: np.ndarray | None = None,
    a: np.ndarray | None = None,
    schedule: ContactSchedule | None = None,
    forces: Mapping[str, np.ndarray] | None = None,
    exact: bool = False,
) -> Clip:
    """A clip of configurations, whose numbers are finite, and whose quaternions may need a norm.

    Frames that are missing among evenly spaced ones are made from those around them.

    Args:
        names: of the joints that the file gives.
        order: of the file's quaternions; see :func:`normalize`.
        option: whether ``--quat`` can change it.

    Raises:
        DynacomError: quaternions of another order or far from norm 1, angles in degrees.
    """
    notes = list(notes)
    q = q.copy()
    q[:, 3:7], error, doubts = normalize(
        path, q[:, 3:7], order, option, option and options.quat is not None
    )
    notes += doubts
    notes += check_angles(path, robot, names, joint_angles(robot, q, names))
    known, there = robot.joints.names, set(names)
    if held := [name for name in known if name not in there]:
        notes.append(
            f"The file does not give {len(held)} of {len(known)} joints, which stay at their "
            f"default: {brief(held)}."
        )
    if not error.max() <= QUATERNION_NOTED:
        notes.append(
            f"The root's quaternions were normalised: their norms differ from 1 by up to "
            f"{error.max():.1g}."
        )
    given = tuple(name for name in known if name in there)
    forces = forces or {}
    if gaps := Gaps.find(time):
        notes.append(gaps.note())
        time, q, error = gaps.times(), gaps.configurations(robot.model, q), gaps.repeated(error)
        v, a = (None if values is None else gaps.interpolated(values) for values in (v, a))
        schedule = None if schedule is None else gaps.schedule(schedule)
        forces = gaps.forces(forces)
    return Clip(
        path,
        time,
        q,
        v,
        a,
        given,
        schedule,
        forces,
        error,
        tuple(notes),
        gaps,
        exact,
        options,
        robot,
    )


def schedule_from_masks(names: Sequence[str], masks: np.ndarray) -> ContactSchedule:
    """When contacts are active, and how probable that is.

    Args:
        names: of C contacts.
        masks: (T, C), bool, or numbers from 0 to 1: a contact is active from one half on, and if
            there are others than 0 and 1, they are its confidence.
    """
    active = masks >= 0.5 if masks.dtype.kind != "b" else masks
    if np.array_equal(active, masks):
        return ContactSchedule(names, active)
    return ContactSchedule(names, active, masks.astype(float))


def check_contacts(path: Path, robot: Robot, names: Sequence[str]) -> None:
    """Refuses contacts that the robot does not have, or that are there twice.

    Raises:
        DynacomError
    """
    for name in names:
        if name not in robot.contacts:
            raise DynacomError(
                f"{path}: contacts must be those of {robot.name} ({', '.join(robot.contacts)}), "
                f"got '{name}'"
            )
        if names.count(name) > 1:
            raise DynacomError(f"{path}: contact '{name}' is there {names.count(name)} times")


def is_point(robot: Robot, contact: str) -> bool:
    """Whether a contact gives a force only."""
    return isinstance(robot.contacts[contact], ContactPointSettings)
