# SPDX-License-Identifier: BSD-2-Clause
"""What is found of a motion: arrays, summary, files."""

import csv
import json
import math
import os
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pyarrow.parquet
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import dynacom
from dynacom import (
    AnalysisOptions,
    Clip,
    ContactSchedule,
    DynacomError,
    FaultLimit,
    Motion,
    MotionReport,
    analyze,
    load_robot,
    missing_contacts,
    motion_report,
    read_motion,
)
from dynacom.robots import Robot
from helpers import WALKS, documented_columns

G = 9.81
FRAME_ARRAYS = [
    *("time", "com", "vcom", "acom", "am", "dam", "ground_force", "ground_torque"),
    *("cop", "vrp", "dcm", "nl", "residual", "feasible_acom", "feasible_dam"),
]
FILES = ["frames.parquet", "schedule.yaml", "summary.json"]
SUMMARY = [
    "clip",
    "robot",
    "mass",
    "weight",
    "frames",
    "duration",
    "frame_rate",
    "omega",
    "verdict",
    "codes",
    "distance",
    "reasons",
    "feasible_share",
    "windows",
    "statuses",
    "residual_force_rms",
    "residual_torque_rms",
    "notes",
    "derivatives",
    "cutoff",
    "cutoff_sensitivity",
    "ground",
    "ground_velocity",
    "contacts",
    "bodies",
    "seats",
    "mean_vertical_force",
    "momentum_change",
    "contact_missing",
    "unexplained",
    "measured",
    "options",
]


@pytest.fixture(scope="module")
def walk(talos: Robot) -> Clip:
    """The bundled walk, with its own derivatives, schedule and planned forces."""
    return dynacom.read_motion(WALKS / "talos_walk.npz", talos)


@pytest.fixture(scope="module")
def report(talos: Robot, walk: Clip) -> MotionReport:
    return analyze(walk, talos)


@pytest.fixture(scope="module")
def bare(walk: Clip) -> Clip:
    """The walk without all that can be found out."""
    return replace(walk, v=None, a=None, schedule=None, forces={})


@pytest.fixture(scope="module")
def found(talos: Robot, bare: Clip) -> MotionReport:
    return analyze(bare, talos, options=with_options(cutoff=6.0))


def cut(clip: Clip, frames: int) -> Clip:
    return replace(
        clip,
        time=clip.time[:frames],
        q=clip.q[:frames],
        quaternion_error=clip.quaternion_error[:frames],
    )


def with_options(**fields: object) -> AnalysisOptions:
    return replace(AnalysisOptions(), **fields)


def reason(report: MotionReport, code: str) -> dict:
    return next(entry for entry in report.summary["reasons"] if entry["code"] == code)


def assert_same(one: MotionReport, other: MotionReport, *names: str) -> None:
    for name in names or one.arrays:
        assert_array_equal(one[name], other[name], name)


# Arrays.


@pytest.mark.parametrize("flat", [True, False])
def test_arrays_are_those_of_the_steps_by_hand(talos, walk, flat):
    report = analyze(walk, talos, options=with_options(flat=flat, omega=3.1))
    robot = talos.dynacom()
    split = dynacom.splitContacts(robot)
    motion = Motion(walk.time, walk.q, walk.v, walk.a)
    contacts = dynacom.computeContactMotions(robot, motion)
    corners = dynacom.computeContactMotions(split.robot, motion)
    none = ContactSchedule([], np.zeros((318, 0), dtype=bool))
    dynamics = dynacom.analyzeMotion(split.robot, motion, none)
    inference = dynacom.inferContacts(split, corners, dynamics, True, recorded=walk.schedule)
    active = np.asarray(inference.schedule.active)
    split.robot.setGroundHeight(inference.ground[active].mean())
    parts = dynacom.analyzeMotion(split.robot, motion, inference.schedule, flat, 3.1)
    analysis = dynacom.gatherParts(robot, split, contacts, corners, parts)
    clearance = np.column_stack([corner.height for corner in corners]) - inference.ground
    expected = {name: getattr(analysis, name) for name in FRAME_ARRAYS}
    expected["status"] = [str(status) for status in analysis.status]
    for part, contact in zip(split.parts, analysis.parts, strict=True):
        expected[f"contact.{part.name}.active"] = contact.active
    for index, (contact, moved) in enumerate(zip(analysis.contacts, contacts, strict=True)):
        values = {
            "active": contact.active,
            "confidence": contact.active.astype(float),
            "force": contact.wrench[:, :3],
            "torque": contact.wrench[:, 3:],
            "cop": contact.cop,
            "friction_usage": contact.friction_usage,
            "cone_usage": dynacom.computeConeUsage(contact),
            "yaw_usage": contact.yaw_usage,
            "cop_margin": contact.cop_margin,
            "position": moved.position,
            "rotation": moved.rotation,
            "height": clearance[:, 4 * index : 4 * index + 4].min(axis=1),
            "speed": np.sqrt((moved.velocity**2).sum(axis=1)),
            "measured_force": walk.forces[contact.name][:, :3],
            "measured_torque": walk.forces[contact.name][:, 3:],
        }
        expected |= {f"contact.{contact.name}.{name}": value for name, value in values.items()}
    expected["fault"] = [""] * len(walk.time)
    expected["judged"] = [True] * len(walk.time)
    recorded = dynacom.RecordedMotion(walk.time, walk.q)
    verdict = dynacom.judgeMotion(split.robot, motion, recorded, corners, inference.ground, parts)
    for code, finding in verdict.findings.items():
        expected[f"fault.{code}"] = finding.measured
    change = dynacom.distanceToFeasible(split, corners, parts, inference.schedule)
    expected["distance"] = np.linalg.norm(change.com, axis=1)
    expected["feasible_com"] = analysis.com + change.com
    assert set(report.arrays) == set(expected)
    for name, values in expected.items():
        if name.endswith((".speed", ".height")):
            assert_allclose(report[name], values, rtol=1e-12, atol=1e-15, err_msg=name)
        else:
            assert_array_equal(report[name], values, name)
    assert report.summary["omega"] == 3.1
    assert repr(report.verdict.findings) == repr(verdict.findings)


def test_what_a_report_holds(talos, walk, report):
    assert report.clip is walk
    assert report.robot is talos
    assert_array_equal(report.motion.q, walk.q)
    assert_array_equal(report.schedule.active, walk.schedule.active)
    assert report["com"] is report.arrays["com"]
    with pytest.raises(KeyError):
        report["com_x"]
    assert "\n" not in repr(report)
    assert "arrays=" not in repr(report) and "summary=" not in repr(report)
    assert report["contact.left_sole.active"].dtype == bool
    assert report["status"].dtype.kind == "U"


