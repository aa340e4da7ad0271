# SPDX-License-Identifier: BSD-2-Clause
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dynacom import DynacomError
from dynacom.motion_bodies import LEVER, check_bodies, find_order, root_link, sample_bodies
from dynacom.motion_joints import configurations, tree_orders, urdf_order
from motion_files import body_poses, sway

PATH = Path("clip.npz")
TOY_LINKS = ["body", "upper", "lower", "wheel", "slider", "toe"]


def links_of(robot):
    """The links that joints move, in the order of the URDF."""
    if robot.name == "toy":
        return TOY_LINKS
    links = [name.replace("_joint", "_link") for name in urdf_order(robot)]
    links[links.index("waist_pitch_link")] = "torso_link"
    return [root_link(robot), *links]


def sample(robot, q, links=None, names=False, change=None):
    links = links or links_of(robot)
    position, quaternion = body_poses(robot, q, links)
    if change:
        change(position, quaternion)
    return sample_bodies(
        position, np.roll(quaternion, -1, axis=-1), q[:, :7], links if names else None
    )


def columns(motion, order):
    return motion.angles[:, [motion.names.index(name) for name in order]]


def test_root_link(toy, humanoid, talos):
    assert root_link(toy) == "body"
    assert root_link(humanoid) == "pelvis"
    assert root_link(talos) == "base_link"


@pytest.mark.parametrize("title", ["the order of the URDF", "breadth first", "depth first"])
@pytest.mark.parametrize("shuffled", [False, True])
def test_usual_orders(toy, title, shuffled):
    motion = sway(toy)
    order = tree_orders(toy)[title]
    links = TOY_LINKS[::-1] if shuffled else TOY_LINKS
    found, notes = find_order(PATH, toy, columns(motion, order), sample(toy, motion.q, links))
    assert found == order
    assert f"by the poses of the bodies their order is {title}." in notes[0]
    assert "within" in notes[1] and "e-1" in notes[1]


@pytest.mark.parametrize("title", ["the order of the URDF", "breadth first"])
def test_usual_orders_of_the_g1(humanoid, title):
    motion = sway(humanoid)
    order = tree_orders(humanoid)[title]
    found, notes = find_order(PATH, humanoid, columns(motion, order), sample(humanoid, motion.q))
    assert found == order
    assert title in notes[0]


@pytest.mark.parametrize("seed", range(5))
def test_any_order(humanoid, seed):
    """With bodies in another order than joints, too."""
    rng = np.random.default_rng(seed)
    motion = sway(humanoid)
    order = tuple(rng.permutation(motion.names).tolist())
    links = rng.permutation(links_of(humanoid)).tolist()
    links = [root_link(humanoid), *(link for link in links if link != root_link(humanoid))]
    found, notes = find_order(
        PATH, humanoid, columns(motion, order), sample(humanoid, motion.q, links)
    )
    assert found == order
    assert f"their order is one of its own ({', '.join(order)})." in notes[0]


def test_any_order_while_joints_rest(humanoid):
    """Those that do not move, or move alike, may be taken for each other: they are the same."""
    rng = np.random.default_rng(0)
    motion = sway(humanoid)
    angles = motion.angles.copy()
    angles[:, ::3] = 0.0
    angles[:, 1] = angles[:, 4]
    order = rng.permutation(len(motion.names))
    q = configurations(humanoid, motion.position, motion.quaternion, motion.names, angles)
    found, _ = find_order(PATH, humanoid, angles[:, order], sample(humanoid, q))
    again = configurations(humanoid, motion.position, motion.quaternion, found, angles[:, order])
    np.testing.assert_allclose(again, q, atol=1e-12)


def test_any_order_with_links_in_the_same_place(humanoid):
    """The waist turns where the pelvis is, to which other links are fixed; some joints rest."""
    rng = np.random.default_rng(0)
    motion = sway(humanoid)
    angles = motion.angles.copy()
    angles[:, 3:6] = 0.0
    order = rng.permutation(len(motion.names))
    q = configurations(humanoid, motion.position, motion.quaternion, motion.names, angles)
    bodies = sample(humanoid, q, ["pelvis", "pelvis_contour_link", *links_of(humanoid)[1:]])
    found, _ = find_order(PATH, humanoid, angles[:, order], bodies)
    again = configurations(humanoid, motion.position, motion.quaternion, found, angles[:, order])
    np.testing.assert_allclose(again, q, atol=1e-12)


def test_last_joints_count(humanoid):
    """What the wrists turn moves no link's origin."""
    motion = sway(humanoid)
    swapped = list(motion.names)
    left, right = (swapped.index(f"{side}_wrist_yaw_joint") for side in ("left", "right"))
    swapped[left], swapped[right] = swapped[right], swapped[left]
    found, _ = find_order(PATH, humanoid, columns(motion, swapped), sample(humanoid, motion.q))
    assert found == tuple(swapped)


