# SPDX-License-Identifier: BSD-2-Clause
"""Lesson 9. Standing on a slope: the plane of the soles is the ground."""

import numpy as np
import pinocchio

import dynacom

talos = dynacom.DynaCoM(dynacom.load_robot("talos").model)
for side in "left", "right":
    sole = dynacom.Contact6DSettings()
    sole.frame_name = f"leg_{side}_sole_fix_joint"
    sole.half_length = 0.10
    sole.half_width = 0.06
    sole.mu = 0.3
    sole.gu = 0.1
    sole.friction = dynacom.FrictionModel.Cone
    talos.addContact(dynacom.Contact6D(sole), side)

model = talos.getModel()
rest = np.zeros(model.nv)
for degrees in (0, 5, 10, 20):
    # The ankles bend until the soles lie on the slope, which rises forwards.
    q = pinocchio.neutral(model)
    for side in "left", "right":
        q[model.joints[model.getJointId(f"leg_{side}_5_joint")].idx_q] = -np.radians(degrees)
    talos.computeDynamics(q, rest, rest)
    left = talos.getContact("left").getSurfacePose()
    slope = dynacom.GroundPlane(left.translation, left.rotation[:, 2])

    # Now with the slope for the ground: where is Talos pressed against it?
    talos.computeDynamics(q, rest, rest, np.zeros(6), slope)
    pressed = left.actInv(talos.getCoP3D())
    status = talos.distributeForce(
        talos.getGroundCoMForce(), talos.getGroundCoMTorque(), talos.getCoM()
    )
    friction = talos.getContactFrictionUsage("left")
    print(
        f"{degrees:2d} degrees: {status!s:<8} pressed {pressed[0]:6.3f} m before the left sole's ",
        end="",
    )
    print(f"middle, which uses {100 * friction:3.0f} % of its friction")
