# SPDX-License-Identifier: BSD-2-Clause
"""Motions come out of repair feasible, and files say the same when they are read again."""

import json
import re
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import dynacom
from batch_clips import write_without_legs
from dynacom import AnalysisOptions, DynacomError, LadderSettings, RepairReport
from dynacom.contacts_file import contact_arrays
from dynacom.repair_summary import repair_summary
from dynacom.robots import Robot
from helpers import WALKS
from motion_files import columns_of

BY_DEFAULT = ["frames.parquet", "schedule.yaml", "summary.json"]


def write_walk(path: Path, robot: Robot, factor: float, frames: slice = slice(None)) -> Path:
    """Talos' bundled walk, played faster by a factor; CSV is without times, at 50 Hz times it."""
    with np.load(WALKS / "talos_walk.npz") as file:
        time, q = file["t"][frames] / factor, file["q"][frames]
    if path.suffix == ".npz":
        motion = dynacom.differentiate(robot.model, time, q)
        np.savez(path, t=time, q=q, v=motion.v, a=motion.a)
    else:
        columns = columns_of(robot, q)
        table = np.column_stack([*columns.values()])
        np.savetxt(path, table, "%.6f", ",", header=",".join(columns), comments="")
    return path


@dataclass
class Saved:
    report: RepairReport
    folder: Path
    summary: dict

    @property
    def motion(self) -> Path:
        return self.folder / self.report.clip.path.name


@pytest.fixture(scope="module")
def hurried(talos, tmp_path_factory) -> Saved:
    """The walk twice as fast, which is repairable before."""
    folder = tmp_path_factory.mktemp("hurried")
    path = write_walk(folder / "walk.npz", talos, 2.0)
    report = dynacom.repair(path, talos)
    report.save(folder / "out", page=False, export_contacts=True)
    return Saved(report, folder / "out", json.loads((folder / "out/summary.json").read_text()))


def assert_supported(robot: Robot, report: dynacom.MotionReport) -> None:
    """Inverse dynamics asks the root for nothing but what contacts give, frame by frame.

    Neither the centroidal dynamics nor the solver is part of it: forces of the report push at the
    places of the contacts' frames, taken to the root by Jacobians.
    """
    model = robot.model
    data = model.createData()
    motion, weight = report.motion, report.summary["weight"]
    for row in range(len(motion.time)):
        base = pin.rnea(model, data, motion.q[row], motion.v[row], motion.a[row])[:6]
        pin.computeJointJacobians(model, data, motion.q[row])
        for name, settings in robot.contacts.items():
            frame = model.getFrameId(settings.frame_name)
            wrench = np.hstack(
                [report[f"contact.{name}.{part}"][row] for part in ("force", "torque")]
            )
            jacobian = pin.getFrameJacobian(model, data, frame, pin.LOCAL)
            base = base - jacobian[:, :6].T @ wrench
        assert np.abs(base).max() < 1e-3 * weight


def test_a_walk_that_is_too_fast(talos, hurried):
    report = hurried.report
    assert report.before.verdict.outcome == "repairable"
    assert (report.outcome, report.changed) == ("repaired", True)
    assert report.after.verdict.outcome == "feasible"
    assert_array_equal(report.motion.q, report.repair.recorded.q)
    assert_array_equal(report.after.clip.q, report.motion.q)
    assert report.after["status"].tolist() == ["Solved"] * 318
    assert_supported(talos, report.after)
    with pytest.raises(AssertionError):
        assert_supported(talos, report.before)


def test_the_file_says_the_same_when_it_is_read(talos, hurried):
    again = dynacom.analyze(hurried.motion, talos)
    report = hurried.report
    assert again.clip.exact
    assert_array_equal(again.motion.q, report.motion.q)
    assert_array_equal(again.motion.time, report.clip.time)
    assert again.examination.derived.cutoff == 0.0
    assert again.verdict.outcome == "feasible"
    assert again["status"].tolist() == ["Solved"] * 318
    assert_allclose(again.motion.a, report.motion.a, rtol=0, atol=1e-9)
    # Who does not know is told in the summary.
    cut = AnalysisOptions(cutoff=6.0)
    assert dynacom.analyze(hurried.motion, talos, options=cut).examination.derived.cutoff == 6.0


