// SPDX-License-Identifier: BSD-2-Clause
// Which of the library's solvers a distribution has asked.
#pragma once

#include <vector>

#include "dual_newton.hpp"
#include "dynacom/wrench_distribution.hpp"
#include "two_stage.hpp"

namespace dynacom_tests {

/// How many solvers have been asked for a result without warm start: 1, Newton's method on the
/// dual; 2, the robust one, too; 3, this again with more digits.
/// They are asked again here, one after the other, until the iterations add up; 0 if they do not.
inline int countAskedSolvers(const dynacom::DistributionResult& result) {
  using Vector6 = dynacom::DistributionResult::Vector6;
  const int enough = dynacom::WrenchDistribution::kMaximalIterations;
  const double overall_weight =
      result.wrench_weights.cwiseProduct(result.wrench).norm() / result.wrench.norm();
  const double unit = result.scale * (1. / overall_weight);  // with the same rounding
  const Vector6 wrench = result.wrench / unit;
  const Vector6 weights = result.wrench_weights * (1. / overall_weight);
  const Vector6 target = result.wrench_weights.cwiseProduct(result.wrench) / result.scale;

  dynacom::internal::DualNewton newton;
  newton.reserve(result.contacts.size());
  std::vector<std::size_t> slots;
  for (const auto& contact : result.contacts) {
    slots.push_back(slots.size());
    newton.setContact(slots.back(), contact);
  }
  newton.setActive(slots, result.contacts);
  newton.solve(result.contacts, target, weights, false, enough);
  int iterations = newton.iterations();
  if (iterations == result.iterations) return 1;

  dynacom::internal::TwoStageSolver<double> robust;
  robust.setProblem(result.contacts, weights);
  robust.solve(wrench, enough);
  iterations += robust.iterations();
  if (iterations == result.iterations) return 2;

  dynacom::internal::TwoStageSolver<long double> accurate;
  accurate.setProblem(result.contacts, weights);
  accurate.solve(result.wrench.cast<long double>() / static_cast<long double>(unit), enough);
  iterations += accurate.iterations();
  return iterations == result.iterations ? 3 : 0;
}

}  // namespace dynacom_tests
