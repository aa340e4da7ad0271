# SPDX-License-Identifier: BSD-2-Clause
"""The arrays of NumPy archives."""

import io
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from dynacom.errors import DynacomError
from dynacom.motion_checks import check_finite
from dynacom.motion_mark import MARK, is_mark, mark_text


@contextmanager
def open_archive(path: Path) -> "Iterator[Arrays]":
    """The arrays of an archive.

    Raises:
        DynacomError: it is none.
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
            yield Arrays(path, archive)


class Arrays:
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

    def filled(self, name: str, value: float) -> np.ndarray:
        """A number in the shape of an array that is there."""
        return np.full(self._archive[name].shape, value)

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

    def cast(self, name: str, values: np.ndarray, notes: list[str]) -> np.ndarray:
        """Numbers for an array that is there, of its type.

        Args:
            notes: to which one is added where they are real and the array is of integers: then it
                is so no more.
        """
        dtype = self._archive[name].dtype
        if dtype.kind in "iu" and (values != np.rint(values)).any():
            notes.append(f"The array {name} was of integers, and is of real numbers now.")
            return values
        return values.astype(dtype)

    def is_exact(self) -> bool:
        """Whether the archive is marked so."""
        try:
            return is_mark(self._archive[MARK].item())
        except Exception:  # as below; mostly, it is not there
            return False

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


def rewrite(path: Path, changes: Mapping[str, np.ndarray | None], mark: bool) -> bytes:
    """An archive with other arrays, all else in it as it is, byte for byte.

    Args:
        changes: array's name -> the new one, laid out in memory as the old one; None to leave it
            out.
        mark: whether it is to be marked as exact.

    Raises:
        OSError: the file cannot be read.
    """
    written = io.BytesIO()
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(written, "w") as new:
        for member in old.infolist():
            name = member.filename.removesuffix(".npy")
            if name == MARK or changes.get(name, ()) is None:
                continue
            content = old.read(member)
            if name in changes:
                by_columns = np.load(io.BytesIO(content), allow_pickle=False).flags.fnc
                content = _to_bytes(np.asarray(changes[name], order="F" if by_columns else "C"))
            new.writestr(member, content)
        if mark:
            member = zipfile.ZipInfo(f"{MARK}.npy")
            member.compress_type = old.infolist()[0].compress_type
            new.writestr(member, _to_bytes(np.array(mark_text())))
    return written.getvalue()


def _to_bytes(array: np.ndarray) -> bytes:
    content = io.BytesIO()
    np.lib.format.write_array(content, array, allow_pickle=False)
    return content.getvalue()
