// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <pinocchio/multibody.hpp>
#include <vector>

#include "dynacom/motion.hpp"

namespace dynacom::internal {

/// Whether the first joint is a free-flyer: the first seven components of configurations are then
/// its place and its quaternion, and the first six of velocities its own.
bool hasFreeFlyer(const pinocchio::Model& model);

/// @throws std::invalid_argument unless there is a frame, and times are finite and increase
void requireTime(const Eigen::VectorXd& time);

/// @throws std::invalid_argument unless there are so many configurations, finite and with
///         quaternions of norm 1
void requireConfigurations(const pinocchio::Model& model, const Eigen::MatrixXd& q,
                           Eigen::Index frames);

/// @throws std::invalid_argument unless values have that size, and are finite
void requireFrames(const char* name, const Eigen::MatrixXd& values, Eigen::Index size,
                   const char* unit, Eigen::Index frames);

/// Looks at motions frame by frame, fast, for what Motion::validate() would refuse, and says no
/// more than that.
class MotionCheck {
 public:
  explicit MotionCheck(const pinocchio::Model& model);

  /// Whether all arrays have the sizes of the model and the time, and time increases.
  bool hasSizes(const Motion& motion) const;
  /// Whether a configuration is finite, and its quaternions have norm 1.
  bool isConfiguration(const Eigen::Ref<const Eigen::VectorXd>& q) const;
  /// Whether all numbers of a frame are.
  bool isValid(const Motion& motion, Eigen::Index frame) const;

 private:
  // Components of a configuration whose squares must add up to one.
  struct Circle {
    Eigen::Index first, size;
  };

  const pinocchio::Model& model_;
  std::vector<Circle> circles_;
  bool is_known_ = true;  // whether there are no other conditions
};

}  // namespace dynacom::internal
