# SPDX-License-Identifier: BSD-2-Clause
"""Lesson 3. The same in a control loop: what is measured once a tick is computed once a tick.

In C++ nothing in it allocates, locks, throws or calls the system.
"""

import math

import numpy as np
import pinocchio

import dynacom

talos = dynacom.DynaCoM(dynacom.load_robot("talos").model)
for side in "left", "right":
    sole = dynacom.Contact6DSettings()
    sole.frame_name = f"leg_{side}_sole_fix_joint"
    sole.half_length = 0.10
    sole.half_width = 0.06
    sole.mu = 0.7
    sole.gu = 0.1
    talos.addContact(dynacom.Contact6D(sole), side)
# Nearly all distributions take one iteration. What has no answer after so many gets none.
talos.setMaximalIterations(50)

# Other parts of the controller need Pinocchio's results, too: they are computed once a tick.
model = talos.getModel()
data = model.createData()
q = pinocchio.neutral(model)
v, a = np.zeros(model.nv), np.zeros(model.nv)
pinocchio.computeCentroidalMomentumTimeVariation(model, data, q, v, a)
talos.computeDynamics(data)

# The right foot's place is measured: it has sunk in by 5 mm.
measured = pinocchio.SE3(talos.getContact("right").getPose())
measured.translation[2] -= 0.005
talos.setContactPose("right", measured)

# What happens every 100 ms is printed afterwards: printing calls the system.
records = []
for tick in range(1000):
    # Talos sways sideways, and lifts its left foot while it leans on the right one.
    t = 0.001 * tick
    a[1] = math.sin(2 * math.pi * t)
    if tick == 200:
        talos.deactivateContact("left")
    if tick == 300:
        talos.activateContact("left")

    pinocchio.computeCentroidalMomentumTimeVariation(model, data, q, v, a)
    talos.computeDynamics(data)
    # Solved; Relaxed where it is out of reach, and then the forces are the best that there are, and
    # what they really do to the robot is in getFeasibleACoM(); else there is no answer, and the
    # forces are those of the last one: a few ticks of that are for the controller to bridge.
    status = talos.distributeForce(
        talos.getGroundCoMForce(), talos.getGroundCoMTorque(), talos.getCoM()
    )
    if tick % 100 == 50:
        left, right = (talos.getContact(side).appliedForce()[2] for side in ("left", "right"))
        records.append((t, status, left, right))

print("   t [s]  status     left, right f_z [N]")
for t, status, left, right in records:
    print(f"{t:8.2f}  {status!s:<9} {left:8.1f} {right:8.1f}")
