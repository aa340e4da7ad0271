# SPDX-License-Identifier: BSD-2-Clause
import copy
import gc
import operator

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import dynacom
from dynacom import (
    Contact6D,
    Contact6DSettings,
    ContactBase,
    ContactPoint,
    ContactPointSettings,
    DynacomError,
    DynaCoMSettings,
    FrictionModel,
    NotReadyError,
)
from helpers import (
    CALM,
    array_kinds,
    point,
    point_settings,
    random_pose,
    sole,
    sole_settings,
    to_com,
)

MU, GU, DX, DY = 0.3, 0.4, 0.1, 0.05

# The manual's matrices, typed from it.
POINT_U = [[0, 0, -1]]
POINT_C = [[1, 0, -MU], [0, 1, -MU], [-1, 0, -MU], [0, -1, -MU]]
SOLE_U = [
    [0, 0, -1, 0, 0, 0],
    [0, 0, -DX, 0, -1, 0],
    [0, 0, -DY, 1, 0, 0],
    [0, 0, -DX, 0, 1, 0],
    [0, 0, -DY, -1, 0, 0],
]
SOLE_C = [
    [1, 0, -MU, 0, 0, 0],
    [0, 1, -MU, 0, 0, 0],
    [-1, 0, -MU, 0, 0, 0],
    [0, -1, -MU, 0, 0, 0],
    [0, 0, -GU, 0, 0, 1],
    [0, 0, -GU, 0, 0, -1],
]

MATRICES = ("uni_A", "uni_b", "fri_A", "fri_b", "reg_A", "reg_b", "ne_A")


@pytest.fixture
def the_point() -> ContactPoint:
    return point(mu=MU, weights=np.array([1.0, 2.0, 3.0]))


@pytest.fixture
def the_sole() -> Contact6D:
    return sole(mu=MU, gu=GU, half_length=DX, half_width=DY, weights=np.arange(1.0, 7.0))


@pytest.fixture(params=["the_point", "the_sole"])
def contact(request: pytest.FixtureRequest) -> ContactBase:
    return request.getfixturevalue(request.param)


def state(contact: ContactBase) -> list:
    """All that a contact holds, to tell whether anything has changed."""
    values = [getattr(contact, name)().tolist() for name in MATRICES]
    values += [contact.appliedForce().tolist(), contact.getPose().homogeneous.tolist()]
    return [*values, contact.getFrameID(), contact.getFrameName(), repr(contact.getSettings())]


# Settings.

OPTIONS = {
    "friction": FrictionModel.OuterPyramid,
    "facets": 8,
    "facet_angle": 0,
    "least_normal_force": 0,
    "greatest_normal_force": np.inf,
    "placement": pin.SE3.Identity(),
}
DEFAULTS = [
    (
        ContactPointSettings,
        {
            "mu": 0,
            "weights": np.ones(3),
            "frame_name": "",
            "world_aligned": False,
            "radius": 0,
            "reference": np.zeros(3),
            **OPTIONS,
        },
    ),
    (
        Contact6DSettings,
        {
            "mu": 0,
            "gu": 0,
            "half_length": 0,
            "half_width": 0,
            "weights": np.ones(6),
            "frame_name": "",
            "reference": np.zeros(6),
            "coupled_yaw": False,
            **OPTIONS,
        },
    ),
    (DynaCoMSettings, {"urdf": "", "gravity": np.array([0, 0, -9.81])}),
]
OTHER_VALUES = {
    "mu": 0.25,
    "gu": 0.125,
    "half_length": 0.375,
    "half_width": 0.0625,
    "radius": 0.5,
    "frame_name": "sole",
    "urdf": "robot.urdf",
    "world_aligned": True,
    "coupled_yaw": True,
    "friction": FrictionModel.Cone,
    "facets": 16,
    "facet_angle": 0.125,
    "least_normal_force": 5.0,
    "greatest_normal_force": 500.0,
    "placement": pin.SE3(np.eye(3), np.array([0.0, 0.25, 0.0])),
}
FIELDS = [(cls, field) for cls, defaults in DEFAULTS for field in defaults]


def other_value(settings: object, field: str) -> object:
    value = getattr(settings, field)
    return 3.0 * value + 0.5 if isinstance(value, np.ndarray) else OTHER_VALUES[field]


@pytest.mark.parametrize(("cls", "defaults"), DEFAULTS)
def test_settings_defaults(cls, defaults):
    fields = {name for name, kind in vars(cls).items() if isinstance(kind, property)}
    assert fields == defaults.keys()
    for field, value in defaults.items():
        assert_array_equal(getattr(cls(), field), value)


