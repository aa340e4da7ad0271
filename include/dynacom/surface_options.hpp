// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <iosfwd>
#include <limits>
#include <pinocchio/spatial.hpp>

#include "dynacom/contact_set.hpp"

namespace dynacom {

/// What of Coulomb's cone, ‖(f_x, f_y)‖ ≤ μ f_z, a contact uses.
enum class FrictionModel {
  OuterPyramid,  ///< the pyramid around it, |f_x|, |f_y| ≤ μ f_z: up to √2 μ f_z on its diagonals
  InnerPyramid,  ///< that within it, |f_x|, |f_y| ≤ μ f_z / √2
  Facets,        ///< a pyramid around it of more sides, Section::facets()
  Cone           ///< the cone itself
};

/// The value's name, as written above.
DYNACOM_EXPORT const char* to_string(FrictionModel model);
DYNACOM_EXPORT std::ostream& operator<<(std::ostream& out, FrictionModel model);

/// What the settings of points and surfaces have in common. The defaults are those of a pyramid
/// without bounds whose surface is the frame's.
struct DYNACOM_EXPORT SurfaceOptions {
  FrictionModel friction = FrictionModel::OuterPyramid;
  int facets = 8;           ///< of FrictionModel::Facets, from 4 to 64
  double facet_angle = 0.;  ///< of its first side's normal, from the x axis [rad]
  /// Between these is the normal force: 0 ≤ least ≤ greatest [N].
  double least_normal_force = 0.;
  double greatest_normal_force = std::numeric_limits<double>::infinity();
  /// Of the surface in the contact's frame: a sole that is turned against it, say.
  pinocchio::SE3 placement = pinocchio::SE3::Identity();

  /// D of ContactSet.
  Section makeFriction(double mu) const;
  /// What of a force (f_x, f_y) the model compares with μ f_z: its length for a cone.
  double findTangential(const Eigen::Vector2d& force) const;

  bool operator==(const SurfaceOptions& other) const;
};

}  // namespace dynacom
