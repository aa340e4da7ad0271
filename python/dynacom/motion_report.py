# SPDX-License-Identifier: BSD-2-Clause
"""What a motion asks of the ground, frame by frame and as a whole."""

import json
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dynacom.analysis_options import AnalysisOptions
from dynacom.dynacom_pywrap import (
    ContactMotion,
    ContactSchedule,
    DynaCoM,
    Motion,
    MotionAnalysis,
    MotionVerdict,
    analyzeMotion,
    compareDerivatives,
    computeContactMotions,
    detectContacts,
    differentiate,
    estimateGround,
    filterConfigurations,
    judgeMotion,
    kMaximalCutoff,
)
from dynacom.errors import DynacomError
from dynacom.motion_file import Clip, read_motion
from dynacom.results_folder import results_folder
from dynacom.robots import Robot, load_robot
from dynacom.schedule_file import read_schedule, write_schedule

if TYPE_CHECKING:
    import pandas

# All that may be written of a report.
_FILES = ("frames.csv", "frames.parquet", "report.html", "schedule.yaml", "summary.json")

_XYZ = ("_x", "_y", "_z")
_XY = ("_x", "_y")
_WRENCH = tuple(f"_{part}{axis}" for part in ("force", "torque") for axis in _XYZ)
_WRENCH_UNITS = ("N", "N", "N", "N m", "N m", "N m")

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
    ("residual", _WRENCH, _WRENCH_UNITS),
    ("feasible_acom", _XYZ, "m/s^2"),
    ("feasible_dam", _XYZ, "N m"),
)
_CONTACT_COLUMNS = (
    ("active", ("",), ""),
    ("force", _XYZ, "N"),
    ("torque", _XYZ, "N m"),
    ("cop", _XY, "m"),
    ("friction_usage", ("",), ""),
    ("yaw_usage", ("",), ""),
    ("cop_margin", ("",), "m"),
    ("position", _XYZ, "m"),
    ("rotation", ("_x", "_y", "_z", "_w"), ""),
    ("height", ("",), "m"),
    ("speed", ("",), "m/s"),
)
# Where the file says what the contacts felt.
_MEASURED_COLUMNS = (("measured_force", _XYZ, "N"), ("measured_torque", _XYZ, "N m"))

# How far derivatives from a file may be off, as parts of them, to be used: integrators differ by
# more than rounding, and a landing is a step in velocity.
_VELOCITY_MISMATCH = 0.05
_ACCELERATION_MISMATCH = 0.2
# How far a frame may be from where an even frame rate puts it, in frames, to be taken for there:
# times are often rounded to milliseconds.
_EVEN = 0.1

# From which height on a ground is worth a question: most files have theirs at zero [m].
_FAR_FROM_ZERO = 0.1

#: What may be wrong with a motion: code -> unit of its worst value, and what it means.
FAULTS = {
    "residual_force": ("m g", "the contacts cannot give the force"),
    "residual_torque": ("m g m", "the contacts cannot give the moment"),
    "flight_with_support_needed": ("m g", "no contact is active, but the motion needs support"),
    "contact_missing": ("m g", "a contact just above the ground would have to push"),
    "ground_penetration": ("m", "a contact is below the ground"),
    "foot_sliding": ("m/s", "an active contact slides"),
    "discontinuity": ("m or rad", "the motion jumps"),
    "quaternion": ("of the norm", "the root's quaternions are not of norm 1"),
}


