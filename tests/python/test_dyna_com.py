# SPDX-License-Identifier: BSD-2-Clause
import copy
import gc
import inspect
import re
import threading
import weakref
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import dynacom
from dynacom import (
    Contact6D,
    ContactBase,
    ContactPoint,
    DistributionStatus,
    DynaCoM,
    DynacomError,
    DynaCoMSettings,
    NotReadyError,
)
from dynacom.robots import Robot
from helpers import (
    CALM,
    UP,
    array_kinds,
    assert_gives_wrench,
    assert_within_cones,
    block_diagonal,
    documentation,
    point,
    random_configuration,
    random_humanoid,
    random_pose,
    random_tree,
    reference_configuration,
    robots_folder,
    share_by_edges,
    sole,
)

SOLVED = DistributionStatus.Solved
RELAXED = DistributionStatus.Relaxed
INVALID = DistributionStatus.InvalidInput
G = 9.81

PENDULUM = """
<robot name="pendulum">
  <link name="base"><inertial>
    <mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
  </inertial></link>
  <link name="bob"><inertial>
    <origin xyz="0 0 -1"/>
    <mass value="3"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
  </inertial></link>
  <joint name="hinge" type="continuous">
    <parent link="base"/><child link="bob"/><axis xyz="0 1 0"/>
  </joint>
</robot>
"""


@pytest.fixture(scope="module")
def humanoid() -> pin.Model:
    return random_humanoid(0)


@pytest.fixture
def robot(humanoid: pin.Model) -> DynaCoM:
    """It knows three soles, of which one is not active."""
    robot = DynaCoM(humanoid)
    for name, active in (("a", True), ("b", True), ("c", False)):
        robot.addContact(sole_of(humanoid, name), name, active)
    return robot


FRAMES = {"a": "rleg6_joint", "b": "lleg6_joint", "c": "rarm5_joint", "d": "larm5_joint"}


def sole_of(model: pin.Model, name: str) -> Contact6D:
    """Different for each name, so that no two can be mistaken for each other."""
    frame = FRAMES[name]
    assert model.existFrame(frame)
    size = 0.1 + 0.01 * ord(name)
    return sole(frame_name=frame, mu=5.0, gu=4.0, half_length=size, half_width=0.5 * size)


