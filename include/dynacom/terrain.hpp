// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "dynacom/contact_inference.hpp"

namespace dynacom {

/// Stances of a contact are on different levels if their heights differ by more than this [m].
constexpr double kSameLevel = 0.05;
/// And on different slopes if their inclinations do by more than this [rad].
constexpr double kSameSlope = 0.002;
/// How long a contact is at rest at least to be held there [s].
constexpr double kHeldDuration = 0.5;

/// The ground under one contact.
struct ContactTerrain {
  std::string name;
  double height;  ///< its median over the frames in which the contact is active [m]; NaN where that
                  ///< is never, or the ground is not known
  /// Heights of the stances on which it stands, increasing [m]: of the first, and of each that is
  /// on another level than all before it, see kSameLevel.
  std::vector<double> levels;
  /// Inclinations of those stances that are on a slope, increasing [rad]: of the first, and of each
  /// that is on another slope than all before it, see kSameSlope.
  std::vector<double> slopes;
};

/// A contact that is held still where nothing carries it, in the lowest stance in which it is.
struct HeldContact {
  std::string name;
  /// Names of the parts that are held, in alphabetical order and without the contact's, while the
  /// rest of it carries: it is tilted. Empty where nothing of it carries all the time.
  std::vector<std::string> parts;
  Eigen::Index first, behind;  ///< frames
  double begin;                ///< time of the first [s]
  double height;               ///< above Terrain::level [m]
};

/// What a motion stands on.
struct Terrain {
  std::vector<ContactTerrain> contacts;  ///< in the order of the robot's
  double lowest;  ///< height of all stances on which contacts stand, or, if there are none, of
                  ///< their grounds [m]; NaN where none is known
  double level;   ///< of the ground as a whole: as given, else the median height of these stances;
                  ///< 0 if there are none [m]
  /// Each contact once for the whole of it, and once for what is tilted, as far as that is held for
  /// kHeldDuration; in the order of their stances.
  std::vector<HeldContact> held;
};

/// Finds what a motion stands on. A contact stands on the stances of its parts that are on the
/// ground and in which the part is active at some time; stances of other links do not count.
/// @param parts          of the contacts, and of other links behind them, as PartRobot::parts
/// @param inference      of inferContacts() for these
/// @param schedule       of the contacts, gathered from the inference's
/// @param ground         height of the ground under each contact, contacts × frames [m]; NaN where
///                       it is not known
/// @param time           of the frames [s]
/// @param ground_height  DetectionSettings::ground_height, NaN where the ground was to be found
/// @throws std::invalid_argument if sizes differ, or a stance is none of the parts' and frames'
DYNACOM_EXPORT Terrain findTerrain(const std::vector<PartRobot::Part>& parts,
                                   const ContactInference& inference,
                                   const ContactSchedule& schedule, const Eigen::MatrixXd& ground,
                                   const Eigen::VectorXd& time,
                                   double ground_height = std::numeric_limits<double>::quiet_NaN());

}  // namespace dynacom
