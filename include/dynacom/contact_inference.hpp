// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "dynacom/contact_parts.hpp"
#include "dynacom/detection_settings.hpp"

namespace dynacom {

/// A time in which a part of the robot is at rest: on the ground, or held in the air.
struct Stance {
  std::size_t part;            ///< index of PartRobot::parts
  Eigen::Index first, behind;  ///< frames in which it is slow; the second is the one after the last
  double height;               ///< of the part's lowest point there, or of the ground under it if
                               ///< DetectionSettings::ground_height tells of it [m]
  bool on_ground;              ///< whether the ground may carry the part there
  /// Frames that belong to it, the second behind the last: with those of the way from the stance
  /// before and to the next one, up to where the part is fastest.
  Eigen::Index begin, end;
  /// The ground's gradient (∂z/∂x, ∂z/∂y) there; zero where it is level, told by
  /// DetectionSettings::ground_height or not known, or where the part is never active.
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
};

/// When which part of a robot touches the ground, and where that ground is.
struct DYNACOM_EXPORT ContactInference {
  ContactSchedule schedule;  ///< of the parts, with confidence and readiness
  std::vector<Stance> stances;
  /// Height of the ground under each part, parts × frames [m]: of the stance that a frame is in, or
  /// in which the part is active; on the way from one stance to the next the lower one's. NaN where
  /// there is none on the ground, and of links where they are not active.
  Eigen::MatrixXd ground;
  /// What the schedule cannot give of the wrench that the motion needs, 2 × frames: the norms of
  /// the force [m g] and of the moment about the CoM [m g m].
  Eigen::Matrix2Xd missing;
  /// The slope that all stances share in which a contact's part is active; zero where there is no
  /// such one.
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
  /// Velocity of the ground, as given or found, in the world [m/s].
  Eigen::Vector3d ground_velocity = Eigen::Vector3d::Zero();
};

/// Finds the contacts of a motion by what it needs: for each frame and each set of parts that may
/// be active, it costs where they are and how fast, and what they cannot give of the wrench that
/// the motion needs; changes cost, too. The cheapest path through time is the schedule (Viterbi
/// 1967), and the probabilities over the same costs are its confidence (forward-backward, Rabiner
/// 1989), but that changes are the less probable the shorter a frame is, up to 60 a second. Parts
/// carry load on a ground that was landed on, or that is as high as such a one: see
/// DetectionSettings, whose constants are all there are.
/// @param parts     of splitContacts()
/// @param motions   of computeContactMotions() for the parts
/// @param dynamics  of analyzeMotion() for the parts, with whatever schedule
/// @param exact     whether the motion is free of noise: planned, or simulated
/// @param recorded  of the whole robot's contacts, by whose names and numbers of parts: if given,
///                  contacts are active as it says, and only which of their parts are is found;
///                  null otherwise
/// @throws std::invalid_argument if settings are not valid, or sizes differ, or there are more than
///         32 parts
DYNACOM_EXPORT ContactInference inferContacts(const PartRobot& parts,
                                              const std::vector<ContactMotion>& motions,
                                              const MotionAnalysis& dynamics, bool exact,
                                              const DetectionSettings& settings = {},
                                              const ContactSchedule* recorded = nullptr);

}  // namespace dynacom