@dataclass(frozen=True)
class MotionReport:
    """What was found of a motion.

    Arrays have a row per frame, are in the world's axes unless they say otherwise, and in SI units.
    """

    clip: Clip
    robot: Robot
    options: AnalysisOptions
    #: As analysed: filtered, where derivatives had to be computed.
    motion: Motion = field(repr=False)
    schedule: ContactSchedule = field(repr=False)
    analysis: MotionAnalysis = field(repr=False)
    verdict: MotionVerdict
    #: By name, see docs/columns.md: ``com`` (T, 3), ``contact.left_sole.force`` (T, 3), ...
    arrays: dict[str, np.ndarray] = field(repr=False)
    #: What summary.json holds: docs/verdict.md.
    summary: dict[str, Any] = field(repr=False)

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
        folder = Path(folder)
        try:
            with results_folder(folder, _FILES) as temporary:
                self._write_tables(temporary, csv)
                text = json.dumps(self.summary, indent=2, ensure_ascii=False, allow_nan=False)
                (temporary / "summary.json").write_text(text + "\n", encoding="utf-8")
                write_schedule(self.schedule, self.motion.time, temporary / "schedule.yaml")
                if page:
                    from dynacom.page import write_page

                    write_page(
                        temporary / "report.html",
                        self.robot,
                        self.motion.q,
                        self.arrays,
                        self.summary,
                    )
                names = sorted(file.name for file in temporary.iterdir())
        except OSError as error:
            raise DynacomError(
                f"{folder}: cannot be written ({error.strerror or error})"
            ) from error
        return [folder / name for name in names]

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
    progress: Callable[[float], None] | None = None,
) -> MotionReport:
    """Judges a motion: what the ground must give, what its contacts can, and whether that suffices.

    Where the file's velocities and accelerations do not agree with its configurations, or it has
    none, they are computed: see ``filterConfigurations`` and ``differentiate``. Contacts are active
    as `schedule` says, else as the file says, else as ``detectContacts`` finds them.

    Args:
        motion: a file, see :func:`read_motion`, or what was read from one.
        robot: a robot, or the name or file of one, see :func:`load_robot`.
        fps, quat, trust, clip: as in :func:`read_motion`.
        schedule: a file, see docs/verdict.md, or a schedule with T frames.
        options: settings; their defaults by default.
        sensitivity: whether to judge the motion with half and twice the cut-off, too, which takes
            three times as long.
        progress: called now and then with what part of the work is done.

    Raises:
        DynacomError: the file cannot be read or is no motion of this robot, see
            :func:`read_motion`; the schedule is not one for it; the cut-off is not below
            ``kMaximalCutoff`` of the frame rate, or the frame rate is not even.
        ValueError: options are out of their ranges.
    """
    options = options or AnalysisOptions()
    options.validate()
    if not isinstance(robot, Robot):
        robot = load_robot(robot)
    if not isinstance(motion, Clip):
        motion = read_motion(motion, robot, fps=fps, quat=quat, trust=trust, clip=clip)
    try:
        report = progress or (lambda part: None)
        return _analyze(motion, robot, schedule, options, sensitivity, report)
    except ValueError as error:
        raise DynacomError(f"{motion.path}: {error}") from error


@dataclass(frozen=True)
class _Derived:
    """A motion with derivatives, and where these come from."""

    motion: Motion
    #: Of the filter [Hz]; None where there was none.
    cutoff: float | None
    text: str


def _analyze(
    clip: Clip,
    robot: Robot,
    schedule: str | Path | ContactSchedule | None,
    options: AnalysisOptions,
    sensitive: bool,
    progress: Callable[[float], None],
) -> MotionReport:
    derived = _derive(clip, robot, options.cutoff)
    dynamics = robot.dynacom()
    contacts = computeContactMotions(dynamics, derived.motion)
    ground = estimateGround(contacts, clip.time, options.detection)
    schedule, schedule_text = _find_schedule(clip, schedule, contacts, ground, options)
    dynamics.setGroundHeight(float(ground.mean()))

    # The motion itself, and with other cut-offs how much hangs on that.
    others = _other_cutoffs(clip, derived.cutoff) if sensitive else []
    work = (1 + len(others)) * len(clip.time)

    def judge(motion: Motion, done: int) -> tuple[MotionAnalysis, MotionVerdict]:
        analysis = analyzeMotion(
            dynamics,
            motion,
            schedule,
            options.flat,
            omega=options.omega,
            progress=lambda frames: progress((done + frames) / work),
        )
        moved = contacts if motion is derived.motion else computeContactMotions(dynamics, motion)
        verdict = judgeMotion(
            dynamics,
            motion,
            clip.q,
            clip.quaternion_error,
            moved,
            ground,
            analysis,
            options.verdict,
        )
        return analysis, verdict

    analysis, verdict = judge(derived.motion, 0)
    weight = _weight(dynamics)
    sensitivity = []
    if derived.cutoff is not None:
        sensitivity.append(_residuals(derived.cutoff, analysis, verdict, weight))
        for number, cutoff in enumerate(others):
            other = _recompute(clip, robot, cutoff)
            results = judge(other, (1 + number) * len(clip.time))
            sensitivity.append(_residuals(cutoff, *results, weight))
        sensitivity.sort(key=lambda entry: entry["cutoff"])

    arrays = _collect_arrays(clip, analysis, contacts, ground)
    unexplained = _unexplained(clip, analysis, verdict)
    rms_force, rms_torque = _residual_rms(analysis, weight)
    notes = [
        *clip.notes,
        derived.text,
        schedule_text,
        _ground_text(robot, ground, options.detection.same_ground),
    ]
    if unexplained["share"] > 0.0:
        notes.append(_unexplained_text(unexplained))
    summary = {
        "clip": clip.path.name,
        "robot": robot.name,
        "mass": dynamics.getMass(),
        "frames": len(clip.time),
        "duration": float(clip.time[-1] - clip.time[0]),
        "frame_rate": _frame_rate(clip.time),
        "omega": analysis.omega,
        "verdict": "feasible" if verdict.feasible else "not feasible",
        "codes": _codes(verdict),
        "reasons": _reasons(verdict, options, len(clip.time)),
        "statuses": dict(Counter(status.name for status in analysis.status)),
        "residual_force_rms": rms_force,
        "residual_torque_rms": rms_torque,
        "notes": notes,
        "derivatives": derived.text,
        "cutoff": derived.cutoff,
        "cutoff_sensitivity": sensitivity,
        "ground": dict(zip(robot.contacts, ground.tolist(), strict=True)),
        "contacts": {c.name: _summarize_contact(c, weight) for c in analysis.contacts},
        "mean_vertical_force": float(analysis.ground_force[:, 2].mean() / weight),
        "momentum_change": float(_momentum_change(analysis, dynamics.getMass()) / weight),
        "unexplained": unexplained,
        "measured": _compare_forces(clip, analysis),
        "options": options.to_dict(),
    }
    return MotionReport(
        clip,
        robot,
        options,
        derived.motion,
        schedule,
        analysis,
        verdict,
        arrays,
        _without_nan(summary),
    )


