# SPDX-License-Identifier: BSD-2-Clause
import contextlib
import csv
import json
import os
import pty
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pyarrow.parquet
import pytest

import dynacom
from dynacom import cli
from dynacom.motion_joints import urdf_order
from dynacom.summary import summary_table
from helpers import WALKS, documented_columns, robots_folder
from motion_files import sway, write_columns, write_csv

WALK = WALKS / "talos_walk.npz"
FILES = ["frames.parquet", "schedule.yaml", "summary.json"]


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
        assert status == 2, (out, err)
        assert out == ""
        assert re.fullmatch(r"dynacom: [^\n]+\n", err)
        for part in parts:
            assert str(part) in err

    return refuses


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
        *(
            "--schedule",
            "--cutoff",
            "--ground-height",
            "--friction",
            "--flat",
            "--uneven",
            "--omega",
        ),
        *("--settings", "--set", "--out", "--csv", "--page", "--no-page", "--check"),
        *("--distance", "--no-distance", "--preset"),
    ):
        assert option in out
    status, out, _ = command("repair", "--help")
    assert status == 0
    for option in (
        *(
            "--robot",
            "--schedule",
            "--set",
            "--out",
            "--csv",
            "--page",
            "--check",
            "--balance-only",
        ),
        *("--strict", "--stretch", "--export-contacts"),
    ):
        assert option in out


@pytest.mark.parametrize(
    "arguments",
    [[], ["dance"], ["analyze"], ["repair"], ["show"], ["analyze", "m.npz", "--bogus"]],
)
def test_usage_errors(command, arguments):
    status, _, err = command(*arguments)
    assert status == 2
    assert "Traceback" not in err


# Results.


@pytest.fixture
def analyze(command, tmp_path):
    """Analyses a motion, which must succeed: the folder, and what was printed."""

    def analyze(motion, *arguments, robot="talos"):
        out = tmp_path / "out"
        status, printed, err = command(
            "analyze", motion, "--robot", robot, "--no-page", "--out", out, *arguments
        )
        assert (status, err) == (0, "")
        return out, printed

    return analyze


def summary(out):
    return json.loads((out / "summary.json").read_text(encoding="utf-8"))


def cells(printed):
    """The table's rows: its two columns, the lines of a cell joined."""
    rows = []
    for line in printed.splitlines():
        if line.startswith("│"):
            left, right = (cell.strip() for cell in line.strip("│").split("│"))
            if left:
                rows.append([left, right])
            else:
                rows[-1][1] += f" {right}"
    return [tuple(row) for row in rows]


def test_files_are_those_of_the_report(analyze, talos, tmp_path):
    """The command is dynacom.analyze and save, and no more."""
    out, printed = analyze(WALK)
    report = dynacom.analyze(WALK, talos)
    report.save(tmp_path / "expected", page=False)
    assert sorted(os.listdir(out)) == FILES
    for name in FILES:
        assert (out / name).read_bytes() == (tmp_path / "expected" / name).read_bytes()
    for name in FILES:
        assert f"\nWrote {out / name}\n" in printed


