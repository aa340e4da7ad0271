# SPDX-License-Identifier: BSD-2-Clause
"""Motions for the tests of readers, and files that hold them."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin
import pytest

from dynacom import Clip, DynacomError, read_motion
from dynacom.motion_joints import configurations, urdf_order
from dynacom.robots import Robot

ROOT = ["root_x", "root_y", "root_z", "root_qx", "root_qy", "root_qz", "root_qw"]

# Joints of every kind, whose order in the text is neither that of their names nor of the tree.
TOY_URDF = """<robot name="toy">
  <link name="body"><inertial><mass value="2"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="upper"/><link name="lower"/><link name="tip"/>
  <link name="wheel"/><link name="slider"/><link name="toe"/>
  <joint name="z_knee" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz="0 0 -0.4"/><axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" effort="1" velocity="1"/></joint>
  <joint name="m_hip" type="revolute"><parent link="body"/><child link="upper"/>
    <origin xyz="0 0.2 0" rpy="0.1 0.2 0.3"/><axis xyz="0.6 0.8 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="z_foot" type="fixed"><parent link="lower"/><child link="tip"/>
    <origin xyz="0 0 -0.4"/></joint>
  <joint name="c_wheel" type="continuous"><parent link="body"/><child link="wheel"/>
    <origin xyz="0.3 0 0"/><axis xyz="0 1 0"/></joint>
  <joint name="a_slide" type="prismatic"><parent link="body"/><child link="slider"/>
    <origin xyz="-0.3 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-0.2" upper="0.2" effort="1" velocity="1"/></joint>
  <joint name="b_toe" type="revolute"><parent link="tip"/><child link="toe"/>
    <origin xyz="0.1 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <transmission name="t"><joint name="z_knee"/></transmission>
</robot>
"""

TOY_FILE = """
urdf: toy.urdf
contacts:
  - {name: foot, kind: point, frame: tip, mu: 0.7, world_aligned: true, radius: 0.02}
  - {name: pad, kind: 6d, frame: tip, mu: 0.7, gu: 0.1, half_length: 0.1, half_width: 0.1,
     xyz: [0, 0.1, -0.05], rpy: [0.1, 0, 0]}
"""

G1_FILE = """
urdf: g1_description/urdf/g1_29dof_rev_1_0.urdf
contacts:
  - {name: left_sole, kind: 6d, frame: left_ankle_roll_link, mu: 0.7, gu: 0.05,
     half_length: 0.085, half_width: 0.025, xyz: [0.035, 0, -0.035]}
  - {name: right_sole, kind: 6d, frame: right_ankle_roll_link, mu: 0.7, gu: 0.05,
     half_length: 0.085, half_width: 0.025, xyz: [0.035, 0, -0.035]}
"""


class Sway(NamedTuple):
    """An upright robot that turns as it goes, and moves each joint in a way of its own."""

    time: np.ndarray
    position: np.ndarray
    #: x y z w.
    quaternion: np.ndarray
    #: In the order of the URDF.
    names: tuple[str, ...]
    angles: np.ndarray
    q: np.ndarray

    @property
    def table(self) -> np.ndarray:
        """The columns of CSV without a header."""
        return np.hstack([self.position, self.quaternion, self.angles])

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """The columns of CSV with a header."""
        names = ["t", *ROOT, *self.names]
        return dict(zip(names, np.column_stack([self.time, self.table]).T, strict=True))


def columns_of(robot: Robot, q: np.ndarray) -> dict[str, np.ndarray]:
    """The columns of CSV with a header."""
    model = robot.model
    joints = {name: q[:, model.joints[model.getJointId(name)].idx_q] for name in robot.joints.names}
    return dict(zip(ROOT, q[:, :7].T, strict=True)) | joints


def sway(robot: Robot, frames: int = 90) -> Sway:
    time = np.arange(frames) / 60.0
    phase = time[:, None]
    position = np.hstack([0.5 * phase, 0.1 * np.sin(2.0 * phase), 0.8 + 0.02 * np.cos(3.0 * phase)])
    turns = np.hstack([0.1 * np.sin(phase), 0.1 * np.cos(phase), 1.2 + 0.5 * phase])
    quaternion = np.array([pin.Quaternion(pin.rpy.rpyToMatrix(turn)).coeffs() for turn in turns])
    names = urdf_order(robot)
    angles = np.empty((frames, len(names)))
    for column, name in enumerate(names):
        index = robot.model.joints[robot.model.getJointId(name)].idx_q
        lower = max(robot.model.lowerPositionLimit[index], -1.0)
        upper = min(robot.model.upperPositionLimit[index], 1.0)
        wave = np.sin((1.0 + 0.13 * column) * time + column)
        angles[:, column] = 0.5 * (lower + upper) + 0.4 * (upper - lower) * wave
    q = configurations(robot, position, quaternion, names, angles)
    return Sway(time, position, quaternion, names, angles, q)


def write_csv(path: Path, table: np.ndarray, header: str | None = None) -> Path:
    np.savetxt(path, table, "%.17g", ",", header=header or "", comments="")
    return path


def write_columns(path: Path, columns: dict[str, np.ndarray]) -> Path:
    return write_csv(path, np.column_stack([*columns.values()]), ",".join(columns))


def body_poses(robot: Robot, q: np.ndarray, links: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Positions (T, B, 3) and quaternions (T, B, 4), w x y z, of links in the world."""
    data = robot.model.createData()
    frames = [robot.model.getFrameId(link, pin.FrameType.BODY) for link in links]
    position, quaternion = np.empty((len(q), len(links), 3)), np.empty((len(q), len(links), 4))
    for row, configuration in enumerate(q):
        pin.framesForwardKinematics(robot.model, data, configuration)
        for column, frame in enumerate(frames):
            pose = data.oMf[frame]
            position[row, column] = pose.translation
            quaternion[row, column] = np.roll(pin.Quaternion(pose.rotation).coeffs(), 1)
    return position, quaternion


def refuses(path: Path, robot: Robot, *parts: str, **options: object) -> str:
    """Expects an error of one line that begins with the path and holds all parts."""
    with pytest.raises(DynacomError) as caught:
        read_motion(path, robot, **options)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    for part in parts:
        assert part in message, message
    return message


def assert_notes(clip: Clip, *parts: str) -> None:
    """Expects these notes and no other, each a sentence that holds its part."""
    assert len(clip.notes) == len(parts), clip.notes
    for note, part in zip(clip.notes, parts, strict=True):
        assert part in note
        assert note[0].isupper() and note.endswith(".") and "\n" not in note
