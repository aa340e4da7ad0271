// SPDX-License-Identifier: BSD-2-Clause
// Lesson 2. How do the contacts share the ground's wrench?
#include <cstdio>
#include <dynacom/contact6d.hpp>
#include <dynacom/dyna_com.hpp>

namespace {

void printForces(const dynacom::DynaCoM& talos) {
  std::printf("%s\n", dynacom::to_string(talos.getDistributionStatus()));
  for (const std::string& name : talos.getActiveContacts()) {
    std::printf("  %-6s", name.c_str());
    for (const double value : talos.getContact(name)->appliedForce()) std::printf(" %8.2f", value);
    std::printf("\n");
  }
}

void show(const char* what, const Eigen::Ref<const Eigen::VectorXd>& values, const char* unit) {
  std::printf("  %-22s", what);
  for (const double value : values) std::printf(" %8.3f", value);
  std::printf("  %s\n", unit);
}

}  // namespace

int main(int argc, char** argv) {
  dynacom::DynaCoMSettings settings;
  settings.urdf = argc > 1 ? argv[1] : DYNACOM_TALOS_URDF;
  dynacom::DynaCoM talos(settings);

  // A sole is a rectangle that pushes, with friction; the cost of its force is ½ Σ (wᵢ λᵢ)².
  for (const char* side : {"left", "right"}) {
    dynacom::Contact6DSettings sole;
    sole.frame_name = std::string("leg_") + side + "_sole_fix_joint";
    sole.half_length = 0.10;
    sole.half_width = 0.06;
    sole.mu = 0.7;
    sole.gu = 0.1;
    sole.weights << 1., 1., 1., 10., 10., 10.;
    talos.addContact(std::make_shared<dynacom::Contact6D>(sole), side);
  }

  const pinocchio::Model& model = talos.getModel();
  const Eigen::VectorXd q = pinocchio::neutral(model);
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(model.nv);
  talos.computeDynamics(q, rest, rest);
  const auto distribute = [&talos] {
    talos.distributeForce(talos.getGroundCoMForce(), talos.getGroundCoMTorque(), talos.getCoM());
    printForces(talos);
  };

  std::printf("At rest on two soles (force [N] and moment [N·m] in the sole's frame): ");
  distribute();

  // How close to the edge is that? For the whole: how much any component of the wrench may change.
  // For a sole: where it is pressed, and how far that is from its nearest edge.
  using Number = Eigen::Matrix<double, 1, 1>;
  show("margin", Number(talos.computeWrenchMargin().margin), "N");
  show("left CoP", talos.getContactCoP("left"), "m");
  show("left CoP's margin", Number(talos.getContactCoPMargin("left")), "m");

  // Settings may change at any time, and act on the next call.
  std::printf("With a left sole that shall carry less: ");
  auto left = std::static_pointer_cast<dynacom::Contact6D>(talos.getContact("left"));
  left->setForceWeights(Eigen::Vector3d(1., 1., 2.));
  distribute();

  // The CoM is not above the right sole: it cannot hold Talos alone. Its force is the best that it
  // can give. What is missing of the wrench makes Talos fall.
  std::printf("With the left foot off the ground: ");
  talos.deactivateContact("left");
  distribute();
  show("missing force", talos.getDistribution().residual.head<3>(), "N");
  show("missing moment", talos.getDistribution().residual.tail<3>(), "N·m");
  show("the CoM accelerates by", talos.getFeasibleACoM(), "m/s²");

  // On uneven ground the centre of pressure comes from the forces of the contacts.
  talos.activateContact("left");
  talos.computeDynamics(q, rest, rest, dynacom::DynaCoM::Vector6::Zero(), false);
  std::printf("Centre of pressure: %.4f %.4f m\n", talos.getCoP().x(), talos.getCoP().y());
}
