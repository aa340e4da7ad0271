# SPDX-License-Identifier: BSD-2-Clause
"""What an analysis says: a table of its frames, and a summary of them."""

import csv
import os
import secrets
import shutil
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.markup import escape
from rich.table import Table

from dynacom.dynacom_pywrap import MotionAnalysis


def frame_columns(analysis: MotionAnalysis) -> dict[str, list]:
    """The columns of frames.csv, in its order: name -> one value per frame.

    docs/columns.md says what they are.
    """
    columns = {"time": analysis.time.tolist()}

    def add(prefix: str, values: np.ndarray, axes: str) -> None:
        for axis, column in zip(axes, values.T.tolist(), strict=True):
            columns[f"{prefix}_{axis}"] = column

    for name in ("com", "vcom", "acom", "am", "dam", "ground_force", "ground_torque"):
        add(name, getattr(analysis, name), "xyz")
    for name in ("cop", "vrp", "nl"):
        add(name, getattr(analysis, name), "xy")
    columns["status"] = [status.name for status in analysis.status]
    for contact in analysis.contacts:
        prefix = f"contact.{contact.name}"
        columns[f"{prefix}.active"] = np.asarray(contact.active, dtype=int).tolist()
        add(f"{prefix}.force", contact.wrench[:, :3], "xyz")
        add(f"{prefix}.torque", contact.wrench[:, 3:], "xyz")
    return columns


def write_frames(analysis: MotionAnalysis, path: Path) -> None:
    """Writes frames.csv: a header and a row per frame; every number reads back exactly."""
    columns = frame_columns(analysis)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))


@contextmanager
def results_folder(path: Path) -> Iterator[Path]:
    """A temporary folder, whose files appear in path when all has gone well.

    Whatever goes wrong, an interruption too, path is left as it was. Files of the same names are
    replaced, others stay.

    Raises:
        OSError: path is not a folder, or cannot be written to.
    """
    existed, finished = path.exists(), False
    # Inside, so that it is on the same file system and needs no right to write elsewhere. Its name
    # is known before it is made: an interruption may come at any time.
    temporary = path / f".dynacom-{secrets.token_hex(8)}"
    try:
        path.mkdir(parents=True, exist_ok=True)
        temporary.mkdir()
        yield temporary
        for file in sorted(temporary.iterdir()):
            os.replace(file, path / file.name)
        finished = True
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
        if not existed and not finished:
            with suppress(OSError):
                path.rmdir()


@dataclass(frozen=True)
class ContactShare:
    """How much of the robot's weight a contact bears: mean vertical force over m g."""

    name: str
    #: Over all frames.
    overall: float
    #: Over the frames in which it is active; NaN if there are none.
    while_active: float
    #: The part of the frames in which it is active.
    active: float


@dataclass(frozen=True)
class Peak:
    """The largest value of something, and when it is reached."""

    value: float
    time: float


@dataclass(frozen=True)
class Summary:
    """A motion in a few numbers. SI units; NaN where there is nothing to tell."""

    frames: int
    duration: float
    mass: float
    #: Name of the status -> number of frames.
    statuses: dict[str, int]
    #: Norms of what the ground must give and the contacts do not.
    residual_force: Peak
    residual_torque: Peak
    #: Rows: x and y. Columns: the least and the largest.
    cop_range: np.ndarray
    shares: tuple[ContactShare, ...]


def summarize(analysis: MotionAnalysis, mass: float, gravity: float) -> Summary:
    """Sums an analysis up.

    Args:
        mass: of the robot [kg].
        gravity: its magnitude [m/s²].
    """
    time = analysis.time
    cop = analysis.cop[np.isfinite(analysis.cop).all(axis=1)]
    cop_range = np.stack([cop.min(axis=0), cop.max(axis=0)], axis=1) if len(cop) else np.nan
    return Summary(
        frames=len(time),
        duration=float(time[-1] - time[0]),
        mass=mass,
        statuses=dict(Counter(status.name for status in analysis.status)),
        residual_force=_peak(time, analysis.residual[:, :3]),
        residual_torque=_peak(time, analysis.residual[:, 3:]),
        cop_range=np.broadcast_to(cop_range, (2, 2)),
        shares=tuple(
            _share(contact.name, contact.active, contact.vertical_force, mass * gravity)
            for contact in analysis.contacts
        ),
    )


def _peak(time: np.ndarray, vectors: np.ndarray) -> Peak:
    norms = np.linalg.norm(vectors, axis=1)
    if np.isnan(norms).all():
        return Peak(np.nan, np.nan)
    index = np.nanargmax(norms)
    return Peak(float(norms[index]), float(time[index]))


def _share(name: str, active: np.ndarray, force: np.ndarray, weight: float) -> ContactShare:
    active = np.asarray(active, dtype=bool)
    if weight == 0.0:
        return ContactShare(name, np.nan, np.nan, float(active.mean()))
    shares = force / weight
    return ContactShare(
        name,
        overall=float(shares.mean()),
        while_active=float(shares[active].mean()) if active.any() else np.nan,
        active=float(active.mean()),
    )


def summary_table(summary: Summary) -> Table:
    """The summary, to be printed."""
    table = Table(show_header=False)
    table.add_column(style="bold", overflow="fold")
    table.add_column(overflow="fold")

    def residual(peak: Peak, unit: str) -> str:
        return f"{peak.value:.3g} {unit} at {peak.time:.3f} s"

    (x_min, x_max), (y_min, y_max) = summary.cop_range
    table.add_row("Duration", f"{summary.duration:.3f} s")
    table.add_row("Frames", str(summary.frames))
    for status, count in summary.statuses.items():
        table.add_row(f"  {status}", f"{count} ({count / summary.frames:.1%})")
    table.add_row("Mass", f"{summary.mass:.3f} kg")
    table.add_row("Largest residual", residual(summary.residual_force, "N"))
    table.add_row("", residual(summary.residual_torque, "N·m"))
    table.add_row("CoP range, x", f"{x_min:.4f} to {x_max:.4f} m")
    table.add_row("CoP range, y", f"{y_min:.4f} to {y_max:.4f} m")
    table.add_section()
    for share in summary.shares:
        text = f"{share.overall:.1%}"
        if share.active > 0.0:
            text += f" ({share.while_active:.1%} while active, in {share.active:.1%} of the frames)"
        else:
            text += " (never active)"
        table.add_row(escape(f"Weight on {share.name}"), text)
    return table
