# SPDX-License-Identifier: BSD-2-Clause
"""Reports of single clips of a batch."""

import hashlib
import re
import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from dynacom.batch_files import local_copy, printable
from dynacom.batch_row import Job, Row
from dynacom.errors import DynacomError
from dynacom.motion_mark import mark_of
from dynacom.motion_report import FILES, analyze
from dynacom.repair import repair
from dynacom.results_folder import save_results


def check_reports() -> None:
    """Sees before the work that reports can be written after it.

    Raises:
        DynacomError: plotly is not installed.
    """
    try:
        import plotly  # noqa: F401
    except ImportError as error:
        raise DynacomError("reports need plotly: pip install dynacom[motion]") from error


def write_reports(
    out: Path,
    rows: Iterable[Row],
    files: Mapping[str, str],
    places: Mapping[str, str],
    job: Job,
) -> dict[tuple[str, str | None], str]:
    """Writes out/reports/CLIP/ for some clips.

    It is what ``dynacom analyze`` writes, or, of clips that were repaired, ``dynacom repair``.

    Args:
        files: name in results -> file.
        places: file -> where it lies among the repaired motions, in a job that repairs.

    Returns:
        File's name and clip -> link to its page; without what cannot be read any more.

    Raises:
        DynacomError: a report cannot be written.
    """
    links = {}
    for row in rows:
        name, clip = row["file"], row["clip"]
        folder = Path("reports", _folder(name, clip))
        try:
            with local_copy(files[name]) as path:
                if row["repair"] == "repaired" and row["repair_file"] is not None:
                    write = _repair_report(path, row, places[files[name]], job)
                else:
                    write = _report(path, row, job)
        except (DynacomError, OSError):
            continue
        save_results(out / folder, FILES, write)
        links[name, clip] = f"{folder.as_posix()}/report.html"
    return links


def _report(path: Path, row: Row, job: Job) -> Callable[[Path], None]:
    """What writes the report of an analysis into a folder."""
    found = analyze(path, job.robot, **_how(row, job))
    found.summary["clip"] = printable(found.summary["clip"])
    return lambda into: found.write_files(into, found.summary, csv=False, page=True)


def _repair_report(path: Path, row: Row, place: str, job: Job) -> Callable[[Path], None]:
    """What writes the report of a repair into a folder: the clip is repaired once more.

    Args:
        place: of the file that it was written to.
    """
    found = repair(path, job.robot, **_how(row, job))
    found.after.summary["clip"] = printable(found.after.summary["clip"])
    with tempfile.TemporaryDirectory(prefix="dynacom-") as folder:
        told, notes = found.write(Path(folder, path.name))
    # That one is gone: the file is there already, perhaps with other clips in it.
    told |= mark_of(job.repair / place) | {"file": row["repair_file"]}
    return lambda into: found.write_files(into, told, notes, csv=False, page=True)


def _how(row: Row, job: Job) -> dict[str, Any]:
    """Arguments of :func:`analyze` and :func:`repair`."""
    return {
        "fps": job.fps,
        "quat": job.quat,
        "trust": job.trust,
        "clip": row["clip"],
        "options": job.options,
    }


def _folder(name: str, clip: str | None) -> str:
    """Of its own for every clip, and no harm in a link or on a disk."""
    text = name if clip is None else f"{name}\0{clip}"
    stem = clip or Path(name).name.split(".")[0]
    stem = re.sub(r"[^A-Za-z0-9_-]+", "_", stem)[:60]
    return f"{stem}-{hashlib.sha256(text.encode()).hexdigest()[:12]}"