def test_csv_when_asked_for(analyze, root, talos):
    out, printed = analyze(WALK, "--csv")
    assert sorted(os.listdir(out)) == ["frames.csv", *FILES]
    assert f"Wrote {out / 'frames.csv'}\n" in printed
    with (out / "frames.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header == list(documented_columns(root, talos.contacts))
    assert len(rows) == 318
    table = pyarrow.parquet.read_table(out / "frames.parquet")
    assert table.column_names == header
    np.testing.assert_array_equal(table["com_x"], [float(row[1]) for row in rows])


def test_the_folder_by_default(command, tmp_path, monkeypatch, motion_file):
    """Beside where one is, named after the clip; clips of other names do not share it."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    for name, folder in (
        ("walk.npz", "walk-analysis"),
        ("walk.2.npz", "walk.2-analysis"),
        (".walk.npz", ".walk-analysis"),
    ):
        path = motion_file(name)
        status, _, _ = command("analyze", path, "--robot", "talos", "--no-page")
        assert status == 0
        assert sorted(os.listdir(folder)) == FILES
    assert len(os.listdir()) == 3


def test_the_suffix_of_packed_files_is_left_out(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    robot = dynacom.load_robot("g1")
    write_csv(tmp_path / "a.clip.csv.gz", sway(robot, 10).table)
    arguments = ("--robot", "g1", "--fps", "60", "--no-page")
    assert command("analyze", "a.clip.csv.gz", *arguments)[0] == 0
    assert sorted(os.listdir()) == ["a.clip-analysis", "a.clip.csv.gz"]


def test_other_files_stay(command, motion_file, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "summary.json").write_text("old")
    arguments = ("--robot", "talos", "--no-page", "--out", tmp_path)
    assert command("analyze", motion_file(), *arguments)[0] == 0
    assert sorted(os.listdir(tmp_path)) == sorted([*FILES, "motion.npz", "notes.txt"])
    assert summary(tmp_path)["frames"] == 40


@pytest.mark.parametrize("name", ["talos_walk", "anymal_walk", "anymal_trot"])
def test_bundled_motions_are_feasible(analyze, name):
    """From rest to rest: on average the ground bears the weight, and all contacts together do."""
    robot = "talos" if name == "talos_walk" else "anymal_c"
    out, printed = analyze(WALKS / f"{name}.npz", "--check", robot=robot)
    found = summary(out)
    assert found["verdict"] == "feasible"
    assert found["mean_vertical_force"] == pytest.approx(1.0, abs=0.01)
    shares = [contact["weight_share"] for contact in found["contacts"].values()]
    assert sum(shares) == pytest.approx(1.0, abs=0.01)
    assert ("Verdict", "feasible") in cells(printed)


# The exit status.


def test_check(command, tmp_path):
    """1 is for a verdict that is not feasible, and only where it is asked for."""
    arguments = ["analyze", WALK, "--robot", "talos", "--no-page", "--out", tmp_path]
    assert command(*arguments, "--check")[0] == 0
    strict = [*arguments, "--set", "verdict.foot_sliding.limit=1e-5"]
    assert command(*strict)[0] == 0
    status, printed, err = command(*strict, "--check")
    assert (status, err) == (1, "")
    assert ("Verdict", "repairable") in cells(printed)
    assert sorted(os.listdir(tmp_path)) == FILES
    assert summary(tmp_path)["codes"] == ["foot_sliding"]


def test_check_of_what_is_repairable(command, tmp_path):
    """The walk is feasible but for the limit; no displacement at all mends that."""
    limit = ["--set", "verdict.foot_sliding.limit=1e-5"]
    arguments = ["analyze", WALK, "--robot", "talos", "--no-page", "--out", tmp_path]
    status, printed, _ = command(*arguments, *limit)
    assert status == 0
    assert cells(printed)[0] == ("Verdict", "repairable")
    # The option's value may be left out, and what follows is not taken for it.
    for check, expected in (
        (["--check"], 1),
        (["--check", "feasible"], 1),
        (["--check=feasible"], 1),
        (["--check", "repairable"], 0),
        (["--check=repairable"], 0),
    ):
        assert command("analyze", *check, *arguments[1:], *limit)[0] == expected
        assert command(*arguments, *limit, *check)[0] == expected
    assert command(*arguments, "--check", "repairable")[0] == 0
    assert command(*arguments, *limit, "--no-distance", "--check", "repairable")[0] == 1
    status, _, err = command(*arguments, "--check=possible")
    assert (status, err) == (2, "dynacom: check must be feasible or repairable, got 'possible'\n")


def test_the_distance_is_printed(analyze, shared_data):
    """Who leans too far is told by how much; whoever does not ask is told nothing."""
    path = shared_data / "cases" / "lean_05cm.npz"
    if not path.exists():
        pytest.skip("there are no cases")
    out, printed = analyze(path)
    found = summary(out)["distance"]
    rms, largest = (f"{1e3 * found[name]:.0f} mm" for name in ("rms", "largest"))
    assert cells(printed)[:2] == [
        ("Verdict", "not feasible"),
        (
            "Distance",
            f"{rms} from a feasible motion (RMS; {largest} at most, at {found['time']:.2f} s)",
        ),
    ]
    table = pyarrow.parquet.read_table(out / "frames.parquet")
    assert max(table["distance"].to_pylist()) == found["largest"]

    out, printed = analyze(path, "--no-distance")
    assert summary(out)["distance"] is None
    assert summary(out)["options"]["distance"] is False
    assert "Distance" not in dict(cells(printed))
    again = pyarrow.parquet.read_table(out / "frames.parquet")
    assert again.column_names == table.column_names
    assert np.isnan(again["distance"]).all()
    assert np.isnan(again["feasible_com_z"]).all()
    assert again["com_x"].equals(table["com_x"])


def test_presets(analyze, command, tmp_path):
    """They come before what settings say."""
    out, _ = analyze(WALK, "--preset", "hicks", "--set", "verdict.residual_torque.limit=0.5")
    verdict = summary(out)["options"]["verdict"]
    assert verdict["residual_force"] == {"limit": 0.05, "allowed_share": 0.0}
    assert verdict["residual_torque"] == {"limit": 0.5, "allowed_share": 0.0}
    arguments = ("analyze", WALK, "--robot", "talos", "--out", tmp_path / "other")
    status, _, err = command(*arguments, "--preset", "lax")
    assert status == 2
    assert err == "dynacom: unknown preset 'lax', expected hicks, opensim, strict\n"


def test_check_of_what_is_unknown(command, tmp_path, clip):
    """Three frames are not feasible either."""
    path = write_csv(tmp_path / "clip.csv", clip.table[:3])
    out = tmp_path / "out"
    arguments = ["analyze", path, "--robot", "g1", "--fps", 60, "--no-page", "--out", out]
    assert command(*arguments)[0] == 0
    status, printed, err = command(*arguments, "--check")
    assert (status, err) == (1, "")
    rows = cells(printed)
    assert rows[:2] == [
        ("Verdict", "unknown"),
        ("too_short", "there are too few frames whose accelerations are known"),
    ]
    assert summary(out)["codes"] == ["too_short"]


def test_windows_are_printed(command, tmp_path):
    """The clip's jump parts them."""
    with np.load(WALK) as file:
        arrays = {name: file[name] for name in ("t", "q", "contacts", "contact_names")}
    arrays["q"][159, 0] += 1.0
    np.savez(tmp_path / "clip.npz", **arrays)
    out = tmp_path / "out"
    arguments = ["analyze", tmp_path / "clip.npz", "--robot", "talos", "--no-page", "--out", out]
    printed = command(*arguments)[1]
    (first, second), share = summary(out)["windows"], summary(out)["feasible_share"]
    assert first[1] < 158 * 0.02 < 160 * 0.02 < second[0]
    assert dict(cells(printed))["Without fault"] == (
        f"{share:.1%} of the frames: {first[0]:.2f} to {first[1]:.2f} s, "
        f"{second[0]:.2f} to {second[1]:.2f} s"
    )


# Options.


def test_schedules(analyze, tmp_path):
    """That which was found is written, may be corrected, and is read again."""
    with np.load(WALK) as file:
        arrays = {name: file[name] for name in ("t", "q", "v", "a")}
    np.savez(tmp_path / "bare.npz", **arrays)
    out, _ = analyze(tmp_path / "bare.npz")
    expected = summary(out)
    assert any(note.startswith("Contacts are found from where") for note in expected["notes"])
    table = pyarrow.parquet.read_table(out / "frames.parquet")
    path = tmp_path / "mine.yaml"
    path.write_text((out / "schedule.yaml").read_text())
    analyze(tmp_path / "bare.npz", "--schedule", path)
    again = summary(out)
    assert f"Contacts are active as {path} says." in again["notes"]
    assert again | {"notes": []} == expected | {"notes": []}
    # But for how sure it is: what is given is.
    other = pyarrow.parquet.read_table(out / "frames.parquet")
    assert other.column_names == table.column_names
    for name in table.column_names:
        if not name.endswith(".confidence"):
            np.testing.assert_array_equal(other[name].to_numpy(), table[name].to_numpy(), name)
    path.write_text("left_sole: [[0, 1]]\n")
    analyze(tmp_path / "bare.npz", "--schedule", path)
    assert summary(out)["contacts"]["left_sole"]["active_share"] == pytest.approx(51 / 318)
    assert summary(out)["contacts"]["right_sole"]["active_share"] == 0.0


def test_settings(analyze, tmp_path):
    """From a file, then from texts, then from options of their own, which count the most."""
    path = tmp_path / "settings.yaml"
    path.write_text("cutoff: 3\nomega: 1\nverdict: {cop_force: 0.1, cop_outside: {limit: 0.2}}\n")
    out, _ = analyze(
        WALK,
        *("--settings", path),
        *("--set", "omega=2", "--set", "detection.change=3"),
        *("--set", "verdict.cop_force=0.2"),
        *("--omega", "3", "--ground-height", "-0.5", "--uneven"),
    )
    options = summary(out)["options"]
    assert (options["cutoff"], options["omega"], options["flat"]) == (3.0, 3.0, False)
    assert options["detection"]["change"] == 3.0
    assert options["detection"]["ground_height"] == -0.5
    assert options["verdict"]["cop_force"] == 0.2
    assert options["verdict"]["cop_outside"] == {"limit": 0.2, "allowed_share": 0.1}
    assert summary(out)["omega"] == 3.0
    assert summary(out)["ground"] == {"left_sole": -0.5, "right_sole": -0.5}


def test_settings_left_alone(analyze):
    out, _ = analyze(WALK)
    assert summary(out)["options"] == dynacom.AnalysisOptions().to_dict()


def test_flat_overrules_a_file(analyze, tmp_path):
    path = tmp_path / "settings.yaml"
    path.write_text("flat: false\n")
    for arguments, flat in (([], False), (["--flat"], True)):
        out, _ = analyze(WALK, "--settings", path, *arguments)
        assert summary(out)["options"]["flat"] is flat


def test_friction(analyze, run):
    out, _ = analyze(WALK, "--friction", "outer-pyramid")
    assert summary(out)["options"]["friction"] == "outer-pyramid"
    done = run("analyze", WALK, "--robot", "talos", "--friction", "round")
    assert done.returncode == 2
    assert "friction must be cone, outer-pyramid, inner-pyramid, facets or null" in done.stderr


@pytest.mark.parametrize(("given", "cutoff"), [("7.5", 7.5), ("0", None)])
def test_the_cut_off(analyze, tmp_path, given, cutoff):
    with np.load(WALK) as file:
        np.savez(tmp_path / "bare.npz", t=file["t"], q=file["q"])
    out, printed = analyze(tmp_path / "bare.npz", "--cutoff", given)
    found = summary(out)
    assert found["cutoff"] == cutoff
    assert found["options"]["cutoff"] == float(given)
    titles = [title for title, _ in cells(printed) if title.startswith("Residual at")]
    assert titles == ([f"Residual at {x} Hz" for x in ("3.75", "7.5", "15")] if cutoff else [])


def test_how_a_file_is_read(analyze, tmp_path):
    """--fps and --quat, as in read_motion."""
    robot = dynacom.load_robot("g1")
    table = sway(robot, 30).table
    table[:, 3:7] = table[:, [6, 3, 4, 5]]
    path = write_csv(tmp_path / "clip.csv", table)
    out, _ = analyze(path, "--fps", "50", "--quat", "wxyz", robot="g1")
    assert summary(out)["frame_rate"] == pytest.approx(50.0)
    assert summary(out)["frames"] == 30


def test_pickles(analyze, shared_data, refuses, tmp_path):
    path = shared_data / "squat_level1.pkl"
    out = tmp_path / "out"
    arguments = ("--robot", "g1", "--no-page", "--out", out)
    refuses("analyze", path, *arguments, parts=["joblib", "--trust"])
    assert not out.exists()
    analyze(path, "--trust", robot="g1")
    assert summary(out)["frames"] == 158


def test_a_clip_of_several(analyze, refuses, tmp_path):
    import pickle

    robot = dynacom.load_robot("g1")
    clips = {}
    for name, frames in (("walk", 20), ("run", 30)):
        motion = sway(robot, frames)
        clips[name] = {
            "root_trans_offset": motion.position,
            "root_rot": motion.quaternion,
            "dof": motion.angles,
            "fps": 60,
        }
    path = tmp_path / "clips.pkl"
    path.write_bytes(pickle.dumps(clips))
    out, _ = analyze(path, "--clip", "run", robot="g1")
    assert summary(out)["frames"] == 30
    arguments = ("analyze", path, "--robot", "g1", "--no-page", "--out", tmp_path / "other")
    refuses(*arguments, parts=[path, "--clip", "walk, run"])
    refuses(*arguments, "--clip", "jump", parts=[path, "jump"])


def test_payloads(analyze, talos):
    """As many as there are."""
    payloads = ("--payload", "torso_2_link:12@0.1,0,0.2", "--payload", "gripper_left_base_link:1")
    out, _ = analyze(WALK, *payloads)
    mass = talos.dynacom().getMass()
    assert summary(out)["mass"] == pytest.approx(mass + 13.0)
    assert summary(out)["mean_vertical_force"] == pytest.approx(1.0, abs=0.01)


def test_a_robot_without_a_file(command, tmp_path, talos):
    urdf = robots_folder() / "talos_data/robots/talos_reduced.urdf"
    contacts = [
        f"{side}_sole_link:6d:name={side}_sole,half_length=0.1,half_width=0.06,mu=0.7,gu=0.08"
        for side in ("left", "right")
    ]
    arguments = [part for contact in contacts for part in ("--contact", contact)]
    out = tmp_path / "out"
    status, _, err = command(
        "analyze", WALK, "--urdf", urdf, *arguments, "--no-page", "--check", "--out", out
    )
    assert (status, err) == (0, "")
    expected = dynacom.analyze(WALK, talos).summary
    assert summary(out) | {"robot": "talos"} == expected


# The summary that is printed.


def test_what_is_printed(analyze, motion_file, talos):
    limits = (f"verdict.{code}.limit=0" for code in ("foot_sliding", "ground_penetration"))
    out, printed = analyze(motion_file(), *(part for text in limits for part in ("--set", text)))
    rows, found = cells(printed), summary(out)
    assert rows[0] == ("Verdict", "repairable")
    title, text = rows.pop(1)
    rms, largest = (f"{1e3 * found['distance'][name]:.1f} mm" for name in ("rms", "largest"))
    assert title == "Distance"
    assert text.startswith(f"{rms} from a feasible motion (RMS; {largest} at most, at ")
    reasons = [entry for entry in found["reasons"] if entry["holds"]]
    assert len(reasons) >= 2
    assert rows[1 : 1 + len(reasons)] == [(entry["code"], entry["text"]) for entry in reasons]
    text = "no window of 1 s or more: the clip is shorter"
    assert rows[1 + len(reasons)] == ("Without fault", text)
    table = dict(rows)
    assert table["Motion"] == "0.780 s, 40 frames at 50 Hz"
    for status, count in found["statuses"].items():
        assert table[status] == f"{count} ({count / 40:.1%})"
    assert table["Mass"] == f"{talos.dynacom().getMass():.3f} kg"
    mean, change = found["mean_vertical_force"], found["momentum_change"]
    assert table["Mean vertical force"].startswith(f"{mean:.1%} of the weight")
    assert abs(change) > 0.0005
    assert table["Mean vertical force"].endswith(f"of which {change:+.1%} ends in momentum")
    for name in ("left_sole", "right_sole"):
        contact = found["contacts"][name]
        assert table[f"Weight on {name}"] == (
            f"{contact['weight_share']:.1%} ({contact['weight_share_while_active']:.1%} while "
            f"active, in {contact['active_share']:.1%} of the frames)"
        )
    assert [text for title, text in rows if title == "Note"] == found["notes"]
    assert [line for line in printed.splitlines() if line.startswith("Wrote ")] == [
        f"Wrote {out / name}" for name in FILES
    ]


def test_measured_forces_and_contacts_that_are_never_active_are_printed(analyze, tmp_path):
    path = tmp_path / "schedule.yaml"
    path.write_text("left_sole: [[0, 9]]\n")
    out, printed = analyze(WALK, "--schedule", path)
    table = dict(cells(printed))
    assert table["Weight on right_sole"] == "0.0% (never active)"
    for name, compared in summary(out)["measured"].items():
        bias, rms = compared["bias"][2], compared["rms"][2]
        assert table[f"Measured on {name}"] == f"f_z differs by {bias:.3g} N, {rms:.3g} N RMS"


def test_names_are_not_taken_for_markup(analyze, motion_file, tmp_path):
    robot = tmp_path / "odd.yaml"
    text = next(p for p in dynacom.robots.list_robots() if p.stem == "talos").read_text()
    name = 'left, "[b]sole"'
    robot.write_text(text.replace("left_sole\n", f"'{name}'\n"))
    path = motion_file("[red]clip.npz", contact_names=np.array([name, "right_sole"]))
    out, printed = analyze(path, robot=robot)
    assert f"Weight on {name}" in dict(cells(printed))
    assert name in summary(out)["contacts"]
    assert summary(out)["clip"] == "[red]clip.npz"


def test_a_table_of_next_to_nothing(talos):
    """One frame, in which nothing is known of time."""
    with np.load(WALK) as file:
        q = file["q"][:1]
    clip = dynacom.Clip(
        WALK, np.zeros(1), q, None, None, (), None, {}, np.zeros(1), ("[b]A note[/b].",)
    )
    table = summary_table(dynacom.analyze(clip, talos).summary)
    left, right = (list(column.cells) for column in table.columns)
    assert right[left.index("Motion")] == "0.000 s, 1 frames"
    assert right[left.index("Note")] == r"\[b]A note\[/b]."


# Bad input: one line on stderr, status 2, and no folder.


@pytest.fixture
def refuses_clip(refuses, tmp_path):
    """Expects that a clip is refused, and nothing written."""

    def refuses_clip(path, *arguments, parts, robot="g1"):
        out = tmp_path / "out"
        options = [*(("--robot", robot) if robot else ()), "--no-page", "--out", out]
        refuses("analyze", path, *options, *arguments, parts=parts)
        assert not out.exists()

    return refuses_clip


@pytest.fixture(scope="module")
def clip():
    return sway(dynacom.load_robot("g1"), 60)


def test_another_robot(refuses_clip, clip, tmp_path):
    path = write_csv(tmp_path / "clip.csv", clip.table)
    refuses_clip(path, "--fps", 60, robot="talos", parts=[path, "32 of the joints of talos", "36"])
    path = write_columns(tmp_path / "named.csv", clip.columns)
    refuses_clip(path, robot="talos", parts=[path, "joints of talos", "left_hip_pitch_joint"])
    refuses_clip(WALK, parts=[WALK, "q must have"])


def test_another_order_of_quaternions(refuses_clip, clip, tmp_path):
    table = clip.table.copy()
    table[:, 3:7] = table[:, [6, 3, 4, 5]]
    path = write_csv(tmp_path / "clip.csv", table)
    refuses_clip(path, "--fps", 60, parts=[path, "x y z w", "w x y z", "--quat wxyz"])
    table[:, 3:7] *= 2.0
    path = write_csv(tmp_path / "clip.csv", table)
    refuses_clip(path, "--fps", 60, parts=[path, "norm"])


def test_degrees(refuses_clip, clip, tmp_path):
    table = clip.table.copy()
    table[:, 7:] = np.rad2deg(table[:, 7:])
    path = write_csv(tmp_path / "clip.csv", table)
    refuses_clip(path, "--fps", 60, parts=[path, "degrees"])


def test_a_hole_in_time(refuses_clip, clip, tmp_path):
    columns = clip.columns
    columns["t"] = columns["t"] + np.where(np.arange(60) >= 20, 0.1, 0.0)
    path = write_columns(tmp_path / "clip.csv", columns)
    refuses_clip(path, parts=[path, "time must have no holes", "between frame 19 "])
    columns["t"][30] = columns["t"][29]
    path = write_columns(tmp_path / "clip.csv", columns)
    refuses_clip(path, parts=[path, "time must increase", "frame 30"])


def test_frame_rates(refuses_clip, clip, tmp_path):
    path = write_csv(tmp_path / "clip.csv", clip.table)
    refuses_clip(path, parts=[path, "give --fps"])
    refuses_clip(path, "--fps", 0, parts=["fps must be finite and > 0 Hz, got 0"])


def test_numbers_that_are_none(refuses_clip, clip, tmp_path):
    table = clip.table.copy()
    table[5, 9] = np.nan
    path = write_csv(tmp_path / "clip.csv", table)
    refuses_clip(path, "--fps", 60, parts=[path, "must be finite", "frame 5"])


def test_files_that_are_none(refuses_clip, tmp_path):
    refuses_clip(tmp_path / "none.csv", parts=["none.csv: cannot be read", "No such file"])
    refuses_clip(tmp_path / "clip.bvh", parts=["clip.bvh", "must end in one of .csv"])
    refuses_clip(tmp_path, parts=[tmp_path, "Is a directory"])


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["--cutoff", "24"], ["clip.csv", "cutoff must be > 0 and < 24 Hz", "0.4 of the frame"]),
        (["--cutoff", "-1"], ["cutoff must be finite and >= 0 Hz, auto or none, got -1"]),
        (["--cutoff", "six"], ["cutoff must be a finite number, auto or null, got 'six'"]),
        (["--set", "cutoff=30"], ["clip.csv", "cutoff must be", "got 30 Hz"]),
        (["--set", "speed=3"], ["setting 'speed=3'", "unknown setting 'speed'", "cutoff, omega"]),
        (["--set", "omega"], ["setting must be NAME=VALUE, got 'omega'"]),
        (["--set", "omega=fast"], ["omega must be a finite number, got 'fast'"]),
        (["--set", "verdict.cop_outside.limit=-1"], ["cop_outside.limit must be", "got -1"]),
        (["--omega", "-1"], ["omega must be finite and >= 0 rad/s, got -1"]),
        (["--omega", "nan"], ["omega must be a finite number, got nan"]),
        (["--ground-height", "inf"], ["ground_height must be a finite number", "got inf"]),
        (["--settings", "none.yaml"], ["none.yaml: cannot be read (No such file"]),
        (["--settings", "bad.yaml"], ["bad.yaml: unknown setting 'left_sole'"]),
        (["--schedule", "none.yaml"], ["none.yaml: cannot be read (No such file"]),
        (["--schedule", "bad.yaml"], ["bad.yaml: contact 'left_sole'", "got [3, 1]"]),
        (["--contact", "a:point:mu=1"], ["--contact goes with --urdf"]),
        (["--urdf", "r.urdf"], ["--robot, or by --urdf and --contact"]),
        (["--payload", "left_hand"], ["FRAME:MASS", "got 'left_hand'"]),
        (["--payload", "tail:1"], ["frame", "got 'tail'"]),
        (["--payload", "torso_link:-1"], ["mass must be positive and finite, got -1"]),
        (["--quat", "zyx"], ["quat must be xyzw or wxyz, got 'zyx'"]),
    ],
)
def test_bad_options(refuses_clip, clip, tmp_path, monkeypatch, arguments, parts):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.yaml").write_text("left_sole: [[3, 1]]\n")
    path = write_csv(tmp_path / "clip.csv", clip.table)
    refuses_clip(path, "--fps", 60, *arguments, parts=parts)