@pytest.mark.parametrize(("cls", "field"), FIELDS)
def test_settings_compare_by_every_field(cls, field):
    settings, other = cls(), cls()
    assert operator.eq(settings, other) is True
    assert operator.ne(settings, other) is False
    setattr(other, field, other_value(other, field))
    assert operator.eq(settings, other) is False
    assert operator.ne(settings, other) is True
    setattr(settings, field, getattr(other, field))
    assert settings == other


def test_settings_of_another_type_are_not_equal():
    for other in (ContactPointSettings(), DynaCoMSettings(), 3, None, "Contact6DSettings"):
        assert operator.eq(Contact6DSettings(), other) is False
        assert operator.ne(Contact6DSettings(), other) is True


@pytest.mark.parametrize(("cls", "field"), FIELDS)
def test_settings_print_every_field(cls, field):
    settings = cls()
    before = str(settings)
    setattr(settings, field, other_value(settings, field))
    # Options are printed where they are other than by default.
    optional = field in OPTIONS or field in ("reference", "coupled_yaw")
    assert f"{field}=" in (str(settings) if optional else before)
    assert str(settings) != before
    assert str(settings) == repr(settings) == settings.to_string()
    assert cls.__name__ in repr(settings)
    if field in OTHER_VALUES and field != "placement":
        value = OTHER_VALUES[field]
        text = f"{value:g}" if isinstance(value, float) else str(value)
        assert text.lower() in repr(settings).lower()


@pytest.mark.parametrize(("cls", "field"), FIELDS)
@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda settings: settings.copy()])
def test_settings_are_copied(cls, field, copied):
    settings = cls()
    other = copied(settings)
    assert type(other) is cls
    assert other == settings
    setattr(other, field, other_value(other, field))
    assert settings == cls()


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        (point_settings(), "weights"),
        (sole_settings(), "weights"),
        (DynaCoMSettings(), "gravity"),
    ],
)
def test_settings_share_no_memory_with_arrays(settings, field):
    before = getattr(settings, field)
    getattr(settings, field)[:] = 7.0
    assert_array_equal(getattr(settings, field), before)
    given_array = before + 1.0
    setattr(settings, field, given_array)
    given_array[:] = 7.0
    assert_array_equal(getattr(settings, field), before + 1.0)


@pytest.mark.parametrize("cls", [ContactPointSettings, Contact6DSettings])
def test_weights_of_any_kind(cls):
    for kind, weights in array_kinds(np.arange(1, cls().weights.size + 1)):
        settings = cls()
        settings.weights = weights
        assert_array_equal(settings.weights, np.ravel(weights), kind)


@pytest.mark.parametrize("cls", [ContactPointSettings, Contact6DSettings])
def test_integers_are_numbers(cls):
    settings = cls()
    settings.mu = 1
    assert settings.mu == 1.0
    assert isinstance(settings.mu, float)


OUT_OF_RANGE = [
    (cls, field, value)
    for cls, fields in (
        (point_settings, ("mu", "radius")),
        (sole_settings, ("mu", "gu", "half_length", "half_width")),
    )
    for field in fields
    for value in (-0.5, -1e-300, np.nan, np.inf, -np.inf)
]
OUT_OF_RANGE += [
    (cls, "weights", np.array([*([1.0] * (size - 1)), value]))
    for cls, size in ((point_settings, 3), (sole_settings, 6))
    for value in (0.0, -2.0, np.nan, np.inf)
]
OUT_OF_RANGE += [(cls, "frame_name", "") for cls in (point_settings, sole_settings)]


@pytest.mark.parametrize(("make", "field", "value"), OUT_OF_RANGE)
def test_settings_out_of_range(make, field, value):
    """The message names the field, what was expected and what was got; nothing has changed."""
    settings = make(**{field: value})
    cls = ContactPoint if isinstance(settings, ContactPointSettings) else Contact6D
    contact = cls(make(mu=0.5))
    before = state(contact)
    shown = "''" if field == "frame_name" else f"{np.ravel(value)[-1]:g}"
    for refuse in (
        settings.validate,
        lambda: cls(settings),
        lambda: cls().initialize(settings),
        lambda: contact.initialize(settings),
    ):
        with pytest.raises(ValueError, match="must be .*, got ") as error:
            refuse()
        assert f"{type(settings).__name__}.{field} must be" in str(error.value)
        assert str(error.value).endswith(shown)
    assert state(contact) == before


