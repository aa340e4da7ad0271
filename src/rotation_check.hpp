// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>

namespace dynacom::internal {

/// Whether a matrix is finite, and orthonormal up to what is more than rounding.
inline bool isOrthonormal(const Eigen::Matrix3d& matrix) {
  constexpr double kEnough = 1e-6;
  return (matrix.transpose() * matrix - Eigen::Matrix3d::Identity()).norm() <= kEnough;
}

}  // namespace dynacom::internal
