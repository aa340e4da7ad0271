# SPDX-License-Identifier: BSD-2-Clause
"""Motions from files."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from dynacom.dynacom_pywrap import ContactSchedule, Motion
from dynacom.errors import DynacomError


class MotionFile(NamedTuple):
    """What a motion file holds."""

    motion: Motion
    #: None where the file does not say when which contact is active.
    schedule: ContactSchedule | None
    #: The file's other arrays, by name, as they are.
    extras: dict[str, np.ndarray]


def read_motion(path: str | Path) -> MotionFile:
    """Reads a motion from a NumPy archive (.npz).

    The archive holds, with one row for each of T frames:

    ============= ======= =====================================================================
    t             (T,)    times, strictly increasing [s]
    q             (T, nq) configurations, in Pinocchio's order: free-flyer's position [m] and
                          quaternion (x, y, z, w), then the joints
    v, a          (T, nv) velocities and accelerations, as in Pinocchio
    contacts      (T, C)  of bool: which contacts are active; may be absent, with the next
    contact_names (C,)    of str: their names
    ============= ======= =====================================================================

    Sizes, and the numbers themselves, are checked by ``Motion.validate``,
    ``ContactSchedule.validate`` and :func:`analyzeMotion`, which know the robot.

    Raises:
        DynacomError: the file is not there, is not such an archive, or an array is missing, or has
            another type or another number of dimensions.
    """
    try:
        archive = np.load(path, allow_pickle=False)
    except OSError as error:
        raise DynacomError(f"{path}: cannot be read ({error.strerror or error})") from error
    except Exception as error:  # NumPy promises no type for what is no archive, or a broken one
        raise DynacomError(f"{path}: must be a NumPy archive (.npz), got another file") from error
    if not isinstance(archive, np.lib.npyio.NpzFile):
        raise DynacomError(f"{path}: must be a NumPy archive (.npz), got a single array")
    with archive:
        return _read_archive(path, archive)


def _read_archive(path: str | Path, archive: np.lib.npyio.NpzFile) -> MotionFile:
    motion = Motion(
        _read_numbers(path, archive, "t", 1),
        _read_numbers(path, archive, "q", 2),
        _read_numbers(path, archive, "v", 2),
        _read_numbers(path, archive, "a", 2),
    )
    schedule = None
    if "contacts" in archive or "contact_names" in archive:
        active = _read_array(path, archive, "contacts", 2, "b", "bool")
        names = _read_array(path, archive, "contact_names", 1, "U", "str")
        schedule = ContactSchedule(names.tolist(), active)
    used = {"t", "q", "v", "a", "contacts", "contact_names"}
    extras = {}
    for name in archive.files:
        if name not in used:
            try:
                extras[name] = archive[name]
            except Exception:
                # Nobody asked for it, so that it may be pickled, or broken.
                continue
    return MotionFile(motion, schedule, extras)


def _read_numbers(
    path: str | Path, archive: np.lib.npyio.NpzFile, name: str, dimensions: int
) -> np.ndarray:
    array = _read_array(path, archive, name, dimensions, "iuf", "real numbers")
    return array.astype(float, copy=False)


def _read_array(
    path: str | Path,
    archive: np.lib.npyio.NpzFile,
    name: str,
    dimensions: int,
    kinds: str,
    expected: str,
) -> np.ndarray:
    """An array of the archive, checked.

    Args:
        kinds: the letters of numpy.dtype.kind that will do.
        expected: what they mean.
    """
    if name not in archive:
        raise DynacomError(
            f"{path}: missing array '{name}', got {', '.join(archive.files) or 'none'}"
        )
    try:
        array = np.asarray(archive[name])
    except Exception as error:  # as above
        raise DynacomError(f"{path}: array '{name}' cannot be read ({error})") from error
    if array.dtype.kind not in kinds:
        raise DynacomError(f"{path}: array '{name}' must be of {expected}, got {array.dtype}")
    if array.ndim != dimensions:
        raise DynacomError(
            f"{path}: array '{name}' must have {dimensions} dimension{'s'[: dimensions - 1]}, "
            f"got shape {array.shape}"
        )
    return array
