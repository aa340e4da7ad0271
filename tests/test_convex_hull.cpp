// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE convex_hull
#include <algorithm>
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <random>

#include "convex_hull.hpp"

using Eigen::Vector2d;
using Corners = std::vector<Vector2d>;

namespace {

double distanceToHull(const Vector2d& point, Corners corners) {
  return dynacom::internal::distanceToHull(point, corners);
}

/// A hull is the union of all triangles between its corners, and its edge is among their edges.
double bySearch(const Vector2d& point, const Corners& corners) {
  const auto area = [](const Vector2d& a, const Vector2d& b, const Vector2d& c) {
    return (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x();
  };
  double distance = HUGE_VAL;
  for (const Vector2d& a : corners)
    for (const Vector2d& b : corners) {
      const Vector2d along = b - a;
      double part = along.squaredNorm() > 0. ? (point - a).dot(along) / along.squaredNorm() : 0.;
      part = std::min(std::max(part, 0.), 1.);
      distance = std::min(distance, (a + part * along - point).norm());
      for (const Vector2d& c : corners)
        if (area(a, b, c) > 0. && area(a, b, point) >= 0. && area(b, c, point) >= 0. &&
            area(c, a, point) >= 0.)
          return 0.;
    }
  return distance;
}

}  // namespace

BOOST_AUTO_TEST_CASE(random_hulls) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(-1., 1.);
  int inside = 0, outside = 0;
  for (int i = 0; i < 2000; ++i) {
    Corners corners(1 + i % 9);
    for (Vector2d& corner : corners) corner << place(random), place(random);
    if (i % 3 == 0) corners.push_back(corners.front());  // twice
    if (i % 4 == 0)                                      // on a grid: many in line
      for (Vector2d& corner : corners) corner = (2. * corner).array().round() / 2.;
    Vector2d point(place(random), place(random));
    if (i % 5 == 0) point = (2. * point).array().round() / 2.;
    const double distance = distanceToHull(point, corners);
    BOOST_TEST(std::abs(distance - bySearch(point, corners)) < 1e-12);
    ++(distance == 0. ? inside : outside);
  }
  BOOST_TEST(inside > 300);
  BOOST_TEST(outside > 300);
}

BOOST_AUTO_TEST_CASE(flat_hulls_have_no_inside) {
  BOOST_TEST(std::isinf(distanceToHull({0., 0.}, {})));
  BOOST_TEST(distanceToHull({3., 4.}, {{0., 0.}}) == 5.);
  BOOST_TEST(distanceToHull({3., 4.}, {{3., 4.}, {3., 4.}}) == 0.);
  // Beyond the ends of a line, on it, and beside it.
  const Corners line = {{1., 1.}, {3., 3.}, {2., 2.}};
  BOOST_TEST(distanceToHull({4., 4.}, line) == std::sqrt(2.));
  BOOST_TEST(distanceToHull({0., 0.}, line) == std::sqrt(2.));
  BOOST_TEST(distanceToHull({2.5, 2.5}, line) == 0.);
  BOOST_TEST(std::abs(distanceToHull({1., 3.}, line) - std::sqrt(2.)) < 1e-15);
}
