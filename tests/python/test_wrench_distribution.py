# SPDX-License-Identifier: BSD-2-Clause
import copy
import gc
import itertools
import subprocess
import sys

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from dynacom import ContactBase, ContactPoint, DistributionStatus, WrenchDistribution
from helpers import (
    CALM,
    THOROUGH,
    array_kinds,
    cheapest_forces,
    cost,
    inequalities,
    point,
    random_pose,
    sole,
)

SOLVED = DistributionStatus.Solved
INFEASIBLE = DistributionStatus.Infeasible

seeds = st.integers(0, 2**32 - 1)


def random_contacts(
    rng: np.random.Generator, tilt: float = 0.6, world_aligned: bool = True
) -> list[ContactBase]:
    """Enough contacts to give any direction of wrench: a sole or more, or three points or more."""
    count = rng.integers(1, 5)
    makers = list(rng.choice([0, 1], count)) if count > 1 else [1]
    if not any(makers):
        makers += [0] * (3 - count)
    contacts = []
    for is_sole in makers:
        if is_sole:
            contact = sole(
                mu=rng.uniform(0.2, 1.0),
                gu=rng.uniform(0.01, 0.3),
                half_length=rng.uniform(0.02, 0.2),
                half_width=rng.uniform(0.02, 0.2),
                weights=10.0 ** rng.uniform(-1.0, 1.0, 6),
            )
        else:
            contact = point(
                mu=rng.uniform(0.2, 1.0),
                weights=10.0 ** rng.uniform(-1.0, 1.0, 3),
                world_aligned=world_aligned and bool(rng.integers(2)),
                radius=rng.choice([0.0, 0.05]),
            )
        contact.updateNewtonEuler(np.array([0.1, 0.2, 0.8]), random_pose(rng, tilt))
        contacts.append(contact)
    return contacts


def force_inside(contact: ContactBase, rng: np.random.Generator, share: float = 1.0) -> np.ndarray:
    """A force within that share of the contact's cones."""
    settings = contact.getSettings()
    limits = [settings.mu, settings.mu]
    if contact.cols() == 6:
        limits += [settings.half_width, settings.half_length, settings.gu]
    ratios = share * rng.uniform(-1.0, 1.0, len(limits)) * limits
    return rng.uniform(10.0, 500.0) * np.concatenate([ratios[:2], [1.0], ratios[2:]])


def wrench_of(contacts: list[ContactBase], forces: list[np.ndarray]) -> np.ndarray:
    return sum(contact.ne_A() @ force for contact, force in zip(contacts, forces, strict=True))


def reachable(rng: np.random.Generator, **kwargs) -> tuple[list[ContactBase], np.ndarray]:
    contacts = random_contacts(rng, **kwargs)
    return contacts, wrench_of(contacts, [force_inside(contact, rng) for contact in contacts])


def distribute(contacts, wrench) -> tuple[DistributionStatus, np.ndarray]:
    distribution = WrenchDistribution()
    for contact in contacts:
        distribution.add(contact)
    return distribution.solve(wrench), distribution.forces()


def split(contacts: list[ContactBase], forces: np.ndarray) -> list[np.ndarray]:
    ends = np.cumsum([contact.cols() for contact in contacts])
    return np.split(forces, ends[:-1])


# The cheapest forces.


@THOROUGH
@given(seeds)
def test_reachable_wrenches_are_shared_at_least_cost(seed):
    """The optimum is unique: another algorithm finds the same forces."""
    rng = np.random.default_rng(seed)
    contacts, wrench = reachable(rng)
    status, forces = distribute(contacts, wrench)
    assert status == SOLVED
    tolerance = 1e-10 * np.linalg.norm(wrench)
    shares = split(contacts, forces)
    assert_allclose(wrench_of(contacts, shares), wrench, rtol=0, atol=10 * tolerance)
    for contact, force in zip(contacts, shares, strict=True):
        assert (inequalities(contact) @ force).max() <= tolerance
    expected = cheapest_forces(contacts, wrench)
    weights = np.concatenate([contact.reg_A() for contact in contacts])
    assert_allclose(forces, expected, rtol=0, atol=1e4 * tolerance)
    assert_allclose(cost(weights, forces), cost(weights, expected), rtol=1e-9)


