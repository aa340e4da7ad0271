// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>

#include "dynacom/contact_set.hpp"

namespace dynacom::internal {

/// A point of the robot that may touch something, through a motion: one column per frame, in the
/// world's axes.
struct PointTrack {
  int limb;          ///< points of one limb, such as the corners of a sole, share a number
  Section friction;  ///< F of its forces
  bool is_body;      ///< whether it belongs to a link that is no contact
  Eigen::Ref<const Eigen::Matrix3Xd> position;  ///< of the point where it would touch [m]
  Eigen::Ref<const Eigen::Matrix3Xd> velocity;  ///< of the robot's matter there [m/s]
};

}  // namespace dynacom::internal
