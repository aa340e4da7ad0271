// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <iosfwd>
#include <limits>
#include <string>
#include <vector>

#include "dynacom/dyna_com.hpp"
#include "dynacom/motion.hpp"

namespace dynacom {

/// Which contacts are active when.
struct DYNACOM_EXPORT ContactSchedule {
  using Matrix = Eigen::Matrix<bool, Eigen::Dynamic, Eigen::Dynamic>;

  std::vector<std::string> names;  ///< of contacts
  Matrix active;                   ///< names.size() × frames

  /// @throws std::invalid_argument if a name is there twice, or active has another size
  void validate(Eigen::Index frames) const;
};

/// How a contact moves through a motion, whether it touches something or not: one column per frame,
/// in the world's axes.
struct ContactMotion {
  std::string name;
  Eigen::Matrix3Xd position;  ///< of the surface's origin [m]
  Eigen::Matrix4Xd rotation;  ///< of the surface: a quaternion (x, y, z, w)
  Eigen::VectorXd height;     ///< z of the surface's lowest corner [m]
  Eigen::Matrix3Xd velocity;  ///< of that corner, as a point of the robot [m/s]
};

/// How many frames can be computed at once, at most, in the lanes of SIMD registers.
constexpr int kMaximalLanes = 8;

/// The motions of all contacts that a robot knows, in the order of getKnownContacts(), placed by
/// the model.
/// @param threads  how many do the work, at most; 0 stands for as many as the machine has
/// @param lanes    how many frames a thread computes at once, at most
/// @throws std::invalid_argument if the motion or a number is not valid; NotReadyError before the
///         robot's initialize()
DYNACOM_EXPORT std::vector<ContactMotion> computeContactMotions(const DynaCoM& robot,
                                                                const Motion& motion,
                                                                int threads = 0,
                                                                int lanes = kMaximalLanes);

/// Where the ground is, and when a contact is held to touch it.
struct DYNACOM_EXPORT DetectionSettings {
  /// A contact begins to touch where its lowest corner is no higher above its ground than this [m],
  /// and no faster than that [m/s]; both ≥ 0.
  double height = 0.015, speed = 0.25;
  /// It ceases to where that corner is higher or faster than this; at least as much as the above.
  double release_height = 0.03, release_speed = 0.5;
  /// At its beginning and end, a contact is cut back to where that corner is no faster than this,
  /// or than three times its median speed in the contact if that is more: a foot that lands or
  /// leaves is not at rest yet, or any more, although it is low and slow, ≥ 0 [m/s].
  double rest_speed = 0.1;
  /// Contacts, and interruptions, shorter than this are none, ≥ 0 [s].
  double minimal_duration = 0.1;
  /// The ground's height under all contacts [m]; NaN if it is to be estimated.
  double ground_height = std::numeric_limits<double>::quiet_NaN();
  /// Where a contact's lowest place is higher than another's by more than this, it is in the air
  /// there, unless it stands still as on a step of a stair, ≥ 0 [m].
  double same_ground = 0.05;

  /// @throws std::invalid_argument naming the first field out of its range
  void validate() const;
  std::string to_string() const;
  bool operator==(const DetectionSettings& other) const;
  bool operator!=(const DetectionSettings& other) const { return !(*this == other); }
};

DYNACOM_EXPORT std::ostream& operator<<(std::ostream& out, const DetectionSettings& settings);

/// The height of the ground under each contact [m], from where the contacts are when they are slow:
/// the fifth percentile of each one's height there. A contact that is never slow, or whose
/// percentile is above the lowest by more than DetectionSettings::same_ground without the contact
/// standing still there, has the lowest ground of all.
/// @param contacts  of computeContactMotions()
/// @param time      frames, strictly increasing [s]
/// @throws std::invalid_argument if settings are not valid, or sizes differ
DYNACOM_EXPORT Eigen::VectorXd estimateGround(const std::vector<ContactMotion>& contacts,
                                              const Eigen::VectorXd& time,
                                              const DetectionSettings& settings = {});

/// Finds when contacts touch their ground.
/// @param contacts  of computeContactMotions()
/// @param time      frames, strictly increasing [s]
/// @param ground    height of the ground under each contact [m]
/// @throws std::invalid_argument if settings are not valid, or sizes differ
DYNACOM_EXPORT ContactSchedule detectContacts(const std::vector<ContactMotion>& contacts,
                                              const Eigen::VectorXd& time,
                                              const Eigen::VectorXd& ground,
                                              const DetectionSettings& settings = {});

}  // namespace dynacom
