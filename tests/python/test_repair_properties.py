# SPDX-License-Identifier: BSD-2-Clause
"""What holds for every repair, of the centre of mass alone and of the whole body.

Robots are symmetric, and their motions ask a little more than contacts give: walks, hops and
standing, swayed at random.
"""

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import dynacom
from dynacom import (
    CentroidalChange,
    CentroidalFilterSettings,
    ContactSchedule,
    Motion,
    PartRobot,
    RepairedMotion,
    RepairSettings,
)
from helpers import CALM, CORNERS, sole
from puppet import FEET, HALF_LENGTH, HALF_WIDTH, Play, hops, make_puppet, stand, walk

RATE = 60.0
# What is the same: a part of the largest number, and so much of it [m], [rad], [weight × s]. Where
# a wrench is as good as within the cones, rounding decides, and distanceToFeasible() takes that of
# which a thousandth is missing, and displacements of less than 0.01 mm, for good.
SAME, NOTHING = 1e-3, 1e-5
# Where a sole's corners are, in its half sides.
PLACES = {
    "front_left": (1.0, 1.0),
    "rear_left": (-1.0, 1.0),
    "rear_right": (-1.0, -1.0),
    "front_right": (1.0, -1.0),
}
# The mirror is y = 0: what it does to a place and a quaternion, and to a force and a moment.
PLACE = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0])
AXIAL = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
# The other corner in it.
ACROSS = {
    "front_left": "front_right",
    "front_right": "front_left",
    "rear_left": "rear_right",
    "rear_right": "rear_left",
}


@dataclass(frozen=True)
class Case:
    """A motion of a robot with feet, left and right, whose joints are the left leg's and then the
    right leg's."""

    model: pin.Model
    #: What the mirror does to the joints of a leg.
    mirror: np.ndarray
    time: np.ndarray
    q: np.ndarray
    #: Parts' names -> when they carry.
    active: dict[str, np.ndarray]
    friction: float = 0.8

    @property
    def weight(self) -> float:
        return pin.computeTotalMass(self.model) * -self.model.gravity.linear[2]

    @property
    def motion(self) -> Motion:
        return dynacom.differentiate(self.model, self.time, self.q)

    @property
    def schedule(self) -> ContactSchedule:
        return ContactSchedule(list(self.active), np.column_stack(list(self.active.values())))

    @property
    def split(self) -> PartRobot:
        robot = dynacom.DynaCoM(self.model)
        for foot in FEET:
            contact = sole(
                frame_name=f"{foot}_foot",
                mu=self.friction,
                gu=0.05,
                half_length=HALF_LENGTH,
                half_width=HALF_WIDTH,
            )
            robot.addContact(contact, foot)
        return dynacom.splitContacts(robot)

    def repair(self, settings: RepairSettings | None = None) -> RepairedMotion:
        return dynacom.repairMotion(
            self.split, self.motion, self.schedule, settings or RepairSettings()
        )

    def measure(self, settings: CentroidalFilterSettings | None = None) -> CentroidalChange:
        split, motion = self.split, self.motion
        return dynacom.distanceToFeasible(
            split,
            dynacom.computeContactMotions(split.robot, motion),
            dynacom.analyzeMotion(split.robot, motion, self.schedule),
            self.schedule,
            settings or CentroidalFilterSettings(),
        )

    def mirrored(self) -> "Case":
        return replace(
            self,
            q=mirror(self.q, PLACE, self.mirror),
            active={
                f"{other}.{ACROSS[corner]}": self.active[f"{foot}.{corner}"]
                for foot, other in zip(FEET, reversed(FEET), strict=True)
                for corner in CORNERS
            },
        )

    def placed(self, move: pin.SE3) -> "Case":
        q = self.q.copy()
        for row in q:
            row[:7] = pin.SE3ToXYZQUAT(move * pin.XYZQUATToSE3(row[:7]))
        return replace(self, q=q)


def mirror(values: np.ndarray, root: np.ndarray, leg: np.ndarray) -> np.ndarray:
    """Rows of a root and two legs."""
    left, right = np.split(values[:, root.size :], 2, axis=1)
    return np.hstack([root * values[:, : root.size], leg * right, leg * left])


