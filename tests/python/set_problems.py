# SPDX-License-Identifier: BSD-2-Clause
"""Random problems of distribution over sets of every kind, for the library and for Clarabel.

Sections are told by their vertices, or by a radius; what is inside of them is a sum of vertices.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import clarabel
import numpy as np
import pinocchio as pin
from scipy import sparse

from dynacom import (
    ContactSet,
    DistributionContact,
    DistributionProblem,
    DistributionSolution,
    DistributionSolver,
    DistributionStatus,
    Section,
)
from helpers import UP

KINDS = ("boxes", "discs", "polygons", "bounds", "grasps", "references", "mixed")

UP_FORCE = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
MIRROR = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])  # of wrenches and forces, across y = 0
# More than any program has.
VARIABLES = 1000
# Of Clarabel: what is asked for, and what will do. It does not always arrive at the former.
TOLERANCES = 1e-10, 1e-8
# Of the residual, a component that exposes a face.
EXPOSED = 1e-7


@dataclass
class Shape:
    """A section: a disc where it has a radius."""

    vertices: np.ndarray = field(default_factory=lambda: np.zeros((1, 2)))
    radius: float = 0.0

    def section(self) -> Section:
        return Section.disc(self.radius) if self.radius > 0.0 else Section.polygon(self.vertices)

    def random_point(self, rng: np.random.Generator) -> np.ndarray:
        """Inside, not on the boundary."""
        if self.radius > 0.0:
            angle = rng.uniform(-np.pi, np.pi)
            return rng.uniform(0.0, 0.95) * self.radius * np.array([np.cos(angle), np.sin(angle)])
        shares = rng.uniform(0.05, 1.0, len(self.vertices))
        return shares @ self.vertices / shares.sum()

    def support(self, direction: np.ndarray) -> float:
        if self.radius > 0.0:
            return self.radius * np.linalg.norm(direction)
        return np.max(self.vertices @ direction)

    def exposed(self, direction: np.ndarray, tolerance: float) -> "Shape":
        """The face of what is farthest in a direction."""
        if self.radius == 0.0:
            values = self.vertices @ direction
            return Shape(self.vertices[values >= values.max() - tolerance])
        length = np.linalg.norm(direction)
        return Shape(self.radius / length * direction[None, :]) if length > tolerance else self

    def mirrored(self) -> "Shape":
        return Shape(self.vertices * [1.0, -1.0], self.radius)


@dataclass
class Contact:
    """A contact in numbers; of a grasp, only bounds, of a point, only friction and bounds."""

    size: int
    lower: np.ndarray  # of each component of a grasp, else [2] only
    upper: np.ndarray
    rotation: np.ndarray
    lever: np.ndarray
    weights: np.ndarray
    reference: np.ndarray
    is_grasp: bool = False
    friction: Shape = field(default_factory=Shape)
    places: Shape = field(default_factory=Shape)
    gamma: tuple[float, float] = (0.0, 0.0)  # τ_z over f_z, from and to

    def make(self) -> DistributionContact:
        if self.is_grasp:
            contact_set = ContactSet.grasp(self.lower, self.upper)
        else:
            friction = self.friction.section()
            contact_set = (
                ContactSet.surface(friction, self.places.section(), self.gamma[1])
                if self.size == 6
                else ContactSet.point(friction)
            )
            contact_set.boundNormalForce(self.lower[2], self.upper[2])
        return DistributionContact(
            contact_set, self.rotation, self.lever, self.weights, self.reference
        )

    @property
    def NE(self) -> np.ndarray:
        return pin.SE3(self.rotation, self.lever).toActionMatrixInverse().T[:, : self.size]

    def random_force(self, rng: np.random.Generator, size: float) -> np.ndarray:
        """Inside, not on the boundary, but where that is all there is."""
        least = np.where(np.isfinite(self.lower), self.lower, self.upper - size)
        greatest = np.minimum(self.upper, least + size)
        force = least + rng.uniform(0.05, 0.95, 6) * (greatest - least)
        if not self.is_grasp:
            x, y = self.places.random_point(rng)
            yaw = self.gamma[0] + rng.uniform(0.05, 0.95) * np.ptp(self.gamma)
            force = force[2] * np.array([*self.friction.random_point(rng), 1.0, y, -x, yaw])
        return force[: self.size]

    def exposed(self, pull: np.ndarray) -> "Contact":
        """The face of the forces with the largest product with a pull."""
        tolerance = EXPOSED * max(1.0, np.linalg.norm(self.lever))
        pull = np.concatenate([pull, np.zeros(6 - self.size)])
        face = replace(self, lower=self.lower.copy(), upper=self.upper.copy())
        rates = pull
        if not self.is_grasp:
            slide, tip = pull[:2], np.array([-pull[4], pull[3]])
            face.friction = self.friction.exposed(slide, tolerance)
            face.places = self.places.exposed(tip, tolerance)
            if abs(pull[5]) > tolerance:
                face.gamma = (np.sign(pull[5]) * self.gamma[1],) * 2
            rates = np.zeros(6)
            rates[2] = pull[2] + self.friction.support(slide) + abs(pull[5]) * self.gamma[1]
            rates[2] += self.places.support(tip)
        face.lower[rates > tolerance] = self.upper[rates > tolerance]
        face.upper[rates < -tolerance] = self.lower[rates < -tolerance]
        return face

    def mirrored(self) -> "Contact":
        """Across the plane y = 0."""
        bounds = np.stack([self.lower * MIRROR, self.upper * MIRROR])
        return replace(
            self,
            lower=bounds.min(axis=0) if self.is_grasp else self.lower,
            upper=bounds.max(axis=0) if self.is_grasp else self.upper,
            rotation=MIRROR[:3, None] * self.rotation * MIRROR[:3],
            lever=MIRROR[:3] * self.lever,
            reference=MIRROR[: self.size] * self.reference,
            friction=self.friction.mirrored(),
            places=self.places.mirrored(),
        )


@dataclass
class Problem:
    contacts: list[Contact]
    wrench: np.ndarray
    wrench_weights: np.ndarray = field(default_factory=lambda: np.ones(6))
    minimal_scale: float = 0.0

    def make(self) -> DistributionProblem:
        return DistributionProblem(
            [contact.make() for contact in self.contacts],
            self.wrench,
            self.wrench_weights,
            self.minimal_scale,
        )

    def mirrored(self) -> "Problem":
        contacts = [contact.mirrored() for contact in self.contacts]
        return replace(self, contacts=contacts, wrench=MIRROR * self.wrench)


class Answer(NamedTuple):
    """Clarabel's."""

    value: float
    tolerance: float  # that it has kept


