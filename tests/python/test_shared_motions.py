# SPDX-License-Identifier: BSD-2-Clause
"""Motions by third parties, which are not part of the repository: ../shared/data/SOURCES.md."""

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

import dynacom
from dynacom import DistributionStatus, DynaCoM
from dynacom.robots import Robot
from helpers import assert_gives_wrench, assert_within_cones, to_com

SOLVED = DistributionStatus.Solved
FEET = {"left_sole": "left_sole_link", "right_sole": "right_sole_link"}


@pytest.fixture
def robot(talos: Robot) -> DynaCoM:
    return talos.dynacom()


def foot_poses(robot: DynaCoM) -> list[pin.SE3]:
    model, data = robot.getModel(), robot.getData()
    frames = [model.getFrameId(frame) for frame in FEET.values()]
    return [pin.updateFramePlacement(model, data, frame).copy() for frame in frames]


def distribute(robot: DynaCoM) -> DistributionStatus:
    return robot.distributeForce(
        robot.getGroundCoMForce(), robot.getGroundCoMTorque(), robot.getCoM()
    )


def test_corner_forces(shared_data, robot):
    """multicontact-api's whole-body motion: corner forces sum to m (acom - g)."""
    rows = np.loadtxt(shared_data / "talos_com_motion.csv.gz", delimiter=",")
    assert rows.shape == (700, 1 + 39 + 38 + 38 + 24)
    # The ends are distorted: accelerations there are differences across the border.
    for row in rows[20:-20]:
        q, v, a, corners = np.split(row[1:], [39, 77, 115])
        robot.computeDynamics(q, v, a)
        feet = corners.reshape(2, 4, 3).sum(axis=1)
        poses = foot_poses(robot)
        total = sum(pose.rotation @ force for pose, force in zip(poses, feet, strict=True))
        assert_allclose(robot.getGroundCoMForce(), total, rtol=0, atol=1e-5)
        gravity = np.array([0.0, 0.0, -9.81])
        expected = robot.getMass() * (robot.getACoM() - gravity)
        assert_allclose(robot.getGroundCoMForce(), expected, rtol=1e-13, atol=1e-11)
        assert distribute(robot) == SOLVED
        assert_gives_wrench(robot, 1e-8)
        for name in FEET:
            assert_within_cones(robot.getContact(name), 1e-9)


def test_crocoddyl_walk(shared_data, robot):
    """The wrenches sum to the ground's in every frame; in single support they are the foot's."""
    with np.load(shared_data / "crocoddyl_talos_walk.npz") as file:
        rows = file["rows"]
    assert rows.shape == (57, 1 + 39 + 38 + 38 + 12)
    finite = np.isfinite(rows).all(axis=1)
    # Knots of impulses have no acceleration.
    assert np.count_nonzero(~finite) <= 2
    weight = 9.81 * robot.getMass()
    singles = 0
    for row in rows[finite]:
        q, v, a, wrenches = np.split(row[1:], [39, 77, 115])
        robot.computeDynamics(q, v, a)
        wrenches = dict(zip(FEET, wrenches.reshape(2, 6), strict=True))
        total = sum(
            to_com(pose.act(pin.Force(wrench)), robot.getCoM())
            for pose, wrench in zip(foot_poses(robot), wrenches.values(), strict=True)
        )
        ground = np.concatenate([robot.getGroundCoMForce(), robot.getGroundCoMTorque()])
        assert_allclose(ground, total, rtol=0, atol=1e-12 * weight)

        standing = [name for name, wrench in wrenches.items() if wrench.any()]
        for name in FEET:
            change = robot.activateContact if name in standing else robot.deactivateContact
            change(name)
        assert distribute(robot) == SOLVED
        assert_gives_wrench(robot, 1e-11 * weight)
        for name in standing:
            assert_within_cones(robot.getContact(name), 1e-12 * weight)
        if len(standing) == 1:
            force = robot.getContact(standing[0]).appliedForce()
            assert_allclose(force, wrenches[standing[0]], rtol=0, atol=1e-11 * weight)
            singles += 1
    assert singles >= 30


def test_a_run_on_a_treadmill(shared_data):
    """Its belt, at 2 m/s, is found, although who runs rolls over the feet."""
    folder = shared_data / "forces"
    report = dynacom.analyze(folder / "hamner_run_2mps.npz", folder / "hamner.yaml")
    assert_allclose(report.summary["ground_velocity"], [-2.0, 0.0, 0.0], rtol=0, atol=0.1)
    assert any("a treadmill" in note for note in report.summary["notes"])
    assert report.summary["distance"]["rms"] < 0.005
