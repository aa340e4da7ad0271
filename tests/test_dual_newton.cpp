// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE dual_newton
#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "dual_newton.hpp"
#include "feet.hpp"
#include "test_tools.hpp"
#include "two_stage.hpp"

using namespace dynacom;
using namespace dynacom_tests;
using dynacom::internal::BoxCone;
using dynacom::internal::DualNewton;
using dynacom::internal::Factors6;
using dynacom::internal::TwoStageSolver;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Vector6 = DistributionResult::Vector6;

namespace {

constexpr int kEnough = WrenchDistribution::kMaximalIterations;

MatrixXd inequalities(const ContactBase& contact) {
  MatrixXd A(contact.uni_rows() + contact.fri_rows(), contact.cols());
  A << contact.uni_A(), contact.fri_A();
  return A;
}

/// A contact where it is, as a distribution knows it.
DistributionResult::Contact describe(const ContactBase& contact) {
  DistributionResult::Contact described;
  described.A = inequalities(contact);
  described.weights = contact.reg_A();
  described.NE = contact.ne_A();
  described.force.setZero(contact.cols());
  described.active.setConstant(described.A.rows(), false);
  described.multipliers.setZero(described.A.rows());
  described.relaxation_multipliers.setZero(described.A.rows());
  return described;
}

/// Feet of a robot of 1 m, on ground that is flat but for 0.2 rad.
std::vector<DistributionResult::Contact> feet(Random& random) {
  std::vector<DistributionResult::Contact> contacts;
  for (Index count = random.integer(1, 4); count > 0; --count) {
    std::shared_ptr<ContactBase> contact = makePoint("foot");
    if (random.coin()) contact = makeSole("foot");
    const Vector3d tilt = random.vector(3, 0.2), place(0., 0., -1.);
    contact->updateNewtonEuler(
        Vector3d::Zero(),
        pinocchio::SE3(Eigen::AngleAxisd(tilt.norm(), tilt.normalized()).toRotationMatrix(),
                       place + 0.3 * random.vector(3, 1.)));
    contacts.push_back(describe(*contact));
  }
  return contacts;
}

/// A solver that knows these contacts, each in a slot, the last one in the first.
DualNewton newtonOf(const std::vector<DistributionResult::Contact>& contacts) {
  DualNewton newton;
  newton.reserve(contacts.size() + 1);  // one more than are used
  std::vector<std::size_t> slots;
  for (const auto& contact : contacts) {
    slots.push_back(contacts.size() - 1 - slots.size());
    newton.setContact(slots.back(), contact);
  }
  newton.setActive(slots, contacts);
  return newton;
}

/// A wrench of unit size for a robot that stands, is pushed, or is thrown about.
Vector6 randomWrench(Random& random, const Vector6& weights) {
  const Vector6 wrench = Vector6::Unit(2) + random.vector(6, random.coin() ? 0.1 : 1.);
  return wrench / weights.cwiseProduct(wrench).norm();
}

/// A symmetric matrix with these eigenvalues, of which the upper half must not be read.
Factors6::Matrix6 lowerHalf(Random& random, const Vector6& eigenvalues) {
  const MatrixXd basis = MatrixXd::NullaryExpr(6, 6, [&] { return random.uniform(-1., 1.); })
                             .householderQr()
                             .householderQ();
  Factors6::Matrix6 matrix = basis * eigenvalues.asDiagonal() * basis.transpose();
  matrix.triangularView<Eigen::StrictlyUpper>().setConstant(
      std::numeric_limits<double>::quiet_NaN());
  return matrix;
}

}  // namespace