def motion(model: pin.Model, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return random_configuration(model, seed), *rng.uniform(-1.0, 1.0, (2, model.nv))


def distribute(robot: DynaCoM) -> DistributionStatus:
    return robot.distributeForce(
        robot.getGroundCoMForce(), robot.getGroundCoMTorque(), robot.getCoM()
    )


def state(robot: DynaCoM) -> dict[str, object]:
    """All that a robot hands out, to tell whether anything has changed."""
    values = {name: getattr(robot, name)() for name in GETTERS}
    values["data.com"] = robot.getData().com[0].copy()
    values["data.oMi"] = [placement.homogeneous for placement in robot.getData().oMi]
    result = robot.getDistribution()
    for name in ("wrench", "achieved", "residual", "scale", "cost", "iterations"):
        values[f"distribution.{name}"] = getattr(result, name)
    values["distribution.forces"] = result.forces()
    for name in robot.getKnownContacts():
        contact = robot.getContact(name)
        for item in ("appliedForce", "ne_A", "reg_A", "uni_A", "fri_A", "getFrameID"):
            values[f"{name}.{item}"] = getattr(contact, item)()
        for item in CONTACT_GETTERS:
            values[f"{name}.{item}"] = np.array(getattr(robot, item)(name))
        values[f"{name}.pose"] = contact.getPose().homogeneous
    return values


MOTION_GETTERS = (
    "getGroundCoMForce",
    "getGroundCoMTorque",
    "getCoM",
    "getVCoM",
    "getACoM",
    "getAM",
    "getAMVariation",
    "getCoP",
    "getVRP",
    "getNL",
    "getCoP3D",
    "getVRP3D",
    "getECMP",
    "getFeasibleACoM",
    "getFeasibleAMVariation",
)
CONTACT_GETTERS = (
    "getContactCoP",
    "getContactFrictionUsage",
    "getContactCoPMargin",
    "getContactYawUsage",
)
STACKED = ("uni_A", "uni_b", "fri_A", "fri_b", "reg_A", "reg_b", "ne_A", "ne_b", "allForces")
GETTERS = (
    *MOTION_GETTERS,
    *STACKED,
    "getMass",
    "getGroundHeight",
    "getMinimalVerticalForce",
    "getWrenchWeights",
    "getWarmStart",
    "getMaximalIterations",
    "isCoPDefined",
    "getSettings",
    "getActiveContacts",
    "getKnownContacts",
    "getDistributionStatus",
)


def assert_same(actual: dict[str, object], expected: dict[str, object]) -> None:
    assert actual.keys() == expected.keys()
    for name, value in expected.items():
        if isinstance(value, np.ndarray | list | float) and name not in (
            "getActiveContacts",
            "getKnownContacts",
        ):
            assert_array_equal(actual[name], value, name)
        else:
            assert actual[name] == value, name


# Initialisation.


def pendulum_settings(**fields: object) -> DynaCoMSettings:
    settings = DynaCoMSettings()
    settings.urdf = PENDULUM
    for name, value in fields.items():
        setattr(settings, name, value)
    return settings


def test_from_settings(tmp_path):
    """The XML itself or a file; the root joint is a free-flyer."""
    path = tmp_path / "pendulum.urdf"
    path.write_text(PENDULUM)
    later = DynaCoM()
    later.initialize(settings=pendulum_settings())
    for robot in (
        DynaCoM(pendulum_settings()),
        DynaCoM(settings=pendulum_settings(urdf=str(path))),
        DynaCoM(pendulum_settings(urdf="\n " + PENDULUM)),
        later,
    ):
        model = robot.getModel()
        assert (model.nq, model.nv) == (7 + 2, 6 + 1)
        assert model.joints[1].shortname() == "JointModelFreeFlyer"
        assert robot.getMass() == 5.0
        assert_array_equal(model.gravity.linear, [0, 0, -9.81])
    assert robot.getSettings() == pendulum_settings()


def test_from_a_model(humanoid):
    later = DynaCoM()
    later.initialize(model=humanoid)
    for robot in (DynaCoM(humanoid), DynaCoM(model=humanoid), later):
        assert robot.getModel() == humanoid
        assert isinstance(robot.getModel(), pin.Model)
        assert isinstance(robot.getData(), pin.Data)
        assert_allclose(robot.getMass(), pin.computeTotalMass(humanoid), rtol=1e-15)
        assert robot.getSettings() == DynaCoMSettings()


def test_the_model_is_copied(humanoid):
    model = pin.Model(humanoid)
    robot = DynaCoM(model)
    q, v, a = motion(model, 0)
    robot.computeDynamics(q, v, a)
    expected = robot.getGroundCoMForce()
    model.gravity.linear = np.zeros(3)
    inertia = model.inertias[1]
    inertia.mass = 1000.0
    model.inertias[1] = inertia
    robot.computeDynamics(q, v, a)
    assert_array_equal(robot.getGroundCoMForce(), expected)


@pytest.mark.parametrize("gravity", [0.0, -1.62, -9.81, -274.0, 0, -10])
def test_gravity_of_any_magnitude(humanoid, gravity):
    model = pin.Model(humanoid)
    model.gravity.linear = np.array([0.0, 0.0, gravity])
    q, v = pin.neutral(model), np.zeros(model.nv)
    robot = DynaCoM(model)
    robot.computeDynamics(q, v, v)
    assert_allclose(robot.getGroundCoMForce(), [0, 0, -robot.getMass() * gravity], atol=1e-13)
    assert_array_equal(robot.getSettings().gravity, [0, 0, gravity])

    settings = pendulum_settings(gravity=np.array([0, 0, gravity]))
    robot = DynaCoM(settings)
    robot.computeDynamics(pin.neutral(robot.getModel()), np.zeros(7), np.zeros(7))
    assert_allclose(robot.getGroundCoMForce(), [0, 0, -5.0 * gravity], atol=1e-13)
    assert_array_equal(robot.getModel().gravity.linear, [0, 0, gravity])
    assert robot.getSettings() == settings


@pytest.mark.parametrize(
    "gravity", [[0, 0, 9.81], [1e-9, 0, -9.81], [0, -9.81, 0], [0, 0, np.nan], [0, 0, -np.inf]]
)
def test_gravity_in_other_directions(robot, humanoid, gravity):
    gravity = np.array(gravity, dtype=float)
    settings = pendulum_settings(gravity=gravity)
    model = pin.Model(humanoid)
    model.gravity.linear = gravity
    before = state(robot)
    for refuse in (
        settings.validate,
        lambda: DynaCoM(settings),
        lambda: DynaCoM(model),
        lambda: robot.initialize(settings),
        lambda: robot.initialize(model),
    ):
        with pytest.raises(ValueError, match=r"gravity must be along -z or zero, got .*\d|nan|inf"):
            refuse()
    assert_same(state(robot), before)


NO_URDF = "is not a robot's URDF"


@pytest.mark.parametrize(
    ("urdf", "message"),
    [
        ("", "urdf must be a file or XML, got ''"),
        ("  ", "urdf: cannot read the file '  '"),
        ("no/such/file.urdf", "urdf: cannot read the file 'no/such/file.urdf'"),
        ("hello world", "urdf: cannot read the file 'hello world'"),
        ("<robot", f"urdf: the XML given {NO_URDF}"),
        (PENDULUM[:300], f"urdf: the XML given {NO_URDF}"),
        (PENDULUM[:-10], f"urdf: the XML given {NO_URDF}"),
        ("<html></html>", f"urdf: the XML given {NO_URDF}"),
        ('<?xml version="1.0"?>', f"urdf: the XML given {NO_URDF}"),
        (PENDULUM.replace("bob", "base"), f"urdf: the XML given {NO_URDF}.*'base' is not unique"),
        (PENDULUM.replace('"2"', '"two"'), "urdf: the XML given has errors.*two"),
        (PENDULUM.replace('"2"', '"nan"'), "urdf: the XML given has errors.*nan"),
        ("<robot name='ghost'><link name='a'/></robot>", "'ghost' must have a mass > 0, got 0"),
    ],
)
def test_urdf_that_cannot_be_read(robot, urdf, message):
    """Nothing has changed: the robot known before is still there, with its contacts."""
    robot.computeDynamics(*motion(robot.getModel(), 0))
    before = state(robot)
    settings = pendulum_settings(urdf=urdf)
    with pytest.raises(ValueError, match=message):
        DynaCoM(settings)
    with pytest.raises(ValueError, match=message):
        robot.initialize(settings)
    assert_same(state(robot), before)
    assert distribute(robot) == SOLVED


FILES = {
    "empty": b"",
    "blank": b" \n\n",
    "cut off": PENDULUM[:300].encode(),
    "text": b"hello world",
    "bytes": bytes(range(256)),
    "page": b"<!doctype html><html><body>404</body></html>",
}


@pytest.mark.parametrize("content", FILES.values(), ids=FILES.keys())
def test_files_that_are_no_urdf(robot, tmp_path, content):
    """The message names the file; nothing has changed."""
    before = state(robot)
    path = tmp_path / "my robot.urdf"
    path.write_bytes(content)
    settings = pendulum_settings(urdf=str(path))
    for refuse in (lambda: DynaCoM(settings), lambda: robot.initialize(settings)):
        with pytest.raises(ValueError, match="DynaCoMSettings.urdf.*my robot.urdf'"):
            refuse()
    assert_same(state(robot), before)


def test_urdf_messages_are_plain(robot, tmp_path):
    """A missing file is told as such, not as a bad robot that contains an error message."""
    before = state(robot)
    for urdf in ("no/such/file.urdf", str(tmp_path)):
        with pytest.raises(ValueError) as error:
            robot.initialize(pendulum_settings(urdf=urdf))
        assert str(error.value).count("DynaCoMSettings.urdf") == 1
        assert NO_URDF not in str(error.value)
    assert f"got the directory '{tmp_path}'" in str(error.value)
    assert_same(state(robot), before)


def test_names_with_spaces(tmp_path):
    """Of files, robots, links and joints, and of contacts."""
    text = PENDULUM.replace("pendulum", "a long pendulum").replace("bob", "the bob, left")
    folder = tmp_path / "my robots, é"
    folder.mkdir()
    path = folder / "the pendulum.urdf"
    path.write_text(text, encoding="utf-8")
    for urdf in (text, str(path)):
        robot = DynaCoM(pendulum_settings(urdf=urdf))
        assert robot.getMass() == 5.0
        assert robot.getModel().name == "a long pendulum"
        robot.addContact(point(frame_name="the bob, left", mu=1.0), "my contact")
        robot.computeDynamics(pin.neutral(robot.getModel()), np.zeros(7), np.zeros(7))
        assert distribute(robot) == SOLVED
        assert robot.getActiveContacts() == ["my contact"]


def test_model_without_mass(robot):
    before = state(robot)
    with pytest.raises(ValueError, match="must have a mass > 0, got 0"):
        DynaCoM(pin.Model())
    with pytest.raises(ValueError, match="must have a mass > 0, got 0"):
        robot.initialize(pin.Model())
    assert_same(state(robot), before)


@pytest.mark.parametrize("wrong", [3, "talos.urdf", {}, Contact6D()])
def test_initialize_with_something_else(robot, wrong):
    before = state(robot)
    with pytest.raises(TypeError):
        DynaCoM(wrong)
    with pytest.raises(TypeError):
        robot.initialize(wrong)
    assert_same(state(robot), before)


def test_initialize_again(robot):
    """Contacts and motion are forgotten, as are the forces that the contacts were given."""
    robot.computeNL(3.0, *motion(robot.getModel(), 0))
    assert distribute(robot) == SOLVED
    contact = robot.getContact("a")
    assert contact.appliedForce().any()
    robot.initialize(pendulum_settings())
    assert robot.getKnownContacts() == []
    assert not contact.appliedForce().any()
    assert robot.getMass() == 5.0
    assert robot.getDistributionStatus() == DistributionStatus.NoContact
    for name in (*MOTION_GETTERS, "ne_b"):
        assert np.isnan(getattr(robot, name)()).all(), name
    robot.initialize(random_humanoid(1))
    robot.addContact(contact, "again")
    assert robot.getContact("again") is contact


BEFORE_INITIALIZE = {
    "computeDynamics": lambda robot: robot.computeDynamics(np.zeros(7), np.zeros(6), np.zeros(6)),
    "computeDynamics of data": lambda robot: robot.computeDynamics(pin.Model().createData()),
    "computeNL": lambda robot: robot.computeNL(3.0),
    "computeNL of a motion": lambda robot: robot.computeNL(
        3.0, np.zeros(7), np.zeros(6), np.zeros(6)
    ),
    "addContact": lambda robot: robot.addContact(sole(), "a"),
    "addContact6d": lambda robot: robot.addContact6d(sole(), "a"),
    "distributeForce": lambda robot: robot.distributeForce(*np.ones((3, 3))),
    "distributeForce of NaN": lambda robot: robot.distributeForce(*np.full((3, 3), np.nan)),
}


@pytest.mark.parametrize("call", BEFORE_INITIALIZE.values(), ids=BEFORE_INITIALIZE.keys())
def test_use_before_initialize(call):
    robot = DynaCoM()
    with pytest.raises(NotReadyError, match=r"DynaCoM .* before initialize\(\)") as error:
        call(robot)
    assert isinstance(error.value, RuntimeError)
    assert isinstance(error.value, DynacomError)
    robot.initialize(pendulum_settings())
    robot.computeDynamics(pin.neutral(robot.getModel()), np.zeros(7), np.zeros(7))


def test_what_works_before_initialize():
    """Settings are kept; there is nothing to be found yet, and no name is known."""
    robot = DynaCoM()
    assert not robot.isInitialized()
    robot.setGroundHeight(0.5)
    robot.setMinimalVerticalForce(2.0)
    robot.setWrenchWeights(np.full(6, 3.0))
    robot.setWarmStart(False)
    robot.setMaximalIterations(50)
    for name in (*MOTION_GETTERS, "ne_b"):
        assert np.isnan(getattr(robot, name)()).all(), name
    assert not robot.isCoPDefined()
    assert np.isnan(robot.computeWrenchMargin().margin)
    assert robot.getDistributionStatus() == DistributionStatus.NoContact
    assert robot.getDistribution().contacts == []
    assert robot.getKnownContacts() == robot.getActiveContacts() == []
    for name in ("getContact", "removeContact", "resetContactPose", *CONTACT_GETTERS):
        with pytest.raises(ValueError, match="no contact 'a'; known: none"):
            getattr(robot, name)("a")
    with pytest.raises(ValueError, match="no contact 'a'; known: none"):
        robot.setContactPose("a", pin.SE3.Identity())
    robot.initialize(pendulum_settings())
    assert robot.isInitialized()
    assert robot.getGroundHeight() == 0.5
    assert robot.getMinimalVerticalForce() == 2.0
    assert_array_equal(robot.getWrenchWeights(), np.full(6, 3.0))
    assert not robot.getWarmStart()
    assert robot.getMaximalIterations() == 50


def test_computeNL_needs_a_motion(robot):
    with pytest.raises(NotReadyError, match=r"computeNL needs computeDynamics\(\)"):
        robot.computeNL(3.0)
    robot.computeDynamics(*motion(robot.getModel(), 0))
    robot.computeNL(3.0)
    robot.initialize(pendulum_settings())
    with pytest.raises(NotReadyError, match=r"computeNL needs computeDynamics\(\)"):
        robot.computeNL(3.0)


def test_before_computeDynamics(robot):
    """NaN, which no one takes for a result, and no force anywhere."""
    for name in (*MOTION_GETTERS, "ne_b"):
        values = getattr(robot, name)()
        assert np.isnan(values).all(), name
        assert values.shape == ((2,) if name in ("getCoP", "getVRP", "getNL") else values.shape)
    assert robot.getDistributionStatus() == DistributionStatus.NoContact
    assert not robot.getDistribution().isOptimal()
    assert np.isnan(robot.computeWrenchMargin().margin)
    assert not robot.isCoPDefined()
    assert_array_equal(robot.allForces(), np.zeros(12))
    for name in "abc":
        assert np.isnan(robot.getContactCoP(name)).all()
        assert np.isnan(robot.getContactCoPMargin(name))
        assert robot.getContactFrictionUsage(name) == robot.getContactYawUsage(name) == 0.0


# Dynamics; test_centroidal.py has more of them.


def test_keywords_and_defaults(robot):
    robot.setWarmStart(False)  # so that the same problem again takes the same steps
    q, v, a = motion(robot.getModel(), 0)
    robot.computeDynamics(q, v, a)
    expected = state(robot)
    zero = np.zeros(6)
    robot.computeDynamics(q=q, v=v, a=a, extWrench=zero, flatHorizontalGround=True)
    assert_same(state(robot), expected)
    robot.computeDynamics(a=a, v=v, q=q)
    assert_same(state(robot), expected)
    robot.computeDynamics(q, v, a, zero, True)
    assert_same(state(robot), expected)

    assert robot.computeNL(omega=3.0) is None
    expected = state(robot)
    assert robot.computeNL(omega=3.0, q=q, v=v, a=a) is None
    assert_same(state(robot), expected)
    robot.computeNL(omega=3.0, q=q, v=v, a=a, extWrench=zero, flatHorizontalGround=True)
    assert_same(state(robot), expected)
    robot.computeNL(3.0, q, v, a, zero, True)
    assert_same(state(robot), expected)

    status = robot.distributeForce(
        groundCoMForce=robot.getGroundCoMForce(),
        groundCoMTorque=robot.getGroundCoMTorque(),
        com=robot.getCoM(),
    )
    assert status == SOLVED
    expected = state(robot)
    assert distribute(robot) == SOLVED
    assert_same(state(robot), expected)

    other = sole_of(robot.getModel(), "d")
    robot.addContact(contact=other, name="d", active=False)
    assert "d" not in robot.getActiveContacts()
    robot.activateContact(name="d")
    robot.deactivateContact(name="d")
    assert robot.getContact(name="d") is other
    robot.removeContact(name="d")
    robot.addContact6d(contact=other, name="d", active=False)
    robot.activateContact6d(name="d")
    robot.deactivateContact6d(name="d")
    robot.removeContact6d(name="d")
    robot.addContact(other, "d")
    assert robot.getActiveContacts()[-1] == "d"
    robot.removeContact("d")
    robot.addContact6d(other, "d")
    assert robot.getActiveContacts()[-1] == "d"
    robot.setGroundHeight(groundHeight=0.5)
    assert robot.getGroundHeight() == 0.5
    robot.setMinimalVerticalForce(minimalVerticalForce=2.0)
    assert robot.getMinimalVerticalForce() == 2.0
    robot.setWrenchWeights(weights=np.arange(1, 7))
    assert_array_equal(robot.getWrenchWeights(), np.arange(1, 7))
    robot.setWarmStart(warmStart=True)
    assert robot.getWarmStart() is True
    robot.setMaximalIterations(maximalIterations=20)
    assert robot.getMaximalIterations() == 20
    robot.setContactPose(name="a", oMs=pin.SE3.Identity())
    robot.resetContactPose(name="a")
    for name in CONTACT_GETTERS:
        getattr(robot, name)(name="a")


def test_virtual_repellent_point_by_hand():
    """A pendulum whose base accelerates: v = c - dd(c)/omega², n = p - v."""
    robot = DynaCoM(pendulum_settings())
    q = pin.neutral(robot.getModel())
    q[:3] = [1.0, 2.0, 3.0]
    a = np.array([0.5, -1.5, 0.25, 0, 0, 0, 0])
    robot.computeNL(2.0, q, np.zeros(7), a)
    com = np.array([1.0, 2.0, 3.0 - 0.6])
    force = 5.0 * np.array([0.5, -1.5, 0.25 + G])
    cop = com[:2] - force[:2] * com[2] / force[2]
    assert_allclose(robot.getCoM(), com, rtol=1e-15)
    assert_allclose(robot.getGroundCoMForce(), force, rtol=1e-15)
    assert_allclose(robot.getCoP(), cop, rtol=1e-14)
    assert_allclose(robot.getVRP(), [1.0 - 0.5 / 4, 2.0 + 1.5 / 4], rtol=1e-14)
    assert_allclose(robot.getNL(), cop - [1.0 - 0.5 / 4, 2.0 + 1.5 / 4], rtol=1e-12)
    robot.computeNL(4)
    assert_allclose(robot.getVRP(), [1.0 - 0.5 / 16, 2.0 + 1.5 / 16], rtol=1e-14)


def test_non_linearity_vanishes_for_the_linear_pendulum():
    """Constant height and no change of angular momentum: the CoP repels the CoM by g / height."""
    robot = DynaCoM(pendulum_settings())
    q = pin.neutral(robot.getModel())
    q[2] = 1.5
    a = np.array([0.5, -1.5, 0, 0, 0, 0, 0])
    robot.computeNL(np.sqrt(G / 0.9), q, np.zeros(7), a)
    assert_allclose(robot.getNL(), np.zeros(2), rtol=0, atol=1e-15)


@pytest.mark.parametrize("omega", [0, -1.0, np.nan])
def test_omega_out_of_range(robot, omega):
    robot.computeNL(3.0, *motion(robot.getModel(), 0))
    before = state(robot)
    with pytest.raises(ValueError, match=f"omega must be > 0 rad/s, got {omega:g}"):
        robot.computeNL(omega)
    assert_same(state(robot), before)


def test_computeNL_of_a_motion_changes_nothing_when_it_throws(robot):
    robot.computeNL(3.0, *motion(robot.getModel(), 0))
    before = state(robot)
    with pytest.raises(ValueError, match="omega must be > 0 rad/s, got 0"):
        robot.computeNL(0, *motion(robot.getModel(), 1))
    assert_same(state(robot), before)


@pytest.mark.parametrize("height", [np.nan, np.inf, -np.inf])
def test_ground_height_out_of_range(robot, height):
    robot.setGroundHeight(-0.5)
    with pytest.raises(ValueError, match=f"groundHeight must be finite, got {height:g}"):
        robot.setGroundHeight(height)
    assert robot.getGroundHeight() == -0.5


@pytest.mark.parametrize("force", [0.0, -1.0, np.nan, np.inf])
def test_minimal_vertical_force_out_of_range(robot, force):
    robot.setMinimalVerticalForce(3.0)
    message = f"minimalVerticalForce must be finite and > 0 N, got {force:g}"
    with pytest.raises(ValueError, match=message):
        robot.setMinimalVerticalForce(force)
    assert robot.getMinimalVerticalForce() == 3.0


@pytest.mark.parametrize("weight", [0.0, -1.0, np.nan, np.inf])
def test_wrench_weights_out_of_range(robot, weight):
    robot.setWrenchWeights(np.arange(1, 7))
    for component in range(6):
        weights = np.ones(6)
        weights[component] = weight
        with pytest.raises(ValueError, match="wrench weights must be finite and > 0, got"):
            robot.setWrenchWeights(weights)
    for size in (0, 5, 7):
        with pytest.raises(ValueError, match=f"weights must have 6 components, got {size}"):
            robot.setWrenchWeights(np.ones(size))
    assert_array_equal(robot.getWrenchWeights(), np.arange(1, 7))


@pytest.mark.parametrize("flat", [True, False])
def test_no_centre_of_pressure_below_the_minimal_vertical_force(talos, talos_standing, flat):
    """NaN, never an infinity or a former value; the threshold itself is enough."""
    robot = talos.dynacom()
    zero = np.zeros(talos.model.nv)

    def fall(force):
        a = zero.copy()
        a[2] = force / robot.getMass() - G
        robot.computeNL(3.0, talos_standing, zero, a, flatHorizontalGround=flat)

    assert robot.getMinimalVerticalForce() == 1.0
    for force, minimum in ((0.99, 1.0), (0.0, 1.0), (-500.0, 1.0), (49.0, 50.0), (1e-6, 2e-6)):
        robot.setMinimalVerticalForce(minimum)
        fall(800.0)
        assert robot.isCoPDefined()
        assert np.isfinite(robot.getNL()).all()
        fall(force)
        assert not robot.isCoPDefined()
        assert np.isnan(robot.getCoP()).all()
        assert np.isnan(robot.getNL()).all()
        assert np.isfinite(robot.getVRP()).all()
        for name in robot.getActiveContacts():
            assert np.isnan(robot.getContactCoP(name)).all() or flat
    robot.setMinimalVerticalForce(50.0)
    fall(50.001)
    assert robot.isCoPDefined()


def test_external_wrench_is_about_the_centre_of_mass(talos, talos_standing):
    """A load on a shoulder: the feet bear its weight, and its moment moves the CoP."""
    robot = talos.dynacom()
    zero = np.zeros(talos.model.nv)
    load = np.array([0, 0, -100, 0, 5, 0])
    robot.computeDynamics(talos_standing, zero, zero, load)
    weight = G * robot.getMass()
    assert_allclose(robot.getGroundCoMForce(), [0, 0, weight + 100], rtol=0, atol=1e-10)
    assert_allclose(robot.getGroundCoMTorque(), [0, -5, 0], rtol=0, atol=1e-12)
    expected = robot.getCoM()[:2] + [5 / (weight + 100), 0]
    assert_allclose(robot.getCoP(), expected, rtol=0, atol=1e-15)


# Arrays.


def test_arrays_of_any_kind(robot):
    model = robot.getModel()
    rng = np.random.default_rng(0)
    q = pin.neutral(model)
    q[7:] = rng.integers(-2, 3, model.nq - 7)
    v, a = rng.integers(-3, 4, (2, model.nv))
    wrench, com = np.arange(6) - 3, np.array([1, -1, 2])
    robot.setWarmStart(False)  # so that the same problem again takes the same steps
    states = {}
    robot.computeNL(3, q, v, a, wrench)
    for kinds in zip(*map(array_kinds, (q, v, a, wrench, com, wrench[:3])), strict=True):
        (kind, *_), (q_, v_, a_, wrench_, com_, force_) = zip(*kinds, strict=True)
        robot.computeDynamics(q_, v_, a_, wrench_, False)
        first = state(robot)
        robot.computeNL(3, q_, v_, a_, wrench_)
        second = state(robot)
        robot.distributeForce(force_, com_, com_)
        states[kind] = first, second, state(robot)
    for values in states.values():
        for actual, expected in zip(values, states["plain"], strict=True):
            assert_same(actual, expected)


@pytest.mark.parametrize("name", GETTERS[: len(MOTION_GETTERS) + len(STACKED)])
def test_arrays_handed_out_are_copies(robot, name):
    robot.computeNL(3.0, *motion(robot.getModel(), 0))
    assert distribute(robot) == SOLVED
    before = state(robot)
    values = getattr(robot, name)()
    expected = values.copy()
    values += 1.0
    assert_same(state(robot), before)
    values = getattr(robot, name)()
    robot.computeNL(4.0, *motion(robot.getModel(), 1))
    distribute(robot)
    assert_array_equal(values, expected)
    del robot
    gc.collect()
    assert_array_equal(values, expected)


def test_arrays_handed_in_are_copies(robot):
    q, v, a = motion(robot.getModel(), 0)
    wrench = np.ones(6)
    robot.computeNL(3.0, q, v, a, wrench)
    force, torque, com = robot.getGroundCoMForce(), robot.getGroundCoMTorque(), robot.getCoM()
    robot.distributeForce(force, torque, com)
    before = state(robot)
    for array in (q, v, a, wrench, force, torque, com):
        array[:] = 99.0
    assert_same(state(robot), before)


def test_settings_handed_out_are_copies():
    settings = pendulum_settings()
    robot = DynaCoM(settings)
    settings.urdf = "changed"
    robot.getSettings().urdf = "changed"
    robot.getSettings().gravity[2] = 0.0
    assert robot.getSettings() == pendulum_settings()


@pytest.mark.parametrize("name", ["q", "v", "a"])
@pytest.mark.parametrize("change", [-1, 1, None])
def test_vectors_of_the_wrong_size(robot, name, change):
    model = robot.getModel()
    robot.computeNL(3.0, *motion(model, 0))
    before = state(robot)
    arguments = dict(zip("qva", motion(model, 1), strict=True))
    expected = arguments[name].size
    size = 0 if change is None else expected + change
    arguments[name] = np.zeros(size)
    unit = "nq" if name == "q" else "nv"
    message = rf"^{name} must have {expected} components \({unit}\), got {size}$"
    with pytest.raises(ValueError, match=message):
        robot.computeDynamics(**arguments)
    with pytest.raises(ValueError, match=message):
        robot.computeNL(3.0, **arguments)
    assert_same(state(robot), before)


def test_wrenches_of_the_wrong_size(robot):
    """The docstring promises a ValueError for extWrench too."""
    q, v, a = motion(robot.getModel(), 0)
    robot.computeNL(3.0, q, v, a)
    before = state(robot)
    for size in (0, 3, 5, 7):
        with pytest.raises(ValueError, match=f"extWrench must have 6 .*, got {size}"):
            robot.computeDynamics(q, v, a, np.zeros(size))
        with pytest.raises(ValueError, match=f"extWrench must have 6 .*, got {size}"):
            robot.computeNL(3.0, q, v, a, extWrench=np.zeros(size))
    assert_same(state(robot), before)


@pytest.mark.parametrize("name", ["groundCoMForce", "groundCoMTorque", "com"])
def test_distribution_of_vectors_of_the_wrong_size(robot, name):
    robot.computeDynamics(*motion(robot.getModel(), 0))
    before = state(robot)
    arguments = dict.fromkeys(("groundCoMForce", "groundCoMTorque", "com"), np.zeros(3))
    for size in (0, 2, 4, 6):
        arguments[name] = np.zeros(size)
        with pytest.raises(ValueError, match=f"{name} must have 3 .*, got {size}"):
            robot.distributeForce(**arguments)
    assert_same(state(robot), before)


@pytest.mark.parametrize(
    "wrong", [None, "q", 3.0, [0.0, "1.0"], np.zeros((2, 2)), np.array(["a"]), np.ones(3) * 1j, {}]
)
def test_vectors_of_the_wrong_type(robot, wrong):
    """An error, after which the robot is as it was and works."""
    q, v, a = motion(robot.getModel(), 0)
    robot.computeNL(3.0, q, v, a)
    before = state(robot)
    for call in (
        lambda: robot.computeDynamics(wrong, v, a),
        lambda: robot.computeDynamics(q, wrong, a),
        lambda: robot.computeDynamics(q, v, wrong),
        lambda: robot.computeDynamics(q, v, a, wrong),
        lambda: robot.computeNL(3.0, wrong, v, a),
        lambda: robot.distributeForce(wrong, np.zeros(3), np.zeros(3)),
        lambda: robot.distributeForce(np.zeros(3), np.zeros(3), wrong),
    ):
        with pytest.raises(TypeError):
            call()
    assert_same(state(robot), before)
    assert distribute(robot) == SOLVED


@pytest.mark.parametrize("wrong", [None, "3", [3.0], np.ones(2), 1j, {}])
def test_numbers_of_the_wrong_type(robot, wrong):
    robot.computeNL(3.0, *motion(robot.getModel(), 0))
    before = state(robot)
    with pytest.raises(TypeError):
        robot.setGroundHeight(wrong)
    with pytest.raises(TypeError):
        robot.computeNL(wrong)
    assert_same(state(robot), before)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("argument", range(4), ids=["q", "v", "a", "extWrench"])
@pytest.mark.parametrize("flat", [True, False])
def test_motion_that_is_not_finite(robot, argument, value, flat):
    """A fact of the world, not an exception; the next sample is analysed as if nothing had been."""
    robot.setWarmStart(False)
    arguments = [*motion(robot.getModel(), 0), np.zeros(6)]

    def compute(arguments):
        robot.computeNL(3.0, *arguments, flatHorizontalGround=flat)

    compute(arguments)
    distribute(robot)
    before = state(robot)
    for component in range(arguments[argument].size):
        broken = [array.copy() for array in arguments]
        broken[argument][component] = value
        status = robot.getDistributionStatus()
        compute(broken)
        for name in MOTION_GETTERS:
            assert np.isnan(getattr(robot, name)()).all(), name
        assert not robot.isCoPDefined()
        # Only on uneven ground there was a distribution; be that as it may, forces are kept.
        assert robot.getDistributionStatus() == (status if flat else INVALID)
        assert_array_equal(robot.allForces(), before["allForces"])
        assert distribute(robot) == robot.getDistributionStatus() == INVALID
        assert_array_equal(robot.allForces(), before["allForces"])
        assert not robot.getDistribution().isOptimal()
        assert np.isnan(robot.computeWrenchMargin().margin)
        assert np.isnan(robot.getFeasibleACoM()).all()
    compute(arguments)
    distribute(robot)
    assert_same(state(robot), before)


def test_motion_beyond_the_largest_numbers(robot):
    """Finite numbers may become others."""
    q, v, a = motion(robot.getModel(), 0)
    robot.computeDynamics(q, 1e200 * v, a)
    for name in MOTION_GETTERS:
        assert np.isnan(getattr(robot, name)()).all(), name
    assert distribute(robot) == INVALID
    robot.computeDynamics(q, v, a)
    assert np.isfinite(robot.getGroundCoMTorque()).all()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("argument", range(3), ids=["groundCoMForce", "groundCoMTorque", "com"])
def test_distribution_of_what_is_not_finite(robot, argument, value):
    robot.setWarmStart(False)
    robot.computeDynamics(*motion(robot.getModel(), 0))
    arguments = [robot.getGroundCoMForce(), robot.getGroundCoMTorque(), robot.getCoM()]
    assert robot.distributeForce(*arguments) == SOLVED
    before = state(robot)
    for component in range(3):
        broken = [array.copy() for array in arguments]
        broken[argument][component] = value
        assert robot.distributeForce(*broken) == robot.getDistributionStatus() == INVALID
        assert_array_equal(robot.allForces(), before["allForces"])
        for name in "ab":
            force = robot.getContact(name).appliedForce()
            assert_array_equal(force, before[f"{name}.appliedForce"])
    assert robot.distributeForce(*arguments) == SOLVED
    assert_same(state(robot), before)


CHANGES = {
    "nothing": lambda robot: None,
    "another motion": lambda robot: robot.computeDynamics(*motion(robot.getModel(), 1)),
    "an idle contact": lambda robot: robot.addContact(sole_of(robot.getModel(), "d"), "d", False),
    "mu": lambda robot: robot.getContact("a").setMu(3.0),
    "weights": lambda robot: robot.getContact("b").setForceWeights(np.full(3, 2.0)),
    "frame": lambda robot: move(robot.getContact("a"), FRAMES["d"]),
    "deactivated": lambda robot: robot.deactivateContact("a"),
    "activated": lambda robot: robot.activateContact("c"),
    "removed": lambda robot: robot.removeContact("b"),
    "added": lambda robot: robot.addContact(sole_of(robot.getModel(), "d"), "d"),
    "again": lambda robot: (robot.deactivateContact("a"), robot.activateContact("a")),
    "norm": lambda robot: robot.setWrenchWeights(np.full(6, 2.0)),
}


def move(contact: Contact6D, frame: str) -> None:
    settings = contact.getSettings()
    settings.frame_name = frame
    contact.initialize(settings)


@pytest.mark.parametrize("change", CHANGES)
def test_forces_without_an_answer(robot, change):
    """Those of the last one, as long as contacts and their settings are the same."""
    robot.computeDynamics(*motion(robot.getModel(), 0))
    assert distribute(robot) == SOLVED
    kept = robot.allForces()
    CHANGES[change](robot)
    com = robot.getCoM()
    for _ in range(2):
        assert robot.distributeForce(np.full(3, np.nan), np.zeros(3), com) == INVALID
        forces = robot.allForces()
        if change in ("nothing", "another motion", "an idle contact"):
            assert_array_equal(forces, kept)
        else:
            assert_array_equal(forces, np.zeros(6 * len(robot.getActiveContacts())))
        assert_array_equal(robot.getDistribution().forces(), forces)
    assert distribute(robot) in (SOLVED, RELAXED)
    assert robot.getDistribution().isOptimal()


# A motion of which Pinocchio has computed all.


def computed(model: pin.Model, *motion: np.ndarray) -> pin.Data:
    """As a controller has it that computes momenta anyway."""
    data = model.createData()
    pin.computeCentroidalMomentumTimeVariation(model, data, *motion)
    return data


def results(robot: DynaCoM) -> dict[str, object]:
    """All that is promised to be the same, whoever has computed the motion."""
    values = state(robot)
    del values["data.com"]
    return values


def assert_same_by_data(
    robot: DynaCoM, motions: list[tuple[np.ndarray, ...]], wrenches: np.ndarray, flat: bool
) -> None:
    """Of both ways, on two robots, over several ticks: after each of these, all is the same."""
    model, other = robot.getModel(), robot.copy()
    for (q, v, a), wrench in zip(motions, wrenches, strict=True):
        robot.computeDynamics(q, v, a, wrench, flat)
        other.computeDynamics(computed(model, q, v, a), wrench, flat)
        assert_same(results(other), results(robot))
        for dynamics in (robot, other):
            dynamics.computeNL(3.0)
            distribute(dynamics)
        assert_same(results(other), results(robot))


@CALM
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_dynamics_of_data(seed, flat):
    """Random robots, with joints of many types, on soles and points."""
    rng = np.random.default_rng(seed)
    model = random_tree(seed)
    robot = DynaCoM(model)
    for number in range(1, rng.integers(2, 5)):
        frame = f"frame{number}"
        contact = sole(frame_name=frame) if rng.integers(2) else point(frame_name=frame, radius=0.1)
        robot.addContact(contact, frame, bool(rng.integers(4)))
    motions = [motion(model, int(number)) for number in rng.integers(2**31, size=3)]
    assert_same_by_data(robot, motions, rng.uniform(-50.0, 50.0, (3, 6)), flat)


@pytest.mark.parametrize("flat", [True, False])
def test_dynamics_of_data_of_talos(talos, talos_standing, flat):
    """Standing, so that there is something to distribute; the ground is not at zero."""
    rng = np.random.default_rng(0)
    robot = talos.dynacom()
    robot.setGroundHeight(0.01)
    motions = [(talos_standing, *0.1 * rng.standard_normal((2, talos.model.nv))) for _ in range(5)]
    assert_same_by_data(robot, motions, rng.uniform(-5.0, 5.0, (5, 6)), flat)
    assert robot.getDistributionStatus() == SOLVED


def test_dynamics_of_one_s_own_data(robot):
    """Pinocchio's algorithm may have run on getData() itself."""
    model, data = robot.getModel(), robot.getData()
    q, v, a = motion(model, 0)
    other = robot.copy()
    other.computeDynamics(q, v, a)
    pin.computeCentroidalMomentumTimeVariation(model, data, q, v, a)
    robot.computeDynamics(data)
    assert_same(state(robot), state(other))


@pytest.mark.parametrize("flat", [True, False])
def test_nothing_is_kept_of_data(robot, flat):
    """It may be overwritten, and go; the robot's own data knows where the joints are."""
    model = robot.getModel()
    other = robot.copy()
    other.computeDynamics(*motion(model, 0), flatHorizontalGround=flat)
    data = computed(model, *motion(model, 0))
    robot.computeDynamics(data, flatHorizontalGround=flat)
    pin.computeCentroidalMomentumTimeVariation(model, data, *motion(model, 1))
    assert_same(results(robot), results(other))
    del data
    gc.collect()
    for dynamics in (robot, other):
        dynamics.activateContact("c")
        dynamics.addContact(sole_of(model, "d"), "d")
        dynamics.computeNL(3.0)
        assert distribute(dynamics) == SOLVED
    assert_same(results(robot), results(other))


def test_data_is_left_as_it_is(robot):
    model = robot.getModel()
    data = computed(model, *motion(model, 0))
    before = [placement.homogeneous for placement in data.oMi]
    momentum = data.hg.vector.copy(), data.dhg.vector.copy()
    robot.computeDynamics(data, np.ones(6), False)
    assert_array_equal([placement.homogeneous for placement in data.oMi], before)
    assert_array_equal((data.hg.vector, data.dhg.vector), momentum)


def test_data_and_vectors_are_told_apart(robot):
    """By position, by keyword, with lists: each call ends where it belongs."""
    robot.setWarmStart(False)  # so that the same problem again takes the same steps
    q, v, a = motion(robot.getModel(), 0)
    data = computed(robot.getModel(), q, v, a)
    wrench = np.arange(6.0)
    for flat in (True, False):
        robot.computeDynamics(q, v, a, wrench, flat)
        expected = results(robot)
        for arguments, keywords in (
            ((q, v, a, list(wrench), flat), {}),
            ((q, v), {"a": a, "extWrench": tuple(wrench), "flatHorizontalGround": flat}),
            ((data, wrench, flat), {}),
            ((data, list(wrench), np.bool_(flat)), {}),
            ((data, tuple(wrench)), {"flatHorizontalGround": flat}),
            ((data,), {"extWrench": wrench, "flatHorizontalGround": flat}),
            ((), {"flatHorizontalGround": flat, "extWrench": list(wrench), "data": data}),
        ):
            robot.computeDynamics(*motion(robot.getModel(), 1))
            assert robot.computeDynamics(*arguments, **keywords) is None
            assert_same(results(robot), expected)
    robot.computeDynamics(q, v, a)
    expected = results(robot)
    for arguments, keywords in (((data,), {}), ((), {"data": data})):
        robot.computeDynamics(*motion(robot.getModel(), 1))
        robot.computeDynamics(*arguments, **keywords)
        assert_same(results(robot), expected)


def test_data_of_the_wrong_type(robot):
    q, v, a = motion(robot.getModel(), 0)
    data = computed(robot.getModel(), q, v, a)
    robot.computeDynamics(data)
    before = state(robot)
    for arguments in (
        (),
        (None,),
        (robot.getModel(),),
        (robot,),
        (q,),
        (q, v),
        (data, data),
        (data, None),
        (data, 3.0),
        (data, True),
        (data, "123456"),
        (data, [1, 2, 3, 4, 5, "6"]),
        (data, v, a),
        (data, np.zeros(6), "flat"),
        (data, np.zeros(6), True, True),
        (q, v, data),
    ):
        with pytest.raises(TypeError):
            robot.computeDynamics(*arguments)
    for size in (0, 5, 7):
        with pytest.raises(ValueError, match=f"^extWrench must have 6 components, got {size}$"):
            robot.computeDynamics(data, np.zeros(size))
    assert_same(state(robot), before)


def test_data_of_another_robot(robot):
    """By the number of its joints, or by its mass; nothing has changed."""
    model = robot.getModel()
    robot.computeNL(3.0, *motion(model, 0))
    assert distribute(robot) == SOLVED
    before = state(robot)
    other = DynaCoM(pendulum_settings()).getModel()
    message = rf"^data.oMi must have {model.njoints} placements \(one per joint\), got 3$"
    with pytest.raises(ValueError, match=message):
        robot.computeDynamics(computed(other, *motion(other, 0)))

    heavier = pin.Model(model)
    load = pin.Inertia(0.001, np.zeros(3), np.zeros((3, 3)))
    heavier.appendBodyToJoint(1, load, pin.SE3.Identity())
    data = computed(heavier, *motion(model, 0))
    mass = rf"data's mass must be {robot.getMass():g} kg, got {data.mass[0]:g}"
    with pytest.raises(NotReadyError, match=mass):
        robot.computeDynamics(data)
    assert_same(state(robot), before)


def test_data_without_momenta(robot):
    """Data on which nothing has run, or only kinematics; nothing has changed."""
    model = robot.getModel()
    robot.computeNL(3.0, *motion(model, 0))
    assert distribute(robot) == SOLVED
    before = state(robot)
    placed = model.createData()
    pin.forwardKinematics(model, placed, *motion(model, 0))
    message = r"needs computeCentroidalMomentumTimeVariation\(model, data, q, v, a\) before"
    for data in (model.createData(), placed):
        for flat in (True, False):
            with pytest.raises(NotReadyError, match=message):
                robot.computeDynamics(data, np.zeros(6), flat)
            assert_same(state(robot), before)


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("argument", range(4), ids=["q", "v", "a", "extWrench"])
@pytest.mark.parametrize("flat", [True, False])
def test_data_that_is_not_finite(robot, argument, value, flat):
    """As if the motion had been given: no exception, no number, the forces of before."""
    robot.setWarmStart(False)
    model = robot.getModel()
    arguments = [*motion(model, 0), np.zeros(6)]

    def compute(arguments):
        robot.computeDynamics(computed(model, *arguments[:3]), arguments[3], flat)
        robot.computeNL(3.0)

    compute(arguments)
    distribute(robot)
    before = state(robot)
    for component in (0, -1):
        broken = [array.copy() for array in arguments]
        broken[argument][component] = value
        status = robot.getDistributionStatus()
        compute(broken)
        for name in MOTION_GETTERS:
            assert np.isnan(getattr(robot, name)()).all(), name
        assert robot.getDistributionStatus() == (status if flat else INVALID)
        assert_array_equal(robot.allForces(), before["allForces"])
        assert distribute(robot) == INVALID
        assert_array_equal(robot.allForces(), before["allForces"])
    compute(arguments)
    distribute(robot)
    assert_same(state(robot), before)


# Contacts where they were measured.


def somewhere(seed: int) -> pin.SE3:
    """Within a metre of the world's origin, and not too steep to stand on."""
    return random_pose(np.random.default_rng(seed), tilt=0.6)


def moved(pose: pin.SE3, rng: np.random.Generator) -> pin.SE3:
    """Elsewhere by some centimetres, and turned by some degrees."""
    return pose * pin.SE3(pin.exp3(rng.uniform(-0.2, 0.2, 3)), rng.uniform(-0.05, 0.05, 3))


def wrench_from(
    forces: dict[str, np.ndarray], poses: dict[str, pin.SE3], com: np.ndarray
) -> np.ndarray:
    """What forces at these places give about the centre of mass, term by term."""
    force, moment = np.zeros(3), np.zeros(3)
    for name, pose in poses.items():
        pushed, turned = np.split(np.append(forces[name], np.zeros(3))[:6], 2)
        pushed, turned = pose.rotation @ pushed, pose.rotation @ turned
        force += pushed
        moment += turned + np.cross(pose.translation - com, pushed)
    return np.concatenate([force, moment])


def forces_of(robot: DynaCoM) -> dict[str, np.ndarray]:
    return {name: robot.getContact(name).appliedForce() for name in robot.getActiveContacts()}


@pytest.mark.parametrize("way", ["distributeForce", "computeDynamics", "computeDynamics of data"])
def test_forces_about_displaced_feet(talos, talos_standing, way):
    """They give the wrench asked for about the places measured, and about no others."""
    rng = np.random.default_rng(0)
    model = talos.model
    for _ in range(10):
        robot = talos.dynacom()
        v, a = 0.1 * rng.standard_normal((2, model.nv))
        robot.computeDynamics(talos_standing, v, a)
        poses = {name: robot.getContact(name).getPose() for name in robot.getActiveContacts()}
        measured = {name: moved(pose, rng) for name, pose in poses.items()}
        for name, pose in measured.items():
            robot.setContactPose(name, pose)
            assert robot.getContact(name).getPose() == pose
        if way == "distributeForce":
            distribute(robot)
        elif way == "computeDynamics":
            robot.computeDynamics(talos_standing, v, a, flatHorizontalGround=False)
        else:
            data = computed(model, talos_standing, v, a)
            robot.computeDynamics(data, flatHorizontalGround=False)
        assert robot.getDistributionStatus() == SOLVED
        forces, wrench = forces_of(robot), robot.ne_b()
        tolerance = 1e-9 * np.linalg.norm(wrench)
        given = wrench_from(forces, measured, robot.getCoM())
        assert_allclose(given, wrench, rtol=0, atol=tolerance)
        elsewhere = wrench_from(forces, poses, robot.getCoM())
        assert np.abs(elsewhere - wrench).max() > 1e6 * tolerance
        for name, pose in measured.items():
            assert robot.getContact(name).getPose() == pose
            assert_within_cones(robot.getContact(name), tolerance)


@pytest.mark.parametrize("moving", [True, False])
def test_measured_poses_and_another_centre_of_mass(robot, moving):
    """That of the call counts, not that of a motion, which there need not be."""
    if moving:
        robot.computeDynamics(*motion(robot.getModel(), 0))
    poses = {name: somewhere(seed) for seed, name in enumerate("ab")}
    for name, pose in poses.items():
        robot.setContactPose(name, pose)
    com = np.array([0.3, -0.2, 0.9])
    robot.distributeForce(G * robot.getMass() * UP, np.zeros(3), com)
    result, forces = robot.getDistribution(), forces_of(robot)
    given = wrench_from(forces, poses, com)
    assert np.linalg.norm(given) > 1.0
    assert_allclose(given, result.achieved, rtol=0, atol=1e-9 * result.scale)


def test_centre_of_pressure_of_displaced_feet(talos, talos_standing):
    """(6) by hand: each sole's own centre, where the sole was measured, by its vertical force."""
    rng = np.random.default_rng(1)
    robot = talos.dynacom()
    zero = np.zeros(talos.model.nv)
    robot.computeDynamics(talos_standing, zero, zero)
    measured = {
        name: moved(robot.getContact(name).getPose(), rng) for name in robot.getActiveContacts()
    }
    for name, pose in measured.items():
        robot.setContactPose(name, pose)
    robot.computeDynamics(talos_standing, zero, zero, flatHorizontalGround=False)
    moment, vertical = np.zeros(2), 0.0
    for name, pose in measured.items():
        force = robot.getContact(name).appliedForce()
        place = pose.act(np.array([-force[4], force[3], 0.0]) / force[2])
        lifted = pose.rotation[2] @ force[:3]
        moment += lifted * place[:2]
        vertical += lifted
    assert_allclose(robot.getCoP(), moment / vertical, rtol=0, atol=1e-12)


def test_displaced_points(anymal, anymal_standing):
    """Of a ball foot the frame is measured; the surface is the radius below, as always."""
    rng = np.random.default_rng(0)
    robot = anymal.dynacom()
    zero = np.zeros(anymal.model.nv)
    robot.computeDynamics(anymal_standing, zero, zero)
    surfaces = {}
    for name in robot.getActiveContacts():
        contact = robot.getContact(name)
        assert contact.getSettings().world_aligned
        pose = moved(contact.getPose(), rng)
        robot.setContactPose(name, pose)
        below = pose.translation - contact.getSettings().radius * UP
        surfaces[name] = pin.SE3(np.eye(3), below)
        assert contact.getPose() == pose
        assert_allclose(contact.getSurfacePose().homogeneous, surfaces[name].homogeneous)
    assert distribute(robot) == SOLVED
    given = wrench_from(forces_of(robot), surfaces, robot.getCoM())
    assert_allclose(given, robot.ne_b(), rtol=0, atol=1e-9 * G * robot.getMass())


def assert_stands_at(robot: DynaCoM, name: str, pose: pin.SE3) -> None:
    """Pose and matrix about the centre of mass are those of that place."""
    contact = robot.getContact(name)
    assert_allclose(contact.getPose().homogeneous, pose.homogeneous, rtol=0, atol=1e-14)
    expected = pin.SE3(pose.rotation, pose.translation - robot.getCoM()).toDualActionMatrix()
    assert_allclose(contact.ne_A(), expected, rtol=0, atol=1e-13)


def modelled(robot: DynaCoM, name: str, q: np.ndarray) -> pin.SE3:
    model = robot.getModel()
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[model.getFrameId(FRAMES[name])]


LASTING = {
    "computeDynamics": lambda robot: robot.computeDynamics(*motion(robot.getModel(), 1)),
    "computeDynamics of data": lambda robot: robot.computeDynamics(
        computed(robot.getModel(), *motion(robot.getModel(), 1))
    ),
    "uneven ground": lambda robot: robot.computeDynamics(
        *motion(robot.getModel(), 1), flatHorizontalGround=False
    ),
    "computeNL": lambda robot: robot.computeNL(3.0, *motion(robot.getModel(), 1)),
    "distributeForce": lambda robot: distribute(robot),
    "kinematics": lambda robot: pin.forwardKinematics(
        robot.getModel(), robot.getData(), random_configuration(robot.getModel(), 1)
    ),
    "activated again": lambda robot: (robot.deactivateContact("a"), robot.activateContact("a")),
    "another one": lambda robot: robot.setContactPose("b", somewhere(1)),
    "another one reset": lambda robot: robot.resetContactPose("b"),
    "an invalid motion": lambda robot: robot.computeDynamics(
        np.full(robot.getModel().nq, np.nan), *motion(robot.getModel(), 1)[1:]
    ),
    "other settings": lambda robot: robot.getContact("a").setMu(0.3),
    "initialised again": lambda robot: move(robot.getContact("a"), FRAMES["a"]),
}


@pytest.mark.parametrize("event", LASTING)
def test_measured_poses_last(robot, event):
    """Until they are reset, whatever happens."""
    model = robot.getModel()
    robot.computeDynamics(*motion(model, 0))
    pose = somewhere(0)
    robot.setContactPose("a", pose)
    assert_stands_at(robot, "a", pose)
    LASTING[event](robot)
    assert robot.getContact("a").getPose() == pose
    robot.computeDynamics(*motion(model, 2))
    assert_stands_at(robot, "a", pose)
    robot.computeDynamics(*motion(model, 3), flatHorizontalGround=False)
    distribute(robot)
    assert_stands_at(robot, "a", pose)
    robot.resetContactPose("a")
    robot.computeDynamics(*motion(model, 3))
    assert_stands_at(robot, "a", modelled(robot, "a", motion(model, 3)[0]))


@pytest.mark.parametrize("way", ["distributeForce", "computeDynamics"])
def test_poses_that_are_reset(robot, way):
    """By the model again, from the next call on that places contacts; twice does no harm."""
    model = robot.getModel()
    robot.computeDynamics(*motion(model, 0))
    pose = somewhere(0)
    robot.setContactPose("a", pose)
    distribute(robot)
    for _ in range(2):
        robot.resetContactPose("a")
        assert_stands_at(robot, "a", pose)
    if way == "distributeForce":
        distribute(robot)
    else:
        robot.computeDynamics(*motion(model, 0))
    assert_stands_at(robot, "a", modelled(robot, "a", motion(model, 0)[0]))


def test_poses_that_were_never_measured_stay_the_model_s(robot):
    robot.computeDynamics(*motion(robot.getModel(), 0))
    assert distribute(robot) == SOLVED
    before = state(robot)
    for name in "abc":
        robot.resetContactPose(name)
    assert_same(state(robot), before)
    robot.setContactPose("a", somewhere(1))
    for name in "bc":
        assert_array_equal(
            robot.getContact(name).getPose().homogeneous, before[f"{name}.pose"], name
        )


def test_poses_measured_again(robot):
    robot.computeDynamics(*motion(robot.getModel(), 0))
    pose = somewhere(0)
    robot.setContactPose("a", somewhere(1))
    robot.setContactPose("a", pose)
    distribute(robot)
    assert_stands_at(robot, "a", pose)


def test_poses_measured_before_the_motion(robot):
    """And of a contact that is not active yet."""
    poses = {name: somewhere(seed) for seed, name in enumerate("ac")}
    for name, pose in poses.items():
        robot.setContactPose(name, pose)
        assert robot.getContact(name).getPose() == pose
    robot.computeDynamics(*motion(robot.getModel(), 0))
    robot.activateContact("c")
    assert distribute(robot) == SOLVED
    poses["b"] = modelled(robot, "b", motion(robot.getModel(), 0)[0])
    for name, pose in poses.items():
        assert_stands_at(robot, name, pose)
    given = wrench_from(forces_of(robot), poses, robot.getCoM())
    assert_allclose(given, robot.ne_b(), rtol=0, atol=1e-8 * np.linalg.norm(robot.ne_b()))


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, DynaCoM.copy])
def test_copies_keep_measured_poses(robot, copied):
    """Each its own: what one measures from then on is nothing to the other."""
    model = robot.getModel()
    robot.computeDynamics(*motion(model, 0))
    pose = somewhere(0)
    robot.setContactPose("a", pose)
    other = copied(robot)
    robot.resetContactPose("a")
    other.setContactPose("b", somewhere(1))
    for dynamics in (robot, other):
        dynamics.computeDynamics(*motion(model, 1))
        distribute(dynamics)
    assert_stands_at(other, "a", pose)
    for name in "ab":
        assert_stands_at(robot, name, modelled(robot, name, motion(model, 1)[0]))
    del robot
    gc.collect()
    other.computeDynamics(*motion(model, 2))
    assert_stands_at(other, "a", pose)


