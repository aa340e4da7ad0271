# SPDX-License-Identifier: BSD-2-Clause
import contextlib
import hashlib
import io
import os
import pickle
import pty
import re
import shutil
import signal
import subprocess
import sys
import time
import types

import numpy as np
import pyarrow.dataset
import pyarrow.parquet
import pytest
from rich.console import Console

import dynacom
from batch_clips import cut, hover, motion, same, write_clips, write_program
from dynacom import DynacomError, batch_overview, batch_pool, batch_store
from dynacom.batch_files import find_motions
from dynacom.batch_judge import error_row
from dynacom.batch_pool import Task
from dynacom.batch_row import Job
from dynacom.batch_store import Store
from dynacom.motion_report import FAULTS
from dynacom.summary import summary_table
from helpers import WALKS

ROBOT = "anymal_c"
COMMAND = [sys.executable, "-m", "dynacom"]


@pytest.fixture(scope="module")
def clips(tmp_path_factory):
    """A folder, and of each file in it a part of its error."""
    folder = tmp_path_factory.mktemp("clips")
    return folder, write_clips(folder)


@pytest.fixture(scope="module")
def result(clips, tmp_path_factory):
    """The table of that folder, and DIR."""
    out = tmp_path_factory.mktemp("result") / "out"
    return dynacom.batch(clips[0], ROBOT, out=out, frames=True, jobs=2), out


@pytest.fixture
def walks(tmp_path):
    """A few good clips."""
    folder = tmp_path / "walks"
    folder.mkdir()
    for number in range(4):
        cut(folder / f"{number}.npz", 50 * number, 20)
    return folder


def rows(table):
    return {row["file"]: row for row in table.to_pylist()}


def refused(part, *arguments, **options):
    with pytest.raises(DynacomError, match=re.escape(part)) as error:
        dynacom.batch(*arguments, **options)
    assert "\n" not in str(error.value)


# The table.


def test_numbers_too_large_end_no_batch(walks, tmp_path):
    """Root mean squares do not exist then; pages and lists do, and a clip's own summary."""
    with np.load(WALKS / "anymal_walk.npz") as file:
        q = file["q"][:60].copy()
    q[30, 9] = 1e200
    for number in range(2):  # which are alike, and so have to be sorted
        cut(walks / f"huge_{number}.npz", 0, 60, q=q, v=None, a=None)
    out = tmp_path / "out"
    table = rows(dynacom.batch(walks, ROBOT, out=out, jobs=1))
    path = walks / "huge_0.npz"
    row = table[str(path)]
    assert row["status"] == "ok"
    assert row["verdict"] == "not feasible"
    assert row["residual_force_rms"] is None
    page = (out / "index.html").read_text(encoding="utf-8")
    assert "huge_0.npz" in page
    assert "discontinuity (3 frames, up to ∞ of the greatest speed)" in page
    console = Console(file=io.StringIO(), width=120)
    console.print(summary_table(dynacom.analyze(path, ROBOT).summary))
    assert "– of the weight" in console.file.getvalue()
    assert not re.search(r"\d{20}", console.file.getvalue())


def test_a_row_for_each_file_whatever_it_is(clips, result):
    table, _ = result
    errors = clips[1]
    assert table["file"].to_pylist() == sorted(errors)
    for file, row in rows(table).items():
        assert (row["status"] == "error") == bool(errors[file]), row["error"]
        if errors[file]:
            assert errors[file] in row["error"]
            assert file in row["error"]
            assert "\n" not in row["error"]
            known = {name for name, value in row.items() if value is not None}
            certain = {"file", "robot", "status", "error", "seconds", "dynacom"}
            assert certain <= known <= certain | {"sha256"}