# Derivatives.


def _even_times(time: np.ndarray) -> np.ndarray | None:
    """The times of an even frame rate, where these are that but for rounding."""
    if len(time) < 2:
        return None
    even, step = np.linspace(time[0], time[-1], len(time), retstep=True)
    return even if np.ptp(time - even) <= 2.0 * _EVEN * step else None


def _frame_rate(time: np.ndarray) -> float | None:
    """Frames per second, where they are evenly spaced [Hz]."""
    if _even_times(time) is None:
        return None
    return float((len(time) - 1) / (time[-1] - time[0]))


def _recompute(clip: Clip, robot: Robot, cutoff: float | None) -> Motion:
    q, rate = clip.q, _frame_rate(clip.time)
    if cutoff is not None:
        q = filterConfigurations(robot.model, q, rate, cutoff)
    time = clip.time if rate is None else _even_times(clip.time)
    motion = differentiate(robot.model, time, q)
    return Motion(clip.time, motion.q, motion.v, motion.a)


def _derive(clip: Clip, robot: Robot, cutoff: float | None) -> _Derived:
    reason = "the file has none"
    if clip.v is not None and clip.a is not None:
        motion = Motion(clip.time, clip.q, clip.v, clip.a)
        mismatch = compareDerivatives(robot.model, motion)
        fits = f"{mismatch.velocity:.1%} and {mismatch.acceleration:.1%}"
        agree = mismatch.velocity <= _VELOCITY_MISMATCH
        if agree and mismatch.acceleration <= _ACCELERATION_MISMATCH:
            text = f"Velocities and accelerations are the file's: they differ by {fits} from its"
            return _Derived(motion, None, f"{text} positions and velocities.")
        reason = f"the file's differ by {fits} from its positions and velocities"
    elif clip.v is not None:
        reason = "the file has velocities only"
    rate = _frame_rate(clip.time)
    if cutoff is not None and rate is None and len(clip.time) > 1:
        raise DynacomError(
            f"{clip.path}: times must be evenly spaced to be filtered, got steps from "
            f"{np.diff(clip.time).min():g} to {np.diff(clip.time).max():g} s; without a filter "
            "(--cutoff 0) they need not be"
        )
    if rate is None:
        cutoff = None
    elif cutoff is not None and not 0.0 < cutoff < kMaximalCutoff * rate:
        raise DynacomError(
            f"{clip.path}: cutoff must be > 0 and < {kMaximalCutoff * rate:g} Hz, which is "
            f"{kMaximalCutoff:g} of the frame rate, got {cutoff:g} Hz"
        )
    how = (
        "without a filter"
        if cutoff is None
        else f"after a Butterworth filter of 4th order, forward and backward, at {cutoff:g} Hz"
    )
    if rate is not None and (error := np.abs(clip.time - _even_times(clip.time)).max()) > 1e-6:
        how += f", with times made even, by up to {1e3 * error:.2g} ms"
    text = f"Velocities and accelerations are computed from the positions, {how}: {reason}."
    return _Derived(_recompute(clip, robot, cutoff), cutoff, text)