# Random problems.


def random_polygon(rng: np.random.Generator, size: float, count: int, off_centre: float) -> Shape:
    """Vertices on an ellipse."""
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, count))
    radii = size * np.array([1.0, rng.uniform(0.3, 1.0)])
    centre = off_centre * size * rng.uniform(-1.0, 1.0, 2)
    return Shape(centre + radii * np.stack([np.cos(angles), np.sin(angles)], axis=1))


def box(half_x: float, half_y: float) -> Shape:
    return Shape(np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [half_x, half_y])


def random_contact(rng: np.random.Generator, kind: str) -> Contact:
    def is_of(other: str) -> bool:
        return kind == other or (kind == "mixed" and rng.integers(2) == 0)

    is_grasp = rng.integers(3) > 0 if kind == "grasps" else kind == "mixed" and rng.integers(5) == 0
    size = 6 if is_grasp else int(rng.choice([3, 6]))
    sizes = np.array([1.0, 1.0, 1.0, 0.1, 0.1, 0.1])
    lower, upper = np.zeros(6), np.full(6, np.inf)
    if is_grasp:
        lower = -rng.integers(0, 2, 6) * sizes * 10.0 ** rng.uniform(0.0, 2.5, 6)
        upper = sizes * 10.0 ** rng.uniform(0.0, 2.5, 6)
        upper[rng.integers(10, size=6) == 0] = np.inf
        fixed = rng.integers(10, size=6) == 0
        upper[fixed] = lower[fixed]
    elif is_of("bounds"):
        lower[2] = rng.choice([0.0, 10.0 ** rng.uniform(0.0, 2.0)])
        upper[2] = lower[2] + rng.choice(
            [0.0, 10.0 ** rng.uniform(1.0, 3.0), np.inf], p=[0.1, 0.6, 0.3]
        )
    mu = rng.uniform(0.1, 1.2)
    if is_of("discs"):
        friction = Shape(radius=mu)
    elif is_of("polygons"):
        friction = random_polygon(rng, mu, int(rng.integers(3, 9)), 0.2)
    else:
        friction = box(mu, mu)
    half = rng.uniform([0.02, 0.01], [0.2, 0.1])
    if is_of("polygons"):
        places = random_polygon(rng, half[0], int(rng.integers(1, 9)), rng.uniform(0.0, 2.0))
    elif is_of("discs") and rng.integers(3) == 0:
        places = Shape(radius=half[0])
    else:
        places = box(*half)
    gamma = rng.choice([0.0, rng.uniform(0.005, 0.1)], p=[0.1, 0.9])
    weights = 10.0 ** rng.uniform(-0.5, 0.5, size)
    if rng.integers(2):
        weights[1] = weights[0]
    tilt = rng.uniform(-0.3, 0.3, 3) * (4.0 if rng.integers(3) == 0 else 1.0)
    reference = np.zeros(size)
    if is_of("references"):
        reference = (
            rng.uniform(-1.0, 1.0, size) * sizes[:size] * 10.0 ** rng.uniform(0.0, 2.0, size)
        )
    return Contact(
        size=size,
        lower=lower,
        upper=upper,
        rotation=pin.exp3(tilt) @ pin.exp3(rng.uniform(-np.pi, np.pi) * UP),
        lever=rng.uniform([-0.5, -0.3, -1.0], [0.5, 0.3, -0.5]),
        weights=weights,
        reference=reference,
        is_grasp=is_grasp,
        friction=friction,
        places=places,
        gamma=(-gamma, gamma),
    )


