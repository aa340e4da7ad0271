// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE cone_projection
#include <algorithm>
#include <cmath>
#include <eiquadprog/eiquadprog-fast.hpp>
#include <vector>

#include "inference/cone_projection.hpp"
#include "test_tools.hpp"

using namespace dynacom_tests;
using dynacom::Section;
using dynacom::internal::ConeProjection;

namespace {

/// Points, each with its friction, and a wrench that is asked of them.
struct Problem {
  double scale = 0.33;  // metres
  Eigen::Matrix3Xd levers;
  std::vector<Section> friction;
  Vector6 wrench;

  std::uint32_t all() const { return static_cast<std::uint32_t>((1ull << levers.cols()) - 1); }
};

/// Pyramids, or other polygons with the origin in them.
Section randomPolygon(Random& random) {
  const double mu = random.uniform(0.3, 1.);
  switch (random.integer(0, 3)) {
    case 0:
      return Section::facets(mu, int(random.integer(5, 12)), random.uniform(0., 1.));
    case 1:
      return Section::rectangle({-mu, -0.1 * mu}, {0.3 * mu, random.uniform(0., 1.)});
    case 2: {
      Eigen::Matrix2Xd triangle(2, 3);
      triangle << mu, -0.5 * mu, -mu, 0., mu, -0.8 * mu;
      return Section::polygon(triangle);
    }
    default:
      return Section::facets(mu, 4);
  }
}

Section randomDisc(Random& random) { return Section::disc(random.uniform(0.3, 1.)); }

/// A point of a section, somewhere or on its rim.
Vector2d randomPlace(Random& random, const Section& section) {
  const Vector2d far(random.uniform(-2., 2.), random.uniform(-2., 2.));
  double low = 0., high = 1.;
  for (int step = 0; step < 50; ++step)
    (section.excess(0.5 * (low + high) * far, 1.) <= 0. ? low : high) = 0.5 * (low + high);
  return (random.coin() ? low : random.uniform(0., low)) * far;
}

Problem randomProblem(Random& random, Section (*randomSection)(Random&)) {
  Problem problem;
  const Index points = random.integer(1, 8);
  problem.scale = random.uniform(0.1, 1.);
  problem.levers.resize(3, points);
  for (Index k = 0; k < points; ++k) {
    problem.levers.col(k) = random.vector3(0.5);
    problem.levers(2, k) -= 1.;
    problem.friction.push_back(randomSection(random));
  }
  // Level ground now and then, where many edges are all but dependent.
  if (random.coin()) problem.levers.row(2).setConstant(-0.9);
  problem.wrench << random.vector3(), 0.3 * random.vector3();
  if (random.coin()) problem.wrench[2] += 2.;
  // Half of them within reach of all points.
  if (random.coin()) {
    problem.wrench.setZero();
    for (Index k = 0; k < points; ++k) {
      Vector3d force;
      force << randomPlace(random, problem.friction[static_cast<std::size_t>(k)]), 1.;
      force *= random.uniform(0., 1.);
      problem.wrench.head<3>() += force;
      problem.wrench.tail<3>() += problem.levers.col(k).cross(force);
    }
  }
  problem.wrench *= random.uniform(1., 1000.);
  return problem;
}

std::uint32_t randomSet(Random& random, const Problem& problem) {
  return static_cast<std::uint32_t>(random.integer(0, Index(problem.all())));
}

Section shrink(const Section& section) {
  switch (section.shape()) {
    case Section::Shape::Disc:
      return Section::disc(0.9 * section.radius());
    case Section::Shape::Polygon:
      return Section::polygon(0.9 * section.vertices());
    default:
      return Section::rectangle(0.9 * section.lower(), 0.9 * section.upper());
  }
}

/// The sides of a polygon, for forces: n·(f_x, f_y) ≤ n·v f_z, and f_z ≥ 0; rows that are ≥ 0.
MatrixXd sidesOf(const Section& section) {
  Eigen::Matrix2Xd corners = section.vertices();
  if (section.shape() == Section::Shape::Rectangle) {
    corners.resize(2, 4);
    corners << section.lower().x(), section.upper().x(), section.upper().x(), section.lower().x(),
        section.lower().y(), section.lower().y(), section.upper().y(), section.upper().y();
  }
  MatrixXd rows(corners.cols() + 1, 3);
  for (Index k = 0; k < corners.cols(); ++k) {
    const Vector2d side = corners.col((k + 1) % corners.cols()) - corners.col(k);
    const Vector2d outward = Vector2d(side.y(), -side.x()).normalized();
    rows.row(k) << -outward.transpose(), outward.dot(corners.col(k));
  }
  rows.row(corners.cols()) << 0., 0., 1.;
  return rows;
}

/// What a set of points cannot give of the wrench, by a general solver. Its variables are the
/// points' forces, so that no edge is computed; points of proximity make it regular.
Vector6 residualOf(const Problem& problem, std::uint32_t set) {
  std::vector<Index> active;
  for (Index k = 0; k < problem.levers.cols(); ++k)
    if (set >> k & 1u) active.push_back(k);
  Vector6 units;
  units << 1., 1., 1., Vector3d::Constant(1. / problem.scale);
  const double size = problem.wrench.norm();
  const Vector6 target = units.asDiagonal() * problem.wrench / size;
  const Index n = 3 * Index(active.size());
  MatrixXd gives = MatrixXd::Zero(6, n), within(0, n);
  for (std::size_t i = 0; i < active.size(); ++i) {
    const Index column = 3 * Index(i), row = within.rows();
    const Vector3d lever = problem.levers.col(active[i]);
    for (int axis = 0; axis < 3; ++axis) {
      gives.block<3, 1>(0, column + axis) = Vector3d::Unit(axis);
      gives.block<3, 1>(3, column + axis) = lever.cross(Vector3d::Unit(axis));
    }
    const MatrixXd sides = sidesOf(problem.friction[static_cast<std::size_t>(active[i])]);
    within.conservativeResize(row + sides.rows(), n);
    within.bottomRows(sides.rows()).setZero();
    within.block(row, column, sides.rows(), 3) = sides;
  }
  gives = units.asDiagonal() * gives;
  const double stiffness = 1e-4;
  VectorXd forces = VectorXd::Zero(n);
  Vector6 residual = target;
  for (int round = 0; n > 0 && round < 300; ++round) {
    eiquadprog::solvers::EiquadprogFast solver;
    solver.reset(n, 0, within.rows());
    const MatrixXd hessian = gives.transpose() * gives + stiffness * MatrixXd::Identity(n, n);
    const VectorXd gradient = -gives.transpose() * target - stiffness * forces;
    VectorXd next(n);
    const auto status = solver.solve_quadprog(hessian, gradient, MatrixXd(0, n), VectorXd(0),
                                              within, VectorXd::Zero(within.rows()), next);
    BOOST_REQUIRE((status == eiquadprog::solvers::EIQUADPROG_FAST_OPTIMAL));
    const double moved = (next - forces).norm();
    forces = next;
    residual = target - gives * forces;
    if (moved < 1e-9) break;
  }
  return size * (units.cwiseInverse().asDiagonal() * residual);
}

/// Checks that an answer is what its forces give, each within its cone, and that nothing that
/// points can give is closer, but for a part of the wrench: its residual pulls no point further,
/// and is orthogonal to what is given, (28) in docs/equations.md.
void prove(const Problem& problem, std::uint32_t set, const ConeProjection& projection,
           double gain) {
  Vector6 units;
  units << 1., 1., 1., Vector3d::Constant(1. / problem.scale);
  const double size = (units.asDiagonal() * problem.wrench).norm();
  const Vector6 residual = units.cwiseAbs2().asDiagonal() * projection.residual();
  Vector6 given = Vector6::Zero();
  for (Index k = 0; k < problem.levers.cols(); ++k) {
    const Section& section = problem.friction[static_cast<std::size_t>(k)];
    const Vector3d force = projection.force(int(k)), lever = problem.levers.col(k);
    given.head<3>() += force;
    given.tail<3>() += lever.cross(force);
    if (set >> k & 1u) {
      BOOST_TEST(section.excess(force.head<2>(), force.z()) <= 1e-12 * size);
      BOOST_TEST(force.z() >= 0.);
      const Vector3d pull = residual.head<3>() + residual.tail<3>().cross(lever);
      BOOST_TEST(section.support(pull.head<2>()) + pull.z() <= 2. * gain * size);
    } else {
      BOOST_TEST(force.isZero(0.));
    }
  }
  BOOST_TEST(close((given + projection.residual()) / size, problem.wrench / size, 1e-12));
  BOOST_TEST(std::abs(residual.dot(given)) <= 10. * gain * size * size);
  BOOST_TEST(close(projection.lift(set), given[2], 1e-12));
}

void compare(const Problem& problem, std::uint32_t set, const ConeProjection::Residual& found) {
  const Vector6 expected = residualOf(problem, set);
  const double size = problem.wrench.norm(), lever = problem.scale;
  const double force = expected.head<3>().norm(), torque = expected.tail<3>().norm();
  // What is least is this; its parts follow from it, with half as many digits.
  const auto square = [&](double f, double t) { return (f * f + t * t / (lever * lever)); };
  BOOST_TEST(close(square(found.force, found.torque) / (size * size),
                   square(force, torque) / (size * size), 1e-5));
  BOOST_TEST(close(found.force / size, force / size, 1e-3));
  BOOST_TEST(close(found.torque / size, torque / size, 1e-3));
}

}  // namespace