@THOROUGH
@given(seeds)
def test_wrenches_in_reach_or_not(seed):
    """Solved or infeasible, both are told apart as another algorithm does."""
    rng = np.random.default_rng(seed)
    contacts, wrench = reachable(rng)
    wrench += rng.choice([10.0, 100.0, 1000.0]) * rng.standard_normal(6)
    status, forces = distribute(contacts, wrench)
    expected = cheapest_forces(contacts, wrench)
    if expected is None:
        assert status == INFEASIBLE
        assert_array_equal(forces, np.zeros(forces.size))
    else:
        assert status == SOLVED
        assert_allclose(forces, expected, rtol=0, atol=1e-6 * np.linalg.norm(wrench))


@CALM
@given(seeds)
def test_no_feasible_forces_are_cheaper(seed):
    """Without trust in any solver: from the optimum, every way to feasible forces goes uphill."""
    rng = np.random.default_rng(seed)
    contacts = random_contacts(rng)
    known = [force_inside(contact, rng) for contact in contacts]
    wrench = wrench_of(contacts, known)
    status, forces = distribute(contacts, wrench)
    assert status == SOLVED
    weights = np.concatenate([contact.reg_A() for contact in contacts])
    best = cost(weights, forces)
    for share in (1e-3, 0.1, 1.0):
        other = (1.0 - share) * forces + share * np.concatenate(known)
        assert best <= cost(weights, other) * (1.0 + 1e-9)


def test_one_sole_has_no_choice():
    rng = np.random.default_rng(0)
    contact = sole(mu=0.5, gu=0.1, half_length=0.1, half_width=0.05)
    contact.updateNewtonEuler(np.zeros(3), random_pose(rng))
    force = np.array([10.0, -20.0, 100.0, 4.0, -9.0, 5.0])
    status, forces = distribute([contact], contact.ne_A() @ force)
    assert status == SOLVED
    assert_allclose(forces, force, rtol=0, atol=1e-11)


@pytest.mark.parametrize("row", range(11))
def test_each_limit_holds(row):
    """Just inside each limit of a sole there are forces, just outside there are none."""
    contact = sole(mu=0.5, gu=0.1, half_length=0.1, half_width=0.05)
    contact.updateNewtonEuler(np.zeros(3), random_pose(np.random.default_rng(row)))
    A = inequalities(contact)[row]
    centre = np.array([0.0, 0.0, 100.0, 0.0, 0.0, 0.0])
    to_limit = A * -(A @ centre) / (A @ A)
    for factor, expected in ((1.0 - 1e-6, SOLVED), (1.0 + 1e-6, INFEASIBLE)):
        # The first row is the normal force itself: beyond it the contact pulls.
        force = centre + factor * to_limit if row else (1.0 - factor) * centre
        status, forces = distribute([contact], contact.ne_A() @ force)
        assert status == expected
        assert_allclose(forces, force if expected == SOLVED else 0.0 * force, rtol=0, atol=1e-9)


def line_of_soles(*places: float, **fields: object) -> list[ContactBase]:
    contacts = []
    for x in places:
        contact = sole(mu=0.5, gu=0.1, half_length=0.1, half_width=0.05, **fields)
        contact.updateNewtonEuler(
            np.array([0.0, 0.0, 1.0]), pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))
        )
        contacts.append(contact)
    return contacts


def test_weights_act_squared():
    """Two soles far apart: twice the weight on one of them bears four times less of a push."""
    push = np.array([10.0, 0.0, 1000.0, 0.0, -10.0, 0.0])
    left, right = line_of_soles(-0.5, 0.5)
    right.setForceWeights(np.array([2, 1, 1]))
    status, forces = distribute([left, right], push)
    assert status == SOLVED
    assert_allclose([forces[0], forces[6]], [8.0, 2.0], rtol=1e-9)


@CALM
@given(seeds, st.floats(-3.0, 3.0))
def test_only_the_weights_ratios_count(seed, exponent):
    rng = np.random.default_rng(seed)
    contacts, wrench = reachable(rng)
    status, forces = distribute(contacts, wrench)
    for contact in contacts:
        weights = 10.0**exponent * contact.reg_A()
        contact.setForceWeights(weights[:3])
        if contact.cols() == 6:
            contact.setTorqueWeights(weights[3:])
    again, scaled = distribute(contacts, wrench)
    assert status == again == SOLVED
    assert_allclose(scaled, forces, rtol=0, atol=1e-9 * np.linalg.norm(wrench))


