# SPDX-License-Identifier: BSD-2-Clause
"""What is to be found on a plane: centre of pressure, zero-moment point, pivots."""

import re

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import dynacom
from dynacom import CentroidalWrench, DistributionStatus, DynaCoM, GroundPlane
from helpers import CALM, THOROUGH

seeds = st.integers(0, 2**16)


def make_wrench(force, torque) -> CentroidalWrench:
    wrench = CentroidalWrench()
    wrench.force, wrench.torque = force, torque
    return wrench


def random_slope(rng: np.random.Generator) -> tuple[GroundPlane, np.ndarray]:
    """A plane, and axes whose third is its unit normal."""
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return GroundPlane(rng.uniform(-1, 1, 3), rng.uniform(0.1, 10.0) * axes[:, 2]), axes


def test_planes():
    plane = GroundPlane()
    assert_array_equal(plane.point, np.zeros(3))
    assert_array_equal(plane.normal, [0.0, 0.0, 1.0])
    assert GroundPlane([0, 0, 0]) == GroundPlane(point=(0, 0, 0), normal=(0, 0, 1)) == plane
    plane.normal = [0, 3, 4]
    assert plane != GroundPlane()
    assert repr(plane) == "GroundPlane(point=[0 0 0], normal=[0 3 4])"
    other = plane.copy()
    other.point = np.ones(3)
    assert_array_equal(plane.point, np.zeros(3))
    with pytest.raises(ValueError, match=r"normal must have 3 components, got 2"):
        GroundPlane([0, 0, 0], [0, 1])
    with pytest.raises(TypeError, match="point must be an array"):
        GroundPlane("here")


@pytest.mark.parametrize(
    ("plane", "message"),
    [
        (GroundPlane([0, 0, 0], [0, 0, 0]), "normal must be finite and not zero, got 0 0 0"),
        (GroundPlane([0, 0, 0], [0, np.nan, 1]), "normal must be finite and not zero, got"),
        (GroundPlane([0, 0, np.inf]), "point must be finite, got"),
    ],
)
def test_planes_that_are_none(plane, message, talos, talos_standing):
    robot, rest = talos.dynacom(), np.zeros(talos.model.nv)
    robot.computeNL(3.0, talos_standing, rest, rest)
    cop = robot.getCoP()
    for call in (
        plane.validate,
        lambda: dynacom.computeCoP(make_wrench(np.ones(3), np.ones(3)), np.ones(3), plane),
        lambda: dynacom.computeCMP(np.ones(3), np.ones(3), plane),
        lambda: robot.computeDynamics(talos_standing, rest, rest, np.zeros(6), plane),
        lambda: robot.computeDynamics(robot.getData(), np.zeros(6), plane),
        lambda: robot.computeNL(3.0, talos_standing, rest, rest, np.zeros(6), plane),
        lambda: robot.getCMP(plane),
        lambda: robot.getZMP(plane),
    ):
        with pytest.raises(ValueError, match=re.escape(f"GroundPlane.{message}")):
            call()
    assert_array_equal(robot.getCoP(), cop)


@THOROUGH
@given(seeds)
def test_centre_of_pressure_is_that_of_forces_on_the_plane(seed):
    """Wherever on it forces press, and however they pull sideways: by their normal parts."""
    rng = np.random.default_rng(seed)
    plane, axes = random_slope(rng)
    com = rng.uniform(-2.0, 2.0, 3)
    places = plane.point + rng.uniform(-1.0, 1.0, (5, 2)) @ axes[:, :2].T
    pressures = rng.uniform(1.0, 100.0, 5)
    forces = np.column_stack([rng.uniform(-50.0, 50.0, (5, 2)), pressures]) @ axes.T
    torque = np.cross(places - com, forces).sum(axis=0)
    wrench = make_wrench(forces.sum(axis=0), torque)
    cop = dynacom.computeCoP(groundWrench=wrench, com=com, plane=plane)
    assert_allclose(cop, pressures @ places / pressures.sum(), rtol=0, atol=1e-11)
    assert np.isnan(dynacom.computeCoP(wrench, com, plane, minimalNormalForce=1e3)).all()


