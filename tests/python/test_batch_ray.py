# SPDX-License-Identifier: BSD-2-Clause
"""Batches on a real Ray, of this machine."""

import contextlib
import os
import signal
import sys
import threading
import time

import pyarrow.dataset
import pyarrow.parquet
import pytest

import dynacom
from batch_clips import cut, same, write_clips, write_program, write_repairable
from dynacom import DynacomError

ROBOT = "anymal_c"


@pytest.fixture(scope="module")
def ray():
    ray = pytest.importorskip("ray")
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    ray.init(
        num_cpus=2,
        include_dashboard=False,
        log_to_driver=False,
        object_store_memory=100 * 2**20,
    )
    yield ray
    ray.shutdown()


def test_rows_are_those_of_local(ray, tmp_path):
    folder = tmp_path / "clips"
    write_clips(folder)
    out = tmp_path / "out"
    states = []
    table = dynacom.batch(
        folder, ROBOT, out=out, engine="ray", jobs=2, frames=True, progress=states.append
    )
    assert same(table, dynacom.batch(folder, ROBOT))
    last = states[-1]
    assert last.done == last.files == table.num_rows
    assert last.errors == table["status"].to_pylist().count("error")
    frames = pyarrow.dataset.dataset(out / "frames", partitioning="hive")
    assert frames.count_rows() == last.frames > 0
    assert ray.is_initialized()  # it was not the batch that started it

    cut(folder / "walk_0.npz", 7, 25)
    again = dynacom.batch(
        folder, ROBOT, out=out, engine="ray", frames=True, resume=True, progress=states.append
    )
    # What has no hash is tried again.
    assert (states[-1].done, states[-1].known) == (last.files, last.files - 3)
    assert same(again, dynacom.batch(folder, ROBOT))


def test_options_reach_actors(ray, tmp_path):
    clip = cut(tmp_path / "walk.npz", 0, 30)
    for distance in (True, False):
        options = dynacom.AnalysisOptions(distance=distance)
        table = dynacom.batch(clip, ROBOT, engine="ray", jobs=1, options=options)
        assert (table["distance_rms"][0].as_py() is not None) == distance


def test_repair_is_that_of_local(ray, tmp_path, anymal):
    folder = tmp_path / "clips"
    write_repairable(folder, anymal)
    tables, trees = [], []
    for engine in ("local", "ray"):
        out = tmp_path / engine
        tables.append(dynacom.batch(folder, anymal, out=out, engine=engine, jobs=2, repair=True))
        repaired = out / "repaired"
        files = (path for path in repaired.rglob("*") if path.is_file())
        trees.append({path.relative_to(repaired): path.read_bytes() for path in files})
    assert same(*tables)
    assert trees[0] == trees[1]
    assert len(trees[0]) > 5


def test_an_actor_is_killed(ray, tmp_path, anymal):
    """What was on it is done by another, and a clip that kills its worker is an error."""
    folder, log = tmp_path / "clips", tmp_path / "log"
    folder.mkdir()
    # A worker's parent is the actor.
    tell = f"import os, time; open({str(log)!r}, 'a').write(f'{{os.getppid()}}\\n'); "
    for number in range(40):
        write_program(folder / f"{number:02}.pkl", anymal, 5 * number, tell + "time.sleep(0.1)")
    write_program(folder / "30_dies.pkl", anymal, 0, "import os; os.kill(os.getpid(), 9)")
    killed = []

    def kill():
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline and not killed:
            with contextlib.suppress(OSError):
                actors = log.read_text().split()
                if len(actors) >= 5:
                    os.kill(int(actors[-1]), signal.SIGKILL)
                    killed.append(actors[-1])
            time.sleep(0.02)

    killer = threading.Thread(target=kill)
    killer.start()
    table = dynacom.batch(folder, anymal, engine="ray", jobs=2, trust=True)
    killer.join()
    actors = log.read_text().split()
    assert len(killed) == 1
    assert len(set(actors)) >= 2
    assert len(actors) > 40  # some were done again
    names = [os.path.basename(file) for file in table["file"].to_pylist()]
    assert names == sorted(os.listdir(folder))
    errors = [row["error"] for row in table.to_pylist() if row["status"] == "error"]
    assert len(errors) == 1
    assert errors[0].endswith("30_dies.pkl: its worker process died twice (by SIGKILL)")
    log.unlink()
    assert same(table, dynacom.batch(folder, anymal, trust=True))


def test_frames_that_cannot_be_written(ray, tmp_path):
    cut(tmp_path / "walk.npz", 0, 20)
    out = tmp_path / "out"
    out.mkdir()
    (out / "frames").write_text("mine")
    with pytest.raises(DynacomError, match=r"out/frames: cannot be written \("):
        dynacom.batch(tmp_path, ROBOT, out=out, engine="ray", jobs=1, frames=True)


def test_the_command_starts_ray_quietly(tmp_path, run):
    pytest.importorskip("ray")
    cut(tmp_path / "walk.npz", 0, 20)
    out = tmp_path / "out"
    options = ("--engine", "ray", "--jobs", 1)
    done = run("batch", tmp_path / "walk.npz", "--robot", ROBOT, "--out", out, *options)
    assert done.returncode == 0
    lines = done.stderr.splitlines()
    assert all("Set ray log level" in line for line in lines)  # as Ray cannot but tell
    table = pyarrow.parquet.read_table(out / "clips.parquet")
    assert same(table, dynacom.batch(tmp_path / "walk.npz", ROBOT))


def test_without_ray(tmp_path, monkeypatch):
    cut(tmp_path / "walk.npz", 0, 20)
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(DynacomError, match=r"pip install dynacom\[ray\]"):
        dynacom.batch(tmp_path, ROBOT, out=tmp_path / "out", engine="ray")
    assert not (tmp_path / "out").exists()
