# SPDX-License-Identifier: BSD-2-Clause
"""How contacts move, where the ground is, and when they touch it."""

import copy

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import dynacom
from dynacom import (
    ContactMotion,
    ContactSchedule,
    DetectionSettings,
    DynaCoM,
    Motion,
    NotReadyError,
    computeContactMotions,
    detectContacts,
    estimateGround,
)
from helpers import WALKS, documentation, point, random_configuration, random_tree, sole

RATE = 128.0  # so that durations are exact
FIELDS = (
    "height",
    "speed",
    "release_height",
    "release_speed",
    "rest_speed",
    "minimal_duration",
    "ground_height",
    "same_ground",
)


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


def settings(**fields: float) -> DetectionSettings:
    result = DetectionSettings()
    for name, value in fields.items():
        setattr(result, name, value)
    return result


def found(puppet: DynaCoM, left: np.ndarray, **fields: float) -> str:
    """When the left foot touches the ground at zero: dots and hashes."""
    contacts, time = walk(puppet, left)
    schedule = detectContacts(contacts, time, np.zeros(2), settings(**fields))
    assert schedule.names == ["left", "right"]
    assert not schedule.active[:, 1].any()
    return "".join(".#"[int(active)] for active in schedule.active[:, 0])


def ground(puppet: DynaCoM, *feet: np.ndarray, **fields: float) -> list[float]:
    contacts, time = walk(puppet, *feet)
    return estimateGround(contacts, time, settings(**fields)).tolist()


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


# Detection.


def test_low_and_slow_begins_high_or_fast_ends(puppet):
    """With hysteresis: in between, it is as it was."""
    fields = {
        "height": 0.01,
        "release_height": 0.03,
        "speed": 0.2,
        "release_speed": 0.4,
        "minimal_duration": 0.0,
        "rest_speed": 1.0,
    }
    for edge, low, high in ((0, 0.01, 0.03), (1, 0.2, 0.4)):
        values = [high + 0.001, high, low + 0.001, low, low + 0.001, high, high + 0.001, high]
        feet = np.zeros((len(values), 2))
        feet[:, edge] = values
        assert found(puppet, feet, **fields) == "...###..", edge


def test_heights_are_those_above_the_ground(puppet):
    contacts, time = walk(puppet, foot((20, 0.5, 0.0)), foot((20, -0.2, 0.0)))
    for heights, expected in (
        ([0.5, -0.2], [True, True]),
        ([0.0, 0.0], [False, True]),
        ([0.5, -0.3], [True, False]),
    ):
        schedule = detectContacts(contacts, time, np.array(heights))
        assert_array_equal(schedule.active, np.tile(expected, (20, 1)))


def test_contacts_that_are_too_short_are_none(puppet):
    """So are interruptions; at the ends of the motion nobody knows how long they are."""
    up, down = (0.1, 0.0), (0.0, 0.0)
    kwargs = {"minimal_duration": 10.0 / RATE}
    left = foot((3, *down), (20, *up), (9, *down), (20, *up), (10, *down), (20, *up))
    expected = "###" + 20 * "." + 9 * "." + 20 * "." + 10 * "#" + 20 * "."
    assert found(puppet, left, **kwargs) == expected
    left = foot((3, *up), (20, *down), (9, *up), (20, *down), (10, *up), (20, *down), (3, *up))
    expected = "..." + 49 * "#" + 10 * "." + 20 * "#" + "..."
    assert found(puppet, left, **kwargs) == expected
    assert found(puppet, left, minimal_duration=0.0).count(".") == 25


def test_contacts_are_cut_back_to_rest(puppet):
    """Where the foot lands or leaves it is low and slow, but not at rest; not where it slides."""
    landing = foot((10, 0.1, 1.0), (4, 0.01, 0.2), (30, 0.0, 0.02), (3, 0.01, 0.15), (10, 0.1, 1.0))
    assert found(puppet, landing) == 14 * "." + 30 * "#" + 13 * "."
    assert found(puppet, landing, rest_speed=0.18) == 14 * "." + 33 * "#" + 10 * "."
    assert found(puppet, landing, rest_speed=0.2) == 10 * "." + 37 * "#" + 10 * "."
    sliding = landing.copy()
    sliding[14:44, 1] = 0.07
    assert found(puppet, sliding) == 10 * "." + 37 * "#" + 10 * "."
    # At the ends of the motion it is not cut: nobody knows what was before.
    assert found(puppet, landing[10:47]) == 37 * "#"


