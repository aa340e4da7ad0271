# SPDX-License-Identifier: BSD-2-Clause
import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynacom
from dynacom import ContactSchedule, DynaCoM, DynacomError, Motion, read_motion
from dynacom.motion_joints import tree_orders
from helpers import CALM, WALKS
from motion_files import assert_notes, body_poses, refuses, sway

# Plain archives: t, q, v, a.


def test_reads_every_array(motion_file, talos, talos_motion):
    clip = read_motion(motion_file(), talos)
    np.testing.assert_array_equal(clip.time, talos_motion["t"])
    for name in "qva":
        np.testing.assert_array_equal(getattr(clip, name), talos_motion[name])
    assert clip.schedule.names == ["left_sole", "right_sole"]
    np.testing.assert_array_equal(clip.schedule.active, talos_motion["contacts"])
    assert clip.forces == {}
    assert len(clip.joint_names) == 32
    assert clip.notes == ()
    # The analysis takes them as they are.
    Motion(clip.time, clip.q, clip.v, clip.a).validate(talos.model)


def test_compressed_archives_and_other_numbers(tmp_path, talos, talos_motion):
    path = tmp_path / "motion.npz"
    arrays = talos_motion | {
        "t": np.arange(len(talos_motion["t"])),
        "q": np.asfortranarray(talos_motion["q"]),
        "v": talos_motion["v"].astype(np.float32),
        "a": talos_motion["a"].astype(">f8"),
    }
    np.savez_compressed(path, **arrays)
    clip = read_motion(path, talos)
    np.testing.assert_array_equal(clip.time, arrays["t"])
    for name in "qva":
        np.testing.assert_array_equal(getattr(clip, name), arrays[name])


def test_single_precision(motion_file, talos, talos_motion):
    path = motion_file(**{name: talos_motion[name].astype(np.float32) for name in "tqva"})
    clip = read_motion(path, talos)
    np.testing.assert_allclose(clip.q, talos_motion["q"], atol=1e-7)
    np.testing.assert_allclose(np.linalg.norm(clip.q[:, 3:7], axis=1), 1.0, atol=1e-15)
    assert clip.notes == ()


@pytest.mark.parametrize("missing", ["v", "a", "va"])
def test_velocities_and_accelerations_may_be_absent(motion_file, talos, talos_motion, missing):
    clip = read_motion(motion_file(**dict.fromkeys(missing)), talos)
    for name in "va":
        if name in missing:
            assert getattr(clip, name) is None
        else:
            np.testing.assert_array_equal(getattr(clip, name), talos_motion[name])


def test_other_arrays_are_left_alone(motion_file, talos):
    read_motion(motion_file(meta=np.array({"a": 1}, dtype=object), more=np.ones(3)), talos)


def test_options_that_are_of_no_use(motion_file, talos):
    clip = read_motion(motion_file(), talos, fps=50, quat="wxyz")
    assert_notes(clip, "--fps is not used", "--quat is not used")


def test_quaternions_are_checked_here_too(motion_file, talos, talos_motion):
    q = talos_motion["q"].copy()
    q[:, 3:7] = np.roll(q[:, 3:7], 1, axis=1)
    message = refuses(motion_file(q=q), talos, "must be x y z w, got w x y z")
    assert "--quat" not in message


def test_contacts_may_be_absent(motion_file, talos):
    assert read_motion(motion_file(contacts=None, contact_names=None), talos).schedule is None


@pytest.mark.parametrize("name", ["contacts", "contact_names"])
def test_contacts_and_their_names_come_together(motion_file, talos, name):
    refuses(motion_file(**{name: None}), talos, f"missing array '{name}'")


@pytest.mark.parametrize("dtype", [float, np.float32, int])
def test_masks_of_zeros_and_ones(motion_file, talos, dtype):
    """Numbers are as good as bool, and say no more."""
    masks = np.arange(80).reshape(40, 2) % 3 == 0
    clip = read_motion(motion_file(contacts=masks.astype(dtype)), talos)
    np.testing.assert_array_equal(clip.schedule.active, masks)
    assert clip.schedule.confidence is None