def test_the_summary(hurried):
    repair, found = hurried.summary["repair"], hurried.report.repair
    report = hurried.report
    assert hurried.summary["verdict"] == "feasible"
    assert repair["outcome"] == "repaired"
    assert (repair["verdict_before"], repair["verdict"]) == ("repairable", "feasible")
    assert repair["verdict_filtered"] == found.filtered.verdict.outcome
    assert repair["codes_before"] == ["residual_torque", "cop_outside"]
    for ending, side in (("_before", report.before), ("", report.after)):
        missing = repair[f"missing{ending}"]
        residual = side["residual"] / side.summary["weight"]
        for key, part in (("force_rms", slice(3)), ("torque_rms", slice(3, 6))):
            rms = np.sqrt(np.mean(np.sum(residual[:, part] ** 2, axis=1)))
            assert_allclose(missing[key], rms, rtol=1e-6, atol=1e-9)
    assert (repair["missing_before"]["frames"], repair["missing"]["frames"]) == (271, 0)
    change = np.linalg.norm(found.change[:, :3], axis=1)
    assert repair["root"] == {
        "rms": pytest.approx(np.sqrt(np.mean(change**2))),
        "largest": pytest.approx(change.max()),
        "frame": change.argmax(),
        "time": report.motion.time[change.argmax()],
    }
    shift = np.linalg.norm(report.after["com"] - report.before["com"], axis=1)
    assert repair["com"]["largest"] == pytest.approx(shift.max())
    assert repair["joints"]["joint"] in report.robot.joints.names
    stances = repair["stances"]
    assert stances["held"] == stances["count"] == 8
    assert 0.0 < stances["largest_drift"] < 1e-3
    assert stances["largest_speed"] < stances["largest_speed_before"]
    for name in ("speed", "drift", "sunk", "floating"):
        assert stances[f"largest_{name}"] == getattr(found.feet, name)
        assert stances[f"largest_{name}_before"] == getattr(found.feet_before, name)
    assert max(stances["largest_sunk"], stances["largest_floating"]) < 2e-3
    assert [rung["name"] for rung in repair["rungs"]] == ["balance", "feet", "joints"]
    assert all(rung["kept"] and rung["text"].endswith(".") for rung in repair["rungs"])
    assert (repair["file"], repair["exact"]) == ("walk.npz", True)
    assert repair | dynacom.mark_of(hurried.motion) == repair
    assert (repair["reasons"], repair["stretch"]) == ([], 1.0)
    # Before it is written nobody knows the file; all else is the same.
    unwritten = report.summary["repair"]
    assert {key: value for key, value in repair.items() if key in unwritten} == unwritten
    written = {"verdict_written", "codes_written"}
    assert set(repair) - set(unwritten) == {"file", "sha256", "exact"} | written
    assert (repair["verdict_written"], repair["codes_written"]) == ("feasible", ["feasible"])


def test_contacts_for_training(talos, hurried):
    with np.load(hurried.folder / "contacts.npz") as file:
        arrays = {name: file[name] for name in file.files}
    report = hurried.report.after
    frames = len(report.motion.time)
    assert {name: array.shape for name, array in arrays.items()} == {
        "time": (frames,),
        "fps": (),
        "frame": (frames,),
        "contact_names": (2,),
        "contact_mask": (frames, 2),
        "contact_forces": (frames, 2, 3),
        "contact_wrenches": (frames, 2, 6),
        "cop": (frames, 2, 3),
    }
    assert arrays["contact_mask"].dtype == bool
    assert arrays["contact_names"].tolist() == ["left_sole", "right_sole"]
    assert arrays["fps"] == pytest.approx(100.0)
    assert_array_equal(arrays["frame"], np.arange(frames))
    # Their sum is what accelerates the whole, about its centre too: (1), (2).
    analysis = report.analysis
    assert_allclose(arrays["contact_forces"].sum(axis=1), analysis.ground_force, atol=1e-6)
    mask = arrays["contact_mask"]
    assert not arrays["contact_forces"][~mask].any()
    assert_array_equal(mask[:, 0], report["contact.left_sole.active"])
    # The force at its centre of pressure gives the moment, but for that about the normal.
    loaded = np.isfinite(arrays["cop"]).all(axis=2)
    assert loaded.any(axis=1).all()
    for contact, name in enumerate(report.robot.contacts):
        rows = loaded[:, contact]
        lever = arrays["cop"][rows, contact] - report[f"contact.{name}.position"][rows]
        moment = np.cross(lever, arrays["contact_forces"][rows, contact])
        expected = arrays["contact_wrenches"][rows, contact, 3:]
        # Soles are flat on the ground: their x and y are turned by the heading only.
        assert_allclose(
            np.linalg.norm(moment[:, :2], axis=1), np.linalg.norm(expected[:, :2], axis=1), atol=0.1
        )
        assert_allclose(arrays["cop"][rows, contact, 2], 0.0, atol=2e-3)


