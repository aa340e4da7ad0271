// SPDX-License-Identifier: BSD-2-Clause
#include "dual_newton.hpp"

#include <algorithm>
#include <cmath>

namespace dynacom::internal {

namespace {

constexpr int kNormal = BoxCone::kNormal;

// All of these are for a problem whose weighted wrench has unit size.

// ε, as a part of the mean compliance: less, if the answer that it leads to is none.
constexpr double kSlacks[] = {1e-5, 1e-8, 1e-11};
constexpr int kMaximalSteps = 50;
// Along a step, what part of the slope at its start is as good as none.
constexpr double kFlat = 0.3;
// How often a step is cut, and how often until it is enough to have come to another state.
constexpr int kMaximalCuts = 30;
constexpr int kEasyCuts = 3;
// For which ratio of two lengths their middle is the geometric one.
constexpr double kFarApart = 4.;
// What part of the largest compliance the least must be, so that nothing needs to be asked about
// the rank.
constexpr double kFullRank = 1e-6;
// Of a direction of the wrenches that the contacts give, what remains outside of the others: more
// than the first, it is one of its own, less than the second, it is rounding.
constexpr double kIndependent = 1e-5;
constexpr double kDependent = 1e-11;
// The distance from the closest wrench: more than the first, times how far wrench weights are
// apart, it has digits enough, less than the second, it is rounding.
constexpr double kFar = 1e-4;
constexpr double kReached = 1e-13;
// What an answer may lack, and until when it is refined out of reach, where what is missing is to
// be accurate, too.
constexpr double kMissing = 1e-12;
constexpr double kExact = 4e-16;
constexpr int kRefinements = 3;
// By how much the signs of an answer may be wrong, beside the terms that make them up.
constexpr double kRounding = 1e-12;
// Of the distance, a multiplier that is not zero, and one that is.
constexpr double kHeld = 1e-8;
constexpr double kFree = 1e-12;
// By how much terms may be larger than the costs that they make up.
constexpr double kCancellation = 1e6;

}  // namespace

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

void DualNewton::setContacts(const std::vector<Contact>& contacts) {
  blocks_.resize(contacts.size());
  recognised_ = true;
  largest_weight_ = 0.;
  for (const Contact& contact : contacts)
    largest_weight_ = std::max(largest_weight_, contact.weights.maxCoeff());
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const Contact& contact = contacts[k];
    const std::optional<BoxCone> cone = BoxCone::recognise(contact.A);
    if (!cone) {
      recognised_ = false;
      return;
    }
    Block& block = blocks_[k];
    block.cone = *cone;
    block.weights.setOnes();
    block.weights.head(cone->size) = contact.weights / largest_weight_;
    for (int i = 0; i < 6; ++i)
      block.betas[i] =
          cone->sides[static_cast<std::size_t>(i)].beta * block.weights[i] / block.weights[kNormal];
    block.free.loaded = true;
    for (int i = 0; i < cone->size; ++i)
      block.free.bounds[static_cast<std::size_t>(i)] = i != kNormal && block.betas[i] == 0. ? 1 : 0;
    block.e.setZero();
    block.state = block.former = block.free;
  }
  directions_.reserve(6 * contacts.size());
}

// Begins with all components free, but for those that are always zero.
void DualNewton::release() {
  for (Block& block : blocks_) {
    block.state = block.free;
    computeStiffness(block);
  }
}