def test_zero_is_in_range():
    point(mu=0, radius=0).getSettings().validate()
    sole(mu=0, gu=0, half_length=0, half_width=0).getSettings().validate()


@pytest.mark.parametrize("value", ["a", None, [1.0], np.ones(3), 1j])
@pytest.mark.parametrize(
    ("make", "field"),
    [(point_settings, "mu"), (point_settings, "radius"), (sole_settings, "half_length")],
)
def test_settings_of_the_wrong_type(make, field, value):
    settings = make()
    with pytest.raises(TypeError):
        setattr(settings, field, value)
    assert settings == make()


# Construction.


@pytest.mark.parametrize(
    ("cls", "make"), [(ContactPoint, point_settings), (Contact6D, sole_settings)]
)
def test_settings_to_the_constructor_or_later(cls, make):
    settings = make(mu=0.3)
    later = cls()
    assert later.cols() == 0
    later.initialize(settings=settings)
    assert state(later) == state(cls(settings=settings))
    assert later.getSettings() == settings
    assert later.getFrameName() == "frame"


def test_initialize_again(contact):
    """The force becomes zero and the frame is looked up again; the rest is as of the settings."""
    contact.updateNewtonEuler(np.zeros(3), random_pose(np.random.default_rng(0)))
    contact.applyForce(np.ones(contact.cols()))
    contact.setFrameID(3)
    settings = contact.getSettings()
    settings.mu, settings.frame_name = 0.9, "another"
    contact.initialize(settings)
    assert contact.getFrameName() == "another"
    assert contact.getFrameID() == type(contact)().getFrameID() > 2**62
    assert_array_equal(contact.appliedForce(), np.zeros(contact.cols()))
    assert contact.fri_A()[0, 2] == -0.9


def test_settings_are_taken_as_a_copy(contact):
    settings = contact.getSettings()
    contact.initialize(settings)
    before = state(contact)
    settings.mu = 0.9
    settings.weights = 7.0 * settings.weights
    contact.getSettings().mu = 0.9
    assert state(contact) == before


@pytest.mark.parametrize(
    ("cls", "wrong"), [(ContactPoint, sole_settings()), (Contact6D, point_settings())]
)
def test_settings_of_the_other_contact(cls, wrong):
    for argument in (wrong, {}, None, "frame"):
        with pytest.raises(TypeError):
            cls(argument)
        with pytest.raises(TypeError):
            cls().initialize(argument)


def test_contact_base_is_abstract():
    with pytest.raises(RuntimeError, match="cannot be instantiated"):
        ContactBase()
    assert issubclass(ContactPoint, ContactBase)
    assert issubclass(Contact6D, ContactBase)


SETTERS = [
    ("setMu", "mu", {"mu": 0.7}),
    ("setForceWeights", "force_weights", {"weights": [7.0, 8.0, 9.0]}),
    ("setGu", "gu", {"gu": 0.7}),
    ("setTorqueWeights", "torque_weights", {"weights": [7.0, 8.0, 9.0]}),
    ("setSurfaceHalfWidth", "half_width", {"half_width": 0.7}),
    ("setSurfaceHalfLength", "half_length", {"half_length": 0.7}),
]


@pytest.mark.parametrize(
    ("cls", "setter", "fields"),
    [(Contact6D, setter, fields) for setter, _, fields in SETTERS]
    + [(ContactPoint, setter, fields) for setter, _, fields in SETTERS[:2]],
)
def test_setters_before_initialize(cls, setter, fields):
    contact = cls()
    (value,) = fields.values()
    value = np.array(value) if "weights" in fields else value
    with pytest.raises(NotReadyError, match=rf"{cls.__name__} .*before initialize\(\)") as error:
        getattr(contact, setter)(value)
    assert isinstance(error.value, RuntimeError)
    assert isinstance(error.value, DynacomError)
    contact.initialize(point_settings() if cls is ContactPoint else sole_settings())
    getattr(contact, setter)(value)


def test_contact_that_waits():
    """Until it has settings a contact has no columns, and nothing that it hands out is garbage."""
    for contact in (ContactPoint(), Contact6D()):
        assert contact.cols() == contact.uni_rows() == contact.fri_rows() == 0
        for name in MATRICES:
            assert getattr(contact, name)().size == 0
        contact.updateNewtonEuler(np.ones(3), pin.SE3.Random())
        contact.deactivate()
        assert_array_equal(contact.toWorldForces(), np.zeros(6))
        assert_array_equal(contact.toCoMForces(), np.zeros(6))
        assert np.isnan(contact.getCoP()).all()
        assert contact.clone().cols() == 0
        with pytest.raises(ValueError, match="force must have 0 components, got 3"):
            contact.applyForce(np.ones(3))


