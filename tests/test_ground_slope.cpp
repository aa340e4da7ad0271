// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE ground_slope
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "inference/ground_slope.hpp"
#include "test_tools.hpp"

using namespace dynacom_tests;
using dynacom::internal::findGroundSlopes;
using dynacom::internal::Footing;

namespace {

using Footings = std::vector<Footing>;
using Ground = std::function<double(double, double)>;

// Contacts that are points, one after the other.
Footings asPoints(const Eigen::Matrix3Xd& points) {
  Footings footings;
  for (Index k = 0; k < points.cols(); ++k)
    footings.push_back({std::size_t(k % 4), points.middleCols(k, 1)});
  return footings;
}

// So many places that are stood on, in the plane of a gradient.
Eigen::Matrix3Xd stand(Random& random, const Vector2d& gradient, Index count) {
  Eigen::Matrix3Xd points(3, count);
  for (Index k = 0; k < count; ++k) {
    points.col(k) << random.uniform(-2., 2.), random.uniform(-2., 2.), 0.;
    points(2, k) = 0.3 + gradient.dot(points.col(k).head<2>());
  }
  return points;
}

// A sole of 0.2 m times 0.12 m whose middle is on the ground.
Footing makeSole(std::size_t contact, const Vector3d& middle, const Vector2d& tilt) {
  Footing sole = {contact, Eigen::Matrix3Xd(3, 4)};
  sole.points.topRows<2>() << -0.1, -0.1, 0.1, 0.1, -0.06, 0.06, -0.06, 0.06;
  sole.points.row(2) = tilt.transpose() * sole.points.topRows<2>();
  sole.points.colwise() += middle;
  return sole;
}

// Steps along x, with soles as flat on the ground as they can be, or level.
Footings walk(const Ground& ground, int steps, bool is_level = false, double stride = 0.25) {
  Footings footings;
  for (int k = 0; k < steps; ++k) {
    const double x = stride * double(std::max(k - 1, 0)), y = k % 2 == 0 ? 0.1 : -0.1;
    constexpr double d = 1e-6;
    const Vector2d tilt((ground(x + d, y) - ground(x - d, y)) / (2. * d),
                        (ground(x, y + d) - ground(x, y - d)) / (2. * d));
    footings.push_back(makeSole(std::size_t(k % 2), Vector3d(x, y, ground(x, y)),
                                is_level ? Vector2d::Zero() : tilt));
  }
  return footings;
}

// Heights are off by as much as this at the most: those of soles as a whole, and those of corners.
void addNoise(Random& random, double sole, double corner, Footings& footings) {
  for (Footing& footing : footings) {
    footing.points.row(2).array() += random.uniform(-sole, sole);
    footing.points.row(2) += random.vector(footing.points.cols(), corner).transpose();
  }
}

bool isLevel(const Footings& footings) {
  const auto slopes = findGroundSlopes(footings);
  return slopes.size() == footings.size() &&
         std::all_of(slopes.begin(), slopes.end(), [](const Vector2d& s) { return s.isZero(0.); });
}

// Whether all have one slope.
boost::test_tools::predicate_result allHave(const Footings& footings, const Vector2d& gradient,
                                            double tolerance) {
  for (const Vector2d& slope : findGroundSlopes(footings)) {
    const auto result = close(slope, gradient, tolerance);
    if (!result) return result;
  }
  return true;
}

Ground makeRamp(double degrees, double from, double to) {
  const double gradient = std::tan(degrees * std::acos(-1.) / 180.);
  return [=](double x, double) { return gradient * (std::clamp(x, from, to) - from); };
}

}  // namespace

BOOST_AUTO_TEST_CASE(a_plane_is_found_by_its_gradient) {
  Random random(1);
  for (int trial = 0; trial < 50; ++trial) {
    const Vector2d gradient(random.uniform(0.02, 0.3), random.uniform(-0.3, 0.3));
    Eigen::Matrix3Xd points = stand(random, gradient, 12);
    BOOST_TEST(allHave(asPoints(points), gradient, 1e-12));
    for (Index k = 0; k < points.cols(); ++k) points(2, k) += random.uniform(-1e-3, 1e-3);
    BOOST_TEST(allHave(asPoints(points), gradient, 3e-3));
  }
}

