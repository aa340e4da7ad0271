# SPDX-License-Identifier: BSD-2-Clause
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import dynacom
from dynacom.motion_joints import urdf_order
from dynacom.robots import Robot
from helpers import SHARED_DATA
from motion_files import G1_FILE, TOY_FILE, TOY_URDF

ROOT = Path(__file__).parents[2]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--pictures",
        action="store_true",
        help="keep in docs/ the pictures that tests of pages take",
    )


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository."""
    return ROOT


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Motions by third parties, which are not part of the repository."""
    if not SHARED_DATA.is_dir():
        pytest.skip("the folder ../shared/data is not there")
    return SHARED_DATA


@pytest.fixture(scope="session")
def talos() -> Robot:
    return dynacom.load_robot("talos")


@pytest.fixture(scope="session")
def anymal() -> Robot:
    return dynacom.load_robot("anymal_c")


@pytest.fixture(scope="session")
def toy(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """A small robot with joints of every kind; its toe may be missing in files."""
    folder = tmp_path_factory.mktemp("toy")
    (folder / "toy.urdf").write_text(TOY_URDF)
    (folder / "toy.yaml").write_text(TOY_FILE)
    robot = dynacom.load_robot(folder / "toy.yaml")
    default = robot.default.copy()
    default[robot.model.joints[robot.model.getJointId("b_toe")].idx_q] = 0.25
    layout = ("z_knee", "m_hip", "c_wheel", "a_slide")
    return replace(robot, default=default, joint_layouts=(layout,))


@pytest.fixture(scope="session")
def humanoid(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """Unitree's G1 of 29 joints, whose wrists may be missing in files."""
    path = tmp_path_factory.mktemp("g1") / "humanoid.yaml"
    path.write_text(G1_FILE)
    robot = dynacom.load_robot(path)
    layout = tuple(name for name in urdf_order(robot) if "wrist" not in name)
    return replace(robot, joint_layouts=(layout,))


def put_on_ground(robot: Robot, q: np.ndarray) -> np.ndarray:
    """q, moved along z so that the lowest contact touches the ground (z = 0)."""
    dynamics = robot.dynacom()
    zero = np.zeros(robot.model.nv)
    dynamics.computeDynamics(q, zero, zero)
    lowest = min(
        dynamics.getContact(name).getSurfacePose().translation[2] for name in robot.contacts
    )
    q = q.copy()
    q[2] -= lowest
    return q


@pytest.fixture(scope="session")
def talos_standing(talos: Robot) -> np.ndarray:
    """Knees bent, feet side by side on the ground."""
    model = talos.model
    q = pin.neutral(model)
    for side in ("left", "right"):
        for joint, angle in (("3", -0.45), ("4", 0.9), ("5", -0.45)):
            q[model.idx_qs[model.getJointId(f"leg_{side}_{joint}_joint")]] = angle
    return put_on_ground(talos, q)


@pytest.fixture(scope="session")
def anymal_standing(anymal: Robot) -> np.ndarray:
    """Legs bent, feet on the ground: the URDF's SRDF calls it `standing`."""
    model = anymal.model
    q = pin.neutral(model)
    for front, sign in (("F", 1.0), ("H", -1.0)):
        for side, roll in (("L", -0.1), ("R", 0.1)):
            for joint, angle in (("HAA", roll), ("HFE", 0.7 * sign), ("KFE", -1.0 * sign)):
                q[model.idx_qs[model.getJointId(f"{side}{front}_{joint}")]] = angle
    return put_on_ground(anymal, q)


Motion = dict[str, np.ndarray]


@pytest.fixture(scope="session")
def talos_motion(talos: Robot, talos_standing: np.ndarray) -> Motion:
    """The arrays of a motion file: Talos on two feet, on one, on none; at last it falls freely."""
    rng = np.random.default_rng(0)
    frames, nv = 40, talos.model.nv
    time = np.linspace(0.0, 0.78, frames)
    v = 0.02 * rng.standard_normal((frames, nv))
    a = 0.05 * rng.standard_normal((frames, nv))
    q = np.array([pin.integrate(talos.model, talos_standing, 0.02 * v_t) for v_t in v])
    q[-1], v[-1], a[-1] = talos_standing, 0.0, 0.0
    a[-1, 2] = -9.81
    contacts = np.ones((frames, 2), dtype=bool)
    contacts[25:30, 1] = False
    contacts[30:] = False
    names = np.array(["left_sole", "right_sole"])
    return {"t": time, "q": q, "v": v, "a": a, "contacts": contacts, "contact_names": names}


@pytest.fixture
def motion_file(tmp_path: Path, talos_motion: Motion) -> Callable[..., Path]:
    """Writes that motion to a file: with arrays replaced or added, or dropped where None."""

    def write(name: str = "motion.npz", **changes: np.ndarray | None) -> Path:
        path = tmp_path / name
        arrays = talos_motion | changes
        np.savez(path, **{key: value for key, value in arrays.items() if value is not None})
        return path

    return write


@pytest.fixture(scope="session")
def run() -> Callable[..., subprocess.CompletedProcess[str]]:
    """Runs the command as a user does, in a process of its own."""

    def run(*arguments: object, **options: object) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "dynacom", *map(str, arguments)],
            capture_output=True,
            text=True,
            timeout=120,
            env=os.environ | {"COLUMNS": "120"},
            **options,
        )

    return run