def test_frames_that_the_file_does_not_have(talos, tmp_path):
    """contacts.npz has a row for each that was made, and tells which."""
    with np.load(WALKS / "talos_walk.npz") as file:
        kept = np.delete(np.arange(100), [40, 41, 70])
        np.savez(tmp_path / "walk.npz", t=file["t"][kept], q=file["q"][kept])
    report = dynacom.repair(tmp_path / "walk.npz", talos)
    frame = contact_arrays(report.after)["frame"]
    assert len(frame) == 100
    assert_array_equal(np.flatnonzero(frame < 0), [40, 41, 70])
    assert_array_equal(frame[frame >= 0], np.arange(97))


# What is fine.


def test_a_feasible_motion_comes_back_bit_for_bit(talos, tmp_path):
    path = WALKS / "talos_walk.npz"
    report = dynacom.repair(path, talos)
    assert (report.outcome, report.changed) == ("feasible", False)
    assert report.after is report.before
    assert_array_equal(report.motion.q, report.clip.q)
    files = report.save(tmp_path / "out", page=False)
    assert [file.name for file in files] == sorted([*BY_DEFAULT, "talos_walk.npz"])
    assert (tmp_path / "out/talos_walk.npz").read_bytes() == path.read_bytes()
    repair = json.loads((tmp_path / "out/summary.json").read_text())["repair"]
    assert (repair["outcome"], repair["exact"]) == ("feasible", False)
    assert repair["root"]["largest"] == 0.0
    assert repair["rungs"] == []


def test_strict_mends_single_frames(talos, tmp_path):
    path = write_walk(tmp_path / "walk.npz", talos, 1.5)
    assert dynacom.repair(path, talos).outcome == "feasible"
    report = dynacom.repair(path, talos, strict=True)
    assert report.options.ladder.strict
    assert report.outcome == "repaired"
    assert report.repair.missing_before > 50 and report.repair.missing == 0
    assert set(report.after["status"]) == {"Solved"}


def test_nothing_is_missing_but_rounding(anymal, tmp_path):
    """Rounds go on until all frames are Solved, also those in which hardly anything is missing."""
    with np.load(WALKS / "anymal_trot.npz") as file:
        np.savez(tmp_path / "trot.npz", t=file["t"] / 3.0, q=file["q"])
    report = dynacom.repair(tmp_path / "trot.npz", anymal)
    unsure = np.asarray(report.after.examination.verdict.unsure)
    assert np.count_nonzero(~unsure) > 100
    assert {str(status) for status in report.after["status"][~unsure]} == {"Solved"}


def test_what_repair_has_written_is_fine(talos, hurried):
    """Strictly so: repaired motions are left as they are."""
    again = dynacom.repair(hurried.motion, talos, strict=True)
    assert (again.outcome, again.changed) == ("feasible", False)


# CSV, which cannot hold the mark.


def test_csv(talos, tmp_path):
    path = write_walk(tmp_path / "walk.csv", talos, 2.0)
    report = dynacom.repair(path, talos, fps=100.0)
    assert report.outcome == "repaired"
    report.save(tmp_path / "out", page=False)
    again = dynacom.analyze(tmp_path / "out/walk.csv", talos, fps=100.0)
    assert again.clip.exact
    assert again.verdict.outcome == "feasible"
    assert "the file is marked as exact" in again.summary["derivatives"]
    # Also of a motion that was marked and is copied.
    copied = dynacom.repair(tmp_path / "out/walk.csv", talos, fps=100.0)
    assert copied.outcome == "feasible"
    copied.save(tmp_path / "copy", page=False)
    assert dynacom.read_motion(tmp_path / "copy/walk.csv", talos, fps=100.0).exact
    # Without the summary it is a motion as others are.
    (tmp_path / "out/summary.json").unlink()
    assert not dynacom.read_motion(tmp_path / "out/walk.csv", talos, fps=100.0).exact


