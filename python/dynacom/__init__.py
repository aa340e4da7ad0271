# SPDX-License-Identifier: BSD-2-Clause
"""Centroidal dynamics of legged robots, and how their contacts share the ground's wrench.

The classes and functions are those of the C++ library, under the same names and with the same
keyword arguments; arrays are copied on their way in and out. Robots and motions are read from files
by :func:`load_robot` and :func:`read_motion`; :func:`analyze` judges a motion as a whole, and
:func:`batch` many.
"""

# First: it registers the types of Pinocchio and eigenpy that the bindings take and return.
import pinocchio  # noqa: F401  isort: skip

from dynacom import compat as _compat
from dynacom.analysis_options import AnalysisOptions
from dynacom.batch import BatchProgress, batch
from dynacom.dynacom_pywrap import (
    CentroidalState,
    CentroidalWrench,
    Contact6D,
    Contact6DSettings,
    ContactBase,
    ContactMotion,
    ContactPoint,
    ContactPointSettings,
    ContactSchedule,
    DerivativeMismatch,
    DetectionSettings,
    DistributionResult,
    DistributionStatus,
    DynaCoM,
    DynaCoMSettings,
    FaultLimit,
    Motion,
    MotionAnalysis,
    MotionFinding,
    MotionVerdict,
    VerdictSettings,
    WrenchDistribution,
    WrenchMargin,
    __version__,
    analyzeMotion,
    applyGroundWrench,
    compareDerivatives,
    computeCentroidalState,
    computeContactMotions,
    computeDCM,
    computeFlatGroundCoP,
    computeGroundWrench,
    computeVRP,
    countLanes,
    detectContacts,
    differentiate,
    estimateGround,
    filterConfigurations,
    judgeMotion,
    kMaximalCutoff,
    readCentroidalState,
)
from dynacom.errors import DynacomError, NotReadyError
from dynacom.motion_file import Clip, read_motion
from dynacom.motion_report import MotionReport, analyze
from dynacom.robots import Payload, Robot, load_robot, make_robot, parse_payload
from dynacom.schedule_file import read_schedule, write_schedule

_compat.add_aliases()

__all__ = [
    "AnalysisOptions",
    "BatchProgress",
    "CentroidalState",
    "CentroidalWrench",
    "Clip",
    "Contact6D",
    "Contact6DSettings",
    "ContactBase",
    "ContactMotion",
    "ContactPoint",
    "ContactPointSettings",
    "ContactSchedule",
    "DerivativeMismatch",
    "DetectionSettings",
    "DistributionResult",
    "DistributionStatus",
    "DynaCoM",
    "DynaCoMSettings",
    "DynacomError",
    "FaultLimit",
    "Motion",
    "MotionAnalysis",
    "MotionFinding",
    "MotionReport",
    "MotionVerdict",
    "NotReadyError",
    "Payload",
    "Robot",
    "VerdictSettings",
    "WrenchDistribution",
    "WrenchMargin",
    "__version__",
    "analyze",
    "analyzeMotion",
    "applyGroundWrench",
    "batch",
    "compareDerivatives",
    "computeCentroidalState",
    "computeContactMotions",
    "computeDCM",
    "computeFlatGroundCoP",
    "computeGroundWrench",
    "computeVRP",
    "countLanes",
    "detectContacts",
    "differentiate",
    "estimateGround",
    "filterConfigurations",
    "judgeMotion",
    "kMaximalCutoff",
    "load_robot",
    "make_robot",
    "parse_payload",
    "readCentroidalState",
    "read_motion",
    "read_schedule",
    "write_schedule",
]
