# SPDX-License-Identifier: BSD-2-Clause
"""Motions from tables, one row per frame, whose columns have names.

They are those that docs/files.md lists.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from dynacom.dynacom_pywrap import ContactSchedule
from dynacom.errors import DynacomError
from dynacom.motion_checks import check_finite, make_time
from dynacom.motion_clip import Clip, Options, check_contacts, clip_from_joints, is_point
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
    labels: Mapping[str, str] | None = None,
    notes: Sequence[str] = (),
) -> Clip:
    """A clip of columns of numbers by name, each (T,).

    Args:
        order: of the quaternions, where the file does not name their columns; columns are already
            named accordingly.
        labels: what messages call columns instead of by their names.

    Raises:
        DynacomError: as :func:`read_motion`.
    """
    labels = {name: f"column '{name}'" for name in columns} | dict(labels or {})

    def take(names: list[str]) -> np.ndarray:
        values = np.array([columns[name] for name in names], dtype=float)
        values = values.reshape(len(names), frames).T  # if there is none, too
        check_finite(path, [labels[name] for name in names], values)
        return values

    root = [_find_root(path, columns, name) for name in ROOT_COLUMNS]
    frames = len(columns[root[0]])
    contacts = {name: match for name in columns if (match := _CONTACT.fullmatch(name))}
    times = [name for name in _TIME_COLUMNS if name in columns]
    others = {*root, *contacts, *times, *_IGNORED_COLUMNS}
    joints = [name for name in columns if name not in others]

    notes = list(notes)
    if order is None and options.quat is not None:
        notes.append("The columns of the root's quaternion have names: --quat is not used.")
    time, more = make_time(
        path,
        frames,
        time=columns[times[0]].astype(float) if times else None,
        fps=options.fps,
    )
    notes += more
    known, more = match_joints(path, robot, joints)
    notes += more
    names = [joints[index] for index in known]
    values = take(root)

    active: dict[str, np.ndarray] = {}
    components: dict[str, dict[str, str]] = {}
    for column, match in contacts.items():
        name, what = match["name"], match["what"]
        if what == "active":
            active[name] = _switch(path, labels[column], take([column])[:, 0])
        else:
            components.setdefault(name, {})[what] = column
    check_contacts(path, robot, [*active])
    check_contacts(path, robot, [*components])
    forces = {}
    for name, by_component in components.items():
        wanted = [f"force_{axis}" for axis in "xyz"]
        if not is_point(robot, name) and any(key.startswith("torque") for key in by_component):
            wanted += [f"torque_{axis}" for axis in "xyz"]
        for key in wanted:
            if key not in by_component:
                raise DynacomError(f"{path}: missing column 'contact.{name}.{key}'")
        forces[name] = take([by_component[key] for key in wanted])

    return clip_from_joints(
        path,
        robot,
        time,
        values[:, :3],
        values[:, 3:],
        names,
        take(names),
        order=order,
        option=True,
        notes=notes,
        schedule=ContactSchedule([*active], np.stack([*active.values()], 1)) if active else None,
        forces=forces,
    )


def _find_root(path: Path, columns: Mapping[str, np.ndarray], name: str) -> str:
    short = name.removeprefix("root_")
    found = [candidate for candidate in (name, short) if candidate in columns]
    if not found:
        raise DynacomError(f"{path}: missing column '{name}' (or '{short}')")
    return found[0]


def _switch(path: Path, what: str, values: np.ndarray) -> np.ndarray:
    wrong = (values != 0.0) & (values != 1.0)
    if wrong.any():
        frame = int(np.argmax(wrong))
        raise DynacomError(f"{path}: {what} must be 0 or 1, got {values[frame]:g} in frame {frame}")
    return values == 1.0
