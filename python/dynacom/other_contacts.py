# SPDX-License-Identifier: BSD-2-Clause
"""What touches the ground besides a robot's contacts: knees, hands, a back."""

from collections.abc import Iterator
from typing import Any

from dynacom.analysis_options import AnalysisOptions
from dynacom.dynacom_pywrap import MotionExamination
from dynacom.motion_joints import brief
from dynacom.robots import Robot


def body_statistics(found: MotionExamination) -> dict[str, dict[str, float]]:
    """Link's name -> what part of the frames it is active in, and its vertical force [m g]."""
    return {
        body.link: {
            "active_share": body.active_share,
            "weight_share": body.weight_share,
            "largest_vertical_force": body.largest_vertical_force,
        }
        for body in found.statistics.bodies
    }


def seat_statistics(found: MotionExamination) -> list[dict[str, Any]]:
    """The links that would have to carry where no ground is known: docs/verdict.md."""
    time = found.analysis.time
    return [
        {
            "link": seat.link,
            "begin": float(time[seat.first]),
            "end": float(time[seat.behind - 1]),
            "height": seat.height,
            "weight_share": seat.weight_share,
        }
        for seat in found.seats
    ]


def body_texts(robot: Robot, options: AnalysisOptions, found: MotionExamination) -> Iterator[str]:
    """Sentences on the links that carry, and on those that might and are not known."""
    statistics = found.statistics
    if statistics.bodies:
        *first, last = (body.link for body in statistics.bodies)
        names = f"{', '.join(first)} and {last}" if first else last
        yield (
            f"{names} {'carry' if first else 'carries'} "
            f"{statistics.bodies_weight_share_while_active:.0%} of the weight in "
            f"{statistics.bodies_active_share:.0%} of the frames; --feet-only leaves such contacts "
            "out."
        )
    for seat in seat_statistics(found):
        yield (
            f"{seat['link']} would have to carry {seat['weight_share']:.0%} of the weight at "
            f"{seat['height']:.2f} m from {seat['begin']:.2f} to {seat['end']:.2f} s, "
            "where no ground is known: a seat? Its force is not counted."
        )
    if options.feet_only or found.verdict.feasible:
        return
    if missing := robot.collision_points.missing:
        yield (
            f"{len(missing)} meshes of the robot's collision geometry cannot be read, and so what "
            f"else may touch the ground is not known: {brief(missing)}."
        )
