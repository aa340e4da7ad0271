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

/// @param name  in messages
/// @throws std::invalid_argument unless there are so many configurations, finite and with
///         quaternions of norm 1
void requireConfigurations(const pinocchio::Model& model, const Eigen::MatrixXd& q,
                           Eigen::Index frames, const char* name = "q");

/// Motion::validate(), but for the norms of quaternions.
/// @throws std::invalid_argument
void requireNumbers(const pinocchio::Model& model, const Motion& motion);

/// @throws std::invalid_argument unless values have that size, and are finite
void requireFrames(const char* name, const Eigen::MatrixXd& values, Eigen::Index size,
                   const char* unit, Eigen::Index frames);

/// What makes numbers a configuration.
class ConfigurationCheck {
 public:
  explicit ConfigurationCheck(const pinocchio::Model& model);

  /// Whether quaternions, and all others whose squares must add up to one, have norm 1. Allocates
  /// nothing.
  /// @param model  the same
  /// @param q      nq
  bool isNormalized(const pinocchio::Model& model,
                    const Eigen::Ref<const Eigen::VectorXd>& q) const;

 private:
  // Components of a configuration whose squares must add up to one.
  struct Circle {
    Eigen::Index first, size;
  };

  std::vector<Circle> circles_;
  bool is_known_ = true;  // whether there are no other conditions
};

/// Whether all arrays have the sizes of the model and the time, and time increases.
bool hasSizes(const pinocchio::Model& model, const Motion& motion);

/// Whether all numbers of a frame are finite.
bool isFinite(const Motion& motion, Eigen::Index frame);

}  // namespace dynacom::internal
