# SPDX-License-Identifier: BSD-2-Clause
"""What holds for every distribution, whatever the contacts and the wrench.

Contacts may be without friction, without extent, in one place; wrenches are inside of what the
contacts can give, in its corners, and out of reach. Tolerances are relative to the scale of the
problem, the weighted norm of the wrench: the status is decided at 1e-8 of it, and what depends on
the contacts through a small angle between them is as many digits less certain.
"""

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from dynacom import (
    ContactBase,
    DistributionResult,
    DistributionStatus,
    DynaCoM,
    WrenchDistribution,
)
from helpers import (
    CALM,
    THOROUGH,
    block_diagonal,
    generators,
    point,
    random_configuration,
    random_humanoid,
    random_pose,
    share_by_edges,
    sole,
)

SOLVED, RELAXED = DistributionStatus.Solved, DistributionStatus.Relaxed
# The mirror is y = 0: what it does to vectors; and to a force and a moment, an axial vector.
MIRROR = np.diag([1.0, -1.0, 1.0])
AXIAL = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])

# Of the scale: the achieved wrench, and forces; which side of 1e-8 a distance is on, is not said.
ACHIEVED = 1e-10
FORCES = 1e-8
BORDER = 1.01e-8


def mirror(pose: pin.SE3) -> pin.SE3:
    return pin.SE3(MIRROR @ pose.rotation @ MIRROR, MIRROR @ pose.translation)


@dataclass
class Problem:
    """Contacts, by kind, settings and pose, and what is asked of them."""

    kinds: list
    fields: list[dict]
    poses: list[pin.SE3]
    com: np.ndarray
    wrench: np.ndarray
    norm: np.ndarray

    def contacts(self) -> list[ContactBase]:
        contacts = []
        for kind, fields, pose in zip(self.kinds, self.fields, self.poses, strict=True):
            contact = kind(**fields)
            contact.updateNewtonEuler(self.com, pose)
            contacts.append(contact)
        return contacts

    @property
    def scale(self) -> float:
        return float(np.linalg.norm(self.norm * self.wrench))

    def pick(self, order: list[int]) -> "Problem":
        return replace(
            self,
            kinds=[self.kinds[k] for k in order],
            fields=[self.fields[k] for k in order],
            poses=[self.poses[k] for k in order],
        )


def solve(problem: Problem) -> DistributionResult:
    distribution = WrenchDistribution()
    distribution.setWrenchWeights(problem.norm)
    for contact in problem.contacts():
        distribution.add(contact)
    distribution.solve(problem.wrench)
    return distribution.result()


def forces(result: DistributionResult) -> list[np.ndarray]:
    return [contact.force for contact in result.contacts]


def distance(result: DistributionResult) -> float:
    """To what the contacts can give, over the scale."""
    return float(np.linalg.norm(result.wrench_weights * result.residual) / result.scale)


def zero_or(low: float, high: float) -> st.SearchStrategy[float]:
    return st.just(0.0) | st.floats(low, high)


@st.composite
def contact_fields(draw):
    """A kind of contact, and its settings; lengths and friction may be zero."""
    exponents = st.floats(-1.0, 1.0)
    if draw(st.booleans()):
        fields = {
            "mu": draw(zero_or(0.1, 1.0)),
            "gu": draw(zero_or(0.01, 0.3)),
            "half_length": draw(zero_or(0.02, 0.2)),
            "half_width": draw(zero_or(0.02, 0.2)),
            "weights": 10.0 ** np.array(draw(st.tuples(*[exponents] * 6))),
        }
        return sole, fields
    fields = {
        "mu": draw(zero_or(0.1, 1.0)),
        "weights": 10.0 ** np.array(draw(st.tuples(*[exponents] * 3))),
    }
    return point, fields


