# SPDX-License-Identifier: BSD-2-Clause
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose, assert_array_equal

import dynacom
from dynacom import CentroidalState, CentroidalWrench, DynaCoM
from helpers import (
    CALM,
    THOROUGH,
    array_kinds,
    random_configuration,
    random_humanoid,
    random_tree,
    to_com,
)

GRAVITY = np.array([0.0, 0.0, -9.81])

seeds = st.integers(0, 2**16)
models = st.sampled_from([random_humanoid, random_tree]).flatmap(lambda m: st.builds(m, seeds))


def vectors(size: int) -> st.SearchStrategy[np.ndarray]:
    return arrays(float, size, elements=st.floats(-10.0, 10.0), fill=st.nothing())


@st.composite
def motions(draw) -> tuple[pin.Model, np.ndarray, np.ndarray, np.ndarray]:
    """A random robot, and what it does."""
    model = draw(models)
    q = random_configuration(model, draw(seeds))
    return model, q, draw(vectors(model.nv)), draw(vectors(model.nv))


def ground_wrench(model, q, v, a, **kwargs) -> np.ndarray:
    robot = DynaCoM(model)
    robot.computeDynamics(q, v, a, **kwargs)
    return np.concatenate([robot.getGroundCoMForce(), robot.getGroundCoMTorque()])


def rounding(model: pin.Model, data: pin.Data) -> float:
    """What rounding may do to a wrench summed over the bodies, whose forces rnea left in data."""
    reach = 1.0 + max(np.abs(placement.translation).max() for placement in data.oMi)
    terms = sum(np.abs(data.f[joint].vector).max() for joint in range(1, model.njoints))
    return 1e-15 * reach * (1.0 + terms)


# Newton and Euler.


@THOROUGH
@given(motions(), st.floats(0.0, 30.0))
def test_newton_euler_is_rnea(motion, gravity):
    """What the free-flyer lacks, by the recursion over the bodies, is what the ground must give."""
    model, q, v, a = motion
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    data = model.createData()
    base = pin.Force(pin.rnea(model, data, q, v, a)[:6])
    com = pin.centerOfMass(model, data, q)
    expected = to_com(data.oMi[1].act(base), com)
    actual = ground_wrench(model, q, v, a)
    assert_allclose(actual, expected, rtol=0, atol=rounding(model, data))


@CALM
@given(motions())
def test_centroidal_state_by_its_definition(motion):
    """Sums over the bodies, written out: momentum, its rate, and the centre of mass's motion."""
    model, q, v, a = motion
    state = dynacom.computeCentroidalState(model, model.createData(), q, v, a)
    data = model.createData()
    pin.rnea(model, data, q, v, a)
    pin.forwardKinematics(model, data, q, v, a)
    mass, first, momentum, rate = 0.0, np.zeros(3), pin.Force.Zero(), pin.Force.Zero()
    for joint in range(1, model.njoints):
        inertia, oMi = model.inertias[joint], data.oMi[joint]
        v_i, a_i = data.v[joint], data.a[joint]
        mass += inertia.mass
        first += inertia.mass * oMi.act(inertia.lever)
        momentum += oMi.act(inertia * v_i)
        rate += oMi.act(inertia * a_i + v_i.cross(inertia * v_i))
    com = first / mass
    tolerance = rounding(model, data)
    assert_allclose(state.mass, mass, rtol=1e-14)
    assert_allclose(state.com, com, rtol=0, atol=1e-13)
    assert_allclose(state.vcom, momentum.linear / mass, rtol=0, atol=tolerance)
    assert_allclose(state.acom, rate.linear / mass, rtol=0, atol=tolerance)
    # About a point that moves with c, momentum and rate lose nothing but the lever.
    assert_allclose(state.am, to_com(momentum, com)[3:], rtol=0, atol=tolerance)
    assert_allclose(state.amVariation, to_com(rate, com)[3:], rtol=0, atol=tolerance)


