# SPDX-License-Identifier: BSD-2-Clause
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from dynacom import DynacomError, load_robot
from dynacom.motion_joints import (
    brief,
    configurations,
    joint_angles,
    match_joints,
    order_without_names,
    rotations,
    tree_orders,
    urdf_order,
)
from motion_files import sway

PATH = Path("clip.csv")


def test_orders_of_a_robot_whose_joints_stand_anyhow(toy):
    assert toy.joints.names == ("a_slide", "c_wheel", "m_hip", "z_knee", "b_toe")
    assert urdf_order(toy) == ("z_knee", "m_hip", "c_wheel", "a_slide", "b_toe")
    assert tree_orders(toy) == {
        "the order of the URDF": ("z_knee", "m_hip", "c_wheel", "a_slide", "b_toe"),
        "breadth first": ("m_hip", "c_wheel", "a_slide", "z_knee", "b_toe"),
        "depth first": ("m_hip", "z_knee", "b_toe", "c_wheel", "a_slide"),
    }


def test_orders_of_the_g1(humanoid):
    names = urdf_order(humanoid)
    assert len(names) == 29
    assert names == humanoid.joints.names
    orders = tree_orders(humanoid)
    assert orders["depth first"] == names
    # As Isaac Lab has it.
    assert orders["breadth first"][:11] == (
        "left_hip_pitch_joint",
        "right_hip_pitch_joint",
        "waist_yaw_joint",
        "left_hip_roll_joint",
        "right_hip_roll_joint",
        "waist_roll_joint",
        "left_hip_yaw_joint",
        "right_hip_yaw_joint",
        "waist_pitch_joint",
        "left_knee_joint",
        "right_knee_joint",
    )


def test_the_model_of_talos_is_not_in_the_order_of_its_urdf():
    talos = load_robot("talos")
    assert urdf_order(talos)[0] == "torso_1_joint"
    assert talos.joints.names[0] == "leg_left_1_joint"
    assert sorted(urdf_order(talos)) == sorted(talos.joints.names)


def test_urdf_is_gone(toy, tmp_path):
    gone = replace(toy, urdf=tmp_path / "gone.urdf")
    with pytest.raises(DynacomError, match=r"gone\.urdf: cannot be read"):
        urdf_order(gone)


def test_joints_without_names(toy):
    names, (note,) = order_without_names(PATH, toy, 5)
    assert names == urdf_order(toy)
    assert "in the order of the URDF" in note
    names, (note,) = order_without_names(PATH, toy, 4)
    assert names == ("z_knee", "m_hip", "c_wheel", "a_slide")
    assert "the version of toy with 4 joints" in note
    with pytest.raises(DynacomError, match=r"^clip\.csv: must have 4 or 5 joints, .*toy.*, got 6$"):
        order_without_names(PATH, toy, 6)


def test_matching_joints(toy):
    names = ("b_toe", "a_slide", "m_hip", "z_knee", "c_wheel")
    assert match_joints(PATH, toy, names) == ([0, 1, 2, 3, 4], [])
    assert match_joints(PATH, toy, names[:2]) == ([0, 1], [])
    more = ("finger", *names, "thumb")
    assert match_joints(PATH, toy, more) == (
        [1, 2, 3, 4, 5],
        ["Left out, as toy has no such joints: finger, thumb."],
    )


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["b_toe", "m_hip", "b_toe"], "joint 'b_toe' is there 2 times"),
        (["b_toe", "neck"], "must have the joints of toy, got neck, and nothing for a_slide, c_wh"),
        (["neck"], "must have the joints of toy, got neck, and nothing for"),
        ([], "must have the joints of toy, got none, and nothing for a_slide"),
    ],
)
def test_joints_of_another_robot(toy, names, expected):
    with pytest.raises(DynacomError) as caught:
        match_joints(PATH, toy, names)
    assert f"clip.csv: {expected}" in str(caught.value)


def test_configurations(toy):
    motion = sway(toy)
    assert motion.q.shape == (90, 7 + 6)
    names = ("c_wheel", "z_knee")
    angles = np.array([[0.5, -0.25], [3.5, 0.75]])
    q = configurations(toy, motion.position[:2], motion.quaternion[:2], names, angles)
    model = toy.model
    wheel, knee, toe = (
        model.joints[model.getJointId(n)].idx_q for n in ("c_wheel", "z_knee", "b_toe")
    )
    np.testing.assert_array_equal(q[:, :7], np.hstack([motion.position, motion.quaternion])[:2])
    np.testing.assert_allclose(q[:, wheel], np.cos([0.5, 3.5]))
    np.testing.assert_allclose(q[:, wheel + 1], np.sin([0.5, 3.5]))
    np.testing.assert_array_equal(q[:, knee], [-0.25, 0.75])
    np.testing.assert_array_equal(q[:, toe], [0.25, 0.25])
    np.testing.assert_allclose(
        joint_angles(toy, q, names), [[0.5, -0.25], [3.5 - 2 * np.pi, 0.75]], atol=1e-15
    )


def test_rotations():
    rng = np.random.default_rng(0)
    quaternions = rng.standard_normal((4, 3, 4))
    quaternions /= np.linalg.norm(quaternions, axis=-1, keepdims=True)
    for index in np.ndindex(4, 3):
        np.testing.assert_allclose(
            rotations(quaternions)[index],
            pin.Quaternion(quaternions[index].copy()).toRotationMatrix(),
            atol=1e-15,
        )


def test_brief():
    assert brief(["a", "b"]) == "a, b"
    assert brief([]) == ""
    assert brief(list("abcdefgh")) == "a, b, c, d, e, f and 2 more"
