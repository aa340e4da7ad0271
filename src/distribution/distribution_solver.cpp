// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/distribution_solver.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "../check.hpp"
#include "../dual_newton.hpp"
#include "../rotation_check.hpp"
#include "../wrench_span.hpp"
#include "scaled_set.hpp"

namespace dynacom {

using Eigen::Index;
using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using internal::Factors6;
using internal::ScaledSet;
using internal::throwInvalid;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = DistributionProblem::Vector6;

namespace {

// These are for a problem whose weighted wrench has unit size.

// A wrench no farther than this from what the contacts can give is within reach.
constexpr double kReach = 1e-8;
// What an answer may lack.
constexpr double kMissing = 1e-12;
// How many units in the last place of its terms a sum may be off.
constexpr double kRounding = 8. * std::numeric_limits<double>::epsilon();
// Along a step, what part of the slope at its start is as good as none, and by which part of what
// the slope promises the dual has to fall at least (Armijo).
constexpr double kFlat = 0.6, kArmijo = 1e-4;
// For which ratio of two lengths their middle is the geometric one.
constexpr double kFarApart = 4.;
constexpr int kMaximalCuts = 40, kMaximalSteps = 60;
// What part of the largest pivot of the compliance the least must be for a step without slack.
constexpr double kFullRank = 1e-9;
constexpr int kFreeSteps = 3;
// The slack of the proximal point method, over the mean compliance: the first, the least, by which
// it falls where the residual falls less than fivefold, and how many.
constexpr double kFirstSlack = 1e-3, kLeastSlack = 1e-14, kSlackFactor = 0.05, kFall = 0.2;
constexpr int kMaximalRounds = 40;
// On faces, and how often it may fall there until the faces are the wrong ones.
constexpr double kFaceSlack = 1e-5;
constexpr int kSlowRounds = 4;
// Of a direction that faces span, what remains outside of the others: more than the first, it is
// one of its own, less than the second, it is rounding.
constexpr double kIndependent = 1e-6, kDependent = 1e-11;
// What faces that hardly span a direction may leave of the wrench: contacts on a line but for what
// a model's numbers are off.
constexpr double kHardlySpanned = 1e-9;
// Of the residual, a component that exposes a face.
constexpr double kExposed = 1e-9;
constexpr int kResidualSteps = 20;

double normOf(const Vector6& wrench) {
  const double norm = wrench.norm();
  return norm > 1e-140 && norm < 1e140 ? norm : wrench.stableNorm();
}

Matrix3d skew(const Vector3d& v) {
  Matrix3d matrix;
  matrix << 0., -v.z(), v.y(), v.z(), 0., -v.x(), -v.y(), v.x(), 0.;
  return matrix;
}

struct Block {
  int size = 3;
  bool is_described = false;
  Matrix3d rotation;
  Vector3d lever;
  Vector6 weights, inverse_weights;  // W over the largest weight of all
  ContactSet described;              // what `set` is made of
  Vector6 reference;                 // W λ₀ over the unit
  ScaledSet set, face;
  Vector6 pull;  // what the projection is of
  ScaledSet::Response response;

  // W⁻¹ NEᵀ y.
  Vector6 pullOf(const Vector6& y) const {
    Vector6 pull = Vector6::Zero();
    pull.head<3>().noalias() =
        rotation.transpose() * (y.head<3>() + Vector3d(y.tail<3>()).cross(lever));
    if (size == 6) pull.tail<3>().noalias() = rotation.transpose() * y.tail<3>();
    return pull.cwiseProduct(inverse_weights);
  }

  // NE W⁻¹ x.
  Vector6 wrenchOf(const Vector6& x) const {
    const Vector6 force = x.cwiseProduct(inverse_weights);
    Vector6 wrench;
    const Vector3d push = rotation * force.head<3>();
    wrench.head<3>() = push;
    wrench.tail<3>() = lever.cross(push);
    if (size == 6) wrench.tail<3>().noalias() += rotation * force.tail<3>();
    return wrench;
  }

