// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <optional>

#include "dynacom/contact_schedule.hpp"
#include "dynacom/motion.hpp"

namespace dynacom {

/// A motion as it was recorded, before any filter: one column per frame.
struct DYNACOM_EXPORT RecordedMotion {
  Eigen::VectorXd time;  ///< frames, strictly increasing [s]
  Eigen::MatrixXd q;     ///< configurations with quaternions of norm 1, nq × frames
  /// | norm − 1 | of the root's quaternions as they were before; frames, or none for zeros.
  Eigen::VectorXd quaternion_error = {};
  /// Velocities and accelerations, nv × frames each; without columns where they were not recorded.
  Eigen::MatrixXd v = {}, a = {};
  /// When which contact was active, if that was recorded.
  std::optional<ContactSchedule> schedule = std::nullopt;
};

/// Up to which DerivativeMismatch recorded velocities and accelerations are used: integrators
/// differ by more than rounding, and a landing is a step in velocity.
constexpr double kVelocityMismatch = 0.05, kAccelerationMismatch = 0.2;

/// How far a frame may be from where an even frame rate puts it, in frames, to be taken for there:
/// times are often rounded to milliseconds.
constexpr double kEvenTimes = 0.1;

/// The frame rate [Hz], where times [s] increase and are evenly spaced; else NaN, and of one frame.
DYNACOM_EXPORT double findFrameRate(const Eigen::VectorXd& time);

/// A motion with derivatives.
struct DerivedMotion {
  Motion motion;
  bool is_recorded;             ///< whether v and a are those that were recorded
  DerivativeMismatch mismatch;  ///< of those that were recorded; NaN where v or a was not
  double frame_rate;            ///< findFrameRate() [Hz]
  double cutoff;                ///< of the filter; 0 where there was none [Hz]
  /// By how much times were moved to where an even frame rate has them, for the derivatives [s].
  double time_error;
};

/// The motion that was recorded, if its velocities and accelerations agree with its configurations;
/// else that of the filtered configurations, see filterConfigurations() and differentiate().
/// @param cutoff  of the filter [Hz]; 0 for none
/// @throws std::invalid_argument as Motion::validate(); or if frames are to be filtered that are
///         not evenly spaced, or with a cut-off that filterConfigurations() does not take
DYNACOM_EXPORT DerivedMotion deriveMotion(const pinocchio::Model& model,
                                          const RecordedMotion& recorded, double cutoff);

/// The same, whatever velocities and accelerations were recorded.
DYNACOM_EXPORT DerivedMotion rederiveMotion(const pinocchio::Model& model,
                                            const RecordedMotion& recorded, double cutoff);

}  // namespace dynacom