BOOST_AUTO_TEST_CASE(along_a_line_nothing_is_said_of_what_lies_across) {
  Eigen::Matrix3Xd points(3, 8);
  for (Index k = 0; k < 8; ++k) points.col(k) << 0.3 * double(k), 0., 0.03 * double(k);
  BOOST_TEST(allHave(asPoints(points), Vector2d(0.1, 0.), 1e-12));
  // Nor if it is no straight line by a hair.
  for (Index k = 0; k < 8; ++k) points.col(k).tail<2>() += Vector2d(1e-3, 1e-3) * double(k % 2);
  BOOST_TEST(allHave(asPoints(points), Vector2d(0.1, 0.), 1e-3));
}

BOOST_AUTO_TEST_CASE(level_ground_stairs_and_few_places_are_no_slope) {
  Random random(2);
  BOOST_TEST(isLevel(asPoints(stand(random, Vector2d::Zero(), 12))));
  BOOST_TEST(isLevel(asPoints(stand(random, Vector2d(0.01, 0.), 200))));  // half a degree
  Eigen::Matrix3Xd low = stand(random, Vector2d(0.02, 0.), 200);          // and less than 2 cm
  low.topRows<2>() *= 0.2, low.row(2) = (0.02 * low.row(0)).eval();
  BOOST_TEST(isLevel(asPoints(low)));
  BOOST_TEST(isLevel(asPoints(stand(random, Vector2d(0.2, 0.), 5))));
  BOOST_TEST(isLevel({}));
  Eigen::Matrix3Xd stairs(3, 12);
  for (Index k = 0; k < 12; ++k) stairs.col(k) << 0.1 * double(k), 0., 0.15 * double(k / 3);
  BOOST_TEST(isLevel(asPoints(stairs)));
  for (const double tread : {0.25, 0.5})
    for (const double riser : {0.03, 0.05, 0.1, 0.15, 0.2})
      BOOST_TEST(isLevel(
          walk([&](double x, double) { return riser * std::floor(x / tread + 0.3); }, 14, true)));
  // A board that is stepped on, whatever is stood on before and behind it.
  for (const double height : {0.03, 0.05, 0.1})
    for (const double from : {0.3, 0.8})
      for (const double stride : {0.25, 0.5})
        BOOST_TEST(isLevel(
            walk([&](double x, double) { return x < from ? 0. : height; }, 6, true, stride)));
}

BOOST_AUTO_TEST_CASE(feet_that_are_tilted_where_it_is_level_are_on_no_slope) {
  // Side by side, heels up; one of them a bit ahead; and a single one that never moves.
  const Vector2d heel(-0.15, 0.);
  const Footings soles = {makeSole(0, {0., 0.15, 0.015}, heel),
                          makeSole(1, {0., -0.15, 0.015}, heel)};
  BOOST_TEST(isLevel(soles));
  BOOST_TEST(isLevel({soles[0], makeSole(1, {0.3, -0.15, 0.015}, heel)}));
  for (const double tilt : {0.05, 0.2, 0.5}) {
    BOOST_TEST(isLevel({makeSole(0, Vector3d::Zero(), {tilt, 0.})}));
    // Who walks on tiptoe, or with soles that lean outward.
    Footings tiptoe = walk([](double, double) { return 0.; }, 12), outward = tiptoe;
    for (Footing& sole : tiptoe)
      sole = makeSole(sole.contact, sole.points.rowwise().mean(), {-tilt, 0.});
    for (Footing& sole : outward)
      sole = makeSole(sole.contact, sole.points.rowwise().mean(),
                      {0., sole.contact == 0 ? -tilt : tilt});
    BOOST_TEST(isLevel(tiptoe));
    BOOST_TEST(isLevel(outward));
  }
}

BOOST_AUTO_TEST_CASE(noise_is_no_slope) {
  Random random(3);
  for (int trial = 0; trial < 100; ++trial)
    for (const int steps : {10, 60}) {
      Footings footings = walk([](double, double) { return 0.; }, steps);
      addNoise(random, 0.01, 0.01, footings);
      BOOST_TEST(isLevel(footings));
      for (Footing& footing : footings) footing.points = footing.points.rowwise().mean().eval();
      BOOST_TEST(isLevel(footings));
    }
}

BOOST_AUTO_TEST_CASE(feet_that_are_never_flat_are_on_no_slope_where_they_float_too) {
  Random random(5);
  int found = 0;
  for (int trial = 0; trial < 200; ++trial) {
    Footings footings = walk([](double, double) { return 0.; }, trial % 2 == 0 ? 10 : 60);
    for (Footing& sole : footings) {
      const Vector3d middle = sole.points.rowwise().mean();
      sole = makeSole(sole.contact, middle + Vector3d(0., 0., random.uniform(-0.02, 0.02)),
                      Vector2d(-0.1 + random.uniform(-0.05, 0.05), random.uniform(-0.05, 0.05)));
    }
    found += !isLevel(footings);
  }
  // As good as none: some walks look like slopes by chance.
  BOOST_TEST(found <= 2);
}

