# SPDX-License-Identifier: BSD-2-Clause
"""The walks in examples/data, with the contact wrenches that crocoddyl has solved for."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import dynacom
from dynacom import ContactSchedule, DistributionStatus, DynaCoM, Motion
from dynacom.robots import Robot
from helpers import (
    WALKS,
    assert_gives_wrench,
    assert_within_cones,
    cost,
    point,
    sole,
    to_com,
)

SOLVED = DistributionStatus.Solved
G = 9.81


@dataclass
class Walk:
    """A walk, and a robot that knows its contacts as crocoddyl has modelled them."""

    name: str
    arrays: dict[str, np.ndarray]
    robot: DynaCoM
    yaml: Robot

    def __post_init__(self) -> None:
        self.weight = G * self.robot.getMass()
        self.names = [str(name) for name in self.arrays["contact_names"]]
        self.frames = [str(name) for name in self.arrays["contact_frames"]]

    def __len__(self) -> int:
        return len(self.arrays["t"])

    def go_to(self, frame: int) -> None:
        """The dynamics of a frame, with its contacts active."""
        for name, active in zip(self.names, self.arrays["contacts"][frame], strict=True):
            change = self.robot.activateContact if active else self.robot.deactivateContact
            change(name)
        self.robot.computeDynamics(*(self.arrays[key][frame] for key in "qva"))

    def ground_wrench(self) -> np.ndarray:
        robot = self.robot
        return np.concatenate([robot.getGroundCoMForce(), robot.getGroundCoMTorque()])

    def distribute(self) -> DistributionStatus:
        return self.robot.distributeForce(
            self.robot.getGroundCoMForce(), self.robot.getGroundCoMTorque(), self.robot.getCoM()
        )

    def crocoddyl(self, frame: int) -> dict[str, pin.Force]:
        """Crocoddyl's wrench of each active contact, about the world's origin."""
        model, data = self.robot.getModel(), self.robot.getData()
        wrenches = {}
        for k in np.flatnonzero(self.arrays["contacts"][frame]):
            pose = pin.updateFramePlacement(model, data, model.getFrameId(self.frames[k]))
            wrench = pin.Force(self.arrays["contact_wrenches"][frame, k])
            wrenches[self.names[k]] = pose.act(wrench)
        return wrenches

    def crocoddyl_forces(self, frame: int) -> np.ndarray:
        """The same as forces of the active contacts, in their surfaces' frames, stacked."""
        wrenches = self.crocoddyl(frame)
        forces = []
        for name in self.robot.getActiveContacts():
            contact = self.robot.getContact(name)
            force = contact.getSurfacePose().actInv(wrenches[name]).vector
            # Points have no moments.
            assert_allclose(force[contact.cols() :], 0.0, rtol=0, atol=1e-12 * self.weight)
            forces.append(force[: contact.cols()])
        return np.concatenate(forces)


def load(name: str) -> Walk:
    with np.load(WALKS / f"{name}_walk.npz") as file:
        arrays = dict(file)
    yaml = dynacom.load_robot({"talos": "talos", "anymal": "anymal_c"}[name])
    robot = DynaCoM(yaml.model)
    for contact, frame in zip(arrays["contact_names"], arrays["contact_frames"], strict=True):
        if name == "talos":
            fields = {"mu": 0.7, "gu": 0.08, "half_length": 0.10, "half_width": 0.06}
            robot.addContact(sole(frame_name=str(frame), **fields), str(contact), False)
        else:
            ball = point(frame_name=str(frame), mu=0.7, world_aligned=True)
            robot.addContact(ball, str(contact), False)
    return Walk(name, arrays, robot, yaml)


@pytest.fixture(scope="module", params=["talos", "anymal"])
def walk(request: pytest.FixtureRequest) -> Walk:
    return load(request.param)


@pytest.fixture(scope="module")
def talos_walk() -> Walk:
    return load("talos")


