// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE ground_slope
#include <Eigen/Core>

#include "inference/ground_slope.hpp"
#include "test_tools.hpp"

using namespace dynacom_tests;
using dynacom::internal::findGroundSlope;

namespace {

// So many places that are stood on, in the plane of a gradient.
Eigen::Matrix3Xd stand(Random& random, const Vector2d& gradient, Index count) {
  Eigen::Matrix3Xd points(3, count);
  for (Index k = 0; k < count; ++k) {
    points.col(k) << random.uniform(-2., 2.), random.uniform(-2., 2.), 0.;
    points(2, k) = 0.3 + gradient.dot(points.col(k).head<2>());
  }
  return points;
}

}  // namespace

BOOST_AUTO_TEST_CASE(a_plane_is_found_by_its_gradient) {
  Random random(1);
  for (int trial = 0; trial < 50; ++trial) {
    const Vector2d gradient(random.uniform(0.02, 0.3), random.uniform(-0.3, 0.3));
    Eigen::Matrix3Xd points = stand(random, gradient, 12);
    BOOST_TEST(close(findGroundSlope(points), gradient, 1e-12));
    for (Index k = 0; k < points.cols(); ++k) points(2, k) += random.uniform(-1e-3, 1e-3);
    BOOST_TEST(close(findGroundSlope(points), gradient, 3e-3));
  }
}

BOOST_AUTO_TEST_CASE(along_a_line_nothing_is_said_of_what_lies_across) {
  Eigen::Matrix3Xd points(3, 8);
  for (Index k = 0; k < 8; ++k) points.col(k) << 0.3 * double(k), 0., 0.03 * double(k);
  BOOST_TEST(close(findGroundSlope(points), Vector2d(0.1, 0.), 1e-12));
}

BOOST_AUTO_TEST_CASE(level_ground_stairs_and_few_places_are_no_slope) {
  Random random(2);
  BOOST_TEST(findGroundSlope(stand(random, Vector2d::Zero(), 12)).isZero(0.));
  BOOST_TEST(findGroundSlope(stand(random, Vector2d(0.01, 0.), 12)).isZero(0.));  // half a degree
  BOOST_TEST(findGroundSlope(stand(random, Vector2d(0.2, 0.), 5)).isZero(0.));
  BOOST_TEST(findGroundSlope(Eigen::Matrix3Xd(3, 0)).isZero(0.));
  // Two soles side by side, whose heels are up.
  Eigen::Matrix3Xd soles(3, 8);
  soles << -0.1, -0.1, 0.1, 0.1, -0.1, -0.1, 0.1, 0.1,  //
      0.1, 0.2, 0.1, 0.2, -0.1, -0.2, -0.1, -0.2,       //
      0.03, 0.03, 0., 0., 0.03, 0.03, 0., 0.;
  BOOST_TEST(findGroundSlope(soles).isZero(0.));
  BOOST_TEST(close(findGroundSlope(5. * soles), Vector2d(-0.15, 0.), 1e-12));
  Eigen::Matrix3Xd stairs(3, 12);
  for (Index k = 0; k < 12; ++k) stairs.col(k) << 0.1 * double(k), 0., 0.15 * double(k / 3);
  BOOST_TEST(findGroundSlope(stairs).isZero(0.));
}
