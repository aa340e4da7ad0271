# SPDX-License-Identifier: BSD-2-Clause
"""What a motion asks of the ground, frame by frame and as a whole."""

import copy
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dynacom.analysis_options import AUTO, AnalysisOptions
from dynacom.distance import distance_arrays, distance_summary
from dynacom.dynacom_pywrap import (
    ContactSchedule,
    CutoffSensitivity,
    DerivedMotion,
    DistributionStatus,
    Motion,
    MotionAnalysis,
    MotionExamination,
    MotionExaminer,
    MotionVerdict,
    RecordedMotion,
    compareMeasured,
    computeConeUsage,
    describeFaults,
    kExactNoise,
    kMeasuredCutoff,
    kThinnedRate,
)
from dynacom.errors import DynacomError
from dynacom.missing_contacts import missing_summary, missing_texts, unexplained
from dynacom.motion_file import Clip, read_motion
from dynacom.other_contacts import body_statistics, body_texts, seat_statistics
from dynacom.results_folder import save_results
from dynacom.robots import STANDARD_GRAVITY, Robot, load_robot
from dynacom.schedule_file import read_schedule, write_schedule
from dynacom.terrain import ground_heights, terrain_texts

if TYPE_CHECKING:
    import pandas

    from dynacom.repair_change import Before

#: All that may be written of a report.
FILES = ("frames.csv", "frames.parquet", "report.html", "schedule.yaml", "summary.json")

_XYZ = ("_x", "_y", "_z")
_XY = ("_x", "_y")
_WRENCH = tuple(f"_{part}{axis}" for part in ("force", "torque") for axis in _XYZ)
_WRENCH_UNITS = ("N", "N", "N", "N m", "N m", "N m")

#: What may be wrong with a motion: code -> unit of what is measured, and what it means.
FAULTS: dict[str, tuple[str, str]] = describeFaults()

# Of the table: array's name, what its columns' names end with, their units. docs/columns.md says
# what they are.
_FRAME_COLUMNS = (
    ("time", ("",), "s"),
    ("com", _XYZ, "m"),
    ("vcom", _XYZ, "m/s"),
    ("acom", _XYZ, "m/s^2"),
    ("am", _XYZ, "kg m^2/s"),
    ("dam", _XYZ, "N m"),
    ("ground_force", _XYZ, "N"),
    ("ground_torque", _XYZ, "N m"),
    ("cop", _XY, "m"),
    ("vrp", _XY, "m"),
    ("dcm", _XY, "m"),
    ("nl", _XY, "m"),
    ("status", ("",), ""),
    ("judged", ("",), ""),
    ("fault", ("",), ""),
    *((f"fault.{code}", ("",), unit) for code, (unit, _) in FAULTS.items()),
    ("residual", _WRENCH, _WRENCH_UNITS),
    ("feasible_acom", _XYZ, "m/s^2"),
    ("feasible_dam", _XYZ, "N m"),
    ("distance", ("",), "m"),
    ("feasible_com", _XYZ, "m"),
)
_CONTACT_COLUMNS = (
    ("active", ("",), ""),
    ("confidence", ("",), ""),
    ("force", _XYZ, "N"),
    ("torque", _XYZ, "N m"),
    ("cop", _XY, "m"),
    ("friction_usage", ("",), ""),
    ("cone_usage", ("",), ""),
    ("yaw_usage", ("",), ""),
    ("cop_margin", ("",), "m"),
    ("position", _XYZ, "m"),
    ("rotation", ("_x", "_y", "_z", "_w"), ""),
    ("height", ("",), "m"),
    ("speed", ("",), "m/s"),
)
# Of a contact in the summary: fields of ContactStatistics.
_CONTACT_STATISTICS = (
    "active_share",
    "weight_share",
    "weight_share_while_active",
    "largest_vertical_force",
    "largest_friction_usage",
    "largest_cone_usage",
    "least_cop_margin",
)
# Of a link that touches something besides the contacts.
_BODY_COLUMNS = (
    ("active", ("",), ""),
    ("confidence", ("",), ""),
    ("force", _XYZ, "N"),
    ("position", _XYZ, "m"),
)
# Where the file says what the contacts felt.
_MEASURED_COLUMNS = (("measured_force", _XYZ, "N"), ("measured_torque", _XYZ, "N m"))

#: What the code ``too_short`` means, for which a motion is unknown.
TOO_SHORT = "there are too few frames whose accelerations are known"