BOOST_AUTO_TEST_CASE(cones_of_points_and_soles_are_boxes) {
  const auto sole = makeSole("foot");
  const auto box = BoxCone::recognise(inequalities(*sole));
  BOOST_REQUIRE(box.has_value());
  BOOST_TEST(box->size == 6);
  const double betas[] = {0.7, 0.7, 0., 0.06, 0.1, 0.1};
  for (std::size_t i = 0; i < 6; ++i) BOOST_TEST(box->sides[i].beta == betas[i]);
  BOOST_TEST(BoxCone::recognise(inequalities(*makePoint("foot"))).has_value());

  // Rows in another order and of another length are the same cone.
  MatrixXd A = inequalities(*sole).colwise().reverse();
  A.row(3) *= 7.;
  const auto scaled = BoxCone::recognise(A);
  BOOST_REQUIRE(scaled.has_value());
  for (std::size_t i = 0; i < 6; ++i)
    BOOST_TEST(std::abs(scaled->sides[i].beta - betas[i]) < 1e-15);
}

BOOST_AUTO_TEST_CASE(other_cones_are_not) {
  const MatrixXd A = inequalities(*makeSole("foot"));
  const auto refused = [&](const char* what, auto change) {
    MatrixXd other = A;
    change(other);
    BOOST_TEST_CONTEXT(what) BOOST_TEST(!BoxCone::recognise(other).has_value());
  };
  for (Index row = 0; row < A.rows(); ++row) {
    refused("a side that is open", [&](MatrixXd& other) { other.row(row).setZero(); });
    refused("a side turned around", [&](MatrixXd& other) { other.row(row) *= -1.; });
    refused("three components", [&](MatrixXd& other) { other.row(row).setOnes(); });
    if (row == 0) continue;  // the normal force
    refused("a side nearer than the other", [&](MatrixXd& other) { other(row, 2) *= 0.5; });
  }
  refused("four components", [](MatrixXd& other) { other = MatrixXd(other.leftCols(4)); });
  refused("no inequality", [](MatrixXd& other) { other = MatrixXd(0, 6); });
}

// --- Factors6 --------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(factors_solve_as_accurately_as_those_of_eigen) {
  Random random(94);
  double worst = 0., worst_of_eigen = 0.;
  for (const double decades : {0., 1., 3., 6., 8., 10.}) {
    for (int trial = 0; trial < 200; ++trial) {
      // Of all sizes, with a condition number of 10^decades.
      Vector6 eigenvalues = Eigen::pow(10., random.vector(6, 0., decades).array());
      eigenvalues[0] = 1.;
      eigenvalues[5] = std::pow(10., decades);
      eigenvalues *= std::pow(10., random.uniform(-20., 20.));
      const Factors6::Matrix6 lower = lowerHalf(random, eigenvalues);
      const Factors6::Matrix6 matrix = lower.selfadjointView<Eigen::Lower>();
      const Vector6 rhs = random.vector(6);
      Factors6 factors;
      factors.compute(lower);
      const Vector6 x = factors.solve(rhs);
      const Eigen::LDLT<Factors6::Matrix6> eigen(matrix);
      const Vector6 expected = eigen.solve(rhs);

      // Both are the solution of a problem that differs by rounding.
      const double size = eigenvalues[5] * expected.norm();
      worst = std::max(worst, (matrix * x - rhs).norm() / size);
      worst_of_eigen = std::max(worst_of_eigen, (matrix * expected - rhs).norm() / size);
      const double rounding = 1e-14 * std::pow(10., decades);
      BOOST_TEST((x - expected).norm() <= rounding * expected.norm());
      // Without pivoting, D is the square of what stands on the diagonal of Cholesky's factor.
      const Factors6::Matrix6 root = matrix.llt().matrixL();
      const Vector6 pivots = root.diagonal().cwiseAbs2();
      BOOST_TEST(((factors.pivots() - pivots).array().abs() <= rounding * pivots.array()).all());
      BOOST_TEST((factors.pivots().array() > 0.).all());
    }
  }
  BOOST_TEST(worst < 5e-15);
  BOOST_TEST(worst < 5. * worst_of_eigen);
}

