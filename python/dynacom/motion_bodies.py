# SPDX-License-Identifier: BSD-2-Clause
"""In which order joints stand in a file that does not name them, but says where the bodies are.

Forward kinematics with the right order puts every link where the file has its body; with another it
does not, nor with another robot. Links and bodies are compared by four points each: the origin, and
one at :data:`LEVER` along each axis, so that what a last joint turns counts too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from dynacom.errors import DynacomError
from dynacom.motion_joints import (
    ROOT_JOINT,
    configurations,
    conjugate,
    multiply,
    rotations,
    tree_orders,
    wrong_count,
)
from dynacom.robots import Robot

#: [m]
LEVER = 0.1
#: How far a link may be from its body [m]. Revisions of a robot differ by a centimetre; a wrong
#: order by more in any motion worth the name, else the best one wins.
TOLERANCE = 0.02
# Bodies that fit a joint as well as the best one, up to this [m].
_ALIKE = 1e-3
# So many frames are looked at, from the first to the last.
_FRAMES = 40


@dataclass(frozen=True)
class BodySample:
    """Where a file has the bodies, in some of its frames."""

    #: Indices of the frames, (S,).
    frames: np.ndarray
    #: Of the root, position and quaternion x y z w, (S, 7).
    root: np.ndarray
    #: Of B bodies, (S, B, 3) [m] and (S, B, 3, 3).
    position: np.ndarray
    rotation: np.ndarray
    #: Empty where the file does not name them.
    names: tuple[str, ...]

    @property
    def points(self) -> np.ndarray:
        """(S, B, 4, 3)."""
        return _points(self.position, self.rotation)


def sample_bodies(
    position: np.ndarray,
    quaternion: np.ndarray,
    root: np.ndarray,
    names: Sequence[str] | None,
) -> BodySample:
    """Takes some frames.

    Args:
        position: (T, B, 3).
        quaternion: (T, B, 4), x y z w, of any norm but zero.
        root: (T, 7), with a quaternion x y z w of norm 1.
        names: of the bodies.
    """
    count = len(position)
    frames = _sample_frames(count)
    rotation = rotations(_unit(quaternion[frames]))
    return BodySample(frames, root[frames], position[frames], rotation, tuple(names or ()))


def _sample_frames(count: int) -> np.ndarray:
    """Indices of some of so many frames."""
    return np.unique(np.linspace(0, count - 1, min(count, _FRAMES)).astype(int))


def _unit(quaternion: np.ndarray) -> np.ndarray:
    return quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True)


def root_link(robot: Robot) -> str:
    """The link that the free-flyer moves."""
    return _links(robot)[ROOT_JOINT]


def check_bodies(
    path: Path, robot: Robot, names: Sequence[str], angles: np.ndarray, bodies: BodySample
) -> list[str]:
    """Checks that joints whose names are known put the links where the bodies are.

    Args:
        names: of k joints.
        angles: (T, k).

    Returns:
        Notes.

    Raises:
        DynacomError: a link is elsewhere.
    """
    error, where = _mismatch(robot, names, angles, bodies)
    if not error <= TOLERANCE:
        raise _wrong_robot(path, robot, f"the file's joints put {where} {error:.2g} m away")
    return [_agreement(error)]


def find_order(
    path: Path, robot: Robot, angles: np.ndarray, bodies: BodySample
) -> tuple[tuple[str, ...], list[str]]:
    """Finds the order of joints without names.

    First the usual orders are tried: that of the URDF's text, breadth first and depth first, each
    of the robot and of its layouts. If none fits, each joint's angle is computed from the poses of
    the links that it connects, and goes with the column that is like it.

    Args:
        angles: (T, k).

    Returns:
        The joints' names by column, and notes.

    Raises:
        DynacomError: no order puts the links where the bodies are.
    """
    count = angles.shape[1]
    orders = _candidates(robot, count)
    if not orders:
        raise wrong_count(path, robot, count)
    errors = {
        order: _mismatch(robot, order, angles, bodies)
        for order in dict.fromkeys(order for _, order in orders)
    }
    best = min(errors, key=lambda order: errors[order][0])
    if not errors[best][0] <= TOLERANCE and (found := _match_columns(robot, angles, bodies)):
        orders.append(("one of its own", found))
        errors[found] = _mismatch(robot, found, angles, bodies)
        best = min(errors, key=lambda order: errors[order][0])
    error, where = errors[best]
    title = next(title for title, order in orders if order == best)
    if error <= TOLERANCE:
        text = f" ({', '.join(best)})" if title == "one of its own" else ""
        return best, [
            f"The joints have no names: by the poses of the bodies their order is {title}{text}.",
            _agreement(error),
        ]
    if any(
        _mismatch(robot, order, _from_degrees(robot, order, angles), bodies)[0] <= TOLERANCE
        for order in errors
    ):
        raise DynacomError(f"{path}: joint_pos must be in radians, got degrees")
    raise _wrong_robot(
        path, robot, f"no order of the joints does; {title} puts {where} {error:.2g} m away"
    )


def carry_bodies(
    robot: Robot,
    before: np.ndarray,
    after: np.ndarray,
    position: np.ndarray,
    quaternion: np.ndarray,
    names: Sequence[str] | None,
) -> tuple[np.ndarray, list[int]]:
    """Takes bodies along with the links that they belong to.

    A body belongs to the link of its name, else to the one in which it does not move. It stays
    where the file has it in its link: robots of other revisions keep what they differ by.

    Args:
        before, after: configurations (T, nq).
        position: (T, B, 3), before.
        quaternion: (T, B, 4), x y z w, before, of norms close to 1.
        names: of the bodies, if there.

    Returns:
        Their poses after, (T, B, 7), and which bodies belong to no link and are where they were.
    """
    joints = _find_links(robot, before, position, names, quaternion)
    pose = np.dstack([position, quaternion])
    poses = [_link_poses(robot.model, q, joints) for q in (before, after)]
    for body, joint in enumerate(joints):
        if joint is not None:
            old, new = (every[joint] for every in poses)
            moved, turn = _carry(old, new, position[:, body])
            carried = np.hstack([moved, multiply(turn, _unit(quaternion[:, body]))])
            same = (old == new).all(axis=1)
            pose[:, body] = np.where(same[:, None], pose[:, body], carried)
    return pose, [body for body, joint in enumerate(joints) if joint is None]


def carry_points(
    robot: Robot, before: np.ndarray, after: np.ndarray, position: np.ndarray, names: Sequence[str]
) -> np.ndarray | None:
    """The same for bodies of which a file has the positions only, (T, B, 3).

    None if links of these names are elsewhere, or a body belongs to none.
    """
    model, data = robot.model, robot.model.createData()
    links = [
        (body, model.getFrameId(name, pin.FrameType.BODY))
        for body, name in enumerate(names)
        if model.existFrame(name, pin.FrameType.BODY)
    ]
    for frame in _sample_frames(len(before)):
        pin.framesForwardKinematics(model, data, before[frame])
        for body, link in links:
            away = data.oMf[link].translation - position[frame, body]
            if not np.linalg.norm(away) <= TOLERANCE:
                return None
    joints = _find_links(robot, before, position, names)
    if None in joints:
        return None
    moved = np.empty(position.shape)
    poses = [_link_poses(model, q, joints) for q in (before, after)]
    for body, joint in enumerate(joints):
        moved[:, body], _ = _carry(*(every[joint] for every in poses), position[:, body])
    return moved


def axis_vectors(robot: Robot, names: Sequence[str], angles: np.ndarray) -> np.ndarray | None:
    """Rotations of joints about their axes, as vectors (T, k, 3); None if some joints slide.

    Args:
        names: of k joints.
        angles: (T, k).
    """
    if not robot.joints.take(names).turns.all():
        return None
    axes = _axes(robot.model)
    vectors = np.array([axes[robot.model.getJointId(name)] for name in names])
    return angles[:, :, None] * vectors


def _from_degrees(robot: Robot, names: Sequence[str], angles: np.ndarray) -> np.ndarray:
    return np.where(robot.joints.take(names).turns, np.deg2rad(angles), angles)


def _agreement(error: float) -> str:
    return f"Forward kinematics puts the links within {error:.1e} m of the file's bodies."


def _wrong_robot(path: Path, robot: Robot, what: str) -> DynacomError:
    return DynacomError(
        f"{path}: forward kinematics of {robot.name} must put its links where the file has the "
        f"bodies, within {TOLERANCE:g} m, but {what}: is it this robot's clip?"
    )


def _candidates(robot: Robot, count: int) -> list[tuple[str, tuple[str, ...]]]:
    """Orders of so many joints, and what they are called."""
    trees = tree_orders(robot)
    candidates = []
    if count == len(robot.joints.names):
        candidates += trees.items()
    for layout in robot.joint_layouts:
        if len(layout) == count:
            version = f" of the version of {robot.name} with {count} joints"
            candidates.append((f"the file's{version}", layout))
            for title, tree in trees.items():
                candidates.append((title + version, tuple(n for n in tree if n in layout)))
    return candidates


def _links(robot: Robot) -> Mapping[int, str]:
    """Each joint's own link: index of the joint -> name."""
    links: dict[int, str] = {}
    for frame in robot.model.frames:
        if frame.type == pin.FrameType.BODY and frame.parentJoint >= ROOT_JOINT:
            links.setdefault(frame.parentJoint, frame.name)
    return links


