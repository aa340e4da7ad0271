// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <pinocchio/multibody.hpp>

#include "dynacom/export.hpp"

namespace dynacom {

/// A robot's motion, one column per frame.
struct DYNACOM_EXPORT Motion {
  Eigen::VectorXd time;  ///< frames, strictly increasing [s]
  Eigen::MatrixXd q;     ///< configurations, nq × frames
  Eigen::MatrixXd v;     ///< velocities, nv × frames
  Eigen::MatrixXd a;     ///< accelerations, nv × frames

  Eigen::Index frames() const { return time.size(); }

  /// @throws std::invalid_argument naming the first array (and frame) that has another size than
  ///         the model or time says, or a number that is not finite, a quaternion whose norm is not
  ///         1, or a time that does not increase
  void validate(const pinocchio::Model& model) const;
};

/// The largest cut-off frequency that filterConfigurations() takes, as a part of the frame rate:
/// near a half, the filter's frequencies are squeezed together until little is left of it.
constexpr double kMaximalCutoff = 0.4;

/// The smallest cut-off frequency, as a part of the frame rate: of the coefficients of a lower one
/// rounding would leave fewer than seven digits.
constexpr double kMinimalCutoff = 1e-9;

/// Configurations without what is faster than a cut-off frequency: a Butterworth filter of fourth
/// order, forward and backward, so that nothing is delayed and the gain at the cut-off is ½.
///
/// Positions of free-flyers are filtered in the world, orientations and joints in the tangent space
/// at the filter's last output, which slides along the motion: for joints that are numbers this is
/// the ordinary filter. Beyond both ends, the motion is continued by its point reflection there,
/// plus a constant acceleration: three quarters of that of the parabola that fits the last half
/// period of the cut-off best. What the motion really did there, nobody knows: accelerations within
/// half a period of an end can be as wrong as they are large.
/// @param q       configurations, nq × frames
/// @param rate    frames per second, evenly spaced [Hz]
/// @param cutoff  from kMinimalCutoff rate to less than kMaximalCutoff rate [Hz]
/// @return nq × frames
/// @throws std::invalid_argument unless rate and cutoff are in their ranges, q has nq finite rows,
///         and its quaternions have norm 1
DYNACOM_EXPORT Eigen::MatrixXd filterConfigurations(const pinocchio::Model& model,
                                                    const Eigen::MatrixXd& q, double rate,
                                                    double cutoff);

/// The motion through given configurations: velocities and accelerations are those of the parabola
/// through a frame and its two neighbours, in the tangent space at the frame, so that they are as
/// Pinocchio wants them. At both ends it is the polynomial of third order through four frames.
/// @param time  frames, strictly increasing [s]
/// @param q     configurations, nq × frames
/// @throws std::invalid_argument as Motion::validate()
DYNACOM_EXPORT Motion differentiate(const pinocchio::Model& model, const Eigen::VectorXd& time,
                                    const Eigen::MatrixXd& q);

/// How noisy accelerations of the centre of mass are, if they are computed from every stride-th
/// configuration without a filter: the deviation of their noise, in standard gravities.
///
/// It is that of the difference of sixth order, which takes smooth motions away and leaves what is
/// random from frame to frame: per axis, the lower quartile of |Δ⁶c| as that of a normal
/// distribution with deviation √924 σ, then √6 ‖σ‖ / Δt². A quartile, because of three quarters of
/// them a contact may begin or end. Frames need not be evenly spaced: divided differences are
/// taken. They are a sample, up to 640, of where the configuration moves at least half as much as
/// in the root mean square over the motion.
/// @param time    frames, strictly increasing [s]
/// @param q       configurations, nq × frames
/// @param stride  of the frames that are looked at, >= 1
/// @return [g]; NaN if there are fewer than seven such frames, or the robot has no mass
/// @throws std::invalid_argument as Motion::validate(), or if the stride is out of its range
DYNACOM_EXPORT double estimateAccelerationNoise(const pinocchio::Model& model,
                                                const Eigen::VectorXd& time,
                                                const Eigen::MatrixXd& q, Eigen::Index stride = 1);

/// How well derivatives fit what they are the derivatives of.
struct DerivativeMismatch {
  /// ‖(q[k+1] ⊖ q[k])/Δt − v‖ as a part of ‖v‖, and ‖(v[k+1] − v[k])/Δt − a‖ of ‖a‖, both root mean
  /// squares over the steps, the worst of three: the free-flyer's linear and angular part, and the
  /// joints. v and a are those at the step's beginning, at its end, or their mean, whichever fits
  /// best, because integrators differ. What hardly moves is a part of 0.05 m/s or rad/s, and of
  /// 0.5 m/s² or rad/s², at least.
  double velocity, acceleration;
};

/// Compares a motion's derivatives with its differences.
/// @throws std::invalid_argument as Motion::validate()
DYNACOM_EXPORT DerivativeMismatch compareDerivatives(const pinocchio::Model& model,
                                                     const Motion& motion);

}  // namespace dynacom
