# SPDX-License-Identifier: BSD-2-Clause
"""Small clips of ANYmal for the tests of batches, and files that are none."""

import gzip
import os
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow

from dynacom.robots import Robot
from helpers import WALKS
from motion_files import columns_of, write_columns

#: Contents of broken files by name -> a part of the error.
BROKEN = {
    "empty.csv": (b"", "empty file"),
    "empty.npz": (b"", "empty.npz"),
    "header.csv": (b"t,root_x\n1,2\n", "missing column"),
    "text.csv": (b"hello\nworld\n", "must be a number"),
    "narrow.csv": (b"1,2,3\n1,2,3\n", "columns"),
    "ragged.csv": (b"1,2,3\n1,2\n", "columns"),
    "zip.npz": (b"PK\x03\x04 and no more", "zip.npz"),
    "bytes.csv": (bytes(range(256)), "must be text"),
    "half.csv.gz": (gzip.compress(b"1,2,3\n" * 100)[:-10], "gzip"),
    "no.parquet": (b"PAR1", "no.parquet"),
    "no.pkl": (b"\x80\x04 nothing", "must be a pickle"),
    "system.pkl": (pickle.dumps(os.system), "asks for"),
}


def cut(path: Path, start: int, frames: int, walk: str = "anymal_walk", **changes: object) -> Path:
    """A piece of a bundled walk, as a file."""
    with np.load(WALKS / f"{walk}.npz") as file:
        names = ("t", "q", "v", "a", "contacts")
        arrays = {name: file[name][start : start + frames] for name in names}
        arrays["contact_names"] = file["contact_names"]
    arrays |= changes
    np.savez(path, **{name: array for name, array in arrays.items() if array is not None})
    return path


def hover(path: Path, start: int, frames: int) -> Path:
    """As cut, but no contact is ever active: not feasible."""
    return cut(path, start, frames, contacts=np.zeros((frames, 4), dtype=bool))


def hurry(path: Path, start: int, frames: int) -> Path:
    """A piece of the trot at twice its pace: not feasible, but it can be repaired."""
    with np.load(WALKS / "anymal_trot.npz") as file:
        time = file["t"][start : start + frames] / 2.0
    return cut(path, start, frames, "anymal_trot", t=time, v=None, a=None)


def write_without_legs(path: Path, talos: Robot) -> Robot:
    """A file without the legs, which repair has to move: feet slide without them.

    Returns:
        The robot, whose legs are by default where the file needs them.
    """
    with np.load(WALKS / "talos_walk.npz") as file:
        still = np.tile(file["q"][0], (100, 1))
    columns = {
        name: values
        for name, values in columns_of(talos, still).items()
        if not name.startswith("leg_")
    }
    columns = {"t": np.arange(100) / 50.0} | columns
    # The trunk turns faster than soles allow.
    columns["torso_1_joint"] = 0.6 * np.sin(2.0 * np.pi * 1.5 * np.arange(100) / 50.0)
    columns["arm_left_2_joint"] = 0.8 + 0.5 * np.sin(2.0 * np.pi * 2.5 * np.arange(100) / 50.0)
    write_columns(path, columns)
    return replace(talos, default=still[0])


def write_csv(path: Path, robot: Robot, walk: str, rate: float) -> Path:
    """A piece of a bundled walk at so many frames a second; 50 are its own."""
    with np.load(WALKS / f"{walk}.npz") as file:
        q = file["q"][40:80]
    return write_columns(path, {"t": np.arange(len(q)) / rate} | columns_of(robot, q))