BOOST_AUTO_TEST_CASE(what_is_missing_is_what_a_general_solver_finds) {
  Random random(1);
  int reached = 0, missed = 0;
  for (int trial = 0; trial < 400; ++trial) {
    const Problem problem = randomProblem(random, randomPolygon);
    const std::uint32_t set = randomSet(random, problem);
    ConeProjection projection(problem.scale);
    const auto found = projection.project(problem.wrench, problem.levers, problem.friction, set);
    compare(problem, set, found);
    (found.force < 1e-6 * problem.wrench.norm() ? reached : missed) += 1;
  }
  BOOST_TEST(reached > 20);
  BOOST_TEST(missed > 100);
}

BOOST_AUTO_TEST_CASE(nothing_that_discs_and_polygons_give_is_closer) {
  Random random(4);
  const auto randomSection = [](Random& any) {
    return any.integer(0, 3) == 0 ? randomPolygon(any) : randomDisc(any);
  };
  int reached = 0, missed = 0;
  for (int trial = 0; trial < 6000; ++trial) {
    const Problem problem = randomProblem(random, randomSection);
    const std::uint32_t set = randomSet(random, problem);
    for (const double gain : {ConeProjection::kCoarse, ConeProjection::kExact}) {
      ConeProjection projection(problem.scale, gain);
      projection.project(problem.wrench, problem.levers, problem.friction, set);
      prove(problem, set, projection, gain);
    }
    ConeProjection projection(problem.scale);
    const auto found = projection.project(problem.wrench, problem.levers, problem.friction, set);
    (found.force < 1e-6 * problem.wrench.norm() ? reached : missed) += 1;
  }
  BOOST_TEST(reached > 200);
  BOOST_TEST(missed > 1000);
}