def test_measured_poses_are_copies(robot):
    robot.computeDynamics(*motion(robot.getModel(), 0))
    pose = somewhere(0)
    given = pose.copy()
    robot.setContactPose("a", given)
    given.translation = np.zeros(3)
    del given
    gc.collect()
    distribute(robot)
    assert_stands_at(robot, "a", pose)


def test_removed_contacts_forget_where_they_were_measured(robot):
    """As do all, when the robot is initialised again."""
    model = robot.getModel()
    contact = robot.getContact("a")
    robot.setContactPose("a", somewhere(1))
    robot.removeContact("a")
    robot.addContact(contact, "a")
    robot.computeDynamics(*motion(model, 0))
    assert_stands_at(robot, "a", modelled(robot, "a", motion(model, 0)[0]))
    robot.setContactPose("a", somewhere(1))
    robot.initialize(pin.Model(model))
    robot.addContact(contact, "a")
    robot.computeDynamics(*motion(model, 0))
    assert_stands_at(robot, "a", modelled(robot, "a", motion(model, 0)[0]))


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("part", ["translation", "rotation"])
def test_measured_poses_that_are_not_finite(robot, part, value):
    """A fact of the world: a status, and the forces of before, until there is a better pose."""
    robot.computeDynamics(*motion(robot.getModel(), 0))
    assert distribute(robot) == SOLVED
    kept = robot.allForces()
    lost = pin.SE3.Identity()
    setattr(lost, part, np.full_like(getattr(lost, part), value))
    robot.setContactPose("a", lost)
    for _ in range(2):
        assert distribute(robot) == INVALID
        assert_array_equal(robot.allForces(), kept)
    robot.computeDynamics(*motion(robot.getModel(), 0), flatHorizontalGround=False)
    assert robot.getDistributionStatus() == INVALID
    assert np.isnan(robot.getCoP()).all()
    assert not robot.isCoPDefined()
    robot.resetContactPose("a")
    assert distribute(robot) == SOLVED
    assert_allclose(robot.allForces(), kept, rtol=0, atol=1e-9 * np.abs(kept).max())


