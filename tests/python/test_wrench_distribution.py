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

from dynacom import (
    ContactBase,
    ContactPoint,
    DistributionResult,
    DistributionStatus,
    NotReadyError,
    WrenchDistribution,
    WrenchMargin,
)
from helpers import (
    CALM,
    THOROUGH,
    array_kinds,
    block_diagonal,
    cost,
    inequalities,
    point,
    random_pose,
    share_by_edges,
    sole,
)

SOLVED = DistributionStatus.Solved
RELAXED = DistributionStatus.Relaxed

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


def distribution_of(contacts: list[ContactBase]) -> WrenchDistribution:
    distribution = WrenchDistribution()
    for contact in contacts:
        distribution.add(contact)
    return distribution


def distribute(contacts, wrench) -> tuple[DistributionStatus, np.ndarray]:
    distribution = distribution_of(contacts)
    return distribution.solve(wrench), distribution.result().forces()


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
    expected = share_by_edges(contacts, wrench).forces
    weights = np.concatenate([contact.reg_A() for contact in contacts])
    assert_allclose(forces, expected, rtol=0, atol=100 * tolerance)
    assert_allclose(cost(weights, forces), cost(weights, expected), rtol=1e-9)


@THOROUGH
@given(seeds)
def test_wrenches_in_reach_or_not(seed):
    """Status, achieved wrench and forces are those that another algorithm finds."""
    rng = np.random.default_rng(seed)
    contacts, wrench = reachable(rng)
    wrench += rng.choice([10.0, 100.0, 1000.0]) * rng.standard_normal(6)
    norm = np.ones(6) if seed % 2 else 10.0 ** rng.uniform(-1.0, 1.0, 6)
    distribution = distribution_of(contacts)
    distribution.setWrenchWeights(norm)
    status = distribution.solve(wrench)
    result = distribution.result()
    expected = share_by_edges(contacts, wrench, norm)
    assert status == (RELAXED if expected.distance > 1e-8 else SOLVED)
    assert result.isOptimal()
    tolerance = 1e-8 * np.linalg.norm(norm * wrench)
    assert_allclose(norm * result.achieved, norm * expected.closest, rtol=0, atol=tolerance)
    assert_allclose(result.forces(), expected.forces, rtol=0, atol=100 * tolerance)
    weights = np.concatenate([contact.reg_A() for contact in contacts])
    bound = 1e-6 * cost(weights, expected.forces) + (weights.max() * tolerance) ** 2
    assert abs(result.cost - cost(weights, expected.forces)) <= bound


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
    for factor, expected in ((1.0 - 1e-6, SOLVED), (1.0 + 1e-6, RELAXED)):
        # The first row is the normal force itself: beyond it the contact pulls.
        force = centre + factor * to_limit if row else (1.0 - factor) * centre
        distribution = distribution_of([contact])
        assert distribution.solve(contact.ne_A() @ force) == expected
        result = distribution.result()
        assert (inequalities(contact) @ result.forces()).max() <= 1e-9
        if expected == SOLVED:
            assert_allclose(result.forces(), force, rtol=0, atol=1e-9)
        else:
            # The closest is no farther than the point of the limit, and the limit is met.
            on_limit = contact.ne_A() @ (centre + to_limit if row else 0.0 * centre)
            assert np.linalg.norm(result.residual) <= np.linalg.norm(result.wrench - on_limit)
            if row:
                assert abs(A @ result.forces()) <= 1e-9
                assert result.contacts[0].active[row]


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


@CALM
@given(seeds)
def test_reachable_wrenches_are_a_cone(seed):
    """What is out of reach stays so at any scale; the opposite of a push cannot be given."""
    contacts, wrench = reachable(np.random.default_rng(seed), tilt=0.3)
    assert distribute(contacts, -wrench)[0] == RELAXED
    assert distribute(contacts, -1e-3 * wrench)[0] == RELAXED
    assert distribute(contacts, -1e3 * wrench)[0] == RELAXED


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


# What is out of reach.


def at_the_com(contact: ContactBase) -> ContactBase:
    """Placed at the centre of mass, upright: its force is the wrench."""
    contact.updateNewtonEuler(np.zeros(3), pin.SE3.Identity())
    return contact


@pytest.mark.parametrize(
    ("moment_weight", "wrench", "closest"),
    [
        # The ground does not pull.
        (1, [0, 0, -100, 0, 0, 0], [0, 0, 0, 0, 0, 0]),
        # Nor hold more than friction does: the closest on the ray (0.5, 0, 1).
        (1, [100, 0, 100, 0, 0, 0], [60, 0, 120, 0, 0, 0]),
        # Nor press beyond the sole: on the ray (1, 0.1) of f_z and tau_y, in either norm.
        (1, [0, 0, 100, 0, 20, 0], [0, 0, 102 / 1.01, 0, 10.2 / 1.01, 0]),
        (10, [0, 0, 100, 0, 20, 0], [0, 0, 150, 0, 15, 0]),
        # Nor turn the robot without pressing: as before, with tau_z and yaw friction.
        (10, [0, 0, 0, 0, 0, -20], [0, 0, 100, 0, 0, -10]),
    ],
)
def test_the_closest_wrench_by_hand(moment_weight, wrench, closest):
    contact = at_the_com(sole(mu=0.5, gu=0.1, half_length=0.1, half_width=0.05))
    distribution = distribution_of([contact])
    distribution.setWrenchWeights(np.array([1, 1, 1] + [moment_weight] * 3))
    assert distribution.solve(np.array(wrench)) == RELAXED
    result = distribution.result()
    assert_allclose(result.forces(), closest, rtol=0, atol=1e-9)
    assert_allclose(result.achieved, closest, rtol=0, atol=1e-9)
    assert_allclose(result.residual, np.subtract(wrench, closest), rtol=0, atol=1e-9)
    assert result.isOptimal()


def test_the_cheapest_forces_of_the_closest_wrench():
    """Two soles slip; how they share what they hold is up to the weights."""
    contacts = [at_the_com(sole(mu=0.5, gu=0.1, half_length=0.1, half_width=0.05)) for _ in "ab"]
    contacts[1].setForceWeights(np.full(3, 2.0))
    status, forces = distribute(contacts, np.array([100.0, 0.0, 100.0, 0.0, 0.0, 0.0]))
    assert status == RELAXED
    assert_allclose(forces[:6], [48, 0, 96, 0, 0, 0], rtol=0, atol=1e-9)
    assert_allclose(forces[6:], [12, 0, 24, 0, 0, 0], rtol=0, atol=1e-9)


