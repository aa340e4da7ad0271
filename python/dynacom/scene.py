# SPDX-License-Identifier: BSD-2-Clause
"""A motion in 3D: the robot, its contacts' forces, CoM, CoP, VRP and the support polygon.

Drawn with viser through Pinocchio's ViserVisualizer: recorded into a page, or live in a browser.
"""

import contextlib
import io
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
import pinocchio as pin

from dynacom.dynacom_pywrap import Contact6DSettings
from dynacom.errors import DynacomError
from dynacom.repair_change import Before
from dynacom.robots import ContactSettings, Robot
from dynacom.scene_before import Ghost, MovingPath
from dynacom.scene_robot import draw_robot

#: Red, green, blue of what is drawn here and in the page's plots. Kept apart by those, too, who do
#: not see all colours (the palette of Okabe and Ito).
COLORS = {
    "com": (30, 30, 30),
    "cop": (213, 94, 0),
    "vrp": (0, 114, 178),
    "feasible_com": (122, 81, 149),
    "support": (240, 228, 66),
    # Before repair: the robot, and points in paler colours than after it.
    "ghost": (70, 110, 220),
    "com_before": (145, 145, 145),
    "cop_before": (236, 165, 112),
}
CONTACT_COLORS = (
    *((0, 158, 115), (204, 121, 167), (230, 159, 0), (86, 180, 233)),
    *((140, 86, 75), (110, 110, 20), (23, 122, 130), (127, 127, 127)),
)

# More frames than these make pages that are too large, and too slow to go back in.
_MOST_FRAMES = 900

_WORLD = "/world"


def contact_color(number: int) -> tuple[int, int, int]:
    """Red, green, blue of a robot's contact by its place in the robot's file; then of links."""
    return CONTACT_COLORS[number % len(CONTACT_COLORS)]


def surface_corners(
    settings: ContactSettings, arrays: Mapping[str, np.ndarray], name: str
) -> np.ndarray:
    """Where a contact's surface lies: (T, N, 3) in the world [m], N = 4 for soles, 1 for points."""
    position = arrays[f"contact.{name}.position"]
    if not isinstance(settings, Contact6DSettings):
        return position[:, None, :]
    x, y = settings.half_length, settings.half_width
    corners = np.array([[x, y, 0.0], [-x, y, 0.0], [-x, -y, 0.0], [x, -y, 0.0]])
    rotation = rotation_matrices(arrays[f"contact.{name}.rotation"])
    return position[:, None, :] + corners @ rotation.transpose(0, 2, 1)


def rotation_matrices(quaternions: np.ndarray) -> np.ndarray:
    """(T, 3, 3) of unit quaternions (T, 4), x y z w."""
    x, y, z, w = quaternions.T
    matrices = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(matrices).transpose(2, 0, 1)


@dataclass(frozen=True)
class Recording:
    """A scene over time, to be played in a page."""

    #: A page of its own, which needs nothing else.
    html: str
    #: When its frames are [s], from its beginning.
    times: np.ndarray
    #: When they are shown once more, without the ghost [s]; None where there is none.
    times_without_ghost: np.ndarray | None
    #: What could not be drawn, and why; None where all was.
    note: str | None


def record(
    robot: Robot,
    q: np.ndarray,
    arrays: Mapping[str, np.ndarray],
    summary: Mapping[str, Any],
    rate: float = 15.0,
    *,
    before: Before | None = None,
) -> Recording:
    """Records a motion's scene.

    Args:
        q: (T, nq), the configurations.
        arrays: of the report, a row per frame.
        summary: of the report.
        rate: frames per second of the recording, at most; long motions get fewer.
        before: the motion before repair, to be drawn as a ghost.

    Raises:
        DynacomError: viser is not installed.
    """
    # Those, too, that a reason leads to.
    worst = [reason["time"] for reason in summary["reasons"]] + repair_times(summary)
    worst = [time for time in worst if time is not None]
    frames = np.union1d(_thin(arrays["time"], rate), closest_frames(arrays["time"], worst))
    times = arrays["time"][frames] - arrays["time"][0]
    with _server(_import_viser(), port=0) as server:
        scene = Scene(server, robot, q, arrays, summary, before)
        recorder = server.get_scene_serializer()
        # The last frame stays for as long as the others.
        pauses = np.diff(times, append=times[-1] + 1.0 / rate)
        with server.atomic():  # nobody waits for single changes
            for frame, pause in zip(frames, pauses, strict=True):
                scene.show(frame)
                if scene.ghost is None:
                    recorder.insert_sleep(float(pause))
                    continue
                # A player knows times alone: in the second half of its pause, a frame has no ghost.
                for visible in (True, False):
                    scene.ghost.visible = visible
                    recorder.insert_sleep(float(pause) / 2.0)
        without = None if scene.ghost is None else times + pauses / 2.0
        return Recording(recorder.as_html(), times, without, scene.note)


