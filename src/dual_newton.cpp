// SPDX-License-Identifier: BSD-2-Clause
#include "dual_newton.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "newton_limits.hpp"
#include "wrench_span.hpp"

namespace dynacom::internal {

namespace {

using namespace newton;

constexpr int kNormal = BoxCone::kNormal;

// How many steps are taken without ε before those with, and from the state of the last answer.
constexpr int kFreeSteps = 3;
constexpr int kFreeStepsFromLast = 2;
// For how many problems a contact may take no part, so that it begins where it left. That is for
// contacts that come and go; where a foot comes down after a step, its state says nothing: in a
// walk of 50 Hz it costs more steps than it saves, at 1 kHz it makes no difference.
constexpr std::size_t kShortAbsence = 10;
// ε, as a part of the mean compliance: less, if the answer that it leads to is none.
constexpr double kSlacks[] = {1e-3, 1e-4, 1e-6, 1e-8, 1e-11};
constexpr int kMaximalSteps = 50;
// Until when an answer is refined out of reach, where what is missing is to be accurate, too.
constexpr double kExact = 4e-16;
constexpr int kRefinements = 3;

// Calls a function with an integral_constant for the number of a contact's components, so that the
// compiler knows it.
template <class Function>
void withSize(int size, Function function) {
  if (size == 6)
    function(std::integral_constant<int, 6>());
  else
    function(std::integral_constant<int, 3>());
}

// Calls a function with 0, 1, ... 5, which the compiler knows.
template <class Function, int... Indices>
void unroll(Function function, std::integer_sequence<int, Indices...>) {
  (function(std::integral_constant<int, Indices>()), ...);
}
template <class Function>
void unroll6(Function function) {
  unroll(function, std::make_integer_sequence<int, 6>());
}

}  // namespace

// Column by column, with all numbers in registers.
void Factors6::compute(const Matrix6& matrix) {
  double rest[6][6];
  unroll6([&](auto row) {
    unroll6([&](auto column) {
      constexpr int i = row, j = column;
      if constexpr (j <= i) rest[i][j] = matrix(i, j);
    });
  });
  unroll6([&](auto column) {
    constexpr int j = column;
    pivots_[j] = rest[j][j];
    inverse_pivots_[j] = 1. / rest[j][j];
    unroll6([&](auto row) {
      constexpr int i = row;
      if constexpr (i > j) L_(i, j) = rest[i][j] * inverse_pivots_[j];
    });
    unroll6([&](auto row) {
      unroll6([&](auto next_column) {
        constexpr int i = row, k = next_column;
        if constexpr (k > j && k <= i) rest[i][k] -= L_(i, j) * rest[k][j];
      });
    });
  });
}

Factors6::Vector6 Factors6::solve(const Vector6& rhs) const {
  Vector6 x = rhs;
  unroll6([&](auto column) {
    unroll6([&](auto row) {
      constexpr int i = row, j = column;
      if constexpr (i > j) x[i] -= L_(i, j) * x[j];
    });
  });
  x = x.cwiseProduct(inverse_pivots_);
  unroll6([&](auto step) {
    unroll6([&](auto row) {
      constexpr int i = row, j = 5 - step;
      if constexpr (i < j) x[i] -= L_(j, i) * x[j];
    });
  });
  return x;
}

std::optional<BoxCone> BoxCone::recognise(const Eigen::MatrixXd& A) {
  BoxCone cone;
  if (A.cols() != 3 && A.cols() != 6) return std::nullopt;
  cone.size = static_cast<int>(A.cols());
  for (Eigen::Index row = 0; row < A.rows(); ++row) {
    const double of_normal = A(row, kNormal);
    Eigen::Index bounded = -1;
    for (Eigen::Index i = 0; i < A.cols(); ++i) {
      if (i == kNormal || A(row, i) == 0.) continue;
      if (bounded >= 0) return std::nullopt;
      bounded = i;
    }
    if (bounded < 0) {
      if (!(of_normal < 0.) || cone.normal_row >= 0) return std::nullopt;
      cone.normal_row = row;
      cone.normal_factor = -of_normal;
      continue;
    }
    const double factor = std::abs(A(row, bounded)), beta = -of_normal / factor;
    Side& side = cone.sides[static_cast<std::size_t>(bounded)];
    const std::size_t which = A(row, bounded) > 0. ? 0 : 1;
    const bool other_known = side.rows[1 - which] >= 0;
    if (!(beta >= 0.) || side.rows[which] >= 0 || (other_known && side.beta != beta))
      return std::nullopt;
    side.beta = beta;
    side.rows[which] = row;
    side.factors[which] = factor;
  }
  if (cone.normal_row < 0) return std::nullopt;
  for (int i = 0; i < cone.size; ++i)
    if (i != kNormal && (cone.sides[static_cast<std::size_t>(i)].rows[0] < 0 ||
                         cone.sides[static_cast<std::size_t>(i)].rows[1] < 0))
      return std::nullopt;
  return cone;
}

void DualNewton::reserve(std::size_t slots) {
  if (slots > blocks_.size()) blocks_.resize(slots);
  active_.reserve(slots);
  directions_.reserve(6 * slots);
}

void DualNewton::setContact(std::size_t slot, const Contact& contact) {
  Block& block = blocks_[slot];
  const std::optional<BoxCone> cone = BoxCone::recognise(contact.A);
  block.is_box = cone.has_value();
  if (!cone) return;
  block.cone = *cone;
  block.largest_weight = contact.weights.maxCoeff();
  block.betas.setZero();
  block.reaches.setConstant(std::numeric_limits<double>::infinity());
  block.free = State();
  block.free.loaded = true;
  for (int i = 0; i < cone->size; ++i) {
    const double beta = cone->sides[static_cast<std::size_t>(i)].beta;
    block.betas[i] = beta * contact.weights[i] / contact.weights[BoxCone::kNormal];
    if (beta > 0.) block.reaches[i] = block.betas[i];
    if (i != BoxCone::kNormal && beta == 0.) block.free.bounds[static_cast<std::size_t>(i)] = 1;
  }
  block.reaches[BoxCone::kNormal] = 1.;
  block.e.setZero();
  block.has_pure_moments = false;
  forget(block);
}

void DualNewton::forget(Block& block) {
  block.last = block.free;
  block.state = State();
  block.last_problem_number = problem_number_;
  block.is_free.setZero();
  block.edge.setZero();
  block.inverse_stiffness = 0.;
}

void DualNewton::forget() {
  for (Block& block : blocks_) forget(block);
  has_answer_ = finished_ = false;
}

void DualNewton::setActive(const std::vector<std::size_t>& slots,
                           const std::vector<Contact>& contacts) {
  for (const std::size_t slot : active_) blocks_[slot].last_problem_number = problem_number_;
  for (const std::size_t slot : slots)
    if (problem_number_ - blocks_[slot].last_problem_number > kShortAbsence)
      blocks_[slot].last = blocks_[slot].free;
  active_ = slots;
  recognised_ = true;
  largest_weight_ = 0.;
  for (const std::size_t slot : active_) {
    recognised_ = recognised_ && blocks_[slot].is_box;
    largest_weight_ = std::max(largest_weight_, blocks_[slot].largest_weight);
  }
  if (!recognised_) return;
  for (std::size_t k = 0; k < active_.size(); ++k) {
    Block& block = blocks_[active_[k]];
    block.weights.setOnes();
    block.weights.head(block.cone.size) = contacts[k].weights / largest_weight_;
    block.inverse_weights = block.weights.cwiseInverse();
  }
}

// Enters the state to start from, contact by contact. Returns whether any differs from
// Start::Free.
bool DualNewton::begin(Start start) {
  bool differs = false;
  for (const std::size_t slot : active_) {
    Block& block = blocks_[slot];
    enter(block, start == Start::LastAnswer ? block.last : block.free);
    differs = differs || !(block.state == block.free);
  }
  return differs;
}

void DualNewton::enter(Block& block, const State& state) {
  const bool same = state == block.state;
  block.state = state;  // where there is no load, bounds may differ
  if (same) return;
  for (int i = 0; i < 6; ++i) {
    const int bound = state.loaded ? state.bounds[static_cast<std::size_t>(i)] : 1;
    block.is_free[i] = bound == 0 ? 1. : 0.;
    block.edge[i] = state.loaded ? bound * block.betas[i] : 0.;
  }
  if (!state.loaded) return;
  block.is_free[kNormal] = 0.;  // but with those at their bounds
  block.edge[kNormal] = 1.;
  block.inverse_stiffness = 1. / block.edge.squaredNorm();
}

// The state that a pull wants. What x_z would have to be less,
//
//     x_z − g_z − Σ βᵢ max(0, |gᵢ| − βᵢ x_z),
//
// rises, ever less steeply: from zero on, where all that pull sideways are at their bounds,
// Newton's method comes from the left, and lets go of one bound after the other.
//
// From another point it comes there with its first step.
template <int kSize>
DualNewton::State DualNewton::findState(const Block& block) {
  const Vector6& g = block.pull;
  double sizes[kSize], is_held[kSize], normal = 0.;
  for (int i = 0; i < kSize; ++i) {
    sizes[i] = std::abs(g[i]);
    is_held[i] = 1. - block.is_free[i];
  }
  for (int step = 0; step <= kSize; ++step) {
    double numerator = g[kNormal], denominator = 1., changes = 0.;
    for (int i = 0; i < kSize; ++i) {
      const double held_beta = is_held[i] * block.betas[i];
      numerator += held_beta * sizes[i];
      denominator += held_beta * block.betas[i];
    }
    normal = std::max(0., numerator / denominator);
    for (int i = 0; i < kSize; ++i) {
      const double holds = sizes[i] > block.betas[i] * normal ? 1. : 0.;
      changes += std::abs(holds - is_held[i]);
      is_held[i] = holds;
    }
    if (changes == 0.) break;
  }
  State state;
  state.loaded = normal > 0.;
  for (int i = 0; i < kSize; ++i) {
    const double beta = block.betas[i];
    const signed char side = g[i] < 0. && beta > 0. ? -1 : 1;
    state.bounds[static_cast<std::size_t>(i)] = is_held[i] != 0. || beta == 0. ? side : 0;
  }
  state.bounds[kNormal] = 0;
  return state;
}

EIGEN_STRONG_INLINE DualNewton::Vector6 DualNewton::pullOf(const Block& block,
                                                           const Vector6& multipliers) {
  Vector6 pull = Vector6::Zero();
  withSize(block.cone.size, [&](auto size) {
    pull.template head<size>().noalias() =
        block.e.template leftCols<size>().transpose() * multipliers;
  });
  return pull;
}

// Whether forces, or a pull, leave all components free.
EIGEN_STRONG_INLINE bool DualNewton::isInside(const Block& block, const Vector6& force) {
  const double normal = force[kNormal];
  return normal > 0. && (force.cwiseAbs() - normal * block.reaches).maxCoeff() <= 0.;
}

// The forces for a pull, as long as the state stays.
DualNewton::Vector6 DualNewton::respond(const Block& block, const Vector6& pull) {
  return block.is_free.cwiseProduct(pull) +
         (block.edge.dot(pull) * block.inverse_stiffness) * block.edge;
}

EIGEN_STRONG_INLINE void DualNewton::addWrench(const Block& block, const Vector6& force,
                                               Vector6& wrench) {
  withSize(block.cone.size, [&](auto size) {
    wrench.noalias() += block.e.template leftCols<size>() * force.template head<size>();
  });
}

void DualNewton::keepStates() {
  for (const std::size_t slot : active_) blocks_[slot].former = blocks_[slot].state;
}

// The forces for the multipliers at hand, in the state that they want. Returns whether that is
// another than at the last keepStates().
bool DualNewton::evaluate() {
  bool changed = false;
  achieved_.setZero();
  for (const std::size_t slot : active_) {
    Block& block = blocks_[slot];
    block.pull = pullOf(block, multipliers_);
    if (isInside(block, block.pull))
      enter(block, block.free);
    else
      withSize(block.cone.size, [&](auto size) { enter(block, findState<size>(block)); });
    block.force = respond(block, block.pull);
    addWrench(block, block.force, achieved_);
    changed = changed || !(block.state == block.former);
  }
  return changed;
}

// Begins anew with multipliers in the state at hand.
void DualNewton::restart(const Vector6& multipliers) {
  multipliers_.setZero();
  for (const std::size_t slot : active_) {
    blocks_[slot].pull.setZero();
    blocks_[slot].force.setZero();
  }
  correct(multipliers);
}

// Changes the multipliers in the state at hand. The forces change by what they respond to the
// change, which is more accurate than what they respond to the sum.
void DualNewton::correct(const Vector6& change) {
  multipliers_ += change;
  achieved_.setZero();
  for (const std::size_t slot : active_) {
    Block& block = blocks_[slot];
    const Vector6 pull = pullOf(block, change);
    block.pull += pull;
    block.force += respond(block, pull);
    addWrench(block, block.force, achieved_);
  }
}

// The wrench that a unit of the normal force, and what goes with it, gives.
DualNewton::Vector6 DualNewton::normalWrench(const Block& block) {
  if (block.inverse_stiffness == 1.) return block.e.col(kNormal);
  Vector6 wrench = Vector6::Zero();
  addWrench(block, block.edge, wrench);
  return wrench;
}

// How the wrench rises with its multipliers, as long as the state stays: the lower half.
void DualNewton::assembleCompliance() {
  Matrix6 compliance = Matrix6::Zero();
  // Two products at a time: what is summed up is read and written half as often. Those of pure
  // moments, of which the upper half is zero, on their own.
  struct Product {
    const double *column = nullptr, *row = nullptr;
  };
  const auto add = [&](const Product& product, Product& waiting, auto first_row) {
    if (!waiting.column) {
      waiting = product;
      return;
    }
    const Eigen::Map<const Vector6> a(waiting.column), b(product.column);
    const double *a_row = waiting.row, *b_row = product.row;
    waiting = Product();
    unroll6([&](auto column) {
      constexpr int j = column, segment = 6 - j / 2 * 2;  // packets of two begin at even rows
      if constexpr (j >= first_row)
        compliance.col(j).template tail<segment>() +=
            a_row[j] * a.template tail<segment>() + b_row[j] * b.template tail<segment>();
    });
  };
  Product force, moment;
  const std::integral_constant<int, 0> of_force;
  const std::integral_constant<int, 3> of_moment;
  for (const std::size_t slot : active_) {
    Block& block = blocks_[slot];
    if (!block.state.loaded) continue;
    block.normal_wrench = normalWrench(block);
    block.normal_response = block.inverse_stiffness * block.normal_wrench;
    add({block.normal_wrench.data(), block.normal_response.data()}, force, of_force);
    const auto square = [&](int i) {
      const double* column = block.e.col(i).data();
      return Product{column, column};
    };
    const int forces = block.has_pure_moments ? 3 : block.cone.size;
    for (int i = 0; i < forces; ++i)
      if (block.is_free[i] != 0.) add(square(i), force, of_force);
    for (int i = forces; i < block.cone.size; ++i)
      if (block.is_free[i] != 0.) add(square(i), moment, of_moment);
  }
  const Vector6 nothing = Vector6::Zero();
  if (force.column) add({nothing.data(), nothing.data()}, force, of_force);
  if (moment.column) add({nothing.data(), nothing.data()}, moment, of_moment);
  compliance_ = compliance;
}

// Steps without ε, from the state at hand, until the wrench is reached. Returns false if it is not,
// or if the state hardly gives some wrenches.
bool DualNewton::stepFreely(int steps) {
  rank_ = 6;
  for (int step = 0; step < steps && stepsTaken() < maximal_iterations_; ++step) {
    ++iterations_;
    assembleCompliance();
    factors_.compute(compliance_);
    if (!hasFullRank()) {
      if (step == 0) restart(Vector6::Zero());
      return false;
    }
    multipliers_ = factors_.solve(target_);
    keepStates();
    const bool changed = evaluate();
    if (!changed) refine(target_, kMissing);
    if (isReached(target_, kMissing)) {
      // Where components are just at their bounds, rounding may say of the state at hand that it is
      // another; the one before has led here.
      for (const std::size_t slot : active_) blocks_[slot].last = blocks_[slot].former;
      return isFinite();
    }
    if (!changed) return false;
  }
  return false;
}

// The first step where a sole is on its own: it gives each wrench by one force, x = e⁻¹ times the
// wrench, and as moments give no force, that is two systems of three equations. Returns false,
// without a step, if the contact is of another kind, the force is not inside of the cone, or digits
// were lost.
bool DualNewton::stepAsSole() {
  if (active_.size() != 1) return false;
  Block& block = blocks_[active_.front()];
  if (!block.has_pure_moments || !block.free.hasBounds(State())) return false;
  const Eigen::Matrix3d of_force = block.e.topLeftCorner<3, 3>().inverse(),
                        of_moment = block.e.bottomRightCorner<3, 3>().inverse();
  const auto lever = block.e.bottomLeftCorner<3, 3>();  // takes forces to moments
  block.force.head<3>().noalias() = of_force * target_.head<3>();
  block.force.tail<3>().noalias() = of_moment * (target_.tail<3>() - lever * block.force.head<3>());
  achieved_.setZero();
  addWrench(block, block.force, achieved_);
  if (!isInside(block, block.force) || !isReached(target_, kMissing)) return false;

  block.pull = block.force;  // eᵀ ν
  multipliers_.tail<3>().noalias() = of_moment.transpose() * block.pull.tail<3>();
  multipliers_.head<3>().noalias() =
      of_force.transpose() * (block.pull.head<3>() - lever.transpose() * multipliers_.tail<3>());
  block.last = block.free;
  ++iterations_;
  return true;
}

// Newton's method with ε, from the multipliers and the state at hand, until the state stays.
// Returns false if it does not.
bool DualNewton::stepWithSlack() {
  Vector6 gradient = achieved_ + slack_ * multipliers_ - target_;
  while (stepsTaken() < std::min(kMaximalSteps, maximal_iterations_)) {
    ++iterations_;
    assembleCompliance();
    Matrix6 slackened = compliance_;
    slackened.diagonal().array() += slack_;
    factors_.compute(slackened);
    const Vector6 step = -factors_.solve(gradient);
    const double slope = gradient.dot(step);
    if (!(slope < 0.)) return gradient.norm() <= kMissing;
    // The slope along the step rises from negative on. The full step is taken unless the slope is
    // positive there; else one is sought where it has nearly vanished, or at least the state is
    // another.
    const Vector6 start = multipliers_;
    keepStates();
    double length = 1., lower = 0., upper = 1., lower_slope = slope, upper_slope = 0.;
    bool changed = false;
    for (int cut = 0;; ++cut) {
      if (cut == kMaximalCuts) return false;
      multipliers_ = start + length * step;
      changed = evaluate();
      gradient = achieved_ + slack_ * multipliers_ - target_;
      if (cut == 0 && !changed) break;
      const double end_slope = gradient.dot(step);
      const bool descends = end_slope < 0.;
      if (std::abs(end_slope) <= -kFlat * slope || (descends && cut == 0) ||
          (descends && changed && cut >= kEasyCuts)) {
        changed = true;
        break;
      }
      (descends ? lower : upper) = length;
      (descends ? lower_slope : upper_slope) = end_slope;
      // By turns where a straight line between both would vanish, and in the middle.
      if (cut % 2 == 0)
        length = lower + (upper - lower) * lower_slope / (lower_slope - upper_slope);
      else
        length = upper > kFarApart * lower && lower > 0. ? std::sqrt(lower * upper)
                                                         : 0.5 * (lower + upper);
    }
    if (!changed) return true;
  }
  return false;
}

// From the state to the answer, without ε; its compliance has been assembled and decomposed.
DistributionStatus DualNewton::finish() {
  missing_.setZero();
  rank_ = 6;
  if (!hasFullRank() && !findRange()) return DistributionStatus::NumericalFailure;

  if (rank_ < 6) {
    // The closest wrench is the projection on what the directions span.
    missing_ = target_ - projectOnRange(target_);
    missing_ -= projectOnRange(missing_);
    const double distance = missing_.norm();
    if (distance <= kReached)
      missing_.setZero();
    else if (distance < kFar * weights_.maxCoeff() / weights_.minCoeff())
      return DistributionStatus::NumericalFailure;
    compliance_.triangularView<Eigen::StrictlyUpper>() = compliance_.transpose();
    Matrix6 reduced = range_.transpose() * (compliance_ * range_);
    reduced.diagonal().tail(6 - rank_).setOnes();
    factors_.compute(reduced);
    restart(projectOnRange(multipliers_));
  }
  const Vector6 closest = target_ - missing_;
  const bool reached = missing_.isZero(0.);
  refine(closest, reached ? kMissing : kExact);
  if (!isReached(closest, kMissing) || !provesItself() || !isFinite())
    return DistributionStatus::NumericalFailure;
  for (const std::size_t slot : active_) blocks_[slot].last = blocks_[slot].state;
  finished_ = true;
  return reached ? DistributionStatus::Solved : DistributionStatus::Relaxed;
}

DualNewton::Vector6 DualNewton::projectOnRange(const Vector6& wrench) const {
  return range_ * (range_.transpose() * wrench);
}

// The multipliers that change the wrench by as much, of those in the range.
DualNewton::Vector6 DualNewton::solveRange(const Vector6& wrench) const {
  if (rank_ == 6) return factors_.solve(wrench);
  return range_ * factors_.solve(range_.transpose() * wrench);
}

// An orthonormal basis of the wrenches that the state can give, whatever it costs. Returns false if
// the rank is not certain.
bool DualNewton::findRange() {
  directions_.clear();
  for (const std::size_t slot : active_) {
    const Block& block = blocks_[slot];
    if (!block.state.loaded) continue;
    directions_.push_back(normalWrench(block).normalized());
    for (int i = 0; i < block.cone.size; ++i)
      if (block.is_free[i] != 0.) directions_.push_back(block.e.col(i).normalized());
  }
  return findSpan(directions_, kIndependent, kDependent, range_, rank_);
}

// Whether multipliers of both stages have the signs that they must have, and forces are in their
// cones; sets the bounds of components without extent, which are at both.
bool DualNewton::provesItself() {
  const double distance = missing_.norm();
  double all_terms = 0., costs = kRounding;
  for (const std::size_t slot : active_) {
    Block& block = blocks_[slot];
    // What pulls and forces are made of, without signs.
    block.terms = block.force.cwiseAbs();
    block.terms.noalias() += block.e.cwiseAbs().transpose() * multipliers_.cwiseAbs();
    all_terms = std::max(all_terms, block.terms.maxCoeff());
    costs = std::max(costs, block.force.cwiseAbs().maxCoeff());
  }
  if (!(all_terms <= kCancellation * costs)) return false;

  for (const std::size_t slot : active_) {
    Block& block = blocks_[slot];
    block.pull_of_distance = pullOf(block, missing_);
    const Vector6& p = block.pull_of_distance;
    const Vector6& g = block.pull;
    // What the normal direction is made of, its size, and what its rounding may be.
    double resistance_of_distance = -p[kNormal], resistance = -g[kNormal];
    double length = distance * block.e.col(kNormal).norm();
    double rounding = kRounding * block.terms[kNormal];
    double largest_beta = 1.;
    for (int i = 0; i < block.cone.size; ++i) {
      if (i == kNormal) continue;
      const double beta = block.betas[i], size = std::abs(p[i]);
      const double scale = distance * block.e.col(i).norm();
      const double own_rounding = kRounding * block.terms[i];
      // Of what bears no load, such a pull only says on which side it is bound.
      const bool decides = block.state.loaded && beta > 0.;
      if (decides && size > kFree * scale && size < kHeld * scale) return false;
      const bool held = size > kFree * scale && size >= kHeld * scale;
      signed char& bound = block.state.bounds[static_cast<std::size_t>(i)];
      if (!block.state.loaded || beta == 0.) {
        bound = (held ? p[i] : g[i]) < 0. ? -1 : 1;
      } else if (bound == 0) {
        if (held || !(std::abs(block.force[i]) <=
                      beta * block.force[kNormal] + kRounding * block.weights[i]))
          return false;
        continue;
      } else if (held ? bound * p[i] < 0. : !(bound * (g[i] - block.force[i]) >= -own_rounding)) {
        return false;
      }
      resistance_of_distance -= bound * beta * p[i];
      resistance -= bound * beta * g[i];
      length += beta * scale;
      rounding += beta * own_rounding;
      largest_beta = std::max(largest_beta, block.cone.sides[static_cast<std::size_t>(i)].beta);
    }
    if (block.state.loaded) {
      if (!(block.force[kNormal] * largest_beta >= -kRounding * block.weights[kNormal]))
        return false;
      continue;
    }
    const bool held = resistance_of_distance >= kHeld * length && distance > 0.;
    if (!held && !(std::abs(resistance_of_distance) <= kFree * length)) return false;
    if (!held && !(resistance >= -rounding)) return false;
  }
  return true;
}

bool DualNewton::hasFullRank() const {
  const Vector6& pivots = factors_.pivots();
  return (pivots.array() > kFullRank * pivots.maxCoeff()).all();
}

bool DualNewton::isReached(const Vector6& wrench, double enough) const {
  return (wrench - achieved_).squaredNorm() <= enough * enough;
}

// Corrects the multipliers until no more than this is lacking of a wrench.
void DualNewton::refine(const Vector6& wrench, double enough) {
  for (int refinement = 0; refinement < kRefinements && !isReached(wrench, enough); ++refinement)
    correct(solveRange(wrench - achieved_));
}

// Whether the contacts' matrices are finite: whatever of them is not, the pulls are not.
bool DualNewton::isFinite() const {
  double sum = 0.;
  for (const std::size_t slot : active_) sum += blocks_[slot].pull.cwiseAbs().sum();
  return std::isfinite(sum);
}

DistributionStatus DualNewton::solve(const std::vector<Contact>& contacts, const Vector6& target,
                                     const Vector6& wrench_weights, bool warm_start,
                                     int maximal_iterations) {
  ++problem_number_;
  iterations_ = iterations_in_vain_ = 0;
  maximal_iterations_ = maximal_iterations;
  if (!recognised_) return DistributionStatus::NumericalFailure;
  weights_ = wrench_weights;
  target_ = target;
  for (std::size_t k = 0; k < active_.size(); ++k) {
    Block& block = blocks_[active_[k]];
    withSize(block.cone.size, [&](auto size) {
      const Eigen::Map<const Eigen::Matrix<double, 6, size>> NE(contacts[k].NE.data());
      for (int i = 0; i < size; ++i)
        block.e.col(i) = weights_.cwiseProduct(NE.col(i)) * block.inverse_weights[i];
      if constexpr (size == 6)
        block.has_pure_moments = NE.template topRightCorner<3, 3>().cwiseAbs().sum() == 0.;
    });
  }

  const DistributionStatus status = search(warm_start && has_answer_);
  has_answer_ = status != DistributionStatus::NumericalFailure;
  return status;
}

DistributionStatus DualNewton::search(bool from_last_answer) {
  const bool was_finished = finished_;
  finished_ = false;
  bool reached = false;
  if (from_last_answer) {
    // With all components free, it is the start without a last answer.
    const bool differs = begin(Start::LastAnswer);
    if (differs || was_finished) {
      reached = stepFreely(kFreeStepsFromLast);
      if (!reached && was_finished && iterations_ == 1 && !hasFullRank()) {
        // The state of the last answer may lead to this one as it led to that.
        const DistributionStatus status = finish();
        if (status != DistributionStatus::NumericalFailure) return status;
      }
      if (!reached) iterations_in_vain_ = iterations_;
    }
  }
  if (!reached) {
    begin(Start::Free);
    reached = stepAsSole() || stepFreely(kFreeSteps);
  }
  if (reached) {
    missing_.setZero();
    settle();
    return DistributionStatus::Solved;
  }

  double mean_compliance = 0.;
  for (const std::size_t slot : active_) mean_compliance += blocks_[slot].e.squaredNorm() / 6.;
  for (const double slack : kSlacks) {
    slack_ = slack * mean_compliance;
    if (!stepWithSlack()) break;
    const Vector6 multipliers = multipliers_;
    assembleCompliance();
    factors_.compute(compliance_);
    const DistributionStatus status = finish();
    if (status != DistributionStatus::NumericalFailure) return status;
    multipliers_ = multipliers;
    evaluate();
  }
  return DistributionStatus::NumericalFailure;
}

// Of an answer within reach, what provesItself() sets: components without extent are at both
// bounds.
void DualNewton::settle() {
  for (const std::size_t slot : active_) {
    Block& block = blocks_[slot];
    block.pull_of_distance.setZero();
    for (int i = 0; i < block.cone.size; ++i)
      if (block.betas[i] == 0. && i != kNormal)
        block.state.bounds[static_cast<std::size_t>(i)] = block.pull[i] < 0. ? -1 : 1;
  }
}

void DualNewton::writeAnswer(DistributionResult& result, double unit, double overall_weight) const {
  const double cost_scale = unit * largest_weight_ * largest_weight_;
  const double distance_scale = unit * overall_weight * overall_weight;
  result.wrench_multipliers = cost_scale * weights_.cwiseProduct(multipliers_);
  result.achieved = unit * achieved_.cwiseQuotient(weights_);
  result.residual = result.wrench - result.achieved;
  double cost = 0.;
  for (std::size_t k = 0; k < active_.size(); ++k) {
    const Block& block = blocks_[active_[k]];
    const int size = block.cone.size;
    Contact& contact = result.contacts[k];
    const Vector6 force = unit * block.force.cwiseProduct(block.inverse_weights);
    contact.force = force.head(size);
    cost += block.force.squaredNorm();
    contact.multipliers.setZero();
    contact.relaxation_multipliers.setZero();
    contact.active.setConstant(false);
    double of_normal = block.force[kNormal] - block.pull[kNormal];
    double of_distance = -block.pull_of_distance[kNormal];
    const auto write = [&](Eigen::Index row, double factor, double multiplier,
                           double multiplier_of_distance) {
      contact.active[row] = true;
      contact.multipliers[row] = cost_scale * factor * multiplier;
      contact.relaxation_multipliers[row] =
          std::max(0., distance_scale * factor * multiplier_of_distance);
    };
    for (int i = 0; i < size; ++i) {
      const double bound = block.state.bounds[static_cast<std::size_t>(i)];
      if (bound == 0.) continue;
      const BoxCone::Side& side = block.cone.sides[static_cast<std::size_t>(i)];
      const std::size_t which = bound > 0. ? 0 : 1;
      const double multiplier = bound * (block.pull[i] - block.force[i]);
      const double multiplier_of_distance = bound * block.pull_of_distance[i];
      write(side.rows[which], block.weights[i] / side.factors[which], multiplier,
            multiplier_of_distance);
      of_normal -= block.betas[i] * multiplier;
      of_distance -= block.betas[i] * multiplier_of_distance;
    }
    if (!block.state.loaded)
      write(block.cone.normal_row, block.weights[kNormal] / block.cone.normal_factor, of_normal,
            of_distance);
  }
  result.cost = 0.5 * unit * cost_scale * cost;
}

}  // namespace dynacom::internal
