# SPDX-License-Identifier: BSD-2-Clause
import contextlib
import csv
import json
import os
import pickle
import pty
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pandas
import pyarrow.parquet
import pytest

import dynacom
from dynacom import cli


@pytest.fixture
def command(monkeypatch, capfd):
    """Runs the command in this process: status, stdout, stderr."""

    def command(*arguments):
        monkeypatch.setattr(sys, "argv", ["dynacom", *map(str, arguments)])
        monkeypatch.setenv("COLUMNS", "120")
        status = 0
        try:
            cli.main()
        except SystemExit as exit:
            status = exit.code or 0
        return status, *capfd.readouterr()

    return command


@pytest.fixture
def refuses(command):
    """Expects status 2, and one line on stderr that holds all parts."""

    def refuses(*arguments, parts):
        status, out, err = command(*arguments)
        assert status == 2
        assert out == ""
        assert re.fullmatch(r"dynacom: [^\n]+\n", err)
        for part in parts:
            assert str(part) in err

    return refuses


def read_csv(path):
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    return {name: list(column) for name, *column in zip(*rows, strict=True)}


# Without a motion.


def test_version(run, root):
    done = run("--version")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"dynacom {dynacom.__version__}\n"
    assert f'\nversion = "{dynacom.__version__}"\n' in (root / "pyproject.toml").read_text()


def test_version_waits_for_nothing_that_it_does_not_need():
    code = "import sys; from dynacom import cli; sys.exit('rich.table' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_robots(command):
    status, out, err = command("robots")
    assert (status, err) == (0, "")
    for text in (
        "talos",
        "talos_data/robots/talos_reduced.urdf",
        "left_sole (6d)",
        "right_sole (6d)",
        "anymal_c",
        "anymal_c_simple_description/urdf/anymal.urdf",
        *(f"{leg}_FOOT (point)" for leg in ("LF", "RF", "LH", "RH")),
    ):
        assert text in out


def test_help(command):
    status, out, _ = command("analyze", "--help")
    assert status == 0
    assert "[rad/s]" in out
    for option in (
        *("--robot", "--urdf", "--contact", "--payload", "--fps", "--quat", "--trust", "--clip"),
        *("--schedule", "--cutoff", "--ground-height", "--flat", "--uneven", "--omega"),
        *("--settings", "--set", "--out", "--csv", "--page", "--no-page", "--check"),
    ):
        assert option in out


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["dance"],
        ["analyze"],
        ["analyze", "--bogus"],
        ["show"],
        ["show", "m.npz", "--port", "x"],
    ],
)
def test_usage_errors(command, arguments):
    status, _, err = command(*arguments)
    assert status == 2
    assert "Traceback" not in err


# What is written, and what is said.

FILES = ["frames.parquet", "schedule.yaml", "summary.json"]


@pytest.fixture
def analyze(command, tmp_path):
    """Analyses a motion, which must succeed: the folder of results, and what was printed."""

    def analyze(motion, *arguments, robot="talos", files=FILES):
        out = tmp_path / "out"
        status, printed, err = command(
            "analyze", motion, "--robot", robot, "--out", out, "--no-page", *arguments
        )
        assert (status, err) == (0, "")
        assert sorted(os.listdir(out)) == files
        return out, printed

    return analyze


def summary_of(folder):
    return json.loads((folder / "summary.json").read_text())


def test_what_is_written_is_the_report(analyze, motion_file, talos):
    path = motion_file()
    out, printed = analyze(path, "--csv", files=["frames.csv", *FILES])
    report = dynacom.analyze(path, talos)
    assert summary_of(out) == report.summary
    table = pyarrow.parquet.read_table(out / "frames.parquet")
    cells = read_csv(out / "frames.csv")
    assert table.column_names == list(report.columns()) == list(cells)
    for name in ("ground_force_z", "contact.right_sole.torque_x"):
        np.testing.assert_array_equal(table[name], report.columns()[name][0])
        np.testing.assert_array_equal(np.array(cells[name], dtype=float), table[name])
    assert [line for line in printed.splitlines() if line.startswith("Wrote ")] == [
        f"Wrote {out / name}" for name in ["frames.csv", *FILES]
    ]


