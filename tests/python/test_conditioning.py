# SPDX-License-Identifier: BSD-2-Clause
"""Distributions against the reference of 50 digits, sort by sort.

scripts/reliability runs this file as a program: test_conditioning.py PROBLEMS SEED.
"""

import multiprocessing
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
import pytest

import reference
from dynacom import DistributionStatus
from problems import (
    Problem,
    anywhere,
    force_inside,
    inside,
    random_problem,
    random_surface,
    random_wrench,
    relative_difference,
)

Maker = Callable[[np.random.Generator, int], Problem]


# The sorts of problems.


def scale_weights(problem: Problem, factor: float) -> Problem:
    for surface in problem.surfaces:
        surface.weights = factor * surface.weights
    return problem


def far_away(rng: np.random.Generator, number: int) -> Problem:
    direction = rng.standard_normal(3)
    return random_problem(rng, number, com=100.0 * direction / np.linalg.norm(direction))


def masses(rng: np.random.Generator, number: int) -> Problem:
    return random_problem(rng, number, mass=10.0 ** rng.uniform(-1.0, 4.0))


def common_weights(rng: np.random.Generator, number: int) -> Problem:
    return scale_weights(random_problem(rng, number), 10.0 ** rng.uniform(-6.0, 6.0))


def weights_apart(rng: np.random.Generator, number: int) -> Problem:
    return random_problem(rng, number, decades=4.0)


