// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>

namespace dynacom::internal {

/// The gradient (∂z/∂x, ∂z/∂y) of the plane that points lie in; zero where it is level, where there
/// are few points, or all are close together, or where they lie in no plane.
/// @param points  where something stands, 3 × points [m]
Eigen::Vector2d findGroundSlope(const Eigen::Matrix3Xd& points);

}  // namespace dynacom::internal
