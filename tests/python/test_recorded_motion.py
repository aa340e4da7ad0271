# SPDX-License-Identifier: BSD-2-Clause
import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import dynacom
from dynacom import ContactSchedule, RecordedMotion, deriveMotion, findFrameRate, rederiveMotion
from helpers import documentation

FRAMES = 101
TIME = np.arange(FRAMES) / 50.0


@pytest.fixture(scope="module")
def model() -> pin.Model:
    """A body that flies."""
    model = pin.Model()
    root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root_joint")
    model.appendBodyToJoint(root, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    return model


@pytest.fixture
def fall(model) -> dict[str, np.ndarray]:
    """It falls, as stones do."""
    q = np.tile(pin.neutral(model), (FRAMES, 1))
    q[:, 2] = 3.0 * TIME - 0.5 * 9.81 * TIME**2
    v, a = np.zeros((2, FRAMES, 6))
    v[:, 2] = 3.0 - 9.81 * TIME
    a[:, 2] = -9.81
    return {"q": q, "v": v, "a": a}


def test_what_was_recorded_comes_back(fall):
    schedule = ContactSchedule(["foot"], np.zeros((FRAMES, 1), dtype=bool))
    error = np.linspace(0.0, 1e-3, FRAMES)
    recorded = RecordedMotion(TIME, **fall, quaternion_error=error, schedule=schedule)
    for name, values in fall.items():
        assert_array_equal(getattr(recorded, name), values)
    assert_array_equal(recorded.time, TIME)
    assert_array_equal(recorded.quaternion_error, error)
    assert recorded.schedule.names == ["foot"]
    bare = RecordedMotion(TIME, fall["q"])
    for name in ("v", "a", "quaternion_error", "schedule"):
        assert getattr(bare, name) is None


def test_derivatives_that_fit_are_used(model, fall):
    derived = deriveMotion(model, RecordedMotion(TIME, **fall), 6.0)
    assert derived.is_recorded
    assert derived.frame_rate == pytest.approx(50.0)
    assert derived.cutoff == 0.0
    assert derived.mismatch.velocity < 0.02
    assert_array_equal(derived.motion.v, fall["v"])


@pytest.mark.parametrize("derive", [deriveMotion, rederiveMotion])
def test_derivatives_of_a_parabola(model, fall, derive):
    """Differences of second order have no error, whatever the file said."""
    fall["v"] *= 1.5
    derived = derive(model, RecordedMotion(TIME, **fall), 0.0)
    assert not derived.is_recorded
    assert np.isnan(derived.mismatch.velocity) == (derive is rederiveMotion)
    assert_allclose(derived.motion.v[:, 2], 3.0 - 9.81 * TIME, atol=1e-9)
    assert_allclose(derived.motion.a[:, 2], -9.81, atol=1e-9)


def test_frame_rates():
    assert findFrameRate(TIME) == pytest.approx(50.0)
    assert np.isnan(findFrameRate(TIME**2))
    rounded = np.round(np.arange(31) / 30.0, 3)
    assert findFrameRate(rounded) == pytest.approx(30.0)
    assert np.abs(rounded - np.arange(31) / 30.0).max() * 30.0 < dynacom.kEvenTimes


def test_refused(model, fall):
    with pytest.raises(ValueError, match="cutoff must be > 0 and < 20 Hz"):
        deriveMotion(model, RecordedMotion(TIME, fall["q"]), 25.0)
    with pytest.raises(ValueError, match=r"to be filtered, got steps from 0\.0004 to"):
        deriveMotion(model, RecordedMotion(TIME**2, fall["q"]), 6.0)
    with pytest.raises(ValueError, match="a must have 6 components"):
        deriveMotion(model, RecordedMotion(TIME, fall["q"], v=fall["v"], a=fall["a"][:, 1:]), 6.0)
    with pytest.raises(TypeError):
        RecordedMotion(TIME, fall["q"], schedule="feet")


def test_documentation():
    for function in (deriveMotion, rederiveMotion, findFrameRate):
        (text,) = documentation(function)
        assert text
    assert "ValueError" in documentation(deriveMotion)[0]