def test_marked_motions_are_not_filtered(talos, tmp_path):
    """However noisy they are: who marks them is believed. A cut-off that is asked for counts."""
    with np.load(WALKS / "talos_walk.npz") as file:
        time, q = file["t"], file["q"]
    rng = np.random.default_rng(0)
    q[:, :3] += 1e-3 * rng.standard_normal((len(q), 3))
    np.savez(tmp_path / "noisy.npz", t=time, q=q)
    clip = dynacom.read_motion(tmp_path / "noisy.npz", talos)
    assert dynacom.analyze(clip, talos, sensitivity=False).examination.derived.cutoff > 0.0
    dynacom.write_motion(clip, tmp_path / "marked.npz", clip.q)
    marked = dynacom.analyze(tmp_path / "marked.npz", talos, sensitivity=False)
    assert marked.examination.derived.cutoff == 0.0
    assert_array_equal(marked.motion.q, q)
    assert marked.summary["derivatives"] == (
        "Velocities and accelerations are computed from the positions, without a filter: the file "
        "is marked as exact, as dynacom repair marks what it writes."
    )
    options = AnalysisOptions(cutoff=4.0)
    asked = dynacom.analyze(tmp_path / "marked.npz", talos, options=options, sensitivity=False)
    assert asked.examination.derived.cutoff == 4.0
    assert "marked" not in asked.summary["derivatives"]


# What is hopeless.


@pytest.fixture
def falling(talos, talos_standing, tmp_path) -> Path:
    """Leaves the ground at once, and hangs a metre above it for two seconds, as if by a rope."""
    time = np.arange(100) / 50.0
    q = np.tile(talos_standing, (100, 1))
    q[:, 2] += np.clip(4.0 * time * (2.0 - time), 0.0, 1.0)
    path = tmp_path / "falling.npz"
    np.savez(path, t=time, q=q)
    return path


def test_a_hopeless_motion(talos, falling, tmp_path):
    report = dynacom.repair(falling, talos)
    assert report.outcome == "not repaired"
    codes = [reason.code for reason in report.repair.reasons]
    assert codes
    reasons = report.summary["repair"]["reasons"]
    assert [reason["code"] for reason in reasons] == codes
    assert all(reason["text"] for reason in reasons)
    report.save(tmp_path / "out", page=False)
    json.loads((tmp_path / "out/summary.json").read_text())


def test_a_motion_that_is_too_short(talos, talos_standing, tmp_path):
    """Of which nobody knows anything is not touched."""
    path = tmp_path / "short.npz"
    np.savez(path, t=np.arange(4) / 50.0, q=np.tile(talos_standing, (4, 1)))
    report = dynacom.repair(path, talos)
    assert (report.outcome, report.changed) == ("not repaired", False)
    assert report.summary["repair"]["reasons"][0]["code"] == "too_short"
    assert report.summary["repair"]["reasons"][0]["time"] is None
    report.save(tmp_path / "out", page=False)
    assert (tmp_path / "out/short.npz").read_bytes() == path.read_bytes()


def test_what_nothing_helps_stays_as_it_was(talos, tmp_path):
    """Bit for bit, and without a mark: it may be as noisy as it was."""
    noise = np.random.default_rng(5)
    with np.load(WALKS / "talos_walk.npz") as file:
        q = np.tile(file["q"][0], (100, 1))
    time = np.arange(100) / 50.0
    q[:, 2] += np.clip(4.0 * time * (2.0 - time), 0.0, 1.0)
    q[:, 7:] += noise.normal(0.0, 0.002, (100, q.shape[1] - 7))
    path = tmp_path / "hover.npz"
    np.savez(path, t=time, q=q)
    report = dynacom.repair(path, talos)
    assert report.outcome == "not repaired"
    assert "not_better" in {reason.code for reason in report.repair.reasons}
    assert not report.changed
    report.save(tmp_path / "out", page=False)
    assert (tmp_path / "out/hover.npz").read_bytes() == path.read_bytes()
    assert not dynacom.read_motion(tmp_path / "out/hover.npz", talos).exact