  // Adds NE W⁻¹ J W⁻¹ NEᵀ for J = diag(of_force, of_moment).
  void addCompliance(const Matrix3d& of_force, const Matrix3d& of_moment, Matrix6& sum) const {
    const auto turn = [&](const Matrix3d& matrix, const auto& scales) {
      const Matrix3d scaled = rotation * scales.asDiagonal();
      return Matrix3d(scaled * matrix * scaled.transpose());
    };
    const Matrix3d force = turn(of_force, inverse_weights.head<3>());
    const Matrix3d cross = skew(lever);
    const Matrix3d coupling = cross * force;
    sum.topLeftCorner<3, 3>() += force;
    sum.bottomLeftCorner<3, 3>() += coupling;
    sum.topRightCorner<3, 3>() += coupling.transpose();
    sum.bottomRightCorner<3, 3>() += coupling * cross.transpose();
    if (size == 6) sum.bottomRightCorner<3, 3>() += turn(of_moment, inverse_weights.tail<3>());
  }
};

}  // namespace

Eigen::Matrix<double, 6, Eigen::Dynamic> DistributionProblem::Contact::NE() const {
  Eigen::Matrix<double, 6, Eigen::Dynamic> matrix =
      Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, set.size());
  matrix.topLeftCorner<3, 3>() = rotation;
  matrix.bottomLeftCorner<3, 3>() = skew(lever) * rotation;
  if (set.size() == 6) matrix.bottomRightCorner<3, 3>() = rotation;
  return matrix;
}

void DistributionProblem::validate() const {
  if (!wrench.allFinite()) throwInvalid("wrench must be finite, got ", wrench.transpose());
  if (!wrench_weights.allFinite() || !(wrench_weights.array() > 0.).all())
    throwInvalid("wrench_weights must be finite and > 0, got ", wrench_weights.transpose());
  if (!(std::isfinite(minimal_scale) && minimal_scale >= 0.))
    throwInvalid("minimal_scale must be finite and >= 0, got ", minimal_scale);
  for (const Contact& contact : contacts) {
    const Index size = contact.set.size();
    if (!internal::isOrthonormal(contact.rotation))
      throwInvalid("rotation must be orthonormal, got\n", contact.rotation);
    if (!contact.lever.allFinite())
      throwInvalid("lever must be finite, got ", contact.lever.transpose());
    if (contact.weights.size() != 0) {
      internal::requireSize("weights", contact.weights.size(), size, "components (or none)");
      if (!contact.weights.allFinite() || !(contact.weights.array() > 0.).all())
        throwInvalid("weights must be finite and > 0, got ", contact.weights.transpose());
    }
    if (contact.reference.size() != 0) {
      internal::requireSize("reference", contact.reference.size(), size, "components (or none)");
      if (!contact.reference.allFinite())
        throwInvalid("reference must be finite, got ", contact.reference.transpose());
    }
  }
}

double DistributionProblem::scale() const {
  double force = minimal_scale;  // that there is in any case
  for (const Contact& contact : contacts) {
    const Index n = contact.set.size();
    const auto least = contact.set.lower().cwiseMax(-contact.set.upper()).head(n);
    force = std::max(force, least.maxCoeff());
    if (contact.reference.size() > 0)
      force = std::max(force, contact.reference.lpNorm<Eigen::Infinity>());
  }
  return std::max(force * wrench_weights.head<3>().maxCoeff(),
                  normOf(wrench_weights.cwiseProduct(wrench)));
}