def test_steps_in_time_need_not_be_even(puppet):
    left = foot((10, 0.1, 0.0), (5, 0.0, 0.0), (10, 0.1, 0.0))
    contacts, time = walk(puppet, left)
    assert not detectContacts(contacts, time, np.zeros(2)).active.any()
    time[12:] += 0.07
    assert_array_equal(detectContacts(contacts, time, np.zeros(2)).active[:, 0], left[:, 0] == 0.0)


def test_a_single_frame(puppet):
    contacts, time = walk(puppet, foot((1, 0.0, 0.0)))
    schedule = detectContacts(contacts, time, np.zeros(2))
    assert_array_equal(schedule.active, [[True, False]])
    assert estimateGround(contacts, time).tolist() == [0.0, 0.0]


# The ground.


def test_the_ground_is_where_the_contact_is_slow(puppet):
    """A low percentile: a few frames that lie lower, or fast ones, do not matter."""
    left = foot((3, -0.5, 0.0), (100, 0.02, 0.1), (100, 0.03, 0.0), (500, -0.1, 2.0))
    assert ground(puppet, left)[0] == 0.02
    assert ground(puppet, left, speed=3.0, release_speed=3.0)[0] == -0.1
    heights = np.random.default_rng(0).normal(0.0, 0.004, 1000)
    level = ground(puppet, np.column_stack([heights, 0.0 * heights]))[0]
    assert level == pytest.approx(np.percentile(heights, 5.0), abs=1e-4)


def test_each_contact_has_its_ground(puppet):
    """Up to same_ground, and beyond where it stands still, as on a step."""
    low = foot((100, 0.0, 0.0))
    for height, speed, expected in (
        (0.04, 0.1, 0.04),  # lands a little off
        (0.3, 0.1, 0.0),  # slow in the air
        (0.3, 0.04, 0.3),  # stands on a step
    ):
        assert ground(puppet, low, foot((100, height, speed))) == [0.0, expected]
    assert ground(puppet, low, foot((100, 0.3, 0.1)), same_ground=0.31) == [0.0, 0.3]
    assert ground(puppet, low, foot((100, 0.04, 0.1)), same_ground=0.03) == [0.0, 0.0]
    # Still, but not for long enough.
    short = foot((50, 0.3, 0.1), (9, 0.3, 0.0), (41, 0.3, 0.1))
    assert ground(puppet, low, short) == [0.0, 0.0]
    assert ground(puppet, low, short, minimal_duration=0.06) == [0.0, 0.3]


def test_a_contact_that_is_never_slow_has_the_others_ground(puppet):
    assert ground(puppet, foot((50, 0.1, 0.0)), foot((50, 0.0, 3.0))) == [0.1, 0.1]
    # If none is, the lowest place of all.
    assert ground(puppet, foot((50, 0.4, 3.0)), foot((49, 0.3, 3.0), (1, 0.2, 3.0))) == [0.2, 0.2]


def test_the_ground_given(puppet):
    assert ground(puppet, foot((50, 0.1, 0.0)), ground_height=-0.7) == [-0.7, -0.7]


# Settings.


def test_defaults():
    values = {name: getattr(DetectionSettings(), name) for name in FIELDS}
    assert np.isnan(values.pop("ground_height"))
    assert values == {
        "height": 0.015,
        "speed": 0.25,
        "release_height": 0.03,
        "release_speed": 0.5,
        "rest_speed": 0.1,
        "minimal_duration": 0.1,
        "same_ground": 0.05,
    }
    assert repr(settings(ground_height=1.0)) == (
        "DetectionSettings(height=0.015, speed=0.25, release_height=0.03, release_speed=0.5, "
        "rest_speed=0.1, minimal_duration=0.1, ground_height=1, same_ground=0.05)"
    )