def biped() -> pin.Model:
    """A trunk above two legs of five joints that turn: hip (roll, pitch), knee, ankle (pitch,
    roll)."""
    model = pin.Model()
    trunk = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "trunk")
    model.appendBodyToJoint(trunk, pin.Inertia.FromBox(20.0, 0.2, 0.3, 0.4), shifted(z=0.2))
    for foot, side in zip(FEET, (1.0, -1.0), strict=True):
        joint, length = trunk, 0.0
        kinds = [pin.JointModelRX, *[pin.JointModelRY] * 3, pin.JointModelRX]
        for number, (kind, below) in enumerate(zip(kinds, (0.0, 0.4, 0.4, 0.0, 0.0), strict=True)):
            place = shifted(y=0.1 * side) if number == 0 else shifted(z=-length)
            joint = model.addJoint(joint, kind(), place, f"{foot}_{number}")
            mass = 3.0 if below else 0.5
            box = pin.Inertia.FromBox(mass, 0.1, 0.1, max(below, 0.05))
            model.appendBodyToJoint(joint, box, shifted(z=-0.5 * below))
            length = below
        frame = pin.Frame(f"{foot}_foot", joint, shifted(z=-0.05), pin.FrameType.OP_FRAME)
        model.addFrame(frame)
    return model


def shifted(y: float = 0.0, z: float = 0.0) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([0.0, y, z]))


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> dict[str, pin.Model]:
    return {
        "puppet": make_puppet(tmp_path_factory.mktemp("puppet"), sole=1.0).model,
        "massless": make_puppet(tmp_path_factory.mktemp("massless")).model,
        "biped": biped(),
    }


def sway(model: pin.Model, time: np.ndarray, q: np.ndarray, size: np.ndarray, seed: int):
    """Configurations that swing around these, each coordinate by so much, at 1 to 1.6 Hz."""
    rng = np.random.default_rng(seed)
    phase, rate = rng.uniform(0.0, 6.0, model.nv), rng.uniform(6.0, 10.0, model.nv)
    steps = size * rng.uniform(0.5, 1.0, model.nv) * np.sin(time[:, None] * rate + phase)
    return np.array([pin.integrate(model, *pair) for pair in zip(q, steps, strict=True)])


def of_play(model: pin.Model, play: Play, first: float, seconds: float, size: float, seed: int):
    """A part of a puppet's play, swayed: its body by so much [m], its feet by little."""
    frames = slice(round(first * RATE), round((first + seconds) * RATE))
    time = play.time[frames] - play.time[frames][0]
    sizes = np.concatenate([np.repeat([size, 0.5 * size, 0.1 * size], 3), np.full(3, 0.1 * size)])
    q = sway(model, time, play.clip().q[frames], sizes, seed)
    active = {f"{foot}.{corner}": play.active[foot][frames] for foot in FEET for corner in CORNERS}
    return Case(model, np.array([1.0, -1.0, 1.0]), time, q, active)


def of_biped(model: pin.Model, heel_is_up: bool, size: float, seed: int) -> Case:
    """Stands with bent knees and sways; its left heel may be up for a while, its outer corner a
    little longer."""
    time = np.arange(60) / RATE
    leg = [0.0, -0.4, 0.8, -0.4, 0.0]
    q = np.tile(np.concatenate([[0.0, 0.0, 0.8, 0.0, 0.0, 0.0, 1.0], leg, leg]), (len(time), 1))
    sizes = np.concatenate([np.repeat([size, 0.5 * size], 3), np.full(10, 0.2 * size)])
    q = sway(model, time, q, sizes, seed)
    active = {f"{foot}.{corner}": np.full(len(time), True) for foot in FEET for corner in CORNERS}
    if heel_is_up:
        active["left.rear_left"][15:40] = active["left.rear_right"][20:35] = False
    return Case(model, np.array([-1.0, 1.0, 1.0, 1.0, -1.0]), time, q, active)


