# SPDX-License-Identifier: BSD-2-Clause
"""Motions that are possible by construction, of a robot that is a body above massless soles.

The body keeps its orientation and the soles weigh nothing, so that angular momentum is zero and
forces act along lines through the centre of mass: c̈ + g ẑ = (c − p) (c̈_z + g) / (c_z − p_z), where
p is the centre of pressure. A motion is made from p and the height of the body: what carries when
is then known, without any of the code that is tested.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.linalg import solve_banded

import dynacom
from dynacom import Clip
from dynacom.robots import Robot

GRAVITY = 9.81
HEIGHT = 0.8  # of the body above what it stands on
WIDTH = 0.1  # from the middle to a foot
HALF_LENGTH, HALF_WIDTH = 0.1, 0.05
FEET = ("left", "right")

_LEG = """
  <link name="{name}_x"/><link name="{name}_y"/>
  <link name="{name}_foot"><inertial><mass value="{mass}"/>
    <inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/>
  </inertial></link>
  <joint name="{name}_jx" type="prismatic"><parent link="body"/><child link="{name}_x"/>
    <axis xyz="1 0 0"/><limit lower="-99" upper="99" effort="1" velocity="99"/></joint>
  <joint name="{name}_jy" type="prismatic"><parent link="{name}_x"/><child link="{name}_y"/>
    <axis xyz="0 1 0"/><limit lower="-99" upper="99" effort="1" velocity="99"/></joint>
  <joint name="{name}_jz" type="prismatic"><parent link="{name}_y"/><child link="{name}_foot"/>
    <axis xyz="0 0 1"/><limit lower="-99" upper="99" effort="1" velocity="99"/></joint>"""

_FILE = """
urdf: puppet.urdf
contacts:
  - {{name: left, kind: 6d, frame: left_foot, mu: 0.8, gu: 0.05, half_length: {length},
     half_width: {width}}}
  - {{name: right, kind: 6d, frame: right_foot, mu: 0.8, gu: 0.05, half_length: {length},
     half_width: {width}}}