BOOST_AUTO_TEST_CASE(factors_by_hand) {
  // L = [1 0; 3 1], D = (2, 5), and ones.
  Factors6::Matrix6 matrix = Factors6::Matrix6::Identity();
  matrix(0, 0) = 2.;
  matrix(1, 0) = 6.;
  matrix(1, 1) = 23.;
  Factors6 factors;
  factors.compute(matrix);
  BOOST_TEST(factors.pivots() == (Vector6() << 2., 5., 1., 1., 1., 1.).finished());
  // (2, 6; 6, 23) (1, 2) = (14, 52).
  const Vector6 rhs = (Vector6() << 14., 52., 3., 4., 5., 6.).finished();
  BOOST_TEST(close(factors.solve(rhs), (Vector6() << 1., 2., 3., 4., 5., 6.).finished(), 1e-14));
  // And what was before does not matter.
  factors.compute(Factors6::Matrix6::Identity());
  BOOST_TEST(factors.pivots() == Vector6::Ones());
  BOOST_TEST(factors.solve(rhs) == rhs);
}

BOOST_AUTO_TEST_CASE(a_matrix_that_is_not_positive_has_a_pivot_that_is_not) {
  Random random(95);
  Factors6 factors;
  for (int trial = 0; trial < 500; ++trial) {
    // As many pivots are negative as eigenvalues are, by Sylvester's law of inertia.
    Vector6 eigenvalues = Eigen::pow(10., random.vector(6, -2., 2.).array());
    const Index negative = random.integer(1, 6);
    eigenvalues.head(negative) *= -1.;
    factors.compute(lowerHalf(random, eigenvalues));
    BOOST_TEST((factors.pivots().array() < 0.).count() == negative);

    // Where an eigenvalue is zero, the last pivot is, but for rounding.
    eigenvalues = eigenvalues.cwiseAbs();
    eigenvalues[random.integer(0, 5)] = 0.;
    factors.compute(lowerHalf(random, eigenvalues));
    BOOST_TEST(factors.pivots().minCoeff() <= 1e-9 * factors.pivots().maxCoeff());
  }
  Factors6::Matrix6 matrix = Factors6::Matrix6::Zero();
  factors.compute(matrix);
  BOOST_TEST(!(factors.pivots().array() > 0.).any());
  matrix.setIdentity();
  matrix(3, 2) = 1.;  // a singular block
  factors.compute(matrix);
  BOOST_TEST(!(factors.pivots().array() > 0.).all());
  matrix(5, 1) = std::numeric_limits<double>::quiet_NaN();
  factors.compute(matrix);
  BOOST_TEST(!(factors.pivots().array() > 0.).all());
}

// --- Answers ---------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(the_answer_is_that_of_the_other_solver) {
  Random random(91);
  int solved = 0, relaxed = 0, left = 0;
  const int trials = 3000;
  for (int trial = 0; trial < trials; ++trial) {
    DistributionResult mine, other;
    mine.contacts = feet(random);
    const Vector6 weights = random.coin() ? Vector6::Ones() : Vector6(random.vector(6, 0.5, 2.));
    const Vector6 wrench = randomWrench(random, weights);
    other = mine;

    DualNewton newton = newtonOf(mine.contacts);
    const DistributionStatus status =
        newton.solve(mine.contacts, weights.cwiseProduct(wrench), weights, true, kEnough);
    if (status == DistributionStatus::NumericalFailure) {
      ++left;
      continue;
    }
    (status == DistributionStatus::Solved ? solved : relaxed) += 1;
    newton.writeAnswer(mine, 10., 1.);
    TwoStageSolver<long double> solver;
    solver.setProblem(other.contacts, weights);
    BOOST_REQUIRE(solver.solve(wrench.cast<long double>(), kEnough) == status);
    solver.writeAnswer(other, 10., 1.);
    BOOST_TEST(close(mine.forces(), other.forces(), 1e-8));

    // What the answer says of itself holds, from the result alone.
    mine.status = status;
    mine.wrench = 10. * wrench;
    mine.wrench_weights = weights;
    mine.scale = 10.;
    mine.achieved.setZero();
    for (const auto& contact : mine.contacts) mine.achieved += contact.NE * contact.force;
    mine.residual = mine.wrench - mine.achieved;
    BOOST_TEST(mine.isOptimal(1e-9));
  }
  BOOST_TEST(solved > trials / 6);
  BOOST_TEST(relaxed > trials / 4);
  BOOST_TEST(left < trials / 50);
  BOOST_TEST_MESSAGE(solved << " solved, " << relaxed << " relaxed, " << left << " left");
}

