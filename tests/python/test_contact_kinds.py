# SPDX-License-Identifier: BSD-2-Clause
"""Contacts whose sets are more than pyramids, on a robot."""

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

import dynacom
from dynacom import DistributionStatus, FrictionModel
from helpers import inequalities, sole_settings

SOLE = {"mu": 0.5, "gu": 0.05, "half_length": 0.1, "half_width": 0.06}


def standing(talos, **fields) -> dynacom.DynaCoM:
    """Talos on both soles, with settings that are other than by default."""
    robot = dynacom.DynaCoM(talos.model)
    for side in ("left", "right"):
        settings = sole_settings(**SOLE, frame_name=f"leg_{side}_sole_fix_joint")
        for name, value in fields.items():
            setattr(settings, name, value)
        robot.addContact(dynacom.Contact6D(settings), side)
    return robot


def share(
    robot: dynacom.DynaCoM, talos_standing, sideways=(0.0, 0.0)
) -> dynacom.DistributionResult:
    """What the ground gives a robot that stands, pushed by forces [N] through its CoM."""
    model = robot.getModel()
    zero = np.zeros(model.nv)
    robot.computeDynamics(talos_standing, zero, zero)
    force = robot.getGroundCoMForce() + np.array([*sideways, 0.0])
    robot.distributeForce(force, robot.getGroundCoMTorque(), robot.getCoM())
    result = robot.getDistribution()
    assert result.isOptimal()
    return result


def test_a_cone_allows_less_than_its_pyramid(talos, talos_standing):
    forces = {}
    for model in (FrictionModel.OuterPyramid, FrictionModel.Cone):
        robot = standing(talos, friction=model)
        mu = SOLE["mu"]
        push = 2.0 * mu * robot.getMass() * 9.81
        result = share(robot, talos_standing, (push, push))
        assert result.status == DistributionStatus.Relaxed
        forces[model] = [contact.force for contact in result.contacts]
        assert all(
            robot.getContactFrictionUsage(side) == pytest.approx(1.0) or not force.any()
            for side, force in zip(("left", "right"), forces[model], strict=True)
        )
    for force in forces[FrictionModel.Cone]:
        assert np.hypot(*force[:2]) <= mu * force[2] * (1.0 + 1e-9)
    assert any(
        np.hypot(*force[:2]) > 1.1 * mu * force[2] for force in forces[FrictionModel.OuterPyramid]
    )


def test_many_facets_are_as_good_as_the_cone(talos, talos_standing):
    push = (60.0, 40.0)
    cone = share(standing(talos, friction=FrictionModel.Cone), talos_standing, push)
    facets = share(standing(talos, friction=FrictionModel.Facets, facets=64), talos_standing, push)
    assert cone.status == facets.status
    assert_allclose(facets.achieved, cone.achieved, atol=0.5)


def test_a_reference_is_kept_where_it_gives_the_wrench(talos, talos_standing):
    plain = share(standing(talos), talos_standing)
    robot = standing(talos)
    offset = np.array([0.0, 5.0, 0.0, 0.0, 0.0, 0.0])
    for side, contact, sign in zip(("left", "right"), plain.contacts, (1.0, -1.0), strict=True):
        settings = robot.getContact(side).getSettings()
        settings.reference = contact.force + sign * offset
        robot.getContact(side).initialize(settings)
    pressed = share(robot, talos_standing)
    assert pressed.status == DistributionStatus.Solved
    assert pressed.cost < plain.cost
    assert pressed.contacts[0].set is not None
    assert robot.getContact("left").getSet() == pressed.contacts[0].set


def test_bounds_of_the_normal_force(talos, talos_standing):
    weight = standing(talos).getMass() * 9.81
    robot = standing(talos, greatest_normal_force=0.4 * weight)
    result = share(robot, talos_standing)
    assert result.status == DistributionStatus.Relaxed
    assert_allclose([contact.force[2] for contact in result.contacts], 0.4 * weight)


def test_a_hand_that_pulls(talos, talos_standing):
    robot = standing(talos)
    push = (0.5 * robot.getMass() * 9.81, 0.0)
    assert share(robot, talos_standing, push).status == DistributionStatus.Relaxed
    settings = dynacom.ContactGraspSettings()
    settings.lower, settings.upper = [-500.0] * 3 + [50.0] * 3, [500.0] * 3 + [50.0] * 3
    with pytest.raises(ValueError, match=r"ContactGraspSettings\.frame_name"):
        dynacom.ContactGrasp(settings)
    settings.lower = [-500.0] * 3 + [-50.0] * 3
    settings.frame_name = "gripper_right_base_link"
    robot.addContact(dynacom.ContactGrasp(settings), "hand")
    held = share(robot, talos_standing, push)
    assert held.status == DistributionStatus.Solved
    assert np.all(np.abs(held.contacts[2].force) <= np.asarray(settings.upper) * (1.0 + 1e-12))