BOOST_AUTO_TEST_CASE(on_two_soles_that_slip_edges_are_all_but_dependent) {
  Problem problem;
  problem.scale = 1.;
  problem.levers.resize(3, 8);
  for (Index k = 0; k < 8; ++k)
    problem.levers.col(k) << (k & 1 ? 0.1 : -0.1) + 1e-6 * double(k),
        (k & 2 ? 0.05 : -0.05) + (k & 4 ? 0.1 : -0.1), -0.75;
  problem.friction.assign(8, Section::disc(0.7));
  ConeProjection warm(problem.scale, ConeProjection::kExact);
  for (int trial = 0; trial < 3000; ++trial) {
    // Pushed at a place of the ground, at which moments turn, too.
    const double angle = 0.002 * trial;
    const Vector3d place(0.1 * std::sin(3. * angle), 0.15 * std::sin(5. * angle), -0.75);
    const Vector3d force(0.9 * std::sin(7. * angle), 0.9 * std::cos(11. * angle), 1.);
    problem.wrench << force, place.cross(force);
    problem.wrench[5] += 0.03 * std::sin(13. * angle);
    ConeProjection cold(problem.scale, ConeProjection::kExact);
    for (ConeProjection* projection : {&cold, &warm}) {
      projection->project(problem.wrench, problem.levers, problem.friction, problem.all());
      prove(problem, problem.all(), *projection, ConeProjection::kExact);
    }
  }
}

