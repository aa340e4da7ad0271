# SPDX-License-Identifier: BSD-2-Clause
"""What a motion file can have wrong, noticed before anything is computed from it.

Frames count from 0. All limits stand here; they are generous, so that what goes beyond is a mistake
in the file or in how it was read, and no motion. Comparisons are such that what is not a number
counts as beyond them.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from dynacom.errors import DynacomError
from dynacom.robots import Robot

#: |norm - 1| of a quaternion: more than rounding and interpolation do to it.
QUATERNION_ERROR = 0.1
#: Above this it is noted. Six digits make less.
QUATERNION_NOTED = 1e-5
#: Vertical component of the root's z axis in the median frame: below the first (53° of inclination)
#: the robot does not stand, above the second (37°) it does.
NOT_UPRIGHT, UPRIGHT = 0.6, 0.8
#: Angles are degrees if so many joints are so far outside their limits [rad] in the median frame,
#: or one of them by more than a turn, and none is as far as the last number once they are radians.
DEGREES_SHARE, DEGREES_EXCESS, RADIANS_EXCESS = 0.4, 1.0, 0.35
TURN = 2.0 * np.pi
#: An angle so far outside its limits is noted [rad]. Retargeted motions go a little beyond.
NOTED_EXCESS = 0.1
#: A time step, in median ones: of evenly spaced frames, two may be missing in a row.
HOLE = 3.5

_ORDERS = {"xyzw": "x y z w", "wxyz": "w x y z"}


def check_finite(path: Path, what: str | Callable[[int], str], values: np.ndarray) -> None:
    """Refuses NaN and infinity.

    Args:
        what: the array's name, or its columns' by their indices.
        values: (T, ...).

    Raises:
        DynacomError
    """
    finite = np.isfinite(values)
    if finite.all():
        return
    frame, *column = map(int, np.argwhere(~finite)[0])
    value = values[(frame, *column)]
    if not isinstance(what, str):
        what, column = what(column[0]), []
    where = f" of column {', '.join(map(str, column))}" if column else ""
    raise DynacomError(f"{path}: {what} must be finite, got {value} in frame {frame}{where}")


def make_time(
    path: Path,
    frames: int,
    time: np.ndarray | None = None,
    file_fps: float | None = None,
    fps: float | None = None,
) -> tuple[np.ndarray, list[str]]:
    """The frames' times, and notes.

    Args:
        time: in the file, if it has them; they count.
        file_fps: the frame rate in the file, if it has one [Hz].
        fps: the frame rate that was asked for, if any, which counts more than the file's.

    Raises:
        DynacomError: there is no frame, or neither times nor a frame rate; a frame rate is not
            positive; times are not finite, do not increase, or have a hole.
    """
    if frames == 0:
        raise DynacomError(f"{path}: must have at least one frame, got none")
    if fps is not None:
        _check_rate("fps", fps)
    if time is not None:
        check_finite(path, "time", time)
        _check_steps(path, time)
        unused = fps is not None
        return time, ["The file has times of its own: --fps is not used."] if unused else []
    if file_fps is None and fps is None:
        raise DynacomError(f"{path}: has no times and no frame rate: give --fps")
    if fps is None:
        _check_rate(f"{path}: fps", file_fps)
        return np.arange(frames) / file_fps, []
    differs = file_fps is not None and fps != file_fps
    return np.arange(frames) / fps, (
        [f"The file says {file_fps:g} frames per second; --fps {fps:g} counts."] if differs else []
    )


def _check_rate(what: str, rate: float) -> None:
    if not (np.isfinite(rate) and rate > 0.0):
        raise DynacomError(f"{what} must be finite and > 0 Hz, got {rate:g}")


def _check_steps(path: Path, time: np.ndarray) -> None:
    steps = np.diff(time)
    if not (steps > 0.0).all():
        frame = int(np.argmax(steps <= 0.0)) + 1
        raise DynacomError(
            f"{path}: time must increase, got {time[frame - 1]:.10g} s and then "
            f"{time[frame]:.10g} s in frame {frame}"
        )
    if len(steps) and steps.max() > HOLE * np.median(steps):
        frame = int(np.argmax(steps))
        raise DynacomError(
            f"{path}: time must have no holes, got one of {steps[frame]:.4g} s between frame "
            f"{frame} ({time[frame]:.6g} s) and the next, where steps are {np.median(steps):.4g} s"
        )


def to_xyzw(quaternion: np.ndarray, order: str) -> np.ndarray:
    """Quaternions (..., 4) of the given order as x y z w."""
    return quaternion if order == "xyzw" else quaternion[..., [1, 2, 3, 0]]


def from_xyzw(quaternion: np.ndarray, order: str) -> np.ndarray:
    """The inverse of :func:`to_xyzw`."""
    return quaternion if order == "xyzw" else quaternion[..., [3, 0, 1, 2]]


def normalize(
    path: Path,
    quaternion: np.ndarray,
    order: str | None = None,
    option: bool = False,
    believed: bool = False,
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Normalises the root's quaternions.

    Args:
        quaternion: (T, 4), x y z w.
        order: in which the file's were taken, ``xyzw`` or ``wxyz``; None where the file names
            their components.
        option: whether ``--quat`` can change it.
        believed: whether ``--quat`` says it: robots may lie.

    Returns:
        Quaternions of norm 1, where the norm was 1 up to rounding as they are; |norm - 1|; and
        notes.

    Raises:
        DynacomError: a norm is far from 1; or the robot would stand if the order were the other,
            and does not as it is, and nobody says so.
    """
    norm = np.linalg.norm(quaternion, axis=1)
    error = np.abs(norm - 1.0)
    if not error.max() <= QUATERNION_ERROR:
        frame = int(np.argmax(error))
        raise DynacomError(
            f"{path}: the root's quaternion must have norm 1, got {norm[frame]:.4g} in frame "
            f"{frame}: are these its columns?"
        )
    quaternion = quaternion / np.where(error > 1e-12, norm, 1.0)[:, None]
    if order is not None:
        other = "wxyz" if order == "xyzw" else "xyzw"
        # The file's columns as they would be in the other order.
        columns = quaternion if order == "xyzw" else quaternion[:, [3, 0, 1, 2]]
        heights = _heights(quaternion)
        if heights.min() < NOT_UPRIGHT:  # else their median is not either
            up, other_up = np.median(heights), np.median(_heights(to_xyzw(columns, other)))
            if up < NOT_UPRIGHT and other_up > UPRIGHT:
                turn = (
                    f"turn its z axis to a height of {up:.2f} in the median frame, and to "
                    f"{other_up:.2f} in the other order"
                )
                if believed:
                    return quaternion, error, [f"The root's quaternions, {_ORDERS[order]}, {turn}."]
                raise DynacomError(
                    f"{path}: the root's quaternions must be {_ORDERS[order]}, got "
                    f"{_ORDERS[other]}: they {turn}"
                    + (f"; give --quat {other}, or --quat {order} if it does lie" if option else "")
                )
    return quaternion, error, []