@CALM
@given(seeds)
def test_nothing_within_reach_is_closer(seed):
    """Without trust in any solver: nor are forces that give the same cheaper."""
    rng = np.random.default_rng(seed)
    contacts, wrench = reachable(rng)
    wrench += 1000.0 * rng.standard_normal(6)
    distribution = distribution_of(contacts)
    if distribution.solve(wrench) == SOLVED:
        return
    result = distribution.result()
    least = np.linalg.norm(result.residual)
    for share in (1e-3, 0.1, 1.0):
        forces = [force_inside(contact, rng) for contact in contacts]
        other = (1.0 - share) * result.achieved + share * wrench_of(contacts, forces)
        assert least <= np.linalg.norm(wrench - other) + 1e-9 * np.linalg.norm(wrench)
    again, cheapest = distribute(contacts, result.achieved)
    weights = np.concatenate([contact.reg_A() for contact in contacts])
    assert again == SOLVED
    assert result.cost <= cost(weights, cheapest) * (1.0 + 1e-6)


def test_fewer_than_three_points():
    """Rank-deficient: a point gives no moment about itself, two give none about their line."""
    rng = np.random.default_rng(0)
    for count in (1, 2):
        contacts = []
        for number in range(count):
            contact = point(mu=0.5)
            pose = pin.SE3(np.eye(3), np.array([0.3 * number, 0.2, -0.8]))
            contact.updateNewtonEuler(np.zeros(3), pose)
            contacts.append(contact)
        for wrench in [*rng.standard_normal((100, 6)), 0.1 * np.eye(6)[2], np.repeat([1, 0], 3)]:
            distribution = distribution_of(contacts)
            assert distribution.solve(wrench) == RELAXED
            result = distribution.result()
            assert result.isOptimal()
            expected = share_by_edges(contacts, wrench)
            assert_allclose(result.achieved, expected.closest, rtol=0, atol=1e-9)
            assert_allclose(result.forces(), expected.forces, rtol=0, atol=1e-7)
            assert distribution.computeMargin().margin == 0.0
        # What they can give is solved for all that.
        force = np.tile([0.2, -0.1, 1.0], count)
        wrench = np.hstack([contact.ne_A() for contact in contacts]) @ force
        distribution = distribution_of(contacts)
        assert distribution.solve(wrench) == SOLVED
        assert distribution.computeMargin().margin == 0.0


# Without contacts, without numbers.


def test_no_contact():
    distribution = WrenchDistribution()
    assert distribution.solve(np.ones(6)) == DistributionStatus.NoContact
    result = distribution.result()
    assert result.forces().shape == (0,)
    assert result.contacts == []
    assert_array_equal(result.achieved, np.zeros(6))
    assert_array_equal(result.residual, np.ones(6))
    assert (result.cost, result.iterations) == (0.0, 0)
    assert result.isOptimal()
    distribution.add(line_of_soles(0.0)[0])
    assert distribution.solve(np.zeros(6)) == SOLVED
    distribution.clear()
    assert distribution.solve(np.ones(6)) == DistributionStatus.NoContact
    assert distribution.result().forces().shape == (0,)


def test_nothing_asked_nothing_given():
    """Without contacts, too: that is a free flight."""
    for contacts in ([], line_of_soles(-0.5, 0.5)):
        distribution = distribution_of(contacts)
        assert distribution.solve(np.zeros(6)) == SOLVED
        result = distribution.result()
        assert_array_equal(result.forces(), np.zeros(6 * len(contacts)))
        assert_array_equal(result.residual, np.zeros(6))
        assert result.isOptimal()


@pytest.mark.parametrize("count", [0, 1, 2])
def test_zero_is_relative_to_the_minimal_scale(count):
    """A free fall's wrench is rounding, not a pull that contacts cannot give."""
    contacts = line_of_soles(*np.arange(count))
    rounding = np.array([1e-7, -1e-7, -1e-7, 0.0, 1e-7, 0.0])
    distribution = distribution_of(contacts)
    assert distribution.solve(rounding, 900.0) == SOLVED
    assert distribution.result().scale == 900.0
    assert distribution.result().isOptimal()
    assert np.abs(distribution.result().forces()).max(initial=0.0) < 1e-6
    assert distribution.solve(wrench=rounding, minimalScale=1.0) != SOLVED
    assert distribution.solve(1e4 * rounding, 900.0) != SOLVED


def ready() -> tuple[WrenchDistribution, list[ContactBase], np.ndarray]:
    """Two soles that bear a weight."""
    contacts = line_of_soles(-0.5, 0.5)
    distribution = distribution_of(contacts)
    wrench = np.array([0.0, 0.0, 500.0, 0.0, 0.0, 0.0])
    assert distribution.solve(wrench) == SOLVED
    return distribution, contacts, wrench


def assert_no_answer(distribution: WrenchDistribution, forces: np.ndarray) -> None:
    """The forces that it keeps, and nothing that could be taken for an answer."""
    result = distribution.result()
    assert_array_equal(result.forces(), forces)
    assert not result.isOptimal()
    assert np.isnan(distribution.computeMargin().margin)
    for contact in result.contacts:
        assert not contact.active.any()
        assert not contact.multipliers.any()
        assert not contact.relaxation_multipliers.any()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("component", range(6))
def test_numbers_that_are_not_finite(value, component):
    """A fact of the world: a status, the forces of before, and the next wrench is no worse."""
    distribution, _, wrench = ready()
    expected = distribution.result().forces()
    broken = wrench.copy()
    broken[component] = value
    assert distribution.solve(broken) == DistributionStatus.InvalidInput
    assert_no_answer(distribution, expected)
    assert_array_equal(distribution.result().wrench, broken)
    assert_allclose(distribution.result().achieved, wrench, rtol=0, atol=1e-9)
    assert distribution.solve(wrench) == SOLVED
    assert_array_equal(distribution.result().forces(), expected)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_minimal_scale_that_is_not_finite(value):
    distribution, _, wrench = ready()
    expected = distribution.result().forces()
    assert distribution.solve(wrench, value) == DistributionStatus.InvalidInput
    assert_no_answer(distribution, expected)
    assert distribution.solve(wrench, 1.0) == SOLVED
    assert_array_equal(distribution.result().forces(), expected)