# Matrices.


def test_matrices_of_a_point(the_point):
    """Two-dimensional, the single row of U too: code that stacks matrices relies on it."""
    assert (the_point.uni_rows(), the_point.fri_rows(), the_point.cols()) == (1, 4, 3)
    assert the_point.uni_A().shape == (1, 3)
    assert_array_equal(the_point.uni_A(), POINT_U)
    assert_array_equal(the_point.fri_A(), POINT_C)
    assert_array_equal(the_point.uni_b(), np.zeros(1))
    assert_array_equal(the_point.fri_b(), np.zeros(4))
    assert_array_equal(the_point.reg_A(), [1, 2, 3])
    assert_array_equal(the_point.reg_b(), np.zeros(3))
    assert the_point.ne_A().shape == (6, 3)


def test_matrices_of_a_sole(the_sole):
    assert (the_sole.uni_rows(), the_sole.fri_rows(), the_sole.cols()) == (5, 6, 6)
    assert_array_equal(the_sole.uni_A(), SOLE_U)
    assert_array_equal(the_sole.fri_A(), SOLE_C)
    assert_array_equal(the_sole.uni_b(), np.zeros(5))
    assert_array_equal(the_sole.fri_b(), np.zeros(6))
    assert_array_equal(the_sole.reg_A(), [1, 2, 3, 4, 5, 6])
    assert_array_equal(the_sole.reg_b(), np.zeros(6))
    assert the_sole.ne_A().shape == (6, 6)


def test_newton_euler_by_hand(the_point, the_sole):
    """A surface turned by 90 degrees about z, 1 m beside the centre of mass along y."""
    pose = pin.SE3(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([0.0, 3.0, 0.0]))
    expected = np.array(
        [
            [0, -1, 0, 0, 0, 0],
            [1, 0, 0, 0, 0, 0],
            [0, 0, 1, 0, 0, 0],
            [0.5, 0, 1, 0, -1, 0],
            [0, 0.5, 0, 1, 0, 0],
            [0, 1, 0, 0, 0, 1],
        ]
    )
    com = np.array([0.0, 2.0, 0.5])
    the_sole.updateNewtonEuler(com=com, oMs=pose)
    the_point.updateNewtonEuler(com, pose)
    assert_array_equal(the_sole.ne_A(), expected)
    assert_array_equal(the_point.ne_A(), expected[:, :3])
    assert the_sole.getPose() == the_sole.getSurfacePose() == pose


@CALM
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_newton_euler_is_the_force_adjoint(seed, is_sole):
    rng = np.random.default_rng(seed)
    contact = sole() if is_sole else point()
    com, pose = rng.uniform(-2.0, 2.0, 3), random_pose(rng)
    contact.updateNewtonEuler(com, pose)
    adjoint = pin.SE3(pose.rotation, pose.translation - com).toDualActionMatrix()
    assert_allclose(contact.ne_A(), adjoint[:, : contact.cols()], rtol=0, atol=1e-15)


@pytest.mark.parametrize(("setter", "argument", "fields"), SETTERS)
@pytest.mark.parametrize("by_keyword", [True, False])
def test_setters_of_a_sole(the_sole, setter, argument, fields, by_keyword):
    """Each changes the matrices as its field in the settings does, and nothing else."""
    the_sole.applyForce(np.ones(6))
    settings = the_sole.getSettings()
    ((field, value),) = fields.items()
    if field == "weights":
        weights = settings.weights
        weights[slice(3, 6) if argument == "torque_weights" else slice(0, 3)] = value
        settings.weights, value = weights, np.array(value)
    else:
        setattr(settings, field, value)
    if by_keyword:
        getattr(the_sole, setter)(**{argument: value})
    else:
        getattr(the_sole, setter)(value)
    expected = Contact6D(settings)
    expected.applyForce(np.ones(6))
    assert state(the_sole) == state(expected)


@pytest.mark.parametrize(("setter", "argument", "fields"), SETTERS[:2])
def test_setters_of_a_point(the_point, setter, argument, fields):
    settings = the_point.getSettings()
    ((field, value),) = fields.items()
    value = np.array(value) if field == "weights" else value
    setattr(settings, field, value)
    getattr(the_point, setter)(**{argument: value})
    assert state(the_point) == state(ContactPoint(settings))
    assert not hasattr(the_point, "setGu")


