// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/motion_analysis.hpp"

#include <cmath>
#include <utility>

#include "check.hpp"
#include "motion_check.hpp"
#include "motion_distribution.hpp"
#include "motion_sweep.hpp"

namespace dynacom {

void AnalysisSettings::validate() const {
  internal::requireField(omega >= 0. && std::isfinite(omega), "AnalysisSettings.omega",
                         "finite and >= 0 rad/s", omega);
  internal::requireField(threads >= 0, "AnalysisSettings.threads", ">= 0", threads);
  internal::requireField(lanes >= 1, "AnalysisSettings.lanes", ">= 1", lanes);
}

int countLanes(const DynaCoM& robot, int lanes) {
  if (!robot.isInitialized())
    throw NotReadyError("DynaCoM is used by countLanes before initialize()");
  internal::requireField(lanes >= 1, "lanes", ">= 1", lanes);
  const auto lane_robot =
      internal::LaneRobot::make(robot.getModel(), internal::describeCarrier(robot).contacts, lanes);
  return lane_robot ? lane_robot->lanes() : 1;
}

MotionAnalysis analyzeMotion(const DynaCoM& robot, const Motion& motion,
                             const ContactSchedule& schedule, const AnalysisSettings& settings) {
  settings.validate();
  if (!robot.isInitialized())
    throw NotReadyError("DynaCoM is used by analyzeMotion before initialize()");
  const pinocchio::Model& model = robot.getModel();
  const internal::Carrier carrier = internal::describeCarrier(robot);
  internal::DataPool data([&] { return std::make_unique<pinocchio::Data>(model); });
  const internal::MotionSweep sweep(model, carrier.contacts, settings.lanes, data);
  const internal::MotionDistribution distribution(carrier, settings.lanes);
  internal::Workers workers(settings.threads);

  if (!internal::hasSizes(model, motion)) internal::requireNumbers(model, motion);
  schedule.validate(motion.frames());
  for (const std::string& name : schedule.names) robot.getContact(name);
  std::vector<ContactMotion> contacts;
  MotionAnalysis analysis;
  sweep.run(motion, workers, contacts, &analysis);
  distribution.run(schedule, contacts, robot.getGroundHeight(), settings, workers, analysis,
                   settings.progress);
  return analysis;
}

}  // namespace dynacom