def test_masks_of_fractions(motion_file, talos):
    """A contact is active from one half on; the fraction is how sure that is."""
    masks = np.linspace(0.0, 1.0, 80).reshape(40, 2)
    masks[0] = 0.5, 0.4999
    clip = read_motion(motion_file(contacts=masks), talos)
    np.testing.assert_array_equal(clip.schedule.active, masks >= 0.5)
    assert clip.schedule.active[0].tolist() == [True, False]
    np.testing.assert_array_equal(clip.schedule.confidence, masks)


def test_missing_arrays(motion_file, talos):
    refuses(motion_file(t=None), talos, "missing array 't', got q, v, a, contacts, contact_names")
    refuses(motion_file(q=None), talos, "missing array 'q', got t, v, a, contacts, contact_names")


@pytest.mark.parametrize("content", [b"", b"time,q\n0,1\n", b"\x80\x04K\x01."])
def test_other_files(tmp_path, talos, content):
    path = tmp_path / "motion.npz"
    path.write_bytes(content)
    refuses(path, talos, "must be a NumPy archive (.npz), got another file")


def test_single_array(tmp_path, talos):
    path = tmp_path / "motion.npz"
    with path.open("wb") as file:
        np.save(file, np.ones(3))
    refuses(path, talos, "must be a NumPy archive (.npz), got a single array")


def test_empty_archive(tmp_path, talos):
    path = tmp_path / "motion.npz"
    np.savez(path)
    refuses(path, talos, "missing array 't', got none")


def test_pickled_array_is_not_loaded(motion_file, talos):
    path = motion_file(q=np.array([[1, "x"]], dtype=object))
    refuses(path, talos, "q cannot be read", "allow_pickle=False")


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("t", np.array(["0", "1"]), "must be of real numbers, got <U1"),
        ("q", np.ones((2, 39), dtype=complex), "must be of real numbers, got complex128"),
        ("v", np.ones((2, 38), dtype=bool), "must be of real numbers, got bool"),
        ("contacts", np.full((40, 2), "1"), "must be of bool or numbers, got <U1"),
        ("contacts", np.full((40, 2), 1.5), "must be from 0 to 1, got 1.5"),
        ("contacts", np.full((40, 2), -1), "must be from 0 to 1, got -1"),
        ("contacts", np.full((40, 2), np.nan), "must be finite, got nan in frame 0 of column 0"),
        ("contact_names", np.array([1, 2]), "must be of texts, got int64"),
        ("t", np.ones((40, 1)), "must have shape (T,), got (40, 1)"),
        ("t", np.ones(0), None),
        ("q", np.ones(39), "must have shape (40, nq), got (39,)"),
        ("q", np.ones((40, 38)), "must have 39 columns, nq of talos, got 38"),
        ("q", np.ones((39, 39)), "must have shape (40, nq), got (39, 39)"),
        ("v", np.ones((40, 39)), "must have shape (40, 38), got (40, 39)"),
        ("a", np.array(1.0), "must have shape (40, 38), got ()"),
        ("a", np.full((40, 38), np.inf), "must be finite, got inf in frame 0 of column 0"),
        ("contacts", np.ones(40, dtype=bool), "must have shape (40, 2), got (40,)"),
        ("contacts", np.ones((40, 1), dtype=bool), "must have shape (40, 2), got (40, 1)"),
        ("contact_names", np.array("left_sole"), "must have shape (names,), got ()"),
    ],
)
def test_wrong_type_or_shape(motion_file, talos, name, value, expected):
    path = motion_file(**{name: value})
    refuses(path, talos, f"{name} {expected}" if expected else "must have at least one frame")


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["left_sole", "hand"], "must be those of talos (left_sole, right_sole), got 'hand'"),
        (["left_sole", "left_sole"], "contact 'left_sole' is there 2 times"),
    ],
)
def test_wrong_contacts(motion_file, talos, names, expected):
    refuses(motion_file(contact_names=np.array(names)), talos, expected)


