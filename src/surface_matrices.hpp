// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>

#include "dynacom/surface_options.hpp"

namespace dynacom::internal {

/// The inequalities of a contact's set, as ContactBase has them.
struct SurfaceMatrices {
  Eigen::MatrixXd uni_A, fri_A;
  Eigen::VectorXd uni_b, fri_b;
};

/// Those of a point or a surface: unilaterality, bounds of the normal force and the edges of where
/// pressure may be; friction, and a bound on the yaw moment.
/// @param places  where pressure may be, nothing for a point
SurfaceMatrices listInequalities(const ContactSet& set, const Section* places);

}  // namespace dynacom::internal
