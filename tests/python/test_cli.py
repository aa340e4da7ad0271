# SPDX-License-Identifier: BSD-2-Clause
import contextlib
import csv
import os
import pty
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import dynacom
from dynacom import cli, report


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


def numbers(table, *names):
    return np.array([[float(value) for value in table[name]] for name in names]).T


def documented_columns(root, contacts):
    """The names in docs/columns.md, in its order."""
    text = (root / "docs" / "columns.md").read_text()
    cells = re.findall(r"^\| (`.*?`) \|", text, flags=re.MULTILINE)
    names = [name for cell in cells for name in re.findall(r"`([^`]+)`", cell)]
    per_contact = [name for name in names if "<name>" in name]
    frame = [name for name in names if name not in per_contact]
    assert names == frame + per_contact
    return frame + [name.replace("<name>", c) for c in contacts for name in per_contact]


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
    for option in ("--robot", "--out", "--flat", "--uneven", "--omega", "--ground-height"):
        assert option in out


@pytest.mark.parametrize(
    "arguments",
    [[], ["dance"], ["analyze"], ["analyze", "m.npz", "--out", "d"], ["analyze", "--bogus"]],
)
def test_usage_errors(command, arguments):
    status, _, err = command(*arguments)
    assert status == 2
    assert "Traceback" not in err


# frames.csv.


@pytest.fixture
def analyze(command, tmp_path):
    """Analyses a motion, which must succeed: the columns of frames.csv, and what was printed."""

    def analyze(motion, *arguments, robot="talos"):
        out = tmp_path / "out"
        status, printed, err = command(
            "analyze", motion, "--robot", robot, "--out", out, *arguments
        )
        assert (status, err) == (0, "")
        assert os.listdir(out) == ["frames.csv"]
        return read_csv(out / "frames.csv"), printed

    return analyze


def test_columns_are_those_documented(analyze, motion_file, root):
    table, _ = analyze(motion_file())
    assert list(table) == documented_columns(root, ["left_sole", "right_sole"])
    assert len(table) == 29 + 2 * 7


@pytest.mark.parametrize("flat", [True, False])
def test_values_are_those_of_each_frame(analyze, motion_file, talos, talos_motion, flat):
    """Every cell, against DynaCoM's own methods, called frame by frame."""
    arguments = ["--omega", "3.1", "--ground-height", "0.01", "--flat" if flat else "--uneven"]
    table, _ = analyze(motion_file(), *arguments)

    columns = {name: [] for name in table}

    def add(name, values, axes="xyz"):
        for axis, value in zip(axes, values, strict=True):
            columns[f"{name}_{axis}"].append(value)

    statuses = []
    for k, t in enumerate(talos_motion["t"]):
        active = dict(zip(talos_motion["contact_names"], talos_motion["contacts"][k], strict=True))
        robot = talos.dynacom(inactive=[name for name in active if not active[name]])
        robot.setGroundHeight(0.01)
        q, v, a = (talos_motion[name][k] for name in "qva")
        robot.computeNL(3.1, q, v, a, flatHorizontalGround=flat)
        force, torque = robot.getGroundCoMForce(), robot.getGroundCoMTorque()
        statuses.append(str(robot.distributeForce(force, torque, robot.getCoM())))
        columns["time"].append(t)
        add("com", robot.getCoM())
        add("vcom", robot.getVCoM())
        add("acom", robot.getACoM())
        add("am", robot.getAM())
        add("dam", robot.getAMVariation())
        add("ground_force", force)
        add("ground_torque", torque)
        add("cop", robot.getCoP(), "xy")
        add("vrp", robot.getVRP(), "xy")
        add("nl", robot.getNL(), "xy")
        for name in active:
            contact = robot.getContact(name)
            columns[f"contact.{name}.active"].append(float(active[name]))
            add(f"contact.{name}.force", contact.appliedForce()[:3])
            add(f"contact.{name}.torque", contact.appliedForce()[3:])

    assert table["status"] == statuses
    assert set(statuses) == {"Solved", "Relaxed", "NoContact"}
    del columns["status"]
    for name, values in columns.items():
        # The order of activation may differ, and the solver's rounding with it.
        tolerance = 1e-6 if name.startswith("contact") or not flat else 0.0
        np.testing.assert_allclose(
            numbers(table, name)[:, 0], values, rtol=tolerance, atol=tolerance, err_msg=name
        )