def test_wrenches_beyond_the_largest_numbers():
    distribution, _, wrench = ready()
    expected = distribution.result().forces()
    assert distribution.solve(np.full(6, 1.5e308)) == DistributionStatus.NumericalFailure
    assert_no_answer(distribution, expected)
    assert distribution.solve(wrench) == SOLVED
    assert_array_equal(distribution.result().forces(), expected)


@pytest.mark.parametrize("broken", ["com", "pose"])
def test_places_that_are_not_finite(broken):
    contacts = line_of_soles(-0.5, 0.5)
    nan = np.full(3, np.nan)
    pose = pin.SE3(np.eye(3), nan if broken == "pose" else np.zeros(3))
    contacts[0].updateNewtonEuler(nan if broken == "com" else np.zeros(3), pose)
    status, forces = distribute(contacts, np.array([0.0, 0.0, 500.0, 0.0, 0.0, 0.0]))
    assert status == DistributionStatus.InvalidInput
    assert_array_equal(forces, np.zeros(12))


KEPT = {
    "another place": lambda distribution, contacts: contacts[0].updateNewtonEuler(
        np.zeros(3), pin.SE3.Identity()
    ),
    "nothing": lambda distribution, contacts: None,
    "the same norm": lambda distribution, contacts: distribution.setWrenchWeights(np.ones(6)),
}
FORGOTTEN = {
    "friction": lambda distribution, contacts: contacts[0].setMu(0.4),
    "weights": lambda distribution, contacts: contacts[1].setForceWeights(np.full(3, 2.0)),
    "one more": lambda distribution, contacts: contacts.extend(line_of_soles(1.0)),
    "one less": lambda distribution, contacts: contacts.pop(),
    "norm": lambda distribution, contacts: distribution.setWrenchWeights(np.full(6, 2.0)),
    "forgetForces": lambda distribution, contacts: distribution.forgetForces(),
}


@pytest.mark.parametrize("change", [*KEPT, *FORGOTTEN])
@pytest.mark.parametrize(
    ("broken", "status"),
    [
        (np.nan, DistributionStatus.InvalidInput),
        (1.5e308, DistributionStatus.NumericalFailure),
    ],
)
def test_forces_without_an_answer(change, broken, status):
    """Those of before, as long as contacts and settings are the same, even if they move."""
    distribution, contacts, wrench = ready()
    kept = distribution.result().forces()
    (KEPT | FORGOTTEN)[change](distribution, contacts)
    distribution.clear()
    for contact in contacts:
        distribution.add(contact)
    expected = kept if change in KEPT else np.zeros(6 * len(contacts))
    for _ in range(2):
        assert distribution.solve(np.full(6, broken)) == status
        assert_no_answer(distribution, expected)
    assert distribution.solve(wrench) in (SOLVED, RELAXED)
    assert distribution.result().isOptimal()


def test_forces_kept_are_those_of_the_last_answer():
    """A relaxed one is an answer too, as is one of nothing."""
    distribution, _, wrench = ready()
    assert distribution.solve(-wrench + [0, 0, 0, 0, 0, 10]) == RELAXED
    expected = distribution.result().forces()
    distribution.solve(np.full(6, np.nan))
    assert_array_equal(distribution.result().forces(), expected)
    assert distribution.solve(wrench) == SOLVED
    assert distribution.solve(np.zeros(6)) == SOLVED
    distribution.solve(np.full(6, np.nan))
    assert_array_equal(distribution.result().forces(), np.zeros(12))


def test_contact_that_was_never_initialised():
    """A mistake in the program, which must not pass for a contact that gives no force."""
    distribution, _, _ = ready()
    with pytest.raises((ValueError, RuntimeError), match="initialize|initialised"):
        distribution.add(ContactPoint())
    assert len(distribution.result().contacts) == 2


# The margin.


def margin_of(contacts, wrench, norm=None) -> WrenchMargin:
    distribution = distribution_of(contacts)
    if norm is not None:
        distribution.setWrenchWeights(np.array(norm))
    distribution.solve(np.array(wrench, dtype=float))
    return distribution.computeMargin()


def test_margin_by_hand():
    """Of a sole at the centre of mass: its limits, the least of them."""
    contacts = [at_the_com(sole(mu=0.5, gu=0.2, half_length=0.1, half_width=0.05))]
    margin = margin_of(contacts, [0, 0, 500, -5, 0, 0])
    assert margin.margin == pytest.approx(20.0, rel=1e-8)
    assert (margin.axis, margin.sign) == (3, -1)
    # In a norm in which a moment counts a hundred times, friction gives way before.
    norm = [1, 1, 1, 100, 100, 100]
    margin = margin_of(contacts, [0, 100, 500, -5, 0, 0], norm)
    assert margin.margin == pytest.approx(150.0, rel=1e-8)
    assert (margin.axis, margin.sign) == (1, 1)
    # Where soles are wide, f_z does, at the apex of the cone; or where it hardly counts.
    wide = [at_the_com(sole(mu=2.0, gu=2.0, half_length=2.0, half_width=2.0))]
    margin = margin_of(wide, [0, 0, 500, 0, 0, 0])
    assert margin.margin == pytest.approx(500.0, rel=1e-8)
    assert (margin.axis, margin.sign) == (2, -1)
    margin = margin_of(contacts, [0, 0, 500, 0, 0, 0], [100, 100, 1e-3, 100, 100, 100])
    assert margin.margin == pytest.approx(0.5, rel=1e-8)
    assert (margin.axis, margin.sign) == (2, -1)


def test_margin_where_anything_can_be_given():
    """Palms on opposite walls press as hard as they like."""
    palms = []
    for side in (-1.0, 1.0):
        palm = sole(mu=0.5, gu=0.1, half_length=0.1, half_width=0.05)
        to_wall = pin.SE3(pin.exp3(np.array([0.0, -side * np.pi / 2, 0.0])), side * np.eye(3)[0])
        palm.updateNewtonEuler(np.zeros(3), to_wall)
        palms.append(palm)
    for wrench in (np.zeros(6), [0, 0, 500, 0, 0, 0], [900, 20, -50, 1, 2, 3]):
        margin = margin_of(palms, wrench)
        assert margin.margin == np.inf
        assert (margin.axis, margin.sign) == (-1, 0)