def _other_cutoffs(clip: Clip, cutoff: float | None) -> list[float]:
    if cutoff is None:
        return []
    limit = kMaximalCutoff * _frame_rate(clip.time)
    return [other for other in (0.5 * cutoff, 2.0 * cutoff) if other < limit]


# Contacts.


def _find_schedule(
    clip: Clip,
    given: str | Path | ContactSchedule | None,
    contacts: list[ContactMotion],
    ground: np.ndarray,
    options: AnalysisOptions,
) -> tuple[ContactSchedule, str]:
    if isinstance(given, ContactSchedule):
        return given, "Contacts are active as the caller says."
    if given is not None:
        names = [contact.name for contact in contacts]
        return read_schedule(given, clip.time, names), f"Contacts are active as {given} says."
    if clip.schedule is not None:
        return clip.schedule, "Contacts are active as the file says."
    found = detectContacts(contacts, clip.time, ground, options.detection)
    return found, "Contacts are found from height and speed."


def _ground_text(robot: Robot, ground: np.ndarray, same_ground: float) -> str:
    heights = ", ".join(
        f"{name} {height:.3f} m" for name, height in zip(robot.contacts, ground, strict=True)
    )
    text = f"Height of the ground: {heights}."
    lowest = ground.min()
    if steps := [
        f"{name} ({height - lowest:.2f} m)"
        for name, height in zip(robot.contacts, ground, strict=True)
        if height - lowest > same_ground
    ]:
        text += (
            f" {', '.join(steps)} higher: still there, and so taken to stand on steps."
            " If they are in the air, --ground-height says where the ground is."
        )
    if np.abs(ground).min() > _FAR_FROM_ZERO:
        text += " None is near the height 0: is it this robot's motion?"
    return text


# Results.


def _weight(dynamics: DynaCoM) -> float:
    """What forces are compared with: m g, of standard gravity where there is none [N]."""
    return dynamics.getMass() * (-dynamics.getSettings().gravity[2] or 9.81)


def _momentum_change(analysis: MotionAnalysis, mass: float) -> float:
    """What part of the mean vertical force ends in momentum [N]: the clip may begin in a fall."""
    time, velocity = analysis.time, analysis.vcom[:, 2]
    duration = time[-1] - time[0]
    return float(mass * (velocity[-1] - velocity[0]) / duration) if duration > 0.0 else 0.0


def _unexplained(clip: Clip, analysis: MotionAnalysis, verdict: MotionVerdict) -> dict[str, Any]:
    """What the contacts cannot give.

    The mean force [N] and moment about the CoM [N m] are over the frames in which no contact is
    missing, in the heading's axes: x to where the root looks, z up.
    """
    supported = np.ones(len(clip.time), dtype=bool)
    for code in ("contact_missing", "flight_with_support_needed"):
        supported &= verdict.findings[code].measured == 0.0
    x, y, z, w = clip.q[:, 3:7].T
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    cos, sin = np.cos(yaw), np.sin(yaw)
    forward = np.stack([cos, sin, 0.0 * yaw], axis=1)
    left = np.stack([-sin, cos, 0.0 * yaw], axis=1)
    residual = analysis.residual.reshape(-1, 2, 3)
    force, torque = (
        [
            _mean((part * forward).sum(axis=1)[supported]),
            _mean((part * left).sum(axis=1)[supported]),
            _mean(part[supported, 2]),
        ]
        for part in (residual[:, 0], residual[:, 1])
    )
    solved = [status.name == "Solved" for status in analysis.status]
    return {"share": 1.0 - float(np.mean(solved)), "force": force, "torque": torque}


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if len(values) else 0.0


def _unexplained_text(unexplained: dict[str, Any]) -> str:
    force, torque = (
        ", ".join(f"{value:.3g}" for value in unexplained[part]) for part in ("force", "torque")
    )
    return (
        f"In {unexplained['share']:.1%} of the frames the contacts cannot give what the motion "
        f"takes. Where no contact is missing, ({force}) N and ({torque}) N m are missing on "
        "average, forward, left and up: a load that nobody has told of may be the reason."
    )