def _mismatch(
    robot: Robot, names: Sequence[str], angles: np.ndarray, bodies: BodySample
) -> tuple[float, str]:
    """How far links are from their bodies at worst [m], and which.

    A body without a name is that of the nearest link. Where the file has fewer bodies than there
    are links, each body must have a link; else each link must have a body.
    """
    model = robot.model
    # Links about which the file's joints say everything.
    known = {ROOT_JOINT, *(model.getJointId(name) for name in names)}
    links = {
        joint: link
        for joint, link in _links(robot).items()
        if known.issuperset(list(model.supports[joint])[1:])
    }
    columns = range(bodies.position.shape[1])
    named = {joint: link for joint, link in links.items() if link in bodies.names}
    if named:
        links = named
        columns = [bodies.names.index(link) for link in links.values()]

    q = configurations(robot, bodies.root[:, :3], bodies.root[:, 3:], names, angles[bodies.frames])
    position, rotation = _joint_poses(robot.model, q)
    joints = list(links)
    link_points = _points(position[:, joints], rotation[:, joints])
    body_points = bodies.points
    # Of every link from every body.
    errors = np.stack(
        [
            np.linalg.norm(link_points - body_points[:, [body]], axis=-1).max(axis=(0, 2))
            for body in columns
        ],
        axis=1,
    )
    if named:
        errors = errors.diagonal()
    elif len(columns) < len(joints):
        nearest = errors.min(axis=0)
        return float(nearest.max()), f"every link from body {int(np.argmax(nearest))}"
    else:
        errors = errors.min(axis=1)
    worst = int(np.argmax(errors))
    return float(errors[worst]), links[joints[worst]]


