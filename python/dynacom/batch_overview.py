# SPDX-License-Identifier: BSD-2-Clause
"""What is to be said of all clips of a batch together."""

import heapq
import json
import math
import statistics
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pyarrow.parquet

from dynacom.batch_repair import OUTCOMES
from dynacom.batch_row import Row
from dynacom.motion_report import FAULTS

# So many of the worst clips, and of those that could not be judged, are told one by one.
_LISTED = 200
# From the best to the worst.
_VERDICTS = ("feasible", "unknown", "repairable", "not feasible")
_COLUMNS = (
    *("file", "clip", "status", "error", "verdict", "codes", "severity", "feasible_share"),
    *("frames", "duration"),
    *("mean_vertical_force", "residual_force_rms", "residual_torque_rms"),
    *("distance_rms", "distance_max", "slope_x", "slope_y"),
    *("repair", "repair_root_max", "repair_reasons", "repair_file", "repair_error"),
    *(f"{code}.{column}" for code in FAULTS for column in ("holds", "frames", "worst")),
)
# A folder's ground is worth a word if it has so many clips, if theirs lie no farther apart than
# this [m], and none nearer to zero; or are slopes whose gradients differ by no more in x and y, and
# are this on average: one degree.
_GROUND_CLIPS = 3
_GROUND_SPREAD = 0.02
_GROUND_HEIGHT = 0.01
_SLOPE_SPREAD = 0.02
_SLOPE = math.tan(math.radians(1.0))


@dataclass(frozen=True)
class Ground:
    """On which the clips of a folder stand, one for all, which is not level, or not at zero."""

    #: Empty for all folders together.
    folder: str
    clips: int
    #: [m]; of a slope, where contacts stand on it on average.
    height: float
    #: Gradient (∂z/∂x, ∂z/∂y), zero where it is level.
    slope: tuple[float, float] = (0.0, 0.0)

    def text(self) -> str:
        """A sentence."""
        where = f" in {self.folder}" if self.folder else ""
        clips = f"The ground of all {self.clips} clips{where} whose ground is known"
        if not any(self.slope):
            return f"{clips} lies at {self.height:.2f} m."
        angle = math.degrees(math.atan(math.hypot(*self.slope)))
        towards = math.degrees(math.atan2(self.slope[1], self.slope[0]))
        return (
            f"{clips} is a slope of {angle:.1f} degrees, which rises towards {towards:.0f} degrees "
            "from the x axis of the world: motions may be tilted."
        )


@dataclass
class Overview:
    """Counts, and the worst."""

    #: Verdict -> clips that have it; all verdicts, from the best to the worst.
    verdicts: Counter[str] = field(default_factory=lambda: Counter(dict.fromkeys(_VERDICTS, 0)))
    #: Clips that could not be judged.
    errors: int = 0
    #: Code -> clips in which the fault holds; all codes.
    codes: Counter[str] = field(default_factory=lambda: Counter(dict.fromkeys(FAULTS, 0)))
    frames: int = 0
    #: [s]
    duration: float = 0.0
    #: Of the frames, in windows.
    feasible_frames: float = 0.0
    #: Rows of the worst clips: those in the largest share of whose frames a fault is that holds.
    worst: list[Row] = field(default_factory=list)
    #: Rows of the first clips that could not be judged.
    failed: list[Row] = field(default_factory=list)
    #: Whether the batch repairs motions, too.
    repairs: bool = False
    #: Outcome of repair -> clips that have it; all outcomes, from the best to the worst.
    outcomes: Counter[str] = field(default_factory=lambda: Counter(dict.fromkeys(OUTCOMES, 0)))
    #: Code -> clips that it keeps from being repaired; codes that do.
    repair_codes: Counter[str] = field(default_factory=Counter)
    #: Clips that could be judged, but whose repair failed, or could not be written.
    repair_errors: int = 0
    #: Rows of the first of these.
    repair_failed: list[Row] = field(default_factory=list)
    #: Grounds worth a word.
    grounds: list[Ground] = field(default_factory=list)

    @property
    def clips(self) -> int:
        """All of them."""
        return self.judged + self.errors

    @property
    def judged(self) -> int:
        """All of them, but for errors."""
        return self.verdicts.total()


