// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE ground_plane
#include <limits>
#include <sstream>

#include "dynacom/ground_plane.hpp"
#include "test_tools.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

const double kNaN = std::numeric_limits<double>::quiet_NaN();
const double kInfinity = std::numeric_limits<double>::infinity();

/// A plane, and axes on it: z is its normal.
struct Slope {
  explicit Slope(Random& random) : oMp(random.placement()) {
    plane.point = oMp.translation();
    plane.normal = random.uniform(0.1, 10.) * normal();
  }
  Vector3d normal() const { return oMp.rotation().col(2); }
  double heightOf(const Vector3d& point) const { return oMp.actInv(point).z(); }

  SE3 oMp;
  GroundPlane plane;
};

/// A wrench that presses on the slope with 50 N or more.
CentroidalWrench pressingOn(const Slope& slope, Random& random) {
  Vector3d force = random.vector3(100.);
  force.z() = random.uniform(50., 500.);
  return {slope.oMp.rotation() * force, random.vector3(100.)};
}

/// The moment of a wrench about another point than c.
Vector3d momentAbout(const Vector3d& point, const CentroidalWrench& wrench, const Vector3d& com) {
  return wrench.torque + (com - point).cross(wrench.force);
}

}  // namespace

BOOST_AUTO_TEST_CASE(by_default_the_plane_is_the_horizontal_one_through_the_origin) {
  const GroundPlane plane;
  plane.validate();
  BOOST_TEST(close(plane.point, Vector3d::Zero(), 0.));
  BOOST_TEST(close(plane.normal, Vector3d::UnitZ(), 0.));
}

BOOST_AUTO_TEST_CASE(centre_of_pressure_is_that_of_forces_on_the_slope) {
  // Wherever on the slope forces press, and however they pull sideways: each presses by its part
  // along the normal, and the centre is the mean by that.
  Random random(1);
  for (int trial = 0; trial < 200; ++trial) {
    const Slope slope(random);
    const Vector3d com = random.vector3(2.);
    CentroidalWrench wrench{Vector3d::Zero(), Vector3d::Zero()};
    Vector3d sum = Vector3d::Zero();
    double total = 0.;
    for (int i = 0; i < 5; ++i) {
      const Vector3d at =
          slope.oMp.act(Vector3d(random.uniform(-1., 1.), random.uniform(-1., 1.), 0.));
      const double pressure = random.uniform(1., 100.);
      const Vector3d force = slope.oMp.rotation() * Vector3d(random.uniform(-50., 50.),
                                                             random.uniform(-50., 50.), pressure);
      wrench.force += force;
      wrench.torque += (at - com).cross(force);
      sum += pressure * at;
      total += pressure;
    }
    BOOST_TEST(close(computeCoP(wrench, com, slope.plane), sum / total));
  }
}

BOOST_AUTO_TEST_CASE(about_the_centre_of_pressure_the_moment_is_parallel_to_the_normal) {
  Random random(2);
  for (int trial = 0; trial < 200; ++trial) {
    const Slope slope(random);
    const CentroidalWrench wrench = pressingOn(slope, random);
    const Vector3d com = random.vector3(2.), cop = computeCoP(wrench, com, slope.plane);
    BOOST_TEST(close(slope.heightOf(cop), 0.));
    const Vector3d moment = momentAbout(cop, wrench, com);
    BOOST_TEST(close(moment.cross(slope.normal()), Vector3d::Zero(), 1e-10));
    // Whatever the moments are about.
    const Vector3d other = random.vector3(2.);
    const CentroidalWrench same{wrench.force, momentAbout(other, wrench, com)};
    BOOST_TEST(close(computeCoP(same, other, slope.plane), cop, 1e-11));
  }
}

BOOST_AUTO_TEST_CASE(whoever_lies_on_the_slope_sees_flat_ground) {
  Random random(3);
  for (int trial = 0; trial < 200; ++trial) {
    const Slope slope(random);
    const CentroidalWrench wrench = pressingOn(slope, random);
    const Vector3d com = random.vector3(2.);
    const Matrix3d pRo = slope.oMp.rotation().transpose();
    const Vector2d cop =
        computeFlatGroundCoP({pRo * wrench.force, pRo * wrench.torque}, slope.oMp.actInv(com));
    BOOST_TEST(
        close(computeCoP(wrench, com, slope.plane), slope.oMp.act(Vector3d(cop.x(), cop.y(), 0.))));
  }
}