@st.composite
def problems(draw, max_contacts: int = 5) -> Problem:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count = draw(st.integers(1, max_contacts))
    tilt = draw(st.sampled_from([0.0, 0.6, 1.4]))
    kinds, fields, poses = [], [], []
    for _ in range(count):
        kind, settings = draw(contact_fields())
        kinds.append(kind)
        fields.append(settings)
        # Two in one place, now and then.
        again = poses and draw(st.integers(0, 3)) == 0
        poses.append(poses[-1] if again else random_pose(rng, tilt))
    problem = Problem(kinds, fields, poses, rng.uniform(-0.5, 0.5, 3), np.zeros(6), np.ones(6))
    if draw(st.booleans()):
        problem.norm = 10.0 ** rng.uniform(-1.0, 1.0, 6)

    contacts = problem.contacts()
    edges = block_diagonal([generators(contact) for contact in contacts])
    rays = np.hstack([contact.ne_A() for contact in contacts]) @ edges
    where = draw(st.sampled_from(["inside", "corner", "near", "out"]))
    if where == "corner":
        problem.wrench = rays[:, rng.integers(rays.shape[1], size=draw(st.integers(1, 3)))].sum(1)
        problem.wrench *= rng.uniform(1.0, 500.0)
    elif where != "out":
        problem.wrench = rays @ rng.uniform(0.0, 500.0 / rays.shape[1], rays.shape[1])
    if where in ("near", "out"):
        size = 300.0 if where == "out" else draw(st.sampled_from([1e-3, 1.0, 30.0]))
        problem.wrench = problem.wrench + size * rng.standard_normal(6)
    return problem


def assert_same_status(one: DistributionResult, other: DistributionResult) -> None:
    assert {one.status, other.status} <= {SOLVED, RELAXED}
    if one.status != other.status:
        assert max(distance(one), distance(other)) < BORDER


def assert_same_shares(
    one: DistributionResult, other: DistributionResult, expected: list[np.ndarray]
) -> None:
    """The forces of other are the expected ones, which were made from those of one."""
    assert_same_status(one, other)
    size = max(other.scale / other.wrench_weights.min(), *(np.abs(f).max() for f in expected))
    for force, share in zip(forces(other), expected, strict=True):
        assert_allclose(force, share, rtol=0, atol=FORCES * size)


@THOROUGH
@given(problems())
def test_every_answer_is_optimal(problem):
    """By its own conditions; within the cones; and it gives what it says it gives."""
    result = solve(problem)
    assert result.status in (SOLVED, RELAXED)
    assert result.isOptimal()
    given = np.zeros(6)
    for contact, share in zip(problem.contacts(), result.contacts, strict=True):
        assert (share.A @ share.force).max() <= ACHIEVED * problem.scale
        given += contact.ne_A() @ share.force
    atol = ACHIEVED * problem.scale
    assert_allclose(problem.norm * result.achieved, problem.norm * given, rtol=0, atol=atol)
    total = problem.norm * (result.achieved + result.residual)
    assert_allclose(total, problem.norm * problem.wrench, rtol=0, atol=1e-15 * problem.scale)
    assert (distance(result) <= 1e-8) == (result.status == SOLVED)


@THOROUGH
@given(problems(), st.floats(-6.0, 6.0))
def test_forces_scale_with_the_wrench(problem, exponent):
    """From micronewtons to meganewtons, all is the same but the unit."""
    factor = 10.0**exponent
    one, other = solve(problem), solve(replace(problem, wrench=factor * problem.wrench))
    assert_same_shares(one, other, [factor * force for force in forces(one)])
    atol = ACHIEVED * factor * problem.scale
    assert_allclose(
        problem.norm * other.achieved, factor * problem.norm * one.achieved, rtol=0, atol=atol
    )


@THOROUGH
@given(problems(), st.floats(-3.0, 3.0))
def test_only_ratios_of_weights_count(problem, exponent):
    """Those of the cost, and those of the norm."""
    factor = 10.0**exponent
    one = solve(problem)
    fields = [{**fields, "weights": factor * fields["weights"]} for fields in problem.fields]
    assert_same_shares(one, solve(replace(problem, fields=fields)), forces(one))
    assert_same_shares(one, solve(replace(problem, norm=problem.norm / factor)), forces(one))


@THOROUGH
@given(problems())
def test_mirror(problem):
    """The left hand of the world is the right hand of its image."""
    one = solve(problem)
    poses = [mirror(pose) for pose in problem.poses]
    other = solve(
        replace(problem, poses=poses, com=MIRROR @ problem.com, wrench=AXIAL * problem.wrench)
    )
    assert_same_shares(one, other, [AXIAL[: force.size] * force for force in forces(one)])


@THOROUGH
@given(problems(), st.randoms(use_true_random=False))
def test_order_does_not_matter(problem, random):
    order = list(range(len(problem.kinds)))
    random.shuffle(order)
    one, other = solve(problem), solve(problem.pick(order))
    assert_same_shares(one, other, [one.contacts[k].force for k in order])