// The state that the pull at hand wants. What x_z would have to be less,
//
//     x_z − g_z − Σ βᵢ max(0, |gᵢ| − βᵢ x_z),
//
// rises, ever less steeply: from zero on, where all that pull sideways are at their bounds,
// Newton's method comes from the left, and lets go of one bound after the other.
void DualNewton::project(Block& block) {
  const int size = block.cone.size;
  const Vector6& g = block.pull;
  double normal = g[kNormal];
  bool inside = normal > 0.;
  for (int i = 0; i < size; ++i)
    inside &= i == kNormal || std::abs(g[i]) <= block.betas[i] * normal;
  if (inside) {
    block.state = block.free;
    return;
  }

  double numerator = g[kNormal], denominator = 1.;
  for (int i = 0; i < size; ++i) {
    block.state.bounds[i] = 0;
    if (i == kNormal) continue;
    block.state.bounds[i] = g[i] < 0. && block.betas[i] > 0. ? -1 : 1;
    numerator += block.betas[i] * std::abs(g[i]);
    denominator += block.betas[i] * block.betas[i];
  }
  block.state.loaded = numerator > 0.;
  if (!block.state.loaded) return;
  for (bool changed = true; changed;) {
    normal = numerator / denominator;
    changed = false;
    for (int i = 0; i < size; ++i) {
      if (i == kNormal || block.state.bounds[i] == 0 || block.betas[i] == 0. ||
          std::abs(g[i]) > block.betas[i] * normal)
        continue;
      block.state.bounds[i] = 0;
      numerator -= block.betas[i] * std::abs(g[i]);
      denominator -= block.betas[i] * block.betas[i];
      changed = true;
    }
  }
}

// The forces for a pull, components at their bounds staying there.
DualNewton::Vector6 DualNewton::respond(const Block& block, const Vector6& pull) {
  Vector6 force = Vector6::Zero();
  if (!block.state.loaded) return force;
  double numerator = pull[kNormal];
  for (int i = 0; i < block.cone.size; ++i)
    numerator += block.state.bounds[i] * block.betas[i] * pull[i];
  const double normal = numerator / block.stiffness;
  for (int i = 0; i < block.cone.size; ++i)
    force[i] =
        block.state.bounds[i] == 0 ? pull[i] : block.state.bounds[i] * block.betas[i] * normal;
  force[kNormal] = normal;
  return force;
}

// The forces for the multipliers at hand, in the state that they want. Returns whether it is
// another than the former.
bool DualNewton::evaluate() {
  bool changed = false;
  achieved_.setZero();
  for (Block& block : blocks_) {
    block.pull.noalias() = block.e.transpose() * multipliers_;
    project(block);
    computeStiffness(block);
    block.force = respond(block, block.pull);
    achieved_.noalias() += block.e * block.force;
    changed = changed || block.state != block.former;
  }
  return changed;
}

// Begins anew with multipliers in the state at hand.
void DualNewton::restart(const Vector6& multipliers) {
  multipliers_.setZero();
  for (Block& block : blocks_) {
    block.pull.setZero();
    block.force.setZero();
  }
  correct(multipliers);
}

// Changes the multipliers in the state at hand. The forces change by what they respond to the
// change, which is more accurate than what they respond to the sum.
void DualNewton::correct(const Vector6& change) {
  multipliers_ += change;
  achieved_.setZero();
  for (Block& block : blocks_) {
    const Vector6 pull = block.e.transpose() * change;
    block.pull += pull;
    block.force += respond(block, pull);
    achieved_.noalias() += block.e * block.force;
  }
}

// What the normal force and all that goes with it cost.
void DualNewton::computeStiffness(Block& block) {
  block.stiffness = 1.;
  for (int i = 0; i < block.cone.size; ++i)
    if (block.state.bounds[i] != 0) block.stiffness += block.betas[i] * block.betas[i];
}

// The direction of wrenches that goes with the normal force.
DualNewton::Vector6 DualNewton::normalDirection(const Block& block) {
  Vector6 direction = block.e.col(kNormal);
  for (int i = 0; i < block.cone.size; ++i)
    if (block.state.bounds[i] != 0)
      direction += block.state.bounds[i] * block.betas[i] * block.e.col(i);
  return direction;
}