@CALM
@given(seeds)
def test_centroidal_moment_pivot_is_on_the_line_of_the_force(seed):
    rng = np.random.default_rng(seed)
    plane, axes = random_slope(rng)
    com = rng.uniform(-2.0, 2.0, 3)
    force = axes @ [*rng.uniform(-50.0, 50.0, 2), rng.uniform(50.0, 100.0)]
    pivot = dynacom.computeCMP(groundForce=force, com=com, plane=plane)
    assert abs(axes[:, 2] @ (pivot - plane.point)) < 1e-12
    assert_allclose(np.cross(com - pivot, force), np.zeros(3), rtol=0, atol=1e-10)
    assert np.isnan(dynacom.computeCMP(force, com, plane, minimalNormalForce=1e3)).all()


def test_repellent_points_by_hand():
    state = dynacom.CentroidalState()
    state.com, state.acom = [1, 2, 3], [4, -8, 5]
    assert_array_equal(dynacom.computeVRP3D(state=state, omega=2), [0, 4, 1.75])
    ecmp = dynacom.computeECMP(state=state, gravity=[0, 0, -10], omega=2)
    assert_array_equal(ecmp, [0, 4, 1.75 - 2.5])
    with pytest.raises(ValueError, match="omega"):
        dynacom.computeECMP(state, [0, 0, -10], 0.0)


@pytest.mark.parametrize("of_data", [False, True])
def test_a_robot_on_a_plane(of_data, talos, talos_standing):
    """The class and the functions behind it tell the same."""
    robot, rest = talos.dynacom(), np.zeros(talos.model.nv)
    q, wrench = talos_standing, np.array([60.0, 0.0, 0.0, 0.0, 5.0, 0.0])
    plane = GroundPlane([0.0, 0.0, 0.1], [-0.2, 0.0, 1.0])
    if of_data:
        data = robot.getModel().createData()
        pin.computeCentroidalMomentumTimeVariation(robot.getModel(), data, q, rest, rest)
        robot.computeDynamics(data=data, extWrench=wrench, ground=plane)
        robot.computeNL(3.0)
    else:
        robot.computeDynamics(q, rest, rest, wrench, plane)
        cop = robot.getCoP3D()
        robot.computeNL(omega=3.0, q=q, v=rest, a=rest, extWrench=wrench, ground=plane)
        assert_array_equal(robot.getCoP3D(), cop)
    com, force = robot.getCoM(), robot.getGroundCoMForce()
    ground = make_wrench(force, robot.getGroundCoMTorque())
    assert_array_equal(robot.getCoP3D(), dynacom.computeCoP(ground, com, plane))
    assert_array_equal(robot.getCoP(), robot.getCoP3D()[:2])
    assert_array_equal(robot.getCMP(plane), dynacom.computeCMP(force, com, plane))
    assert_array_equal(robot.getVRP(), robot.getVRP3D()[:2])
    assert_array_equal(robot.getNL(), robot.getCoP() - robot.getVRP())
    assert_allclose(robot.getVRP3D() - robot.getECMP(), [0.0, 0.0, 9.81 / 9.0], rtol=0, atol=1e-12)
    # Nobody has been asked what the contacts give.
    assert robot.getDistributionStatus() == DistributionStatus.NoContact
    assert np.isnan(robot.getZMP(plane)).all()
    assert robot.distributeForce(force, ground.torque, com) == DistributionStatus.Solved
    assert_allclose(robot.getZMP(plane), robot.getCoP3D(), rtol=0, atol=1e-7)


def test_the_flag_is_still_a_flag(talos, talos_standing):
    robot, rest = talos.dynacom(), np.zeros(talos.model.nv)
    zero = np.zeros(6)
    robot.computeDynamics(talos_standing, rest, rest, zero, True)
    flat = robot.getCoP3D()
    assert robot.getDistributionStatus() == DistributionStatus.NoContact
    robot.computeDynamics(talos_standing, rest, rest, zero, GroundPlane())
    assert_array_equal(robot.getCoP3D(), flat)
    robot.computeDynamics(talos_standing, rest, rest, zero, False)
    assert robot.getDistributionStatus() == DistributionStatus.Solved
    for wrong in ("flat", [0, 0, 1]):
        with pytest.raises(TypeError):
            robot.computeDynamics(talos_standing, rest, rest, zero, wrong)


def test_before_initialize():
    robot = DynaCoM()
    for point in (robot.getCoP3D(), robot.getVRP3D(), robot.getECMP()):
        assert point.shape == (3,)
        assert np.isnan(point).all()
    assert np.isnan(robot.getCMP(GroundPlane())).all()
    assert np.isnan(robot.getZMP(GroundPlane())).all()
    with pytest.raises(dynacom.NotReadyError, match="initialize"):
        robot.computeDynamics(np.zeros(7), *np.zeros((3, 6)), GroundPlane())
