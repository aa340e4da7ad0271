# SPDX-License-Identifier: BSD-2-Clause
"""The crouches that lessons 4 to 6 judge."""

import numpy as np
import pinocchio


def crouch(talos, period):
    """Times (T,) [s] and configurations (T, nq) of two crouches, with the feet where they are."""
    model = talos.getModel()
    rest = np.zeros(model.nv)
    time = np.arange(round(200 * period) + 1) / 100
    q = np.tile(pinocchio.neutral(model), (len(time), 1))
    for row, t in zip(q, time, strict=True):
        bend = 0.2 + 0.3 * (1 - np.cos(2 * np.pi * t / period))
        for side in "left", "right":
            for joint, angle in (3, -bend), (4, 2 * bend), (5, -bend):
                row[model.idx_qs[model.getJointId(f"leg_{side}_{joint}_joint")]] = angle
        talos.computeDynamics(row, rest, rest)
        row[:3] -= talos.getContact("left_sole").getSurfacePose().translation
    return time, q