bool DistributionSolution::isOptimal(const DistributionProblem& problem, double tolerance) const {
  const double scale = problem.scale();
  const Vector6& D = problem.wrench_weights;
  const double size = D.cwiseProduct(residual).norm();
  if (status == DistributionStatus::NoContact)
    return problem.contacts.empty() && size > kReach * scale;
  const bool relaxed = status == DistributionStatus::Relaxed;
  if (status != DistributionStatus::Solved && !relaxed) return false;
  if (forces.size() != problem.contacts.size()) return false;
  if (relaxed ? !(size >= kReach * scale * (1. - tolerance))
              : !(size <= kReach * scale * (1. + tolerance)))
    return false;

  const double unit = scale > 0. ? scale / D.maxCoeff() : 1.;
  const Vector6 direction = D.cwiseAbs2().cwiseProduct(residual);
  Vector6 given = Vector6::Zero();
  double gap = 0., distance_gap = 0., all_costs = 0.;
  for (std::size_t k = 0; k < forces.size(); ++k) {
    const DistributionProblem::Contact& contact = problem.contacts[k];
    const Eigen::VectorXd& force = forces[k];
    const Index n = contact.set.size();
    if (force.size() != n || !force.allFinite()) return false;
    const Eigen::VectorXd weights =
        contact.weights.size() > 0 ? contact.weights : Eigen::VectorXd::Ones(n);
    const Eigen::VectorXd reference =
        contact.reference.size() > 0 ? contact.reference : Eigen::VectorXd::Zero(n);
    const auto NE = contact.NE();
    given += NE * force;
    const double force_size = std::max(unit, force.lpNorm<Eigen::Infinity>());
    if (!(contact.set.excess(force) <= tolerance * force_size)) return false;

    // Nothing is farther in the direction of the residual, and of what is as far, nothing cheaper.
    const Eigen::VectorXd pull = NE.transpose() * direction;
    const Eigen::VectorXd gradient =
        weights.cwiseAbs2().cwiseProduct(force - reference) - NE.transpose() * multipliers;
    ScaledSet face(contact.set, Vector6::Ones());
    face.setUnit(contact.set, Vector6::Ones(), 1.);
    Vector6 own = Vector6::Zero(), against = Vector6::Zero(), at = Vector6::Zero();
    own.head(n) = pull;
    against.head(n) = -gradient;
    at.head(n) = force;
    if (relaxed) {
      // Components of the residual that expose a face are more than it may be off.
      const double rounding = std::max(kExposed, 10. * kMissing * scale / size) * direction.norm() *
                              std::max(1., contact.lever.norm());
      distance_gap += std::max(0., face.support(own, rounding) - own.dot(at));
      ScaledSet exposed;
      if (!face.expose(own, rounding, exposed)) return false;
      face = exposed;
    }
    const double terms = (weights.cwiseAbs2().cwiseProduct(force)).lpNorm<Eigen::Infinity>() +
                         multipliers.norm() * std::max(1., contact.lever.norm()) +
                         (weights.cwiseAbs2().cwiseProduct(reference)).lpNorm<Eigen::Infinity>();
    gap += std::max(0., face.support(against, tolerance * terms) - against.dot(at));
    all_costs += terms * force_size;
  }
  return distance_gap <= tolerance * (size * scale + size * size) && gap <= tolerance * all_costs &&
         D.cwiseProduct(given - achieved).norm() <= tolerance * scale &&
         D.cwiseProduct(problem.wrench - achieved - residual).norm() <= tolerance * scale;
}

struct DistributionSolver::Workspace {
  int maximal_iterations = kMaximalIterations;
  bool warm_start = true, has_answer = false;
  DistributionSolution solution;
  std::vector<Block> blocks;
  Vector6 weights;  // D over its overall size
  Vector6 target;
  double mean_compliance = 0., largest_weight = 0.;  // of the cost, of all contacts

  // Of the multipliers at hand.
  Vector6 multipliers = Vector6::Zero(), achieved = Vector6::Zero();
  double terms = 0.;  // what the achieved wrench is a sum of
  double may_lack = kMissing;
  double value = 0.;  // of the dual, without slack
  Matrix6 compliance;
  Factors6 factors;
  int iterations = 0;

  using Which = ScaledSet Block::*;

  void take(const DistributionProblem& problem, double unit, double overall_weight);
  void evaluate(const Vector6& nu, Which which);
  void assemble(double slack);
  bool descend(Which which, double slack, const Vector6& centre, int steps);
  bool startFree();
  double enough() const { return std::max(may_lack, kRounding * terms); }
  Vector6 missing() const { return target - achieved; }
  DistributionStatus search();
  bool relax(const Vector6& guess, bool is_spanned_certainly);
  bool spanFaces(bool is_certain, Matrix6& basis, int& rank, Vector6& fixed);
  bool findResidual(bool is_certain, Vector6& residual);
  std::vector<Vector6> directions;
};