#: A puppet's play, the part of it that is taken, first and how long [s].
PLAYS = {
    "standing": (stand(rate=RATE, seconds=2.0), 0.0, 1.0),
    "walking": (walk(rate=RATE, steps=3, stride=0.2, stand=0.4), 0.3, 1.2),
    "hopping": (hops(rate=RATE, count=1), 0.6, 1.2),
}
#: How far motions sway at the most, so that they ask a little more than contacts give [m].
SWAYS = {
    "standing": 0.04,
    "swaying": 0.04,
    "on a toe": 0.04,
    "walking": 0.02,
    "hopping": 0.02,
}
ON_GROUND = [name for name in SWAYS if name != "hopping"]


def motions(*names: str) -> st.SearchStrategy[tuple[str, float, int]]:
    """Which motion, which part of the sway, and a seed."""
    return st.tuples(st.sampled_from(names), st.floats(0.3, 1.0), st.integers(0, 2**32 - 1))


ANY = motions(*SWAYS)


def make_case(models: dict[str, pin.Model], motion: tuple[str, float, int]) -> Case:
    name, share, seed = motion
    size = share * SWAYS[name]
    if name in PLAYS:
        return of_play(models["puppet"], *PLAYS[name], size, seed)
    return of_biped(models["biped"], name == "on a toe", size, seed)


def repaired(case: Case, settings: RepairSettings | None = None) -> RepairedMotion:
    """Of a case that needs it."""
    found = case.repair(settings)
    assume(found.change.any())
    return found


def measured(case: Case, settings: CentroidalFilterSettings | None = None) -> CentroidalChange:
    found = case.measure(settings)
    assert found.converged
    return found


def assert_same(one: np.ndarray, other: np.ndarray) -> None:
    assert_allclose(one, other, rtol=0, atol=NOTHING + SAME * np.abs(other).max())


@CALM
@given(ANY)
def test_mirror(models, motion):
    """The left hand of the world is the right hand of its image."""
    case = make_case(models, motion)
    image = case.mirrored()
    one, other = repaired(case), image.repair()
    assert_same(other.change, mirror(one.change, AXIAL, case.mirror))
    moves = other.motion.q - image.q, one.motion.q - case.q
    assert_same(moves[0], mirror(moves[1], PLACE, case.mirror))
    assert other.within_reach == one.within_reach
    one, other = measured(case), measured(image)
    assert_same(other.com, AXIAL[:3] * one.com)
    assert_same(
        other.angular_momentum / case.weight, AXIAL[3:] * one.angular_momentum / case.weight
    )


@CALM
@given(ANY, st.integers(0, 3), st.tuples(*[st.floats(-5.0, 5.0)] * 3))
def test_place_and_quarter_turns(models, motion, turns, place):
    """The friction pyramids stand along the axes of the world."""
    case = make_case(models, motion)
    move = pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.5 * np.pi * turns])), np.array(place))
    moved = case.placed(move)
    assert_same(moved.repair().change, repaired(case).change)
    assert_same(measured(moved).com, measured(case).com @ move.rotation.T)


@CALM
@given(ANY, st.floats(-np.pi, np.pi))
def test_yaw_without_friction(models, motion, yaw):
    """Pyramids without width have no axes."""
    case = replace(make_case(models, motion), friction=0.0)
    moved = case.placed(pin.SE3(pin.exp3(np.array([0.0, 0.0, yaw])), np.zeros(3)))
    assert_same(moved.repair().change, repaired(case).change)


@CALM
@given(ANY, st.floats(-2.0, 2.0))
def test_mass(models, motion, exponent):
    """Of robots that differ in nothing else, each moves as the other, at forces in proportion."""
    case, factor = make_case(models, motion), 10.0**exponent
    heavy = pin.Model(case.model)
    for joint, inertia in enumerate(case.model.inertias):
        heavy.inertias[joint] = pin.Inertia(
            factor * inertia.mass, inertia.lever, factor * inertia.inertia
        )
    other = replace(case, model=heavy)
    assert_same(other.repair().change, repaired(case).change)
    one, other = measured(case), measured(other)
    assert_same(other.com, one.com)
    assert_same(other.angular_momentum / (factor * case.weight), one.angular_momentum / case.weight)


