# SPDX-License-Identifier: BSD-2-Clause
"""What a batch finds of a clip: one row, see docs/batch.md."""

import hashlib
import json
import math
import os
import secrets
import urllib.parse
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from dynacom.analysis_options import AnalysisOptions
from dynacom.batch_files import printable
from dynacom.batch_repair import REPAIR_COLUMNS, WRITING, WritingError
from dynacom.dynacom_pywrap import (
    CollisionPoints,
    Contact6DSettings,
    ContactPointSettings,
    DistributionStatus,
    FrictionModel,
    __version__,
)
from dynacom.motion_report import FAULTS, MotionReport, window_times
from dynacom.other_contacts import body_statistics, seat_statistics
from dynacom.robots import Robot
from dynacom.terrain import ground_heights

if TYPE_CHECKING:
    import pyarrow

Row = dict[str, Any]

# Column's name, Arrow's type, unit. docs/batch.md says what they are.
_COLUMNS = (
    ("file", "string", ""),
    ("clip", "string", ""),
    ("sha256", "string", ""),
    ("robot", "string", ""),
    ("status", "string", ""),
    ("error", "string", ""),
    ("verdict", "string", ""),
    ("feasible", "bool", ""),
    ("codes", "list<string>", ""),
    ("severity", "double", ""),
    ("feasible_share", "double", ""),
    ("windows", "list<list<double>>", "s"),
    ("frames", "int64", ""),
    ("duration", "double", "s"),
    ("frame_rate", "double", "Hz"),
    ("mass", "double", "kg"),
    ("omega", "double", "rad/s"),
    ("cutoff", "double", "Hz"),
    ("mean_vertical_force", "double", "m g"),
    ("momentum_change", "double", "m g"),
    ("residual_force_rms", "double", "m g"),
    ("residual_torque_rms", "double", "m g m"),
    ("distance_rms", "double", "m"),
    ("distance_max", "double", "m"),
    ("slope_x", "double", ""),
    ("slope_y", "double", ""),
    ("solved_share", "double", ""),
    ("relaxed_share", "double", ""),
    ("no_contact_share", "double", ""),
    ("bodies", "bodies", ""),
    ("seats", "seats", ""),
    *REPAIR_COLUMNS,
)
# Of the columns that hold a list of things: what is known of each.
_THINGS = {
    "bodies": ("link", "active_share", "weight_share", "largest_vertical_force"),
    "seats": ("link", "begin", "end", "height", "weight_share"),
}
_FAULT_COLUMNS = (
    ("holds", "bool", ""),
    ("frames", "int64", ""),
    ("worst", "double", None),
    ("time", "double", "s"),
)
_CONTACT_COLUMNS = (
    ("active_share", "double", ""),
    ("weight_share", "double", ""),
    ("weight_share_while_active", "double", ""),
    ("largest_vertical_force", "double", "m g"),
    ("largest_friction_usage", "double", ""),
    ("largest_cone_usage", "double", ""),
    ("least_cop_margin", "double", "m"),
    ("ground", "double", "m"),
)
_LAST_COLUMNS = (
    ("seconds", "double", "s"),
    ("dynacom", "string", ""),
)
# Columns that are fields of MotionStatistics.
_STATISTICS = (
    "frames",
    "mass",
    "mean_vertical_force",
    "momentum_change",
    "residual_force_rms",
    "residual_torque_rms",
)
_STATUSES = {
    DistributionStatus.Solved: "solved_share",
    DistributionStatus.Relaxed: "relaxed_share",
    DistributionStatus.NoContact: "no_contact_share",
}
_MEASURED = tuple(
    f"measured_{part}_{axis}" for part in ("force", "torque") for axis in ("x", "y", "z")
)