def test_robots_that_are_none(refuses_clip, tmp_path):
    refuses_clip(WALK, robot="talso", parts=["robot must be one of", "talos", "'talso'"])
    missing = tmp_path / "none.yaml"
    refuses_clip(WALK, robot=missing, parts=[missing, "No such file"])
    bad = tmp_path / "bad.yaml"
    bad.write_text("urdf: 3\ncontacts: []\n")
    refuses_clip(WALK, robot=bad, parts=[bad, "urdf must be"])
    refuses_clip(WALK, robot=None, parts=["--robot, or by --urdf and --contact"])
    urdf = robots_folder() / "talos_data/robots/talos_reduced.urdf"
    refuses_clip(WALK, "--urdf", urdf, robot=None, parts=["contacts must be given, got none"])
    contact = ("--contact", "left_sole_link:7d:mu=1")
    refuses_clip(WALK, "--urdf", urdf, *contact, robot=None, parts=["kind must be point or 6d"])
    refuses_clip(
        WALK,
        *("--urdf", tmp_path / "none.urdf", "--contact", "a:point:mu=1"),
        robot=None,
        parts=["none.urdf"],
    )


@pytest.mark.parametrize("command_name", ["analyze", "show"])
def test_both_commands_refuse_the_same(refuses, command_name, tmp_path):
    refuses(command_name, WALK, parts=["--robot, or by --urdf and --contact"])
    refuses(command_name, tmp_path / "none.npz", "--robot", "talos", parts=["cannot be read"])