# Time.


def test_time_may_be_stretched(anymal, tmp_path):
    """A trot four times as fast slides; slower by a half it does so no more than is allowed."""
    with np.load(WALKS / "anymal_trot.npz") as file:
        np.savez(tmp_path / "trot.npz", t=1.0 + file["t"] / 4.0, q=file["q"])
    assert dynacom.repair(tmp_path / "trot.npz", anymal).outcome == "not repaired"
    report = dynacom.repair(tmp_path / "trot.npz", anymal, stretch=2.0)
    assert report.outcome == "repaired"
    stretch = report.summary["repair"]["stretch"]
    assert 1.0 < stretch <= 2.0
    report.save(tmp_path / "out")
    again = dynacom.analyze(tmp_path / "out/trot.npz", anymal)
    expected = 1.0 + stretch * (report.clip.time - 1.0)
    assert_allclose(again.clip.time, expected, rtol=0, atol=1e-12)
    assert again.verdict.outcome == "feasible"


# Joints' limits.


@pytest.fixture
def beyond(talos, tmp_path) -> Path:
    """The walk 1.9 times too fast, with a joint 0.3 rad beyond its limit."""
    with np.load(WALKS / "talos_walk.npz") as file:
        time, q = file["t"] / 1.9, file["q"]
    model = talos.model
    column = model.idx_qs[model.getJointId("head_2_joint")]
    q[:, column] = model.upperPositionLimit[column] + 0.3
    np.savez(tmp_path / "beyond.npz", t=time, q=q)
    return tmp_path / "beyond.npz"


def test_who_is_beyond_limits_is_not_repaired(talos, beyond, tmp_path):
    """Nor who was so before, and did not ask for limits."""
    report = dynacom.repair(beyond, talos, balance_only=True)
    assert report.repair.missing == 0
    repair = report.summary["repair"]
    assert repair["limits"] == pytest.approx({"before": 0.3, "after": 0.3}, abs=1e-3)
    assert (repair["outcome"], [reason["code"] for reason in repair["reasons"]]) == (
        "not repaired",
        ["joint_limits"],
    )
    assert repair["reasons"][0]["text"].startswith("head_2_joint is beyond its limits, by up to 0.")
    assert "--balance-only" in repair["reasons"][0]["hint"]
    report = dynacom.repair(beyond, talos)
    assert report.outcome == "repaired"
    assert report.summary["repair"]["limits"]["after"] < 1e-9


def test_a_feasible_motion_beyond_limits(talos, beyond):
    """Stays as it is, and is told of."""
    with np.load(beyond) as file:
        np.savez(beyond, t=1.9 * file["t"], q=file["q"])
    report = dynacom.repair(beyond, talos)
    assert (report.outcome, report.changed) == ("feasible", False)
    assert "beyond its limits by up to 17.2°" in report.summary["notes"][-1]


def test_the_order_of_joints_is_blamed_only_for_what_the_motion_has(talos, beyond):
    options = AnalysisOptions()
    options.ladder.largest_turn = 0.01  # which keeps the joint where it is
    report = dynacom.repair(beyond, talos, options=options)
    (reason,) = [
        reason for reason in report.summary["repair"]["reasons"] if reason["code"] == "joint_limits"
    ]
    assert "another order" in reason["hint"]
    worse = replace_excess(report.repair, before=0.0)
    (reason,) = [
        reason
        for reason in repair_summary(talos, worse)["reasons"]
        if reason["code"] == "joint_limits"
    ]
    assert reason["hint"] is None


def replace_excess(repair: dynacom.MotionRepair, before: float) -> SimpleNamespace:
    """The same, of a motion whose joints were that far beyond their limits."""
    names = [name for name in dir(repair) if not name.startswith("_")]
    values = {name: getattr(repair, name) for name in names}
    return SimpleNamespace(**values | {"joint_excess_before": before})


# Settings.


