# SPDX-License-Identifier: BSD-2-Clause
"""Is a motion feasible, and what speaks against it?"""

import copy
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import nnls

import dynacom
from dynacom import (
    ContactSchedule,
    DynaCoM,
    FaultLimit,
    Motion,
    MotionFinding,
    MotionVerdict,
    NotReadyError,
    RecordedMotion,
    VerdictSettings,
    analyzeMotion,
    computeContactMotions,
    judgeMotion,
)
from helpers import WALKS, documentation, point, sole

# Those of the reasons in summary.json; `feasible` is where none of them holds.
CODES = [
    "downward_normal",
    "residual_force",
    "residual_torque",
    "cop_outside",
    "flight_with_support_needed",
    "ground_penetration",
    "foot_sliding",
    "discontinuity",
]
DEFAULTS = {
    "downward_normal": (1.1, 0.02),
    "residual_force": (0.1, 0.05),
    "residual_torque": (0.03, 0.05),
    "cop_outside": (0.02, 0.1),
    "flight_with_support_needed": (0.05, 0.02),
    "ground_penetration": (0.02, 0.02),
    "foot_sliding": (0.2, 0.02),
    "discontinuity": (1.0, 0.0),
}
NUMBERS = {
    "cop_force": 0.3,
    "linear_speed": 10.0,
    "turning_speed": 30.0,
    "joint_speed": 50.0,
    "jump_time": 0.25,
    "minimal_window": 1.0,
    "interruption": 0.1,
    "repairable_distance": 0.01,
    "repairable_largest_distance": 0.05,
    "repairable_depth": 0.07,
    "repairable_slide": 0.3,
}
POSITIVE = (
    *("linear_speed", "turning_speed", "joint_speed"),
    *("repairable_distance", "repairable_largest_distance"),
    *("repairable_depth", "repairable_slide"),
)
FRAMES, MASS, G = 100, 10.0, 9.81
SOLES = ["left", "right"]


@dataclass
class Stand:
    """A body of 10 kg that stands on two soles, in 100 frames of one second; to be spoilt."""

    robot: DynaCoM = field(init=False)
    time: np.ndarray = field(init=False)
    active: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        model = pin.Model()
        model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
        model.appendBodyToJoint(1, pin.Inertia.FromSphere(MASS, 0.2), pin.SE3.Identity())
        for name, y in zip(SOLES, (0.1, -0.1), strict=True):
            place = pin.SE3(np.eye(3), np.array([0.0, y, -0.5]))
            model.addFrame(pin.Frame(name, 1, place, pin.OP_FRAME))
        self.robot = DynaCoM(model)
        for name in SOLES:
            contact = sole(frame_name=name, mu=0.5, gu=0.05, half_length=0.1, half_width=0.05)
            self.robot.addContact(contact, name)
        self.time = np.arange(FRAMES) / FRAMES
        self.q = np.zeros((FRAMES, 7))
        self.q[:, 2], self.q[:, 6] = 0.5, 1.0
        self.recorded = self.q.copy()
        self.v, self.a = np.zeros((2, FRAMES, 6))
        self.active = np.ones((FRAMES, 2), dtype=bool)
        self.ground = np.zeros(2)
        self.settings = VerdictSettings()
        self.unsure = None

    def arguments(self) -> dict:
        motion = Motion(self.time, self.q, self.v, self.a)
        return {
            "robot": self.robot,
            "motion": motion,
            "recorded": RecordedMotion(self.time, self.recorded),
            "contacts": computeContactMotions(self.robot, motion),
            "ground": self.ground,
            "analysis": analyzeMotion(self.robot, motion, ContactSchedule(SOLES, self.active)),
            "settings": self.settings,
            "unsure": self.unsure,
        }

    def judge(self) -> MotionVerdict:
        return judgeMotion(**self.arguments())

    def judge_as(self, code: str) -> MotionFinding:
        """The finding of the one fault that holds."""
        verdict = self.judge()
        assert holding(verdict) == [code]
        assert not verdict.feasible
        return verdict.findings[code]


def holding(verdict: MotionVerdict) -> list[str]:
    return [code for code, finding in verdict.findings.items() if finding.holds]


@pytest.fixture
def stand() -> Stand:
    return Stand()


