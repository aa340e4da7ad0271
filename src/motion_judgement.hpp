// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include "carrier.hpp"
#include "dynacom/motion_verdict.hpp"
#include "step_speeds.hpp"
#include "workers.hpp"

namespace dynacom::internal {

/// What a verdict is about, of which nothing is checked any more.
struct JudgedMotion {
  const Carrier& carrier;
  const Eigen::VectorXd& time;
  const StepSpeeds& steps;
  const std::vector<ContactMotion>& contacts;  // of the carrier
  const Eigen::MatrixXd& ground;               // contacts × frames, or × 1
  const MotionAnalysis& analysis;
  const std::vector<ContactMotion>& faces;  // contacts whose normals count: the robot's, whole
  const ContactSchedule::Matrix& active;    // whether they are, faces × frames
  Eigen::Array<bool, Eigen::Dynamic, 1> near_jumps;
  Eigen::Array<bool, Eigen::Dynamic, 1> unsure;  // near_jumps, and others
  bool is_too_short;                             // see kMinimalFrames
};

MotionVerdict judgeMotion(const JudgedMotion& judged, const VerdictSettings& settings,
                          Workers& workers);

/// The frames near steps that are faster than they may be: so near that their accelerations are
/// not known.
Eigen::Array<bool, Eigen::Dynamic, 1> findNearJumps(const Eigen::VectorXd& time,
                                                    const StepSpeeds& steps,
                                                    const VerdictSettings& settings);

/// Whether there are fewer frames than kMinimalFrames, and their derivatives were computed.
bool isTooShort(const Motion& motion, const RecordedMotion& recorded);

}  // namespace dynacom::internal
