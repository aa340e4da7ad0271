// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE minimum_norm
#include <Eigen/QR>
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "minimum_norm.hpp"

using MinimumNorm = dynacom::internal::MinimumNorm<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kTolerance = 1e-12, kDependent = 1e-12;

struct Problem {
  MatrixXd E;
  VectorXd d;
  MatrixXd G;
  VectorXd h;

  MinimumNorm::Status solve(MinimumNorm& solver) const {
    return solver.solve(E, d, G, h, kTolerance, kDependent);
  }
};

// Another way to the answer: of all subsets of inequalities taken as equalities, the point of least
// norm that respects all. Exponential, and without any choice that could go wrong.
double leastNormByEnumeration(const Problem& problem, VectorXd& x) {
  const Index n = problem.E.rows(), p = problem.E.cols(), m = problem.G.cols();
  double least = std::numeric_limits<double>::infinity();
  for (int subset = 0; subset < (1 << m); ++subset) {
    MatrixXd N(n, p + m);
    VectorXd rhs(p + m);
    N.leftCols(p) = problem.E;
    rhs.head(p) = problem.d;
    Index size = p;
    for (Index j = 0; j < m; ++j) {
      if (!(subset >> j & 1)) continue;
      N.col(size) = problem.G.col(j);
      rhs[size++] = problem.h[j];
    }
    VectorXd point = VectorXd::Zero(n);
    if (size > 0)
      point = N.leftCols(size).transpose().completeOrthogonalDecomposition().solve(rhs.head(size));
    const bool reaches = (N.leftCols(size).transpose() * point - rhs.head(size)).norm() <=
                         1e-9 * (1. + point.norm());
    const bool respects = m == 0 || (problem.G.transpose() * point - problem.h).maxCoeff() <= 1e-9;
    if (reaches && respects && point.norm() < least) {
      least = point.norm();
      x = point;
    }
  }
  return least;
}

class Random {
 public:
  double normal() { return normal_(engine_); }
  Index integer(Index from, Index to) {
    return std::uniform_int_distribution<Index>(from, to)(engine_);
  }
  MatrixXd matrix(Index rows, Index cols) {
    return MatrixXd::NullaryExpr(rows, cols, [this] { return normal(); });
  }

  // Every kind of trouble now and then: equalities that follow from others, inequalities that are
  // parallel or say the same twice, cones, nothing at all.
  Problem problem() {
    const Index n = integer(1, 6), p = integer(0, n), m = integer(0, 7);
    Problem problem{matrix(n, p), VectorXd(p), matrix(n, m), VectorXd(m)};
    if (p > 1 && integer(0, 3) == 0) problem.E.col(p - 1) = problem.E.col(0);
    if (p > 2 && integer(0, 3) == 0) problem.E.col(p - 1) = problem.E.col(0) + problem.E.col(1);
    for (Index i = 0; i < p; ++i) problem.E.col(i).normalize();
    if (m > 1 && integer(0, 2) == 0) problem.G.col(m - 1) = problem.G.col(0);
    if (m > 2 && integer(0, 2) == 0) problem.G.col(m - 2) = -2. * problem.G.col(0);
    const VectorXd inside = matrix(n, 1);
    problem.d = problem.E.transpose() * inside;
    const bool cone = integer(0, 2) == 0;
    for (Index j = 0; j < m; ++j)
      problem.h[j] = cone ? 0. : problem.G.col(j).dot(inside) + (integer(0, 1) ? 0. : normal());
    if (m > 1) problem.h[m - 1] = problem.h[0];
    return problem;
  }

 private:
  std::mt19937_64 engine_{20};
  std::normal_distribution<double> normal_;
};

// The conditions of a minimum: x + E y + G z = 0 with z ≥ 0 on active inequalities, which are
// equations, and 0 on all others.
void checkConditions(const Problem& problem, const MinimumNorm& solver) {
  const Index m = problem.G.cols();
  BOOST_REQUIRE(solver.y().size() == problem.E.cols());
  BOOST_REQUIRE(solver.z().size() == m);
  const double terms = 1. + solver.x().norm() + solver.y().lpNorm<1>() + solver.z().lpNorm<1>();
  BOOST_TEST((solver.x() + problem.E * solver.y() + problem.G * solver.z()).norm() <=
             1e-10 * terms);

  std::vector<bool> active(static_cast<std::size_t>(m), false);
  for (const Index j : solver.active()) {
    BOOST_REQUIRE(j >= 0);
    BOOST_REQUIRE(j < m);
    BOOST_TEST(!active[static_cast<std::size_t>(j)], "inequality " << j << " is active twice");
    active[static_cast<std::size_t>(j)] = true;
  }
  for (Index j = 0; j < m; ++j) {
    const double slack = problem.h[j] - problem.G.col(j).dot(solver.x());
    if (active[static_cast<std::size_t>(j)]) {
      BOOST_TEST(solver.z()[j] >= -1e-10 * terms);
      BOOST_TEST(std::abs(slack) <= 1e-9 * terms);
    } else {
      BOOST_TEST(solver.z()[j] == 0.);
    }
  }
  BOOST_TEST(solver.iterations() >= static_cast<int>(solver.active().size()));
}

}  // namespace