def test_margin_of_nothing():
    contacts = line_of_soles(-0.5, 0.5)
    # Out of reach.
    margin = margin_of(contacts, [0, 0, -1, 0, 0, 0])
    assert (margin.margin, margin.axis, margin.sign) == (0.0, -1, 0)
    # On an edge, and at the apex.
    assert margin_of(contacts, [50, 0, 100, 0, -50, 0]).margin == pytest.approx(0.0, abs=1e-7)
    assert margin_of(contacts, np.zeros(6)).margin == 0.0
    # No contact, no answer.
    assert margin_of([], np.zeros(6)).margin == 0.0
    for margin in (margin_of(contacts, np.full(6, np.nan)), WrenchDistribution().computeMargin()):
        assert np.isnan(margin.margin)
        assert (margin.axis, margin.sign) == (-1, 0)


@CALM
@given(seeds)
def test_margin_is_that_of_the_twelve_directions(seed):
    """Within it another algorithm finds every wrench in reach, and beyond it one that is not."""
    rng = np.random.default_rng(seed)
    contacts = random_contacts(rng)
    wrench = wrench_of(contacts, [force_inside(contact, rng, 0.9) for contact in contacts])
    norm = 10.0 ** rng.uniform(-1.0, 1.0, 6)
    margin = margin_of(contacts, wrench, norm)
    assert 0.0 < margin.margin < np.inf

    def distance(axis, sign, size):
        step = sign * size / norm[axis] * np.eye(6)[axis]
        return share_by_edges(contacts, wrench + step, norm).distance

    for axis, sign in itertools.product(range(6), (-1, 1)):
        assert distance(axis, sign, margin.margin * (1.0 - 1e-6)) < 1e-10
    assert distance(margin.axis, margin.sign, margin.margin * (1.0 + 1e-4)) > 1e-10
    # Nothing has happened to the distribution.
    distribution = distribution_of(contacts)
    distribution.solve(wrench)
    forces = distribution.result().forces()
    distribution.computeMargin()
    assert_array_equal(distribution.result().forces(), forces)
    assert distribution.result().isOptimal()


# The result.


def result_of(contacts, wrench) -> DistributionResult:
    distribution = distribution_of(contacts)
    distribution.solve(np.array(wrench, dtype=float))
    return distribution.result()


def mixed_contacts() -> list[ContactBase]:
    """A sole and a point, 1 m below the centre of mass."""
    com = np.array([0.0, 0.0, 1.0])
    contacts = [*line_of_soles(-0.5), point(mu=0.5)]
    contacts[1].updateNewtonEuler(com, pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0])))
    return contacts


@pytest.mark.parametrize(
    "wrench",
    [[0, 0, 500, 0, 0, 0], [400, 0, 500, 0, 0, 0], [np.nan] * 6, None],
    ids=["Solved", "Relaxed", "InvalidInput", "before"],
)
def test_shapes_and_types(wrench):
    """The same after any status; before the first solve there are no contacts."""
    contacts = mixed_contacts()
    result = WrenchDistribution().result() if wrench is None else result_of(contacts, wrench)
    assert isinstance(result, DistributionResult)
    assert isinstance(result.status, DistributionStatus)
    for name in ("wrench", "achieved", "residual", "wrench_weights", "wrench_multipliers"):
        values = getattr(result, name)
        assert (values.shape, values.dtype) == ((6,), float), name
    assert isinstance(result.scale, float)
    assert isinstance(result.cost, float)
    assert isinstance(result.iterations, int)
    assert isinstance(result.contacts, list)
    assert result.forces().dtype == float
    if wrench is None:
        assert result.contacts == []
        assert result.forces().shape == (0,)
        return
    assert result.forces().shape == (9,)
    assert len(result.contacts) == 2
    for share, contact in zip(result.contacts, contacts, strict=True):
        assert isinstance(share, DistributionResult.Contact)
        m, n = inequalities(contact).shape
        shapes = {"A": (m, n), "weights": (n,), "NE": (6, n), "force": (n,), "active": (m,)}
        shapes |= {"multipliers": (m,), "relaxation_multipliers": (m,)}
        for name, shape in shapes.items():
            values = getattr(share, name)
            assert values.shape == shape, name
            assert values.dtype == (bool if name == "active" else float), name


def test_before_the_first_solve():
    result = WrenchDistribution().result()
    assert result.status == DistributionStatus.NoContact
    for name in ("wrench", "achieved", "residual", "wrench_multipliers", "scale", "cost"):
        assert np.isnan(getattr(result, name)).all(), name
    assert_array_equal(result.wrench_weights, np.ones(6))
    assert result.iterations == 0
    assert not result.isOptimal()


@pytest.mark.parametrize("name", ["status", "wrench", "achieved", "scale", "cost", "contacts"])
def test_results_are_not_to_be_written(name):
    result = result_of(mixed_contacts(), [0, 0, 500, 0, 0, 0])
    with pytest.raises(AttributeError):
        setattr(result, name, getattr(result, name))