def test_columns_are_those_documented(root, report, found):
    """Names and units, with measured forces and without."""
    documented = documented_columns(root, report.robot.contacts)
    for each in (report, found):
        expected = {
            name: unit
            for name, unit in documented.items()
            if each is report or ".measured_" not in name
        }
        columns = each.columns()
        assert list(columns) == list(expected)
        for name, (values, unit) in columns.items():
            assert values.shape == (len(each["time"]),)
            assert unit == expected[name], name
    assert len(expected) == len(documented) - 12


def test_columns_are_parts_of_arrays(report):
    columns = report.columns()
    for name, array in report.arrays.items():
        if array.ndim == 1:
            assert_array_equal(columns[name][0], array)
            continue
        endings = {
            2: ["_x", "_y"],
            3: ["_x", "_y", "_z"],
            4: ["_x", "_y", "_z", "_w"],
            6: [f"_{part}_{axis}" for part in ("force", "torque") for axis in "xyz"],
        }[array.shape[1]]
        for ending, values in zip(endings, array.T, strict=True):
            assert_array_equal(columns[name + ending][0], values)
    assert len(columns) == sum(a.shape[1] if a.ndim > 1 else 1 for a in report.arrays.values())


def test_points_have_no_torque(anymal):
    report = analyze(WALKS / "anymal_walk.npz", anymal)
    assert report.verdict.feasible
    for foot in anymal.contacts:
        assert not report[f"contact.{foot}.torque"].any()
        assert np.isnan(report[f"contact.{foot}.cop_margin"]).all()
        assert np.isnan(report[f"contact.{foot}.yaw_usage"]).all()
        # The plan's wrenches are of points at the ankles: their moments are not compared.
        assert f"contact.{foot}.measured_torque" not in report.arrays
        assert len(report.summary["measured"].get(foot, {"bias": [0, 0, 0]})["bias"]) == 3


def test_a_data_frame(report, monkeypatch):
    frame = report.to_dataframe()
    assert list(frame.columns) == list(report.columns())
    assert len(frame) == 318
    for name, (values, _) in report.columns().items():
        assert_array_equal(frame[name].to_numpy(), values, name)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(DynacomError, match="^a data frame needs pandas: pip install pandas$"):
        report.to_dataframe()


# The summary.


def test_the_summary(talos, report):
    summary = report.summary
    assert list(summary) == SUMMARY
    assert summary["clip"] == "talos_walk.npz"
    assert summary["robot"] == "talos"
    assert summary["mass"] == pytest.approx(talos.dynacom().getMass())
    assert summary["frames"] == 318
    assert summary["duration"] == pytest.approx(6.34)
    assert summary["frame_rate"] == pytest.approx(50.0)
    assert summary["omega"] == pytest.approx(
        np.sqrt(G / (report["com"][:, 2].mean() - np.mean([*summary["ground"].values()]))), rel=1e-4
    )
    assert summary["verdict"] == "feasible"
    assert summary["codes"] == ["feasible"]
    assert summary["statuses"] == {"Solved": 318}
    assert summary["cutoff"] is None
    assert summary["cutoff_sensitivity"] == []
    assert summary["derivatives"] in summary["notes"]
    assert summary["options"] == AnalysisOptions().to_dict()


def test_shares_of_the_contacts(report):
    """By hand: vertical forces are those of the surfaces, turned."""
    weight = report.summary["mass"] * G
    for name, contact in report.summary["contacts"].items():
        active = report[f"contact.{name}.active"]
        vertical = np.array(
            [
                (pin.Quaternion(rotation).matrix() @ force)[2]
                for rotation, force in zip(
                    report[f"contact.{name}.rotation"], report[f"contact.{name}.force"], strict=True
                )
            ]
        )
        usage = report[f"contact.{name}.friction_usage"]
        margin = report[f"contact.{name}.cop_margin"]
        assert contact == {
            "active_share": pytest.approx(active.mean()),
            "weight_share": pytest.approx(vertical.mean() / weight),
            "weight_share_while_active": pytest.approx(vertical[active].mean() / weight),
            "largest_vertical_force": pytest.approx(vertical.max() / weight),
            "largest_friction_usage": np.nanmax(usage),
            "largest_cone_usage": np.nanmax(report[f"contact.{name}.cone_usage"]),
            "least_cop_margin": np.nanmin(margin),
        }
    shares = [contact["weight_share"] for contact in report.summary["contacts"].values()]
    assert sum(shares) == pytest.approx(report.summary["mean_vertical_force"], rel=1e-9)


def test_a_contact_that_is_never_active(talos, walk):
    schedule = ContactSchedule(["left_sole"], np.ones((318, 1), dtype=bool))
    contact = analyze(walk, talos, schedule=schedule).summary["contacts"]["right_sole"]
    assert contact == {
        "active_share": 0.0,
        "weight_share": 0.0,
        "weight_share_while_active": None,
        "largest_vertical_force": 0.0,
        "largest_friction_usage": None,
        "largest_cone_usage": None,
        "least_cop_margin": None,
    }


def test_mean_vertical_force(talos, walk, report):
    """Newton over the clip: the weight, and what has changed of the momentum."""
    weight = report.summary["mass"] * G
    mean = report["ground_force"][:, 2].mean() / weight
    assert report.summary["mean_vertical_force"] == pytest.approx(mean, rel=1e-12)
    half = analyze(replace(cut(walk, 20), v=walk.v[:20], a=walk.a[:20], schedule=None, forces={}),
                   talos)  # fmt: skip
    change = half.summary["momentum_change"]
    speed = half["vcom"][[0, -1], 2]
    assert change == pytest.approx((speed[1] - speed[0]) / half.summary["duration"] / G)
    assert abs(change) > 1e-3
    assert half.summary["mean_vertical_force"] - 1.0 == pytest.approx(change, rel=0.1)


def test_reasons(report, walk, talos):
    codes = [entry["code"] for entry in report.summary["reasons"]]
    assert codes == list(report.verdict.findings)
    options = AnalysisOptions()
    options.verdict.foot_sliding = FaultLimit(1e-5, 0.1)
    options.verdict.ground_penetration = FaultLimit(1e-5, 0.9)
    strict = analyze(walk, talos, options=options)
    assert strict.summary["verdict"] == "repairable"
    assert strict.summary["codes"] == ["foot_sliding"]
    for entry, (code, finding) in zip(
        strict.summary["reasons"], strict.verdict.findings.items(), strict=True
    ):
        limit = getattr(options.verdict, code)
        assert {key: entry[key] for key in entry if key not in ("text", "unit")} == {
            "code": code,
            "holds": finding.holds,
            "frames": finding.frames,
            "share": finding.frames / 318,
            "worst": finding.worst,
            "time": finding.time,
            "subject": finding.subject or None,
            "threshold": limit.limit,
            "allowed_share": limit.allowed_share,
        }
        assert (": more than" in entry["text"]) == (finding.frames > 0)
    sliding = reason(strict, "foot_sliding")
    assert sliding["holds"] and not reason(strict, "ground_penetration")["holds"]
    assert sliding["text"] == (
        f"an active contact slides: more than 1e-05 m/s in {sliding['frames']} of 318 frames, up "
        f"to {sliding['worst']:.3g} m/s at {sliding['time']:.2f} s ({sliding['subject']})"
    )
    assert sliding["subject"] in [part.name for part in report.examination.parts]


