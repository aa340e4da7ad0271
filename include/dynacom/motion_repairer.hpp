// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dynacom/motion_examination.hpp"
#include "dynacom/motion_repair.hpp"

namespace dynacom {

/// What MotionRepairer needs to know.
struct DYNACOM_EXPORT RepairerSettings {
  ExaminationSettings examination = {};
  /// With `feet` and `joints` off, wrenches only are looked after.
  RepairSettings repair = {};
  /// Whether single frames are mended, too, of motions that are feasible as a whole.
  bool strict = false;
  /// How often a motion is repaired at most, with the contacts that are found in what came out, on
  /// each rung.
  int rounds = 5;
  /// A motion whose root has to be displaced farther than this in any frame [m], or a joint turned
  /// by more than the second [rad], is not said to be repaired.
  double largest_displacement = 0.1, largest_turn = 0.8;
  /// By which factor time may be stretched where nothing else helps; 1 for not at all.
  double largest_stretch = 1.;

  /// @throws std::invalid_argument naming the first field out of its range
  void validate() const;
};

/// How it went.
enum class RepairOutcome {
  Feasible,     ///< The motion was feasible, and is as it was.
  Repaired,     ///< It was not, and is now: in every frame, without a fault.
  NotRepaired,  ///< Something is left, see MotionRepair::reasons.
};

/// "feasible", "repaired" or "not repaired".
DYNACOM_EXPORT const char* to_string(RepairOutcome outcome);

/// A rung of the ladder, in their order.
enum class RepairRung {
  Ground,    ///< all of it lifted to the height that the ground is told to have, after it was
             ///< turned such that a slope which all stances share is level
  Filter,    ///< what was recorded is noisy, and was filtered
  Schedule,  ///< contacts, as they are in a motion that is exact
  Balance,   ///< wrenches within reach
  Feet,      ///< contacts at rest, level with their ground, and those in the air above it
  Joints,    ///< positions and velocities within their limits
  Time,      ///< stretched
};

/// "ground", "filter", "schedule", "balance", "feet", "joints" or "time".
DYNACOM_EXPORT const char* to_string(RepairRung rung);

/// What a rung has gained. What is measured is for Ground the height of what is stood on above the
/// ground [m]; for Filter the root's displacement by it, root mean square
/// [m], for Schedule the distance to a feasible
/// motion, root mean square [m], where it is known, else NaN; for Balance the number of frames
/// whose wrench is not within reach; for Feet the largest speed of a contact along the ground
/// [m/s]; for Joints how far one is beyond its range at most [rad]; for Time the factor.
struct RepairStep {
  RepairRung rung;
  double before, after;
  bool is_kept;  ///< whether its motion counts, or that of the rung before
};

/// Why a motion is not repaired.
struct RepairReason {
  std::string code;  ///< what is left: that of a MotionFault, or one of those in MotionRepair
  double time;       ///< of the frame where it is worst [s]; NaN where it is of no frame
  std::string text;
};

/// How much something was changed.
struct RepairChange {
  double rms = 0., largest = 0.;
  Eigen::Index frame = 0;  ///< where it is largest
  std::string joint;       ///< whose that is, of joints
};

/// How the contacts of a robot stand, of which stances tell when they carry.
struct RepairedFeet {
  double speed = 0.;  ///< the largest of one along the ground, that of FootSliding [m/s]
  /// The largest distance of a part that carries from where it is on average in its stance [m]; NaN
  /// where there is no stance.
  double drift = 0.;
  /// How deep a part is below its ground at most, and how high one that carries is above it, as
  /// findRepairGround() tells it [m].
  double sunk = 0., floating = 0.;
};

/// What was made of a recorded motion.
struct MotionRepair {
  RepairOutcome outcome;
  MotionExamination before;  ///< as it was recorded
  /// What came out, exact unless nothing was changed: its times and configurations, and the
  /// schedule that was recorded, if there was one; without velocities and accelerations, which are
  /// those of differentiate().
  RecordedMotion recorded;
  MotionExamination after;     ///< of that, without a filter
  MotionExamination filtered;  ///< as who does not know that it is exact finds it
  /// Of the configurations, from those of `before` in their tangent spaces, nv × frames.
  Eigen::MatrixXd change;
  RepairChange root, com;     ///< displacements [m]
  RepairChange turn, joints;  ///< of the root, and changes of joints that turn [rad]
  /// How far a joint is beyond its limits at most, or a step of it, in what `before` has and in
  /// what came out [rad], [m].
  double joint_excess_before = 0., joint_excess = 0.;
  /// How many of the judged frames contacts cannot give what they need, by more than 0.001 m g or
  /// m g m.
  Eigen::Index missing_before = 0, missing = 0;
  std::vector<RepairedStance> stances;  ///< of the last rung
  /// In `before` and in `after`, where what carries in `after` does.
  RepairedFeet feet_before, feet;
  double ground_offset = 0.;  ///< by which all was lifted, besides these changes [m]
  double ground_tilt = 0.;    ///< by which it was turned before that [rad]
  double stretch = 1.;        ///< of time
  std::vector<RepairStep> steps;
  /// Of `Repaired` and `Feasible` none. Codes are those of faults, and `contact_needed` where
  /// nothing carries, `out_of_reach` where what carries cannot give what is needed,
  /// `joint_limits`, `feet_not_held` where contacts were to stand still and drift by more than
  /// RepairSettings::largest_drift in a stance, `bound` where settings do not allow so much,
  /// `not_better` where all that was tried is worse, and the motion stays as it was, and
  /// `too_short`.
  std::vector<RepairReason> reasons;
};

/// Repairs recorded motions of one robot: a ladder, whose rungs are climbed as far as they lead.
///
/// A motion is examined as ever. If it is feasible, it stays as it is. Else it is filtered, as for
/// its verdict, and taken for exact from then on: contacts are found anew, unless that makes it
/// much farther from a feasible one, as where soles are tilted by mistake. Then wrenches are
/// brought within reach by repairMotion(), and contacts found once more in what came out, until
/// all is solved, some rounds at most; then the same with feet and joints, and where feet
/// cannot be held with joints alone, which count only if they leave wrenches within reach.
class DYNACOM_EXPORT MotionRepairer {
 public:
  /// @param robot  is copied; its root must be a free-flyer
  /// @throws std::invalid_argument if settings are not valid, or the root is no free-flyer;
  ///         NotReadyError before the robot's initialize()
  explicit MotionRepairer(const DynaCoM& robot, const RepairerSettings& settings = {});
  MotionRepairer(MotionRepairer&&) noexcept;
  MotionRepairer& operator=(MotionRepairer&&) noexcept;
  ~MotionRepairer();

  const RepairerSettings& getSettings() const;

  /// Several threads may call this at once.
  /// @throws std::invalid_argument as MotionExaminer::examine() and repairMotion()
  MotionRepair repair(const RecordedMotion& recorded) const;

 private:
  struct Workspace;
  std::unique_ptr<Workspace> workspace_;
};

/// Repairs one recorded motion, see MotionRepairer.
/// @throws as MotionRepairer
DYNACOM_EXPORT MotionRepair repairRecordedMotion(const DynaCoM& robot,
                                                 const RecordedMotion& recorded,
                                                 const RepairerSettings& settings = {});

}  // namespace dynacom