def test_values_are_those_of_analyze(result, anymal):
    table, _ = result
    good = [row for row in table.to_pylist() if row["status"] == "ok"]
    assert {row["verdict"] for row in good} == {"feasible", "not feasible", "unknown"}
    for row in good:
        report = dynacom.analyze(row["file"], anymal)
        summary = report.summary
        for name in (
            *("verdict", "codes", "frames", "duration", "frame_rate", "mass", "omega", "cutoff"),
            *("mean_vertical_force", "momentum_change", "feasible_share", "windows"),
        ):
            assert row[name] == summary[name], name
        distance = summary["distance"] or {"rms": None, "largest": None}
        assert row["distance_rms"] == distance["rms"]
        assert row["distance_max"] == distance["largest"]
        assert (row["distance_rms"] is None) == (row["verdict"] == "unknown")
        known = row["verdict"] != "unknown"
        assert row["feasible"] is (report.verdict.feasible if known else None)
        assert known != (row["codes"] == ["too_short"])
        assert row["error"] is row["clip"] is None
        assert row["dynacom"] == dynacom.__version__
        assert row["seconds"] > 0.0
        severity = 0.0
        for reason in summary["reasons"]:
            code = reason["code"]
            for column in ("holds", "frames", "worst", "time"):
                assert row[f"{code}.{column}"] == reason[column]
            if reason["holds"]:
                severity = max(severity, reason["frames"] / summary["frames"])
        assert row["severity"] == severity
        for contact, found in summary["contacts"].items():
            for name, value in found.items():
                assert row[f"contact.{contact}.{name}"] == value
            assert row[f"contact.{contact}.ground"] == summary["ground"][contact]
        status = report["status"]
        for name, text in (
            ("solved_share", "Solved"),
            ("relaxed_share", "Relaxed"),
            ("no_contact_share", "NoContact"),
        ):
            assert row[name] == np.mean(status == text)
        weight = 9.81 * row["mass"]
        force, torque = np.split(report["residual"] / weight, 2, axis=1)
        for name, part in (("force", force), ("torque", torque)):
            expected = np.sqrt((part**2).sum(axis=1).mean())
            assert row[f"residual_{name}_rms"] == pytest.approx(expected, rel=1e-12, abs=1e-15)


def test_hashes(result):
    for file, row in rows(result[0]).items():
        if os.path.isfile(file):
            with open(file, "rb") as opened:
                assert row["sha256"] == hashlib.sha256(opened.read()).hexdigest()
    assert sum(row["sha256"] is None for row in result[0].to_pylist()) == 2  # link, pipe


def test_columns_and_units_are_those_documented(result, root, anymal):
    table, out = result
    text = (root / "docs" / "batch.md").read_text().partition("## The columns")[2]
    lines = re.findall(r"^\| `([^`]+)` \|([^|]*)\|", text, re.MULTILINE)
    documented = {name: unit.strip() for name, unit in lines}
    expected = {name: unit for name, unit in documented.items() if "<" not in name}
    last = {name: expected.pop(name) for name in ("seconds", "dynacom")}
    for code, (fault_unit, _) in FAULTS.items():
        for name, unit in documented.items():
            if name.startswith("<code>"):
                expected[name.replace("<code>", code)] = unit.replace("of the fault", fault_unit)
    for contact in anymal.contacts:
        for name, unit in documented.items():
            if name.startswith("contact."):
                expected[name.replace("<name>", contact)] = unit
    expected |= last
    units = {field.name: field.metadata[b"unit"].decode() for field in table.schema}
    assert list(units.items()) == list(expected.items())
    written = pyarrow.parquet.read_schema(out / "clips.parquet")
    assert written.equals(table.schema, check_metadata=True)


@pytest.mark.parametrize("jobs", [1, 3])
def test_rows_do_not_depend_on_the_number_of_jobs(clips, result, jobs):
    assert same(dynacom.batch(clips[0], ROBOT, jobs=jobs), result[0])


def test_shards_are_parts_of_the_whole(clips, result, tmp_path):
    parts = [dynacom.batch(clips[0], ROBOT, shard=(i, 3)) for i in (1, 2, 3)]
    counts = [part.num_rows for part in parts]
    assert max(counts) - min(counts) <= 1
    assert same(pyarrow.concat_tables(parts).sort_by("file"), result[0])
    one = next(iter(clips[1]))
    assert dynacom.batch(one, ROBOT, shard=(2, 2), out=tmp_path / "out").num_rows == 0
    assert "0 clips" in (tmp_path / "out" / "index.html").read_text()


