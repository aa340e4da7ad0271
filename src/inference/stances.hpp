// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dynacom/detection_settings.hpp"
#include "point_track.hpp"

namespace dynacom::internal {

/// A time in which a point is at rest.
struct Rest {
  Eigen::Index first, behind;  ///< frames in which it is slow
  double height;               ///< median of its heights there [m]
  bool on_ground;              ///< whether something may carry it there
};

/// The rests of a point, and what belongs to which: until it is fastest between two, a point
/// belongs to the earlier one.
struct Rests {
  std::vector<Rest> list;
  std::vector<int> owner;  ///< for each frame an index of the list; −1 where there is none
};

/// What is known of contacts: of each, whether one or more of its points are active, or none.
struct KnownContacts {
  std::vector<std::uint32_t> masks;  ///< a bit for each point of a contact
  Eigen::Matrix<bool, Eigen::Dynamic, Eigen::Dynamic> active;  ///< contacts × frames
};

/// The scales of a motion's costs.
struct CostScales {
  double height;  ///< [m]
  double speed;   ///< [m/s]
  double force;   ///< [m g]
  double torque;  ///< [m g m]
};

/// Where points are at rest.
/// @param exact  whether the motion is free of noise
/// @param known  null where nothing is: what is active stands on the ground with its lowest points,
///               wherever that is
std::vector<Rests> findRests(const std::vector<PointTrack>& points, const Eigen::VectorXd& time,
                             bool exact, const DetectionSettings& settings,
                             const KnownContacts* known = nullptr);

/// The velocity of the ground [m/s]: the one that low points have that move level, where that is
/// far more frequent than rest; else zero.
Eigen::Vector3d findGroundVelocity(const std::vector<PointTrack>& points);

/// The scales of the costs, from what points do at rest.
CostScales findScales(const std::vector<PointTrack>& points, const std::vector<Rests>& rests,
                      const Eigen::VectorXd& time, const DetectionSettings& settings);

}  // namespace dynacom::internal
