// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "dynacom/motion_verdict.hpp"

namespace dynacom {

/// What one contact does in a motion as a whole. Forces are parts of the robot's weight m g; NaN
/// stands for what does not exist.
struct ContactStatistics {
  std::string name;
  double active_share;               ///< of the frames
  double weight_share;               ///< mean of its vertical force
  double weight_share_while_active;  ///< the same over the frames where it is active
  double largest_vertical_force;
  double largest_friction_usage;  ///< see DynaCoM::getContactFrictionUsage()
  double largest_cone_usage;      ///< see computeConeUsage()
  double least_cop_margin;        ///< see DynaCoM::getContactCoPMargin() [m]
};

/// What a link does in it that touches something besides the contacts.
struct BodyStatistics {
  std::string link;
  double active_share;  ///< of the frames
  double weight_share;  ///< mean of its vertical force
  double largest_vertical_force;
};

/// A motion in a few numbers. Forces are parts of the robot's weight m g, moments of m g times a
/// metre, unless they say otherwise.
struct DYNACOM_EXPORT MotionStatistics {
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  Eigen::Index frames;
  double mass;    ///< of the robot [kg]
  double weight;  ///< m g, with the gravity that the robot has, 9.81 m/s² if it has none [N]
  std::map<DistributionStatus, Eigen::Index> statuses;  ///< how many frames have which
  double mean_vertical_force;  ///< of the ground's; 1 for a motion that begins and ends at rest
  /// What part of that ends in momentum, (ċ_z(end) − ċ_z(begin)) / (g duration): a clip may begin
  /// in a fall.
  double momentum_change;
  /// Root mean squares of the residual's force and moment, about the CoM.
  double residual_force_rms, residual_torque_rms;
  /// The mean residual, force [N] and moment [N·m], over the frames in which a contact is active
  /// and accelerations are known (MotionVerdict::unsure); zero if there is none. In the axes of the
  /// free-flyer's heading, forward, left and up, or the world's where there is no free-flyer.
  Vector6 mean_residual;
  std::vector<ContactStatistics> contacts;  ///< as MotionAnalysis::contacts
  std::vector<BodyStatistics> bodies;       ///< as MotionAnalysis::bodies
  /// Share of the frames in which any of these is active, and the mean over these frames of the
  /// vertical force of all of them; zero if there are none.
  double bodies_active_share, bodies_weight_share_while_active;

  /// Which part of the frames has a status.
  double share(DistributionStatus status) const;
  /// Whether the mean residual may be that of a load which nobody has told of: it is large enough,
  /// and much the same all the time, but no larger than what is carried, and pulls along the ground
  /// by no more than a load does. Not where a number is NaN.
  bool mayBeLoad() const;
};

/// How much of its friction cone a contact uses in each frame: ‖(f_x, f_y)‖ over μ f_z, 1 on the
/// cone. The friction pyramid around it, in which forces lie, allows √2 on its diagonals. NaN,
/// infinite and zero where friction_usage is.
/// @return one number per frame
DYNACOM_EXPORT Eigen::VectorXd computeConeUsage(const MotionAnalysis::Contact& contact);

/// Sums up what was found of a motion.
/// @param motion    for which both were computed
/// @param analysis  of analyzeMotion()
/// @param verdict   of judgeMotion()
/// @throws std::invalid_argument if sizes differ; NotReadyError before the robot's initialize()
DYNACOM_EXPORT MotionStatistics summarizeMotion(const DynaCoM& robot, const Motion& motion,
                                                const MotionAnalysis& analysis,
                                                const MotionVerdict& verdict);

/// How computed values differ from measured ones, component by component, over the columns where
/// all measured ones are finite.
struct MeasuredDifference {
  Eigen::Index frames;          ///< how many columns these are; if there are none, all else is NaN
  Eigen::VectorXd bias;         ///< mean of computed − measured
  Eigen::VectorXd rms;          ///< root mean square of that
  Eigen::VectorXd correlation;  ///< Pearson's; NaN where one of both does not change
};

/// Compares forces that were computed with those that were measured.
/// @param computed, measured  one column per frame
/// @throws std::invalid_argument if sizes differ
DYNACOM_EXPORT MeasuredDifference compareMeasured(const Eigen::MatrixXd& computed,
                                                  const Eigen::MatrixXd& measured);

}  // namespace dynacom
