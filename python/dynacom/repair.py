# SPDX-License-Identifier: BSD-2-Clause
"""From a motion that physics does not allow to one that it does, and what that took."""

import copy
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from dynacom.analysis_options import AnalysisOptions
from dynacom.dynacom_pywrap import ContactSchedule, Motion, MotionRepair, MotionRepairer
from dynacom.motion_file import Clip, read_motion
from dynacom.motion_report import MotionReport, make_examiner, make_recorded
from dynacom.robots import Robot, load_robot


@dataclass(frozen=True, eq=False)
class RepairReport:
    """What was made of a motion, and how it was before."""

    #: As it was read.
    clip: Clip
    robot: Robot
    options: AnalysisOptions
    #: Step by step.
    repair: MotionRepair = field(repr=False)
    #: As :func:`dynacom.analyze` finds the clip.
    before: MotionReport = field(repr=False)
    #: The same of what came out: without a filter, unless nothing was changed.
    after: MotionReport = field(repr=False)

    @property
    def outcome(self) -> str:
        """``feasible`` (as it was), ``repaired`` or ``not repaired``."""
        return self.repair.outcome

    @property
    def changed(self) -> bool:
        """Whether the motion is another one now."""
        raise NotImplementedError

    @property
    def motion(self) -> Motion:
        """What came out, with its derivatives."""
        return self.after.motion

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The summary of `after`, with ``repair``, see docs/repair.md."""
        raise NotImplementedError

    def write(self, path: str | Path) -> list[str]:
        """Writes the motion in the format of the clip's file, see :func:`write_motion`: notes.

        The file's bytes as they were where nothing was changed. Of CSV the mark, see
        :func:`mark_of`, is to be written beside it.
        """
        raise NotImplementedError

    def save(
        self,
        folder: str | Path,
        *,
        csv: bool = False,
        page: bool = True,
        export_contacts: bool = False,
    ) -> list[Path]:
        """Writes the motion under its own name, frames.parquet, summary.json, ...: all or none."""
        raise NotImplementedError


def repair(
    motion: str | Path | Clip,
    robot: str | Path | Robot,
    *,
    fps: float | None = None,
    quat: str | None = None,
    trust: bool = False,
    clip: str | None = None,
    schedule: str | Path | ContactSchedule | None = None,
    options: AnalysisOptions | None = None,
    balance_only: bool = False,
    strict: bool = False,
    stretch: float | None = None,
    threads: int = 0,
    progress: Callable[[float], None] | None = None,
) -> RepairReport:
    """Makes a motion one that physics allows, by as little as can be.

    Args:
        motion, robot, fps, quat, trust, clip, schedule, threads, progress: as in :func:`analyze`.
        options: settings; their defaults by default. Those of repair are in the groups ``repair``
            and ``ladder``.
        balance_only: whether to look after wrenches only, not after feet and joints.
        strict: whether to mend single frames, too, of motions that are feasible as a whole.
        stretch: by which factor time may be stretched where nothing else helps.

    Raises:
        DynacomError, ValueError: as :func:`analyze`; a clip of fewer than four frames.
    """
    options = AnalysisOptions() if options is None else copy.deepcopy(options)
    if balance_only:
        options.repair.feet = options.repair.joints = False
    if strict:
        options.ladder.strict = True
    if stretch is not None:
        options.ladder.largest_stretch = stretch
    options.validate()
    if not isinstance(robot, Robot):
        robot = load_robot(robot)
    if not isinstance(motion, Clip):
        motion = read_motion(motion, robot, fps=fps, quat=quat, trust=trust, clip=clip)
    repairer = make_repairer(robot, options, threads=threads, progress=progress)
    return repair_clip(motion, robot, options, repairer, schedule)


def make_repairer(robot: Robot, options: AnalysisOptions, **others: Any) -> MotionRepairer:
    """What repairs motions of a robot; `others` are arguments of :class:`MotionExaminer`."""
    ladder = options.ladder
    return MotionRepairer(
        robot.dynacom(),
        make_examiner(robot, options, sensitivity=False, **others),
        options.repair,
        ladder.strict,
        ladder.rounds,
        ladder.largest_displacement,
        ladder.largest_turn,
        ladder.largest_stretch,
    )


def repair_clip(
    clip: Clip,
    robot: Robot,
    options: AnalysisOptions,
    repairer: MotionRepairer,
    schedule: str | Path | ContactSchedule | None = None,
) -> RepairReport:
    """As :func:`repair`, by a repairer that was made for robot and options.

    Raises:
        DynacomError: as there.
    """
    raise NotImplementedError
