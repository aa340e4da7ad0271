# SPDX-License-Identifier: BSD-2-Clause
"""The whole body's change after which contacts can give what a motion needs."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import dynacom
from dynacom import ContactSchedule, Motion, PartRobot, RepairSettings, repairMotion
from helpers import WALKS


@dataclass
class Case:
    """A part of Talos' bundled walk, played faster than it can be."""

    split: PartRobot
    motion: Motion
    schedule: ContactSchedule


@pytest.fixture(scope="module")
def hurried(talos) -> Case:
    with np.load(WALKS / "talos_walk.npz") as file:
        time, q, contacts = (file[name][40:140] for name in ("t", "q", "contacts"))
        names = file["contact_names"].tolist()
    split = dynacom.splitContacts(talos.dynacom())
    active = {name: contacts[:, k].astype(bool) for k, name in enumerate(names)}
    schedule = ContactSchedule(
        [part.name for part in split.parts],
        np.column_stack([active[part.name.partition(".")[0]] for part in split.parts]),
    )
    motion = dynacom.differentiate(talos.model, (time - time[0]) / 1.5, q)
    return Case(split, motion, schedule)


def count_out_of_reach(case: Case, motion: Motion) -> int:
    analysis = dynacom.analyzeMotion(case.split.robot, motion, case.schedule)
    return sum(str(status) != "Solved" for status in analysis.status)


def test_all_frames_come_within_reach(talos, hurried):
    """By the analysis of the motion as it is written, which knows nothing of how it was made."""
    assert count_out_of_reach(hurried, hurried.motion) > 20
    repaired = repairMotion(hurried.split, hurried.motion, hurried.schedule)
    assert repaired.within_reach
    frames, nv = len(hurried.motion.time), talos.model.nv
    assert repaired.change.shape == (frames, nv)
    assert repaired.residual.shape == (frames, 6)
    assert count_out_of_reach(hurried, repaired.motion) == 0
    # Close to the motion before, and made of the change that it tells of.
    assert 1e-5 < repaired.root_rms <= repaired.root_largest < 0.03
    assert repaired.joint_rms < np.radians(1.0)
    assert_array_equal(repaired.motion.time, hurried.motion.time)
    moved = dynacom.differentiate(talos.model, repaired.motion.time, repaired.motion.q)
    assert_allclose(repaired.motion.a, moved.a, rtol=0, atol=1e-9)
    shift = repaired.motion.q[:, :3] - hurried.motion.q[:, :3]
    assert_allclose(np.linalg.norm(shift, axis=1).max(), repaired.root_largest, rtol=0.05)
    # The soles, which stood still in the plan, do so.
    assert all(stance.is_still for stance in repaired.stances)
    assert repaired.held_largest < 1e-3
    # And what is repaired needs no more of it.
    again = repairMotion(hurried.split, repaired.motion, hurried.schedule)
    assert_array_equal(again.motion.q, repaired.motion.q)


def test_free_frames_and_settings(hurried):
    everything = np.ones(len(hurried.motion.time), dtype=bool)
    untouched = repairMotion(
        hurried.split, hurried.motion, hurried.schedule, RepairSettings(), everything
    )
    assert_array_equal(untouched.motion.q, hurried.motion.q)
    assert untouched.root_largest == 0.0
    settings = RepairSettings()
    settings.largest_drift = 0.0
    moving = repairMotion(hurried.split, hurried.motion, hurried.schedule, settings)
    assert not any(stance.is_still for stance in moving.stances)
    assert "within_reach=True" in repr(moving)
    assert "largest_drift=0" in repr(settings)


def test_what_is_refused(hurried):
    settings = RepairSettings()
    settings.friction_margin = 1.0
    with pytest.raises(ValueError, match="RepairSettings.friction_margin must be < 1, got 1"):
        repairMotion(hurried.split, hurried.motion, hurried.schedule, settings)
    wrong = ContactSchedule(["nose"], np.ones((len(hurried.motion.time), 1), dtype=bool))
    with pytest.raises(ValueError, match="schedule names 'nose', which is no part"):
        repairMotion(hurried.split, hurried.motion, wrong)
    with pytest.raises(ValueError, match="free must have 100 frames"):
        repairMotion(hurried.split, hurried.motion, hurried.schedule, free=np.ones(3, dtype=bool))