def test_unwritable_folders(refuses, motion_file, tmp_path):
    file = tmp_path / "file"
    file.write_text("mine")
    arguments = ("analyze", motion_file(), "--robot", "talos", "--no-page", "--out")
    refuses(*arguments, file, parts=[file, "cannot be written (File exists)"])
    refuses(*arguments, file / "out", parts=[file, "cannot be written (Not a directory)"])
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


# Ctrl-C.


def test_an_interrupted_analysis_leaves_nothing(command, motion_file, tmp_path, monkeypatch):
    def interrupt(part):
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "_progress", lambda title: contextlib.nullcontext(interrupt))
    out = tmp_path / "out"
    status, printed, err = command("analyze", motion_file(), "--robot", "talos", "--out", out)
    assert status not in (0, 1, 2)
    assert printed == ""
    assert "Traceback" not in err
    assert not out.exists()


@pytest.fixture
def long_motion(motion_file, talos_motion):
    """Of 40000 frames, which take a while."""
    arrays = {name: np.tile(talos_motion[name], (1000, 1)) for name in ("q", "v", "a", "contacts")}
    return motion_file(t=0.01 * np.arange(40000), **arrays)


def start(motion, out, **options):
    return subprocess.Popen(
        [
            *(sys.executable, "-m", "dynacom", "analyze", motion, "--robot", "talos"),
            *("--no-page", "--csv", "--set", "verdict.discontinuity.limit=9", "--out", out),
        ],
        stdout=subprocess.PIPE,
        # Where the tests run in the background of a shell, they and their children ignore it.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        **options,
    )


