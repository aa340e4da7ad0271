# SPDX-License-Identifier: BSD-2-Clause
"""The exact answer of a wrench distribution, to 50 digits: the tests' reference.

A contact's forces of unit normal force are a box, |λᵢ| ≤ Lᵢ: what is the largest over its cone, and
what is the closest in it, can be written down. That leaves two small problems:

 1. min ‖D (w − w*)‖ over what the contacts give. w* is a combination of at most six corners of
    cones, found by the active-set method of Lawson and Hanson.
 2. min ½ ‖W λ‖² over the forces that give w*. Its dual has six variables ν, and is a concave
    function made of quadratic pieces: Newton's method, with a proximal term for ν that are not
    unique, ends on the right piece.

How an answer was found does not matter: certify() proves it, from the problem and the answer
alone. Numbers have four times the digits that are asked for, for the square of the error is what
the proof bounds, and boundaries that differ by a rounding error of doubles cost digits, too.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from mpmath import mp, mpf

DIGITS = 50
mp.dps = 4 * DIGITS

ZERO, ONE = mpf(0), mpf(1)
# What is nothing, relative to its terms: less than the square of the smallest error that counts.
NOTHING = mpf(10) ** -(2 * DIGITS + 10)
# How exactly stage two gives its wrench.
DONE = mpf(10) ** -(3 * DIGITS)
# The last of the factors of stage two's proximal term.
PROXIMITY = mpf(10) ** -70

Vector = list[mpf]


@dataclass
class Contact:
    """Forces (f_x, f_y, f_z) and perhaps moments (τ_x, τ_y, τ_z), |λᵢ| ≤ limits[i] λ_z."""

    columns: list[Vector]  # what each component gives: six numbers
    limits: Vector  # that of f_z has no meaning
    weights: Vector

    @property
    def others(self) -> list[int]:
        """All components but the normal force."""
        return [i for i in range(len(self.weights)) if i != 2]


@dataclass
class Answer:
    """The optimum. The cost is ½ ‖W λ‖²."""

    forces: list[Vector]
    cost: mpf
    achieved: Vector
    distance: mpf  # ‖D (w − w*)‖
    multipliers: Vector  # ν
    error: mpf  # by which the conditions of optimality fail, relative to their terms

    def stacked(self) -> Vector:
        return [component for force in self.forces for component in force]


def exactly(values: Sequence[float]) -> Vector:
    return [mpf(float(value)) for value in values]


def dot(a: Vector, b: Vector) -> mpf:
    return mp.fdot(a, b)


def norm(a: Vector) -> mpf:
    return mp.sqrt(mp.fdot(a, a))


def times(a: Vector, b: Vector) -> Vector:
    return [x * y for x, y in zip(a, b, strict=True)]


def plus(a: Vector, factor: mpf, b: Vector) -> Vector:
    return [x + factor * y for x, y in zip(a, b, strict=True)]


def cross(a: Vector, b: Vector) -> Vector:
    return [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]


def place(rotation: list[Vector], lever: Vector, limits: Vector, weights: Vector) -> Contact:
    """A contact at a lever arm from the centre of mass; rotation by rows."""
    axes = [[row[i] for row in rotation] for i in range(3)]
    columns = [axis + cross(lever, axis) for axis in axes]
    if len(weights) == 6:
        columns += [[ZERO] * 3 + axis for axis in axes]
    return Contact(columns, limits, weights)


def wrench_of(contacts: list[Contact], forces: list[Vector]) -> Vector:
    columns = [column for contact in contacts for column in contact.columns]
    stacked = [component for force in forces for component in force]
    return [dot([column[i] for column in columns], stacked) for i in range(6)]


def pull(contact: Contact, wrench: Vector) -> Vector:
    """The linear function wrench · (NE λ) of λ, as its coefficients."""
    return [dot(column, wrench) for column in contact.columns]


def support(contact: Contact, g: Vector) -> mpf:
    """The largest g·λ among the contact's forces with λ_z = 1."""
    return g[2] + sum((contact.limits[i] * abs(g[i]) for i in contact.others), ZERO)


def _size(contact: Contact) -> mpf:
    return sum(norm(column) for column in contact.columns)


