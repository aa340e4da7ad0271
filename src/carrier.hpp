// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>
#include <pinocchio/multibody.hpp>
#include <string>
#include <vector>

#include "dynacom/dyna_com.hpp"

namespace dynacom::internal {

/// A contact, and where it is fixed to a robot.
struct FixedContact {
  std::string name;
  std::shared_ptr<const ContactBase> contact;  // which nobody else changes
  pinocchio::JointIndex joint;
  pinocchio::SE3 placement;  // of the contact's frame in the joint's
};

/// What carries a robot, and how: all that is to be known of it for distributions.
struct Carrier {
  std::vector<FixedContact> contacts;
  double mass;
  Eigen::Vector3d gravity;
  DynaCoM::Vector6 wrench_weights;
  double minimal_vertical_force;
  bool warm_start;
  int maximal_iterations;
};

/// All contacts that a robot knows, and its settings.
Carrier describeCarrier(const DynaCoM& robot);

}  // namespace dynacom::internal
