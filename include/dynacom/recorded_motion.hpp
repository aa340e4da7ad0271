// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>

#include "dynacom/contact_schedule.hpp"
#include "dynacom/motion.hpp"

namespace dynacom {

/// A motion as it was recorded, before any filter: one column per frame.
struct DYNACOM_EXPORT RecordedMotion {
  Eigen::VectorXd time;  ///< frames, strictly increasing [s]
  Eigen::MatrixXd q;     ///< configurations with quaternions of norm 1, nq × frames
  /// Velocities and accelerations, nv × frames each; without columns where they were not recorded.
  Eigen::MatrixXd v = {}, a = {};
  /// When which contact was active, if that was recorded.
  std::optional<ContactSchedule> schedule = std::nullopt;
  /// Whether it is known to be free of noise, as what repair has written: kAutomaticCutoff stands
  /// for no filter then.
  bool is_exact = false;
};

/// Up to which DerivativeMismatch recorded velocities and accelerations are used: integrators
/// differ by more than rounding, and a landing is a step in velocity.
constexpr double kVelocityMismatch = 0.05, kAccelerationMismatch = 0.2;

/// How far a frame may be from where an even frame rate puts it, in frames, to be taken for there:
/// times are often rounded to milliseconds.
constexpr double kEvenTimes = 0.1;

/// The frame rate [Hz], where times [s] increase and are evenly spaced; else NaN, and of one frame.
DYNACOM_EXPORT double findFrameRate(const Eigen::VectorXd& time);

/// Up to which noise of the accelerations, see estimateAccelerationNoise(), a motion is exact, and
/// needs no filter [g]. Of simulations and plans it is 0.004 at most, of what was measured or
/// retargeted 0.02 at least, at 30 to 200 frames a second.
constexpr double kExactNoise = 0.01;

/// What stands for a cut-off that deriveMotion() chooses.
constexpr double kAutomaticCutoff = std::numeric_limits<double>::quiet_NaN();

/// The cut-off that is chosen for motions that are not exact [Hz], and which part of the frame rate
/// it is at most.
constexpr double kMeasuredCutoff = 6., kMeasuredCutoffPart = 0.3;

/// The frame rate at which noise is also looked at, where frames come faster [Hz]: what was rounded
/// is noisy at a high rate only, and what was interpolated at a low one only. And the cut-off for
/// what is exact at that rate and at no higher one [Hz].
constexpr double kThinnedRate = 100., kRoundedCutoff = 40.;

/// What a motion that was filtered must need of its supports beyond its weight, near an end, for
/// the accelerations there to be unsure: as root mean squares over one period of the cut-off,
/// ‖m c̈‖ [m g] or ‖L̇‖ [m g m].
constexpr double kUnsureForce = 0.03, kUnsureTorque = 0.01;

/// A motion with derivatives.
struct DYNACOM_EXPORT DerivedMotion {
  Motion motion;
  bool is_recorded;             ///< whether v and a are those that were recorded
  DerivativeMismatch mismatch;  ///< of those that were recorded; NaN where v or a was not
  double frame_rate;            ///< findFrameRate() [Hz]
  double cutoff;                ///< of the filter; 0 where there was none [Hz]
  /// By how much times were moved to where an even frame rate has them, for the derivatives [s].
  double time_error;
  /// Whether the cut-off, or that there is none, was chosen for the noise below.
  bool is_automatic;
  bool is_told_exact;  ///< RecordedMotion::is_exact
  /// estimateAccelerationNoise() of all frames as they were recorded, and of as many as make about
  /// kThinnedRate, which is the same where that is not lower; NaN of few frames [g].
  double noise, thinned_noise;
  /// Whether a frame's accelerations hang on what was before the first frame or after the last one,
  /// which nobody knows: it was filtered, it is within half a period of the cut-off from that end,
  /// and the motion there is not at rest, see kUnsureForce; one per frame.
  Eigen::Array<bool, Eigen::Dynamic, 1> unsure;

  /// Whether the motion is free of noise, see inferContacts(): it is no noisier than kExactNoise,
  /// or is told to be, and was not filtered, or for rounding only. Motions of too few frames to
  /// tell are, if they were not filtered.
  bool isExact() const;
};

/// The motion that was recorded, if its velocities and accelerations agree with its configurations;
/// else that of the filtered configurations, see filterConfigurations() and differentiate().
/// @param cutoff  of the filter [Hz]; 0 for none; kAutomaticCutoff for none where the motion is
///                exact, or is told to be, kRoundedCutoff where it is so at kThinnedRate, and else
///                kMeasuredCutoff, or kMeasuredCutoffPart of the frame rate where that is lower
/// @throws std::invalid_argument as Motion::validate(); or if frames are to be filtered that are
///         not evenly spaced, or with a cut-off that filterConfigurations() does not take
DYNACOM_EXPORT DerivedMotion deriveMotion(const pinocchio::Model& model,
                                          const RecordedMotion& recorded,
                                          double cutoff = kAutomaticCutoff);

/// The same, whatever velocities and accelerations were recorded.
DYNACOM_EXPORT DerivedMotion rederiveMotion(const pinocchio::Model& model,
                                            const RecordedMotion& recorded,
                                            double cutoff = kAutomaticCutoff);

}  // namespace dynacom
