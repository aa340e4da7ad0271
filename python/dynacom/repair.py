# SPDX-License-Identifier: BSD-2-Clause
"""From a motion that physics does not allow to one that it does, and what that took."""

import copy
import shutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from dynacom.analysis_options import AnalysisOptions
from dynacom.contacts_file import write_contacts
from dynacom.dynacom_pywrap import (
    ContactSchedule,
    Motion,
    MotionExaminer,
    MotionRepair,
    MotionRepairer,
)
from dynacom.errors import DynacomError
from dynacom.motion_change import Change
from dynacom.motion_clip import is_point
from dynacom.motion_file import Clip, read_motion
from dynacom.motion_mark import mark_of
from dynacom.motion_report import (
    FILES,
    MotionReport,
    examine,
    make_examiner,
    make_recorded,
    without_nan,
)
from dynacom.motion_writer import write_motion
from dynacom.repair_change import Before
from dynacom.repair_summary import left_notes, repair_summary
from dynacom.results_folder import save_results
from dynacom.robots import Robot, load_robot

_CONTACTS_FILE = "contacts.npz"


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
        """Whether the motion is another one now: not where it was feasible, or nothing helped."""
        return self.after is not self.before

    @property
    def motion(self) -> Motion:
        """What came out, with its derivatives."""
        return self.after.motion

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The summary of `after`, with ``repair``, see docs/repair.md."""
        summary = self.after.summary
        repair = without_nan(repair_summary(self.robot, self.repair))
        notes = [*summary["notes"], *left_notes(repair)]
        return summary | {"notes": notes, "repair": repair}

    def write(self, path: str | Path) -> tuple[dict[str, Any], list[str]]:
        """Writes the motion in the format of the clip's file: as it was where nothing was changed.

        Args:
            path: the file to write, with the suffix of the clip's.

        Returns:
            What is to be said of the file in the summary: what marks it, which is to be written
            beside it for CSV, see :func:`mark_of`, with ``exact`` False for what is not marked; and
            its ``verdict_written`` and ``codes_written``, once it has been read again. And notes,
            see :func:`write_motion`.

        Raises:
            DynacomError: as :func:`write_motion`.
        """
        if not self.changed:
            _copy(self.clip.path, Path(path))
            return mark_of(path) | {"exact": self.clip.exact} | _written(self.after), []
        notes = write_motion(self.clip, path, **self._arguments())
        written = self.examine_written(self.read_again(path))
        if written.verdict.outcome != self.after.verdict.outcome:
            notes.append(different_text(written))
        return mark_of(path) | _written(written), notes

    def change(self) -> Change:
        """What of the clip's file is another thing now, for whoever writes several clips at once.

        Raises:
            DynacomError: as :func:`write_motion`.
        """
        return Change.of(self.clip, mark=True, **self._arguments())

    def read_again(self, path: str | Path) -> Clip:
        """The motion as it was written.

        Raises:
            DynacomError: as :func:`read_motion`.
        """
        how = self.clip.options
        return read_motion(
            path,
            self.robot,
            fps=None if how.fps is None else how.fps / self.repair.stretch,
            quat=how.quat,
            trust=how.trust,
            clip=how.clip,
        )

    def examine_written(self, clip: Clip, examiner: MotionExaminer | None = None) -> MotionReport:
        """What is found of the motion as it was written.

        Args:
            clip: what was read of it.
            examiner: of the robot, and of options without a cut-off.
        """
        options = replace(self.options, cutoff=None)
        examiner = examiner or make_examiner(self.robot, options, sensitivity=False)
        marked = replace(clip, exact=True)  # CSV is so when the summary is there
        return examine(marked, self.robot, options, examiner, self.repair.recorded.schedule)

    def _arguments(self) -> dict[str, Any]:
        """Of :func:`write_motion`."""
        after = self.repair.after
        forces = {
            contact.name: contact.wrench[:, : 3 if is_point(self.robot, contact.name) else 6]
            for contact in after.analysis.contacts
        }
        return {
            "q": self.repair.recorded.q,
            "schedule": after.schedule,
            "forces": forces,
            "stretch": self.repair.stretch,
        }

    def save(
        self,
        folder: str | Path,
        *,
        csv: bool = False,
        page: bool = True,
        export_contacts: bool = False,
    ) -> list[Path]:
        """Writes the motion and its report: all of it or nothing.

        The motion has the name and the format of its file. The others are those of
        :meth:`MotionReport.save`, with ``repair`` in the summary and the motion before in the page,
        and are replaced, or taken away if they are not wanted now, as there.

        Args:
            folder: made if it is not there; not that of the clip's file.
            csv, page: whether to write frames.csv, and report.html.
            export_contacts: whether to write contacts.npz, see :func:`contact_arrays`.

        Returns:
            The files.

        Raises:
            DynacomError: as :meth:`MotionReport.save`; the motion's file would be that of the clip,
                or has the name of another one here.
        """
        name, others = self.clip.path.name, (*FILES, _CONTACTS_FILE)
        if name in others:
            raise DynacomError(f"{self.clip.path}: is called as a result is: it needs another name")
        if (Path(folder) / name).resolve() == self.clip.path.resolve():
            raise DynacomError(f"{folder}: must be another folder than that of the motion, {name}")

        def write(into: Path) -> None:
            self.write_files(into, *self.write(into / name), csv=csv, page=page)
            if export_contacts:
                write_contacts(self.after, into / _CONTACTS_FILE)

        return save_results(folder, others, write)

    def write_files(
        self,
        folder: Path,
        told: Mapping[str, Any],
        notes: Iterable[str],
        *,
        csv: bool,
        page: bool,
    ) -> None:
        """Writes the report into a folder: the files of :meth:`save`, but for motion and contacts.

        Args:
            told, notes: of the motion's file, see :meth:`write`.

        Raises:
            OSError, DynacomError: as :meth:`MotionReport.write_files`.
        """
        summary = self.summary | {
            "repair": self.summary["repair"] | told,
            "notes": [*self.summary["notes"], *notes],
        }
        before = Before(self.before.motion.q, self.before.arrays, self.before.summary)
        self.after.write_files(folder, summary, csv=csv, page=page, before=before)


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
    options = repair_options(options, balance_only=balance_only, strict=strict)
    if stretch is not None:
        options.ladder.largest_stretch = stretch
    options.validate()
    if not isinstance(robot, Robot):
        robot = load_robot(robot)
    if not isinstance(motion, Clip):
        motion = read_motion(motion, robot, fps=fps, quat=quat, trust=trust, clip=clip)
    repairer = make_repairer(robot, options, threads=threads, progress=progress)
    return repair_clip(motion, robot, options, repairer, schedule)


def repair_options(
    options: AnalysisOptions | None, *, balance_only: bool, strict: bool
) -> AnalysisOptions:
    """A copy of the options, or of their defaults, with what :func:`repair` was asked for."""
    options = AnalysisOptions() if options is None else copy.deepcopy(options)
    if balance_only:
        options.repair.feet = options.repair.joints = False
    if strict:
        options.ladder.strict = True
    return options


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
    recorded, schedule_text = make_recorded(clip, robot, schedule)
    try:
        found = repairer.repair(recorded)
    except ValueError as error:
        raise DynacomError(f"{clip.path}: {error}") from error
    before = after = MotionReport(clip, robot, options, found.before, schedule_text)
    made = found.recorded
    if not (np.array_equal(made.q, recorded.q) and np.array_equal(made.time, recorded.time)):
        # Forces in the file were those of the motion before.
        repaired = replace(
            clip,
            time=np.array(made.time),
            q=np.array(made.q),
            v=None,
            a=None,
            forces={},
            exact=True,
        )
        after = MotionReport(repaired, robot, options, found.after, schedule_text)
    return RepairReport(clip, robot, options, found, before, after)


def different_text(written: MotionReport) -> str:
    """What is to be said of a motion whose verdict is another one as it was written."""
    return (
        f"The motion is {written.verdict.outcome} ({', '.join(written.verdict.codes)}) as it was "
        "written: its file cannot hold all that was changed."
    )


def _written(report: MotionReport) -> dict[str, Any]:
    verdict = report.verdict
    return {"verdict_written": verdict.outcome, "codes_written": verdict.codes}


def _copy(source: Path, path: Path) -> None:
    if path.exists() and path.samefile(source):
        raise DynacomError(f"{path}: must be another file than the one that was read")
    try:
        shutil.copyfile(source, path)
    except OSError as error:
        raise DynacomError(f"{path}: cannot be written ({error.strerror or error})") from error
