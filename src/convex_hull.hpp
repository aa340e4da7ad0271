// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

namespace dynacom::internal {

/// The distance of a point to the convex hull of others: 0 inside, infinite where there are none.
/// @param corners  of the hull and inside it, in any order, which is changed
double distanceToHull(const Eigen::Vector2d& point, std::vector<Eigen::Vector2d>& corners);

}  // namespace dynacom::internal