def counts(rng: np.random.Generator, number: int) -> Problem:
    return random_problem(rng, number, count=1 + 7 * (number // 4) % 16)


def tilts(rng: np.random.Generator, number: int) -> Problem:
    return random_problem(rng, number, tilt=np.deg2rad(80.0))


def redundant(rng: np.random.Generator, number: int) -> Problem:
    """Two contacts at one place: the same twice, or two of one pose, or of one position."""
    problem = random_problem(rng, number)
    first = problem.surfaces[0]
    second = replace(first)
    if number // 4 % 3 >= 1:
        second = random_surface(rng, problem.com, rotation=first.rotation)
    if number // 4 % 3 == 2:
        second = random_surface(rng, problem.com)
    second.position = first.position
    problem.surfaces.append(second)
    problem.wrench = 500.0 * random_wrench(rng, problem, number)
    return problem


def corners(rng: np.random.Generator, number: int) -> Problem:
    """Some of the contacts at corners of their cones, the others without force."""
    problem = random_problem(rng, number)
    loaded = replace(problem, surfaces=problem.surfaces[: 1 + number % len(problem.surfaces)])
    problem.wrench = 500.0 * inside(rng, loaded, corner=True)
    return problem


def boundary(rng: np.random.Generator, number: int) -> Problem:
    """The closest wrench to one out of reach, as double-precision numbers."""
    problem = out_of_reach(rng, number)
    problem.wrench = np.array([float(x) for x in problem.exact().solve().achieved])
    return problem


def out_of_reach(rng: np.random.Generator, number: int) -> Problem:
    """The closest wrench is one of the cone's facets, not its tip."""
    problem = random_problem(rng, number)
    while True:
        problem.wrench = 500.0 * anywhere(rng)
        answer = problem.exact().solve()
        if answer.distance > 1.0 and any(answer.achieved):
            return problem


def weighted_wrench(rng: np.random.Generator, number: int) -> Problem:
    problem = out_of_reach(rng, number)
    problem.wrench_weights = 10.0 ** rng.uniform(-1.0, 1.0, 6)
    return problem


def points(count: int) -> Maker:
    def make(rng: np.random.Generator, number: int) -> Problem:
        return random_problem(rng, number, count=count, is_point=True)

    return make


def line(rng: np.random.Generator, number: int) -> Problem:
    """The first contact has no width, or no length."""
    return _flattened(rng, number, ["half_width", "half_length"][number // 4 % 2])


def point_with_yaw(rng: np.random.Generator, number: int) -> Problem:
    return _flattened(rng, number, "half_width", "half_length")


def _flattened(rng: np.random.Generator, number: int, *fields: str) -> Problem:
    problem = random_problem(rng, number)
    flat = random_surface(rng, problem.com, is_point=False, weights=np.ones(6))
    problem.surfaces[0] = replace(flat, **dict.fromkeys(fields, 0.0))
    problem.wrench = 500.0 * random_wrench(rng, problem, number)
    return problem


def flat_ground(rng: np.random.Generator, number: int) -> Problem:
    """Feet side by side: many equalities in what is given, exact in double precision.

    Of every four wrenches one is inside, one presses on the feet's common edge, one is made of the
    cones' corners, one is anywhere.
    """
    com = _dyadic(rng.uniform([-2.0, -2.0, 0.5], [2.0, 2.0, 1.2]))
    foot = random_surface(rng, com, is_point=False, weights=10.0 ** rng.uniform(-1.0, 1.0, 6))
    for name in ("mu", "gu", "half_length", "half_width"):
        foot = replace(foot, **{name: float(_dyadic(max(0.01, getattr(foot, name))))})
    problem = Problem(com, [])
    for side in range(rng.integers(2, 5)):
        position = com + [0.125, _dyadic(0.25 * side - 0.3), -0.75]
        problem.surfaces.append(replace(foot, rotation=np.eye(3), position=position))
    if number % 4 == 3:
        problem.wrench = 512.0 * _dyadic(anywhere(rng))
        return problem
    for contact in problem.contacts():
        force = _dyadic(force_inside(rng, foot, corner=False) / foot.limits) * foot.limits
        if number % 4 == 1:
            force[4] = foot.half_length
        elif number % 4 == 2:
            force = force_inside(rng, foot, corner=True)
        problem.wrench += 512.0 * contact.ne_A() @ (_dyadic(rng.uniform(0.1, 1.0)) * force)
    return problem


def _dyadic(values):
    """Rounded such that sums of products of three of them have no rounding."""
    return np.round(np.asarray(values) * 256.0) / 256.0


def slope(rng: np.random.Generator, number: int) -> Problem:
    """The same on a slope, where rounding breaks the equalities: the forces are those on the flat.

    The exact answer for the rounded numbers is another one, which jumps with every digit.
    """
    flat = flat_ground(rng, number)
    turn = pin.exp3(rng.uniform(-0.5, 0.5, 3))
    surfaces = [
        replace(
            surface,
            rotation=turn @ surface.rotation,
            position=flat.com + turn @ (surface.position - flat.com),
        )
        for surface in flat.surfaces
    ]
    wrench = np.concatenate([turn @ flat.wrench[:3], turn @ flat.wrench[3:]])
    return Problem(flat.com, surfaces, wrench, same_as=flat)


def everything(rng: np.random.Generator, number: int) -> Problem:
    """All of the above at once."""
    direction = rng.standard_normal(3)
    problem = random_problem(
        rng,
        number,
        count=rng.integers(1, 17),
        com=100.0 * direction / np.linalg.norm(direction),
        mass=10.0 ** rng.uniform(-1.0, 4.0),
        tilt=np.deg2rad(80.0),
        decades=4.0,
    )
    return scale_weights(problem, 10.0 ** rng.uniform(-6.0, 6.0))


def forces_cheaper(rng: np.random.Generator, number: int) -> Problem:
    """Weights of 1e-5 on forces beside 1 on moments."""
    problem = random_problem(rng, number)
    for surface in problem.surfaces:
        surface.weights[:3] = 1e-5
        surface.weights[3:] = 1.0
    return problem


def weights_far_apart(rng: np.random.Generator, number: int) -> Problem:
    return random_problem(rng, number, decades=6.0)


SORTS: dict[str, Maker] = {
    "100 m from the world's origin": far_away,
    "masses from 0.1 kg to 10 t": masses,
    "weights of any common scale": common_weights,
    "weights up to 1e4 apart": weights_apart,
    "1 to 16 contacts": counts,
    "tilts up to 80°": tilts,
    "two contacts at one place": redundant,
    "corners of cones": corners,
    "on the boundary": boundary,
    "out of reach": out_of_reach,
    "out of reach, weighted norm": weighted_wrench,
    "one point": points(1),
    "two points": points(2),
    "three points": points(3),
    "a line": line,
    "a point with yaw": point_with_yaw,
    "flat ground": flat_ground,
    "a slope": slope,
    "all of these": everything,
}

WIDE_SORTS: dict[str, Maker] = {
    "1e-5 on forces, 1 on moments": forces_cheaper,
    "weights up to 1e6 apart": weights_far_apart,
}


# The comparison.

SAME_FORCES = 1e-7


@dataclass
class Comparison:
    status: DistributionStatus
    right_status: bool
    is_optimal: bool
    outside: float  # of the cones, over the scale
    wrench: float  # ‖D (NE λ − w*)‖, over the scale
    cost: float  # relative
    forces: float  # relative to the norm of λ
    sensitivity: float = 0.0  # where the forces differ: that of the exact answer

    @property
    def is_ill_conditioned(self) -> bool:
        return self.sensitivity > SAME_FORCES

    def errors(self, wide: bool) -> list[str]:
        """What is wrong. Where the exact answer jumps with rounding, forces and cost may differ."""
        excused = self.is_ill_conditioned and not wide
        same_forces = wide or self.forces <= SAME_FORCES
        errors = {
            f"the status is {self.status}": not self.right_status,
            "isOptimal(1e-6) is false": not self.is_optimal,
            f"outside of a cone by {self.outside:.1e}": not self.outside <= 1e-9,
            f"the wrench is off by {self.wrench:.1e}": not self.wrench <= 1e-8,
            f"the cost is off by {self.cost:.1e}": not (abs(self.cost) <= 1e-6 or excused),
            f"the forces are off by {self.forces:.1e}": not (same_forces or excused),
        }
        return [error for error, holds in errors.items() if holds]


def compare(problem: Problem) -> Comparison:
    result = problem.solve()
    exact = problem.exact()
    answer = exact.solve()
    D = exact.wrench_weights
    scale = reference.norm(reference.times(D, exact.wrench))
    forces = [reference.exactly(contact.force) for contact in result.contacts]

    outside = reference.ZERO
    cost = reference.ZERO
    for contact, force in zip(exact.contacts, forces, strict=True):
        bounds = [abs(force[i]) - contact.limits[i] * force[2] for i in contact.others]
        outside = max(outside, -force[2], *bounds)
        cost += reference.norm(reference.times(contact.weights, force)) ** 2 / 2
    missing = reference.plus(
        reference.wrench_of(exact.contacts, forces), -reference.ONE, answer.achieved
    )
    stacked = [x for force in forces for x in force]
    difference = relative_difference(stacked, answer.stacked())
    if not any(answer.stacked()):  # relative to the scale, then
        difference = float(reference.norm(stacked) / scale)
    unit = answer.cost or (scale * max(max(contact.weights) for contact in exact.contacts)) ** 2
    distance = answer.distance / scale
    right = {DistributionStatus.Solved} if distance < 1e-7 else set()
    if distance > 1e-9:
        right.add(DistributionStatus.Relaxed)
    return Comparison(
        status=result.status,
        right_status=result.status in right,
        is_optimal=result.isOptimal(1e-6),
        outside=float(outside / scale),
        wrench=float(reference.norm(reference.times(D, missing)) / scale),
        cost=float((cost - answer.cost) / unit),
        forces=difference,
        sensitivity=problem.sensitivity() if difference > SAME_FORCES else 0.0,
    )


def make_problem(sort: str, number: int, seed: int) -> Problem:
    rng = np.random.default_rng([seed, number, *sort.encode()])
    return (SORTS | WIDE_SORTS)[sort](rng, number)


@pytest.mark.parametrize("sort", [*SORTS, *WIDE_SORTS])
def test_exact(sort):
    for number in range(16):
        comparison = compare(make_problem(sort, number, seed=1))
        assert not comparison.errors(sort in WIDE_SORTS), f"problem {number}"
        assert not comparison.is_ill_conditioned or sort in WIDE_SORTS, f"problem {number}"


# The reference.


def test_certificate_refuses_what_is_not_optimal():
    """Another multiplier, and forces that give another wrench, by 1e-30."""
    exact = random_problem(np.random.default_rng(0), 0, count=3, is_point=False).exact()
    D = exact.wrench_weights
    answer = exact.solve()
    certify = reference.certify
    assert certify(exact.contacts, exact.wrench, D, answer) < 1e-110
    tiny = reference.mpf(10) ** -30
    nearly = [x * (1 + tiny) for x in answer.multipliers]
    assert certify(exact.contacts, exact.wrench, D, replace(answer, multipliers=nearly)) > 1e-35
    for factor in (1 - tiny, 1 + tiny):
        forces = [[x * factor for x in force] for force in answer.forces]
        achieved = reference.wrench_of(exact.contacts, forces)
        other = replace(answer, forces=forces, achieved=achieved)
        assert certify(exact.contacts, exact.wrench, D, other) > 1e-35


def test_reference_knows_what_is_exact():
    """Two points of which one is twice as dear, below the centre of mass and far apart."""
    up = [[reference.mpf(i == j) for j in range(3)] for i in range(3)]
    exactly = reference.exactly
    contacts = [
        reference.place(up, exactly([x, 0, -1]), exactly([0.5, 0.5, 0]), exactly(weights))
        for x, weights in ((1.0, [1, 1, 1]), (-1.0, [2, 1, 1]))
    ]
    answer = reference.solve(contacts, exactly([10, 0, 100, 0, -10, 0]))
    assert relative_difference(answer.stacked(), exactly([8, 0, 50, 2, 0, 50])) < 1e-50
    assert answer.distance < 1e-50
    # Beyond friction, and below the ground.
    answer = reference.solve(contacts, exactly([0, 0, -1, 0, 0, 0]))
    assert not any(answer.stacked())
    assert abs(answer.distance - 1) < 1e-50


# The campaign.


def run(task: tuple[str, int, int]) -> tuple[str, int, Comparison]:
    sort, number, seed = task
    try:
        return sort, number, compare(make_problem(sort, number, seed))
    except ArithmeticError as error:  # of the reference
        raise ArithmeticError(f"problem {number} of '{sort}': {error}") from error


def row(sort: str, comparisons: list[Comparison]) -> str:
    def worst(values: Iterable[float]) -> str:
        return f"{max(map(abs, values), default=0.0):.1e}"

    wide = sort in WIDE_SORTS
    statuses = [comparison.status for comparison in comparisons]
    well = [c for c in comparisons if wide or not c.is_ill_conditioned]
    cells = [
        sort,
        len(comparisons),
        statuses.count(DistributionStatus.Solved),
        statuses.count(DistributionStatus.Relaxed),
        statuses.count(DistributionStatus.NumericalFailure),
        sum(bool(comparison.errors(wide)) for comparison in comparisons),
        len(comparisons) - len(well),
        worst(comparison.forces for comparison in well),
        worst(comparison.cost for comparison in well),
        worst(comparison.wrench for comparison in comparisons),
        worst(comparison.outside for comparison in comparisons),
    ]
    return f"| {' | '.join(map(str, cells))} |"


def main(problems: int, seed: int) -> Iterator[str]:
    """The campaign's table, line by line."""
    tasks = [(sort, n, seed) for sort in (*SORTS, *WIDE_SORTS) for n in range(problems)]
    yield (
        "| problems | number | Solved | Relaxed | failures | wrong | ill-conditioned "
        "| λ | cost | wrench | outside cone |"
    )
    yield "|---|---|---|---|---|---|---|---|---|---|---|"
    comparisons: list[Comparison] = []
    wrong = 0
    with multiprocessing.Pool() as pool:
        for sort, number, comparison in pool.imap(run, tasks, chunksize=4):
            comparisons.append(comparison)
            errors = comparison.errors(sort in WIDE_SORTS)
            if errors:
                wrong += 1
                print(f"problem {number} of '{sort}': {', '.join(errors)}", file=sys.stderr)
            if number == problems - 1:
                yield row(sort, comparisons)
                comparisons = []
    if wrong:
        sys.exit(1)


if __name__ == "__main__":
    for text in main(*map(int, sys.argv[1:])):
        print(text, flush=True)
