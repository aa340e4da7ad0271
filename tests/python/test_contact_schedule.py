# SPDX-License-Identifier: BSD-2-Clause
"""How contacts move, and schedules of when they are active."""

import copy
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import dynacom
from dynacom import (
    ContactMotion,
    ContactSchedule,
    DynaCoM,
    Motion,
    NotReadyError,
    computeContactMotions,
)
from helpers import WALKS, documentation, point, random_configuration, random_tree, sole

RATE = 128.0


@pytest.fixture(scope="module")
def puppet() -> DynaCoM:
    """Two feet, left and right, that go wherever they are put."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    model.appendBodyToJoint(1, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    for name in ("left", "right"):
        joint = model.addJoint(1, pin.JointModelTranslation(), pin.SE3.Identity(), name)
        model.addFrame(pin.Frame(f"{name}_foot", joint, pin.SE3.Identity(), pin.OP_FRAME))
    robot = DynaCoM(model)
    for name in ("left", "right"):
        robot.addContact(point(frame_name=f"{name}_foot", mu=0.5), name)
    return robot


def walk(
    puppet: DynaCoM, left: np.ndarray, right: np.ndarray | None = None, rate: float = RATE
) -> tuple[list[ContactMotion], np.ndarray]:
    """Feet of which (T, 2) heights and speeds along the ground are given; by default the right one
    is in the air all the time, and fast."""
    frames = len(left)
    if right is None:
        right = np.tile([1.0, 5.0], (frames, 1))
    q, v = np.zeros((frames, 13)), np.zeros((frames, 12))
    q[:, 6] = 1.0
    q[:, 9], v[:, 7] = left.T
    q[:, 12], v[:, 10] = right.T
    time = np.arange(frames) / rate
    return computeContactMotions(puppet, Motion(time, q, v, 0.0 * v)), time


def foot(*parts: tuple[int, float, float]) -> np.ndarray:
    """(frames, height, speed), one after the other."""
    return np.array([row for frames, *row in parts for _ in range(frames)])


# Contacts' motions.


@pytest.mark.parametrize("seed", range(4))
def test_contacts_are_where_pinocchio_says(seed):
    """The surface, its lowest corner, and how that moves, as a point of the robot."""
    model = random_tree(seed)
    robot = DynaCoM(model)
    frames = [frame.name for frame in model.frames if frame.type == pin.OP_FRAME]
    robot.addContact(sole(frame_name=frames[-1], half_length=0.2, half_width=0.1), "sole")
    robot.addContact(point(frame_name=frames[0], world_aligned=True, radius=0.3), "ball")
    robot.addContact(point(frame_name=frames[1], radius=0.2), "tip")
    rng = np.random.default_rng(seed)
    q = np.array([random_configuration(model, seed + number) for number in range(6)])
    v = rng.standard_normal((6, model.nv))
    motion = Motion(np.arange(6.0), q, v, 0.0 * v)
    contacts = computeContactMotions(robot, motion)
    assert [contact.name for contact in contacts] == robot.getKnownContacts()
    data = model.createData()
    step = 1e-6
    for contact in contacts:
        assert contact.position.shape == contact.velocity.shape == (6, 3)
        assert contact.rotation.shape == (6, 4)
        assert contact.height.shape == (6,)
        settings = robot.getContact(contact.name).getSettings()
        size = np.zeros(2)
        if contact.name == "sole":
            size = np.array([settings.half_length, settings.half_width])
        radius = getattr(settings, "radius", 0.0)
        frame_id = model.getFrameId(settings.frame_name)
        for k in range(6):
            placed = []
            for configuration in (q[k], pin.integrate(model, q[k], step * v[k])):
                pin.framesForwardKinematics(model, data, configuration)
                placed.append(data.oMf[frame_id].copy())
            turned = np.eye(3) if contact.name == "ball" else placed[0].rotation
            surface = pin.SE3(turned, placed[0].translation) * pin.SE3(
                np.eye(3), np.array([0.0, 0.0, -radius])
            )
            assert_allclose(contact.position[k], surface.translation, rtol=0, atol=1e-12)
            rotation = pin.Quaternion(contact.rotation[k]).matrix()
            assert_allclose(rotation, surface.rotation, rtol=0, atol=1e-12)
            corners = [
                surface.act(np.array([x * size[0], y * size[1], 0.0]))
                for x in (-1, 1)
                for y in (-1, 1)
            ]
            lowest = min(corners, key=lambda corner: corner[2])
            assert contact.height[k] == pytest.approx(lowest[2], abs=1e-12)
            after = placed[1].act(placed[0].actInv(lowest))
            assert_allclose(contact.velocity[k], (after - lowest) / step, rtol=0, atol=1e-4)


def test_a_measured_pose_says_nothing_of_other_frames(puppet):
    robot = puppet.copy()
    robot.setContactPose("left", pin.SE3(np.eye(3), np.ones(3)))
    contacts, _ = walk(robot, foot((5, 0.3, 0.0)))
    assert_array_equal(contacts[0].height, np.full(5, 0.3))
    assert_array_equal(robot.getContact("left").getPose().translation, np.ones(3))


def test_contact_motions_as_objects(puppet):
    (left, _), _ = walk(puppet, foot((3, 0.1, 0.2)))
    assert repr(left) == "ContactMotion(name='left', frames=3)"
    other = copy.deepcopy(left)
    left.height[:] = 9.0
    assert_array_equal(left.height, np.full(3, 0.1))
    assert_array_equal(other.height, left.height)
    with pytest.raises(AttributeError):
        left.height = np.zeros(3)
    with pytest.raises(RuntimeError, match="cannot be instantiated"):
        ContactMotion()


def test_motions_that_are_not_valid(puppet):
    motion = Motion(np.arange(3.0), np.zeros((3, 13)), np.zeros((3, 12)), np.zeros((3, 12)))
    with pytest.raises(ValueError, match="q must have quaternions of norm 1"):
        computeContactMotions(puppet, motion)
    with pytest.raises(NotReadyError, match=r"before initialize\(\)"):
        computeContactMotions(DynaCoM(), motion)
    with pytest.raises(TypeError):
        computeContactMotions(puppet, np.zeros((3, 13)))


# Schedules.


def test_a_schedule(puppet):
    active = np.array([[True, False], [True, True], [False, True]])
    schedule = ContactSchedule(["left", "right"], active)
    assert schedule.names == ["left", "right"]
    assert_array_equal(schedule.active, active)
    assert schedule.active.dtype == bool
    assert schedule.confidence is None
    assert schedule.readiness is None
    assert repr(schedule) == "ContactSchedule(frames=3, names=['left', 'right'])"
    numbers = np.linspace(0.1, 1.0, 6).reshape(3, 2)
    full = ContactSchedule(["left", "right"], active, confidence=numbers, readiness=numbers[::-1])
    assert_array_equal(full.confidence, numbers)
    assert_array_equal(full.readiness, numbers[::-1])
    other = copy.deepcopy(full)
    assert_array_equal(other.confidence, numbers)
    full.validate(3)
    with pytest.raises(TypeError, match="several names, got one text"):
        ContactSchedule("ab", active)


@pytest.mark.parametrize(
    ("names", "arrays", "message"),
    [
        (["left", "left"], {}, "names the contact 'left' twice"),
        (["left"], {}, "active must have 1 contacts, got 2"),
        (["left", "right"], {"active": np.ones((4, 2), dtype=bool)}, "active must have 3 frames"),
        (["left", "right"], {"confidence": np.ones((3, 1))}, "confidence must have 2 contacts"),
        (["left", "right"], {"readiness": np.ones((2, 2))}, "readiness must have 3 frames"),
        (
            ["left", "right"],
            {"confidence": np.full((3, 2), 1.5)},
            "confidence must be >= 0 and <= 1, got 1.5 in frame 0",
        ),
        (
            ["left", "right"],
            {"readiness": np.zeros((3, 2))},
            "readiness must be > 0 and <= 1, got 0 in frame 0",
        ),
        (
            ["left", "right"],
            {"readiness": np.array([[1.0, 1.0], [1.0, np.nan], [1.0, 1.0]])},
            "readiness must be > 0 and <= 1, got nan in frame 1",
        ),
    ],
)
def test_schedules_that_are_not_valid(names, arrays, message):
    schedule = ContactSchedule(names, **({"active": np.ones((3, 2), dtype=bool)} | arrays))
    with pytest.raises(ValueError, match=message):
        schedule.validate(3)


@pytest.mark.parametrize(
    "function", [computeContactMotions, dynacom.splitContacts, dynacom.inferContacts]
)
def test_documentation(function):
    (text,) = documentation(function)
    assert len(text.splitlines()) >= 2


# The motions in examples/data.


@pytest.mark.parametrize(
    ("name", "robot"),
    [("talos_walk", "talos"), ("anymal_walk", "anymal_c"), ("anymal_trot", "anymal_c")],
)
def test_the_schedule_found_is_the_one_planned(name, robot):
    """Within two frames at every landing and every lift-off, and none more or less of them."""
    robot = dynacom.load_robot(robot)
    clip = dynacom.read_motion(WALKS / f"{name}.npz", robot)
    report = dynacom.analyze(replace(clip, v=None, a=None, schedule=None), robot)
    # They were planned with contacts at other points of the feet, a little off these.
    assert_allclose([*report.summary["ground"].values()], 0.0, rtol=0, atol=0.002)
    schedule = report.schedule
    assert schedule.names == clip.schedule.names == list(robot.contacts)
    changes = 0
    for active, planned in zip(schedule.active.T, clip.schedule.active.T, strict=True):
        assert active[0] == planned[0] and active[-1] == planned[-1]
        for direction in (-1, 1):
            found, expected = (
                np.flatnonzero(np.diff(values.astype(int)) == direction)
                for values in (active, planned)
            )
            assert len(found) == len(expected)
            assert np.abs(found - expected).max() <= 2
            changes += len(found)
    assert changes >= 12
