# SPDX-License-Identifier: BSD-2-Clause
"""What several of the tests need: arrays of all sorts, random robots, a quadratic program."""

import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
from hypothesis import settings

import dynacom
from dynacom import Contact6D, Contact6DSettings, ContactPoint, ContactPointSettings, DynaCoM

ROOT = Path(__file__).parents[2]
SHARED_DATA = ROOT.parent / "shared" / "data"
WALKS = ROOT / "examples" / "data"

# The same examples in every run: a test that fails does so for everyone.
CALM = settings(deadline=None, derandomize=True, max_examples=50)
THOROUGH = settings(CALM, max_examples=200)

UP = np.array([0.0, 0.0, 1.0])


def array_kinds(values: Sequence[float]) -> Iterator[tuple[str, np.ndarray]]:
    """The same whole numbers, in every shape, layout and type that a vector may come in."""
    array = np.array(values, dtype=float)
    n = array.size
    yield "plain", array
    for dtype in (np.int64, np.int32, np.int16, np.float32):
        yield np.dtype(dtype).name, array.astype(dtype)
    yield "strided", np.repeat(array, 3)[::3]
    yield "strided integers", np.repeat(array.astype(int), 2)[::2]
    yield "reversed", array[::-1].copy()[::-1]
    yield "column", array.reshape(n, 1)
    yield "column of integers", array.astype(int).reshape(n, 1)
    yield "column of a C matrix", np.tile(array, (3, 1)).T.copy()[:, 1]
    yield "row of a Fortran matrix", np.asfortranarray(np.tile(array, (3, 1)))[1]
    yield "two-dimensional column of a C matrix", np.tile(array, (3, 1)).T.copy()[:, 1:2]
    frozen = array.copy()
    frozen.setflags(write=False)
    yield "read-only", frozen


def point_settings(**fields: object) -> ContactPointSettings:
    return _fill(ContactPointSettings(), fields)


def sole_settings(**fields: object) -> Contact6DSettings:
    return _fill(Contact6DSettings(), fields)


def _fill(settings, fields):
    settings.frame_name = "frame"
    for name, value in fields.items():
        assert hasattr(settings, name)
        setattr(settings, name, value)
    return settings


def point(**fields: object) -> ContactPoint:
    return ContactPoint(point_settings(**fields))


def sole(**fields: object) -> Contact6D:
    return Contact6D(sole_settings(**fields))


def random_pose(rng: np.random.Generator, tilt: float = np.pi, reach: float = 1.0) -> pin.SE3:
    """A placement within reach, turned by any yaw and tilted by at most that angle."""
    yaw, direction = rng.uniform(-np.pi, np.pi, 2)
    axis = np.array([np.cos(direction), np.sin(direction), 0.0])
    rotation = pin.exp3(rng.uniform(0.0, tilt) * axis) @ pin.exp3(yaw * UP)
    return pin.SE3(rotation, rng.uniform(-reach, reach, 3))


def to_com(wrench: pin.Force, com: np.ndarray) -> np.ndarray:
    """A wrench about the world's origin, taken to the centre of mass."""
    return pin.SE3(np.eye(3), -np.asarray(com)).act(wrench).vector


