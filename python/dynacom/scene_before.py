# SPDX-License-Identifier: BSD-2-Clause
"""What a scene shows of a motion before repair: a ghost of the robot, and paths to compare."""

from typing import Any

import numpy as np

from dynacom.repair_change import Before
from dynacom.robots import Robot
from dynacom.scene_robot import draw_robot

# Paths are shown within this time of a frame [s], as lines between points so far apart [s].
_AROUND = 0.5
_STEP = 1.0 / 30.0


class MovingPath:
    """The part of a point's path that is close to a frame in time."""

    def __init__(
        self,
        scene: Any,
        name: str,
        time: np.ndarray,
        points: np.ndarray,
        color: tuple[int, int, int],
        *,
        thickness: float,
    ) -> None:
        """Draws nothing yet.

        Args:
            scene: of a viser server.
            name: in the scene's tree.
            time: (T,) [s].
            points: (T, 3) [m]; the path has holes where they are not finite.
            color: red, green, blue.
            thickness: of the line [m].
        """
        step = max(1, round(_STEP / np.diff(time).mean())) if len(time) > 1 else 1
        time_there, points = time[::step], points[::step]
        pieces = np.stack([points[:-1], points[1:]], axis=1)
        drawn = np.isfinite(pieces).all(axis=(1, 2))
        self._pieces = pieces[drawn].astype(np.float32)
        # Those between the first and the last moment.
        begins, ends = time_there[:-1][drawn], time_there[1:][drawn]
        self._first = np.searchsorted(begins, time - _AROUND)
        self._behind = np.maximum(np.searchsorted(ends, time + _AROUND, side="right"), self._first)
        self._most = max(int((self._behind - self._first).max()), 1)
        self._handle = scene.add_line_segments(
            name, np.zeros((self._most, 2, 3)), color, thickness=thickness, visible=False
        )

    def show(self, frame: int) -> None:
        """Shows what is close to a frame."""
        pieces = self._pieces[self._first[frame] : self._behind[frame]]
        self._handle.visible = len(pieces) > 0
        if len(pieces) > 0:
            # Always as many lines: the last ones have no length.
            end = np.repeat(pieces[-1:, 1:], 2, axis=1)
            rest = np.repeat(end, self._most - len(pieces), axis=0)
            self._handle.points = np.concatenate([pieces, rest])


class Ghost:
    """The robot before repair in one colour, its CoM, its CoP and their paths."""

    def __init__(
        self,
        server: Any,
        path: str,
        robot: Robot,
        before: Before,
        points: dict[str, np.ndarray],
        colors: dict[str, tuple[int, int, int]],
        radius: float,
    ) -> None:
        """Draws it somewhere.

        Args:
            server: a viser.ViserServer.
            path: in the tree of its scene.
            robot: whose motion it was.
            before: the motion.
            points: (T, 3) [m] of each point that is drawn, by its name.
            colors: red, green, blue of each point, and of the `ghost`.
            radius: of the points' balls [m].
        """
        self._root = server.scene.add_frame(path, show_axes=False)
        self._q, self._points = before.q, points
        self._move, _ = draw_robot(server, robot, f"{path}/robot", colors["ghost"])
        self._balls = {
            name: server.scene.add_icosphere(
                f"{path}/{name}", radius, color=colors[name], cast_shadow=False
            )
            for name in points
        }
        self._paths = [
            MovingPath(
                server.scene,
                f"{path}/{name}_path",
                before.arrays["time"],
                places,
                colors[name],
                thickness=0.2 * radius,
            )
            for name, places in points.items()
        ]

    @property
    def visible(self) -> bool:
        """Whether any of it is seen."""
        return self._root.visible

    @visible.setter
    def visible(self, value: bool) -> None:
        self._root.visible = value

    def show(self, frame: int) -> None:
        """Moves everything to where it is in a frame."""
        self._move(self._q[frame])
        for name, ball in self._balls.items():
            place = self._points[name][frame]
            ball.visible = bool(np.isfinite(place).all())
            if ball.visible:
                ball.position = place
        for path in self._paths:
            path.show(frame)