def test_numbers_read_back_exactly(analyze, motion_file, talos):
    path = motion_file()
    table, _ = analyze(path)
    clip = dynacom.read_motion(path, talos)
    motion, schedule = dynacom.Motion(clip.time, clip.q, clip.v, clip.a), clip.schedule
    analysis = dynacom.analyzeMotion(talos.dynacom(), motion, schedule)
    names = [f"ground_force_{axis}" for axis in "xyz"]
    np.testing.assert_array_equal(numbers(table, *names), analysis.ground_force)
    names = [f"contact.right_sole.torque_{axis}" for axis in "xyz"]
    np.testing.assert_array_equal(numbers(table, *names), analysis.contacts[1].wrench[:, 3:])


def test_nan_where_there_is_no_number(analyze, motion_file, talos_motion):
    """The last frame is free fall, in which nothing presses anywhere."""
    table, _ = analyze(motion_file())
    for name in ("cop_x", "cop_y", "nl_x", "nl_y"):
        assert table[name][-1] == "nan"
        assert "nan" not in table[name][:-1]
    assert "nan" not in table["vrp_x"]
    assert float(table["ground_force_z"][-1]) == pytest.approx(0.0, abs=1e-9)


def test_points_have_no_torque(analyze, motion_file, anymal, anymal_standing):
    frames = 3
    zeros = np.zeros((frames, anymal.model.nv))
    path = motion_file(
        t=np.arange(frames),
        q=np.tile(anymal_standing, (frames, 1)),
        v=zeros,
        a=zeros,
        contacts=np.ones((frames, 4), dtype=bool),
        contact_names=np.array(["RH_FOOT", "LH_FOOT", "RF_FOOT", "LF_FOOT"]),
    )
    table, _ = analyze(path, robot="anymal_c")
    feet = [name.split(".")[1] for name in table if name.endswith(".active")]
    assert feet == list(anymal.contacts)
    assert set(table["status"]) == {"Solved"}
    for foot in feet:
        assert numbers(table, f"contact.{foot}.force_z").min() > 100.0
        assert not numbers(table, *(f"contact.{foot}.torque_{axis}" for axis in "xyz")).any()


def test_a_single_frame(analyze, motion_file, talos_motion, talos):
    first = {name: talos_motion[name][:1] for name in ("t", "q", "v", "a", "contacts")}
    table, _ = analyze(motion_file(**first))
    assert table["status"] == ["Solved"]
    borne = float(table["contact.left_sole.force_z"][0]) + float(
        table["contact.right_sole.force_z"][0]
    )
    assert borne == pytest.approx(9.81 * talos.dynacom().getMass(), rel=0.05)


def test_contacts_without_schedule_stay_inactive(analyze, motion_file, talos_motion):
    path = motion_file(
        contacts=talos_motion["contacts"][:, :1], contact_names=np.array(["left_sole"])
    )
    table, _ = analyze(path)
    assert set(table["contact.right_sole.active"]) == {"0"}


def test_omega_of_the_mean_height_by_default(analyze, motion_file):
    table, _ = analyze(motion_file(), "--ground-height", "0.1")
    com, acom = numbers(table, "com_x", "com_y"), numbers(table, "acom_x", "acom_y")
    omega2 = 9.81 / (numbers(table, "com_z").mean() - 0.1)
    np.testing.assert_allclose(numbers(table, "vrp_x", "vrp_y"), com - acom / omega2, rtol=1e-12)


def test_names_that_csv_must_quote(analyze, motion_file, tmp_path):
    robot = tmp_path / "odd.yaml"
    text = next(p for p in dynacom.robots.list_robots() if p.stem == "talos").read_text()
    name = 'left, "[b]sole"'
    robot.write_text(text.replace("left_sole\n", f"'{name}'\n"))
    path = motion_file(contact_names=np.array([name, "right_sole"]))
    table, printed = analyze(path, robot=robot)
    assert f"contact.{name}.force_z" in table
    assert f"Weight on {name}" in printed


# The summary.


def test_summary(analyze, motion_file, talos, talos_motion):
    _, printed = analyze(motion_file())
    text = re.sub(r"[│┃|]+", " ", printed)

    def row(title):
        return re.search(rf"{title} +(.*?) *$", text, flags=re.MULTILINE).group(1)

    assert row("Duration") == "0.780 s"
    assert row("Frames") == "40"
    # The foot that it stands on is not below its centre of mass; a free fall asks for nothing.
    assert row("Solved") == "26 (65.0%)"
    assert row("Relaxed") == "5 (12.5%)"
    assert row("NoContact") == "9 (22.5%)"
    assert row("Mass") == f"{talos.dynacom().getMass():.3f} kg"
    assert re.fullmatch(r"\S+ N at 0\.\d{3} s", row("Largest residual"))
    assert re.fullmatch(r"-?0\.\d{4} to -?0\.\d{4} m", row("CoP range, x"))
    assert re.search(r"in 75\.0% of the frames\)", row("Weight on left_sole"))
    assert re.search(r"in 62\.5% of the frames\)", row("Weight on right_sole"))
    assert re.search(r"^Wrote .*out/frames\.csv$", printed, flags=re.MULTILINE)