@pytest.mark.parametrize("wrong", [None, "pose", np.eye(4), np.zeros(3), pin.Motion.Zero(), {}])
def test_measured_poses_of_the_wrong_type(robot, wrong):
    robot.computeDynamics(*motion(robot.getModel(), 0))
    before = state(robot)
    with pytest.raises(TypeError):
        robot.setContactPose("a", wrong)
    with pytest.raises(TypeError):
        robot.setContactPose("a")
    assert_same(state(robot), before)
    robot.computeDynamics(*motion(robot.getModel(), 0))
    assert_same(state(robot), before)


# Pinocchio's objects, and lifetimes.


def test_model_and_data_keep_the_robot_alive(humanoid):
    robot = DynaCoM(humanoid)
    q, v, a = motion(humanoid, 0)
    robot.computeDynamics(q, v, a)
    com = robot.getCoM()
    model, data = robot.getModel(), robot.getData()
    oMi = data.oMi
    del robot
    gc.collect()
    assert model == humanoid
    assert_array_equal(data.com[0], com)
    assert len(oMi) == model.njoints
    pin.computeCentroidalMomentumTimeVariation(model, data, q, v, a)
    assert_array_equal(data.com[0], com)


def test_model_and_data_are_the_robot_s_own(humanoid):
    """Not copies: what Pinocchio computes in one's hand is seen by the robot."""
    robot = DynaCoM(humanoid)
    model, data = robot.getModel(), robot.getData()
    pin.centerOfMass(model, data, random_configuration(humanoid, 1))
    assert_array_equal(robot.getData().com[0], data.com[0])
    robot.computeDynamics(*motion(humanoid, 2))
    assert_array_equal(data.com[0], robot.getCoM())
    state_read = dynacom.readCentroidalState(data)
    assert_array_equal(state_read.am, robot.getAM())