"""


def make_puppet(folder: Path, sole: float = 0.0) -> Robot:
    """Two soles, left and right, that go wherever they are put, below a body of 30 kg.

    Args:
        sole: the mass of each [kg]; if there is one, motions are no longer possible by
            construction, but close to that.
    """
    legs = "".join(_LEG.format(name=name, mass=sole, inertia=0.01 * sole) for name in FEET)
    (folder / "puppet.urdf").write_text(
        '<robot name="puppet"><link name="body"><inertial><mass value="30"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        f"{legs}</robot>",
        encoding="utf-8",
    )
    (folder / "puppet.yaml").write_text(
        _FILE.format(length=HALF_LENGTH, width=HALF_WIDTH), encoding="utf-8"
    )
    return dynacom.load_robot(folder / "puppet.yaml")


@dataclass(frozen=True)
class Play:
    """What body and feet do: rows are frames, in the world [m]; feet by name."""

    time: np.ndarray
    body: np.ndarray
    feet: dict[str, np.ndarray]
    #: Name -> which frames it carries in, by construction.
    active: dict[str, np.ndarray]

    def moved(self, velocity: np.ndarray) -> "Play":
        """The same as seen by who moves at that velocity."""
        shift = self.time[:, None] * velocity
        feet = {name: place - shift for name, place in self.feet.items()}
        return replace(self, body=self.body - shift, feet=feet)

    def mirrored(self) -> "Play":
        """Left and right exchanged."""
        mirror = np.array([1.0, -1.0, 1.0])
        swap = dict(zip(FEET, reversed(FEET), strict=True))
        return replace(
            self,
            body=self.body * mirror,
            feet={name: self.feet[swap[name]] * mirror for name in FEET},
            active={name: self.active[swap[name]] for name in FEET},
        )

    def with_standing(self, seconds: float) -> "Play":
        """The same with so long a standing before and after it."""
        count = round(seconds / (self.time[1] - self.time[0]))

        def longer(values: np.ndarray) -> np.ndarray:
            before, after = values[:1], values[-1:]
            return np.concatenate([np.repeat(before, count, 0), values, np.repeat(after, count, 0)])

        step = self.time[1] - self.time[0]
        return Play(
            step * np.arange(len(self.time) + 2 * count),
            longer(self.body),
            {name: longer(place) for name, place in self.feet.items()},
            {name: longer(active) for name, active in self.active.items()},
        )

    def clip(self, yaw: float = 0.0) -> Clip:
        """As a file would hold it, without velocities and accelerations; all turned by a yaw."""
        frames = len(self.time)
        turn = np.array(
            [[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]]
        )
        q = np.zeros((frames, 13))
        q[:, :3] = self.body @ turn.T
        q[:, 5:7] = np.sin(yaw / 2), np.cos(yaw / 2)
        for index, name in enumerate(FEET):
            q[:, 7 + 3 * index : 10 + 3 * index] = self.feet[name] - self.body
        return Clip(Path("puppet"), self.time, q, None, None, (), None, {}, np.zeros(frames), ())


def smooth(part: np.ndarray) -> np.ndarray:
    """From 0 to 1, with two derivatives that are zero at both ends."""
    x = np.clip(part, 0.0, 1.0)
    return x**3 * (10 - 15 * x + 6 * x**2)


def follow(
    time: np.ndarray, pressure: np.ndarray, height: np.ndarray, ends: tuple[float, float]
) -> np.ndarray:
    """One horizontal coordinate of the body above a centre of pressure, (T,).

    Args:
        pressure: of the centre of pressure, (T, 2): this coordinate, and its height.
        height: of the body.
        ends: the coordinate in the first and the last frame.
    """
    step = time[1] - time[0]
    rising = np.gradient(np.gradient(height, step), step)
    stiffness = (GRAVITY + rising) / (height - pressure[:, 1])
    frames = len(time)
    bands = np.zeros((3, frames))
    bands[0, 2:] = bands[2, :-2] = 1.0 / step**2
    bands[1, 1:-1] = -2.0 / step**2 - stiffness[1:-1]
    bands[1, [0, -1]] = 1.0
    right = -stiffness * pressure[:, 0]
    right[[0, -1]] = ends
    return solve_banded((1, 1), bands, right)


def walk(
    *,
    rate: float = 120.0,
    steps: int = 6,
    stride: float = 0.25,
    rise: Callable[[float], float] = lambda x: 0.0,
    clearance: float = 0.08,
    single: float = 0.5,
    double: float = 0.3,
    stand: float = 1.0,
) -> Play:
    """A walk from standing to standing, over ground whose height is a function of x.

    Feet stay level: on a slope they stand on the height of their middle.
    """
    places = {"left": [0.0], "right": [0.0]}
    swings, begin = [], stand  # (foot, begin, from, to)
    x = 0.0
    for number in range(steps):
        foot = FEET[number % 2]
        x += stride if number < steps - 1 else 0.0
        swings.append((foot, begin, places[foot][-1], x))
        places[foot].append(x)
        begin += single + double
    time = np.arange(round((begin - double + stand) * rate) + 1) / rate
    feet, active = {}, {}
    for name, side in zip(FEET, (1.0, -1.0), strict=True):
        place = np.zeros((len(time), 3))
        place[:, 1] = side * WIDTH
        place[:, 2] = rise(0.0)
        active[name] = np.ones(len(time), dtype=bool)
        for foot, start, old, new in swings:
            if foot != name:
                continue
            part = (time - start) / single
            going = smooth(part)
            after = part >= 0.0
            place[after, 0] = (old + (new - old) * going)[after]
            level = rise(old) + (rise(new) - rise(old)) * smooth(1.5 * part)
            bump = (clearance + max(0.0, rise(old) - rise(new))) * np.sin(
                np.pi * np.clip(part, 0, 1)
            ) ** 2
            place[after, 2] = (level + bump)[after]
            # By a hair, so that rounding does not decide.
            active[name] &= ~((part > 1e-9) & (part < 1 - 1e-9))
        feet[name] = place
    pressure = _pressure(time, feet, active, double)
    body = np.zeros((len(time), 3))
    body[:, 2] = HEIGHT + _mean_height(time, feet, single + double)
    for axis in (0, 1):
        both = [np.mean([feet[name][frame, axis] for name in FEET]) for frame in (0, -1)]
        body[:, axis] = follow(time, pressure[:, [axis, 2]], body[:, 2], tuple(both))
    return Play(time, body, feet, active)


def _pressure(time, feet, active, double):
    """Within the foot that carries; from one to the other while both do."""
    # How much of it the left foot has: 1 where it alone carries, ½ at both ends of the motion.
    left, right = active["left"], active["right"]
    share = np.full(len(time), np.nan)
    share[left & ~right] = 1.0
    share[right & ~left] = 0.0
    known = np.flatnonzero(~np.isnan(share))
    if len(known) == 0:
        share[:] = 0.5
    else:
        for first, last in zip(known[:-1], known[1:], strict=True):
            between = np.arange(first + 1, last)
            part = (time[between] - time[first]) / (time[last] - time[first])
            share[between] = share[first] + (share[last] - share[first]) * smooth(part)
        for edge, inside in ((0, known[0]), (len(time) - 1, known[-1])):
            span = np.arange(min(edge, inside), max(edge, inside) + 1)
            away = np.abs(time[span] - time[inside]) / max(double, 1e-9)
            share[span] = share[inside] + (0.5 - share[inside]) * smooth(away)
    return share[:, None] * feet["left"] + (1.0 - share[:, None]) * feet["right"]


def _mean_height(time, feet, width):
    """A smooth height of what is stood on: the lower foot's, averaged over a step, twice."""
    lower = np.minimum(feet["left"][:, 2], feet["right"][:, 2])
    size = max(1, round(width / (time[1] - time[0])))
    kernel = np.ones(size) / size
    for _ in range(3):
        padded = np.concatenate([np.full(size, lower[0]), lower, np.full(size, lower[-1])])
        lower = np.convolve(padded, kernel, "same")[size:-size]
    return lower