def _match_columns(robot: Robot, angles: np.ndarray, bodies: BodySample) -> tuple[str, ...] | None:
    """The joint of every column, by the angles that the bodies' poses show.

    Joints are taken from the root on: a joint's link is the body that stays where the joint is,
    turns about its axis only, and turns as some column says. Where several do, as links do that are
    fixed to the joint's parent in the same place while another joint is at rest, it is the one that
    turns most. None where that is not enough to go by: a number of joints other than the robot's,
    or prismatic ones, or no body that fits.
    """
    model = robot.model
    names = robot.joints.names
    count = len(names)
    if angles.shape[1] != count or count != model.njoints - ROOT_JOINT - 1:
        return None
    if not robot.joints.turns.all():
        return None
    axes = _axes(model)
    angles = angles[bodies.frames]
    rotation = {ROOT_JOINT: rotations(bodies.root[:, 3:])}
    position = {ROOT_JOINT: bodies.root[:, :3]}
    # Of every joint from every column [rad].
    differences = np.empty((count, count))
    for joint in range(ROOT_JOINT + 1, model.njoints):
        parent, placement = model.parents[joint], model.jointPlacements[joint]
        origin = position[parent] + rotation[parent] @ placement.translation
        zero = rotation[parent] @ placement.rotation
        turned = np.swapaxes(zero, -1, -2)[:, None] @ bodies.rotation
        error = np.linalg.norm(bodies.position - origin[:, None], axis=-1)
        error += LEVER * np.linalg.norm(turned @ axes[joint] - axes[joint], axis=-1)
        shown = _turn(turned, axes[joint])
        difference = np.abs(_wrap(shown[:, :, None] - angles[:, None, :])).max(axis=0)
        error = error.max(axis=0) + LEVER * difference.min(axis=1)
        if not error.min() <= TOLERANCE:
            return None
        moves = np.abs(_wrap(shown - shown[0])).max(axis=0)
        body = int(np.argmax(np.where(error <= error.min() + _ALIKE, moves, -1.0)))
        position[joint], rotation[joint] = bodies.position[:, body], bodies.rotation[:, body]
        differences[names.index(model.names[joint])] = difference[body]

    found: dict[int, str] = {}
    # The clearest first: what is alike by chance is taken by then.
    for index in np.argsort(differences.min(axis=1)):
        free = [column for column in range(count) if column not in found]
        found[free[int(np.argmin(differences[index, free]))]] = names[index]
    return tuple(found[column] for column in range(count))