def test_unexplained_loads_go_with_the_robot(talos, walk):
    """In the heading's axes: whoever walks elsewhere misses the same."""
    schedule = ContactSchedule(["left_sole"], np.ones((318, 1), dtype=bool))
    report = analyze(walk, talos, schedule=schedule)
    lost = report.summary["unexplained"]
    assert lost["share"] == np.mean(report["status"] != "Solved") > 0.2
    # Talos looks along x, by a little.
    mean = report["residual"].mean(axis=0)
    assert_allclose(lost["force"], mean[:3], rtol=0.05, atol=0.05 * np.linalg.norm(mean[:3]))
    assert_allclose(lost["torque"], mean[3:], rtol=0.05, atol=0.05 * np.linalg.norm(mean[3:]))
    assert np.linalg.norm(lost["torque"]) > 10.0

    turn = pin.rpy.rpyToMatrix(0.0, 0.0, 2.0)
    q = walk.q.copy()
    q[:, :3] = q[:, :3] @ turn.T
    q[:, 3:7] = [
        pin.Quaternion(turn @ pin.Quaternion(row[3:7]).matrix()).coeffs() for row in walk.q
    ]
    turned = analyze(replace(walk, q=q), talos, schedule=schedule)
    assert np.abs(turned["residual"].mean(axis=0) - mean).max() > 10.0
    for part in ("force", "torque"):
        assert_allclose(turned.summary["unexplained"][part], lost[part], rtol=0, atol=1e-6)


def test_who_leans_carries_no_load(shared_data, talos):
    """It lacks a force along the ground, with which nothing pulls all the time."""
    report = analyze(shared_data / "cases" / "lean_05cm.npz", talos)
    assert report.summary["unexplained"]["force"][0] < -0.02 * 9.81 * report.summary["mass"]
    assert not any("load" in note for note in report.summary["notes"])


def test_loads_of_nothing_are_not_told(samples):
    """A G1 that carries a box: rounding beside the largest component is 0."""
    lost = samples["sub3_largebox_003_mj.npz"].summary["unexplained"]
    (note,) = [
        text for text in samples["sub3_largebox_003_mj.npz"].summary["notes"] if "load" in text
    ]
    for value in lost["force"] + lost["torque"]:
        assert f"{value:.3g}" in note
    assert missing_contacts._vector_text(np.array([1.5, 1e-16, -0.3])) == "1.5, 0, -0.3"


def test_nothing_unexplained_is_not_mentioned(report):
    assert report.summary["unexplained"]["share"] == 0.0
    assert not any("cannot give" in note for note in report.summary["notes"])


def missing_note(report: MotionReport) -> str:
    (text,) = [note for note in report.summary["notes"] if "cannot give" in note]
    return text


def test_missing_contacts_are_a_note(talos, walk):
    """Of the walk, the right foot is left out: it is missing while the left one is in the air."""
    masks = np.asarray(walk.schedule.active).copy()
    right = list(walk.schedule.names).index("right_sole")
    alone = masks[:, right] & ~masks[:, 1 - right]
    masks[:, right] = False
    report = analyze(walk, talos, schedule=ContactSchedule(walk.schedule.names, masks))
    missing = report.summary["contact_missing"]
    time = report["time"]
    found = np.zeros(len(time), dtype=bool)
    for begin, end in missing["times"]:
        found |= (time >= begin) & (time <= end)
    assert (missing["frames"], missing["share"]) == (found.sum(), found.mean())
    assert found[alone].mean() > 0.98  # but for the end of a smeared flight
    residual = np.linalg.norm(report["residual"].reshape(-1, 2, 3), axis=2)
    residual[np.asarray(report.verdict.unsure)] = 0.0
    largest = residual[found].max(axis=0) / (9.81 * report.summary["mass"])
    assert_allclose([missing["force"], missing["torque"]], largest, rtol=1e-9)
    assert missing["force"] > 0.9  # all of the weight
    text = missing_note(report)
    assert f"in {found.sum()} of 318 frames, from {missing['times'][0][0]:.2f} to" in text
    assert f"up to {missing['force']:.2g} m g of force" in text
    assert "Either the given contacts are wrong there; or" in text


def test_what_is_missing_for_a_moment_is_not_worth_a_note(talos, walk):
    """A tenth of a second is: what is shorter interrupts no window, either."""
    step = walk.time[1] - walk.time[0]
    for frames, is_noted in ((int(0.09 / step), False), (int(0.13 / step), True)):
        masks = np.asarray(walk.schedule.active).copy()
        masks[100 : 100 + frames] = False
        report = analyze(walk, talos, schedule=ContactSchedule(walk.schedule.names, masks))
        missing = report.summary["contact_missing"]
        if is_noted:
            assert_allclose(missing["times"], [report["time"][[100, 99 + frames]]])
            assert "from" in missing_note(report)
        else:
            assert missing is None
            assert not any("cannot give" in note for note in report.summary["notes"])


def test_nothing_is_missing_of_what_is_unknown(talos, walk):
    schedule = ContactSchedule(["left_sole"], np.zeros((318, 1), dtype=bool))
    report = analyze(walk, talos, schedule=schedule)
    assert report.summary["contact_missing"]["share"] == 1.0
    short = replace(
        walk,
        time=walk.time[:4],
        q=walk.q[:4],
        v=None,
        a=None,
        schedule=None,
        forces={},
        quaternion_error=walk.quaternion_error[:4],
    )
    report = analyze(short, talos)
    assert report.summary["verdict"] == "unknown"
    assert report.summary["contact_missing"] is None


# Forces from the file.


def test_planned_forces_stand_beside_those_computed(report, walk):
    for name, compared in report.summary["measured"].items():
        measured = walk.forces[name]
        computed = np.hstack([report[f"contact.{name}.{part}"] for part in ("force", "torque")])
        assert_allclose(compared["bias"], (computed - measured).mean(axis=0), rtol=1e-9, atol=1e-9)
        rms = np.linalg.norm(computed - measured, axis=0) / math.sqrt(318)
        assert_allclose(compared["rms"], rms, rtol=1e-9)
        correlation = [
            ((a - a.mean()) * (b - b.mean())).sum()
            / math.sqrt(((a - a.mean()) ** 2).sum() * ((b - b.mean()) ** 2).sum())
            for a, b in zip(computed.T, measured.T, strict=True)
        ]
        assert_allclose(compared["correlation"], correlation, rtol=1e-9)
        # The planner shares otherwise while both feet stand, but not while one does.
        assert compared["correlation"][2] > 0.95
        assert_array_equal(report[f"contact.{name}.measured_force"], measured[:, :3])
    assert list(report.summary["measured"]) == ["left_sole", "right_sole"]
    one = report["contact.left_sole.active"] ^ report["contact.right_sole.active"]
    for name in ("left_sole", "right_sole"):
        assert_allclose(
            report[f"contact.{name}.force"][one],
            report[f"contact.{name}.measured_force"][one],
            rtol=0,
            atol=1e-8 * G * report.summary["mass"],
        )


