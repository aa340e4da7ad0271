// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
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
  /// How probable it is that a contact is active, from 0 to 1: names.size() × frames, or nothing
  /// where nobody has said so.
  Eigen::MatrixXd confidence = {};
  /// How readily a contact bears load while it is active, 0 < ρ ≤ 1: the weights of its force are
  /// divided by √ρ. names.size() × frames, or nothing for 1.
  Eigen::MatrixXd readiness = {};

  /// @throws std::invalid_argument if a name is there twice, or a matrix has another size or a
  ///         number out of its range
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

}  // namespace dynacom