def test_clips_of_a_pickle(tmp_path, anymal):
    path = tmp_path / "many.pkl"
    content = {f"clip {k}": motion(anymal, 30 * k, 20) for k in range(3)}
    content["\ud800bad"] = motion(anymal, 0, 5) | {"root_rot": np.zeros((5, 4))}
    path.write_bytes(pickle.dumps(content))
    cut(tmp_path / "other.npz", 0, 20)
    table = dynacom.batch(tmp_path, anymal, out=tmp_path / "out", frames=True)
    names = ["clip 0", "clip 1", "clip 2", "\\ud800bad", None]
    assert table["clip"].to_pylist() == names
    assert table["status"].to_pylist() == ["ok"] * 3 + ["error", "ok"]
    for k in range(3):
        report = dynacom.analyze(path, anymal, clip=f"clip {k}")
        assert table["residual_force_rms"][k].as_py() == report.summary["residual_force_rms"]
    frames = pyarrow.dataset.dataset(tmp_path / "out" / "frames", partitioning="hive").to_table()
    assert set(frames["clip"].to_pylist()) == {*names[:3], None}


def test_options_and_reading_are_those_of_analyze(tmp_path):
    q = np.load(WALKS / "anymal_walk.npz")["q"][:30, :19].copy()
    q[:, 3:7] = q[:, [6, 3, 4, 5]]
    np.savetxt(tmp_path / "m.csv", q, delimiter=",")
    options = dynacom.AnalysisOptions(cutoff=None, omega=4.0)
    table = dynacom.batch(tmp_path, ROBOT, fps=50.0, quat="wxyz", options=options)
    (row,) = table.to_pylist()
    assert (row["status"], row["omega"], row["cutoff"]) == ("ok", 4.0, None)
    assert row["frame_rate"] == pytest.approx(50.0)
    assert dynacom.batch(tmp_path, ROBOT)["status"].to_pylist() == ["error"]


def test_without_distance(walks, tmp_path, run):
    """It reaches the workers, and the page."""
    out = tmp_path / "out"
    done = run("batch", walks, "--robot", ROBOT, "--out", out, "--no-distance", "--frames")
    assert (done.returncode, done.stderr) == (0, "")
    table = pyarrow.parquet.read_table(out / "clips.parquet")
    assert table["status"].to_pylist() == 4 * ["ok"]
    for name in ("distance_rms", "distance_max"):
        assert table[name].to_pylist() == 4 * [None]
    frames = pyarrow.dataset.dataset(out / "frames", partitioning="hive").to_table()
    assert np.isnan(frames["distance"]).all()
    assert (out / "index.html").read_text().count('<td class="n" data-value="-Infinity">–') == 8


# Which files.


def test_paths(tmp_path, monkeypatch):
    for name in (
        "a/1.csv",
        "a/b/2.NPZ",
        "a/[3].csv.gz",
        "a/4.txt",
        "a/.5.csv",
        "out/clips.parquet",
        "out/parts/1.parquet",
        "out/mine.csv",
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)
    everything = ["a/1.csv", "a/[3].csv.gz", "a/b/2.NPZ"]
    assert list(find_motions("a")) == everything
    assert list(find_motions(["./a/b", "a/", "a/1.csv"])) == everything
    assert list(find_motions(".", tmp_path / "out")) == [*everything, "out/mine.csv"]
    assert len(find_motions(".")) == 6
    assert list(find_motions("a/*")) == everything
    assert list(find_motions("a/**/*.NPZ")) == ["a/b/2.NPZ"]
    assert list(find_motions("a/[3].csv.gz")) == ["a/[3].csv.gz"]
    assert list(find_motions(["a/4.txt", "no.csv"])) == ["a/4.txt", "no.csv"]
    for path in ("no", "x/*.csv"):
        with pytest.raises(DynacomError, match=re.escape(path)):
            find_motions(path)
    (tmp_path / "void").mkdir()
    with pytest.raises(DynacomError, match=r"void: must hold motions \(\.csv, .*got none"):
        find_motions("void")
    with pytest.raises(DynacomError, match="got none"):
        find_motions([])


# Frames.


def test_frames(result, anymal):
    table, out = result
    frames = pyarrow.dataset.dataset(out / "frames", partitioning="hive").to_table()
    assert set(frames["robot"].to_pylist()) == {ROBOT}
    good = [row for row in table.to_pylist() if row["status"] == "ok"]
    assert frames.num_rows == sum(row["frames"] for row in good)
    assert not [path for path in (out / "frames").rglob("*") if ".writing/" in str(path)]
    for row in good[:3]:
        own = frames.filter(pyarrow.compute.field("file") == row["file"]).sort_by("frame")
        assert own["frame"].to_pylist() == list(range(row["frames"]))
        for name, (values, unit) in dynacom.analyze(row["file"], anymal).columns().items():
            assert own.schema.field(name).metadata[b"unit"].decode() == unit
            np.testing.assert_array_equal(own[name].to_numpy(), values, err_msg=name)