def test_forces_that_are_not_always_known(talos, walk):
    """As of a sensor that fails: frames without numbers are left out."""
    forces = {name: values.copy() for name, values in walk.forces.items()}
    forces["left_sole"][::2, 1] = np.nan
    forces["left_sole"] = forces["left_sole"][:, :3]
    forces["right_sole"][:] = np.nan
    report = analyze(replace(walk, forces=forces), talos)
    assert list(report.summary["measured"]) == ["left_sole"]
    compared = report.summary["measured"]["left_sole"]
    difference = (report["contact.left_sole.force"] - forces["left_sole"])[1::2]
    assert_allclose(compared["bias"], difference.mean(axis=0), rtol=1e-9)
    assert "contact.left_sole.measured_torque" not in report.arrays
    assert "contact.right_sole.measured_torque" in report.arrays


def test_forces_that_never_change_do_not_correlate(talos, walk):
    forces = {"left_sole": np.zeros((318, 3))}
    compared = analyze(replace(walk, forces=forces), talos).summary["measured"]["left_sole"]
    assert compared["correlation"] == [None, None, None]


# Derivatives.


def test_own_derivatives_are_used_where_they_agree(report, walk):
    assert_array_equal(report.motion.v, walk.v)
    assert_array_equal(report.motion.a, walk.a)
    assert report.summary["derivatives"].startswith("Velocities and accelerations are the file's")


def test_own_derivatives_need_not_agree_to_rounding(talos, walk):
    """Integrators differ, and digits are cut."""
    clip = replace(walk, v=1.04 * walk.v, a=1.1 * walk.a)
    report = analyze(clip, talos)
    assert_array_equal(report.motion.v, clip.v)
    assert_array_equal(report.motion.a, clip.a)
    assert "they differ by 3.8% and 5.5% from its" in report.summary["derivatives"]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda clip: {"v": 1.25 * clip.v}, "the file's differ by 19.6% and 25.0%"),
        (lambda clip: {"v": 1.1 * clip.v}, "the file's differ by 9.0% and 10.0%"),
        (lambda clip: {"a": 2.0 * clip.a}, "the file's differ by 0.0% and "),
        (lambda clip: {"v": 0.0 * clip.v}, "the file's differ by "),
        (lambda clip: {"a": None}, "the file has velocities only"),
        (lambda clip: {"v": None}, "the file has none"),
        (lambda clip: {"v": None, "a": None}, "the file has none"),
    ],
)
def test_else_they_are_computed(talos, walk, change, why):
    """And the report says so, and why."""
    report = analyze(replace(walk, **change(walk)), talos, options=with_options(cutoff=6.0))
    q = dynacom.filterConfigurations(talos.model, walk.q, 50.0, 6.0)
    expected = dynacom.differentiate(talos.model, walk.time, q)
    for name in ("q", "v", "a"):
        values = getattr(expected, name)
        size = np.abs(values).max()
        assert_allclose(getattr(report.motion, name), values, rtol=0, atol=1e-9 * size)
    assert_array_equal(report.motion.time, walk.time)
    assert report.summary["cutoff"] == 6.0
    text = report.summary["derivatives"]
    assert text.startswith("Velocities and accelerations are computed from the positions, after a")
    assert "Butterworth" in text and "at 6 Hz" in text
    assert why in text
    assert text in report.summary["notes"]


def test_the_cut_off_that_suits(talos, bare):
    """A plan is exact; with a millimetre of noise it is not; and who says what is believed."""
    report = analyze(bare, talos)
    assert report.summary["cutoff"] is None
    assert report.summary["cutoff_sensitivity"] == []
    assert "The motion is exact" in report.summary["derivatives"]
    assert_array_equal(report.motion.q, bare.q)
    q = bare.q.copy()
    q[:, :3] += 1e-3 * np.random.default_rng(0).standard_normal((len(q), 3))
    noisy = replace(bare, q=q)
    report = analyze(noisy, talos)
    assert report.summary["cutoff"] == 6.0
    assert [entry["cutoff"] for entry in report.summary["cutoff_sensitivity"]] == [3.0, 6.0, 12.0]
    text = report.summary["derivatives"]
    assert "the motion is not exact" in text and "more than 0.01 g" in text
    # At 12.5 frames a second there is no room for 6 Hz.
    slow = analyze(replace(cut(noisy, 80), time=bare.time[:80] * 4.0), talos)
    assert slow.summary["cutoff"] == pytest.approx(0.3 * 12.5)
    assert "only 12.5 frames a second" in slow.summary["derivatives"]
    assert "Those of " in slow.summary["derivatives"]


def test_no_filter(talos, bare):
    report = analyze(bare, talos, options=with_options(cutoff=None))
    expected = dynacom.differentiate(talos.model, bare.time, bare.q)
    assert_array_equal(report.motion.q, bare.q)
    assert_allclose(report.motion.a, expected.a, rtol=0, atol=1e-8 * np.abs(expected.a).max())
    assert report.summary["cutoff"] is None
    assert report.summary["cutoff_sensitivity"] == []
    assert "without a filter" in report.summary["derivatives"]


def test_how_much_hangs_on_the_cut_off(talos, bare, found):
    """At half, once and twice, with the same contacts."""
    entries = found.summary["cutoff_sensitivity"]
    assert [entry["cutoff"] for entry in entries] == [3.0, 6.0, 12.0]
    for entry in entries:
        other = analyze(
            bare, talos, schedule=found.schedule, options=with_options(cutoff=entry["cutoff"])
        )
        force, torque = np.split(other["residual"] / (G * found.summary["mass"]), 2, axis=1)
        assert entry == {
            "cutoff": entry["cutoff"],
            "residual_force_rms": pytest.approx(np.sqrt((force**2).sum(axis=1).mean()), rel=1e-6),
            "residual_torque_rms": pytest.approx(np.sqrt((torque**2).sum(axis=1).mean()), rel=1e-6),
            "relaxed_share": np.mean(other["status"] == "Relaxed"),
            "verdict": other.summary["verdict"],
            "codes": other.summary["codes"],
        }
    assert entries[0]["residual_force_rms"] != entries[2]["residual_force_rms"]


