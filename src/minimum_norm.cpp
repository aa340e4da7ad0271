// SPDX-License-Identifier: BSD-2-Clause
#include "minimum_norm.hpp"

#include <Eigen/Householder>
#include <Eigen/Jacobi>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace dynacom::internal {

namespace {

template <class Scalar>
constexpr Scalar kInfinity = std::numeric_limits<Scalar>::infinity();
// An equality whose normal has no more than this outside the span of others follows from them: its
// own rounding, which is that of double, is no more.
template <class Scalar>
constexpr Scalar kDependentEquality =
    std::numeric_limits<Scalar>::digits > std::numeric_limits<double>::digits ? 1e-13 : 1e-10;
// An inequality that depends on active ones contradicts them if it is violated by more than this
// many tolerances, times what the tolerances of the active ones add up to in it.
constexpr double kContradiction = 1e3;

// Far above what has been seen, 120 for 88 inequalities.
int iterationLimit(Eigen::Index inequalities) { return 50 + 10 * static_cast<int>(inequalities); }

}  // namespace

template <class Scalar>
void MinimumNorm<Scalar>::reserve(Eigen::Index n, Eigen::Index p, Eigen::Index m) {
  reflectors_.resize(n, p);
  J_.resize(n, n);
  R_.resize(n, n);
  for (KeptVector* vector : {&rhs_, &x_, &u_, &Jn_, &r_, &workspace_}) vector->resize(n);
  y_.resize(p);
  z_.resize(m);
  slack_.resize(m);
  active_.reserve(n);
  implied_.reserve(m);
}

template <class Scalar>
typename MinimumNorm<Scalar>::Status MinimumNorm<Scalar>::solve(
    const MatrixRef& E, const VectorRef& d, const MatrixRef& G, const VectorRef& h,
    Scalar tolerance, Scalar dependent, int maximal_iterations) {
  eigen_assert(E.cols() <= kMaximalEqualities);
  iterations_ = 0;
  reserve(E.rows(), E.cols(), G.cols());
  implied_.clear();
  startWithEqualities(E, d);
  const Status status = activateViolated(G, h, tolerance, dependent, maximal_iterations);
  readMultipliers();
  return status;
}

template <class Scalar>
typename MinimumNorm<Scalar>::Status MinimumNorm<Scalar>::activateViolated(const MatrixRef& G,
                                                                           const VectorRef& h,
                                                                           Scalar tolerance,
                                                                           Scalar dependent,
                                                                           int maximal_iterations) {
  const int limit = std::min(maximal_iterations, iterationLimit(G.cols()));
  for (bool refined = true;;) {
    const Eigen::Index violated = findViolated(G, h, tolerance);
    if (violated < 0) {
      if (refined) return Status::Solved;
      // Steps pile up rounding; what follows from the active constraints does not.
      computeSolution();
      refined = true;
      continue;
    }
    refined = false;
    completeBasis();

    Scalar multiplier = 0.;
    for (bool done = false; !done;) {
      if (iterations_ >= limit) return Status::IterationLimit;
      ++iterations_;
      computeDirections(G.col(violated));
      // The whole step reaches the inequality; on the way, the multiplier of an active one may
      // reach zero.
      const auto outside = Jn_.tail(Jn_.size() - q_);
      const Scalar violation = G.col(violated).dot(x_) - h[violated];
      Scalar whole = kInfinity<Scalar>;
      if (outside.squaredNorm() > dependent * dependent * Jn_.squaredNorm())
        whole = violation / outside.squaredNorm();
      Scalar partial = kInfinity<Scalar>;
      Eigen::Index leaving = -1;
      for (Eigen::Index k = equalities_; k < q_; ++k) {
        if (r_[k] > 0. && u_[k] < partial * r_[k]) {
          partial = u_[k] / r_[k];
          leaving = k;
        }
      }
      const Scalar step = std::min(whole, partial);
      if (step == kInfinity<Scalar>) {
        // The inequality follows from the active ones, and none of them can leave: either it
        // contradicts them, or all that it lacks is rounding.
        if (violation > kContradiction * tolerance * (1. + r_.head(q_).template lpNorm<1>()))
          return Status::Infeasible;
        implied_.push_back(violated);
        break;
      }

      if (whole < kInfinity<Scalar>)
        x_.noalias() -= step * (J_.rightCols(J_.cols() - q_) * outside);
      u_.head(q_) -= step * r_.head(q_);
      multiplier += step;
      if (whole <= partial) {
        activate(violated, h[violated], multiplier);
        done = true;
      } else {
        leave(leaving);
      }
    }
  }
}

