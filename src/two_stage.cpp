// SPDX-License-Identifier: BSD-2-Clause
#include "two_stage.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace dynacom::internal {

namespace {

// All of these are for a problem whose weighted wrench has unit size. What is rounding is less with
// the digits of long double.
template <class Scalar>
constexpr Scalar kRoundoff =
    std::numeric_limits<Scalar>::digits > std::numeric_limits<double>::digits ? 1e-3 : 1.;
template <class Scalar>
constexpr Scalar kRoundoffRoot = kRoundoff<Scalar> < 1 ? 1e-2 : 1.;
template <class Scalar>
struct Tolerances {
  // What part of an inequality's normal outside the span of the active ones is none: at the first
  // attempt, and later on.
  static constexpr Scalar kNearlyDependent = 1e-8;
  static constexpr Scalar kDependentInequality = 1e-12 * kRoundoff<Scalar>;
  // By how much the solver may leave an inequality behind.
  static constexpr Scalar kTolerance = 1e-12 * kRoundoff<Scalar>;
  // How far an answer may be from its wrench and from its inequalities: at the first attempt, and
  // after the relaxation.
  static constexpr Scalar kExactWrench = 1e-9;
  static constexpr Scalar kExactInequality = 2e-12 * kRoundoff<Scalar>;
  static constexpr Scalar kAccurateWrench = 5e-9;
  static constexpr Scalar kAccurateInequality = 1e-10 * kRoundoff<Scalar>;
  // What is left of a vector when others are projected out is none below this part of it.
  static constexpr Scalar kDependent = 1e-10 * kRoundoff<Scalar>;
  // Where the relaxation multiplies an inequality by less than this, it is rounding, too.
  static constexpr Scalar kMultiplierRounding = kRoundoff<Scalar> < 1 ? 1e-14 : 3e-12;
  // Of the relaxation: its √δ, how many steps it may take, when it has arrived, and what does not
  // approach an inequality.
  static constexpr Scalar kProximity = 1e-4 * kRoundoffRoot<Scalar>;
  static constexpr Scalar kLeastProximity = 1e-7 * kRoundoffRoot<Scalar>;
  static constexpr int kEasySteps = 2;
  static constexpr int kProximalSteps = 100;
  static constexpr Scalar kProximalChange = 1e-11 * kRoundoff<Scalar>;
  static constexpr Scalar kProximalGain = 1e-13 * kRoundoff<Scalar>;
  static constexpr int kStalledSteps = 2;
  static constexpr Scalar kRounding = 1e-15 * kRoundoff<Scalar>;
  static constexpr Scalar kParallel = 1e-9 * kRoundoff<Scalar>;
  // A distance that has few digits, where the wrench weights are equal, and forces that do.
  static constexpr Scalar kNearBoundary = 1e-4;
  static constexpr Scalar kLargeForces = 100.;
  // Of the cheapest forces on a face: √ε, how many steps, and when nothing is missing any more.
  static constexpr Scalar kSlack = 1e-4 * kRoundoffRoot<Scalar>;
  static constexpr int kMultiplierSteps = 100;
  static constexpr Scalar kMissing = 1e-11 * kRoundoff<Scalar>;
  static constexpr Scalar kLeastShrinking = 1e-5;
};

}  // namespace

template <class Scalar>
void TwoStageSolver<Scalar>::setProblem(const std::vector<DistributionResult::Contact>& contacts,
                                        const DistributionResult::Vector6& weights) {
  weights_ = weights.cast<Scalar>();
  contacts_.resize(contacts.size());
  n_ = m_ = 0;
  largest_weight_ = 0;
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    Contact& contact = contacts_[k];
    contact.A = contacts[k].A.template cast<Scalar>();
    contact.weights = contacts[k].weights.template cast<Scalar>();
    contact.NE = contacts[k].NE.template cast<Scalar>();
    n_ += contact.A.cols();
    m_ += contact.A.rows();
    largest_weight_ = std::max(largest_weight_, contact.weights.maxCoeff());
  }
  resize();
}

