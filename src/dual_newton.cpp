// SPDX-License-Identifier: BSD-2-Clause
#include "dual_newton.hpp"

#include <algorithm>
#include <cmath>

#include "two_stage.hpp"

namespace dynacom::internal {

namespace {

constexpr int kNormal = BoxCone::kNormal;

// All of these are for a problem whose weighted wrench has unit size.

// ε, as a part of the mean compliance.
constexpr double kSlack = 1e-10;
constexpr int kMaximalSteps = 50;
// A step has gone too far where the dual has begun to fall again by more than this part of its
// slope at the start; how often it is shortened.
constexpr double kOvershoot = 0.1;
constexpr int kMaximalCuts = 10;
// What part of the largest compliance the least must be, so that nothing needs to be asked about
// the rank.
constexpr double kFullRank = 1e-6;
// Of a direction of the wrenches that the contacts give, what remains outside of the others: more
// than the first, it is one of its own, less than the second, it is rounding.
constexpr double kIndependent = 1e-6;
constexpr double kDependent = 1e-11;
// The distance from the closest wrench: more than the first, it has digits enough, less than the
// second, it is rounding.
constexpr double kFar = 1e-5;
constexpr double kReached = 1e-13;
// What an answer may lack.
constexpr double kMissing = 1e-12;
constexpr int kRefinements = 3;
// By how much the signs of an answer may be wrong, beside the terms that make them up.
constexpr double kRounding = 1e-12;
// Of the distance, a multiplier that is not zero, and one that is.
constexpr double kHeld = 1e-8;
constexpr double kFree = 1e-12;
// By how much terms may be larger than the costs that they make up.
constexpr double kCancellation = 1e6;

double sign(double value) { return value < 0. ? -1. : 1.; }

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
  double largest_weight = 0.;
  for (const Contact& contact : contacts)
    largest_weight = std::max(largest_weight, contact.weights.maxCoeff());
  largest_cost_ = largest_weight * largest_weight;
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const Contact& contact = contacts[k];
    const std::optional<BoxCone> cone = BoxCone::recognise(contact.A);
    if (!cone) {
      recognised_ = false;
      return;
    }
    Block& block = blocks_[k];
    block.cone = *cone;
    block.costs.setOnes();
    block.costs.head(cone->size) = (contact.weights / largest_weight).cwiseAbs2();
    block.compliances = block.costs.cwiseInverse();
    for (std::size_t i = 0; i < 6; ++i)
      block.betas[static_cast<Eigen::Index>(i)] = cone->sides[i].beta;
    block.e.setZero();
    block.pull.setZero();
    block.force.setZero();
  }
  directions_.reserve(6 * contacts.size());
}

// Begins with all components free, but for those that are always zero.
void DualNewton::release() {
  for (Block& block : blocks_) {
    block.loaded = true;
    for (int i = 0; i < block.cone.size; ++i)
      block.bounds[i] = i != kNormal && block.betas[i] == 0. ? 1 : 0;
  }
}

