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

# Settings may change at any time, and act on the next call.
print("With a left sole that shall carry less: ", end="")
talos.getContact("left").setForceWeights(np.array([1, 1, 2]))
distribute()

# The CoM is not above the right sole: it cannot hold Talos alone.
print("With the left foot off the ground: ", end="")
talos.deactivateContact("left")
distribute()

# On uneven ground the centre of pressure comes from the forces of the contacts.
talos.activateContact("left")
talos.computeDynamics(q, rest, rest, flatHorizontalGround=False)
print("Centre of pressure: {:.4f} {:.4f} m".format(*talos.getCoP()))
