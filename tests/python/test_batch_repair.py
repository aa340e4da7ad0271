# SPDX-License-Identifier: BSD-2-Clause
"""Batches that repair: rows, and what is in DIR/repaired."""

import json
import os
import pickle
import re
import shutil
import signal
import subprocess
import sys
import time
import types
from pathlib import Path

import numpy as np
import pinocchio as pin
import pyarrow.parquet
import pytest

import dynacom
from batch_clips import (
    cut,
    hover,
    hurry,
    motion,
    same,
    write_csv,
    write_program,
    write_repairable,
    write_without_legs,
)
from dynacom import DynacomError, batch_judge
from dynacom.batch_files import find_motions, find_places
from dynacom.batch_judge import Judge
from dynacom.batch_overview import overview
from dynacom.batch_repair import REASONS, REPAIR_COLUMNS
from dynacom.batch_row import Job
from helpers import WALKS

ROBOT = "anymal_c"
NAMES = [name for name, _, _ in REPAIR_COLUMNS]


@pytest.fixture(scope="module")
def clips(tmp_path_factory, anymal):
    """A folder, and what becomes of each file in it."""
    folder = tmp_path_factory.mktemp("clips") / "motions"
    return folder, write_repairable(folder, anymal)


@pytest.fixture(scope="module")
def result(clips, tmp_path_factory):
    """The table of that folder, and DIR."""
    out = tmp_path_factory.mktemp("result") / "out"
    return repair(clips[0], out, jobs=2), out


def repair(paths, out, robot=ROBOT, **options):
    return dynacom.batch(paths, robot, out=out, repair=True, **options)


def tree(out):
    """What lies in the folder of repaired motions, in hidden ones too: path -> bytes."""
    folder = out / "repaired"
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def rows_of(table, file):
    return [row for row in table.to_pylist() if row["file"] == str(file)]


# Rows and files.


def test_outcomes(clips, result):
    folder, outcomes = clips
    table, out = result
    found = {
        name: "+".join(row["repair"] or row["status"] for row in rows_of(table, folder / name))
        for name in outcomes
    }
    assert found == outcomes
    written = {name for name, outcome in outcomes.items() if re.search("feas|(?<!t )rep", outcome)}
    assert set(tree(out)) == written | {"fast.csv.summary.json"}
    for name, outcome in outcomes.items():
        for row in rows_of(table, folder / name):
            is_kept = row["repair"] in ("feasible", "repaired")
            assert row["repair_file"] == (f"repaired/{name}" if is_kept else None)
            assert (row["repair_reasons"] is None) == (row["repair"] != "not repaired"), outcome
            assert row["repair_error"] is None
            if row["status"] == "error":
                assert [row[name] for name in NAMES] == [None] * len(NAMES)


def test_the_analysis_is_as_ever(clips, result):
    table = dynacom.batch(clips[0], ROBOT)
    assert same(table.drop(NAMES), result[0].drop(NAMES))
    assert all(set(table[name].to_pylist()) == {None} for name in NAMES)


def test_values_are_those_of_repair(clips, result, anymal):
    for name in ("calm.csv", "fast.csv", "sub/air.npz", "sub/fast.npz"):
        (row,) = rows_of(result[0], clips[0] / name)
        found = dynacom.repair(clips[0] / name, anymal)
        assert row["repair"] == found.outcome
        change = found.summary["repair"]
        for part in ("root", "joints"):
            assert row[f"repair_{part}_rms"] == change[part]["rms"]
            assert row[f"repair_{part}_max"] == change[part]["largest"]
        assert row["repair_missing"] == change["missing"]["frames"]
        codes = list(dict.fromkeys(reason["code"] for reason in change["reasons"]))
        assert row["repair_reasons"] == ("+".join(codes) or None)
        assert row["repair_verdict"] == change["verdict"]


def test_feasible_clips_are_copied(clips, result):
    for name in ("calm.csv", "calm.npz", "calm.pkl"):
        assert (result[1] / "repaired" / name).read_bytes() == (clips[0] / name).read_bytes()


