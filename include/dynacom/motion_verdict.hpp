// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <iosfwd>
#include <string>
#include <vector>

#include "dynacom/centroidal_filter.hpp"
#include "dynacom/motion_analysis.hpp"
#include "dynacom/recorded_motion.hpp"

namespace dynacom {

/// What may be wrong with a motion. In each frame something is measured; forces are parts of the
/// robot's weight m g, moments of m g times a metre. What accelerations decide, from ResidualForce
/// to FlightWithSupportNeeded, is not measured in frames whose accelerations are not known
/// (MotionVerdict::unsure), nor is FootSliding near jumps: these are 0 there, and such frames are
/// no part of those of which a share may be beyond the limit.
enum class MotionFault {
  /// An active contact's normal, which must point into the robot, points down: how far below the
  /// horizontal [rad], π/2 for straight down. It comes first, since it is the robot's description
  /// that is wrong then, and what else was found is worth little.
  DownwardNormal,
  /// The contacts cannot give the force: ‖force of the residual‖ [m g]. Zero without contacts.
  ResidualForce,
  /// The contacts cannot give the moment: ‖moment of the residual‖ [m g·m]. Zero without contacts.
  ResidualTorque,
  /// How far the centre of pressure that is needed lies outside what carries [m]: its horizontal
  /// distance to the convex hull of all corners of the active contacts. It is (5) of the ground
  /// wrench, on the horizontal plane through the mean height of these corners. Zero where the
  /// contacts can give the wrench (Solved), since contacts at different heights have no such plane,
  /// and where the vertical force is below VerdictSettings::cop_force.
  CoPOutside,
  /// No contact is active, but something must be given: the larger of ‖f‖ [m g] and ‖τ‖ [m g·m].
  FlightWithSupportNeeded,
  /// A contact's lowest corner is below its ground: how deep [m].
  GroundPenetration,
  /// An active contact's lowest corner moves along the ground: how fast [m/s].
  FootSliding,
  /// A step from frame to frame is none that a motion makes: how fast the root or a joint moves in
  /// it, as a part of its greatest speed (VerdictSettings). Both frames of a step have its value.
  Discontinuity,
};

constexpr std::size_t kMotionFaults = 8;

/// The fault's code, such as "residual_force".
DYNACOM_EXPORT const char* to_string(MotionFault fault);
/// The unit of what is measured, such as "m g".
DYNACOM_EXPORT const char* getUnit(MotionFault fault);
/// What the fault means, such as "the contacts cannot give the force".
DYNACOM_EXPORT const char* getMeaning(MotionFault fault);

/// Whether a small change of the motion can mend the fault: not where it is the robot's description
/// that is wrong, or frames do not belong together.
DYNACOM_EXPORT bool isMendable(MotionFault fault);

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
  /// Beyond 63 degrees: the soles of robots that kneel on their insteps face up by 50 degrees.
  FaultLimit downward_normal = {1.1, 0.02};
  FaultLimit residual_force = {0.1, 0.05};
  FaultLimit residual_torque = {0.03, 0.05};
  FaultLimit cop_outside = {0.02, 0.1};
  FaultLimit flight_with_support_needed = {0.05, 0.02};
  FaultLimit ground_penetration = {0.02, 0.02};
  FaultLimit foot_sliding = {0.2, 0.02};
  FaultLimit discontinuity = {1., 0.};
  /// The least vertical force for a centre of pressure to be looked at, ≥ 0 [m g]: below it, as
  /// around flights, that point is far away without a moment that matters. Between 0.1 and 0.3 m g
  /// it is so in nine frames of ten of measured and simulated runs and trots.
  double cop_force = 0.3;
  /// The greatest speed of the root and of prismatic joints, > 0 [m/s]: nobody runs faster.
  double linear_speed = 10.;
  /// The greatest speed at which the root turns, > 0 [rad/s]: a somersault takes 12.
  double turning_speed = 30.;
  /// The greatest speed of joints, > 0 [rad/s]: motors of humanoids turn by 20 to 37, and
  /// retargeted dances reach 40 for a frame.
  double joint_speed = 50.;
  /// Frames so close to a jump are unsure, as are two at either side at least, ≥ 0 [s]: filters and
  /// differences spread a jump over them. At 6 Hz, a jump of a humanoid's shoulder by 2 rad is
  /// beyond the limits of forces for 0.14 s, one of its root by 0.3 m for 0.26 s.
  double jump_time = 0.25;
  /// How long a window is at least, ≥ 0 [s].
  double minimal_window = 1.;
  /// Interruptions of a window that are shorter than this are none where there is as much time
  /// without fault before and after them, ≥ 0 [s].
  double interruption = 0.1;
  /// A motion that is not feasible is repairable if the CoM has to be displaced by no more than
  /// this, root mean square over the frames, and by no more than the second in any, > 0 [m]; see
  /// distanceToFeasible(). Well retargeted clips need 0.2 to 4 mm, kicks and sprints up to 10;
  /// three joints mixed up 16, a robot that leans 5 cm too far 50.
  double repairable_distance = 0.01, repairable_largest_distance = 0.05;
  /// Nor is one whose contacts are deeper below their ground than this, if that is a fault, or
  /// slide by more than the second, the fastest of them at each moment, in a row of frames that are
  /// beyond the limit, > 0 [m]. The toes
  /// of people who push off seem to be 6 cm deep where they were measured by markers; feet of
  /// retargeted dances slide by 12 to 26 cm, and what slides farther makes a step.
  double repairable_depth = 0.07, repairable_slide = 0.3;