BOOST_AUTO_TEST_CASE(a_foot_that_is_all_but_level_tips_over_its_side) {
  // Its other side is pulled sideways by less than counts, and by more than rounding.
  DistributionResult mine;
  for (const double x : {-0.1, 0.1})
    for (const double y : {-0.04, 0.04}) {
      const auto point = makePoint("foot");
      const double z = y > 0. ? -0.7 : -0.7 + 1e-10;
      point->updateNewtonEuler(Vector3d::Zero(),
                               pinocchio::SE3(Eigen::Matrix3d::Identity(), Vector3d(x, y, z)));
      mine.contacts.push_back(describe(*point));
    }
  DistributionResult other = mine;
  const Vector6 weights = Vector6::Ones();
  const Vector6 wrench = (Vector6() << 0.02, 0.03, 1., 0.08, 0.02, 0.01).finished();
  DualNewton newton = newtonOf(mine.contacts);
  BOOST_TEST(
      (newton.solve(mine.contacts, wrench, weights, true, kEnough) == DistributionStatus::Relaxed));
  newton.writeAnswer(mine, 1., 1.);
  TwoStageSolver<long double> solver;
  solver.setProblem(other.contacts, weights);
  BOOST_TEST((solver.solve(wrench.cast<long double>(), kEnough) == DistributionStatus::Relaxed));
  solver.writeAnswer(other, 1., 1.);
  BOOST_TEST(close(mine.forces(), other.forces(), 1e-8));
}

BOOST_AUTO_TEST_CASE(no_wrench_wants_no_forces_whatever_was_before) {
  Random random(93);
  for (int trial = 0; trial < 50; ++trial) {
    DistributionResult result;
    result.contacts = feet(random);
    DualNewton newton = newtonOf(result.contacts);
    for (const double size : {1., 0., 1e-15}) {
      const Vector6 wrench = size * Vector6::Unit(2);
      const DistributionStatus status =
          newton.solve(result.contacts, wrench, Vector6::Ones(), trial % 2 == 0, kEnough);
      if (status == DistributionStatus::NumericalFailure) continue;
      newton.writeAnswer(result, 1., 1.);
      Vector6 achieved = Vector6::Zero();
      for (const auto& contact : result.contacts) achieved += contact.NE * contact.force;
      BOOST_TEST((status == DistributionStatus::Relaxed || (achieved - wrench).norm() < 1e-11));
      BOOST_TEST((size == 1. || achieved.norm() < 1e-11));
    }
  }
}

BOOST_AUTO_TEST_CASE(where_no_inequality_is_active_one_step_is_enough) {
  Random random(92);
  int inside = 0;
  for (int trial = 0; trial < 200; ++trial) {
    DistributionResult result;
    result.contacts = feet(random);
    Vector6 wrench = Vector6::Zero();
    for (const auto& contact : result.contacts) wrench += contact.NE.col(2);
    wrench.normalize();
    DualNewton newton = newtonOf(result.contacts);
    if (newton.solve(result.contacts, wrench, Vector6::Ones(), false, kEnough) !=
        DistributionStatus::Solved)
      continue;
    newton.writeAnswer(result, 1., 1.);
    int active = 0;
    for (const auto& contact : result.contacts) active += static_cast<int>(contact.active.count());
    if (active > 0) continue;
    ++inside;
    // One or two points cannot give all wrenches: it may take a step to find out.
    Index components = 0;
    for (const auto& contact : result.contacts) components += contact.A.cols();
    const bool few = components == 3 || (components == 6 && result.contacts.size() == 2);
    BOOST_TEST(newton.iterations() <= (few ? 2 : 1));
  }
  BOOST_TEST(inside > 50);
}