template <class Scalar>
void TwoStageSolver<Scalar>::reserve(std::size_t contacts, Eigen::Index rows, Eigen::Index cols,
                                     Eigen::Index all_rows, Eigen::Index all_cols) {
  contacts_.resize(contacts);
  for (std::size_t k = 0; k < contacts; ++k) {
    contacts_[k].A.resize(rows, cols);
    contacts_[k].weights.resize(cols);
    contacts_[k].NE.resize(6, cols);
  }
  n_ = all_cols;
  m_ = all_rows;
  resize();
}

// Gives everything the size of the problem, also what it may not need.
template <class Scalar>
void TwoStageSolver<Scalar>::resize() {
  for (Program* program : {&direct_, &slackened_}) {
    const Eigen::Index slacks = program == &slackened_ ? 6 : 0;
    program->scales.resize(n_);
    program->E.resize(slacks + n_, 6);
    program->G.resize(slacks + n_, m_);
    program->d.resize(6);
    program->h.resize(m_);
    program->solver.reserve(slacks + n_, 6, m_);
  }
  for (KeptVector* vector : {&lambda_, &scaled_, &change_, &gradient_, &products_})
    vector->resize(n_);
  for (KeptVector* vector : {&relaxation_multipliers_, &multipliers_}) vector->resize(m_);
  face_.resize(n_, n_);
  R_.resize(n_, n_);
  held_.resize(n_);
  active_.setConstant(m_, false);
}

// Fills E and G from the scales. A slack is a variable more for each column of E, with this factor.
template <class Scalar>
void TwoStageSolver<Scalar>::assemble(Program& program, const Vector6& row_weights, Scalar slack) {
  const Eigen::Index slacks = slack > 0. ? 6 : 0;
  program.E.setZero(slacks + n_, 6);
  program.G.setZero(slacks + n_, m_);
  program.E.topRows(slacks).diagonal().setConstant(slack);
  Eigen::Index col = 0, row = 0;
  for (const Contact& contact : contacts_) {
    const Eigen::Index cols = contact.A.cols(), rows = contact.A.rows();
    for (Eigen::Index i = 0; i < cols; ++i) {
      const Scalar scale = program.scales[col + i];
      program.E.row(slacks + col + i) =
          row_weights.cwiseProduct(contact.NE.col(i)).transpose() / scale;
      program.G.row(slacks + col + i).segment(row, rows) = contact.A.col(i).transpose() / scale;
    }
    col += cols;
    row += rows;
  }
  for (Eigen::Index i = 0; i < 6; ++i) {
    program.norms[i] = program.E.col(i).norm();
    if (program.norms[i] == 0.) program.norms[i] = 1.;  // a component that the contacts cannot give
    program.E.col(i) /= program.norms[i];
  }
}

// The variable is W λ, with W the weights over their largest: its norm is the cost, and tolerances
// mean the same for a mouse and for an elephant.
template <class Scalar>
void TwoStageSolver<Scalar>::assembleCheapest(Program& program, Scalar slack) {
  program.scales.resize(n_);
  Eigen::Index col = 0;
  for (const Contact& contact : contacts_) {
    program.scales.segment(col, contact.weights.size()) = contact.weights / largest_weight_;
    col += contact.weights.size();
  }
  assemble(program, slack > 0. ? weights_ : Vector6::Ones(), slack);
}

// The scales are what a unit of λ does to the weighted wrench. See relax().
template <class Scalar>
void TwoStageSolver<Scalar>::assembleClosest(Scalar proximity) {
  slackened_.scales.resize(n_);
  Eigen::Index col = 0;
  for (const Contact& contact : contacts_)
    for (Eigen::Index i = 0; i < contact.NE.cols(); ++i, ++col) {
      slackened_.scales[col] = weights_.cwiseProduct(contact.NE.col(i)).norm();
      if (slackened_.scales[col] == 0.) slackened_.scales[col] = 1.;
    }
  assemble(slackened_, weights_, proximity);
}

template <class Scalar>
typename TwoStageSolver<Scalar>::Status TwoStageSolver<Scalar>::minimizeNorm(Program& program,
                                                                             Scalar tolerance,
                                                                             Scalar dependent) {
  if (iterations_ >= maximal_iterations_) return Status::IterationLimit;
  ++iterations_;
  const Status status = program.solver.solve(program.E, program.d, program.G, program.h, tolerance,
                                             dependent, maximal_iterations_ - iterations_);
  iterations_ += program.solver.iterations();
  return status;
}

