// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE cone_projection
#include <algorithm>
#include <eiquadprog/eiquadprog-fast.hpp>
#include <vector>

#include "inference/cone_projection.hpp"
#include "test_tools.hpp"

using namespace dynacom_tests;
using dynacom::internal::ConeProjection;

namespace {

/// Points, each with its friction, and a wrench that is asked of them.
struct Problem {
  double scale = 0.33;  // metres
  Eigen::Matrix3Xd levers;
  std::vector<double> mu;
  Vector6 wrench;
};

Problem randomProblem(Random& random) {
  Problem problem;
  const Index points = random.integer(1, 8);
  problem.scale = random.uniform(0.1, 1.);
  problem.levers.resize(3, points);
  for (Index k = 0; k < points; ++k) {
    problem.levers.col(k) = random.vector3(0.5);
    problem.levers(2, k) -= 1.;
    problem.mu.push_back(random.uniform(0.3, 1.));
  }
  // Level ground now and then, where many edges are all but dependent.
  if (random.coin()) problem.levers.row(2).setConstant(-0.9);
  problem.wrench << random.vector3(), 0.3 * random.vector3();
  if (random.coin()) problem.wrench[2] += 2.;
  // Half of them within reach of all points.
  if (random.coin()) {
    problem.wrench.setZero();
    for (Index k = 0; k < points; ++k) {
      const double mu = problem.mu[static_cast<std::size_t>(k)];
      const Vector3d force =
          random.uniform(0., 1.) * Vector3d(random.uniform(-mu, mu), random.uniform(-mu, mu), 1.);
      problem.wrench.head<3>() += force;
      problem.wrench.tail<3>() += problem.levers.col(k).cross(force);
    }
  }
  problem.wrench *= random.uniform(1., 1000.);
  return problem;
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
  MatrixXd gives = MatrixXd::Zero(6, n), within = MatrixXd::Zero(5 * Index(active.size()), n);
  for (std::size_t i = 0; i < active.size(); ++i) {
    const Index column = 3 * Index(i), row = 5 * Index(i);
    const Vector3d lever = problem.levers.col(active[i]);
    const double mu = problem.mu[static_cast<std::size_t>(active[i])];
    for (int axis = 0; axis < 3; ++axis) {
      gives.block<3, 1>(0, column + axis) = Vector3d::Unit(axis);
      gives.block<3, 1>(3, column + axis) = lever.cross(Vector3d::Unit(axis));
    }
    within.block<5, 3>(row, column) << 0., 0., 1., -1., 0., mu, 1., 0., mu, 0., -1., mu, 0., 1., mu;
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
    const Problem problem = randomProblem(random);
    const auto set =
        static_cast<std::uint32_t>(random.integer(0, (Index(1) << problem.levers.cols()) - 1));
    ConeProjection projection(problem.scale);
    const auto found = projection.project(problem.wrench, problem.levers, problem.mu, set);
    compare(problem, set, found);
    (found.force < 1e-6 * problem.wrench.norm() ? reached : missed) += 1;
  }
  BOOST_TEST(reached > 20);
  BOOST_TEST(missed > 100);
}

BOOST_AUTO_TEST_CASE(the_last_answer_changes_how_fast_it_is_and_not_what_is_found) {
  Random random(2);
  Problem problem = randomProblem(random);
  while (problem.levers.cols() < 5) problem = randomProblem(random);
  ConeProjection warm(problem.scale);
  for (int step = 0; step < 400; ++step) {
    // A little further, now and then somewhere else, and with other points.
    if (step % 40 == 39) problem.wrench = 300. * random.vector(6);
    problem.wrench += 0.02 * problem.wrench.norm() * random.vector(6);
    problem.levers += 0.002 * MatrixXd::NullaryExpr(3, problem.levers.cols(),
                                                    [&] { return random.uniform(-1., 1.); });
    const auto set = static_cast<std::uint32_t>(
        step % 3 == 0 ? random.integer(1, (Index(1) << problem.levers.cols()) - 1)
                      : (Index(1) << problem.levers.cols()) - 1);
    compare(problem, set, warm.project(problem.wrench, problem.levers, problem.mu, set));
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
  problem.mu.assign(8, 0.7);
  ConeProjection exact(1., ConeProjection::kExact), coarse(1.);
  for (ConeProjection* projection : {&exact, &coarse})
    projection->project(problem.wrench, problem.levers, problem.mu, 0xff);
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
  const Problem problem = randomProblem(random);
  ConeProjection projection(problem.scale);
  const auto nobody = projection.project(problem.wrench, problem.levers, problem.mu, 0);
  BOOST_TEST(close(nobody.force, problem.wrench.head<3>().norm()));
  BOOST_TEST(close(nobody.torque, problem.wrench.tail<3>().norm()));
  const auto nothing = projection.project(Vector6::Zero(), problem.levers, problem.mu, 1);
  BOOST_TEST(nothing.force == 0.);
  BOOST_TEST(nothing.torque == 0.);
}

BOOST_AUTO_TEST_CASE(a_point_gives_what_lies_in_its_pyramid_and_nothing_of_what_pulls) {
  Eigen::Matrix3Xd levers(3, 1);
  levers << 0.1, -0.2, -1.;
  const Vector3d lever = levers.col(0);
  const auto missing = [&](const Vector3d& force) {
    Vector6 wrench;
    wrench << force, lever.cross(force);
    return ConeProjection(0.33).project(wrench, levers, {0.5}, 1);
  };
  BOOST_TEST(missing({0.5, -0.5, 1.}).force < 1e-9);
  BOOST_TEST(missing({0.1, 0.2, 1.}).force < 1e-9);
  BOOST_TEST(missing({0.6, 0., 1.}).force > 0.01);
  BOOST_TEST(close(missing({0., 0., -2.}).force, 2.));
}