def random_tree(seed: int) -> pin.Model:
    """A free-flyer with two to eight more joints of many types, attached at random."""
    rng = np.random.default_rng(seed)
    joints = [
        pin.JointModelRX,
        pin.JointModelPY,
        pin.JointModelRUBZ,
        pin.JointModelSpherical,
        pin.JointModelPlanar,
        pin.JointModelTranslation,
        lambda: pin.JointModelRevoluteUnaligned(*_random_axis(rng)),
        lambda: pin.JointModelPrismaticUnaligned(*_random_axis(rng)),
    ]
    model = pin.Model()
    parents = [model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")]
    for number in range(rng.integers(2, 9)):
        joint = joints[rng.integers(len(joints))]()
        parents.append(
            model.addJoint(int(rng.choice(parents)), joint, random_pose(rng), f"joint{number}")
        )
    for parent in parents:
        half = rng.uniform(0.05, 0.5, 3)
        inertia = pin.Inertia.FromBox(rng.uniform(0.1, 20.0), *(2 * half))
        model.appendBodyToJoint(parent, inertia, random_pose(rng))
        model.addFrame(
            pin.Frame(f"frame{parent}", parent, random_pose(rng), pin.FrameType.OP_FRAME)
        )
    return model


def _random_axis(rng: np.random.Generator) -> np.ndarray:
    axis = rng.standard_normal(3)
    return axis / np.linalg.norm(axis)


def random_humanoid(seed: int) -> pin.Model:
    """Pinocchio's sample humanoid, with a free-flyer and random placements and inertias."""
    pin.seed(seed)
    return pin.buildSampleModelHumanoidRandom(True)


def random_configuration(model: pin.Model, seed: int) -> np.ndarray:
    pin.seed(seed)
    return pin.randomConfiguration(model, -np.full(model.nq, 2.0), np.full(model.nq, 2.0))


def robots_folder() -> Path:
    """Where the package example-robot-data, which has no Python module, keeps its files."""
    for entry in sys.path:
        folder = Path(entry, "cmeel.prefix/share/example-robot-data/robots")
        if folder.is_dir():
            return folder
    raise FileNotFoundError("example-robot-data is not installed")


def reference_configuration(model: pin.Model, srdf: str, name: str) -> np.ndarray:
    """A configuration that an SRDF of example-robot-data names; the model stays as it is."""
    model = pin.Model(model)
    pin.loadReferenceConfigurations(model, str(robots_folder() / srdf), False)
    return model.referenceConfigurations[name].copy()


def inequalities(contact: dynacom.ContactBase) -> np.ndarray:
    """Unilaterality and friction of a contact, one below the other."""
    return np.vstack([contact.uni_A(), contact.fri_A()])


def block_diagonal(blocks: Sequence[np.ndarray]) -> np.ndarray:
    shapes = np.array([block.shape for block in blocks])
    matrix = np.zeros(shapes.sum(axis=0))
    for block, (row, col) in zip(blocks, np.cumsum(shapes, axis=0) - shapes, strict=True):
        matrix[row : row + block.shape[0], col : col + block.shape[1]] = block
    return matrix


def cost(weights: np.ndarray, forces: np.ndarray) -> float:
    """What a distribution minimises, equation (9)."""
    return 0.5 * float(np.sum((weights * forces) ** 2))


def cheapest_forces(
    contacts: Sequence[dynacom.ContactBase], wrench: np.ndarray
) -> np.ndarray | None:
    """The quadratic program (9-13), solved another way; None where it is infeasible.

    What the equalities leave free is a problem of least distance, min |z| subject to G z >= h,
    which Lawson and Hanson (Solving Least Squares Problems, chapter 23) turn into one of
    non-negative least squares.
    """
    scale = np.linalg.norm(wrench)
    weights = np.concatenate([contact.reg_A() for contact in contacts])
    equalities = np.hstack([contact.ne_A() for contact in contacts]) / weights
    A = block_diagonal([inequalities(contact) for contact in contacts]) / weights
    base = np.linalg.lstsq(equalities, wrench / scale, rcond=None)[0]
    if np.linalg.norm(equalities @ base - wrench / scale) > 1e-9:
        return None
    rank = np.linalg.matrix_rank(equalities)
    free = np.linalg.svd(equalities)[2][rank:].T
    rows = np.linalg.norm(A, axis=1, keepdims=True)
    G, h = -(A / rows) @ free, (A / rows) @ base
    if free.shape[1] == 0:
        return scale * base / weights if h.max() <= 1e-9 else None
    # The rows' unit is |base|, the least cost without inequalities.
    unit = np.linalg.norm(base)
    E = np.vstack([G.T, h / unit])
    f = np.append(np.zeros(free.shape[1]), 1.0)
    multipliers = nonnegative_least_squares(E, f)
    residual = E @ multipliers - f
    if np.linalg.norm(residual) < 1e-7:
        return None
    # More digits than residual's last component has: the rows that hold are known now.
    tight = multipliers > 0.0
    z = np.linalg.lstsq(G[tight], h[tight], rcond=None)[0] if tight.any() else 0.0 * f[:-1]
    return scale * (base + free @ z) / weights


def nonnegative_least_squares(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """x >= 0 that minimises |A x - b|, by Lawson and Hanson's active sets."""
    x = np.zeros(A.shape[1])
    passive = np.zeros(A.shape[1], dtype=bool)
    # Those that would enter by rounding alone, only to leave at once.
    refused = np.zeros(A.shape[1], dtype=bool)
    for _ in range(10 * A.shape[1]):
        gradient = np.where(passive | refused, -np.inf, A.T @ (b - A @ x))
        entering = np.argmax(gradient)
        if gradient[entering] <= 1e-12:
            return x
        passive[entering] = True
        trial = _least_squares(A, b, passive)
        if trial[entering] <= 0.0:
            passive[entering], refused[entering] = False, True
            continue
        refused[:] = False
        while trial[passive].min() <= 0.0:
            leaving = passive & (trial <= 0.0)
            step = np.min(x[leaving] / (x[leaving] - trial[leaving]))
            x = np.where(passive, x + step * (trial - x), 0.0)
            passive &= x > 1e-14
            trial = _least_squares(A, b, passive)
        x = trial
    raise RuntimeError("non-negative least squares did not end")


def _least_squares(A: np.ndarray, b: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """x that minimises |A x - b| and is zero outside of some columns."""
    x = np.zeros(A.shape[1])
    x[columns] = np.linalg.lstsq(A[:, columns], b, rcond=None)[0]
    return x


def assert_within_cones(contact: dynacom.ContactBase, tolerance: float) -> None:
    force = contact.appliedForce()
    values = inequalities(contact) @ force
    assert values.max() <= tolerance, (contact.getFrameName(), values)


def assert_gives_wrench(robot: DynaCoM, tolerance: float) -> None:
    """The contacts' forces sum to the wrench asked for, by their matrices and by their poses."""
    com = robot.getCoM()
    total = np.zeros(6)
    for name in robot.getActiveContacts():
        contact = robot.getContact(name)
        force = np.zeros(6)
        force[: contact.cols()] = contact.appliedForce()
        total += to_com(contact.getSurfacePose().act(pin.Force(force)), com)
    np.testing.assert_allclose(total, robot.ne_b(), rtol=0, atol=tolerance)
    np.testing.assert_allclose(
        robot.ne_A() @ robot.allForces(), robot.ne_b(), rtol=0, atol=tolerance
    )


def documentation(function: object) -> list[str]:
    """The docstring of each overload, without the signature that Boost.Python puts before it."""
    doc = getattr(function, "__doc__", None) or ""
    parts = re.split(r"^\w+\( .*\) -> \S+", doc.strip(), flags=re.MULTILINE)
    if len(parts) == 1:
        return [doc.strip()]
    return [part.strip().removeprefix(":").strip() for part in parts[1:]]
