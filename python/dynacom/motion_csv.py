# SPDX-License-Identifier: BSD-2-Clause
"""Motions from and into comma-separated values, with and without a header."""

import codecs
import csv
import gzip
import io
import itertools
import re
import warnings
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple, TextIO

import numpy as np

from dynacom.dynacom_pywrap import _readNumberTable
from dynacom.errors import DynacomError
from dynacom.motion_change import ROUNDING_NOISE, Change, rounding_noise
from dynacom.motion_clip import Clip, Options
from dynacom.motion_columns import (
    ROOT_COLUMNS,
    changed_columns,
    clip_from_columns,
    is_contact,
    is_mask,
)
from dynacom.motion_joints import joint_counts, order_without_names
from dynacom.motion_mark import is_marked_beside
from dynacom.robots import Robot

_NO_GZIP = (gzip.BadGzipFile, EOFError, zlib.error)


def read_csv(path: Path, robot: Robot, options: Options) -> Clip:
    """Reads .csv and .csv.gz: with a header, or 7 + n columns without one.

    Raises:
        DynacomError: as :func:`read_motion`.
        OSError: the file cannot be read.
    """
    table = _read_table(path)
    exact = is_marked_beside(path, table.file.content)
    if table.header:
        return clip_from_columns(path, robot, table.columns(), options, exact=exact)
    names, order, notes = _name_columns(path, robot, table, options)
    return clip_from_columns(
        path,
        robot,
        table.columns(names),
        options,
        order=order,
        numbered=True,
        notes=notes,
        exact=exact,
    )


def write_csv(change: Change) -> bytes:
    """The file with a change: each number that does not change keeps its text.

    Numbers that do are written as those in their column are: with as many decimals, in as many as
    accelerations need, or in as few as tell them.

    Raises:
        DynacomError: as :func:`write_motion`.
        OSError: the file cannot be read.
    """
    clip = change.clip
    table = _read_table(clip.path)
    names = table.header or _name_columns(clip.path, clip.robot, table, clip.options)[0]
    columns = table.columns(names)
    after = changed_columns(change, columns)
    if not after:
        return table.file.content
    with table.file.open() as text:
        lines = [*text]
    rows = [place for place, line in enumerate(lines) if line.strip()]
    cells = [_split(lines[place]) for place in rows]
    body = cells[1:] if table.header else cells
    texts = {
        name: [_Cell.of(row[place]) for row in body]
        for place, name in enumerate(names)
        if after.get(name) is not None
    }
    writers = _find_writers(change, after, texts)
    for place, name in enumerate(names):
        if name not in texts:
            continue
        values, write = after[name], writers[name]
        is_new = (values != columns[name]).tolist()
        for row, cell, value, new in zip(body, texts[name], values.tolist(), is_new, strict=True):
            if new:
                row[place] = f"{cell.before}{write(value)}{cell.after}"
    dropped = {place for place, name in enumerate(names) if after.get(name, ()) is None}
    for place, row in zip(rows, cells, strict=True):
        end = lines[place][len(lines[place].rstrip("\r\n")) :]
        kept = (cell for column, cell in enumerate(row) if column not in dropped)
        lines[place] = ",".join(kept) + end
    return table.file.with_text("".join(lines))


def _find_writers(
    change: Change,
    after: Mapping[str, np.ndarray | None],
    texts: "Mapping[str, Sequence[_Cell]]",
) -> dict[str, Callable[[float], str]]:
    """How the numbers of each column are written.

    Args:
        after: column's name -> numbers, (T,).
        texts: the same of what is in the file.
    """
    forms = {name: _Form.of([cell.number for cell in cells]) for name, cells in texts.items()}
    is_shortest = any(form.kind == "r" for form in forms.values())
    writers, more = {}, Counter()
    for name, form in forms.items():
        values = after[name]
        if is_mask(name):
            style = _truth_style([cell.number for cell in texts[name]])
            writers[name] = style or form.for_truth(values).write
            continue
        if is_contact(name):
            fine = form if form.decimals else _Form("r")  # whole by chance
        else:
            fine = form.for_accelerations(values, change.rate)
            # Of zeros alone nobody knows how many digits others would have.
            if fine != form and is_shortest:
                fine = _Form("r")
            elif fine != form:
                more[fine.decimals] += 1
        writers[name] = fine.write
    for decimals, count in more.items():
        change.notes.append(
            f"Accelerations need more decimals than the file has: {count} columns have {decimals} "
            "now."
        )
    return writers