@pytest.mark.parametrize("forward", [pin.forwardKinematics, pin.framesForwardKinematics])
def test_contacts_follow_data(robot, forward):
    """A script runs Pinocchio on getData(): at the next distribution contacts stand there."""
    model, data = robot.getModel(), robot.getData()
    robot.computeDynamics(*motion(model, 0))
    q = random_configuration(model, 1)
    forward(model, data, q)
    reference = model.createData()
    pin.framesForwardKinematics(model, reference, q)
    force, torque, com = robot.getGroundCoMForce(), np.zeros(3), np.array([0.1, 0.2, 0.3])
    robot.distributeForce(force, torque, com)
    for name in ("a", "b"):
        contact = robot.getContact(name)
        pose = reference.oMf[model.getFrameId(FRAMES[name])]
        assert_array_equal(contact.getPose().homogeneous, pose.homogeneous)
        expected = pin.SE3(pose.rotation, pose.translation - com).toDualActionMatrix()
        assert_allclose(contact.ne_A(), expected, rtol=0, atol=1e-15)
    assert_array_equal(robot.ne_b(), np.concatenate([force, torque]))


@pytest.mark.parametrize("flat", [True, False])
def test_contacts_are_fresh_after_computeDynamics(robot, flat):
    """All that are known, active or not, whichever flag."""
    model = robot.getModel()
    reference = model.createData()
    for seed in (0, 1):
        q, v, a = motion(model, seed)
        robot.computeDynamics(q, v, a, flatHorizontalGround=flat)
        pin.framesForwardKinematics(model, reference, q)
        for name in robot.getKnownContacts():
            contact = robot.getContact(name)
            pose = reference.oMf[model.getFrameId(FRAMES[name])]
            assert_allclose(contact.getPose().homogeneous, pose.homogeneous, rtol=0, atol=1e-14)
            pose = contact.getPose()
            expected = pin.SE3(pose.rotation, pose.translation - robot.getCoM())
            assert_allclose(contact.ne_A(), expected.toDualActionMatrix(), rtol=0, atol=1e-14)


def test_contacts_of_frames_that_were_added(humanoid):
    """Operational frames count as much as the URDF's."""
    model = pin.Model(humanoid)
    placement = pin.SE3(pin.exp3(np.array([0.1, 0.2, 0.3])), np.array([0.0, 0.1, -0.2]))
    parent = model.frames[model.getFrameId("rleg6_joint")].parentJoint
    model.addFrame(pin.Frame("toe", parent, placement, pin.FrameType.OP_FRAME))
    robot = DynaCoM(model)
    contact = point(frame_name="toe")
    robot.addContact(contact, "toe")
    robot.computeDynamics(*motion(model, 0))
    expected = robot.getData().oMi[parent] * placement
    assert_allclose(contact.getPose().homogeneous, expected.homogeneous, rtol=0, atol=1e-15)
    assert contact.getFrameID() == model.getFrameId("toe")


def test_contact_identity(robot):
    """What is added is what is handed out, as the type it is."""
    contact = sole_of(robot.getModel(), "d")
    robot.addContact(contact, "d")
    assert robot.getContact("d") is contact
    assert isinstance(robot.getContact("d"), Contact6D)
    pointed = point(frame_name=FRAMES["d"])
    robot.addContact(pointed, "point")
    assert robot.getContact("point") is pointed
    assert isinstance(robot.getContact("point"), ContactPoint)
    assert isinstance(pointed, ContactBase)


def test_contacts_live_as_long_as_anyone_holds_them(robot):
    contact = sole_of(robot.getModel(), "d")
    seen = weakref.ref(contact)
    contact.setMu(0.123)
    robot.addContact(contact, "d")
    del contact
    gc.collect()
    assert robot.getContact("d").getSettings().mu == 0.123
    robot.computeDynamics(*motion(robot.getModel(), 0))
    distribute(robot)

    held = robot.getContact("d")
    robot.removeContact("d")
    del robot
    gc.collect()
    assert held.getSettings().mu == 0.123
    del held
    gc.collect()
    assert seen() is None


def test_setters_of_a_shared_contact_act_on_the_next_call(robot):
    robot.computeDynamics(*motion(robot.getModel(), 0))
    contact = robot.getContact("b")
    contact.setMu(0.25)
    contact.setForceWeights(np.full(3, 4.0))
    assert_array_equal(robot.fri_A()[6:, 6:], contact.fri_A())
    assert_array_equal(robot.reg_A(), [1] * 6 + [4] * 3 + [1] * 3)
    distribute(robot)
    with_setters = robot.allForces()
    contact.initialize(contact.getSettings())
    distribute(robot)
    assert_allclose(robot.allForces(), with_setters, rtol=0, atol=1e-9)
    expected = share_by_edges([robot.getContact("a"), contact], robot.ne_b())
    assert_allclose(with_setters, expected.forces, rtol=0, atol=1e-6)


def test_contact_of_another_frame_on_the_next_call(robot):
    """initialize() may name another frame: the contact moves there."""
    model = robot.getModel()
    robot.computeDynamics(*motion(model, 0))
    contact = robot.getContact("a")
    settings = contact.getSettings()
    settings.frame_name = FRAMES["d"]
    contact.initialize(settings)
    distribute(robot)
    assert contact.getFrameID() == model.getFrameId(FRAMES["d"])
    expected = model.createData()
    pin.framesForwardKinematics(model, expected, motion(model, 0)[0])
    pose = expected.oMf[contact.getFrameID()]
    assert_allclose(contact.getPose().homogeneous, pose.homogeneous, rtol=0, atol=1e-14)


def test_contact_whose_frame_is_gone(robot):
    """Nothing has changed when it throws, and the robot works again once the contact is right."""
    model = robot.getModel()
    robot.computeNL(3.0, *motion(model, 0))
    assert distribute(robot) == SOLVED
    contact = robot.getContact("b")
    settings = contact.getSettings()
    right = settings.frame_name
    settings.frame_name = "nowhere"
    contact.initialize(settings)
    before = state(robot)
    wrench = robot.getGroundCoMForce(), robot.getGroundCoMTorque()
    for call in (
        lambda: robot.computeDynamics(*motion(model, 1)),
        lambda: robot.computeDynamics(*motion(model, 1), flatHorizontalGround=False),
        lambda: robot.computeNL(4.0, *motion(model, 1)),
        lambda: robot.distributeForce(*wrench, np.zeros(3)),
    ):
        with pytest.raises(ValueError, match="must have one frame 'nowhere', got 0"):
            call()
        assert_same(state(robot), before)
    settings.frame_name = right
    contact.initialize(settings)
    assert distribute(robot) == SOLVED