class Fake:
    """Stands for an analysis with round numbers."""

    class Contact:
        def __init__(self, name, active, vertical_force):
            self.name = name
            self.active = np.array(active, dtype=bool)
            self.vertical_force = np.array(vertical_force, dtype=float)

    time = np.array([1.0, 1.5, 2.0, 3.0])
    status = [
        dynacom.DistributionStatus.Solved,
        dynacom.DistributionStatus.Relaxed,
        dynacom.DistributionStatus.Solved,
        dynacom.DistributionStatus.NoContact,
    ]
    residual = np.array(
        [[0, 0, 0, 0, 0, 0], [3, 4, 0, 0, 0, 1], [0, 0, 0, 0, 0, 0], [0, 0, 1, 0, 3, 4]],
        dtype=float,
    )
    cop = np.array([[0.1, -0.2], [np.nan, np.nan], [-0.3, 0.4], [0.0, 0.0]])
    contacts = [
        Contact("a", [1, 1, 0, 0], [100, 50, 0, 0]),
        Contact("b", [0, 0, 0, 0], [0, 0, 0, 0]),
    ]


def test_summary_by_hand():
    summary = report.summarize(Fake(), mass=10.0, gravity=10.0)
    assert summary.frames == 4
    assert summary.duration == 2.0
    assert summary.statuses == {"Solved": 2, "Relaxed": 1, "NoContact": 1}
    assert summary.residual_force == report.Peak(5.0, 1.5)
    assert summary.residual_torque == report.Peak(5.0, 3.0)
    np.testing.assert_array_equal(summary.cop_range, [[-0.3, 0.1], [-0.2, 0.4]])
    assert summary.shares[0] == report.ContactShare("a", 0.375, 0.75, 0.5)
    assert summary.shares[1].overall == 0.0
    assert np.isnan(summary.shares[1].while_active)


def test_summary_of_nothing():
    """Nowhere a CoP, no gravity: NaN, and no warnings or errors."""
    fake = Fake()
    fake.cop = np.full((4, 2), np.nan)
    fake.residual = np.full((4, 6), np.nan)
    summary = report.summarize(fake, mass=10.0, gravity=0.0)
    assert np.isnan(summary.cop_range).all()
    assert np.isnan(summary.residual_force.value)
    assert np.isnan(summary.shares[0].overall)
    report.summary_table(summary)


# Bad input.


def test_bad_robots(refuses, motion_file, tmp_path):
    path, out = motion_file(), tmp_path / "out"
    options = ("--out", out, "--robot")
    refuses("analyze", path, *options, "talso", parts=["talos", "'talso'"])
    missing = tmp_path / "none.yaml"
    refuses("analyze", path, *options, missing, parts=[missing, "No such file"])
    bad = tmp_path / "bad.yaml"
    bad.write_text("urdf: 3\ncontacts: []\n")
    refuses("analyze", path, *options, bad, parts=[bad, "urdf must be"])
    assert not out.exists()


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"q": None}, "missing array 'q'"),
        (
            {"contacts": None, "contact_names": None},
            "missing arrays 'contacts' and 'contact_names'",
        ),
        ({"t": np.zeros(40)}, "time must increase"),
        ({"q": np.zeros((40, 7))}, "q must have 39"),
        ({"v": np.full((40, 38), np.nan)}, "v must be finite"),
        ({"contact_names": np.array(["left_sole", "hand"])}, "'hand'"),
        ({"contacts": np.ones((39, 2), dtype=bool)}, "got (39, 2)"),
    ],
)
def test_bad_motions(refuses, motion_file, tmp_path, changes, part):
    path, out = motion_file(**changes), tmp_path / "out"
    refuses("analyze", path, "--robot", "talos", "--out", out, parts=[path, part])
    assert not out.exists()


@pytest.mark.parametrize(
    ("option", "value", "part"),
    [
        ("--omega", "-1", "omega must be"),
        ("--omega", "nan", "omega must be"),
        ("--ground-height", "inf", "groundHeight must be finite"),
    ],
)
def test_bad_settings(refuses, motion_file, tmp_path, option, value, part):
    out = tmp_path / "out"
    arguments = ("analyze", motion_file(), "--robot", "talos", "--out", out)
    refuses(*arguments, option, value, parts=[part])


def test_unwritable_folders(refuses, motion_file, tmp_path):
    file = tmp_path / "file"
    file.write_text("mine")
    arguments = ("analyze", motion_file(), "--robot", "talos", "--out")
    refuses(*arguments, file, parts=[file, "exists"])
    refuses(*arguments, file / "out", parts=[file, "Not a directory"])
    if os.geteuid() != 0:
        locked = tmp_path / "locked"
        locked.mkdir(mode=0o500)
        refuses(*arguments, locked, parts=[locked, "Permission denied"])
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