@pytest.mark.parametrize("field", FIELDS)
def test_settings_are_compared_and_copied(field):
    changed = settings(**{field: 0.7})
    assert changed != DetectionSettings()
    assert changed == settings(**{field: 0.7})
    for other in (copy.copy(changed), copy.deepcopy(changed), changed.copy()):
        assert other == changed
        setattr(other, field, 0.8)
        assert getattr(changed, field) == 0.7
    assert DetectionSettings() == DetectionSettings()


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("height", -0.1, "height must be finite and >= 0 m, got -0.1"),
        ("height", np.nan, "height must be finite and >= 0 m, got nan"),
        ("speed", -1.0, "speed must be finite and >= 0 m/s, got -1"),
        ("release_height", 0.01, "release_height must be finite and >= height, got 0.01"),
        ("release_height", np.inf, "release_height must be finite and >= height, got inf"),
        ("release_speed", 0.2, "release_speed must be finite and >= speed, got 0.2"),
        ("rest_speed", np.nan, "rest_speed must be finite and >= 0 m/s, got nan"),
        ("minimal_duration", -0.1, "minimal_duration must be finite and >= 0 s, got -0.1"),
        ("ground_height", -np.inf, "ground_height must be finite or NaN, got -inf"),
        ("same_ground", -1.0, "same_ground must be finite and >= 0 m, got -1"),
    ],
)
def test_settings_out_of_range(puppet, field, value, message):
    wrong = settings(**{field: value})
    contacts, time = walk(puppet, foot((5, 0.0, 0.0)))
    for call in (
        wrong.validate,
        lambda: estimateGround(contacts, time, wrong),
        lambda: detectContacts(contacts, time, np.zeros(2), wrong),
    ):
        with pytest.raises(ValueError, match=f"^DetectionSettings.{message}$"):
            call()


def test_settings_take_numbers_only():
    with pytest.raises(TypeError):
        DetectionSettings().height = "0.1"
    with pytest.raises(AttributeError, match="no attribute 'hight'"):
        DetectionSettings().hight = 0.1


# The bindings.


def test_keywords_and_defaults(puppet):
    contacts, time = walk(puppet, foot((30, 0.01, 0.0)))
    level = estimateGround(contacts=contacts, time=time, settings=DetectionSettings())
    assert level.shape == (2,)
    assert_array_equal(level, estimateGround(contacts, time))
    schedule = detectContacts(
        contacts=contacts, time=time, ground=level, settings=DetectionSettings()
    )
    assert isinstance(schedule, ContactSchedule)
    assert schedule.active.shape == (30, 2)
    assert schedule.active.dtype == bool
    assert_array_equal(schedule.active, detectContacts(tuple(contacts), time, level).active)


def test_sizes_that_differ(puppet):
    contacts, time = walk(puppet, foot((30, 0.01, 0.0)))
    for call in (
        lambda: estimateGround(contacts, time[:-1]),
        lambda: detectContacts(contacts, time[:-1], np.zeros(2)),
    ):
        with pytest.raises(ValueError, match="height must have 29 frames .*, got 30"):
            call()
    message = r"ground must have 2 heights \(one per contact\), got 1"
    with pytest.raises(ValueError, match=message):
        detectContacts(contacts, time, np.zeros(1))
    for wrong in (None, 3, [1, 2], ["left"]):
        with pytest.raises(TypeError):
            detectContacts(wrong, time, np.zeros(2))


def test_no_contacts():
    time = np.arange(4.0)
    assert estimateGround([], time).shape == (0,)
    schedule = detectContacts([], time, np.zeros(0))
    assert schedule.names == []
    assert schedule.active.shape == (4, 0)


@pytest.mark.parametrize("function", [computeContactMotions, estimateGround, detectContacts])
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
    motion = Motion(clip.time, clip.q, clip.v, clip.a)
    contacts = computeContactMotions(robot.dynacom(), motion)
    level = estimateGround(contacts, clip.time)
    # They were planned with contacts at other points of the feet, a little off these.
    assert_allclose(level, 0.0, rtol=0, atol=0.002)
    schedule = detectContacts(contacts, clip.time, level)
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
