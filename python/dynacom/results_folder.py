# SPDX-License-Identifier: BSD-2-Clause
"""Results that appear whole, or not at all."""

import errno
import os
import secrets
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from dynacom.errors import DynacomError


def save_results(
    folder: str | Path, own: Iterable[str], write: Callable[[Path], None]
) -> list[Path]:
    """Files that appear in a folder when all of them are written.

    Args:
        folder, own: as in :func:`results_folder`.
        write: writes them into the folder that it is given.

    Returns:
        The files.

    Raises:
        DynacomError: the folder cannot be written to.
    """
    folder = Path(folder)
    try:
        with results_folder(folder, own) as temporary:
            write(temporary)
            names = sorted(file.name for file in temporary.iterdir())
    except OSError as error:
        raise DynacomError(f"{folder}: cannot be written ({error.strerror or error})") from error
    return [folder / name for name in names]


@contextmanager
def results_folder(path: Path, own: Iterable[str] = ()) -> Iterator[Path]:
    """A temporary folder, whose files appear in path when all has gone well.

    Whatever goes wrong, an interruption too, path is left as it was. Files of the same names are
    replaced, others stay.

    Args:
        own: names of files of an earlier time that are taken away where there is no new one.

    Raises:
        OSError: path is not a folder, or cannot be written to, or has a folder where a file shall
            be.
    """
    made = [folder for folder in (path, *path.parents) if not folder.exists()]
    # Inside, so that it is on the same file system and needs no right to write elsewhere. Its name
    # is known before it is made: an interruption may come at any time.
    temporary = path / f".dynacom-{secrets.token_hex(8)}"
    results, replaced = temporary / "results", temporary / "replaced"
    names, finished = [], False
    try:
        path.mkdir(parents=True, exist_ok=True)
        temporary.mkdir()
        results.mkdir()
        replaced.mkdir()
        yield results
        names = sorted({file.name for file in results.iterdir()} | set(own))
        for name in names:
            if (path / name).is_dir():
                raise IsADirectoryError(errno.EISDIR, f"{name} is a folder")
        for name in names:
            if (path / name).exists():
                os.replace(path / name, replaced / name)
            if (results / name).exists():
                os.replace(results / name, path / name)
        finished = True
    finally:
        if not finished:
            for name in names:
                if not (results / name).exists():
                    (path / name).unlink(missing_ok=True)
                if (replaced / name).exists():
                    os.replace(replaced / name, path / name)
        shutil.rmtree(temporary, ignore_errors=True)
        if not finished:
            for folder in made:
                with suppress(OSError):
                    folder.rmdir()
