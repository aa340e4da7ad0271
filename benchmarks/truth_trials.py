"""Motions whose contact forces were measured or simulated: SOURCES.md in ../shared/data/forces."""

import tempfile
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio

import dynacom

# By how much the forces of these come late [s].
LAGS = {"icub": 0.05}
# A foot is in contact where it bears more than this part of m g; where forces were measured rather
# than simulated, also more than this [N], below which they are noise.
CONTACT_SHARE, CONTACT_FORCE = 0.02, 20.0
# What is added as noise, to the root's place and what slides, and to what turns: [m], [rad].
NOISE = 1e-3, 2e-3
GRAVITY = 9.81


@dataclass(frozen=True)
class Trial:
    """A motion and the forces on its feet: T frames, F feet; belts that move are taken out."""

    name: str
    robot: dynacom.Robot
    time: np.ndarray  # (T,), from 0 [s]
    q: np.ndarray  # (T, nq)
    feet: tuple  # F names
    force: np.ndarray  # (T, F, 3), in the world; NaN where a component is not measured [N]
    cop: np.ndarray  # (T, F, 3), in the world; NaN where nothing presses [m]
    touch: np.ndarray | None  # (T, F), bool; None if only the forces are known
    measured: np.ndarray  # (T,), bool: all forces on the robot are known

    @property
    def simulated(self):
        return self.name.startswith("sim")

    @property
    def mass(self):
        return pinocchio.computeTotalMass(self.robot.model)

    @property
    def weight(self):
        return self.mass * GRAVITY

    @property
    def cutoff(self):
        """The filter that suits this kind of motion [Hz], or None."""
        if self.simulated:
            return None
        return 10.0 if "jump" in self.name else 6.0

    @property
    def noisy_cutoff(self):
        """The same, once there is noise."""
        return self.cutoff or 10.0

    def contacts(self, foot):
        """Names of the robot's contacts that are parts of a foot."""
        return [name for name in self.robot.contacts if name == foot or name.startswith(f"{foot}_")]


@cache
def load_robot(path):
    return dynacom.load_robot(path)


def read_trial(path):
    """A trial from its archive, beside which is the file of its robot."""
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files if name != "source"}
    name = path.stem
    robot = load_robot(path.with_name(str(arrays["urdf"])).with_suffix(".yaml"))
    if list(arrays["joint_names"]) != list(robot.model.names[2:]):
        raise ValueError(f"{path}: joints must be {list(robot.model.names[2:])}")
    time = arrays["t"].astype(float)
    time -= time[0]
    q = arrays["q"].astype(float)
    force, cop = arrays["foot_forces"].astype(float), arrays["foot_cops"].astype(float)
    measured = arrays["measured"].astype(bool)
    touch = arrays.get("foot_contact")

    if "belt_velocity" in arrays:
        gone = np.outer(time, arrays["belt_velocity"])
        q[:, :3] -= gone
        cop -= gone[:, None]
    lag = next((lag for start, lag in LAGS.items() if name.startswith(start)), 0.0)
    if lag:
        flat = force.reshape(len(time), -1)
        flat = np.transpose([np.interp(time + lag, time, column) for column in flat.T])
        force = flat.reshape(force.shape)
        measured &= time + lag <= time[-1]
    return Trial(
        name,
        robot,
        time,
        q,
        tuple(map(str, arrays["foot_names"])),
        force,
        cop,
        None if touch is None else touch.astype(bool),
        measured,
    )


def find_sliding(model):
    """Which components of changes of configurations are of the root's place or joints that slide
    [m], not turn [rad]: (nv,), bool."""
    sliding = np.zeros(model.nv, dtype=bool)
    sliding[:3] = True
    for joint in list(model.joints)[2:]:
        if joint.shortname().startswith("JointModelP"):
            sliding[joint.idx_v : joint.idx_v + joint.nv] = True
    return sliding


def add_noise(model, q, sliding, turning, seed=0):
    """Configurations (T, nq) with white noise: on the root's place and what slides [m], and on what
    turns [rad]."""
    scale = np.where(find_sliding(model), sliding, turning)
    steps = scale * np.random.default_rng(seed).standard_normal((len(q), model.nv))
    return np.array([pinocchio.integrate(model, *pair) for pair in zip(q, steps, strict=True)])


def with_noise(trial, seed=0):
    """The trial with noise on its configurations."""
    return replace(trial, q=add_noise(trial.robot.model, trial.q, *NOISE, seed))


def measured_schedule(trial):
    """A schedule with all contacts of a foot active while it bears load."""
    names = list(trial.robot.contacts)
    active = np.zeros((len(trial.time), len(names)), dtype=bool)
    least = max(CONTACT_SHARE * trial.weight, 0.0 if trial.simulated else CONTACT_FORCE)
    for index, foot in enumerate(trial.feet):
        for name in trial.contacts(foot):
            active[:, names.index(name)] = np.nan_to_num(trial.force[:, index, 2]) > least
    return dynacom.ContactSchedule(names, active)


def analyze(trial, cutoff, schedule=None, options=None):
    """What dynacom finds of a trial, from its times and configurations alone.

    Args:
        cutoff: [Hz]; None for no filter.
        schedule: a ContactSchedule; None to find one.
        options: other settings than the defaults.
    """
    options = options or dynacom.AnalysisOptions()
    options.cutoff = cutoff
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{trial.name}.npz"
        np.savez(path, t=trial.time, q=trial.q)
        return dynacom.analyze(
            path, trial.robot, options=options, sensitivity=False, schedule=schedule
        )