@CALM
@given(ANY, st.floats(-1.0, 1.0))
def test_time_and_gravity(models, motion, exponent):
    """All s times as slow where gravity is s² times as small: wrenches are the same parts of the
    weight. Costs are, too, in the ratio of durations, where the settings of accelerations are s²
    times as small, and that of the angular momentum, over the weight, and durations s times as
    large."""
    case, s = make_case(models, motion), 4.0**exponent
    light = pin.Model(case.model)
    light.gravity = pin.Motion(case.model.gravity.vector / s**2)
    slow = replace(case, model=light, time=s * case.time)
    whole, centroidal = RepairSettings(), CentroidalFilterSettings()
    whole.linear_acceleration /= s**2
    whole.angular_acceleration /= s**2
    centroidal.com_acceleration /= s**2
    centroidal.angular_momentum *= s
    for scaled in (whole, centroidal):
        scaled.window *= s
        scaled.overlap *= s
    whole.slide_speed /= s
    assert_same(slow.repair(whole).change, repaired(case).change)
    one, other = measured(case), measured(slow, centroidal)
    assert_same(other.com, one.com)
    assert_same(other.angular_momentum / slow.weight / s, one.angular_momentum / case.weight)


@CALM
@given(motions(*ON_GROUND))
def test_what_is_repaired_comes_back_bit_for_bit(models, motion):
    """So does its centre of mass. Feet are left out: those that slide slowly after the first repair
    may be held still in the second."""
    case = make_case(models, motion)
    settings = RepairSettings()
    settings.feet = settings.joints = False
    found = repaired(case, settings)
    assert found.within_reach
    again = replace(case, q=found.motion.q)
    assert_array_equal(again.repair(settings).motion.q, again.q)
    assert not again.repair(settings).change.any()
    assert not again.measure().com.any()


@pytest.mark.parametrize("name", ["standing", "walking"])
def test_what_is_possible_by_construction_comes_back_bit_for_bit(models, name):
    play, first, seconds = PLAYS[name]
    case = of_play(models["massless"], play, first, seconds, 0.0, 0)
    found = case.repair()
    assert found.within_reach
    assert_array_equal(found.motion.q, case.q)
    assert not case.measure().com.any()


@CALM
@given(ANY)
def test_what_is_repaired_hardly_moves(models, motion):
    """Where its stances drift as they did: those that drift a little less than before may be held
    still in the second repair, and were not in the first."""
    case = make_case(models, motion)
    settings = RepairSettings()
    settings.feet = settings.joints = False
    again = replace(case, q=repaired(case, settings).motion.q).repair(settings)
    assert again.root_rms < 1e-4
    assert again.joint_rms < 1e-4


@CALM
@given(motions(*ON_GROUND))
def test_forces_move_the_robot(models, motion):
    """By the recursive Newton-Euler algorithm: what acts on its root is nothing but the forces of
    the parts that carry."""
    case = make_case(models, motion)
    moved = repaired(case).motion
    split = case.split
    analysis = dynacom.analyzeMotion(split.robot, moved, case.schedule)
    forces = {contact.name: contact.wrench[:, :3] for contact in analysis.contacts}
    data = case.model.createData()
    for frame in range(len(case.time)):
        torques = pin.rnea(case.model, data, moved.q[frame], moved.v[frame], moved.a[frame])
        pin.framesForwardKinematics(case.model, data, moved.q[frame])
        total = np.zeros(6)
        for foot in FEET:
            sole_pose = data.oMf[case.model.getFrameId(f"{foot}_foot")]
            for corner, (x, y) in PLACES.items():
                force = forces[f"{foot}.{corner}"][frame]
                place = sole_pose.act(np.array([x * HALF_LENGTH, y * HALF_WIDTH, 0.0]))
                total += np.concatenate([force, np.cross(place, force)])
                assert case.active[f"{foot}.{corner}"][frame] or not force.any()
        root = data.oMi[1].actInv(pin.Force(total)).vector
        assert_allclose(torques[:6], root, rtol=0, atol=1e-8 * case.weight)