// How the wrench rises with its multipliers, as long as the state stays.
void DualNewton::assembleCompliance() {
  compliance_.setZero();
  for (const Block& block : blocks_) {
    if (!block.state.loaded) continue;
    const Vector6 direction = normalDirection(block);
    compliance_.noalias() += direction * (direction / block.stiffness).transpose();
    for (int i = 0; i < block.cone.size; ++i)
      if (block.state.bounds[i] == 0 && i != kNormal)
        compliance_.noalias() += block.e.col(i) * block.e.col(i).transpose();
  }
}

// Newton's method with ε, from the multipliers and the state at hand, until the state stays.
// Returns false if it does not.
bool DualNewton::findState() {
  Vector6 gradient = achieved_ + slack_ * multipliers_ - target_;
  while (iterations_ < kMaximalSteps) {
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
    for (Block& block : blocks_) block.former = block.state;
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

// From the state to the answer, without ε.
DistributionStatus DualNewton::finish() {
  missing_.setZero();
  rank_ = 6;
  factors_.compute(compliance_);
  if (!hasFullRank() && !findRange()) return DistributionStatus::NumericalFailure;

  if (rank_ < 6) {
    // The closest wrench is the projection on what the directions span.
    const auto range = range_.leftCols(rank_);
    missing_ = target_ - range * (range.transpose() * target_);
    missing_ -= range * (range.transpose() * missing_);
    const double distance = missing_.norm();
    if (distance <= kReached)
      missing_.setZero();
    else if (distance < kFar * weights_.maxCoeff() / weights_.minCoeff())
      return DistributionStatus::NumericalFailure;
    Matrix6 reduced = Matrix6::Identity();
    reduced.topLeftCorner(rank_, rank_).noalias() = range.transpose() * compliance_ * range;
    factors_.compute(reduced);
    restart(range * (range.transpose() * multipliers_));
  }
  const Vector6 closest = target_ - missing_;
  const bool reached = missing_.isZero(0.);
  refine(closest, reached ? kMissing : kExact);
  if (!((closest - achieved_).norm() <= kMissing) || !provesItself())
    return DistributionStatus::NumericalFailure;
  return reached ? DistributionStatus::Solved : DistributionStatus::Relaxed;
}

// The multipliers that change the wrench by as much, of those in the range.
DualNewton::Vector6 DualNewton::solveRange(const Vector6& wrench) const {
  if (rank_ == 6) return factors_.solve(wrench);
  Vector6 coordinates = Vector6::Zero();
  coordinates.head(rank_).noalias() = range_.leftCols(rank_).transpose() * wrench;
  factors_.solveInPlace(coordinates);
  return range_.leftCols(rank_) * coordinates.head(rank_);
}

// An orthonormal basis of the wrenches that the state can give, whatever it costs: one direction
// after the other, of which the most is new. Returns false if the rank is not certain.
bool DualNewton::findRange() {
  directions_.clear();
  for (const Block& block : blocks_) {
    if (!block.state.loaded) continue;
    directions_.push_back(normalDirection(block).normalized());
    for (int i = 0; i < block.cone.size; ++i)
      if (block.state.bounds[i] == 0 && i != kNormal)
        directions_.push_back(block.e.col(i).normalized());
  }
  for (rank_ = 0; rank_ < 6; ++rank_) {
    double most = 0.;
    for (const Vector6& direction : directions_) {
      const double norm = direction.squaredNorm();
      if (!(norm > most)) continue;
      most = norm;
      range_.col(rank_) = direction;
    }
    most = std::sqrt(most);
    if (most <= kDependent) return true;
    if (most < kIndependent) return false;
    auto basis = range_.col(rank_);
    for (int k = 0; k < rank_; ++k) basis -= range_.col(k).dot(basis) * range_.col(k);
    basis.normalize();
    for (Vector6& direction : directions_) direction -= basis.dot(direction) * basis;
  }
  return true;
}

// Whether multipliers of both stages have the signs that they must have, and forces are in their
// cones; sets the bounds of components without extent, which are at both.
bool DualNewton::provesItself() {
  const double distance = missing_.norm();
  double all_terms = 0., costs = kRounding;
  for (Block& block : blocks_) {
    // What pulls and forces are made of, without signs.
    block.terms = block.force.cwiseAbs();
    block.terms.noalias() += block.e.cwiseAbs().transpose() * multipliers_.cwiseAbs();
    all_terms = std::max(all_terms, block.terms.maxCoeff());
    costs = std::max(costs, block.force.cwiseAbs().maxCoeff());
  }
  if (!(all_terms <= kCancellation * costs)) return false;

  for (Block& block : blocks_) {
    block.pull_of_distance.noalias() = block.e.transpose() * missing_;
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
      if (size > kFree * scale && size < kHeld * scale) return false;
      const bool held = size > kFree * scale;
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

// The closed form for forces without inequalities, if they respect them. Returns false if they do
// not, or if the contacts hardly give some wrenches; then it has been the first step.
bool DualNewton::solveFreely() {
  assembleCompliance();
  factors_.compute(compliance_);
  if (!hasFullRank()) return false;
  ++iterations_;
  rank_ = 6;
  missing_.setZero();
  multipliers_ = factors_.solve(target_);
  for (Block& block : blocks_) block.former = block.state;
  if (evaluate()) return false;
  refine(target_, kMissing);
  for (Block& block : blocks_) {
    block.pull_of_distance.setZero();
    for (int i = 0; i < block.cone.size; ++i)
      if (block.state.bounds[i] != 0) block.state.bounds[i] = block.pull[i] < 0. ? -1 : 1;
  }
  return (target_ - achieved_).norm() <= kMissing;
}

bool DualNewton::hasFullRank() const {
  const auto pivots = factors_.matrixLLT().diagonal();
  const double least = pivots.minCoeff(), largest = pivots.maxCoeff();
  return factors_.info() == Eigen::Success && least * least > kFullRank * largest * largest;
}

// Corrects the multipliers until no more than this is lacking of a wrench.
void DualNewton::refine(const Vector6& wrench, double enough) {
  for (int refinement = 0; refinement < kRefinements; ++refinement) {
    const Vector6 lacking = wrench - achieved_;
    if (lacking.norm() <= enough) return;
    correct(solveRange(lacking));
  }
}

DistributionStatus DualNewton::solve(const std::vector<Contact>& contacts, const Vector6& wrench,
                                     const Vector6& wrench_weights) {
  iterations_ = 0;
  if (!recognised_) return DistributionStatus::NumericalFailure;
  weights_ = wrench_weights;
  target_ = weights_.cwiseProduct(wrench);
  for (std::size_t k = 0; k < blocks_.size(); ++k) {
    Block& block = blocks_[k];
    for (int i = 0; i < block.cone.size; ++i)
      block.e.col(i) = weights_.cwiseProduct(contacts[k].NE.col(i)) / block.weights[i];
  }

  release();
  restart(Vector6::Zero());
  if (solveFreely()) return DistributionStatus::Solved;
  const double mean_compliance = compliance_.trace() / 6.;
  for (const double slack : kSlacks) {
    slack_ = slack * mean_compliance;
    if (!findState()) break;
    const Vector6 multipliers = multipliers_;
    const DistributionStatus status = finish();
    if (status != DistributionStatus::NumericalFailure) return status;
    multipliers_ = multipliers;
    evaluate();
  }
  return DistributionStatus::NumericalFailure;
}

void DualNewton::writeAnswer(DistributionResult& result, double unit, double overall_weight) const {
  const double cost_scale = unit * largest_weight_ * largest_weight_;
  const double distance_scale = unit * overall_weight * overall_weight;
  result.wrench_multipliers = cost_scale * weights_.cwiseProduct(multipliers_);
  for (std::size_t k = 0; k < blocks_.size(); ++k) {
    const Block& block = blocks_[k];
    const int size = block.cone.size;
    Contact& contact = result.contacts[k];
    contact.force = unit * block.force.head(size).cwiseQuotient(block.weights.head(size));
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
}

}  // namespace dynacom::internal
