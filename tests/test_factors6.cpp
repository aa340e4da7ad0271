// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE factors6
#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <limits>

#include "factors6.hpp"
#include "test_tools.hpp"

using namespace dynacom_tests;
using dynacom::internal::Factors6;
using Eigen::Index;
using Eigen::MatrixXd;
using Vector6 = Factors6::Vector6;

namespace {

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
