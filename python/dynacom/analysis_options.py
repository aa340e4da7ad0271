# SPDX-License-Identifier: BSD-2-Clause
"""How a motion is analysed: settings with their defaults, from a file and from the command line.

A settings file is YAML; what it does not name stays at its default::

    cutoff: auto          # of the filter [Hz]: what suits the motion; 0 or null for none
    omega: 0.0            # of VRP and DCM [rad/s]; 0 for that of the CoM's mean height
    flat: true            # the ground is flat and horizontal: see the CoP
    feet_only: false      # nothing but the contacts of the robot file may touch the ground
    friction: cone        # or outer-pyramid, inner-pyramid, facets; null for the robot file's
    distance: true        # how far is the motion from a feasible one?
    filter: {com: 0.01}   # CentroidalFilterSettings, field by field: how that is found
    detection:            # DetectionSettings, field by field
      ground_height: null # [m]; null if it is to be found
      ground_velocity: [-1.0, 0.0, 0.0] # a treadmill's [m/s]; null if it is to be found
    verdict:              # VerdictSettings: a limit, and the part of the frames that may exceed it
      residual_force: {limit: 0.1, allowed_share: 0.05}
      minimal_window: 1.0
    repair:               # RepairSettings, field by field: what changes cost, and what is mended
      displacement: 0.005  # [m]
      feet: true
    ladder:               # LadderSettings, field by field: how far repair goes
      largest_displacement: 0.1 # [m]
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from dynacom.dynacom_pywrap import (
    CentroidalFilterSettings,
    DetectionSettings,
    FaultLimit,
    FrictionModel,
    RepairSettings,
    VerdictSettings,
    kAutomaticCutoff,
)
from dynacom.errors import DynacomError
from dynacom.presets import preset_values
from dynacom.robots import FRICTION_MODELS, Robot
from dynacom.yaml_file import is_number, parse_yaml, read_yaml

#: What a cut-off is called that suits the motion.
AUTO = "auto"
# What is not good after so many rounds never is.
_MOST_ROUNDS = 1000


@dataclass(slots=True)
class LadderSettings:
    """How far repair goes, see ``MotionRepairer``.

    Attributes:
        rounds: how often a motion is repaired at most on each rung, with the contacts that are
            found in what came out.
        largest_displacement, largest_turn: a motion whose root has to be displaced farther than
            this in any frame [m], or a joint turned by more [rad], is not said to be repaired.
        largest_stretch: by which factor time may be stretched where nothing else helps; 1 for not
            at all.
        strict: whether single frames are mended, too, of motions that are feasible as a whole.
    """

    rounds: int = 5
    largest_displacement: float = 0.1
    largest_turn: float = 0.8
    largest_stretch: float = 1.0
    strict: bool = False

    def validate(self) -> None:
        """Raises ValueError, naming the first setting out of its range."""
        if not 1 <= self.rounds <= _MOST_ROUNDS:
            raise ValueError(
                f"LadderSettings.rounds must be from 1 to {_MOST_ROUNDS}, got {self.rounds}"
            )
        for name in ("largest_displacement", "largest_turn"):
            if not (math.isfinite(value := getattr(self, name)) and value > 0.0):
                raise ValueError(f"LadderSettings.{name} must be finite and > 0, got {value:g}")
        if not (math.isfinite(self.largest_stretch) and self.largest_stretch >= 1.0):
            raise ValueError(
                "LadderSettings.largest_stretch must be finite and >= 1, got "
                f"{self.largest_stretch:g}"
            )

    def copy(self) -> "LadderSettings":
        """Another one with the same values."""
        return replace(self)


@dataclass(slots=True)
class AnalysisOptions:
    """How a motion is analysed, and repaired.

    Attributes:
        cutoff: of the filter where velocities and accelerations are computed [Hz]; 0 or None for no
            filter, "auto" for what suits the motion, see ``deriveMotion``.
        omega: of virtual repellent point and divergent component of motion [rad/s]; 0 stands for
            sqrt(g / mean height of the CoM above the ground).
        flat: whether the centre of pressure is that of flat horizontal ground.
        feet_only: whether nothing but the robot's contacts may touch the ground; else its links
            may, too, where contacts do not suffice.
        friction: of contacts that are outer pyramids, as they are unless they say otherwise, and of
            links: "cone", "outer-pyramid", "inner-pyramid" or "facets"; None for what the robot
            file says, which is the cone by default.
        distance: whether to find how far motions are from feasible ones.
        filter: how that is found, see ``distanceToFeasible``.
        detection: how contacts are found, see ``inferContacts``.
        verdict: limits of the verdict, see ``judgeMotion``.
        repair: what changes cost, and what is mended, see ``repairMotion``.
        ladder: how far repair goes.
    """

    cutoff: float | Literal["auto"] | None = AUTO
    omega: float = 0.0
    flat: bool = True
    feet_only: bool = False
    friction: str | None = None
    distance: bool = True
    filter: CentroidalFilterSettings = field(default_factory=CentroidalFilterSettings)
    detection: DetectionSettings = field(default_factory=DetectionSettings)
    verdict: VerdictSettings = field(default_factory=VerdictSettings)
    repair: RepairSettings = field(default_factory=RepairSettings)
    ladder: LadderSettings = field(default_factory=LadderSettings)

    def validate(self) -> None:
        """Raises ValueError, naming the first setting out of its range."""
        cutoff = self.cutoff
        if isinstance(cutoff, str):
            if cutoff != AUTO:
                raise ValueError(f"cutoff must be a number of Hz, {AUTO} or none, got {cutoff!r}")
        elif cutoff is not None and not (math.isfinite(cutoff) and cutoff >= 0.0):
            raise ValueError(f"cutoff must be finite and >= 0 Hz, {AUTO} or none, got {cutoff:g}")
        if not (math.isfinite(self.omega) and self.omega >= 0.0):
            raise ValueError(f"omega must be finite and >= 0 rad/s, got {self.omega:g}")
        if self.friction is not None and self.friction not in FRICTION_MODELS:
            raise ValueError(
                f"friction must be one of {', '.join(FRICTION_MODELS)} or none, "
                f"got {self.friction!r}"
            )
        for group in _GROUP_NAMES:
            getattr(self, group).validate()

    def friction_model(self, robot: Robot) -> FrictionModel:
        """By what motions of a robot are judged where its contacts are outer pyramids."""
        return robot.friction if self.friction is None else FRICTION_MODELS[self.friction]

    def update(self, values: Any, where: str) -> None:
        """Changes some of the settings; all of them or, where it raises, none.

        Args:
            values: a mapping as in a settings file.
            where: what the message calls it.

        Raises:
            DynacomError: a name is none of a setting, or a value none that it can have.
        """
        self._update([(values, where)], where)

    def update_from_file(self, path: str | Path) -> None:
        """Changes the settings that a file names.

        Raises:
            DynacomError: the file cannot be read, and as :meth:`update`.
        """
        content = read_yaml(path)
        self.update({} if content is None else content, str(path))

    def update_from_preset(self, name: str, robot: Robot) -> None:
        """Changes limits of the verdict to those of a preset, see docs/verdict.md.

        Args:
            robot: whose mass makes newtons parts of the weight.

        Raises:
            DynacomError: there is no preset of that name, or the robot does not suit it.
        """
        self.update(preset_values(name, robot), f"preset {name}")

    def update_from_texts(self, texts: Iterable[str]) -> None:
        """Changes settings by texts like ``verdict.residual_force.limit=0.2``.

        Raises:
            DynacomError: a text is none of that form, and as :meth:`update`.
        """
        changes = []
        for text in texts:
            path, equals, value = text.partition("=")
            if not equals or not value:
                raise DynacomError(f"setting must be NAME=VALUE, got '{text}'")
            try:
                content = parse_yaml(value)
            except ValueError:
                content = value
            for name in reversed(path.split(".")):
                content = {name: content}
            changes.append((content, f"setting '{text}'"))
        self._update(changes, "settings")

    def _update(self, changes: list[tuple[Any, str]], where: str) -> None:
        # What is in range depends on other settings: it is looked at when all have been changed.
        changed = replace(self, **{name: getattr(self, name).copy() for name in _GROUP_NAMES})
        for values, place in changes:
            _update(changed, values, place)
        try:
            changed.validate()
        except ValueError as error:
            raise DynacomError(f"{where}: {error}") from error
        for name in _names(self):
            setattr(self, name, getattr(changed, name))

    @property
    def cutoff_number(self) -> float:
        """The cut-off as ``deriveMotion`` and ``MotionExaminer`` take it: 0 for none [Hz]."""
        return kAutomaticCutoff if self.cutoff == AUTO else self.cutoff or 0.0

    def to_dict(self) -> dict[str, Any]:
        """The settings, as a settings file would hold them."""
        return _to_dict(self)


_GROUPS = (
    AnalysisOptions,
    CentroidalFilterSettings,
    DetectionSettings,
    VerdictSettings,
    FaultLimit,
    RepairSettings,
    LadderSettings,
)
# Fields of AnalysisOptions that have settings of their own.
_GROUP_NAMES = ("filter", "detection", "verdict", "repair", "ladder")


def _names(group: Any) -> list[str]:
    if is_dataclass(group):
        return [field.name for field in fields(group)]
    properties = vars(type(group)).items()
    return [name for name, value in properties if isinstance(value, property)]


def _to_dict(group: Any) -> dict[str, Any]:
    values = {name: getattr(group, name) for name in _names(group)}
    return {
        name: _to_dict(value) if isinstance(value, _GROUPS) else _without_nan(value)
        for name, value in values.items()
    }


def _without_nan(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return None if np.isnan(value).any() else value.tolist()
    return None if isinstance(value, float) and math.isnan(value) else value


# What null stands for, where it may.
_NULL = {
    "cutoff": None,
    "friction": None,
    "ground_height": math.nan,
    "ground_velocity": np.full(3, math.nan),
}
# What is one of some words.
_WORDS = {"friction": FRICTION_MODELS}
# What may be found by itself.
_AUTO = {"cutoff"}


def _update(group: Any, values: Any, where: str) -> None:
    names = _names(group)
    if not isinstance(values, dict):
        raise DynacomError(f"{where}: must be a mapping with {', '.join(names)}, got {values!r}")
    for name, value in values.items():
        if name not in names:
            raise DynacomError(f"{where}: unknown setting {name!r}, expected {', '.join(names)}")
        now = getattr(group, name)
        if isinstance(now, _GROUPS):
            _update(now, value, f"{where}: {name}")
            setattr(group, name, now)
        elif isinstance(now, bool):
            if not isinstance(value, bool):
                raise DynacomError(f"{where}: {name} must be true or false, got {value!r}")
            setattr(group, name, value)
        elif value is None and name in _NULL:
            setattr(group, name, _NULL[name])
        elif name in _WORDS:
            if not (isinstance(value, str) and value in _WORDS[name]):
                raise DynacomError(
                    f"{where}: {name} must be {', '.join(_WORDS[name])} or null, got {value!r}"
                )
            setattr(group, name, value)
        elif isinstance(now, np.ndarray):
            if not (isinstance(value, list) and len(value) == 3 and all(map(is_number, value))):
                raise DynacomError(
                    f"{where}: {name} must be a list of 3 finite numbers or null, got {value!r}"
                )
            setattr(group, name, np.array(value, dtype=float))
        elif isinstance(now, int):
            if not (is_number(value) and value == int(value)):
                raise DynacomError(f"{where}: {name} must be a whole number, got {value!r}")
            setattr(group, name, int(value))
        elif is_number(value):
            setattr(group, name, float(value))
        elif value == AUTO and name in _AUTO:
            setattr(group, name, AUTO)
        else:
            expected = "a finite number"
            if others := [
                word for word, known in ((AUTO, _AUTO), ("null", _NULL)) if name in known
            ]:
                expected = f"{', '.join([expected, *others[:-1]])} or {others[-1]}"
            raise DynacomError(f"{where}: {name} must be {expected}, got {value!r}")