# Copies.


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, DynaCoM.copy])
def test_copies_share_nothing(robot, copied):
    model = robot.getModel()
    robot.setGroundHeight(0.25)
    robot.computeNL(3.0, *motion(model, 0))
    assert distribute(robot) == SOLVED
    before = state(robot)
    other = copied(robot)
    assert type(other) is DynaCoM
    assert_same(state(other), before)
    for name in robot.getKnownContacts():
        assert other.getContact(name) is not robot.getContact(name)
        assert type(other.getContact(name)) is Contact6D

    other.getContact("a").setMu(0.1)
    other.getContact("b").applyForce(np.ones(6))
    other.setGroundHeight(1.0)
    other.activateContact("c")
    other.deactivateContact("a")
    other.computeNL(4.0, *motion(model, 1))
    distribute(other)
    other.removeContact("a")
    assert_same(state(robot), before)

    changed = state(other)
    robot.removeContact("b")
    robot.initialize(pendulum_settings())
    del robot, model
    gc.collect()
    assert_same(state(other), changed)
    other.computeDynamics(*motion(other.getModel(), 2))


def test_copy_before_initialize():
    other = DynaCoM().copy()
    with pytest.raises(NotReadyError):
        other.computeNL(1.0)
    other.initialize(pendulum_settings())


def test_copies_work_in_threads(robot):
    """Each thread its own copy: the same results as one after the other."""
    model = robot.getModel()
    motions = [motion(model, seed) for seed in range(8)]

    def run(worker, results):
        for q, v, a in motions:
            worker.computeDynamics(q, v, a)
            status = distribute(worker)
            results.append((str(status), worker.allForces()))

    expected = []
    run(robot.copy(), expected)
    results = [[] for _ in range(4)]
    threads = [threading.Thread(target=run, args=(robot.copy(), out)) for out in results]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for out in results:
        for (status, forces), (expected_status, expected_forces) in zip(out, expected, strict=True):
            assert status == expected_status
            assert_array_equal(forces, expected_forces)


# Contacts.


@pytest.mark.parametrize("add", ["addContact", "addContact6d"])
def test_contacts_that_cannot_be_added(robot, add):
    """The message names contact and reason; nothing has changed."""
    model = robot.getModel()
    before = state(robot)
    add = getattr(robot, add)
    known = robot.getContact("a")
    new = sole_of(model, "d")
    for contact, name, message in (
        (new, "a", "'a' already"),
        (known, "z", "'z' is known already, as 'a'"),
        (robot.getContact("c"), "z", "'z' is known already, as 'c'"),
        (Contact6D(), "z", "'z' was never initialised"),
        (ContactPoint(), "z", "'z' was never initialised"),
        (sole(frame_name="nowhere"), "z", "'z': the model must have one frame 'nowhere', got 0"),
        (None, "z", "'z' must not be null"),
    ):
        with pytest.raises(ValueError, match=message):
            add(contact, name)
    for contact, name in ((new, 3), (new, None), ("a", "z"), (robot, "z"), (sole, "z")):
        with pytest.raises(TypeError):
            add(contact, name)
    assert_same(state(robot), before)
    assert new.getFrameID() > 2**62
    add(new, "d")


@pytest.mark.parametrize(
    "name",
    [
        "removeContact",
        "activateContact",
        "deactivateContact",
        "removeContact6d",
        "activateContact6d",
        "deactivateContact6d",
        "getContact",
        "setContactPose",
        "resetContactPose",
        *CONTACT_GETTERS,
    ],
)
def test_names_that_are_not_known(robot, name):
    """The message names those that are."""
    before = state(robot)
    more = [pin.SE3.Identity()] if name == "setContactPose" else []

    def call(contact_name, robot=robot):
        getattr(robot, name)(contact_name, *more)

    with pytest.raises(ValueError, match="no contact 'z'; known: 'a', 'b', 'c'"):
        call("z")
    with pytest.raises(ValueError, match="no contact ''"):
        call("")
    for wrong in (None, 3, robot.getContact("a")):
        with pytest.raises(TypeError):
            call(wrong)
    assert_same(state(robot), before)
    with pytest.raises(ValueError, match="no contact 'a'; known: none"):
        call("a", DynaCoM(robot.getModel()))


def test_activation(robot):
    assert robot.getActiveContacts() == ["a", "b"]
    assert robot.getKnownContacts() == ["a", "b", "c"]
    robot.computeDynamics(*motion(robot.getModel(), 0))
    assert distribute(robot) == SOLVED
    before = state(robot)
    # What is active already, or is not, stays as it is, force and all.
    robot.activateContact("a")
    robot.deactivateContact("c")
    assert_same(state(robot), before)

    contact = robot.getContact("a")
    assert contact.appliedForce().any()
    robot.deactivateContact("a")
    assert not contact.appliedForce().any()
    assert robot.getActiveContacts() == ["b"]
    assert sorted(robot.getKnownContacts()) == ["a", "b", "c"]
    robot.activateContact("a")
    robot.activateContact("c")
    assert robot.getActiveContacts() == ["b", "a", "c"]
    assert isinstance(robot.getActiveContacts(), list)

    assert distribute(robot) == SOLVED
    robot.removeContact("a")
    assert not contact.appliedForce().any()
    assert robot.getKnownContacts() == ["b", "c"]


def test_lists_of_names_are_copies(robot):
    robot.getActiveContacts().clear()
    robot.getKnownContacts().clear()
    assert robot.getKnownContacts() == ["a", "b", "c"]


def test_late_contacts_are_placed_at_once(robot):
    """A contact added or activated after computeDynamics gets its placement then."""
    model = robot.getModel()
    robot.computeDynamics(*motion(model, 0))
    pose = {
        name: pin.updateFramePlacement(model, robot.getData(), model.getFrameId(frame)).homogeneous
        for name, frame in FRAMES.items()
    }
    contact = sole_of(model, "d")
    robot.addContact(contact, "d", False)
    assert_array_equal(contact.getPose().homogeneous, pose["d"])
    contact.setPose(pin.SE3.Identity())
    robot.activateContact("d")
    assert_array_equal(contact.getPose().homogeneous, pose["d"])
    assert contact.ne_A().any()


OPERATIONS = st.lists(
    st.tuples(
        st.sampled_from(["add", "idle", "remove", "activate", "deactivate", "distribute"]),
        st.sampled_from("abcd"),
    ),
    max_size=25,
)


@CALM
@given(OPERATIONS)
def test_any_order_of_operations(operations):
    """Names, matrices and forces belong together, however contacts came and went."""
    model = random_humanoid(0)
    robot = DynaCoM(model)
    robot.computeDynamics(*motion(model, 3))
    contacts, active = {}, []
    for operation, name in operations:
        if operation in ("add", "idle"):
            if name in contacts:
                with pytest.raises(ValueError, match=f"'{name}' already"):
                    robot.addContact(sole_of(model, name), name)
                continue
            contacts[name] = sole_of(model, name)
            robot.addContact(contacts[name], name, operation == "add")
            active += [name] if operation == "add" else []
        elif operation == "distribute":
            distribute(robot)
        elif name not in contacts:
            with pytest.raises(ValueError, match=f"no contact '{name}'"):
                getattr(robot, f"{operation}Contact")(name)
        else:
            getattr(robot, f"{operation}Contact")(name)
            if operation == "activate":
                active += [name] if name not in active else []
            else:
                active = [other for other in active if other != name]
                assert not contacts[name].appliedForce().any()
            if operation == "remove":
                del contacts[name]

        assert robot.getActiveContacts() == active
        assert robot.getKnownContacts()[: len(active)] == active
        assert sorted(robot.getKnownContacts()) == sorted(contacts)
        for known, contact in contacts.items():
            assert robot.getContact(known) is contact

    status = distribute(robot)
    result = robot.getDistribution()
    assert len(result.contacts) == len(active)
    assert result.isOptimal()
    ordered = [contacts[name] for name in active]
    if not active:
        assert status == DistributionStatus.NoContact
        assert robot.allForces().size == 0
        return
    assert_array_equal(robot.uni_A(), block_diagonal([c.uni_A() for c in ordered]))
    assert_array_equal(robot.fri_A(), block_diagonal([c.fri_A() for c in ordered]))
    assert_array_equal(robot.ne_A(), np.hstack([c.ne_A() for c in ordered]))
    for name, getter in (
        ("uni_b", "uni_b"),
        ("fri_b", "fri_b"),
        ("reg_A", "reg_A"),
        ("reg_b", "reg_b"),
        ("allForces", "appliedForce"),
    ):
        expected = np.concatenate([getattr(contact, getter)() for contact in ordered])
        assert_array_equal(getattr(robot, name)(), expected)
    # The same contacts, under other names, in the order of the alphabet, on a fresh robot.
    fresh = DynaCoM(model)
    fresh.computeDynamics(*motion(model, 3))
    for name in sorted(active):
        fresh.addContact(sole_of(model, name), f"the one at {FRAMES[name]}")
    assert distribute(fresh) == status
    scale = np.linalg.norm(fresh.ne_b())
    for name in active:
        force = fresh.getContact(f"the one at {FRAMES[name]}").appliedForce()
        assert_allclose(contacts[name].appliedForce(), force, rtol=0, atol=1e-9 * scale)


def test_stacked_matrices_are_matrices(humanoid):
    """Of one point, and of none, too: the number of dimensions does not depend on the contacts."""
    robot = DynaCoM(humanoid)
    shapes = {name: getattr(robot, name)().shape for name in STACKED}
    assert shapes == {
        "uni_A": (0, 0),
        "uni_b": (0,),
        "fri_A": (0, 0),
        "fri_b": (0,),
        "reg_A": (0,),
        "reg_b": (0,),
        "ne_A": (6, 0),
        "ne_b": (6,),
        "allForces": (0,),
    }
    robot.addContact(point(frame_name=FRAMES["a"]), "a")
    assert robot.fri_A().shape == (4, 3)
    assert robot.ne_A().shape == (6, 3)
    assert robot.uni_A().shape == (1, 3)


# Distribution; test_wrench_distribution.py has more of it.


@CALM
@given(st.integers(0, 2**32 - 1))
def test_distribution_is_the_quadratic_program(seed):
    """Through the class: at the model's frames, whatever the wrench and the centre of mass."""
    rng = np.random.default_rng(seed)
    model = random_humanoid(seed % 5)
    robot = DynaCoM(model)
    names = rng.permutation(list(FRAMES))[: rng.integers(1, 5)]
    for name in names:
        contact = sole_of(model, name)
        contact.setForceWeights(10.0 ** rng.uniform(-1, 1, 3))
        contact.setMu(rng.uniform(0.2, 1.0))
        robot.addContact(contact, name)
    robot.computeDynamics(*motion(model, seed % 1000))
    com = rng.uniform(-1.0, 1.0, 3)
    # Once for the contacts' matrices about com, then for a wrench that they can give.
    robot.distributeForce(np.ones(3), np.zeros(3), com)
    wrench = np.zeros(6)
    for name in names:
        wrench += robot.getContact(name).ne_A() @ [*rng.uniform(-9, 9, 2), 100.0, 1.0, -1.0, 2.0]
    status = robot.distributeForce(wrench[:3], wrench[3:], com)
    assert status == robot.getDistributionStatus() == SOLVED
    contacts = [robot.getContact(name) for name in names]
    tolerance = 1e-9 * np.linalg.norm(wrench)
    expected = share_by_edges(contacts, wrench).forces
    assert_allclose(robot.allForces(), expected, rtol=0, atol=10 * tolerance)
    assert_allclose(robot.ne_A() @ robot.allForces(), wrench, rtol=0, atol=tolerance)
    for contact in contacts:
        assert_within_cones(contact, tolerance)


def test_out_of_reach(robot):
    """Forces are the best that the contacts can give, and the result says what is missing."""
    robot.computeDynamics(*motion(robot.getModel(), 0))
    com = robot.getCoM()
    contact = robot.getContact("a")
    push = contact.ne_A() @ [0, 0, 100, 0, 0, 0]
    robot.deactivateContact("b")
    assert robot.distributeForce(push[:3], push[3:], com) == SOLVED
    assert_allclose(robot.allForces(), [0, 0, 100, 0, 0, 0], rtol=0, atol=1e-10)

    pull = np.concatenate([-push[:3], push[3:]])
    status = robot.distributeForce(pull[:3], pull[3:], com)
    assert status == robot.getDistributionStatus() == RELAXED
    result = robot.getDistribution()
    expected = share_by_edges([contact], pull)
    assert_array_equal(robot.ne_b(), pull)
    assert_array_equal(result.wrench, pull)
    assert_allclose(result.achieved, expected.closest, rtol=0, atol=1e-9)
    assert_allclose(robot.allForces(), expected.forces, rtol=0, atol=1e-8)
    assert_array_equal(result.residual, pull - result.achieved)
    assert_array_equal(contact.appliedForce(), robot.allForces())
    assert_within_cones(contact, 1e-9)
    assert result.isOptimal()
    assert robot.computeWrenchMargin().margin == 0.0

    robot.deactivateContact("a")
    status = robot.distributeForce(push[:3], push[3:], com)
    assert status == robot.getDistributionStatus() == DistributionStatus.NoContact
    assert robot.allForces().shape == (0,)
    assert_array_equal(robot.getDistribution().achieved, np.zeros(6))
    for name in "abc":
        assert not robot.getContact(name).appliedForce().any()


