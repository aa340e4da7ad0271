# SPDX-License-Identifier: BSD-2-Clause
"""What is to be said of all clips of a batch together."""

import heapq
import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pyarrow.parquet

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
    *("distance_rms", "distance_max"),
    *(f"{code}.{column}" for code in FAULTS for column in ("holds", "frames", "worst")),
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
    found.worst = heapq.nlargest(listed, _judged(table, found, listed), key=_badness)
    return found


def _judged(table: Path, found: Overview, listed: int) -> Iterator[Row]:
    """The clips that were judged; all are counted on the way."""
    file = pyarrow.parquet.ParquetFile(table)
    for rows in file.iter_batches(batch_size=500, columns=list(_COLUMNS)):
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
            yield row


def _badness(row: Row) -> tuple[int, float, float]:
    residual = row["residual_force_rms"]
    if residual is None:  # it is too large for numbers
        residual = math.inf
    return _VERDICTS.index(row["verdict"]), row["severity"], residual
