# SPDX-License-Identifier: BSD-2-Clause
"""The motions in examples/data, with the contact wrenches that crocoddyl has solved for."""

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
    closest_by_edges,
    cost,
    point,
    sole,
    to_com,
)

SOLVED, RELAXED = DistributionStatus.Solved, DistributionStatus.Relaxed
G = 9.81

# How many contacts are active at once.
SUPPORTS = {"talos_walk": {1, 2}, "anymal_walk": {3, 4}, "anymal_trot": {2, 4}}


@dataclass
class Walk:
    """A walk or a trot, and a robot with its contacts as crocoddyl has modelled them."""

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

    def go_to(self, frame: int, flat: bool = True) -> None:
        """The dynamics of a frame, with its contacts active."""
        for name, active in zip(self.names, self.arrays["contacts"][frame], strict=True):
            change = self.robot.activateContact if active else self.robot.deactivateContact
            change(name)
        motion = (self.arrays[key][frame] for key in "qva")
        self.robot.computeDynamics(*motion, flatHorizontalGround=flat)

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
    with np.load(WALKS / f"{name}.npz") as file:
        arrays = dict(file)
    yaml = dynacom.load_robot("talos" if name == "talos_walk" else "anymal_c")
    robot = DynaCoM(yaml.model)
    for contact, frame in zip(arrays["contact_names"], arrays["contact_frames"], strict=True):
        if name == "talos_walk":
            fields = {"mu": 0.7, "gu": 0.08, "half_length": 0.10, "half_width": 0.06}
            robot.addContact(sole(frame_name=str(frame), **fields), str(contact), False)
        else:
            ball = point(frame_name=str(frame), mu=0.7, world_aligned=True)
            robot.addContact(ball, str(contact), False)
    return Walk(name, arrays, robot, yaml)


@pytest.fixture(scope="module", params=SUPPORTS)
def walk(request: pytest.FixtureRequest) -> Walk:
    return load(request.param)


@pytest.fixture
def talos_walk() -> Walk:
    return load("talos_walk")


@pytest.fixture
def trot() -> Walk:
    return load("anymal_trot")


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
    assert set(at_once) == SUPPORTS[walk.name]
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
    height = 0.0 if walk.name == "talos_walk" else 0.03
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
        assert walk.robot.getDistribution().isOptimal(1e-9)


@pytest.mark.parametrize("mu", [0.7, 0.05])
@pytest.mark.parametrize("flat", [True, False])
def test_warm_start_changes_no_answer(walk, mu, flat):
    """Contacts come and go, in reach and, on slippery ground, out of it."""
    warm, cold = load(walk.name), load(walk.name)
    cold.robot.setWarmStart(False)
    statuses = set()
    for name in walk.names:
        for dynamics in (warm, cold):
            dynamics.robot.getContact(name).setMu(mu)
    for frame in range(len(walk)):
        for dynamics in (warm, cold):
            dynamics.go_to(frame, flat)
            if flat:
                dynamics.distribute()
        result, expected = warm.robot.getDistribution(), cold.robot.getDistribution()
        assert result.status == expected.status
        size = np.linalg.norm(expected.forces())
        assert_allclose(result.forces(), expected.forces(), rtol=0, atol=1e-9 * size)
        assert_allclose(result.achieved, expected.achieved, rtol=0, atol=1e-9 * expected.scale)
        assert_allclose(warm.robot.getCoP(), cold.robot.getCoP(), rtol=0, atol=1e-9)
        assert result.isOptimal()
        statuses.add(str(result.status))
    assert statuses == ({"Solved"} if mu == 0.7 else {"Solved", "Relaxed"})


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


def assert_as_close_as_can_be(walk: Walk) -> DistributionStatus:
    """What a distribution says and gives, against a sum of the edges of the cones."""
    status, result = walk.distribute(), walk.robot.getDistribution()
    contacts = [walk.robot.getContact(name) for name in walk.robot.getActiveContacts()]
    wrench = walk.ground_wrench()
    expected = closest_by_edges(contacts, wrench)
    distance = expected.distance * np.linalg.norm(wrench) / result.scale
    if not 1e-9 < distance < 1e-7:
        assert status == (SOLVED if distance < 1e-8 else RELAXED)
    assert_allclose(result.achieved, expected.wrench, rtol=0, atol=1e-9 * walk.weight)
    assert_allclose(result.residual, wrench - expected.wrench, rtol=0, atol=1e-9 * walk.weight)
    for contact in contacts:
        assert_within_cones(contact, 1e-11 * walk.weight)
    assert result.isOptimal()
    return status


@pytest.mark.parametrize(("mu", "least", "most"), [(0.05, 0.25, 0.6), (0.0, 0.9, 1.0)])
def test_on_slippery_ground(walk, mu, least, most):
    """The motions were planned for 0.7: with less, a part of their wrenches is out of reach."""
    slippery = load(walk.name)
    for name in slippery.names:
        slippery.robot.getContact(name).setMu(mu)
    relaxed, frames = 0, range(0, len(slippery), 3)
    for frame in frames:
        slippery.go_to(frame)
        relaxed += assert_as_close_as_can_be(slippery) == RELAXED
    assert least <= relaxed / len(frames) <= most


def test_a_foot_less_is_not_enough(talos_walk):
    """The schedule matters: on the wrong foot alone Talos cannot do what it does."""
    walk = talos_walk
    for frame in np.flatnonzero(walk.arrays["contacts"].sum(axis=1) == 1)[::10]:
        walk.go_to(frame)
        (standing,) = walk.robot.getActiveContacts()
        (swinging,) = set(walk.names) - {standing}
        walk.robot.activateContact(swinging)
        walk.robot.deactivateContact(standing)
        assert assert_as_close_as_can_be(walk) == RELAXED
        walk.robot.deactivateContact(swinging)
        assert walk.distribute() == DistributionStatus.NoContact