def test_the_page_is_written_unless_it_is_not_wanted(command, motion_file, tmp_path):
    status, printed, err = command(
        "analyze", motion_file(), "--robot", "talos", "--out", tmp_path / "out"
    )
    assert (status, err) == (0, "")
    assert f"Wrote {tmp_path / 'out' / 'report.html'}" in printed.splitlines()
    assert (tmp_path / "out" / "report.html").read_text("utf-8").startswith("<!DOCTYPE html>")


def test_a_folder_is_named_after_the_clip(command, motion_file, tmp_path, monkeypatch):
    path = motion_file("my.clip.npz")
    monkeypatch.chdir(tmp_path)
    assert command("analyze", path, "--robot", "talos", "--no-page")[0] == 0
    (folder,) = [entry for entry in tmp_path.iterdir() if entry.is_dir()]
    assert folder.name.startswith("my") and folder.name.endswith("-analysis")
    assert sorted(os.listdir(folder)) == FILES


def test_summary(analyze, motion_file, talos):
    out, printed = analyze(motion_file())
    text = re.sub(r"[│┃|]+", " ", printed)

    def row(title):
        return re.search(rf"{title} +(.*?) *$", text, flags=re.MULTILINE).group(1)

    assert row("Verdict") == "not feasible"
    assert row("Motion") == "0.780 s, 40 frames at 50 Hz"
    statuses = summary_of(out)["statuses"]
    assert set(statuses) == {"Solved", "Relaxed", "NoContact"}
    for status, count in statuses.items():
        assert row(status) == f"{count} ({count / 40:.1%})"
    assert row("Mass") == f"{talos.dynacom().getMass():.3f} kg"
    assert re.search(r"in 75\.0% of the frames\)", row("Weight on left_sole"))
    assert re.search(r"in 62\.5% of the frames\)", row("Weight on right_sole"))
    for reason in summary_of(out)["reasons"]:
        assert (reason["code"] in printed) == reason["holds"]


def test_names_that_look_like_markup(analyze, motion_file, tmp_path):
    robot = tmp_path / "odd.yaml"
    text = next(p for p in dynacom.robots.list_robots() if p.stem == "talos").read_text()
    name = 'left, "[b]sole"'
    robot.write_text(text.replace("left_sole\n", f"'{name}'\n"))
    path = motion_file(contact_names=np.array([name, "right_sole"]))
    _, printed = analyze(path, robot=robot)
    assert f"Weight on {name}" in printed


def test_check(command, motion_file, root, tmp_path):
    walk = root / "examples/data/talos_walk.npz"
    options = ("--robot", "talos", "--no-page", "--out", tmp_path / "out")
    assert command("analyze", walk, *options, "--check")[0] == 0
    status, printed, err = command("analyze", motion_file(), *options, "--check")
    assert (status, err) == (1, "")
    assert "not feasible" in printed
    assert command("analyze", motion_file(), *options)[0] == 0


# Options do what they say.


def test_settings(analyze, motion_file, tmp_path):
    file = tmp_path / "settings.yaml"
    file.write_text("omega: 2.0\nverdict: {foot_sliding: {limit: 0.7}, near_ground: 0.01}\n")
    out, _ = analyze(
        motion_file(),
        *("--settings", file, "--set", "verdict.foot_sliding.allowed_share=0.5"),
        *("--omega", "3.1", "--ground-height", "0.01", "--uneven"),
    )
    summary = summary_of(out)
    options = summary["options"]
    assert summary["omega"] == options["omega"] == 3.1
    assert options["verdict"]["foot_sliding"] == {"limit": 0.7, "allowed_share": 0.5}
    assert options["verdict"]["near_ground"] == 0.01
    assert options["detection"]["ground_height"] == 0.01
    assert options["flat"] is False
    assert set(summary["ground"].values()) == {0.01}


