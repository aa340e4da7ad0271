# SPDX-License-Identifier: BSD-2-Clause
"""Every format, and the samples of ../shared/data/SOURCES.md."""

import pickle

import numpy as np
import pinocchio as pin
import pytest

from dynacom import DynacomError, Motion, read_motion
from motion_files import assert_notes, body_poses, refuses, sway, write_columns, write_csv


@pytest.mark.parametrize("name", ["clip.txt", "clip", "clip.npy", "clip.csv.zip", "clip.gz", "npz"])
def test_other_suffixes(tmp_path, toy, name):
    (tmp_path / name).write_text("1,2")
    expected = (
        f"must end in one of .csv, .csv.gz, .parquet, .npz, .pkl, .pickle, .joblib, got '{name}'"
    )
    refuses(tmp_path / name, toy, expected)


@pytest.mark.parametrize("suffix", [".csv", ".csv.gz", ".parquet", ".npz", ".pkl"])
def test_missing_files_and_folders(tmp_path, toy, suffix):
    path = tmp_path / f"clip{suffix}"
    refuses(path, toy, "cannot be read (No such file or directory)")
    path.mkdir()
    refuses(path, toy, "cannot be read (Is a directory)")


def test_unknown_order(tmp_path, toy):
    path = write_csv(tmp_path / "clip.csv", sway(toy).table)
    with pytest.raises(DynacomError, match=r"^quat must be xyzw or wxyz, got 'xyz'$"):
        read_motion(path, toy, quat="xyz")


def test_every_format_gives_the_same(tmp_path, humanoid):
    motion = sway(humanoid)
    csv = write_csv(tmp_path / "bare.csv", motion.table)
    header = write_columns(tmp_path / "header.csv", motion.columns)
    plain, tracking = tmp_path / "plain.npz", tmp_path / "tracking.npz"
    np.savez(plain, t=motion.time, q=motion.q)
    links = [f.name for f in humanoid.model.frames if f.type == pin.FrameType.BODY]
    position, quaternion = body_poses(humanoid, motion.q, links)
    np.savez(tracking, fps=60, joint_pos=motion.angles, body_pos_w=position, body_quat_w=quaternion)
    retargeted = tmp_path / "clip.pkl"
    content = {"root_pos": motion.position, "root_rot": motion.quaternion, "dof_pos": motion.angles}
    retargeted.write_bytes(pickle.dumps({"fps": 60, **content}))
    for path in (csv, header, plain, tracking, retargeted):
        clip = read_motion(path, humanoid, fps=60)
        np.testing.assert_allclose(clip.time, motion.time, atol=1e-15)
        np.testing.assert_allclose(clip.q, motion.q, atol=1e-12)
        assert len(clip.joint_names) == 29
        zero = np.zeros((len(clip.time), humanoid.model.nv))
        Motion(clip.time, clip.q, zero, zero).validate(humanoid.model)


def test_errors_for_every_way_to_be_wrong_give_no_warnings(tmp_path, toy, recwarn):
    """A command prints one line."""
    for value in (1e300, -1e300, 1e-320):
        table = sway(toy).table
        table[3] = value
        refuses(write_csv(tmp_path / "clip.csv", table), toy, fps=60)
    assert list(recwarn) == []


# The samples.


def test_both_files_of_a_clip_agree(shared_data, humanoid):
    """Frame by frame, from the first one on; the archive has one frame less."""
    csv = read_motion(shared_data / "B_HandsUp.csv", humanoid, fps=60)
    npz = read_motion(shared_data / "B_HandsUp.npz", humanoid)
    assert csv.q.shape == (442, 36)
    assert npz.q.shape == (441, 36)
    np.testing.assert_array_equal(csv.time[:441], npz.time)
    # Six digits, once more interpolated.
    np.testing.assert_allclose(csv.q[:441], npz.q, rtol=0, atol=1e-5)
    assert abs(csv.q[1:] - npz.q).max() > 1e-2
    assert_notes(csv, "in the order of the URDF")
    assert_notes(npz, "by the poses of the bodies their order is the order of the URDF", "within")
    # Its velocities are central differences.
    v = [pin.difference(humanoid.model, *pair) for pair in zip(npz.q, npz.q[2:], strict=False)]
    np.testing.assert_allclose(npz.v[1:-1], 30.0 * np.array(v), rtol=0, atol=1e-3)


def test_a_dance(shared_data, humanoid):
    """With steps that are as fast as retargeted mocap gets."""
    path = shared_data / "J_Dance0_StepTouch.csv"
    clip = read_motion(path, humanoid, fps=60)
    assert clip.q.shape == (1949, 36)
    assert clip.time[-1] == pytest.approx(1948 / 60)
    assert_notes(clip, "in the order of the URDF")
    refuses(path, humanoid, "give --fps")
    believed = read_motion(path, humanoid, fps=60, quat="wxyz")
    assert_notes(believed, "in the order of the URDF", "in the other order")


def test_a_clip_with_a_box(shared_data, humanoid, talos):
    """Of a robot whose waist is a centimetre higher."""
    path = shared_data / "sub3_largebox_003_mj.npz"
    clip = read_motion(path, humanoid)
    assert clip.q.shape == (325, 36)
    assert clip.time[1] == 1 / 50
    assert_notes(clip, "Forward kinematics puts the links within 1.0e-02 m of the file's bodies.")
    v = [pin.difference(humanoid.model, *pair) for pair in zip(clip.q, clip.q[2:], strict=False)]
    np.testing.assert_allclose(clip.v[1:-1], 25.0 * np.array(v), rtol=0, atol=0.05)
    refuses(path, humanoid, "must put its links where the file has the bodies", quat="xyzw")
    refuses(path, talos, "must have the joints of talos, got left_hip_pitch_joint, ", "23 more")


def test_clips_of_another_robot(shared_data, talos):
    refuses(shared_data / "B_HandsUp.csv", talos, "32 of the joints of talos, got 36", fps=60)
    refuses(shared_data / "B_HandsUp.npz", talos, "must have 32 joints, as talos does, got 29")
