# SPDX-License-Identifier: BSD-2-Clause
"""Motions that benchmarks/repair.py makes from clips."""

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from repair_derived import DERIVED

import dynacom
from dynacom import Clip
from dynacom.robots import Robot
from puppet import make_puppet, walk


@pytest.fixture(scope="module")
def puppet(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return make_puppet(tmp_path_factory.mktemp("puppet"))


@pytest.fixture(scope="module")
def clip() -> Clip:
    return walk(steps=2).clip(yaw=0.3)


def derive(name: str, clip: Clip, robot: Robot) -> tuple[Clip, np.ndarray]:
    """And the change of its configurations, in the tangent space."""
    made = DERIVED[name](clip, robot.model)
    assert made.v is None
    assert made.a is None
    pairs = zip(clip.q, made.q, strict=True)
    return made, np.array([pin.difference(robot.model, *pair) for pair in pairs])


@pytest.mark.parametrize(("name", "height"), [("floating", 0.05), ("sunk", -0.03)])
def test_heights(clip, puppet, name, height):
    _, steps = derive(name, clip, puppet)
    assert_allclose(steps, np.tile(np.eye(1, 12, 2) * height, (len(steps), 1)), atol=1e-12)


def test_skating_is_along_x_and_needs_the_same_forces(clip, puppet):
    made, steps = derive("skating", clip, puppet)
    shift = made.q[:, :3] - clip.q[:, :3]
    assert_allclose(shift, np.outer(clip.time, [0.1, 0.0, 0.0]), atol=1e-12)
    assert_allclose(steps[:, 3:], 0.0, atol=1e-12)
    accelerations = (
        dynacom.differentiate(puppet.model, of.time, of.q).a[:, :3] for of in (clip, made)
    )
    assert_allclose(*accelerations, atol=1e-8)


def test_drifting_turns_and_shifts_the_world(clip, puppet):
    made, steps = derive("drifting", clip, puppet)
    assert_array_equal(made.q[:, 7:], clip.q[:, 7:])
    yaw = np.radians(2.0) * clip.time
    assert_allclose(steps[:, 3:6], np.outer(yaw, [0.0, 0.0, 1.0]), atol=1e-12)
    x, y, z = clip.q[:, :3].T
    expected = [np.cos(yaw) * x - np.sin(yaw) * y, np.sin(yaw) * x + np.cos(yaw) * y, z]
    expected[1] = expected[1] + 0.02 * clip.time
    assert_allclose(made.q[:, :3], np.transpose(expected), atol=1e-12)


def test_jittering(clip, puppet):
    """1 mm on places and on what slides, as the puppet's legs do, and 5 mrad on what turns."""
    _, steps = derive("jittering", clip, puppet)
    expected = np.repeat([1e-3, 5e-3, 1e-3], [3, 3, 6])
    assert_allclose(np.std(steps, axis=0), expected, rtol=0.15)


def test_sped_up(clip, puppet):
    made, steps = derive("sped up", clip, puppet)
    assert_allclose(made.time, clip.time / 1.3)
    assert not steps.any()