@THOROUGH
@given(seeds)
def test_what_a_result_says_of_itself(seed):
    """Sums, cost, and the conditions of optimality in both stages, by their formulas."""
    rng = np.random.default_rng(seed)
    contacts, wrench = reachable(rng)
    if seed % 2:
        wrench += 300.0 * rng.standard_normal(6)
    norm = 10.0 ** rng.uniform(-1.0, 1.0, 6)
    distribution = distribution_of(contacts)
    distribution.setWrenchWeights(norm)
    status = distribution.solve(wrench)
    result = distribution.result()
    scale = np.linalg.norm(norm * wrench)
    assert result.status == status
    assert result.scale == pytest.approx(scale, rel=1e-15)
    assert_array_equal(result.wrench, wrench)
    assert_array_equal(result.wrench_weights, norm)
    assert result.iterations >= 0
    assert_array_equal(result.forces(), np.concatenate([c.force for c in result.contacts]))
    given = sum(share.NE @ share.force for share in result.contacts)
    assert_allclose(norm * result.achieved, norm * given, rtol=0, atol=1e-12 * scale)
    assert_array_equal(result.residual, wrench - result.achieved)
    costs = [cost(share.weights, share.force) for share in result.contacts]
    assert result.cost == pytest.approx(sum(costs), rel=1e-12)

    pull = norm**2 * result.residual
    for share, contact in zip(result.contacts, contacts, strict=True):
        assert_array_equal(share.A, inequalities(contact))
        assert_array_equal(share.weights, contact.reg_A())
        assert_array_equal(share.NE, contact.ne_A())
        slack = share.A @ share.force
        assert slack.max() <= 1e-9 * scale
        assert_allclose(slack[share.active], 0.0, rtol=0, atol=1e-9 * scale)
        # W^2 lambda = NE' nu - A' mu
        by_wrench = share.NE.T @ result.wrench_multipliers
        by_limits = share.A.T @ share.multipliers
        size = np.abs(share.NE.T) @ np.abs(result.wrench_multipliers)
        size += np.abs(share.A.T) @ np.abs(share.multipliers) + scale * share.weights.max() ** 2
        of_cost = share.weights**2 * share.force
        assert (np.abs(of_cost - by_wrench + by_limits) <= 1e-8 * size).all()
        assert not share.multipliers[~share.active].any()
        held = share.relaxation_multipliers > 0.0
        assert share.multipliers[~held].min(initial=0.0) >= -1e-9 * size.max()
        # NE' D^2 r = A' mu'
        assert share.relaxation_multipliers.min() >= 0.0
        if status == RELAXED:
            by_relaxation = share.A.T @ share.relaxation_multipliers
            size = np.abs(share.NE).max() * np.linalg.norm(pull)
            assert_allclose(share.NE.T @ pull, by_relaxation, rtol=0, atol=1e-8 * size)
            assert_allclose(slack[held], 0.0, rtol=0, atol=1e-9 * scale)
        else:
            assert not held.any()
    if status == RELAXED:
        assert abs(pull @ result.achieved) <= 1e-9 * scale * np.linalg.norm(norm * result.residual)
    else:
        assert np.linalg.norm(norm * result.residual) <= 1e-8 * scale
    assert result.isOptimal()
    assert result.isOptimal(tolerance=1e-5)
    assert not result.isOptimal(-1.0)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, DistributionResult.copy, None])
def test_results_are_copies(copied):
    """Of what was, whatever happens to the distribution or to what is handed out."""
    contacts, wrench = reachable(np.random.default_rng(3))
    distribution = distribution_of(contacts)
    distribution.solve(wrench)
    held = distribution.result()
    if copied:
        held = copied(held)
    expected = held.forces().copy()
    forces = held.contacts[0].force.copy()
    for array in (held.wrench, held.achieved, held.forces(), held.contacts[0].force):
        array += 9.0
    distribution.solve(3.0 * wrench)
    distribution.clear()
    del distribution
    gc.collect()
    assert held.status == SOLVED
    assert_array_equal(held.wrench, wrench)
    assert_array_equal(held.forces(), expected)
    assert_array_equal(held.contacts[0].force, forces)
    assert held.isOptimal()
    share = held.contacts[0]
    del held
    gc.collect()
    assert_array_equal(share.force, forces)
    assert_array_equal(share.copy().force, forces)


BETWEEN = """
import numpy as np
import pinocchio as pin
from dynacom import Contact6D, Contact6DSettings, ContactPoint, ContactPointSettings
from dynacom import WrenchDistribution
settings = Contact6DSettings(), ContactPointSettings()
for one in settings:
    one.frame_name = "foot"
    one.mu = 0.5
contacts = Contact6D(settings[0]), ContactPoint(settings[1])
for contact in contacts:
    contact.updateNewtonEuler(np.zeros(3), pin.SE3.Identity())
wrench = np.array([0.0, 0.0, 500.0, 0.0, 0.0, 0.0])
for before in ((), contacts[:1], contacts, contacts[::-1]):
    for after in ((), contacts[1:], 20 * contacts):
        distribution = WrenchDistribution()
        for contact in before:
            distribution.add(contact)
        distribution.solve(wrench)
        distribution.clear()
        for contact in after:
            distribution.add(contact)
        {call}
        distribution.solve(wrench)
        assert len(distribution.result().contacts) == len(after)
        assert distribution.result().isOptimal()
"""


