# SPDX-License-Identifier: BSD-2-Clause
"""Frames that a file has dropped."""

import numpy as np
import pinocchio as pin
import pytest

from dynacom import ContactSchedule, read_motion
from dynacom.motion_gaps import Gaps
from motion_files import assert_notes, sway, write_columns


def without(frames: int, *dropped: int) -> np.ndarray:
    return np.setdiff1d(np.arange(frames), dropped)


@pytest.mark.parametrize(
    ("dropped", "text"),
    [
        ((30,), "The frame after 0.4833 s is missing: it was made from those around it"),
        ((1,), "The frame after 0 s is missing"),
        ((88,), "The frame after 1.45 s is missing"),
        ((40, 41), "Frames are missing, 2 in all, the first after 0.65 s: they were made"),
        ((10, 12, 50, 51), "Frames are missing, 4 in all, the first after 0.15 s"),
    ],
)
def test_dropped_frames_are_made_anew(tmp_path, toy, dropped, text):
    motion = sway(toy)
    kept = without(90, *dropped)
    columns = {name: values[kept] for name, values in motion.columns.items()}
    clip = read_motion(write_columns(tmp_path / "clip.csv", columns), toy)
    assert_notes(clip, text)
    np.testing.assert_allclose(clip.time, motion.time, rtol=0, atol=1e-9)
    np.testing.assert_allclose(clip.q[kept], motion.q[kept], atol=1e-12)
    largest = max(
        np.abs(pin.difference(toy.model, motion.q[frame], clip.q[frame])).max() for frame in dropped
    )
    steps = [
        np.abs(pin.difference(toy.model, motion.q[frame], motion.q[frame - 1])).max()
        for frame in dropped
    ]
    assert largest < 0.02 * max(steps)  # a line would be off by more
    np.testing.assert_allclose(np.linalg.norm(clip.q[:, 3:7], axis=1), 1.0, atol=1e-12)


def test_whatever_the_file_has_is_made_too(tmp_path, toy):
    motion = sway(toy)
    kept = without(90, 20, 60)
    time = motion.time[kept]
    v = np.linspace(0.0, 1.0, 90)[:, None] ** 3 * np.arange(1, toy.model.nv + 1)
    masks = np.stack([np.arange(90) < 20, np.arange(90) % 2 == 0], axis=1)
    confidence = np.where(masks, 0.75, 0.25)
    wrenches = np.linspace(-1.0, 1.0, 90)[:, None, None] ** 2 * np.ones((90, 2, 6))
    arrays = {"t": time, "q": motion.q[kept], "v": v[kept], "a": v[kept]}
    arrays |= {"contacts": confidence[kept], "contact_names": np.array(["foot", "pad"])}
    np.savez(tmp_path / "clip.npz", **arrays, contact_wrenches=wrenches[kept])
    clip = read_motion(tmp_path / "clip.npz", toy)
    # Cubics are what they were.
    np.testing.assert_allclose(clip.v, v, atol=1e-9)
    np.testing.assert_allclose(clip.a, v, atol=1e-9)
    np.testing.assert_allclose(clip.forces["pad"], wrenches[:, 1], atol=1e-9)
    # Contacts are those of the frame before.
    expected = masks.copy()
    expected[[20, 60]] = masks[[19, 59]]
    np.testing.assert_array_equal(clip.schedule.active, expected)
    np.testing.assert_array_equal(clip.schedule.confidence, np.where(expected, 0.75, 0.25))
    assert len(clip.quaternion_error) == 90


@pytest.mark.parametrize(
    "time",
    [
        [0.0],
        [0.0, 0.1],
        np.arange(50) / 30.0,
        np.round(np.arange(50) / 120.0, 3),
        np.cumsum([0.1, 0.1, 0.14, 0.1, 0.2, 0.1]),  # uneven anyway
        np.cumsum([1.0, 1.5, 1.0, 1.5, 1.0, 1.5]),
        np.arange(50) ** 1.2,
    ],
)
def test_other_times_are_as_they_are(time):
    assert Gaps.find(np.asarray(time, dtype=float)) is None


def test_times_may_be_rounded():
    exact = np.arange(100) / 120.0
    kept = without(100, 50)
    gaps = Gaps.find(np.round(exact, 3)[kept])
    np.testing.assert_array_equal(np.flatnonzero(gaps.missing), [49])
    np.testing.assert_allclose(gaps.times(), exact, atol=1e-3)
    np.testing.assert_array_equal(gaps.times()[kept], np.round(exact, 3)[kept])
    schedule = ContactSchedule(["a"], np.ones((99, 1), dtype=bool))
    assert gaps.schedule(schedule).confidence is None
