# SPDX-License-Identifier: BSD-2-Clause
"""Motions from comma-separated values, with and without a header."""

import csv
import gzip
import io
import itertools
import warnings
import zlib
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np

from dynacom.dynacom_pywrap import _readNumberTable
from dynacom.errors import DynacomError
from dynacom.motion_clip import Clip, Options
from dynacom.motion_columns import ROOT_COLUMNS, clip_from_columns
from dynacom.motion_joints import joint_counts, order_without_names
from dynacom.robots import Robot

_NO_GZIP = (gzip.BadGzipFile, EOFError, zlib.error)


def read_csv(path: Path, robot: Robot, options: Options) -> Clip:
    """Reads .csv and .csv.gz: with a header, or 7 + n columns without one.

    Raises:
        DynacomError: as :func:`read_motion`.
        OSError: the file cannot be read.
    """
    file = _File(path, path.read_bytes())
    with file.open() as text:
        lines = ((above, line) for above, line in enumerate(text) if line.strip())
        above, first = next(lines, (0, None))
        if first is None:
            raise DynacomError(f"{path}: must hold a motion, got an empty file")
        cells = [cell.strip() for cell in next(csv.reader([first]))]
        names = [] if all(map(_is_number, cells)) else _check_names(path, cells)
        table = _load_plain(file, above + bool(names), len(cells))
        if table is None:
            rows = text if names else itertools.chain([first], text)
            table = _load(file, rows, len(cells), names)
    if not names:
        return _clip_without_header(path, robot, table, options)
    return clip_from_columns(path, robot, dict(zip(names, table.T, strict=True)), options)


def _check_names(path: Path, cells: list[str]) -> list[str]:
    """The names in a header."""
    # As numpy.savetxt writes it.
    names = [cells[0].removeprefix("#").strip(), *cells[1:]]
    for name, count in Counter(names).items():
        if name and count > 1:
            raise DynacomError(f"{path}: column '{name}' is there {count} times")
    return names


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
        numbered=True,
        notes=notes,
    )


@dataclass(frozen=True)
class _File:
    path: Path
    #: As on the disk.
    content: bytes

    @property
    def is_compressed(self) -> bool:
        return self.path.suffix.lower() == ".gz"

    @contextmanager
    def open(self) -> Iterator[TextIO]:
        """The file as text; what is none is a DynacomError."""
        content = io.BytesIO(self.content)
        binary = gzip.GzipFile(fileobj=content) if self.is_compressed else content
        try:
            # utf-8-sig: spreadsheets begin with a mark.
            yield io.TextIOWrapper(binary, encoding="utf-8-sig", newline="")
        except (UnicodeDecodeError, csv.Error) as error:
            raise DynacomError(f"{self.path}: must be text, comma-separated ({error})") from error
        except _NO_GZIP as error:
            raise DynacomError(f"{self.path}: must be a gzip file ({error})") from error


def _load_plain(file: _File, above: int, count: int) -> np.ndarray | None:
    """What :func:`_load` returns, in a sixth of its time, of the rows below so many lines.

    None where there is anything but finite numbers: what else a table may hold, and what is wrong
    with it, is for :func:`_load` to say.
    """
    try:
        content = gzip.decompress(file.content) if file.is_compressed else file.content
    except _NO_GZIP:
        return None
    return _readNumberTable(content, above, count)


def _load(file: _File, rows: Iterator[str], count: int, names: list[str]) -> np.ndarray:
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
        raise DynacomError(f"{file.path}: {_diagnose(file, count, names) or error}") from error
    if table.size and table.shape[1] != count:
        raise DynacomError(f"{file.path}: {_diagnose(file, count, names)}")
    return table.reshape(-1, count)


def _truth(cell: str) -> float:
    """0 or 1, as pandas writes them too."""
    word = cell.strip().lower()
    return float(word == "true") if word in ("true", "false") else float(cell)


def _diagnose(file: _File, count: int, names: list[str]) -> str:
    """What is wrong with the first line that NumPy could not read; empty if that is not found."""
    with file.open() as text:
        rows = csv.reader(text)
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
