# SPDX-License-Identifier: BSD-2-Clause
"""Small motions of which it is known what is true: ../shared/data/cases/README.md."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import dynacom
from dynacom import MotionReport
from dynacom.schedule_file import read_schedule


@pytest.fixture(scope="module")
def cases(shared_data: Path) -> Path:
    folder = shared_data / "cases"
    if not folder.is_dir():
        pytest.skip("there are no cases")
    return folder


def millimetres(report: MotionReport) -> float:
    """The distance to feasible."""
    distance = report.summary["distance"]
    assert distance["converged"]
    assert np.sqrt(np.mean(report["distance"] ** 2)) == pytest.approx(distance["rms"])
    return 1e3 * distance["rms"]


def judge(path: Path, robot: object = "talos", **arguments: object) -> MotionReport:
    return dynacom.analyze(path, robot, sensitivity=False, **arguments)


def active(report: MotionReport, name: str) -> np.ndarray:
    return report[f"contact.{name}.active"]


def verdict(report: MotionReport) -> tuple[str, list[str]]:
    return report.summary["verdict"], report.summary["codes"]


def note(report: MotionReport, text: str) -> bool:
    return any(text in entry for entry in report.summary["notes"])


def changes(values: np.ndarray) -> np.ndarray:
    return np.flatnonzero(np.diff(values.astype(int)))


def assert_schedule(report: MotionReport, path: Path, frames: int) -> None:
    """As a file says, up to so many frames at each change."""
    truth = read_schedule(path, report.clip.time, list(report.robot.contacts))
    for name, expected in zip(truth.names, np.asarray(truth.active).T, strict=True):
        found = changes(active(report, name))
        assert_allclose(found, changes(expected), rtol=0, atol=frames, err_msg=name)


def test_a_raised_foot(cases):
    """The CoM is 2.5 cm outside the left sole, and the right foot is in the air, 5 cm up."""
    report = judge(cases / "fallonefoot_05cm.npz")
    assert verdict(report) == ("not feasible", ["cop_outside"])
    assert active(report, "left_sole").all()
    assert not active(report, "right_sole").any()
    assert report.summary["ground"]["right_sole"] is None
    assert note(report, "right_sole rests 5 cm up")
    worst = report.verdict.findings["cop_outside"].worst
    assert worst == pytest.approx(0.025, abs=0.002)
    assert 20.0 < millimetres(report) < 30.0


def test_leaning(cases):
    """The CoM is 5 cm in front of the toes."""
    report = judge(cases / "lean_05cm.npz")
    assert verdict(report) == ("not feasible", ["cop_outside"])
    worst = report.verdict.findings["cop_outside"].worst
    assert worst == pytest.approx(0.05, abs=0.002)
    assert 45.0 < millimetres(report) < 60.0
    # Back over the toes, that is, and neither up nor down.
    moved = report["feasible_com"] - report["com"]
    assert (moved[:, 0] < -0.04).all()
    assert np.abs(moved[:, 1:]).max() < 0.005


def test_leaning_on_the_moon(cases):
    """Who falls here falls there, only slower."""
    moon = dynacom.load_robot("talos").with_gravity(1.62)
    report = judge(cases / "lean_05cm.npz", moon)
    assert verdict(report) == ("not feasible", ["cop_outside"])
    assert report.summary["weight"] == pytest.approx(1.62 * report.summary["mass"])
    assert 45.0 < millimetres(report) < 60.0
    assert note(report, "m g is the weight there")
    # Without gravity, nothing leans.
    nowhere = judge(cases / "lean_05cm.npz", dynacom.load_robot("talos").with_gravity(0.0))
    assert nowhere.summary["verdict"] == "feasible"
    assert nowhere.summary["weight"] == pytest.approx(9.81 * report.summary["mass"])


def test_on_the_edges_of_tilted_soles(cases):
    """The heels are 10 cm up and the CoM 15 cm behind the front edges, which alone carry."""
    report = judge(cases / "tiptoe30_heel.npz")
    assert report.summary["verdict"] == "not feasible"
    assert "cop_outside" in report.summary["codes"]
    for name in ("left_sole", "right_sole"):
        for side in ("left", "right"):
            assert report[f"contact.{name}.front_{side}.active"].all()
            assert not report[f"contact.{name}.rear_{side}.active"].any()
        assert note(report, f"{name} is tilted: its rear_left and rear_right rest 10 cm up")
    worst = report.verdict.findings["cop_outside"].worst
    assert worst == pytest.approx(0.15, abs=0.005)
    assert 130.0 < millimetres(report) < 170.0
    # They are no feet that are held in the air.
    assert not note(report, "say by --schedule")


def test_a_jump(cases):
    """Its forces exist; at take-off and landing two frames of 385 are off, without any filter."""
    report = judge(cases / "hyq_jump.npz", cases / "hyq.yaml")
    assert verdict(report) == ("feasible", ["feasible"])
    flight = ~np.any([active(report, name) for name in report.robot.contacts], axis=0)
    assert flight.any()
    assert len(changes(flight)) == 2
    weight = report.summary["mass"] * 9.81
    assert np.abs(report["ground_force"][flight]).max() < 0.05 * weight
    # Neither rounding in the air nor two frames are worth a word.
    assert report.summary["contact_missing"] is None
    assert not note(report, "cannot give")


def test_a_slope(cases):
    report = judge(cases / "slope3.npz")
    assert verdict(report) == ("feasible", ["feasible"])
    assert_schedule(report, cases / "slope3.schedule.yaml", 2)
    assert note(report, "The ground is a slope of 3.0 degrees, which rises towards")
    assert report.summary["distance"]["largest"] == 0.0
    # Who walks steadily asks of the ground what its weight does; forces have the slope's normal.
    active = np.asarray(report.examination.inference.schedule.active)
    for index, contact in enumerate(report.examination.analysis.contacts):
        whole = active[:, 4 * index : 4 * index + 4].all(axis=1)
        usage = np.median(contact.friction_usage[whole])
        limit = report.robot.contacts[contact.name].mu
        assert usage == pytest.approx(np.tan(np.radians(3.0)) / limit, rel=0.01)


def test_stairs(cases):
    report = judge(cases / "stairs.npz")
    assert verdict(report) == ("feasible", ["feasible"])
    assert_schedule(report, cases / "stairs.schedule.yaml", 2)
    assert report.summary["distance"]["largest"] == 0.0
    assert note(report, "left_sole stands at 0.00, 0.15 and 0.45 m")
    assert note(
        report, "right_sole stands at 0.00, 0.30 and 0.45 m: steps or stairs, or feet that float."
    )


@pytest.mark.parametrize("told", [False, True])
def test_a_treadmill(cases, told):
    options = dynacom.AnalysisOptions()
    if told:
        options.detection.ground_velocity = np.array([-1.0, 0.0, 0.0])
    report = judge(cases / "treadmill1.npz", options=options)
    assert verdict(report) == ("feasible", ["feasible"])
    assert_allclose(report.summary["ground_velocity"], [-1.0, 0.0, 0.0], rtol=0, atol=0.01)
    assert note(report, "The ground moves by (-1.00, 0.00) m/s: a treadmill")


def test_a_squat_that_is_cut_in_motion(cases):
    """A sine of 1 Hz, exact: accelerations are right, at the ends too."""
    report = judge(cases / "cut_bob.npz")
    assert verdict(report) == ("feasible", ["feasible"])
    time, height = report.clip.time, report["com"][:, 2]
    waves = np.column_stack(
        [np.ones_like(time), np.sin(2 * np.pi * time), np.cos(2 * np.pi * time)]
    )
    factors, *_ = np.linalg.lstsq(waves, height, rcond=None)
    assert np.abs(waves @ factors - height).max() < 1e-3  # it is that sine
    expected = -((2 * np.pi) ** 2) * (waves[:, 1:] @ factors[1:])
    known = ~np.asarray(report.verdict.unsure)
    assert known.mean() > 0.8
    error = np.abs(report["acom"][:, 2] - expected)[known]
    assert error.max() < 0.1 * np.abs(expected).max()


def test_a_dropped_frame(cases):
    """One of 1800 is missing: it is made anew, and said so."""
    path = cases / "drop_t.npz"
    with np.load(path) as file:
        time, q, truth = file["t"], file["q"], file["truth"]
    report = judge(path)
    assert verdict(report) == ("feasible", ["feasible"])
    assert report.summary["frames"] == len(time) + 1
    assert report.summary["frame_rate"] == pytest.approx(100.0)
    assert note(report, "The frame after 5.99 s is missing: it was made from those around it")
    there = np.isin(np.rint(100.0 * report.clip.time), np.rint(100.0 * time))
    assert_allclose(report.clip.q[there], q, rtol=0, atol=1e-12)
    for name, expected in zip(report.robot.contacts, truth.T, strict=True):
        found = changes(active(report, name)[there])
        assert_allclose(found, changes(expected), rtol=0, atol=2, err_msg=name)


def test_a_normal_that_points_down_is_said_first(cases):
    contacts = [
        f"{name}:6d:half_length=0.1,half_width=0.05,mu=0.7,gu=0.05" for name in ("l_sole", "r_sole")
    ]
    robot = dynacom.make_robot(cases / "zdown.urdf", contacts)
    report = judge(cases / "full.csv", robot)
    assert verdict(report) == ("not feasible", ["downward_normal"])
    for name, text in zip(("l_sole", "r_sole"), report.summary["notes"], strict=False):
        assert text.startswith(f"{name}'s normal points down")
        assert "must point into the robot" in text
