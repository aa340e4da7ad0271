# SPDX-License-Identifier: BSD-2-Clause
"""What files can have wrong, whatever their format."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from dynacom import DynacomError, read_motion
from dynacom.motion_checks import normalize
from motion_files import assert_notes, refuses, sway, write_columns, write_csv


@pytest.fixture
def check(tmp_path, toy):
    """Changes the toy's table, and expects it to be refused."""

    def check(change, *parts, **options):
        table = sway(toy).table
        table = change(table) if callable(change) else change
        path = write_csv(tmp_path / "clip.csv", table)
        return refuses(path, toy, *parts, **({"fps": 60} | options))

    return check


def changed(column, frame, value):
    def change(table):
        table[frame, column] = value
        return table

    return change


# Numbers.


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_not_finite(check, value):
    check(changed(4, 7, value), f"column 5 (root_qy) must be finite, got {value} in frame 7")
    check(changed(8, 89, value), f"column 9 (m_hip) must be finite, got {value} in frame 89")


def test_too_large(check):
    check(changed(6, 3, 1e308), "norm 1, got inf in frame 3")


# Frame rate and time.


@pytest.mark.parametrize("fps", [0.0, -60.0, np.nan, np.inf])
def test_frame_rates(tmp_path, toy, fps):
    path = write_csv(tmp_path / "clip.csv", sway(toy).table)
    with pytest.raises(DynacomError, match=r"^fps must be finite and > 0 Hz, got"):
        read_motion(path, toy, fps=fps)


def test_missing_frame_rate(check):
    check(lambda table: table, "has no times and no frame rate: give --fps", fps=None)


def with_time(path, robot, time):
    columns = sway(robot, len(time)).columns | {"t": time}
    return write_columns(path / "clip.csv", columns)


def test_hole_in_time(tmp_path, toy):
    time = np.arange(90) / 60.0
    time[41:] += 0.1
    path = with_time(tmp_path, toy, time)
    refuses(path, toy, "holes", "of 0.1167 s between frame 40 (0.666667 s) and the next", "0.01667")


@pytest.mark.parametrize("back", [0.0, 0.3])
def test_time_that_does_not_increase(tmp_path, toy, back):
    time = np.arange(90) / 60.0
    time[30] = time[29] - back
    path = with_time(tmp_path, toy, time)
    refuses(path, toy, f"time must increase, got {time[29]:.10g} s and then", " s in frame 30")


def test_time_that_is_no_number(tmp_path, toy):
    time = np.arange(90) / 60.0
    time[30] = np.nan
    refuses(with_time(tmp_path, toy, time), toy, "time must be finite, got nan in frame 30")


def test_clocks_may_jitter(tmp_path, toy):
    """A single frame may be lost, and some may come much too early."""
    rng = np.random.default_rng(0)
    time = np.delete(np.arange(91) / 60.0, 40)
    time[1:-1:4] -= rng.uniform(0.0160, 0.0166, len(time[1:-1:4]))
    clip = read_motion(with_time(tmp_path, toy, time), toy)
    np.testing.assert_array_equal(clip.time, time)


def test_times_count_more_than_the_frame_rate(tmp_path, toy):
    path = write_columns(tmp_path / "clip.csv", sway(toy).columns)
    clip = read_motion(path, toy, fps=30)
    np.testing.assert_array_equal(clip.time, sway(toy).time)
    assert_notes(clip, "--fps is not used")


# Quaternions.


def test_quaternions_far_from_norm_1(check):
    def scale(table):
        table[12, 3:7] *= 1.2
        return table

    check(scale, "the root's quaternion must have norm 1, got 1.2 in frame 12")


def test_what_is_not_a_number_has_no_norm():
    quaternions = np.tile([0.0, 0.0, 0.0, 1.0], (5, 1))
    for wrong in (np.nan, np.inf):
        quaternions[3, 1] = wrong
        with pytest.raises(DynacomError, match="must have norm 1, got (nan|inf) in frame 3"):
            normalize(Path("clip.csv"), quaternions)


