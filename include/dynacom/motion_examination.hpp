// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dynacom/missing_support.hpp"
#include "dynacom/motion_statistics.hpp"
#include "dynacom/recorded_motion.hpp"
#include "dynacom/terrain.hpp"

namespace dynacom {

/// What examineMotion() needs to know besides.
struct DYNACOM_EXPORT ExaminationSettings {
  /// Of the filter where velocities and accelerations have to be computed [Hz]; 0 for none, and
  /// kAutomaticCutoff (NaN) for what suits the motion, see deriveMotion().
  double cutoff = kAutomaticCutoff;
  /// Its threads do all of it. Its progress is not called: the one below is.
  AnalysisSettings analysis = {};
  DetectionSettings detection = {};
  VerdictSettings verdict = {};
  /// Of contacts that are outer pyramids, as they are unless they say otherwise, and of links, see
  /// splitContacts(). The outer pyramid itself lets forces pass that are up to 41 % beyond
  /// Coulomb's cone.
  FrictionModel friction = FrictionModel::Cone;
  /// Links that may touch the ground besides the contacts, of findCollisionPoints(); they are
  /// looked at where the contacts alone cannot give what the motion needs.
  std::vector<BodyPoints> bodies = {};
  /// Whether to find how far the motion is from a feasible one, and how.
  bool distance = true;
  CentroidalFilterSettings filter = {};
  /// Whether to judge the motion with half and twice the cut-off, too, where a filter is needed and
  /// takes them.
  bool sensitivity = false;
  /// Called now and then, in the caller's thread, with what part of the frames is analysed, which
  /// increases up to 1. Where several threads examine at once, of several motions, but never by two
  /// threads at once.
  std::function<void(double)> progress = nullptr;

  /// @throws std::invalid_argument naming the first field out of its range
  void validate() const;
};

/// What another cut-off frequency would have led to, with the same contacts, ground and links.
struct CutoffSensitivity {
  double cutoff;  ///< [Hz]
  MotionVerdict verdict;
  MotionStatistics statistics;
};

/// A link that is held still high above all ground that is known while contacts cannot give what
/// the motion needs, and that could give the rest: it may sit or lean on something. Its force
/// counts nowhere.
struct Seat {
  std::string link;
  Eigen::Index first, behind;  ///< frames
  double height;               ///< of its lowest point [m]
  double weight_share;         ///< mean vertical force that it would have to give [m g]
};

/// All that was found of a recorded motion, step by step.
struct MotionExamination {
  DerivedMotion derived;
  std::vector<ContactMotion> contacts;  ///< computeContactMotions(); velocities are relative to the
                                        ///< ground, which may be a treadmill
  std::vector<BodyPoints> links;  ///< those that were looked at, with their points, if one carries
  std::vector<PartRobot::Part> parts;       ///< of splitContacts() with these
  std::vector<ContactMotion> part_motions;  ///< the same of the parts
  /// inferContacts(): of the parts, within the contacts that are recorded, if there are any.
  ContactInference inference;
  ContactSchedule schedule;  ///< of the contacts, gathered from that of their parts
  ContactSchedule bodies;    ///< of the links that carry at some time, by name
  std::vector<Seat> seats;   ///< where links may rest on what nothing is known of
  /// What inferContacts() finds on its own, gathered, where contacts are recorded.
  std::optional<ContactSchedule> inferred;
  /// In which share of the frames each contact is otherwise in `inferred` than in `schedule`; of no
  /// contact where there is no `inferred`.
  Eigen::VectorXd disagreement;
  Eigen::MatrixXd ground;  ///< height of the ground under each contact's lowest part, contacts ×
                           ///< frames [m]; NaN where there is none
  Terrain terrain;
  MotionAnalysis analysis;  ///< gatherParts()
  MotionVerdict verdict;
  std::optional<MissingSupport> missing_support;
  /// distanceToFeasible(), where the settings ask for it, the verdict is not Unknown, some frames
  /// are not unsure, and none is too large for numbers. Nothing is asked of frames near jumps and
  /// near ends that are unsure; around flights, contacts count that are active within half a period
  /// of the cut-off.
  std::optional<CentroidalChange> distance;
  MotionStatistics statistics;
  std::vector<CutoffSensitivity> sensitivity;  ///< with half, and with twice the cut-off
};

/// Judges recorded motions of one robot. What it needs for that, threads, solvers and storage, it
/// keeps from one motion to the next: for short clips, these would take as long as the motion.
/// In a process that was forked from its own it has no threads but the caller's.
class DYNACOM_EXPORT MotionExaminer {
 public:
  /// @param robot  is copied
  /// @throws std::invalid_argument if settings are not valid; NotReadyError before the robot's
  ///         initialize()
  explicit MotionExaminer(const DynaCoM& robot, const ExaminationSettings& settings = {});
  /// A copy has threads and a robot of its own. One that was moved from may be assigned to, and no
  /// more.
  MotionExaminer(const MotionExaminer& other);
  MotionExaminer(MotionExaminer&&) noexcept;
  MotionExaminer& operator=(MotionExaminer other) noexcept;
  ~MotionExaminer();

  const ExaminationSettings& getSettings() const;

  /// Finds a motion's derivatives, what its contacts do and where the ground is, and what that asks
  /// of them. Contacts are taken apart: what bears load is which of their parts touch. Where they
  /// alone cannot give what the motion needs, contacts are inferred once more, with those links
  /// that were low then; if more can be given so, these count, and carry like contacts. The ground
  /// that the centre of pressure lies on is the mean of those that the parts stand on. Results do
  /// not depend on what was examined before; several threads may call this at once.
  /// @throws std::invalid_argument if the motion or its schedule is not valid, see deriveMotion()
  ///         and analyzeMotion()
  MotionExamination examine(const RecordedMotion& recorded) const;

  /// Judges many, see analyzeMotions().
  void examineMany(std::size_t clips, const std::function<RecordedMotion(std::size_t)>& read,
                   const std::function<void(std::size_t, const MotionExamination*,
                                            const std::string&)>& done) const;

 private:
  struct Workspace;
  std::unique_ptr<Workspace> workspace_;
};

/// Judges one recorded motion, see MotionExaminer::examine().
/// @throws as MotionExaminer
DYNACOM_EXPORT MotionExamination examineMotion(const DynaCoM& robot, const RecordedMotion& recorded,
                                               const ExaminationSettings& settings = {});

/// Judges many recorded motions of one robot, each as examineMotion() does. A pool of threads,
/// ExaminationSettings::analysis's, takes clip after clip; those that find none left take part in
/// what is not done yet. Never are there more clips in memory than threads, and results do not
/// depend on their number, bit for bit.
/// @param clips     how many
/// @param read      gives a clip by its number, 0 to clips − 1, in order; called by several threads
///                  at once
/// @param done      takes a clip's number with what was found of it, or null and the message of
///                  what was thrown by `read` or MotionExaminer::examine(), which is the end of
///                  that clip only. Called by one thread at a time, in the order in which clips are
///                  done, and no more once it has thrown
/// @param settings  the progress is not told
/// @throws what `done` throws, once all threads have stopped; std::invalid_argument if settings are
///         not valid; NotReadyError before the robot's initialize()
DYNACOM_EXPORT void analyzeMotions(
    const DynaCoM& robot, std::size_t clips, const std::function<RecordedMotion(std::size_t)>& read,
    const std::function<void(std::size_t, const MotionExamination*, const std::string&)>& done,
    const ExaminationSettings& settings = {});

}  // namespace dynacom
