// SPDX-License-Identifier: BSD-2-Clause
#include "ground_slope.hpp"

#include <Eigen/QR>
#include <algorithm>

namespace dynacom::internal {

namespace {

// Fewer points do not show that they lie in a plane.
constexpr Eigen::Index kPoints = 6;
// And feet that are tilted, all alike, do not show that the ground is: points must be this far
// apart along the slope [m].
constexpr double kExtent = 0.5;
// A plane is a slope from this gradient on, one degree, and this difference of heights [m], if no
// point is farther from it than this [m], and than this part of the difference.
constexpr double kGradient = 0.01746, kRise = 0.02, kOff = 0.02, kOffPart = 0.2;

}  // namespace

Eigen::Vector2d findGroundSlope(const Eigen::Matrix3Xd& points) {
  if (points.cols() < kPoints) return Eigen::Vector2d::Zero();
  const double rise = points.row(2).maxCoeff() - points.row(2).minCoeff();
  if (rise <= kRise) return Eigen::Vector2d::Zero();
  const Eigen::Vector3d mean = points.rowwise().mean();
  const Eigen::MatrixX3d centred = (points.colwise() - mean).transpose();
  // Of least norm, where the points lie on a line.
  const Eigen::Vector2d gradient =
      centred.leftCols<2>().completeOrthogonalDecomposition().solve(centred.col(2));
  const double off = (centred.col(2) - centred.leftCols<2>() * gradient).cwiseAbs().maxCoeff();
  if (gradient.norm() < kGradient || off > std::min(kOff, kOffPart * rise))
    return Eigen::Vector2d::Zero();
  const Eigen::VectorXd along = centred.leftCols<2>() * gradient.normalized();
  if (along.maxCoeff() - along.minCoeff() < kExtent) return Eigen::Vector2d::Zero();
  return gradient;
}

}  // namespace dynacom::internal
