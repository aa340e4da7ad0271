// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "carrier.hpp"
#include "dynacom/motion_analysis.hpp"
#include "lane_analysis.hpp"
#include "pool.hpp"
#include "workers.hpp"

namespace dynacom::internal {

/// The first step of an analysis, which knows nothing of schedules and grounds: what a motion needs
/// of them, and how contacts lie and move.
class MotionSweep {
 public:
  /// @param model  must outlive this, as must `data`, which is the model's
  /// @param lanes  as AnalysisSettings::lanes
  MotionSweep(const pinocchio::Model& model, std::vector<FixedContact> contacts, int lanes,
              DataPool& data);

  /// How many lanes it has, see countLanes().
  int lanes() const { return lane_robot_ ? lane_robot_->lanes() : 1; }

  /// @param contacts  becomes computeContactMotions() of these contacts
  /// @param dynamics  is given its time, and from com to ground_torque what MotionAnalysis says,
  ///                  nothing of contacts; null if nobody wants that: then the motion must be valid
  /// @param progress  as that of forEachBlock()
  /// @throws std::invalid_argument as requireNumbers(); a frame whose quaternions have another norm
  ///         than 1 is NaN
  void run(const Motion& motion, Workers& workers, std::vector<ContactMotion>& contacts,
           MotionAnalysis* dynamics,
           const std::function<void(Eigen::Index)>& progress = nullptr) const;

 private:
  class Worker;

  const pinocchio::Model& model_;
  const std::vector<FixedContact> contacts_;
  DataPool& data_;
  const std::optional<LaneRobot> lane_robot_;
};

}  // namespace dynacom::internal
