# SPDX-License-Identifier: BSD-2-Clause
"""By how much repair has changed a motion."""

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

from dynacom.repair_change import Before, change_arrays, com_change
from report_case import repaired_walk


def still(robot, frames: int) -> Before:
    """A robot that stands in its neutral configuration."""
    q = np.tile(pin.neutral(robot.model), (frames, 1))
    com = np.array([pin.centerOfMass(robot.model, robot.model.createData(), one) for one in q])
    return Before(q, {"time": np.arange(float(frames)), "com": com}, {})


def test_each_kind_of_joint(toy):
    """The root's place, a hinge, a wheel without limits; what slides is not among what turns."""
    before = still(toy, 6)
    q = before.q.copy()
    place = {name: toy.model.idx_qs[toy.model.getJointId(name)] for name in toy.joints.names}
    q[1, :3] += [0.03, -0.04, 0.12]
    q[2, place["z_knee"]] += 0.3
    q[2, place["m_hip"]] -= 0.2
    angle = -0.4
    q[3, place["c_wheel"] : place["c_wheel"] + 2] = [np.cos(angle), np.sin(angle)]
    q[4, place["a_slide"]] += 0.1
    q[5, 3:7] = [0.0, 0.0, np.sin(0.1), np.cos(0.1)]  # which is no joint's change
    change = change_arrays(toy, before, q)
    assert_allclose(change["root"], [0.0, 0.13, 0.0, 0.0, 0.0, 0.0], atol=1e-12)
    assert_allclose(change["joints"], [0.0, 0.0, 0.3, 0.4, 0.0, 0.0], atol=1e-12)
    assert change["joint"][2:4].tolist() == ["z_knee", "c_wheel"]


def test_of_a_repaired_walk(talos):
    """By Pinocchio's placements and centres of mass, without its difference."""
    before, q, arrays, _ = repaired_walk(talos)
    change = change_arrays(talos, before, q)
    # Talos turns by so little that lines and screws are as long.
    displaced = np.linalg.norm(q[:, :3] - before.q[:, :3], axis=1)
    assert 0.001 < displaced.max() < 0.1
    assert_allclose(change["root"], displaced, rtol=1e-3, atol=1e-9)
    turned = np.abs(q[:, 7:] - before.q[:, 7:])
    assert_allclose(change["joints"], turned.max(axis=1), atol=1e-12)
    frame = change["joints"].argmax()
    assert talos.model.names[2 + int(turned[frame].argmax())] == change["joint"][frame]
    data = talos.model.createData()
    coms = [[pin.centerOfMass(talos.model, data, x).copy() for x in y] for y in (before.q, q)]
    assert_allclose(
        com_change(before, arrays), np.linalg.norm(np.subtract(*coms), axis=1), atol=1e-12
    )


def test_what_is_refused(toy):
    before = still(toy, 3)
    with pytest.raises(ValueError, match=r"^before.q must have the shape \(2, 13\), got \(3, 13\)"):
        change_arrays(toy, before, before.q[:2])
    with pytest.raises(ValueError, match=r"^q must have the shape \(3, 13\), got \(3, 12\)"):
        change_arrays(toy, before, before.q[:, 1:])
    with pytest.raises(ValueError, match="Before.q must have 3 frames as its arrays, got 2"):
        Before(before.q[:2], before.arrays, {})