@dataclass(frozen=True)
class Job:
    """What is done with every clip. It can be sent to another process."""

    robot: Robot
    options: AnalysisOptions
    fps: float | None = None
    quat: str | None = None
    trust: bool = False
    #: Where the tables of frames go; None for nowhere.
    frames: Path | None = None
    #: Where repaired motions go; None if nothing is repaired.
    repair: Path | None = None

    def __reduce__(self) -> tuple:
        robot = self.robot
        contacts = {
            name: (type(settings) is Contact6DSettings, _fields(settings))
            for name, settings in robot.contacts.items()
        }
        others = (robot.urdf, robot.default, robot.joint_layouts, robot.friction)
        parts = (robot.name, robot.model, contacts, *others)
        # Meshes are read once, and not by every process.
        points = None if self.options.feet_only else robot.collision_points
        options = self.options.to_dict()
        others = (self.fps, self.quat, self.trust, self.frames, self.repair)
        return _make_job, (parts, points, options, *others)

    def settings(self) -> dict[str, Any]:
        """All that results depend on, but for the files: it can be written as JSON."""
        robot, options = self.robot, self.options.to_dict()
        if self.repair is None:
            del options["repair"], options["ladder"]
        return {
            "dynacom": __version__,
            "robot": robot.name,
            "model": hashlib.sha256(robot.model.saveToString().encode()).hexdigest(),
            "default": robot.default.tolist(),
            "joint_layouts": robot.joint_layouts,
            "contacts": {name: _jsonable(s) for name, s in robot.contacts.items()},
            "friction": str(self.options.friction_model(robot)),
            "bodies": None if self.options.feet_only else _digest_bodies(robot),
            "options": options,
            "fps": self.fps,
            "quat": self.quat,
            "trust": self.trust,
            "frames": self.frames is not None,
            "repair": self.repair is not None,
        }

    def key(self) -> str:
        """Differs where the settings differ."""
        text = json.dumps(self.settings(), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    def schema(self) -> "pyarrow.Schema":
        """Of the table: its columns are those of docs/batch.md."""
        import pyarrow

        def things(names: tuple[str, ...]) -> pyarrow.DataType:
            kinds = {"link": pyarrow.string()}
            own = [pyarrow.field(name, kinds.get(name, pyarrow.float64())) for name in names]
            return pyarrow.list_(pyarrow.struct(own))

        types = {
            "string": pyarrow.string(),
            "bool": pyarrow.bool_(),
            "int64": pyarrow.int64(),
            "double": pyarrow.float64(),
            "list<string>": pyarrow.list_(pyarrow.string()),
            "list<list<double>>": pyarrow.list_(pyarrow.list_(pyarrow.float64())),
        } | {column: things(names) for column, names in _THINGS.items()}
        columns = list(_COLUMNS)
        for code, (unit, _) in FAULTS.items():
            columns += [
                (f"{code}.{name}", t, unit if u is None else u) for name, t, u in _FAULT_COLUMNS
            ]
        for contact in self.robot.contacts:
            columns += [(f"contact.{contact}.{name}", t, u) for name, t, u in _CONTACT_COLUMNS]
        columns += _LAST_COLUMNS
        fields = [
            pyarrow.field(name, types[t], metadata={"unit": unit}) for name, t, unit in columns
        ]
        metadata = {"dynacom.key": self.key(), "dynacom.settings": json.dumps(self.settings())}
        return pyarrow.schema(fields, metadata)


def _make_job(
    parts: tuple, points: CollisionPoints | None, options: dict[str, Any], *others: Any
) -> Job:
    name, model, contacts, *rest = parts
    made = {}
    for contact, (is_6d, values) in contacts.items():
        made[contact] = settings = Contact6DSettings() if is_6d else ContactPointSettings()
        for key, value in values.items():
            setattr(settings, key, value)
    own = AnalysisOptions()
    own.update(options, "options")
    robot = Robot(name, model, made, *rest)
    if points is not None:
        vars(robot)["collision_points"] = points  # as functools.cached_property keeps it
    return Job(robot, own, *others)


def _fields(settings: Any) -> dict[str, Any]:
    names = [name for name, value in vars(type(settings)).items() if isinstance(value, property)]
    return {name: getattr(settings, name) for name in names}


def _jsonable(settings: Any) -> dict[str, Any]:
    return {name: _plain(value) for name, value in _fields(settings).items()}


def _plain(value: Any) -> Any:
    """Of a setting, what JSON has; no bound is null."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, pin.SE3):
        return value.homogeneous.tolist()
    if isinstance(value, FrictionModel):
        return str(value)
    if isinstance(value, float) and math.isinf(value):
        return None
    return value


def _digest_bodies(robot: Robot) -> str:
    """Differs where what may touch the ground differs."""
    digest = hashlib.sha256()
    for body in robot.collision_points.bodies:
        digest.update(f"{body.link}:{body.joint}:".encode())
        digest.update(body.points.tobytes() + body.radius.tobytes())
    return digest.hexdigest()


def report_row(report: MotionReport, name: str) -> Row:
    """What the summary says, without its sentences: those take as long as the analysis."""
    found = report.examination
    statistics, derived = found.statistics, found.derived
    verdict = found.verdict
    findings = verdict.findings
    row = {
        "file": name,
        "robot": printable(report.robot.name),
        "status": "ok",
        "verdict": verdict.outcome,
        "feasible": None if verdict.outcome == "unknown" else verdict.feasible,
        "codes": verdict.codes,
        "severity": verdict.severity,
        "feasible_share": verdict.feasible_share,
        "windows": window_times(verdict),
        "duration": float(report.clip.time[-1] - report.clip.time[0]),
        "frame_rate": derived.frame_rate,
        "omega": found.analysis.omega,
        "cutoff": derived.cutoff or None,
        "bodies": [{"link": link, **own} for link, own in body_statistics(found).items()],
        "seats": seat_statistics(found),
        "dynacom": __version__,
    }
    if (distance := found.distance) is not None:
        row |= {"distance_rms": distance.rms, "distance_max": distance.largest}
    for column in _STATISTICS:
        row[column] = getattr(statistics, column)
    for status, column in _STATUSES.items():
        row[column] = statistics.share(status)
    for code, finding in findings.items():
        for column, _, _ in _FAULT_COLUMNS:
            row[f"{code}.{column}"] = getattr(finding, column)
    grounds = ground_heights(found)
    if any(map(math.isfinite, grounds.values())):
        row["slope_x"], row["slope_y"] = map(float, found.inference.slope)
    for contact in statistics.contacts:
        for column, _, _ in _CONTACT_COLUMNS:
            value = grounds[contact.name] if column == "ground" else getattr(contact, column)
            row[f"contact.{contact.name}.{column}"] = value
    return without_nan(row)


def without_nan(row: Row) -> Row:
    """The row, with null where a number does not exist, or is too large."""
    return {
        column: None if isinstance(value, float) and not math.isfinite(value) else value
        for column, value in row.items()
    }


# Frames.


def frames_file(folder: Path, robot: Robot, name: str, clip: str | None) -> Path:
    """Where a clip's table lies: partitioned, since folders of a million files serve nobody."""
    text = name if clip is None else f"{name}\0{clip}"
    digest = hashlib.sha256(text.encode()).hexdigest()
    robot_name = urllib.parse.quote(printable(robot.name), safe="")
    # Letters only: some buckets alone would be read as numbers.
    bucket = "".join("abcdefghijklmnop"[int(digit, 16)] for digit in digest[:2])
    return folder / f"robot={robot_name}" / f"bucket={bucket}" / f"{digest[:32]}.parquet"


def write_frames(
    report: MotionReport, name: str, clip: str | None, path: Path, folder: Path
) -> None:
    """Writes a clip's table, as a whole.

    Args:
        name: of the file in results.
        path: see :func:`frames_file`.
        folder: of all tables.

    Raises:
        WritingError: the folder cannot be written to.
    """
    import pyarrow
    import pyarrow.parquet

    count = len(report.arrays["time"])
    columns = report.columns()
    # The same columns for every clip of a robot.
    nothing = np.full(count, np.nan)
    for contact in report.robot.contacts:
        for ending in _MEASURED:
            unit = "N" if "force" in ending else "N m"
            columns.setdefault(f"contact.{contact}.{ending}", (nothing, unit))
    fields, arrays = [], []
    texts = {"file": name, "clip": clip}
    for title, text in texts.items():
        values = pyarrow.array([text] * count, pyarrow.string()).dictionary_encode()
        fields.append(pyarrow.field(title, values.type))
        arrays.append(values)
    fields.append(pyarrow.field("frame", pyarrow.int64()))
    arrays.append(pyarrow.array(np.arange(count)))
    contacts = [column for column in columns if column.startswith("contact.")]
    names = [column for column in columns if column not in set(contacts)] + sorted(contacts)
    for column in names:
        values, unit = columns[column]
        array = pyarrow.array(values.tolist() if values.dtype.kind == "U" else values)
        fields.append(pyarrow.field(column, array.type, metadata={"unit": unit}))
        arrays.append(array)
    temporary = folder / WRITING / f"{path.stem}-{secrets.token_hex(4)}.parquet"
    try:
        for parent in (path.parent, temporary.parent):
            parent.mkdir(parents=True, exist_ok=True)
        table = pyarrow.Table.from_arrays(arrays, schema=pyarrow.schema(fields))
        pyarrow.parquet.write_table(table, temporary)
        os.replace(temporary, path)
    except OSError as error:
        with suppress(OSError):
            temporary.unlink()
        raise WritingError(f"{folder}: cannot be written ({error.strerror or error})") from error
