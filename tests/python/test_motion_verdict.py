# SPDX-License-Identifier: BSD-2-Clause
"""Is a motion feasible, and what speaks against it?"""

import copy
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

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
from helpers import WALKS, documentation, sole

# Those of the reasons in summary.json; `feasible` is where none of them holds.
CODES = [
    "residual_force",
    "residual_torque",
    "flight_with_support_needed",
    "contact_missing",
    "ground_penetration",
    "foot_sliding",
    "discontinuity",
    "quaternion",
]
DEFAULTS = {
    "residual_force": (0.1, 0.05),
    "residual_torque": (0.03, 0.05),
    "flight_with_support_needed": (0.05, 0.02),
    "contact_missing": (0.03, 0.02),
    "ground_penetration": (0.02, 0.02),
    "foot_sliding": (0.2, 0.02),
    "discontinuity": (0.15, 0.0),
    "quaternion": (1e-3, 0.0),
}
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
        self.quaternion_error = np.zeros(FRAMES)
        self.v, self.a = np.zeros((2, FRAMES, 6))
        self.active = np.ones((FRAMES, 2), dtype=bool)
        self.ground = np.zeros(2)
        self.settings = VerdictSettings()

    def arguments(self) -> dict:
        motion = Motion(self.time, self.q, self.v, self.a)
        return {
            "robot": self.robot,
            "motion": motion,
            "recorded": RecordedMotion(self.time, self.recorded, self.quaternion_error),
            "contacts": computeContactMotions(self.robot, motion),
            "ground": self.ground,
            "analysis": analyzeMotion(self.robot, motion, ContactSchedule(SOLES, self.active)),
            "settings": self.settings,
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


def test_contact_missing(stand):
    """The same, but with soles close enough to the ground to have been contacts."""
    stand.active[20:30] = False
    stand.q[20:30, 2] += 0.05
    finding = stand.judge_as("contact_missing")
    assert (finding.frames, finding.time) == (10, 0.2)
    assert finding.worst == pytest.approx(1.0)
    stand.settings.near_ground = 0.04
    assert stand.judge_as("flight_with_support_needed").frames == 10
    # A sole alone would have to carry what is beside it.
    stand.active[20:30, 0] = True
    stand.settings = VerdictSettings()
    assert stand.judge_as("contact_missing").worst == pytest.approx(0.05, rel=0.3)


def test_below_the_ground(stand):
    stand.q[:5, 2] -= 0.03
    stand.q[3, 2] -= 0.01
    finding = stand.judge_as("ground_penetration")
    assert (finding.frames, finding.time) == (5, 0.03)
    assert finding.worst == pytest.approx(0.04)
    stand.ground[:] = -0.04
    assert stand.judge().feasible
    # Each has its own ground, and the deepest counts.
    stand.ground[:] = [0.0, -0.04]
    assert stand.judge_as("ground_penetration").worst == pytest.approx(0.04)


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


def test_jumps_of_the_record(stand):
    """One is enough; that of the filtered motion does not matter."""
    stand.q[60:, 0] += 0.2
    assert stand.judge().feasible
    stand.recorded[60:, 0] += 0.2
    finding = stand.judge_as("discontinuity")
    assert (finding.frames, finding.time) == (1, 0.6)
    assert finding.worst == pytest.approx(0.2)
    stand.recorded[60:, 0] -= 0.06
    assert stand.judge().feasible
    stand.recorded[90:, 3:7] = pin.Quaternion(pin.exp3(np.array([0.0, 0.0, 0.3]))).coeffs()
    finding = stand.judge_as("discontinuity")
    assert (finding.frames, finding.time) == (1, 0.9)
    assert finding.worst == pytest.approx(0.3)


def test_quaternions_of_the_record(stand):
    stand.quaternion_error[7] = 0.002
    finding = stand.judge_as("quaternion")
    assert (finding.frames, finding.worst, finding.time) == (1, 0.002, 0.07)
    assert_array_equal(finding.measured, stand.quaternion_error)


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
    stand.quaternion_error[:] = 0.1
    stand.v[:, 0] = 1.0
    stand.ground[:] = 0.1
    verdict = stand.judge()
    assert holding(verdict) == ["ground_penetration", "foot_sliding", "quaternion"]
    assert repr(verdict) == (
        "MotionVerdict(feasible=False, holding=['ground_penetration', 'foot_sliding', "
        "'quaternion'])"
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


def test_a_single_frame(stand):
    for name in ("time", "q", "recorded", "quaternion_error", "v", "a", "active"):
        setattr(stand, name, getattr(stand, name)[:1])
    verdict = stand.judge()
    assert verdict.feasible
    assert all(finding.measured.shape == (1,) for finding in verdict.findings.values())


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
    assert settings.near_ground == 0.06
    settings.validate()
    text = ", ".join(f"{code}=({x:g}, {y:g})" for code, (x, y) in DEFAULTS.items())
    assert repr(settings) == f"VerdictSettings({text}, near_ground=0.06)"


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


def test_near_ground_is_compared():
    settings = VerdictSettings()
    settings.near_ground = 0.1
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


def test_near_ground_out_of_range(stand):
    for value in (-0.1, np.nan, np.inf):
        stand.settings.near_ground = value
        message = f"^VerdictSettings.near_ground must be finite and >= 0 m, got {value:g}$"
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
        (
            "recorded",
            lambda r: RecordedMotion(r.time, r.q, r.quaternion_error[:-1]),
            "quaternion_error must have 100 frames, got 99",
        ),
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
    for name in ("time", "q", "recorded", "quaternion_error", "v", "a", "active"):
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
    finding = verdict.findings["quaternion"]
    finding.measured[:] = 9.0
    assert not finding.measured.any()
    verdict.findings.clear()
    assert list(verdict.findings) == CODES
    assert repr(finding) == "MotionFinding(frames=0, worst=0, time=0, holds=False)"
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