def _heights(quaternion: np.ndarray) -> np.ndarray:
    """Vertical component of the root's z axis, (T,)."""
    return 1.0 - 2.0 * (quaternion[:, 0] ** 2 + quaternion[:, 1] ** 2)


def check_angles(path: Path, robot: Robot, names: Sequence[str], angles: np.ndarray) -> list[str]:
    """Refuses angles in degrees; notes those outside the joints' limits.

    Args:
        names: of k joints.
        angles: (T, k).

    Raises:
        DynacomError: they are far outside the joints' limits, and within if they are degrees.
    """
    joints = robot.joints.take(names)
    limited = np.flatnonzero(joints.turns & ~joints.unlimited)
    if not len(limited):
        return []
    indices = joints.idx_q[limited]
    lower = robot.model.lowerPositionLimit[indices]
    upper = robot.model.upperPositionLimit[indices]
    angles = angles[:, limited]
    above_lower = angles.min(axis=0) >= lower - NOTED_EXCESS
    if (above_lower & (angles.max(axis=0) <= upper + NOTED_EXCESS)).all():
        return []

    def excess(values: np.ndarray) -> np.ndarray:
        return np.maximum(lower - values, values - upper)

    outside = excess(angles)
    frame, column = np.unravel_index(np.argmax(outside), outside.shape)
    name, value = names[limited[column]], angles[frame, column]
    limits = f"{lower[column]:.4g} to {upper[column]:.4g} rad"
    is_far = False
    if outside[frame, column] > DEGREES_EXCESS:  # else no median is, and medians take long
        usual = np.median(outside, axis=0)
        is_far = np.mean(usual > DEGREES_EXCESS) >= DEGREES_SHARE or usual.max() > TURN
    if is_far and excess(np.deg2rad(angles)).max() < RADIANS_EXCESS:
        raise DynacomError(
            f"{path}: joints must be in radians, got degrees: {name} ({limits}) is {value:.4g} in "
            f"frame {frame}"
        )
    return [
        f"The joint {name} ({limits}) goes beyond its limits: {value:.4g} rad in frame {frame}."
    ]