def test_existing_folder(analyze, motion_file, tmp_path, command):
    out = tmp_path / "out"
    out.mkdir()
    (out / "frames.csv").write_text("old")
    table, _ = analyze(motion_file())
    assert len(table["time"]) == 40


def test_other_files_stay(command, motion_file, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    status, _, _ = command("analyze", motion_file(), "--robot", "talos", "--out", tmp_path)
    assert status == 0
    assert sorted(os.listdir(tmp_path)) == ["frames.csv", "motion.npz", "notes.txt"]


def test_nested_folders_are_made(command, motion_file, tmp_path):
    out = tmp_path / "a" / "b"
    assert command("analyze", motion_file(), "--robot", "talos", "--out", out)[0] == 0
    assert (out / "frames.csv").exists()
    umask = os.umask(0)
    os.umask(umask)
    assert (out / "frames.csv").stat().st_mode & 0o777 == 0o666 & ~umask


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError(28, "No space left on device")])
@pytest.mark.parametrize("existed", [True, False])
def test_interrupted_writing_leaves_everything_as_it_was(tmp_path, error, existed):
    out = tmp_path / "out"
    if existed:
        out.mkdir()
        (out / "frames.csv").write_text("old")
    with (
        pytest.raises(error if isinstance(error, type) else OSError),
        report.results_folder(out) as folder,
    ):
        (folder / "frames.csv").write_text("half")
        raise error
    assert out.exists() == existed
    if existed:
        assert os.listdir(out) == ["frames.csv"]
        assert (out / "frames.csv").read_text() == "old"


def test_interrupted_analysis_leaves_nothing(command, motion_file, tmp_path, monkeypatch):
    def interrupt(done):
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "_progress", lambda total: contextlib.nullcontext(interrupt))
    out = tmp_path / "out"
    status, printed, err = command("analyze", motion_file(), "--robot", "talos", "--out", out)
    assert status not in (0, 2)
    assert printed == ""
    assert "Traceback" not in err
    assert not out.exists()


def test_ctrl_c_while_writing(tmp_path, talos_motion, motion_file):
    repeat = 2000
    arrays = {
        name: np.tile(talos_motion[name], (repeat, 1)) for name in ("q", "v", "a", "contacts")
    }
    path = motion_file(t=np.arange(len(arrays["q"])), **arrays)
    out = tmp_path / "out"
    process = subprocess.Popen(
        [sys.executable, "-m", "dynacom", "analyze", path, "--robot", "talos", "--out", out],
        stderr=subprocess.PIPE,
        text=True,
        # Where the tests run in the background of a shell, they and their children ignore it.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    deadline = time.monotonic() + 60
    while not out.exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode not in (0, 2)
    assert "Traceback" not in err
    assert not out.exists()


# The progress bar.


def test_progress_on_a_terminal_only(motion_file, tmp_path, run):
    path = motion_file()
    arguments = ["analyze", str(path), "--robot", "talos", "--out", str(tmp_path / "out")]
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
    assert "40/40" in shown
    assert "frames/s" in shown


# The bundled walks.


@pytest.mark.parametrize(("walk", "robot"), [("talos_walk", "talos"), ("anymal_walk", "anymal_c")])
def test_bundled_walks(analyze, root, walk, robot):
    """From rest to rest: on average the ground bears the weight, and all contacts together do."""
    path = root / "examples" / "data" / f"{walk}.npz"
    table, _ = analyze(path, robot=robot)
    subject = dynacom.load_robot(robot)
    clip = dynacom.read_motion(path, subject)
    motion, schedule = dynacom.Motion(clip.time, clip.q, clip.v, clip.a), clip.schedule
    assert len(table["time"]) == motion.frames
    weight = 9.81 * subject.dynacom().getMass()
    assert numbers(table, "ground_force_z").mean() == pytest.approx(weight, rel=0.01)

    # They were planned within these cones.
    assert set(table["status"]) == {"Solved"}
    active = numbers(table, *(f"contact.{name}.active" for name in schedule.names))
    np.testing.assert_array_equal(active, schedule.active)

    # What each contact bears, in the world, adds up to what the ground must give.
    analysis = dynacom.analyzeMotion(subject.dynacom(), motion, schedule)
    borne = sum(contact.vertical_force for contact in analysis.contacts)
    np.testing.assert_allclose(borne, analysis.ground_force[:, 2], rtol=1e-6)
    summary = report.summarize(analysis, weight / 9.81, 9.81)
    shares = sum(share.overall for share in summary.shares)
    assert shares == pytest.approx(1.0, abs=0.01)
