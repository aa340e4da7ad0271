# SPDX-License-Identifier: BSD-2-Clause
"""Lesson 4. Is a motion possible? Configurations in, a verdict out."""

import numpy as np
from crouch import crouch

import dynacom

talos = dynacom.load_robot("talos").dynacom()
model = talos.getModel()
parts = dynacom.splitContacts(talos)


def nobody(frames):
    """A schedule in which no contact is ever active."""
    return dynacom.ContactSchedule([], np.zeros((frames, 0), dtype=bool))


for period in 2.0, 0.5:
    time, q = crouch(talos, period)

    # Velocities and accelerations, without what is faster than 6 Hz.
    smooth = dynacom.filterConfigurations(model, q, rate=100.0, cutoff=6.0)
    motion = dynacom.differentiate(model, time, smooth)

    # Which corners of which feet touch the ground, and when? What the motion needs tells.
    corners = dynacom.computeContactMotions(parts.robot, motion)
    needed = dynacom.analyzeMotion(parts.robot, motion, nobody(len(time)))
    found = dynacom.inferContacts(parts, corners, needed, exact=False)
    schedule = dynacom.gatherParts(talos, parts, found.schedule)

    # What must they give, and what can they? And is that enough?
    analysis = dynacom.analyzeMotion(parts.robot, motion, found.schedule)
    recorded = dynacom.RecordedMotion(time, q)
    verdict = dynacom.judgeMotion(parts.robot, motion, recorded, corners, found.ground, analysis)
    largest = analysis.ground_force[:, 2].max() / (talos.getMass() * 9.81)
    share = 100 * schedule.active.mean()
    print(f"A crouch in {period:.1f} s: {'feasible' if verdict.feasible else 'not feasible'}")
    print(f"  on the ground {share:.0f} %, up to {largest:.2f} m g")
    for code, finding in verdict.findings.items():
        if finding.holds:
            print(f"  {code}: {finding.frames} frames, worst at {finding.time:.2f} s")
