// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <iosfwd>
#include <string>

#include "dynacom/motion_analysis.hpp"
#include "dynacom/recorded_motion.hpp"

namespace dynacom {

/// What may be wrong with a motion. In each frame something is measured; forces are parts of the
/// robot's weight m g, moments of m g times a metre.
enum class MotionFault {
  /// The contacts cannot give the force: ‖force of the residual‖ [m g]. Zero in frames of
  /// FlightWithSupportNeeded and ContactMissing.
  ResidualForce,
  /// The contacts cannot give the moment: ‖moment of the residual‖ [m g·m]. Likewise.
  ResidualTorque,
  /// No contact is active, but something must be given: the larger of ‖f‖ [m g] and ‖τ‖ [m g·m].
  FlightWithSupportNeeded,
  /// Contacts that are just above the ground, and not active, would give what is out of reach: the
  /// larger of the residual's force [m g] and moment [m g·m] without them. Where that is within the
  /// limit, the frame counts as one of the above.
  ContactMissing,
  /// A contact's lowest corner is below its ground: how deep [m].
  GroundPenetration,
  /// An active contact's lowest corner moves along the ground: how fast [m/s].
  FootSliding,
  /// A step from frame to frame is unlike those before and after it: by how much, the larger of
  /// the root's place [m] and what turns [rad].
  Discontinuity,
  /// The root's quaternion, as recorded, had another norm than 1: by how much.
  Quaternion,
};

constexpr std::size_t kMotionFaults = 8;

/// The fault's code, such as "residual_force".
DYNACOM_EXPORT const char* to_string(MotionFault fault);

/// From where on a fault is one.
struct FaultLimit {
  double limit;          ///< of what is measured in a frame
  double allowed_share;  ///< of the frames, that may be beyond the limit

  bool operator==(const FaultLimit& other) const {
    return limit == other.limit && allowed_share == other.allowed_share;
  }
  bool operator!=(const FaultLimit& other) const { return !(*this == other); }
};

/// The limits of all faults, and what else judgeMotion() needs to know. Recorded motions of real
/// people, fitted to a robot, are never exact: the defaults let pass what a controller can mend.
struct DYNACOM_EXPORT VerdictSettings {
  FaultLimit residual_force = {0.1, 0.05};
  FaultLimit residual_torque = {0.03, 0.05};
  FaultLimit flight_with_support_needed = {0.05, 0.02};
  FaultLimit contact_missing = {0.03, 0.02};
  FaultLimit ground_penetration = {0.02, 0.02};
  FaultLimit foot_sliding = {0.2, 0.02};
  FaultLimit discontinuity = {0.15, 0.};
  FaultLimit quaternion = {1e-3, 0.};
  /// Up to which height above its ground a contact is just above it, ≥ 0 [m].
  double near_ground = 0.06;

  const FaultLimit& operator[](MotionFault fault) const;
  FaultLimit& operator[](MotionFault fault);
  /// @throws std::invalid_argument naming the first that is out of its range: limits must be finite
  ///         and ≥ 0, and so must near_ground; shares are from 0 to 1
  void validate() const;
  std::string to_string() const;
  bool operator==(const VerdictSettings& other) const;
  bool operator!=(const VerdictSettings& other) const { return !(*this == other); }
};

DYNACOM_EXPORT std::ostream& operator<<(std::ostream& out, const VerdictSettings& settings);

/// What was found of one fault.
struct MotionFinding {
  Eigen::VectorXd measured;  ///< in each frame, see MotionFault
  Eigen::Index frames;       ///< beyond the limit
  double worst;              ///< the largest measured
  double time;               ///< of the first frame where that is [s]
  bool holds;                ///< whether more frames than allowed are beyond the limit
};

/// Whether a motion is feasible, and what speaks against it.
struct DYNACOM_EXPORT MotionVerdict {
  std::array<MotionFinding, kMotionFaults> findings;  ///< in the order of MotionFault

  const MotionFinding& operator[](MotionFault fault) const;
  /// Whether no fault holds.
  bool isFeasible() const;
};

/// Judges a motion.
/// @param contacts  of computeContactMotions() for the same robot and motion
/// @param ground    height of the ground under each contact, see estimateGround() [m]
/// @param recorded  the same before any filter, of which q and quaternion_error are looked at
/// @param analysis  of analyzeMotion() for the same robot and motion
/// @param threads   as AnalysisSettings::threads
/// @throws std::invalid_argument if settings or motion are not valid, or sizes differ;
///         NotReadyError before the robot's initialize()
DYNACOM_EXPORT MotionVerdict judgeMotion(const DynaCoM& robot, const Motion& motion,
                                         const RecordedMotion& recorded,
                                         const std::vector<ContactMotion>& contacts,
                                         const Eigen::VectorXd& ground,
                                         const MotionAnalysis& analysis,
                                         const VerdictSettings& settings = {}, int threads = 0);

}  // namespace dynacom
