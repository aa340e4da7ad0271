# SPDX-License-Identifier: BSD-2-Clause
"""The files of a batch: which they are, and where they are while they are read."""

import glob
import os
import re
import stat
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from dynacom.errors import DynacomError
from dynacom.motion_file import SUFFIXES

_URL = re.compile(r"[a-z][a-z0-9+.-]+://", re.IGNORECASE)
# What a batch writes to its folder, which may be that of the motions.
_RESULTS = ("clips.parquet", "parts", "frames", "reports")


def find_motions(
    paths: str | Path | Iterable[str | Path], out: Path | None = None
) -> dict[str, str]:
    """The motion files that paths stand for, in the order of their names.

    Folders are searched for files whose suffix is that of a motion, but for what is hidden, and for
    what a batch writes to `out`. A glob stands for what it matches. URLs, of what fsspec opens, may
    be both.

    Returns:
        A file's name in results, where it is text whatever its bytes -> the file. Files that are
        not there are among them, if they are called like a motion.

    Raises:
        DynacomError: a path is none of a motion, or a folder holds none; fsspec is needed and not
            installed.
    """
    if isinstance(paths, str | Path):
        paths = [paths]
    out = None if out is None else out.resolve()
    files: set[str] = set()
    for path in map(str, paths):
        found = list(_find_remote(path) if is_url(path) else _find_local(path, out))
        if not found:
            raise DynacomError(f"{path}: must hold motions ({', '.join(SUFFIXES)}), got none")
        files.update(found)
    if not files:
        raise DynacomError("paths must be files or folders of motions, got none")
    return dict(sorted((printable(file), file) for file in files))


def printable(text: str) -> str:
    """The text, with what no UTF-8 can say written in ASCII: names of files may be any bytes."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def is_url(path: str) -> bool:
    """Whether fsspec has to open it."""
    return _URL.match(path) is not None


@contextmanager
def local_copy(file: str) -> Iterator[Path]:
    """The file itself, or a copy of what a URL stands for while it is needed.

    Raises:
        DynacomError: it is no regular file, which would never end; fsspec is not installed.
        OSError: it cannot be read.
    """
    if not is_url(file):
        if not stat.S_ISREG(os.stat(file).st_mode):
            raise DynacomError(f"{file}: must be a file")
        yield Path(file)
        return
    with tempfile.TemporaryDirectory(prefix="dynacom-") as folder:
        copy = Path(folder, file.rstrip("/").rpartition("/")[2])
        system, path = _fsspec(file).url_to_fs(file)
        system.get_file(path, str(copy))
        yield copy


def _find_local(path: str, out: Path | None) -> Iterator[str]:
    is_there = os.path.lexists(path)
    if os.path.isdir(path):
        yield from _search(path, out)
    elif is_there or (path.lower().endswith(SUFFIXES) and not glob.has_magic(path)):
        yield os.path.normpath(path)
    elif glob.has_magic(path):
        for match in glob.iglob(path, recursive=True):
            if os.path.isdir(match):
                yield from _search(match, out)
            elif match.lower().endswith(SUFFIXES):
                yield os.path.normpath(match)
    else:
        raise DynacomError(f"{path}: must be a file or a folder, which is not there")


def _search(folder: str, out: Path | None) -> Iterator[str]:
    for parent, folders, names in os.walk(folder):
        ours = _RESULTS if out is not None and Path(parent).resolve() == out else ()
        folders[:] = [name for name in folders if not name.startswith(".") and name not in ours]
        for name in names:
            if name.startswith(".") or name in ours:
                continue
            if name.lower().endswith(SUFFIXES):
                yield os.path.normpath(os.path.join(parent, name))


def _find_remote(url: str) -> Iterator[str]:
    system, path = _fsspec(url).url_to_fs(url)
    is_glob = glob.has_magic(path)
    for match in system.glob(path) if is_glob else [path]:
        if not system.isdir(match):
            if not is_glob or match.lower().endswith(SUFFIXES):
                yield system.unstrip_protocol(match)
            continue
        for file in system.find(match):
            inside = file[len(match) :].split("/")
            is_hidden = any(part.startswith(".") for part in inside)
            if file.lower().endswith(SUFFIXES) and not is_hidden:
                yield system.unstrip_protocol(file)


def _fsspec(url: str) -> Any:
    try:
        import fsspec.core
    except ImportError as error:
        raise DynacomError(f"{url}: URLs need fsspec: pip install fsspec") from error
    return fsspec.core
