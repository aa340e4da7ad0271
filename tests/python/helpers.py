# SPDX-License-Identifier: BSD-2-Clause
"""What several of the tests need: arrays of all sorts, random robots, another solver."""

import itertools
import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from hypothesis import settings
from scipy.optimize import nnls

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


def nonnegative_least_squares(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """x >= 0 that minimises |A x - b|."""
    return nnls(A, b, maxiter=10000)[0] if A.shape[1] else np.zeros(0)  # which nnls takes ill


def generators(contact: dynacom.ContactBase) -> np.ndarray:
    """The edges of a contact's cone, by its settings alone: every force in it is a sum of them."""
    settings = contact.getSettings()
    limits = [settings.mu, settings.mu]
    if contact.cols() == 6:
        limits += [settings.half_width, settings.half_length, settings.gu]
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=len(limits)))) * limits
    return np.unique(np.insert(corners, 2, 1.0, axis=1), axis=0).T


class Shares(NamedTuple):
    """What contacts can give of a wrench, computed another way."""

    #: The reachable wrench that is the closest to it.
    closest: np.ndarray
    #: The weighted distance of the two, over the weighted norm of the wrench.
    distance: float
    #: The cheapest forces that give the closest.
    forces: np.ndarray


class Closest(NamedTuple):
    """The reachable wrench closest to another, computed another way."""

    wrench: np.ndarray
    #: The weighted distance of the two, over the weighted norm of what was asked for.
    distance: float
    #: The edges of the cones that lie in the residual's supporting plane, one column each, and what
    #: they give of the weighted wrench, over that norm; at unit length.
    edges: np.ndarray
    rays: np.ndarray


def closest_by_edges(
    contacts: Sequence[dynacom.ContactBase], wrench: np.ndarray, weights: np.ndarray | None = None
) -> Closest:
    """The first stage of a distribution as a problem of non-negative least squares.

    Its variables are the shares of the cones' edges, so that no inequality is left.
    """
    weights = np.ones(6) if weights is None else weights
    scale = np.linalg.norm(weights * wrench)
    asked = weights * wrench / scale
    edges = block_diagonal([generators(contact) for contact in contacts])
    rays = weights[:, None] * (np.hstack([contact.ne_A() for contact in contacts]) @ edges)
    sizes = np.linalg.norm(rays, axis=0)
    edges, rays = edges / sizes, rays / sizes

    closest = rays @ nonnegative_least_squares(rays, asked)
    residual = asked - closest
    distance = np.linalg.norm(residual)
    if distance > 1e-8:
        on_face = residual @ rays >= -1e-7 * distance
        edges, rays = edges[:, on_face], rays[:, on_face]
    return Closest(scale * closest / weights, float(distance), edges, rays)


def share_by_edges(
    contacts: Sequence[dynacom.ContactBase], wrench: np.ndarray, weights: np.ndarray | None = None
) -> Shares:
    """Both stages of a distribution as problems of non-negative least squares.

    In the second, edges that lead away from the residual's supporting plane have no share.
    """
    found = closest_by_edges(contacts, wrench, weights)
    weights = np.ones(6) if weights is None else weights
    scale = np.linalg.norm(weights * wrench)
    closest, edges, rays = weights * found.wrench / scale, found.edges, found.rays

    costs = np.concatenate([contact.reg_A() for contact in contacts])
    costs = costs[:, None] / costs.max() * edges
    # The method of multipliers: what is missing is asked for again.
    stiffness, asked = 1e4, closest
    for _ in range(20):
        shares = nonnegative_least_squares(
            np.vstack([stiffness * rays, costs]),
            np.concatenate([stiffness * asked, np.zeros(len(costs))]),
        )
        missing = closest - rays @ shares
        asked = asked + missing
        if np.linalg.norm(missing) < 1e-13:
            break
    else:
        raise RuntimeError("the multipliers have not converged")
    return Shares(found.wrench, found.distance, scale * (edges @ shares))


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


#: What the parts of a sole are called.
CORNERS = ("front_left", "rear_left", "rear_right", "front_right")


def documented_columns(root: Path, contacts: Sequence[str]) -> dict[str, str]:
    """The names in docs/columns.md, in its order, with their units as in Parquet's metadata.

    Args:
        contacts: names of soles.
    """
    text = (root / "docs" / "columns.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`.*?`) \| (.*?) ?\|", text, flags=re.MULTILINE)
    units = {
        name: unit.replace("²", "^2").replace("·", " ")
        for cell, unit in rows
        for name in re.findall(r"`([^`]+)`", cell)
        if "<link>" not in name  # links that touch something are in no column of a walk
    }
    per_contact = {name: unit for name, unit in units.items() if "<name>" in name}
    frame = {name: unit for name, unit in units.items() if name not in per_contact}
    assert list(units) == [*frame, *per_contact]
    return frame | {
        name.replace("<name>", contact).replace("<part>", part): unit
        for contact in contacts
        for name, unit in per_contact.items()
        for part in (CORNERS if "<part>" in name else [""])
    }