def test_wrench_weights_choose_the_closest(robot):
    """What counts more is kept better."""
    robot.computeDynamics(*motion(robot.getModel(), 0))
    contacts = [robot.getContact(name) for name in "ab"]
    for contact in contacts:
        contact.setMu(0.3)
        contact.setGu(0.1)
    asked = np.array([3000.0, -2000.0, 100.0, 50.0, -60.0, 900.0])
    residuals = {}
    for weights in ([1, 1, 1, 1, 1, 1], [100, 100, 100, 1, 1, 1], [1, 1, 1, 100, 100, 100]):
        weights = np.array(weights, dtype=float)
        robot.setWrenchWeights(weights)
        assert robot.distributeForce(asked[:3], asked[3:], robot.getCoM()) == RELAXED
        result = robot.getDistribution()
        assert_array_equal(result.wrench_weights, weights)
        expected = share_by_edges(contacts, asked, weights)
        scale = np.linalg.norm(weights * asked)
        assert_allclose(
            weights * result.achieved, weights * expected.closest, rtol=0, atol=1e-9 * scale
        )
        residuals[tuple(weights[[0, 3]])] = np.linalg.norm(result.residual.reshape(2, 3), axis=1)
    assert residuals[100, 1][0] < residuals[1, 1][0] < residuals[1, 100][0]
    assert residuals[1, 100][1] < residuals[1, 1][1] < residuals[100, 1][1]


def test_the_scale_is_the_weight(robot):
    """Of any robot at 9.81 m/s², if the wrench is less: rounding is not a pull."""
    robot.computeDynamics(*motion(robot.getModel(), 0))
    robot.deactivateContact("b")
    weight = G * robot.getMass()
    rounding = -1e-9 * weight * robot.getContact("a").getPose().rotation[:, 2]
    assert robot.distributeForce(rounding, np.zeros(3), robot.getCoM()) == SOLVED
    assert_allclose(robot.getDistribution().scale, weight, rtol=1e-14)
    assert robot.distributeForce(1e3 * rounding, np.zeros(3), robot.getCoM()) == RELAXED
    robot.deactivateContact("a")
    assert robot.distributeForce(rounding, np.zeros(3), robot.getCoM()) == SOLVED
    status = robot.distributeForce(1e3 * rounding, np.zeros(3), robot.getCoM())
    assert status == DistributionStatus.NoContact


