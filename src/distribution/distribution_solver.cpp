// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/distribution_solver.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

#include "../check.hpp"
#include "../factors6.hpp"
#include "../rotation_check.hpp"
#include "../wrench_span.hpp"
#include "scaled_set.hpp"

namespace dynacom {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using internal::Factors6;
using internal::ScaledSet;
using internal::SumOfSquares6;
using internal::throwInvalid;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = DistributionProblem::Vector6;

namespace {

// For a problem whose weighted wrench has unit size. Each stands for one thing.
struct Tolerances {
  // A wrench no farther than this from what contacts can give is within reach: that is the
  // manual's, and what a controller can tell.
  static constexpr double reach = 1e-8;
  // What an answer may lack: what forces of doubles lose by levers and weights of a few decades.
  static constexpr double missing = 5e-13;
  // By how many units in the last place of its terms a sum of some ten may be off.
  static constexpr double rounding = 8. * std::numeric_limits<double>::epsilon();

  // Along a step, what part of the slope at its start is as good as none; by which part of what the
  // slope promises the dual has to fall (Armijo 1966); how often a step may be cut, and how many
  // steps there may be: far more than any problem has taken.
  static constexpr double flat = 0.6, armijo = 1e-4;
  static constexpr int cuts = 40, steps = 60;
  // Where a step is cut in other ways than by its slopes, that is which part of what is left; a
  // step that was cut as often leads far beyond kinks, and the next one is damped, ten times more
  // each.
  static constexpr double back = 0.25;
  static constexpr int many_cuts = 3;
  // How many steps are tried without slack: nearly all wrenches within reach take one or two. More
  // are where the last has left less than this of what was missing.
  static constexpr int direct_steps = 2;
  static constexpr double fast = 0.3;
  // What part of the largest pivot of the compliance the least must be for that: more digits than
  // this leaves are lost.
  static constexpr double full_rank = 1e-9;

  // The slack of the proximal point method, over the mean compliance: the first, which few steps
  // lead to and from which faces are known; the least, rounding; by which it falls where the
  // residual falls less than fivefold; for how many rounds, and for how many that are slow on
  // faces.
  static constexpr double first_slack = 1e-4, least_slack = 1e-14, slack_factor = 0.05, fall = 0.2;
  static constexpr int rounds = 40, slow_rounds = 4;
  // When that little is missing, it is tried without slack.
  static constexpr double close = 1e-2;
  // By which part of what is missing a round may still change that, and how much closer a wrench
  // may be, for an answer where no proof is found: less than that no motion or robot is known by.
  static constexpr double settled = 1e-3, near = 1e-5;

  // Of a direction that faces span, what remains outside of the others: more than the first, it is
  // one of its own, less than the second, it is rounding.
  static constexpr double independent = 1e-6, dependent = 1e-11;
  // And what it is plainly, next to the boundary, too; so of what exposes a face.
  static constexpr double plainly = 0.1;
  // Of the residual, a component that exposes a face.
  static constexpr double exposed = 1e-9;
  // A residual that is no more may be rounding. One that has all digits is more than the other,
  // times the ratio of wrench weights.
  static constexpr double some = 2e-12, far = 1e-4;
  // Of components of the residual, how many times what may be rounding is clearly more.
  static constexpr double clear = 1e4;
};

double normOf(const Vector6& wrench) {
  const double norm = wrench.norm();
  return norm > 1e-140 && norm < 1e140 ? norm : wrench.stableNorm();
}

Matrix3d skew(const Vector3d& v) {
  Matrix3d matrix;
  matrix << 0., -v.z(), v.y(), v.z(), 0., -v.x(), -v.y(), v.x(), 0.;
  return matrix;
}

// Calls a function with the number of a contact's components, which the compiler knows then.
template <class Function>
void withSize(int size, Function function) {
  if (size == 6)
    function(std::integral_constant<int, 6>());
  else
    function(std::integral_constant<int, 3>());
}

template <class Element>
struct Range {
  Element *first, *last;
  Element* begin() const { return first; }
  Element* end() const { return last; }
};

// A contact in units of its cost, x = W λ.
struct Block {
  int size = 3;
  // What `set` is made of.
  bool is_described = false;
  ContactSet described;
  Vector6 described_weights;
  bool has_unit = false;             // whether bounds of forces are in units
  Vector6 weights, inverse_weights;  // W over the largest weight of all
  bool has_reference = false;
  Vector6 reference;            // W λ₀ over the unit
  Matrix6 e = Matrix6::Zero();  // D NE W⁻¹
  ScaledSet set, face;
  Vector6 pull = Vector6::Zero();  // what the projection is of
  ScaledSet::Response response;

  void place(const DistributionProblem::Contact& contact, const Vector6& wrench_weights) {
    const Matrix3d R = contact.rotation * inverse_weights.head<3>().asDiagonal();
    const Vector3d& p = contact.lever;
    e.topLeftCorner<3, 3>() = wrench_weights.head<3>().asDiagonal() * R;
    e.block<1, 3>(3, 0) = wrench_weights[3] * (p.y() * R.row(2) - p.z() * R.row(1));
    e.block<1, 3>(4, 0) = wrench_weights[4] * (p.z() * R.row(0) - p.x() * R.row(2));
    e.block<1, 3>(5, 0) = wrench_weights[5] * (p.x() * R.row(1) - p.y() * R.row(0));
    if (size == 6)
      e.bottomRightCorner<3, 3>() = wrench_weights.tail<3>().asDiagonal() * contact.rotation *
                                    inverse_weights.tail<3>().asDiagonal();
  }