def test_ctrl_c_while_analysing(tmp_path, long_motion):
    out = tmp_path / "out"
    terminal, process_end = pty.openpty()
    process = start(long_motion, out, stderr=process_end, env=os.environ | {"TERM": "xterm"})
    os.close(process_end)
    shown = b""
    while b"Analysing" not in shown:
        shown += os.read(terminal, 1 << 16)
    process.send_signal(signal.SIGINT)
    with contextlib.suppress(OSError):  # what a terminal says when the other end is closed
        while more := os.read(terminal, 1 << 16):
            shown += more
    printed, _ = process.communicate(timeout=60)
    os.close(terminal)
    assert process.returncode not in (0, 1, 2)
    assert printed == b""
    assert b"Traceback" not in shown
    assert not out.exists()


def test_ctrl_c_while_writing(tmp_path, long_motion):
    out = tmp_path / "out"
    process = start(long_motion, out, stderr=subprocess.PIPE)
    deadline = time.monotonic() + 60
    while not out.exists() and time.monotonic() < deadline:
        time.sleep(0.001)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode not in (0, 1, 2)
    assert b"Traceback" not in err
    assert not out.exists()


# The progress bar.


def test_progress_on_a_terminal_only(motion_file, tmp_path, run):
    arguments = ["analyze", str(motion_file()), "--robot", "talos", "--no-page"]
    arguments += ["--out", str(tmp_path / "out")]
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
    assert re.search(r"\d:\d\d:\d\d", shown)  # the time left
    assert b"Verdict" in done.stdout