BOOST_AUTO_TEST_CASE(a_ramp_between_level_ground_has_its_slope_and_the_rest_none) {
  for (const double degrees : {3., 5., 12., 20.}) {
    const Ground ramp = makeRamp(degrees, 0.85, 2.4);
    const Footings footings = walk(ramp, 16);
    const auto slopes = findGroundSlopes(footings);
    const double gradient = std::tan(degrees * std::acos(-1.) / 180.);
    for (std::size_t k = 0; k < footings.size(); ++k) {
      const double x = footings[k].points.row(0).mean();
      if (x > 0.85 && x < 2.4)
        BOOST_TEST(close(slopes[k], Vector2d(gradient, 0.), 1e-9));
      else
        BOOST_TEST(slopes[k].isZero(0.));
    }
  }
  // With noise, those that stand across its ends may be on either side.
  Random random(4);
  int found = 0, all = 0;
  for (int trial = 0; trial < 50; ++trial) {
    Footings footings = walk(makeRamp(8., 0.85, 2.4), 16);
    addNoise(random, 0.005, 0.005, footings);
    const auto slopes = findGroundSlopes(footings);
    for (std::size_t k = 0; k < footings.size(); ++k) {
      const double x = footings[k].points.row(0).mean();
      if (x < 0.6 || x > 2.6) BOOST_TEST(slopes[k].isZero(0.));
      if (x < 0.95 || x > 2.3) continue;
      ++all;
      if (slopes[k].isZero(0.)) continue;
      ++found;
      // By no more than if one foot were 0.5 cm too high, and the other too low, 0.2 m aside.
      BOOST_TEST(close(slopes[k], Vector2d(0.1405, 0.), 0.05));
    }
  }
  BOOST_TEST(found > 0.98 * all);
}

BOOST_AUTO_TEST_CASE(a_roof_has_two_slopes_and_a_ridge_one_for_each_foot) {
  const Footings roof = walk([](double x, double) { return 0.2 * std::min(x, 2.1 - x); }, 9);
  const auto slopes = findGroundSlopes(roof);
  for (std::size_t k = 0; k < roof.size(); ++k)
    BOOST_TEST(
        close(slopes[k], Vector2d(roof[k].points.row(0).mean() < 1.05 ? 0.2 : -0.2, 0.), 1e-9));
  // Along a ridge that rises; where it does not, feet just lean outward for all that is known.
  const Footings ridge = walk([](double x, double y) { return 0.1 * x - 0.2 * std::abs(y); }, 12);
  const auto sides = findGroundSlopes(ridge);
  for (std::size_t k = 0; k < ridge.size(); ++k)
    BOOST_TEST(close(sides[k], Vector2d(0.1, ridge[k].contact == 0 ? -0.2 : 0.2), 1e-9));
}

BOOST_AUTO_TEST_CASE(four_legs_find_a_ramp_by_where_they_step) {
  for (const double degrees : {5., 12.}) {
    const Ground ramp = makeRamp(degrees, 0.8, 2.3);
    Footings footings;
    for (int beat = 0; beat < 26; ++beat)
      for (int leg = 0; leg < 4; ++leg) {
        if ((leg == 0 || leg == 3) != (beat % 2 == 0)) continue;  // a trot
        Eigen::Matrix3Xd point(3, 1);
        point << 0.12 * beat + (leg < 2 ? 0.26 : -0.25), leg % 2 == 0 ? 0.15 : -0.15, 0.;
        point(2, 0) = ramp(point(0, 0), point(1, 0));
        footings.push_back({std::size_t(leg), point});
      }
    const auto slopes = findGroundSlopes(footings);
    for (std::size_t k = 0; k < footings.size(); ++k) {
      const double x = footings[k].points(0, 0);
      // Points within centimetres of its ends are in both planes.
      if (x > 0.85 && x < 2.25)
        BOOST_TEST(
            close(slopes[k], Vector2d(std::tan(degrees * std::acos(-1.) / 180.), 0.), 0.005));
      else if (x < 0.75 || x > 2.35)
        BOOST_TEST(slopes[k].isZero(0.));
    }
  }
}
