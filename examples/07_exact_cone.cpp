// SPDX-License-Identifier: BSD-2-Clause
// Lesson 7. How much friction is there? Pyramids around the cone and within it, and the cone.
#include <cstdio>
#include <dynacom/contact6d.hpp>
#include <dynacom/dyna_com.hpp>
#include <utility>
#include <vector>

int main(int argc, char** argv) {
  dynacom::DynaCoMSettings settings;
  settings.urdf = argc > 1 ? argv[1] : DYNACOM_TALOS_URDF;
  dynacom::DynaCoM talos(settings);
  std::vector<std::pair<std::shared_ptr<dynacom::Contact6D>, dynacom::Contact6DSettings>> soles;
  for (const char* side : {"left", "right"}) {
    dynacom::Contact6DSettings sole;
    sole.frame_name = std::string("leg_") + side + "_sole_fix_joint";
    sole.half_length = 0.10;
    sole.half_width = 0.06;
    sole.mu = 0.3;
    sole.gu = 0.1;
    soles.emplace_back(std::make_shared<dynacom::Contact6D>(sole), sole);
    talos.addContact(soles.back().first, side);
  }

  const pinocchio::Model& model = talos.getModel();
  const Eigen::VectorXd q = pinocchio::neutral(model);
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(model.nv);

  // A push along the diagonal, of 0.25 of the weight each way, 0.35 together: more than mu = 0.3.
  // The pyramid around the cone, which is the manual's, lets it pass.
  for (const dynacom::FrictionModel friction :
       {dynacom::FrictionModel::OuterPyramid, dynacom::FrictionModel::InnerPyramid,
        dynacom::FrictionModel::Facets,  // eight sides around the cone: one touches it here
        dynacom::FrictionModel::Cone}) {
    for (auto& [contact, sole] : soles) {
      sole.friction = friction;
      contact->initialize(sole);
    }
    talos.computeDynamics(q, rest, rest);
    const double weight = talos.getGroundCoMForce().z();
    const Eigen::Vector3d push(0.25 * weight, 0.25 * weight, weight);
    const Eigen::Vector3d middle = 0.5 * (soles[0].first->getSurfacePose().translation() +
                                          soles[1].first->getSurfacePose().translation());
    const dynacom::DistributionStatus status =
        talos.distributeForce(push, (middle - talos.getCoM()).cross(push), talos.getCoM());
    const Eigen::VectorXd& force = talos.getContact("left")->appliedForce();
    std::printf("%-13s %-8s left: %.3f of its normal force, missing %6.1f N\n",
                dynacom::to_string(friction), dynacom::to_string(status),
                force.head<2>().norm() / force[2],
                talos.getDistribution().residual.head<3>().norm());
  }
}
