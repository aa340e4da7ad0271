# SPDX-License-Identifier: BSD-2-Clause
"""How far a motion is from a feasible one, in the summary and in words."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from dynacom.dynacom_pywrap import MotionExamination

# From where on a distance is told as that alone, if it is not known [m].
_FAR = 1.0


def distance_summary(found: MotionExamination) -> dict[str, Any] | None:
    """In the summary: [m], [s]. None where nobody asked for it, or nothing can be said."""
    change = found.distance
    if change is None:
        return None
    return {
        "rms": change.rms,
        "largest": change.largest,
        "time": float(found.analysis.time[change.frame]),
        "converged": change.converged,
    }


def distance_arrays(found: MotionExamination) -> dict[str, np.ndarray]:
    """Of the table of frames: NaN where there is no distance."""
    com, change = found.analysis.com, found.distance
    displacement = np.full_like(com, np.nan) if change is None else change.com
    return {
        "distance": np.linalg.norm(displacement, axis=1),
        "feasible_com": com + displacement,
    }


def distance_text(
    distance: Mapping[str, Any], moment: Callable[[float], str] = "{:.2f} s".format
) -> str:
    """What :func:`distance_summary` found, in words.

    Args:
        moment: writes a time [s].
    """
    if distance["largest"] == 0.0:
        return "0 mm: the contacts can give what is needed in every frame that is judged"
    if distance["largest"] > _FAR and not distance["converged"]:
        return f"more than {_FAR:g} m from a feasible motion, if there is one: the search ended"
    text = (
        f"{_millimetres(distance['rms'])} from a feasible motion (RMS; "
        f"{_millimetres(distance['largest'])} at most, at {moment(distance['time'])})"
    )
    return text if distance["converged"] else f"{text}, roughly: its search did not converge"


def _millimetres(metres: float) -> str:
    # Tenths where they matter, and nothing behind the point of what is large.
    return f"{1e3 * metres:.{1 if metres < 0.00995 else 0}f} mm"
