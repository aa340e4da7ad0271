# SPDX-License-Identifier: BSD-2-Clause
"""Random problems of distribution, for the library and for the reference."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin
from mpmath import mpf

import reference
from dynacom import Contact6D, ContactPoint, DistributionResult, WrenchDistribution
from helpers import UP, point, sole


@dataclass
class Surface:
    """A contact, by its settings and its place."""

    is_point: bool
    mu: float
    gu: float
    half_length: float
    half_width: float
    weights: np.ndarray
    rotation: np.ndarray
    position: np.ndarray

    @property
    def limits(self) -> np.ndarray:
        """|λᵢ| ≤ limits[i] λ_z."""
        limits = [self.mu, self.mu, 1.0, self.half_width, self.half_length, self.gu]
        return np.array(limits[: self.weights.size])

    def make(self, com: np.ndarray) -> ContactPoint | Contact6D:
        if self.is_point:
            contact = point(mu=self.mu, weights=self.weights)
        else:
            contact = sole(
                mu=self.mu,
                gu=self.gu,
                half_length=self.half_length,
                half_width=self.half_width,
                weights=self.weights,
            )
        contact.updateNewtonEuler(com, pin.SE3(self.rotation, self.position))
        return contact


@dataclass
class Problem:
    com: np.ndarray
    surfaces: list[Surface]
    wrench: np.ndarray = field(default_factory=lambda: np.zeros(6))
    wrench_weights: np.ndarray = field(default_factory=lambda: np.ones(6))
    same_as: "Problem | None" = None  # a problem with the same forces, for the reference

    def contacts(self) -> list[ContactPoint | Contact6D]:
        return [surface.make(self.com) for surface in self.surfaces]

    def solve(self) -> DistributionResult:
        distribution = WrenchDistribution()
        distribution.setWrenchWeights(self.wrench_weights)
        for contact in self.contacts():
            distribution.add(contact)
        distribution.solve(self.wrench)
        return distribution.result()

    def exact(self, change: Callable[[mpf], mpf] = lambda x: x) -> "ExactProblem":
        """These numbers, or changed ones, for the reference; lever arms before any rounding."""
        if self.same_as:
            return self.same_as.exact(change)

        def exactly(values: np.ndarray) -> reference.Vector:
            return [change(x) for x in reference.exactly(values)]

        com = reference.exactly(self.com)
        contacts = []
        for surface in self.surfaces:
            lever = reference.plus(reference.exactly(surface.position), -reference.ONE, com)
            contacts.append(
                reference.place(
                    [exactly(row) for row in surface.rotation],
                    [change(x) for x in lever],
                    exactly(surface.limits),
                    exactly(surface.weights),
                )
            )
        return ExactProblem(contacts, exactly(self.wrench), exactly(self.wrench_weights))

    def sensitivity(self) -> float:
        """How much λ changes, relative to its norm, with half a unit in all numbers' last place."""
        rng = np.random.default_rng(0)
        forces = self.exact().solve().stacked()
        changed = [
            self.exact(lambda x: x * (1 + int(rng.choice([-1, 1])) * mpf(2) ** -53)).solve()
            for _ in range(8)
        ]
        return max(relative_difference(answer.stacked(), forces) for answer in changed)


@dataclass
class ExactProblem:
    contacts: list[reference.Contact]
    wrench: reference.Vector
    wrench_weights: reference.Vector

    def solve(self) -> reference.Answer:
        return reference.solve(self.contacts, self.wrench, self.wrench_weights)


def relative_difference(vector: reference.Vector, expected: reference.Vector) -> float:
    difference = reference.norm(reference.plus(vector, -reference.ONE, expected))
    return float(difference / (reference.norm(expected) or 1))


# Random problems.


def random_surface(
    rng: np.random.Generator, com: np.ndarray, tilt: float = 0.3, decades: float = 0.0, **fields
) -> Surface:
    is_point = bool(rng.integers(2))
    is_point = fields.pop("is_point", is_point)
    direction = rng.uniform(-np.pi, np.pi)
    axis = np.array([np.cos(direction), np.sin(direction), 0.0])
    yaw = pin.exp3(rng.uniform(-np.pi, np.pi) * UP)
    surface = Surface(
        is_point=is_point,
        mu=rng.uniform(0.2, 1.0),
        gu=rng.uniform(0.01, 0.2),
        half_length=rng.uniform(0.01, 0.15),
        half_width=rng.uniform(0.01, 0.1),
        weights=10.0 ** rng.uniform(-decades / 2, decades / 2, 3 if is_point else 6),
        rotation=pin.exp3(rng.uniform(0.0, tilt) * axis) @ yaw,
        position=com + rng.uniform([-0.5, -0.5, -1.2], [0.5, 0.5, -0.4]),
    )
    return replace(surface, **fields)


def force_inside(rng: np.random.Generator, surface: Surface, corner: bool) -> np.ndarray:
    """Of unit normal force."""
    size = surface.weights.size
    use = rng.choice([-1.0, 1.0], size) if corner else 0.99 * rng.uniform(-1.0, 1.0, size)
    use[2] = 1.0
    return use * surface.limits


def inside(rng: np.random.Generator, problem: Problem, corner: bool = False) -> np.ndarray:
    """A wrench that the contacts can give: about 1 N."""
    return sum(
        rng.uniform(0.1, 1.0) * contact.ne_A() @ force_inside(rng, surface, corner)
        for surface, contact in zip(problem.surfaces, problem.contacts(), strict=True)
    )


def anywhere(rng: np.random.Generator) -> np.ndarray:
    wrench = rng.uniform(-1.0, 1.0, 6)
    wrench[2] += rng.integers(2) * 2.0
    return wrench


def random_wrench(rng: np.random.Generator, problem: Problem, number: int) -> np.ndarray:
    """Of every four, two are inside, one is made of the cones' corners, one is anywhere."""
    if number % 4 == 3:
        return anywhere(rng)
    return inside(rng, problem, corner=number % 4 == 2)


def random_problem(
    rng: np.random.Generator,
    number: int,
    count: int | None = None,
    com: np.ndarray | None = None,
    mass: float = 50.0,
    **fields,
) -> Problem:
    com = rng.uniform([-2.0, -2.0, 0.5], [2.0, 2.0, 1.2]) if com is None else com
    count = rng.integers(1, 6) if count is None else count
    problem = Problem(com, [random_surface(rng, com, **fields) for _ in range(count)])
    problem.wrench = 9.81 * mass * random_wrench(rng, problem, number)
    return problem
