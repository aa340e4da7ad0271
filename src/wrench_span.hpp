// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

namespace dynacom::internal {

/// Finds an orthonormal basis of the wrenches that directions span, one direction after the other,
/// of which the most is new.
/// @param directions   of length 1, which are used up
/// @param independent  what has more outside of the others is a direction of its own
/// @param dependent    and what has less is rounding
/// @param basis        as many columns as the rank, and zeros behind
/// @return false if the rank is not certain
inline bool findSpan(std::vector<Eigen::Matrix<double, 6, 1>>& directions, double independent,
                     double dependent, Eigen::Matrix<double, 6, 6>& basis, int& rank) {
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  basis.setZero();
  for (rank = 0; rank < 6; ++rank) {
    double most = 0.;
    for (const Vector6& direction : directions) {
      const double norm = direction.squaredNorm();
      if (!(norm > most)) continue;
      most = norm;
      basis.col(rank) = direction;
    }
    most = std::sqrt(most);
    if (most <= dependent) {
      basis.col(rank).setZero();
      return true;
    }
    if (most < independent) return false;
    auto own = basis.col(rank);
    for (int k = 0; k < rank; ++k) own -= basis.col(k).dot(own) * basis.col(k);
    own.normalize();
    for (Vector6& direction : directions) direction -= own.dot(direction) * own;
  }
  return true;
}

}  // namespace dynacom::internal