@CALM
@given(models, seeds)
def test_rates_are_derivatives(model, seed):
    """A step forward and one back in time, along the motion itself."""
    q = random_configuration(model, seed)
    v, a = np.random.default_rng(seed).uniform(-1.0, 1.0, (2, model.nv))
    h = 1e-5

    def state(t):
        # To second order, which is enough: the difference drops even terms.
        q_t = pin.integrate(model, q, t * v + 0.5 * t * t * a)
        return dynacom.computeCentroidalState(model, model.createData(), q_t, v + t * a, a)

    before, now, after = state(-h), state(0.0), state(h)
    for value, rate in (("com", "vcom"), ("vcom", "acom"), ("am", "amVariation")):
        expected = (getattr(after, value) - getattr(before, value)) / (2.0 * h)
        scale = 1.0 + np.abs(getattr(now, rate)).max()
        assert_allclose(getattr(now, rate), expected, rtol=0, atol=1e-4 * scale)


@CALM
@given(motions(), vectors(6))
def test_external_wrench(motion, wrench):
    """What others give, the ground need not."""
    model, q, v, a = motion
    without = ground_wrench(model, q, v, a)
    assert_array_equal(ground_wrench(model, q, v, a, extWrench=np.zeros(6)), without)
    actual = ground_wrench(model, q, v, a, extWrench=wrench)
    assert_allclose(actual, without - wrench, rtol=1e-15, atol=1e-12)


@CALM
@given(motions(), st.floats(0.0, 100.0))
def test_gravity(motion, gravity):
    """It changes the vertical force by m g and nothing else."""
    model, q, v, a = motion
    robot = DynaCoM(model)
    robot.computeDynamics(q, v, a)
    before = np.concatenate([robot.getGroundCoMForce(), robot.getGroundCoMTorque()])
    acceleration = robot.getACoM()
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    robot = DynaCoM(model)
    robot.computeDynamics(q, v, a)
    after = np.concatenate([robot.getGroundCoMForce(), robot.getGroundCoMTorque()])
    assert_array_equal(robot.getACoM(), acceleration)
    expected = before + [0, 0, robot.getMass() * (gravity - 9.81), 0, 0, 0]
    assert_allclose(after, expected, rtol=1e-13, atol=1e-11 * robot.getMass())


@CALM
@given(motions())
def test_at_rest_the_ground_bears_the_weight_under_the_centre_of_mass(motion):
    model, q, _, _ = motion
    zero = np.zeros(model.nv)
    robot = DynaCoM(model)
    robot.computeDynamics(q, zero, zero)
    weight = 9.81 * pin.computeTotalMass(model)
    assert_allclose(robot.getGroundCoMForce(), [0, 0, weight], rtol=1e-14, atol=0)
    assert_array_equal(robot.getGroundCoMTorque(), np.zeros(3))
    assert_array_equal(robot.getCoP(), robot.getCoM()[:2])


@CALM
@given(motions())
def test_free_fall_needs_no_ground(motion):
    model, q, _, _ = motion
    a = np.zeros(model.nv)
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    a[:3] = data.oMi[1].rotation.T @ GRAVITY
    robot = DynaCoM(model)
    robot.computeDynamics(q, np.zeros(model.nv), a)
    tolerance = 1e-12 * robot.getMass()
    assert_allclose(robot.getACoM(), GRAVITY, rtol=0, atol=1e-12)
    assert_allclose(robot.getGroundCoMForce(), np.zeros(3), rtol=0, atol=tolerance)
    assert_allclose(robot.getGroundCoMTorque(), np.zeros(3), rtol=0, atol=10 * tolerance)
    assert np.isnan(robot.getCoP()).all()


@CALM
@given(motions(), st.floats(-3.0, 3.0), vectors(3))
def test_nothing_depends_on_where_the_robot_is_and_heads(motion, yaw, offset):
    """Moved and turned about the vertical, the robot's wrench turns with it."""
    model, q, v, a = motion
    move = pin.SE3(pin.exp3(np.array([0.0, 0.0, yaw])), offset)
    moved = q.copy()
    moved[:7] = pin.SE3ToXYZQUAT(move * pin.XYZQUATToSE3(q[:7]))
    here = dynacom.computeCentroidalState(model, model.createData(), q, v, a)
    there = dynacom.computeCentroidalState(model, model.createData(), moved, v, a)
    assert_allclose(there.com, move.act(here.com), rtol=0, atol=1e-12)
    scale = np.abs(np.concatenate([here.vcom, here.acom, here.am, here.amVariation])).max()
    for name in ("vcom", "acom", "am", "amVariation"):
        expected = move.rotation @ getattr(here, name)
        assert_allclose(getattr(there, name), expected, rtol=0, atol=1e-11 * (1.0 + scale))