@pytest.mark.parametrize("norm", [0.92, 1.08])
def test_quaternions_near_norm_1_are_normalised(tmp_path, toy, norm):
    motion = sway(toy)
    table = motion.table
    table[12, 3:7] *= norm
    clip = read_motion(write_csv(tmp_path / "clip.csv", table), toy, fps=60)
    np.testing.assert_allclose(clip.q, motion.q, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(clip.q[:, 3:7], axis=1), 1.0, atol=1e-15)
    np.testing.assert_allclose(clip.quaternion_error, 0.08 * (np.arange(90) == 12), atol=1e-12)
    assert_notes(clip, "order of the URDF", "normalised: their norms differ from 1 by up to 0.08.")


def test_rounding_is_not_worth_a_note(tmp_path, toy):
    path = write_csv(tmp_path / "clip.csv", np.round(sway(toy).table, 6))
    clip = read_motion(path, toy, fps=60)
    assert 0.0 < clip.quaternion_error.max() < 1e-5
    assert_notes(clip, "order of the URDF")
    np.testing.assert_allclose(np.linalg.norm(clip.q[:, 3:7], axis=1), 1.0, atol=1e-15)


def test_quaternions_in_the_other_order(check):
    check(
        lambda table: table[:, [0, 1, 2, 6, 3, 4, 5, *range(7, 12)]],
        "must be x y z w, got w x y z",
        "in the median frame, and to 1.00 in the other order; give --quat wxyz",
    )


def test_a_given_order_is_believed(tmp_path, toy):
    """Whoever gives it knows, perhaps, that the robot lies; a note says what it would be else."""
    table = sway(toy).table
    path = write_csv(tmp_path / "clip.csv", table)
    clip = read_motion(path, toy, fps=60, quat="wxyz")
    np.testing.assert_allclose(clip.q[:, 3:7], table[:, [4, 5, 6, 3]], atol=1e-15)
    assert_notes(clip, "order of the URDF", "and to 1.00 in the other order")
    assert not any("z axis" in note for note in read_motion(path, toy, fps=60).notes)


def turned(table, turn):
    """The same motion, of which each frame's root is turned in its own frame."""
    for row in table:
        row[3:7] = (pin.Quaternion(row[3:7].copy()) * pin.Quaternion(pin.exp3(turn))).coeffs()
    return table


@pytest.mark.parametrize("turn", [[1.6, 0, 0], [0, 1.6, 0], [-1.6, 0, 0], [0, 0, 2.0], [0, 3.1, 0]])
def test_robots_may_lie(tmp_path, toy, turn):
    """Not upright is not yet another order: only if the other makes it upright."""
    table = turned(sway(toy).table, np.array(turn))
    clip = read_motion(write_csv(tmp_path / "clip.csv", table), toy, fps=60)
    np.testing.assert_allclose(clip.q[:, 3:7], table[:, 3:7], atol=1e-12)


def test_columns_with_names_are_believed(tmp_path, toy):
    """Their quaternions may make the robot lie on its side, where the other order would not."""
    table = sway(toy).table
    table[:, 3:7] = [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]
    columns = dict(zip(sway(toy).columns, np.column_stack([sway(toy).time, table]).T, strict=True))
    clip = read_motion(write_columns(tmp_path / "clip.csv", columns), toy, quat="wxyz")
    np.testing.assert_allclose(clip.q[:, 3:7], table[:, 3:7], atol=1e-15)
    assert_notes(clip, "--quat is not used")
    refuses(write_csv(tmp_path / "other.csv", table), toy, "give --quat wxyz", fps=60)


# Joints.


def to_degrees(table):
    revolute = [7, 8, 9, 11]
    table[:, revolute] = np.rad2deg(table[:, revolute])
    return table


def test_degrees(check):
    check(
        to_degrees,
        "joints must be in radians, got degrees: b_toe (-1 to 1 rad) is -45.84 in frame 28",
    )


def test_degrees_by_name(tmp_path, toy):
    columns = sway(toy).columns
    columns |= {name: np.rad2deg(columns[name]) for name in ("m_hip", "z_knee", "b_toe")}
    refuses(write_columns(tmp_path / "clip.csv", columns), toy, "got degrees: b_toe")


