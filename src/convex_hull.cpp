// SPDX-License-Identifier: BSD-2-Clause
#include "convex_hull.hpp"

#include <algorithm>
#include <limits>

namespace dynacom::internal {

namespace {

using Eigen::Vector2d;

// Twice the area of a triangle, positive where it is passed counter-clockwise.
double turn(const Vector2d& a, const Vector2d& b, const Vector2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

double distanceToSegment(const Vector2d& point, const Vector2d& a, const Vector2d& b) {
  const Vector2d along = b - a;
  const double square = along.squaredNorm();
  const double part = square > 0. ? std::clamp((point - a).dot(along) / square, 0., 1.) : 0.;
  return (point - a - part * along).norm();
}

}  // namespace

double distanceToHull(const Vector2d& point, std::vector<Vector2d>& corners) {
  if (corners.empty()) return std::numeric_limits<double>::infinity();
  const auto isBefore = [](const Vector2d& a, const Vector2d& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  };
  std::sort(corners.begin(), corners.end(), isBefore);

  // Nothing outside the box around a hull is inside the hull. This decides for flat hulls, which
  // have no inside: what lies on their line, beyond their ends, is on no side of it.
  const auto [lowest, highest] =
      std::minmax_element(corners.begin(), corners.end(),
                          [](const Vector2d& a, const Vector2d& b) { return a.y() < b.y(); });
  bool is_inside = point.x() >= corners.front().x() && point.x() <= corners.back().x() &&
                   point.y() >= lowest->y() && point.y() <= highest->y();
  double distance = (point - corners.front()).norm();

  // Andrew's monotone chains, which go around counter-clockwise together.
  std::vector<Vector2d> chain;
  const auto follow = [&](auto first, auto last) {
    chain.clear();
    for (; first != last; ++first) {
      while (chain.size() > 1 && turn(chain.end()[-2], chain.back(), *first) <= 0.)
        chain.pop_back();
      chain.push_back(*first);
    }
    for (std::size_t k = 1; k < chain.size(); ++k) {
      is_inside = is_inside && turn(chain[k - 1], chain[k], point) >= 0.;
      distance = std::min(distance, distanceToSegment(point, chain[k - 1], chain[k]));
    }
  };
  follow(corners.begin(), corners.end());
  follow(corners.rbegin(), corners.rend());
  return is_inside ? 0. : distance;
}

}  // namespace dynacom::internal
