# SPDX-License-Identifier: BSD-2-Clause
"""Motions into files, each in the format of the file that it is from."""

import os
import secrets
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from dynacom.dynacom_pywrap import ContactSchedule
from dynacom.errors import DynacomError
from dynacom.motion_change import Change
from dynacom.motion_clip import Clip
from dynacom.motion_csv import write_csv
from dynacom.motion_file import suffix_of
from dynacom.motion_npz import write_npz
from dynacom.motion_parquet import write_parquet
from dynacom.motion_pickle import write_pickle

_WRITERS = {
    ".csv": write_csv,
    ".csv.gz": write_csv,
    ".parquet": write_parquet,
    ".npz": write_npz,
    ".pkl": write_pickle,
    ".pickle": write_pickle,
    ".joblib": write_pickle,
}


def write_motion(
    clip: Clip,
    path: str | Path,
    q: np.ndarray,
    *,
    schedule: ContactSchedule | None = None,
    forces: Mapping[str, np.ndarray] | None = None,
    mark: bool = True,
    stretch: float = 1.0,
) -> list[str]:
    """Writes new configurations of a clip in the format of its file.

    The clip's file is read again: whatever in it does not follow from the configurations is kept,
    and where these are those of the clip, their numbers are, bit for bit. What follows from them is
    computed anew, or left out, which a note says. docs/files.md tells more.

    Args:
        clip: what :func:`read_motion` returned, from a file that has not changed since.
        path: the file to write, with the suffix of the clip's; it is there as a whole or not at
            all.
        q: (T, nq), of all frames of the clip. Frames and joints that the clip's file does not have
            are not written.
        schedule: when contacts are active, T frames, for files that say so; None to keep what they
            say.
        forces: contact's name -> its force, (T, 6) or (T, 3), as :attr:`Clip.forces`, for files
            that have them.
        mark: whether to mark the motion as exact, so that it is read without a filter: in the file,
            or, for CSV, by what :func:`mark_of` says, which is to be written beside it.
        stretch: by which factor the motion is slower: times t become t0 + stretch (t - t0), frame
            rates are divided by it. Where the file has neither, a note tells the rate.

    Returns:
        Notes: sentences on what is not as it was, besides the motion.

    Raises:
        DynacomError: the path is the clip's own, has another suffix, or cannot be written; the
            clip's file cannot be read or has changed; an argument has the wrong shape.
    """
    path = Path(path)
    if clip.options is None or clip.robot is None:
        raise DynacomError("clip must be one that read_motion has read, got one that was made")
    suffix = suffix_of(clip.path)
    if suffix_of(path) != suffix:
        raise DynacomError(f"{path}: must end in {suffix}, as {clip.path.name}, got '{path.name}'")
    if path.resolve() == clip.path.resolve() or (path.exists() and path.samefile(clip.path)):
        raise DynacomError(f"{path}: must be another file than the one that was read")
    change = Change.of(clip, q, schedule, forces, mark, stretch)
    content = motion_content(change)
    try:
        _replace(path, content)
    except OSError as error:
        raise DynacomError(f"{path}: cannot be written ({error.strerror or error})") from error
    return change.notes


def motion_content(change: Change) -> bytes:
    """The file of a clip, with a change in it.

    Raises:
        DynacomError: the clip's file cannot be read or has changed.
    """
    path = change.clip.path
    try:
        return _WRITERS[suffix_of(path)](change)
    except OSError as error:
        raise DynacomError(f"{path}: cannot be read ({error.strerror or error})") from error


def _replace(path: Path, content: bytes) -> None:
    """Writes a file at once: nobody finds a half of it."""
    temporary = path.with_name(f".dynacom-{secrets.token_hex(8)}")
    try:
        with temporary.open("xb") as file:
            file.write(content)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