# The free functions.


@CALM
@given(motions())
def test_free_functions_are_those_of_the_class(motion):
    """For those who have their own Model and Data: the same numbers to the last bit."""
    model, q, v, a = motion
    wrench = np.arange(6.0)
    robot = DynaCoM(model)
    robot.setGroundHeight(-0.25)
    robot.computeNL(3.0, q, v, a, wrench)

    data = model.createData()
    state = dynacom.computeCentroidalState(model=model, data=data, q=q, v=v, a=a)
    ground = dynacom.computeGroundWrench(state=state, gravity=GRAVITY, extWrench=wrench)
    cop = dynacom.computeFlatGroundCoP(groundWrench=ground, com=state.com, groundHeight=-0.25)
    vrp = dynacom.computeVRP(state=state, omega=3.0)
    assert_allclose(state.mass, robot.getMass(), rtol=1e-14)
    for ours, theirs in (
        (state.com, robot.getCoM()),
        (state.vcom, robot.getVCoM()),
        (state.acom, robot.getACoM()),
        (state.am, robot.getAM()),
        (state.amVariation, robot.getAMVariation()),
        (ground.force, robot.getGroundCoMForce()),
        (ground.torque, robot.getGroundCoMTorque()),
        (cop, robot.getCoP()),
        (vrp, robot.getVRP()),
        (cop - vrp, robot.getNL()),
    ):
        assert_array_equal(ours, theirs)

    # Kinematics and momenta are left in the caller's data.
    expected = model.createData()
    pin.computeCentroidalMomentumTimeVariation(model, expected, q, v, a)
    assert data.oMi[model.njoints - 1] == expected.oMi[model.njoints - 1]
    assert data.hg == expected.hg
    assert data.dhg == expected.dhg
    read = dynacom.readCentroidalState(data=expected)
    for name in ("mass", "com", "vcom", "acom", "am", "amVariation"):
        assert_array_equal(getattr(read, name), getattr(state, name))


def make_state(**fields: object) -> CentroidalState:
    state = CentroidalState()
    for name, value in fields.items():
        setattr(state, name, value)
    return state


def make_wrench(force: np.ndarray, torque: np.ndarray) -> CentroidalWrench:
    wrench = CentroidalWrench()
    wrench.force, wrench.torque = np.asarray(force), np.asarray(torque)
    return wrench


def test_ground_wrench_by_hand():
    state = make_state(mass=2.0, acom=np.array([1, 2, 3]), amVariation=np.array([4, 5, 6]))
    ground = dynacom.computeGroundWrench(state, np.array([0, 0, -10]))
    assert_array_equal(ground.force, [2, 4, 26])
    assert_array_equal(ground.torque, [4, 5, 6])
    ground = dynacom.computeGroundWrench(state, np.array([0, 0, -10]), np.array([1, 2, 3, 4, 5, 7]))
    assert_array_equal(ground.force, [1, 2, 23])
    assert_array_equal(ground.torque, [0, 0, -1])


def test_accelerations_of_a_ground_wrench_by_hand():
    state = make_state(mass=2.0, com=np.ones(3), acom=np.full(3, 9.0), amVariation=np.full(3, 9.0))
    ground = make_wrench([2, 4, 26], [4, 5, 6])
    caused = dynacom.applyGroundWrench(state, ground, np.array([0, 0, -10]))
    assert_array_equal(caused.acom, [1, 2, 3])
    assert_array_equal(caused.amVariation, [4, 5, 6])
    assert caused.mass == 2.0
    assert_array_equal(caused.com, np.ones(3))
    assert_array_equal(state.acom, np.full(3, 9.0))
    pushed = {"gravity": np.array([0, 0, -10]), "extWrench": np.array([2, 4, 6, 1, 2, 3])}
    caused = dynacom.applyGroundWrench(state=state, groundWrench=ground, **pushed)
    assert_array_equal(caused.acom, [2, 4, 6])
    assert_array_equal(caused.amVariation, [5, 7, 9])


