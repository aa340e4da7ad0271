# SPDX-License-Identifier: BSD-2-Clause
"""Motions from tables, one row per frame, whose columns have names.

They are those that docs/files.md lists.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dynacom.dynacom_pywrap import ContactSchedule
from dynacom.errors import DynacomError
from dynacom.motion_change import Change
from dynacom.motion_checks import check_finite, make_time
from dynacom.motion_clip import (
    Clip,
    Options,
    check_contacts,
    clip_from_joints,
    is_point,
    schedule_from_masks,
)
from dynacom.motion_joints import match_joints
from dynacom.robots import Robot

#: Of the root: position, quaternion.
ROOT_COLUMNS = tuple(f"root_{name}" for name in ("x", "y", "z", "qx", "qy", "qz", "qw"))

_TIME_COLUMNS = ("t", "time")
# Numbers of rows, which say nothing.
_IGNORED_COLUMNS = {"", "frame", "index", "Unnamed: 0", "__index_level_0__"}
_CONTACT = re.compile(r"contact\.(?P<name>.+)\.(?P<what>active|(?:force|torque)_[xyz])")


def clip_from_columns(
    path: Path,
    robot: Robot,
    columns: Mapping[str, np.ndarray],
    options: Options,
    *,
    order: str | None = None,
    numbered: bool = False,
    notes: Sequence[str] = (),
    exact: bool = False,
) -> Clip:
    """A clip of columns of numbers by name, each (T,).

    Args:
        order: of the quaternions, where the file does not name their columns; columns are already
            named accordingly.
        numbered: whether messages give the columns' numbers, because the file does not name them.
        exact: whether the file is marked.

    Raises:
        DynacomError: as :func:`read_motion`.
    """
    layout = _find_layout(path, columns)
    root, times = layout.root, layout.times
    table = _Table(path, columns, numbered, len(columns[root[0]]))

    notes = list(notes)
    if order is None and options.quat is not None:
        notes.append("The columns of the root's quaternion have names: --quat is not used.")
    time = columns[times[0]].astype(float) if times else None
    time, more = make_time(path, table.frames, time=time, fps=options.fps)
    notes += more
    known, more = match_joints(path, robot, layout.joints)
    notes += more
    names = [layout.joints[index] for index in known]
    pose = table.take(root)
    schedule, forces = _read_contacts(robot, table, layout)
    return clip_from_joints(
        path,
        robot,
        time,
        pose[:, :3],
        pose[:, 3:],
        names,
        table.take(names),
        options,
        order=order,
        option=True,
        notes=notes,
        schedule=schedule,
        forces=forces,
        exact=exact,
    )


def changed_columns(
    change: Change, columns: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray | None]:
    """What a change makes of a file's columns: those that are others then; None is left out."""
    clip, robot = change.clip, change.clip.robot
    layout = _find_layout(clip.path, columns)
    root = np.array([columns[name] for name in layout.root]).T
    known, _ = match_joints(clip.path, robot, layout.joints)
    names = [layout.joints[index] for index in known]
    angles = np.array([columns[name] for name in names]).reshape(len(names), len(root)).T
    pose = np.hstack([change.position(root[:, :3]), change.quaternion(root[:, 3:])])
    after: dict[str, np.ndarray | None] = {}
    if change.moves:
        after |= zip(layout.root, pose.T, strict=True)
        after |= zip(names, change.angles(names, angles).T, strict=True)
        after |= {name: change.stretched(columns[name]) for name in layout.times}
        if not layout.times:
            change.frame_rate(None)
    if change.schedule is not None and layout.masks:
        for contact, column in layout.masks.items():
            unsure = not np.isin(columns[column], (0.0, 1.0)).all()
            after[column] = change.mask(contact, unsure)
        change.note_masks([*layout.masks])
    stale = []
    for contact, by_component in layout.components.items():
        if contact in change.forces:
            values = change.forces[contact][change.rows].T
            wanted = [f"{what}_{axis}" for what in ("force", "torque") for axis in "xyz"]
            after |= {
                by_component[what]: row
                for what, row in zip(wanted, values, strict=False)
                if what in by_component
            }
        elif change.moves:
            after |= dict.fromkeys(by_component.values())
            stale.append(contact)
    if stale:
        change.note_forces(stale)
    return {
        name: values
        for name, values in after.items()
        if values is None or not np.array_equal(values, columns[name])
    }