// Finds the cheapest forces that give a wrench, which is over the unit. False if there are none,
// or hardly any.
template <class Scalar>
bool TwoStageSolver<Scalar>::minimizeCost(const Vector6& wrench, Scalar dependent,
                                          Scalar inequality) {
  assembleCheapest(direct_, 0.);
  direct_.d = wrench.cwiseQuotient(direct_.norms);
  direct_.h.setZero(m_);
  const Status status = minimizeNorm(direct_, Tolerances<Scalar>::kTolerance, dependent);
  lambda_ = direct_.solver.x().cwiseQuotient(direct_.scales);
  // The solver leaves out equalities that depend on others, whether they contradict or not.
  return status == Status::Solved &&
         passesCheck(wrench, Tolerances<Scalar>::kExactWrench, inequality);
}

// Does the same on the face of relax(), where equalities and inequalities may all but depend on
// each other, by the method of multipliers: what the forces do not give is added to what is asked
// for
//
//     minimise ½ ‖x‖² + ½ ‖s‖²   subject to   D NE λ + √ε s = asked,   A λ ≤ 0
//
// again and again, until nothing is missing.
template <class Scalar>
bool TwoStageSolver<Scalar>::minimizeCostOnFace(const Vector6& wrench, Scalar tolerance) {
  assembleCheapest(slackened_, Tolerances<Scalar>::kSlack);
  restrictToFace();
  slackened_.h.setZero(m_);
  // The residual is to be accurate, too.
  const Scalar enough = std::min(Tolerances<Scalar>::kMissing,
                                 std::max(Tolerances<Scalar>::kMissing * 1000 * distance_.norm(),
                                          Tolerances<Scalar>::kRounding));
  Vector6 asked = weights_.cwiseProduct(wrench),
          missing = Vector6::Constant(std::numeric_limits<Scalar>::infinity());
  for (int step = 0; step < Tolerances<Scalar>::kMultiplierSteps; ++step) {
    slackened_.d = asked.cwiseQuotient(slackened_.norms);  // weighted, as the slacks are
    const Status status =
        minimizeNorm(slackened_, tolerance, Tolerances<Scalar>::kDependentInequality);
    if (status != Status::Solved) return false;
    lambda_.noalias() = face_ * slackened_.solver.x().tail(n_);
    lambda_ = lambda_.cwiseQuotient(slackened_.scales);
    const Vector6 former = missing;
    missing = weights_.cwiseProduct(wrench - give(lambda_));
    const Scalar ratio = step > 0 ? missing.dot(former) / former.squaredNorm() : Scalar(0);
    if (missing.norm() <= Tolerances<Scalar>::kRounding ||
        (missing.norm() <= enough && step > 0 && !(ratio < 0.5)))
      break;
    if (ratio > 1. - Tolerances<Scalar>::kLeastShrinking &&
        missing.norm() <= Tolerances<Scalar>::kExactWrench / 10.)
      break;
    // What shrinks slowly and evenly is the beginning of a geometric series.
    asked +=
        missing / std::max(1 - std::max(ratio, Scalar(0)), Tolerances<Scalar>::kLeastShrinking);
  }
  return passesCheck(wrench, Tolerances<Scalar>::kAccurateWrench,
                     Tolerances<Scalar>::kAccurateInequality);
}