@pytest.mark.parametrize(("setter", "argument", "fields"), SETTERS)
@pytest.mark.parametrize("value", [-0.5, np.nan, np.inf])
def test_setters_out_of_range(the_sole, setter, argument, fields, value):
    (field,) = fields
    value = np.full(3, value) if field == "weights" else value
    before = state(the_sole)
    with pytest.raises(ValueError, match=f"Contact6DSettings.{field} must be .*, got "):
        getattr(the_sole, setter)(value)
    assert state(the_sole) == before


def test_weights_must_not_be_zero(contact):
    before = state(contact)
    with pytest.raises(ValueError, match="weights must be finite and > 0, got 1 0 1"):
        contact.setForceWeights(np.array([1, 0, 1]))
    assert state(contact) == before


# World-aligned and round feet.


def test_surface_of_a_point():
    """By default the frame itself; world_aligned drops its rotation, radius moves it down."""
    rng = np.random.default_rng(1)
    pose = random_pose(rng)
    R, p = pose.rotation, pose.translation
    for aligned in (False, True):
        for radius in (0.0, 0.25):
            contact = point(world_aligned=aligned, radius=radius)
            contact.setPose(pose)
            axes = np.eye(3) if aligned else R
            surface = contact.getSurfacePose()
            assert_array_equal(surface.rotation, axes)
            assert_allclose(surface.translation, p - radius * axes[:, 2], rtol=0, atol=1e-16)
            assert contact.getPose() == pose
            contact.updateNewtonEuler(np.zeros(3), pose)
            assert_array_equal(contact.ne_A()[:3], axes)
            lever = pin.skew(surface.translation)
            assert_allclose(contact.ne_A()[3:], lever @ axes, rtol=0, atol=1e-15)


# Forces.


def test_force(contact):
    force = np.arange(1.0, contact.cols() + 1.0)
    assert_array_equal(contact.appliedForce(), 0.0 * force)
    contact.applyForce(force=force)
    assert_array_equal(contact.appliedForce(), force)
    contact.deactivate()
    assert_array_equal(contact.appliedForce(), 0.0 * force)


@CALM
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_wrenches_in_the_world(seed, is_sole):
    """toWorldForces is about the world's origin, toCoMForces about the centre of mass."""
    rng = np.random.default_rng(seed)
    aligned = bool(rng.integers(2))
    contact = sole() if is_sole else point(world_aligned=aligned, radius=rng.uniform(0, 0.1))
    com, pose = rng.uniform(-2.0, 2.0, 3), random_pose(rng)
    contact.updateNewtonEuler(com, pose)
    force = np.zeros(6)
    force[: contact.cols()] = rng.uniform(-500.0, 500.0, contact.cols())
    contact.applyForce(force[: contact.cols()])
    world = contact.getSurfacePose().act(pin.Force(force))
    assert_allclose(contact.toWorldForces(), world.vector, rtol=0, atol=1e-11)
    assert_allclose(contact.toCoMForces(), to_com(world, com), rtol=0, atol=1e-11)
    assert_allclose(
        contact.toCoMForces(), contact.ne_A() @ contact.appliedForce(), rtol=0, atol=1e-11
    )


def test_centre_of_pressure(the_point, the_sole):
    for contact in (the_point, the_sole):
        assert np.isnan(contact.getCoP()).all()
        contact.applyForce(np.append([1.0, 2.0, -3.0], np.zeros(contact.cols() - 3)))
        assert np.isnan(contact.getCoP()).all()
    the_point.applyForce(np.array([1.0, 2.0, 3.0]))
    assert_array_equal(the_point.getCoP(), np.zeros(2))
    # 50 N press 0.03 m along x and 0.02 m against y: (x, y, 0) cross (0, 0, f) = (y f, -x f, 0).
    the_sole.applyForce(np.array([5.0, 6.0, 50.0, -1.0, -1.5, 0.3]))
    assert_allclose(the_sole.getCoP(), [0.03, -0.02], rtol=1e-15)


