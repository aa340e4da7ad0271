# SPDX-License-Identifier: BSD-2-Clause
"""Distributions over sets of every kind, by identities; test_second_solver_of_sets.py has more."""

import copy
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import problems
from dynacom import (
    ContactSet,
    DistributionContact,
    DistributionProblem,
    DistributionSolver,
    DistributionStatus,
    Section,
    WrenchDistribution,
)
from helpers import UP
from set_problems import (
    KINDS,
    MIRROR,
    Contact,
    Problem,
    Shape,
    cost_scale,
    make_problem,
    size_of,
    solve,
    unit_of,
)

SOLVED, RELAXED = DistributionStatus.Solved, DistributionStatus.Relaxed


@pytest.mark.parametrize("kind", KINDS)
def test_mirrored_problems_have_mirrored_answers(kind):
    for number in range(100):
        problem = make_problem(kind, number)
        for contact in problem.contacts:  # without lower bounds, see below
            if contact.is_grasp:
                contact.upper = np.minimum(contact.upper, 1e4)
        solution, mirrored = solve(problem), solve(problem.mirrored())
        unit = unit_of(problem)
        assert mirrored.status == solution.status
        assert_allclose(mirrored.achieved, MIRROR * solution.achieved, atol=1e-8 * unit)
        assert abs(mirrored.cost - solution.cost) <= 1e-8 * cost_scale(problem, solution)
        for force, image in zip(solution.forces, mirrored.forces, strict=True):
            assert_allclose(image, MIRROR[: force.size] * force, atol=1e-6 * unit)


def test_a_grasp_without_a_lower_bound():
    """It is as one without an upper bound that holds the other way round."""
    lower, upper = np.full(6, -1.0), np.full(6, 1.0)
    upper[0] = np.inf
    wrench = np.array([5.0, 7.0, -8.0, 9.0, 0.0, 0.0])
    statuses = []
    for sign in (1.0, -1.0):
        bounds = np.sort([sign * lower, sign * upper], axis=0)
        contact = DistributionContact(ContactSet.grasp(*bounds))
        solution = DistributionSolver().solve(DistributionProblem([contact], sign * wrench))
        statuses.append(solution.status)
        assert_allclose(solution.forces[0], sign * np.array([5.0, 1.0, -1.0, 1.0, 0.0, 0.0]))
    assert statuses == [RELAXED, RELAXED]


@pytest.mark.parametrize("kind", KINDS)
def test_a_warm_start_changes_nothing(kind):
    solver = DistributionSolver()
    problem = make_problem(kind, 0)
    rng = np.random.default_rng(1)
    for _ in range(50):
        problem.wrench = problem.wrench + 0.1 * unit_of(problem) * rng.normal(size=6)
        warm, cold = solver.solve(problem.make()), solve(problem)
        assert warm.status == cold.status
        assert_allclose(warm.achieved, cold.achieved, atol=1e-8 * unit_of(problem))
        assert abs(warm.cost - cold.cost) <= 1e-8 * cost_scale(problem, cold)


def test_boxes_are_those_of_the_contact_classes():
    """The other solver of the library, for the manual's pyramids and rectangles."""
    for number in range(200):
        rng = np.random.default_rng([2, number])
        problem = problems.random_problem(rng, number, count=rng.integers(1, 5))
        distribution = WrenchDistribution()
        contacts = []
        for surface, contact in zip(problem.surfaces, problem.contacts(), strict=True):
            distribution.add(contact)
            friction = Section.facets(surface.mu, 4)
            half = [surface.half_length, surface.half_width]
            places = Section.rectangle(np.negative(half), half)
            contact_set = (
                ContactSet.point(friction)
                if surface.is_point
                else ContactSet.surface(friction, places, surface.gu)
            )
            lever = surface.position - problem.com
            contacts.append(DistributionContact(contact_set, surface.rotation, lever))
            assert_allclose(contacts[-1].NE(), contact.ne_A(), atol=1e-12)
        status = distribution.solve(problem.wrench)
        expected = distribution.result()
        solution = DistributionSolver().solve(DistributionProblem(contacts, problem.wrench))
        assert solution.status == status
        assert_allclose(solution.achieved, expected.achieved, atol=1e-7 * expected.scale)
        # Of a corner's wrench, the forces are hardly certain; the cost is.
        assert_allclose(solution.cost, expected.cost, rtol=1e-6)


# Sections that are nearly, or wholly, the same.


def with_facets(problem: Problem, count: int, part: float = 1.0) -> Problem:
    """Friction by polygons around a part of the discs."""

    def facets(disc: Shape) -> Shape:
        return Shape(Section.facets(part * disc.radius, count, angle=0.1).vertices())

    contacts = [replace(c, friction=facets(c.friction)) for c in problem.contacts]
    return replace(problem, contacts=contacts)


