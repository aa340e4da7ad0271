# SPDX-License-Identifier: BSD-2-Clause
"""Lesson 8. A hand on a rail pulls as well as it pushes, but not harder than it may."""

import numpy as np
import pinocchio

import dynacom

talos = dynacom.DynaCoM(dynacom.load_robot("talos").model)
sole = dynacom.Contact6DSettings()
sole.frame_name = "leg_right_sole_fix_joint"
sole.half_length = 0.10
sole.half_width = 0.06
sole.mu = 0.7
sole.gu = 0.1
talos.addContact(dynacom.Contact6D(sole), "right")

# The hand gives forces up to a bound each way, and no moments: a rail turns in it.
rail = dynacom.ContactGraspSettings()
rail.frame_name = "gripper_left_base_link"
hand = dynacom.ContactGrasp(rail)
talos.addContact(hand, "hand", active=False)

model = talos.getModel()
q, rest = pinocchio.neutral(model), np.zeros(model.nv)
for strongest in (0.0, 20.0, 200.0):
    rail.upper = np.array([strongest, strongest, strongest, 0.0, 0.0, 0.0])
    rail.lower = -rail.upper
    hand.initialize(rail)
    if strongest == 20.0:  # and from now on
        talos.activateContact("hand")
    talos.computeDynamics(q, rest, rest)
    status = talos.distributeForce(
        talos.getGroundCoMForce(), talos.getGroundCoMTorque(), talos.getCoM()
    )
    missing = np.linalg.norm(talos.getDistribution().residual[3:])
    print(f"a hand of {strongest:5.1f} N: {status!s:<8} missing {missing:6.2f} N m", end="")
    print("; the hand gives" + "".join(f" {value:7.2f}" for value in hand.appliedForce()[:3]), "N")