@pytest.mark.parametrize(("cutoff", "expected"), [("4", 4.0), ("0", None)])
def test_cutoff(analyze, motion_file, cutoff, expected):
    out, _ = analyze(motion_file(v=None, a=None), "--cutoff", cutoff)
    assert summary_of(out)["cutoff"] == expected


def test_schedule_corrected_by_hand(analyze, motion_file, tmp_path):
    schedule = tmp_path / "mine.yaml"
    schedule.write_text("left_sole: [[0.0, 0.2]]\n")
    out, _ = analyze(motion_file(), "--schedule", schedule)
    assert summary_of(out)["contacts"]["left_sole"]["active_share"] == 11 / 40
    assert summary_of(out)["contacts"]["right_sole"]["active_share"] == 0.0


def test_payload(analyze, motion_file, talos):
    out, _ = analyze(motion_file(), "--payload", "gripper_left_base_link:2@0.1,0,0")
    assert summary_of(out)["mass"] == pytest.approx(talos.dynacom().getMass() + 2.0)


def test_a_robot_without_a_file(command, motion_file, tmp_path):
    contacts = [
        part
        for side in ("left", "right")
        for part in (
            "--contact",
            f"leg_{side}_sole_fix_joint:6d:name={side}_sole,half_length=0.1,half_width=0.06,mu=0.7,"
            "gu=0.08",
        )
    ]
    urdf = "talos_data/robots/talos_reduced.urdf"
    status, _, err = command(
        *("analyze", motion_file(), "--urdf", urdf, *contacts, "--no-page"),
        *("--out", tmp_path / "out"),
    )
    assert (status, err) == (0, "")
    assert (
        command(
            *("analyze", motion_file(), "--robot", "talos", "--no-page", "--out", tmp_path / "same")
        )[0]
        == 0
    )
    one, other = (
        pyarrow.parquet.read_table(tmp_path / name / "frames.parquet") for name in ("out", "same")
    )
    pandas.testing.assert_frame_equal(one.to_pandas(), other.to_pandas())


# Bad input: one line, status 2, and no folder.


@pytest.fixture
def csv_file(tmp_path, talos_motion):
    """Writes the motion as CSV without a header, changed by a function."""

    def write(change=lambda q: q, name="motion.csv"):
        q = np.tile(talos_motion["q"][:1], (40, 1))
        path = tmp_path / name
        np.savetxt(path, change(q.copy()), delimiter=",")
        return path

    return write


def test_bad_robots(refuses, motion_file, tmp_path):
    path, out = motion_file(), tmp_path / "out"
    options = ("--out", out, "--no-page")
    refuses("analyze", path, *options, "--robot", "talso", parts=["talos", "'talso'"])
    missing = tmp_path / "none.yaml"
    refuses("analyze", path, *options, "--robot", missing, parts=[missing, "No such file"])
    bad = tmp_path / "bad.yaml"
    bad.write_text("urdf: 3\ncontacts: []\n")
    refuses("analyze", path, *options, "--robot", bad, parts=[bad, "urdf must be"])
    refuses("analyze", path, *options, parts=["--robot", "--urdf"])
    refuses("analyze", path, *options, "--robot", "talos", "--urdf", "r", parts=["--urdf"])
    refuses(
        *("analyze", path, *options, "--robot", "talos", "--contact", "a:point:mu=1"),
        parts=["--contact", "--urdf"],
    )
    refuses(
        *("analyze", path, *options, "--robot", "talos", "--payload", "heavy"),
        parts=["payload", "FRAME:MASS", "'heavy'"],
    )
    assert not out.exists()


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"q": None}, "'q'"),
        ({"t": np.zeros(40)}, "increase"),
        ({"t": np.r_[np.arange(20) / 50, np.arange(20) / 50 + 3.0]}, "hole"),
        ({"q": np.zeros((40, 7))}, "39"),
        ({"v": np.full((40, 38), np.nan)}, "finite"),
        ({"contact_names": np.array(["left_sole", "hand"])}, "'hand'"),
        ({"contacts": np.ones((39, 2), dtype=bool)}, "(39, 2)"),
    ],
)
def test_bad_motions(refuses, motion_file, tmp_path, changes, part):
    path, out = motion_file(**changes), tmp_path / "out"
    refuses("analyze", path, "--robot", "talos", "--out", out, "--no-page", parts=[path, part])
    assert not out.exists()


