// SPDX-License-Identifier: BSD-2-Clause
// Judges answers to wrench distributions, from the contacts' geometry alone.
#pragma once

#include <string>

#include "dynacom/wrench_distribution.hpp"
#include "random_problems.hpp"

namespace dynacom_tests {

/// What an answer is certified to be. Over the scale, or over the largest number compared.
struct Verdict {
  std::string error;         ///< what is wrong with it; empty if nothing
  double outside_cone = 0.;  ///< by how much a force is outside its cone, over scale or forces
  double residual = 0.;      ///< norm of the residual
  double residual_gap = 0.;  ///< by how much that could be above the least, at most
  double cost_gap = 0.;      ///< by which part of the cost that could be above the least, at most
};

/// Certifies forces by weak duality. Each contact's cone is spanned by its corners, so that the
/// largest value of a linear function over it is known in closed form, and all is computed in
/// extended precision. What the result says of multipliers is but a hint at which bounds to try.
Verdict check(const Problem& problem, const dynacom::DistributionResult& result);

}  // namespace dynacom_tests