@dataclass(frozen=True, eq=False)
class MotionReport:
    """What was found of a motion.

    Arrays have a row per frame, are in the world's axes unless they say otherwise, and in SI units.
    """

    clip: Clip
    robot: Robot
    options: AnalysisOptions
    #: Step by step.
    examination: MotionExamination = field(repr=False)
    #: How it is known when contacts are active.
    _schedule_text: str = field(repr=False)

    @property
    def motion(self) -> Motion:
        """As analysed: filtered, where derivatives had to be computed."""
        return self.examination.derived.motion

    @property
    def schedule(self) -> ContactSchedule:
        """Which contacts are active when."""
        return self.examination.schedule

    @property
    def analysis(self) -> MotionAnalysis:
        """Dynamics and forces."""
        return self.examination.analysis

    @property
    def verdict(self) -> MotionVerdict:
        """Whether the motion is feasible, and what speaks against it."""
        return self.examination.verdict

    @cached_property
    def arrays(self) -> dict[str, np.ndarray]:
        """By name, see docs/columns.md: ``com`` (T, 3), ``contact.left_sole.force`` (T, 3), ..."""
        return _collect_arrays(self.clip, self.examination, self.options)

    @cached_property
    def summary(self) -> dict[str, Any]:
        """What summary.json holds: docs/verdict.md."""
        return without_nan(_summarize(self))

    def __getitem__(self, name: str) -> np.ndarray:
        """An array by its name."""
        return self.arrays[name]

    def columns(self) -> dict[str, tuple[np.ndarray, str]]:
        """The table of frames, see docs/columns.md: column's name -> ((T,) values, unit)."""
        columns = {}
        for name, endings, units in self._layout():
            array = self.arrays[name]
            if isinstance(units, str):
                units = (units,) * len(endings)
            for index, (ending, unit) in enumerate(zip(endings, units, strict=True)):
                values = array if array.ndim == 1 else array[:, index]
                columns[name + ending] = values, unit
        return columns

    def _layout(self) -> Iterator[tuple[str, tuple[str, ...], Any]]:
        yield from _FRAME_COLUMNS
        for contact in self.robot.contacts:
            for name, endings, units in _CONTACT_COLUMNS + _MEASURED_COLUMNS:
                if (full := f"contact.{contact}.{name}") in self.arrays:
                    yield full, endings, units
            for part in self.examination.analysis.parts:
                if part.name.startswith(f"{contact}."):
                    yield f"contact.{part.name}.active", ("",), ""
        for body in self.examination.analysis.bodies:
            for name, endings, units in _BODY_COLUMNS:
                yield f"body.{body.link}.{name}", endings, units

    def to_dataframe(self) -> "pandas.DataFrame":
        """The table of frames, for pandas.

        Raises:
            DynacomError: pandas is not installed.
        """
        try:
            import pandas
        except ImportError as error:
            raise DynacomError("a data frame needs pandas: pip install pandas") from error
        return pandas.DataFrame({name: values for name, (values, _) in self.columns().items()})

    def save(self, folder: str | Path, *, csv: bool = False, page: bool = True) -> list[Path]:
        """Writes frames.parquet, summary.json, schedule.yaml and report.html: all of them or none.

        Files of these names, and frames.csv, that are there already are replaced, or taken away if
        they are not wanted now; others stay.

        Args:
            folder: made if it is not there.
            csv: whether to write frames.csv, too.
            page: whether to write report.html.

        Returns:
            The files.

        Raises:
            DynacomError: the folder cannot be written to, or pyarrow, plotly or viser is not
                installed.
        """
        return save_results(
            folder, FILES, lambda into: self.write_files(into, self.summary, csv=csv, page=page)
        )

    def write_files(
        self,
        folder: Path,
        summary: dict[str, Any],
        *,
        csv: bool,
        page: bool,
        before: "Before | None" = None,
    ) -> None:
        """Writes the files of :meth:`save` into a folder, one after the other.

        Args:
            summary: which may hold more than the report's.
            before: the motion before repair, for the page.

        Raises:
            OSError: a file cannot be written.
            DynacomError: as :meth:`save`.
        """
        self._write_tables(folder, csv)
        text = json.dumps(summary, indent=2, ensure_ascii=False, allow_nan=False)
        (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
        write_schedule(self.schedule, self.motion.time, folder / "schedule.yaml")
        if page:
            from dynacom.page import write_page

            path = folder / "report.html"
            write_page(path, self.robot, self.motion.q, self.arrays, summary, before=before)

    def _write_tables(self, folder: Path, with_csv: bool) -> None:
        """frames.parquet, and frames.csv."""
        try:
            import pyarrow
            from pyarrow import csv, parquet
        except ImportError as error:
            raise DynacomError(
                "frames.parquet needs pyarrow: pip install dynacom[motion]"
            ) from error
        fields, arrays = [], []
        for name, (values, unit) in self.columns().items():
            array = pyarrow.array(values.tolist() if values.dtype.kind == "U" else values)
            fields.append(pyarrow.field(name, array.type, metadata={"unit": unit}))
            arrays.append(array)
        metadata = {"clip": self.summary["clip"], "robot": self.robot.name}
        table = pyarrow.Table.from_arrays(arrays, schema=pyarrow.schema(fields, metadata))
        parquet.write_table(table, folder / "frames.parquet")
        if with_csv:
            numbers = [
                array.cast(pyarrow.int8()) if array.type == pyarrow.bool_() else array
                for array in arrays
            ]
            csv.write_csv(
                pyarrow.Table.from_arrays(numbers, names=table.column_names), folder / "frames.csv"
            )


def analyze(
    motion: str | Path | Clip,
    robot: str | Path | Robot,
    *,
    fps: float | None = None,
    quat: str | None = None,
    trust: bool = False,
    clip: str | None = None,
    schedule: str | Path | ContactSchedule | None = None,
    options: AnalysisOptions | None = None,
    sensitivity: bool = True,
    threads: int = 0,
    progress: Callable[[float], None] | None = None,
) -> MotionReport:
    """Judges a motion: what the ground must give, what its contacts can, and whether that suffices.

    Where the file's velocities and accelerations do not agree with its configurations, or it has
    none, they are computed: see ``filterConfigurations`` and ``differentiate``. Contacts are active
    as `schedule` says, else as the file says, else as ``inferContacts`` finds them.

    Args:
        motion: a file, see :func:`read_motion`, or what was read from one.
        robot: a robot, or the name or file of one, see :func:`load_robot`.
        fps, quat, trust, clip: as in :func:`read_motion`.
        schedule: a file, see docs/verdict.md, or a schedule with T frames.
        options: settings; their defaults by default.
        sensitivity: whether to judge the motion with half and twice the cut-off, too, which takes
            three times as long.
        threads: how many do the work; 0 stands for as many as the machine has. Results do not
            depend on it.
        progress: called now and then with what part of the work is done.

    Raises:
        DynacomError: the file cannot be read or is no motion of this robot, see
            :func:`read_motion`; the schedule is not one for it; the cut-off is not below
            ``kMaximalCutoff`` of the frame rate, or the frame rate is not even.
        ValueError: options are out of their ranges.
    """
    options = AnalysisOptions() if options is None else copy.deepcopy(options)
    options.validate()
    if not isinstance(robot, Robot):
        robot = load_robot(robot)
    if not isinstance(motion, Clip):
        motion = read_motion(motion, robot, fps=fps, quat=quat, trust=trust, clip=clip)
    examiner = make_examiner(
        robot, options, sensitivity=sensitivity, threads=threads, progress=progress
    )
    return examine(motion, robot, options, examiner, schedule)


def make_examiner(
    robot: Robot, options: AnalysisOptions, *, sensitivity: bool, **others: Any
) -> MotionExaminer:
    """What examines motions of a robot; `others` are arguments of :class:`MotionExaminer`."""
    return MotionExaminer(
        robot.dynacom(),
        options.cutoff_number,
        options.flat,
        options.omega,
        options.detection,
        options.verdict,
        sensitivity,
        # A robot without contacts is not to stand on links of which nobody has said anything.
        bodies=[] if options.feet_only or not robot.contacts else robot.collision_points.bodies,
        distance=options.distance,
        filter=options.filter,
        friction=options.friction_model(robot),
        **others,
    )


def examine(
    clip: Clip,
    robot: Robot,
    options: AnalysisOptions,
    examiner: MotionExaminer,
    schedule: str | Path | ContactSchedule | None = None,
) -> MotionReport:
    """As :func:`analyze`, by an examiner that was made for robot and options.

    Raises:
        DynacomError: as there.
    """
    recorded, schedule_text = make_recorded(clip, robot, schedule)
    try:
        examination = examiner.examine(recorded)
    except ValueError as error:
        raise DynacomError(f"{clip.path}: {error}") from error
    return MotionReport(clip, robot, options, examination, schedule_text)


def make_recorded(
    clip: Clip, robot: Robot, schedule: str | Path | ContactSchedule | None
) -> tuple[RecordedMotion, str]:
    """What is to be examined of a clip, and a sentence on who says when contacts are active.

    Raises:
        DynacomError: as :func:`read_schedule`.
    """
    schedule, text = _find_schedule(clip, robot, schedule)
    return RecordedMotion(clip.time, clip.q, clip.v, clip.a, schedule, clip.exact), text


def _find_schedule(
    clip: Clip, robot: Robot, given: str | Path | ContactSchedule | None
) -> tuple[ContactSchedule | None, str]:
    """When contacts are active, if anybody says so, and who does."""
    if isinstance(given, ContactSchedule):
        # Of the file's frames, or of all.
        if clip.gaps and len(np.asarray(given.active)) == len(clip.gaps.time):
            given = clip.gaps.schedule(given)
        return given, "Contacts are active as the caller says."
    if given is not None:
        schedule = read_schedule(given, clip.time, list(robot.contacts))
        return schedule, f"Contacts are active as {given} says."
    if clip.schedule is not None:
        return clip.schedule, "Contacts are active as the file says."
    return None, "Contacts are found from where the feet are and from what the motion needs."


# The summary.


def _summarize(report: MotionReport) -> dict[str, Any]:
    clip, robot, found = report.clip, report.robot, report.examination
    derived, statistics = found.derived, found.statistics
    derivatives = _derivatives_text(clip, derived, report.options)
    downward = list(_downward_texts(robot, found.verdict))
    notes = [
        *downward,
        *_gravity_texts(robot),
        *clip.notes,
        derivatives,
        report._schedule_text,
        *terrain_texts(report.options, found),
        *body_texts(robot, report.options, found),
        *missing_texts(found, report.options, is_reversed=bool(downward)),
        *_unjudged_texts(found),
    ]
    sensitivity = []
    if derived.cutoff > 0.0:
        sensitivity = [_residuals(entry) for entry in found.sensitivity]
        sensitivity.append(_residuals(found, derived.cutoff))
        sensitivity.sort(key=lambda entry: entry["cutoff"])
    return {
        "clip": clip.path.name,
        "robot": robot.name,
        "mass": statistics.mass,
        "weight": statistics.weight,
        "frames": statistics.frames,
        "duration": float(clip.time[-1] - clip.time[0]),
        "frame_rate": derived.frame_rate,
        "omega": found.analysis.omega,
        "verdict": found.verdict.outcome,
        "codes": found.verdict.codes,
        "distance": distance_summary(found),
        "reasons": _reasons(found.verdict, report.options, statistics.frames),
        "feasible_share": found.verdict.feasible_share,
        "windows": window_times(found.verdict),
        "statuses": {status.name: frames for status, frames in statistics.statuses.items()},
        "residual_force_rms": statistics.residual_force_rms,
        "residual_torque_rms": statistics.residual_torque_rms,
        "notes": notes,
        "derivatives": derivatives,
        "cutoff": derived.cutoff or None,
        "cutoff_sensitivity": sensitivity,
        "ground": ground_heights(found),
        "ground_velocity": found.inference.ground_velocity.tolist(),
        "contacts": {
            contact.name: {name: getattr(contact, name) for name in _CONTACT_STATISTICS}
            for contact in statistics.contacts
        },
        "bodies": body_statistics(found),
        "seats": seat_statistics(found),
        "mean_vertical_force": statistics.mean_vertical_force,
        "momentum_change": statistics.momentum_change,
        "contact_missing": missing_summary(found.missing_support),
        "unexplained": unexplained(statistics),
        "measured": _compare_forces(clip, found.analysis),
        "options": report.options.to_dict(),
    }


def _derivatives_text(clip: Clip, derived: DerivedMotion, options: AnalysisOptions) -> str:
    """Where velocities and accelerations come from."""
    mismatch = derived.mismatch
    differ = f"differ by {mismatch.velocity:.1%} and {mismatch.acceleration:.1%} from"
    if derived.is_recorded:
        text = (
            f"Velocities and accelerations are the file's: they {differ} its positions and "
            "velocities."
        )
        return text if options.cutoff in (AUTO, None) else f"{text} No cut-off is used."
    if clip.v is None:
        reason = "the file has none"
    elif clip.a is None:
        reason = "the file has velocities only"
    else:
        reason = f"the file's {differ} its positions and velocities"
    how = "without a filter"
    if derived.cutoff > 0.0:
        how = (
            "after a Butterworth filter of 4th order, forward and backward, at "
            f"{derived.cutoff:g} Hz"
        )
    if derived.time_error > 1e-6:
        how += f", with times made even, by up to {1e3 * derived.time_error:.2g} ms"
    is_marked = derived.is_automatic and derived.is_told_exact
    if is_marked:
        reason = "the file is marked as exact, as dynacom repair marks what it writes"
    text = f"Velocities and accelerations are computed from the positions, {how}: {reason}."
    if derived.is_automatic and not is_marked:
        text += f" {_cutoff_text(derived)}"
    if unsure := int(np.count_nonzero(derived.unsure)):
        text += (
            f" Those of {unsure} frames are unsure: the clip begins or ends in motion, and what "
            "was before or came after is not known."
        )
    return text


def _cutoff_text(derived: DerivedMotion) -> str:
    """Why the cut-off is what it is."""
    if np.isnan(derived.noise):
        return f"There are too few frames to tell how noisy they are: {derived.cutoff:g} Hz."
    noise = f"without a filter, the noise of the accelerations is {derived.noise:.2g} g"
    limit = f"{kExactNoise:g} g"
    if derived.cutoff == 0.0:
        return f"The motion is exact: {noise}, up to {limit} are allowed."
    thinned = f"{derived.thinned_noise:.2g} g at {kThinnedRate:g} frames a second"
    if derived.thinned_noise <= kExactNoise:
        return f"The motion is exact, but rounded: {noise}, but {thinned}."
    if derived.noise <= kExactNoise:
        noise += f", but {thinned}"
    text = f"The cut-off was chosen because the motion is not exact: {noise}, more than {limit}."
    if derived.cutoff < kMeasuredCutoff:
        text += (
            f" It is not {kMeasuredCutoff:g} Hz, because there are only "
            f"{derived.frame_rate:.3g} frames a second."
        )
    return text


def _gravity_texts(robot: Robot) -> Iterator[str]:
    """Where it is not the Earth's."""
    gravity = -robot.model.gravity.linear[2]
    if abs(gravity - STANDARD_GRAVITY) > 0.01:
        text = "is the weight there" if gravity > 0.0 else f"is with {STANDARD_GRAVITY} m/s^2"
        yield f"Gravity is {gravity:g} m/s^2; m g {text}."


def _unjudged_texts(found: MotionExamination) -> Iterator[str]:
    """Frames whose forces nobody judges, beside those that the derivatives' sentence tells of."""
    unsure = np.count_nonzero(found.verdict.unsure)
    if unsure > np.count_nonzero(found.derived.unsure):
        yield (
            f"Forces are not judged in {unsure} of {len(found.verdict.unsure)} frames, in which "
            "accelerations are not known: where the clip begins or ends in motion, beside jumps, "
            "and within half a period of the filter from take-offs and landings."
        )


def _downward_texts(robot: Robot, verdict: MotionVerdict) -> Iterator[str]:
    """Of contacts whose normal points down for most of the time, or beyond the fault's limit."""
    finding = verdict.findings["downward_normal"]
    for (name, settings), normal in zip(robot.contacts.items(), verdict.normals, strict=True):
        if normal.downward_share > 0.5 or (finding.holds and finding.subject == name):
            yield (
                f"{name}'s normal points down (the z axis of the frame {settings.frame_name} has "
                f"a vertical component of {normal.up:.2f} on average) in "
                f"{normal.downward_share:.0%} of the frames in which it carries: a contact's z "
                "axis must point into the robot, else its force would pull. The robot file is to "
                "be corrected first."
            )


def window_times(verdict: MotionVerdict) -> list[list[float]]:
    """The first and the last time of each window."""
    return [[window.begin, window.end] for window in verdict.windows]


def _reasons(verdict: MotionVerdict, options: AnalysisOptions, frames: int) -> list[dict[str, Any]]:
    reasons = []
    for code, finding in verdict.findings.items():
        unit, text = FAULTS[code]
        limit = getattr(options.verdict, code)
        share = finding.frames / frames
        if finding.frames:
            text += (
                f": more than {limit.limit:g} {unit} in {finding.frames} of {frames} frames, up to "
                f"{finding.worst:.3g} {unit} at {finding.time:.2f} s"
            )
            if finding.subject:
                text += f" ({finding.subject})"
        reasons.append(
            {
                "code": code,
                "holds": finding.holds,
                "frames": finding.frames,
                "share": share,
                "worst": finding.worst,
                "unit": unit,
                "time": finding.time,
                "subject": finding.subject or None,
                "threshold": limit.limit,
                "allowed_share": limit.allowed_share,
                "text": text,
            }
        )
    return reasons


def _residuals(
    found: MotionExamination | CutoffSensitivity, cutoff: float | None = None
) -> dict[str, Any]:
    statistics = found.statistics
    return {
        "cutoff": found.cutoff if cutoff is None else cutoff,
        "residual_force_rms": statistics.residual_force_rms,
        "residual_torque_rms": statistics.residual_torque_rms,
        "relaxed_share": statistics.share(DistributionStatus.Relaxed),
        "verdict": found.verdict.outcome,
        "codes": found.verdict.codes,
    }


def _compare_forces(clip: Clip, analysis: MotionAnalysis) -> dict[str, Any]:
    """Of each contact whose force the file holds: computed minus measured, by component."""
    compared = {}
    for contact in analysis.contacts:
        if contact.name not in clip.forces:
            continue
        measured = clip.forces[contact.name]
        difference = compareMeasured(contact.wrench[:, : measured.shape[1]], measured)
        if difference.frames > 0:
            compared[contact.name] = {
                name: getattr(difference, name).tolist() for name in ("bias", "rms", "correlation")
            }
    return compared


# The table.


def _faults_by_frame(verdict: MotionVerdict, options: AnalysisOptions) -> np.ndarray:
    """The codes of the faults beyond whose limits each frame is, with + between them, (T,)."""
    combination = np.zeros(len(verdict.unsure), dtype=int)
    for bit, (code, finding) in enumerate(verdict.findings.items()):
        combination |= (finding.measured > getattr(options.verdict, code).limit) << bit
    found, places = np.unique(combination, return_inverse=True)
    texts = [
        "+".join(code for bit, code in enumerate(verdict.findings) if number >> bit & 1)
        for number in found.tolist()
    ]
    return np.array(texts)[places]


def _collect_arrays(
    clip: Clip, found: MotionExamination, options: AnalysisOptions
) -> dict[str, np.ndarray]:
    analysis = found.analysis
    arrays = distance_arrays(found)
    arrays["status"] = np.array([status.name for status in analysis.status])
    arrays["judged"] = ~np.asarray(found.verdict.unsure, dtype=bool)
    arrays["fault"] = _faults_by_frame(found.verdict, options)
    for code, finding in found.verdict.findings.items():
        arrays[f"fault.{code}"] = finding.measured
    names = [name for name, _, _ in _FRAME_COLUMNS if name not in arrays]
    arrays |= {name: getattr(analysis, name) for name in names}
    confidence = found.schedule.confidence
    ground, contacts = found.ground, found.contacts
    for index, (contact, moved) in enumerate(zip(analysis.contacts, contacts, strict=True)):
        wrench = contact.wrench
        values = {
            "active": np.asarray(contact.active, dtype=bool),
            "force": wrench[:, :3],
            "torque": wrench[:, 3:],
            "cop": contact.cop,
            "friction_usage": contact.friction_usage,
            "cone_usage": computeConeUsage(contact),
            "yaw_usage": contact.yaw_usage,
            "cop_margin": contact.cop_margin,
            "position": moved.position,
            "rotation": moved.rotation,
            "height": moved.height - ground[:, index],
            "speed": np.linalg.norm(moved.velocity, axis=1),
        }
        if contact.name in clip.forces:
            measured = clip.forces[contact.name]
            values["measured_force"] = measured[:, :3]
            if measured.shape[1] == 6:
                values["measured_torque"] = measured[:, 3:]
        if confidence is not None:
            values["confidence"] = confidence[:, index]
        arrays |= {f"contact.{contact.name}.{name}": array for name, array in values.items()}
    for part, place in zip(analysis.parts, found.parts, strict=True):
        if "." in part.name and place.contact < len(contacts):
            arrays[f"contact.{part.name}.active"] = np.asarray(part.active, dtype=bool)
    for index, body in enumerate(analysis.bodies):
        key = f"body.{body.link}"
        arrays[f"{key}.active"] = np.asarray(body.active, dtype=bool)
        arrays[f"{key}.confidence"] = found.bodies.confidence[:, index]
        arrays[f"{key}.force"] = body.force
        arrays[f"{key}.position"] = body.position
    return arrays


def without_nan(value: Any) -> Any:
    """The value, with null where JSON has no number."""
    if isinstance(value, dict):
        return {key: without_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [without_nan(item) for item in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