def turn_over(q):
    q[:, 3:7] = [1.0, 0.0, 0.0, 0.0]  # w first
    return q


def jump(q):
    q[20:, 0] += 2.0
    return q


def in_degrees(q):
    q[:, 7:] = np.degrees(q[:, 7:])
    return q


@pytest.mark.parametrize(
    ("change", "options", "parts"),
    [
        (lambda q: q, [], ["--fps"]),
        (lambda q: q, ["--fps", "0"], ["fps", "0"]),
        (lambda q: q[:, :-1], ["--fps", "50"], ["7 columns", "32", "talos", "38"]),
        (turn_over, ["--fps", "50"], ["wxyz"]),
        (jump, ["--fps", "50"], ["jumps by 2 m", "frame 19", "0.38 s"]),
        (in_degrees, ["--fps", "50"], ["degrees"]),
        (lambda q: q, ["--fps", "50", "--quat", "wzyx"], ["xyzw", "wzyx"]),
        (lambda q: q, ["--fps", "50", "--cutoff", "20"], ["cutoff", "20 Hz", "0.4"]),
        (lambda q: q, ["--fps", "50", "--schedule", "none.yaml"], ["none.yaml"]),
        (lambda q: q, ["--fps", "50", "--set", "verdict.luck=1"], ["luck", "residual_force"]),
        (lambda q: q, ["--fps", "50", "--omega", "-1"], ["omega", "-1"]),
        (lambda q: q, ["--fps", "50", "--ground-height", "inf"], ["ground_height", "inf"]),
    ],
)
def test_wrong_input(refuses, csv_file, tmp_path, change, options, parts):
    out = tmp_path / "out"
    arguments = ("analyze", csv_file(change), "--robot", "talos", "--out", out, "--no-page")
    refuses(*arguments, *options, parts=parts)
    assert not out.exists()


def test_pickles_run_no_code(refuses, tmp_path):
    class Bomb:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "boom"),)

    path = tmp_path / "motion.pkl"
    path.write_bytes(pickle.dumps({"fps": 30, "root_pos": Bomb()}))
    refuses("analyze", path, "--robot", "talos", "--no-page", parts=[path, "mkdir"])
    assert not (tmp_path / "boom").exists()


def test_unwritable_folders(refuses, motion_file, tmp_path):
    file = tmp_path / "file"
    file.write_text("mine")
    arguments = ("analyze", motion_file(), "--robot", "talos", "--no-page", "--out")
    refuses(*arguments, file, parts=[file, "exists"])
    refuses(*arguments, file / "out", parts=[file, "Not a directory"])
    assert file.read_text() == "mine"


def test_bad_urdf(run, motion_file, tmp_path):
    """In a process of its own, so that what libraries print is seen too."""
    robot = tmp_path / "robot.yaml"
    robot.write_text("{urdf: r.urdf, contacts: [{name: a, kind: point, frame: a, mu: 1}]}")
    (tmp_path / "r.urdf").write_text("<robot")
    done = run("analyze", motion_file(), "--robot", robot, "--out", tmp_path / "out")
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(r"dynacom: [^\n]*robot\.yaml: urdf: [^\n]*r\.urdf[^\n]*\n", done.stderr)


def test_no_traceback_in_a_process_of_its_own(run, tmp_path):
    done = run("analyze", tmp_path / "none.npz", "--robot", "talos", "--out", tmp_path / "out")
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(r"dynacom: [^\n]*none\.npz: cannot be read[^\n]*\n", done.stderr)


# Results appear whole or not at all.


