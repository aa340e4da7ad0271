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
) -> Clip:
    """A clip of columns of numbers by name, each (T,).

    Args:
        order: of the quaternions, where the file does not name their columns; columns are already
            named accordingly.
        numbered: whether messages give the columns' numbers, because the file does not name them.

    Raises:
        DynacomError: as :func:`read_motion`.
    """
    root = [_find_root(path, columns, name) for name in ROOT_COLUMNS]
    table = _Table(path, columns, numbered, len(columns[root[0]]))
    contacts = [name for name in columns if _CONTACT.fullmatch(name)]
    times = [name for name in _TIME_COLUMNS if name in columns]
    others = {*root, *contacts, *times, *_IGNORED_COLUMNS}
    joints = [name for name in columns if name not in others]

    notes = list(notes)
    if order is None and options.quat is not None:
        notes.append("The columns of the root's quaternion have names: --quat is not used.")
    time = columns[times[0]].astype(float) if times else None
    time, more = make_time(path, table.frames, time=time, fps=options.fps)
    notes += more
    known, more = match_joints(path, robot, joints)
    notes += more
    names = [joints[index] for index in known]
    pose = table.take(root)
    schedule, forces = _read_contacts(robot, table, contacts)
    return clip_from_joints(
        path,
        robot,
        time,
        pose[:, :3],
        pose[:, 3:],
        names,
        table.take(names),
        order=order,
        option=True,
        believed=options.quat is not None,
        notes=notes,
        schedule=schedule,
        forces=forces,
    )


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
    robot: Robot, table: _Table, columns: Sequence[str]
) -> tuple[ContactSchedule | None, dict[str, np.ndarray]]:
    """The schedule, if there, and forces by contact."""
    masks: dict[str, np.ndarray] = {}
    components: dict[str, dict[str, str]] = {}
    for column in columns:
        match = _CONTACT.fullmatch(column)
        if match["what"] == "active":
            masks[match["name"]] = _mask(table, column)
        else:
            components.setdefault(match["name"], {})[match["what"]] = column
    check_contacts(table.path, robot, [*masks])
    check_contacts(table.path, robot, [*components])
    forces = {}
    for name, by_component in components.items():
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