def test_arrays(walk):
    """What the files promise, so that the tests below mean what they say."""
    arrays, frames = walk.arrays, len(walk)
    model = walk.robot.getModel()
    count = len(walk.names)
    shapes = {
        "q": (frames, model.nq),
        "v": (frames, model.nv),
        "a": (frames, model.nv),
        "contacts": (frames, count),
        "contact_wrenches": (frames, count, 6),
    }
    for key, shape in shapes.items():
        assert arrays[key].shape == shape
        assert np.isfinite(arrays[key]).all()
    assert arrays["contacts"].dtype == bool
    steps = np.diff(arrays["t"])
    assert 0.0 < steps.min() <= steps.max() <= 0.03 + 1e-12
    touchdowns = np.count_nonzero(np.diff(arrays["contacts"].astype(int), axis=0) == 1)
    assert touchdowns >= 4
    at_once = arrays["contacts"].sum(axis=1)
    assert set(at_once) == ({1, 2} if walk.name == "talos" else {3, 4})
    assert not arrays["contact_wrenches"][~arrays["contacts"]].any()


def test_motion_is_consistent(walk):
    """v[k+1] = v[k] + a[k] dt, q[k+1] = q[k] + v[k+1] dt, and standing feet stand."""
    arrays, model = walk.arrays, walk.robot.getModel()
    data = model.createData()
    for k, dt in enumerate(np.diff(arrays["t"])):
        v = arrays["v"][k] + dt * arrays["a"][k]
        assert_allclose(arrays["v"][k + 1], v, rtol=0, atol=1e-9)
        q = pin.integrate(model, arrays["q"][k], dt * v)
        assert_allclose(pin.difference(model, arrays["q"][k + 1], q), 0.0, rtol=0, atol=1e-9)
        places = []
        for configuration in (arrays["q"][k], arrays["q"][k + 1]):
            pin.framesForwardKinematics(model, data, configuration)
            places.append([data.oMf[model.getFrameId(frame)].translation for frame in walk.frames])
        standing = arrays["contacts"][k] & arrays["contacts"][k + 1]
        assert_allclose(*(np.array(place)[standing] for place in places), rtol=0, atol=1e-3)


def test_contact_wrenches_sum_to_the_ground_wrench(walk):
    """In every frame: crocoddyl's contact dynamics against the centroidal dynamics."""
    for frame in range(len(walk)):
        walk.go_to(frame)
        com = walk.robot.getCoM()
        total = sum(to_com(wrench, com) for wrench in walk.crocoddyl(frame).values())
        assert_allclose(total, walk.ground_wrench(), rtol=0, atol=1e-12 * walk.weight)


def test_centre_of_pressure_is_that_of_the_contact_wrenches(walk):
    """(5) against the axis of crocoddyl's wrenches, where it meets the ground."""
    height = 0.0 if walk.name == "talos" else 0.03
    walk.robot.setGroundHeight(height)
    for frame in range(len(walk)):
        walk.go_to(frame)
        wrench = sum(walk.crocoddyl(frame).values(), pin.Force.Zero())
        at_ground = to_com(wrench, np.array([0.0, 0.0, height]))
        expected = np.array([-at_ground[4], at_ground[3]]) / at_ground[2]
        assert_allclose(walk.robot.getCoP(), expected, rtol=0, atol=1e-12)


def test_every_frame_is_solved(walk):
    """The ground wrench is reached, and forces stay within all inequalities."""
    for frame in range(len(walk)):
        walk.go_to(frame)
        assert walk.distribute() == SOLVED
        assert_gives_wrench(walk.robot, 1e-11 * walk.weight)
        assert (walk.robot.uni_A() @ walk.robot.allForces()).max() <= 1e-12 * walk.weight
        assert (walk.robot.fri_A() @ walk.robot.allForces()).max() <= 1e-12 * walk.weight
        for name in walk.robot.getActiveContacts():
            assert_within_cones(walk.robot.getContact(name), 1e-12 * walk.weight)


