# SPDX-License-Identifier: BSD-2-Clause
"""Reports of single clips of a batch."""

import hashlib
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from dynacom.batch_files import local_copy, printable
from dynacom.batch_row import Job, Row
from dynacom.errors import DynacomError
from dynacom.motion_report import analyze


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
    out: Path, rows: Iterable[Row], files: Mapping[str, str], job: Job
) -> dict[tuple[str, str | None], str]:
    """Writes out/reports/CLIP/, as ``dynacom analyze`` does, for some clips.

    Args:
        files: name in results -> file.

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
                found = analyze(
                    path,
                    job.robot,
                    fps=job.fps,
                    quat=job.quat,
                    trust=job.trust,
                    clip=clip,
                    options=job.options,
                )
        except (DynacomError, OSError):
            continue
        found.summary["clip"] = printable(found.summary["clip"])
        found.save(out / folder)
        links[name, clip] = f"{folder.as_posix()}/report.html"
    return links


def _folder(name: str, clip: str | None) -> str:
    """Of its own for every clip, and no harm in a link or on a disk."""
    text = name if clip is None else f"{name}\0{clip}"
    stem = clip or Path(name).name.split(".")[0]
    stem = re.sub(r"[^A-Za-z0-9_-]+", "_", stem)[:60]
    return f"{stem}-{hashlib.sha256(text.encode()).hexdigest()[:12]}"