def test_one_foot_of_two_is_not_enough(trot):
    """Nor can ANYmal trot on one foot."""
    for frame in np.flatnonzero(trot.arrays["contacts"].sum(axis=1) == 2)[::5]:
        trot.go_to(frame)
        trot.robot.deactivateContact(trot.robot.getActiveContacts()[0])
        assert assert_as_close_as_can_be(trot) == RELAXED


@pytest.mark.parametrize("contacts", ["crocoddyl's", "the package's"])
def test_two_points_give_all_but_one_component(trot, contacts):
    """Two points have no moment about the line from one to the other.

    Crocoddyl's points are the origins of the feet's frames; those of the package's robot lie below
    the centres of the feet, up to 14 mm away. So where ANYmal stands on two feet, in
    120 of the 194 frames, the motion needs no moment about the one line, and its wrench is Solved.
    About the other it does, and its wrench is Relaxed: that moment is missing, and nothing else.
    """
    if contacts == "the package's":
        trot.robot = trot.yaml.dynacom()
    robot, distances = trot.robot, []
    for frame in np.flatnonzero(trot.arrays["contacts"].sum(axis=1) == 2):
        trot.go_to(frame)
        assert_as_close_as_can_be(trot)
        assert np.linalg.matrix_rank(robot.ne_A()) == 5
        assert robot.computeWrenchMargin().margin == 0.0

        com, names = robot.getCoM(), robot.getActiveContacts()
        one, other = (robot.getContact(name).getSurfacePose().translation - com for name in names)
        line = (other - one) / np.linalg.norm(other - one)
        # The moment of a wrench w about the line is n' w.
        n = np.concatenate([np.cross(one, line), line])
        missing = (n @ trot.ground_wrench()) * n / (n @ n)
        residual = robot.getDistribution().residual
        assert_allclose(residual, missing, rtol=0, atol=1e-11 * trot.weight)
        distances.append(np.linalg.norm(residual) / trot.weight)
    assert len(distances) == 120
    if contacts == "crocoddyl's":
        assert max(distances) < 1e-12
    else:
        assert 1e-6 < min(distances) < max(distances) < 2e-3


def test_what_is_written_about_the_trot(root, trot):
    """The numbers in docs/files.md."""
    robot, model = trot.yaml.dynacom(), trot.yaml.model
    arrays, data = trot.arrays, model.createData()
    motion = Motion(*(arrays[key] for key in "tqva"))
    analysis = dynacom.analyzeMotion(robot, motion, ContactSchedule(trot.names, arrays["contacts"]))
    force, moment = np.split(analysis.residual, 2, axis=1)
    away = 0.0
    for q, active in zip(arrays["q"], arrays["contacts"], strict=True):
        robot.computeDynamics(q, np.zeros(model.nv), np.zeros(model.nv))
        pin.framesForwardKinematics(model, data, q)
        for k in np.flatnonzero(active):
            planned = data.oMf[model.getFrameId(trot.frames[k])].translation
            own = robot.getContact(trot.names[k]).getSurfacePose().translation
            away = max(away, np.linalg.norm(own - planned))
    text = " ".join((root / "docs/files.md").read_text().split())
    for number in (
        f"up to {1e3 * away:.0f} mm away",
        f"{analysis.status.count(RELAXED)} of {len(trot)} frames on two feet are `Relaxed`",
        f"by up to {np.linalg.norm(force, axis=1).max():.2f} N",
        f"{np.linalg.norm(moment, axis=1).max():.2f} N·m",
        f"the other {analysis.status.count(SOLVED)}, on four, `Solved`",
    ):
        assert number in text


@pytest.mark.parametrize("flat", [True, False])
def test_analysis_of_the_robot_that_comes_with_the_package(walk, flat):
    """All the way: robot file, motion, schedule, every frame."""
    arrays = walk.arrays
    motion = Motion(arrays["t"], arrays["q"], arrays["v"], arrays["a"])
    schedule = ContactSchedule(walk.names, arrays["contacts"])
    analysis = dynacom.analyzeMotion(walk.yaml.dynacom(), motion, schedule, flat)
    # test_two_points_give_all_but_one_component tells why.
    two_points = (walk.name == "anymal_trot") & (arrays["contacts"].sum(axis=1) == 2)
    assert analysis.status == list(np.where(two_points, RELAXED, SOLVED))
    residual = np.linalg.norm(analysis.residual, axis=1)
    assert_allclose(residual[~two_points], 0.0, rtol=0, atol=1e-11 * walk.weight)
    assert (residual <= 2e-3 * walk.weight).all()
    assert [contact.name for contact in analysis.contacts] == walk.names
    vertical = np.array([contact.vertical_force for contact in analysis.contacts])
    assert_allclose(
        vertical.sum(axis=0),
        analysis.ground_force[:, 2] - analysis.residual[:, 2],
        rtol=0,
        atol=1e-11 * walk.weight,
    )
    assert (vertical[arrays["contacts"].T] > 0.0).all()
    assert_array_equal(vertical[~arrays["contacts"].T], 0.0)
    for frame in range(0, len(walk), 20):
        walk.go_to(frame)
        wrench = np.concatenate([analysis.ground_force[frame], analysis.ground_torque[frame]])
        assert_allclose(wrench, walk.ground_wrench(), rtol=0, atol=1e-12 * walk.weight)
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