@THOROUGH
@given(problems(), st.integers(0, 2**32 - 1), st.booleans())
def test_the_world_has_no_preferred_origin_or_axes(problem, seed, turn):
    """Contacts, centre of mass and wrench moved together: the contacts' own forces stay."""
    if turn:  # of the norm, only a sphere in forces and one in moments do not turn
        problem = replace(problem, norm=np.repeat(problem.norm[[0, 3]], 3))
    move = random_pose(np.random.default_rng(seed), reach=10.0)
    if not turn:
        move.rotation = np.eye(3)
    one = solve(problem)
    moved = replace(
        problem,
        poses=[move * pose for pose in problem.poses],
        com=move.act(problem.com),
        wrench=np.kron(np.eye(2), move.rotation) @ problem.wrench,
    )
    assert_same_shares(one, solve(moved), forces(one))


@THOROUGH
@given(problems(), st.data())
def test_a_contact_more_never_raises_the_residual(problem, data):
    """Nor, where nothing is left of it anyway, the cost."""
    count = len(problem.kinds)
    without = data.draw(st.integers(0, count - 1))
    fewer = solve(problem.pick([k for k in range(count) if k != without]))
    more = solve(problem)
    left = problem.scale if fewer.status == DistributionStatus.NoContact else distance(fewer)
    if count == 1:
        assert fewer.status == DistributionStatus.NoContact
        left = 1.0
    assert distance(more) <= left + ACHIEVED
    if fewer.status == SOLVED:
        assert more.status == SOLVED or distance(more) < BORDER
        assert more.cost <= fewer.cost * (1.0 + 1e-6) + (ACHIEVED * problem.scale) ** 2


@THOROUGH
@given(problems(max_contacts=3))
def test_a_contact_twice_gives_what_it_gave(problem):
    """Only cheaper: where all are doubled, each bears half at half the cost."""
    one, other = solve(problem), solve(problem.pick(2 * list(range(len(problem.kinds)))))
    assert_same_shares(one, other, 2 * [0.5 * force for force in forces(one)])


@THOROUGH
@given(problems())
def test_what_was_achieved_can_be_reached(problem):
    """Asked for again, it is given, by the same forces."""
    one = solve(problem)
    assume(np.linalg.norm(problem.norm * one.achieved) > 1e-3 * problem.scale)
    other = solve(replace(problem, wrench=one.achieved))
    assert distance(other) < BORDER
    size = max(problem.scale / problem.norm.min(), np.abs(one.forces()).max())
    assert_allclose(other.forces(), one.forces(), rtol=0, atol=FORCES * size)


@THOROUGH
@given(problems(), st.floats(0.0, 1.0))
def test_margin_within_reach(problem, share):
    """What is within the margin of a wrench is within reach."""
    distribution = WrenchDistribution()
    distribution.setWrenchWeights(problem.norm)
    for contact in problem.contacts():
        distribution.add(contact)
    status = distribution.solve(problem.wrench)
    margin = distribution.computeMargin()
    assert margin.margin >= 0.0
    if status == RELAXED:
        assert (margin.margin, margin.axis, margin.sign) == (0.0, -1, 0)
        return
    if margin.margin == np.inf:
        assert (margin.axis, margin.sign) == (-1, 0)
    size = share * min(margin.margin, problem.scale)
    for axis in range(6):
        for sign in (-1.0, 1.0):
            step = sign * size / problem.norm[axis] * np.eye(6)[axis]
            assert distance(solve(replace(problem, wrench=problem.wrench + step))) < BORDER


FRAMES = ("rleg6_joint", "lleg6_joint", "rarm5_joint", "larm5_joint")