def random_problem(rng: np.random.Generator, kind: str, number: int) -> Problem:
    """One to four contacts; every second wrench is one of theirs, the others are anywhere."""
    contacts = [random_contact(rng, kind) for _ in range(rng.integers(1, 5))]
    size = 10.0 ** rng.uniform(0.0, 3.0)
    if number % 2 == 0:
        wrench = sum(contact.NE @ contact.random_force(rng, size) for contact in contacts)
    else:
        wrench = size * (rng.uniform(-1.0, 1.0, 6) * [1.0, 1.0, 1.0, 0.3, 0.3, 0.3] + UP_FORCE)
    problem = Problem(contacts, wrench)
    if rng.integers(3) == 0:
        problem.wrench_weights = 10.0 ** rng.uniform(-1.0, 1.0, 6)
    if rng.integers(2):
        problem.minimal_scale = size
    return problem


def make_problem(kind: str, number: int, seed: int = 0) -> Problem:
    rng = np.random.default_rng([KINDS.index(kind), number, seed])
    return random_problem(rng, kind, number)


# By the library.


def solve(problem: Problem) -> DistributionSolution:
    return DistributionSolver().solve(problem.make())


def size_of(problem: Problem, wrench: np.ndarray) -> float:
    return np.linalg.norm(problem.wrench_weights * wrench)


def unit_of(problem: Problem) -> float:
    """The scale as a force; a newton where nothing is asked."""
    return problem.make().scale() / problem.wrench_weights.max() or 1.0


def cost_scale(problem: Problem, solution: DistributionSolution) -> float:
    """What errors of the cost are relative to: no cost is counted from less than a force."""
    largest = max(np.abs(force).max() for force in solution.forces)
    least_weight = min(contact.weights.min() for contact in problem.contacts)
    return solution.cost + 0.5 * (least_weight * max(largest, unit_of(problem))) ** 2


# The same by Clarabel.


class Program:
    """A conic program: ½ z'Pz + q'z, subject to rows of which each is b − A z in a cone."""

    def __init__(self) -> None:
        self.size = 0
        self._rows: list[tuple[np.ndarray, np.ndarray, Callable]] = []

    def variables(self, count: int) -> np.ndarray:
        self.size += count
        return np.arange(self.size - count, self.size)

    def row(self, *terms: tuple[np.ndarray | int, np.ndarray | float]) -> np.ndarray:
        """The sum of coefficients times variables."""
        row = np.zeros(VARIABLES)
        for variables, coefficients in terms:
            row[variables] += coefficients
        return row

    def add(self, cone: Callable, constants: object, rows: list[np.ndarray]) -> None:
        """Constants + rows · z in the cone."""
        self._rows.append((-np.array(rows), np.array(constants, dtype=float), cone))

    def _equations(self) -> tuple[np.ndarray, np.ndarray]:
        """Those that say something of their own: Clarabel's answers suffer from others."""
        found = [(A[:, : self.size], b) for A, b, cone in self._rows if cone is clarabel.ZeroConeT]
        if not found:
            return np.zeros((0, self.size)), np.zeros(0)
        A, b = np.vstack([A for A, _ in found]), np.concatenate([b for _, b in found])
        lengths = np.maximum(np.linalg.norm(A, axis=1), 1e-300)
        U, S, Vt = np.linalg.svd(A / lengths[:, None], full_matrices=False)
        own = S > 1e-10
        return Vt[own], (U[:, own].T @ (b / lengths)) / S[own]

    def minimise(self, P: np.ndarray, q: np.ndarray) -> Answer | None:
        """None if Clarabel does not arrive at either tolerance."""
        A, b = self._equations()
        matrices, constants, cones = [A], [b], [clarabel.ZeroConeT(len(b))]
        for A, b, cone in self._rows:
            if cone is clarabel.ZeroConeT:
                continue
            matrices.append(A[:, : self.size])
            constants.append(b)
            cones.append(cone(len(b)))
        options = clarabel.DefaultSettings()
        options.verbose = False
        options.max_iter = 500
        full, reduced = TOLERANCES
        options.tol_gap_abs = options.tol_gap_rel = options.tol_feas = full
        options.reduced_tol_gap_abs = options.reduced_tol_gap_rel = reduced
        options.reduced_tol_feas = reduced
        # What helps it to arrive there.
        options.max_step_fraction = 0.95
        options.iterative_refinement_max_iter = 50
        options.iterative_refinement_abstol = options.iterative_refinement_reltol = 1e-15
        solution = clarabel.DefaultSolver(
            sparse.csc_matrix(np.triu(P)),
            q,
            sparse.csc_matrix(np.vstack(matrices)),
            np.concatenate(constants),
            cones,
            options,
        ).solve()
        kept = {clarabel.SolverStatus.Solved: full, clarabel.SolverStatus.AlmostSolved: reduced}
        if solution.status not in kept:
            return None
        return Answer(solution.obj_val, kept[solution.status])


