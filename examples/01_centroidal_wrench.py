# SPDX-License-Identifier: BSD-2-Clause
"""Lesson 1. Which wrench must the ground give to a robot in motion, and where does it press?"""

import math

import numpy as np
import pinocchio

import dynacom


def show(what, values, unit):
    print(f"{what:<28}" + "".join(f" {value:9.3f}" for value in values) + f"  {unit}")


# A robot by name is a file of the package; a DynaCoM is made from any URDF or pinocchio.Model.
talos = dynacom.DynaCoM(dynacom.load_robot("talos").model)
model = talos.getModel()

# Its motion is configuration, velocity and acceleration, in Pinocchio's order. Here it stands
# upright, and begins to move: forwards at 0.5 m/s², and bowing at 0.2 rad/s².
q = pinocchio.neutral(model)
v = np.zeros(model.nv)
a = np.zeros(model.nv)
a[0] = 0.5
a[4] = 0.2

# In this posture the soles are 1.083 m below the root joint's frame, which is at height zero.
talos.setGroundHeight(-1.083)
talos.computeDynamics(q, v, a)
print(f"Talos weighs {talos.getMass():.2f} kg")
show("centre of mass", talos.getCoM(), "m")
show("force of the ground", talos.getGroundCoMForce(), "N")
show("its moment about the CoM", talos.getGroundCoMTorque(), "N·m")
show("centre of pressure", talos.getCoP(), "m")

# The linear inverted pendulum leaves angular momentum and height out. Its virtual repellent point
# is where the ground would press if that were true; the rest is the non-linearity.
height = talos.getCoM()[2] - talos.getGroundHeight()
talos.computeNL(math.sqrt(9.81 / height))
show("virtual repellent point", talos.getVRP(), "m")
show("non-linearity", talos.getNL(), "m")

# A person pulls with 40 N to the left, at the height of the CoM: the ground has to pull back.
pull = np.zeros(6)
pull[1] = 40.0
talos.computeDynamics(q, v, a, extWrench=pull)
show("force of the ground, pulled", talos.getGroundCoMForce(), "N")
show("centre of pressure, pulled", talos.getCoP(), "m")
