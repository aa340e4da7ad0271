# SPDX-License-Identifier: BSD-2-Clause
"""Lesson 2. How do the contacts share the ground's wrench?"""

import numpy as np
import pinocchio

import dynacom


def show_forces(talos):
    print(talos.getDistributionStatus())
    for name in talos.getActiveContacts():
        force = talos.getContact(name).appliedForce()
        print(f"  {name:<6}" + "".join(f" {value:8.2f}" for value in force))


def show(what, values, unit):
    print(f"  {what:<22}" + "".join(f" {value:8.3f}" for value in values) + f"  {unit}")


talos = dynacom.DynaCoM(dynacom.load_robot("talos").model)

# A sole is a rectangle that pushes, with friction; the cost of its force is ½ Σ (wᵢ λᵢ)².
for side in "left", "right":
    sole = dynacom.Contact6DSettings()
    sole.frame_name = f"leg_{side}_sole_fix_joint"
    sole.half_length = 0.10
    sole.half_width = 0.06
    sole.mu = 0.7
    sole.gu = 0.1
    sole.weights = np.array([1, 1, 1, 10, 10, 10])
    talos.addContact(dynacom.Contact6D(sole), side)

model = talos.getModel()
q = pinocchio.neutral(model)
rest = np.zeros(model.nv)
talos.computeDynamics(q, rest, rest)


def distribute():
    talos.distributeForce(talos.getGroundCoMForce(), talos.getGroundCoMTorque(), talos.getCoM())
    show_forces(talos)


print("At rest on two soles (force [N] and moment [N·m] in the sole's frame): ", end="")
distribute()

# How close to the edge is that? For the whole: how much any component of the wrench may change.
# For a sole: where it is pressed, and how far that is from its nearest edge.
show("margin", [talos.computeWrenchMargin().margin], "N")
show("left CoP", talos.getContactCoP("left"), "m")
show("left CoP's margin", [talos.getContactCoPMargin("left")], "m")

# Settings may change at any time, and act on the next call.
print("With a left sole that shall carry less: ", end="")
talos.getContact("left").setForceWeights(np.array([1, 1, 2]))
distribute()

# The CoM is not above the right sole: it cannot hold Talos alone. Its force is the best that it can
# give. What is missing of the wrench makes Talos fall.
print("With the left foot off the ground: ", end="")
talos.deactivateContact("left")
distribute()
show("missing force", talos.getDistribution().residual[:3], "N")
show("missing moment", talos.getDistribution().residual[3:], "N·m")
show("the CoM accelerates by", talos.getFeasibleACoM(), "m/s²")

# On uneven ground the centre of pressure comes from the forces of the contacts.
talos.activateContact("left")
talos.computeDynamics(q, rest, rest, flatHorizontalGround=False)
print("Centre of pressure: {:.4f} {:.4f} m".format(*talos.getCoP()))