@pytest.mark.parametrize(
    "call",
    [
        "distribution.result().forces()",
        "distribution.result().isOptimal()",
        "distribution.computeMargin()",
        "distribution.copy().result().copy()",
    ],
)
def test_between_add_and_solve(call):
    """There is no answer then, but nothing goes wrong: in a process, which would not survive it."""
    run = subprocess.run(
        [sys.executable, "-c", BETWEEN.replace("{call}", call)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert run.returncode == 0, run.stderr


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
    assert_array_equal(distribution.result().forces(), expected)


def test_contacts_by_their_matrices():
    """The same as the contacts themselves; or all of them as one."""
    contacts, wrench = reachable(np.random.default_rng(5))
    for asked in (wrench, -wrench):
        status, expected = distribute(contacts, asked)
        distribution = WrenchDistribution()
        for contact in contacts:
            matrices = {"weights": contact.reg_A(), "NE": contact.ne_A()}
            distribution.add(A=inequalities(contact), **matrices)
        assert distribution.solve(asked) == status
        atol = 1e-9 * np.linalg.norm(wrench)
        assert_allclose(distribution.result().forces(), expected, rtol=0, atol=atol)
        distribution.clear()
        distribution.add(
            block_diagonal([inequalities(contact) for contact in contacts]),
            np.concatenate([contact.reg_A() for contact in contacts]),
            np.hstack([contact.ne_A() for contact in contacts]),
        )
        assert distribution.solve(asked) == status
        assert distribution.result().isOptimal()
        assert_allclose(distribution.result().forces(), expected, rtol=0, atol=atol)


def test_contacts_that_are_none():
    """Any matrices will do: a rope, a jet without limits, one that does nothing at all."""
    distribution = WrenchDistribution()
    rope = np.eye(6)[:, 2:3]
    distribution.add(np.array([[-1.0]]), np.ones(1), rope)
    distribution.add(np.zeros((0, 2)), np.array([1.0, 2.0]), np.eye(6)[:, :2])
    distribution.add(np.zeros((0, 1)), np.ones(1), np.zeros((6, 1)))
    assert distribution.solve(np.array([3.0, -4.0, 5.0, 0.0, 0.0, 0.0])) == SOLVED
    result = distribution.result()
    assert_allclose(result.forces(), [5, 3, -4, 0], rtol=0, atol=1e-9)
    assert [share.A.shape for share in result.contacts] == [(1, 1), (0, 2), (0, 1)]
    assert [share.active.shape for share in result.contacts] == [(1,), (0,), (0,)]
    assert result.isOptimal()
    assert distribution.solve(np.array([3.0, -4.0, -5.0, 0.0, 0.0, 0.0])) == RELAXED
    assert_allclose(distribution.result().forces(), [0, 3, -4, 0], rtol=0, atol=1e-9)
    assert distribution.result().isOptimal()


A, WEIGHTS, NE = np.zeros((2, 3)), np.ones(3), np.ones((6, 3))


@pytest.mark.parametrize(
    ("matrices", "message"),
    [
        ((A[:, :2], WEIGHTS, NE), "A must have 3 columns.*, got 2"),
        ((A, WEIGHTS[:2], NE), "A must have 2 columns.*, got 3"),
        ((A, WEIGHTS, NE[:, :2]), "NE must have 3 columns.*, got 2"),
        ((A, WEIGHTS, NE[:5]), "NE must have 6 rows, got 5"),
        ((A, WEIGHTS, np.ones((0, 3))), "NE must have 6 rows, got 0"),
        ((A[:, :0], WEIGHTS[:0], NE[:, :0]), "weights must have 1 component or more, got none"),
        ((A + np.nan, WEIGHTS, NE), "A must be finite"),
        ((A - np.inf, WEIGHTS, NE), "A must be finite"),
        ((A, np.array([1.0, 0.0, 1.0]), NE), "weights must be finite and > 0, got 1 0 1"),
        ((A, np.array([1.0, -2.0, 1.0]), NE), "weights must be finite and > 0, got +1 -2 +1"),
        ((A, np.array([1.0, np.nan, 1.0]), NE), "weights must be finite and > 0, got.* nan"),
        ((A, np.array([1.0, np.inf, 1.0]), NE), "weights must be finite and > 0, got.* inf"),
    ],
)
def test_matrices_that_cannot_be_added(matrices, message):
    """The message names the thing; nothing was added."""
    distribution, _, wrench = ready()
    forces = distribution.result().forces()
    with pytest.raises(ValueError, match=f"^{message}"):
        distribution.add(*matrices)
    assert len(distribution.result().contacts) == 2
    assert distribution.solve(wrench) == SOLVED
    assert_array_equal(distribution.result().forces(), forces)


def test_matrices_of_numbers_that_are_not_finite():
    """NE comes from sensors: a status."""
    distribution = WrenchDistribution()
    distribution.add(A, WEIGHTS, np.nan * NE)
    assert distribution.solve(np.ones(6)) == DistributionStatus.InvalidInput
    assert_array_equal(distribution.result().forces(), np.zeros(3))
    distribution.clear()
    distribution.add(A, WEIGHTS, NE)
    assert distribution.solve(np.ones(6)) == SOLVED


@pytest.mark.parametrize("wrong", [0.0, -1.0, np.nan, np.inf])
def test_wrench_weights_out_of_their_range(wrong):
    distribution, _, wrench = ready()
    weights = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    distribution.setWrenchWeights(weights)
    assert_array_equal(distribution.getWrenchWeights(), weights)
    for component in range(6):
        broken = weights.copy()
        broken[component] = wrong
        message = rf"wrench weights must be finite and > 0, got.* {wrong:g}|got +{wrong:g}"
        with pytest.raises(ValueError, match=message):
            distribution.setWrenchWeights(broken)
        assert_array_equal(distribution.getWrenchWeights(), weights)
    for size in (0, 3, 5, 7):
        with pytest.raises(ValueError, match=f"weights must have 6 components, got {size}"):
            distribution.setWrenchWeights(weights=np.ones(size))
    for kind in (None, 1.0, "ones", ["1.0"] * 6):
        with pytest.raises(TypeError):
            distribution.setWrenchWeights(kind)
    assert_array_equal(distribution.getWrenchWeights(), weights)
    assert distribution.solve(wrench) == SOLVED


def test_wrench_weights_are_copies_and_stay():
    distribution, contacts, wrench = ready()
    weights = np.arange(1, 7)
    distribution.setWrenchWeights(weights)
    weights[:] = 0
    distribution.getWrenchWeights()[:] = 9.0
    distribution.clear()
    assert_array_equal(distribution.getWrenchWeights(), np.arange(1, 7))
    assert_array_equal(distribution.copy().getWrenchWeights(), np.arange(1, 7))
    for contact in contacts:
        distribution.add(contact)
    distribution.solve(wrench)
    assert_array_equal(distribution.result().wrench_weights, np.arange(1, 7))
    assert distribution.result().scale == pytest.approx(3 * 500.0)


def test_only_the_ratios_of_wrench_weights_count():
    contacts, wrench = reachable(np.random.default_rng(2))
    distribution = distribution_of(contacts)
    norm = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    distribution.setWrenchWeights(norm)
    assert distribution.solve(-wrench) == RELAXED
    expected = distribution.result()
    distribution.setWrenchWeights(1e3 * norm)
    assert distribution.solve(-wrench) == RELAXED
    result = distribution.result()
    atol = 1e-9 * np.linalg.norm(wrench)
    assert_allclose(result.achieved, expected.achieved, rtol=0, atol=atol)
    assert_allclose(result.forces(), expected.forces(), rtol=0, atol=10 * atol)


@pytest.mark.parametrize("warm", [True, False])
def test_problems_of_changing_size_on_one_object(warm):
    """Nothing is left of the problem before, however large it was, and whether in reach or not.

    But for rounding, where solve() starts from it.
    """
    rng = np.random.default_rng(7)
    distribution = WrenchDistribution()
    distribution.setWarmStart(warm)
    for number in range(100):
        contacts, wrench = reachable(rng)
        wrench *= -1.0 if number % 3 == 0 else 1.0
        distribution.clear()
        for contact in contacts:
            distribution.add(contact)
        status, forces = distribute(contacts, wrench)
        atol = 1e-9 * np.linalg.norm(wrench) if warm else 0.0
        for _ in range(2):  # and the same again, on what the first solution has left
            assert distribution.solve(wrench) == status
            assert_allclose(distribution.result().forces(), forces, rtol=0, atol=atol)
            assert distribution.result().isOptimal()


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, WrenchDistribution.copy])
def test_copies_share_nothing(copied):
    contacts, wrench = reachable(np.random.default_rng(3))
    distribution = distribution_of(contacts)
    distribution.setWarmStart(False)  # so that the same problem again takes the same steps
    assert distribution.solve(wrench) == SOLVED
    forces = distribution.result().forces()
    other = copied(distribution)
    assert_array_equal(other.result().forces(), forces)
    assert other.solve(2.0 * wrench) == SOLVED
    assert_array_equal(distribution.result().forces(), forces)
    other.clear()
    assert distribution.solve(wrench) == SOLVED
    assert_array_equal(distribution.result().forces(), forces)