@CALM
@given(
    st.permutations(FRAMES),
    st.lists(contact_fields(), min_size=4, max_size=4),
    st.lists(st.text(min_size=1, max_size=5), min_size=8, max_size=8, unique=True),
    st.sampled_from([1.0, -1.0]),
    st.integers(0, 2**32 - 1),
)
def test_names_and_order_in_a_robot(order, contacts, names, sign, seed):
    """Contacts of other names, activated in another order, bear the same forces."""
    model = random_humanoid(0)
    q, rest = random_configuration(model, seed % 1000), np.zeros(model.nv)
    wrench, shares = None, []
    for frames, own_names in ((FRAMES, names[:4]), (order, names[4:])):
        robot = DynaCoM(model)
        for frame, name in zip(frames, own_names, strict=True):
            kind, fields = contacts[FRAMES.index(frame)]
            robot.addContact(kind(**fields, frame_name=frame), name)
        robot.computeDynamics(q, rest, rest)
        if wrench is None:
            edges = block_diagonal([generators(robot.getContact(name)) for name in own_names])
            rays = robot.ne_A() @ edges
            rng = np.random.default_rng(seed)
            wrench = sign * rays @ rng.uniform(0.0, 100.0, rays.shape[1])
        robot.distributeForce(wrench[:3], wrench[3:], robot.getCoM())
        result = robot.getDistribution()
        assert result.isOptimal()
        for name, force in zip(own_names, forces(result), strict=True):
            assert_array_equal(robot.getContact(name).appliedForce(), force)
        shares.append((result, dict(zip(frames, forces(result), strict=True))))
    (one, by_frame), (other, other_by_frame) = shares
    assert_same_status(one, other)
    for frame in FRAMES:
        assert_allclose(other_by_frame[frame], by_frame[frame], rtol=0, atol=FORCES * other.scale)


def symmetric_robot(rng: np.random.Generator, pairs: int) -> pin.Model:
    """A trunk and pairs of legs, the right one the mirror image of the left.

    Leg k's foot is the frame left{k} or right{k}. The joints of all left legs come first. What is a
    number of the left leg in a motion, is the same number of the right leg in its mirror image.
    """
    model = pin.Model()
    trunk = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "trunk")
    model.appendBodyToJoint(trunk, pin.Inertia.FromBox(30.0, 0.5, 0.3, 0.6), pin.SE3.Identity())
    legs = []
    for _ in range(pairs):
        kinds = rng.choice([pin.JointModelRevoluteUnaligned, pin.JointModelPrismaticUnaligned], 3)
        axes = rng.standard_normal((3, 3))
        places = [random_pose(rng, reach=0.3) for _ in range(4)]
        inertias = [pin.Inertia.FromBox(*rng.uniform(0.1, 2.0, 4)) for _ in range(3)]
        legs.append((kinds, axes / np.linalg.norm(axes, axis=1)[:, None], places, inertias))
    for side in ("left", "right"):
        for leg, (kinds, axes, places, inertias) in enumerate(legs):
            if side == "right":
                # The image of a turn goes the other way round.
                turns = np.where(kinds == pin.JointModelRevoluteUnaligned, -1.0, 1.0)
                axes = turns[:, None] * (axes @ MIRROR)
                places = [mirror(place) for place in places]
            joint = trunk
            for kind, axis, place, inertia in zip(kinds, axes, places, inertias, strict=False):
                name = f"{side}{leg}, joint {model.njoints}"
                joint = model.addJoint(joint, kind(*axis), place, name)
                # A box is its own image.
                model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
            foot = pin.Frame(f"{side}{leg}", joint, places[-1], pin.FrameType.OP_FRAME)
            model.addFrame(foot)
    return model