// The problem in units.
void DistributionSolver::Workspace::take(const DistributionProblem& problem, double unit,
                                         double overall_weight) {
  weights = problem.wrench_weights / overall_weight;
  target = weights.cwiseProduct(problem.wrench) / unit;
  blocks.resize(problem.contacts.size());
  directions.reserve(6 * blocks.size());
  largest_weight = 0.;
  for (const auto& contact : problem.contacts)
    largest_weight =
        std::max(largest_weight, contact.weights.size() > 0 ? contact.weights.maxCoeff() : 1.);
  mean_compliance = 0.;
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    const DistributionProblem::Contact& contact = problem.contacts[k];
    Block& block = blocks[k];
    const Index n = contact.set.size();
    block.size = int(n);
    block.rotation = contact.rotation;
    block.lever = contact.lever;
    Vector6 own = Vector6::Ones();
    if (contact.weights.size() > 0)
      own.head(n) = contact.weights / largest_weight;
    else
      own.head(n) /= largest_weight;
    if (!block.is_described || block.weights != own || block.described != contact.set) {
      block.weights = own;
      block.inverse_weights = own.cwiseInverse();
      block.described = contact.set;
      block.set = block.face = ScaledSet(contact.set, own);
      block.is_described = true;
    }
    block.set.setUnit(contact.set, own, unit);
    block.reference.setZero();
    if (contact.reference.size() > 0)
      block.reference.head(n) = contact.reference.cwiseProduct(own.head(n)) / unit;
    for (int i = 0; i < int(n); ++i)
      mean_compliance += weights.cwiseProduct(block.wrenchOf(Vector6::Unit(i))).squaredNorm() / 6.;
  }
}

// The forces for multipliers, and what they amount to.
void DistributionSolver::Workspace::evaluate(const Vector6& nu, Which which) {
  multipliers = nu;
  achieved.setZero();
  terms = value = 0.;
  const Vector6 y = weights.cwiseProduct(nu);
  for (Block& block : blocks) {
    block.pull = block.pullOf(y) + block.reference;
    (block.*which).project(block.pull, block.response);
    const Vector6& x = block.response.force;
    const Vector6 wrench = weights.cwiseProduct(block.wrenchOf(x));
    achieved += wrench;
    terms += wrench.norm();
    value += block.pull.dot(x) - 0.5 * x.squaredNorm();
  }
  value -= nu.dot(target);
}

// How the wrench rises with its multipliers, and its factors.
void DistributionSolver::Workspace::assemble(double slack) {
  compliance.setZero();
  for (const Block& block : blocks) {
    const ScaledSet::Response& response = block.response;
    block.addCompliance(response.of_force, response.of_moment, compliance);
    if (response.inverse_stiffness == 0.) continue;
    const Vector6 growth = block.wrenchOf(response.growth);
    compliance.noalias() += response.inverse_stiffness * growth * growth.transpose();
  }
  compliance = weights.asDiagonal() * compliance * weights.asDiagonal();
  Matrix6 slackened = compliance;
  slackened.diagonal().array() += slack;
  factors.compute(slackened);
}

// Newton's method for the minimum of the dual and ½ slack ‖ν − centre‖², from the multipliers at
// hand. Returns whether it is there; without slack also false where some wrenches are hardly given.
bool DistributionSolver::Workspace::descend(Which which, double slack, const Vector6& centre,
                                            int steps) {
  double former = std::numeric_limits<double>::infinity();
  for (int step = 0; iterations < maximal_iterations; ++step) {
    const Vector6 gradient = slack * (multipliers - centre) - missing();
    const double size = gradient.norm();
    // What no step makes smaller, and is small, is rounding.
    if (size <= enough() || (size <= kMissing && size > 0.5 * former)) return true;
    former = size;
    if (step == steps) return false;
    ++iterations;
    assemble(slack);
    const Vector6& pivots = factors.pivots();
    if (slack == 0. && !(pivots.array() > kFullRank * pivots.maxCoeff()).all()) return false;
    const Vector6 direction = -factors.solve(gradient);
    const double slope = gradient.dot(direction);
    if (!(slope < 0.)) return false;
    const Vector6 start = multipliers;
    const auto costOf = [&] { return value + 0.5 * slack * (multipliers - centre).squaredNorm(); };
    const double cost = costOf();
    // Where the dual has no digits for what the step promises, the gradient has.
    const bool is_local = -slope <= kRounding * std::abs(cost);
    double length = 1., lower = 0., upper = 1., lower_slope = slope, upper_slope = 0.;
    for (int cut = 0;; ++cut) {
      if (cut == kMaximalCuts) return false;
      evaluate(start + length * direction, which);
      const Vector6 residual = slack * (multipliers - centre) - missing();
      if (residual.norm() <= enough()) return true;
      if (is_local) {
        if (residual.norm() < size) break;
        evaluate(start, which);
        return false;
      }
      const double end_slope = residual.dot(direction);
      const bool descends = end_slope <= 0.;
      if ((descends && cut == 0) || (descends && -end_slope <= -kFlat * slope) ||
          (!descends && end_slope <= -kFlat * slope &&
           costOf() <= cost + kArmijo * length * slope + kRounding * std::abs(cost)))
        break;
      (descends ? lower : upper) = length;
      (descends ? lower_slope : upper_slope) = end_slope;
      if (cut % 2 == 0)
        length = lower + (upper - lower) * lower_slope / (lower_slope - upper_slope);
      else
        length = upper > kFarApart * lower && lower > 0. ? std::sqrt(lower * upper)
                                                         : 0.5 * (lower + upper);
    }
  }
  return false;
}