@pytest.mark.parametrize("name", ["sub/fast.npz", "fast.csv", "fast.pkl"])
def test_repaired_clips_are_exact_and_feasible(clips, result, anymal, name):
    path = result[1] / "repaired" / name
    clip = dynacom.read_motion(path, anymal)
    before = dynacom.read_motion(clips[0] / name, anymal)
    assert clip.exact
    assert not before.exact
    np.testing.assert_array_equal(clip.time, before.time)
    report = dynacom.analyze(clip, anymal)
    (row,) = rows_of(result[0], clips[0] / name)
    assert report.summary["cutoff"] is None
    assert report.verdict.outcome == row["repair_verdict"] == "feasible"
    residual = np.abs(report["residual"]).max() / report.summary["weight"]
    assert residual < 2e-3
    difference = np.linalg.norm(clip.q[:, :3] - before.q[:, :3], axis=1)
    assert difference.max() == pytest.approx(row["repair_root_max"], abs=5e-3)
    assert row["repair_root_max"] >= row["repair_root_rms"] > 0.0


def test_the_mark_of_csv(result):
    path = result[1] / "repaired" / "fast.csv"
    content = json.loads(path.with_name("fast.csv.summary.json").read_text())
    assert content == {"repair": dynacom.mark_of(path)}


def test_pickles_hold_what_is_feasible(clips, result, anymal):
    """Those clips that are, in their order, and untouched if they were."""
    path = result[1] / "repaired" / "many.pkl"
    before = pickle.loads((clips[0] / "many.pkl").read_bytes())
    after = pickle.loads(path.read_bytes())
    assert list(after) == ["calm", "fast"]
    assert list(after["calm"]) == list(before["calm"])
    for key, value in before["calm"].items():
        np.testing.assert_array_equal(after["calm"][key], value)
    assert not dynacom.read_motion(path, anymal, clip="calm").exact
    clip = dynacom.read_motion(path, anymal, clip="fast")
    assert clip.exact
    assert dynacom.analyze(clip, anymal).verdict.outcome == "feasible"
    alone = dynacom.read_motion(result[1] / "repaired" / "fast.pkl", anymal)
    np.testing.assert_array_equal(clip.q, alone.q)


def test_what_is_repaired_needs_no_repair(result, tmp_path):
    """All of it is feasible, and stays as it is, and is still exact."""
    folder, out = result[1] / "repaired", tmp_path / "out"
    table = repair(folder, out)
    assert set(table["repair"].to_pylist()) == {"feasible"}
    assert tree(out) == tree(result[1])


def test_options_reach_workers(tmp_path, anymal):
    path = cut(tmp_path / "trot.npz", 20, 50, "anymal_trot", v=None, a=None)
    (row,) = repair(path, tmp_path / "a").to_pylist()
    (strict,) = repair(path, tmp_path / "b", strict=True).to_pylist()
    assert (row["repair"], row["repair_missing"] > 0) == ("feasible", True)
    assert (strict["repair"], strict["repair_missing"]) == ("repaired", 0)

    path = hurry(tmp_path / "fast.npz", 20, 50)
    (row,) = repair(path, tmp_path / "c").to_pylist()
    (balanced,) = repair(path, tmp_path / "d", balance_only=True).to_pylist()
    found = dynacom.repair(path, anymal, balance_only=True)
    assert balanced["repair_joints_rms"] == found.repair.joints.rms < row["repair_joints_rms"]


def test_urls(clips, result, tmp_path):
    pytest.importorskip("fsspec")
    table = repair(f"file://{clips[0]}", tmp_path / "out")
    for name in NAMES:
        texts = [text and str(text).replace("file://", "") for text in table[name].to_pylist()]
        assert texts == [text and str(text) for text in result[0][name].to_pylist()]
    assert tree(tmp_path / "out") == tree(result[1])


# Jobs, shards.


@pytest.mark.parametrize("jobs", [1, 3])
def test_files_do_not_depend_on_the_number_of_jobs(clips, result, tmp_path, jobs):
    assert same(repair(clips[0], tmp_path / "out", jobs=jobs), result[0])
    assert tree(tmp_path / "out") == tree(result[1])


def test_shards_are_parts_of_the_whole(clips, result, tmp_path):
    files = {}
    tables = []
    for part in (1, 2, 3):
        out = tmp_path / str(part)
        tables.append(repair(clips[0], out, shard=(part, 3)))
        own = tree(out)
        assert not files.keys() & own.keys()
        files |= own
    assert same(
        pyarrow.concat_tables(tables).sort_by("file").drop(["clip"]), result[0].drop(["clip"])
    )
    assert files == tree(result[1])


