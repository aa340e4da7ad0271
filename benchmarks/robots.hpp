// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <dynacom/contact6d.hpp>
#include <dynacom/contact_point.hpp>
#include <dynacom/dyna_com.hpp>

// The robots of the benchmarks.

namespace dynacom::benchmarks {

constexpr double kFriction = 0.7, kYawFriction = 0.1, kHalfLength = 0.10, kHalfWidth = 0.06;

// Talos, with its two soles.
inline DynaCoM makeTalos() {
  DynaCoMSettings settings;
  settings.urdf = DYNACOM_TALOS_URDF;
  DynaCoM talos(settings);
  for (const char* side : {"left", "right"}) {
    Contact6DSettings sole;
    sole.mu = kFriction;
    sole.gu = kYawFriction;
    sole.half_length = kHalfLength;
    sole.half_width = kHalfWidth;
    sole.frame_name = std::string("leg_") + side + "_sole_fix_joint";
    talos.addContact(std::make_shared<Contact6D>(sole), side);
  }
  return talos;
}

// A trunk of 50 kg that stands on four points, in mid-stride.
inline DynaCoM makeQuadruped() {
  pinocchio::Model model;
  const auto trunk =
      model.addJoint(0, pinocchio::JointModelFreeFlyer(), pinocchio::SE3::Identity(), "trunk");
  model.appendBodyToJoint(trunk, pinocchio::Inertia::FromBox(50., 0.9, 0.4, 0.3));
  const Eigen::Vector3d feet[] = {
      {0.42, 0.22, -0.5}, {0.30, -0.20, -0.5}, {-0.33, 0.20, -0.5}, {-0.38, -0.21, -0.5}};
  int number = 0;
  for (const Eigen::Vector3d& foot : feet) {
    const std::string name = "foot" + std::to_string(++number);
    model.addFrame(pinocchio::Frame(name, trunk, pinocchio::SE3(Eigen::Matrix3d::Identity(), foot),
                                    pinocchio::OP_FRAME));
  }
  DynaCoM quadruped(model);
  for (int foot = 1; foot <= number; ++foot) {
    ContactPointSettings point;
    point.mu = kFriction;
    point.frame_name = "foot" + std::to_string(foot);
    quadruped.addContact(std::make_shared<ContactPoint>(point), point.frame_name);
  }
  return quadruped;
}

}  // namespace dynacom::benchmarks