BOOST_AUTO_TEST_CASE(a_sole_on_its_own_takes_one_step_to_its_only_force) {
  Random random(99);
  int inside = 0, outside = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    DistributionResult result;
    do result.contacts = feet(random);
    while (result.contacts.front().A.cols() != 6);
    result.contacts.resize(1);
    auto& contact = result.contacts.front();
    contact.weights = random.vector(6, 0.5, 2.);
    const Vector6 weights = random.vector(6, 0.5, 2.);
    Vector6 force = random.vector(6, 0.1);
    force[2] = 1.;
    Vector6 wrench = contact.NE * force;
    force /= weights.cwiseProduct(wrench).norm();
    wrench = contact.NE * force;
    DualNewton newton = newtonOf(result.contacts);
    const DistributionStatus status = newton.solve(result.contacts, weights.cwiseProduct(wrench),
                                                   weights, trial % 2 == 0, kEnough);
    if (!((contact.A * force).maxCoeff() <= 0.)) {
      ++outside;
      BOOST_TEST(status != DistributionStatus::Solved);
      continue;
    }
    ++inside;
    BOOST_TEST(status == DistributionStatus::Solved);
    BOOST_TEST(newton.iterations() == 1);
    newton.writeAnswer(result, 1., 1.);
    BOOST_TEST(close(contact.force, force, 1e-13));
    // W² λ = NEᵀ ν.
    BOOST_TEST(close(contact.NE.transpose() * result.wrench_multipliers,
                     contact.weights.cwiseAbs2().cwiseProduct(force), 1e-12));
    BOOST_TEST(contact.multipliers.isZero(0.));
  }
  BOOST_TEST(inside > 100);
  BOOST_TEST(outside > 100);
}

BOOST_AUTO_TEST_CASE(from_the_state_of_an_answer_one_step_leads_to_it_again) {
  Random random(96);
  int answers = 0, others = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    DistributionResult first;
    first.contacts = feet(random);
    const Vector6 weights = random.coin() ? Vector6::Ones() : Vector6(random.vector(6, 0.5, 2.));
    const Vector6 wrench = randomWrench(random, weights);
    DualNewton newton = newtonOf(first.contacts);
    const DistributionStatus status =
        newton.solve(first.contacts, weights.cwiseProduct(wrench), weights, true, kEnough);
    if (status == DistributionStatus::NumericalFailure) continue;
    ++answers;
    const int iterations = newton.iterations();
    newton.writeAnswer(first, 1., 1.);
    DistributionResult again = first;
    BOOST_TEST(newton.solve(again.contacts, weights.cwiseProduct(wrench), weights, true, kEnough) ==
               status);
    newton.writeAnswer(again, 1., 1.);
    BOOST_TEST(newton.iterations() == 1);
    BOOST_TEST(close(again.forces(), first.forces(), 1e-10));
    // A larger wrench of the same kind wants the same state.
    BOOST_TEST(newton.solve(again.contacts, 1.3 * weights.cwiseProduct(wrench), weights, true,
                            kEnough) == status);
    BOOST_TEST(newton.iterations() == 1);
    // Without, it is as if nothing had been before: the same bits.
    BOOST_TEST(newton.solve(again.contacts, weights.cwiseProduct(wrench), weights, false,
                            kEnough) == status);
    newton.writeAnswer(again, 1., 1.);
    BOOST_TEST(newton.iterations() == iterations);
    BOOST_TEST(again.forces() == first.forces());
    if (iterations > 1) ++others;
  }
  BOOST_TEST(answers > 900);
  BOOST_TEST(others > 300);
}

