// SPDX-License-Identifier: BSD-2-Clause
#include "cone_projection.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace dynacom::internal {

namespace {

// A direction is taken to be within the span of the others if the square of its part outside is
// smaller than this.
constexpr double kDependent = 1e-10;
// Each round adds an edge, and the distance decreases; there are few rounds in practice.
constexpr int kRounds = 60;

}  // namespace

ConeProjection::Vector6 ConeProjection::direction(const Edge& edge, const Eigen::Matrix3Xd& levers,
                                                  const std::vector<double>& mu) const {
  const double friction = mu[static_cast<std::size_t>(edge.point)];
  const Eigen::Vector3d force(edge.x * friction, edge.y * friction, 1.);
  const Eigen::Vector3d lever = levers.col(edge.point);
  Vector6 wrench;
  wrench << force, lever.cross(force) / lever_;
  return wrench;
}

void ConeProjection::add(const Edge& edge, const Vector6& column) {
  edges_[count_] = edge;
  factors_[count_] = 0.;
  columns_.col(count_) = column;
  for (int k = 0; k <= count_; ++k) products_[count_][k] = columns_.col(k).dot(column);
  pulls_[count_] = column.dot(target_);
  ++count_;
}

void ConeProjection::drop(int position) {
  --count_;
  decomposed_ = std::min(decomposed_, position);
  for (int k = position; k < count_; ++k) {
    edges_[k] = edges_[k + 1];
    factors_[k] = factors_[k + 1];
    columns_.col(k) = columns_.col(k + 1);
    pulls_[k] = pulls_[k + 1];
    for (int i = 0; i <= k; ++i) products_[k][i] = products_[k + 1][i + (i >= position)];
  }
}

// The factors of least squares, by Cholesky's decomposition of the normal equations, of which the
// rows are kept that are still those of the same edges; false if the last edge is within the span
// of the others.
bool ConeProjection::solve() {
  for (; decomposed_ < count_; ++decomposed_) {
    const int i = decomposed_;
    double rhs = pulls_[i], sum = products_[i][i];
    for (int j = 0; j < i; ++j) {
      double product = products_[i][j];
      for (int k = 0; k < j; ++k) product -= L_[i][k] * L_[j][k];
      L_[i][j] = product * inverse_[j];
      rhs -= L_[i][j] * y_[j];
      sum -= L_[i][j] * L_[i][j];
    }
    if (!(sum > kDependent)) return false;
    inverse_[i] = 1. / std::sqrt(sum);
    y_[i] = rhs * inverse_[i];
  }
  for (int i = count_ - 1; i >= 0; --i) {
    double value = y_[i];
    for (int k = i + 1; k < count_; ++k) value -= L_[k][i] * solution_[k];
    solution_[i] = value * inverse_[i];
  }
  return true;
}

double ConeProjection::lift(std::uint32_t set) const {
  double sum = 0.;
  for (int k = 0; k < count_; ++k)
    if (set >> edges_[k].point & 1u) sum += factors_[k] * columns_(2, k);
  return sum;
}

Eigen::Vector3d ConeProjection::force(int point) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int k = 0; k < count_; ++k)
    if (edges_[k].point == point) sum += factors_[k] * columns_.col(k).head<3>();
  return sum;
}

ConeProjection::Residual ConeProjection::project(const Vector6& wrench,
                                                 const Eigen::Matrix3Xd& levers,
                                                 const std::vector<double>& mu, std::uint32_t set) {
  target_ << wrench.head<3>(), wrench.tail<3>() / lever_;
  const double size = target_.norm();

  // What is left of the last answer, as far as its points are there.
  const std::array<Edge, kEdges> last = edges_;
  const int edges = std::exchange(count_, 0);
  decomposed_ = 0;
  for (int k = 0; k < edges; ++k)
    if (set >> last[k].point & 1u) add(last[k], direction(last[k], levers, mu));
  while (count_ > 0 && !solve()) drop(count_ - 1);
  for (;;) {  // of the old edges only those that push
    const auto least = std::min_element(solution_.begin(), solution_.begin() + count_);
    if (count_ == 0 || *least > 0.) break;
    drop(static_cast<int>(least - solution_.begin()));
    solve();
  }
  std::copy_n(solution_.begin(), count_, factors_.begin());

  Vector6& residual = residual_;
  // Edges that are within the span of those that push, although rounding says that they would help.
  std::array<Edge, kRounds> useless;
  auto useless_end = useless.begin();
  for (int round = 0; round < kRounds; ++round) {
    residual = target_;
    for (int k = 0; k < count_; ++k) residual -= factors_[k] * columns_.col(k);
    if (size == 0.) break;

    // The best edge of each point, and the best of these.
    const Eigen::Vector3d force = residual.head<3>(), torque = residual.tail<3>() / lever_;
    Edge best = {-1, 0, 0};
    double slope = gain_ * size;
    for (std::uint32_t rest = set; rest != 0; rest &= rest - 1) {
      const int point = __builtin_ctz(rest);
      const Eigen::Vector3d pull = force + torque.cross(Eigen::Vector3d(levers.col(point)));
      const double friction = mu[static_cast<std::size_t>(point)];
      const double value = friction * (std::abs(pull.x()) + std::abs(pull.y())) + pull.z();
      if (value <= slope) continue;
      const Edge edge = {std::int8_t(point), std::int8_t(pull.x() < 0. ? -1 : 1),
                         std::int8_t(pull.y() < 0. ? -1 : 1)};
      const auto known = edges_.begin() + count_;
      if (std::find(edges_.begin(), known, edge) != known ||
          std::find(useless.begin(), useless_end, edge) != useless_end)
        continue;
      best = edge;
      slope = value;
    }
    if (best.point < 0 || count_ == kEdges) break;
    add(best, direction(best, levers, mu));
    if (!solve()) {
      drop(count_ - 1);
      *useless_end++ = best;
      continue;
    }
    useless_end = useless.begin();
    // On the way to the new factors, whichever becomes zero first is left.
    for (;;) {
      double step = 1.;
      int leaving = -1;
      for (int k = 0; k < count_; ++k) {
        if (solution_[k] > 0.) continue;
        const double part =
            factors_[k] / std::max(factors_[k] - solution_[k], std::numeric_limits<double>::min());
        if (leaving < 0 || part < step) step = part, leaving = k;
      }
      if (leaving < 0) break;
      for (int k = 0; k < count_; ++k) factors_[k] += step * (solution_[k] - factors_[k]);
      drop(leaving);
      if (count_ == 0) break;
      solve();
    }
    std::copy_n(solution_.begin(), count_, factors_.begin());
  }
  return {residual.head<3>().norm(), residual.tail<3>().norm() * lever_};
}

}  // namespace dynacom::internal