# Symmetries.


@CALM
@given(seeds, st.floats(-6.0, 6.0))
def test_forces_scale_with_the_wrench(seed, exponent):
    """From micronewtons to meganewtons."""
    contacts, wrench = reachable(np.random.default_rng(seed))
    scale = 10.0**exponent
    status, forces = distribute(contacts, wrench)
    scaled_status, scaled = distribute(contacts, scale * wrench)
    assert status == scaled_status == SOLVED
    assert_allclose(scaled / scale, forces, rtol=0, atol=1e-9 * np.linalg.norm(wrench))


@CALM
@given(seeds)
def test_reachable_wrenches_are_a_cone(seed):
    """What is out of reach stays so at any scale; the opposite of a push cannot be given."""
    contacts, wrench = reachable(np.random.default_rng(seed), tilt=0.3)
    assert distribute(contacts, -wrench)[0] == INFEASIBLE
    assert distribute(contacts, -1e-3 * wrench)[0] == INFEASIBLE
    assert distribute(contacts, -1e3 * wrench)[0] == INFEASIBLE


@CALM
@given(seeds, st.randoms())
def test_order_does_not_matter(seed, random):
    contacts, wrench = reachable(np.random.default_rng(seed))
    status, forces = distribute(contacts, wrench)
    order = list(range(len(contacts)))
    random.shuffle(order)
    shuffled_status, shuffled = distribute([contacts[k] for k in order], wrench)
    assert status == shuffled_status == SOLVED
    expected = split(contacts, forces)
    for k, force in zip(order, split([contacts[k] for k in order], shuffled), strict=True):
        assert_allclose(force, expected[k], rtol=0, atol=1e-9 * np.linalg.norm(wrench))


@CALM
@given(seeds, st.booleans())
def test_the_world_has_no_preferred_heading_or_origin(seed, turn):
    """Contacts and wrench moved together: the contacts' own forces stay."""
    rng = np.random.default_rng(seed)
    # World-aligned surfaces would not turn with the others.
    contacts, wrench = reachable(rng, world_aligned=False)
    status, forces = distribute(contacts, wrench)
    move = random_pose(rng)
    if not turn:
        move.rotation = np.eye(3)
    com = np.array([0.1, 0.2, 0.8])
    for contact in contacts:
        contact.updateNewtonEuler(move.act(com), move * contact.getPose())
    turned = np.concatenate([move.rotation @ wrench[:3], move.rotation @ wrench[3:]])
    moved_status, moved = distribute(contacts, turned)
    assert status == moved_status == SOLVED
    assert_allclose(moved, forces, rtol=0, atol=1e-9 * np.linalg.norm(wrench))


MIRROR = np.diag([1.0, -1.0, 1.0])


@CALM
@given(seeds)
def test_mirror(seed):
    """The left hand of the world is the right hand of its image; moments are axial vectors."""
    rng = np.random.default_rng(seed)
    contacts, wrench = reachable(rng)
    com = np.array([0.1, 0.2, 0.8])
    image = [contact.clone() for contact in contacts]
    for contact in image:
        pose = contact.getPose()
        contact.updateNewtonEuler(
            MIRROR @ com,
            pin.SE3(MIRROR @ pose.rotation @ MIRROR, MIRROR @ pose.translation),
        )
    status, forces = distribute(contacts, wrench)
    mirrored = np.concatenate([MIRROR @ wrench[:3], -MIRROR @ wrench[3:]])
    image_status, image_forces = distribute(image, mirrored)
    assert status == image_status == SOLVED
    shares = zip(split(contacts, forces), split(image, image_forces), strict=True)
    for force, image_force in shares:
        signs = np.array([1, -1, 1, -1, 1, -1])[: force.size]
        atol = 1e-9 * np.linalg.norm(wrench)
        assert_allclose(image_force, signs * force, rtol=0, atol=atol)