# How it is solved: from where it starts, how long, and what is kept for the next time.


def add_in_slots(
    distribution: WrenchDistribution, contacts: list[ContactBase], slots: list[int]
) -> None:
    distribution.clear()
    for contact, slot in zip(contacts, slots, strict=True):
        distribution.add(contact, slot)


@THOROUGH
@given(seeds)
def test_warm_start_changes_no_answer(seed):
    """Of contacts that move, come and go, in their slots, and of wrenches in reach or not."""
    rng = np.random.default_rng(seed)
    contacts, wrench = reachable(rng)
    warm = WrenchDistribution()
    for slot, contact in enumerate(contacts):
        warm.reserve(contact, slot)
    for _ in range(5):
        slots = list(rng.permutation(len(contacts))[: rng.integers(1, len(contacts) + 1)])
        moving = [contacts[slot] for slot in slots]
        for contact in moving:
            step = pin.SE3(pin.exp3(rng.uniform(-0.05, 0.05, 3)), rng.uniform(-0.02, 0.02, 3))
            contact.updateNewtonEuler(np.array([0.1, 0.2, 0.8]), contact.getPose() * step)
        asked = wrench + 30.0 * rng.standard_normal(6)
        add_in_slots(warm, moving, slots)
        cold = distribution_of(moving)
        cold.setWarmStart(False)
        assert warm.solve(asked) == cold.solve(asked)
        result, expected = warm.result(), cold.result()
        tolerance = 1e-9 * np.linalg.norm(asked)
        assert_allclose(result.achieved, expected.achieved, rtol=0, atol=tolerance)
        assert_allclose(result.forces(), expected.forces(), rtol=0, atol=10 * tolerance)
        assert result.isOptimal()


def at_a_corner(contacts: list[ContactBase]) -> np.ndarray:
    """A wrench for which many inequalities are active."""
    settings = [contact.getSettings() for contact in contacts]
    forces = [
        np.array([s.mu, s.mu, 1.0, s.half_width, s.half_length, s.gu]) * 100.0 * (number + 1)
        for number, s in enumerate(settings)
    ]
    return wrench_of(contacts, forces)


def test_warm_start_saves_steps():
    """From the active inequalities of the answer there is but one to it; that is the default."""
    contacts = line_of_soles(-0.5, 0.5)
    hard = 0.999 * at_a_corner(contacts)
    distribution = distribution_of(contacts)
    assert distribution.getWarmStart() is True
    assert distribution.solve(hard) == SOLVED
    cold_steps = distribution.result().iterations
    assert cold_steps > 2
    for warm, steps in ((True, 1), (False, cold_steps), (True, 1)):
        distribution.setWarmStart(warmStart=warm)
        assert distribution.getWarmStart() is warm
        assert distribution.solve(hard) == SOLVED
        assert distribution.result().iterations == steps
        assert distribution.result().isOptimal()
    # It is the slots that remember, in whatever order they take part.
    add_in_slots(distribution, contacts[::-1], [1, 0])
    assert distribution.solve(hard) == SOLVED
    assert distribution.result().iterations == 1
    # A copy remembers as well, and reset() forgets.
    other = distribution.copy()
    assert other.solve(hard) == SOLVED
    assert other.result().iterations == 1
    other.reset()
    for contact in contacts:
        other.add(contact)
    assert other.solve(hard) == SOLVED
    assert other.result().iterations == cold_steps