def test_codes(stand):
    verdict = stand.judge()
    assert list(verdict.findings) == CODES
    assert verdict.feasible
    for finding in verdict.findings.values():
        assert isinstance(finding, MotionFinding)
        assert_array_equal(finding.measured, np.zeros(FRAMES))
        assert (finding.frames, finding.worst, finding.time, finding.holds) == (0, 0.0, 0.0, False)
        assert finding.subject == ""
    assert verdict.outcome == "feasible"
    assert verdict.codes == ["feasible"]
    assert list(dynacom.describeFaults()) == CODES


def test_faults_are_described():
    """In one table, which C++ has."""
    faults = dynacom.describeFaults()
    assert faults["cop_outside"][0] == faults["ground_penetration"][0] == "m"
    for unit, meaning in faults.values():
        assert unit and meaning
    faults.clear()
    assert list(dynacom.describeFaults()) == CODES


# Faults, one by one.


def test_force_out_of_reach(stand):
    """What is missing, as a part of the weight: here friction gives half of it, to both sides."""
    stand.a[40:50, 0] = 0.8 * G
    stand.a[45, 0] = 0.9 * G
    stand.settings.residual_torque = FaultLimit(1.0, 0.0)
    finding = stand.judge_as("residual_force")
    assert (finding.frames, finding.time) == (10, 0.45)
    residual = stand.arguments()["analysis"].residual
    expected = np.linalg.norm(residual[:, :3], axis=1) / (MASS * G)
    assert_allclose(finding.measured, expected, rtol=1e-12)
    assert finding.worst == finding.measured.max() == finding.measured[45]


def test_moment_out_of_reach(stand):
    # About the vertical: yaw friction, and the two soles against one another.
    stand.a[30:60, 5] = 2000.0
    stand.settings.residual_force = FaultLimit(10.0, 0.0)
    finding = stand.judge_as("residual_torque")
    assert finding.frames == 30
    residual = stand.arguments()["analysis"].residual
    expected = np.linalg.norm(residual[:, 3:], axis=1) / (MASS * G)
    assert_allclose(finding.measured, expected, rtol=1e-12)


def test_flight(stand):
    """Far above the ground: falling asks for nothing, floating for all of the weight."""
    stand.q[:, 2] = stand.recorded[:, 2] = 3.0
    stand.active[:] = False
    stand.a[:, 2] = -G
    assert stand.judge().feasible
    stand.a[10:13, 2] = 0.0
    finding = stand.judge_as("flight_with_support_needed")
    assert (finding.frames, finding.time) == (3, 0.1)
    assert finding.worst == pytest.approx(1.0)
    stand.a[10:13, 2] = -0.96 * G  # within 5 % of the weight
    assert stand.judge().feasible


def distance_to_hull(point: np.ndarray, corners: np.ndarray) -> float:
    """By non-negative least squares: the closest of all means of the corners."""
    heavy = 1e4  # what the weights' sum is worth
    matrix = np.vstack([corners.T - point[:, None], np.full(len(corners), heavy)])
    weights, _ = nnls(matrix, np.array([0.0, 0.0, heavy]))
    return float(np.linalg.norm(weights @ corners / weights.sum() - point))


def test_pressure_outside_what_carries(stand):
    """As far as a hull that was found otherwise says, for any wrench and any pose."""
    rng = np.random.default_rng(3)
    for frame in range(FRAMES):
        turn = pin.exp3(np.array([0.0, 0.0, rng.uniform(-3.0, 3.0)]))
        tilt = pin.exp3(rng.uniform(-0.3, 0.3, 3))
        stand.q[frame, 3:7] = pin.Quaternion(turn @ tilt).coeffs()
        stand.a[frame] = rng.uniform(-4.0, 4.0, 6)
        stand.active[frame] = [(True, True), (True, False), (False, True)][frame % 3]
    stand.a[:, 3:] *= 12.0  # what was recorded stays as it is: else each frame were a jump
    arguments = stand.arguments()
    analysis, contacts = arguments["analysis"], arguments["contacts"]
    expected = np.zeros(FRAMES)
    for frame in range(FRAMES):
        corners = [
            moved.position[frame]
            + pin.Quaternion(moved.rotation[frame]).matrix() @ [0.1 * x, 0.05 * y, 0.0]
            for moved, active in zip(contacts, stand.active[frame], strict=True)
            if active
            for x, y in ((1, 1), (1, -1), (-1, 1), (-1, -1))
        ]
        corners = np.array(corners)
        # Where the wrench about the world's origin has no horizontal moment, at that height.
        force, com = analysis.ground_force[frame], analysis.com[frame]
        moment = analysis.ground_torque[frame] + np.cross(com, force)
        height = corners[:, 2].mean()
        cop = [height * force[0] - moment[1], height * force[1] + moment[0]] / force[2]
        if str(analysis.status[frame]) != "Solved" and force[2] > 0.3 * MASS * G:
            expected[frame] = distance_to_hull(cop, corners[:, :2])
    finding = judgeMotion(**arguments).findings["cop_outside"]
    assert (expected > 0.02).sum() > 30
    assert (expected == 0.0).sum() > 10
    assert_allclose(finding.measured, expected, atol=1e-7)


