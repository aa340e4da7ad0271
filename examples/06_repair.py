# SPDX-License-Identifier: BSD-2-Clause
"""Lesson 6. A motion that is too fast, and the closest one that physics allows."""

import math

from crouch import crouch

import dynacom

talos = dynacom.load_robot("talos").dynacom()
examiner = dynacom.MotionExaminer(talos, sensitivity=False)
repairer = dynacom.MotionRepairer(talos, examiner)

for period in 2.0, 0.5:
    recorded = dynacom.RecordedMotion(*crouch(talos, period))
    repair = repairer.repair(recorded)
    print(f"A crouch in {period:.1f} s: {repair.outcome}")

    # What is left stands in reasons; what came out, in recorded, which need not be filtered.
    for reason in repair.reasons:
        print(f"  {reason.code}: {reason.text}")
    frames = len(repair.recorded.time)
    print(
        f"  {repair.missing_before} of {frames} frames were out of reach, and {repair.missing} are"
    )
    root, turned = 1e3 * repair.root.largest, math.degrees(repair.joints.largest)
    print(
        f"  the root was displaced by {root:.1f} mm, at most, and joints turned by {turned:.2f} deg"
    )
    for step in repair.steps:
        print(f"  step {step.rung}: {'kept' if step.is_kept else 'not kept'}")

    # It is what its contacts can give, in every frame, and so says whoever examines it.
    found = examiner.examine(repair.recorded)
    print(f"  it is {'feasible' if found.verdict.feasible else 'not feasible'}")