// The forces in the cone for the pull at hand. What λ_z would have to be less,
//
//     q_z λ_z − g_z − Σ βᵢ max(0, |gᵢ| − qᵢ βᵢ λ_z),
//
// rises, ever less steeply: from zero on, where all that pull sideways are at their bounds,
// Newton's method comes from the left, and lets go of one bound after the other.
void DualNewton::project(Block& block) {
  const int size = block.cone.size;
  const Vector6& g = block.pull;
  double normal = g[kNormal] * block.compliances[kNormal];
  bool inside = normal > 0.;
  for (int i = 0; i < size; ++i)
    inside = inside &&
             (i == kNormal || std::abs(g[i]) * block.compliances[i] <= block.betas[i] * normal);
  if (inside) {
    block.loaded = true;
    for (int i = 0; i < size; ++i) block.bounds[i] = block.betas[i] == 0. && i != kNormal ? 1 : 0;
    return;
  }

  double numerator = g[kNormal], denominator = block.costs[kNormal];
  for (int i = 0; i < size; ++i) {
    block.bounds[i] = 0;
    if (i == kNormal) continue;
    block.bounds[i] = g[i] < 0. ? -1 : 1;
    numerator += block.betas[i] * std::abs(g[i]);
    denominator += block.betas[i] * block.betas[i] * block.costs[i];
  }
  block.loaded = numerator > 0.;
  if (!block.loaded) return;
  for (bool changed = true; changed;) {
    normal = numerator / denominator;
    changed = false;
    for (int i = 0; i < size; ++i) {
      if (i == kNormal || block.bounds[i] == 0 || block.betas[i] == 0.) continue;
      if (std::abs(g[i]) > block.costs[i] * block.betas[i] * normal) continue;
      block.bounds[i] = 0;
      numerator -= block.betas[i] * std::abs(g[i]);
      denominator -= block.betas[i] * block.betas[i] * block.costs[i];
      changed = true;
    }
  }
}

// The forces for the pull at hand, components at their bounds staying there.
void DualNewton::respond(Block& block) {
  block.force.setZero();
  if (!block.loaded) return;
  double numerator = block.pull[kNormal];
  for (int i = 0; i < block.cone.size; ++i)
    numerator += block.bounds[i] * block.betas[i] * block.pull[i];
  const double normal = numerator / block.stiffness;
  for (int i = 0; i < block.cone.size; ++i)
    block.force[i] = block.bounds[i] == 0 ? block.pull[i] * block.compliances[i]
                                          : block.bounds[i] * block.betas[i] * normal;
  block.force[kNormal] = normal;
}

// The forces for multipliers of the wrench, and what they give. Unless the state is kept, it
// becomes theirs; returns whether it was another before.
bool DualNewton::evaluate(const Vector6& multipliers, bool keep) {
  bool changed = false;
  achieved_.setZero();
  for (Block& block : blocks_) {
    block.pull.noalias() = block.e.transpose() * multipliers;
    if (!keep) {
      const auto bounds = block.bounds;
      const bool loaded = block.loaded;
      project(block);
      changed = changed || loaded != block.loaded || (loaded && bounds != block.bounds);
      takeStiffness(block);
    }
    respond(block);
    achieved_.noalias() += block.e * block.force;
  }
  return changed;
}

// What the normal force and all that goes with it cost.
void DualNewton::takeStiffness(Block& block) {
  block.stiffness = block.costs[kNormal];
  for (int i = 0; i < block.cone.size; ++i)
    if (block.bounds[i] != 0) block.stiffness += block.betas[i] * block.betas[i] * block.costs[i];
}

// The direction of wrenches that goes with the normal force.
DualNewton::Vector6 DualNewton::normalDirection(const Block& block) {
  Vector6 direction = block.e.col(kNormal);
  for (int i = 0; i < block.cone.size; ++i)
    if (block.bounds[i] != 0) direction += block.bounds[i] * block.betas[i] * block.e.col(i);
  return direction;
}

// How the wrench rises with its multipliers, as long as the state stays.
void DualNewton::assembleCompliance() {
  compliance_.setZero();
  for (const Block& block : blocks_) {
    if (!block.loaded) continue;
    const Vector6 direction = normalDirection(block);
    compliance_.noalias() += direction * (direction / block.stiffness).transpose();
    for (int i = 0; i < block.cone.size; ++i)
      if (block.bounds[i] == 0 && i != kNormal)
        compliance_.noalias() +=
            block.e.col(i) * (block.compliances[i] * block.e.col(i)).transpose();
  }
}