  // eᵀ ν.
  Vector6 pullOf(const Vector6& nu) const {
    Vector6 pull = Vector6::Zero();
    withSize(size, [&](auto n) {
      pull.template head<n>().noalias() = e.template leftCols<n>().transpose() * nu;
    });
    return pull;
  }

  // e x.
  Vector6 wrenchOf(const Vector6& x) const {
    Vector6 wrench;
    withSize(size,
             [&](auto n) { wrench.noalias() = e.template leftCols<n>() * x.template head<n>(); });
    return wrench;
  }

  // Adds e eᵀ.
  void addFreeCompliance(SumOfSquares6& sum) const {
    for (int k = 0; k < 3; ++k) sum.add(e.col(k));
    if (size == 6)
      for (int k = 3; k < 6; ++k) sum.add<3>(e.col(k));
  }

  // Adds the same of points that move along a line in the plane of two components.
  void addAlong(const Vector2d& friction, const Vector2d& moments, SumOfSquares6& sum) const {
    if (!friction.isZero(0.)) sum.add(e.leftCols<2>() * friction);
    if (!moments.isZero(0.)) sum.add<3>(e.middleCols<2>(3) * moments);
  }

  // Adds e J eᵀ with J the Jacobian of the projection.
  void addCompliance(SumOfSquares6& sum) const {
    if (response.is_free) {
      addFreeCompliance(sum);
      return;
    }
    for (int k = 0; k < 3; ++k)
      if (response.free[k] != 0.) sum.add(e.col(k));
    for (int k = 3; k < size; ++k)
      if (response.free[k] != 0.) sum.add<3>(e.col(k));
    addAlong(response.friction_along, response.moments_along, sum);
    if (response.inverse_stiffness > 0.)
      sum.add(std::sqrt(response.inverse_stiffness) * wrenchOf(response.growth));
  }

  // Of each component what decides at which bound it is: what makes the distance smaller, or else
  // the cost.
  Vector6 decidingPull(const Vector6& residual) const {
    const Vector6 of_distance = pullOf(residual);
    const Vector6 rounding =
        (Tolerances::exposed * residual.norm() + Tolerances::rounding) * reach();
    return (of_distance.array().abs() > rounding.array()).select(of_distance, pull);
  }

