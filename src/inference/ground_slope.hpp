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
/// A sole that is tilted shows nothing by itself: a plane is a slope if the rise from footing to
/// footing agrees. Either all footings lie in one plane; or soles that follow each other, of all
/// contacts or of one, lie in one and are tilted as it is. Points alone show no slope beside level
/// ground: who climbs stairs on points steps as on a plane.
/// @param footings  in the order of time
std::vector<Eigen::Vector2d> findGroundSlopes(const std::vector<Footing>& footings);

}  // namespace dynacom::internal
