# SPDX-License-Identifier: BSD-2-Clause
"""Many motions at once: a row per clip, whatever the clip."""

import math
import os
import re
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dynacom.analysis_options import AnalysisOptions
from dynacom.batch_files import find_motions, find_places, is_url
from dynacom.batch_pool import Done, Pool, Task
from dynacom.batch_repair import repair_file
from dynacom.batch_row import Job
from dynacom.errors import DynacomError
from dynacom.repair import repair_options
from dynacom.robots import Robot, load_robot

if TYPE_CHECKING:
    import pyarrow

    from dynacom.batch_overview import Overview
    from dynacom.batch_store import Store


@dataclass(frozen=True)
class BatchProgress:
    """How far a batch is."""

    #: To be judged.
    files: int
    #: Of these, done.
    done: int = 0
    #: Of these, done by the batch that this one goes on with.
    known: int = 0
    #: In the files that are done, but for those known.
    clips: int = 0
    frames: int = 0
    #: Clips that could not be judged.
    errors: int = 0

    def plus(self, done: Done) -> "BatchProgress":
        """With one more file."""
        rows = done.rows or []
        return BatchProgress(
            self.files,
            self.done + 1,
            self.known + (done.rows is None),
            self.clips + len(rows),
            self.frames + sum(row.get("frames", 0) for row in rows),
            self.errors + sum(row["status"] == "error" for row in rows),
        )


def batch(
    paths: str | Path | Iterable[str | Path],
    robot: str | Path | Robot,
    *,
    out: str | Path | None = None,
    options: AnalysisOptions | None = None,
    fps: float | None = None,
    quat: str | None = None,
    trust: bool = False,
    engine: str = "local",
    jobs: int | None = None,
    shard: tuple[int, int] | None = None,
    resume: bool = False,
    frames: bool = False,
    report: int = 0,
    repair: bool = False,
    balance_only: bool = False,
    strict: bool = False,
    progress: Callable[[BatchProgress], None] | None = None,
) -> "pyarrow.Table":
    """Judges clips, as :func:`analyze` does: a row for each, with its error if it cannot be judged.

    Args:
        paths: files, folders to search for motions, globs, URLs of what fsspec opens.
        robot: a robot, or the name or file of one, see :func:`load_robot`.
        out: folder for the table, a page, and what else is asked for; made if it is not there.
        options: settings; their defaults by default.
        fps, quat, trust: as in :func:`read_motion`, for all files.
        engine: ``local`` for processes of this machine, ``ray`` for Ray Data: then a cluster, if
            Ray is connected to one.
        jobs: processes; by default as many as there are cores.
        shard: (i, n) for the ith of n parts of the files, i from 1 to n.
        resume: go on with the batch in `out`, with what has changed, and what is not yet done.
        frames: write the table of each clip's frames to `out`, too.
        report: of so many of the worst clips `out` gets a report each.
        repair: whether to repair motions, as :func:`repair` does, and to write those that are
            feasible then to `out`, see docs/batch.md.
        balance_only, strict: as in :func:`repair`.
        progress: called as files are done.

    Returns:
        The table, see docs/batch.md; its rows are in the order of the files' names, whatever the
        number of jobs.

    Raises:
        DynacomError: there is no motion at `paths`; `out` has results and `resume` is false, or it
            cannot be written to, or another batch writes to it; an argument is none of those above;
            pyarrow, or Ray, is not installed; the robot, as in :func:`load_robot`.
        ValueError: options are out of their ranges.
    """
    arguments = {
        "options": options,
        "fps": fps,
        "quat": quat,
        "trust": trust,
        "engine": engine,
        "jobs": jobs,
        "shard": shard,
        "balance_only": balance_only,
        "strict": strict,
        "progress": progress,
    }
    _need_pyarrow()
    import pyarrow.parquet

    own = {"resume": resume, "frames": frames, "report": report, "repair": repair}
    if out is not None:
        run_batch(paths, robot, out, **own, **arguments)
        return pyarrow.parquet.read_table(Path(out, "clips.parquet"))
    for name, value in own.items():
        if value:
            raise DynacomError(f"{name} needs out, a folder")
    with tempfile.TemporaryDirectory(prefix="dynacom-") as folder:
        run_batch(paths, robot, folder, **arguments)
        return pyarrow.parquet.read_table(Path(folder, "clips.parquet"), memory_map=False)


