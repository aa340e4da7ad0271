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
    recorded = RecordedMotion(TIME, **fall, schedule=schedule)
    for name, values in fall.items():
        assert_array_equal(getattr(recorded, name), values)
    assert_array_equal(recorded.time, TIME)
    assert recorded.schedule.names == ["foot"]
    bare = RecordedMotion(TIME, fall["q"])
    for name in ("v", "a", "schedule"):
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


def bob(rate: float, seconds: float = 3.0) -> tuple[np.ndarray, np.ndarray]:
    """A squat of 1 Hz, cut in motion at both ends: time, and height [m]."""
    time = np.arange(int(seconds * rate)) / rate
    return time, 0.04 * np.sin(2.0 * np.pi * time + 0.6)


@pytest.mark.parametrize("rate", [30.0, 60.0, 120.0, 500.0])
def test_the_cut_off_that_suits(model, rate):
    time, height = bob(rate)
    q = np.tile(pin.neutral(model), (len(time), 1))
    q[:, 2] = height
    expected = -((2.0 * np.pi) ** 2) * height
    exact = deriveMotion(model, RecordedMotion(time, q))
    assert exact.is_automatic and exact.cutoff == 0.0
    assert exact.noise < dynacom.kExactNoise and exact.thinned_noise < dynacom.kExactNoise
    assert exact.unsure.dtype == bool and exact.unsure.tolist() == [False] * len(time)
    # A second difference takes (2 pi f / rate)² / 12 of a sine away; at the ends it is 11 of these.
    bound = (2.0 * np.pi / rate) ** 2 * 1.6
    assert_allclose(exact.motion.a[:, 2], expected, rtol=0, atol=bound + 1e-6)

    q[:, :3] += 1e-3 * np.random.default_rng(0).standard_normal((len(time), 3))
    noisy = deriveMotion(model, RecordedMotion(time, q), dynacom.kAutomaticCutoff)
    assert noisy.is_automatic and noisy.cutoff == dynacom.kMeasuredCutoff
    assert noisy.noise > dynacom.kExactNoise
    # Frames that are not marked are no worse than those in the middle.
    error = np.abs(noisy.motion.a[:, 2] - expected)
    middle = error[len(time) // 3 : 2 * len(time) // 3]
    assert noisy.unsure.sum() == 2 * (int(0.5 * rate / 6.0) + 1)
    assert noisy.unsure[0] and noisy.unsure[-1]
    assert np.sqrt(np.mean(error[~noisy.unsure] ** 2)) < 1.5 * np.sqrt(np.mean(middle**2))

    believed = deriveMotion(model, RecordedMotion(time, q), 0.0)
    assert not believed.is_automatic and believed.cutoff == 0.0
    assert believed.noise == noisy.noise and not believed.unsure.any()
    assert exact.isExact() and not noisy.isExact() and not believed.isExact()


def test_cut_bob(shared_data):
    """A squat that is cut in motion: its fit by a sine of 1 Hz tells the accelerations."""
    talos = dynacom.load_robot("talos")
    clip = dynacom.read_motion(shared_data / "cases" / "cut_bob.npz", talos)
    model = talos.dynacom().getModel()
    data = model.createData()
    height = np.array([pin.centerOfMass(model, data, q)[2] for q in clip.q])
    angle = 2.0 * np.pi * clip.time
    waves = np.stack([np.sin(angle), np.cos(angle), np.ones_like(angle)], axis=1)
    fitted = np.linalg.lstsq(waves, height, rcond=None)[0]
    assert_allclose(waves @ fitted, height, rtol=0, atol=1e-6)
    expected = -((2.0 * np.pi) ** 2) * waves[:, :2] @ fitted[:2]
    assert np.abs(expected[[0, -1]]).min() > 1.0

    def errors(derived) -> np.ndarray:
        motion = derived.motion
        states = [
            dynacom.computeCentroidalState(model, data, *frame)
            for frame in zip(motion.q, motion.v, motion.a, strict=True)
        ]
        return np.abs([state.acom[2] for state in states] - expected)

    recorded = RecordedMotion(clip.time, clip.q)
    exact = deriveMotion(model, recorded)
    assert exact.cutoff == 0.0
    assert errors(exact).max() < 0.02
    forced = deriveMotion(model, recorded, 6.0)
    assert errors(forced)[~forced.unsure].max() < 0.1
    assert forced.unsure.sum() == 18


# What is exact: plans and simulations. All others were measured, or fitted to what was.
MOTIONS = {
    "forces/sim_walk.npz": ("forces/sim_biped.yaml", True),
    "forces/sim_trot.npz": ("forces/sim_quadruped.yaml", True),
    "forces/sim_jump.npz": ("forces/sim_biped.yaml", True),
    "forces/s4_walk.npz": ("forces/s4.yaml", False),
    "forces/s4_squats.npz": ("forces/s4.yaml", False),
    "forces/hamner_run_2mps.npz": ("forces/hamner.yaml", False),
    "forces/icub_com_sinusoid.npz": ("forces/icub.yaml", False),
    "cases/hyq_jump.npz": ("cases/hyq.yaml", True),
    "cases/slope3.npz": ("talos", True),
    "B_HandsUp.npz": ("g1", False),
    "clips/airkick_stand.pkl": ("g1", False),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_what_is_exact(shared_data, name):
    where, exact = MOTIONS[name]
    robot = dynacom.load_robot(shared_data / where if "/" in where else where)
    clip = dynacom.read_motion(shared_data / name, robot, trust=name.endswith("pkl"))
    derived = rederiveMotion(robot.dynacom().getModel(), RecordedMotion(clip.time, clip.q))
    assert derived.cutoff == (0.0 if exact else 6.0)
    # Neither is near the limit.
    assert derived.thinned_noise < 0.005 if exact else derived.thinned_noise > 0.02


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