  // The largest pull that a wrench of unit size has on each component.
  Vector6 reach() const {
    Vector6 norms = Vector6::Zero();
    norms.head(size) = e.leftCols(size).colwise().norm();
    return norms;
  }
};

}  // namespace

Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, 6> DistributionProblem::Contact::NE()
    const {
  Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, 6> matrix;
  matrix.setZero(6, set.size());
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
  for (std::size_t k = 0; k < contacts.size(); ++k)
    contacts[k].validate(internal::concat("contacts[", k, "]."));
}

void DistributionProblem::Contact::validate(const std::string& prefix) const {
  const auto name = [&](const char* field) { return prefix + field; };
  const auto require = [&](const char* field, const Components& values) {
    if (values.size() != 0)
      internal::requireSize(name(field).c_str(), values.size(), set.size(), "components (or none)");
  };
  if (!internal::isOrthonormal(rotation))
    throwInvalid(name("rotation"), " must be orthonormal, got\n", rotation);
  if (!lever.allFinite()) throwInvalid(name("lever"), " must be finite, got ", lever.transpose());
  require("weights", weights);
  if (!weights.allFinite() || !(weights.array() > 0.).all())
    throwInvalid(name("weights"), " must be finite and > 0, got ", weights.transpose());
  require("reference", reference);
  if (!reference.allFinite())
    throwInvalid(name("reference"), " must be finite, got ", reference.transpose());
}

double DistributionProblem::scale() const {
  double force = minimal_scale;  // that there is in any case
  for (const Contact& contact : contacts) {
    if (!contact.set.isCone()) {
      const auto least = contact.set.lower().cwiseMax(-contact.set.upper());
      force = std::max(force, least.head(contact.set.size()).maxCoeff());
    }
    if (contact.reference.size() > 0)
      force = std::max(force, contact.reference.lpNorm<Eigen::Infinity>());
  }
  return std::max(force * wrench_weights.head<3>().maxCoeff(),
                  normOf(wrench_weights.cwiseProduct(wrench)));
}

namespace {

// Whether forces give what they are said to, in their sets, and none are cheaper.
// @param on_faces  of those in the faces that the residual exposes, where nothing is closer
bool isCheapest(const DistributionSolution& solution, const DistributionProblem& problem,
                double tolerance, bool on_faces) {
  using Components = DistributionProblem::Components;
  const double scale = problem.scale();
  const Vector6& D = problem.wrench_weights;
  const double size = D.cwiseProduct(solution.residual).norm();
  const double unit = scale > 0. ? scale / D.maxCoeff() : 1.;
  const Vector6 direction = D.cwiseAbs2().cwiseProduct(solution.residual);
  Vector6 given = Vector6::Zero();
  double gap = 0., distance_gap = 0., all_costs = 0.;
  for (std::size_t k = 0; k < solution.forces.size(); ++k) {
    const DistributionProblem::Contact& contact = problem.contacts[k];
    const Components& force = solution.forces[k];
    const Index n = contact.set.size();
    if (force.size() != n || !force.allFinite()) return false;
    const Components weights =
        contact.weights.size() > 0 ? contact.weights : Components(Components::Ones(n));
    const Components reference =
        contact.reference.size() > 0 ? contact.reference : Components(Components::Zero(n));
    const auto NE = contact.NE();
    given += NE * force;
    const double force_size = std::max(unit, force.lpNorm<Eigen::Infinity>());
    if (!(contact.set.excess(force) <= tolerance * force_size)) return false;

    // Nothing is farther in the direction of the residual, and of what is as far, nothing cheaper.
    const Components pull = NE.transpose() * direction;
    const Components gradient =
        weights.cwiseAbs2().cwiseProduct(force - reference) - NE.transpose() * solution.multipliers;
    ScaledSet face(contact.set, Vector6::Ones());
    face.setUnit(contact.set, Vector6::Ones(), 1.);
    Vector6 own = Vector6::Zero(), against = Vector6::Zero(), at = Vector6::Zero();
    own.head(n) = pull;
    against.head(n) = -gradient;
    at.head(n) = force;
    if (on_faces) {
      // Components of the residual that expose a face are more than it may be off.
      Vector6 rounding = Vector6::Zero();
      rounding.head(n) = std::max(Tolerances::exposed, 10. * Tolerances::missing * scale / size) *
                         direction.norm() * NE.colwise().norm().transpose();
      distance_gap += std::max(0., face.support(own, rounding) - own.dot(at));
      ScaledSet exposed;
      if (!face.expose(own, rounding, exposed)) return false;
      face = exposed;
    }
    const double terms = (weights.cwiseAbs2().cwiseProduct(force)).lpNorm<Eigen::Infinity>() +
                         solution.multipliers.norm() * std::max(1., contact.lever.norm()) +
                         (weights.cwiseAbs2().cwiseProduct(reference)).lpNorm<Eigen::Infinity>();
    gap +=
        std::max(0., face.support(against, Vector6::Constant(tolerance * terms)) - against.dot(at));
    all_costs += terms * force_size;
  }
  return distance_gap <= tolerance * (size * scale + size * size) && gap <= tolerance * all_costs &&
         D.cwiseProduct(given - solution.achieved).norm() <= tolerance * scale &&
         D.cwiseProduct(problem.wrench - solution.achieved - solution.residual).norm() <=
             tolerance * scale;
}

}  // namespace

bool DistributionSolution::isOptimal(const DistributionProblem& problem, double tolerance) const {
  const double scale = problem.scale();
  const Vector6& D = problem.wrench_weights;
  const double size = D.cwiseProduct(residual).norm();
  if (status == DistributionStatus::NoContact)
    return problem.contacts.empty() && size > Tolerances::reach * scale;
  if (forces.size() != problem.contacts.size()) return false;
  if (status == DistributionStatus::Solved)
    // What is hardly out of reach has no multipliers but on faces.
    return size <= Tolerances::reach * scale * (1. + tolerance) &&
           (isCheapest(*this, problem, tolerance, false) ||
            (size > Tolerances::some * scale && isCheapest(*this, problem, tolerance, true)));
  return status == DistributionStatus::Relaxed &&
         size >= Tolerances::reach * scale * (1. - tolerance) &&
         isCheapest(*this, problem, tolerance, true);
}

struct DistributionSolver::Workspace {
  int maximal_iterations = kMaximalIterations;
  bool warm_start = true;
  DistributionSolution solution;
  // Of the contacts, and of more that there were before: what these have allocated stays.
  std::vector<Block> blocks;
  std::size_t block_count = 0;
  Vector6 weights;  // D over its overall size
  Vector6 target, residual;
  double largest_weight = 0.;  // of the cost, of all contacts
  // What the last answer leaves to start from.
  bool has_answer = false;
  // The multipliers from which the last Relaxed answer was found, and with which slack and centre
  // these were.
  Vector6 slackened = Vector6::Zero(), last_centre = Vector6::Zero();
  double last_slack = 0.;

  // Of the multipliers at hand.
  Vector6 multipliers = Vector6::Zero(), achieved = Vector6::Zero();
  double terms = 0.;  // what the achieved wrench is a sum of
  double may_lack = Tolerances::missing;
  double value = 0.;  // of the dual, without slack
  Factors6 factors;
  int iterations = 0, iterations_in_vain = 0;
  bool is_cut = false;  // whether there were not enough
  bool is_accurate = false;
  bool is_clear = false;     // of multipliers on faces: whether it is, or close to the boundary
  bool is_on_faces = false;  // whether the multipliers are those of forces on faces
  bool is_found_at_once = false;  // by the first step of all: nothing else leads there faster

  using Which = ScaledSet Block::*;
  // What is tried for an answer out of reach: two steps on the faces, or as many as it takes, or
  // these, too, where faces hardly span a direction, which is left out then.
  enum class Effort { Little, Usual, All };

