# SPDX-License-Identifier: BSD-2-Clause
"""Motions from comma-separated values, with and without a header."""

import csv
import gzip
import itertools
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

import numpy as np

from dynacom.errors import DynacomError
from dynacom.motion_clip import Clip, Options
from dynacom.motion_columns import ROOT_COLUMNS, clip_from_columns
from dynacom.motion_joints import joint_counts, order_without_names
from dynacom.robots import Robot


def read_csv(path: Path, robot: Robot, options: Options) -> Clip:
    """Reads .csv and .csv.gz: with a header, or 7 + n columns without one.

    Raises:
        DynacomError: as :func:`read_motion`.
        OSError: the file cannot be read.
    """
    with _open(path) as file:
        first = next((line for line in file if line.strip()), None)
        if first is None:
            raise DynacomError(f"{path}: must hold a motion, got an empty file")
        cells = [cell.strip() for cell in next(csv.reader([first]))]
        if all(map(_is_number, cells)):
            table = _load(path, itertools.chain([first], file), len(cells), [])
            return _clip_without_header(path, robot, table, options)
        # As numpy.savetxt writes it.
        cells[0] = cells[0].removeprefix("#").strip()
        for name in cells:
            if name and cells.count(name) > 1:
                raise DynacomError(f"{path}: column '{name}' is there {cells.count(name)} times")
        table = _load(path, file, len(cells), cells)
    return clip_from_columns(path, robot, dict(zip(cells, table.T, strict=True)), options)


def _clip_without_header(path: Path, robot: Robot, table: np.ndarray, options: Options) -> Clip:
    count = table.shape[1] - len(ROOT_COLUMNS)
    if count not in (counts := joint_counts(robot)):
        raise DynacomError(
            f"{path}: must have a header, or 7 columns of the root and "
            f"{' or '.join(map(str, sorted(counts)))} of the joints of {robot.name}, got "
            f"{table.shape[1]}"
        )
    joints, notes = order_without_names(path, robot, count)
    order = options.quat or "xyzw"
    root = ROOT_COLUMNS
    if order == "wxyz":
        root = (*root[:3], root[6], *root[3:6])
    names = (*root, *joints)
    return clip_from_columns(
        path,
        robot,
        dict(zip(names, table.T, strict=True)),
        options,
        order=order,
        labels={name: f"column {number} ({name})" for number, name in enumerate(names, 1)},
        notes=notes,
    )


@contextmanager
def _open(path: Path) -> Iterator[TextIO]:
    """The file as text; what is none is a DynacomError."""
    opener = gzip.open if path.suffix.lower() == ".gz" else open
    # utf-8-sig: spreadsheets begin with a mark.
    with opener(path, "rt", encoding="utf-8-sig", newline="") as file:
        try:
            yield file
        except (UnicodeDecodeError, csv.Error) as error:
            raise DynacomError(f"{path}: must be text, comma-separated ({error})") from error
        except (gzip.BadGzipFile, EOFError, zlib.error) as error:
            raise DynacomError(f"{path}: must be a gzip file ({error})") from error


def _load(path: Path, rows: Iterator[str], count: int, names: list[str]) -> np.ndarray:
    """The numbers, (T, count)."""
    converters = {column: _truth for column, name in enumerate(names) if name.endswith(".active")}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # that there is no row
            table = np.loadtxt(
                rows,
                delimiter=",",
                ndmin=2,
                comments=None,
                quotechar='"',
                encoding="utf-8",
                converters=converters or None,
            )
    except (UnicodeDecodeError, EOFError):
        raise
    except ValueError as error:
        raise DynacomError(f"{path}: {_diagnose(path, count, names) or error}") from error
    if table.size and table.shape[1] != count:
        raise DynacomError(f"{path}: {_diagnose(path, count, names)}")
    return table.reshape(-1, count)


def _truth(cell: str) -> float:
    """0 or 1, as pandas writes them too."""
    word = cell.strip().lower()
    return float(word == "true") if word in ("true", "false") else float(cell)


def _diagnose(path: Path, count: int, names: list[str]) -> str:
    """What is wrong with the first line that NumPy could not read; empty if that is not found."""
    with _open(path) as file:
        rows = csv.reader(file)
        header = bool(names)
        for row in rows:
            if not any(cell.strip() for cell in row):
                continue
            if header:
                header = False
                continue
            if len(row) != count:
                return (
                    f"line {rows.line_num} must have {count} columns, as the first, got {len(row)}"
                )
            for number, cell in enumerate(row, 1):
                name = f" ({names[number - 1]})" if names else ""
                truth = name.endswith(".active)") and cell.strip().lower() in ("true", "false")
                if not (truth or _is_number(cell)):
                    return (
                        f"line {rows.line_num}, column {number}{name} must be a number, "
                        f"got '{cell[:40]}'"
                    )
    return ""


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