// x becomes the point of least norm under the equalities, of which only independent ones are kept.
template <class Scalar>
void MinimumNorm<Scalar>::startWithEqualities(const MatrixRef& E, const VectorRef& d) {
  active_.clear();
  complete_ = false;

  q_ = equalities_ = 0;
  if (E.cols() > 0) {
    decompose(E);
    R_.topLeftCorner(q_, q_) = reflectors_.topLeftCorner(q_, q_);
    for (Eigen::Index k = 0; k < q_; ++k) rhs_[k] = d[permutation_[static_cast<std::size_t>(k)]];
  }

  // As computeSolution(), but without J.
  x_.setZero();
  x_.head(q_) = rhs_.head(q_);
  R_.topLeftCorner(q_, q_).template triangularView<Eigen::Upper>().transpose().solveInPlace(
      x_.head(q_));
  u_.head(q_) = -x_.head(q_);
  R_.topLeftCorner(q_, q_).template triangularView<Eigen::Upper>().solveInPlace(u_.head(q_));
  applyQ(x_);
}

// Householder's decomposition, at each step of the column of which the most is left: Eigen's own
// allocates. Counts the columns that do not follow from others.
template <class Scalar>
void MinimumNorm<Scalar>::decompose(const MatrixRef& E) {
  reflectors_ = E;
  const Eigen::Index p = E.cols();
  for (Eigen::Index k = 0; k < p; ++k) permutation_[static_cast<std::size_t>(k)] = k;
  for (Eigen::Index k = 0; k < std::min(E.rows(), p); ++k) {
    const auto position = static_cast<std::size_t>(k);
    const Eigen::Index below = E.rows() - k - 1;
    Eigen::Index most = 0;
    reflectors_.bottomRightCorner(below + 1, p - k).colwise().squaredNorm().maxCoeff(&most);
    reflectors_.col(k).swap(reflectors_.col(k + most));
    std::swap(permutation_[position], permutation_[static_cast<std::size_t>(k + most)]);

    Scalar pivot = 0;
    reflectors_.col(k).tail(below + 1).makeHouseholderInPlace(coefficients_[position], pivot);
    reflectors_(k, k) = pivot;
    const auto reflector = reflectors_.col(k).tail(below);
    for (Eigen::Index j = k + 1; j < p; ++j) {
      auto column = reflectors_.col(j).tail(below);
      const Scalar product = coefficients_[position] * (reflectors_(k, j) + reflector.dot(column));
      reflectors_(k, j) -= product;
      column -= product * reflector;
    }
    if (std::abs(pivot) > kDependentEquality<Scalar>) ++q_;
  }
  equalities_ = q_;
}

// Computes J, which problems without active inequalities never need.
template <class Scalar>
void MinimumNorm<Scalar>::completeBasis() {
  if (complete_) return;
  J_.setIdentity();
  applyQ(J_);
  complete_ = true;
}

// Multiplies by Q of the equalities' decomposition: Eigen's own way to do so allocates.
template <class Scalar>
template <class Operand>
void MinimumNorm<Scalar>::applyQ(Operand& operand) {
  auto products = workspace_.head(operand.cols()).transpose();
  for (Eigen::Index k = equalities_ - 1; k >= 0; --k) {
    const Eigen::Index below = operand.rows() - k - 1;
    const auto reflector = reflectors_.col(k).tail(below);
    products = operand.row(k);
    products.noalias() += reflector.transpose() * operand.bottomRows(below);
    products *= coefficients_[static_cast<std::size_t>(k)];
    operand.row(k) -= products;
    operand.bottomRows(below) -= reflector.lazyProduct(products);
  }
}

