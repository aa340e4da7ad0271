# SPDX-License-Identifier: BSD-2-Clause
"""Motions filtered and differentiated: against scipy, and against Pinocchio's own derivatives."""

import math

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import signal

import dynacom
from dynacom import (
    Motion,
    compareDerivatives,
    differentiate,
    estimateAccelerationNoise,
    filterConfigurations,
)
from helpers import documentation, random_configuration, random_pose, random_tree

RATE = 100.0


@pytest.fixture(scope="module")
def model() -> pin.Model:
    """A free-flyer with a joint that turns and one that slides."""
    rng = np.random.default_rng(0)
    model = pin.Model()
    root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    arm = model.addJoint(root, pin.JointModelRX(), random_pose(rng), "arm")
    model.addJoint(arm, pin.JointModelPY(), random_pose(rng), "slide")
    return model


def noise(frames: int, columns: int, seed: int = 0) -> np.ndarray:
    """A walk at random, so that there is something at every frequency."""
    return np.cumsum(np.random.default_rng(seed).standard_normal((frames, columns)), axis=0)


def quaternions(rotations: list[np.ndarray]) -> np.ndarray:
    return np.array([pin.Quaternion(rotation).coeffs() for rotation in rotations])


def rotation(row: np.ndarray) -> np.ndarray:
    return pin.Quaternion(np.array(row)).matrix()


def configurations(frames: int, seed: int = 0) -> np.ndarray:
    """Of the model above, with orientations that turn far, by small steps."""
    values = noise(frames, 6, seed)
    turn, rotations = np.eye(3), []
    for step in np.random.default_rng(seed + 1).normal([0.1, 0.02, -0.05], 0.05, (frames, 3)):
        turn = turn @ pin.exp3(step)
        rotations.append(turn)
    return np.hstack([values[:, :3], quaternions(rotations), values[:, 3:5]])


def continued(values: np.ndarray, rate: float, cutoff: float) -> np.ndarray:
    """Frames after the last: point reflection, and 3/4 of the acceleration of half a period."""
    period = rate / cutoff
    after = np.arange(1, min(len(values) - 1, math.ceil(8.0 * period)) + 1)
    fitted = min(max(math.ceil(0.5 * period), 4), len(values) - 1)
    reflected = 2.0 * values[-1] - values[-1 - after]
    if fitted < 4:
        return reflected
    flat = values.reshape(len(values), -1)[-1 - fitted :]
    acceleration = 0.75 * 2.0 * np.polyfit(np.arange(-fitted, 1), flat, 2)[0]
    # Of a parabola and its reflection, and after half a period of lines.
    bent = np.minimum(after, math.ceil(0.5 * period))
    grows = bent**2 + (2 * bent + 1) * (after - bent)
    return reflected + (grows[:, None] * acceleration).reshape(reflected.shape)


def butterworth(values: np.ndarray, rate: float, cutoff: float) -> np.ndarray:
    """The same filter by scipy."""
    sections = signal.butter(4, cutoff, fs=rate, output="sos")
    before, after = continued(values[::-1], rate, cutoff)[::-1], continued(values, rate, cutoff)
    padded = np.concatenate([before, values, after])
    filtered = signal.sosfiltfilt(sections, padded, axis=0, padtype=None)
    return filtered[len(before) : len(before) + len(values)]


# The filter.


