# SPDX-License-Identifier: BSD-2-Clause
"""Joints of motion files and of robots: names, orders, angles."""

import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from dynacom.errors import DynacomError
from dynacom.robots import Robot

#: Pinocchio's index of the free-flyer, the first joint of every robot.
ROOT_JOINT = 1


def urdf_order(robot: Robot) -> tuple[str, ...]:
    """The robot's joints in the order of the URDF's text, which the model's need not be."""
    return _in_order(robot.joints.names, _names_in_urdf(robot.urdf))


@lru_cache(maxsize=16)
def _in_order(names: tuple[str, ...], order: tuple[str, ...]) -> tuple[str, ...]:
    """The names in this order; those that are not in it are last."""
    place = {name: index for index, name in enumerate(order)}
    return tuple(sorted(names, key=lambda name: place.get(name, len(place))))


def _names_in_urdf(path: Path) -> tuple[str, ...]:
    try:
        return _read_names(path, path.stat().st_mtime_ns)
    except (OSError, ElementTree.ParseError) as error:
        raise DynacomError(f"{path}: cannot be read ({error})") from error


@lru_cache(maxsize=16)
def _read_names(path: Path, changed: int) -> tuple[str, ...]:
    """Once for many motions, as long as the file has not changed."""
    root = ElementTree.parse(path).getroot()
    return tuple(joint.get("name", "") for joint in root.findall("joint"))


def tree_orders(robot: Robot) -> dict[str, tuple[str, ...]]:
    """The robot's joints as simulators order them: what it is called -> the names.

    Siblings stand in the order of the URDF; fixed joints make no level of their own.
    """
    model = robot.model
    place = {name: index for index, name in enumerate(urdf_order(robot))}
    children: dict[int, list[int]] = {index: [] for index in range(model.njoints)}
    for index in range(ROOT_JOINT + 1, model.njoints):
        children[model.parents[index]].append(index)
    for siblings in children.values():
        siblings.sort(key=lambda index: place.get(model.names[index], -1))

    breadth = list(children[ROOT_JOINT])
    for index in breadth:  # which grows
        breadth += children[index]
    depth, stack = [], children[ROOT_JOINT][::-1]
    while stack:
        depth.append(stack.pop())
        stack += children[depth[-1]][::-1]

    def names(indices: Sequence[int]) -> tuple[str, ...]:
        return tuple(model.names[index] for index in indices if model.names[index] in place)

    return {
        "the order of the URDF": tuple(place),
        "breadth first": names(breadth),
        "depth first": names(depth),
    }


def joint_counts(robot: Robot) -> set[int]:
    """How many joints a file without names may have."""
    return {len(robot.joints.names), *map(len, robot.joint_layouts)}


def order_without_names(path: Path, robot: Robot, count: int) -> tuple[tuple[str, ...], list[str]]:
    """The joints that so many columns without names are, and notes.

    Those of the URDF, in its order; or those of one of the robot's layouts.

    Raises:
        DynacomError: neither has so many.
    """
    names = urdf_order(robot)
    if len(names) == count:
        return names, ["The joints have no names: they are taken in the order of the URDF."]
    for layout in robot.joint_layouts:
        if len(layout) == count:
            return layout, [
                f"The joints have no names: they are taken for those of the version of "
                f"{robot.name} with {count} joints."
            ]
    raise wrong_count(path, robot, count)


def wrong_count(path: Path, robot: Robot, count: int) -> DynacomError:
    """The error for so many joints without names."""
    counts = " or ".join(map(str, sorted(joint_counts(robot))))
    return DynacomError(f"{path}: must have {counts} joints, as {robot.name} does, got {count}")


def match_joints(path: Path, robot: Robot, names: Sequence[str]) -> tuple[list[int], list[str]]:
    """Finds the robot's joints among the file's.

    Returns:
        Indices of names that are the robot's, and notes on the others.

    Raises:
        DynacomError: a name is there twice; or some are not the robot's while the robot has joints
            that are not named: it is another robot's clip.
    """
    known = robot.joints.places
    counts = Counter(names)
    for name, count in counts.items():
        if count > 1:
            raise DynacomError(f"{path}: joint '{name}' is there {count} times")
    unknown = [name for name in names if name not in known]
    missing = [name for name in known if name not in counts]
    if missing and (unknown or len(missing) == len(known)):
        raise DynacomError(
            f"{path}: must have the joints of {robot.name}, got {brief(unknown) or 'none'}, "
            f"and nothing for {brief(missing)}"
        )
    notes = [f"Left out, as {robot.name} has no such joints: {brief(unknown)}."] if unknown else []
    return [index for index, name in enumerate(names) if name in known], notes


def brief(names: Sequence[str], most: int = 6) -> str:
    """The first of the names, and how many there are besides."""
    rest = len(names) - most
    return ", ".join(names[:most]) + (f" and {rest} more" if rest > 0 else "")


def configurations(
    robot: Robot,
    position: np.ndarray,
    quaternion: np.ndarray,
    names: Sequence[str],
    angles: np.ndarray,
) -> np.ndarray:
    """Configurations as in Pinocchio, (T, nq); joints that are not named are at their default.

    Args:
        position: of the root, (T, 3) [m].
        quaternion: of the root, (T, 4), x y z w.
        names: of k joints of the robot.
        angles: (T, k) [rad], of prismatic joints [m].
    """
    q = np.tile(robot.default, (len(position), 1))
    q[:, :3] = position
    q[:, 3:7] = quaternion
    joints = robot.joints.take(names)
    q[:, joints.idx_q] = angles
    for column in np.flatnonzero(joints.unlimited):
        index, angle = joints.idx_q[column], angles[:, column]
        q[:, index], q[:, index + 1] = np.cos(angle), np.sin(angle)
    return q


def joint_angles(robot: Robot, q: np.ndarray, names: Sequence[str]) -> np.ndarray:
    """The inverse of :func:`configurations`: (T, k)."""
    joints = robot.joints.take(names)
    angles = q[:, joints.idx_q]
    for column in np.flatnonzero(joints.unlimited):
        index = joints.idx_q[column]
        angles[:, column] = np.arctan2(q[:, index + 1], q[:, index])
    return angles


def rotations(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrices, (..., 3, 3), of quaternions x y z w of norm 1, (..., 4)."""
    x, y, z, w = np.moveaxis(quaternion, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def multiply(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Products of quaternions x y z w, (..., 4): the rotation on the right comes first."""
    a, b = left[..., :3], right[..., :3]
    u, w = left[..., 3:], right[..., 3:]
    scalar = u * w - np.sum(a * b, axis=-1, keepdims=True)
    return np.concatenate([u * b + w * a + np.cross(a, b), scalar], axis=-1)


def conjugate(quaternion: np.ndarray) -> np.ndarray:
    """Inverses of quaternions x y z w, (..., 4), of norm 1."""
    return quaternion * [-1.0, -1.0, -1.0, 1.0]