  void describe(const DistributionProblem& problem);
  void place(const DistributionProblem& problem, double unit, double overall_weight);
  void evaluate(const Vector6& nu, Which which);
  void factorise(double slack, const Matrix6* outside);
  bool descend(Which which, double slack, const Vector6& centre, int steps,
               const Matrix6* outside = nullptr);
  bool hasFullRank() const {
    const Vector6& pivots = factors.pivots();
    return (pivots.array() > Tolerances::full_rank * pivots.maxCoeff()).all();
  }
  double findMeanCompliance() const;
  bool startFree();
  bool isClear() const { return is_on_faces ? is_clear : is_accurate; }
  double enough() const { return std::max(may_lack, Tolerances::rounding * terms); }
  // Whether no step makes what is missing smaller: less than some ten errors of what it is a sum
  // of.
  bool isRounding(double size) const { return size <= 10. * Tolerances::rounding * terms; }
  Vector6 missing() const { return target - achieved; }
  // What part of the residual exposes nothing: rounding is more, where there is little of it.
  double exposing() const { return Tolerances::exposed + Tolerances::rounding / residual.norm(); }
  Range<Block> placed() { return {blocks.data(), blocks.data() + block_count}; }
  Range<const Block> placed() const { return {blocks.data(), blocks.data() + block_count}; }
  DistributionStatus search();
  DistributionStatus relaxed() const {
    return residual.norm() > Tolerances::reach ? DistributionStatus::Relaxed
                                               : DistributionStatus::Solved;
  }
  void write(double unit);
  void writeNothing();
  DistributionStatus approach(double slack, Vector6 centre, Effort effort, int rounds);
  bool isReachedWithoutSlack();
  bool relax(const Vector6& start, Effort effort);
  bool spanFaces(double independent, double dependent, Matrix6& basis, int& rank, Vector6& fixed);
  bool findResidual(Effort effort, Matrix6& outside);
  bool reachClosest(Effort effort, const Vector6& start, const Matrix6& outside);
  double findGap(double rounding) const;
  bool exposesClearly();
  bool reachOnFaces(Effort effort, const Matrix6& outside);
  std::vector<Vector6> directions;
};

// What of the contacts does not move.
void DistributionSolver::Workspace::describe(const DistributionProblem& problem) {
  block_count = problem.contacts.size();
  if (blocks.size() < block_count) blocks.resize(block_count);
  directions.reserve(6 * block_count);
  largest_weight = 0.;
  for (const auto& contact : problem.contacts)
    largest_weight =
        std::max(largest_weight, contact.weights.size() > 0 ? contact.weights.maxCoeff() : 1.);
  for (std::size_t k = 0; k < block_count; ++k) {
    const DistributionProblem::Contact& contact = problem.contacts[k];
    Block& block = blocks[k];
    const Index n = contact.set.size();
    if (block.size != int(n)) block.response = ScaledSet::Response();
    block.size = int(n);
    block.has_unit = !contact.set.isCone();
    block.has_reference = contact.reference.size() > 0;
    block.weights.setOnes();
    if (contact.weights.size() > 0) block.weights.head(n) = contact.weights;
    // By the contact's own weights: what others weigh does not change a bit of it.
    const bool is_known = block.is_described && block.described_weights == block.weights &&
                          block.described == contact.set;
    if (!is_known) {
      block.set = block.face = ScaledSet(contact.set, block.weights);
      block.described = contact.set;
      block.described_weights = block.weights;
      block.is_described = true;
    }
    block.weights.head(n) /= largest_weight;
    block.inverse_weights = block.weights.cwiseInverse();
    if (!is_known && !block.has_unit) block.set.setUnit(contact.set, block.weights, 1.);
  }
}

// The problem in units.
void DistributionSolver::Workspace::place(const DistributionProblem& problem, double unit,
                                          double overall_weight) {
  weights = problem.wrench_weights / overall_weight;
  target = weights.cwiseProduct(problem.wrench) / unit;
  for (std::size_t k = 0; k < block_count; ++k) {
    const DistributionProblem::Contact& contact = problem.contacts[k];
    Block& block = blocks[k];
    block.place(contact, weights);
    if (block.has_unit) block.set.setUnit(contact.set, block.weights, unit);
    block.reference.setZero();
    if (block.has_reference)
      block.reference.head(block.size) =
          contact.reference.cwiseProduct(block.weights.head(block.size)) / unit;
  }
}

double DistributionSolver::Workspace::findMeanCompliance() const {
  double sum = 0.;
  for (const Block& block : placed()) sum += block.e.leftCols(block.size).squaredNorm() / 6.;
  return sum;
}

// The forces for multipliers, and what they amount to.
void DistributionSolver::Workspace::evaluate(const Vector6& nu, Which which) {
  multipliers = nu;
  achieved.setZero();
  terms = value = 0.;
  for (Block& block : placed()) {
    block.pull = block.pullOf(nu);
    if (block.has_reference) block.pull += block.reference;
    (block.*which).project(block.pull, block.response);
    const Vector6& x = block.response.force;
    const Vector6 wrench = block.wrenchOf(x);
    achieved += wrench;
    terms += wrench.norm();
    value += block.pull.dot(x) - 0.5 * x.squaredNorm();
  }
  value -= nu.dot(target);
}

// How the wrench rises with its multipliers, with slack.
// @param outside  what to add to that, where faces give no wrenches; or null
void DistributionSolver::Workspace::factorise(double slack, const Matrix6* outside) {
  SumOfSquares6 sum;
  for (const Block& block : placed()) block.addCompliance(sum);
  Matrix6 compliance = sum.toMatrix();
  if (outside) compliance += *outside;
  compliance.diagonal().array() += slack;
  factors.compute(compliance);
}

// Newton's method for the minimum of the dual and ½ slack ‖ν − centre‖², from the multipliers at
// hand. Returns whether it is there; without slack also false where some wrenches are hardly given.
bool DistributionSolver::Workspace::descend(Which which, double slack, const Vector6& centre,
                                            int steps, const Matrix6* outside) {
  double former = std::numeric_limits<double>::infinity();
  double damping = 0.;
  for (int step = 0;; ++step) {
    const Vector6 gradient = slack * (multipliers - centre) - missing();
    const double size = gradient.norm();
    // What no step makes smaller, and is small, is rounding.
    if (size <= enough() || (size <= Tolerances::missing && size > 0.5 * former)) return true;
    const double former_size = std::exchange(former, size);
    if (step >= steps && !(slack == 0. && size < Tolerances::fast * former_size)) return false;
    if (iterations >= maximal_iterations) {
      is_cut = true;
      return false;
    }
    ++iterations;
    factorise(slack + damping, outside);
    if (slack == 0. && !hasFullRank()) return false;
    const Vector6 direction = -factors.solve(gradient);
    const double slope = gradient.dot(direction);
    if (!(slope < 0.)) return false;
    const Vector6 start = multipliers;
    const auto costOf = [&] { return value + 0.5 * slack * (multipliers - centre).squaredNorm(); };
    const double cost = costOf();
    // Where the dual has no digits for what the step promises, the gradient has.
    const bool is_local = -slope <= Tolerances::rounding * std::abs(cost);
    double length = 1., lower = 0., upper = 1., lower_slope = slope, upper_slope = 0.;
    int cut = 0;
    for (;; ++cut) {
      if (cut == Tolerances::cuts) return false;
      evaluate(start + length * direction, which);
      const Vector6 residual = slack * (multipliers - centre) - missing();
      if (residual.norm() <= enough()) return true;
      if (is_local) {
        if (residual.norm() < size) break;
        evaluate(start, which);
        return isRounding(size);
      }
      const double end_slope = residual.dot(direction);
      const bool descends = end_slope <= 0.;
      if ((descends && cut == 0) || (descends && -end_slope <= -Tolerances::flat * slope) ||
          (!descends && end_slope <= -Tolerances::flat * slope &&
           costOf() <=
               cost + Tolerances::armijo * length * slope + Tolerances::rounding * std::abs(cost)))
        break;
      (descends ? lower : upper) = length;
      (descends ? lower_slope : upper_slope) = end_slope;
      if (cut % 2 == 0)
        length = lower + (upper - lower) * lower_slope / (lower_slope - upper_slope);
      else
        length = lower + Tolerances::back * (upper - lower);
    }
    if (cut >= Tolerances::many_cuts)
      damping = 10. * (slack + damping);
    else if (cut == 0)
      damping = 0.;
  }
}

// The multipliers that are the answer if all forces are inside of their sets.
bool DistributionSolver::Workspace::startFree() {
  ++iterations;
  SumOfSquares6 compliance;
  Vector6 rest = target;
  for (const Block& block : placed()) {
    block.addFreeCompliance(compliance);
    if (block.has_reference) rest -= block.wrenchOf(block.reference);
  }
  factors.compute(compliance.toMatrix());
  const bool has_full_rank = hasFullRank();
  evaluate(has_full_rank ? factors.solve(rest) : Vector6(Vector6::Zero()), &Block::set);
  return has_full_rank;
}

DistributionStatus DistributionSolver::Workspace::search() {
  residual.setZero();
  const bool was_on_faces = std::exchange(is_on_faces, false);
  if (warm_start && has_answer) {
    const Vector6 last = multipliers;
    evaluate(was_on_faces ? slackened : last, &Block::set);
    if (!std::isfinite(achieved.sum())) return DistributionStatus::InvalidInput;
    if (!was_on_faces) {
      if (descend(&Block::set, 0., last, Tolerances::direct_steps))
        return DistributionStatus::Solved;
    } else {
      const DistributionStatus status = relax(last, Effort::Little)
                                            ? relaxed()
                                            : approach(last_slack, last_centre, Effort::Little, 1);
      // Without all digits, an answer is not to depend on the last one.
      if (status != DistributionStatus::NumericalFailure && is_accurate) return status;
    }
    iterations_in_vain = std::exchange(iterations, 0);
    is_cut = is_on_faces = is_clear = false;
    is_accurate = true;
    residual.setZero();
  }
  if (startFree() && descend(&Block::set, 0., multipliers, Tolerances::direct_steps)) {
    is_found_at_once = iterations == 1;
    return DistributionStatus::Solved;
  }
  if (!std::isfinite(achieved.sum())) return DistributionStatus::InvalidInput;
  const DistributionStatus status = approach(Tolerances::first_slack * findMeanCompliance(),
                                             Vector6::Zero(), Effort::Usual, Tolerances::rounds);
  return status == DistributionStatus::NumericalFailure && !is_cut &&
                 missing().norm() <= Tolerances::reach
             ? DistributionStatus::Solved
             : status;
}

// The proximal point method on the dual, which is the method of multipliers (Rockafellar 1976),
// from the multipliers at hand.
DistributionStatus DistributionSolver::Workspace::approach(double slack, Vector6 centre,
                                                           Effort effort, int rounds) {
  is_accurate = false;
  const double least_slack = Tolerances::least_slack * findMeanCompliance();
  double former = 0.;
  Vector6 former_missing = Vector6::Zero(), settled = Vector6::Zero();
  double least_change = Tolerances::settled;
  for (int round = 0; round < rounds && iterations < maximal_iterations; ++round) {
    descend(&Block::set, slack, centre, Tolerances::steps);
    const Vector6 lacking = missing();
    const double size = lacking.norm();
    if (size <= Tolerances::close && isReachedWithoutSlack()) return DistributionStatus::Solved;
    if (is_cut) break;
    if (size <= enough()) return DistributionStatus::Solved;
    // What stays is out of reach, if it proves so.
    const bool stays = (lacking - former_missing).norm() <= 0.1 * size;
    last_slack = slack;
    last_centre = centre;
    if (round == 0 || stays) {
      // No smaller slack will tell more than the least.
      if (relax(multipliers, effort) || (slack <= least_slack && relax(multipliers, Effort::All)))
        return relaxed();
    }
    const double change = (lacking - former_missing).norm() / size;
    if (change <= least_change) {
      least_change = change;
      settled = multipliers;
    }
    former_missing = lacking;
    if (size > Tolerances::fall * former)
      slack = std::max(slack * Tolerances::slack_factor, least_slack);
    former = size;
    centre = multipliers;
  }
  if (is_cut || settled.isZero(0.) || !(missing().norm() > Tolerances::reach))
    return DistributionStatus::NumericalFailure;
  // Without a proof: where discs hardly span a direction, no smaller slack has more digits.
  evaluate(settled, &Block::set);
  residual = missing();
  const double size = residual.norm();
  if (findGap(Tolerances::settled) <= Tolerances::near * size) return DistributionStatus::Relaxed;
  residual.setZero();
  return DistributionStatus::NumericalFailure;
}

// Next to the answer, Newton's method without slack has all digits. Returns whether it is there, or
// leaves the multipliers where they are.
bool DistributionSolver::Workspace::isReachedWithoutSlack() {
  const Vector6 kept = multipliers;
  is_accurate = descend(&Block::set, 0., kept, Tolerances::direct_steps);
  if (!is_accurate) evaluate(kept, &Block::set);
  return is_accurate;
}

// An orthonormal basis of the wrenches that the faces span, and the wrench that all forces in them
// share. Returns false if the rank is not certain, and is to be.
bool DistributionSolver::Workspace::spanFaces(double independent, double dependent, Matrix6& basis,
                                              int& rank, Vector6& fixed) {
  directions.clear();
  fixed.setZero();
  for (const Block& block : placed()) {
    const ScaledSet::Span span = block.face.span();
    fixed += block.wrenchOf(span.fixed);
    for (int k = 0; k < span.count; ++k)
      directions.push_back(block.wrenchOf(span.axes.col(k)).normalized());
  }
  return internal::findSpan(directions, independent, dependent, basis, rank);
}

// What is missing of the closest wrench, from the forces at hand and a guess: the part of the
// target that the faces which forces are on do not span. Where these turn with the residual, by
// Newton's method, whose Jacobian outside of what they span is 1 + Σ ∂(NE x)/∂r. Then the faces are
// those that it exposes.
//
// @param outside  the projector on what they do not span
bool DistributionSolver::Workspace::findResidual(Effort effort, Matrix6& outside) {
  const double dependent = effort == Effort::All ? Tolerances::independent : Tolerances::dependent;
  bool is_found = false, is_near = false;
  for (int step = 0; step < Tolerances::steps && !is_found; ++step) {
    SumOfSquares6 bend;
    bool is_bent = false;
    for (Block& block : placed()) {
      ScaledSet::Bend own;
      block.set.hold(block.response, block.pullOf(residual), block.face, own);
      if (own.friction.isZero(0.) && own.moments.isZero(0.)) continue;
      is_bent = true;
      block.addAlong(own.friction, own.moments, bend);
    }
    Matrix6 basis;
    int rank = 0;
    Vector6 fixed;
    if (!spanFaces(Tolerances::independent, dependent, basis, rank, fixed) || rank == 6)
      return false;
    outside.noalias() = Matrix6::Identity() - basis * basis.transpose();
    const Vector6 rest = target - fixed;
    if (!is_bent) {
      residual.noalias() = outside * Vector6(outside * rest);
      is_found = true;
      continue;
    }
    const Vector6 former = residual;
    const Matrix6 bent = bend.toMatrix().selfadjointView<Eigen::Lower>();
    const Eigen::PartialPivLU<Matrix6> lu(Matrix6::Identity() + bent);
    residual += lu.solve(rest - residual);  // but for what faces make up for
    if (rank > 0) {
      using Spanned = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 6>;
      using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6, 6>;
      const auto spanned = basis.leftCols(rank);
      const Spanned turned = lu.solve(spanned);
      const Eigen::LDLT<Square> along(Square(spanned.transpose() * turned));
      residual -= turned * along.solve(spanned.transpose() * residual);
    }
    // One step more than it takes: where a disc is hardly pulled, its point has few digits else.
    is_found = is_near;
    is_near = (residual - former).norm() <= Tolerances::missing;
  }
  const double size = residual.norm();
  if (!is_found || !(size > Tolerances::some) || !std::isfinite(size)) return false;
  for (Block& block : placed())
    if (!block.set.expose(block.pullOf(residual), exposing() * size * block.reach(), block.face))
      return false;
  return true;
}

// The cheapest forces on the faces that give the target, from the multipliers at hand.
bool DistributionSolver::Workspace::reachOnFaces(Effort effort, const Matrix6& outside) {
  const Which face = &Block::face;
  // What is missing of the target is to be accurate: nothing but rounding may be off.
  may_lack = 0.;
  const double compliance = findMeanCompliance();
  const Vector6 start = multipliers;
  const Matrix6 stiff = compliance * outside;
  evaluate(start, face);
  bool given = descend(face, 0., start, Tolerances::direct_steps, &stiff);
  if (!given && effort != Effort::Little) {
    Vector6 centre = start;
    evaluate(start, face);
    double slack = Tolerances::first_slack * compliance, former = missing().norm();
    for (int slow = 0; slow < Tolerances::slow_rounds && iterations < maximal_iterations;) {
      descend(face, slack, centre, Tolerances::steps);
      const double size = missing().norm();
      if (size <= enough() || (size <= Tolerances::missing && size > 0.5 * former)) break;
      if (size > Tolerances::fall * former) {
        ++slow;
        slack = std::max(slack * Tolerances::slack_factor, Tolerances::least_slack * compliance);
      }
      former = size;
      centre = multipliers;
    }
    // Multipliers of what faces do not give mean nothing.
    evaluate(multipliers - outside * multipliers, face);
    const double may_be_left = effort == Effort::All ? Tolerances::exposed : Tolerances::missing;
    given = missing().norm() <= std::max(may_be_left, enough());
  }
  is_accurate = isRounding(missing().norm());
  may_lack = Tolerances::missing;
  return given;
}

// Out of reach: the closest wrench, then the cheapest forces of those on the faces that its
// residual exposes, and the proof of both.
//
// What the minimum with slack lacks is nearly the residual. Of a wrench that is hardly out of
// reach, whose multipliers grow without limit, this is the answer, too, if rounding decides nothing
// of it.
// @param start  from which multipliers on the forces are sought
bool DistributionSolver::Workspace::relax(const Vector6& start, Effort effort) {
  residual = missing();
  if (residual.norm() > Tolerances::some) {
    const Vector6 kept = multipliers;
    Matrix6 outside;
    if (findResidual(effort, outside) && reachClosest(effort, start, outside) &&
        (is_clear || residual.norm() > Tolerances::reach)) {
      slackened = kept;
      is_on_faces = true;
      return true;
    }
    evaluate(kept, &Block::set);
  }
  is_accurate = is_clear = false;
  residual.setZero();
  return false;
}

// The cheapest forces that leave the residual, and the proof of both.
bool DistributionSolver::Workspace::reachClosest(Effort effort, const Vector6& start,
                                                 const Matrix6& outside) {
  const Vector6 asked = target;
  target -= residual;
  multipliers = start - outside * start;
  const bool given = reachOnFaces(effort, outside);
  target = asked;
  if (!given) return false;
  if (effort == Effort::All) residual = missing();
  const double size = residual.norm();
  const double ratio = weights.maxCoeff() / weights.minCoeff();
  is_clear = is_accurate && effort != Effort::All && size >= Tolerances::some * ratio * ratio &&
             exposesClearly();
  is_accurate = is_clear && size >= Tolerances::far * ratio;
  if (is_clear && !is_accurate) {
    Matrix6 basis;
    int rank = 0;
    Vector6 fixed;
    is_clear = (missing() - residual).norm() <= Tolerances::rounding * terms &&
               spanFaces(Tolerances::plainly, Tolerances::dependent, basis, rank, fixed);
  }
  return findGap(exposing()) <= Tolerances::reach * size;
}

// By how much forces could be farther in the direction of the residual: by nothing where no
// reachable wrench is closer.
// @param rounding  what part of the residual may be that
double DistributionSolver::Workspace::findGap(double rounding) const {
  const double size = residual.norm();
  double gap = 0.;
  for (const Block& block : placed()) {
    const Vector6 pull = block.pullOf(residual);
    gap += std::max(0., block.set.support(pull, rounding * size * block.reach()) -
                            pull.dot(block.response.force));
  }
  return gap;
}

// Whether the residual exposes the same faces, whatever of it is taken for rounding.
bool DistributionSolver::Workspace::exposesClearly() {
  const double size = residual.norm();
  const auto countAxes = [&](const Block& block, double tolerance) {
    ScaledSet face;
    block.set.expose(block.pullOf(residual), tolerance * size * block.reach(), face);
    return face.span().count;
  };
  const auto all = placed();
  const double least = std::max(Tolerances::missing, Tolerances::rounding * terms / size);
  const double most =
      std::min(Tolerances::plainly, std::max(Tolerances::reach, Tolerances::clear * least));
  return std::all_of(all.begin(), all.end(), [&](const Block& block) {
    return countAxes(block, least) == countAxes(block, most);
  });
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

void DistributionSolver::reserve(std::size_t contacts) {
  work_->blocks.reserve(contacts);
  work_->directions.reserve(6 * contacts);
  work_->solution.forces.reserve(contacts);
  work_->solution.bounds.reserve(contacts);
}

void DistributionSolver::forget() { work_->has_answer = false; }

const DistributionSolution& DistributionSolver::solution() const { return work_->solution; }

const DistributionSolution& DistributionSolver::solve(const DistributionProblem& problem) {
  const std::size_t contacts = problem.contacts.size();
  DistributionSolution& solution = work_->solution;
  work_->has_answer = work_->has_answer && solution.forces.size() == contacts;
  solution.forces.resize(contacts);
  solution.bounds.resize(contacts);
  work_->describe(problem);
  return solveMoved(problem);
}

const DistributionSolution& DistributionSolver::solveMoved(const DistributionProblem& problem) {
  Workspace& work = *work_;
  DistributionSolution& solution = work.solution;
  const std::size_t contacts = problem.contacts.size();
  if (contacts != work.block_count)
    throwInvalid("solveMoved() needs the contacts of the last solve(), ", work.block_count,
                 ", got ", contacts);
  for (std::size_t k = 0; k < contacts; ++k)
    if (problem.contacts[k].set.size() != work.blocks[k].size ||
        (problem.contacts[k].reference.size() > 0) != work.blocks[k].has_reference)
      throwInvalid("solveMoved() needs the contacts of the last solve(), but contacts[", k,
                   "] has another size, or a reference, or none");
  const Vector6& D = problem.wrench_weights;
  const double wrench_size = normOf(problem.wrench);
  const double weighted_size = normOf(D.cwiseProduct(problem.wrench));
  const double scale = problem.scale();
  const double overall_weight = wrench_size > 0. ? weighted_size / wrench_size : D.maxCoeff();
  const double unit = scale / overall_weight;
  work.iterations = work.iterations_in_vain = 0;
  work.is_accurate = true;
  work.is_cut = work.is_found_at_once = false;
  bool answered = false;
  if (!problem.wrench.allFinite()) {
    solution.status = DistributionStatus::InvalidInput;
  } else if (contacts == 0) {
    solution.status = weighted_size <= Tolerances::reach * scale ? DistributionStatus::Solved
                                                                 : DistributionStatus::NoContact;
  } else if (scale == 0.) {
    solution.status = DistributionStatus::Solved;  // by no forces at all
  } else {
    work.place(problem, unit, overall_weight);
    solution.status = work.search();
    answered = solution.status == DistributionStatus::Solved ||
               solution.status == DistributionStatus::Relaxed;
    // An answer that the last one's multipliers lead to takes none; it counts as one all the same.
    work.iterations = std::max(1 - work.iterations_in_vain, work.iterations);
  }
  solution.iterations_in_vain = work.iterations_in_vain;
  solution.iterations = work.iterations + work.iterations_in_vain;
  work.has_answer = answered && !work.is_found_at_once;
  if (answered) {
    work.write(unit);
  } else {
    work.writeNothing();
  }
  // That of the closest wrench is known with more digits than the difference has.
  if (solution.status == DistributionStatus::Relaxed || (answered && work.is_on_faces))
    solution.residual = unit * work.residual.cwiseQuotient(work.weights);
  else
    solution.residual = problem.wrench - solution.achieved;
  return solution;
}

void DistributionSolver::Workspace::write(double unit) {
  const double price = unit * largest_weight * largest_weight;
  solution.multipliers = price * weights.cwiseProduct(multipliers);
  solution.achieved = unit * achieved.cwiseQuotient(weights);
  double cost = 0., sizes = 0.;  // the former a difference of the latter
  for (std::size_t k = 0; k < block_count; ++k) {
    const Block& block = blocks[k];
    const Vector6& x = block.response.force;
    DistributionProblem::Components& force = solution.forces[k];
    force.resize(block.size);
    withSize(block.size, [&](auto n) {
      force.template head<n>() =
          unit * x.template head<n>().cwiseProduct(block.inverse_weights.template head<n>());
    });
    if (block.response.is_free)
      solution.bounds[k].setZero();
    else
      solution.bounds[k] = block.set.findBounds(block.response, block.decidingPull(residual));
    cost += 0.5 * (x - block.reference).squaredNorm();
    sizes += 0.5 * (x.squaredNorm() + block.reference.squaredNorm());
  }
  solution.cost = cost * unit * price;
  // What of the wrench is rounding has a price, by the multipliers.
  const double lacking = is_on_faces ? 0. : missing().norm();
  const bool is_cost_known = multipliers.norm() * std::max(lacking, Tolerances::rounding * terms) <=
                             Tolerances::reach * sizes;
  solution.is_accurate = is_accurate && is_cost_known;
  solution.is_clear = isClear() && is_cost_known;
}

void DistributionSolver::Workspace::writeNothing() {
  solution.multipliers.setZero();
  solution.achieved.setZero();
  for (std::size_t k = 0; k < block_count; ++k) {
    solution.forces[k].setZero(blocks[k].size);
    solution.bounds[k].setZero();
  }
  solution.cost = 0.;
  solution.is_accurate = solution.is_clear = solution.status == DistributionStatus::Solved;
}

}  // namespace dynacom
