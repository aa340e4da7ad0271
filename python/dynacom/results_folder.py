# SPDX-License-Identifier: BSD-2-Clause
"""Results that appear whole, or not at all."""

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def results_folder(path: Path) -> Iterator[Path]:
    """A temporary folder, whose files appear in path when all has gone well.

    Whatever goes wrong, an interruption too, path is left as it was. Files of the same names are
    replaced, others stay.

    Raises:
        OSError: path is not a folder, or cannot be written to.
    """
    existed, finished = path.exists(), False
    # Inside, so that it is on the same file system and needs no right to write elsewhere. Its name
    # is known before it is made: an interruption may come at any time.
    temporary = path / f".dynacom-{secrets.token_hex(8)}"
    try:
        path.mkdir(parents=True, exist_ok=True)
        temporary.mkdir()
        yield temporary
        for file in sorted(temporary.iterdir()):
            os.replace(file, path / file.name)
        finished = True
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
        if not existed and not finished:
            with suppress(OSError):
                path.rmdir()