def test_frames_of_what_has_become_unreadable_go(walks, tmp_path):
    out = tmp_path / "out"
    dynacom.batch(walks, ROBOT, out=out, frames=True)
    assert len(list((out / "frames").rglob("*.parquet"))) == 4
    (walks / "2.npz").write_bytes(b"")
    table = dynacom.batch(walks, ROBOT, out=out, frames=True, resume=True)
    assert table["status"].to_pylist() == ["ok", "ok", "error", "ok"]
    assert len(list((out / "frames").rglob("*.parquet"))) == 3


# Going on.


def run_again(out, paths, **options):
    states = []
    table = dynacom.batch(paths, ROBOT, out=out, resume=True, progress=states.append, **options)
    return table, states[-1]


def test_processes_start_before_they_are_needed(walks, tmp_path, anymal, monkeypatch):
    """As many as there is work for; and they end, whatever else is wrong."""
    begun = []
    start = subprocess.Popen

    def begin(*arguments, **options):
        begun.append(start(*arguments, **options))
        return begun[-1]

    monkeypatch.setattr(batch_pool.subprocess, "Popen", begin)
    job = Job(anymal, dynacom.AnalysisOptions())
    pool = batch_pool.Pool(job, 3)
    pool.start(2)
    assert len(begun) == 2
    tasks = [Task(k, f"{k}.npz", str(walks / f"{k}.npz"), None) for k in range(4)]
    done = [reply for reply in pool.run(tasks) if reply is not None]
    assert sorted(reply.index for reply in done) == [0, 1, 2, 3]
    assert all(reply.rows[0]["status"] == "ok" for reply in done)
    pool.close()
    assert len(begun) == 3  # one more, for there was more to do than was said
    assert all(process.poll() is not None for process in begun)

    out = tmp_path / "out"
    dynacom.batch(walks, ROBOT, out=out, jobs=1)
    begun.clear()
    refused("--resume", walks, ROBOT, out=out, jobs=2)
    assert len(begun) == 2
    assert all(process.poll() is not None for process in begun)


def test_results_of_before_are_not_overwritten(walks, tmp_path):
    out = tmp_path / "out"
    table = dynacom.batch(walks, ROBOT, out=out)
    refused("--resume", walks, ROBOT, out=out)
    shutil.rmtree(out / "parts")
    refused("has results of a batch", walks, ROBOT, out=out)
    assert pyarrow.parquet.read_table(out / "clips.parquet").equals(table)


def test_resume_does_what_has_changed(walks, tmp_path):
    out = tmp_path / "out"
    before = dynacom.batch(walks, ROBOT, out=out)
    again, state = run_again(out, walks)
    assert again.equals(before)
    assert (state.files, state.done, state.known, state.clips) == (4, 4, 4, 0)

    cut(walks / "1.npz", 10, 25)  # changed
    cut(walks / "0a.npz", 70, 20)  # new
    (walks / "3.npz").unlink()  # gone
    again, state = run_again(out, walks)
    assert (state.known, state.clips) == (2, 2)
    assert same(again, dynacom.batch(walks, ROBOT))
    assert rows(again)[str(walks / "0.npz")] == before.to_pylist()[0]  # its seconds too

    os.utime(walks / "0.npz")
    assert run_again(out, walks)[1].known == 4


@pytest.mark.parametrize(
    "options",
    [
        {"options": dynacom.AnalysisOptions(omega=3.0)},
        {"options": dynacom.AnalysisOptions(distance=False)},
        {"fps": 30.0},
        {"frames": True},
    ],
)
def test_resume_with_other_settings_does_everything(walks, tmp_path, options):
    out = tmp_path / "out"
    dynacom.batch(walks, ROBOT, out=out)
    table, state = run_again(out, walks, **options)
    assert (state.known, state.clips) == (0, 4)
    omega = options.get("options", dynacom.AnalysisOptions()).omega
    if omega:
        assert set(table["omega"].to_pylist()) == {omega}
    assert rows_of_parts(out) == 4  # what is of no use has gone