@CALM
@given(motions(), vectors(6))
def test_accelerations_are_those_of_the_ground_wrench(motion, wrench):
    """One function is the other's inverse."""
    model, q, v, a = motion
    state = dynacom.computeCentroidalState(model, model.createData(), q, v, a)
    ground = dynacom.computeGroundWrench(state, GRAVITY, wrench)
    caused = dynacom.applyGroundWrench(state, ground, GRAVITY, wrench)
    size = np.abs(ground.force).max() + np.abs(wrench).max() + 10.0 * state.mass
    assert_allclose(caused.acom, state.acom, rtol=0, atol=1e-15 * size / state.mass)
    size = np.abs(ground.torque).max() + np.abs(wrench).max()
    assert_allclose(caused.amVariation, state.amVariation, rtol=0, atol=1e-15 * size)
    for name in ("mass", "com", "vcom", "am"):
        assert_array_equal(getattr(caused, name), getattr(state, name))


def test_centre_of_pressure_by_hand():
    """100 N up, 10 N along x and 20 N along y, from a centre of mass 0.8 m above the ground."""
    com = np.array([1.0, 2.0, 0.8])
    wrench = make_wrench([10.0, 20.0, 100.0], [3.0, 5.0, 7.0])
    expected = [1.0 + (-5.0 - 8.0) / 100.0, 2.0 + (3.0 - 16.0) / 100.0]
    assert_allclose(dynacom.computeFlatGroundCoP(wrench, com), expected, rtol=1e-15)
    # On a step 0.3 m high the lateral forces have less of a lever.
    expected = [1.0 + (-5.0 - 5.0) / 100.0, 2.0 + (3.0 - 10.0) / 100.0]
    assert_allclose(dynacom.computeFlatGroundCoP(wrench, com, 0.3), expected, rtol=1e-15)
    assert_allclose(
        dynacom.computeFlatGroundCoP(wrench, com, groundHeight=0.3), expected, rtol=1e-15
    )


@CALM
@given(seeds, st.floats(-2.0, 2.0))
def test_centre_of_pressure_is_that_of_forces_on_the_ground(seed, height):
    """Wherever on the ground forces press, and however they pull sideways."""
    rng = np.random.default_rng(seed)
    com = rng.uniform(-2.0, 2.0, 3)
    places = np.column_stack([rng.uniform(-1.0, 1.0, (5, 2)), np.full(5, height)])
    forces = np.column_stack([rng.uniform(-50.0, 50.0, (5, 2)), rng.uniform(1.0, 100.0, 5)])
    torque = np.cross(places - com, forces).sum(axis=0)
    cop = dynacom.computeFlatGroundCoP(make_wrench(forces.sum(axis=0), torque), com, height)
    assert_allclose(cop, forces[:, 2] @ places[:, :2] / forces[:, 2].sum(), rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("force", "means_something"),
    [
        (1.0, True),
        (1e9, True),
        (np.nextafter(1.0, 0.0), False),
        (0.0, False),
        (-5.0, False),
        (np.nan, False),
    ],
)
def test_centre_of_pressure_needs_a_newton(force, means_something):
    cop = dynacom.computeFlatGroundCoP(make_wrench([0.0, 0.0, force], np.zeros(3)), np.ones(3))
    assert cop.shape == (2,)
    assert np.isfinite(cop).all() == means_something
    assert np.isnan(cop).all() != means_something


def test_another_minimal_vertical_force():
    wrench = make_wrench([0.0, 0.0, 0.1], np.zeros(3))
    cop = dynacom.computeFlatGroundCoP(wrench, np.ones(3), 0.0, 0.1)
    assert_array_equal(cop, np.ones(2))
    cop = dynacom.computeFlatGroundCoP(wrench, np.ones(3), minimalVerticalForce=0.11)
    assert np.isnan(cop).all()


def test_virtual_repellent_point_by_hand():
    state = make_state(com=np.array([1, 2, 3]), acom=np.array([4, -8, 5]))
    assert_array_equal(dynacom.computeVRP(state, 2), [0, 4])
    assert_allclose(dynacom.computeVRP(state, 1e8), [1, 2], rtol=1e-15)