def test_maximal_iterations(robot):
    """Where they are not enough there is no answer, and the forces are those of the last one."""
    robot.computeDynamics(*motion(robot.getModel(), 0))
    contacts, com = [robot.getContact(name) for name in "ab"], robot.getCoM()
    assert distribute(robot) == SOLVED
    kept = robot.allForces()
    # At a corner of the first cone: two sides of the pyramid, two edges, and the yaw.
    settings = contacts[0].getSettings()
    corner = [settings.mu, settings.mu, 1, settings.half_width, settings.half_length, settings.gu]
    hard = contacts[0].ne_A() @ np.multiply(100.0, corner) + contacts[1].ne_A() @ np.eye(6)[2]

    assert robot.getMaximalIterations() == dynacom.WrenchDistribution.kMaximalIterations == 100_000
    robot.setWarmStart(False)
    robot.setMaximalIterations(1)
    for _ in range(2):
        status = robot.distributeForce(hard[:3], hard[3:], com)
        assert status == robot.getDistributionStatus() == DistributionStatus.NumericalFailure
        assert_array_equal(robot.allForces(), kept)
        assert robot.getDistribution().iterations == 1
        assert not robot.getDistribution().isOptimal()
    robot.activateContact("c")
    status = robot.distributeForce(hard[:3], hard[3:], com)
    assert status == DistributionStatus.NumericalFailure
    assert_array_equal(robot.allForces(), np.zeros(18))
    robot.deactivateContact("c")
    robot.setMaximalIterations(100)
    assert robot.distributeForce(hard[:3], hard[3:], com) == SOLVED
    assert robot.getDistribution().isOptimal()
    expected = share_by_edges(contacts, hard).forces
    assert_allclose(robot.allForces(), expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize("number", [0, -1, -10000])
def test_maximal_iterations_out_of_range(robot, number):
    robot.setMaximalIterations(7)
    message = f"^maximalIterations must be > 0, got {number}$"
    with pytest.raises(ValueError, match=message):
        robot.setMaximalIterations(number)
    assert robot.getMaximalIterations() == 7


def test_maximal_iterations_of_any_kind(robot):
    """An integer of Python or of numpy, and nothing else."""
    for number in (20, np.int64(21), np.int32(22), np.uint8(23)):
        robot.setMaximalIterations(number)
        assert robot.getMaximalIterations() == number
        assert type(robot.getMaximalIterations()) is int
    for wrong in (2.0, np.float64(2.0), None, "2", [2], 2j):
        with pytest.raises(TypeError):
            robot.setMaximalIterations(wrong)
    for large in (2**31, np.int64(2**40), -(2**31) - 1):
        with pytest.raises(OverflowError):
            robot.setMaximalIterations(large)
    assert robot.getMaximalIterations() == 23


def test_warm_start_is_a_setting(robot):
    assert robot.getWarmStart() is True
    for value in (False, np.bool_(True), np.bool_(False)):
        robot.setWarmStart(value)
        assert robot.getWarmStart() is bool(value)
    for wrong in ("no", 0.5, np.zeros(2)):
        with pytest.raises(TypeError):
            robot.setWarmStart(wrong)
    assert robot.getWarmStart() is False


def test_settings_of_distributions_stay(robot):
    """Through initialize() and in copies, as the weights do."""
    robot.setWarmStart(False)
    robot.setMaximalIterations(77)
    robot.computeDynamics(*motion(robot.getModel(), 0))
    distribute(robot)
    robot.initialize(pendulum_settings())
    for dynamics in (robot, robot.copy(), copy.copy(robot), copy.deepcopy(robot)):
        assert dynamics.getWarmStart() is False
        assert dynamics.getMaximalIterations() == 77


@CALM
@given(OPERATIONS, st.integers(0, 2**32 - 1))
def test_warm_start_changes_no_answer(operations, seed):
    """However contacts come and go in between, and whether the wrench is in reach or not."""
    rng = np.random.default_rng(seed)
    model = random_humanoid(0)
    warm = DynaCoM(model)
    for name in "abcd":
        contact = sole_of(model, name)
        contact.setMu(rng.uniform(0.2, 1.0))
        contact.setGu(rng.uniform(0.02, 0.2))
        warm.addContact(contact, name, bool(rng.integers(2)))
    cold = warm.copy()
    cold.setWarmStart(False)
    q, v, a = motion(model, seed % 1000)
    direction = 0.02 * rng.standard_normal(model.nv)
    for operation, name in [*operations, ("distribute", "a")]:
        q = pin.integrate(model, q, direction)
        for dynamics in (warm, cold):
            if operation in ("activate", "deactivate"):
                getattr(dynamics, f"{operation}Contact")(name)
            elif operation == "remove":
                dynamics.setContactPose(name, modelled(dynamics, name, q))
            dynamics.computeDynamics(q, v, a)
        assert distribute(warm) == distribute(cold)
        result, expected = warm.getDistribution(), cold.getDistribution()
        assert_allclose(result.forces(), expected.forces(), rtol=0, atol=1e-9 * expected.scale)
        assert_allclose(result.achieved, expected.achieved, rtol=0, atol=1e-9 * expected.scale)
        assert result.isOptimal()


def test_distribution_is_a_copy(robot):
    robot.computeDynamics(*motion(robot.getModel(), 0))
    assert distribute(robot) == SOLVED
    held = robot.getDistribution()
    forces = held.forces()
    robot.getDistribution().achieved[:] = 9.0
    robot.getDistribution().contacts[0].force[:] = 9.0
    assert_array_equal(robot.getDistribution().forces(), forces)
    robot.distributeForce(np.ones(3), np.zeros(3), robot.getCoM())
    robot.removeContact("a")
    del robot
    gc.collect()
    assert_array_equal(held.forces(), forces)
    assert held.isOptimal()


def test_distribution_is_in_the_order_of_activation(robot):
    robot.computeDynamics(*motion(robot.getModel(), 0))
    robot.activateContact("c")
    robot.deactivateContact("a")
    robot.activateContact("a")
    assert robot.getActiveContacts() == ["b", "c", "a"]
    assert distribute(robot) == SOLVED
    result = robot.getDistribution()
    assert_array_equal(result.forces(), robot.allForces())
    for name, share in zip("bca", result.contacts, strict=True):
        contact = robot.getContact(name)
        assert_array_equal(share.force, contact.appliedForce())
        assert_array_equal(share.NE, contact.ne_A())
        assert_array_equal(share.weights, contact.reg_A())


@CALM
@given(st.integers(0, 2**32 - 1))
def test_feasible_accelerations(seed):
    """By Newton and Euler from what is achieved: those of the motion where all of it is."""
    rng = np.random.default_rng(seed)
    model = random_humanoid(0)
    robot = DynaCoM(model)
    for name in "ab":
        robot.addContact(sole_of(model, name), name)
    q, v, a = motion(model, seed % 1000)
    pushed = rng.uniform(-50.0, 50.0, 6)
    robot.computeNL(3.0, q, v, a, pushed)
    assert np.isnan(robot.getFeasibleACoM()).all()
    assert np.isnan(robot.getFeasibleAMVariation()).all()
    vrp = robot.getVRP()
    assert_allclose(vrp, (robot.getCoM() - robot.getACoM() / 9.0)[:2], rtol=1e-12)

    status = distribute(robot)
    force, torque = np.split(robot.getDistribution().achieved + pushed, 2)
    acom = force / robot.getMass() - G * UP
    assert_allclose(robot.getFeasibleACoM(), acom, rtol=1e-12, atol=1e-12)
    assert_allclose(robot.getFeasibleAMVariation(), torque, rtol=1e-12, atol=1e-12)
    scale = robot.getDistribution().scale
    differs = np.abs(acom - robot.getACoM()).max() * robot.getMass()
    differs += np.abs(torque - robot.getAMVariation()).max()
    assert (differs <= 1e-6 * scale) == (status == SOLVED)
    # A distribution by hand leaves computeNL() as it is; one of computeDynamics() does not.
    robot.computeNL(3.0)
    assert_array_equal(robot.getVRP(), vrp)
    robot.computeNL(3.0, q, v, a, pushed, False)
    assert_allclose(robot.getFeasibleACoM(), acom, rtol=1e-10, atol=1e-10)
    assert_allclose(robot.getVRP(), (robot.getCoM() - acom / 9.0)[:2], rtol=1e-9, atol=1e-9)
    if robot.isCoPDefined():
        assert_array_equal(robot.getNL(), robot.getCoP() - robot.getVRP())


def test_feasible_accelerations_in_flight(robot):
    """Without contacts: free fall, whatever the motion says."""
    model = robot.getModel()
    for name in "ab":
        robot.deactivateContact(name)
    robot.computeDynamics(*motion(model, 0), flatHorizontalGround=False)
    assert robot.getDistributionStatus() == DistributionStatus.NoContact
    assert_allclose(robot.getFeasibleACoM(), -G * UP, rtol=1e-15)
    assert_array_equal(robot.getFeasibleAMVariation(), np.zeros(3))


def test_usage_and_margin_of_a_contact_by_hand(robot):
    """A force within the limits: how much of each it uses."""
    robot.computeDynamics(*motion(robot.getModel(), 0))
    contact = robot.getContact("a")
    robot.deactivateContact("b")
    settings = contact.getSettings()
    settings.mu, settings.gu, settings.half_length, settings.half_width = 0.5, 0.2, 0.1, 0.05
    contact.initialize(settings)
    robot.distributeForce(np.zeros(3), np.zeros(3), robot.getCoM())
    wrench = contact.ne_A() @ [10.0, -40.0, 100.0, 3.0, -6.0, -5.0]
    assert robot.distributeForce(wrench[:3], wrench[3:], robot.getCoM()) == SOLVED
    # The centre of pressure: x = -tau_y/f_z, y = tau_x/f_z.
    assert_allclose(robot.getContactCoP("a"), [0.06, 0.03], rtol=1e-9)
    assert robot.getContactCoPMargin("a") == pytest.approx(0.02, rel=1e-8)
    assert robot.getContactFrictionUsage("a") == pytest.approx(0.8, rel=1e-9)
    assert robot.getContactYawUsage("a") == pytest.approx(0.25, rel=1e-9)
    for name, getter in (
        ("getContactCoP", contact.getCoP),
        ("getContactCoPMargin", contact.getCoPMargin),
        ("getContactFrictionUsage", contact.getFrictionUsage),
        ("getContactYawUsage", contact.getYawUsage),
    ):
        assert_array_equal(getattr(robot, name)("a"), getter())
    # Out of reach, forces are on a limit; what is used up is used up.
    wrench = contact.ne_A() @ [500.0, 0.0, 100.0, 0.0, 0.0, 0.0]
    assert robot.distributeForce(wrench[:3], wrench[3:], robot.getCoM()) == RELAXED
    assert robot.getContactFrictionUsage("a") == pytest.approx(1.0, rel=1e-9)
    # Below the minimal force there is none, and a contact that takes no part has none either.
    robot.setMinimalVerticalForce(1e4)
    for name in "ab":
        assert robot.getContactCoP(name).shape == (2,)
        assert np.isnan(robot.getContactCoP(name)).all()
        assert np.isnan(robot.getContactCoPMargin(name))
        assert robot.getContactFrictionUsage(name) == 0.0
        assert robot.getContactYawUsage(name) == 0.0


def test_usage_of_points(humanoid):
    """A point has its centre of pressure, but no edges and no yaw; without friction, no usage."""
    robot = DynaCoM(humanoid)
    robot.addContact(point(frame_name=FRAMES["a"], mu=0.5), "a")
    robot.computeDynamics(*motion(humanoid, 0))
    contact = robot.getContact("a")
    wrench = contact.ne_A() @ [10.0, -20.0, 100.0]
    assert robot.distributeForce(wrench[:3], wrench[3:], robot.getCoM()) == SOLVED
    assert_array_equal(robot.getContactCoP("a"), np.zeros(2))
    assert robot.getContactFrictionUsage("a") == pytest.approx(0.4, rel=1e-9)
    assert np.isnan(robot.getContactCoPMargin("a"))
    assert np.isnan(robot.getContactYawUsage("a"))
    contact.setMu(0.0)
    robot.distributeForce(wrench[:3], wrench[3:], robot.getCoM())
    assert np.isnan(robot.getContactFrictionUsage("a"))


def test_margin_of_the_wrench(resting):
    """The class's and that of a distribution of the same contacts and wrench."""
    distribution = dynacom.WrenchDistribution()
    weights = np.array([1.0, 1.0, 1.0, 5.0, 5.0, 5.0])
    resting.setWrenchWeights(weights)
    distribution.setWrenchWeights(weights)
    assert distribute(resting) == SOLVED
    for name in resting.getActiveContacts():
        distribution.add(resting.getContact(name))
    distribution.solve(resting.ne_b(), G * resting.getMass())
    margin, expected = resting.computeWrenchMargin(), distribution.computeMargin()
    assert isinstance(margin, dynacom.WrenchMargin)
    assert margin.margin == pytest.approx(expected.margin, rel=1e-12)
    assert (margin.axis, margin.sign) == (expected.axis, expected.sign)
    assert isinstance(margin.margin, float)
    assert 0.0 < margin.margin < G * resting.getMass()
    # A lean of the centre of mass takes of it.
    force, torque = np.split(resting.ne_b(), 2)
    resting.distributeForce(force, torque, resting.getCoM() + [0.05, 0.0, 0.0])
    assert resting.computeWrenchMargin().margin < margin.margin


# Talos at rest.


def half_sitting(talos: Robot) -> np.ndarray:
    """The SRDF's posture, lowered onto the ground."""
    q = reference_configuration(talos.model, "talos_data/srdf/talos.srdf", "half_sitting")
    robot = talos.dynacom()
    zero = np.zeros(talos.model.nv)
    robot.computeDynamics(q, zero, zero)
    q[2] -= robot.getContact("left_sole").getPose().translation[2]
    return q


@pytest.fixture(params=["half sitting", "standing"])
def resting(request, talos: Robot, talos_standing: np.ndarray) -> DynaCoM:
    robot = talos.dynacom()
    zero = np.zeros(talos.model.nv)
    q = talos_standing if request.param == "standing" else half_sitting(talos)
    robot.computeDynamics(q, zero, zero)
    assert distribute(robot) == SOLVED
    return robot


def test_weight_at_rest(resting):
    weight = G * resting.getMass()
    assert 80.0 < resting.getMass() < 100.0
    assert_allclose(resting.getGroundCoMForce(), [0, 0, weight], rtol=0, atol=1e-12 * weight)
    assert_allclose(resting.getGroundCoMTorque(), np.zeros(3), rtol=0, atol=1e-12 * weight)
    assert_allclose(resting.getCoP(), resting.getCoM()[:2], rtol=0, atol=1e-15)
    assert_gives_wrench(resting, 1e-9 * weight)
    total = sum(resting.getContact(name).toWorldForces() for name in ("left_sole", "right_sole"))
    assert_allclose(total[:3], [0, 0, weight], rtol=0, atol=1e-9 * weight)
    for name in ("left_sole", "right_sole"):
        assert_within_cones(resting.getContact(name), 1e-9 * weight)
        assert 0.4 * weight < resting.getContact(name).toWorldForces()[2] < 0.6 * weight


def test_feet_share_by_symmetry(resting, talos):
    """The feet stand symmetrically: about the point midway between them, so do their forces."""
    weight = G * resting.getMass()
    left, right = (resting.getContact(name) for name in ("left_sole", "right_sole"))
    middle = 0.5 * (left.getPose().translation + right.getPose().translation) + 0.9 * UP
    assert resting.distributeForce(weight * UP, np.zeros(3), middle) == SOLVED
    mirrored = right.appliedForce() * [1, -1, 1, -1, 1, -1]
    # The posture in the SRDF is symmetric to a milliradian.
    assert_allclose(left.appliedForce(), mirrored, rtol=0, atol=2e-3 * weight)
    assert_allclose(left.appliedForce()[2], 0.5 * weight, rtol=1e-3)
    # What leans to the left puts weight on the left.
    status = resting.distributeForce(weight * UP, np.zeros(3), middle + [0.0, 0.02, 0.0])
    assert status == SOLVED
    assert left.appliedForce()[2] > right.appliedForce()[2] + 1.0


@pytest.mark.parametrize("lean", [0.0, 0.02])
def test_both_centres_of_pressure_agree_on_flat_ground(talos, talos_standing, lean):
    """(6) needs the distributed forces, (5) does not; the soles lie on the ground."""
    rng = np.random.default_rng(0)
    robot = talos.dynacom()
    compared = 0
    for number in range(20):
        v, a = 0.3 * rng.standard_normal((2, talos.model.nv))
        a *= 20.0 if number % 4 == 0 else 1.0  # too much for the soles
        q = talos_standing.copy()
        q[2] += lean
        robot.setGroundHeight(lean)
        robot.computeDynamics(q, v, a)
        flat = robot.getCoP()
        robot.computeDynamics(q, v, a, flatHorizontalGround=False)
        assert robot.isCoPDefined()
        if robot.getDistributionStatus() == SOLVED:
            assert_allclose(robot.getCoP(), flat, rtol=0, atol=1e-8)
            compared += 1
        else:
            # That of what the contacts can give is beneath the soles, which the other is not.
            assert robot.getDistributionStatus() == RELAXED
            achieved = dynacom.CentroidalWrench()
            achieved.force, achieved.torque = np.split(robot.getDistribution().achieved, 2)
            expected = dynacom.computeFlatGroundCoP(achieved, robot.getCoM(), lean)
            assert_allclose(robot.getCoP(), expected, rtol=0, atol=1e-8)
    assert 10 <= compared < 20


def test_centre_of_the_pressures_on_stairs(talos, talos_standing):
    """(6) by its definition: each sole's own centre of pressure, weighted by its vertical force."""
    q = talos_standing.copy()
    model = talos.model
    # One knee bent more: the left foot stands higher.
    for joint, angle in (("3", -0.6), ("4", 1.2), ("5", -0.6)):
        q[model.idx_qs[model.getJointId(f"leg_left_{joint}_joint")]] = angle
    zero = np.zeros(model.nv)
    robot = talos.dynacom()
    a = zero.copy()
    a[:2] = [0.3, 0.1]
    robot.computeDynamics(q, zero, a, flatHorizontalGround=False)
    assert robot.getDistributionStatus() == SOLVED
    moment, vertical = np.zeros(2), 0.0
    heights = []
    for name in robot.getActiveContacts():
        contact = robot.getContact(name)
        surface = contact.getSurfacePose()
        force = surface.rotation[2] @ contact.appliedForce()[:3]
        place = surface.act(np.append(contact.getCoP(), 0.0))
        moment += force * place[:2]
        vertical += force
        heights.append(place[2])
    assert abs(heights[0] - heights[1]) > 0.05
    assert_allclose(robot.getCoP(), moment / vertical, rtol=0, atol=1e-12)
    uneven = robot.getCoP()
    robot.computeDynamics(q, zero, a)
    assert np.abs(robot.getCoP() - uneven).max() > 1e-4


def test_uneven_ground_without_contact(humanoid):
    robot = DynaCoM(humanoid)
    q, v, a = motion(humanoid, 0)
    robot.computeDynamics(q, v, a, flatHorizontalGround=False)
    assert robot.getDistributionStatus() == DistributionStatus.NoContact
    assert np.isnan(robot.getCoP()).all()
    assert np.isfinite(robot.getGroundCoMForce()).all()


def test_urdf_of_a_real_robot(talos):
    """By its URDF or by its model, Talos is the same."""
    settings = DynaCoMSettings()
    settings.urdf = str(robots_folder() / "talos_data/robots/talos_reduced.urdf")
    robot = DynaCoM(settings)
    q, v, a = motion(talos.model, 0)
    robot.computeDynamics(q, v, a)
    expected = talos.dynacom()
    expected.computeDynamics(q, v, a)
    assert_array_equal(robot.getGroundCoMForce(), expected.getGroundCoMForce())
    assert_array_equal(robot.getAM(), expected.getAM())


# The package as a whole.

BINDINGS = [
    getattr(dynacom, name)
    for name in dynacom.__all__
    if getattr(getattr(dynacom, name), "__module__", None) == DynaCoM.__module__
]
CLASSES = [item for item in BINDINGS if inspect.isclass(item)]
CLASSES += [dynacom.MotionAnalysis.Contact, dynacom.DistributionResult.Contact]
# Of enums, what Boost.Python gives them all.
INHERITED = {"names", "values"}


def members(cls: type) -> list[tuple[str, object]]:
    return [
        (name, member)
        for name, member in vars(cls).items()
        if not name.startswith("_")
        and name not in INHERITED
        and not isinstance(member, cls)
        and not inspect.isclass(member)
    ]


def test_everything_is_exported():
    import dynacom.dynacom_pywrap as bindings

    for name, item in vars(bindings).items():
        if getattr(item, "__module__", None) == bindings.__name__ and not name.startswith("_"):
            # eigenpy adds two functions of its own.
            assert name in dynacom.__all__ or name in ("seed", "sharedMemory"), name
            assert name not in dynacom.__all__ or getattr(dynacom, name) is item


@pytest.mark.parametrize("item", BINDINGS, ids=lambda item: getattr(item, "__name__", "function"))
def test_classes_and_functions_have_docstrings(item):
    assert all(documentation(item))


@pytest.mark.parametrize(
    ("cls", "name"), [(cls, name) for cls in CLASSES for name, _ in members(cls)]
)
def test_methods_and_properties_have_docstrings(cls, name):
    """Of every overload: the signature that Boost.Python writes says nothing of units."""
    docs = documentation(vars(cls)[name])
    assert docs
    assert all(docs)


HEADERS = {
    "centroidal.hpp": (),
    "ground_plane.hpp": (None, "GroundPlane"),
    "contact_base.hpp": ("ContactBase",),
    "contact_point.hpp": ("ContactPointSettings", "ContactPoint"),
    "contact6d.hpp": ("Contact6DSettings", "Contact6D"),
    "wrench_distribution.hpp": ("DistributionResult", "WrenchDistribution"),
    "dyna_com.hpp": ("DynaCoMSettings", "DynaCoM"),
}


def header_signatures(root: Path, header: str, cls: str | None) -> dict[str, set[tuple]]:
    """Public methods or free functions: name -> overloads, each ((parameter, has default), …)."""
    text = (root / "include/dynacom" / header).read_text(encoding="utf-8")
    text = re.sub(r"//.*", "", text)
    if cls is None:
        text = "\n".join(re.findall(r"^DYNACOM_EXPORT (?!std::ostream)[^;{]*;", text, re.M))
    else:
        declaration = rf"(?:class|struct) DYNACOM_EXPORT {cls}\b[^;{{]*\{{(.*?)\n\}};"
        text = re.split(r"\n (?:protected|private):", re.search(declaration, text, re.S)[1])[0]
        text = re.sub(r"\{[^{}]*\}", ";", text)
    signatures: dict[str, set[tuple]] = {}
    pattern = r"(?<![\w~.:>])(\w+)\(((?:[^()]|\([^()]*\))*)\)\s*(?:const)?\s*(?:override)?\s*[;{=]"
    for name, parameters in re.findall(pattern, text):
        # Commas between <> do not separate parameters.
        while (flat := re.sub(r"<[^<>]*>", "", parameters)) != parameters:
            parameters = flat
        parts = [part for part in parameters.split(",") if part.strip()]
        parsed = tuple((re.findall(r"\w+", part.split("=")[0])[-1], "=" in part) for part in parts)
        signatures.setdefault(name, set()).add(parsed)
    signatures.pop(cls, None)
    return signatures


def python_signatures(function: object) -> set[tuple]:
    """The same, from what Boost.Python says of itself; methods have no self in C++."""
    overloads = set()
    for text in re.findall(r"^\w+\((.*)\) ->", function.__doc__, re.M):
        parameters = re.findall(r"\([\w.]+\)(\w+)(=?)", text)
        overloads.add(tuple((name, bool(value)) for name, value in parameters if name != "self"))
    return overloads


@pytest.mark.parametrize(
    ("header", "cls"),
    [(header, cls) for header, classes in HEADERS.items() for cls in classes or (None,)],
)
def test_names_and_parameters_are_those_of_the_headers(root, header, cls):
    """All that C++ offers is there, with the same parameters and defaults for the same of them."""
    signatures = header_signatures(root, header, cls)
    assert len(signatures) >= 2
    home = getattr(dynacom, cls) if cls else dynacom
    for name, overloads in signatures.items():
        assert python_signatures(getattr(home, name)) == overloads, name


def test_frame_name_of_two_frames():
    """Pinocchio allows one name for frames of different types: which is meant cannot be known."""
    model = pin.buildSampleModelHumanoidRandom()
    for kind in (pin.FrameType.OP_FRAME, pin.FrameType.SENSOR):
        model.addFrame(pin.Frame("twice", 1, 0, pin.SE3.Identity(), kind))
    robot = DynaCoM(model)
    settings = dynacom.ContactPointSettings()
    settings.frame_name = "twice"
    message = "contact 'foot': the model must have one frame 'twice', got 2"
    with pytest.raises(ValueError, match=message):
        robot.addContact(dynacom.ContactPoint(settings), "foot")
    assert robot.getKnownContacts() == []


def test_free_fall_asks_nothing_of_active_contacts():
    """What remains of the wrench is rounding, in whatever direction."""
    robot = dynacom.load_robot("talos").dynacom()
    model = robot.getModel()
    fall = np.zeros(model.nv)
    fall[2] = -9.81
    robot.computeDynamics(pin.neutral(model), np.zeros(model.nv), fall)
    wrench = robot.getGroundCoMForce(), robot.getGroundCoMTorque()
    assert robot.distributeForce(*wrench, robot.getCoM()) == dynacom.DistributionStatus.Solved
    assert np.abs(robot.allForces()).max() < 1e-9