def test_a_tilted_ground_is_levelled(talos, tmp_path):
    """A walk in a world that is turned by 8 degrees, on ground that is told to be flat."""
    with np.load(WALKS / "talos_walk.npz") as file:
        time, q = file["t"], file["q"]
    tilt = 0.14
    turn = pin.SE3(pin.rpy.rpyToMatrix(0.0, tilt, 0.0), np.array([0.0, 0.0, 0.02]))
    tilted = q.copy()
    for row in tilted:
        row[:7] = pin.SE3ToXYZQUAT(turn * pin.XYZQUATToSE3(row[:7]))
    np.savez(tmp_path / "tilted.npz", t=time, q=tilted)
    options = AnalysisOptions()
    options.detection.ground_height = 0.0
    report = dynacom.repair(tmp_path / "tilted.npz", talos, options=options)
    assert report.before.verdict.outcome != "feasible"
    assert report.outcome == "repaired"
    assert report.repair.steps[0].rung == "ground"
    assert_allclose(report.repair.ground_tilt, tilt, atol=0.005)
    # What is left is the walk itself.
    assert report.repair.root.largest < 0.002
    assert_allclose(report.repair.recorded.q[:, 2:7], q[:, 2:7], atol=0.01)
    report.save(tmp_path / "out", page=False)
    summary = json.loads((tmp_path / "out/summary.json").read_text())
    assert summary["repair"]["ground_tilt"] == report.repair.ground_tilt


def test_settings_reach_the_repairer(talos, tmp_path):
    path = write_walk(tmp_path / "walk.npz", talos, 2.0)
    options = AnalysisOptions()
    options.ladder.largest_displacement = 1e-3
    report = dynacom.repair(path, talos, options=options)
    assert "bound" in [reason.code for reason in report.repair.reasons]
    only = dynacom.repair(path, talos, balance_only=True)
    assert not (only.options.repair.feet or only.options.repair.joints)
    assert [step.rung for step in only.repair.steps] == ["balance"]
    assert options.repair.feet  # the caller's own stay as they were
    stiff = AnalysisOptions()
    stiff.repair.displacement = 1e-4
    moved = dynacom.repair(path, talos, options=stiff)
    assert moved.repair.root.rms < 0.5 * only.repair.root.rms


def test_defaults_are_those_of_the_library():
    signature = dynacom.MotionRepairer.__init__.__doc__
    for name, value in vars_of(LadderSettings()).items():
        found = re.search(rf"\b{name}=([\w.]+)", signature)[1]
        assert type(value)(float(found) if found not in ("True", "False") else found == "True") == (
            value
        )


def vars_of(settings: LadderSettings) -> dict[str, object]:
    return {name: getattr(settings, name) for name in LadderSettings.__slots__}


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("rounds", 0),
        ("rounds", 10**6),
        ("largest_displacement", 0.0),
        ("largest_turn", np.inf),
        ("largest_stretch", 0.9),
    ],
)
def test_settings_out_of_range(name, value):
    options = AnalysisOptions(ladder=replace(LadderSettings(), **{name: value}))
    with pytest.raises(ValueError, match=rf"LadderSettings\.{name} must be .*, got"):
        options.validate()


def test_the_manual_is_true(root, tmp_path, monkeypatch, capsys):
    """Its Python runs, and prints what one would expect."""
    text = (root / "docs" / "repair.md").read_text(encoding="utf-8")
    (tmp_path / "examples").symlink_to(root / "examples")
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"^```python\n(.*?)^```$", text, re.M | re.S)
    exec(compile(code, "repair.md", "exec"), {})
    printed = capsys.readouterr().out
    assert "repairable -> feasible repaired" in printed
    assert "{'Solved': 318}" in printed


# Files.


def test_the_motion_itself_is_never_overwritten(talos, hurried, tmp_path):
    path = write_walk(tmp_path / "walk.npz", talos, 2.0)
    report = replace(hurried.report, clip=dynacom.read_motion(path, talos))
    before = path.read_bytes()
    for folder in (tmp_path, tmp_path / "x" / ".."):
        with pytest.raises(DynacomError, match="another folder"):
            report.save(folder, page=False)
    link = tmp_path / "link"
    link.symlink_to(tmp_path)
    with pytest.raises(DynacomError, match="another folder"):
        report.save(link, page=False)
    assert path.read_bytes() == before
    named = path.rename(tmp_path / "contacts.npz")
    other = replace(hurried.report, clip=dynacom.read_motion(named, talos))
    with pytest.raises(DynacomError, match="called as a result"):
        other.save(tmp_path / "out", page=False)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("step", ["write_contacts", "write_motion"])