// The multipliers that are the answer if all forces are inside of their sets.
bool DistributionSolver::Workspace::startFree() {
  Matrix6 sum = Matrix6::Zero();
  Vector6 rest = target;
  for (const Block& block : blocks) {
    block.addCompliance(Matrix3d::Identity(), Matrix3d::Identity(), sum);
    rest -= weights.cwiseProduct(block.wrenchOf(block.reference));
  }
  sum = weights.asDiagonal() * sum * weights.asDiagonal();
  factors.compute(sum);
  const Vector6& pivots = factors.pivots();
  const bool has_full_rank = (pivots.array() > kFullRank * pivots.maxCoeff()).all();
  evaluate(has_full_rank ? factors.solve(rest) : Vector6(Vector6::Zero()), &Block::set);
  return has_full_rank;
}

DistributionStatus DistributionSolver::Workspace::search() {
  iterations = 0;
  const Which all = &Block::set;
  if (warm_start && has_answer) {
    evaluate(multipliers, all);
    if (!std::isfinite(achieved.sum())) return DistributionStatus::InvalidInput;
    if (descend(all, 0., multipliers, 2)) return DistributionStatus::Solved;
  }
  if (startFree() && descend(all, 0., multipliers, kFreeSteps)) return DistributionStatus::Solved;
  if (!std::isfinite(achieved.sum())) return DistributionStatus::InvalidInput;

  // The proximal point method on the dual, which is the method of multipliers (Rockafellar 1976).
  double slack = kFirstSlack * mean_compliance, former = std::numeric_limits<double>::infinity();
  Vector6 centre = Vector6::Zero(), former_missing = Vector6::Zero();
  evaluate(centre, all);
  for (int round = 0; round < kMaximalRounds && iterations < maximal_iterations; ++round) {
    descend(all, slack, centre, kMaximalSteps);
    const Vector6 lacking = missing();
    const double size = lacking.norm();
    if (size <= enough()) return DistributionStatus::Solved;
    // What stays is out of reach, if it proves so.
    const bool stays = (lacking - former_missing).norm() <= 0.1 * size;
    if (size > kReach && (round == 0 || stays)) {
      const Vector6 kept = multipliers;
      if (relax(lacking, true)) return DistributionStatus::Relaxed;
      evaluate(kept, all);
      // No smaller slack will tell them apart.
      if (slack <= kLeastSlack * mean_compliance && relax(lacking, false))
        return DistributionStatus::Relaxed;
      evaluate(kept, all);
    }
    former_missing = lacking;
    if (size > kFall * former)
      slack = std::max(slack * kSlackFactor, kLeastSlack * mean_compliance);
    former = size;
    centre = multipliers;
  }
  return missing().norm() <= kReach ? DistributionStatus::Solved
                                    : DistributionStatus::NumericalFailure;
}