def test_facets_converge_to_the_cone():
    """A disc lies between the polygons around it and those within it, so what it gives does."""
    counts = [16, 32, 64]
    gaps = dict.fromkeys(counts, 0.0)
    relaxed = 0
    for number in range(1, 121, 2):
        problem = make_problem("discs", number)
        solution = solve(problem)
        scale = problem.make().scale()
        distance = size_of(problem, solution.residual)
        relaxed += solution.status == RELAXED
        for count in counts:
            around = solve(with_facets(problem, count))
            within = solve(with_facets(problem, count, np.cos(np.pi / count)))
            least, most = (size_of(problem, found.residual) for found in (around, within))
            assert least - 1e-8 * scale <= distance <= most + 1e-8 * scale
            gaps[count] += (most - least) / scale
            if within.status == SOLVED:
                tolerance = 1e-8 * cost_scale(problem, solution)
                assert around.cost - tolerance <= solution.cost <= within.cost + tolerance
    assert relaxed > 30
    for count in counts[1:]:
        assert_allclose(gaps[count // 2] / gaps[count], 4.0, rtol=0.05)


def turned(shape: Shape, angle: float) -> Shape:
    return Shape(shape.vertices @ pin.exp3(angle * UP)[:2, :2].T, shape.radius)


def test_a_polygon_of_four_vertices_is_the_rectangle():
    """Turned against the axes, it is no rectangle to the library; turned back as a whole, it is."""
    angle = 0.4
    for number in range(200):
        problem = make_problem("boxes", number)
        for contact in problem.contacts:  # with the same costs in all directions
            contact.weights[1] = contact.weights[0]
            contact.weights[4:5] = contact.weights[3:4]
        contacts = [
            replace(
                contact,
                rotation=contact.rotation @ pin.exp3(-angle * UP),
                friction=turned(contact.friction, angle),
                places=turned(contact.places, angle),
            )
            for contact in problem.contacts
        ]
        other = replace(problem, contacts=contacts)
        made = other.make().contacts[0].set
        assert made.friction().shape() == Section.Shape.Polygon
        assert made.size() == 3 or made.moments().shape() == Section.Shape.Polygon
        one, two = solve(problem), solve(other)
        unit = unit_of(problem)
        assert two.status == one.status
        assert_allclose(two.achieved, one.achieved, atol=1e-8 * unit)
        assert abs(two.cost - one.cost) <= 1e-8 * cost_scale(problem, one)
        back = pin.SE3(pin.exp3(-angle * UP), np.zeros(3)).toActionMatrixInverse().T
        for force, same in zip(one.forces, two.forces, strict=True):
            assert_allclose(back[: force.size, : force.size] @ same, force, atol=1e-6 * unit)


def bounded_to(contact: Contact, force: np.ndarray) -> Contact:
    """With no other force in its set."""
    lower, upper = np.zeros(6), np.zeros(6)
    fixed = replace(contact, lower=lower, upper=upper)
    if contact.is_grasp:
        lower[:] = upper[:] = force
        return fixed
    lower[2] = upper[2] = force[2]
    fixed.friction = Shape(force[None, :2] / force[2])
    if contact.size == 6:
        fixed.places = Shape(np.array([[-force[4], force[3]]]) / force[2])
        fixed.gamma = (0.0, 0.0)
    return fixed


@pytest.mark.parametrize("kind", KINDS)
def test_a_set_of_one_force_is_a_known_force(kind):
    """As if its wrench came from elsewhere."""
    found = 0
    for number in range(200):
        rng = np.random.default_rng([3, number])
        problem = make_problem(kind, number)
        first, *others = problem.contacts
        force = first.random_force(rng, unit_of(problem))
        if not others or not (first.is_grasp or force[2] > 0.0):
            continue
        if first.size == 6 and not first.is_grasp:
            force[5] = 0.0
        problem.minimal_scale = 10.0 * unit_of(problem) + np.abs(force).max()
        known = replace(problem, contacts=[bounded_to(first, force), *others])
        rest = replace(problem, contacts=others, wrench=problem.wrench - first.NE @ force)
        one, two = solve(known), solve(rest)
        unit = unit_of(known)
        assert one.status == two.status
        assert one.isOptimal(known.make())
        assert_allclose(one.forces[0], force, rtol=1e-12, atol=1e-12)
        assert_allclose(one.residual, two.residual, atol=1e-8 * unit)
        for a, b in zip(one.forces[1:], two.forces, strict=True):
            assert_allclose(a, b, atol=1e-6 * unit)
        found += 1
    assert found > 100


# The classes.


def one_point() -> DistributionContact:
    return DistributionContact(ContactSet.point(Section.disc(0.5)), lever=[0, 0, -1])


def test_a_force_by_hand():
    """A point below the CoM pushes up and sideways, but no more than friction allows."""
    problem = DistributionProblem([one_point()], [3, 0, 10, 0, -3, 0])
    solution = DistributionSolver().solve(problem)
    assert solution.status == SOLVED
    assert_allclose(solution.forces[0], [3.0, 0.0, 10.0], atol=1e-9)
    assert_allclose(solution.cost, 54.5)
    assert solution.isOptimal(problem)
    assert_allclose(solution.achieved, problem.wrench, atol=1e-7)
    assert_allclose(solution.residual, np.zeros(6), atol=1e-7)
    # Only forces count: the closest on the cone's side, (1, 2) · f_z with 2 f_z ≈ wrench.
    problem.wrench, problem.wrench_weights = [10, 0, 10, 0, 0, 0], [1, 1, 1, 1e-6, 1e-6, 1e-6]
    relaxed = DistributionSolver().solve(problem)
    assert relaxed.status == RELAXED
    assert_allclose(relaxed.forces[0], [6.0, 0.0, 12.0], rtol=1e-9, atol=1e-9)
    assert relaxed.isOptimal(problem)
    assert not solution.isOptimal(problem)
    assert not relaxed.isOptimal(DistributionProblem([one_point()], [3, 0, 10, 0, -3, 0]))


def test_defaults():
    contact = DistributionContact(ContactSet())
    assert_array_equal(contact.rotation, np.eye(3))
    assert_array_equal(contact.lever, np.zeros(3))
    assert contact.weights is None
    assert contact.reference is None
    assert_array_equal(contact.NE(), np.eye(6)[:, :3])
    problem = DistributionProblem([contact], np.ones(6))
    assert_array_equal(problem.wrench_weights, np.ones(6))
    assert problem.minimal_scale == 0.0
    assert_allclose(problem.scale(), np.sqrt(6.0))
    problem.minimal_scale = 10.0
    assert problem.scale() == 10.0


def test_what_a_contact_tells():
    turn = pin.exp3(np.array([0.0, 0.0, np.pi / 2]))
    grasp = ContactSet.grasp([-1] * 6, [1] * 6)
    for rotation in (turn, turn.tolist(), tuple(map(tuple, turn)), np.asfortranarray(turn)):
        contact = DistributionContact(
            set=grasp,
            rotation=rotation,
            lever=(1, 2, 3),
            weights=[1, 2, 3, 4, 5, 6],
            reference=np.arange(6),
        )
        assert contact.set == grasp
        assert_array_equal(contact.rotation, turn)
        assert_array_equal(contact.lever, [1.0, 2.0, 3.0])
        assert_array_equal(contact.weights, np.arange(1.0, 7.0))
        assert_array_equal(contact.reference, np.arange(6.0))
    oMs = pin.SE3(turn, np.array([1.0, 2.0, 3.0]))
    assert_allclose(contact.NE(), oMs.toActionMatrixInverse().T)


def test_contacts_are_changed_as_a_whole():
    """What would change a copy, and that alone, is refused."""
    problem = DistributionProblem([one_point()], np.zeros(6))
    with pytest.raises(AttributeError):
        problem.contacts[0].lever = [1, 0, 0]
    with pytest.raises(AttributeError):
        problem.contacts.append(one_point())
    problem.contacts = [*problem.contacts, DistributionContact(ContactSet())]
    assert [contact.set for contact in problem.contacts] == [one_point().set, ContactSet()]


def test_copies_share_nothing():
    problem = DistributionProblem([one_point()], [0, 0, 1, 0, 0, 0])
    for other in (problem.copy(), copy.copy(problem), copy.deepcopy(problem)):
        other.wrench, other.contacts = np.zeros(6), []
        assert_array_equal(problem.wrench, [0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
        assert len(problem.contacts) == 1
    solver = DistributionSolver()
    solution = solver.solve(problem)
    solver.solve(DistributionProblem([], [0, 0, 1, 0, 0, 0]))
    assert_allclose(solution.forces[0], [0.0, 0.0, 1.0], atol=1e-12)


def test_without_contacts():
    nothing = DistributionProblem([], np.zeros(6))
    assert DistributionSolver().solve(nothing).status == SOLVED
    something = DistributionProblem((), np.ones(6))
    solution = DistributionSolver().solve(something)
    assert solution.status == DistributionStatus.NoContact
    assert solution.isOptimal(something)
    assert_array_equal(solution.residual, np.ones(6))


def test_steps_run_out():
    solver = DistributionSolver()
    solver.setWarmStart(warm_start=False)
    problem = make_problem("discs", 3).make()
    assert solver.solve(problem).iterations > 1
    solver.setMaximalIterations(maximal_iterations=1)
    solution = solver.solve(problem)
    assert solution.status == DistributionStatus.NumericalFailure
    assert not solution.isOptimal(problem)
    for contact, force in zip(problem.contacts, solution.forces, strict=True):
        assert contact.set.excess(force) <= 0.0
    with pytest.raises(ValueError, match="^maximal_iterations must be > 0, got 0$"):
        solver.setMaximalIterations(0)


def test_they_print():
    contact = DistributionContact(ContactSet(), weights=[1, 2, 3], reference=[0, 0, 5])
    assert repr(contact) == (
        f"DistributionContact(set={ContactSet()}, rotation=[[1 0 0], [0 1 0], [0 0 1]], "
        "lever=[0 0 0], weights=[1 2 3], reference=[0 0 5])"
    )
    problem = DistributionProblem([one_point()], [0, 0, 10, 0, 0, 0], minimal_scale=2)
    assert repr(problem) == (
        "DistributionProblem(contacts=1, wrench=[0 0 10 0 0 0], wrench_weights=[1 1 1 1 1 1], "
        "minimal_scale=2)"
    )
    assert repr(DistributionSolver()) == "DistributionSolver()"
    solution = DistributionSolver().solve(DistributionProblem([], np.ones(6)))
    assert repr(solution) == (
        "DistributionSolution(status=NoContact, achieved=[0 0 0 0 0 0], residual=[1 1 1 1 1 1], "
        "cost=0, iterations=0, forces=[])"
    )


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"rotation": np.ones((3, 3))}, ValueError, "^rotation must be orthonormal"),
        ({"rotation": np.eye(4)}, ValueError, r"^rotation\[0\] must have 3 components, got 4$"),
        ({"rotation": np.eye(3)[:2]}, ValueError, "^rotation must have 3 rows, got 2$"),
        ({"rotation": 1.0}, TypeError, "^rotation must be an array, a list or .* got float$"),
        ({"rotation": [1, 0, 0]}, TypeError, r"^rotation\[0\] must be an array, .* got int$"),
        ({"lever": [1, 2]}, ValueError, "^lever must have 3 components, got 2$"),
        ({"lever": [1, 2, np.nan]}, ValueError, "^lever must be finite"),
        ({"lever": "abc"}, TypeError, "^lever must be an array, a list or .* got str$"),
        ({"weights": [1, 2]}, ValueError, "^weights must have 3 components, got 2$"),
        ({"weights": []}, ValueError, "^weights must have 3 components, got 0$"),
        ({"weights": [1, 2, 0]}, ValueError, "^weights must be finite and > 0"),
        ({"weights": 1.0}, TypeError, "^weights must be an array, a list or .* got float$"),
        ({"reference": [1, 2, 3, 4]}, ValueError, "^reference must have 3 components, got 4$"),
        ({"reference": [1, 2, np.inf]}, ValueError, "^reference must be finite"),
    ],
)
def test_what_is_no_contact(arguments, error, message):
    with pytest.raises(error, match=message):
        DistributionContact(ContactSet(), **arguments)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"wrench": [1, 2, 3]}, ValueError, "^wrench must have 6 components, got 3$"),
        ({"wrench": [np.nan] * 6}, ValueError, "^wrench must be finite"),
        ({"wrench": None}, TypeError, "^wrench must be an array, a list or .* got NoneType$"),
        ({"wrench_weights": [0] * 6}, ValueError, "^wrench_weights must be finite and > 0"),
        ({"wrench_weights": 1}, TypeError, "^wrench_weights must be an array, .* got int$"),
        ({"minimal_scale": -1.0}, ValueError, "^minimal_scale must be finite and >= 0, got -1$"),
        ({"contacts": one_point()}, TypeError, "^contacts must be an array, .*DistributionContact"),
        ({"contacts": [ContactSet()]}, TypeError, r"^contacts\[0\] must be a Dist.* ContactSet$"),
    ],
)
def test_what_is_no_problem(arguments, error, message):
    made = {"contacts": [one_point()], "wrench": np.zeros(6)}
    with pytest.raises(error, match=message):
        DistributionProblem(**(made | arguments))


def test_problems_are_looked_at_again_before_they_are_solved():
    problem = DistributionProblem([one_point()], np.zeros(6))
    problem.wrench = [np.inf] * 6
    with pytest.raises(ValueError, match="^wrench must be finite"):
        problem.validate()
    with pytest.raises(ValueError, match="^wrench must be finite"):
        DistributionSolver().solve(problem)