# Going on.


def run_again(paths, out, **options):
    states = []
    return repair(paths, out, resume=True, progress=states.append, **options), states[-1]


def test_resume_repairs_what_was_only_judged(clips, result, tmp_path):
    out = tmp_path / "out"
    dynacom.batch(clips[0], ROBOT, out=out)
    table, state = run_again(clips[0], out)
    assert state.known == 0
    assert same(table, result[0])
    assert tree(out) == tree(result[1])
    table, state = run_again(clips[0], out)
    assert (state.known, state.clips) == (len(clips[1]), 0)
    assert same(table, result[0])


def test_resume_does_what_is_not_there(clips, result, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(result[1], out)
    (out / "repaired" / "sub" / "fast.npz").unlink()
    (out / "repaired" / "many.pkl").unlink()
    half = out / "repaired" / ".writing" / "0123" / "half.npz"
    half.parent.mkdir(parents=True)
    half.write_bytes(b"PK")
    table, state = run_again(clips[0], out)
    assert (state.files - state.known, state.clips) == (2, 5)
    assert same(table, result[0])
    assert tree(out) == tree(result[1])


def test_resume_does_what_lies_elsewhere_now(clips, result, tmp_path):
    out = tmp_path / "out"
    repair(clips[0] / "sub", out)
    assert set(tree(out)) == {"fast.npz"}
    table, state = run_again(clips[0], out)
    assert state.known == 1  # that one of sub of which nothing was written
    assert same(table, result[0])
    assert tree(out).items() >= tree(result[1]).items()


def test_files_of_clips_that_are_feasible_no_more_go(tmp_path, anymal):
    folder, out = tmp_path / "clips", tmp_path / "out"
    folder.mkdir()
    for name in ("a", "b", "c", "d"):
        hurry(folder / f"{name}.npz", 20, 50)
    write_csv(folder / "e.csv", anymal, "anymal_trot", 100.0)
    assert set(repair(folder, out)["repair"].to_pylist()) == {"repaired"}
    assert len(tree(out)) == 6
    hover(folder / "a.npz", 0, 40)
    (folder / "b.npz").write_bytes(b"")
    (folder / "c.npz").unlink()
    (folder / "c.npz").symlink_to("nowhere.npz")
    (folder / "e.csv").write_bytes(b"")
    table, _ = run_again(folder, out)
    assert table["repair_file"].to_pylist() == [None] * 3 + ["repaired/d.npz", None]
    assert set(tree(out)) == {"d.npz"}


def test_killed_and_resumed(tmp_path, anymal, run):
    """There is no half of a file, and each is as without interruption."""
    folder, out = tmp_path / "clips", tmp_path / "out"
    folder.mkdir()
    for number in range(16):
        write_program(
            folder / f"{number:02}.pkl", anymal, 5 * number, "import time; time.sleep(0.2)"
        )
        hurry(folder / f"{number:02}.npz", 5 * number, 40)
    arguments = ("batch", folder, "--robot", ROBOT, "--trust", "--jobs", 2, "--repair", "--out")
    process = subprocess.Popen(
        [sys.executable, "-m", "dynacom", *map(str, [*arguments, out])],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    deadline = time.monotonic() + 60
    while not list((out / "parts").glob("part-*")):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=60)
    again = run(*arguments, out, "--resume")
    assert (again.returncode, again.stderr) == (0, "")
    assert "Known before" in again.stdout
    whole = run(*arguments, tmp_path / "whole")
    assert whole.returncode == 0
    tables = [pyarrow.parquet.read_table(d / "clips.parquet") for d in (out, tmp_path / "whole")]
    assert same(*tables)
    assert tree(out) == tree(tmp_path / "whole")
    assert len(tree(out)) > 24


# What goes wrong.


@pytest.fixture
def judge(tmp_path, anymal):
    return Judge(Job(anymal, dynacom.AnalysisOptions(), repair=tmp_path / "repaired"))


def fail(*arguments, **options):
    raise RuntimeError("no\nluck")


def test_an_error_of_repair_keeps_the_analysis(tmp_path, judge, monkeypatch):
    path = hurry(tmp_path / "m.npz", 20, 50)
    (good,) = judge("m.npz", str(path), None, "m.npz")
    assert (good["repair"], good["repair_file"]) == ("repaired", "repaired/m.npz")
    monkeypatch.setattr(batch_judge, "repair_clip", fail)
    (row,) = judge("m.npz", str(path), None, "m.npz")
    assert row["repair_error"] == "m.npz: RuntimeError: no luck"
    left = {name for name in row if name.startswith("repair")}
    assert left == {"repair_error"}
    assert {k: v for k, v in row.items() if k not in {*NAMES, "seconds"}} == {
        k: v for k, v in good.items() if k not in {*NAMES, "seconds"}
    }
    assert not tree(tmp_path)


def test_repair_that_kills_workers(tmp_path, anymal):
    """Without it, there is a row of the analysis."""
    log = tmp_path / "log"
    log.touch()
    kill = f"import os; f = open({str(log)!r}, 'r+'); n = len(f.read()); f.write('x'); f.flush()"
    write_program(tmp_path / "m.pkl", anymal, 0, f"{kill}; n > 1 or os._exit(1)")
    (row,) = repair(tmp_path / "m.pkl", tmp_path / "out", trust=True).to_pylist()
    assert (row["status"], row["verdict"], row["repair"]) == ("ok", "feasible", None)
    assert row["repair_error"] == f"{tmp_path}/m.pkl: its worker process died twice"
    # There may be more memory now.
    (row,) = repair(tmp_path / "m.pkl", tmp_path / "out", trust=True, resume=True).to_pylist()
    assert (row["repair"], row["repair_error"]) == ("feasible", None)
    assert set(tree(tmp_path / "out")) == {"m.pkl"}

    log.write_text("")
    write_program(tmp_path / "m.pkl", anymal, 0, f"{kill}; os._exit(1)")
    (row,) = repair(tmp_path / "m.pkl", tmp_path / "out", trust=True, resume=True).to_pylist()
    assert row["error"].endswith("its worker process died three times (exit status 1)")
    assert row["repair_error"] is None
    assert (row["repair_file"], tree(tmp_path / "out")) == (None, {})


@pytest.mark.parametrize("what", ["motion_content", "PickleFile.dump", "PickleFile.change"])
def test_what_a_format_cannot_hold(tmp_path, judge, anymal, monkeypatch, what):
    name = "m.npz" if what == "motion_content" else "m.pkl"
    hurry(tmp_path / "m.npz", 20, 50)
    fast = motion(anymal, 20, 40) | {"fps": 150.0}
    clips = {"calm": motion(anymal, 20, 40), "fast": fast}
    (tmp_path / "m.pkl").write_bytes(pickle.dumps(clips))
    monkeypatch.setattr(f"dynacom.batch_repair.{what}", fail)
    *others, row = judge(name, str(tmp_path / name), None, name)
    assert row["repair"] == "repaired"
    assert row["repair_error"] == f"{name}: RuntimeError: no luck"
    assert row.get("repair_file") is None
    assert row["repair_root_max"] > 0.0
    # The others of the file are there if they can be.
    is_there = what == "PickleFile.change"
    assert set(tree(tmp_path)) == ({"m.pkl"} if is_there else set())
    for other in others:
        assert other.get("repair_file") == ("repaired/m.pkl" if is_there else None)
    if is_there:
        assert list(pickle.loads((tmp_path / "repaired" / "m.pkl").read_bytes())) == ["calm"]


@pytest.mark.parametrize("kind", ["csv", "pkl"])
def test_what_is_not_feasible_as_it_was_written(tmp_path, talos, kind):
    """What repair has moved is not in the file: it is not written."""
    path = tmp_path / "walk.csv"
    robot = write_without_legs(path, talos)
    if kind == "pkl":
        clip = dynacom.read_motion(path, robot)
        names = list(clip.joint_names)
        columns = [robot.model.joints[robot.model.getJointId(name)].idx_q for name in names]
        parts = {
            "root_pos": clip.q[:, :3],
            "root_rot": clip.q[:, 3:7],
            "dof_pos": clip.q[:, columns],
        }
        clips = {name: parts | {"fps": 50.0, "dof_names": names} for name in ("one", "two")}
        path = tmp_path / "walk.pkl"
        path.write_bytes(pickle.dumps(clips))
    table = repair(path, tmp_path / "out", robot=robot)
    for row in table.to_pylist():
        assert (row["repair"], row["repair_file"]) == ("repaired", None)
        assert re.fullmatch(
            rf"{path}: The motion is repairable \(foot_sliding\) as it was written: .*",
            row["repair_error"],
        )
    assert not tree(tmp_path / "out")
    found = overview(tmp_path / "out" / "clips.parquet")
    assert (found.outcomes["repaired"], found.repair_errors) == (0, table.num_rows)
    assert "cannot hold all that was changed" in (tmp_path / "out" / "index.html").read_text()


def test_a_folder_that_cannot_be_written_to(tmp_path):
    path = hurry(tmp_path / "m.npz", 20, 50)
    out = tmp_path / "out"
    out.mkdir()
    (out / "repaired").write_text("mine")
    with pytest.raises(DynacomError, match=f"{out}/repaired: cannot be written"):
        repair(path, out)
    assert (out / "repaired").read_text() == "mine"


def test_no_file_larger_than_that(tmp_path, run):
    """As on a full disk, writing fails in the middle of a file."""
    path, out = cut(tmp_path / "m.npz", 0, 60), tmp_path / "out"
    arguments = ["batch", path, "--robot", ROBOT, "--out", out, "--repair"]
    limit = "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000)); "
    code = f"{limit}from dynacom.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(rf"dynacom: {out}/repaired: cannot be written \(.*\)\n", done.stderr)
    assert not [p for p in out.rglob("*") if p.is_file() and p.name != ".lock"]
    again = run(*arguments, "--resume")
    assert (again.returncode, again.stderr) == (0, "")
    assert tree(out) == {"m.npz": path.read_bytes()}


def test_bad_arguments(tmp_path):
    path = cut(tmp_path / "m.npz", 0, 20)
    out = tmp_path / "out"
    with pytest.raises(DynacomError, match="repair needs out, a folder"):
        dynacom.batch(path, ROBOT, repair=True)
    for name in ("balance_only", "strict"):
        with pytest.raises(DynacomError, match=f"{name} goes with repair"):
            dynacom.batch(path, ROBOT, out=out, **{name: True})
    options = dynacom.AnalysisOptions()
    options.ladder.largest_stretch = 1.5
    with pytest.raises(DynacomError, match="does not stretch time, got 1.5"):
        repair(path, out, options=options)
    assert not out.exists()


# Places.


def test_places(tmp_path, monkeypatch):
    for name in ("a/1.csv", "a/b/2.npz", "c/1.csv", "out/repaired/1.csv", "out/mine.csv"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    (Path(os.fsdecode(os.fsencode(tmp_path) + b"/a/\xff.csv"))).touch()
    monkeypatch.chdir(tmp_path)

    def places(*paths):
        return list(find_places(paths, find_motions(paths, Path("out")).values()).values())

    assert places("a") == ["1.csv", "\udcff.csv", "b/2.npz"]
    assert places(tmp_path / "a") == places("a") == places("./c/../a")
    assert places("a/b/2.npz") == places("a/b") == ["2.npz"]
    assert places("a/b", "c/1.csv") == ["a/b/2.npz", "c/1.csv"]
    assert places("a/*/*.npz") == ["b/2.npz"]
    assert "mine.csv" not in places("a", "c")
    assert [place for place in places(".") if "out" in place] == ["out/mine.csv"]
    # One file by two names.
    one, other = sorted(places("a/1.csv", tmp_path / "a/1.csv"), key=len)
    assert one == "1.csv"
    assert re.fullmatch("[0-9a-f]{12}-1.csv", other)


def test_places_of_urls():
    def places(path, *files):
        return list(find_places(path, files).values())

    bucket = ("s3://bucket/m/a/1.npz", "s3://bucket/m/2.npz")
    for path in ("s3://bucket/m", "s3://bucket/m/", "s3://bucket/m/**/*.npz"):
        assert places(path, *bucket) == ["a/1.npz", "2.npz"]
    assert places(bucket[0], bucket[0]) == ["1.npz"]
    both = ["/data/1.npz", "s3://bucket/2.npz"]
    assert places(both, *both) == ["data/1.npz", "s3/bucket/2.npz"]
    archive = "zip://a/1.npz::http://host/archive.zip"
    assert places("zip://::http://host/archive.zip", archive) == ["a/1.npz"]
    signed = ["https://host/1.npz?key=1", "https://host/1.npz?key=2"]
    first, second = places(signed, *signed)
    assert first == "1.npz"
    assert re.fullmatch("[0-9a-f]{12}-1.npz", second)
    (long,) = places("s3://b", f"s3://b/{'x' * 300}.npz")
    assert len(long) < 255
    assert long.endswith("x.npz")
    assert ".." not in places("s3://b", "s3://b/a/../../1.npz")[0]


# What is said.


def test_index(clips, result):
    page = (result[1] / "index.html").read_text()
    outcomes = "+".join(clips[1].values()).split("+")
    clips_count = len(outcomes)
    for outcome in ("feasible", "repaired", "not repaired"):
        count = outcomes.count(outcome)
        section = page.partition("<h2>Repair</h2>")[2].partition("<h2>")[0]
        assert f'<td>{outcome}</td><td class="n">{count} ({count / clips_count:.1%})' in section
    codes = [row["repair_reasons"] for row in result[0].to_pylist() if row["repair_reasons"]]
    for code in {code for text in codes for code in text.split("+")}:
        count = sum(code in text.split("+") for text in codes)
        assert f'<td>{code}: {REASONS[code]}</td><td class="n">{count} (' in section
    assert "<td>not repaired: too_short</td>" in page


def test_reports_of_repaired_clips_are_those_of_repair(clips, tmp_path, anymal, monkeypatch):
    """With the motion before; of others the report is that of the analysis."""
    # What a page looks like is tested elsewhere.
    page = types.ModuleType("dynacom.page")
    page.write_page = lambda path, *_, before: path.write_text("" if before is None else "before")
    monkeypatch.setitem(sys.modules, "dynacom.page", page)
    folder, out = tmp_path / "motions", tmp_path / "out"
    names = ("sub/fast.npz", "sub/air.npz", "many.pkl", "calm.csv", "fast.csv")
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(clips[0] / name, folder / name)
    options = dynacom.AnalysisOptions()
    options.repair.displacement = 0.004
    table = repair(folder, out, report=10, options=options)
    text = (out / "index.html").read_text()
    links = {title: link for link, title in re.findall(r'<a href="([^"]+)">([^<]+)</a>', text)}
    rows = [row for row in table.to_pylist() if row["status"] == "ok"]
    assert sum(row["repair"] == "repaired" for row in rows) == 3
    assert len(links) == len(rows) == len(names) + 2
    for row in rows:
        title = row["file"] if row["clip"] is None else f"{row['file']}: {row['clip']}"
        report = out / Path(links[title]).parent
        # No motion is written but where it is already.
        files = ["frames.parquet", "report.html", "schedule.yaml", "summary.json"]
        assert sorted(path.name for path in report.iterdir()) == files
        summary = json.loads((report / "summary.json").read_text())
        if row["repair"] != "repaired":
            assert "repair" not in summary
            assert (report / "report.html").read_text() == ""
            assert summary["verdict"] == row["verdict"]
            continue
        assert (report / "report.html").read_text() == "before"
        alone = dynacom.repair(row["file"], anymal, clip=row["clip"], options=options)
        alone.save(tmp_path / "alone")
        expected = json.loads((tmp_path / "alone" / "summary.json").read_text())
        expected["repair"] |= dynacom.mark_of(out / row["repair_file"])
        expected["repair"]["file"] = row["repair_file"]
        assert summary == expected
        assert summary["repair"]["verdict_before"] == row["verdict"]
        assert summary["repair"]["root"]["largest"] == row["repair_root_max"]
        for name in ("frames.parquet", "schedule.yaml"):
            assert (report / name).read_bytes() == (tmp_path / "alone" / name).read_bytes()


def test_an_index_without_repair(tmp_path):
    out = tmp_path / "out"
    dynacom.batch(cut(tmp_path / "m.npz", 0, 20), ROBOT, out=out)
    page = (out / "index.html").read_text()
    assert "epair<" not in page


def test_command(clips, result, tmp_path, run):
    out = tmp_path / "out"
    done = run("batch", clips[0], "--robot", ROBOT, "--out", out, "--repair")
    assert (done.returncode, done.stderr) == (0, "")
    assert same(pyarrow.parquet.read_table(out / "clips.parquet"), result[0])
    assert tree(out) == tree(result[1])
    text = re.sub(r"[│┃|]+", " ", done.stdout).partition(" Repair ")[2]
    outcomes = "+".join(clips[1].values()).split("+")
    for outcome in ("feasible", "repaired", "not repaired"):
        assert re.search(rf"^ +{outcome} +{outcomes.count(outcome)} \(", text, re.MULTILINE)
    assert re.search(r"^ +too_short +left in 1 \(", text, re.MULTILINE)
    assert done.stdout.endswith(f"Wrote {out}/index.html\nWrote {out}/repaired\n")
    done = run("batch", clips[0], "--robot", ROBOT, "--out", tmp_path / "b", "--strict")
    assert (done.returncode, done.stderr) == (2, "dynacom: strict goes with repair\n")


# The ground.


def write_at(folder, heights):
    folder.mkdir(parents=True)
    with np.load(WALKS / "anymal_walk.npz") as file:
        q = file["q"][:20]
    for number, height in enumerate(heights):
        cut(folder / f"{number}.npz", 0, 20, q=q + height * (np.arange(19) == 2))


def grounds(paths, out, **options):
    dynacom.batch(paths, ROBOT, out=out, **options)
    page = (out / "index.html").read_text()
    found = overview(out / "clips.parquet").grounds
    assert all(ground.text() in page for ground in found)
    assert ("whose ground is known" in page) == bool(found)
    return [(ground.folder, ground.clips, round(ground.height, 3)) for ground in found]


def test_a_ground_that_is_not_at_zero(tmp_path):
    base = tmp_path / "m"
    write_at(base / "high", [0.1, 0.1, 0.105])
    write_at(base / "zero", [0.0, 0.0, 0.0])
    write_at(base / "mixed", [0.1, 0.2, 0.3])
    write_at(base / "few", [0.1, 0.1])
    ((_, _, zero),) = grounds(base / "zero", tmp_path / "0") or [("", 0, 0.0)]
    assert zero == 0.0
    ((folder, clips, height),) = grounds(base, tmp_path / "all")
    assert (folder, clips) == (str(base / "high"), 3)
    assert height == pytest.approx(0.1025, abs=0.005)
    ((folder, clips, height),) = grounds(base / "high", tmp_path / "high")
    assert (folder, clips) == ("", 3)
    options = dynacom.AnalysisOptions()
    options.detection.ground_height = 0.1
    assert grounds(base / "high", tmp_path / "told", options=options) == []


def test_a_folder_that_is_tilted(tmp_path):
    folder = tmp_path / "tilted"
    folder.mkdir()
    tilt = np.radians(2.9)
    with np.load(WALKS / "talos_walk.npz") as file:
        time, q = file["t"][:200], file["q"][:200]
    for number in range(3):
        turn = pin.SE3(pin.rpy.rpyToMatrix(0.0, tilt, 0.0), np.array([0.0, 0.0, 0.01 * number]))
        tilted = q.copy()
        for row in tilted:
            row[:7] = pin.SE3ToXYZQUAT(turn * pin.XYZQUATToSE3(row[:7]))
        np.savez(folder / f"{number}.npz", t=time, q=tilted)
    table = dynacom.batch(folder, "talos", out=tmp_path / "out")
    # A turn about y by the angle lowers what is in front.
    np.testing.assert_allclose(table["slope_x"].to_numpy(), -np.tan(tilt), atol=2e-3)
    np.testing.assert_allclose(table["slope_y"].to_numpy(), 0.0, atol=2e-3)
    (ground,) = overview(tmp_path / "out" / "clips.parquet").grounds
    assert ground.text() in (tmp_path / "out" / "index.html").read_text()
    assert ground.text().startswith(
        "The ground of all 3 clips whose ground is known is a slope of 2.9 degrees, which rises "
        "towards 180 degrees"
    )
    # A level one among them, and there is no common one.
    np.savez(folder / "3.npz", t=time, q=q)
    table = dynacom.batch(folder, "talos", out=tmp_path / "more")
    assert table["slope_x"].to_pylist()[3] == 0.0
    assert overview(tmp_path / "more" / "clips.parquet").grounds == []