// Finds the reachable wrench closest to a target, which is weighted by D and over the unit, by
// the proximal point method: with e = D NE, columns at unit length, and λ̃ the forces in that scale,
//
//     minimise ½ ‖e λ̃ − target‖² + ½ δ ‖λ̃ − λ̃₀‖²   subject to   A λ ≤ 0
//
// again and again, λ̃₀ being the answer before. Any δ > 0 leads to a minimum of the first term, and
// after a finite number of steps, because all is linear. As a problem of least norm its variables
// are (√δ (λ̃ − λ̃₀), s), with s the distance: eᵀ √δ (λ̃ − λ̃₀) + √δ s = √δ (target − e λ̃₀).
template <class Scalar>
bool TwoStageSolver<Scalar>::findClosest(const Vector6& target) {
  Solver& solver = slackened_.solver;
  slackened_.d.resize(6);
  slackened_.h.resize(m_);
  scaled_.setZero(n_);
  distance_ = target;
  Scalar proximity = Tolerances<Scalar>::kProximity,
         former = std::numeric_limits<Scalar>::infinity();
  int stalled = 0;
  assembleClosest(proximity);
  for (int step = 0; step < Tolerances<Scalar>::kProximalSteps; ++step) {
    slackened_.d = proximity * (target - giveScaled(scaled_)).cwiseQuotient(slackened_.norms);
    slackened_.h.noalias() = -proximity * (slackened_.G.bottomRows(n_).transpose() * scaled_);
    Scalar tolerance = Tolerances<Scalar>::kRounding * std::max(distance_.norm(), proximity);
    // Less than what rounding leaves behind, a tolerance can keep the solver going in circles.
    Status status = Status::IterationLimit;
    for (int attempt = 0; attempt < 3 && status == Status::IterationLimit; ++attempt) {
      status = minimizeNorm(slackened_, tolerance, Tolerances<Scalar>::kDependentInequality);
      tolerance *= 100;
    }
    if (status != Status::Solved) return false;
    distance_ = solver.x().template head<6>();
    change_ = solver.x().tail(n_) / proximity;
    scaled_ += change_;
    if (change_.norm() <= Tolerances<Scalar>::kProximalChange * (1. + scaled_.norm())) break;
    const bool closer = distance_.norm() < (1. - Tolerances<Scalar>::kProximalGain) * former;
    stalled = closer ? 0 : stalled + 1;
    if (stalled == Tolerances<Scalar>::kStalledSteps) break;
    former = distance_.norm();
    extrapolate();
    if (step >= Tolerances<Scalar>::kEasySteps && distance_.norm() < proximity &&
        proximity > Tolerances<Scalar>::kLeastProximity) {
      proximity = std::max(distance_.norm(), Tolerances<Scalar>::kLeastProximity);
      assembleClosest(proximity);
    }
  }
  lambda_ = scaled_.cwiseQuotient(slackened_.scales);
  relaxation_multipliers_ = proximity * solver.z().cwiseMax(0.);
  return true;
}

template <class Scalar>
bool TwoStageSolver<Scalar>::relax(const Vector6& target) {
  iterations_ = 0;
  maximal_iterations_ = std::numeric_limits<int>::max();
  return findClosest(target);
}

// Goes on along the last change of findClosest(), as far as the distance becomes less and no
// inequality is in the way: directions in which forces hardly give a wrench, such as those of soles
// that are nearly parallel, would take very many steps.
template <class Scalar>
void TwoStageSolver<Scalar>::extrapolate() {
  const Vector6 moved = giveScaled(change_);
  Scalar length = slackened_.solver.x().template head<6>().dot(moved) / moved.squaredNorm();
  if (!(length > 0.)) return;
  slackened_.h.noalias() = slackened_.G.bottomRows(n_).transpose() * change_;
  for (Eigen::Index j = 0; j < m_; ++j)
    if (slackened_.h[j] > Tolerances<Scalar>::kParallel * change_.norm())
      length = std::min(length, -slackened_.G.col(j).tail(n_).dot(scaled_) / slackened_.h[j]);
  if (length > 0.) scaled_ += length * change_;
}

// The weighted wrench of forces times their scales.
template <class Scalar>
typename TwoStageSolver<Scalar>::Vector6 TwoStageSolver<Scalar>::giveScaled(
    const KeptVector& forces) const {
  Vector6 wrench;
  wrench.noalias() = slackened_.E.bottomRows(n_).transpose() * forces;
  return wrench.cwiseProduct(slackened_.norms);
}

// What multipliers of relax() have to be more than, not to be rounding.
template <class Scalar>
Scalar TwoStageSolver<Scalar>::findLeastMultiplier() const {
  return std::max(Scalar(kMultiplied) * distance_.norm(), Tolerances<Scalar>::kMultiplierRounding);
}