def solve(contacts: list[Contact], wrench: Vector, wrench_weights: Vector | None = None) -> Answer:
    """The cheapest forces that give the wrench, or the closest to it that contacts can give."""
    D = wrench_weights or [ONE] * 6
    scale = norm(times(D, wrench))
    if scale == 0:
        zero = [[ZERO] * len(contact.weights) for contact in contacts]
        return Answer(zero, ZERO, [ZERO] * 6, ZERO, [ZERO] * 6, ZERO)
    wanted = [x / scale for x in wrench]
    achieved = _closest(contacts, wanted, D)
    residual = plus(wanted, -ONE, achieved)
    largest = max(weight for contact in contacts for weight in contact.weights)
    multipliers, forces = _cheapest(contacts, _faces(contacts, residual, D), achieved, largest)
    forces = [[scale * component for component in force] for force in forces]
    answer = Answer(
        forces,
        sum(norm(times(c.weights, f)) ** 2 for c, f in zip(contacts, forces, strict=True)) / 2,
        [scale * x for x in achieved],
        scale * norm(times(D, residual)),
        [scale * largest**2 * x for x in multipliers],
        ZERO,
    )
    answer.error = certify(contacts, wrench, D, answer)
    if not answer.error <= NOTHING:
        raise ArithmeticError(f"not certified: {mp.nstr(answer.error, 5)}")
    return answer


# Stage one.


def _closest(contacts: list[Contact], wrench: Vector, D: Vector) -> Vector:
    """The reachable wrench closest to one of unit size."""
    target = times(D, wrench)
    corners: list[Vector] = []
    shares: Vector = []
    for _ in range(1000):
        left = list(target)
        for corner, share in zip(corners, shares, strict=True):
            left = plus(left, -share, corner)
        if norm(left) <= NOTHING:
            break
        entering = _best_corner(contacts, left, D)
        if entering is None:
            break
        corners.append(entering)
        shares.append(ZERO)
        while True:
            trial = _least_squares(corners, target)
            leaving = [i for i, share in enumerate(trial) if share <= 0]
            if not leaving:
                break
            step, first = min((shares[i] / (shares[i] - trial[i]), i) for i in leaving)
            shares = [x + step * (y - x) for x, y in zip(shares, trial, strict=True)]
            del corners[first], shares[first]
        shares = trial
    else:
        raise ArithmeticError("stage one did not end")
    return [(x - y) / d for x, y, d in zip(target, left, D, strict=True)]


def _best_corner(contacts: list[Contact], left: Vector, D: Vector) -> Vector | None:
    """Of all corners, as weighted unit wrenches, that which reduces most what is left."""
    best, corner = NOTHING * norm(left), None
    weighted = times(D, left)
    for contact in contacts:
        g = pull(contact, weighted)
        if support(contact, g) <= 0:
            continue
        wrench = contact.columns[2]
        for i in contact.others:
            wrench = plus(wrench, mp.sign(g[i]) * contact.limits[i], contact.columns[i])
        wrench = times(D, wrench)
        size = norm(wrench)
        if size > 0 and dot(wrench, left) / size > best:
            best = dot(wrench, left) / size
            corner = [x / size for x in wrench]
    return corner


def _least_squares(columns: list[Vector], target: Vector) -> Vector:
    """By Gram and Schmidt, twice."""
    basis: list[Vector] = []
    triangle: list[Vector] = []
    for column in columns:
        rest, coefficients = column, [ZERO] * len(basis)
        for _ in range(2):
            for i, direction in enumerate(basis):
                along = dot(direction, rest)
                coefficients[i] += along
                rest = plus(rest, -along, direction)
        size = norm(rest)
        basis.append([x / size for x in rest])
        triangle.append([*coefficients, size])
    solution: Vector = [ZERO] * len(columns)
    rest = target
    along = []
    for direction in basis:
        along.append(dot(direction, rest))
        rest = plus(rest, -along[-1], direction)
    for i in reversed(range(len(columns))):
        solution[i] = (
            along[i] - sum((triangle[j][i] * solution[j] for j in range(i + 1, len(columns))), ZERO)
        ) / triangle[i][i]
    return solution


# Stage two.


@dataclass
class Face:
    """The forces of a contact which, all of them, lie on inequalities that stage one multiplies.

    Each component is either free within its limit, or fixed to a multiple of λ_z.
    """

    fixed: dict[int, mpf]
    nothing: bool  # λ is zero


def _faces(contacts: list[Contact], residual: Vector, D: Vector) -> list[Face]:
    y = times(times(D, D), residual)
    size = norm(times(D, residual))
    faces = []
    for contact in contacts:
        face = Face({i: ZERO for i in contact.others if contact.limits[i] == 0}, False)
        if size > NOTHING:
            g = pull(contact, y)
            doubt = NOTHING * size * _size(contact)
            face.nothing = support(contact, g) < -doubt
            for i in contact.others:
                if abs(g[i]) > doubt:
                    face.fixed[i] = mp.sign(g[i]) * contact.limits[i]
        faces.append(face)
    return faces


