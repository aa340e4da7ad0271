# SPDX-License-Identifier: BSD-2-Clause
"""The files of a batch: which they are, and where they are while they are read."""

import errno
import glob
import hashlib
import itertools
import os
import re
import stat
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from dynacom.errors import DynacomError
from dynacom.motion_file import SUFFIXES

_URL = re.compile(r"[a-z][a-z0-9+.-]+://", re.IGNORECASE)
# What the commonest URLs need, by their beginning.
_PACKAGES = {
    "abfs": "adlfs",
    "az": "adlfs",
    "gs": "gcsfs",
    "http": "fsspec aiohttp",
    "https": "fsspec aiohttp",
    "s3": "s3fs",
}
# What a batch writes to its folder, which may be that of the motions.
_RESULTS = ("clips.parquet", "parts", "frames", "reports", "repaired")
# Of a file that is written [bytes]: servers allow longer ones than disks do.
_LONGEST_NAME = 200


def find_motions(
    paths: str | Path | Iterable[str | Path], out: Path | None = None
) -> dict[str, str]:
    """The motion files that paths stand for, in the order of their names.

    Folders are searched for files whose suffix is that of a motion, but for what is hidden, and for
    what a batch writes to `out`. A glob stands for what it matches. URLs, of what fsspec opens, may
    be all of these.

    Returns:
        A file's name in results, where it is text whatever its bytes -> the file. Files that are
        not there are among them, if they are called like a motion.

    Raises:
        DynacomError: a path is none of a motion, or a folder holds none; a URL cannot be searched,
            or fsspec or what it needs for it is not installed.
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


def find_places(paths: str | Path | Iterable[str | Path], files: Iterable[str]) -> dict[str, str]:
    """Where what is made of each file lies in a folder: as the files lie in the one they share.

    Which one that is follows from `paths`, so that a file keeps its place when others come or go.

    Args:
        files: what :func:`find_motions` found at `paths`.

    Returns:
        A file -> its place, a relative path; no two files have the same one.
    """
    if isinstance(paths, str | Path):
        paths = [paths]
    parts = {file: _parts(file) for file in files}
    # A path may be a file itself: its folder is what counts.
    folders = [_fixed_parts(str(path)) for path in paths] + [own[:-1] for own in parts.values()]
    shared = len(os.path.commonprefix(folders))
    places: dict[str, str] = {}
    taken: set[str] = set()
    for file, own in parts.items():
        *inside, name = ("_" if part in (".", "..") else part for part in own[shared:] if part)
        place = "/".join([*inside, name])
        if place in taken or len(os.fsencode(name)) > _LONGEST_NAME:
            # Two names of one file, or of URLs that differ in their queries.
            digest = hashlib.sha256(os.fsencode(file)).hexdigest()[:12]
            place = "/".join([*inside, f"{digest}-{_ending(name)}"])
        taken.add(place)
        places[file] = place
    return places


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
        DynacomError: it is no regular file, which would never end; it is a URL that cannot be read.
        OSError: it is not there.
    """
    if not is_url(file):
        if not stat.S_ISREG(os.stat(file).st_mode):
            raise DynacomError(f"{file}: must be a file")
        yield Path(file)
        return
    with tempfile.TemporaryDirectory(prefix="dynacom-") as folder:
        with _remote(file, "read") as (system, path):
            copy = Path(folder, _ending(_without_query(path).rpartition("/")[2]))
            system.get_file(path, str(copy))
        yield copy


def _ending(name: str) -> str:
    """The end of a name, which says what it is, no longer than a disk allows."""
    return os.fsencode(name)[-_LONGEST_NAME:].decode(errors="ignore")


def _parts(path: str) -> tuple[str, ...]:
    """Of a path from the root on, which is empty, or of a URL, whose scheme comes first."""
    if not is_url(path):
        return tuple(os.path.abspath(path).split(os.sep))
    scheme, _, rest = path.partition("::")[0].partition("://")
    rest = _without_query(f"{scheme}://{rest}").partition("://")[2]
    return (scheme.lower(), *filter(None, rest.split("/")))


def _fixed_parts(path: str) -> tuple[str, ...]:
    """Those of a path, or those of a glob before what it leaves open."""
    parts = _parts(path)
    if not is_url(path) and os.path.lexists(path):
        return parts
    return tuple(itertools.takewhile(lambda part: not glob.has_magic(part), parts))


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
    with _remote(url, "searched") as (system, path):
        system.invalidate_cache()  # there may be more than at the last search of this process
        address = _addresses(url, path, system)
        name = _without_query(path)
        is_named = name.lower().endswith(SUFFIXES)
        is_folder = url.endswith("/")
        # Asked first: who may read a file may not always list its folder.
        if is_named and not is_folder and system.isfile(path):
            yield address(path)
        elif glob.has_magic(name):
            for match, info in system.glob(path, detail=True).items():
                if "/." in match and "/." not in name:
                    continue  # hidden
                if info["type"] == "directory":
                    yield from map(address, _search_remote(system, match.rstrip("/")))
                elif match.lower().endswith(SUFFIXES):
                    yield address(match)
        elif is_folder or system.isdir(path):
            yield from map(address, _search_remote(system, path))
        elif is_named or system.exists(path):
            yield address(path)
        else:
            raise DynacomError(f"{url}: must be a file or a folder, which is not there")


def _search_remote(system: Any, folder: str) -> Iterator[str]:
    for file in system.find(folder):
        inside = file[len(folder) :].split("/")
        is_hidden = any(part.startswith(".") for part in inside)
        if file.lower().endswith(SUFFIXES) and not is_hidden:
            yield file


@contextmanager
def _remote(url: str, what: str) -> Iterator[tuple[Any, str]]:
    """fsspec's file system and path; whatever either raises becomes a DynacomError."""
    try:
        import fsspec.core

        yield fsspec.core.url_to_fs(url)
    except DynacomError:
        raise
    except ImportError as error:
        kinds = [kind for kind in re.findall(r"(\w+)://", url) if kind in _PACKAGES]
        package = _PACKAGES[kinds[-1]] if kinds else error.name
        hint = f": pip install {package}" if package else ""
        raise DynacomError(f"{url}: needs a package ({error}){hint}") from error
    except Exception as error:  # of any server's library
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        if isinstance(error, FileNotFoundError) and reason in ("", url):
            reason = os.strerror(errno.ENOENT)
        reason = reason or type(error).__name__
        raise DynacomError(f"{url}: cannot be {what} ({reason})") from error


def _addresses(url: str, path: str, system: Any) -> Callable[[str], str]:
    """What makes a URL of a path, as url is one of path: with its server, or what is around it."""
    # zip://folder::s3://bucket/archive.zip
    head, chain = re.fullmatch(r"(.*?://.*?)((?:::.*)?)", url, re.DOTALL).groups()
    start = head.rfind(path)
    if start < 0 or head[start + len(path) :].strip("/"):
        return system.unstrip_protocol
    return lambda found: f"{head[:start]}{found}{chain}"


def _without_query(path: str) -> str:
    """Of HTTP, where ? does not belong to a file's name."""
    is_http = path.lower().startswith(("http://", "https://"))
    return path.partition("?")[0] if is_http else path