def test_a_polygon_and_a_placement(talos, talos_standing):
    sole = sole_settings(**SOLE)
    x, y = sole.half_length, sole.half_width
    placement = pin.SE3(np.eye(3), np.array([0.02, 0.0, 0.0]))
    robot = dynacom.DynaCoM(talos.model)
    for side in ("left", "right"):
        settings = dynacom.ContactPolygonSettings()
        settings.mu, settings.gu = sole.mu, sole.gu
        settings.vertices = [[x - 0.02, y], [-x - 0.02, y], [-x - 0.02, -y], [x - 0.02, -y]]
        settings.placement = placement
        settings.weights = sole.weights
        settings.frame_name = f"leg_{side}_sole_fix_joint"
        robot.addContact(dynacom.ContactPolygon(settings), side)
        assert len(robot.getContact(side).getCorners()) == 4
    moved = share(robot, talos_standing)
    plain = share(standing(talos), talos_standing)
    # The same places are pressed on, though costs are of moments about another point.
    assert moved.status == plain.status == DistributionStatus.Solved
    assert_allclose(moved.achieved, plain.achieved, atol=1e-6)


# Coupled yaw.


def test_soles_of_coupled_yaw_give_what_their_corners_give(talos, talos_standing):
    robot = standing(talos, coupled_yaw=True)
    corners = dynacom.splitContacts(robot, friction=FrictionModel.OuterPyramid).robot
    assert robot.getContact("left").getSet() is None
    weight = robot.getMass() * 9.81
    statuses = set()
    for push, yaw in ((0.0, 0.02), (0.2, 0.02), (0.49, 0.02), (0.0, 0.2), (0.3, 0.2), (0.6, 0.1)):
        results = []
        for one in (robot, corners):
            share(one, talos_standing)
            force = one.getGroundCoMForce() + np.array([push * weight, 0.0, 0.0])
            torque = one.getGroundCoMTorque() + np.array([0.0, -0.8 * push, yaw]) * weight
            statuses.add(one.distributeForce(force, torque, one.getCoM()))
            results.append(one.getDistribution())
        soles, points = results
        assert soles.isOptimal()
        assert points.isOptimal()
        assert soles.status == points.status
        assert_allclose(soles.achieved, points.achieved, atol=1e-6 * weight)
        assert all(
            0.0 <= robot.getContactYawUsage(side) <= 1.0 + 1e-9 for side in ("left", "right")
        )
    assert statuses == {DistributionStatus.Solved, DistributionStatus.Relaxed}
    assert robot.computeWrenchMargin().margin == 0.0


def test_soles_of_coupled_yaw_beside_a_hand_are_refused(talos, talos_standing):
    robot = standing(talos, coupled_yaw=True)
    settings = dynacom.ContactGraspSettings()
    settings.lower, settings.upper = [-500.0] * 3 + [-50.0] * 3, [500.0] * 3 + [50.0] * 3
    settings.frame_name = "gripper_right_base_link"
    robot.addContact(dynacom.ContactGrasp(settings), "hand")
    with pytest.raises(
        ValueError, match="contact 'gripper_right_base_link' is more than a pyramid"
    ):
        share(robot, talos_standing)
    robot.deactivateContact("hand")
    assert share(robot, talos_standing).status == DistributionStatus.Solved


def test_motions_of_soles_of_coupled_yaw(talos, talos_motion):
    """Whole, they are distributed by their rows; in parts, they are corners as any sole is."""
    motion = dynacom.Motion(*(talos_motion[key] for key in "tqva"))
    schedule = dynacom.ContactSchedule(["left", "right"], talos_motion["contacts"])
    robot, plain = standing(talos, coupled_yaw=True), standing(talos)
    whole = dynacom.analyzeMotion(robot, motion, schedule)
    for contact in whole.contacts:
        loaded = contact.active & (contact.vertical_force > 1.0)
        assert loaded.sum() > 20
        rows = inequalities(robot.getContact(contact.name))
        assert (contact.wrench[loaded] @ rows.T).max() <= 1e-6
        assert np.nanmax(contact.yaw_usage) <= 1.0 + 1e-9
    gathered = []
    for one in (robot, plain):
        split = dynacom.splitContacts(one)
        names = [part.name for part in split.parts]
        active = np.repeat(talos_motion["contacts"], 4, axis=1)
        parts = dynacom.analyzeMotion(split.robot, motion, dynacom.ContactSchedule(names, active))
        motions = [dynacom.computeContactMotions(r, motion) for r in (one, split.robot)]
        gathered.append(dynacom.gatherParts(one, split, *motions, parts))
    for coupled, other in zip(gathered[0].contacts, gathered[1].contacts, strict=True):
        assert_allclose(coupled.wrench, other.wrench)
        assert_allclose(coupled.friction_usage, other.friction_usage)
        assert np.isnan(coupled.yaw_usage).all()
        assert not np.isnan(other.yaw_usage).all()