@CALM
@given(cut=st.integers(min_value=0, max_value=3000), flip=st.binary(min_size=1, max_size=8))
def test_damaged_files_give_one_line(tmp_path_factory, toy, cut, flip):
    path = tmp_path_factory.mktemp("damaged") / "motion.npz"
    motion = sway(toy, 3)
    np.savez_compressed(
        path,
        t=motion.time,
        q=motion.q,
        v=np.ones((3, 11)),
        contacts=np.ones((3, 1), dtype=bool),
        contact_names=np.array(["foot"]),
    )
    content = path.read_bytes()
    cut %= len(content)
    path.write_bytes(content[:cut] + flip + content[cut + len(flip) :])
    try:
        read_motion(path, toy)
    except DynacomError as error:
        assert re.match(r"[^\n]*motion\.npz: [^\n]+$", str(error))


# Contact forces of plain archives.


@pytest.mark.parametrize(
    ("walk", "robot"),
    [("talos_walk", "talos"), ("anymal_walk", "anymal_c"), ("anymal_trot", "anymal_c")],
)
def test_planned_forces_of_the_bundled_walks(walk, robot):
    """In the surfaces' frames they add up to what the ground must give."""
    subject = dynacom.load_robot(robot)
    clip = read_motion(WALKS / f"{walk}.npz", subject)
    assert clip.notes == ()
    assert list(clip.forces) == list(subject.contacts)
    motion = Motion(clip.time, clip.q, clip.v, clip.a)
    analysis = dynacom.analyzeMotion(subject.dynacom(), motion, clip.schedule)
    dynamics = subject.dynacom()
    for frame in range(0, len(clip.time), 10):
        dynamics.computeDynamics(clip.q[frame], clip.v[frame], clip.a[frame])
        total = sum(
            dynamics.getContact(name).getSurfacePose().rotation @ force[frame, :3]
            for name, force in clip.forces.items()
        )
        np.testing.assert_allclose(total, analysis.ground_force[frame], atol=1e-6)
    for name, active in zip(clip.schedule.names, clip.schedule.active.T, strict=True):
        assert (clip.forces[name][~active] == 0.0).all()
        assert (clip.forces[name][active, 2] > 0.0).all()


@pytest.fixture
def with_wrenches(tmp_path, toy):
    """Writes the toy's motion with random wrenches on both contacts."""

    def write(frames, wrenches=None, **changes):
        motion = sway(toy)
        rng = np.random.default_rng(0)
        if wrenches is None:
            wrenches = rng.standard_normal((90, 2, 6))
        arrays = {
            "t": motion.time,
            "q": motion.q,
            "contacts": np.ones((90, 2), dtype=bool),
            "contact_names": np.array(["pad", "foot"]),
            "contact_wrenches": wrenches,
        } | changes
        if frames:
            arrays["contact_frames"] = np.array(frames)
        path = tmp_path / "clip.npz"
        np.savez(path, **arrays)
        return path, arrays["contact_wrenches"]

    return write


def frame_pose(robot, q, frame):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return data.oMf[robot.model.getFrameId(frame)]


def test_forces_in_the_contacts_own_frames(with_wrenches, toy):
    path, wrenches = with_wrenches(None)
    clip = read_motion(path, toy)
    np.testing.assert_array_equal(clip.forces["pad"], wrenches[:, 0])
    # The axes of the foot's surface are the world's.
    for frame in (0, 50):
        rotation = frame_pose(toy, clip.q[frame], "tip").rotation
        expected = rotation @ wrenches[frame, 1, :3]
        np.testing.assert_allclose(clip.forces["foot"][frame], expected, atol=1e-12)


def test_forces_in_other_frames_of_the_same_body(with_wrenches, toy):
    """The link above the pad's frame, and the pad's for the foot."""
    path, wrenches = with_wrenches(["lower", "pad_contact"])
    clip = read_motion(path, toy)
    assert clip.notes == ()
    for frame in (0, 50):
        world = {
            name: frame_pose(toy, clip.q[frame], name) for name in ("lower", "pad_contact", "tip")
        }
        expected = world["pad_contact"].actInv(world["lower"].act(pin.Force(wrenches[frame, 0])))
        np.testing.assert_allclose(clip.forces["pad"][frame], expected.vector, atol=1e-12)
        expected = world["pad_contact"].rotation @ wrenches[frame, 1, :3]
        np.testing.assert_allclose(clip.forces["foot"][frame], expected, atol=1e-12)


