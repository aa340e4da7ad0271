// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <pinocchio/multibody.hpp>
#include <vector>

namespace dynacom::internal {

/// The steps from each of several configurations to the next, in the tangent space at the former:
/// pinocchio::difference(), in a fraction of the time where most joints are numbers.
class ConfigurationSteps {
 public:
  explicit ConfigurationSteps(const pinocchio::Model& model);

  /// @param q  configurations, nq × frames
  /// @return nv × (frames − 1)
  Eigen::MatrixXd compute(const Eigen::MatrixXd& q) const;

 private:
  // Components that belong together: of configurations, and of steps.
  struct Range {
    Eigen::Index q, nq, v, nv;
  };

  const Eigen::Index nv_;
  std::vector<Range> numbers_;  // of which steps are differences
  std::vector<Range> curved_;   // all others
  pinocchio::Model model_;      // of nothing but these
};

}  // namespace dynacom::internal
