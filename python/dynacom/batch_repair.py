# SPDX-License-Identifier: BSD-2-Clause
"""What a batch repairs: a few columns of each clip, and the motions in DIR/repaired."""

import json
import os
import secrets
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from dynacom.batch_files import printable
from dynacom.dynacom_pywrap import MotionExaminer
from dynacom.errors import DynacomError
from dynacom.motion_file import Clip, suffix_of
from dynacom.motion_mark import mark_of
from dynacom.motion_pickle import PickleFile
from dynacom.motion_report import FAULTS, TOO_SHORT
from dynacom.motion_writer import motion_content
from dynacom.repair import RepairReport, different_text

#: Column's name, Arrow's type, unit. docs/batch.md says what they are.
REPAIR_COLUMNS = (
    ("repair", "string", ""),
    ("repair_root_rms", "double", "m"),
    ("repair_root_max", "double", "m"),
    ("repair_joints_rms", "double", "rad"),
    ("repair_joints_max", "double", "rad"),
    ("repair_missing", "int64", ""),
    ("repair_reasons", "string", ""),
    ("repair_verdict", "string", ""),
    ("repair_file", "string", ""),
    ("repair_error", "string", ""),
)

#: Outcomes of repair, from the best to the worst.
OUTCOMES = ("feasible", "repaired", "not repaired")

#: Why a clip is not repaired: code -> what it means.
REASONS = {code: text for code, (_, text) in FAULTS.items()} | {
    "contact_needed": "nothing carries, where the motion needs a force",
    "out_of_reach": "contacts cannot give what the motion needs",
    "joint_limits": "joints are beyond their limits",
    "feet_not_held": "contacts that were to stand still drift by more than they may",
    "not_better": "what was tried is worse, and the motion stays as it was",
    "bound": "the motion would have to be changed by more than the settings allow",
    "too_short": TOO_SHORT,
}

#: Of a folder that workers write to: where files are until they are whole.
WRITING = ".writing"
# Formats that cannot be marked as exact.
_UNMARKED = (".csv", ".csv.gz")


class WritingError(DynacomError):
    """Results of a clip cannot be written: not its fault, nor would the next one do better."""


def repair_row(report: RepairReport) -> dict[str, Any]:
    """What the columns hold of a repair, but for the file."""
    found = report.repair
    codes = dict.fromkeys(reason.code for reason in found.reasons)
    return {
        "repair": found.outcome,
        "repair_root_rms": found.root.rms,
        "repair_root_max": found.root.largest,
        "repair_joints_rms": found.joints.rms,
        "repair_joints_max": found.joints.largest,
        "repair_missing": found.missing,
        "repair_reasons": "+".join(codes) or None,
        "repair_verdict": found.after.verdict.outcome,
    }


class RepairedFile:
    """What becomes of a file whose clips are repaired one after the other.

    It holds the clips that were feasible, bit for bit, and those that were repaired; where there
    are none, there is no file.
    """

    def __init__(
        self,
        folder: Path,
        place: str,
        source: Path,
        pickle: PickleFile | None,
        examiner: MotionExaminer,
    ) -> None:
        """Writes nothing yet.

        Args:
            folder: of all repaired motions.
            place: the file's in it, a relative path.
            source: the file that is read.
            pickle: the same, if it may hold several clips.
            examiner: of what is written: without a filter.
        """
        self._folder = folder
        self._place = place
        self._source = source
        self._pickle = pickle
        self._examiner = examiner
        self._kept = 0
        #: What is still to be examined once it is written.
        self._unchecked: RepairReport | None = None
        #: The file's bytes, if they are not those that it had.
        self._content: Callable[[], bytes] = source.read_bytes
        self._is_exact = False

    @property
    def name(self) -> str:
        """The file as the table has it."""
        return repair_file(self._folder, self._place)

    def add(self, name: str | None, report: RepairReport | None) -> bool:
        """Adds a clip, if it is such a one.

        Args:
            name: of the clip in the file; None if it is alone.
            report: what was made of it; None if nothing was.

        Returns:
            Whether the file will hold it.

        Raises:
            DynacomError: the file's format cannot hold what was made of it, so it will not.
        """
        is_kept = report is not None and report.outcome != "not repaired"
        try:
            if is_kept and report.changed:
                self._change(report)
        except BaseException:
            is_kept = False
            raise
        finally:
            if not is_kept and name is not None:
                self._pickle.drop(name)
                self._content = self._pickle.dump
            self._kept += is_kept
        if is_kept:
            self._is_exact = report.changed or report.clip.exact
        return is_kept

    def write(self) -> None:
        """Writes the file as a whole, if it holds a clip.

        Raises:
            WritingError: the folder cannot be written to.
            DynacomError: the file holds what cannot be written, or is not feasible as it was.
        """
        if not self._kept:
            return
        content = self._read()
        path = self._folder / self._place
        temporary = self._folder / WRITING / secrets.token_hex(8)
        with _writing(self._folder):
            try:
                for parent in (path.parent, temporary):
                    parent.mkdir(parents=True, exist_ok=True)
                written = temporary / path.name
                _write(written, content)
                if self._unchecked is not None:
                    self._check(self._unchecked, self._unchecked.read_again(written))
                # The mark first: who finds the file finds that, too.
                if self._is_exact and suffix_of(path) in _UNMARKED:
                    text = json.dumps({"repair": mark_of(written)})
                    _write(_mark_path(written), text.encode())
                    os.replace(_mark_path(written), _mark_path(path))
                os.replace(written, path)
            finally:
                shutil.rmtree(temporary, ignore_errors=True)

    def _change(self, report: RepairReport) -> None:
        change = report.change()
        if self._pickle is None:
            content = motion_content(change)
            self._content = lambda: content
            self._unchecked = report
        else:
            self._pickle.change(change)
            self._content = self._pickle.dump
            clip = report.clip
            self._check(report, self._pickle.read(clip.options.clip, clip.robot))

    def _check(self, report: RepairReport, written: Clip) -> None:
        """A file may not have all joints of the robot, and has its numbers rounded.

        Raises:
            DynacomError: the motion is not feasible as it was written.
        """
        found = report.examine_written(written, self._examiner)
        if found.verdict.outcome != "feasible":
            raise DynacomError(f"{self._source}: {different_text(found)}")

    def _read(self) -> bytes:
        try:
            return self._content()
        except OSError as error:
            reason = error.strerror or error
            raise DynacomError(f"{self._source}: cannot be read ({reason})") from error


def remove_repaired(folder: Path, place: str) -> None:
    """Removes what was made of a file, if anything was.

    Args:
        folder, place: as in :class:`RepairedFile`.

    Raises:
        WritingError: the folder cannot be written to.
    """
    path = folder / place
    with _writing(folder):
        for old in (path, _mark_path(path)):
            with suppress(FileNotFoundError, NotADirectoryError):
                old.unlink()


def repair_file(folder: Path, place: str) -> str:
    """What the table says of a file at a place in the folder of repaired motions."""
    return printable(f"{folder.name}/{place}")


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        name = printable(str(folder))
        raise WritingError(f"{name}: cannot be written ({error.strerror or error})") from error


def _mark_path(path: Path) -> Path:
    return path.with_name(f"{path.name}.summary.json")


def _write(path: Path, content: bytes) -> None:
    """Onto the disk."""
    with path.open("xb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