def test_equals_share_equally():
    """Soles around the centre of mass, four of them: each bears a quarter."""
    contacts = []
    for x, y in itertools.product((-0.3, 0.3), (-0.2, 0.2)):
        contact = sole(mu=0.5, gu=0.1, half_length=0.1, half_width=0.05)
        contact.updateNewtonEuler(np.zeros(3), pin.SE3(np.eye(3), np.array([x, y, -0.9])))
        contacts.append(contact)
    status, forces = distribute(contacts, np.array([0.0, 0.0, 1000.0, 0.0, 0.0, 0.0]))
    assert status == SOLVED
    assert_allclose(forces, np.tile([0, 0, 250, 0, 0, 0], 4), rtol=0, atol=1e-10)


# What is not a solution.


def test_no_contact():
    distribution = WrenchDistribution()
    assert distribution.solve(np.ones(6)) == DistributionStatus.NoContact
    assert distribution.forces().shape == (0,)
    distribution.add(line_of_soles(0.0)[0])
    assert distribution.solve(np.zeros(6)) == SOLVED
    distribution.clear()
    assert distribution.solve(np.ones(6)) == DistributionStatus.NoContact
    assert distribution.forces().shape == (0,)


def test_nothing_asked_nothing_given():
    status, forces = distribute(line_of_soles(-0.5, 0.5), np.zeros(6))
    assert status == SOLVED
    assert_array_equal(forces, np.zeros(12))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("component", range(6))
def test_numbers_that_are_not_finite(value, component):
    """A fact of the world: a status, finite forces, and the next wrench is none the worse."""
    contacts = line_of_soles(-0.5, 0.5)
    distribution = WrenchDistribution()
    for contact in contacts:
        distribution.add(contact)
    wrench = np.array([0.0, 0.0, 500.0, 0.0, 0.0, 0.0])
    assert distribution.solve(wrench) == SOLVED
    expected = distribution.forces()
    broken = wrench.copy()
    broken[component] = value
    assert distribution.solve(broken) == DistributionStatus.NumericalFailure
    assert_array_equal(distribution.forces(), np.zeros(12))
    assert distribution.solve(wrench) == SOLVED
    assert_array_equal(distribution.forces(), expected)


@pytest.mark.parametrize("broken", ["com", "pose"])
def test_places_that_are_not_finite(broken):
    contacts = line_of_soles(-0.5, 0.5)
    nan = np.full(3, np.nan)
    pose = pin.SE3(np.eye(3), nan if broken == "pose" else np.zeros(3))
    contacts[0].updateNewtonEuler(nan if broken == "com" else np.zeros(3), pose)
    status, forces = distribute(contacts, np.array([0.0, 0.0, 500.0, 0.0, 0.0, 0.0]))
    assert status == DistributionStatus.NumericalFailure
    assert_array_equal(forces, np.zeros(12))


def test_out_of_reach():
    contacts = line_of_soles(-0.5, 0.5)
    for wrench in (
        [0.0, 0.0, -100.0, 0.0, 0.0, 0.0],  # the ground does not pull
        [60.0, 0.0, 100.0, 0.0, 0.0, 0.0],  # nor hold more than friction does
        [0.0, 0.0, 100.0, 0.0, -70.0, 0.0],  # nor press beyond the soles
        [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],  # nor turn the robot without pressing
    ):
        status, forces = distribute(contacts, np.array(wrench))
        assert status == INFEASIBLE
        assert_array_equal(forces, np.zeros(12))


FEW_POINTS = """
import sys
import numpy as np
import pinocchio as pin
from dynacom import ContactPoint, ContactPointSettings, WrenchDistribution
settings = ContactPointSettings()
settings.frame_name, settings.mu = "foot", 0.5
contacts = []
for number in range(int(sys.argv[1])):
    contact = ContactPoint(settings)
    contact.updateNewtonEuler(np.zeros(3), pin.SE3(np.eye(3), np.array([0.3 * number, 0.2, -0.8])))
    contacts.append(contact)
statuses = set()
for wrench in np.random.default_rng(0).standard_normal((500, 6)):
    for asked in (wrench, [0, 0, 1, 0, 0, 0], [1, 1, 1, 0, 0, 0]):
        distribution = WrenchDistribution()
        for contact in contacts:
            distribution.add(contact)
        statuses.add(str(distribution.solve(np.array(asked))))
        assert not distribution.forces().any()
    garbage = [np.full(size, np.nan) for size in range(40)]
print(*sorted(statuses))
"""