def test_single_support(talos_walk):
    """One sole has no choice: its wrench is crocoddyl's own."""
    walk, compared = talos_walk, 0
    for frame in np.flatnonzero(walk.arrays["contacts"].sum(axis=1) == 1):
        walk.go_to(frame)
        assert walk.distribute() == SOLVED
        (name,) = walk.robot.getActiveContacts()
        own = walk.arrays["contact_wrenches"][frame, walk.names.index(name)]
        # The sole's frame is that which crocoddyl's wrench is given in.
        force = walk.robot.getContact(name).appliedForce()
        assert_allclose(force, own, rtol=0, atol=1e-11 * walk.weight)
        compared += 1
    assert compared >= 100


def test_no_dearer_than_crocoddyl(walk):
    """Crocoddyl minimises something else: its forces are feasible, so ours cost no more."""
    robot, gains = walk.robot, []
    for frame in range(len(walk)):
        walk.go_to(frame)
        assert walk.distribute() == SOLVED
        theirs = walk.crocoddyl_forces(frame)
        assert (robot.uni_A() @ theirs).max() <= 0.0
        assert (robot.fri_A() @ theirs).max() <= 0.0
        assert_allclose(robot.ne_A() @ theirs, robot.ne_b(), rtol=0, atol=1e-11 * walk.weight)
        ratio = cost(robot.reg_A(), robot.allForces()) / cost(robot.reg_A(), theirs)
        assert ratio <= 1.0 + 1e-12
        gains.append(1.0 - ratio)
    # Where there is a choice, crocoddyl did choose something else.
    assert max(gains) > 0.01


def test_a_foot_less_is_not_enough(talos_walk):
    """The schedule matters: on the wrong foot alone Talos cannot do what it does."""
    walk = talos_walk
    for frame in np.flatnonzero(walk.arrays["contacts"].sum(axis=1) == 1)[::10]:
        walk.go_to(frame)
        (standing,) = walk.robot.getActiveContacts()
        (swinging,) = set(walk.names) - {standing}
        walk.robot.activateContact(swinging)
        walk.robot.deactivateContact(standing)
        assert walk.distribute() == DistributionStatus.Infeasible
        walk.robot.deactivateContact(swinging)
        assert walk.distribute() == DistributionStatus.NoContact


@pytest.mark.parametrize("flat", [True, False])
def test_analysis_of_the_robot_that_comes_with_the_package(walk, flat):
    """All the way: robot file, motion, schedule, every frame."""
    arrays = walk.arrays
    motion = Motion(arrays["t"], arrays["q"], arrays["v"], arrays["a"])
    schedule = ContactSchedule(walk.names, arrays["contacts"])
    analysis = dynacom.analyzeMotion(walk.yaml.dynacom(), motion, schedule, flat)
    assert analysis.status == [SOLVED] * len(walk)
    assert_allclose(analysis.residual, 0.0, rtol=0, atol=1e-11 * walk.weight)
    assert [contact.name for contact in analysis.contacts] == walk.names
    vertical = np.array([contact.vertical_force for contact in analysis.contacts])
    assert_allclose(
        vertical.sum(axis=0), analysis.ground_force[:, 2], rtol=0, atol=1e-11 * walk.weight
    )
    assert (vertical[arrays["contacts"].T] > 0.0).all()
    assert_array_equal(vertical[~arrays["contacts"].T], 0.0)
    for frame in range(0, len(walk), 20):
        walk.go_to(frame)
        wrench = np.concatenate([analysis.ground_force[frame], analysis.ground_torque[frame]])
        assert_array_equal(wrench, walk.ground_wrench())
    assert_allclose(analysis.omega, np.sqrt(G / analysis.com[:, 2].mean()), rtol=1e-12)


def test_both_centres_of_pressure_on_a_walk(talos_walk):
    """(5) and (6) are the same where soles are on the ground to a tenth of a millimetre."""
    walk = talos_walk
    for frame in range(0, len(walk), 5):
        walk.go_to(frame)
        flat = walk.robot.getCoP()
        walk.robot.computeDynamics(
            *(walk.arrays[key][frame] for key in "qva"), flatHorizontalGround=False
        )
        assert walk.robot.getDistributionStatus() == SOLVED
        assert_allclose(walk.robot.getCoP(), flat, rtol=0, atol=1e-4)