@pytest.mark.parametrize("omega", [0.0, -1.0, np.nan, -np.inf])
def test_virtual_repellent_point_needs_a_frequency(omega):
    with pytest.raises(ValueError, match=f"omega must be > 0 rad/s, got {omega:g}"):
        dynacom.computeVRP(make_state(com=np.zeros(3)), omega)


# Arrays.


@pytest.fixture(scope="module")
def humanoid() -> pin.Model:
    return random_humanoid(0)


@pytest.mark.parametrize("name", ["q", "v", "a"])
@pytest.mark.parametrize("change", [-1, 1, None])
def test_wrong_sizes(humanoid, name, change):
    sizes = {"q": humanoid.nq, "v": humanoid.nv, "a": humanoid.nv}
    arguments = {"q": pin.neutral(humanoid), "v": np.zeros(sizes["v"]), "a": np.zeros(sizes["a"])}
    size = 0 if change is None else sizes[name] + change
    arguments[name] = np.zeros(size)
    unit = "nq" if name == "q" else "nv"
    message = rf"^{name} must have {sizes[name]} components \({unit}\), got {size}$"
    with pytest.raises(ValueError, match=message):
        dynacom.computeCentroidalState(humanoid, humanoid.createData(), **arguments)


@pytest.mark.parametrize("wrong", [None, "q", [[0.0]], np.zeros((2, 3)), np.array(["a"]), 1.0])
def test_wrong_types(humanoid, wrong):
    zero = np.zeros(humanoid.nv)
    data = humanoid.createData()
    for call in (
        lambda: dynacom.computeCentroidalState(humanoid, data, wrong, zero, zero),
        lambda: dynacom.computeCentroidalState(wrong, data, pin.neutral(humanoid), zero, zero),
        lambda: dynacom.readCentroidalState(wrong),
        lambda: dynacom.computeGroundWrench(make_state(mass=1.0), wrong),
        lambda: dynacom.computeFlatGroundCoP(make_wrench(np.ones(3), np.ones(3)), wrong),
        lambda: dynacom.computeVRP(wrong, 1.0),
        lambda: setattr(make_state(), "com", wrong),
    ):
        with pytest.raises(TypeError):
            call()


def test_vectors_of_the_wrong_size():
    state, wrench = make_state(mass=1.0), make_wrench(np.ones(3), np.ones(3))
    with pytest.raises(ValueError, match="gravity must have 3 .*, got 2"):
        dynacom.computeGroundWrench(state, np.zeros(2))
    with pytest.raises(ValueError, match="extWrench must have 6 .*, got 3"):
        dynacom.computeGroundWrench(state, np.zeros(3), np.zeros(3))
    with pytest.raises(ValueError, match="com must have 3 .*, got 4"):
        dynacom.computeFlatGroundCoP(wrench, np.zeros(4))
    with pytest.raises(ValueError, match="torque must have 3 .*, got 6"):
        wrench.torque = np.zeros(6)


def test_arrays_of_any_kind(humanoid):
    q, v = pin.neutral(humanoid), np.arange(humanoid.nv) - 8
    q[7:] = np.arange(humanoid.nq - 7) - 5
    kinds = zip(array_kinds(q), array_kinds(v), array_kinds(-v), strict=True)
    states = {}
    for (kind, q_), (_, v_), (_, a_) in kinds:
        state = dynacom.computeCentroidalState(humanoid, humanoid.createData(), q_, v_, a_)
        states[kind] = [state.com, state.vcom, state.acom, state.am, state.amVariation]
    for kind, values in states.items():
        for value, expected in zip(values, states["plain"], strict=True):
            assert_array_equal(value, expected, kind)


@pytest.mark.parametrize("cls", [CentroidalState, CentroidalWrench])
def test_structs_share_no_memory_with_arrays(cls):
    for field in (name for name, kind in vars(cls).items() if isinstance(kind, property)):
        struct = cls()
        if field == "mass":
            struct.mass = 3
            assert struct.mass == 3.0
            continue
        for kind, values in array_kinds([1, -2, 3]):
            setattr(struct, field, values)
            assert_array_equal(getattr(struct, field), [1, -2, 3], kind)
        values = np.ones(3)
        setattr(struct, field, values)
        values[:] = 9.0
        getattr(struct, field)[:] = 9.0
        assert_array_equal(getattr(struct, field), np.ones(3))