def _codes(verdict: MotionVerdict) -> list[str]:
    holding = [code for code, finding in verdict.findings.items() if finding.holds]
    return holding or ["feasible"]


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
        reasons.append(
            {
                "code": code,
                "holds": finding.holds,
                "frames": finding.frames,
                "share": share,
                "worst": finding.worst,
                "unit": unit,
                "time": finding.time,
                "threshold": limit.limit,
                "allowed_share": limit.allowed_share,
                "text": text,
            }
        )
    return reasons


def _residual_rms(analysis: MotionAnalysis, weight: float) -> tuple[float, float]:
    """Of the force [m g], and of the moment about the CoM [m g m]."""
    norms = np.linalg.norm(analysis.residual.reshape(-1, 2, 3), axis=2) / weight
    force, torque = np.sqrt((norms**2).mean(axis=0)).tolist()
    return force, torque


def _residuals(
    cutoff: float, analysis: MotionAnalysis, verdict: MotionVerdict, weight: float
) -> dict[str, Any]:
    rms_force, rms_torque = _residual_rms(analysis, weight)
    relaxed = [status.name == "Relaxed" for status in analysis.status]
    return {
        "cutoff": cutoff,
        "residual_force_rms": rms_force,
        "residual_torque_rms": rms_torque,
        "relaxed_share": float(np.mean(relaxed)),
        "codes": _codes(verdict),
    }


def _collect_arrays(
    clip: Clip, analysis: MotionAnalysis, contacts: list[ContactMotion], ground: np.ndarray
) -> dict[str, np.ndarray]:
    names = [name for name, _, _ in _FRAME_COLUMNS if name != "status"]
    arrays = {name: getattr(analysis, name) for name in names}
    arrays["status"] = np.array([status.name for status in analysis.status])
    for contact, moved, height in zip(analysis.contacts, contacts, ground, strict=True):
        values = {
            "active": np.asarray(contact.active, dtype=bool),
            "force": contact.wrench[:, :3],
            "torque": contact.wrench[:, 3:],
            "cop": contact.cop,
            "friction_usage": contact.friction_usage,
            "yaw_usage": contact.yaw_usage,
            "cop_margin": contact.cop_margin,
            "position": moved.position,
            "rotation": moved.rotation,
            "height": moved.height - height,
            "speed": np.linalg.norm(moved.velocity, axis=1),
        }
        if contact.name in clip.forces:
            measured = clip.forces[contact.name]
            values["measured_force"] = measured[:, :3]
            if measured.shape[1] == 6:
                values["measured_torque"] = measured[:, 3:]
        arrays |= {f"contact.{contact.name}.{name}": array for name, array in values.items()}
    return arrays


def _summarize_contact(contact: MotionAnalysis.Contact, weight: float) -> dict[str, Any]:
    active = np.asarray(contact.active, dtype=bool)
    share = contact.vertical_force / weight
    usage = contact.friction_usage[np.isfinite(contact.friction_usage)]
    margin = contact.cop_margin[np.isfinite(contact.cop_margin)]
    return {
        "active_share": float(active.mean()),
        "weight_share": float(share.mean()),
        "weight_share_while_active": float(share[active].mean()) if active.any() else None,
        "largest_vertical_force": float(share.max()),
        "largest_friction_usage": float(usage.max()) if len(usage) else None,
        "least_cop_margin": float(margin.min()) if len(margin) else None,
    }


def _compare_forces(clip: Clip, analysis: MotionAnalysis) -> dict[str, Any]:
    """Of each contact whose force the file holds: computed minus measured, by component."""
    compared = {}
    for contact in analysis.contacts:
        if contact.name not in clip.forces:
            continue
        measured = clip.forces[contact.name]
        computed = contact.wrench[:, : measured.shape[1]]
        known = np.isfinite(measured).all(axis=1)
        if not known.any():
            continue
        difference = (computed - measured)[known]
        compared[contact.name] = {
            "bias": difference.mean(axis=0).tolist(),
            "rms": np.sqrt((difference**2).mean(axis=0)).tolist(),
            "correlation": [
                _correlation(a, b)
                for a, b in zip(computed[known].T, measured[known].T, strict=True)
            ],
        }
    return compared


def _correlation(a: np.ndarray, b: np.ndarray) -> float | None:
    if a.std() == 0.0 or b.std() == 0.0:
        return None
    return float(np.corrcoef(a, b)[0, 1])


def _without_nan(value: Any) -> Any:
    """The value, with null where JSON has no number."""
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_without_nan(item) for item in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