def test_the_page_is_written_unless_it_is_not_wanted(command, motion_file, tmp_path):
    status, printed, err = command(
        "analyze", motion_file(), "--robot", "talos", "--out", tmp_path / "out"
    )
    assert (status, err) == (0, "")
    assert f"Wrote {tmp_path / 'out' / 'report.html'}" in printed.splitlines()
    assert (tmp_path / "out" / "report.html").read_text("utf-8").startswith("<!DOCTYPE html>")


# The viewer.


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


# Repair.


@pytest.fixture(scope="module")
def hurried(tmp_path_factory, talos):
    """The walk twice as fast, which contacts cannot give."""
    path = tmp_path_factory.mktemp("hurried") / "walk.npz"
    with np.load(WALK) as file:
        np.savez(path, t=file["t"] / 2.0, q=file["q"])
    return path


def test_repair(command, hurried, talos, tmp_path):
    """The command is dynacom.repair and save, and no more; it tells what was and what is."""
    out = tmp_path / "out"
    arguments = ("repair", hurried, "--robot", "talos", "--no-page", "--out", out)
    status, printed, err = command(*arguments, "--check")
    assert (status, err) == (0, "")
    files = sorted([*FILES, "walk.npz"])
    assert sorted(os.listdir(out)) == files
    report = dynacom.repair(hurried, talos)
    report.save(tmp_path / "expected", page=False)
    for name in FILES:
        assert (out / name).read_bytes() == (tmp_path / "expected" / name).read_bytes()
        assert f"\nWrote {out / name}\n" in printed
    found = summary(out)["repair"]
    rows = dict(cells(printed))
    assert rows["Repair"] == "repaired"
    assert rows["Verdict"] == "repairable (residual_torque, cop_outside) → feasible"
    assert rows["without the mark"] == "feasible"
    assert rows["Frames out of reach"] == "271 (85.2%) → 0 (0.0%)"
    root, joints = found["root"], found["joints"]
    assert rows["Root displaced"] == (
        f"{1e3 * root['rms']:.3g} mm (RMS), up to {1e3 * root['largest']:.3g} mm "
        f"(frame {root['frame']}, at {root['time']:.2f} s)"
    )
    assert joints["joint"] in rows["Joints turned"] and "°" in rows["Joints turned"]
    assert rows["Stances held still"] == "8 of 8"
    steps = [name for name in rows if name.startswith("Step: ")]
    assert steps == ["Step: balance", "Step: feet", "Step: joints"]
    # Contacts, a page and a table, if they are asked for.
    assert command(*arguments, "--export-contacts", "--csv")[0] == 0
    assert sorted(os.listdir(out)) == sorted([*files, "contacts.npz", "frames.csv"])