@pytest.mark.parametrize("count", [1, 2])
def test_fewer_than_three_points(count):
    """A status, in a process of its own: it has been seen to write beyond the solver's memory."""
    run = subprocess.run(
        [sys.executable, "-c", FEW_POINTS, str(count)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert set(run.stdout.split()) <= {"NumericalFailure", "Infeasible"}


def test_contact_that_was_never_initialised():
    """A mistake in the program, which must not pass for a contact that gives no force."""
    with pytest.raises((ValueError, RuntimeError), match="initialize|initialised"):
        WrenchDistribution().add(ContactPoint())


# The object.


def test_contacts_are_copied_when_added():
    rng = np.random.default_rng(5)
    contacts, wrench = reachable(rng)
    _, expected = distribute(contacts, wrench)
    distribution = WrenchDistribution()
    for contact in contacts:
        distribution.add(contact=contact)
    for contact in contacts:
        contact.setMu(0.0)
        contact.updateNewtonEuler(np.zeros(3), pin.SE3.Identity())
    del contacts, contact
    gc.collect()
    assert distribution.solve(wrench=wrench) == SOLVED
    assert_array_equal(distribution.forces(), expected)


def test_problems_of_changing_size_on_one_object():
    """Nothing is left of the problem before, however large it was."""
    rng = np.random.default_rng(7)
    distribution = WrenchDistribution()
    for _ in range(100):
        contacts, wrench = reachable(rng)
        distribution.clear()
        for contact in contacts:
            distribution.add(contact)
        status, forces = distribute(contacts, wrench)
        assert distribution.solve(wrench) == status == SOLVED
        assert_array_equal(distribution.forces(), forces)
        # The same again, on what the first solution has left.
        assert distribution.solve(wrench) == SOLVED
        assert_array_equal(distribution.forces(), forces)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, WrenchDistribution.copy])
def test_copies_share_nothing(copied):
    contacts, wrench = reachable(np.random.default_rng(3))
    distribution = WrenchDistribution()
    for contact in contacts:
        distribution.add(contact)
    assert distribution.solve(wrench) == SOLVED
    forces = distribution.forces()
    other = copied(distribution)
    assert_array_equal(other.forces(), forces)
    assert other.solve(2.0 * wrench) == SOLVED
    assert_array_equal(distribution.forces(), forces)
    other.clear()
    assert distribution.solve(wrench) == SOLVED
    assert_array_equal(distribution.forces(), forces)


def test_forces_are_a_copy():
    contacts, wrench = reachable(np.random.default_rng(3))
    distribution = WrenchDistribution()
    for contact in contacts:
        distribution.add(contact)
    distribution.solve(wrench)
    forces = distribution.forces()
    expected = forces.copy()
    forces[:] = 9.0
    assert_array_equal(distribution.forces(), expected)
    held = distribution.forces()
    distribution.solve(3.0 * wrench)
    assert_array_equal(held, expected)


def test_wrenches_of_any_kind():
    contacts = line_of_soles(-0.5, 0.5)
    results = {
        kind: distribute(contacts, wrench)
        for kind, wrench in array_kinds([10, -20, 500, 3, 40, -5])
    }
    assert results["plain"][0] == SOLVED
    for kind, (status, forces) in results.items():
        assert status == SOLVED, kind
        assert_array_equal(forces, results["plain"][1], kind)


@pytest.mark.parametrize("size", [0, 3, 5, 7])
def test_wrenches_of_the_wrong_size(size):
    distribution = WrenchDistribution()
    distribution.add(line_of_soles(0.0)[0])
    with pytest.raises(ValueError, match=f"wrench must have 6 .*, got {size}"):
        distribution.solve(np.ones(size))


def test_wrong_types():
    distribution = WrenchDistribution()
    for wrong in (None, "wrench", [1.0] * 6, np.ones((2, 3)), np.array(list("abcdef"))):
        with pytest.raises(TypeError):
            distribution.solve(wrong)
        with pytest.raises(TypeError):
            distribution.add(wrong)
    assert distribution.solve(np.ones(6)) == DistributionStatus.NoContact


def test_status_names():
    assert DistributionStatus.names.keys() == {
        "Solved",
        "Infeasible",
        "NoContact",
        "NumericalFailure",
    }
    for name, status in DistributionStatus.names.items():
        assert str(status) == name
        assert getattr(DistributionStatus, name) == status
    assert len(set(DistributionStatus.values)) == 4
