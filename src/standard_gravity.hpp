// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>

namespace dynacom::internal {

/// What turns a mass into a force where there is no gravity, and accelerations into numbers
/// [m/s²].
constexpr double kStandardGravity = 9.81;

/// g of "m g", the weight that forces are compared with: of the gravity that there is, and of
/// standard gravity where nothing falls [m/s²].
inline double findUnitGravity(const Eigen::Vector3d& gravity) {
  return gravity.z() < 0. ? -gravity.z() : kStandardGravity;
}

}  // namespace dynacom::internal