// Newton's method with ε, until the state stays. Returns false if it does not.
bool DualNewton::findState() {
  release();
  for (Block& block : blocks_) takeStiffness(block);
  multipliers_.setZero();
  Vector6 gradient = -target_;
  for (iterations_ = 1; iterations_ <= kMaximalSteps; ++iterations_) {
    assembleCompliance();
    if (iterations_ == 1) slack_ = kSlack * compliance_.trace() / 6.;
    Matrix6 slackened = compliance_;
    slackened.diagonal().array() += slack_;
    factors_.compute(slackened);
    const Vector6 step = -factors_.solve(gradient);
    const double slope = gradient.dot(step);
    if (!(slope < 0.)) return false;
    bool changed = false;
    double length = 1.;
    for (int cut = 0;; ++cut) {
      if (cut > kMaximalCuts) return false;
      const Vector6 next = multipliers_ + length * step;
      changed = evaluate(next, false) || changed || cut > 0;
      gradient = achieved_ + slack_ * next - target_;
      const double end_slope = gradient.dot(step);
      if (!(end_slope > -kOvershoot * slope)) break;
      length *= std::max(0.1, slope / (slope - end_slope));
    }
    multipliers_ += length * step;
    if (!changed) return true;
  }
  return false;
}

// From the state to the answer, without ε.
DistributionStatus DualNewton::finish() {
  missing_.setZero();
  rank_ = 6;
  const auto pivots = factors_.matrixLLT().diagonal();
  const double least = pivots.minCoeff(), largest = pivots.maxCoeff();
  if (!(least * least > kFullRank * largest * largest) && !findRange())
    return DistributionStatus::NumericalFailure;

  if (rank_ < 6) {
    // The closest wrench is the projection on what the directions span.
    const auto range = range_.leftCols(rank_);
    missing_ = target_ - range * (range.transpose() * target_);
    missing_ -= range * (range.transpose() * missing_);
    const double distance = missing_.norm();
    if (distance <= kReached)
      missing_.setZero();
    else if (distance < kFar)
      return DistributionStatus::NumericalFailure;
    Matrix6 reduced = Matrix6::Identity();
    reduced.topLeftCorner(rank_, rank_).noalias() = range.transpose() * compliance_ * range;
    factors_.compute(reduced);
    multipliers_ = range * (range.transpose() * multipliers_);
  }
  const Vector6 closest = target_ - missing_;
  evaluate(multipliers_, true);
  for (int refinement = 0; refinement < kRefinements; ++refinement) {
    const Vector6 lacking = closest - achieved_;
    if (lacking.norm() <= kMissing) break;
    multipliers_ += solveRange(lacking);
    evaluate(multipliers_, true);
  }
  if (!((closest - achieved_).norm() <= kMissing) || !provesItself())
    return DistributionStatus::NumericalFailure;
  return missing_.isZero(0.) ? DistributionStatus::Solved : DistributionStatus::Relaxed;
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
    if (!block.loaded) continue;
    directions_.push_back(normalDirection(block).normalized());
    for (int i = 0; i < block.cone.size; ++i)
      if (block.bounds[i] == 0 && i != kNormal) directions_.push_back(block.e.col(i).normalized());
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
  const double held = kHeld * distance, free = kFree * distance;
  for (Block& block : blocks_) {
    const int size = block.cone.size;
    block.pull_of_distance.noalias() = block.e.transpose() * missing_;
    const Vector6& p = block.pull_of_distance;
    const Vector6& g = block.pull;
    double terms = 0., costs = kRounding;
    for (int i = 0; i < size; ++i) {
      terms = std::max(terms, block.e.col(i).cwiseAbs().dot(multipliers_.cwiseAbs()));
      costs = std::max(costs, block.costs[i] * std::abs(block.force[i]));
    }
    const double rounding = kRounding * (terms + costs);
    if (terms > kCancellation * costs) return false;

    double resistance_of_distance = -p[kNormal], resistance = -g[kNormal];
    for (int i = 0; i < size; ++i) {
      if (i == kNormal) continue;
      const double beta = block.betas[i], size_of_p = std::abs(p[i]);
      if (size_of_p > free && size_of_p < held) return false;
      const bool is_held = size_of_p >= held && distance > 0.;
      if (!block.loaded || beta == 0.) {
        const double bound = sign(is_held ? p[i] : g[i]);
        block.bounds[i] = bound < 0. ? -1 : 1;
      } else if (block.bounds[i] == 0) {
        if (is_held || !(std::abs(block.force[i]) <= beta * block.force[kNormal] + kRounding))
          return false;
        continue;
      } else if (is_held
                     ? block.bounds[i] * p[i] < 0.
                     : !(block.bounds[i] * (g[i] - block.costs[i] * block.force[i]) >= -rounding)) {
        return false;
      }
      resistance_of_distance -= block.bounds[i] * beta * p[i];
      resistance -= block.bounds[i] * beta * g[i];
    }
    if (block.loaded) {
      if (!(block.force[kNormal] >= -kRounding)) return false;
      block.held = false;
      continue;
    }
    if (resistance_of_distance < -free ||
        (resistance_of_distance > free && resistance_of_distance < held))
      return false;
    block.held = distance > 0. && resistance_of_distance >= held;
    if (!block.held && !(resistance >= -rounding)) return false;
  }
  return true;
}