BOOST_AUTO_TEST_CASE(a_horizontal_plane_is_flat_ground) {
  Random random(4);
  for (int trial = 0; trial < 100; ++trial) {
    CentroidalWrench wrench{random.vector3(100.), random.vector3(100.)};
    wrench.force.z() = random.uniform(1., 500.);
    const Vector3d com = random.vector3(2.);
    const double height = random.uniform(-1., 1.);
    const Vector3d cop = computeCoP(wrench, com, {Vector3d(0., 0., height), Vector3d::UnitZ()});
    // To the last digit.
    BOOST_TEST(close(cop.head<2>(), computeFlatGroundCoP(wrench, com, height), 0.));
    BOOST_TEST(close(cop.z(), height, 1e-15));
  }
}

BOOST_AUTO_TEST_CASE(neither_which_point_nor_how_long_the_normal_is_matters) {
  Random random(5);
  for (int trial = 0; trial < 50; ++trial) {
    const Slope slope(random);
    const CentroidalWrench wrench = pressingOn(slope, random);
    const Vector3d com = random.vector3(2.), cop = computeCoP(wrench, com, slope.plane);
    const Vector3d pivot = computeCMP(wrench.force, com, slope.plane);
    for (const double length : {1e-310, 1e-200, 1e-3, 1e200, 1.5e308}) {
      GroundPlane same = slope.plane;
      same.point = slope.oMp.act(Vector3d(random.uniform(-5., 5.), random.uniform(-5., 5.), 0.));
      same.normal = length * slope.normal();
      // Of the smallest numbers few digits are left.
      const double tolerance = length < 1e-300 ? 1e-9 : 1e-12;
      BOOST_TEST(close(computeCoP(wrench, com, same), cop, tolerance));
      BOOST_TEST(close(computeCMP(wrench.force, com, same), pivot, tolerance));
    }
  }
}

BOOST_AUTO_TEST_CASE(centroidal_moment_pivot_is_on_the_line_of_the_force) {
  Random random(6);
  for (int trial = 0; trial < 200; ++trial) {
    const Slope slope(random);
    const CentroidalWrench wrench = pressingOn(slope, random);
    const Vector3d com = random.vector3(2.);
    const Vector3d pivot = computeCMP(wrench.force, com, slope.plane);
    BOOST_TEST(close(slope.heightOf(pivot), 0.));
    BOOST_TEST(close((com - pivot).cross(wrench.force), Vector3d::Zero(), 1e-10));
    // Without a moment about the CoM it is the centre of pressure.
    BOOST_TEST(close(computeCoP({wrench.force, Vector3d::Zero()}, com, slope.plane), pivot));
  }
}

BOOST_AUTO_TEST_CASE(centroidal_moment_pivot_by_hand) {
  // 0.8 m below the CoM, a force of 1 in 10 along x has gone back 0.08 m. The distance to the
  // centre of pressure is (τ_y, −τ_x) / f_z.
  const CentroidalWrench wrench{Vector3d(10., -20., 100.), Vector3d(5., 7., 9.)};
  const Vector3d com(1., 2., 0.8);
  const Vector3d pivot = computeCMP(wrench.force, com, GroundPlane());
  BOOST_TEST(close(pivot, Vector3d(1. - 0.08, 2. + 0.16, 0.)));
  const Vector2d cop = computeFlatGroundCoP(wrench, com);
  BOOST_TEST(close(pivot.head<2>(), cop + Vector2d(7., -5.) / 100.));
}

BOOST_AUTO_TEST_CASE(a_wall_is_a_plane) {
  // 40 N against the wall x = 1, 30 N up along it, 0.5 m before the wall.
  const GroundPlane wall{Vector3d(1., 0., 0.), Vector3d(-1., 0., 0.)};
  const Vector3d com(0.5, 2., 0.8);
  const CentroidalWrench wrench{Vector3d(-40., 0., 30.), Vector3d(9., 4., -8.)};
  BOOST_TEST(close(computeCMP(wrench.force, com, wall), Vector3d(1., 2., 0.8 - 0.5 * 30. / 40.)));
  // The force at (1, y, z): τ_y = −40 (z − 0.8) − 30 · 0.5, τ_z = 40 (y − 2).
  BOOST_TEST(
      close(computeCoP(wrench, com, wall), Vector3d(1., 2. - 8. / 40., 0.8 - (15. + 4.) / 40.)));
  // The other side of the wall is not pressed on.
  BOOST_TEST(allNaN(computeCoP(wrench, com, {wall.point, -wall.normal})));
}

