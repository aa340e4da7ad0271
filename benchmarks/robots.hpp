// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <dynacom/dyna_com.hpp>
#include <dynacom/surface_options.hpp>

#include "peers.hpp"

// The robots of the benchmarks, and what is asked of them.

namespace dynacom::benchmarks {

using Wrench = Eigen::Matrix<double, 6, 1>;  // (force, moment) about the CoM

// As in python/dynacom/robots/talos.yaml.
constexpr double kFriction = 0.7, kYawFriction = 0.08, kHalfLength = 0.10, kHalfWidth = 0.06;

// Talos, with its two soles, "left" and "right".
DynaCoM makeTalos(FrictionModel friction = FrictionModel::OuterPyramid);
// The same on soles without their corners: polygons of eight vertices.
DynaCoM makeTalosOnOctagons();
// Unitree's G1, with its two soles, as in python/dynacom/robots/g1.yaml.
DynaCoM makeG1();
// A trunk of 50 kg that stands on four points, in mid-stride.
DynaCoM makeQuadruped(FrictionModel friction = FrictionModel::OuterPyramid);
// The same trunk, on so many points or soles around it.
DynaCoM makePoints(int number);
DynaCoM makeSoles(int number);

// Distributes that wrench, as the controller of a robot does every tick.
inline DistributionStatus distribute(DynaCoM& robot, const Wrench& wrench) {
  return robot.distributeForce(wrench.head<3>(), wrench.tail<3>(), robot.getCoM());
}

// The wrench that the motion of the last computeDynamics() takes.
Wrench groundWrench(const DynaCoM& robot);

// The problem of the robot's last distribution, as general solvers take it.
QuadraticProgram makeProgram(const DynaCoM& robot);

// A solver that answers another question than the robot's last distribution would be no reference.
// @throws std::logic_error if its forces are others
void requireSameForces(const DynaCoM& robot, const Eigen::VectorXd& forces);

}  // namespace dynacom::benchmarks