def test_resume_with_another_robot_does_everything(walks, tmp_path, anymal):
    out = tmp_path / "out"
    before = dynacom.batch(walks, anymal, out=out)
    heavy = anymal.with_payload("base", 10.0)
    table = dynacom.batch(walks, heavy, out=out, resume=True)
    difference = np.subtract(table["mass"].to_pylist(), before["mass"].to_pylist())
    np.testing.assert_allclose(difference, 10.0)


def test_a_broken_part_is_done_again(walks, tmp_path):
    out = tmp_path / "out"
    before = dynacom.batch(walks, ROBOT, out=out)
    for part in (out / "parts").iterdir():
        part.write_bytes(part.read_bytes()[:100])
    (out / "parts" / ".part-00000009.parquet.tmp").write_bytes(b"half")
    table, state = run_again(out, walks)
    assert state.known == 0
    assert same(table, before)
    assert not list((out / "parts").glob(".*"))


def test_two_batches_in_one_folder(walks, tmp_path, anymal):
    out = tmp_path / "out"
    job = Job(anymal, dynacom.AnalysisOptions())
    with Store.open(out, job, ["a"], resume=False):
        refused(f"{out}: another batch is writing to it", walks, anymal, out=out)
        refused("another batch is writing to it", walks, anymal, out=out, resume=True)
    assert dynacom.batch(walks, anymal, out=out).num_rows == 4


@pytest.mark.parametrize("seed", range(5))
def test_the_table_is_in_order_however_rows_come(tmp_path, anymal, monkeypatch, seed):
    """Parts that overlap, files of several rows, interruptions, little memory."""
    monkeypatch.setattr(batch_store, "_PART_ROWS", 4)
    monkeypatch.setattr(batch_store, "_GROUP_ROWS", 5)
    rng = np.random.default_rng(seed)
    names = [f"{k:03}" for k in range(60)]
    job = Job(anymal, dynacom.AnalysisOptions())
    order = sorted(range(60), key=lambda k: k + rng.uniform(0, 25))

    def made(index, run):
        count = 1 + index % 3
        return [
            error_row(job, names[index], str(run)) | {"clip": str(k), "sha256": "0"}
            for k in range(count)
        ]

    with Store.open(tmp_path, job, names, resume=False) as store:
        for index in order[:40]:
            store.add(index, made(index, 1))
        store.flush()
    redone = set(rng.permutation(order[:40])[:7].tolist())
    with Store.open(tmp_path, job, names, resume=True) as store:
        for index in order:
            assert (store.known(index) == "0") == (index in order[:40])
            if index in redone or index in order[40:]:
                store.add(index, made(index, 2))
        store.finish()
    table = pyarrow.parquet.read_table(tmp_path / "clips.parquet")
    expected = [
        (names[index], str(k), "1" if index in order[:40] and index not in redone else "2")
        for index in range(60)
        for k in range(1 + index % 3)
    ]
    columns = (table[name].to_pylist() for name in ("file", "clip", "error"))
    assert list(zip(*columns, strict=True)) == expected


# Killed.


@pytest.fixture
def slow(tmp_path, anymal):
    """Clips that take longer than parts are kept back, and a file that tells how often each is."""
    folder, log = tmp_path / "slow", tmp_path / "log"
    folder.mkdir()
    for number in range(24):
        statement = f"import time; open({str(log)!r}, 'a').write('{number}\\n'); time.sleep(0.2)"
        write_program(folder / f"{number:02}.pkl", anymal, 5 * number, statement)
    return folder, log


