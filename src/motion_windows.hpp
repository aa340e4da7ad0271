// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dynacom/motion_verdict.hpp"

namespace dynacom::internal {

/// What durations may lack through the rounding of times [s].
constexpr double kTimeRounding = 1e-9;

/// The windows of a motion, see MotionWindow.
/// @param time    frames, increasing [s]
/// @param beyond  frames at fault
/// @param jumps   frames at fault that no window may hold
/// @param unsure  frames of which forces are not judged, with which no window begins or ends
std::vector<MotionWindow> findWindows(const Eigen::VectorXd& time,
                                      const Eigen::Array<bool, Eigen::Dynamic, 1>& beyond,
                                      const Eigen::Array<bool, Eigen::Dynamic, 1>& jumps,
                                      const Eigen::Array<bool, Eigen::Dynamic, 1>& unsure,
                                      const VerdictSettings& settings);

}  // namespace dynacom::internal