@CALM
@given(seeds)
def test_maximal_iterations(seed):
    """As many as a problem takes are enough; one less is not, and forces are those of before."""
    rng = np.random.default_rng(seed)
    contacts, wrench = reachable(rng)
    distribution = distribution_of(contacts)
    distribution.setWarmStart(False)
    status = distribution.solve(wrench)
    needed, expected = distribution.result().iterations, distribution.result().forces()
    assert distribution.solve(2.0 * expected.max() * np.eye(6)[2]) in (SOLVED, RELAXED)
    kept = distribution.result().forces()
    for number in {1, needed // 2, needed - 1} - {0, needed}:
        distribution.setMaximalIterations(maximalIterations=number)
        assert distribution.getMaximalIterations() == number
        assert distribution.solve(wrench) == DistributionStatus.NumericalFailure
        assert_no_answer(distribution, kept)
        assert distribution.result().iterations <= number
    for number in (needed, needed + 1, 10 * needed):
        distribution.setMaximalIterations(number)
        assert distribution.solve(wrench) == status
        assert_array_equal(distribution.result().forces(), expected)
        assert distribution.result().iterations == needed


def test_no_iterations_are_enough_where_none_are_needed():
    """Without contacts, without a wrench, without numbers."""
    distribution = WrenchDistribution()
    distribution.setMaximalIterations(1)
    assert distribution.solve(np.ones(6)) == DistributionStatus.NoContact
    distribution.add(line_of_soles(0.0)[0])
    assert distribution.solve(np.zeros(6)) == SOLVED
    assert distribution.solve(np.full(6, np.nan)) == DistributionStatus.InvalidInput


@pytest.mark.parametrize("number", [0, -1])
def test_maximal_iterations_out_of_range(number):
    distribution, _, wrench = ready()
    assert distribution.getMaximalIterations() == WrenchDistribution.kMaximalIterations == 100_000
    distribution.setMaximalIterations(7)
    with pytest.raises(ValueError, match=f"^maximalIterations must be > 0, got {number}$"):
        distribution.setMaximalIterations(number)
    for wrong in (None, 2.0, "2"):
        with pytest.raises(TypeError):
            distribution.setMaximalIterations(wrong)
    assert distribution.getMaximalIterations() == 7
    assert distribution.solve(wrench) == SOLVED


@CALM
@given(seeds)
def test_slots_change_no_answer(seed):
    """Shares are in the order of add(), whatever the slots."""
    rng = np.random.default_rng(seed)
    contacts, wrench = reachable(rng)
    status, forces = distribute(contacts, wrench)
    distribution = WrenchDistribution()
    slots = list(rng.permutation(len(contacts) + 2)[: len(contacts)])
    for slot in range(len(contacts) + 2):  # slots are there before they are taken in any order
        distribution.reserve(contact=contacts[0], slot=slot)
    for _ in range(2):
        add_in_slots(distribution, contacts, slots)
        assert distribution.solve(wrench) == status
        result = distribution.result()
        assert_allclose(result.forces(), forces, rtol=0, atol=1e-9 * np.linalg.norm(wrench))
        for share, contact in zip(result.contacts, contacts, strict=True):
            assert_array_equal(share.NE, contact.ne_A())
            assert_array_equal(share.A, inequalities(contact))
            assert_array_equal(share.weights, contact.reg_A())
        assert result.isOptimal()


def test_slots_that_cannot_be_taken():
    """Nothing has changed: the contacts added before are still those of the problem."""
    contacts = line_of_soles(-0.5, 0.0, 0.5)
    distribution = WrenchDistribution()
    distribution.add(contacts[0], np.int64(0))
    distribution.add(contact=contacts[1], slot=1)
    for slot in (0, 1):
        with pytest.raises(ValueError, match=f"slot {slot} is taken already"):
            distribution.add(contacts[2], slot)
    for call in (distribution.add, distribution.reserve):
        with pytest.raises(ValueError, match="slot must be at most 2, .*got 3"):
            call(contacts[2], 3)
        with pytest.raises(OverflowError):
            call(contacts[2], -1)
        with pytest.raises(ValueError, match="never initialised"):
            call(ContactPoint(), 2)
        for wrong in (None, 1.0, "1"):
            with pytest.raises(TypeError):
                call(contacts[2], wrong)
    with pytest.raises(NotReadyError, match=r"before updateNewtonEuler\(\)"):
        distribution.add(sole(), 2)
    wrench = np.array([0.0, 0.0, 500.0, 0.0, 0.0, 0.0])
    status, forces = distribute(contacts[:2], wrench)
    assert distribution.solve(wrench) == status
    assert_allclose(distribution.result().forces(), forces, rtol=0, atol=1e-12)
    # By its matrices, a contact takes the slot of its position, too.
    distribution.clear()
    distribution.add(contacts[0], 1)
    with pytest.raises(ValueError, match="slot 1 is taken already"):
        distribution.add(A, WEIGHTS, NE)


def test_forces_belong_to_slots():
    """The same contacts in other slots are others: without an answer, their forces are zero."""
    distribution, contacts, wrench = ready()
    kept = distribution.result().forces()
    for slots, expected in (([0, 1], kept), ([1, 0], np.zeros(12)), ([0, 1], np.zeros(12))):
        add_in_slots(distribution, contacts, slots)
        assert distribution.solve(np.full(6, np.nan)) == DistributionStatus.InvalidInput
        assert_array_equal(distribution.result().forces(), expected)
    assert distribution.solve(wrench) == SOLVED


def test_reserve_changes_nothing():
    """Neither the problem at hand nor its answer."""
    distribution, contacts, wrench = ready()
    before = repr(distribution.result())
    distribution.reserve(point(mu=0.5), 2)
    assert repr(distribution.result()) == before
    assert distribution.solve(wrench) == SOLVED
    assert len(distribution.result().contacts) == 2
    add_in_slots(distribution, contacts, [2, 0])
    assert distribution.solve(wrench) == SOLVED
    assert distribution.result().isOptimal()


def test_reset():
    """As new, but for weights and settings."""
    distribution, contacts, wrench = ready()
    distribution.setWrenchWeights(np.full(6, 2.0))
    distribution.setWarmStart(False)
    distribution.setMaximalIterations(5)
    distribution.reset()
    assert repr(distribution.result()) == repr(WrenchDistribution().result())
    assert_array_equal(distribution.getWrenchWeights(), np.full(6, 2.0))
    assert distribution.getWarmStart() is False
    assert distribution.getMaximalIterations() == 5
    with pytest.raises(ValueError, match="slot must be at most 0"):
        distribution.add(contacts[0], 1)
    assert distribution.solve(wrench) == DistributionStatus.NoContact
    for contact in contacts:
        distribution.add(contact)
    assert distribution.solve(np.full(6, np.nan)) == DistributionStatus.InvalidInput
    assert_array_equal(distribution.result().forces(), np.zeros(12))
    assert distribution.solve(wrench) == SOLVED


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, WrenchDistribution.copy])
def test_copies_have_the_settings(copied):
    distribution, _, _ = ready()
    distribution.setWarmStart(False)
    distribution.setMaximalIterations(3)
    other = copied(distribution)
    distribution.setWarmStart(True)
    distribution.setMaximalIterations(4)
    assert other.getWarmStart() is False
    assert other.getMaximalIterations() == 3


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
    for wrong in (None, "wrench", [1.0, None], np.ones((2, 3)), np.array(list("abcdef"))):
        with pytest.raises(TypeError):
            distribution.solve(wrong)
        with pytest.raises(TypeError):
            distribution.add(wrong)
        with pytest.raises(TypeError):
            distribution.solve(np.ones(6), wrong)
    for matrices in ((None, WEIGHTS, NE), (A, [1, 1, 1], NE), (A, WEIGHTS, "NE"), (A, WEIGHTS)):
        with pytest.raises(TypeError):
            distribution.add(*matrices)
    assert distribution.solve(np.ones(6)) == DistributionStatus.NoContact
    with pytest.raises(TypeError):
        distribution.result().isOptimal("very")


def test_status_names():
    names = ["Solved", "Relaxed", "NoContact", "InvalidInput", "NumericalFailure"]
    assert list(DistributionStatus.names) == names
    for name, status in DistributionStatus.names.items():
        assert str(status) == name
        assert getattr(DistributionStatus, name) == status
    assert len(set(DistributionStatus.values)) == len(names)
