// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/missing_support.hpp"

#include <algorithm>
#include <array>

#include "check.hpp"
#include "motion_windows.hpp"
#include "nan.hpp"
#include "standard_gravity.hpp"

namespace dynacom {

namespace {

using Mask = Eigen::Array<bool, Eigen::Dynamic, 1>;

// What is measured of forces: where one is beyond its limit, something is missing.
constexpr std::array kForceFaults = {MotionFault::ResidualForce, MotionFault::ResidualTorque,
                                     MotionFault::CoPOutside, MotionFault::FlightWithSupportNeeded};

// Frames beyond a limit for so long [s] and more, but for shorter interruptions.
std::vector<MissingSupport::Interval> findIntervals(const Eigen::VectorXd& time, const Mask& beyond,
                                                    double least) {
  const Eigen::Index frames = time.size();
  const auto endOf = [&](Eigen::Index frame) {
    if (frame + 1 < frames) return time[frame + 1];
    return frames > 1 ? 2. * time[frame] - time[frame - 1] : time[frame];
  };
  const auto isLong = [&](double begin, double end) {
    return end - begin >= least - internal::kTimeRounding;
  };
  std::vector<MissingSupport::Interval> found;
  for (Eigen::Index frame = 0; frame < frames; ++frame) {
    if (!beyond[frame]) continue;
    const bool is_next = !found.empty() && found.back().last == frame - 1;
    if (found.empty() || (!is_next && isLong(endOf(found.back().last), time[frame])))
      found.push_back({frame, frame, time[frame], time[frame]});
    found.back().last = frame;
    found.back().end = time[frame];
  }
  const auto isShort = [&](const MissingSupport::Interval& interval) {
    return !isLong(interval.begin, endOf(interval.last));
  };
  found.erase(std::remove_if(found.begin(), found.end(), isShort), found.end());
  return found;
}

void requireFitting(const MotionAnalysis& analysis, const MotionVerdict& verdict) {
  const Eigen::Index frames = verdict.unsure.size();
  internal::requireSize("analysis", analysis.time.size(), frames, "frames (as the verdict)");
  internal::requireSize("analysis", analysis.residual.cols(), frames, "frames (as the verdict)");
  for (const MotionFault fault : kForceFaults)
    internal::requireSize("verdict", verdict[fault].measured.size(), frames, "frames");
}

}  // namespace

std::optional<MissingSupport> findMissingSupport(const DynaCoM& robot,
                                                 const MotionAnalysis& analysis,
                                                 const MotionVerdict& verdict,
                                                 const VerdictSettings& settings) {
  if (!robot.isInitialized())
    throw NotReadyError("DynaCoM is used by findMissingSupport before initialize()");
  settings.validate();
  requireFitting(analysis, verdict);
  if (verdict.outcome == MotionOutcome::Unknown) return std::nullopt;
  const Eigen::Index frames = verdict.unsure.size();
  Mask beyond = Mask::Constant(frames, false);
  for (const MotionFault fault : kForceFaults)
    beyond = beyond || verdict[fault].measured.array() > settings[fault].limit;
  MissingSupport missing = {};
  missing.intervals = findIntervals(analysis.time, beyond, settings.interruption);
  if (missing.intervals.empty()) return std::nullopt;

  const double weight = robot.getMass() * internal::findUnitGravity(robot.getSettings().gravity);
  const Eigen::VectorXd& outside = verdict[MotionFault::CoPOutside].measured;
  for (const MissingSupport::Interval& interval : missing.intervals) {
    const Eigen::Index size = interval.last - interval.first + 1;
    missing.frames += size;
    missing.cop_distance =
        std::max(missing.cop_distance, outside.segment(interval.first, size).maxCoeff());
    for (Eigen::Index frame = interval.first; frame <= interval.last; ++frame) {
      if (verdict.unsure[frame]) continue;
      const auto residual = analysis.residual.col(frame);
      missing.force =
          std::max(missing.force, internal::orInfinity(residual.head<3>().norm() / weight));
      missing.torque =
          std::max(missing.torque, internal::orInfinity(residual.tail<3>().norm() / weight));
    }
  }
  missing.share = double(missing.frames) / double(frames);
  return missing;
}

}  // namespace dynacom