def write_repairable(folder: Path, robot: Robot) -> dict[str, str]:
    """Clips for repair, and files that are none.

    Returns:
        Where each file lies -> what becomes of it, or of its clips, with + between them.
    """
    (folder / "sub").mkdir(parents=True)
    cut(folder / "calm.npz", 0, 30)
    hurry(folder / "sub" / "fast.npz", 20, 50)
    hover(folder / "sub" / "air.npz", 0, 40)
    cut(folder / "short.npz", 100, 3, v=None, a=None)
    write_csv(folder / "calm.csv", robot, "anymal_walk", 50.0)
    write_csv(folder / "fast.csv", robot, "anymal_trot", 100.0)
    calm, fast = motion(robot, 20, 40), motion(robot, 20, 40) | {"fps": 150.0}
    rising = motion(robot, 20, 40)
    rising["root_pos"] = rising["root_pos"] + np.outer(np.arange(40), [0.0, 0.0, 0.02])
    broken = motion(robot, 0, 5) | {"root_rot": np.zeros((5, 4))}
    clips = {"calm": calm, "fast": fast, "rising": rising, "broken": broken}
    (folder / "many.pkl").write_bytes(pickle.dumps(clips))
    (folder / "calm.pkl").write_bytes(pickle.dumps({"one": calm, "two": motion(robot, 60, 40)}))
    (folder / "fast.pkl").write_bytes(pickle.dumps(fast))
    (folder / "rising.pkl").write_bytes(pickle.dumps({"one": rising, "two": broken}))
    (folder / "broken.csv").touch()
    return {
        "broken.csv": "error",
        "calm.csv": "feasible",
        "calm.npz": "feasible",
        "calm.pkl": "feasible+feasible",
        "fast.csv": "repaired",
        "fast.pkl": "repaired",
        "many.pkl": "feasible+repaired+not repaired+error",
        "rising.pkl": "not repaired+error",
        "short.npz": "not repaired",
        "sub/air.npz": "not repaired",
        "sub/fast.npz": "repaired",
    }


def write_clips(folder: Path) -> dict[str, str]:
    """Clips and broken files, in subfolders too: file's name in results -> part of its error."""
    (folder / "sub").mkdir(parents=True)
    errors = {}
    for number in range(5):
        name = f"walk_{number}.npz"
        cut(folder / name, 40 * number, 30 + 5 * number)
        errors[name] = ""
    cut(folder / "sub" / "trot.npz", 20, 50, "anymal_trot")
    hover(folder / "sub" / "air.npz", 0, 40)
    cut(folder / "frame.npz", 100, 1)
    cut(folder / "short.npz", 100, 3, v=None, a=None)  # unknown
    errors |= {"sub/trot.npz": "", "sub/air.npz": "", "frame.npz": "", "short.npz": ""}

    for name, (content, part) in BROKEN.items():
        (folder / name).write_bytes(content)
        errors[name] = part
    q = np.full((3, 19), np.nan)
    cut(folder / "nan.npz", 0, 3, q=q)
    cut(folder / "none.npz", 0, 0)
    cut(folder / "wide.npz", 0, 3, q=np.zeros((3, 25)))
    (folder / "gone.npz").symlink_to("nowhere.npz")
    os.mkfifo(folder / "pipe.csv")
    errors |= {
        "nan.npz": "finite",
        "none.npz": "none.npz",
        "wide.npz": "19",
        "gone.npz": "No such file",
        "pipe.csv": "must be a file",
    }
    odd = '\\udcff<b>&".csv'
    with open(os.fsencode(folder) + b'/\xff<b>&".csv', "w") as file:
        file.write("x\n")
    errors[odd] = "missing column"
    # What is not looked for.
    (folder / "README.md").write_text("Motions.")
    (folder / ".hidden").mkdir()
    cut(folder / ".hidden" / "walk.npz", 0, 10)
    return {str(folder / name): part for name, part in errors.items()}


def motion(robot: Robot, start: int, frames: int) -> dict[str, object]:
    """What a pickle holds of a piece of the walk."""
    with np.load(WALKS / "anymal_walk.npz") as file:
        q = file["q"][start : start + frames]
    return {
        "fps": 50.0,
        "root_pos": q[:, :3],
        "root_rot": q[:, 3:7],
        "dof_pos": q[:, 7:],
        "dof_names": list(robot.model.names)[2:],
    }


class Program:
    """Pickled, it runs a program where it is loaded by someone who trusts it."""

    def __init__(self, expression: str) -> None:
        self._expression = expression

    def __reduce__(self) -> tuple:
        return eval, (self._expression,)


def write_program(path: Path, robot: Robot, start: int, statement: str) -> Path:
    """A clip whose reader runs a statement first."""
    data = pickle.dumps(motion(robot, start, 20))
    expression = f"(exec({statement!r}), __import__('pickle').loads({data!r}))[1]"
    path.write_bytes(pickle.dumps(Program(expression)))
    return path


def same(a: pyarrow.Table, b: pyarrow.Table) -> bool:
    """Whether they are equal, but for what no two runs have in common."""
    return a.drop(["seconds"]).equals(b.drop(["seconds"]))
