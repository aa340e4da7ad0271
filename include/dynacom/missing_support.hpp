// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "dynacom/motion_verdict.hpp"

namespace dynacom {

/// When and by how much that which carries cannot give what a motion needs: a contact is missing,
/// or the motion is out of reach of those there are.
struct MissingSupport {
  /// Frames that follow each other.
  struct Interval {
    Eigen::Index first, last;  ///< both included
    double begin, end;         ///< their times [s]
  };

  std::vector<Interval> intervals;  ///< in their order, one at least
  Eigen::Index frames;              ///< in intervals
  double share;                     ///< that these are of the motion's frames
  /// Largest norms of the residual's force [m g] and moment [m g m] over the frames of intervals
  /// whose accelerations are known (MotionVerdict::unsure).
  double force, torque;
  double cop_distance;  ///< largest measured MotionFault::CoPOutside in intervals [m]; infinite
                        ///< where nothing is known of the centre, as the two above
};

/// Finds what is missing. Frames count that are beyond the limit of a fault that is about forces:
/// ResidualForce, ResidualTorque, CoPOutside or FlightWithSupportNeeded. Intervals are as long as
/// VerdictSettings::interruption at least, and have interruptions in them that are shorter than
/// that. Each frame lasts until the next one, the last one as long as the one before it.
/// @param analysis  for which `verdict` was found
/// @param verdict   of judgeMotion() with the same settings
/// @return nothing where nothing is missing, and where the outcome is Unknown
/// @throws std::invalid_argument if settings are not valid, or sizes differ; NotReadyError before
///         the robot's initialize()
DYNACOM_EXPORT std::optional<MissingSupport> findMissingSupport(
    const DynaCoM& robot, const MotionAnalysis& analysis, const MotionVerdict& verdict,
    const VerdictSettings& settings = {});

}  // namespace dynacom