def overview(table: Path, listed: int = _LISTED) -> Overview:
    """Of a batch's table, which is read a bit at a time.

    Args:
        listed: how long lists may be.
    """
    found = Overview()
    file = pyarrow.parquet.ParquetFile(table)
    settings = json.loads(file.schema_arrow.metadata[b"dynacom.settings"])
    found.repairs = settings["repair"]
    contacts = [name for name in file.schema_arrow.names if name.endswith(".ground")]
    if settings["options"]["detection"]["ground_height"] is not None:
        contacts = []  # it is where the user says
    grounds: dict[str, _Grounds] = {}
    rows = _judged(file, contacts, found, grounds, listed)
    found.worst = heapq.nlargest(listed, rows, key=_badness)
    found.grounds = _find_grounds(grounds)
    return found


@dataclass
class _Grounds:
    """Of a folder's clips: the least and the largest of their heights [m] and gradients."""

    clips: int = 0
    lowest: tuple[float, ...] = (math.inf,) * 3
    highest: tuple[float, ...] = (-math.inf,) * 3

    def add(self, other: "_Grounds") -> None:
        self.clips += other.clips
        self.lowest = tuple(map(min, self.lowest, other.lowest))
        self.highest = tuple(map(max, self.highest, other.highest))

    def ground(self, folder: str) -> Ground | None:
        """That of all, if it is worth a word."""
        if self.clips < _GROUND_CLIPS:
            return None
        pairs = list(zip(self.lowest, self.highest, strict=True))
        spread, *slope_spreads = (high - low for low, high in pairs)
        height, *slope = ((low + high) / 2.0 for low, high in pairs)
        is_level = not any(self.lowest[1:]) and not any(self.highest[1:])
        nearest = max(self.lowest[0], -self.highest[0])  # negative on both sides of zero
        if is_level and spread <= _GROUND_SPREAD and nearest >= _GROUND_HEIGHT:
            return Ground(folder, self.clips, height)
        if max(slope_spreads) <= _SLOPE_SPREAD and math.hypot(*slope) >= _SLOPE:
            return Ground(folder, self.clips, height, tuple(slope))
        return None


def _find_grounds(folders: dict[str, _Grounds]) -> list[Ground]:
    """Of all clips together, or else of folders."""
    together = _Grounds()
    for grounds in folders.values():
        together.add(grounds)
    if (ground := together.ground("")) is not None:
        return [ground]
    found = (grounds.ground(folder) for folder, grounds in folders.items())
    return [ground for ground in found if ground is not None]


def _judged(
    file: pyarrow.parquet.ParquetFile,
    contacts: list[str],
    found: Overview,
    grounds: dict[str, _Grounds],
    listed: int,
) -> Iterator[Row]:
    """The clips that were judged; all are counted on the way.

    Args:
        contacts: columns that have the height of the ground.
        grounds: folder -> what is known of its clips' grounds.
    """
    for rows in file.iter_batches(batch_size=500, columns=[*_COLUMNS, *contacts]):
        for row in rows.to_pylist():
            if row["status"] == "error":
                found.errors += 1
                if len(found.failed) < listed:
                    found.failed.append(row)
                continue
            found.verdicts[row["verdict"]] += 1
            found.feasible_frames += row["feasible_share"] * row["frames"]
            found.codes.update(code for code in row["codes"] if code in FAULTS)
            found.frames += row["frames"]
            found.duration += row["duration"]
            _count_repair(row, found, listed)
            heights = [row[name] for name in contacts if row[name] is not None]
            if heights:
                ground = (statistics.fmean(heights), row["slope_x"], row["slope_y"])
                folder = row["file"].rpartition("/")[0]
                own = _Grounds(1, ground, ground)
                grounds.setdefault(folder, _Grounds()).add(own)
            yield row


def _count_repair(row: Row, found: Overview, listed: int) -> None:
    if row["repair_error"] is not None:
        found.repair_errors += 1
        if len(found.repair_failed) < listed:
            found.repair_failed.append(row)
    elif row["repair"] is not None:
        found.outcomes[row["repair"]] += 1
        if row["repair_reasons"] is not None:
            found.repair_codes.update(row["repair_reasons"].split("+"))


def _badness(row: Row) -> tuple[int, float, float]:
    residual = row["residual_force_rms"]
    if residual is None:  # it is too large for numbers
        residual = math.inf
    return _VERDICTS.index(row["verdict"]), row["severity"], residual
