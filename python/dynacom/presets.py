# SPDX-License-Identifier: BSD-2-Clause
"""Limits of the verdict that others have published, by name: docs/verdict.md has their table."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
import pinocchio as pin

from dynacom.dynacom_pywrap import Motion, VerdictSettings, computeContactMotions
from dynacom.errors import DynacomError
from dynacom.robots import STANDARD_GRAVITY, Robot

# Faults that say how much is wrong, and not that something is: a tenth of their limits means
# something.
_GRADUAL = (
    *("residual_force", "residual_torque", "cop_outside", "flight_with_support_needed"),
    *("ground_penetration", "foot_sliding"),
)


def preset_values(name: str, robot: Robot) -> dict[str, Any]:
    """The settings of a preset, as a settings file would hold them.

    Args:
        name: one of :data:`PRESETS`.
        robot: whose mass makes newtons parts of the weight.

    Raises:
        DynacomError: there is no such preset, or it needs what the robot does not have.
    """
    if name not in PRESETS:
        raise DynacomError(f"unknown preset {name!r}, expected {', '.join(PRESETS)}")
    return {"verdict": PRESETS[name](robot)}


def _hicks(robot: Robot) -> dict[str, Any]:
    """Peaks of 5 % of the net external force, and of 1 % of CoM's height times that.

    J. L. Hicks, T. K. Uchida, A. Seth, A. Rajagopal, S. L. Delp: Is My Model Good Enough? Best
    Practices for Verification and Validation of Musculoskeletal Models and Simulations of Movement,
    J. Biomech. Eng. 137(2), 020905, 2015, section 3.1.3.
    """
    return _residuals(0.05, 0.01 * _com_height(robot))


def _opensim(robot: Robot) -> dict[str, Any]:
    """Peaks of 25 N and 75 N m.

    OpenSim's checklist for evaluating a simulation, of the residual reduction algorithm: peak
    residual forces less than 10 to 25 N, peak residual moments less than 75 N m.
    """
    weight = pin.computeTotalMass(robot.model) * STANDARD_GRAVITY
    return _residuals(25.0 / weight, 75.0 / weight)


def _strict(_: Robot) -> dict[str, Any]:
    """A tenth of the default limits."""
    defaults = VerdictSettings()
    return {code: {"limit": 0.1 * getattr(defaults, code).limit} for code in _GRADUAL}


#: By name: the verdict's settings for a robot.
PRESETS: Mapping[str, Callable[[Robot], dict[str, Any]]] = MappingProxyType(
    {"hicks": _hicks, "opensim": _opensim, "strict": _strict}
)


def _residuals(force: float, torque: float) -> dict[str, Any]:
    """Limits that no frame may exceed [m g], [m g m]; that of forces is the one in flight, too."""
    limits = {
        "residual_force": force,
        "residual_torque": torque,
        "flight_with_support_needed": force,
    }
    return {code: {"limit": limit, "allowed_share": 0.0} for code, limit in limits.items()}


def _com_height(robot: Robot) -> float:
    """Of the robot in its default configuration, above its lowest contact [m]."""
    if not robot.contacts:
        raise DynacomError(f"preset hicks: {robot.name} must have contacts, to stand on")
    model = robot.model
    rest = np.zeros((1, model.nv))
    motion = Motion(np.zeros(1), robot.default[None], rest, rest)
    lowest = min(contact.height[0] for contact in computeContactMotions(robot.dynacom(), motion))
    return float(pin.centerOfMass(model, model.createData(), robot.default)[2] - lowest)
