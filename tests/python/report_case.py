# SPDX-License-Identifier: BSD-2-Clause
"""Reports to show: the arrays and the summary that an analysis of a motion comes to."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

import dynacom
from dynacom import AnalysisOptions, Clip, ContactSchedule, Motion
from dynacom.repair_change import Before
from dynacom.robots import Robot
from helpers import WALKS

Arrays = dict[str, np.ndarray]
Summary = dict[str, Any]


def walk_report(robot: Robot, **changes: np.ndarray) -> tuple[np.ndarray, Arrays, Summary]:
    """The configurations of Talos' bundled walk, the arrays and the summary of its report.

    Args:
        changes: arrays of the file, to be replaced.
    """
    with np.load(WALKS / "talos_walk.npz") as file:
        walk = {name: file[name] for name in file.files} | changes
    names = walk["contact_names"].tolist()
    motion = Motion(*(walk[name] for name in ("t", "q", "v", "a")))
    forces = {name: walk["contact_wrenches"][:, number] for number, name in enumerate(names)}
    schedule = ContactSchedule(names, walk["contacts"])
    return walk["q"], *report(robot, motion, schedule, forces)


def report(
    robot: Robot,
    motion: Motion,
    schedule: ContactSchedule,
    forces: Mapping[str, np.ndarray] | None = None,
) -> tuple[Arrays, Summary]:
    """The arrays and the summary of a motion's report.

    Args:
        forces: as :attr:`Clip.forces`.
    """
    error = np.zeros(len(motion.time))
    names = robot.joints.names
    clip = Clip(
        Path("clip.npz"),
        *(motion.time, motion.q, motion.v, motion.a),
        *(names, schedule, forces or {}, error, ()),
    )
    found = dynacom.analyze(clip, robot)
    return found.arrays, found.summary


def repaired_walk(robot: Robot) -> tuple[Before, np.ndarray, Arrays, Summary]:
    """Talos' bundled walk, made so fast that Talos would fall, and repaired.

    Returns:
        What it was before; the configurations, the arrays and the summary of the report after.
    """
    with np.load(WALKS / "talos_walk.npz") as file:
        time, q, contacts = file["t"] / 1.85, file["q"], file["contacts"]
        schedule = ContactSchedule(file["contact_names"].tolist(), contacts)
    unfiltered = AnalysisOptions(cutoff=0.0)

    def analyze(q: np.ndarray) -> dynacom.MotionReport:
        given = (robot.joints.names, schedule, {}, np.zeros(len(time)), ())
        clip = Clip(Path("clip.npz"), time, q, None, None, *given)
        return dynacom.analyze(clip, robot, options=unfiltered, sensitivity=False)

    before = analyze(q)
    parts = dynacom.splitContacts(robot.dynacom())
    found = before.examination
    motion = dynacom.repairMotion(parts, found.derived.motion, found.inference.schedule).motion
    after = analyze(np.asarray(motion.q))
    return Before(q, before.arrays, before.summary), motion.q, after.arrays, after.summary
