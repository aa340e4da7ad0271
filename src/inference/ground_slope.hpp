// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

namespace dynacom::internal {

/// Where a contact stands: its parts that are at rest on the ground at one time.
struct Footing {
  std::size_t contact;
  Eigen::Matrix3Xd points;  ///< mean places of the parts, 3 × parts [m]
};

/// The ground's gradient (∂z/∂x, ∂z/∂y) under each footing; zero where it is level or not known.
///
/// Ground is made of levels and of planes that are not level. It is explained at the least cost:
/// what footings are off it, and so much for each level and each plane (minimum description length,
/// Rissanen 1978). Planes are tried through neighbours in time, and added as long as they pay, each
/// the one that saves most. A sole that is tilted shows nothing by itself: a plane is a slope if
/// the rise from footing to footing agrees, over half a metre.
/// @param footings  in the order of time, no contact's number being large
std::vector<Eigen::Vector2d> findGroundSlopes(const std::vector<Footing>& footings);

}  // namespace dynacom::internal