// An orthonormal basis of the wrenches that the faces span, and the wrench that all forces in them
// share. Returns false if the rank is not certain, and is to be.
bool DistributionSolver::Workspace::spanFaces(bool is_certain, Matrix6& basis, int& rank,
                                              Vector6& fixed) {
  directions.clear();
  fixed.setZero();
  for (const Block& block : blocks) {
    const ScaledSet::Span span = block.face.span();
    fixed += weights.cwiseProduct(block.wrenchOf(span.fixed));
    for (int k = 0; k < span.count; ++k)
      directions.push_back(weights.cwiseProduct(block.wrenchOf(span.axes.col(k))).normalized());
  }
  return internal::findSpan(directions, kIndependent, is_certain ? kDependent : kIndependent, basis,
                            rank);
}

// What is missing of the closest wrench, from the forces at hand and a guess: the part of the
// target that the faces which forces are on do not span. Where these turn with the residual, by
// Newton's method, whose Jacobian outside of what they span is 1 + Σ ∂(NE x)/∂r. Then the faces are
// those that it exposes.
bool DistributionSolver::Workspace::findResidual(bool is_certain, Vector6& residual) {
  bool is_found = false;
  for (int step = 0; step < kResidualSteps && !is_found; ++step) {
    const Vector6 y = weights.cwiseProduct(residual);
    Matrix6 bend = Matrix6::Zero();
    for (Block& block : blocks) {
      Matrix3d of_force, of_moment;
      block.set.hold(block.response, block.pullOf(y), block.face, of_force, of_moment);
      if (of_force.isZero(0.) && of_moment.isZero(0.)) continue;
      block.addCompliance(of_force, of_moment, bend);
    }
    Matrix6 basis;
    int rank = 0;
    Vector6 fixed;
    if (!spanFaces(is_certain, basis, rank, fixed) || rank == 6) return false;
    const auto spanned = basis.leftCols(rank);
    const Vector6 rest = target - fixed;
    const Vector6 former = residual;
    if (bend.isZero(0.)) {
      residual = rest - spanned * (spanned.transpose() * rest);
      residual -= spanned * (spanned.transpose() * residual);
      is_found = true;
      continue;
    }
    const Matrix6 jacobian =
        Matrix6::Identity() + weights.asDiagonal() * bend * weights.asDiagonal();
    const Eigen::PartialPivLU<Matrix6> lu(jacobian);
    residual += lu.solve(rest - residual);  // but for what faces make up for
    if (rank > 0) {
      using Spanned = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 6>;
      using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6, 6>;
      const Spanned bent = lu.solve(spanned);
      const Eigen::LDLT<Square> along(Square(spanned.transpose() * bent));
      residual -= bent * along.solve(spanned.transpose() * residual);
    }
    is_found = (residual - former).norm() <= kMissing;
  }
  const double size = residual.norm();
  if (!is_found || !(size > kReach) || !std::isfinite(size)) return false;
  const Vector6 y = weights.cwiseProduct(residual);
  for (Block& block : blocks) {
    const double reach = block.inverse_weights.maxCoeff() * std::max(1., block.lever.norm());
    const double tolerance = (kExposed * size + kRounding) * reach;
    if (!block.set.expose(block.pullOf(y), tolerance, block.face)) return false;
  }
  return true;
}

// Out of reach: the closest wrench, then the cheapest forces of those on the faces that its
// residual exposes, and the proof of both.
// @param is_spanned_certainly  whether a direction that faces hardly span is not to be left out
bool DistributionSolver::Workspace::relax(const Vector6& guess, bool is_spanned_certainly) {
  Vector6 residual = guess;
  if (!findResidual(is_spanned_certainly, residual)) return false;
  const Vector6 asked = target;
  target -= residual;
  const Vector6 start = multipliers - multipliers.dot(residual) / residual.squaredNorm() * residual;
  evaluate(start, &Block::face);
  // What is missing is to be accurate: nothing but rounding may be off.
  may_lack = 0.;
  Vector6 centre = start;
  double slack = kFaceSlack * mean_compliance, former = missing().norm();
  for (int slow = 0; slow < kSlowRounds && iterations < maximal_iterations;) {
    descend(&Block::face, slack, centre, kMaximalSteps);
    const double size = missing().norm();
    if (size <= enough() || (size <= kMissing && size > 0.5 * former)) break;
    if (size > kFall * former) {
      ++slow;
      slack = std::max(slack * kSlackFactor, kLeastSlack * mean_compliance);
    }
    former = size;
    centre = multipliers;
  }
  const double left = is_spanned_certainly ? kMissing : kHardlySpanned;
  const bool given = missing().norm() <= std::max(left, enough());
  may_lack = kMissing;
  target = asked;
  if (!given) return false;
  if (!is_spanned_certainly) residual = missing();
  // No reachable wrench is closer: forces are as far in the direction of the residual as any.
  const double size = residual.norm();
  const Vector6 y = weights.cwiseProduct(residual);
  double gap = 0.;
  for (const Block& block : blocks) {
    const Vector6 pull = block.pullOf(y);
    // What does not decide faces has to be less than what a judge would take for a closer wrench.
    const double reach = is_spanned_certainly
                             ? block.inverse_weights.maxCoeff() * std::max(1., block.lever.norm())
                             : 0.5 * block.inverse_weights[2];
    gap += std::max(
        0., block.set.support(pull, kExposed * size * reach) - pull.dot(block.response.force));
  }
  return gap <= kReach * size;
}