BOOST_AUTO_TEST_CASE(the_last_answer_changes_how_fast_it_is_and_not_what_is_found) {
  Random random(2);
  for (const bool is_disc : {false, true}) {
    Problem problem = randomProblem(random, is_disc ? randomDisc : randomPolygon);
    while (problem.levers.cols() < 5)
      problem = randomProblem(random, is_disc ? randomDisc : randomPolygon);
    ConeProjection warm(problem.scale);
    for (int step = 0; step < 400; ++step) {
      // A little further, now and then somewhere else, and with other points.
      if (step % 40 == 39) problem.wrench = 300. * random.vector(6);
      problem.wrench += 0.02 * problem.wrench.norm() * random.vector(6);
      problem.levers += 0.002 * MatrixXd::NullaryExpr(3, problem.levers.cols(),
                                                      [&] { return random.uniform(-1., 1.); });
      const std::uint32_t set = step % 3 == 0 ? randomSet(random, problem) : problem.all();
      const auto found = warm.project(problem.wrench, problem.levers, problem.friction, set);
      if (!is_disc) compare(problem, set, found);
      prove(problem, set, warm, ConeProjection::kCoarse);
      // From that answer, it is there at once, with cones of another size, too.
      ConeProjection again(problem.scale);
      again.setAnswer(warm.answer());
      again.project(problem.wrench, problem.levers, problem.friction, set);
      BOOST_TEST(close(again.residual() / problem.wrench.norm(),
                       warm.residual() / problem.wrench.norm(), 2e-3));
      Problem other = problem;
      for (Section& section : other.friction) section = shrink(section);
      again.setAnswer(warm.answer());
      again.project(other.wrench, other.levers, other.friction, set);
      prove(other, set, again, ConeProjection::kCoarse);
    }
  }
}

BOOST_AUTO_TEST_CASE(facets_come_closer_to_the_disc_with_their_number) {
  Random random(5);
  for (int trial = 0; trial < 40; ++trial) {
    Problem problem = randomProblem(random, randomDisc);
    const std::vector<Section> discs = problem.friction;
    const auto missing = [&](const std::vector<Section>& friction) {
      ConeProjection projection(problem.scale, ConeProjection::kExact);
      projection.project(problem.wrench, problem.levers, friction, problem.all());
      Vector6 residual = projection.residual() / problem.wrench.norm();
      residual.tail<3>() /= problem.scale;
      return residual.norm();
    };
    const double exact = missing(discs);
    double last = 1.;
    for (const int facets : {8, 16, 32, 64}) {
      std::vector<Section> around, within;
      for (const Section& disc : discs) {
        around.push_back(Section::facets(disc.radius(), facets));
        within.push_back(
            Section::facets(disc.radius() * std::cos(3.14159265358979323846 / facets), facets));
      }
      const double least = missing(around), most = missing(within);
      BOOST_TEST(least <= exact + 1e-6);
      BOOST_TEST(most >= exact - 1e-6);
      BOOST_TEST(most - least <= 0.5 * last + 2e-6);  // a quarter, if all of it slips
      last = most - least;
    }
  }
}

BOOST_AUTO_TEST_CASE(turned_about_the_vertical_discs_give_the_same_turned) {
  Random random(6);
  for (int trial = 0; trial < 300; ++trial) {
    const Problem problem = randomProblem(random, randomDisc);
    const Matrix3d turn =
        Eigen::AngleAxisd(random.uniform(-3., 3.), Vector3d::UnitZ()).toRotationMatrix();
    const Eigen::Matrix3Xd levers = turn * problem.levers;
    Vector6 wrench;
    wrench << turn * problem.wrench.head<3>(), turn * problem.wrench.tail<3>();
    ConeProjection here(problem.scale, ConeProjection::kExact),
        turned(problem.scale, ConeProjection::kExact);
    here.project(problem.wrench, problem.levers, problem.friction, problem.all());
    turned.project(wrench, levers, problem.friction, problem.all());
    Vector6 expected;
    expected << turn * here.residual().head<3>(), turn * here.residual().tail<3>();
    const double size = problem.wrench.norm();
    BOOST_TEST(close(turned.residual() / size, expected / size, 1e-5));
  }
}

