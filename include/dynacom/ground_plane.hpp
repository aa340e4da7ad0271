// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <iosfwd>
#include <string>

#include "dynacom/centroidal.hpp"
#include "dynacom/export.hpp"

namespace dynacom {

/// A plane that a robot presses on, or any other on which one wants to know where it would: a
/// slope, a wall, a virtual plane between contacts of several heights. By default the world's
/// z = 0.
struct DYNACOM_EXPORT GroundPlane {
  /// Any point o of the plane, world [m].
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  /// Its normal, out of the ground, world; of any length, in what follows n is that of length 1.
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();

  /// @throws std::invalid_argument naming the first field out of its range: both must be finite,
  ///         and the normal not zero
  void validate() const;
  std::string to_string() const;
  bool operator==(const GroundPlane& other) const;
  bool operator!=(const GroundPlane& other) const { return !(*this == other); }
};

DYNACOM_EXPORT std::ostream& operator<<(std::ostream& out, const GroundPlane& plane);

/// Centre of pressure of a ground wrench on a plane, equation (21): the point of the plane about
/// which the wrench's moment is parallel to n,
///
///     p = c − h n + (n × τ − h f_t) / (n·f),   h = n·(c − o),   f_t = f − (n·f) n
///
/// On a horizontal plane it is that of computeFlatGroundCoP(). Of a wrench that contacts give
/// beside the plane, on others, it is the zero-moment point: nothing presses there.
/// @param groundWrench  (f, τ), τ about c
/// @param com           c, world [m]; here, any point that τ is about
/// @param minimalNormalForce  what n·f must have at least, > 0 [N]
/// @return p, world [m]; NaN where n·f is below that, or p is beyond the largest numbers
/// @throws std::invalid_argument unless the plane is valid
DYNACOM_EXPORT Eigen::Vector3d computeCoP(const CentroidalWrench& groundWrench,
                                          const Eigen::Vector3d& com, const GroundPlane& plane,
                                          double minimalNormalForce = kMinimalVerticalForce);

/// Centroidal moment pivot, equation (22): where the line along the ground's force through the CoM
/// meets a plane,
///
///     p = c − h f / (n·f),   h = n·(c − o)
///
/// which is where the centre of pressure would be if there were no moment about the CoM.
/// @param groundForce  f [N]
/// @param com          c, world [m]
/// @param minimalNormalForce  what n·f must have at least, > 0 [N]
/// @return p, world [m]; NaN where n·f is below that, or p is beyond the largest numbers
/// @throws std::invalid_argument unless the plane is valid
DYNACOM_EXPORT Eigen::Vector3d computeCMP(const Eigen::Vector3d& groundForce,
                                          const Eigen::Vector3d& com, const GroundPlane& plane,
                                          double minimalNormalForce = kMinimalVerticalForce);

}  // namespace dynacom
