// SPDX-License-Identifier: BSD-2-Clause
// Talos on its two soles, and the crouches that lessons 4 to 6 judge.
#pragma once

#include <cmath>
#include <dynacom/contact6d.hpp>
#include <dynacom/dyna_com.hpp>
#include <memory>
#include <string>

inline dynacom::DynaCoM makeTalos(const std::string& urdf) {
  dynacom::DynaCoMSettings settings;
  settings.urdf = urdf;
  dynacom::DynaCoM talos(settings);
  for (const char* side : {"left", "right"}) {
    dynacom::Contact6DSettings sole;
    sole.frame_name = std::string("leg_") + side + "_sole_fix_joint";
    sole.half_length = 0.10;
    sole.half_width = 0.06;
    sole.mu = 0.7;
    sole.gu = 0.08;
    talos.addContact(std::make_shared<dynacom::Contact6D>(sole), std::string(side) + "_sole");
  }
  return talos;
}

/// Times of two crouches [s], 100 frames a second.
inline Eigen::VectorXd crouchTimes(double period) {
  const auto frames = static_cast<Eigen::Index>(std::lround(200. * period)) + 1;
  return Eigen::ArrayXd::LinSpaced(frames, 0, double(frames - 1)) / 100.;
}

/// Configurations of two crouches, with the feet where they are: nq × frames.
inline Eigen::MatrixXd crouch(dynacom::DynaCoM& talos, double period) {
  const Eigen::VectorXd time = crouchTimes(period);
  const pinocchio::Model& model = talos.getModel();
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(model.nv);
  Eigen::MatrixXd configurations(model.nq, time.size());
  for (Eigen::Index frame = 0; frame < time.size(); ++frame) {
    Eigen::VectorXd q = pinocchio::neutral(model);
    const double bend = 0.2 + 0.3 * (1. - std::cos(2. * std::acos(-1.) * time[frame] / period));
    for (const char* side : {"left", "right"}) {
      const auto set = [&](const char* number, double angle) {
        const std::string joint = std::string("leg_") + side + "_" + number + "_joint";
        q[model.joints[model.getJointId(joint)].idx_q()] = angle;
      };
      set("3", -bend), set("4", 2. * bend), set("5", -bend);
    }
    talos.computeDynamics(q, rest, rest);
    q.head<3>() -= talos.getContact("left_sole")->getSurfacePose().translation();
    configurations.col(frame) = q;
  }
  return configurations;
}
