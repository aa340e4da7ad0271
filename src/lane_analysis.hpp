// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "dynacom/motion_analysis.hpp"
#include "lanes.hpp"

namespace dynacom::internal {

/// Several frames of a motion at once: a robot as lanes know it, and the shared object that this
/// processor can run.
class LaneRobot {
 public:
  /// Nothing, where there is no such object, or where the robot has joints or contacts of other
  /// kinds.
  /// @param lanes  at most so many frames at once
  static std::optional<LaneRobot> make(const DynaCoM& robot, int lanes);

  int lanes() const { return interface_->lanes; }

 private:
  friend class LaneAnalysis;
  LaneRobot() = default;

  const lanes::Interface* interface_ = nullptr;
  lanes::Robot robot_ = {};
  std::vector<lanes::Joint> joints_;
  std::vector<lanes::Contact> contacts_;
};

/// What a thread has for that.
class LaneAnalysis {
 public:
  /// @param robot                   must outlive this
  /// @param ground_height           for the centre of pressure on flat ground [m]
  /// @param flat_horizontal_ground  as AnalysisSettings::flat_horizontal_ground
  /// @throws std::bad_alloc
  LaneAnalysis(const LaneRobot& robot, double ground_height, bool flat_horizontal_ground);

  /// Analyzes some frames of a motion, as far as lanes do.
  /// @param result  with storage for all frames, and the contacts' active in place
  /// @param readiness  of the contacts, frames × contacts, or nothing; see ContactSchedule
  void run(const Motion& motion, Eigen::Index first, Eigen::Index frames,
           const Eigen::MatrixXd& readiness, MotionAnalysis& result);

  /// Finds how the contacts' frames lie and move in some frames of a motion.
  void place(const Motion& motion, Eigen::Index first, Eigen::Index frames);

  /// Of the last run() or place(), for a frame counted from its first.
  lanes::Outcome outcome(Eigen::Index frame) const {
    return outcomes_[static_cast<std::size_t>(frame)];
  }
  /// Placement of a contact's frame in the world; after run() where the contact is active.
  pinocchio::SE3 placement(std::size_t contact, Eigen::Index frame) const;
  /// After place(): the velocity of its origin, and its angular velocity, in the world's axes.
  pinocchio::Motion velocity(std::size_t contact, Eigen::Index frame) const;

 private:
  std::size_t index(std::size_t contact, Eigen::Index frame) const {
    return static_cast<std::size_t>(frame) * rows_.size() + contact;
  }

  const lanes::Interface& interface_;
  std::unique_ptr<void, void (*)(void*)> analysis_;
  std::vector<lanes::ContactRows> rows_;
  std::vector<lanes::Outcome> outcomes_;
  std::vector<double> placements_, velocities_;
};

}  // namespace dynacom::internal
