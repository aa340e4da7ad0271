// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "carrier.hpp"
#include "dynacom/motion_analysis.hpp"
#include "lane_analysis.hpp"
#include "pool.hpp"
#include "workers.hpp"

namespace dynacom::internal {

/// The second step of an analysis: how contacts share what a motion needs, while a schedule says
/// that they are active. It knows nothing of the robot but what carries it.
class MotionDistribution {
 public:
  /// @param carrier  must outlive this
  /// @param lanes    as AnalysisSettings::lanes
  MotionDistribution(const Carrier& carrier, int lanes);
  ~MotionDistribution();

  /// @param schedule       must be valid; a contact without schedule is never active
  /// @param contacts       how the carrier's contacts lie, of MotionSweep::run()
  /// @param ground_height  of the centre of pressure and the pendulum [m]
  /// @param settings       of which threads, lanes and progress are not looked at
  /// @param analysis       with the dynamics of MotionSweep::run(); is given all the rest
  /// @param progress       as that of forEachBlock()
  void run(const ContactSchedule& schedule, const std::vector<ContactMotion>& contacts,
           double ground_height, const AnalysisSettings& settings, Workers& workers,
           MotionAnalysis& analysis,
           const std::function<void(Eigen::Index)>& progress = nullptr) const;

 private:
  class Worker;
  struct Solver;

  const Carrier& carrier_;
  const std::optional<LaneCarrier> lane_carrier_;
  mutable Pool<Solver> solvers_;  // for what the lanes leave
};

}  // namespace dynacom::internal
