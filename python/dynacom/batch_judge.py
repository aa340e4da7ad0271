# SPDX-License-Identifier: BSD-2-Clause
"""What a batch does with a file: judges its clips, and repairs them, with a row for each."""

import hashlib
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from dynacom.batch_files import local_copy, printable
from dynacom.batch_repair import RepairedFile, WritingError, remove_repaired, repair_row
from dynacom.batch_row import Job, Row, frames_file, report_row, without_nan, write_frames
from dynacom.dynacom_pywrap import __version__
from dynacom.errors import DynacomError
from dynacom.motion_clip import Options
from dynacom.motion_file import Clip, read_motion
from dynacom.motion_pickle import PickleFile
from dynacom.motion_report import MotionReport, examine, make_examiner
from dynacom.repair import RepairReport, make_repairer, repair_clip


class Judge:
    """Analyses clips, and repairs them, one after the other, and has no memory of them."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self._reading = Options(job.fps, job.quat, job.trust)
        # One thread: there are other processes.
        self._examiner = make_examiner(job.robot, job.options, sensitivity=False, threads=1)
        if job.repair is not None:
            self._repairer = make_repairer(job.robot, job.options, threads=1)
            # Of what is written, which is exact.
            options = replace(job.options, cutoff=None)
            self._unfiltered = make_examiner(job.robot, options, sensitivity=False, threads=1)

    def __call__(
        self, name: str, file: str, known: str | None, place: str | None = None
    ) -> list[Row] | None:
        """The rows of a file: one per clip in it, whatever it holds.

        Args:
            name: the file's in results.
            file: a path or a URL.
            known: the SHA-256 of a file of which the rows are known already.
            place: where it lies among the repaired motions, a relative path; None where it is not
                repaired: in a job that repairs, because that kills workers.

        Returns:
            The rows, or None if that is this file.

        Raises:
            WritingError: what was found, or repaired, cannot be written.
        """
        start = time.perf_counter()
        path = Path(file)
        digest = None
        rows: list[Row] = []
        try:
            with local_copy(file) as path:
                with path.open("rb") as opened:
                    digest = _digest(opened)
                if digest == known:
                    return None
                repaired = None
                if place is not None:
                    remove_repaired(self._job.repair, place)
                elif self._job.repair is not None:
                    digest = None  # going on tries it again
                pickle = self._open(path)
                if place is not None:
                    repaired = RepairedFile(self._job.repair, place, path, pickle, self._unfiltered)
                for clip, read in self._clips(path, pickle):
                    found = self._judge(name, clip, path, read, repaired)
                    rows.append(found | {"sha256": digest, "seconds": time.perf_counter() - start})
                    start = time.perf_counter()
                if repaired is not None:
                    _write_repaired(repaired, rows, lambda e: _message(e, name, path))
                    rows[-1]["seconds"] += time.perf_counter() - start
        except WritingError:
            raise
        except Exception as error:  # whatever the file made any library raise
            if place is not None:
                remove_repaired(self._job.repair, place)
            message = _message(error, name, path)
            rows.append(
                error_row(self._job, name, message)
                | {"sha256": digest, "seconds": time.perf_counter() - start}
            )
        return rows

    def _open(self, path: Path) -> PickleFile | None:
        """The file, if it may hold several clips."""
        if path.suffix.lower() not in (".pkl", ".pickle", ".joblib"):
            return None
        with np.errstate(all="ignore"):
            return PickleFile(path, self._reading)

    def _clips(
        self, path: Path, pickle: PickleFile | None
    ) -> Iterable[tuple[str | None, Callable[[], Clip]]]:
        """The clips of a file by name: None for one that is alone."""
        if pickle is not None:
            return pickle.clips(self._job.robot)
        return [(None, lambda: read_motion(path, self._job.robot, **asdict(self._reading)))]

    def _judge(
        self,
        name: str,
        clip: str | None,
        path: Path,
        read: Callable[[], Clip],
        repaired: RepairedFile | None,
    ) -> Row:
        job = self._job
        title = None if clip is None else printable(clip)
        frames = None if job.frames is None else frames_file(job.frames, job.robot, name, title)
        try:
            with np.errstate(all="ignore"):
                report, made = self._examine(read(), repaired is not None)
            row = report_row(report, name)
        except Exception as error:
            if frames is not None:
                with suppress(OSError):
                    frames.unlink()  # of the file as it was before
            if repaired is not None:
                repaired.add(clip, None)
            return error_row(job, name, _message(error, name, path)) | {"clip": title}
        if frames is not None:
            write_frames(report, name, title, frames, job.frames)
        if repaired is not None:
            row |= _repair_columns(repaired, clip, made, lambda e: _message(e, name, path))
        elif job.repair is not None:
            row["repair_error"] = f"{name}: its worker process died twice"
        return row | {"clip": title}

    def _examine(
        self, clip: Clip, with_repair: bool
    ) -> tuple[MotionReport, RepairReport | Exception | None]:
        """What is found of a clip, and, where that is asked for, its repair, or why there is none.

        Raises:
            DynacomError: as :func:`examine`.
        """
        job, error = self._job, None
        if with_repair:
            try:
                made = repair_clip(clip, job.robot, job.options, self._repairer)
                return made.before, made
            except Exception as raised:  # analysis alone may well do
                error = raised
        return examine(clip, job.robot, job.options, self._examiner), error


def _repair_columns(
    repaired: RepairedFile,
    clip: str | None,
    made: RepairReport | Exception,
    message: Callable[[Exception], str],
) -> Row:
    """Those of a clip's repair, which is added to its file.

    Args:
        message: what is said of an error.
    """
    if isinstance(made, Exception):
        repaired.add(clip, None)
        return {"repair_error": message(made)}
    row = without_nan(repair_row(made))
    try:
        if repaired.add(clip, made):
            row["repair_file"] = repaired.name
    except Exception as error:  # whatever its format makes any library raise
        row["repair_error"] = message(error)
    return row


def _write_repaired(
    repaired: RepairedFile, rows: list[Row], message: Callable[[Exception], str]
) -> None:
    """Writes a file; if that cannot be, its clips' rows tell why.

    Raises:
        WritingError: nothing can be written there.
    """
    try:
        repaired.write()
    except WritingError:
        raise
    except Exception as error:
        for row in rows:
            if row.pop("repair_file", None) is not None:
                row["repair_error"] = message(error)


def _digest(file: BinaryIO) -> str:
    digest = hashlib.sha256()
    while block := file.read(1 << 20):
        digest.update(block)
    return digest.hexdigest()


def error_row(job: Job, name: str, message: str) -> Row:
    """The row of a clip that could not be judged."""
    return {
        "file": name,
        "robot": printable(job.robot.name),
        "status": "error",
        "error": message,
        "dynacom": __version__,
    }


def _message(error: Exception, name: str, path: Path) -> str:
    """One line."""
    if isinstance(error, OSError):
        text = f"{name}: cannot be read ({error.strerror or error})"
    elif isinstance(error, DynacomError):
        text = str(error)
    else:
        text = f"{name}: {type(error).__name__}: {error}"
    # A copy's name says nothing.
    text = printable(text.replace(str(path), name))
    return " ".join(text.split())