def test_what_was_repaired_is_analysed_to_the_same(command, hurried, tmp_path):
    out = tmp_path / "out"
    arguments = ("--robot", "talos", "--no-page", "--check", "--out")
    assert command("repair", hurried, *arguments, out)[0] == 0
    assert command("analyze", hurried, *arguments, tmp_path / "before")[0] == 1
    assert command("analyze", out / "walk.npz", *arguments, tmp_path / "after")[0] == 0
    assert summary(tmp_path / "after")["statuses"] == {"Solved": 318}


def test_repair_has_a_folder_by_default(command, hurried, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, _, _ = command("repair", hurried, "--robot", "talos", "--no-page", "--balance-only")
    assert status == 0
    assert os.listdir() == ["walk-repaired"]
    assert summary(tmp_path / "walk-repaired")["options"]["repair"]["feet"] is False
    rungs = summary(tmp_path / "walk-repaired")["repair"]["rungs"]
    assert [rung["name"] for rung in rungs] == ["balance"]


def test_the_clip_is_not_overwritten(refuses, hurried):
    before = hurried.read_bytes()
    arguments = ("repair", hurried, "--robot", "talos", "--no-page", "--out", hurried.parent)
    refuses(*arguments, parts=[hurried.parent, "another folder"])
    assert hurried.read_bytes() == before
    assert os.listdir(hurried.parent) == ["walk.npz"]


def test_check_of_repairs(command, refuses, hurried, talos, talos_standing, tmp_path):
    """A motion that is feasible, or was made so, passes; one that is repairable if that will do."""
    trot = tmp_path / "trot.npz"
    with np.load(WALKS / "anymal_trot.npz") as file:
        np.savez(trot, t=file["t"] / 3.0, q=file["q"])
    floating = tmp_path / "floating.npz"
    q = np.tile(talos_standing, (100, 1))
    time = np.arange(100) / 50.0
    q[:, 2] += np.clip(4.0 * time * (2.0 - time), 0.0, 1.0)
    np.savez(floating, t=time, q=q)
    out = ("--no-page", "--out", tmp_path / "out")
    for path, robot, feasible, repairable in (
        (WALK, "talos", 0, 0),
        (hurried, "talos", 0, 0),
        (trot, "anymal_c", 1, 0),
        (floating, "talos", 1, 1),
    ):
        arguments = ("repair", path, "--robot", robot, *out)
        assert command(*arguments)[0] == 0
        assert command(*arguments, "--check")[0] == feasible
        assert command(*arguments, "--check", "repairable")[0] == repairable
    status, printed, _ = command("repair", floating, "--robot", "talos", *out)
    rows = dict(cells(printed))
    assert rows["Repair"] == "not repaired"
    assert summary(tmp_path / "out")["repair"]["reasons"]
    for reason in summary(tmp_path / "out")["repair"]["reasons"]:
        when = "" if reason["time"] is None else f" (at {reason['time']:.2f} s)"
        assert rows[reason["code"]] == reason["text"] + when
    assert command("repair", trot, "--robot", "anymal_c", *out, "--stretch", 1.5, "--check")[0] == 0
    assert summary(tmp_path / "out")["repair"]["stretch"] > 1.0
    arguments = ("repair", trot, "--robot", "anymal_c", *out)
    refuses(*arguments, "--stretch", 0.5, parts=["largest_stretch must be finite and >= 1"])
    refuses(*arguments, "--check=possible", parts=["check must be feasible or repairable"])


def test_notes_of_what_was_written_are_printed(command, tmp_path):
    """As that a file without times cannot say how fast it is now."""
    robot = dynacom.load_robot("anymal_c")
    path = tmp_path / "trot.csv"
    with np.load(WALKS / "anymal_trot.npz") as file:
        q = file["q"]
    joints = [q[:, robot.model.joints[robot.model.getJointId(n)].idx_q] for n in urdf_order(robot)]
    write_csv(path, np.column_stack([q[:, :7], *joints]))
    arguments = ("--robot", "anymal_c", "--fps", 150, "--no-page", "--out", tmp_path / "out")
    status, printed, _ = command("repair", path, *arguments, "--stretch", 1.5)
    assert status == 0
    stretch = summary(tmp_path / "out")["repair"]["stretch"]
    note = f"its frame rate is {150 / stretch:.9g} Hz now (--fps)."
    assert note in summary(tmp_path / "out")["notes"][-1]
    assert " ".join(printed.replace("│", " ").split()).count(note) == 1
    again = ("analyze", tmp_path / "out/trot.csv", "--robot", "anymal_c", "--no-page", "--check")
    rate = ("--fps", 100 / stretch, "--out", tmp_path / "again")
    assert command(*again, *rate)[0] == 0
