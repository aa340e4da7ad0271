# SPDX-License-Identifier: BSD-2-Clause
"""Motions from files."""

from pathlib import Path

import numpy as np

from dynacom.errors import DynacomError
from dynacom.motion_clip import Clip, Options
from dynacom.motion_csv import read_csv
from dynacom.motion_npz import read_npz
from dynacom.motion_parquet import read_parquet
from dynacom.motion_pickle import read_pickle
from dynacom.robots import Robot, load_robot

__all__ = ["Clip", "read_motion"]

_READERS = {
    ".csv": read_csv,
    ".csv.gz": read_csv,
    ".parquet": read_parquet,
    ".npz": read_npz,
    ".pkl": read_pickle,
    ".pickle": read_pickle,
    ".joblib": read_pickle,
}

#: How the names of files end that can be read.
SUFFIXES = tuple(_READERS)


def read_motion(
    path: str | Path,
    robot: Robot | str | Path,
    *,
    fps: float | None = None,
    quat: str | None = None,
    trust: bool = False,
    clip: str | None = None,
) -> Clip:
    """Reads a robot's motion from a file, and checks that it can be one.

    docs/files.md says what the formats are; the suffix tells which: .csv, .csv.gz, .parquet, .npz,
    .pkl (.pickle, .joblib).

    Args:
        path: the file.
        robot: whose motion it is: a robot, or what :func:`load_robot` takes, a name or a file.
        fps: frame rate [Hz], for files that have neither times nor a frame rate. It counts more
            than a file's frame rate, and less than its times.
        quat: order of the root's quaternion where the file does not name its components: ``xyzw``
            or ``wxyz``. By default xyzw, in the archives of whole_body_tracking wxyz.
        trust: whether a pickle may do whatever it likes: joblib's files cannot be read otherwise.
        clip: name of the clip to read, where a pickle holds several.

    Raises:
        DynacomError: the file cannot be read, is in none of the formats, or is no motion of this
            robot: other joints, quaternions of another order, degrees, numbers that are not finite,
            times that do not increase or have a hole. The message is one line that says
            what and where.
    """
    path = Path(path)
    if not isinstance(robot, Robot):
        robot = load_robot(robot)
    if quat not in (None, "xyzw", "wxyz"):
        raise DynacomError(f"quat must be xyzw or wxyz, got '{quat}'")
    suffix = suffix_of(path)
    if suffix not in _READERS:
        if path.is_dir():
            raise DynacomError(f"{path}: cannot be read (Is a directory)")
        raise DynacomError(f"{path}: must end in one of {', '.join(_READERS)}, got '{path.name}'")
    try:
        with np.errstate(all="ignore"):  # what overflows is refused
            return _READERS[suffix](path, robot, Options(fps, quat, trust, clip))
    except OSError as error:
        raise DynacomError(f"{path}: cannot be read ({error.strerror or error})") from error


def suffix_of(path: Path) -> str:
    """How the name ends, in small letters; if it is compressed, by two."""
    return "".join(path.suffixes[-2 if path.suffix.lower() == ".gz" else -1 :]).lower()