@dataclass
class Reduced:
    """A contact of which the fixed components went into λ_z; over the largest weight."""

    normal: Vector  # what λ_z gives, with what is fixed to it
    weight: mpf  # squared, that of λ_z likewise
    free: list[tuple[int, Vector, mpf, mpf]]  # components: number, column, weight squared, limit
    fixed: dict[int, mpf]
    size: int


def _reduce(contact: Contact, face: Face, largest: mpf) -> Reduced | None:
    if face.nothing:
        return None
    squares = [(weight / largest) ** 2 for weight in contact.weights]
    normal, weight = contact.columns[2], squares[2]
    for i, ratio in face.fixed.items():
        normal = plus(normal, ratio, contact.columns[i])
        weight += squares[i] * ratio**2
    free = [
        (i, contact.columns[i], squares[i], contact.limits[i])
        for i in contact.others
        if i not in face.fixed
    ]
    return Reduced(normal, weight, free, face.fixed, len(squares))


def _project(contact: Reduced, nu: Vector) -> tuple[Vector, list[tuple[Vector, mpf]]]:
    """λ of least ½ ‖W λ‖² − ν·NE λ, and its derivative by ν: Σ of columns' squares times factors.

    With λ_z = t given, components are clamped at Lᵢ t where t is less than their breakpoint; t is
    where the derivative by t, which grows, is zero.
    """
    slope = dot(contact.normal, nu)
    parts = []
    for i, column, square, limit in contact.free:
        a = dot(column, nu)
        parts.append((abs(a) / (square * limit), a, i, column, square, limit))
    parts.sort(key=lambda part: -part[0])
    force = [ZERO] * contact.size
    if slope + sum((part[5] * abs(part[1]) for part in parts), ZERO) <= 0:
        return force, []
    curvature, normal = contact.weight, contact.normal
    clamped = 0
    while clamped < len(parts) and slope / curvature < parts[clamped][0]:
        _, a, _, column, square, limit = parts[clamped]
        slope += limit * abs(a)
        curvature += square * limit**2
        normal = plus(normal, mp.sign(a) * limit, column)
        clamped += 1
    t = slope / curvature
    force[2] = t
    for i, ratio in contact.fixed.items():
        force[i] = ratio * t
    terms = [(normal, 1 / curvature)]
    for number, (_, a, i, column, square, limit) in enumerate(parts):
        if number < clamped:
            force[i] = mp.sign(a) * limit * t
        else:
            force[i] = a / square
            terms.append((column, 1 / square))
    return force, terms


def _cheapest(
    contacts: list[Contact], faces: list[Face], wrench: Vector, largest: mpf
) -> tuple[Vector, list[Vector]]:
    """ν, over the largest weight squared, and λ for a wrench that the faces can give."""
    reduced = [_reduce(*pair, largest) for pair in zip(contacts, faces, strict=True)]

    # Rows are scaled such that forces without limits give wrenches of unit size.
    sizes = [ZERO] * 6
    for contact in filter(None, reduced):
        for column, square in [(contact.normal, contact.weight)] + [c[1:3] for c in contact.free]:
            for i in range(6):
                sizes[i] += column[i] ** 2 / square
    rows = [1 / mp.sqrt(size) if size > 0 else ONE for size in sizes]
    for contact in filter(None, reduced):
        contact.normal = times(rows, contact.normal)
        contact.free = [(i, times(rows, c), square, limit) for i, c, square, limit in contact.free]
    wrench = times(rows, wrench)

    def evaluate(nu: Vector) -> tuple[Vector, list[Vector], list[tuple[Vector, mpf]]]:
        """The dual's gradient, the forces, and what makes up its second derivative."""
        forces, gradient, terms = [], wrench, []
        for contact, original in zip(reduced, contacts, strict=True):
            if contact is None:
                forces.append([ZERO] * len(original.weights))
                continue
            force, of_contact = _project(contact, nu)
            forces.append(force)
            terms += of_contact
            gradient = plus(gradient, -force[2], contact.normal)
            for i, column, _, _ in contact.free:
                gradient = plus(gradient, -force[i], column)
        return gradient, forces, terms

    nu = [ZERO] * 6
    proximity = mpf(10) ** -3
    for _ in range(40):  # ever less of it, until it makes no difference
        centre = nu
        state = evaluate(nu)
        for _ in range(200):
            away = plus(nu, -ONE, centre)
            gradient = plus(state[0], -proximity, away)
            if norm(gradient) <= DONE * (1 + proximity * norm(away)):
                break
            step = _newton_step(state[2], proximity, gradient)
            rise = dot(step, gradient)
            length = ONE
            for _ in range(200):  # until it does not go beyond the highest point
                trial = plus(nu, length, step)
                state_there = evaluate(trial)
                there = plus(state_there[0], -proximity, plus(trial, -ONE, centre))
                if dot(there, step) >= -rise / 1000:
                    break
                length /= 2
            nu, state = trial, state_there
        if norm(state[0]) <= DONE:
            return times(rows, nu), state[1]
        proximity = max(proximity * mpf(10) ** -5, PROXIMITY)
    raise ArithmeticError("stage two did not end")