def test_large_numbers_that_are_no_degrees_either(tmp_path, toy):
    """Whatever they are, they are no motion: a matter of the verdict."""
    rng = np.random.default_rng(0)
    table = np.hstack([sway(toy).table[:, :7], rng.uniform(-500.0, 500.0, (90, 5))])
    clip = read_motion(write_csv(tmp_path / "clip.csv", table), toy, fps=60)
    assert_notes(clip, "order of the URDF", "goes beyond its limits")


def test_a_single_joint_is_not_in_degrees(tmp_path, toy):
    """But it counts turns that it cannot make."""
    table = sway(toy).table
    table[:, 7] += 2.0 * np.pi * (np.arange(90) > 20)
    clip = read_motion(write_csv(tmp_path / "clip.csv", table), toy, fps=60)
    assert_notes(clip, "order of the URDF", "z_knee (-1.5 to 1.5 rad) goes beyond its limits")


def test_beyond_limits_but_not_in_degrees(tmp_path, toy):
    motion = sway(toy)
    table = motion.table
    table[:, 7] += 1.4
    clip = read_motion(write_csv(tmp_path / "clip.csv", table), toy, fps=60)
    frame = int(np.argmax(table[:, 7]))
    assert_notes(
        clip,
        "order of the URDF",
        "The joint z_knee (-1.5 to 1.5 rad) goes beyond its limits: "
        f"{table[frame, 7]:.4g} rad in frame {frame}.",
    )


# Jumps.


def from_frame(column, frame, step):
    def change(table):
        table[frame:, column] += step
        return table

    return change


@pytest.mark.parametrize(
    ("column", "step"), [(1, 0.3), (7, 0.9), (8, 1.0), (9, 2.0 * np.pi + 2.0), (10, -0.2)]
)
def test_jumps_are_read(tmp_path, toy, column, step):
    """They are a matter of the verdict: the rest of a clip may be good."""
    table = from_frame(column, 40, step)(sway(toy).table)
    clip = read_motion(write_csv(tmp_path / "clip.csv", table), toy, fps=60)
    assert len(clip.time) == 90
    if column != 9:  # of the wheel there are a sine and a cosine
        jump = np.abs(np.diff(clip.q, axis=0)).max(axis=1)
        assert np.argmax(jump) == 39
        assert jump[39] == pytest.approx(abs(step), abs=0.1)


@pytest.mark.parametrize("turns", [-1.0, 1.0, 3.0])
def test_a_wheel_may_count_its_turns(tmp_path, toy, turns):
    table = from_frame(9, 40, turns * 2.0 * np.pi)(sway(toy).table)
    clip = read_motion(write_csv(tmp_path / "clip.csv", table), toy, fps=60)
    np.testing.assert_allclose(clip.q, sway(toy).q, atol=1e-12)


def test_a_wheel_may_turn_on_and_on(tmp_path, toy):
    table = sway(toy).table
    table[:, 9] = np.linspace(0.0, 20.0, 90)
    path = write_csv(tmp_path / "clip.csv", table)
    index = toy.model.joints[toy.model.getJointId("c_wheel")].idx_q
    clip = read_motion(path, toy, fps=60)
    np.testing.assert_allclose(clip.q[:, index], np.cos(table[:, 9]), atol=1e-15)


def test_signs_of_quaternions_are_no_jumps(tmp_path, toy):
    table = sway(toy).table
    table[1::2, 3:7] *= -1.0
    clip = read_motion(write_csv(tmp_path / "clip.csv", table), toy, fps=60)
    np.testing.assert_allclose(clip.q[:, 3:7], table[:, 3:7], atol=1e-15)


@pytest.mark.parametrize("frames", [1, 2])
def test_short_clips(tmp_path, toy, frames):
    path = write_csv(tmp_path / "clip.csv", sway(toy).table[:frames])
    clip = read_motion(path, toy, fps=60)
    np.testing.assert_allclose(clip.q, sway(toy).q[:frames], atol=1e-15)