DistributionStatus DualNewton::solve(const std::vector<Contact>& contacts, const Vector6& wrench,
                                     const Vector6& wrench_weights) {
  iterations_ = 0;
  if (!recognised_) return DistributionStatus::NumericalFailure;
  weights_ = wrench_weights;
  target_ = weights_.cwiseProduct(wrench);
  for (std::size_t k = 0; k < blocks_.size(); ++k)
    blocks_[k].e.leftCols(blocks_[k].cone.size).noalias() = weights_.asDiagonal() * contacts[k].NE;
  return findState() ? finish() : DistributionStatus::NumericalFailure;
}

void DualNewton::writeAnswer(DistributionResult& result, double unit, double overall_weight) const {
  const double cost_scale = unit * largest_cost_;
  const double distance_scale = unit * overall_weight * overall_weight;
  result.wrench_multipliers = cost_scale * weights_.cwiseProduct(multipliers_);
  for (std::size_t k = 0; k < blocks_.size(); ++k) {
    const Block& block = blocks_[k];
    const int size = block.cone.size;
    Contact& contact = result.contacts[k];
    contact.force = unit * block.force.head(size);
    contact.multipliers.setZero();
    contact.relaxation_multipliers.setZero();
    contact.active.setConstant(false);
    double of_normal = block.costs[kNormal] * block.force[kNormal] - block.pull[kNormal];
    double of_distance = -block.pull_of_distance[kNormal];
    for (int i = 0; i < size; ++i) {
      if (block.bounds[i] == 0) continue;
      const double bound = block.bounds[i];
      const BoxCone::Side& side = block.cone.sides[static_cast<std::size_t>(i)];
      const std::size_t which = bound > 0. ? 0 : 1;
      const double multiplier = bound * (block.pull[i] - block.costs[i] * block.force[i]);
      const double multiplier_of_distance = bound * block.pull_of_distance[i];
      contact.active[side.rows[which]] = true;
      contact.multipliers[side.rows[which]] = cost_scale * multiplier / side.factors[which];
      contact.relaxation_multipliers[side.rows[which]] =
          std::max(0., distance_scale * multiplier_of_distance / side.factors[which]);
      of_normal -= block.betas[i] * multiplier;
      of_distance -= block.betas[i] * multiplier_of_distance;
    }
    if (block.loaded) continue;
    contact.active[block.cone.normal_row] = true;
    contact.multipliers[block.cone.normal_row] = cost_scale * of_normal / block.cone.normal_factor;
    contact.relaxation_multipliers[block.cone.normal_row] =
        std::max(0., distance_scale * of_distance / block.cone.normal_factor);
  }
}

}  // namespace dynacom::internal