def test_all_files_or_none(talos, hurried, tmp_path, monkeypatch, step):
    (tmp_path / "summary.json").write_text("mine")

    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(sys.modules["dynacom.repair"], step, fail)
    with pytest.raises(DynacomError, match="No space left"):
        hurried.report.save(tmp_path, page=False, export_contacts=True)
    assert [file.name for file in tmp_path.iterdir()] == ["summary.json"]
    assert (tmp_path / "summary.json").read_text() == "mine"


def test_contacts_of_an_earlier_time_are_taken_away(hurried, tmp_path):
    hurried.report.save(tmp_path, page=False, export_contacts=True)
    assert (tmp_path / "contacts.npz").exists()
    hurried.report.save(tmp_path, page=False)
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted([*BY_DEFAULT, "walk.npz"])


def test_forces_in_the_file_are_those_of_the_new_motion(talos, tmp_path):
    """So is when contacts carry."""
    with np.load(WALKS / "talos_walk.npz") as file:
        arrays = {name: file[name] for name in file.files}
    arrays["t"] = arrays["t"] / 2.0
    np.savez(tmp_path / "walk.npz", **{key: arrays[key] for key in arrays if key not in "va"})
    report = dynacom.repair(tmp_path / "walk.npz", talos)
    assert report.outcome == "repaired"
    assert report.before.summary["measured"] and not report.after.summary["measured"]
    report.save(tmp_path / "out", page=False)
    again = dynacom.analyze(tmp_path / "out/walk.npz", talos)
    assert again.verdict.outcome == "feasible"
    assert_array_equal(again.clip.schedule.active, report.after.schedule.active)
    assert [*again.summary["measured"]] == ["left_sole", "right_sole"]
    for name, compared in again.summary["measured"].items():
        assert_allclose(compared["rms"], 0.0, atol=1e-6, err_msg=name)


def test_what_the_file_cannot_hold_is_told(talos, tmp_path):
    path = tmp_path / "walk.csv"
    robot = write_without_legs(path, talos)
    report = dynacom.repair(path, robot, fps=50.0)
    assert report.outcome == "repaired"
    report.save(tmp_path / "out", page=False)
    summary = json.loads((tmp_path / "out/summary.json").read_text())
    again = dynacom.analyze(tmp_path / "out/walk.csv", robot, fps=50.0)
    assert again.verdict.outcome == "repairable"
    assert summary["repair"]["verdict"] == "feasible"
    assert summary["repair"]["verdict_written"] == again.verdict.outcome
    assert summary["repair"]["codes_written"] == again.verdict.codes
    assert summary["notes"][-1] == (
        f"The motion is repairable ({', '.join(again.verdict.codes)}) as it was written: its file "
        "cannot hold all that was changed."
    )


def test_who_says_when_contacts_carry(talos, tmp_path):
    """The caller, and then the file does."""
    with np.load(WALKS / "talos_walk.npz") as file:
        arrays = {name: file[name] for name in ("t", "q", "contacts", "contact_names")}
    arrays["t"] = arrays["t"] / 2.0
    np.savez(tmp_path / "walk.npz", **arrays)
    active = arrays["contacts"].copy()
    active[100:110] = True
    schedule = dynacom.ContactSchedule(["left_sole", "right_sole"], active)
    assert not np.array_equal(active, arrays["contacts"])
    report = dynacom.repair(tmp_path / "walk.npz", talos, schedule=schedule)
    assert report.changed
    report.save(tmp_path / "out", page=False)
    assert_array_equal(
        dynacom.read_motion(tmp_path / "out/walk.npz", talos).schedule.active, active
    )


def test_the_page_shows_what_was_before(hurried, tmp_path):
    hurried.report.save(tmp_path / "out")
    page = (tmp_path / "out/report.html").read_text()
    assert 'class="repair good"><h2>Repair: done</h2>' in page
    assert "Written to <b>walk.npz</b>, marked as exact" in page
    assert 'id="ghost"' in page
