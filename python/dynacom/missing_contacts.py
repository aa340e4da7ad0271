# SPDX-License-Identifier: BSD-2-Clause
"""What all that may carry cannot give of what a motion needs: how much, when, and what to do."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from dynacom.analysis_options import AnalysisOptions
from dynacom.dynacom_pywrap import DistributionStatus, MotionExamination, MotionStatistics

# What is measured of forces: where one is beyond its limit, something is missing.
_FAULTS = ("residual_force", "residual_torque", "cop_outside", "flight_with_support_needed")
#: What forces are compared with in verdicts, whatever gravity is [m/s^2].
STANDARD_GRAVITY = 9.81
# So many intervals are told one by one.
_LISTED = 3
# From which mean residual on it may be a load that nobody has told of, [m g] or [m g m], and as a
# part of the residual's root mean square, since a load does not change its sign: a box that a G1
# carries for half of a clip comes to 0.005 and a quarter, dances without a load to a twentieth.
_LOAD, _LOAD_PART = 0.003, 0.2
# Nothing pulls along the ground by more than this all the time, and no load that is carried weighs
# more than this, or presses with more than this, [m g] and [m g m].
_PULL, _LARGEST = 0.02, 0.3
# Durations may lack this through the rounding of times [s].
_ROUNDING = 1e-9


def find_missing(found: MotionExamination, options: AnalysisOptions) -> dict[str, Any] | None:
    """Where a contact is missing: what carries cannot give what the motion needs.

    Frames count that are beyond the limit of a fault that is about forces, for
    ``verdict.interruption`` and longer, but for interruptions that are shorter than that.

    Returns:
        What summary.json has as ``contact_missing``; None if nothing is missing, or nothing can be
        said.
    """
    verdict, settings = found.verdict, options.verdict
    if verdict.outcome == "unknown":
        return None
    findings = verdict.findings
    measured = {code: findings[code].measured for code in _FAULTS}
    beyond = [measured[code] > getattr(settings, code).limit for code in _FAULTS]
    time = found.analysis.time
    intervals = _intervals(np.any(beyond, axis=0), time, settings.interruption)
    if not intervals:
        return None
    missing = np.zeros(len(time), dtype=bool)
    for first, last in intervals:
        missing[first : last + 1] = True
    residual = found.analysis.residual[missing & ~np.asarray(verdict.unsure)]
    largest = np.linalg.norm(residual.reshape(-1, 2, 3), axis=2).max(axis=0)
    # As the faults have it, whatever gravity is.
    force, torque = (largest / (found.statistics.mass * STANDARD_GRAVITY)).tolist()
    return {
        "frames": int(np.count_nonzero(missing)),
        "share": float(np.mean(missing)),
        "times": [[float(time[first]), float(time[last])] for first, last in intervals],
        "force": force,
        "torque": torque,
        "distance": float(measured["cop_outside"][missing].max()),
    }


def _intervals(beyond: np.ndarray, time: np.ndarray, least: float) -> list[tuple[int, int]]:
    """Frames that are beyond a limit for so long [s] and more, but for shorter interruptions."""
    # Each frame lasts until the next one; the last one of all as long as the one before it.
    ends = np.append(time[1:], 2.0 * time[-1] - time[-2] if len(time) > 1 else time[-1])
    intervals: list[tuple[int, int]] = []
    for frame in np.flatnonzero(beyond).tolist():
        first, last = intervals[-1] if intervals else (frame, frame)
        if last < frame - 1 and time[frame] - ends[last] >= least - _ROUNDING:
            intervals.append((frame, frame))
        else:
            intervals[-1:] = [(first, frame)]
    return [
        (first, last) for first, last in intervals if ends[last] - time[first] >= least - _ROUNDING
    ]


def missing_texts(
    missing: dict[str, Any] | None,
    found: MotionExamination,
    options: AnalysisOptions,
    is_reversed: bool,
) -> Iterator[str]:
    """Sentences on what is missing, and on what may be done about it.

    Args:
        missing: of :func:`find_missing`.
        is_reversed: whether a contact's normal points down.
    """
    statistics = found.statistics
    if missing is not None:
        frames = statistics.frames
        yield (
            f"What may carry cannot give what the motion needs in {missing['frames']} of {frames} "
            f"frames, {_times_text(missing['times'])}: up to {_amount_text(missing)}. "
            f"{_advice(found, options)}"
        )
    # Neither a robot's description that is wrong nor a seat says anything of loads.
    if not is_reversed and not found.seats and _is_load(statistics):
        force, torque = map(_vector_text, statistics.mean_residual.reshape(2, 3))
        yield (
            f"Where a contact is active, ({force}) N and ({torque}) N m are missing on average, "
            "forward, left and up: a load that nobody has told of may be the reason, and --payload "
            "tells of it."
        )


def unexplained(statistics: MotionStatistics) -> dict[str, Any]:
    """What contacts cannot give, on average: docs/verdict.md."""
    residual = statistics.mean_residual.tolist()
    share = 1.0 - statistics.share(DistributionStatus.Solved)
    return {"share": share, "force": residual[:3], "torque": residual[3:]}


def _vector_text(values: np.ndarray) -> str:
    """Three numbers, of which those that are nothing beside the others are 0."""
    small = np.abs(values) < 1e-3 * np.abs(values).max()
    return ", ".join(f"{value:.3g}" for value in np.where(small, 0.0, values))


def _times_text(times: list[list[float]]) -> str:
    texts = [f"from {begin:.2f} to {end:.2f} s" for begin, end in times[:_LISTED]]
    if (more := len(times) - _LISTED) > 0:
        return f"{', '.join(texts)} and {more} more {'times' if more > 1 else 'time'}"
    *first, last = texts
    return f"{', '.join(first)} and {last}" if first else last


def _amount_text(missing: dict[str, Any]) -> str:
    force, torque = missing["force"], missing["torque"]
    text = f"{force:.2g} m g of force and {torque:.2g} m g m of moment are missing"
    if missing["distance"] > 0.0:
        text += (
            f", and the centre of pressure is needed up to {missing['distance']:.2g} m outside it"
        )
    return text


def _advice(found: MotionExamination, options: AnalysisOptions) -> str:
    """What may be done."""
    if found.inferred is not None:
        text = "the given contacts are wrong there"
    elif found.seats:
        text = "there is a seat, which a contact of the robot file on that link and --schedule tell"
    else:
        text = (
            "something carries that is not known: a foot on a box is told by --schedule, another "
            "link on something by a contact of the robot file besides"
        )
    if options.feet_only:
        text += "; or knees or hands carry, which --feet-only leaves out"
    return f"Either {text}; or the robot leans too far, or accelerates too much."


def _is_load(statistics: MotionStatistics) -> bool:
    """Whether what is missing may be a load: enough of it, and much the same all the time."""
    means = np.linalg.norm(statistics.mean_residual.reshape(2, 3), axis=1) / statistics.weight
    spread = np.array([statistics.residual_force_rms, statistics.residual_torque_rms])
    pull = np.linalg.norm(statistics.mean_residual[:2]) / statistics.weight
    may_be = pull < _PULL and (means < _LARGEST).all()
    return bool(may_be and (means > np.maximum(_LOAD, _LOAD_PART * spread)).any())
