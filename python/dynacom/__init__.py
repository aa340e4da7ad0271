# SPDX-License-Identifier: BSD-2-Clause
"""Centroidal dynamics of legged robots, and how their contacts share the ground's wrench.

The classes and functions are those of the C++ library, under the same names and with the same
keyword arguments; arrays are copied on their way in and out. Robots and motions are read from files
by :func:`load_robot` and :func:`read_motion`.
"""

# First: it registers the types of Pinocchio and eigenpy that the bindings take and return.
import pinocchio  # noqa: F401  isort: skip

from dynacom import compat as _compat
from dynacom.dynacom_pywrap import (
    CentroidalState,
    CentroidalWrench,
    Contact6D,
    Contact6DSettings,
    ContactBase,
    ContactPoint,
    ContactPointSettings,
    ContactSchedule,
    DistributionResult,
    DistributionStatus,
    DynaCoM,
    DynaCoMSettings,
    Motion,
    MotionAnalysis,
    WrenchDistribution,
    WrenchMargin,
    __version__,
    analyzeMotion,
    applyGroundWrench,
    computeCentroidalState,
    computeFlatGroundCoP,
    computeGroundWrench,
    computeVRP,
    readCentroidalState,
)
from dynacom.errors import DynacomError, NotReadyError
from dynacom.motion_file import MotionFile, read_motion
from dynacom.robots import Payload, Robot, load_robot, make_robot, parse_payload

_compat.add_aliases()

__all__ = [
    "CentroidalState",
    "CentroidalWrench",
    "Contact6D",
    "Contact6DSettings",
    "ContactBase",
    "ContactPoint",
    "ContactPointSettings",
    "ContactSchedule",
    "DistributionResult",
    "DistributionStatus",
    "DynaCoM",
    "DynaCoMSettings",
    "DynacomError",
    "Motion",
    "MotionAnalysis",
    "MotionFile",
    "NotReadyError",
    "Payload",
    "Robot",
    "WrenchDistribution",
    "WrenchMargin",
    "__version__",
    "analyzeMotion",
    "applyGroundWrench",
    "computeCentroidalState",
    "computeFlatGroundCoP",
    "computeGroundWrench",
    "computeVRP",
    "load_robot",
    "make_robot",
    "parse_payload",
    "readCentroidalState",
    "read_motion",
]