// The inequality that x violates most, or −1.
template <class Scalar>
Eigen::Index MinimumNorm<Scalar>::findViolated(const MatrixRef& G, const VectorRef& h,
                                               Scalar tolerance) {
  slack_ = -h;
  slack_.noalias() += G.transpose() * x_;
  for (const Eigen::Index inequality : active_) slack_[inequality] = -kInfinity<Scalar>;
  for (const Eigen::Index inequality : implied_) slack_[inequality] = -kInfinity<Scalar>;
  Eigen::Index violated = -1;
  if (slack_.size() == 0 || !(slack_.maxCoeff(&violated) > tolerance)) return -1;
  return violated;
}

// The normal in the basis J, and what a step along it does to the active multipliers.
template <class Scalar>
void MinimumNorm<Scalar>::computeDirections(const VectorRef& normal) {
  Jn_.noalias() = J_.transpose() * normal;
  r_.head(q_) = Jn_.head(q_);
  R_.topLeftCorner(q_, q_).template triangularView<Eigen::Upper>().solveInPlace(r_.head(q_));
}

// Appends the inequality of computeDirections() to the active ones.
template <class Scalar>
void MinimumNorm<Scalar>::activate(Eigen::Index inequality, Scalar rhs, Scalar multiplier) {
  // Rotations turn the part outside the active span into a single component.
  for (Eigen::Index k = Jn_.size() - 1; k > q_; --k) {
    if (Jn_[k] == 0.) continue;
    Eigen::JacobiRotation<Scalar> rotation;
    rotation.makeGivens(Jn_[k - 1], Jn_[k], &Jn_[k - 1]);
    J_.applyOnTheRight(k - 1, k, rotation);
  }
  R_.col(q_).head(q_ + 1) = Jn_.head(q_ + 1);
  rhs_[q_] = rhs;
  u_[q_] = multiplier;
  active_.push_back(inequality);
  ++q_;
}

// Takes the constraint at a position of R, an inequality, out of the active ones.
template <class Scalar>
void MinimumNorm<Scalar>::leave(Eigen::Index position) {
  active_.erase(active_.begin() + (position - equalities_));
  implied_.clear();  // perhaps by this one
  --q_;
  for (Eigen::Index k = position; k < q_; ++k) {
    R_.col(k).head(k + 2) = R_.col(k + 1).head(k + 2);
    rhs_[k] = rhs_[k + 1];
    u_[k] = u_[k + 1];
  }
  // Rotations make R triangular again.
  for (Eigen::Index k = position; k < q_; ++k) {
    Eigen::JacobiRotation<Scalar> rotation;
    rotation.makeGivens(R_(k, k), R_(k + 1, k), &R_(k, k));
    R_.middleCols(k + 1, q_ - k - 1).applyOnTheLeft(k, k + 1, rotation.adjoint());
    J_.applyOnTheRight(k, k + 1, rotation);
  }
}

// Solution and multipliers, anew from the active constraints: x = J₁ R⁻ᵀ rhs, u = −R⁻¹ R⁻ᵀ rhs.
template <class Scalar>
void MinimumNorm<Scalar>::computeSolution() {
  const auto R = R_.topLeftCorner(q_, q_).template triangularView<Eigen::Upper>();
  r_.head(q_) = rhs_.head(q_);
  R.transpose().solveInPlace(r_.head(q_));
  x_.noalias() = J_.leftCols(q_) * r_.head(q_);
  u_.head(q_) = -r_.head(q_);
  R.solveInPlace(u_.head(q_));
}

template <class Scalar>
void MinimumNorm<Scalar>::readMultipliers() {
  y_.setZero();
  for (Eigen::Index k = 0; k < equalities_; ++k)
    y_[permutation_[static_cast<std::size_t>(k)]] = u_[k];
  z_.setZero();
  for (Eigen::Index k = equalities_; k < q_; ++k) z_[active_[k - equalities_]] = u_[k];
}

template class MinimumNorm<double>;
template class MinimumNorm<long double>;

}  // namespace dynacom::internal
