# SPDX-License-Identifier: BSD-2-Clause
"""What all that may carry cannot give of what a motion needs: how much, when, and what to do."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from dynacom.analysis_options import AnalysisOptions
from dynacom.dynacom_pywrap import (
    DistributionStatus,
    MissingSupport,
    MotionExamination,
    MotionStatistics,
)

# So many intervals are told one by one.
_LISTED = 3


def missing_summary(missing: MissingSupport | None) -> dict[str, Any] | None:
    """What summary.json has as ``contact_missing``: docs/verdict.md."""
    if missing is None:
        return None
    return {
        "frames": missing.frames,
        "share": missing.share,
        "times": [[interval.begin, interval.end] for interval in missing.intervals],
        "force": missing.force,
        "torque": missing.torque,
        "distance": missing.cop_distance,
    }


def missing_texts(
    found: MotionExamination, options: AnalysisOptions, is_reversed: bool
) -> Iterator[str]:
    """Sentences on what is missing, and on what may be done about it.

    Args:
        is_reversed: whether a contact's normal points down.
    """
    statistics = found.statistics
    if (missing := found.missing_support) is not None:
        frames = statistics.frames
        yield (
            f"What may carry cannot give what the motion needs in {missing.frames} of {frames} "
            f"frames, {_times_text(missing.intervals)}: up to {_amount_text(missing)}. "
            f"{_advice(found, options)}"
        )
    # Neither a robot's description that is wrong nor a seat says anything of loads.
    if not is_reversed and not found.seats and statistics.mayBeLoad():
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


def _times_text(intervals: list[MissingSupport.Interval]) -> str:
    texts = [f"from {times.begin:.2f} to {times.end:.2f} s" for times in intervals[:_LISTED]]
    if (more := len(intervals) - _LISTED) > 0:
        return f"{', '.join(texts)} and {more} more {'times' if more > 1 else 'time'}"
    *first, last = texts
    return f"{', '.join(first)} and {last}" if first else last


def _amount_text(missing: MissingSupport) -> str:
    text = f"{missing.force:.2g} m g of force and {missing.torque:.2g} m g m of moment are missing"
    if missing.cop_distance > 0.0:
        text += (
            f", and the centre of pressure is needed up to {missing.cop_distance:.2g} m outside it"
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