@pytest.mark.parametrize(
    ("cutoff", "expected"), [(9.9, [4.95, 9.9, 19.8]), (10.0, [5.0, 10.0]), (19.9, [9.95, 19.9])]
)
def test_cut_offs_above_the_limit_are_left_out(talos, bare, cutoff, expected):
    report = analyze(cut(bare, 60), talos, options=with_options(cutoff=cutoff))
    assert [entry["cutoff"] for entry in report.summary["cutoff_sensitivity"]] == expected


@pytest.mark.parametrize("cutoff", [20.0, 25.0, 1e6])
def test_cut_offs_that_are_too_high(talos, bare, walk, cutoff):
    message = (
        f"talos_walk.npz: cutoff must be > 0 and < 20 Hz, which is 0.4 of the frame rate, "
        f"got {cutoff:g} Hz"
    )
    with pytest.raises(DynacomError, match=re.escape(message)):
        analyze(bare, talos, options=with_options(cutoff=cutoff))
    # Where nothing is filtered it does not matter.
    assert analyze(walk, talos, options=with_options(cutoff=cutoff)).verdict.feasible


def test_uneven_times(talos, bare):
    """Cannot be filtered, but differentiated."""
    time = bare.time.copy()
    time[100:] += 0.01
    uneven = replace(bare, time=time)
    message = (
        "times must be evenly spaced to be filtered, got steps from 0.02 to 0.03 s; without a "
        "filter (cutoff 0) they need not be"
    )
    with pytest.raises(DynacomError, match=re.escape(f"talos_walk.npz: {message}")):
        analyze(uneven, talos, options=with_options(cutoff=6.0))
    report = analyze(uneven, talos, options=with_options(cutoff=None))
    expected = dynacom.differentiate(talos.model, time, bare.q)
    assert_array_equal(report.motion.a, expected.a)
    assert report.summary["frame_rate"] is None


@pytest.mark.parametrize(("rate", "digits"), [(60.0, 3), (120.0, 3), (30.0, 2), (24.0, 3)])
def test_times_that_are_rounded_are_even(talos, bare, rate, digits):
    """Else the rounding would be in the accelerations."""
    time = np.arange(318) / rate
    expected = analyze(replace(bare, time=time), talos)
    rounded = replace(bare, time=np.round(time, digits))
    if digits == 2:
        with pytest.raises(DynacomError, match="times must be evenly spaced"):
            analyze(rounded, talos)
        return
    report = analyze(rounded, talos)
    assert_array_equal(report["time"], rounded.time)
    assert report.summary["frame_rate"] == pytest.approx(rate, rel=1e-3)
    size = np.abs(expected["acom"]).max()
    assert_allclose(report["acom"], expected["acom"], rtol=0, atol=5e-3 * size)
    error = np.abs(rounded.time - np.linspace(0.0, rounded.time[-1], 318)).max()
    if rate != 30.0:
        assert (
            f"with times made even, by up to {1e3 * error:.2g} ms"
            in (report.summary["derivatives"])
        )
    assert "made even" not in expected.summary["derivatives"]


# Contacts.


def test_the_schedule_found(report, found):
    """With derivatives from filtered positions, although take-offs are gradual there."""
    assert "Contacts are active as the file says." in report.summary["notes"]
    assert (
        "Contacts are found from where the feet are and from what the motion needs."
        in found.summary["notes"]
    )
    assert found.schedule.names == report.schedule.names
    for active, planned in zip(found.schedule.active.T, report.schedule.active.T, strict=True):
        assert len(edges(active)) == len(edges(planned)) >= 6
        assert np.abs(edges(active) - edges(planned)).max() <= 3
    assert found.verdict.feasible


@pytest.mark.parametrize("name", ["talos_walk", "anymal_walk", "anymal_trot"])
def test_the_schedule_found_with_the_file_s_derivatives(root, name):
    """That of the plan within two frames."""
    robot = load_robot("talos" if name == "talos_walk" else "anymal_c")
    clip = read_motion(root / f"examples/data/{name}.npz", robot)
    found = analyze(replace(clip, schedule=None), robot).schedule
    planned = dict(zip(clip.schedule.names, clip.schedule.active.T, strict=True))
    for contact, active in zip(found.names, found.active.T, strict=True):
        assert len(edges(active)) == len(edges(planned[contact])) >= 4
        assert np.abs(edges(active) - edges(planned[contact])).max() <= 2


def edges(active: np.ndarray) -> np.ndarray:
    return np.flatnonzero(np.diff(active.astype(int)))


@pytest.mark.parametrize("known", [True, False])
def test_the_walk_is_in_reach_to_rounding(talos, walk, known):
    """With the schedule of the file, and with the one found."""
    report = analyze(walk if known else replace(walk, schedule=None), talos)
    assert set(report["status"]) == {"Solved"}
    weight = G * report.summary["mass"]
    assert np.abs(report["residual"]).max() < 1e-9 * weight
    assert report.summary["codes"] == ["feasible"]


def test_schedules_given(talos, walk, tmp_path):
    active = np.ones((318, 1), dtype=bool)
    schedule = ContactSchedule(["right_sole"], active)
    report = analyze(walk, talos, schedule=schedule)
    assert "Contacts are active as the caller says." in report.summary["notes"]
    assert report["contact.right_sole.active"].all()
    assert not report["contact.left_sole.active"].any()
    path = tmp_path / "schedule.yaml"
    path.write_text("right_sole: [[0, 9]]\n")
    other = analyze(walk, talos, schedule=path)
    assert f"Contacts are active as {path} says." in other.summary["notes"]
    assert_same(other, report)


def test_schedules_that_do_not_fit(talos, walk, tmp_path):
    for schedule, message in (
        (ContactSchedule(["left_sole"], np.ones((5, 1), dtype=bool)), "active must have 318"),
        (ContactSchedule(["hand"], np.ones((318, 1), dtype=bool)), "'hand'; known: 'left_sole'"),
    ):
        with pytest.raises(DynacomError, match=f"talos_walk.npz: .*{message}"):
            analyze(walk, talos, schedule=schedule)
    path = tmp_path / "schedule.yaml"
    path.write_text("hand: []\n")
    with pytest.raises(DynacomError, match="schedule.yaml: contact must be one of left_sole, "):
        analyze(walk, talos, schedule=path)


def test_the_ground_given(talos, walk):
    options = AnalysisOptions()
    options.detection.ground_height = -0.1
    report = analyze(replace(walk, schedule=None), talos, options=options)
    assert report.summary["ground"] == {"left_sole": None, "right_sole": None}
    assert_allclose(report.examination.ground, -0.1, rtol=0, atol=1e-12)
    assert report.summary["statuses"] == {"NoContact": 318}
    assert report.summary["codes"] == ["flight_with_support_needed"]
    assert_allclose(report["contact.left_sole.height"].min(), 0.1, atol=2e-3)
    omega = np.sqrt(G / (report["com"][:, 2].mean() + 0.1))
    assert report.summary["omega"] == pytest.approx(omega)