def test_forces_of_points_with_axes_of_their_own(with_wrenches, toy):
    settings = dynacom.ContactPointSettings()
    settings.frame_name, settings.mu = "tip", 0.5
    robot = replace(toy, contacts=dict(toy.contacts) | {"foot": settings})
    path, wrenches = with_wrenches(["pad_contact", "tip"])
    clip = read_motion(path, robot)
    np.testing.assert_array_equal(clip.forces["foot"], wrenches[:, 1, :3])


def test_forces_in_frames_that_do_not_fit(with_wrenches, toy):
    path, wrenches = with_wrenches(["wheel", "hand"])
    clip = read_motion(path, toy)
    assert clip.forces == {}
    assert_notes(
        clip,
        "The forces of pad are left out: they are in 'wheel', which does not move with",
        "The forces of foot are left out: they are in 'hand', no frame",
    )


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"contact_wrenches": np.ones((90, 2, 3))}, "must have shape (90, 2, 6), got (90, 2, 3)"),
        (
            {"contact_wrenches": np.full((90, 2, 6), np.nan)},
            "must be finite, got nan in frame 0 of",
        ),
        ({"contact_frames": np.array(["tip"])}, "contact_frames must have shape (2,), got (1,)"),
        ({"contact_frames": np.array([1, 2])}, "contact_frames must be of texts"),
    ],
)
def test_wrong_forces(with_wrenches, toy, changes, expected):
    path, _ = with_wrenches(None, **changes)
    refuses(path, toy, expected)


# whole_body_tracking.


TOY_LINKS = ["body", "upper", "lower", "wheel", "slider", "toe"]


@pytest.fixture
def tracking(tmp_path, toy):
    """Writes the toy's motion in that layout, with arrays replaced or added, or dropped."""

    def write(**changes):
        motion = sway(toy)
        position, quaternion = body_poses(toy, motion.q, TOY_LINKS)
        arrays = {
            "fps": np.array([60]),
            "joint_pos": motion.angles,
            "body_pos_w": position,
            "body_quat_w": quaternion,
        } | changes
        path = tmp_path / "clip.npz"
        np.savez(path, **{key: value for key, value in arrays.items() if value is not None})
        return path

    return write


def with_root(motion):
    return np.hstack([motion.position, np.roll(motion.quaternion, 1, axis=1), motion.angles])


def test_tracking(tracking, toy):
    motion = sway(toy)
    clip = read_motion(tracking(), toy)
    np.testing.assert_array_equal(clip.time, motion.time)
    np.testing.assert_allclose(clip.q, motion.q, atol=1e-12)
    assert clip.v is clip.a is clip.schedule is None
    assert_notes(clip, "their order is the order of the URDF", "within")


def test_tracking_in_single_precision_and_breadth_first(tracking, toy):
    motion = sway(toy)
    order = tree_orders(toy)["breadth first"]
    angles = motion.angles[:, [motion.names.index(name) for name in order]]
    position, quaternion = body_poses(toy, motion.q, TOY_LINKS)
    path = tracking(
        joint_pos=angles.astype(np.float32),
        body_pos_w=position.astype(np.float32),
        body_quat_w=quaternion.astype(np.float32),
    )
    clip = read_motion(path, toy)
    np.testing.assert_allclose(clip.q, motion.q, atol=1e-6)
    assert_notes(clip, "their order is breadth first", "within")


@pytest.mark.parametrize("bodies", [True, False])
def test_tracking_with_names_of_joints(tracking, toy, bodies):
    motion = sway(toy)
    changes = {"joint_pos": motion.angles[:, ::-1], "joint_names": np.array(motion.names[::-1])}
    clip = read_motion(tracking(**changes), toy)
    np.testing.assert_allclose(clip.q, motion.q, atol=1e-12)
    assert_notes(clip, "within")


