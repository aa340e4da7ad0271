// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "carrier.hpp"
#include "dynacom/motion_analysis.hpp"
#include "lanes.hpp"

namespace dynacom::internal {

/// Both steps of an analysis for several frames of a motion at once, by the shared object that this
/// processor can run. Descriptions are made once, and each thread has workers of its own.

/// A robot that moves as lanes know it.
class LaneRobot {
 public:
  /// Nothing, where there is no such object, or where the robot has joints or contacts of other
  /// kinds.
  /// @param lanes  at most so many frames at once
  static std::optional<LaneRobot> make(const pinocchio::Model& model,
                                       const std::vector<FixedContact>& contacts, int lanes);

  int lanes() const { return interface_->lanes; }

 private:
  friend class LaneSweeper;
  LaneRobot() = default;

  const lanes::Interface* interface_ = nullptr;
  int nq_ = 0, nv_ = 0;
  Eigen::Vector3d gravity_ = Eigen::Vector3d::Zero();
  std::vector<lanes::Joint> joints_;
  std::vector<lanes::Fixture> contacts_;
};

/// What a motion needs, and how contacts lie and move.
class LaneSweeper {
 public:
  /// @throws std::bad_alloc
  explicit LaneSweeper(const LaneRobot& robot);

  /// @param dynamics  where there is room for what the motion needs; null if nobody wants that
  /// @param contacts  where there is room for how the contacts lie and move; rotations of
  ///                  contacts that have the world's axes are left as they are
  void run(const Motion& motion, Eigen::Index first, Eigen::Index frames, MotionAnalysis* dynamics,
           std::vector<ContactMotion>& contacts);

  /// Whether a frame of the last run(), counted from its first, is known; else what was written of
  /// it is nothing.
  bool isKnown(Eigen::Index frame) const { return known_[frame]; }

 private:
  const lanes::Interface& interface_;
  std::unique_ptr<void, void (*)(void*)> worker_;
  std::vector<lanes::PlaceRows> rows_;
  std::vector<bool> is_aligned_;  // contacts that have the world's axes
  Eigen::Array<bool, Eigen::Dynamic, 1> known_;
};

/// Contacts that share wrenches as lanes know it.
class LaneCarrier {
 public:
  /// Nothing, where there is no such object, or where there are contacts of other kinds.
  static std::optional<LaneCarrier> make(const Carrier& carrier, int lanes);

 private:
  friend class LaneDistributor;
  LaneCarrier() = default;

  const lanes::Interface* interface_ = nullptr;
  lanes::Carrier carrier_ = {};
  std::vector<lanes::Contact> contacts_;
  std::vector<bool> is_aligned_;
};

/// How contacts share what a motion needs, in frames that prove their answers in lanes.
class LaneDistributor {
 public:
  /// @param ground_height           for the centre of pressure on flat ground [m]
  /// @param flat_horizontal_ground  as AnalysisSettings::flat_horizontal_ground
  /// @throws std::bad_alloc
  LaneDistributor(const LaneCarrier& carrier, double ground_height, bool flat_horizontal_ground);

  /// @param contacts   how they lie
  /// @param readiness  of the contacts, frames × contacts, or nothing; see ContactSchedule
  /// @param result     with what the motion needs, when contacts are active, and room for the rest
  void run(Eigen::Index first, Eigen::Index frames, const std::vector<ContactMotion>& contacts,
           const Eigen::MatrixXd& readiness, MotionAnalysis& result);

  /// The answer of a frame of the last run(), counted from its first; nothing where it is left.
  std::optional<DistributionStatus> status(Eigen::Index frame) const;

 private:
  const lanes::Interface& interface_;
  std::unique_ptr<void, void (*)(void*)> worker_;
  std::vector<lanes::ContactRows> rows_;
  const std::vector<bool>& is_aligned_;
  std::vector<lanes::Answer> answers_;
};

}  // namespace dynacom::internal