def test_usage_and_margin(the_point, the_sole):
    """How much of friction, of yaw friction and of the distance to the edges a force leaves."""
    for contact in (the_point, the_sole):
        size = contact.cols()
        assert contact.getFrictionUsage() == 0.0
        assert np.isnan(contact.getCoPMargin())
        for force, usage in (
            ([0.15, -0.3, 2.0, 0.0, 0.0, 0.0], 0.5),
            ([-0.6, 0.0, 2.0, 0.0, 0.0, 0.0], 1.0),
            ([0.0, 0.0, 2.0, 0.0, 0.0, 0.0], 0.0),
            ([0.0, 0.9, 2.0, 0.0, 0.0, 0.0], 1.5),
            ([0.1, 0.0, 0.0, 0.0, 0.0, 0.0], np.inf),
            ([0.1, 0.0, -2.0, 0.0, 0.0, 0.0], np.inf),
            ([0.0, 0.0, -2.0, 0.0, 0.0, 0.0], np.inf),
        ):
            contact.applyForce(np.array(force[:size]))
            assert contact.getFrictionUsage() == pytest.approx(usage, rel=1e-15)
        contact.deactivate()
        assert contact.getFrictionUsage() == 0.0
    the_point.applyForce(np.array([0.0, 0.0, 2.0]))
    assert np.isnan(the_point.getCoPMargin())
    assert np.isnan(the_point.getYawUsage())

    assert the_sole.getYawUsage() == 0.0
    for force, usage, margin in (
        ([0.0, 0.0, 2.0, 0.0, 0.0, 0.0], 0.0, DY),
        ([0.0, 0.0, 2.0, 0.04, 0.0, -0.2], 0.25, DY - 0.02),
        ([0.0, 0.0, 2.0, 0.0, 0.18, 0.8], 1.0, DX - 0.09),
        ([0.0, 0.0, 2.0, 0.0, -0.2, 0.0], 0.0, 0.0),
        ([0.0, 0.0, 2.0, 0.0, -0.3, 1.6], 2.0, -0.05),
        ([0.0, 0.0, -2.0, 0.0, 0.0, 0.1], np.inf, np.nan),
    ):
        the_sole.applyForce(np.array(force))
        assert the_sole.getYawUsage() == pytest.approx(usage, rel=1e-15)
        assert the_sole.getCoPMargin() == pytest.approx(margin, abs=1e-16, nan_ok=True)


def test_usage_of_what_is_not_there(the_point, the_sole):
    """No friction: there is none to use. No extent: every edge is where the force is."""
    for contact in (the_point, the_sole):
        contact.setMu(0.0)
        contact.applyForce(np.ones(contact.cols()))
        assert np.isnan(contact.getFrictionUsage())
    the_sole.setGu(0.0)
    the_sole.setSurfaceHalfLength(0.0)
    the_sole.applyForce(np.array([0.0, 0.0, 2.0, 0.0, 0.0, 0.0]))
    assert np.isnan(the_sole.getYawUsage())
    assert the_sole.getCoPMargin() == 0.0
    for waiting in (ContactPoint(), Contact6D()):
        assert np.isnan(waiting.getFrictionUsage())
        assert np.isnan(waiting.getCoPMargin())
        assert np.isnan(waiting.getYawUsage())


@CALM
@given(st.integers(0, 2**32 - 1))
def test_unilaterality_keeps_the_centre_of_pressure_inside(seed):
    """U force <= 0 says the same as pushing with the centre of pressure in the rectangle."""
    rng = np.random.default_rng(seed)
    contact = sole(half_length=rng.uniform(0.01, 0.2), half_width=rng.uniform(0.01, 0.2))
    settings = contact.getSettings()
    half = np.array([settings.half_length, settings.half_width])
    for cop in rng.uniform(-1.5, 1.5, (20, 2)) * half:
        normal = rng.uniform(1.0, 1000.0)
        moment = np.cross(np.append(cop, 0.0), normal * np.array([0.0, 0.0, 1.0]))
        contact.applyForce(np.concatenate([rng.uniform(-9, 9, 2), [normal], moment]))
        assert_allclose(contact.getCoP(), cop, rtol=0, atol=1e-14)
        is_inside = bool((np.abs(cop) <= half).all())
        assert ((contact.uni_A() @ contact.appliedForce() <= 0.0).all()) == is_inside


# Frames, copies, arrays.


def test_frame_index_and_pose(contact):
    assert contact.getFrameID() > 2**62
    contact.setFrameID(frame_id=7)
    assert contact.getFrameID() == 7
    for wrong in (-1, 1.5, "7", None):
        with pytest.raises((TypeError, OverflowError)):
            contact.setFrameID(wrong)
    assert contact.getFrameID() == 7

    assert contact.getPose() == pin.SE3.Identity()
    pose = random_pose(np.random.default_rng(0))
    contact.setPose(pose=pose)
    assert contact.getPose() == pose
    assert isinstance(contact.getPose(), pin.SE3)
    for wrong in (np.eye(4), None, pin.XYZQUATToSE3):
        with pytest.raises(TypeError):
            contact.setPose(wrong)
    assert contact.getPose() == pose