def test_leaning_beyond_the_toes(stand):
    """Three centimetres, of which a residual makes a little of a force and a little of a moment."""
    inertia = 0.4 * MASS * 0.2**2
    stand.a[:, 4] = -0.13 * MASS * G / inertia
    finding = stand.judge_as("cop_outside")
    assert_allclose(finding.measured, 0.03, atol=1e-9)
    findings = stand.judge().findings
    assert 0.0 < findings["residual_force"].worst < 0.1
    assert 0.0 < findings["residual_torque"].worst < 0.03
    # A tenth of the frames may be so.
    stand.a[10:, 4] = 0.0
    assert stand.judge().feasible


def test_points_carry_too():
    """Two points: what is beside the line between them is outside."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    model.appendBodyToJoint(1, pin.Inertia.FromSphere(MASS, 0.2), pin.SE3.Identity())
    robot = DynaCoM(model)
    for name, y in zip(SOLES, (0.1, -0.1), strict=True):
        place = pin.SE3(np.eye(3), np.array([0.03, y, -0.45]))
        model.addFrame(pin.Frame(name, 1, place, pin.OP_FRAME))
    robot = DynaCoM(model)
    for name in SOLES:
        robot.addContact(point(frame_name=name, mu=0.5, radius=0.05), name)
    time, q = np.arange(20) / 20.0, np.tile([0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0], (20, 1))
    motion = Motion(time, q, np.zeros((20, 6)), np.zeros((20, 6)))
    verdict = judgeMotion(
        robot,
        motion,
        RecordedMotion(time, q),
        computeContactMotions(robot, motion),
        np.zeros(2),
        analyzeMotion(robot, motion, ContactSchedule(SOLES, np.ones((20, 2), dtype=bool))),
    )
    assert_allclose(verdict.findings["cop_outside"].measured, 0.03, atol=1e-9)
    assert verdict.codes == ["cop_outside"]
    assert [normal.up for normal in verdict.normals] == [1.0, 1.0]


def test_below_the_ground(stand):
    stand.q[:5, 2] -= 0.03
    stand.q[3, 2] -= 0.01
    finding = stand.judge_as("ground_penetration")
    assert (finding.frames, finding.time) == (5, 0.03)
    assert finding.worst == pytest.approx(0.04)
    stand.ground[:] = -0.04
    assert stand.judge().feasible
    # Each has its own ground, and the deepest counts.
    stand.ground[:] = [-0.04, 0.0]
    finding = stand.judge_as("ground_penetration")
    assert (finding.worst, finding.subject) == (pytest.approx(0.04), "right")
    # It may change, and be unknown.
    stand.ground = np.full((FRAMES, 2), np.nan)
    assert stand.judge().findings["ground_penetration"].worst == 0.0
    stand.ground[90:, 0] = 0.03
    finding = stand.judge_as("ground_penetration")
    assert (finding.frames, finding.time, finding.subject) == (10, 0.9, "left")


def test_sliding(stand):
    """Along the ground, and only where the contact is active."""
    stand.v[:, 2] = 5.0
    assert stand.judge().feasible
    stand.v[50:60, :2] = [0.3, 0.4]
    finding = stand.judge_as("foot_sliding")
    assert (finding.frames, finding.time) == (10, 0.5)
    assert finding.worst == pytest.approx(0.5)
    stand.active[:] = False
    stand.a[:, 2] = -G
    assert stand.judge().feasible


def test_normals_that_point_down(stand):
    """Measured by how far below the horizontal, where the contact is active; and said first."""
    angles = np.linspace(0.0, np.pi, FRAMES)  # of the body about x
    stand.q[:, 3], stand.q[:, 6] = np.sin(angles / 2.0), np.cos(angles / 2.0)
    stand.recorded = stand.q.copy()
    stand.active[:, 0] = False
    stand.active[90:, 1] = False
    verdict = stand.judge()
    assert verdict.codes[0] == "downward_normal"
    finding = verdict.findings["downward_normal"]
    expected = np.clip(angles - np.pi / 2.0, 0.0, None)
    expected[90:] = 0.0
    assert_allclose(finding.measured, expected, rtol=0, atol=1e-9)
    assert finding.frames == np.count_nonzero(expected > 1.1) > 2
    assert (finding.worst, finding.time) == (pytest.approx(expected[89]), 0.89)
    assert finding.subject == "right"
    assert finding.holds
    # A sole that is tilted farther than a robot that kneels tilts its insteps is none.
    stand.settings.downward_normal = FaultLimit(1.1, 0.5)
    assert "downward_normal" not in stand.judge().codes
    assert stand.judge().findings["downward_normal"].frames == finding.frames


def test_jumps_of_the_record(stand):
    """One is enough; that of the filtered motion does not matter."""
    stand.q[60:, 0] += 0.2
    assert stand.judge().feasible
    stand.recorded[60:, 0] += 0.2
    finding = stand.judge_as("discontinuity")
    assert (finding.frames, finding.time, finding.subject) == (2, 0.59, "root")
    assert finding.worst == pytest.approx(2.0)
    assert_allclose(finding.measured[[58, 59, 60, 61]], [0.0, 2.0, 2.0, 0.0], atol=1e-12)
    stand.recorded[60:, 0] -= 0.11
    assert stand.judge().feasible
    stand.recorded[90:, 3:7] = pin.Quaternion(pin.exp3(np.array([0.0, 0.0, 0.36]))).coeffs()
    finding = stand.judge_as("discontinuity")
    assert (finding.frames, finding.time) == (2, 0.89)
    assert finding.subject == "root's orientation"
    assert finding.worst == pytest.approx(1.2)


def test_a_jump_is_judged_apart(stand):
    """Frames near it are left out, as are others whose accelerations nobody knows."""
    stand.recorded[50:, 0] += 0.2
    stand.a[45:55, 0] = 9.0 * G
    verdict = stand.judge()
    assert verdict.codes == ["discontinuity"]
    # The step is between 0.49 and 0.5 s.
    expected = (stand.time > 0.24 - 1e-9) & (stand.time < 0.75 + 1e-9)
    assert_array_equal(verdict.unsure, expected)
    stand.a[5:15, 0] = 9.0 * G
    assert "residual_force" in stand.judge().codes
    stand.unsure = stand.time < 0.2
    verdict = stand.judge()
    assert verdict.codes == ["discontinuity"]
    assert_array_equal(verdict.unsure, expected | stand.unsure)


def test_windows():
    stand = Stand()
    stand.time = 0.05 * np.arange(FRAMES)
    stand.q[40, 2] -= 0.1  # 0.05 s are overlooked
    (window,) = stand.judge().windows
    assert (window.first, window.last, window.begin) == (0, 99, 0.0)
    assert window.end == stand.time[-1]
    assert repr(window) == "MotionWindow(first=0, last=99, begin=0, end=4.95)"
    stand.q[41:50, 2] -= 0.1
    verdict = stand.judge()
    assert [(window.first, window.last) for window in verdict.windows] == [(0, 39), (50, 99)]
    assert verdict.feasible_share == 0.9
    assert not verdict.feasible
    stand.q[:, 2] -= 0.1
    verdict = stand.judge()
    assert (verdict.windows, verdict.feasible_share) == ([], 0.0)


def test_normals(stand):
    """Of what is active: here one foot, upside down with the body for half of the time."""
    stand.q[:50, 3:7] = [1.0, 0.0, 0.0, 0.0]
    stand.active[:, 1] = False
    one, other = stand.judge().normals
    assert (one.up, one.downward_share) == (0.0, 0.5)
    assert np.isnan(other.up) and np.isnan(other.downward_share)
    assert repr(one) == "ContactNormal(up=0, downward_share=0.5)"


def test_the_allowed_share(stand):
    """More frames than that hold a fault, as many do not."""
    stand.settings.foot_sliding = FaultLimit(0.2, 0.25)
    stand.v[:25, 0] = 0.3
    assert stand.judge().feasible
    assert stand.judge().findings["foot_sliding"].frames == 25
    stand.v[25, 0] = 0.2  # on the limit is not beyond it
    assert stand.judge().feasible
    stand.v[25, 0] = 0.21
    assert stand.judge_as("foot_sliding").frames == 26


def test_several_at_once(stand):
    stand.v[:, 0] = 1.0
    stand.ground[:] = 0.1
    verdict = stand.judge()
    assert holding(verdict) == verdict.codes == ["ground_penetration", "foot_sliding"]
    assert verdict.outcome == "not feasible"
    assert repr(verdict) == (
        "MotionVerdict(outcome='not feasible', codes=['ground_penetration', 'foot_sliding'], "
        "feasible_share=0)"
    )


def test_the_robot_is_left_as_it_is(stand):
    robot, rest = stand.robot, np.zeros(6)
    robot.computeDynamics(stand.q[0], rest, rest)
    robot.deactivateContact("left")
    robot.distributeForce([1.0, 2.0, 30.0], [0.0, 0.0, 0.0], robot.getCoM())

    def state() -> list:
        forces = [robot.getContact(name).appliedForce().tolist() for name in SOLES]
        return [repr(robot), robot.getCoM().tolist(), robot.ne_b().tolist(), forces]

    before = state()
    stand.a[:, 0] = 8.0
    stand.judge()
    assert state() == before


@pytest.mark.parametrize("frames", [1, 2, 3, 5, 6])
def test_too_short(stand, frames):
    """Unless derivatives are known."""
    for name in ("time", "q", "recorded", "v", "a", "active"):
        setattr(stand, name, getattr(stand, name)[:frames])
    is_known = frames >= dynacom.kMinimalFrames
    verdict = stand.judge()
    assert verdict.feasible == is_known
    assert verdict.outcome == ("feasible" if is_known else "unknown")
    assert verdict.codes == ["feasible" if is_known else "too_short"]
    assert all(finding.measured.shape == (frames,) for finding in verdict.findings.values())
    arguments = stand.arguments()
    arguments["recorded"] = RecordedMotion(stand.time, stand.recorded, stand.v, stand.a)
    assert judgeMotion(**arguments).feasible


@pytest.mark.parametrize(
    ("name", "robot"),
    [("talos_walk", "talos"), ("anymal_walk", "anymal_c"), ("anymal_trot", "anymal_c")],
)
def test_planned_motions_are_feasible(name, robot):
    """The trot, too: it is out of reach by a little, see docs/files.md."""
    report = dynacom.analyze(WALKS / f"{name}.npz", robot)
    assert report.verdict.feasible
    assert report.verdict.findings["residual_torque"].worst < 0.01


# Settings.


def test_defaults():
    settings = VerdictSettings()
    for code, (limit, allowed_share) in DEFAULTS.items():
        assert getattr(settings, code) == FaultLimit(limit, allowed_share)
    for name, value in NUMBERS.items():
        assert getattr(settings, name) == value
    settings.validate()
    texts = [f"{code}=({x:g}, {y:g})" for code, (x, y) in DEFAULTS.items()]
    texts += [f"{name}={value:g}" for name, value in NUMBERS.items()]
    assert repr(settings) == f"VerdictSettings({', '.join(texts)})"


def test_limits():
    limit = FaultLimit(limit=0.1, allowed_share=0.2)
    assert repr(limit) == "FaultLimit(limit=0.1, allowed_share=0.2)"
    for other in (copy.copy(limit), copy.deepcopy(limit), limit.copy()):
        assert other == limit
        other.limit = 0.3
        assert other != limit
        assert limit.limit == 0.1
    assert FaultLimit(0.1, 0.3) != limit
    with pytest.raises(AttributeError, match="no attribute 'limits'"):
        limit.limits = 0.1
    with pytest.raises(TypeError):
        FaultLimit(0.1)


@pytest.mark.parametrize("code", CODES)
def test_settings_are_compared_and_copied(code):
    settings = VerdictSettings()
    getattr(settings, code).limit = 0.7  # a part of the settings, no copy
    assert getattr(settings, code).limit == 0.7
    assert settings != VerdictSettings()
    other = copy.copy(settings)
    assert other == settings
    setattr(other, code, FaultLimit(0.7, 0.9))
    assert other != settings
    assert getattr(settings, code).allowed_share != 0.9


@pytest.mark.parametrize("name", NUMBERS)
def test_numbers_are_compared(name):
    settings = VerdictSettings()
    setattr(settings, name, 0.17)
    assert settings != VerdictSettings()


@pytest.mark.parametrize("code", CODES)
@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("limit", -0.1, "finite and >= 0, got -0.1"),
        ("limit", np.inf, "finite and >= 0, got inf"),
        ("limit", np.nan, "finite and >= 0, got nan"),
        ("allowed_share", -0.1, "from 0 to 1, got -0.1"),
        ("allowed_share", 1.1, "from 0 to 1, got 1.1"),
        ("allowed_share", np.nan, "from 0 to 1, got nan"),
    ],
)
def test_limits_out_of_range(stand, code, name, value, expected):
    setattr(getattr(stand.settings, code), name, value)
    message = f"^VerdictSettings.{code}.{name} must be {expected}$"
    with pytest.raises(ValueError, match=message):
        stand.settings.validate()
    with pytest.raises(ValueError, match=message):
        stand.judge()


@pytest.mark.parametrize("name", NUMBERS)
def test_numbers_out_of_range(stand, name):
    expected = "> 0" if name in POSITIVE else ">= 0"
    for value in (-0.1, np.nan, np.inf, *([0.0] if name in POSITIVE else [])):
        setattr(stand.settings, name, value)
        message = f"^VerdictSettings.{name} must be finite and {expected}, got {value:g}$"
        with pytest.raises(ValueError, match=message):
            stand.judge()


# What does not belong together.


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        (
            "recorded",
            lambda r: RecordedMotion(r.time, r.q[:-1]),
            "recorded.q must have 100 frames, got 99",
        ),
        (
            "recorded",
            lambda r: RecordedMotion(r.time, r.q[:, :-1]),
            r"recorded.q must have 7 components \(nq\), got 6",
        ),
        ("ground", lambda g: np.zeros((99, 2)), r"ground must have 100 frames \(or 1\), got 99"),
        ("unsure", lambda _: np.zeros(99, dtype=bool), "unsure must have 100 frames"),
        ("ground", lambda g: g[:1], r"ground must have 2 heights \(one per contact\), got 1"),
        ("contacts", lambda c: c[::-1], "expected 'left', got 'right' and 'left'"),
        ("contacts", lambda c: c[:1], r"ground must have 1 heights \(one per contact\), got 2"),
    ],
)
def test_sizes_that_differ(stand, name, change, message):
    arguments = stand.arguments()
    arguments[name] = change(arguments[name])
    with pytest.raises(ValueError, match=message):
        judgeMotion(**arguments)


def test_results_of_another_motion(stand):
    arguments, other = stand.arguments(), Stand()
    for name in ("time", "q", "recorded", "v", "a", "active"):
        setattr(other, name, getattr(other, name)[:50])
    for name, message in (
        ("analysis", "analysis must have 100 frames, got 50"),
        ("contacts", "contacts must have 100 frames, got 50"),
        ("motion", "recorded.q must have 50 frames, got 100"),
    ):
        with pytest.raises(ValueError, match=message):
            judgeMotion(**arguments | {name: other.arguments()[name]})


def test_wrong_types(stand):
    arguments = stand.arguments()
    for name, wrong in (
        ("robot", stand.robot.getModel()),
        ("motion", stand.q),
        ("recorded", None),
        ("contacts", [1, 2]),
        ("contacts", None),
        ("analysis", None),
        ("settings", FaultLimit(1.0, 0.0)),
    ):
        with pytest.raises(TypeError):
            judgeMotion(**arguments | {name: wrong})


def test_before_initialize(stand):
    with pytest.raises(NotReadyError, match=r"judgeMotion before initialize\(\)"):
        judgeMotion(**stand.arguments() | {"robot": DynaCoM()})


# Objects.


def test_findings_are_copies(stand):
    verdict = stand.judge()
    finding = verdict.findings["foot_sliding"]
    finding.measured[:] = 9.0
    assert not finding.measured.any()
    verdict.findings.clear()
    assert list(verdict.findings) == CODES
    assert repr(finding) == "MotionFinding(frames=0, worst=0, time=0, holds=False, subject='')"
    for value in (finding, verdict):
        assert repr(copy.deepcopy(value)) == repr(value)
    with pytest.raises(AttributeError):
        verdict.feasible = False
    with pytest.raises(AttributeError):
        finding.holds = True


def test_settings_have_defaults(stand):
    arguments = stand.arguments()
    del arguments["settings"]
    assert judgeMotion(**arguments).feasible


def test_documentation():
    (text,) = documentation(judgeMotion)
    assert "recorded" in text and "ValueError" in text
    for code in CODES:
        assert code in MotionVerdict.__doc__
        assert getattr(VerdictSettings, code).__doc__