def test_tracking_with_some_joints_and_some_others(tracking, toy):
    motion = sway(toy)
    rng = np.random.default_rng(0)
    more = np.hstack([rng.uniform(-3.0, 3.0, (90, 1)), motion.angles])
    names = np.array(["finger", *motion.names])
    clip = read_motion(tracking(joint_pos=more, joint_names=names), toy)
    np.testing.assert_allclose(clip.q, motion.q, atol=1e-12)
    assert_notes(clip, "no such joints: finger", "within")
    some = {"joint_pos": motion.angles[:, 1:4], "joint_names": np.array(motion.names[1:4])}
    clip = read_motion(tracking(**some), toy)
    assert clip.joint_names == ("a_slide", "c_wheel", "m_hip")
    assert_notes(clip, "within", "not give 2 of 5 joints")
    both = {"joint_pos": more[:, :4], "joint_names": names[:4]}
    refuses(tracking(**both), toy, "the joints of toy, got finger, and nothing for a_slide, b_toe")


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("bodies", [True, False])
def test_tracking_with_the_root_among_the_joints(tracking, toy, named, bodies):
    motion = sway(toy)
    changes = {"joint_pos": with_root(motion)}
    if named:
        changes["joint_names"] = np.array(motion.names)
    if not bodies:
        changes |= {"body_pos_w": None, "body_quat_w": None}
    clip = read_motion(tracking(**changes), toy)
    np.testing.assert_allclose(clip.q, motion.q, atol=1e-12)
    about_order = [] if named else ["the order of the URDF"]
    assert_notes(clip, *about_order, *(["within"] if bodies else []))


def test_tracking_with_the_root_among_other_bodies(tracking, toy):
    """By its name it is found wherever it is."""
    motion = sway(toy)
    position, quaternion = body_poses(toy, motion.q, TOY_LINKS[::-1])
    changes = {"body_pos_w": position, "body_quat_w": quaternion}
    names = np.array(TOY_LINKS[::-1])
    clip = read_motion(tracking(**changes, body_names=names), toy)
    np.testing.assert_allclose(clip.q, motion.q, atol=1e-12)
    refuses(tracking(**changes), toy, "is it this robot's clip?")


def test_tracking_with_other_quaternions(tracking, toy):
    motion = sway(toy)
    _, quaternion = body_poses(toy, motion.q, TOY_LINKS)
    path = tracking(body_quat_w=np.roll(quaternion, -1, axis=2))
    refuses(path, toy, "must be w x y z, got x y z w", "give --quat xyzw")
    np.testing.assert_allclose(read_motion(path, toy, quat="xyzw").q, motion.q, atol=1e-12)


def test_frame_rate_of_tracking(tracking, toy):
    assert read_motion(tracking(fps=np.array(50.0)), toy).time[1] == 0.02
    clip = read_motion(tracking(), toy, fps=30)
    assert clip.time[1] == 1 / 30
    assert "The file says 60 frames per second; --fps 30 counts." in clip.notes
    path = tracking(fps=None)
    refuses(path, toy, "give --fps")
    assert read_motion(path, toy, fps=30).time[1] == 1 / 30