def show(
    robot: Robot,
    q: np.ndarray,
    arrays: Mapping[str, np.ndarray],
    summary: Mapping[str, Any],
    *,
    announce: Callable[[str], None],
    stop: threading.Event | None = None,
    port: int = 8080,
    before: Before | None = None,
) -> None:
    """Shows a motion's scene to a browser on this machine, with buttons to play it.

    Returns when it is stopped, or interrupted.

    Args:
        q, arrays, summary, before: as for :func:`record`.
        announce: is called once with the address to open.
        stop: ends the show when it is set, as the button in the browser does.
        port: the first to be tried.

    Raises:
        DynacomError: viser is not installed.
    """
    stop = threading.Event() if stop is None else stop
    clock = arrays["time"] - arrays["time"][0]
    with _server(_import_viser(), port) as server:
        scene = Scene(server, robot, q, arrays, summary, before)
        controls = _Controls(server, float(clock[-1]), stop)
        if scene.ghost is not None:
            controls.add_ghost(scene.ghost)
        announce(f"http://{server.get_host()}:{server.get_port()}")
        shown = 0
        with contextlib.suppress(KeyboardInterrupt):
            while not stop.wait(1.0 / 60.0):
                frame = int(closest_frames(clock, [controls.advance()])[0])
                if frame != shown:
                    with server.atomic():
                        scene.show(frame)
                    shown = frame
                controls.status.value = str(arrays["status"][frame])


class _Controls:
    """What one plays a motion with."""

    def __init__(self, server: Any, duration: float, stop: threading.Event) -> None:
        self._gui = gui = server.gui
        gui.configure_theme(show_logo=False, show_share_button=False)
        self._duration = max(duration, 1e-3)  # a slider needs a length
        self._playing = gui.add_checkbox("Play", True)
        self._time = gui.add_slider("Time [s]", 0.0, self._duration, 1e-3, 0.0)
        self._speed = gui.add_dropdown("Speed", ("0.1", "0.25", "0.5", "1", "2"), initial_value="1")
        self.status = gui.add_text("Status", "", disabled=True)
        gui.add_button("Stop").on_click(lambda _: stop.set())
        self._time.on_update(self._pause)
        self._before = time.monotonic()

    def add_ghost(self, ghost: Ghost) -> None:
        """Adds what hides the ghost."""
        box = self._gui.add_checkbox("Before repair", True)

        @box.on_update
        def _(_: Any) -> None:
            ghost.visible = box.value

    def _pause(self, event: Any) -> None:
        if event.client is not None:  # else it was advance()
            self._playing.value = False

    def advance(self) -> float:
        """The time to show [s], which goes on where it plays."""
        now = time.monotonic()
        if self._playing.value:
            step = (now - self._before) * float(self._speed.value)
            self._time.value = (self._time.value + step) % self._duration
        self._before = now
        return self._time.value


