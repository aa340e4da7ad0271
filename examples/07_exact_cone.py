# SPDX-License-Identifier: BSD-2-Clause
"""Lesson 7. How much friction is there? Pyramids around the cone and within it, and the cone."""

import numpy as np
import pinocchio

import dynacom

talos = dynacom.DynaCoM(dynacom.load_robot("talos").model)
soles = {}
for side in "left", "right":
    sole = dynacom.Contact6DSettings()
    sole.frame_name = f"leg_{side}_sole_fix_joint"
    sole.half_length = 0.10
    sole.half_width = 0.06
    sole.mu = 0.3
    sole.gu = 0.1
    soles[side] = (dynacom.Contact6D(sole), sole)
    talos.addContact(soles[side][0], side)

model = talos.getModel()
q, rest = pinocchio.neutral(model), np.zeros(model.nv)

# A push along the diagonal, of 0.25 of the weight each way, 0.35 together: more than mu = 0.3.
# The pyramid around the cone, which is the manual's, lets it pass.
for friction in (
    dynacom.FrictionModel.OuterPyramid,
    dynacom.FrictionModel.InnerPyramid,
    dynacom.FrictionModel.Facets,  # eight sides around the cone: one touches it here
    dynacom.FrictionModel.Cone,
):
    for contact, settings in soles.values():
        settings.friction = friction
        contact.initialize(settings)
    talos.computeDynamics(q, rest, rest)
    weight = talos.getGroundCoMForce()[2]
    push = np.array([0.25 * weight, 0.25 * weight, weight])
    middle = sum(contact.getSurfacePose().translation for contact, _ in soles.values()) / 2
    status = talos.distributeForce(push, np.cross(middle - talos.getCoM(), push), talos.getCoM())
    along = np.hypot(*talos.getContact("left").appliedForce()[:2])
    of_normal = along / talos.getContact("left").appliedForce()[2]
    missing = np.linalg.norm(talos.getDistribution().residual[:3])
    print(
        f"{friction!s:<13} {status!s:<8} left: {of_normal:.3f} of its normal force, "
        f"missing {missing:6.1f} N"
    )
