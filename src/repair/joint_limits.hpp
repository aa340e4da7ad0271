// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <pinocchio/multibody.hpp>
#include <vector>

namespace dynacom::internal {

/// A joint of one number, and within what it may be.
struct LimitedJoint {
  Eigen::Index q, v;                     // where it is in configurations and velocities
  double lower, upper;                   // its positions; infinite where there is no limit
  double speed;                          // its largest; infinite where there is no limit
  double position_margin, speed_margin;  // by how much these are less than the joint's own
};

/// A limit of a joint, of its position in a frame or of the step from it to the next.
enum class LimitKind : unsigned char { Lower, Upper, Backward, Forward };
constexpr LimitKind kLimitKinds[] = {LimitKind::Lower, LimitKind::Upper, LimitKind::Backward,
                                     LimitKind::Forward};
constexpr bool isOfStep(LimitKind kind) { return kind >= LimitKind::Backward; }
/// Which way leads beyond it.
constexpr double getSign(LimitKind kind) {
  return kind == LimitKind::Upper || kind == LimitKind::Forward ? 1. : -1.;
}

/// The limits of a model's joints; those of joints of several numbers, and of such as turn without
/// end, are not looked at.
/// @param position_margin  how far within its range a joint is to stay, at most half of that
/// @param speed_margin     which part of its speed is left unused
std::vector<LimitedJoint> listLimits(const pinocchio::Model& model, double position_margin,
                                     double speed_margin);

/// How far a joint is beyond a limit, in its unit; negative within, and for the step from the last
/// frame.
double measureExcess(const LimitedJoint& joint, LimitKind kind, const Eigen::VectorXd& time,
                     const Eigen::MatrixXd& q, Eigen::Index frame);

/// The same of the joint's own limit, without the margin.
double measureOwnExcess(const LimitedJoint& joint, LimitKind kind, const Eigen::VectorXd& time,
                        const Eigen::MatrixXd& q, Eigen::Index frame);

/// The joint that is farthest beyond a limit in a motion.
struct LargestExcess {
  double size = 0.;  // zero where none is
  Eigen::Index frame = 0, v = -1;
};
LargestExcess findLargestExcess(const pinocchio::Model& model, const Eigen::VectorXd& time,
                                const Eigen::MatrixXd& q);

}  // namespace dynacom::internal