BOOST_AUTO_TEST_CASE(what_can_be_given_is_so_exactly_if_that_is_asked_for) {
  // A robot that sways to the front edges of its soles. All of its wrench can be given, but slopes
  // are small long before.
  Problem problem;
  problem.levers.resize(3, 8);
  problem.levers << 0.0707968, -0.129203, -0.129202, 0.0707982, 0.0667158, -0.133284, -0.133283,
      0.0667172,                                                                         //
      0.159872, 0.15987, 0.03987, 0.0398724, -0.0401276, -0.04013, -0.16013, -0.160128,  //
      -0.698994, -0.699019, -0.699018, -0.698993, -0.698994, -0.699019, -0.699018, -0.698993;
  problem.wrench << -0.0997131, 0.000951502, 1.00941, -5.33326e-07, -4.28365e-05, -5.54506e-07;
  problem.friction.assign(8, Section::facets(0.7, 4));
  ConeProjection exact(1., ConeProjection::kExact), coarse(1.);
  for (ConeProjection* projection : {&exact, &coarse})
    projection->project(problem.wrench, problem.levers, problem.friction, 0xff);
  BOOST_TEST(exact.residual().norm() < 1e-9);
  BOOST_TEST(coarse.residual().norm() > 1e-4);
  BOOST_TEST(coarse.residual().norm() < 1e-3);
  // Forces of points are those that make what is given.
  Vector6 given = Vector6::Zero();
  for (Index k = 0; k < 8; ++k) {
    given.head<3>() += exact.force(int(k));
    given.tail<3>() += problem.levers.col(k).cross(exact.force(int(k)));
  }
  BOOST_TEST(close(given + exact.residual(), problem.wrench));
}

BOOST_AUTO_TEST_CASE(nobody_gives_nothing_and_nothing_takes_nothing) {
  Random random(3);
  const Problem problem = randomProblem(random, randomDisc);
  ConeProjection projection(problem.scale);
  const auto nobody = projection.project(problem.wrench, problem.levers, problem.friction, 0);
  BOOST_TEST(close(nobody.force, problem.wrench.head<3>().norm()));
  BOOST_TEST(close(nobody.torque, problem.wrench.tail<3>().norm()));
  const auto nothing = projection.project(Vector6::Zero(), problem.levers, problem.friction, 1);
  BOOST_TEST(nothing.force == 0.);
  BOOST_TEST(nothing.torque == 0.);
}

BOOST_AUTO_TEST_CASE(a_point_gives_what_lies_in_its_cone_and_nothing_of_what_pulls) {
  Eigen::Matrix3Xd levers(3, 1);
  levers << 0.1, -0.2, -1.;
  const Vector3d lever = levers.col(0);
  const auto missing = [&](const Section& section, const Vector3d& force) {
    Vector6 wrench;
    wrench << force, lever.cross(force);
    ConeProjection projection(0.33, ConeProjection::kExact);
    return projection.project(wrench, levers, {section}, 1);
  };
  const Section pyramid = Section::facets(0.5, 4), cone = Section::disc(0.5);
  BOOST_TEST(missing(pyramid, {0.5, -0.5, 1.}).force < 1e-9);
  BOOST_TEST(missing(cone, {0.3, -0.4, 1.}).force < 1e-9);
  BOOST_TEST(missing(cone, {0.5, -0.5, 1.}).force > 0.01);
  for (const Section& section : {pyramid, cone}) {
    BOOST_TEST(missing(section, {0.1, 0.2, 1.}).force < 1e-9);
    BOOST_TEST(missing(section, {0.6, 0., 1.}).force > 0.01);
    BOOST_TEST(close(missing(section, {0., 0., -2.}).force, 2.));
  }
  BOOST_TEST(missing(Section(), {0., 0., 1.}).force == 0.);
  BOOST_TEST(missing(Section(), {0.1, 0., 1.}).force > 0.01);
}

BOOST_AUTO_TEST_CASE(a_force_alone_is_projected_on_its_cone) {
  // By elementary geometry: moments about the point cost what forces cannot do about them.
  Eigen::Matrix3Xd levers = Eigen::Matrix3Xd::Zero(3, 1);
  Random random(7);
  for (int trial = 0; trial < 200; ++trial) {
    const double mu = random.uniform(0.1, 1.5);
    Vector6 wrench;
    wrench << random.vector3(2.), random.vector3();
    ConeProjection projection(0.5, ConeProjection::kExact);
    projection.project(wrench, levers, {Section::disc(mu)}, 1);
    const double along = wrench.head<2>().norm(), normal = wrench[2];
    Vector3d expected = wrench.head<3>();
    if (mu * along <= -normal)
      expected.setZero();
    else if (along > mu * normal) {
      const double factor = (mu * along + normal) / (1. + mu * mu);
      expected << mu * factor / along * wrench.head<2>(), factor;
    }
    BOOST_TEST(close(projection.force(0), expected, 1e-9));
    BOOST_TEST(close(Vector3d(projection.residual().tail<3>()), Vector3d(wrench.tail<3>())));
  }
}
