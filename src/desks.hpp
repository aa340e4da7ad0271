// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "dynacom/dyna_com.hpp"
#include "lane_analysis.hpp"

namespace dynacom::internal {

/// Where threads work on the motions of a robot: each has a copy of the robot for itself, as long
/// as it needs one, and the next one gets it after that. Copies are expensive: Pinocchio's Data has
/// megabytes.
class Desks {
 public:
  /// @param robot  must outlive this, and not change
  /// @param lanes  as AnalysisSettings::lanes
  explicit Desks(const DynaCoM& robot, int lanes = 1)
      : robot_(robot), lane_robot_(LaneRobot::make(robot, lanes)) {}

  const DynaCoM& robot() const { return robot_; }
  /// The robot as lanes know it; null where there are none for it.
  const LaneRobot* laneRobot() const { return lane_robot_ ? &*lane_robot_ : nullptr; }

  /// A copy whose contacts are placed by the model; what else it has done before is not undone, see
  /// clear(). It must not outlive this.
  std::shared_ptr<DynaCoM> take();

  /// Makes a robot forget what it has done but for its motion: no contact is active, and its next
  /// distribution does not depend on those before.
  static void clear(DynaCoM& robot);

 private:
  const DynaCoM& robot_;
  const std::optional<LaneRobot> lane_robot_;
  std::mutex mutex_;                            // of the next two
  std::vector<std::unique_ptr<DynaCoM>> free_;  // with room for all
  std::size_t copies_ = 0;
};

}  // namespace dynacom::internal