DistributionSolver::DistributionSolver() : work_(std::make_unique<Workspace>()) {}
DistributionSolver::DistributionSolver(const DistributionSolver& other)
    : work_(std::make_unique<Workspace>(*other.work_)) {}
DistributionSolver::DistributionSolver(DistributionSolver&& other) noexcept = default;
DistributionSolver& DistributionSolver::operator=(DistributionSolver other) noexcept {
  std::swap(work_, other.work_);
  return *this;
}
DistributionSolver::~DistributionSolver() = default;

void DistributionSolver::setMaximalIterations(int maximal_iterations) {
  if (maximal_iterations <= 0)
    throwInvalid("maximal_iterations must be > 0, got ", maximal_iterations);
  work_->maximal_iterations = maximal_iterations;
}

void DistributionSolver::setWarmStart(bool warm_start) { work_->warm_start = warm_start; }

void DistributionSolver::forget() { work_->has_answer = false; }

const DistributionSolution& DistributionSolver::solve(const DistributionProblem& problem) {
  Workspace& work = *work_;
  DistributionSolution& solution = work.solution;
  const std::size_t contacts = problem.contacts.size();
  work.has_answer = work.has_answer && solution.forces.size() == contacts;
  solution.forces.resize(contacts);
  const Vector6& D = problem.wrench_weights;
  const double scale = problem.scale();
  const double wrench_size = normOf(problem.wrench);
  const double overall_weight =
      wrench_size > 0. ? normOf(D.cwiseProduct(problem.wrench)) / wrench_size : D.maxCoeff();
  const double unit = scale / overall_weight;
  work.iterations = 0;
  if (!problem.wrench.allFinite()) {
    solution.status = DistributionStatus::InvalidInput;
  } else if (contacts == 0) {
    solution.status = wrench_size == 0. || D.cwiseProduct(problem.wrench).norm() <= kReach * scale
                          ? DistributionStatus::Solved
                          : DistributionStatus::NoContact;
  } else if (scale == 0.) {
    solution.status = DistributionStatus::Solved;  // by no forces at all
  } else {
    work.take(problem, unit, overall_weight);
    solution.status = work.search();
  }
  solution.iterations = work.iterations;
  work.has_answer = contacts > 0 && scale > 0. && solution.status == DistributionStatus::Solved;
  const bool answered =
      work.has_answer || (contacts > 0 && solution.status == DistributionStatus::Relaxed);
  solution.achieved.setZero();
  solution.multipliers.setZero();
  solution.cost = 0.;
  const double largest = work.largest_weight;
  if (answered)
    solution.multipliers = unit * largest * largest * work.weights.cwiseProduct(work.multipliers);
  for (std::size_t k = 0; k < contacts; ++k) {
    Eigen::VectorXd& force = solution.forces[k];
    force.setZero(problem.contacts[k].set.size());
    if (!answered) continue;
    const Block& block = work.blocks[k];
    const Vector6 x = block.response.force;
    force = unit * x.cwiseProduct(block.inverse_weights).head(force.size());
    solution.cost += 0.5 * (x - block.reference).squaredNorm() * std::pow(unit * largest, 2);
    solution.achieved += unit * block.wrenchOf(x);
  }
  solution.residual = problem.wrench - solution.achieved;
  return solution;
}

}  // namespace dynacom