def is_contact(column: str) -> bool:
    """Whether a column of this name is about a contact."""
    return _CONTACT.fullmatch(column) is not None


def is_mask(column: str) -> bool:
    """Whether a column of this name says when a contact is active."""
    match = _CONTACT.fullmatch(column)
    return match is not None and match["what"] == "active"


@dataclass(frozen=True)
class _Layout:
    """Which columns are what."""

    #: As :data:`ROOT_COLUMNS`.
    root: list[str]
    #: At most two, of which the first counts.
    times: list[str]
    #: All others, in the file's order.
    joints: list[str]
    #: Contact's name -> column.
    masks: dict[str, str]
    #: Contact's name -> ``force_x``, ... -> column.
    components: dict[str, dict[str, str]]


def _find_layout(path: Path, columns: Mapping[str, np.ndarray]) -> _Layout:
    root = [_find_root(path, columns, name) for name in ROOT_COLUMNS]
    times = [name for name in _TIME_COLUMNS if name in columns]
    masks: dict[str, str] = {}
    components: dict[str, dict[str, str]] = {}
    joints = []
    others = {*root, *times, *_IGNORED_COLUMNS}
    for name in columns:
        if match := _CONTACT.fullmatch(name):
            if match["what"] == "active":
                masks[match["name"]] = name
            else:
                components.setdefault(match["name"], {})[match["what"]] = name
        elif name not in others:
            joints.append(name)
    return _Layout(root, times, joints, masks, components)


@dataclass(frozen=True)
class _Table:
    path: Path
    columns: Mapping[str, np.ndarray]
    numbered: bool
    frames: int

    def label(self, name: str) -> str:
        if self.numbered:
            return f"column {[*self.columns].index(name) + 1} ({name})"
        return f"column '{name}'"

    def take(self, names: Sequence[str]) -> np.ndarray:
        """Columns of finite numbers, (T, k)."""
        values = np.array([self.columns[name] for name in names], dtype=float)
        values = values.reshape(len(names), self.frames).T  # if there is none, too
        check_finite(self.path, lambda column: self.label(names[column]), values)
        return values


def _read_contacts(
    robot: Robot, table: _Table, layout: _Layout
) -> tuple[ContactSchedule | None, dict[str, np.ndarray]]:
    """The schedule, if there, and forces by contact."""
    masks = {name: _mask(table, column) for name, column in layout.masks.items()}
    check_contacts(table.path, robot, [*masks])
    check_contacts(table.path, robot, [*layout.components])
    forces = {}
    for name, by_component in layout.components.items():
        wanted = [f"force_{axis}" for axis in "xyz"]
        if not is_point(robot, name) and any(key.startswith("torque") for key in by_component):
            wanted += [f"torque_{axis}" for axis in "xyz"]
        for key in wanted:
            if key not in by_component:
                raise DynacomError(f"{table.path}: missing column 'contact.{name}.{key}'")
        forces[name] = table.take([by_component[key] for key in wanted])
    schedule = schedule_from_masks([*masks], np.stack([*masks.values()], 1)) if masks else None
    return schedule, forces


def _find_root(path: Path, columns: Mapping[str, np.ndarray], name: str) -> str:
    short = name.removeprefix("root_")
    found = [candidate for candidate in (name, short) if candidate in columns]
    if not found:
        raise DynacomError(f"{path}: missing column '{name}' (or '{short}')")
    return found[0]


def _mask(table: _Table, column: str) -> np.ndarray:
    """A column of numbers from 0 to 1, (T,)."""
    values = table.take([column])[:, 0]
    wrong = (values < 0.0) | (values > 1.0)
    if wrong.any():
        frame = int(np.argmax(wrong))
        raise DynacomError(
            f"{table.path}: {table.label(column)} must be from 0 to 1, got {values[frame]:g} in "
            f"frame {frame}"
        )
    return values