def test_pose_is_a_copy(contact):
    pose = random_pose(np.random.default_rng(0))
    expected = pose.copy()
    contact.setPose(pose)
    pose.translation = np.zeros(3)
    contact.getPose().translation = np.zeros(3)
    contact.getSurfacePose().translation = np.zeros(3)
    assert contact.getPose() == expected
    contact.updateNewtonEuler(np.zeros(3), expected)
    before = state(contact)
    expected.translation = np.ones(3)
    assert state(contact) == before


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda contact: contact.clone()])
def test_copies_share_nothing(contact, copied):
    contact.updateNewtonEuler(np.zeros(3), random_pose(np.random.default_rng(0)))
    contact.applyForce(np.ones(contact.cols()))
    contact.setFrameID(5)
    before = state(contact)
    other = copied(contact)
    assert type(other) is type(contact)
    assert other is not contact
    assert state(other) == before
    other.setMu(0.9)
    other.setForceWeights(np.full(3, 9.0))
    other.applyForce(np.full(other.cols(), 9.0))
    other.setFrameID(9)
    other.updateNewtonEuler(np.ones(3), pin.SE3.Identity())
    assert state(contact) == before
    changed = state(other)
    del contact
    gc.collect()
    assert state(other) == changed


@pytest.mark.parametrize("name", [*MATRICES, "appliedForce", "toWorldForces", "toCoMForces"])
def test_arrays_handed_out_are_copies(contact, name):
    contact.updateNewtonEuler(np.zeros(3), random_pose(np.random.default_rng(0)))
    contact.applyForce(np.ones(contact.cols()))
    before = state(contact)
    values = getattr(contact, name)()
    expected = values.copy()
    values += 1.0
    assert state(contact) == before
    values = getattr(contact, name)()
    assert_array_equal(values, expected)
    del contact
    gc.collect()
    assert_array_equal(values, expected)


def test_arrays_handed_in_are_copies(contact):
    force, com, weights = np.ones(contact.cols()), np.ones(3), np.full(3, 2.0)
    contact.applyForce(force)
    contact.setForceWeights(weights)
    contact.updateNewtonEuler(com, pin.SE3.Identity())
    before = state(contact)
    for array in (force, com, weights):
        array[:] = 99.0
    assert state(contact) == before


def test_arrays_of_any_kind(contact):
    forces = dict(array_kinds(np.arange(contact.cols()) - 2))
    weights = dict(array_kinds([4, 5, 6]))
    coms = dict(array_kinds([-1, 2, -3]))
    states = {}
    for kind in forces:
        contact.applyForce(forces[kind])
        contact.setForceWeights(weights[kind])
        contact.updateNewtonEuler(coms[kind], pin.SE3.Identity())
        states[kind] = state(contact)
    assert contact.appliedForce()[0] == -2.0
    for kind, values in states.items():
        assert values == states["plain"], kind


@pytest.mark.parametrize("shape", [0, 2, 4, 5, 7, (2, 3), (3, 3), (1, 6), (6, 2), (6, 1, 1), ()])
def test_forces_of_the_wrong_shape(contact, shape):
    """One that is a vector of another length is told what was expected and what was got."""
    contact.applyForce(np.full(contact.cols(), 5.0))
    before = state(contact)
    with pytest.raises((ValueError, TypeError)) as error:
        contact.applyForce(np.ones(shape))
    if isinstance(shape, int):
        assert type(error.value) is ValueError
        assert str(error.value) == f"force must have {contact.cols()} components, got {shape}"
    assert state(contact) == before
    contact.applyForce(np.ones(contact.cols()))


WRONG_SIZES = [
    ("force_weights", 2, lambda contact, array: contact.setForceWeights(array)),
    ("force_weights", 6, lambda contact, array: contact.setForceWeights(array)),
    ("torque_weights", 4, lambda contact, array: contact.setTorqueWeights(array)),
    ("com", 2, lambda contact, array: contact.updateNewtonEuler(array, pin.SE3.Identity())),
]


@pytest.mark.parametrize(("name", "size", "call"), WRONG_SIZES)
def test_other_vectors_of_the_wrong_size(the_sole, name, size, call):
    before = state(the_sole)
    with pytest.raises(ValueError, match=f"{name} must have 3 .*, got {size}"):
        call(the_sole, np.ones(size))
    assert state(the_sole) == before