// Where relax() has multiplied an inequality, all forces that come as close to the wrench hold it
// as an equation. Each touches one contact alone: in a basis of that contact's coordinates which
// begins with their normals, the cheapest forces have zeros there, and the rest are their
// variables.
template <class Scalar>
void TwoStageSolver<Scalar>::restrictToFace() {
  const Scalar least = findLeastMultiplier();
  face_.setZero(n_, n_);
  R_.setZero(n_, n_);
  Eigen::Index col = 0, row = 0;
  for (const Contact& contact : contacts_) {
    const Eigen::Index cols = contact.A.cols(), rows = contact.A.rows();
    auto basis = face_.block(col, col, cols, cols);
    Eigen::Index size = 0;
    // Gram and Schmidt, twice, because once is not accurate; false if nothing is left.
    const auto append = [&](const auto& vector, Scalar least) {
      auto added = basis.col(size);
      added = vector;
      for (int twice = 0; twice < 2; ++twice)
        for (Eigen::Index k = 0; k < size; ++k) added -= basis.col(k).dot(added) * basis.col(k);
      const Scalar length = added.norm();
      const bool independent = length > least;
      if (independent) {
        added /= length;
        ++size;
      } else {
        added.setZero();
      }
      return independent;
    };

    for (Eigen::Index j = row; j < row + rows && size < cols; ++j) {
      if (!(relaxation_multipliers_[j] > least)) continue;
      const auto normal = slackened_.G.col(j).segment(6 + col, cols);
      if (!append(normal, Tolerances<Scalar>::kDependent * normal.norm())) continue;
      held_[col + size - 1] = j;
      R_.col(col + size - 1).segment(col, size).noalias() =
          basis.leftCols(size).transpose() * normal;
    }
    const Eigen::Index zeros = size;
    for (Eigen::Index i = 0; i < cols && size < cols; ++i)
      append(Vector::Unit(cols, i), 0.5 / static_cast<Scalar>(cols));

    auto coordinates = products_.head(cols);
    const auto change = [&](auto&& vector) {
      coordinates.noalias() = basis.transpose() * vector;
      coordinates.head(zeros).setZero();
      // What depends on held inequalities is zero, and not what rounding has left of it.
      if (coordinates.norm() <= Tolerances<Scalar>::kDependent * vector.norm())
        coordinates.setZero();
      vector = coordinates;
    };
    if (zeros > 0) {
      for (Eigen::Index j = row; j < row + rows; ++j)
        change(slackened_.G.col(j).segment(6 + col, cols));
      for (Eigen::Index i = 0; i < 6; ++i) change(slackened_.E.col(i).segment(6 + col, cols));
    } else {
      basis.setIdentity();
    }
    col += cols;
    row += rows;
  }
}

template <class Scalar>
DistributionStatus TwoStageSolver<Scalar>::solve(const Vector6& wrench, int maximal_iterations) {
  iterations_ = 0;
  maximal_iterations_ = maximal_iterations;
  relaxation_multipliers_.setZero(m_);
  held_.setConstant(n_, -1);
  on_face_ = false;
  if (minimizeCost(wrench, Tolerances<Scalar>::kNearlyDependent,
                   Tolerances<Scalar>::kExactInequality))
    return DistributionStatus::Solved;

  if (!findClosest(weights_.cwiseProduct(wrench))) return DistributionStatus::NumericalFailure;
  on_face_ = true;
  // Large forces that cancel out want a larger tolerance.
  const Vector6 closest = wrench - distance_.cwiseQuotient(weights_);
  for (const Scalar tolerance :
       {Tolerances<Scalar>::kTolerance, 10 * Tolerances<Scalar>::kTolerance,
        100 * Tolerances<Scalar>::kTolerance})
    if (minimizeCostOnFace(closest, tolerance))
      return weights_.cwiseProduct(wrench - give(lambda_)).norm() <= kReach
                 ? DistributionStatus::Solved
                 : DistributionStatus::Relaxed;
  // Where contacts are nearly parallel, the first attempt may have been too strict.
  on_face_ = false;
  relaxation_multipliers_.setZero();
  return minimizeCost(wrench, Tolerances<Scalar>::kDependentInequality,
                      Tolerances<Scalar>::kAccurateInequality)
             ? DistributionStatus::Solved
             : DistributionStatus::NumericalFailure;
}

template <class Scalar>
bool TwoStageSolver<Scalar>::hasFewDigits() const {
  const Scalar spread = weights_.maxCoeff() / weights_.minCoeff();
  return on_face_ && (distance_.norm() < Tolerances<Scalar>::kNearBoundary * spread ||
                      lambda_.norm() > Tolerances<Scalar>::kLargeForces);
}

