# SPDX-License-Identifier: BSD-2-Clause
"""Distributions against Clarabel, an interior-point solver.

scripts/reliability runs this file as a program: test_second_solver.py PROBLEMS SEED.
"""

import multiprocessing
import sys
from collections.abc import Iterator
from dataclasses import dataclass

import clarabel
import numpy as np
from scipy import sparse

from dynacom import DistributionResult, DistributionStatus
from helpers import block_diagonal
from problems import Problem, anywhere, inside, random_problem

SOLVED, RELAXED = DistributionStatus.Solved, DistributionStatus.Relaxed

TOLERANCE = 1e-10
# Of the scale: a wrench this far from what the contacts can give may be called either.
REACH = 1e-9, 1e-7


def make_problem(number: int, seed: int) -> Problem:
    """One to eight contacts, weights up to ten times apart; every second wrench is within reach."""
    rng = np.random.default_rng([seed, number])
    problem = random_problem(rng, number, count=rng.integers(1, 9), decades=1.0)
    wrench = inside(rng, problem) if number % 2 == 0 else anywhere(rng)
    problem.wrench = 10.0 ** rng.uniform(0.0, 4.0) * wrench
    if number % 8 >= 6:
        problem.wrench_weights = rng.uniform(0.5, 2.0, 6)
    return problem


def minimise(P: np.ndarray, q: np.ndarray, G: np.ndarray, h: np.ndarray, cones: list) -> object:
    """½ x'Px + q'x subject to h − G x in the cones; None if Clarabel has no full answer."""
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_iter = 500
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
    # What helps it to arrive there.
    settings.max_step_fraction = 0.95
    settings.iterative_refinement_max_iter = 50
    settings.iterative_refinement_abstol = settings.iterative_refinement_reltol = 1e-15
    solver = clarabel.DefaultSolver(
        sparse.csc_matrix(P), q, sparse.csc_matrix(G), h, cones, settings
    )
    solution = solver.solve()
    return solution if solution.status == clarabel.SolverStatus.Solved else None


@dataclass
class Program:
    """A problem's matrices, for a wrench of unit weighted norm and a largest weight of one."""

    A: np.ndarray
    NE: np.ndarray
    weights: np.ndarray
    wrench: np.ndarray
    D: np.ndarray

    def distance(self) -> float | None:
        """The least ‖D (w − NE λ)‖ =: t, a second-order cone program in (t, λ)."""
        rows, n = self.A.shape
        G = np.zeros((rows + 7, 1 + n))
        G[:rows, 1:] = self.A
        G[rows, 0] = -1.0
        G[rows + 1 :, 1:] = self.D[:, None] * self.NE
        h = np.concatenate([np.zeros(rows + 1), self.D * self.wrench])
        cones = [clarabel.NonnegativeConeT(rows), clarabel.SecondOrderConeT(7)]
        q = np.zeros(1 + n)
        q[0] = 1.0
        solution = minimise(np.zeros((1 + n, 1 + n)), q, G, h, cones)
        return None if solution is None else solution.x[0]

    def cost(self) -> float | None:
        """The least ½ ‖W λ‖² with NE λ = w, a quadratic program in W λ."""
        rows, n = self.A.shape
        G = np.vstack([self.NE, self.A]) / self.weights
        h = np.concatenate([self.wrench, np.zeros(rows)])
        cones = [clarabel.ZeroConeT(6), clarabel.NonnegativeConeT(rows)]
        solution = minimise(np.eye(n), np.zeros(n), G, h, cones)
        return None if solution is None else solution.obj_val


def program(problem: Problem, result: DistributionResult) -> tuple[Program, float]:
    """And the unit of its cost."""
    weights = np.concatenate([contact.weights for contact in result.contacts])
    made = Program(
        A=block_diagonal([contact.A for contact in result.contacts]),
        NE=np.hstack([contact.NE for contact in result.contacts]),
        weights=weights / weights.max(),
        wrench=problem.wrench / result.scale,
        D=problem.wrench_weights,
    )
    return made, (result.scale * weights.max()) ** 2


@dataclass
class Comparison:
    status: DistributionStatus
    distance: float | None  # Clarabel's, over the scale
    distance_error: float = 0.0  # over the scale
    has_cost: bool = True  # whether Clarabel found it
    cost_error: float = 0.0  # relative

    @property
    def undecided(self) -> bool:
        return self.distance is None or not self.has_cost

    @property
    def wrong(self) -> str:
        if self.status not in (SOLVED, RELAXED):
            return str(self.status)
        if self.distance is None:
            return ""
        solved = self.status == SOLVED
        if (solved and self.distance > REACH[1]) or (not solved and self.distance < REACH[0]):
            return f"{self.status}, but the distance is {self.distance:.1e}"
        if not abs(self.distance_error) <= 1e-6 * self.distance + REACH[0]:
            return f"the distance {self.distance:.1e} is off by {self.distance_error:.1e}"
        if not abs(self.cost_error) <= 1e-6:
            return f"the cost is off by {self.cost_error:.1e}"
        return ""


def compare(problem: Problem) -> Comparison:
    result = problem.solve()
    other, cost_unit = program(problem, result)
    comparison = Comparison(result.status, other.distance())
    if comparison.distance is not None:
        size = np.linalg.norm(result.wrench_weights * result.residual) / result.scale
        comparison.distance_error = size - comparison.distance
    if result.status == SOLVED:
        cost = other.cost()
        comparison.has_cost = cost is not None
        if cost is not None:
            comparison.cost_error = result.cost / cost_unit / cost - 1.0
    return comparison


def test_clarabel_agrees():
    comparisons = [compare(make_problem(number, seed=1)) for number in range(400)]
    wrong = {number: c.wrong for number, c in enumerate(comparisons) if c.wrong}
    assert not wrong
    statuses = [comparison.status for comparison in comparisons]
    assert statuses.count(SOLVED) > 200
    assert statuses.count(RELAXED) > 100
    assert sum(comparison.undecided for comparison in comparisons) < 4


# The campaign.


def run(task: tuple[int, int]) -> Comparison:
    return compare(make_problem(*task))


def main(problems: int, seed: int) -> Iterator[str]:
    """The campaign's table, line by line."""
    with multiprocessing.Pool() as pool:
        tasks = ((number, seed) for number in range(problems))
        comparisons = pool.map(run, tasks, chunksize=50)
    for number, comparison in enumerate(comparisons):
        if comparison.wrong:
            print(f"problem {number}: {comparison.wrong}", file=sys.stderr)
    yield "| status | problems | wrong | no answer from Clarabel | distance | cost |"
    yield "|---|---|---|---|---|---|"
    for status in DistributionStatus.values.values():
        of_status = [c for c in comparisons if c.status == status]
        if not of_status:
            continue
        cells = [
            status,
            len(of_status),
            sum(bool(c.wrong) for c in of_status),
            sum(c.undecided for c in of_status),
            f"{max(abs(c.distance_error) for c in of_status):.1e}",
            f"{max(abs(c.cost_error) for c in of_status):.1e}" if status == SOLVED else "",
        ]
        yield f"| {' | '.join(map(str, cells))} |"
    if any(comparison.wrong for comparison in comparisons):
        sys.exit(1)


if __name__ == "__main__":
    for text in main(*map(int, sys.argv[1:])):
        print(text, flush=True)
