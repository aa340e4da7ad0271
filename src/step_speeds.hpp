// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <string>

#include "dynacom/motion_verdict.hpp"

namespace dynacom::internal {

/// How fast a robot moves from frame to frame.
struct StepSpeeds {
  /// The largest of all its parts' speeds in each step, each as a part of its greatest speed;
  /// frames − 1.
  Eigen::ArrayXd speed;
  /// Whose that is in the fastest step: "root", "root's orientation" or a joint's name; empty if
  /// nothing moves.
  std::string fastest;
};

/// Steps that are shorter than the median one count as that: clocks jitter, and frames that come
/// early have not moved faster.
/// @param time      frames, increasing [s]
/// @param q         configurations, nq × frames
/// @param settings  of which the three greatest speeds are looked at
StepSpeeds measureStepSpeeds(const pinocchio::Model& model, const Eigen::VectorXd& time,
                             const Eigen::MatrixXd& q, const VerdictSettings& settings);

}  // namespace dynacom::internal