@pytest.mark.parametrize("cutoff", [0.7, 6.0, 25.0, 39.9])
@pytest.mark.parametrize("frames", [2, 3, 60, 400])
def test_the_filter_is_scipy_s(model, frames, cutoff):
    """On joints and on the root's position, with long motions and with less than the padding."""
    q = configurations(frames)
    filtered = filterConfigurations(model, q, RATE, cutoff)
    assert filtered.shape == q.shape
    columns = [0, 1, 2, 7, 8]
    expected = butterworth(q[:, columns], RATE, cutoff)
    assert np.abs(expected - q[:, columns]).max() > 1e-3
    assert_allclose(filtered[:, columns], expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("rate", [1.0, 30.0, 59.94, 1000.0])
def test_only_the_cut_off_over_the_rate_matters(model, rate):
    q = configurations(150)
    filtered = filterConfigurations(model, q, rate, 0.11 * rate)
    assert_allclose(filtered, filterConfigurations(model, q, 1.0, 0.11), rtol=0, atol=1e-12)


@pytest.mark.parametrize("frames", [40, 300])
def test_turning_about_an_axis_is_filtered_like_a_number(model, frames):
    """Beyond half a turn, and more than one: an angle is followed, whatever its quaternion."""
    angle = 0.05 * noise(frames, 1, seed=3)[:, 0] + 0.15 * np.arange(frames)
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    q = configurations(frames)
    q[:, 3:7] = quaternions([pin.exp3(value * axis) for value in angle])
    filtered = filterConfigurations(model, q, RATE, 5.0)
    expected = butterworth(angle, RATE, 5.0)
    assert np.ptp(expected) > (4.0 if frames == 40 else 10.0 * np.pi)
    for row, value in zip(filtered, expected, strict=True):
        assert_allclose(rotation(row[3:7]), pin.exp3(value * axis), rtol=0, atol=1e-9)


def test_the_filter_knows_no_direction(model):
    """A world, and a body, that are turned: the result is turned likewise."""
    q = configurations(200)
    rng = np.random.default_rng(7)
    world, body = random_pose(rng), random_pose(rng).rotation
    turned = q.copy()
    turned[:, :3] = q[:, :3] @ world.rotation.T + world.translation
    turned[:, 3:7] = quaternions([world.rotation @ rotation(row[3:7]) @ body for row in q])
    filtered = filterConfigurations(model, q, RATE, 4.0)
    other = filterConfigurations(model, turned, RATE, 4.0)
    expected = filtered[:, :3] @ world.rotation.T + world.translation
    assert_allclose(other[:, :3], expected, rtol=0, atol=1e-9)
    for row, before in zip(other, filtered, strict=True):
        expected = world.rotation @ rotation(before[3:7]) @ body
        assert_allclose(rotation(row[3:7]), expected, rtol=0, atol=1e-9)


def test_the_sign_of_a_quaternion_means_nothing(model):
    q = configurations(100)
    flipped = q.copy()
    flipped[::3, 3:7] *= -1.0
    filtered, other = (filterConfigurations(model, x, RATE, 8.0) for x in (q, flipped))
    for row, expected in zip(other, filtered, strict=True):
        assert_allclose(rotation(row[3:7]), rotation(expected[3:7]), rtol=0, atol=1e-12)


def test_backwards_is_forwards(model):
    """No phase: the motion run backwards is filtered to the same, up to how the filter began."""
    q = configurations(1500)
    forwards = filterConfigurations(model, q, RATE, 10.0)
    backwards = filterConfigurations(model, q[::-1], RATE, 10.0)[::-1]
    assert_allclose(forwards[:, [0, 1, 2, 7, 8]], backwards[:, [0, 1, 2, 7, 8]], atol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_joints_of_every_kind(seed):
    """Quaternions stay of norm 1, and what stands still does so."""
    model = random_tree(seed)
    q = [random_configuration(model, seed)]
    for step in np.random.default_rng(seed).normal(0.0, 0.1, (80, model.nv)):
        q.append(pin.integrate(model, q[-1], step))
    q = np.array(q)
    filtered = filterConfigurations(model, q, RATE, 3.0)
    for row in filtered:
        assert pin.isNormalized(model, row, 1e-12)
    assert np.abs(filtered - q).max() > 1e-2
    still = np.tile(q[0], (30, 1))
    for row in filterConfigurations(model, still, RATE, 3.0):
        assert_allclose(pin.difference(model, q[0], row), 0.0, rtol=0, atol=1e-12)


def test_one_frame_is_left_as_it_is(model):
    q = configurations(1)
    filtered = filterConfigurations(model, q, RATE, 6.0)
    assert filtered.shape == (1, model.nq)
    assert_array_equal(filtered, q)


@pytest.mark.parametrize("cutoff", [0.0, -1.0, np.nan, np.inf, 40.0, 41.0, 50.0])
def test_cut_offs_out_of_range(model, cutoff):
    message = f"cutoff must be > 0 and < 40 Hz, which is 0.4 of the frame rate, got {cutoff:g} Hz"
    with pytest.raises(ValueError, match=f"^{message}$"):
        filterConfigurations(model, configurations(50), RATE, cutoff)


def test_the_largest_cut_off(model):
    assert dynacom.kMaximalCutoff == 0.4
    q = configurations(50)
    for rate in (60.0, 100.0):
        limit = dynacom.kMaximalCutoff * rate
        filterConfigurations(model, q, rate, math.nextafter(limit, 0.0))
        with pytest.raises(ValueError, match="cutoff must be"):
            filterConfigurations(model, q, rate, limit)


@pytest.mark.parametrize("rate", [0.0, -60.0, np.nan, np.inf])
def test_rates_out_of_range(model, rate):
    with pytest.raises(ValueError, match=f"^rate must be finite and > 0 Hz, got {rate:g}$"):
        filterConfigurations(model, configurations(50), rate, 6.0)


def test_configurations_that_are_none(model):
    q = configurations(20)
    for change, message in (
        (lambda q: q[:, :-1], r"q must have 9 components \(nq\), got 8"),
        (lambda q: np.where(np.arange(20)[:, None] == 7, np.nan, q), "q must be finite, .*frame 7"),
        (lambda q: q * [1, 1, 1, 2, 2, 2, 2, 1, 1], "quaternions of norm 1, .*frame 0"),
    ):
        with pytest.raises(ValueError, match=message):
            filterConfigurations(model, change(q), RATE, 6.0)
        with pytest.raises(ValueError, match=message):
            differentiate(model, np.arange(20.0), change(q))
    for wrong in (None, "q", q.tolist(), q[0], q[None]):
        with pytest.raises((TypeError, ValueError)):
            filterConfigurations(model, wrong, RATE, 6.0)


# Derivatives.


def uneven_times(frames: int, seed: int) -> np.ndarray:
    return 2.0 + np.cumsum(np.random.default_rng(seed).uniform(0.005, 0.03, frames))


@pytest.mark.parametrize("seed", range(8))
def test_a_parabola_through_neighbours(seed):
    """v s + a s² / 2 leads from a frame to both of its neighbours, at any times."""
    # At the ends there are other frames on one side only: to three of them a third power leads.
    model = random_tree(seed)
    time = uneven_times(12, seed)
    q = np.array([random_configuration(model, seed)] * 12)
    steps = np.random.default_rng(seed).normal(0.0, 0.2, (12, model.nv))
    q = np.array([pin.integrate(model, row, step) for row, step in zip(q, steps, strict=True)])
    motion = differentiate(model, time, q)
    assert_array_equal(motion.time, time)
    assert_array_equal(motion.q, q)
    for frame, others in ((0, (1, 2, 3)), (11, (8, 9, 10))):
        s = time[list(others)] - time[frame]
        steps = np.array([pin.difference(model, q[frame], q[other]) for other in others])
        left = steps - np.outer(s, motion.v[frame]) - np.outer(0.5 * s**2, motion.a[frame])
        thirds = left / s[:, None] ** 3
        size = max(1.0, np.abs(thirds).max())
        assert_allclose(thirds, np.tile(thirds[0], (3, 1)), rtol=0, atol=1e-7 * size)
    for frame in range(1, 11):
        for other in (frame - 1, frame + 1):
            s = time[other] - time[frame]
            step = motion.v[frame] * s + 0.5 * motion.a[frame] * s**2
            size = max(1.0, np.abs(step).max())
            expected = pin.difference(model, q[frame], q[other])
            assert_allclose(step, expected, rtol=0, atol=1e-9 * size)


@pytest.mark.parametrize("seed", range(5))
def test_derivatives_are_those_that_pinocchio_takes(seed):
    """They move the centre of mass as it moves: to the order of the formula, a quarter of the
    error with half the step."""
    model = random_tree(seed)
    data = model.createData()
    start = random_configuration(model, seed)
    rng = np.random.default_rng(seed)
    directions, frequencies = rng.normal(0.0, 0.4, (2, model.nv)), rng.uniform(1.0, 3.0, model.nv)

    def path(t: float) -> np.ndarray:
        step = directions[0] * np.sin(frequencies * t) + directions[1] * np.cos(frequencies * t)
        return pin.integrate(model, start, step)

    def com(t: float) -> np.ndarray:
        return pin.centerOfMass(model, data, path(t)).copy()

    t, h = 0.3, 1e-3
    velocity = (com(t - 2 * h) - 8 * com(t - h) + 8 * com(t + h) - com(t + 2 * h)) / (12 * h)
    acceleration = (
        -com(t - 2 * h) + 16 * com(t - h) - 30 * com(t) + 16 * com(t + h) - com(t + 2 * h)
    ) / (12 * h**2)
    errors = []
    for step in (0.02, 0.01):
        time = t + step * np.arange(-1, 2)
        motion = differentiate(model, time, np.array([path(x) for x in time]))
        pin.centerOfMass(model, data, motion.q[1], motion.v[1], motion.a[1])
        errors.append(
            [
                np.linalg.norm(data.vcom[0] - velocity),
                np.linalg.norm(data.acom[0] - acceleration),
            ]
        )
    size = np.linalg.norm(acceleration)
    assert size > 1e-2
    assert max(errors[1]) < 1e-2 * max(size, 1.0)
    assert (np.array(errors[0]) > 3.5 * np.array(errors[1])).all()


def test_what_is_straight_has_no_acceleration(model):
    time = uneven_times(9, 0)
    start, velocity = configurations(1)[0], np.arange(1.0, model.nv + 1)
    q = np.array([pin.integrate(model, start, 0.1 * t * velocity) for t in time])
    motion = differentiate(model, time, q)
    assert_allclose(motion.v, np.tile(0.1 * velocity, (9, 1)), rtol=0, atol=1e-9)
    assert_allclose(motion.a, 0.0, rtol=0, atol=1e-7)


def test_short_motions(model):
    q = configurations(2)
    one = differentiate(model, np.array([3.0]), q[:1])
    assert one.frames == 1
    assert one.v.shape == one.a.shape == (1, model.nv)
    assert not one.v.any() and not one.a.any()
    two = differentiate(model, np.array([3.0, 3.5]), q)
    assert two.v.shape == two.a.shape == (2, model.nv)
    expected = pin.difference(model, q[0], q[1]) / 0.5
    assert_allclose(two.v, [expected, expected], rtol=0, atol=1e-12)
    assert not two.a.any()


def test_times_that_are_none(model):
    q = configurations(4)
    for time, message in (
        ([], "time must have at least one frame, got 0"),
        ([0.0, 1.0, 1.0, 2.0], "time must increase, got 1 s and then 1 s in frame 2"),
        ([0.0, 1.0, np.nan, 2.0], "time must be finite, got nan in frame 2"),
        ([0.0, 1.0, 2.0], "q must have 3 frames, got 4"),
    ):
        with pytest.raises(ValueError, match=f"^{message}$"):
            differentiate(model, np.array(time), q)


# How noisy are they?


def test_noise_of_accelerations(model):
    """Of what is known: deviation sqrt(6) rate² sigma on each axis."""
    model = pin.Model(model)
    model.appendBodyToJoint(1, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    frames, rate, sigma = 3000, 100.0, 1e-4
    time = np.arange(frames) / rate
    q = np.tile(configurations(1)[0], (frames, 1))
    q[:, 1] += np.sin(time)
    assert estimateAccelerationNoise(model, time, q) < 1e-6
    q[:, :3] += sigma * np.random.default_rng(0).standard_normal((frames, 3))
    expected = np.sqrt(3.0) * np.sqrt(6.0) * rate**2 * sigma / 9.81
    assert estimateAccelerationNoise(model, time, q) == pytest.approx(expected, rel=0.2)
    slower = estimateAccelerationNoise(model, time, q, stride=5)
    assert slower == pytest.approx(expected / 25.0, rel=0.3)
    with pytest.raises(ValueError, match="stride must be >= 1, got 0"):
        estimateAccelerationNoise(model, time, q, 0)
    with pytest.raises(ValueError, match="q must have 9 frames, got 3000"):
        estimateAccelerationNoise(model, time[:9], q)


# Do derivatives fit?


def mismatch(model: pin.Model, motion: Motion) -> tuple[float, float]:
    """As motion.hpp defines it, once more."""

    def ratio(slopes: np.ndarray, values: np.ndarray, least: float) -> float:
        ratios = []
        for part in (slice(0, 3), slice(3, 6), slice(6, None)):  # place, orientation, joints
            before, after = values[:-1, part], values[1:, part]
            fits = (before, after, 0.5 * (before + after))
            errors = [((slopes[:, part] - x) ** 2).sum(axis=1) for x in fits]
            size = 0.5 * ((before**2).sum(axis=1) + (after**2).sum(axis=1)).mean()
            ratios.append(np.sqrt(np.min(errors, axis=0).mean()) / max(np.sqrt(size), least))
        return max(ratios)

    steps = np.diff(motion.time)[:, None]
    pairs = zip(motion.q[:-1], motion.q[1:], strict=True)
    differences = np.array([pin.difference(model, *pair) for pair in pairs])
    return (
        ratio(differences / steps, motion.v, 0.05),
        ratio(np.diff(motion.v, axis=0) / steps, motion.a, 0.5),
    )


@pytest.mark.parametrize("seed", range(5))
def test_how_far_derivatives_are_off(seed):
    model = random_tree(seed)
    rng = np.random.default_rng(seed)
    q = [random_configuration(model, seed)]
    for step in rng.normal(0.0, 0.05, (20, model.nv)):
        q.append(pin.integrate(model, q[-1], step))
    motion = differentiate(model, uneven_times(21, seed), np.array(q))
    v = motion.v + rng.normal(0.0, 0.5, motion.v.shape)
    a = 1.1 * motion.a
    motion = Motion(motion.time, motion.q, v, a)
    found = compareDerivatives(model, motion)
    assert (found.velocity, found.acceleration) == pytest.approx(mismatch(model, motion), rel=1e-9)
    assert found.velocity > 1e-3 and found.acceleration > 1e-3


@pytest.mark.parametrize("integrator", ["explicit", "semi-implicit", "trapezoidal"])
def test_derivatives_of_any_integrator_fit(integrator):
    model = random_tree(1)
    rng = np.random.default_rng(2)
    time = uneven_times(30, 3)
    a = rng.standard_normal((30, model.nv))
    q, v = [random_configuration(model, 4)], [rng.standard_normal(model.nv)]
    for k, dt in enumerate(np.diff(time)):
        if integrator == "trapezoidal":
            v.append(v[k] + 0.5 * dt * (a[k] + a[k + 1]))
        else:
            v.append(v[k] + dt * a[k])
        speed = {
            "explicit": v[k],
            "semi-implicit": v[k + 1],
            "trapezoidal": 0.5 * (v[k] + v[k + 1]),
        }[integrator]
        q.append(pin.integrate(model, q[k], dt * speed))
    q, v = np.array(q), np.array(v)
    fits = compareDerivatives(model, Motion(time, q, v, a))
    assert fits.velocity == pytest.approx(0.0, abs=1e-9)
    assert fits.acceleration == pytest.approx(0.0, abs=1e-9)
    # Velocities of the free-flyer in the world's axes, or of another unit.
    wrong = v.copy()
    wrong[:, :3] = [rotation(row[3:7]) @ x[:3] for row, x in zip(q, v, strict=True)]
    assert compareDerivatives(model, Motion(time, q, wrong, a)).velocity > 0.1
    assert compareDerivatives(model, Motion(time, q, 2.0 * v, a)).velocity == pytest.approx(
        0.5, rel=0.2
    )
    assert compareDerivatives(model, Motion(time, q, v, 0.0 * a)).acceleration > 1.0


def test_what_stands_still_fits(model):
    still = differentiate(model, np.arange(5.0), np.tile(configurations(1), (5, 1)))
    fits = compareDerivatives(model, still)
    assert (fits.velocity, fits.acceleration) == (0.0, 0.0)
    one = Motion(np.array([0.0]), configurations(1), np.ones((1, 8)), np.ones((1, 8)))
    fits = compareDerivatives(model, one)
    assert (fits.velocity, fits.acceleration) == (0.0, 0.0)


def test_motions_that_do_not_fit_the_model(model):
    motion = differentiate(model, np.arange(5.0), configurations(5))
    with pytest.raises(ValueError, match="^q must have"):
        compareDerivatives(random_tree(0), motion)
    with pytest.raises(TypeError):
        compareDerivatives(model, motion.q)


# The bindings.


def test_keywords(model):
    q = configurations(30)
    assert_array_equal(
        filterConfigurations(model=model, q=q, rate=RATE, cutoff=6),
        filterConfigurations(model, q, RATE, 6.0),
    )
    motion = differentiate(model=model, time=np.arange(30), q=q)
    assert isinstance(motion, Motion)
    fits = compareDerivatives(model=model, motion=motion)
    assert repr(fits) == (
        f"DerivativeMismatch(velocity={fits.velocity:g}, acceleration={fits.acceleration:g})"
    )
    with pytest.raises(AttributeError):
        fits.velocity = 0.0


def test_arguments_are_left_as_they_are(model):
    q, time = configurations(30), np.arange(30.0)
    before = q.copy()
    filterConfigurations(model, q, RATE, 6.0)
    motion = differentiate(model, time, q)
    assert_array_equal(q, before)
    q[:], time[:] = 0.0, 0.0
    assert_array_equal(motion.q, before)
    assert_array_equal(motion.time, np.arange(30.0))


@pytest.mark.parametrize("kind", [np.asfortranarray, lambda q: np.repeat(q, 2, axis=0)[::2]])
def test_arrays_of_any_layout(model, kind):
    q = configurations(30)
    expected = filterConfigurations(model, q, RATE, 6.0)
    assert_array_equal(filterConfigurations(model, kind(q), RATE, 6.0), expected)
    time = np.arange(30.0)
    assert_array_equal(differentiate(model, time, kind(q)).a, differentiate(model, time, q).a)


@pytest.mark.parametrize("function", [filterConfigurations, differentiate, compareDerivatives])
def test_documentation(function):
    (text,) = documentation(function)
    assert "Raises" in text and "ValueError" in text
    for word in {"filterConfigurations": ["(T, nq)", "[Hz]", "Butterworth", "kMaximalCutoff"]}.get(
        function.__name__, []
    ):
        assert word in text