BOOST_AUTO_TEST_CASE(agrees_with_an_enumeration_of_all_active_sets) {
  Random random;
  MinimumNorm solver;
  int solved = 0, infeasible = 0;
  std::size_t active = 0;
  for (int i = 0; i < 3000; ++i) {
    const Problem problem = random.problem();
    VectorXd expected;
    const double least = leastNormByEnumeration(problem, expected);
    const MinimumNorm::Status status = problem.solve(solver);
    BOOST_TEST_CONTEXT("problem " << i) {
      if (least == std::numeric_limits<double>::infinity()) {
        BOOST_TEST((status == MinimumNorm::Status::Infeasible));
        ++infeasible;
      } else {
        BOOST_TEST((status == MinimumNorm::Status::Solved));
        BOOST_TEST((solver.x() - expected).norm() <= 1e-8 * (1. + least));
        checkConditions(problem, solver);
        active += solver.active().size();
        ++solved;
      }
    }
  }
  BOOST_TEST(solved > 1500);
  BOOST_TEST(active > 1500u);
  BOOST_TEST(infeasible > 300);
}

BOOST_AUTO_TEST_CASE(equalities_alone_give_the_pseudoinverse) {
  const MatrixXd E = (MatrixXd(3, 2) << 1., 0.6, 0., 0.8, 0., 0.).finished();
  const VectorXd d = Eigen::Vector2d(2., 2.);
  MinimumNorm solver;
  BOOST_TEST((solver.solve(E, d, MatrixXd(3, 0), VectorXd(0), kTolerance, kDependent) ==
              MinimumNorm::Status::Solved));
  // x = (2, 1, 0): the first component by the first equality, the second by 0.6·2 + 0.8·1 = 2.
  BOOST_TEST((solver.x() - Eigen::Vector3d(2., 1., 0.)).norm() < 1e-15 * 10.);
  // x + E y = 0: by the second component y₂ = −1 / 0.8, and by the first y₁ = −2 + 0.6 / 0.8.
  BOOST_TEST((solver.y() - Eigen::Vector2d(-1.25, -1.25)).norm() < 1e-14);
  BOOST_TEST(solver.z().size() == 0);
  BOOST_TEST(solver.active().empty());
  BOOST_TEST(solver.iterations() == 0);
}

BOOST_AUTO_TEST_CASE(inequalities_are_active_where_they_bind) {
  // x₁ = 1 with x₁ + x₂ ≤ 0, and x₂ ≤ 5, which does not bind: x = (1, −1).
  const MatrixXd E = (MatrixXd(2, 1) << 1., 0.).finished();
  const MatrixXd G = (MatrixXd(2, 2) << 0., 1., 1., 1.).finished();
  MinimumNorm solver;
  BOOST_TEST((solver.solve(E, VectorXd::Ones(1), G, Eigen::Vector2d(5., 0.), kTolerance,
                           kDependent) == MinimumNorm::Status::Solved));
  BOOST_TEST((solver.x() - Eigen::Vector2d(1., -1.)).norm() < 1e-14);
  // By the second component z₂ = 1, by the first y = −1 − 1.
  BOOST_TEST((solver.z() - Eigen::Vector2d(0., 1.)).norm() < 1e-14);
  BOOST_TEST(std::abs(solver.y()[0] + 2.) < 1e-14);
  BOOST_REQUIRE(solver.active().size() == 1u);
  BOOST_TEST(solver.active()[0] == 1);
  BOOST_TEST(solver.iterations() == 1);

  // With room enough, none is, and what was before is forgotten.
  BOOST_TEST((solver.solve(E, VectorXd::Ones(1), G, Eigen::Vector2d(5., 1.), kTolerance,
                           kDependent) == MinimumNorm::Status::Solved));
  BOOST_TEST((solver.x() - Eigen::Vector2d(1., 0.)).norm() < 1e-14);
  BOOST_TEST(solver.active().empty());
  BOOST_TEST(solver.z().isZero(0.));
  BOOST_TEST(solver.iterations() == 0);
}

BOOST_AUTO_TEST_CASE(an_inequality_made_active_too_early_is_left) {
  // x₁ ≥ 2 and 0.1 x₁ + 0.1 x₂ ≥ 1: the first is violated most and becomes active, but with the
  // second comes (5, 5), where the first does not bind.
  const MatrixXd G = (MatrixXd(2, 2) << -1., -0.1, 0., -0.1).finished();
  MinimumNorm solver;
  BOOST_TEST((solver.solve(MatrixXd(2, 0), VectorXd(0), G, Eigen::Vector2d(-2., -1.), kTolerance,
                           kDependent) == MinimumNorm::Status::Solved));
  BOOST_TEST((solver.x() - Eigen::Vector2d(5., 5.)).norm() < 1e-13);
  BOOST_TEST((solver.z() - Eigen::Vector2d(0., 50.)).norm() < 1e-12);
  BOOST_REQUIRE(solver.active().size() == 1u);
  BOOST_TEST(solver.active()[0] == 1);
  // Active, left, active.
  BOOST_TEST(solver.iterations() == 3);
}

BOOST_AUTO_TEST_CASE(half_spaces_without_a_common_point_are_infeasible) {
  const MatrixXd G = (MatrixXd(1, 2) << 1., -1.).finished();
  const VectorXd h = Eigen::Vector2d(-1., -1.);  // x ≤ −1 and x ≥ 1
  MinimumNorm solver;
  BOOST_TEST((solver.solve(MatrixXd(1, 0), VectorXd(0), G, h, kTolerance, kDependent) ==
              MinimumNorm::Status::Infeasible));
  // And it can be used again.
  BOOST_TEST((solver.solve(MatrixXd(1, 0), VectorXd(0), G.leftCols(1), h.head(1), kTolerance,
                           kDependent) == MinimumNorm::Status::Solved));
  BOOST_TEST(solver.x()[0] == -1.);
}