def _newton_step(terms: list[tuple[Vector, mpf]], proximity: mpf, gradient: Vector) -> Vector:
    """By Cholesky's decomposition."""
    columns = [column for column, _ in terms]
    scaled = [[factor * x for x in column] for column, factor in terms]
    L = [[ZERO] * 6 for _ in range(6)]
    for i in range(6):
        of_row = [column[i] for column in scaled]
        for j in range(i + 1):
            entry = dot(of_row, [column[j] for column in columns]) if terms else ZERO
            if i == j:
                L[i][i] = mp.sqrt(entry + proximity - dot(L[i][:i], L[i][:i]))
            else:
                L[i][j] = (entry - dot(L[i][:j], L[j][:j])) / L[j][j]
    x: Vector = []
    for i in range(6):
        x.append((gradient[i] - dot(L[i][:i], x)) / L[i][i])
    for i in reversed(range(6)):
        x[i] = (x[i] - sum((L[j][i] * x[j] for j in range(i + 1, 6)), ZERO)) / L[i][i]
    return x


# The proof.


def certify(contacts: list[Contact], wrench: Vector, D: Vector, answer: Answer) -> mpf:
    """By how much the conditions of optimality of both stages fail, relative to their terms.

    Where they hold there is no other answer: stage one's problem is convex and its w* unique; any
    forces κ that give w* have Σ g·κ = y·w* = 0 with g = NEᵀ y, y = D² (w − w*), and g·κ ≤ 0 for
    each contact, hence = 0: they lie on the face that g exposes. Among those, λ is the cheapest
    if q = W² λ − NEᵀ ν has q·λ = 0 and q·κ ≥ 0 for all κ of the face, and it is unique.
    """
    scale = norm(times(D, wrench))
    achieved = wrench_of(contacts, answer.forces)
    residual = plus(wrench, -ONE, achieved)
    distance = norm(times(D, residual))
    y = times(times(D, D), residual)
    out_of_reach = distance > NOTHING * scale
    failures = [
        norm(times(D, plus(achieved, -ONE, answer.achieved))) / scale,
        abs(distance - answer.distance) / scale,
    ]
    if out_of_reach:
        failures.append(abs(dot(y, achieved)) / (distance * scale))
    for contact, force in zip(contacts, answer.forces, strict=True):
        failures.append(-force[2] / scale)
        for i in contact.others:
            failures.append((abs(force[i]) - contact.limits[i] * force[2]) / scale)

        # Components of κ on the face: λ_z = 1, fixed[i] the others, or free within limits.
        fixed, is_nothing = {}, False
        if out_of_reach:
            g = pull(contact, y)
            size = distance * _size(contact)
            highest = support(contact, g) / size
            failures.append(highest)
            is_nothing = highest < -NOTHING
            for i in contact.others:
                if abs(g[i]) > NOTHING * size:
                    fixed[i] = mp.sign(g[i]) * contact.limits[i]
        if is_nothing:
            failures.append(norm(force) / scale)
            continue
        for i, ratio in fixed.items():
            failures.append(abs(force[i] - ratio * force[2]) / scale)
        of_cost = times(times(contact.weights, contact.weights), force)
        of_wrench = pull(contact, answer.multipliers)
        q = plus(of_cost, -ONE, of_wrench)
        least = q[2]
        for i in contact.others:
            least += q[i] * fixed[i] if i in fixed else -contact.limits[i] * abs(q[i])
        terms = sum(map(abs, of_cost)) + sum(map(abs, of_wrench))
        terms += max(contact.weights) ** 2 * scale * NOTHING
        failures.append(-least / terms)
        failures.append(abs(dot(q, force)) / (terms * (norm(force) + scale)))
    return max(failures)