def test_velocities_of_tracking(tracking, toy):
    """As in Pinocchio: they are those that the positions show."""
    motion = sway(toy)
    model = toy.model
    v = np.array(
        [pin.difference(model, a, b) for a, b in zip(motion.q, motion.q[1:], strict=False)]
    )
    v = 60.0 * np.vstack([v, v[-1:]])
    q = motion.q
    world = np.array([frame_pose(toy, row, "body").rotation for row in q])
    rng = np.random.default_rng(0)
    linear, angular = rng.standard_normal((2, 90, 6, 3))
    linear[:, 0] = np.einsum("tij,tj->ti", world, v[:, :3])
    angular[:, 0] = np.einsum("tij,tj->ti", world, v[:, 3:6])
    index = [model.joints[model.getJointId(name)].idx_v for name in motion.names]
    velocities = {"body_lin_vel_w": linear, "body_ang_vel_w": angular, "joint_vel": v[:, index]}
    clip = read_motion(tracking(**velocities), toy)
    np.testing.assert_allclose(clip.v, v, atol=1e-9)
    assert clip.a is None
    # With the root's before them, which then count.
    root = np.hstack([linear[:, 0], angular[:, 0]])
    both = {"joint_pos": with_root(motion), "joint_vel": np.hstack([root, v[:, index]])}
    for others in (velocities, dict.fromkeys(velocities)):
        clip = read_motion(tracking(**(others | both)), toy)
        np.testing.assert_allclose(clip.v, v, atol=1e-9)
    # By name, some only.
    some = {
        "joint_pos": motion.angles[:, [3, 0]],
        "joint_vel": v[:, index][:, [3, 0]],
        "joint_names": np.array(motion.names)[[3, 0]],
    }
    clip = read_motion(tracking(**(velocities | some)), toy)
    known = [*range(6), index[0], index[3]]
    np.testing.assert_allclose(clip.v[:, known], v[:, known], atol=1e-9)
    assert (np.delete(clip.v, known, axis=1) == 0.0).all()
    for missing in velocities:
        assert read_motion(tracking(**(velocities | {missing: None})), toy).v is None


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"body_pos_w": None}, "missing array 'body_pos_w'"),
        ({"body_quat_w": None}, "missing array 'body_quat_w'"),
        ({"body_pos_w": np.ones((90, 3))}, "body_pos_w must have shape (90, B, 3), got (90, 3)"),
        ({"body_pos_w": np.ones((90, 0, 3))}, "body_pos_w must have at least one body"),
        ({"body_quat_w": np.ones((90, 5, 4))}, "body_quat_w must have shape (90, 6, 4), got"),
        (
            {"body_quat_w": np.zeros((90, 6, 4))},
            "body_quat_w must have norm 1, got 0 in frame 0 of",
        ),
        ({"body_names": np.array(["body"])}, "body_names must have shape (6,), got (1,)"),
        ({"joint_pos": np.ones(90)}, "joint_pos must have shape (T, n), got (90,)"),
        ({"joint_pos": np.ones((90, 3))}, "must have 4 or 5 joints, as toy does, got 3"),
        ({"joint_pos": np.ones((0, 5))}, "must have at least one frame"),
        ({"joint_pos": np.full((90, 5), np.nan)}, "joint_pos must be finite, got nan in frame 0"),
        (
            {"joint_names": np.array(["m_hip"])},
            "joint_names must name the 5 columns of joint_pos, or all but the root's 7, got 1",
        ),
        ({"fps": np.array([50, 60])}, "fps must be one number, got shape (2,)"),
        ({"fps": np.array(["50"])}, "fps must be of real numbers"),
        ({"fps": np.array([0.0])}, "fps must be finite and > 0 Hz, got 0"),
        (
            {
                "joint_vel": np.ones((90, 6)),
                "body_lin_vel_w": np.ones((90, 6, 3)),
                "body_ang_vel_w": np.ones((90, 6, 3)),
            },
            "joint_vel must have 5 or 6 + 5 columns, got 6",
        ),
    ],
)
def test_wrong_tracking(tracking, toy, changes, expected):
    refuses(tracking(**changes), toy, expected)


def test_another_robots_tracking(tracking, toy, talos):
    position, quaternion = body_poses(toy, sway(toy).q, TOY_LINKS)
    position[:, 5] += [0.0, 0.0, 0.1]
    path = tracking(body_pos_w=position)
    refuses(path, toy, "no order of the joints does; ", "toe 0.1 m away: is it this robot's clip?")
    refuses(path, talos, "must have 32 joints, as talos does, got 5")
    path = tracking(body_pos_w=position, joint_names=np.array(sway(toy).names))
    refuses(path, toy, "the file's joints put toe 0.1 m away: is it this robot's clip?")


def test_tracking_in_degrees(tracking, toy):
    motion = sway(toy)
    degrees = np.where(
        np.array(motion.names) == "a_slide", motion.angles, np.rad2deg(motion.angles)
    )
    refuses(tracking(joint_pos=degrees), toy, "must be in radians, got degrees")
    names = np.array(motion.names)
    refuses(tracking(joint_pos=degrees, joint_names=names), toy, "got degrees: b_toe")


def test_analysis_of_what_was_read(motion_file, talos):
    clip = read_motion(motion_file(), talos)
    assert isinstance(clip.schedule, ContactSchedule)
    motion = Motion(clip.time, clip.q, clip.v, clip.a)
    dynamics = talos.dynacom()
    assert isinstance(dynamics, DynaCoM)
    analysis = dynacom.analyzeMotion(dynamics, motion, clip.schedule)
    assert len(analysis.status) == 40