@THOROUGH
@given(
    st.integers(1, 3),
    st.lists(contact_fields(), min_size=3, max_size=3),
    st.booleans(),
    st.sampled_from(["of the motion", "within reach", "out of reach"]),
    st.integers(0, 2**32 - 1),
)
def test_mirror_of_a_robot(pairs, contacts, world_aligned, where, seed):
    """A symmetric robot that moves as in a mirror: its right feet bear what the left ones bore."""
    rng = np.random.default_rng(seed)
    model = symmetric_robot(rng, pairs)
    joints = 3 * pairs

    def in_mirror(base: np.ndarray, values: np.ndarray) -> np.ndarray:
        return np.concatenate([base * values[: base.size], np.roll(values[base.size :], joints)])

    def robot_with_contacts() -> DynaCoM:
        robot = DynaCoM(model)
        for side in ("left", "right"):
            for leg, (kind, fields) in enumerate(contacts[:pairs]):
                extra = {"world_aligned": world_aligned, "radius": 0.03} if kind == point else {}
                frame = f"{side}{leg}"
                robot.addContact(kind(**fields, **extra, frame_name=frame), frame)
        return robot

    place = pin.SE3ToXYZQUAT(random_pose(rng))
    q = np.concatenate([place, rng.uniform(-1.0, 1.0, 2 * joints)])
    v, a = rng.standard_normal((2, model.nv))
    motion = [q, v, a]
    # Of a quaternion the imaginary part is an axial vector.
    image = [
        in_mirror(np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0]), q),
        in_mirror(AXIAL, v),
        in_mirror(AXIAL, a),
    ]
    one, other = robot_with_contacts(), robot_with_contacts()

    # What else acts on the robot leaves to the ground what it shall be asked for.
    external = np.zeros(6)
    if where != "of the motion":
        one.computeDynamics(*motion)
        feet = [one.getContact(name) for name in one.getActiveContacts()]
        rays = one.ne_A() @ block_diagonal([generators(foot) for foot in feet])
        asked = rays @ rng.uniform(0.0, 100.0, rays.shape[1])
        asked = asked if where == "within reach" else -asked
        needed = np.concatenate([one.getGroundCoMForce(), one.getGroundCoMTorque()])
        external = needed - asked
    for robot, arrays, wrench in ((one, motion, external), (other, image, AXIAL * external)):
        robot.computeDynamics(*arrays, wrench)
        robot.distributeForce(robot.getGroundCoMForce(), robot.getGroundCoMTorque(), robot.getCoM())
        assert robot.getDistribution().isOptimal()
    assert_allclose(other.getCoM(), MIRROR @ one.getCoM(), rtol=0, atol=1e-13)
    size = np.abs(one.ne_b()).max()
    assert_allclose(other.ne_b(), AXIAL * one.ne_b(), rtol=0, atol=1e-12 * size)
    results = one.getDistribution(), other.getDistribution()
    expected = forces(results[0])
    expected = [AXIAL[: f.size] * f for f in expected[pairs:] + expected[:pairs]]
    assert_same_shares(*results, expected)


# Problems on which a property has failed once.


def placed(kind, position, turn, **fields) -> tuple:
    """A contact by its settings and its place relative to the centre of mass."""
    return kind, fields, pin.SE3(pin.exp3(np.array(turn)), np.array(position))


def problem_of(contacts, wrench, norm) -> Problem:
    kinds, fields, poses = map(list, zip(*contacts, strict=True))
    return Problem(kinds, fields, poses, np.zeros(3), np.array(wrench), np.array(norm))


FOUND = {
    "multipliers that are rounding": problem_of(
        [
            placed(point, [1.0, 0.9, 0.3], [0.3, 0.5, 0.3], mu=0.5),
            placed(point, [-0.2, -1.0, -0.7], [0.6, 0.0, -0.6], mu=0.8),
            placed(point, [-0.9, 0.7, 0.5], [0.1, 0.5, 0.2], mu=0.5),
        ],
        [75.0, -69.0, -4.0, 9.0, 201.0, 40.0],
        [1.7, 0.8, 0.5, 1.5, 8.0, 2.0],
    ),
    "two soles": problem_of(
        [
            placed(
                sole,
                [x, 0.0, -1.0],
                np.zeros(3),
                mu=0.5,
                gu=0.1,
                half_length=0.1,
                half_width=0.05,
            )
            for x in (-0.2, 0.3)
        ],
        [49.0, 145.0, 67.0, 58.0, 75.0, -106.0],
        np.ones(6),
    ),
}


@pytest.mark.parametrize("problem", FOUND.values(), ids=FOUND.keys())
@pytest.mark.parametrize("factor", [1.0, 1e-6, 1e-4, 1e-2, 1e2, 1e4, 1e6])
def test_problems_that_were_found(problem, factor):
    """Of the norm's weights only ratios count."""
    result = solve(replace(problem, norm=factor * problem.norm))
    assert result.status == RELAXED
    assert result.isOptimal()
    for contact in result.contacts:
        assert contact.relaxation_multipliers.min() >= 0.0
    expected = share_by_edges(problem.contacts(), problem.wrench, problem.norm)
    atol = ACHIEVED * problem.scale
    assert_allclose(
        problem.norm * result.achieved, problem.norm * expected.closest, rtol=0, atol=atol
    )
    size = problem.scale / problem.norm.min()
    assert_allclose(result.forces(), expected.forces, rtol=0, atol=FORCES * size)
