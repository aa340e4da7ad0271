// SPDX-License-Identifier: BSD-2-Clause
// Lesson 8. A hand on a rail pulls as well as it pushes, but not harder than it may.
#include <cstdio>
#include <dynacom/contact6d.hpp>
#include <dynacom/contact_grasp.hpp>
#include <dynacom/dyna_com.hpp>

int main(int argc, char** argv) {
  dynacom::DynaCoMSettings settings;
  settings.urdf = argc > 1 ? argv[1] : DYNACOM_TALOS_URDF;
  dynacom::DynaCoM talos(settings);
  dynacom::Contact6DSettings sole;
  sole.frame_name = "leg_right_sole_fix_joint";
  sole.half_length = 0.10;
  sole.half_width = 0.06;
  sole.mu = 0.7;
  sole.gu = 0.1;
  talos.addContact(std::make_shared<dynacom::Contact6D>(sole), "right");

  // The hand gives forces up to a bound each way, and no moments: a rail turns in it.
  dynacom::ContactGraspSettings rail;
  rail.frame_name = "gripper_left_base_link";
  const auto hand = std::make_shared<dynacom::ContactGrasp>(rail);
  talos.addContact(hand, "hand", false);

  const pinocchio::Model& model = talos.getModel();
  const Eigen::VectorXd q = pinocchio::neutral(model);
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(model.nv);
  for (const double strongest : {0., 20., 200.}) {
    rail.upper << strongest, strongest, strongest, 0., 0., 0.;
    rail.lower = -rail.upper;
    hand->initialize(rail);
    if (strongest == 20.) talos.activateContact("hand");  // and from now on
    talos.computeDynamics(q, rest, rest);
    const dynacom::DistributionStatus status = talos.distributeForce(
        talos.getGroundCoMForce(), talos.getGroundCoMTorque(), talos.getCoM());
    std::printf("a hand of %5.1f N: %-8s missing %6.2f N m; the hand gives", strongest,
                dynacom::to_string(status), talos.getDistribution().residual.tail<3>().norm());
    for (const double value : hand->appliedForce().head<3>()) std::printf(" %7.2f", value);
    std::printf(" N\n");
  }
}