def test_more_and_fewer_bodies(humanoid):
    motion = sway(humanoid)
    more = [*links_of(humanoid), "head_link", "imu_in_torso", "logo_link"]
    fewer = ["pelvis", "left_ankle_roll_link", "right_ankle_roll_link", "left_wrist_yaw_link"]
    order = tree_orders(humanoid)["breadth first"]
    for links in (more, fewer):
        found, _ = find_order(
            PATH, humanoid, columns(motion, order), sample(humanoid, motion.q, links)
        )
        assert found == order


def test_fewer_joints(humanoid):
    """Links beyond the joints that the file does not give may be anywhere."""
    motion = sway(humanoid)
    (layout,) = humanoid.joint_layouts
    for order in (layout, tuple(n for n in tree_orders(humanoid)["breadth first"] if n in layout)):
        found, notes = find_order(
            PATH, humanoid, columns(motion, order), sample(humanoid, motion.q)
        )
        assert found == order
        assert "of the version of humanoid with 23 joints" in notes[0]


def test_nobody_knows_so_many_joints(humanoid):
    motion = sway(humanoid)
    with pytest.raises(DynacomError, match=r"^clip\.npz: must have 23 or 29 joints, .*, got 28$"):
        find_order(PATH, humanoid, motion.angles[:, 1:], sample(humanoid, motion.q))


def test_degrees(toy, humanoid):
    for robot in (toy, humanoid):
        motion = sway(robot)
        angles = np.rad2deg(motion.angles)
        if robot is toy:
            angles[:, motion.names.index("a_slide")] = motion.angles[
                :, motion.names.index("a_slide")
            ]
        with pytest.raises(DynacomError, match="must be in radians, got degrees"):
            find_order(PATH, robot, angles, sample(robot, motion.q))


def test_another_robot(humanoid):
    """The same number of joints, and longer arms."""

    def lengthen(position, quaternion):
        elbow = links_of(humanoid).index("left_elbow_link")
        position[:, elbow] += [0.0, 0.0, 0.05]

    motion = sway(humanoid)
    bodies = sample(humanoid, motion.q, change=lengthen)
    with pytest.raises(DynacomError) as caught:
        find_order(PATH, humanoid, motion.angles, bodies)
    message = str(caught.value)
    assert "kinematics of humanoid must put its links where the file has the bodies" in message
    assert "puts left_elbow_link 0.05 m away: is it this robot's clip?" in message


def test_a_body_without_a_link(toy):
    motion = sway(toy)

    def move(position, quaternion):
        position[:, 2] += [0.0, 0.0, 0.05]

    bodies = sample(toy, motion.q, ["body", "upper", "toe"], change=move)
    with pytest.raises(DynacomError, match="puts every link from body 2 0.05 m away"):
        find_order(PATH, toy, motion.angles, bodies)


def test_revisions_of_a_robot_differ_a_little(humanoid):
    def move(position, quaternion):
        position[:, -1] += [0.0, 0.0, 0.01]

    motion = sway(humanoid)
    bodies = sample(humanoid, motion.q, change=move)
    _, notes = find_order(PATH, humanoid, motion.angles, bodies)
    assert notes[1] == "Forward kinematics puts the links within 1.0e-02 m of the file's bodies."


def test_joints_with_names(toy):
    motion = sway(toy)
    for names in (True, False):
        bodies = sample(toy, motion.q, names=names)
        (note,) = check_bodies(PATH, toy, motion.names, motion.angles, bodies)
        assert "within" in note
        wrong = motion.angles + [0.0, 0.0, 0.3, 0.0, 0.0]  # the wheel
        with pytest.raises(DynacomError) as caught:
            check_bodies(PATH, toy, motion.names, wrong, bodies)
        # The distance that the lever's end goes.
        expected = f"the file's joints put wheel {2 * LEVER * np.sin(0.15):.2g} m away"
        assert expected in str(caught.value)


def test_names_of_bodies_count(toy):
    """A body must be where the link of its name is, not just any link."""
    motion = sway(toy)
    links = ["body", "lower", "upper", "wheel", "slider", "toe"]
    bodies = sample(toy, motion.q, links)
    check_bodies(PATH, toy, motion.names, motion.angles, bodies)
    with pytest.raises(DynacomError, match="put lower 0.47 m away: is it this robot's clip"):
        check_bodies(
            PATH, toy, motion.names, motion.angles, replace(bodies, names=tuple(TOY_LINKS))
        )


def test_names_of_other_bodies_do_not(toy):
    motion = sway(toy)
    position, quaternion = body_poses(toy, motion.q, TOY_LINKS)
    bodies = sample_bodies(
        position, np.roll(quaternion, -1, axis=-1), motion.q[:, :7], [f"{n}_x" for n in TOY_LINKS]
    )
    (note,) = check_bodies(PATH, toy, motion.names, motion.angles, bodies)
    assert "within" in note