BOOST_AUTO_TEST_CASE(a_state_stays_with_its_slot) {
  Random random(97);
  int answers = 0, returns = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    DistributionResult result;
    result.contacts = feet(random);
    const Vector6 weights = Vector6::Ones(), wrench = randomWrench(random, weights);
    DualNewton newton = newtonOf(result.contacts);
    const auto solve = [&](const Vector6& wrench) {
      return newton.solve(result.contacts, weights.cwiseProduct(wrench), weights, true, kEnough);
    };
    const DistributionStatus status = solve(wrench);
    if (status == DistributionStatus::NumericalFailure) continue;
    ++answers;
    // The contacts in another order, which is that of their slots.
    std::vector<std::size_t> slots;
    for (std::size_t slot = 0; slot < result.contacts.size(); ++slot) slots.push_back(slot);
    std::reverse(result.contacts.begin(), result.contacts.end());
    newton.setActive(slots, result.contacts);
    BOOST_TEST(solve(wrench) == status);
    BOOST_TEST(newton.iterations() == 1);
    newton.writeAnswer(result, 1., 1.);
    const DistributionResult all = result;

    // For a while the last one takes no part, while the others give what they have given.
    if (slots.size() > 1 && status == DistributionStatus::Solved) {
      const auto& last = all.contacts.back();
      slots.pop_back();
      result.contacts.pop_back();
      newton.setActive(slots, result.contacts);
      if (solve(wrench - last.NE * last.force) == DistributionStatus::Solved &&
          newton.iterations() == 1) {
        slots.push_back(slots.size());
        result.contacts = all.contacts;
        newton.setActive(slots, result.contacts);
        BOOST_TEST(solve(wrench) == status);
        BOOST_TEST(newton.iterations() == 1);
        ++returns;
      }
    }

    // A contact that is set again is a new one: nothing is known of it but what it is.
    result = all;
    slots.clear();
    for (const auto& contact : all.contacts) {
      slots.push_back(slots.size());
      newton.setContact(slots.back(), contact);
    }
    newton.setActive(slots, all.contacts);
    BOOST_TEST(solve(wrench) == status);
    newton.writeAnswer(result, 1., 1.);
    BOOST_TEST(close(result.forces(), all.forces(), 1e-10));
  }
  BOOST_TEST(answers > 900);
  BOOST_TEST(returns > 100);
}

BOOST_AUTO_TEST_CASE(no_more_iterations_are_taken_than_are_allowed) {
  Random random(98);
  int given_up = 0, answered = 0;
  for (int trial = 0; trial < 300; ++trial) {
    DistributionResult result, limited;
    result.contacts = feet(random);
    limited = result;
    const Vector6 weights = Vector6::Ones(), wrench = randomWrench(random, weights);
    DualNewton newton = newtonOf(result.contacts);
    TwoStageSolver<double> solver;
    solver.setProblem(result.contacts, weights);
    const DistributionStatus status =
        newton.solve(result.contacts, weights.cwiseProduct(wrench), weights, false, kEnough);
    const int iterations = newton.iterations();
    newton.writeAnswer(result, 1., 1.);
    const DistributionStatus robust_status = solver.solve(wrench, kEnough);
    const int robust_iterations = solver.iterations();
    BOOST_TEST(robust_iterations > 0);
    for (int limit = 1; limit <= 40; ++limit) {
      const DistributionStatus by_newton =
          newton.solve(limited.contacts, weights.cwiseProduct(wrench), weights, false, limit);
      BOOST_TEST(newton.iterations() <= limit);
      if (by_newton != DistributionStatus::NumericalFailure) {
        ++answered;
        BOOST_TEST(by_newton == status);
        newton.writeAnswer(limited, 1., 1.);
        BOOST_TEST(close(limited.forces(), result.forces(), 1e-9));
      }
      if (limit >= iterations) BOOST_TEST(by_newton == status);
      const DistributionStatus by_robust = solver.solve(wrench, limit);
      BOOST_TEST(solver.iterations() <= limit);
      if (limit >= robust_iterations)
        BOOST_TEST(by_robust == robust_status);
      else if (by_robust != DistributionStatus::NumericalFailure)
        BOOST_TEST(by_robust == robust_status);
      else
        ++given_up;
    }
    BOOST_TEST(solver.solve(wrench, 0) == DistributionStatus::NumericalFailure);
    BOOST_TEST(solver.iterations() == 0);
  }
  BOOST_TEST(answered > 1000);
  BOOST_TEST(given_up > 1000);
}