def test_other_files_stay(command, motion_file, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "summary.json").write_text("old")
    arguments = ("analyze", motion_file(), "--robot", "talos", "--no-page", "--out", tmp_path)
    assert command(*arguments)[0] == 0
    assert sorted(os.listdir(tmp_path)) == sorted(["motion.npz", "notes.txt", *FILES])
    assert summary_of(tmp_path)["frames"] == 40


def test_interrupted_analysis_leaves_nothing(command, motion_file, tmp_path, monkeypatch):
    def interrupt(part):
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "_progress", lambda: contextlib.nullcontext(interrupt))
    out = tmp_path / "out"
    status, printed, err = command("analyze", motion_file(), "--robot", "talos", "--out", out)
    assert status not in (0, 2)
    assert printed == ""
    assert "Traceback" not in err
    assert not out.exists()


def test_ctrl_c_while_writing(tmp_path, talos_motion, motion_file):
    repeat = 1000
    arrays = {
        name: np.tile(talos_motion[name][:20], (repeat, 1)) for name in ("q", "v", "a", "contacts")
    }
    path = motion_file(t=np.arange(len(arrays["q"])) / 50, **arrays)
    out = tmp_path / "out"
    process = subprocess.Popen(
        [
            *(sys.executable, "-m", "dynacom", "analyze", path, "--robot", "talos", "--out", out),
            *("--csv", "--no-page"),
        ],
        stderr=subprocess.PIPE,
        text=True,
        # Where the tests run in the background of a shell, they and their children ignore it.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    deadline = time.monotonic() + 60
    while not out.exists() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.001)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode not in (0, 2), err
    assert "Traceback" not in err
    assert not out.exists()


# The progress bar.


def test_progress_on_a_terminal_only(motion_file, tmp_path, run):
    path = motion_file()
    out = str(tmp_path / "out")
    arguments = ["analyze", str(path), "--robot", "talos", "--out", out, "--no-page"]
    assert run(*arguments).stderr == ""

    terminal, process_end = pty.openpty()
    done = subprocess.run(
        [sys.executable, "-m", "dynacom", *arguments],
        stdout=subprocess.PIPE,
        stderr=process_end,
        env=os.environ | {"TERM": "xterm", "COLUMNS": "120"},
        timeout=120,
    )
    os.close(process_end)
    shown = os.read(terminal, 1 << 20).decode()
    os.close(terminal)
    assert done.returncode == 0
    assert "Analysing" in shown
    assert "100%" in shown
    assert re.search(r"\d:\d\d:\d\d", shown)  # left


# The bundled walks, and the viewer.


@pytest.mark.parametrize(
    ("walk", "robot", "status"),
    [
        ("talos_walk", "talos", {"Solved": 318}),
        ("anymal_walk", "anymal_c", {"Solved": 381}),
        ("anymal_trot", "anymal_c", {"Solved": 74, "Relaxed": 120}),
    ],
)
def test_bundled_walks(analyze, root, walk, robot, status):
    """From rest to rest: on average the ground bears the weight."""
    out, printed = analyze(root / "examples" / "data" / f"{walk}.npz", robot=robot)
    summary = summary_of(out)
    assert summary["statuses"] == status
    assert summary["codes"] == ["feasible"]
    assert summary["mean_vertical_force"] == pytest.approx(1.0, rel=0.01)
    shares = sum(contact["weight_share"] for contact in summary["contacts"].values())
    assert shares == pytest.approx(summary["mean_vertical_force"], rel=1e-3)


def test_show(command, motion_file, monkeypatch):
    from dynacom import scene

    shown = []

    def show(robot, q, arrays, summary, *, announce, port):
        shown.append((robot.name, len(q), len(arrays["time"]), summary["frames"], port))
        announce("http://localhost:1234")

    monkeypatch.setattr(scene, "show", show)
    status, out, err = command("show", motion_file(), "--robot", "talos", "--port", "1234")
    assert (status, err) == (0, "")
    assert shown == [("talos", 40, 40, 40, 1234)]
    assert "http://localhost:1234" in out
