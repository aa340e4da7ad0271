// SPDX-License-Identifier: BSD-2-Clause
// Which of the library's solvers a distribution has asked.
#pragma once

#include <array>
#include <cmath>

#include "dynacom/distribution_solver.hpp"
#include "dynacom/wrench_distribution.hpp"
#include "two_stage.hpp"

namespace dynacom_tests {

/// A contact of a result whose inequalities bound each component by a multiple of the normal force.
inline dynacom::DistributionProblem::Contact describeBox(
    const dynacom::DistributionResult::Contact& contact) {
  std::array<double, 6> limits = {};
  for (Eigen::Index row = 0; row < contact.A.rows(); ++row)
    for (Eigen::Index i = 0; i < contact.A.cols(); ++i)
      if (i != 2 && contact.A(row, i) > 0.)
        limits[std::size_t(i)] = -contact.A(row, 2) / contact.A(row, i);
  const Eigen::Vector2d friction(limits[0], limits[1]), half(limits[4], limits[3]);
  const auto section = dynacom::Section::rectangle(-friction, friction);
  dynacom::DistributionProblem::Contact described;
  described.set = contact.A.cols() == 3
                      ? dynacom::ContactSet::point(section)
                      : dynacom::ContactSet::surface(
                            section, dynacom::Section::rectangle(-half, half), limits[5]);
  described.weights = contact.weights;
  // With the same rounding, [p]× = [p]×R Rᵀ.
  const auto R = contact.NE.topLeftCorner<3, 3>(), of_moment = contact.NE.bottomLeftCorner<3, 3>();
  described.rotation = R;
  described.lever << of_moment.row(2).dot(R.row(1)), of_moment.row(0).dot(R.row(2)),
      of_moment.row(1).dot(R.row(0));
  return described;
}

/// How many solvers have been asked for a result of pyramids without warm start: 1, the one of all
/// sets; 2, the robust one, too; 3, this again with more digits.
/// They are asked again here, one after the other, until the iterations add up; 0 if they do not.
inline int countAskedSolvers(const dynacom::DistributionResult& result) {
  using Vector6 = dynacom::DistributionResult::Vector6;
  const int enough = dynacom::WrenchDistribution::kMaximalIterations;
  const double overall_weight =
      result.wrench_weights.cwiseProduct(result.wrench).norm() / result.wrench.norm();
  const double unit = result.scale * (1. / overall_weight);  // with the same rounding
  const Vector6 wrench = result.wrench / unit;
  const Vector6 weights = result.wrench_weights * (1. / overall_weight);

  dynacom::DistributionProblem problem;
  for (const auto& contact : result.contacts) problem.contacts.push_back(describeBox(contact));
  problem.wrench = result.wrench;
  problem.wrench_weights = result.wrench_weights;
  if (result.wrench_weights.cwiseProduct(result.wrench).norm() < result.scale)
    problem.minimal_scale = result.scale / result.wrench_weights.head<3>().maxCoeff();
  dynacom::DistributionSolver solver;
  int iterations = solver.solve(problem).iterations;
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