def _turn(rotation: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Angles (...) of rotations (..., 3, 3) about an axis."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # Twice the sine and twice the cosine.
    return np.arctan2(
        np.einsum("ij,...ij->...", cross, rotation), np.trace(rotation, axis1=-2, axis2=-1) - 1.0
    )


def _wrap(angle: np.ndarray) -> np.ndarray:
    """The same angle in [-π, π)."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def _axes(model: pin.Model) -> dict[int, np.ndarray]:
    """Index of each joint of one degree of freedom -> its axis in its own frame."""
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    axes = {}
    for index in range(ROOT_JOINT + 1, model.njoints):
        joint = model.joints[index]
        if joint.nv == 1:
            column = pin.getJointJacobian(model, data, index, pin.LOCAL)[:, joint.idx_v]
            axes[index] = column[3:]
    return axes


def _joint_poses(model: pin.Model, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions (S, joints, 3) and rotations (S, joints, 3, 3) in the world."""
    data = model.createData()
    position = np.empty((len(q), model.njoints, 3))
    rotation = np.empty((len(q), model.njoints, 3, 3))
    for frame, configuration in enumerate(q):
        pin.forwardKinematics(model, data, configuration)
        for joint, pose in enumerate(data.oMi):
            position[frame, joint], rotation[frame, joint] = pose.translation, pose.rotation
    return position, rotation


def _points(position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Origins and tips of the axes, (..., 4, 3), of frames at (..., 3), (..., 3, 3)."""
    tips = position[..., None, :] + LEVER * np.swapaxes(rotation, -1, -2)
    return np.concatenate([position[..., None, :], tips], axis=-2)


def _find_links(
    robot: Robot,
    q: np.ndarray,
    position: np.ndarray,
    names: Sequence[str] | None,
    quaternion: np.ndarray | None = None,
) -> list[int | None]:
    """The joint that moves each body: Pinocchio's 0 where it is at rest in the world, None if none.

    Bodies that are no link's by name belong to the joint, or to the world, in which they move
    least, by no more than :data:`TOLERANCE`: if there are several, as of joints at rest, to the
    closest. Those that turn in all of them, as fingers do that the robot does not have, belong to
    the one in which they do nothing else.

    Args:
        position, quaternion: (T, B, 3) and (T, B, 4), or None if only the position is known.
    """
    model = robot.model
    frames = _sample_frames(len(q))
    origin, rotation = _joint_poses(model, q[frames])
    own = _points(origin, rotation)
    if quaternion is None:
        points = position[frames][:, :, None]
    else:
        points = _points(position[frames], rotations(_unit(quaternion[frames])))
    joints = []
    for body in range(position.shape[1]):
        name = names[body] if names else ""
        if names and model.existFrame(name, pin.FrameType.BODY):
            joints.append(model.frames[model.getFrameId(name, pin.FrameType.BODY)].parentJoint)
            continue
        # In each joint: (S, joints, points, 3).
        local = np.einsum("sjba,sjpb->sjpa", rotation, points[:, None, body] - origin[:, :, None])
        moves = np.linalg.norm(local - local.mean(axis=0), axis=-1).max(axis=0)
        moves = next((m for m in (moves.max(axis=-1), moves[:, 0]) if m.min() <= TOLERANCE), None)
        if moves is None:
            joints.append(None)
            continue
        away = np.linalg.norm(own[:, :, 0] - points[:, None, body, 0], axis=-1).max(axis=0)
        joints.append(int(np.argmin(np.where(moves <= moves.min() + _ALIKE, away, np.inf))))
    return joints


def _carry(old: np.ndarray, new: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where points (T, 3) get by a motion from old to new poses, (T, 7), and its turns, (T, 4)."""
    turn = multiply(new[:, 3:], conjugate(old[:, 3:]))
    arm = position - old[:, :3]
    return new[:, :3] + np.einsum("tij,tj->ti", rotations(turn), arm), turn


def _link_poses(
    model: pin.Model, q: np.ndarray, joints: Sequence[int | None]
) -> dict[int, np.ndarray]:
    """Of each joint, position and quaternion x y z w in the world, (T, 7)."""
    data = model.createData()
    poses = {joint: np.empty((len(q), 7)) for joint in joints if joint is not None}
    for frame, configuration in enumerate(q):
        pin.forwardKinematics(model, data, configuration)
        for joint, pose in poses.items():
            pose[frame] = pin.SE3ToXYZQUAT(data.oMi[joint])
    return poses