template <class Scalar>
bool TwoStageSolver<Scalar>::passesCheck(const Vector6& wrench, Scalar reach,
                                         Scalar inequality) const {
  if (!(weights_.cwiseProduct(give(lambda_) - wrench).norm() <= reach)) return false;
  inequality *= std::max(Scalar(1), lambda_.template lpNorm<Eigen::Infinity>());
  Eigen::Index col = 0;
  for (const Contact& contact : contacts_) {
    const Eigen::Index cols = contact.A.cols();
    for (Eigen::Index j = 0; j < contact.A.rows(); ++j)
      if (!(contact.A.row(j).dot(lambda_.segment(col, cols)) <= inequality)) return false;
    col += cols;
  }
  return true;
}

template <class Scalar>
typename TwoStageSolver<Scalar>::Vector6 TwoStageSolver<Scalar>::give(
    const KeptVector& forces) const {
  Vector6 wrench = Vector6::Zero();
  Eigen::Index col = 0;
  for (const Contact& contact : contacts_) {
    wrench.noalias() += contact.NE * forces.segment(col, contact.NE.cols());
    col += contact.NE.cols();
  }
  return wrench;
}

template <class Scalar>
void TwoStageSolver<Scalar>::writeAnswer(DistributionResult& result, double unit,
                                         double overall_weight) {
  const Scalar newtons = unit;
  const Scalar cost_scale = newtons * largest_weight_ * largest_weight_;
  // D² is the square of the relative weights times this.
  const Scalar distance_scale = newtons * overall_weight * overall_weight;
  const Program& program = on_face_ ? slackened_ : direct_;
  Vector6 y = program.solver.y().cwiseQuotient(program.norms);
  if (on_face_) y = y.cwiseProduct(weights_);
  result.wrench_multipliers = (-cost_scale * y).template cast<double>();
  multipliers_ = program.solver.z();
  active_.setConstant(m_, false);
  for (const Eigen::Index inequality : program.solver.active()) active_[inequality] = true;

  Eigen::Index col = 0, row = 0;
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    const Contact& contact = contacts_[k];
    const Eigen::Index rows = contact.A.rows(), cols = contact.A.cols();

    // Those of held inequalities make up for what is missing: x + E y + G z = 0.
    Eigen::Index size = 0;
    while (size < cols && held_[col + size] >= 0) ++size;
    if (size > 0) {
      auto missing = gradient_.head(cols);
      missing.noalias() = contact.NE.transpose() * y;
      missing.noalias() += contact.A.transpose() * multipliers_.segment(row, rows);
      missing = missing.cwiseQuotient(program.scales.segment(col, cols));
      missing += lambda_.segment(col, cols).cwiseProduct(program.scales.segment(col, cols));
      auto of_held = products_.head(size);
      of_held.noalias() = face_.block(col, col, cols, size).transpose() * missing;
      of_held = -of_held;
      R_.block(col, col, size, size).template triangularView<Eigen::Upper>().solveInPlace(of_held);
      for (Eigen::Index i = 0; i < size; ++i) {
        multipliers_[held_[col + i]] = of_held[i];
        active_[held_[col + i]] = true;
      }
    }

    DistributionResult::Contact& answer = result.contacts[k];
    answer.force = (newtons * lambda_.segment(col, cols)).template cast<double>();
    answer.multipliers = (cost_scale * multipliers_.segment(row, rows)).template cast<double>();
    answer.relaxation_multipliers =
        (distance_scale * relaxation_multipliers_.segment(row, rows)).template cast<double>();
    answer.active = active_.segment(row, rows);
    // Of an inequality that does not hold as an equation, what is no more is rounding.
    const double rounding = double(distance_scale * findLeastMultiplier());
    for (Eigen::Index j = 0; j < rows; ++j) {
      double& multiplier = answer.relaxation_multipliers[j];
      const double slack = -answer.A.row(j).dot(answer.force);
      if (multiplier <= rounding && slack > kReach * unit) multiplier = 0.;
    }
    col += cols;
    row += rows;
  }
}

template class TwoStageSolver<double>;
template class TwoStageSolver<long double>;

}  // namespace dynacom::internal