# Files.


def test_files(report, tmp_path):
    paths = report.save(tmp_path / "out", csv=True, page=False)
    assert paths == [tmp_path / "out" / name for name in ["frames.csv", *FILES]]
    assert sorted(os.listdir(tmp_path / "out")) == ["frames.csv", *FILES]
    paths = report.save(str(tmp_path / "other"), page=False)
    assert paths == [tmp_path / "other" / name for name in FILES]


def test_parquet(report, tmp_path):
    report.save(tmp_path, page=False)
    table = pyarrow.parquet.read_table(tmp_path / "frames.parquet")
    columns = report.columns()
    assert table.column_names == list(columns)
    for name, (values, unit) in columns.items():
        assert table.schema.field(name).metadata == {b"unit": unit.encode()}
        read = table[name].to_numpy()
        assert_array_equal(read, values, name)
        assert read.dtype.kind == {"U": "O"}.get(values.dtype.kind, values.dtype.kind)
    assert table.schema.metadata == {b"clip": b"talos_walk.npz", b"robot": b"talos"}


def test_csv(report, tmp_path):
    """Every number as it was computed."""
    report.save(tmp_path, csv=True, page=False)
    with (tmp_path / "frames.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    columns = report.columns()
    assert header == list(columns)
    assert len(rows) == 318
    for cells, (name, (values, _)) in zip(zip(*rows, strict=True), columns.items(), strict=True):
        if values.dtype.kind == "U":
            assert list(cells) == list(values)
        elif values.dtype.kind == "b":
            assert list(cells) == ["01"[int(value)] for value in values]
        else:
            assert_array_equal([float(cell) for cell in cells], values, name)
    assert any("nan" in row for row in rows)


def test_names_that_csv_must_quote(talos, walk, tmp_path):
    name = 'left, "[b]sole"'
    contacts = {name: talos.contacts["left_sole"], "right_sole": talos.contacts["right_sole"]}
    robot = replace(talos, contacts=contacts)
    schedule = ContactSchedule([name, "right_sole"], walk.schedule.active)
    report = analyze(replace(walk, schedule=None, forces={}), robot, schedule=schedule)
    report.save(tmp_path, csv=True, page=False)
    with (tmp_path / "frames.csv").open(newline="") as file:
        assert next(csv.reader(file)) == list(report.columns())
    again = dynacom.read_schedule(tmp_path / "schedule.yaml", walk.time, [name, "right_sole"])
    assert_array_equal(again.active, schedule.active)


def test_summary_json(report, found, tmp_path):
    for each in (report, found):
        each.save(tmp_path, page=False)
        text = (tmp_path / "summary.json").read_text(encoding="utf-8")

        def refuse(constant: str) -> None:
            raise AssertionError(f"{constant} is not JSON")

        assert json.loads(text, parse_constant=refuse) == each.summary


def test_no_number_is_null(talos, walk, tmp_path):
    """As omega far below the ground."""
    options = AnalysisOptions()
    options.detection.ground_height = 100.0
    report = analyze(walk, talos, options=options)
    assert report.summary["omega"] is None
    assert np.isnan(report["vrp"]).all() and np.isnan(report["dcm"]).all()
    report.save(tmp_path, page=False)
    assert json.loads((tmp_path / "summary.json").read_text())["omega"] is None


def test_the_schedule_written_gives_the_same_again(talos, bare, found, tmp_path):
    found.save(tmp_path, page=False)
    options = with_options(cutoff=6.0)
    again = analyze(bare, talos, schedule=tmp_path / "schedule.yaml", options=options)
    assert_same(again, found, *(name for name in found.arrays if "confidence" not in name))
    assert again.verdict.feasible == found.verdict.feasible
    differs = {
        key for key in SUMMARY if again.summary[key] != found.summary[key]
    }  # fmt: skip
    assert differs == {"notes"}


def test_other_files_stay(report, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "summary.json").write_text("old")
    report.save(tmp_path, page=False)
    assert sorted(os.listdir(tmp_path)) == sorted([*FILES, "notes.txt"])
    assert (tmp_path / "notes.txt").read_text() == "mine"
    assert json.loads((tmp_path / "summary.json").read_text())["frames"] == 318


@pytest.mark.parametrize("existed", [False, True])
@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(28, "No space left on device")])
@pytest.mark.parametrize("step", ["_write_tables", "write_schedule"])
def test_all_files_or_none(report, tmp_path, monkeypatch, existed, error, step):
    """Whatever fails, and whenever Ctrl-C comes."""
    out = tmp_path / "out"
    if existed:
        report.save(out, csv=True, page=False)
        (out / "frames.csv").write_text("old")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}

    place = motion_report if step == "write_schedule" else MotionReport
    write = getattr(place, step)

    def fail(*arguments: object) -> None:
        write(*arguments)
        raise error

    monkeypatch.setattr(place, step, fail)
    expected = DynacomError if isinstance(error, OSError) else KeyboardInterrupt
    with pytest.raises(expected) as caught:
        report.save(out, csv=True, page=False)
    if expected is DynacomError:
        assert str(caught.value) == f"{out}: cannot be written (No space left on device)"
    assert out.exists() == existed
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_folders_that_cannot_be_written_to(report, tmp_path):
    file = tmp_path / "file"
    file.write_text("mine")
    for path, part in ((file, "File exists"), (file / "out", "Not a directory")):
        with pytest.raises(DynacomError, match=re.escape(f"{path}: cannot be written ({part})")):
            report.save(path, page=False)
    (tmp_path / "summary.json").mkdir()
    with pytest.raises(DynacomError, match=r"cannot be written \(summary.json is a folder\)"):
        report.save(tmp_path, page=False)
    assert sorted(os.listdir(tmp_path)) == ["file", "summary.json"]
    assert file.read_text() == "mine"


