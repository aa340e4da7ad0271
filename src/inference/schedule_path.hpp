// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "stances.hpp"

namespace dynacom::internal {

/// The wrench that is needed, in each frame.
struct WrenchTrack {
  Eigen::Ref<const Eigen::Matrix3Xd> com;            ///< c [m]
  Eigen::Ref<const Eigen::Matrix3Xd> force, torque;  ///< about c [N], [N·m]
};

/// The cheapest schedule of points, and how sure it is.
struct SchedulePath {
  std::vector<std::uint32_t> sets;  ///< in each frame a bit for each point that is active
  Eigen::MatrixXd probability;      ///< that a point is active; points × frames
  Eigen::Matrix2Xd missing;         ///< what they cannot give: norms of force [m g], moment [m g m]
};

/// How many frames are looked at together at most, and how many of these once more with the next
/// ones: memory is needed for so many, where contacts are never certain.
struct PathPieces {
  Eigen::Index longest = 8000, overlap = 1000;
};

/// Finds the sets of active points through time that cost least: what where they are costs, what
/// they cannot give of the wrench, and what changes cost. By dynamic programming (Viterbi), over
/// sets that take of each limb its cheapest points; what sets cannot give is computed only where a
/// path that might be the cheapest passes.
/// @param weight  m g [N]
/// @param known   null where nothing is
SchedulePath findSchedulePath(const std::vector<PointTrack>& points,
                              const std::vector<Rests>& rests, const CostScales& scales,
                              const WrenchTrack& wrench, double weight, const Eigen::VectorXd& time,
                              const DetectionSettings& settings,
                              const KnownContacts* known = nullptr, const PathPieces& pieces = {});

}  // namespace dynacom::internal
