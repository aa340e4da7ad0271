# SPDX-License-Identifier: BSD-2-Clause
"""Contact schedules from and to YAML, to be corrected by hand.

A file names the times at which each contact is active, in seconds::

    left_sole: [[0.0, 0.98], [1.72, 2.5]]
    right_sole:
    - [0.5, 2.016667]

A contact is active in all frames from the first time to the second, both included.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from dynacom.dynacom_pywrap import ContactSchedule
from dynacom.errors import DynacomError
from dynacom.yaml_file import is_number, read_yaml

# By what part of a frame times may be rounded; a single frame has a second.
_ROUNDING = 1e-3


def write_schedule(schedule: ContactSchedule, time: np.ndarray, path: str | Path) -> None:
    """Writes a schedule.

    Args:
        time: (T,) of its frames [s].

    Raises:
        OSError: the file cannot be written.
    """
    lines = ["# When each contact is active [s]: the first and the last frame of each time.\n"]
    digits = max(6, math.ceil(-math.log10(0.1 * _tolerance(time))))
    for name, active in zip(schedule.names, np.asarray(schedule.active).T, strict=True):
        intervals = [
            [round(float(time[first]), digits), round(float(time[last]), digits)]
            for first, last in _runs(active)
        ]
        lines.append(yaml.safe_dump({name: intervals}, default_flow_style=None, width=10**6))
    Path(path).write_text("".join(lines), encoding="utf-8")


def read_schedule(path: str | Path, time: np.ndarray, contacts: Sequence[str]) -> ContactSchedule:
    """Reads a schedule.

    Args:
        time: (T,) of the frames that it is wanted for [s].
        contacts: names that may occur; those that do not are never active.

    Raises:
        DynacomError: the file cannot be read, or is no schedule of these contacts; the message
            names the contact, what was expected and what was got.
    """
    content = read_yaml(path)
    if not isinstance(content, dict):
        raise DynacomError(f"{path}: must be a mapping of contacts to times, got {content!r}")
    if unknown := [name for name in content if name not in contacts]:
        raise DynacomError(
            f"{path}: contact must be one of {', '.join(contacts)}, got {unknown[0]!r}"
        )
    tolerance = _tolerance(time)
    active = np.zeros((len(time), len(contacts)), dtype=bool)
    for name, intervals in content.items():
        where = f"{path}: contact '{name}'"
        pairs = _read_intervals(intervals, where)
        if pairs and all(
            first > time[-1] + tolerance or last < time[0] - tolerance for first, last in pairs
        ):
            raise DynacomError(
                f"{where}: times must be those of the clip, {time[0]:g} to {time[-1]:g} s, got "
                f"{pairs[0][0]:g} to {pairs[-1][1]:g}"
            )
        for first, last in pairs:
            inside = (time >= first - tolerance) & (time <= last + tolerance)
            active[inside, list(contacts).index(name)] = True
    return ContactSchedule(list(contacts), active)


def _tolerance(time: np.ndarray) -> float:
    """By how much times may be rounded [s]."""
    return _ROUNDING * float(np.diff(time).min() if len(time) > 1 else 1.0)


def _read_intervals(value: Any, where: str) -> list[tuple[float, float]]:
    pairs = value if isinstance(value, list) else [value]
    for pair in pairs:
        is_pair = isinstance(pair, list) and len(pair) == 2 and all(map(is_number, pair))
        if not is_pair or pair[0] > pair[1]:
            raise DynacomError(
                f"{where}: must be a list of times [first, last], first <= last, got {pair!r}"
            )
    return [(float(first), float(last)) for first, last in pairs]


def _runs(active: np.ndarray) -> list[tuple[int, int]]:
    """First and last frame of each run of true."""
    edges = np.diff(np.concatenate([[0], active.astype(int), [0]]))
    return list(zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0) - 1, strict=True))