def hops(
    *, rate: float = 120.0, count: int = 4, height: float = 0.12, stance: float = 0.35
) -> Play:
    """Hops on both feet. Between flights the force is a squared sine, whose mean is what it must
    be: the speed at take-off is √(2 g h)."""
    speed = np.sqrt(2.0 * GRAVITY * height)
    flight = 2.0 * speed / GRAVITY
    step = 1e-5

    def push(duration, before, after):
        """Accelerations of a stance that changes the speed so."""
        t = np.arange(0.0, duration, step)
        mean = (after - before) / duration
        return (mean + GRAVITY) * 2.0 * np.sin(np.pi * t / duration) ** 2 - GRAVITY

    # From rest: a standing that fades into falling, and a push.
    still = np.zeros(round(0.5 / step))
    crouch = 0.4
    t = np.arange(0.0, crouch, step)
    # The body sinks and is caught, and leaves upward: polynomials of the height would do as well.
    down = -0.35 * GRAVITY * np.sin(np.pi * t / crouch) ** 2
    sunk = down.sum() * step
    pieces, contact = [still, down], [True, True]
    pieces.append(push(stance, sunk, speed))
    contact.append(True)
    for number in range(count):
        pieces.append(np.full(round(flight / step), -GRAVITY))
        contact.append(False)
        last = number == count - 1
        pieces.append(push(stance, -speed, 0.0 if last else speed))
        contact.append(True)
    pieces.append(still)
    contact.append(True)
    acceleration = np.concatenate(pieces)
    carries = np.concatenate(
        [np.full(len(piece), on) for piece, on in zip(pieces, contact, strict=True)]
    )
    velocity = np.cumsum(acceleration) * step
    place = HEIGHT + np.cumsum(velocity) * step
    fine = step * np.arange(len(place))
    time = np.arange(int(fine[-1] * rate) + 1) / rate
    body = np.zeros((len(time), 3))
    body[:, 2] = np.interp(time, fine, place)
    on = carries[np.minimum(np.rint(time / step).astype(int), len(carries) - 1)]
    feet, active = {}, {}
    for name, side in zip(FEET, (1.0, -1.0), strict=True):
        feet[name] = np.zeros((len(time), 3))
        feet[name][:, 1] = side * WIDTH
        active[name] = on.copy()
    # In flights, feet go up with the body, above the place where it took off.
    edges = np.flatnonzero(np.diff(carries.astype(int)))
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        inside = (time > fine[first]) & (time < fine[last])
        up = np.interp(time[inside], fine, place) - place[first]
        for name in FEET:
            feet[name][inside, 2] = np.maximum(up, 0.0)
    return Play(time, body, feet, active)


def stand(
    *,
    rate: float = 100.0,
    seconds: float = 4.0,
    lifted: tuple[float, float] | None = None,
    lift: float = 0.05,
    slide: float = 0.0,
) -> Play:
    """Stands, if asked with all its weight on the left foot.

    Args:
        lifted: when the right foot is held still in the air; infinite where it is so from the
            beginning or to the end. It takes 0.4 s to get there and back.
        lift: how high.
        slide: a speed at which the left foot, loaded, moves forward meanwhile, with the body
            [m/s].
    """
    time = np.arange(round(seconds * rate) + 1) / rate
    feet, active = {}, {}
    for name, side in zip(FEET, (1.0, -1.0), strict=True):
        feet[name] = np.tile([0.0, side * WIDTH, 0.0], (len(time), 1))
        active[name] = np.ones(len(time), dtype=bool)
    if lifted is not None:
        begin, end = lifted
        up = smooth((time - (begin - 0.4)) / 0.4) if np.isfinite(begin) else np.ones(len(time))
        down = smooth((time - end) / 0.4) if np.isfinite(end) else np.zeros(len(time))
        feet["right"][:, 2] = lift * (up - down)
        active["right"] = feet["right"][:, 2] == 0.0
    pressure = _pressure(time, feet, active, 0.6)
    body = np.zeros((len(time), 3))
    body[:, 2] = HEIGHT
    for axis in (0, 1):
        body[:, axis] = follow(
            time, pressure[:, [axis, 2]], body[:, 2], (pressure[0, axis], pressure[-1, axis])
        )
    if slide and lifted is not None:
        begin, end = (min(max(edge, 0.0), seconds) for edge in lifted)
        # The same force: at an even speed, with short beginnings and ends.
        way = slide * (end - begin) * smooth((time - begin) / (end - begin))
        for place in (body, *feet.values()):
            place[:, 0] += way
    return Play(time, body, feet, active)