def start(*arguments):
    return subprocess.Popen(
        [*COMMAND, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # Where the tests run in the background of a shell, they and their children ignore it.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def wait_for_parts(out, count):
    deadline = time.monotonic() + 60
    while len(list((out / "parts").glob("part-*"))) < count:
        assert time.monotonic() < deadline
        time.sleep(0.01)


def rows_of_parts(out):
    return sum(pyarrow.parquet.read_metadata(p).num_rows for p in (out / "parts").glob("part-*"))


def test_killed_and_resumed(slow, tmp_path, run):
    folder, log = slow
    out = tmp_path / "out"
    arguments = ("batch", folder, "--robot", ROBOT, "--out", out, "--trust", "--jobs", 2)
    process = start(*arguments)
    wait_for_parts(out, 1)
    process.kill()
    process.communicate(timeout=60)
    safe = rows_of_parts(out)
    assert 0 < safe < 24
    assert not (out / "clips.parquet").exists()

    again = run(*arguments, "--resume")
    assert (again.returncode, again.stderr) == (0, "")
    assert f"{safe} of 24 files" in again.stdout
    reads = log.read_text().split()
    assert len(set(reads)) == 24
    assert len(reads) <= 24 + (24 - safe)

    whole = run(*arguments[:5], tmp_path / "whole", *arguments[6:])
    assert whole.returncode == 0
    tables = [pyarrow.parquet.read_table(d / "clips.parquet") for d in (out, tmp_path / "whole")]
    assert same(*tables)
    assert set(tables[0]["status"].to_pylist()) == {"ok"}


def test_ctrl_c(slow, tmp_path, run):
    folder, log = slow
    out = tmp_path / "out"
    arguments = ("batch", folder, "--robot", ROBOT, "--out", out, "--trust", "--jobs", 2)
    process = start(*arguments)
    deadline = time.monotonic() + 60
    while not log.exists() or len(log.read_text().split()) < 6:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    printed, err = process.communicate(timeout=60)
    assert (process.returncode, printed) == (130, "")
    match = re.fullmatch(r"dynacom: interrupted when (\d+) of 24 files were done: .*\n", err)
    assert "--resume" in err
    assert 2 <= int(match[1]) < 24
    assert rows_of_parts(out) == int(match[1])  # all that is finished is there
    again = run(*arguments, "--resume")
    assert f"{match[1]} of 24 files" in again.stdout


def test_workers_that_die(tmp_path, anymal):
    folder = tmp_path / "clips"
    folder.mkdir()
    marker = tmp_path / "marker"
    kill = "import os; os.kill(os.getpid(), 9)"
    once = f"import os; m = {str(marker)!r}\nif not os.path.exists(m):\n    open(m, 'x'); {kill}"
    for number in range(6):
        cut(folder / f"{number}.npz", 10 * number, 20)
    write_program(folder / "1_once.pkl", anymal, 0, once)
    write_program(folder / "3_always.pkl", anymal, 0, kill)
    write_program(folder / "4_exits.pkl", anymal, 0, "import os; os._exit(7)")
    for jobs in (1, 2):
        marker.unlink(missing_ok=True)
        table = dynacom.batch(folder, anymal, trust=True, jobs=jobs)
        errors = {os.path.basename(r["file"]): r["error"] for r in table.to_pylist() if r["error"]}
        assert list(errors) == ["3_always.pkl", "4_exits.pkl"]
        assert errors["3_always.pkl"].endswith("its worker process died twice (by SIGKILL)")
        assert errors["4_exits.pkl"].endswith("its worker process died twice (exit status 7)")
        assert marker.exists()


def test_what_workers_died_of_is_tried_again_by_resume(tmp_path, anymal):
    path = tmp_path / "m.pkl"
    marker = tmp_path / "memory"
    statement = f"import os\nif not os.path.exists({str(marker)!r}): os._exit(1)"
    write_program(path, anymal, 0, statement)
    out = tmp_path / "out"
    assert dynacom.batch(path, anymal, out=out, trust=True)["status"].to_pylist() == ["error"]
    marker.touch()
    table = dynacom.batch(path, anymal, out=out, trust=True, resume=True)
    assert table["status"].to_pylist() == ["ok"]


def test_workers_that_cannot_start(walks, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    refused("a worker process could not start (exit status 1)", walks, ROBOT)


def test_no_process_is_left(walks):
    dynacom.batch(walks, ROBOT)
    with pytest.raises(ChildProcessError):
        os.waitpid(-1, os.WNOHANG)


def test_a_script_without_guard(walks, tmp_path):
    """Workers must not run it again."""
    script = tmp_path / "script.py"
    script.write_text(
        f"import dynacom\nprint(dynacom.batch({str(walks)!r}, {ROBOT!r}, jobs=2).num_rows)\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=120)
    assert (done.stdout, done.stderr) == ("4\n", "")


# Full disks.


@pytest.mark.parametrize("frames", [False, True])
def test_no_file_larger_than_that(walks, tmp_path, run, frames):
    """As on a full disk, writing fails in the middle of a file."""
    out = tmp_path / "out"
    arguments = ["batch", walks, "--robot", ROBOT, "--out", out, *["--frames"] * frames]
    limit = "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000)); "
    code = f"{limit}from dynacom.cli import main; main()"
    command = [sys.executable, "-c", code, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout) == (2, "")
    where = out / "frames" if frames else out
    assert re.fullmatch(rf"dynacom: {where}: cannot be written \(.*\)\n", done.stderr)
    assert not [p for p in out.rglob("*") if p.is_file() and p.name != ".lock"]
    again = run(*arguments, "--resume")
    assert (again.returncode, again.stderr) == (0, "")
    assert pyarrow.parquet.read_table(out / "clips.parquet").num_rows == 4


@pytest.mark.parametrize("frames", [False, True])
def test_a_full_disk(walks, tmp_path, frames):
    """On a small file system, in a name space of its own."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = f"mount -t tmpfs -o size=16k none {disk}"
    if subprocess.run(["unshare", "-rm", "sh", "-c", mount], capture_output=True).returncode:
        pytest.skip("no file system can be mounted here")
    command = f"{sys.executable} -m dynacom batch {walks} --robot {ROBOT} --out {disk}/out"
    where = f"{disk}/out/frames" if frames else f"{disk}/out"
    command += " --frames" * frames
    script = (
        f"{mount} && {command}; echo $?; mount -o remount,size=16m {disk} && "
        f"{command} --resume; echo $?"
    )
    done = subprocess.run(
        ["unshare", "-rm", "sh", "-c", script], capture_output=True, text=True, timeout=120
    )
    assert done.stdout.startswith("2\n")
    assert done.stdout.endswith("\n0\n")
    assert re.fullmatch(
        rf"dynacom: {where}: cannot be written \([^\n]*No space left[^\n]*\)\n",
        done.stderr,
    )


def test_folders_that_cannot_be(walks, tmp_path):
    file = tmp_path / "file"
    file.write_text("mine")
    refused(f"{file}: cannot be written", walks, ROBOT, out=file)
    refused("cannot be written (Not a directory)", walks, ROBOT, out=file / "out")
    assert file.read_text() == "mine"


# The page.


def test_index(clips, result):
    table, out = result
    page = (out / "index.html").read_text()
    bad = [row for row in table.to_pylist() if row["status"] == "error"]
    good = [row for row in table.to_pylist() if row["status"] == "ok"]
    assert f"<h1>{table.num_rows} clips of {ROBOT}</h1>" in page
    for text, count in (
        ("feasible", sum(row["feasible"] is True for row in good)),
        ("repairable", sum(row["verdict"] == "repairable" for row in good)),
        ("not feasible", sum(row["verdict"] == "not feasible" for row in good)),
        ("unknown: too short", 1),
        ("error", len(bad)),
    ):
        assert re.search(rf'<td>{text}</td><td class="n">{count} \(', page)
    for code in FAULTS:
        count = sum(code in row["codes"] for row in good)
        assert re.search(rf'<td>{code}: [^<]*</td><td class="n">{count} \(', page)
    assert page.index("air.npz</td>") < page.index("walk_0.npz</td>")  # the worst first
    assert "\\udcff&lt;b&gt;&amp;&quot;.csv</td>" in page
    assert "<b>" not in page
    assert not re.search(r"https?://|src=|href=", page)


def test_lists_of_the_index_are_short(walks, tmp_path):
    for number in range(5):
        (walks / f"bad_{number}.csv").touch()
    out = tmp_path / "out"
    dynacom.batch(walks, ROBOT, out=out)
    found = batch_overview.overview(out / "clips.parquet", listed=2)
    assert (found.clips, found.verdicts["feasible"], found.errors) == (9, 4, 5)
    assert len(found.worst) == 2
    assert [row["file"][-9:] for row in found.failed] == ["bad_0.csv", "bad_1.csv"]
    assert found.frames == 80
    assert found.duration == pytest.approx(4 * 19 * 0.02)


def test_reports_of_the_worst(walks, tmp_path, monkeypatch, anymal):
    # What a page looks like is tested elsewhere.
    page = types.ModuleType("dynacom.page")
    page.write_page = lambda path, *others, before: path.write_text(others[-1]["clip"])
    monkeypatch.setitem(sys.modules, "dynacom.page", page)
    hover(walks / 'a"b.npz', 0, 40)
    hover(walks / "b.npz", 20, 40)
    out = tmp_path / "out"
    table = dynacom.batch(walks, anymal, out=out, report=2)
    assert table["feasible"].to_pylist() == [True] * 4 + [False] * 2
    links = re.findall(r'<a href="([^"]+)">([^<]+)</a>', (out / "index.html").read_text())
    assert {text for _, text in links} == {f"{walks}/a&quot;b.npz", f"{walks}/b.npz"}
    for link, text in links:
        assert (out / link).read_text() == os.path.basename(text).replace("&quot;", '"')
        assert (out / link).with_name("frames.parquet").exists()
    assert len(list((out / "reports").iterdir())) == 2


# Bad arguments.


def test_bad_arguments(walks, tmp_path, monkeypatch):
    refused("robot", walks, "no-such-robot")
    refused("engine must be local or ray, got 'x'", walks, ROBOT, engine="x")
    refused("jobs must be at least 1, got 0", walks, ROBOT, jobs=0)
    refused("quat must be xyzw or wxyz", walks, ROBOT, quat="x")
    refused("fps must be finite and > 0 Hz, got -3", walks, ROBOT, fps=-3.0)
    refused("shard must be i/n with i from 1 to n, got 3/2", walks, ROBOT, shard=(3, 2))
    refused("got 0/2", walks, ROBOT, shard=(0, 2))
    refused("report must not be negative", walks, ROBOT, report=-1, out=tmp_path / "out")
    refused("out must be a folder of this machine", walks, ROBOT, out="s3://bucket/out")
    with pytest.raises(ValueError, match="omega must be finite"):
        dynacom.batch(walks, ROBOT, options=dynacom.AnalysisOptions(omega=-1.0))
    for name in ("resume", "frames", "report"):
        refused(f"{name} needs out", walks, ROBOT, **{name: 1})
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    refused("pip install dynacom[motion]", walks, ROBOT)
    assert not (tmp_path / "out").exists()


def test_command(clips, result, tmp_path, run):
    out = tmp_path / "out"
    done = run("batch", clips[0], "--robot", ROBOT, "--out", out, "--jobs", 2)
    assert (done.returncode, done.stderr) == (0, "")
    count = sum(map(bool, clips[1].values()))
    text = re.sub(r"[│┃|]+", " ", done.stdout)
    assert re.search(rf"^ *Clips +{len(clips[1])} *$", text, re.MULTILINE)
    assert re.search(rf"^ *errors +{count} \(", text, re.MULTILINE)
    assert f"{count - 5} more are in index.html" in text
    assert done.stdout.endswith(f"Wrote {out}/clips.parquet\nWrote {out}/index.html\n")
    assert same(pyarrow.parquet.read_table(out / "clips.parquet"), result[0])
    options = ("--shard", "1/2", "--cutoff", "3", "--set", "omega=3.5", "--resume")
    assert run("batch", clips[0], "--robot", ROBOT, "--out", out, *options).returncode == 0
    table = pyarrow.parquet.read_table(out / "clips.parquet")
    assert table["file"].to_pylist() == sorted(clips[1])[::2]
    assert set(table["omega"].to_pylist()) == {None, 3.5}


@pytest.mark.parametrize(
    ("options", "part"),
    [
        (["--engine", "x"], "engine must be local or ray"),
        (["--jobs", "0"], "jobs must be"),
        (["--shard", "2"], "shard must be i/n"),
        (["--shard", "2/1"], "shard must be i/n"),
        (["--set", "x=1"], "unknown setting"),
    ],
)
def test_usage(walks, tmp_path, run, options, part):
    done = run("batch", walks, "--robot", ROBOT, "--out", tmp_path / "out", *options)
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(r"dynacom: [^\n]+\n", done.stderr)
    assert part in done.stderr
    assert not (tmp_path / "out").exists()


def test_progress_on_a_terminal(walks, tmp_path):
    terminal, process_end = pty.openpty()
    process = subprocess.Popen(
        [*COMMAND, "batch", walks, "--robot", ROBOT, "--out", tmp_path / "out"],
        stdout=subprocess.DEVNULL,
        stderr=process_end,
        env=os.environ | {"TERM": "xterm", "COLUMNS": "120"},
    )
    os.close(process_end)
    shown = b""
    with contextlib.suppress(OSError):  # which is how a terminal ends
        while block := os.read(terminal, 1 << 16):
            shown += block
    os.close(terminal)
    assert process.wait(timeout=60) == 0
    for part in ("Judging", "4/4 files", "clips/s", "frames/s", "0 errors"):
        assert part.encode() in shown