def test_without_pyarrow(report, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    out = tmp_path / "out"
    with pytest.raises(DynacomError, match=r"^frames.parquet needs pyarrow: pip install dynacom\["):
        report.save(out, page=False)
    assert not out.exists()


# What is analysed.


def test_files_and_names_instead_of_objects(report, talos):
    other = analyze(str(WALKS / "talos_walk.npz"), "talos")
    assert_same(other, report)
    assert other.summary == report.summary
    assert analyze(Path(WALKS / "talos_walk.npz"), talos).summary == report.summary


def test_a_payload_is_carried(talos, walk, report):
    """By the ground, too: m g more of it, and the soles bear it."""
    loaded = analyze(walk, talos.with_payload("torso_2_link", 12.0, (0.1, 0.0, 0.2)))
    assert loaded.summary["mass"] == pytest.approx(report.summary["mass"] + 12.0)
    more = loaded["ground_force"] - report["ground_force"]
    assert more[:, 2].mean() == pytest.approx(12.0 * G, rel=0.01)
    borne = [
        each.summary["contacts"][name]["weight_share"] * each.summary["mass"]
        for each in (loaded, report)
        for name in talos.contacts
    ]
    assert sum(borne[:2]) - sum(borne[2:]) == pytest.approx(12.0, rel=0.01)
    assert (loaded["com"][:, 2] > report["com"][:, 2]).all()


def test_progress(talos, bare, walk):
    for clip in (bare, walk):
        parts = []
        options = with_options(cutoff=6.0)
        analyze(clip, talos, options=options, threads=1, progress=parts.append)
        assert parts == sorted(parts)
        assert parts[0] > 0.0 and parts[-1] == 1.0
        # Each cut-off is as much work.
        assert len(parts) >= (6 if clip is bare else 2)


def test_progress_that_raises(talos, bare):
    def stop(part: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        analyze(bare, talos, progress=stop)


def test_a_robot_without_contacts(talos, bare):
    """It ought to fall."""
    report = analyze(bare, replace(talos, contacts={}), sensitivity=False)
    assert report.summary["codes"] == ["flight_with_support_needed"]
    assert report.summary["statuses"] == {"NoContact": len(bare.time)}
    assert "The robot has no contacts." in report.summary["notes"]


def test_options_are_not_kept(talos, walk):
    """What the summary says of them was so when the motion was analysed."""
    options = AnalysisOptions()
    report = analyze(walk, talos, options=options)
    options.verdict.foot_sliding.limit = 9.0
    assert report.summary["options"] == AnalysisOptions().to_dict()


@pytest.mark.parametrize("frames", [1, 2, 3, 5])
def test_short_clips(talos, bare, frames, tmp_path):
    """Talos stands: in a few frames nobody knows how it moves."""
    report = analyze(cut(bare, frames), talos)
    assert report.summary["verdict"] == "unknown"
    assert report.summary["codes"] == ["too_short"]
    assert report.summary["windows"] == []
    assert report.summary["statuses"] == {"Solved": frames}
    assert report.summary["frame_rate"] == (None if frames == 1 else pytest.approx(50.0))
    assert report.summary["mean_vertical_force"] == pytest.approx(1.0, abs=0.01)
    assert report["com"].shape == (frames, 3)
    if frames < 3:
        assert not report.motion.a.any()
    if frames == 1:
        assert report.summary["cutoff"] is None
        assert report.summary["duration"] == report.summary["momentum_change"] == 0.0
        assert "without a filter" in report.summary["derivatives"]
    report.save(tmp_path, csv=True, page=False)
    assert pyarrow.parquet.read_table(tmp_path / "frames.parquet").num_rows == frames
    again = analyze(cut(bare, frames), talos, schedule=tmp_path / "schedule.yaml")
    assert_same(again, report, *(name for name in report.arrays if "confidence" not in name))


def test_the_clip_s_notes_are_in_the_report(talos, walk):
    report = analyze(replace(walk, notes=("Something was assumed.",)), talos)
    assert report.summary["notes"][0] == "Something was assumed."


def test_the_record_counts_for_jumps(talos, bare):
    """As they were in the file, before any filter. The norms of quaternions are none's fault."""
    error = bare.quaternion_error.copy()
    error[7] = 0.05
    q = bare.q.copy()
    q[100:, 0] += 0.3
    report = analyze(replace(bare, q=q, quaternion_error=error), talos)
    assert report.summary["codes"] == ["discontinuity"]
    jump = reason(report, "discontinuity")
    assert (jump["time"], jump["frames"], jump["subject"]) == (bare.time[99], 2, "root")
    assert jump["text"].startswith("the motion jumps: more than 1 of the greatest speed in 2 of")
    assert jump["text"].endswith("(root)")
    # Before and after it the walk is what it was.
    assert report["fault"][[98, 99, 100, 101]].tolist() == [
        "",
        "discontinuity",
        "discontinuity",
        "",
    ]
    first, second = report.summary["windows"]
    assert (first[0], second[1]) == (bare.time[0], bare.time[-1])
    assert first[1] <= bare.time[98] and second[0] >= bare.time[101]
    assert report.summary["feasible_share"] > 0.9


def test_what_each_frame_is_at_fault_for(talos, walk):
    """Of the frame's own values."""
    schedule = ContactSchedule(["left_sole"], np.arange(318)[:, None] < 300)
    options = AnalysisOptions()
    options.verdict.foot_sliding.limit = 1e-4
    report = analyze(walk, talos, schedule=schedule, options=options)
    weight = G * report.summary["mass"]
    residual = np.linalg.norm(report["residual"].reshape(318, 2, 3), axis=2) / weight
    active = report["contact.left_sole.active"]
    expected = {
        "residual_force": active & (residual[:, 0] > 0.1),
        "residual_torque": active & (residual[:, 1] > 0.03),
        "flight_with_support_needed": ~active & (residual.max(axis=1) > 0.05),
    }
    faults = [text.split("+") for text in report["fault"]]
    for code, beyond in expected.items():
        assert_array_equal([code in fault for fault in faults], beyond, code)
        assert 0 < beyond.sum() < 318 or code == "residual_force"
    for code, finding in report.verdict.findings.items():
        assert sum(code in fault for fault in faults) == finding.frames
    assert {len(fault) for fault in faults} >= {1, 2, 3}
    assert "" in report["fault"]


def test_cone_usage_is_of_the_cone(talos, report):
    """Around the ground's normal: soles are tilted a little."""
    for name, settings in talos.contacts.items():
        force = np.array(
            [
                pin.Quaternion(rotation) * own
                for rotation, own in zip(
                    report[f"contact.{name}.rotation"],
                    report[f"contact.{name}.force"],
                    strict=True,
                )
            ]
        )
        loaded = force[:, 2] > 1.0
        usage = np.linalg.norm(force[:, :2], axis=1)[loaded] / (settings.mu * force[loaded, 2])
        assert_allclose(report[f"contact.{name}.cone_usage"][loaded], usage, rtol=1e-9)
        assert_allclose(report[f"contact.{name}.friction_usage"][loaded], usage, rtol=1e-9)
        largest = report.summary["contacts"][name]["largest_cone_usage"]
        assert largest == pytest.approx(usage.max(), rel=1e-9)


def test_a_normal_that_points_down_is_said_first(shared_data, tmp_path):
    cases = shared_data / "cases"
    sole = "half_length=0.1,half_width=0.05,mu=0.7,gu=0.05"
    robot = dynacom.make_robot(cases / "zdown.urdf", [f"{side}_sole:6d:{sole}" for side in "lr"])
    report = analyze(cases / "full.csv", robot)
    notes = report.summary["notes"]
    for note, side in zip(notes, "lr", strict=False):
        assert note.startswith(f"{side}_sole's normal points down (the z axis of the frame")
        assert "component of -1.00" in note
    assert not any("load" in note for note in notes)
    assert report.summary["verdict"] == "not feasible"
    assert report.summary["codes"] == ["downward_normal"]
    assert report.summary["windows"] == []
    assert reason(report, "downward_normal")["subject"] == "l_sole"
    assert (report["fault"] == "downward_normal").all()
    report.save(tmp_path)
    assert "downward_normal" in (tmp_path / "report.html").read_text()
    (row,) = dynacom.batch(cases / "full.csv", robot).to_pylist()
    assert (row["verdict"], row["codes"]) == ("not feasible", ["downward_normal"])
    assert (row["downward_normal.frames"], row["feasible_share"]) == (101, 0.0)
    assert row["downward_normal.worst"] == pytest.approx(np.pi / 2)


def test_leaning_beyond_the_toes(shared_data, talos):
    """Talos stands still, its CoM 5 cm in front of them."""
    report = analyze(shared_data / "cases" / "lean_05cm.npz", talos)
    assert report.summary["codes"] == ["cop_outside"]
    assert reason(report, "cop_outside")["worst"] == pytest.approx(0.05, abs=0.002)
    assert report.summary["windows"] == []
    missing = report.summary["contact_missing"]
    assert (missing["frames"], missing["share"]) == (101, 1.0)
    assert missing["times"] == [[0.0, 1.0]]
    assert missing["distance"] == pytest.approx(0.05, abs=0.002)


# The samples.

CLIPS = {
    "J_Dance0_StepTouch.csv": {"fps": 60.0},
    "B_HandsUp.csv": {"fps": 60.0},
    "B_HandsUp.npz": {},
    "sub3_largebox_003_mj.npz": {},
    "squat_level1.pkl": {"trust": True},
}


@pytest.fixture(scope="module")
def samples(shared_data: Path) -> dict[str, MotionReport]:
    robot = dynacom.load_robot("g1")
    return {name: analyze(shared_data / name, robot, **given) for name, given in CLIPS.items()}


@pytest.mark.parametrize("name", CLIPS)
def test_the_ground_bears_the_weight(samples, name):
    """On average, but for what has changed of the momentum: the box clip ends moving upwards."""
    summary = samples[name].summary
    mean, change = summary["mean_vertical_force"], summary["momentum_change"]
    assert mean - change == pytest.approx(1.0, abs=0.01)
    if name.startswith(("J_Dance0", "B_HandsUp")):
        assert mean == pytest.approx(1.0, abs=0.01)


def test_both_files_of_a_clip_give_the_same_forces(samples):
    """Within one part in a hundred of the weight; the archive ends a frame earlier, and so does
    what the filter knows: there is more in the last tenth of a second."""
    csv, npz = samples["B_HandsUp.csv"], samples["B_HandsUp.npz"]
    frames = len(npz["time"])
    assert frames == 441
    weight = G * npz.summary["mass"]
    for name in ("left_sole", "right_sole"):
        assert_array_equal(csv[f"contact.{name}.active"][:frames], npz[f"contact.{name}.active"])
        difference = csv[f"contact.{name}.force"][:frames] - npz[f"contact.{name}.force"]
        assert np.linalg.norm(difference, axis=1)[:-6].max() < 0.01 * weight
        assert np.linalg.norm(difference, axis=1).max() < 0.025 * weight
    difference = np.linalg.norm(csv["ground_force"][:frames] - npz["ground_force"], axis=1)
    assert difference[:-6].max() < 0.006 * weight
    assert difference.max() < 0.025 * weight
    assert np.median(difference) < 1e-4 * weight


def test_hands_up(samples):
    """Both feet stand all the time, but tilted: their heels are 4 cm up, and carry nothing."""
    for name in ("B_HandsUp.csv", "B_HandsUp.npz"):
        report = samples[name]
        for foot in report.robot.contacts:
            assert report[f"contact.{foot}.active"].all()
            assert report[f"contact.{foot}.front_left.active"].all()
            text = f"{foot} is tilted: its rear_left and rear_right rest"
            assert any(text in note for note in report.summary["notes"])
        assert "residual_force" not in report.summary["codes"]
        assert "cop_outside" in report.summary["codes"]


def test_a_dance_steps(samples):
    report = samples["J_Dance0_StepTouch.csv"]
    assert not report.verdict.feasible
    for foot in report.robot.contacts:
        active = report[f"contact.{foot}.active"]
        assert 0.7 < active.mean() < 0.95
        steps = edges(active)
        assert 12 <= len(steps) < 60
        assert np.diff(report["time"][steps]).min() > 0.05
    assert not reason(report, "discontinuity")["holds"]
    assert report.summary["windows"]
    # What is missing has no direction: it is no load.
    assert any("cannot give" in note for note in report.summary["notes"])
    assert not any("load" in note for note in report.summary["notes"])


@pytest.mark.parametrize(
    ("name", "joint", "frames"),
    [
        ("B_Fence2.csv", "right_shoulder_yaw_joint", 2),
        ("J_Dance5_Hype.csv", "left_shoulder_pitch_joint", 10),
    ],
)
def test_clips_with_jumps_are_judged(shared_data, name, joint, frames):
    report = analyze(shared_data / "clips" / name, "g1", fps=60.0, sensitivity=False)
    assert "discontinuity" in report.summary["codes"]
    jump = reason(report, "discontinuity")
    assert (jump["subject"], jump["frames"]) == (joint, frames)
    assert joint in jump["text"]
    # As the differences of the file's angles have it.
    model = report.robot.model
    column = model.joints[model.getJointId(joint)].idx_q
    speed = np.abs(np.diff(report.clip.q[:, column])) * 60.0
    assert jump["worst"] == pytest.approx(speed.max() / 50.0, rel=1e-9)


def test_a_box_is_not_hidden(samples):
    """It is known to nobody but the robot that carries it: much of the clip is out of reach."""
    report = samples["sub3_largebox_003_mj.npz"]
    assert not report.verdict.feasible
    lost = report.summary["unexplained"]
    assert lost["share"] > 0.3
    assert np.linalg.norm(lost["torque"]) > 1.0
    assert any("cannot give" in note for note in report.summary["notes"])
    assert any("load" in note for note in report.summary["notes"])
    holding = [entry for entry in report.summary["reasons"] if entry["holds"]]
    assert {entry["code"] for entry in holding} == set(report.summary["codes"])


def test_a_clip_that_floats(samples):
    """Estimated from a video: the feet are high up but in the squat, and slide; it needs them.

    Toes are back at the height of standing a third of a second after they carry.
    """
    report = samples["squat_level1.pkl"]
    assert report.summary["codes"] == ["ground_penetration", "foot_sliding"]
    assert any("23 joints" in note for note in report.summary["notes"])
    assert [entry["cutoff"] for entry in report.summary["cutoff_sensitivity"]] == [3.0, 6.0]
