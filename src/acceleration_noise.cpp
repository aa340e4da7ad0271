// SPDX-License-Identifier: BSD-2-Clause
#include "acceleration_noise.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <pinocchio/algorithm/center-of-mass.hpp>
#include <vector>

#include "check.hpp"
#include "configuration_steps.hpp"
#include "dynacom/motion.hpp"
#include "motion_check.hpp"
#include "nan.hpp"
#include "standard_gravity.hpp"

namespace dynacom {

namespace {

// A difference of sixth order takes so many frames. Of higher orders, what a smooth motion leaves
// is less, but there are more frames in which a contact may begin.
constexpr Eigen::Index kNodes = 7;
constexpr Eigen::Index kWindows = 10;  // that a block has, one frame after the other
constexpr Eigen::Index kBlock = kNodes + kWindows - 1;

// How many blocks are looked at: a part of those that there are, and no more than so many.
constexpr Eigen::Index kLeastBlocks = 6, kMostBlocks = 40, kFramesPerBlock = 58;

// The lower quartile of |x|, where x is normal with mean 0 and deviation 1.
constexpr double kQuartile = 0.318639;

// The first frames of those blocks in which the configuration moves at least half as much as in the
// root mean square: what stands still says nothing about how well motion is known.
std::vector<Eigen::Index> chooseBlocks(const pinocchio::Model& model, const Eigen::MatrixXd& q,
                                       Eigen::Index stride) {
  const Eigen::Index length = kBlock * stride;
  const Eigen::Index count = std::max<Eigen::Index>(q.cols() / length, 1);
  if (count == 1) return {0};
  Eigen::MatrixXd ends(q.rows(), count + 1);
  for (Eigen::Index block = 0; block <= count; ++block)
    ends.col(block) = q.col(std::min(block * length, q.cols() - 1));
  const Eigen::VectorXd moves =
      internal::ConfigurationSteps(model).compute(ends).colwise().squaredNorm();
  std::vector<Eigen::Index> moving;
  for (Eigen::Index block = 0; block < count; ++block)
    if (moves[block] >= 0.25 * moves.mean()) moving.push_back(block * length);

  const auto found = static_cast<Eigen::Index>(moving.size());
  const Eigen::Index wanted =
      std::clamp(q.cols() / (kFramesPerBlock * stride), kLeastBlocks, kMostBlocks);
  if (found <= wanted) return moving;
  std::vector<Eigen::Index> chosen;
  for (Eigen::Index k = 0; k < wanted; ++k)
    chosen.push_back(moving[static_cast<std::size_t>((2 * k + 1) * found / (2 * wanted))]);
  return chosen;
}

// Of seven points, how far the sixth divided difference is from zero, as a number whose variance
// is that of each point's noise, times √6 / h²: what the noise makes of a second difference.
Eigen::Vector3d measureWindow(const double* time,
                              const Eigen::Ref<const Eigen::Matrix<double, 3, kNodes>>& points) {
  const double step = (time[kNodes - 1] - time[0]) / double(kNodes - 1);
  Eigen::Vector3d difference = Eigen::Vector3d::Zero();
  double squares = 0.;
  for (Eigen::Index i = 0; i < kNodes; ++i) {
    double weight = 1.;
    for (Eigen::Index j = 0; j < kNodes; ++j)
      if (j != i) weight *= step / (time[i] - time[j]);
    squares += weight * weight;
    difference += weight * points.col(i);
  }
  return difference.cwiseAbs() * std::sqrt(6. / squares) / (step * step);
}

}  // namespace

double internal::estimateAccelerationNoise(const pinocchio::Model& model,
                                           const CoMFunction& findCoM, const Eigen::VectorXd& time,
                                           const Eigen::MatrixXd& q, Eigen::Index stride) {
  const std::vector<Eigen::Index> blocks = chooseBlocks(model, q, stride);
  Eigen::MatrixXd chosen(q.rows(), kBlock * Eigen::Index(blocks.size()));
  std::vector<double> times;
  std::vector<Eigen::Index> begins;  // of blocks, among those
  for (const Eigen::Index first : blocks) {
    begins.push_back(Eigen::Index(times.size()));
    for (Eigen::Index k = 0; k < kBlock && first + k * stride < q.cols(); ++k) {
      chosen.col(Eigen::Index(times.size())) = q.col(first + k * stride);
      times.push_back(time[first + k * stride]);
    }
  }
  const auto count = static_cast<Eigen::Index>(times.size());
  begins.push_back(count);
  const Eigen::Matrix3Xd points = findCoM(chosen.leftCols(count));

  std::array<std::vector<double>, 3> measured;
  for (std::size_t block = 0; block < blocks.size(); ++block)
    for (Eigen::Index k = begins[block]; k + kNodes <= begins[block + 1]; ++k) {
      const Eigen::Vector3d noise =
          measureWindow(&times[static_cast<std::size_t>(k)], points.middleCols<kNodes>(k));
      for (std::size_t axis = 0; axis < 3; ++axis)
        measured[axis].push_back(internal::orInfinity(noise[static_cast<Eigen::Index>(axis)]));
    }
  if (measured[0].empty()) return internal::kNaN;
  double square = 0.;
  for (std::vector<double>& axis : measured) {
    const auto quartile = axis.begin() + static_cast<std::ptrdiff_t>((axis.size() - 1) / 4);
    std::nth_element(axis.begin(), quartile, axis.end());
    square += *quartile * *quartile;
  }
  return std::sqrt(square) / kQuartile / internal::kStandardGravity;
}

double estimateAccelerationNoise(const pinocchio::Model& model, const Eigen::VectorXd& time,
                                 const Eigen::MatrixXd& q, Eigen::Index stride) {
  internal::requireTime(time);
  internal::requireConfigurations(model, q, time.size());
  if (stride < 1) internal::throwInvalid("stride must be >= 1, got ", stride);
  pinocchio::Data data(model);
  const auto findCoM = [&](const Eigen::MatrixXd& chosen) {
    return internal::findCoM(model, data, chosen);
  };
  return internal::estimateAccelerationNoise(model, findCoM, time, q, stride);
}

Eigen::Matrix3Xd internal::findCoM(const pinocchio::Model& model, pinocchio::Data& data,
                                   const Eigen::MatrixXd& q) {
  Eigen::Matrix3Xd com(3, q.cols());
  for (Eigen::Index frame = 0; frame < q.cols(); ++frame)
    com.col(frame) = pinocchio::centerOfMass(model, data, q.col(frame), false);
  return com;
}

}  // namespace dynacom