  const FaultLimit& operator[](MotionFault fault) const;
  FaultLimit& operator[](MotionFault fault);
  /// @throws std::invalid_argument naming the first that is out of its range: limits must be finite
  ///         and ≥ 0, shares from 0 to 1, and the others as they say
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
  /// Whose that is: a contact's name for DownwardNormal, GroundPenetration and FootSliding; for
  /// Discontinuity "root", "root's orientation" or a joint's name. Empty for others, and where
  /// nothing is.
  std::string subject;
};

/// A part of a motion, longer than VerdictSettings::minimal_window, without a frame beyond the
/// limit of any fault, but for short interruptions. A discontinuity is never one of those. Frames
/// that are unsure may be within one, but neither begin nor end it.
struct MotionWindow {
  Eigen::Index first, last;  ///< frames, both included
  double begin, end;         ///< their times [s]
};

/// Where a contact's normal points while the contact is active.
struct ContactNormal {
  double up;              ///< mean of its vertical component, 1 for up; NaN if never active
  double downward_share;  ///< of these frames, where it points down; NaN if there are none
};

/// What came out.
enum class MotionOutcome {
  Feasible,     ///< No fault holds.
  Repairable,   ///< Only faults hold that are mendable, and a feasible motion is near.
  NotFeasible,  ///< A fault holds.
  Unknown,      ///< Nothing can be said: there are too few frames whose accelerations are known.
};

/// "feasible", "repairable", "not feasible" or "unknown".
DYNACOM_EXPORT const char* to_string(MotionOutcome outcome);

/// Whether a motion is feasible, and what speaks against it.
struct DYNACOM_EXPORT MotionVerdict {
  MotionOutcome outcome;
  std::array<MotionFinding, kMotionFaults> findings;  ///< in the order of MotionFault
  /// Frames whose accelerations are not known: those that were given, and those near jumps.
  Eigen::Array<bool, Eigen::Dynamic, 1> unsure;
  std::vector<MotionWindow> windows;   ///< in their order; none where the outcome is Unknown
  double feasible_share;               ///< of the frames, that are in windows
  std::vector<ContactNormal> normals;  ///< of each contact of the robot

  const MotionFinding& operator[](MotionFault fault) const;
  /// Lets NotFeasible be Repairable, where only mendable faults hold, and the distance to feasible
  /// and what contacts sink and slide are within what settings allow.
  /// @param distance  of distanceToFeasible(); where that did not converge, nothing changes
  /// @param time      of the frames [s]
  void weighDistance(const CentroidalChange& distance, const Eigen::VectorXd& time,
                     const VerdictSettings& settings);
  /// The largest share of frames beyond the limit of a fault that holds; 0 if none does.
  double getSeverity() const;
  bool isFeasible() const { return outcome == MotionOutcome::Feasible; }
  /// The codes of the faults that hold; else "feasible"; only "too_short" where that is Unknown.
  std::vector<std::string> getCodes() const;
};

/// Fewer frames than these tell nothing where derivatives were computed: each of them would be made
/// of the same few numbers, and a filter has nothing to filter.
constexpr Eigen::Index kMinimalFrames = 6;

/// Judges a motion. The outcome is Unknown if there are fewer than kMinimalFrames frames and their
/// derivatives are not those of `recorded`, or if no fault holds and all frames are unsure but
/// fewer than kMinimalFrames.
/// @param contacts  of computeContactMotions() for the same robot and motion
/// @param recorded  the same before any filter: jumps are looked for in its q, and its v and a say
///                  whether the motion's are recorded ones
/// @param ground    height of the ground under each contact, contacts × frames, or contacts × 1
///                  where it does not change, see ContactInference [m]; NaN where it is not known
/// @param analysis  of analyzeMotion() for the same robot and motion
/// @param threads   as AnalysisSettings::threads
/// @param unsure    frames whose accelerations are not known; empty if there are none
/// @throws std::invalid_argument if settings or motion are not valid, or sizes differ;
///         NotReadyError before the robot's initialize()
DYNACOM_EXPORT MotionVerdict judgeMotion(const DynaCoM& robot, const Motion& motion,
                                         const RecordedMotion& recorded,
                                         const std::vector<ContactMotion>& contacts,
                                         const Eigen::MatrixXd& ground,
                                         const MotionAnalysis& analysis,
                                         const VerdictSettings& settings = {}, int threads = 0,
                                         const Eigen::Array<bool, Eigen::Dynamic, 1>& unsure = {});

}  // namespace dynacom
