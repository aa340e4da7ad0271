// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE dual_newton
#include <boost/test/unit_test.hpp>
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
using dynacom::internal::TwoStageSolver;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Vector6 = DistributionResult::Vector6;

namespace {

MatrixXd inequalities(const ContactBase& contact) {
  MatrixXd A(contact.uni_rows() + contact.fri_rows(), contact.cols());
  A << contact.uni_A(), contact.fri_A();
  return A;
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
    contacts.emplace_back();
    contacts.back().A = inequalities(*contact);
    contacts.back().weights = contact->reg_A();
    contacts.back().NE = contact->ne_A();
    contacts.back().force.setZero(contact->cols());
    contacts.back().active.setConstant(contacts.back().A.rows(), false);
    contacts.back().multipliers.setZero(contacts.back().A.rows());
    contacts.back().relaxation_multipliers.setZero(contacts.back().A.rows());
  }
  return contacts;
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

BOOST_AUTO_TEST_CASE(the_answer_is_that_of_the_other_solver) {
  Random random(91);
  int solved = 0, relaxed = 0, left = 0;
  const int trials = 3000;
  for (int trial = 0; trial < trials; ++trial) {
    DistributionResult mine, other;
    mine.contacts = feet(random);
    // Standing, pushed, thrown about.
    Vector6 wrench = Vector6::Unit(2) + random.vector(6, random.coin() ? 0.1 : 1.);
    Vector6 weights = random.coin() ? Vector6::Ones() : Vector6(random.vector(6, 0.5, 2.));
    wrench /= weights.cwiseProduct(wrench).norm();
    other = mine;

    DualNewton newton;
    newton.setContacts(mine.contacts);
    const DistributionStatus status = newton.solve(mine.contacts, wrench, weights);
    if (status == DistributionStatus::NumericalFailure) {
      ++left;
      continue;
    }
    (status == DistributionStatus::Solved ? solved : relaxed) += 1;
    newton.writeAnswer(mine, 10., 1.);
    TwoStageSolver<long double> solver;
    solver.setProblem(other.contacts, weights);
    BOOST_REQUIRE(solver.solve(wrench.cast<long double>()) == status);
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

BOOST_AUTO_TEST_CASE(no_wrench_wants_no_forces_whatever_was_before) {
  Random random(93);
  for (int trial = 0; trial < 50; ++trial) {
    DistributionResult result;
    result.contacts = feet(random);
    DualNewton newton;
    newton.setContacts(result.contacts);
    for (const double size : {1., 0., 1e-15}) {
      const Vector6 wrench = size * Vector6::Unit(2);
      const DistributionStatus status = newton.solve(result.contacts, wrench, Vector6::Ones());
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
    DualNewton newton;
    newton.setContacts(result.contacts);
    if (newton.solve(result.contacts, wrench, Vector6::Ones()) != DistributionStatus::Solved)
      continue;
    newton.writeAnswer(result, 1., 1.);
    int active = 0;
    for (const auto& contact : result.contacts) active += static_cast<int>(contact.active.count());
    if (active > 0) continue;
    ++inside;
    BOOST_TEST(newton.iterations() == 1);
  }
  BOOST_TEST(inside > 50);
}
