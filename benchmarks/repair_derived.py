"""Motions that are made from a clip as people's tools make them by mistake."""

from dataclasses import replace

import numpy as np
import pinocchio
import truth_trials

RAISED, SUNK = 0.05, -0.03  # [m]
SKATING = 0.1  # at which a root is dragged along x, feet and all [m/s]
DRIFT, TURNING = 0.02, np.radians(2.0)  # along y [m/s], and about the vertical [rad/s]
NOISE = 1e-3, 5e-3  # of the root's place and what slides [m], of what turns [rad]
HASTE = 1.3


def moved(clip, velocity=(0.0, 0.0, 0.0), yaw_rate=0.0, offset=0.0):
    """Seen from a frame that goes and turns about the vertical, and is lower by an offset."""
    q = clip.q.copy()
    since = clip.time - clip.time[0]
    for row, t in zip(q, since, strict=True):
        turn = pinocchio.exp3(np.array([0.0, 0.0, yaw_rate * t]))
        frame = pinocchio.SE3(turn, t * np.asarray(velocity) + [0.0, 0.0, offset])
        row[:7] = pinocchio.SE3ToXYZQUAT(frame * pinocchio.XYZQUATToSE3(row[:7]))
    return with_configurations(clip, q)


def with_configurations(clip, q):
    """As if a file held these, and no velocities."""
    return replace(clip, q=q, v=None, a=None)


def jittering(clip, model):
    return with_configurations(clip, truth_trials.add_noise(model, clip.q, *NOISE))


def sped_up(clip, model):
    return replace(with_configurations(clip, clip.q), time=clip.time / HASTE)


#: By how docs/repair.md calls it, what makes it of a clip and its robot's model.
DERIVED = {
    "floating": lambda clip, model: moved(clip, offset=RAISED),
    "sunk": lambda clip, model: moved(clip, offset=SUNK),
    "skating": lambda clip, model: moved(clip, velocity=(SKATING, 0.0, 0.0)),
    "drifting": lambda clip, model: moved(clip, velocity=(0.0, DRIFT, 0.0), yaw_rate=TURNING),
    "jittering": jittering,
    "sped up": sped_up,
}
