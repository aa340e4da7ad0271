// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE contact_set
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include "dynacom/contact_set.hpp"
#include "test_tools.hpp"

using namespace dynacom;
using namespace dynacom_tests;
using Eigen::Vector2d;

namespace {

constexpr double kPi = 3.14159265358979323846;

Eigen::Matrix2Xd square(double half) {
  return half * (Eigen::Matrix<double, 2, 4>() << 1, -1, -1, 1, 1, 1, -1, -1).finished();
}

}  // namespace

BOOST_AUTO_TEST_CASE(polygons_are_hulls_and_rectangles_are_known_as_such) {
  Eigen::Matrix2Xd points(2, 6);
  points << 1, -1, -1, 1, 0, 0.5,  //
      1, 1, -1, -1, 0, 1;
  BOOST_TEST((Section::polygon(points) == Section::rectangle({-1, -1}, {1, 1})));
  points(1, 4) = 3.;
  const Section house = Section::polygon(points);
  BOOST_TEST((house.shape() == Section::Shape::Polygon));
  BOOST_TEST(house.vertices().cols() == 5);
  for (Eigen::Index k = 0; k < 5; ++k) {
    const Vector2d a = house.vertices().col(k), b = house.vertices().col((k + 1) % 5);
    BOOST_TEST(a.x() * b.y() - a.y() * b.x() > 0.);  // counter-clockwise around the origin
  }
  BOOST_TEST((Section::polygon(Vector2d(1, 2)) == Section::rectangle({1, 2}, {1, 2})));
  BOOST_TEST((Section::facets(0.5, 4) == Section::rectangle({-0.5, -0.5}, {0.5, 0.5})));
}

BOOST_AUTO_TEST_CASE(supports_and_excesses_agree_with_each_other) {
  // A point is inside if no direction has it beyond the support.
  Eigen::Matrix2Xd points(2, 5);
  points << 1, 0.2, -0.5, 0.1, 0.9,  //
      0.5, 1, 0.4, -0.3, -0.1;
  for (const Section& section :
       {Section::disc(0.7), Section::polygon(points), Section::facets(0.7, 8, 0.1),
        Section::rectangle({-0.3, 0.1}, {0.5, 0.4}), Section::polygon(points.leftCols<2>())}) {
    std::mt19937_64 engine(3);
    const auto uniform = [&](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(engine);
    };
    for (int trial = 0; trial < 200; ++trial) {
      const double normal = uniform(0.1, 2.);
      const Vector2d point(uniform(-2., 2.), uniform(-2., 2.));
      double farthest = -std::numeric_limits<double>::infinity();
      for (int k = 0; k < 20000; ++k) {
        const Vector2d direction(std::cos(k * kPi / 1e4), std::sin(k * kPi / 1e4));
        farthest = std::max(farthest, direction.dot(point) - normal * section.support(direction));
      }
      // Inside both are how far the nearest side is; outside, a corner may be nearer than sides.
      const double excess = section.excess(point, normal);
      BOOST_TEST((excess > 1e-6) == (farthest > 1e-6));
      if (excess < 0. && section.vertices().cols() != 2)
        BOOST_TEST(std::abs(excess - farthest) < 1e-3);  // directions are 3e-4 apart
    }
  }
}

BOOST_AUTO_TEST_CASE(places_give_moments) {
  // A unit force at (x, y) has the moment (y, −x).
  const ContactSet set =
      ContactSet::surface(Section::disc(0.5), Section::rectangle({-0.1, -0.02}, {0.2, 0.05}), 0.03);
  Eigen::Matrix<double, 6, 1> force;
  force << 1., 2., 10., 0.5, -2., 0.3;  // at the corner (0.2, 0.05), and all the yaw moment
  BOOST_TEST(std::abs(set.excess(force)) < 1e-15);
  force[4] = 1.1;
  BOOST_TEST(std::abs(set.excess(force) - 0.1) < 1e-12);
  BOOST_TEST(set.isCone());
}

BOOST_AUTO_TEST_CASE(support_of_cones_is_nothing_or_infinite) {
  ContactSet set = ContactSet::point(Section::disc(0.5));
  BOOST_TEST(set.support(Eigen::Vector3d(0.3, 0.4, -0.3)) == 0.);
  BOOST_TEST(set.support(Eigen::Vector3d(0.3, 0.4, -0.2)) == ContactSet::kInfinity);
  set.boundNormalForce(10., 50.);
  BOOST_TEST(!set.isCone());
  BOOST_TEST(std::abs(set.support(Eigen::Vector3d(0.3, 0.4, -0.3)) + 0.5) < 1e-12);
  BOOST_TEST(std::abs(set.support(Eigen::Vector3d(0.3, 0.4, -0.2)) - 2.5) < 1e-12);
}

BOOST_AUTO_TEST_CASE(what_is_out_of_its_range_is_named) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  BOOST_TEST(throws<std::invalid_argument>([&] { Section::disc(-1.); }, {"radius", "-1"}));
  BOOST_TEST(throws<std::invalid_argument>([&] { Section::disc(nan); }, {"radius", "nan"}));
  BOOST_TEST(throws<std::invalid_argument>([&] { Section::facets(1., 3); }, {"facets", "4", "3"}));
  BOOST_TEST(throws<std::invalid_argument>([&] { Section::polygon(Eigen::Matrix2Xd(2, 0)); },
                                           {"polygon", "none"}));
  BOOST_TEST(throws<std::invalid_argument>(
      [&] {
        Section::rectangle({1., 0.}, {0., 1.});
      },
      {"rectangle"}));
  BOOST_TEST(throws<std::invalid_argument>(
      [&] { ContactSet::surface(Section::disc(1.), Section::polygon(square(0.1)), -0.1); },
      {"gamma", "-0.1"}));
  ContactSet set;
  BOOST_TEST(throws<std::invalid_argument>([&] { set.boundNormalForce(5., 1.); }, {"5", "1"}));
  BOOST_TEST(throws<std::invalid_argument>([&] { set.boundNormalForce(-1., 1.); }, {"-1"}));
  using Vector6 = ContactSet::Vector6;
  BOOST_TEST(throws<std::invalid_argument>(
      [&] { ContactSet::grasp(Vector6::Ones(), Vector6::Zero()); }, {"bounds"}));
  ContactSet grasp = ContactSet::grasp(-Vector6::Ones(), Vector6::Ones());
  BOOST_TEST(throws<std::invalid_argument>([&] { grasp.boundNormalForce(0., 1.); }, {"grasp"}));
}
