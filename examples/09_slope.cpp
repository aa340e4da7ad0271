// SPDX-License-Identifier: BSD-2-Clause
// Lesson 9. Standing on a slope: the plane of the soles is the ground.
#include <cmath>
#include <cstdio>
#include <dynacom/contact6d.hpp>
#include <dynacom/dyna_com.hpp>

int main(int argc, char** argv) {
  dynacom::DynaCoMSettings settings;
  settings.urdf = argc > 1 ? argv[1] : DYNACOM_TALOS_URDF;
  dynacom::DynaCoM talos(settings);
  for (const char* side : {"left", "right"}) {
    dynacom::Contact6DSettings sole;
    sole.frame_name = std::string("leg_") + side + "_sole_fix_joint";
    sole.half_length = 0.10;
    sole.half_width = 0.06;
    sole.mu = 0.3;
    sole.gu = 0.1;
    sole.friction = dynacom::FrictionModel::Cone;
    talos.addContact(std::make_shared<dynacom::Contact6D>(sole), side);
  }

  const pinocchio::Model& model = talos.getModel();
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(model.nv);
  for (const int degrees : {0, 5, 10, 20}) {
    // The ankles bend until the soles lie on the slope, which rises forwards.
    Eigen::VectorXd q = pinocchio::neutral(model);
    for (const char* side : {"left", "right"})
      q[model.joints[model.getJointId(std::string("leg_") + side + "_5_joint")].idx_q()] =
          -degrees * M_PI / 180.;
    talos.computeDynamics(q, rest, rest);
    const pinocchio::SE3 left = talos.getContact("left")->getSurfacePose();
    const dynacom::GroundPlane slope = {left.translation(), left.rotation().col(2)};

    // Now with the slope for the ground: where is Talos pressed against it?
    talos.computeDynamics(q, rest, rest, dynacom::DynaCoM::Vector6::Zero(), slope);
    const Eigen::Vector3d pressed = left.actInv(talos.getCoP3D());
    const dynacom::DistributionStatus status = talos.distributeForce(
        talos.getGroundCoMForce(), talos.getGroundCoMTorque(), talos.getCoM());
    std::printf(
        "%2d degrees: %-8s pressed %6.3f m before the left sole's middle, which uses %3.0f %% of "
        "its "
        "friction\n",
        degrees, dynacom::to_string(status), pressed.x(),
        100. * talos.getContactFrictionUsage("left"));
  }
}