def run_batch(
    paths: str | Path | Iterable[str | Path],
    robot: str | Path | Robot,
    out: str | Path,
    *,
    options: AnalysisOptions | None = None,
    fps: float | None = None,
    quat: str | None = None,
    trust: bool = False,
    engine: str = "local",
    jobs: int | None = None,
    shard: tuple[int, int] | None = None,
    resume: bool = False,
    frames: bool = False,
    report: int = 0,
    repair: bool = False,
    balance_only: bool = False,
    strict: bool = False,
    progress: Callable[[BatchProgress], None] | None = None,
) -> "Overview":
    """As :func:`batch`, without holding the table in memory.

    Returns:
        What is to be said of all clips together.

    Raises:
        DynacomError, ValueError: as :func:`batch`.
    """
    _need_pyarrow()
    from dynacom.batch_overview import overview
    from dynacom.batch_page import write_index
    from dynacom.batch_reports import check_reports, write_reports
    from dynacom.batch_store import Store

    out = Path(out)
    if re.match(r"[a-z][a-z0-9+.-]+:/", str(out), re.IGNORECASE):  # a Path has one slash
        raise DynacomError(f"out must be a folder of this machine, got {out}")
    _check(engine, jobs, shard, fps, quat, report)
    options = repair_options(options, balance_only=balance_only, strict=strict)
    options.validate()
    _check_repair(options, repair, balance_only, strict)
    if report:
        check_reports()
    if engine == "ray":
        from dynacom.batch_ray import RayPool, import_ray

        import_ray()
    if not isinstance(robot, Robot):
        robot = load_robot(robot)
    files = find_motions(paths, out)
    places = find_places(paths, files.values()) if repair else {}
    if shard is not None:
        part, parts = shard
        files = dict(list(files.items())[part - 1 :: parts])
    folders = [
        out.absolute() / name if is_wanted else None
        for name, is_wanted in (("frames", frames), ("repaired", repair))
    ]
    job = Job(robot, options, fps, quat, trust, *folders)
    with ExitStack() as stack:
        if engine == "local":
            # Processes start while the robot's meshes are read here.
            pool = Pool(job, jobs)
            stack.callback(pool.close)  # whatever is wrong with the folder
            pool.start(len(files))
        store = stack.enter_context(Store.open(out, job, list(files), resume))
        if engine == "ray":
            pool = RayPool(job, jobs)

        def tasks() -> Iterator[Task]:
            for index, (name, file) in enumerate(files.items()):
                place = places.get(file)
                known = store.known(index)
                if place is not None and not _has_repaired(store, index, out, place):
                    known = None
                file = file if is_url(file) else os.path.abspath(file)
                yield Task(index, name, file, known, place)

        state = BatchProgress(len(files))
        try:
            for done in pool.run(tasks()):
                if done is None:
                    store.tick()
                    continue
                if done.rows is not None:
                    store.add(done.index, done.rows)
                state = state.plus(done)
                if progress is not None:
                    progress(state)
        except KeyboardInterrupt:
            store.flush()
            raise
        finally:
            pool.close()
        store.finish()
        found = overview(store.table)
        links = {}
        if report:
            links = write_reports(out, found.worst[:report], files, places, job)
        write_index(out / "index.html", found, links, job)
    return found


def _has_repaired(store: "Store", index: int, out: Path, place: str) -> bool:
    """Whether what rows tell of a file's repaired motions is so."""
    told = store.repaired(index)
    repaired = out / "repaired"
    return told is None or (told == repair_file(repaired, place) and (repaired / place).exists())


def _need_pyarrow() -> None:
    try:
        import pyarrow  # noqa: F401
    except ImportError as error:
        raise DynacomError("a batch needs pyarrow: pip install dynacom[motion]") from error


def _check_repair(options: AnalysisOptions, repair: bool, balance_only: bool, strict: bool) -> None:
    for name, value in (("balance_only", balance_only), ("strict", strict)):
        if value and not repair:
            raise DynacomError(f"{name} goes with repair")
    if repair and options.ladder.largest_stretch != 1.0:
        # Where it counts, files may have no place to say at which frame rate they are then.
        raise DynacomError(
            "ladder.largest_stretch must be 1 in a batch, which does not stretch time, got "
            f"{options.ladder.largest_stretch:g}"
        )


def _check(
    engine: str,
    jobs: int | None,
    shard: tuple[int, int] | None,
    fps: float | None,
    quat: str | None,
    report: int,
) -> None:
    if engine not in ("local", "ray"):
        raise DynacomError(f"engine must be local or ray, got '{engine}'")
    if jobs is not None and jobs < 1:
        raise DynacomError(f"jobs must be at least 1, got {jobs}")
    if report < 0:
        raise DynacomError(f"report must not be negative, got {report}")
    if fps is not None and not 0.0 < fps < math.inf:
        raise DynacomError(f"fps must be finite and > 0 Hz, got {fps:g}")
    if quat not in (None, "xyzw", "wxyz"):
        raise DynacomError(f"quat must be xyzw or wxyz, got '{quat}'")
    if shard is not None and not 1 <= shard[0] <= shard[1]:
        raise DynacomError(f"shard must be i/n with i from 1 to n, got {shard[0]}/{shard[1]}")
