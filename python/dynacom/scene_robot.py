# SPDX-License-Identifier: BSD-2-Clause
"""A robot in a viser scene: its meshes, or lines between its joints where there are none."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from dynacom.errors import DynacomError
from dynacom.robots import Robot

_OPACITY = 0.4
_LINES = (90, 90, 90)
# Of what is drawn in one colour: it stands beside another robot, which it must not hide.
_FAINT = 0.2


def draw_robot(
    server: Any, robot: Robot, path: str, color: tuple[int, int, int] | None = None
) -> tuple[Callable[[np.ndarray], None], str | None]:
    """Draws the robot's meshes, else its joints, all translucent.

    Args:
        server: a viser.ViserServer.
        path: in the tree of its scene.
        color: of everything, red, green, blue; by default, meshes have the colours of their files.

    Returns:
        What moves it to a configuration (nq,), and what could not be drawn, and why, if anything.
    """
    try:
        # Objects belong to the joints that move the links of their names.
        folders = [str(folder) for folder in robot.urdf.resolve().parents]
        visuals = pin.buildGeomFromUrdf(
            robot.model, str(robot.urdf), pin.GeometryType.VISUAL, package_dirs=folders
        )
        for visual in visuals.geometryObjects:
            if color is None:
                visual.meshColor = np.array([*visual.meshColor[:3], _OPACITY])
            else:
                visual.meshColor = np.array([*(value / 255.0 for value in color), _FAINT])
        turn_upright(robot.model, visuals)
        if len(visuals.geometryObjects) > 0:
            return _draw_meshes(server, robot, visuals, path, one_color=color is not None), None
        note = f"{robot.urdf.name} has no visuals: the robot is drawn as lines."
    except Exception as error:  # readers of meshes promise no types
        reason = DynacomError(str(error) or type(error).__name__)
        note = f"The robot is drawn as lines: its meshes cannot be read ({reason})"
    return _draw_skeleton(server, robot, path, color or _LINES), note


def turn_upright(model: pin.Model, visuals: pin.GeometryModel) -> None:
    """Turns meshes whose files say that y is up, if that is what the URDF expects.

    COLLADA means by it that z becomes what was y; many programs, Pinocchio among them, do not turn
    anything, and URDFs are made for either. Right is what brings meshes closer to the next joints.
    """
    upright = pin.SE3(pin.rpy.rpyToMatrix(np.pi / 2.0, 0.0, 0.0), np.zeros(3))
    tilted = [visual for visual in visuals.geometryObjects if _has_y_up(visual.meshPath)]
    gaps = np.zeros(2)
    for visual in tilted:
        visual.geometry.computeLocalAABB()
        box = visual.geometry.aabb_local
        joints = [j for j in range(1, model.njoints) if model.parents[j] == visual.parentJoint]
        for option, placement in enumerate((visual.placement, visual.placement * upright)):
            for joint in joints:
                place = placement.actInv(model.jointPlacements[joint].translation)
                outside = np.maximum(box.min_ - place, place - box.max_).clip(min=0.0)
                gaps[option] += np.linalg.norm(outside)
    if gaps[1] < gaps[0]:
        for visual in tilted:
            visual.placement = visual.placement * upright


def _has_y_up(path: str) -> bool:
    if not _is_collada(path):
        return False
    with open(path, "rb") as file:
        return b"<up_axis>Y_UP" in file.read(10000)  # it is in the file's first element


def _is_collada(path: str) -> bool:
    return path.lower().endswith(".dae")


def _draw_meshes(
    server: Any, robot: Robot, visuals: pin.GeometryModel, path: str, *, one_color: bool
) -> Callable[[np.ndarray], None]:
    from pinocchio.visualize import ViserVisualizer

    class OneColor(ViserVisualizer):
        """Draws COLLADA's meshes, too, in the colours of the geometries; theirs are not asked."""

        def loadViewerGeometryObject(
            self, geometry_object: Any, prefix: str = "", color: Any = None
        ) -> None:
            if not _is_collada(geometry_object.meshPath):
                super().loadViewerGeometryObject(geometry_object, prefix, color)
            else:
                name = f"{prefix}/{geometry_object.name}"
                self.frames[name] = _add_plain_mesh(server, name, geometry_object)
            # Another robot stands there, whose shadow is enough.
            self.frames[f"{prefix}/{geometry_object.name}"].cast_shadow = False

    kind = OneColor if one_color else ViserVisualizer
    visualizer = kind(robot.model, pin.GeometryModel(), visuals)
    visualizer.initViewer(viewer=server)
    try:
        visualizer.loadViewerModel(path)
    except Exception:
        server.scene.remove_by_name(path)
        raise
    # One for every frame of the model, never seen.
    visualizer.framesRootFrame.remove()
    return visualizer.display


def _add_plain_mesh(server: Any, name: str, visual: pin.GeometryObject) -> Any:
    """Draws all that a mesh's file holds as one surface."""
    import trimesh

    mesh = trimesh.load_mesh(visual.meshPath)
    mesh.apply_scale(visual.meshScale)
    *color, opacity = visual.meshColor
    return server.scene.add_mesh_simple(
        name, mesh.vertices, mesh.faces, color=tuple(color), opacity=opacity
    )


def _draw_skeleton(
    server: Any, robot: Robot, path: str, color: tuple[int, int, int]
) -> Callable[[np.ndarray], None]:
    model, data = robot.model, robot.model.createData()
    # Lines from every joint to its parent, and from the contacts to theirs.
    joints = range(2, model.njoints)
    frames = [model.getFrameId(settings.frame_name) for settings in robot.contacts.values()]

    def lines(q: np.ndarray) -> np.ndarray:
        pin.framesForwardKinematics(model, data, q)
        pairs = [(data.oMi[model.parents[joint]], data.oMi[joint]) for joint in joints]
        pairs += [(data.oMi[model.frames[frame].parentJoint], data.oMf[frame]) for frame in frames]
        return np.array([[a.translation, b.translation] for a, b in pairs])

    handle = server.scene.add_line_segments(path, lines(pin.neutral(model)), color, thickness=0.02)

    def move(q: np.ndarray) -> None:
        handle.points = lines(q)

    return move