@pytest.mark.parametrize(
    ("settings", "size"), [(point_settings(), 3), (sole_settings(), 6), (DynaCoMSettings(), 3)]
)
def test_settings_of_the_wrong_size(settings, size):
    before = repr(settings)
    field = "gravity" if size == 3 and hasattr(settings, "gravity") else "weights"
    for wrong in (0, 1, size - 1, size + 1):
        with pytest.raises(ValueError, match=f"{field} must have {size} .*, got {wrong}"):
            setattr(settings, field, np.ones(wrong))
    assert repr(settings) == before


@pytest.mark.parametrize(
    "wrong", [None, "abc", [1, 2, "3"], 1.0, np.array(list("abc")), np.ones(3) * 1j, {}]
)
def test_vectors_of_the_wrong_type(the_point, wrong):
    before = state(the_point)
    for call in (
        the_point.applyForce,
        the_point.setForceWeights,
        lambda com: the_point.updateNewtonEuler(com, pin.SE3.Identity()),
        lambda weights: setattr(point_settings(), "weights", weights),
    ):
        with pytest.raises(TypeError):
            call(wrong)
    assert state(the_point) == before


def test_the_package_names_its_errors():
    assert issubclass(NotReadyError, DynacomError)
    assert issubclass(NotReadyError, RuntimeError)
    assert issubclass(DynacomError, Exception)
    assert dynacom.NotReadyError is NotReadyError


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int64, np.uint8])
def test_numbers_of_numpy(kind):
    """What is read from an array is taken as Python's own numbers are."""
    settings = dynacom.ContactPointSettings()
    settings.frame_name = "foot"
    settings.mu = kind(2)
    assert settings.mu == 2.0
    contact = dynacom.ContactPoint(settings)
    contact.setMu(kind(1))
    assert contact.getSettings().mu == 1.0
    contact.setFrameID(np.int64(3))
    assert contact.getFrameID() == 3
    settings.world_aligned = np.ones(1, dtype=bool)[0]
    assert settings.world_aligned is True
    with pytest.raises(TypeError):
        settings.mu = np.ones(1)


def test_numbers_of_numpy_are_for_functions_of_dynacom_alone():
    """A process has one registry of converters; Pinocchio's functions take what they took."""
    for kind in (np.float32, np.int64):
        with pytest.raises(TypeError):
            pin.Inertia.FromSphere(kind(2), kind(1))
    with pytest.raises(TypeError):
        pin.isNormalized(pin.Model(), np.zeros(0), np.float32(1.0))
    with pytest.raises(TypeError):
        pin.JointModelRX().setIndexes(np.int64(1), np.int64(0), np.int64(0))


def test_a_user_s_own_attributes_stay_what_they_are():
    class Own(dynacom.ContactPointSettings):
        scale = 1.0

    settings = Own()
    settings.scale = np.float32(0.5)
    assert type(settings.scale) is np.float32
    settings.mu = np.float32(0.5)
    assert settings.mu == 0.5


NO_NUMBERS = [
    np.timedelta64(3),
    np.timedelta64(3, "s"),
    np.datetime64(3, "s"),
    np.complex64(1),
    np.complex128(1 + 2j),
    np.str_("3"),
    np.bytes_(b"3"),
    np.array(3.0),
]


@pytest.mark.parametrize("wrong", NO_NUMBERS, ids=repr)
def test_what_numpy_has_besides_numbers(wrong):
    """Is refused, although Python's float() takes most of it."""
    settings = point_settings(mu=0.5, world_aligned=True)
    contact = ContactPoint(settings)
    contact.setFrameID(7)
    for field in ("mu", "radius", "world_aligned"):
        with pytest.raises(TypeError):
            setattr(settings, field, wrong)
    for call in (contact.setMu, contact.setFrameID):
        with pytest.raises(TypeError):
            call(wrong)
    assert contact.getSettings() == settings == point_settings(mu=0.5, world_aligned=True)
    assert contact.getFrameID() == 7


def test_booleans_and_fractions_of_numpy_stay_what_they_are():
    settings, contact = point_settings(), point()
    for value in (np.int64(1), np.float64(1.0)):
        with pytest.raises(TypeError):
            settings.world_aligned = value
    for value in (np.bool_(True), np.float64(1.0)):
        with pytest.raises(TypeError):
            contact.setFrameID(value)
    with pytest.raises(TypeError):
        settings.mu = np.bool_(True)