def add_section(
    program: Program, shape: Shape, x: np.ndarray, y: np.ndarray, normal: np.ndarray
) -> None:
    """(x, y) in the section times the normal force, all of them rows."""
    if shape.radius > 0.0:
        program.add(clarabel.SecondOrderConeT, np.zeros(3), [shape.radius * normal, x, y])
        return
    shares = program.variables(len(shape.vertices))
    for row, values in ((x, shape.vertices[:, 0]), (y, shape.vertices[:, 1]), (normal, 1.0)):
        program.add(clarabel.ZeroConeT, [0.0], [row - program.row((shares, values))])
    program.add(
        clarabel.NonnegativeConeT, np.zeros(len(shares)), [program.row((s, 1.0)) for s in shares]
    )


def add_bounds(program: Program, row: np.ndarray, lower: float, upper: float) -> None:
    if lower == upper:
        program.add(clarabel.ZeroConeT, [-lower], [row])
        return
    for sign, bound in ((1.0, -lower), (-1.0, upper)):
        if np.isfinite(bound):
            program.add(clarabel.NonnegativeConeT, [bound], [sign * row])


def add_contact(program: Program, contact: Contact, unit: float) -> np.ndarray:
    """Forces in units; their variables."""
    forces = program.variables(contact.size)
    rows = [program.row((force, 1.0)) for force in forces]
    if contact.is_grasp:
        for row, lower, upper in zip(rows, contact.lower, contact.upper, strict=True):
            add_bounds(program, row, lower / unit, upper / unit)
        return forces
    normal = rows[2]
    add_bounds(program, normal, contact.lower[2] / unit, contact.upper[2] / unit)
    add_section(program, contact.friction, rows[0], rows[1], normal)
    if contact.size == 6:
        add_section(program, contact.places, -rows[4], rows[3], normal)
        least, most = contact.gamma
        if least == most:
            program.add(clarabel.ZeroConeT, [0.0], [rows[5] - most * normal])
        else:
            program.add(
                clarabel.NonnegativeConeT,
                np.zeros(2),
                [rows[5] - least * normal, most * normal - rows[5]],
            )
    return forces


def least_distance(problem: Problem, unit: float) -> Answer | None:
    """The least ‖D (w − Σ NE λ)‖, in units: a second-order cone program."""
    program = Program()
    (distance,) = program.variables(1)
    D = problem.wrench_weights
    missing = np.zeros((6, VARIABLES))
    for contact in problem.contacts:
        forces = add_contact(program, contact, unit)
        missing[:, forces] = -D[:, None] * contact.NE
    constants = np.concatenate([[0.0], D * problem.wrench / unit])
    program.add(clarabel.SecondOrderConeT, constants, [program.row((distance, 1.0)), *missing])
    q = np.zeros(program.size)
    q[distance] = 1.0
    return program.minimise(np.zeros((program.size, program.size)), q)


def least_cost(problem: Problem, solution: DistributionSolution, unit: float) -> Answer | None:
    """The least ½ Σ ‖W (λ − λ₀)‖² of forces that give the achieved wrench, in units squared.

    Where the wrench is out of reach, these are on the faces that the residual exposes.
    """
    program = Program()
    D = problem.wrench_weights
    direction = D**2 * solution.residual
    given = np.zeros((6, VARIABLES))
    squares, references = {}, {}
    for contact in problem.contacts:
        face = contact
        if solution.status == DistributionStatus.Relaxed:
            face = contact.exposed(contact.NE.T @ direction / np.linalg.norm(direction))
        forces = add_contact(program, face, unit)
        given[:, forces] = contact.NE
        squares.update(zip(forces, contact.weights**2, strict=True))
        references.update(zip(forces, contact.reference / unit, strict=True))
    program.add(clarabel.ZeroConeT, -solution.achieved / unit, list(given))
    P, q, constant = np.zeros((program.size, program.size)), np.zeros(program.size), 0.0
    for variable, square in squares.items():
        P[variable, variable] = square
        q[variable] = -square * references[variable]
        constant += 0.5 * square * references[variable] ** 2
    answer = program.minimise(P, q)
    return answer and answer._replace(value=answer.value + constant)