class Scene:
    """What is drawn of a frame, in a viser server."""

    def __init__(
        self,
        server: Any,
        robot: Robot,
        q: np.ndarray,
        arrays: Mapping[str, np.ndarray],
        summary: Mapping[str, Any],
        before: Before | None = None,
    ) -> None:
        """Draws the first frame.

        Args:
            server: a viser.ViserServer with nothing in it.
            robot, q, arrays, summary, before: as for :func:`record`.
        """
        self._scene = server.scene
        self._q, self._arrays = q, arrays
        self._ground = float(
            np.median([h for h in summary["ground"].values() if h is not None] or [0.0])
        )
        #: What lengths are measured by: the height of the CoM.
        self._height = max(float(np.nanmedian(arrays["com"][:, 2])) - self._ground, 0.1)
        self._length_per_newton = self._height / (summary["weight"] or 1.0)
        self._offset = _centre(arrays["time"], arrays["com"][:, :2], self._height)
        self._corners = [
            surface_corners(settings, arrays, name) for name, settings in robot.contacts.items()
        ]
        active = [arrays[f"contact.{name}.active"] for name in robot.contacts]
        for link in summary["bodies"]:
            position = arrays[f"body.{link}.position"]
            self._corners.append(position[:, None])
            active.append(np.isfinite(position[:, 0]))
        self._active = np.array(active)

        self._world = self._scene.add_frame(_WORLD, show_axes=False)
        self._scene.add_grid(
            f"{_WORLD}/ground",
            infinite_grid=True,
            cell_size=0.25,
            cell_color=(226, 226, 226),
            section_color=(200, 200, 200),
            fade_distance=12.0 * self._height,
            shadow_opacity=0.2,
            position=(0.0, 0.0, self._ground),
        )
        self._aim_camera(server, robot.model, q[0])
        self._robot, self.note = draw_robot(server, robot, f"{_WORLD}/robot")
        self._forces = [*self._draw_forces(robot), *self._draw_body_forces(robot, summary)]
        self._draw_points(has_distance=summary["distance"] is not None)
        #: The motion before repair, if there is one.
        self.ghost: Ghost | None = None
        self._paths: list[MovingPath] = []
        if before is not None:
            self._draw_before(server, robot, before)
        self.show(0)

    def show(self, frame: int) -> None:
        """Moves everything to where it is in a frame."""
        self._world.position = (*-self._offset[frame], 0.0)
        self._robot(self._q[frame])
        for arrow in self._forces:
            arrow(frame)
        com = self._arrays["com"][frame]
        self._com.position = com
        self._plumb.points = np.array([[com, [com[0], com[1], self._ground]]])
        if self._feasible_com is not None:
            self._feasible_com.position = self._arrays["feasible_com"][frame]
            self._feasible_com.visible = bool(self._arrays["distance"][frame] > 1e-3)
        for name, ball in self._balls.items():
            point = self._arrays[name][frame]
            ball.visible = bool(np.isfinite(point).all())
            if ball.visible:
                ball.position = (*point, self._ground)
        self._show_support(frame)
        if self.ghost is not None:
            self.ghost.show(frame)
        for path in self._paths:
            path.show(frame)

    def _aim_camera(self, server: Any, model: pin.Model, q: np.ndarray) -> None:
        """From the front, a little to the side, and from above."""
        data = model.createData()
        pin.forwardKinematics(model, data, q)
        joints = np.array([placement.translation for placement in data.oMi[1:]])
        top = max(float(joints[:, 2].max()) - self._ground, self._height)
        width = float(np.linalg.norm(np.ptp(joints[:, :2], axis=0)))
        size = max(0.65 * top, 0.7 * width, self._height)
        x, y, z, w = q[3:7]
        yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)) - 0.7
        middle = np.array([0.0, 0.0, self._ground + 0.55 * top])
        camera = server.initial_camera
        camera.fov = 0.7
        camera.look_at = middle
        camera.position = middle + size * np.array([3.1 * np.cos(yaw), 3.1 * np.sin(yaw), 0.85])

    def _draw_forces(self, robot: Robot) -> Iterator[Callable[[int], None]]:
        for number, name in enumerate(robot.contacts):
            color = contact_color(number)
            key = f"contact.{name}"
            rotation = rotation_matrices(self._arrays[f"{key}.rotation"])
            # From the contact's own centre of pressure, where it has one.
            place = np.nan_to_num(self._arrays[f"{key}.cop"])
            start = self._arrays[f"{key}.position"] + np.einsum(
                "tij,tj->ti", rotation[:, :, :2], place
            )
            path = _force_path(number, name)
            force = np.einsum("tij,tj->ti", rotation, self._arrays[f"{key}.force"])
            yield self._arrow(path, color, 1.0, start, force)
            measured = self._arrays.get(f"{key}.measured_force")
            if measured is not None:
                force = np.einsum("tij,tj->ti", rotation, measured)
                pale = tuple(int(127 + value / 2) for value in color)
                yield self._arrow(f"{path}, measured", pale, 0.6, start, force)

    def _draw_body_forces(
        self, robot: Robot, summary: Mapping[str, Any]
    ) -> Iterator[Callable[[int], None]]:
        for number, link in enumerate(summary["bodies"], len(robot.contacts)):
            start = np.nan_to_num(self._arrays[f"body.{link}.position"])
            force = self._arrays[f"body.{link}.force"]
            yield self._arrow(_force_path(number, link), contact_color(number), 1.0, start, force)

    def _arrow(
        self,
        path: str,
        color: tuple[int, ...],
        thickness: float,
        start: np.ndarray,
        force: np.ndarray,
    ) -> Callable[[int], None]:
        vector = self._length_per_newton * np.nan_to_num(force)
        # To the millimetre, so that what does not move is not sent.
        points = np.stack([start, start + vector], axis=1).round(3)
        head = np.minimum(0.12 * self._height, 0.4 * np.linalg.norm(vector, axis=1)).round(3)
        handle = self._scene.add_arrows(
            path,
            points[:1],
            color,
            shaft_radius=0.02 * thickness * self._height,
            head_radius=0.05 * thickness * self._height,
            head_length=float(head[0]),
        )

        def move(frame: int) -> None:
            handle.points = points[frame : frame + 1]
            handle.head_length = float(head[frame])
            handle.visible = bool(head[frame] > 0.0)

        return move

    def _draw_points(self, *, has_distance: bool) -> None:
        radius = 0.035 * self._height

        def ball(name: str) -> Any:
            return self._scene.add_icosphere(f"{_WORLD}/{name}", radius, color=COLORS[name])

        self._com = ball("com")
        self._feasible_com = ball("feasible_com") if has_distance else None
        self._balls = {name: ball(name) for name in ("cop", "vrp")}
        self._plumb = self._scene.add_line_segments(
            f"{_WORLD}/plumb", np.zeros((1, 2, 3)), COLORS["com"], thickness=0.2 * radius
        )
        count = sum(corners.shape[1] for corners in self._corners)
        fan = [[0, corner, corner + 1] for corner in range(1, count - 1)]
        self._support = self._scene.add_mesh_simple(
            f"{_WORLD}/support/area",
            np.zeros((count, 3)),
            np.array(fan or [[0, 0, 0]]),
            color=COLORS["support"],
            opacity=0.5,
            side="double",
            cast_shadow=False,
        )
        self._border = self._scene.add_line_segments(
            f"{_WORLD}/support/border",
            np.zeros((count, 2, 3)),
            COLORS["support"],
            thickness=0.3 * radius,
        )

    def _draw_before(self, server: Any, robot: Robot, before: Before) -> None:
        """The ghost, and the paths that it is compared by."""
        radius = 0.035 * self._height
        points = {f"{name}_before": places for name, places in self._places(before.arrays).items()}
        self.ghost = Ghost(server, f"{_WORLD}/before", robot, before, points, COLORS, 0.8 * radius)
        self._paths = [
            MovingPath(
                self._scene,
                f"{_WORLD}/{name}_path",
                self._arrays["time"],
                places,
                COLORS[name],
                thickness=0.3 * radius,
            )
            for name, places in self._places(self._arrays).items()
        ]

    def _places(self, arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """CoM and CoP, (T, 3) each; no CoP that is farther from below the CoM than this is high."""
        com, cop = arrays["com"], arrays["cop"].copy()
        cop[np.linalg.norm(cop - com[:, :2], axis=1) > self._height] = np.nan
        # A little above the support's area.
        return {"com": com, "cop": np.column_stack([cop, np.full(len(cop), self._ground + 0.004)])}

    def _show_support(self, frame: int) -> None:
        """The convex hull of the active contacts, at the height of the lowest."""
        active = np.flatnonzero(self._active[:, frame])
        self._support.visible = self._border.visible = len(active) > 0
        if len(active) == 0:
            return
        corners = np.concatenate([self._corners[number][frame] for number in active])
        hull = convex_hull(corners[:, :2])
        height = corners[:, 2].min() + 0.002
        # Always as many corners: the last ones fall together.
        hull = np.concatenate(
            [hull, np.repeat(hull[-1:], len(self._support.vertices) - len(hull), 0)]
        )
        hull = np.column_stack([hull, np.full(len(hull), height)]).round(3)
        self._support.vertices = hull
        self._border.points = np.stack([hull, np.roll(hull, -1, axis=0)], axis=1)


def repair_times(summary: Mapping[str, Any]) -> list[float | None]:
    """The times that the page's section on repair leads to [s]."""
    repair = summary.get("repair") or {}
    changes = [repair.get(name) or {} for name in ("root", "joints", "com")]
    return [item.get("time") for item in (*changes, *(repair.get("reasons") or []))]


def _force_path(number: int, name: str) -> str:
    # A slash would make levels in the scene's tree.
    shown = "".join(c if c.isprintable() and c != "/" else "_" for c in name)
    return f"{_WORLD}/forces/{number} {shown}"


def convex_hull(points: np.ndarray) -> np.ndarray:
    """The corners of the convex hull of points in a plane, (N, 2), counter-clockwise."""
    points = np.unique(points, axis=0)
    if len(points) < 3:
        return points

    def chain(points: np.ndarray) -> list[np.ndarray]:
        corners: list[np.ndarray] = []
        for point in points:
            while len(corners) > 1 and _turn(corners[-2], corners[-1], point) <= 0.0:
                corners.pop()
            corners.append(point)
        return corners[:-1]

    return np.array(chain(points) + chain(points[::-1]))


def _turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    """Positive where a, b, c turn left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _thin(time: np.ndarray, rate: float) -> np.ndarray:
    """The frames that are the closest to those of a lower rate."""
    duration = time[-1] - time[0]
    count = min(int(duration * rate) + 1, _MOST_FRAMES)
    if count >= len(time):
        return np.arange(len(time))
    return np.unique(closest_frames(time, np.linspace(time[0], time[-1], count)))


def closest_frames(time: np.ndarray, wanted: Sequence[float]) -> np.ndarray:
    """The frames that are the closest to some times."""
    wanted = np.asarray(wanted, dtype=float)
    after = np.searchsorted(time, wanted).clip(max=len(time) - 1)
    before = (after - 1).clip(min=0)
    return np.where(wanted - time[before] < time[after] - wanted, before, after)


def _centre(time: np.ndarray, com: np.ndarray, height: float) -> np.ndarray:
    """What the camera looks at, (T, 2): the motion's middle, or the CoM where that goes far.

    Of the CoM a mean over two seconds: the camera shall not tremble.
    """
    com = np.nan_to_num(com)
    if (np.ptp(com, axis=0) < 2.0 * height).all():
        return np.broadcast_to((com.min(axis=0) + com.max(axis=0)) / 2.0, com.shape)
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(com, axis=0)])
    first = np.searchsorted(time, time - 1.0)
    last = np.searchsorted(time, time + 1.0, side="right")
    return (sums[last] - sums[first]) / (last - first)[:, None]


# ---- viser ----


def _import_viser() -> ModuleType:
    try:
        import viser
    except ImportError as error:
        raise DynacomError(
            "the 3D scene needs viser, which is not installed: pip install dynacom[motion]"
        ) from error
    return viser


@contextlib.contextmanager
def _server(viser: ModuleType, port: int) -> Iterator[Any]:
    """A server that this machine alone can reach, and that does not print.

    Args:
        port: the first to be tried, 0 for any.
    """
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host="127.0.0.1", port=port, verbose=False)
    try:
        yield server
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()
