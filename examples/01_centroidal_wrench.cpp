// SPDX-License-Identifier: BSD-2-Clause
// Lesson 1. Which wrench must the ground give to a robot in motion, and where does it press?
#include <cmath>
#include <cstdio>
#include <dynacom/dyna_com.hpp>

namespace {

void print(const char* what, const Eigen::Ref<const Eigen::VectorXd>& values, const char* unit) {
  std::printf("%-28s", what);
  for (const double value : values) std::printf(" %9.3f", value);
  std::printf("  %s\n", unit);
}

}  // namespace

int main(int argc, char** argv) {
  // A robot is a URDF file, or its XML; its root joint becomes a free-flyer.
  dynacom::DynaCoMSettings settings;
  settings.urdf = argc > 1 ? argv[1] : DYNACOM_TALOS_URDF;
  dynacom::DynaCoM talos(settings);
  const pinocchio::Model& model = talos.getModel();

  // Its motion is configuration, velocity and acceleration, in Pinocchio's order. Here it stands
  // upright, and begins to move: forwards at 0.5 m/s², and bowing at 0.2 rad/s².
  const Eigen::VectorXd q = pinocchio::neutral(model);
  const Eigen::VectorXd v = Eigen::VectorXd::Zero(model.nv);
  Eigen::VectorXd a = Eigen::VectorXd::Zero(model.nv);
  a[0] = 0.5;
  a[4] = 0.2;

  // In this posture the soles are 1.083 m below the root joint's frame, which is at height zero.
  talos.setGroundHeight(-1.083);
  talos.computeDynamics(q, v, a);
  std::printf("Talos weighs %.2f kg\n", talos.getMass());
  print("centre of mass", talos.getCoM(), "m");
  print("force of the ground", talos.getGroundCoMForce(), "N");
  print("its moment about the CoM", talos.getGroundCoMTorque(), "N·m");
  print("centre of pressure", talos.getCoP(), "m");

  // The linear inverted pendulum leaves angular momentum and height out. Its virtual repellent
  // point is where the ground would press if that were true; the rest is the non-linearity.
  const double height = talos.getCoM().z() - talos.getGroundHeight();
  talos.computeNL(std::sqrt(9.81 / height));
  print("virtual repellent point", talos.getVRP(), "m");
  print("non-linearity", talos.getNL(), "m");

  // A person pulls with 40 N to the left, at the height of the CoM: the ground has to pull back.
  dynacom::DynaCoM::Vector6 pull = dynacom::DynaCoM::Vector6::Zero();
  pull[1] = 40.;
  talos.computeDynamics(q, v, a, pull);
  print("force of the ground, pulled", talos.getGroundCoMForce(), "N");
  print("centre of pressure, pulled", talos.getCoP(), "m");
}
