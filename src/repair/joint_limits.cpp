// SPDX-License-Identifier: BSD-2-Clause
#include "joint_limits.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace dynacom::internal {

namespace {
constexpr double kNone = std::numeric_limits<double>::infinity();
}

std::vector<LimitedJoint> listLimits(const pinocchio::Model& model, double position_margin,
                                     double speed_margin) {
  // What robot descriptions have where there is no limit.
  constexpr double kHuge = 1e6;
  std::vector<LimitedJoint> joints;
  for (pinocchio::JointIndex index = 1; index < pinocchio::JointIndex(model.njoints); ++index) {
    const auto& joint = model.joints[index];
    if (joint.nq() != 1 || joint.nv() != 1) continue;
    LimitedJoint limited = {joint.idx_q(),
                            joint.idx_v(),
                            model.lowerPositionLimit[joint.idx_q()],
                            model.upperPositionLimit[joint.idx_q()],
                            model.upperVelocityLimit[joint.idx_v()],
                            0.,
                            0.};
    const bool is_lowered = std::abs(limited.lower) < kHuge,
               is_raised = std::abs(limited.upper) < kHuge;
    // Where both are the same number, there is no range, as in descriptions without limits.
    const bool is_range = limited.upper > limited.lower;
    limited.position_margin = is_lowered && is_raised
                                  ? std::min(position_margin, 0.5 * (limited.upper - limited.lower))
                                  : position_margin;
    limited.lower = is_range && is_lowered ? limited.lower + limited.position_margin : -kNone;
    limited.upper = is_range && is_raised ? limited.upper - limited.position_margin : kNone;
    if (limited.speed > 0. && limited.speed < kHuge) {
      limited.speed_margin = speed_margin * limited.speed;
      limited.speed -= limited.speed_margin;
    } else {
      limited.speed = kNone;
    }
    joints.push_back(limited);
  }
  return joints;
}

double measureExcess(const LimitedJoint& joint, LimitKind kind, const Eigen::VectorXd& time,
                     const Eigen::MatrixXd& q, Eigen::Index frame) {
  if (kind == LimitKind::Lower) return joint.lower - q(joint.q, frame);
  if (kind == LimitKind::Upper) return q(joint.q, frame) - joint.upper;
  if (frame + 1 >= time.size()) return -kNone;
  const double step = q(joint.q, frame + 1) - q(joint.q, frame);
  return getSign(kind) * step - joint.speed * (time[frame + 1] - time[frame]);
}

double measureOwnExcess(const LimitedJoint& joint, LimitKind kind, const Eigen::VectorXd& time,
                        const Eigen::MatrixXd& q, Eigen::Index frame) {
  const double excess = measureExcess(joint, kind, time, q, frame);
  if (!isOfStep(kind)) return excess - joint.position_margin;
  if (frame + 1 >= time.size()) return excess;
  return excess - joint.speed_margin * (time[frame + 1] - time[frame]);
}

LargestExcess findLargestExcess(const pinocchio::Model& model, const Eigen::VectorXd& time,
                                const Eigen::MatrixXd& q) {
  LargestExcess largest;
  for (const LimitedJoint& joint : listLimits(model, 0., 0.))
    for (Eigen::Index frame = 0; frame < q.cols(); ++frame)
      for (const LimitKind kind : kLimitKinds)
        if (const double size = measureExcess(joint, kind, time, q, frame); size > largest.size)
          largest = {size, frame, joint.v};
  return largest;
}

}  // namespace dynacom::internal