BOOST_AUTO_TEST_CASE(without_normal_force_there_is_nothing) {
  Random random(7);
  for (const double least : {1e-6, 1., 50.}) {
    const GroundPlane plane{random.vector3(), Vector3d(0., -3., 4.)};
    const Vector3d normal(0., -0.6, 0.8), lateral(0., 0.8, 0.6), com = random.vector3();
    for (const double size : {0.999 * least, 0., -2. * least, kNaN}) {
      const Vector3d force = size * normal + 20. * lateral;
      BOOST_TEST(allNaN(computeCoP({force, Vector3d::Ones()}, com, plane, least)));
      BOOST_TEST(allNaN(computeCMP(force, com, plane, least)));
    }
    const Vector3d force = 1.001 * least * normal + 2. * least * lateral;
    BOOST_TEST(computeCoP({force, Vector3d::Ones()}, com, plane, least).allFinite());
    BOOST_TEST(computeCMP(force, com, plane, least).allFinite());
  }
  for (const double size : {std::nextafter(1., 0.), 1.}) {  // by default 1 N
    BOOST_TEST(allNaN(computeCMP({0., 0., size}, Vector3d::Ones(), GroundPlane())) == (size < 1.));
    BOOST_TEST(allNaN(computeCoP({{0., 0., size}, Vector3d::Ones()}, Vector3d::Ones(),
                                 GroundPlane())) == (size < 1.));
  }
}

BOOST_AUTO_TEST_CASE(what_is_beyond_the_largest_numbers_is_none) {
  const Vector3d up(0., 0., 1e-300), com = Vector3d::UnitZ();
  BOOST_TEST(allNaN(computeCoP({up, Vector3d(0., 1e10, 0.)}, com, GroundPlane(), 1e-305)));
  BOOST_TEST(allNaN(computeCMP(up + Vector3d(1e10, 0., 0.), com, GroundPlane(), 1e-305)));
  for (const double bad : {kNaN, kInfinity}) {
    BOOST_TEST(allNaN(computeCoP({Vector3d(0., 0., bad), Vector3d::Zero()}, com, GroundPlane())));
    BOOST_TEST(
        allNaN(computeCoP({Vector3d(0., 0., 9.), Vector3d(bad, 0., 0.)}, com, GroundPlane())));
    BOOST_TEST(allNaN(computeCMP(Vector3d(0., 0., 9.), Vector3d(0., bad, 0.), GroundPlane())));
  }
}

BOOST_AUTO_TEST_CASE(planes_that_are_none_are_refused) {
  const auto refused = [](const GroundPlane& plane, std::initializer_list<std::string> words) {
    const Vector3d up = Vector3d::UnitZ();
    BOOST_TEST(throws<std::invalid_argument>([&] { plane.validate(); }, words));
    BOOST_TEST(throws<std::invalid_argument>([&] { computeCoP({up, up}, up, plane); }, words));
    BOOST_TEST(throws<std::invalid_argument>([&] { computeCMP(up, up, plane); }, words));
  };
  refused({Vector3d::Zero(), Vector3d::Zero()}, {"GroundPlane.normal", "not zero", "0 0 0"});
  for (int i = 0; i < 3; ++i) {
    for (const auto& [bad, text] :
         {std::pair<double, const char*>(kNaN, "nan"), {kInfinity, "inf"}, {-kInfinity, "-inf"}}) {
      GroundPlane plane;
      plane.normal[i] = bad;
      refused(plane, {"GroundPlane.normal", "finite", text});
      plane = GroundPlane();
      plane.point[i] = bad;
      refused(plane, {"GroundPlane.point", "finite", text});
    }
  }
}

BOOST_AUTO_TEST_CASE(planes_compare_and_print_by_every_field) {
  const GroundPlane plane{Vector3d(0.25, 0., -1.), Vector3d(0., 3., 4.)};
  GroundPlane other = plane;
  BOOST_TEST((plane == other));
  BOOST_TEST(!(plane != other));
  BOOST_TEST(mentions(plane.to_string(), "point=[0.25"));
  BOOST_TEST(mentions(plane.to_string(), "normal=[0 3 4]"));
  std::ostringstream out;
  out << plane;
  BOOST_TEST(out.str() == plane.to_string());
  other.point.z() = 1.;
  BOOST_TEST((plane != other));
  BOOST_TEST(!(plane == other));
  other = plane;
  other.normal.x() = 1.;
  BOOST_TEST((plane != other));
}