@dataclass(frozen=True)
class _Table:
    file: "_File"
    #: Names of the columns; empty where the file has no header.
    header: list[str]
    #: (T, count).
    values: np.ndarray

    def columns(self, names: Sequence[str] = ()) -> dict[str, np.ndarray]:
        """Name -> numbers."""
        return dict(zip(names or self.header, self.values.T, strict=True))


def _read_table(path: Path) -> _Table:
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
    return _Table(file, names, table)


def _check_names(path: Path, cells: list[str]) -> list[str]:
    """The names in a header."""
    # As numpy.savetxt writes it.
    names = [cells[0].removeprefix("#").strip(), *cells[1:]]
    for name, count in Counter(names).items():
        if name and count > 1:
            raise DynacomError(f"{path}: column '{name}' is there {count} times")
    return names


def _name_columns(
    path: Path, robot: Robot, table: _Table, options: Options
) -> tuple[tuple[str, ...], str, list[str]]:
    """Names of columns without a header, the order of their quaternions, and notes."""
    width = table.values.shape[1]
    count = width - len(ROOT_COLUMNS)
    if count not in (counts := joint_counts(robot)):
        raise DynacomError(
            f"{path}: must have a header, or 7 columns of the root and "
            f"{' or '.join(map(str, sorted(counts)))} of the joints of {robot.name}, got {width}"
        )
    joints, notes = order_without_names(path, robot, count)
    order = options.quat or "xyzw"
    root = ROOT_COLUMNS
    if order == "wxyz":
        root = (*root[:3], root[6], *root[3:6])
    return (*root, *joints), order, notes


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

    def with_text(self, text: str) -> bytes:
        """What such a file is with another text."""
        content = text.encode("utf-8-sig" if self._has_mark() else "utf-8")
        # Without the time of day: the same motion is the same file.
        return gzip.compress(content, mtime=0) if self.is_compressed else content

    def _has_mark(self) -> bool:
        content = gzip.decompress(self.content) if self.is_compressed else self.content
        return content.startswith(codecs.BOM_UTF8)


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


def _split(line: str) -> list[str]:
    """The cells as they stand there, with spaces and quotation marks, without the line's end."""
    line = line.rstrip("\r\n")
    if '"' not in line:
        return line.split(",")
    return re.split(r',(?=(?:[^"]*"[^"]*")*[^"]*$)', line)


class _Cell(NamedTuple):
    """A number's text, and the spaces and quotation marks around it."""

    before: str
    number: str
    after: str

    @classmethod
    def of(cls, text: str) -> "_Cell":
        number = text.strip(' \t"')
        before, _, after = text.partition(number)
        return cls(before, number, after)


@dataclass(frozen=True)
class _Form:
    """How numbers are written."""

    #: ``f``, with a fixed number of decimals; ``e``, the same and a power of ten; ``r``, with as
    #: few digits as tell them from others.
    kind: str
    decimals: int = 0

    @classmethod
    def of(cls, texts: Sequence[str]) -> "_Form":
        """How all of these are."""
        for kind, form in (("f", _FIXED), ("e", _POWER)):
            matches = [form.fullmatch(text) for text in texts]
            if all(matches) and len({len(match[1] or "") for match in matches}) == 1:
                return cls(kind, len(matches[0][1] or ""))
        return cls("r")

    def write(self, value: float) -> str:
        return repr(value) if self.kind == "r" else f"{value:.{self.decimals}{self.kind}}"

    def for_accelerations(self, values: np.ndarray, rate: float) -> "_Form":
        """With more decimals, if those here make accelerations that are too large."""
        form = self
        power = 0
        if self.kind == "e" and (largest := np.abs(values).max()) > 0.0:
            power = int(np.floor(np.log10(largest)))
        while form.kind != "r" and (
            rounding_noise(10.0 ** (power - form.decimals), rate) > ROUNDING_NOISE
        ):
            form = replace(form, decimals=form.decimals + 1)
        return form

    def for_truth(self, values: np.ndarray) -> "_Form":
        """With more decimals, if those here carry a number to the other side of one half."""
        form = self
        while form.kind != "r" and any(
            (float(form.write(value)) >= 0.5) != (value >= 0.5) for value in values.tolist()
        ):
            form = replace(form, decimals=form.decimals + 1)
        return form


_FIXED = re.compile(r"[+-]?\d+(?:\.(\d+))?")
_POWER = re.compile(r"[+-]?\d(?:\.(\d+))?[eE][+-]?\d+")


def _truth_style(texts: Sequence[str]) -> Callable[[float], str] | None:
    """How true and false are written, if these texts are words for them."""
    if not all(text.lower() in ("true", "false") for text in texts):
        return None
    styles = (str.lower, str.upper)
    style = next((style for style in styles if style(texts[0]) == texts[0]), str)
    return lambda value: style(str(value >= 0.5))
