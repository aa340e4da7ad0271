// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/wrench_distribution.hpp"

#include <algorithm>
#include <cmath>
#include <ostream>
#include <utility>

#include "check.hpp"
#include "minimum_norm.hpp"

namespace dynacom {

namespace {

using internal::MinimumNorm;
using internal::throwInvalid;
using Contact = DistributionResult::Contact;
using Vector6 = DistributionResult::Vector6;
using NewtonEuler = Eigen::Matrix<double, 6, Eigen::Dynamic>;

// All of these are for a problem whose weighted wrench has unit size.

// A wrench no farther than this from what the contacts can give is within reach.
constexpr double kReach = 1e-8;
// What part of an inequality's normal outside the span of the active ones is none: at the first
// attempt, and at the last.
constexpr double kNearlyDependent = 1e-8;
constexpr double kDependentInequality = 1e-12;
// By how much the solver may leave an inequality behind.
constexpr double kTolerance = 1e-12;
// How far an answer may be from its wrench and from its inequalities: at the first attempt, and
// after the relaxation.
constexpr double kExactWrench = 1e-9;
constexpr double kExactInequality = 2e-12;
constexpr double kAccurateWrench = 5e-9;
constexpr double kAccurateInequality = 1e-10;
// Forces below this are as good as none.
constexpr double kNegligible = 1e-9;
// What is left of a vector when others are projected out is none below this part of it.
constexpr double kDependent = 1e-10;
// Where the relaxation multiplies an inequality by less than this part of the distance, or by less
// than this, it is rounding.
constexpr double kMultiplied = 1e-10;
constexpr double kMultiplierRounding = 3e-12;
// Of the relaxation: its √δ, how many steps it may take, when it has arrived, and what does not
// approach an inequality.
constexpr double kProximity = 1e-4;
constexpr double kLeastProximity = 1e-7;
constexpr int kEasySteps = 2;
constexpr int kProximalSteps = 100;
constexpr double kProximalChange = 1e-11;
constexpr double kProximalGain = 1e-13;
constexpr int kStalledSteps = 2;
constexpr double kProximalRounding = 1e-15;
constexpr double kRounding = 1e-15;
constexpr double kParallel = 1e-9;
// Of the cheapest forces on a face: √ε, how many steps, and when nothing is missing any more.
constexpr double kSlack = 1e-4;
constexpr int kMultiplierSteps = 100;
constexpr double kMissing = 1e-11;
constexpr double kLeastShrinking = 1e-5;
// The margin's search has arrived when it is this close to what can be reached, or when a step
// changes it by less than this part; below that it is zero.
constexpr double kMarginReach = 1e-11;
constexpr double kMarginChange = 1e-10;
constexpr int kMarginSteps = 50;

Vector6 weighted(const Vector6& weights, const Vector6& wrench) {
  return weights.cwiseProduct(wrench);
}

// The norm, also of numbers whose squares would be too large or too small: that takes longer.
double normOf(const Vector6& wrench) {
  const double norm = wrench.norm();
  return norm > 1e-140 && norm < 1e140 ? norm : wrench.stableNorm();
}

// What D amounts to for a wrench: forces in newtons are a weighted wrench over this.
double overallWeight(const Vector6& weights, const Vector6& wrench) {
  const double size = normOf(wrench);
  return size > 0. ? normOf(weighted(weights, wrench)) / size : weights.maxCoeff();
}

bool haveSameSettings(const Contact& a, const Contact& b) {
  return a.A.rows() == b.A.rows() && a.A.cols() == b.A.cols() && a.A == b.A &&
         a.weights == b.weights;
}

}  // namespace

const char* to_string(DistributionStatus status) {
  switch (status) {
    case DistributionStatus::Solved:
      return "Solved";
    case DistributionStatus::Relaxed:
      return "Relaxed";
    case DistributionStatus::NoContact:
      return "NoContact";
    case DistributionStatus::InvalidInput:
      return "InvalidInput";
    case DistributionStatus::NumericalFailure:
      return "NumericalFailure";
  }
  return "unknown status";
}

std::ostream& operator<<(std::ostream& out, DistributionStatus status) {
  return out << to_string(status);
}

Eigen::VectorXd DistributionResult::forces() const {
  Eigen::Index size = 0;
  for (const Contact& contact : contacts) size += contact.force.size();
  Eigen::VectorXd stacked(size);
  Eigen::Index col = 0;
  for (const Contact& contact : contacts) {
    stacked.segment(col, contact.force.size()) = contact.force;
    col += contact.force.size();
  }
  return stacked;
}

bool DistributionResult::isOptimal(double tolerance) const {
  const double unit = scale / overallWeight(wrench_weights, wrench);  // of forces
  const bool relaxed = status == DistributionStatus::Relaxed;
  if (!relaxed && status != DistributionStatus::Solved && status != DistributionStatus::NoContact)
    return false;

  const double size = weighted(wrench_weights, residual).norm();
  const Vector6 pull = weighted(wrench_weights.cwiseAbs2(), residual);
  if (status == DistributionStatus::Solved && !(size <= kReach * scale * (1. + tolerance)))
    return false;
  if (relaxed && !(std::abs(pull.dot(achieved)) <= tolerance * scale * size)) return false;

  Vector6 given = Vector6::Zero();
  for (const Contact& contact : contacts) {
    given += contact.NE * contact.force;
    const Eigen::VectorXd slack = contact.A * contact.force;
    if (!(slack.array() <= tolerance * unit).all()) return false;

    // The minimum of the cost: W² λ − NEᵀ ν + Aᵀ μ = 0.
    const Eigen::VectorXd of_cost = contact.weights.cwiseAbs2().cwiseProduct(contact.force);
    const Eigen::VectorXd of_wrench = contact.NE.transpose() * wrench_multipliers;
    const Eigen::VectorXd of_bounds = contact.A.transpose() * contact.multipliers;
    const double terms =
        std::max({kNegligible * unit * contact.weights.cwiseAbs2().maxCoeff(),
                  of_cost.lpNorm<Eigen::Infinity>(),
                  (contact.NE.cwiseAbs().transpose() * wrench_multipliers.cwiseAbs()).maxCoeff(),
                  (contact.A.cwiseAbs().transpose() * contact.multipliers.cwiseAbs()).maxCoeff()});
    if (!((of_cost - of_wrench + of_bounds).lpNorm<Eigen::Infinity>() <= tolerance * terms))
      return false;
    for (Eigen::Index j = 0; j < slack.size(); ++j) {
      const bool held = contact.relaxation_multipliers[j] > 0.;
      if (!held && !(contact.multipliers[j] >= -tolerance * terms)) return false;
      if (contact.multipliers[j] != 0. && !(std::abs(slack[j]) <= tolerance * unit)) return false;
    }

    // The slackened wrench: NEᵀ D² r = Aᵀ μ'.
    if (!relaxed) continue;
    if (!(contact.relaxation_multipliers.array() >= 0.).all()) return false;
    const Eigen::VectorXd of_pull = contact.NE.transpose() * pull;
    const Eigen::VectorXd of_relaxation = contact.A.transpose() * contact.relaxation_multipliers;
    if (!((of_pull - of_relaxation).lpNorm<Eigen::Infinity>() <=
          (tolerance * pull.lpNorm<Eigen::Infinity>() +
           kMissing * unit * wrench_weights.cwiseAbs2().maxCoeff()) *
              std::max(1., contact.NE.lpNorm<Eigen::Infinity>())))
      return false;
  }
  return weighted(wrench_weights, given - achieved).norm() <= tolerance * scale &&
         weighted(wrench_weights, wrench - achieved - residual).norm() <= tolerance * scale;
}

struct WrenchDistribution::Workspace {
  // The contacts side by side, as a problem of least norm. Its variable begins with the forces λ,
  // each times its scale; the columns of E are the rows of NE over the scales, at unit length,
  // those of G the rows of A over the scales.
  struct Program {
    Eigen::VectorXd scales;  // n
    Eigen::MatrixXd E, G;
    Vector6 norms;  // of the columns of E before
    Eigen::VectorXd d, h;
    MinimumNorm solver;
  };

  DistributionResult result;
  Vector6 settings = Vector6::Ones();  // D of the next solve()
  std::vector<Contact> added;  // since clear(), the first `count`: those of the next solve()
  std::size_t count = 0;
  bool has_answer = false;  // whether the forces in result are an answer for its contacts

  // What forces and wrenches are divided by, and D over its overall weight: for weights of 1 the
  // unit is the scale, and it is the same for all common factors of the weights.
  double unit = 0., overall_weight = 1.;
  Vector6 wrench_weights = Vector6::Ones();

  Eigen::Index n = 0, m = 0;  // components of λ, inequalities
  double largest_weight = 0.;
  Program direct, slackened;  // without and with slacks
  int iterations = 0;
  Eigen::VectorXd lambda;          // the forces at hand, over the unit
  Eigen::VectorXd scaled, change;  // of relax(): forces times their scales, and the last step
  Vector6 distance;                // of relax(): D (w − NE λ) over the unit
  Eigen::VectorXd relaxation_multipliers;  // of relax(), over the unit
  bool on_face = false;  // whether the forces at hand are those of minimizeCostOnFace()
  // Of restrictToFace(), contact by contact along the diagonals: a basis for x of the cheapest
  // forces, its first vectors times R are the normals of inequalities that are equations there; and
  // which inequality that is, or −1 for the other vectors. Before it has been called, there are
  // none of the former.
  Eigen::MatrixXd face, R;
  Eigen::Array<Eigen::Index, Eigen::Dynamic, 1> held;
  // Of takeAnswer().
  Eigen::VectorXd multipliers, gradient, products;
  Eigen::Array<bool, Eigen::Dynamic, 1> active;

  Contact& nextContact();
  void takeProblem();
  void reserve();
  void assemble(Program& program, const Vector6& row_weights, double slack);
  void assembleCheapest(Program& program, double slack);
  void assembleClosest(double proximity);
  bool minimizeCost(const Vector6& wrench, double dependent, double inequality);
  bool minimizeCostOnFace(const Vector6& wrench, double tolerance);
  bool relax(const Vector6& target);
  void extrapolate();
  Vector6 giveScaled(const Eigen::VectorXd& forces) const;
  void restrictToFace();
  DistributionStatus distribute(const Vector6& wrench);
  bool passesCheck(const Vector6& wrench, double reach, double inequality) const;
  Vector6 give(const Eigen::VectorXd& forces) const;
  void takeAnswer();
  void keepAnswer();
  void sumUp();
  double findBoundary(const Vector6& wrench, const Vector6& direction, double bound);
};

WrenchDistribution::WrenchDistribution() : work_(std::make_unique<Workspace>()) {}
WrenchDistribution::WrenchDistribution(const WrenchDistribution& other)
    : work_(std::make_unique<Workspace>(*other.work_)) {}
WrenchDistribution::WrenchDistribution(WrenchDistribution&& other) noexcept
    : WrenchDistribution() {  // the other can be used again
  std::swap(work_, other.work_);
}
WrenchDistribution& WrenchDistribution::operator=(WrenchDistribution other) noexcept {
  std::swap(work_, other.work_);
  return *this;
}
WrenchDistribution::~WrenchDistribution() = default;

void WrenchDistribution::setWrenchWeights(const Vector6& weights) {
  if (!weights.allFinite() || !(weights.array() > 0.).all())
    throwInvalid("wrench weights must be finite and > 0, got ", weights.transpose());
  if (weights != work_->settings) work_->has_answer = false;
  work_->settings = weights;
}

const Vector6& WrenchDistribution::getWrenchWeights() const { return work_->settings; }

void WrenchDistribution::clear() { work_->count = 0; }

void WrenchDistribution::forgetForces() { work_->has_answer = false; }

const DistributionResult& WrenchDistribution::result() const { return work_->result; }

// The contact to be filled in.
Contact& WrenchDistribution::Workspace::nextContact() {
  if (count == added.size()) added.emplace_back();
  return added[count++];
}

void WrenchDistribution::add(const ContactBase& contact) {
  if (contact.cols() == 0) throwInvalid("a contact was never initialised");
  if (!(contact.uni_b().array() == 0.).all() || !(contact.fri_b().array() == 0.).all())
    throwInvalid("uni_b and fri_b of contact '", contact.getFrameName(), "' must be zero");
  Contact& next = work_->nextContact();
  next.A.resize(contact.uni_rows() + contact.fri_rows(), contact.cols());
  next.A.topRows(contact.uni_rows()) = contact.uni_A();
  next.A.bottomRows(contact.fri_rows()) = contact.fri_A();
  next.weights = contact.reg_A();
  next.NE = contact.ne_A();
}

void WrenchDistribution::add(const Eigen::Ref<const Eigen::MatrixXd>& A,
                             const Eigen::Ref<const Eigen::VectorXd>& weights,
                             const Eigen::Ref<const NewtonEuler>& NE) {
  if (weights.size() == 0) throwInvalid("weights must have 1 component or more, got none");
  internal::requireSize("A", A.cols(), weights.size(), "columns (as many as weights)");
  internal::requireSize("NE", NE.cols(), weights.size(), "columns (as many as weights)");
  if (!A.allFinite()) throwInvalid("A must be finite");
  if (!weights.allFinite() || !(weights.array() > 0.).all())
    throwInvalid("weights must be finite and > 0, got ", weights.transpose());
  Contact& next = work_->nextContact();
  next.A = A;
  next.weights = weights;
  next.NE = NE;
}

// The contacts that were added become those of the result, which keeps its forces if only their
// places have changed.
void WrenchDistribution::Workspace::takeProblem() {
  has_answer = has_answer && result.contacts.size() == count;
  result.contacts.resize(count);
  n = m = 0;
  largest_weight = 0.;
  for (std::size_t k = 0; k < count; ++k) {
    Contact& contact = result.contacts[k];
    if (!haveSameSettings(contact, added[k])) {
      has_answer = false;
      contact.A = added[k].A;
      contact.weights = added[k].weights;
    }
    contact.NE = added[k].NE;
    n += contact.A.cols();
    m += contact.A.rows();
    largest_weight = std::max(largest_weight, contact.weights.maxCoeff());
  }
}

// Gets the storage for what this problem does not need, but the next one of its sizes may.
void WrenchDistribution::Workspace::reserve() {
  if (scaled.size() == n && relaxation_multipliers.size() == m) return;
  for (Program* program : {&direct, &slackened}) {
    const Eigen::Index slacks = program == &slackened ? 6 : 0;
    program->scales.resize(n);
    program->E.resize(slacks + n, 6);
    program->G.resize(slacks + n, m);
    program->d.resize(6);
    program->h.resize(m);
    program->solver.reserve(slacks + n, 6, m);
  }
  for (Eigen::VectorXd* vector : {&lambda, &scaled, &change, &gradient, &products})
    vector->resize(n);
  for (Eigen::VectorXd* vector : {&relaxation_multipliers, &multipliers}) vector->resize(m);
  face.resize(n, n);
  R.resize(n, n);
  held.resize(n);
  active.resize(m);
  for (Contact& contact : result.contacts) {
    const Eigen::Index rows = contact.A.rows();
    if (!has_answer) contact.force.setZero(contact.A.cols());
    contact.active.resize(rows);
    contact.multipliers.resize(rows);
    contact.relaxation_multipliers.resize(rows);
  }
}

// Fills E and G from the scales. A slack is a variable more for each column of E, with this factor.
void WrenchDistribution::Workspace::assemble(Program& program, const Vector6& row_weights,
                                             double slack) {
  const Eigen::Index slacks = slack > 0. ? 6 : 0;
  program.E.setZero(slacks + n, 6);
  program.G.setZero(slacks + n, m);
  program.E.topRows(slacks).diagonal().setConstant(slack);
  Eigen::Index col = 0, row = 0;
  for (const Contact& contact : result.contacts) {
    const Eigen::Index cols = contact.A.cols(), rows = contact.A.rows();
    for (Eigen::Index i = 0; i < cols; ++i) {
      const double scale = program.scales[col + i];
      program.E.row(slacks + col + i) =
          weighted(row_weights, contact.NE.col(i)).transpose() / scale;
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
void WrenchDistribution::Workspace::assembleCheapest(Program& program, double slack) {
  program.scales.resize(n);
  Eigen::Index col = 0;
  for (const Contact& contact : result.contacts) {
    program.scales.segment(col, contact.weights.size()) = contact.weights / largest_weight;
    col += contact.weights.size();
  }
  assemble(program, slack > 0. ? wrench_weights : Vector6::Ones(), slack);
}

// The scales are what a unit of λ does to the weighted wrench. See relax().
void WrenchDistribution::Workspace::assembleClosest(double proximity) {
  slackened.scales.resize(n);
  Eigen::Index col = 0;
  for (const Contact& contact : result.contacts)
    for (Eigen::Index i = 0; i < contact.NE.cols(); ++i, ++col) {
      slackened.scales[col] = weighted(wrench_weights, contact.NE.col(i)).norm();
      if (slackened.scales[col] == 0.) slackened.scales[col] = 1.;
    }
  assemble(slackened, wrench_weights, proximity);
}

// Finds the cheapest forces that give a wrench, which is over the unit. False if there are none,
// or hardly any.
bool WrenchDistribution::Workspace::minimizeCost(const Vector6& wrench, double dependent,
                                                 double inequality) {
  assembleCheapest(direct, 0.);
  direct.d = wrench.cwiseQuotient(direct.norms);
  direct.h.setZero(m);
  const MinimumNorm::Status status =
      direct.solver.solve(direct.E, direct.d, direct.G, direct.h, kTolerance, dependent);
  iterations += direct.solver.iterations();
  lambda = direct.solver.x().cwiseQuotient(direct.scales);
  // The solver leaves out equalities that depend on others, whether they contradict or not.
  return status == MinimumNorm::Status::Solved && passesCheck(wrench, kExactWrench, inequality);
}

// Does the same on the face of relax(), where equalities and inequalities may all but depend on
// each other, by the method of multipliers: what the forces do not give is added to what is asked
// for
//
//     minimise ½ ‖x‖² + ½ ‖s‖²   subject to   D NE λ + √ε s = asked,   A λ ≤ 0
//
// again and again, until nothing is missing.
bool WrenchDistribution::Workspace::minimizeCostOnFace(const Vector6& wrench, double tolerance) {
  assembleCheapest(slackened, kSlack);
  restrictToFace();
  slackened.h.setZero(m);
  // The residual is to be accurate, too.
  const double enough = std::min(kMissing, std::max(kMissing * 1e3 * distance.norm(), kRounding));
  Vector6 asked = weighted(wrench_weights, wrench),
          missing = Vector6::Constant(std::numeric_limits<double>::infinity());
  for (int step = 0; step < kMultiplierSteps; ++step) {
    slackened.d = asked.cwiseQuotient(slackened.norms);  // weighted, as the slacks are
    const MinimumNorm::Status status =
        slackened.solver.solve(slackened.E, slackened.d, slackened.G, slackened.h, tolerance);
    iterations += slackened.solver.iterations();
    if (status != MinimumNorm::Status::Solved) return false;
    lambda.noalias() = face * slackened.solver.x().tail(n);
    lambda = lambda.cwiseQuotient(slackened.scales);
    const Vector6 former = missing;
    missing = weighted(wrench_weights, wrench - give(lambda));
    const double ratio = step > 0 ? missing.dot(former) / former.squaredNorm() : 0.;
    if (missing.norm() <= kRounding || (missing.norm() <= enough && step > 0 && !(ratio < 0.5)))
      break;
    if (ratio > 1. - kLeastShrinking && missing.norm() <= kExactWrench / 10.) break;
    // What shrinks slowly and evenly is the beginning of a geometric series.
    asked += missing / std::max(1. - std::max(ratio, 0.), kLeastShrinking);
  }
  return passesCheck(wrench, kAccurateWrench, kAccurateInequality);
}

// Finds the reachable wrench closest to a target, which is weighted by D and over the unit, by
// the proximal point method: with e = D NE, columns at unit length, and λ̃ the forces in that scale,
//
//     minimise ½ ‖e λ̃ − target‖² + ½ δ ‖λ̃ − λ̃₀‖²   subject to   A λ ≤ 0
//
// again and again, λ̃₀ being the answer before. Any δ > 0 leads to a minimum of the first term, and
// after a finite number of steps, because all is linear. As a problem of least norm its variables
// are (√δ (λ̃ − λ̃₀), s), with s the distance: eᵀ √δ (λ̃ − λ̃₀) + √δ s = √δ (target − e λ̃₀).
bool WrenchDistribution::Workspace::relax(const Vector6& target) {
  MinimumNorm& solver = slackened.solver;
  slackened.d.resize(6);
  slackened.h.resize(m);
  scaled.setZero(n);
  distance = target;
  double proximity = kProximity, former = std::numeric_limits<double>::infinity();
  int stalled = 0;
  assembleClosest(proximity);
  for (int step = 0; step < kProximalSteps; ++step) {
    slackened.d = proximity * (target - giveScaled(scaled)).cwiseQuotient(slackened.norms);
    slackened.h.noalias() = -proximity * (slackened.G.bottomRows(n).transpose() * scaled);
    const double tolerance = std::max(kProximalRounding * distance.norm(), proximity * kRounding);
    const MinimumNorm::Status status =
        solver.solve(slackened.E, slackened.d, slackened.G, slackened.h, tolerance);
    iterations += solver.iterations();
    if (status != MinimumNorm::Status::Solved) return false;
    distance = solver.x().head<6>();
    change = solver.x().tail(n) / proximity;
    scaled += change;
    if (change.norm() <= kProximalChange * (1. + scaled.norm())) break;
    const bool closer = distance.norm() < (1. - kProximalGain) * former;
    stalled = closer ? 0 : stalled + 1;
    if (stalled == kStalledSteps) break;
    former = distance.norm();
    extrapolate();
    if (step >= kEasySteps && distance.norm() < proximity && proximity > kLeastProximity) {
      proximity = std::max(distance.norm(), kLeastProximity);
      assembleClosest(proximity);
    }
  }
  lambda = scaled.cwiseQuotient(slackened.scales);
  relaxation_multipliers = proximity * solver.z().cwiseMax(0.);
  return true;
}

// Goes on along the last change of relax(), as far as the distance becomes less and no inequality
// is in the way: directions in which forces hardly give a wrench, such as those of soles that are
// nearly parallel, would take very many steps.
void WrenchDistribution::Workspace::extrapolate() {
  const Vector6 moved = giveScaled(change);
  double length = slackened.solver.x().head<6>().dot(moved) / moved.squaredNorm();
  if (!(length > 0.)) return;
  slackened.h.noalias() = slackened.G.bottomRows(n).transpose() * change;
  for (Eigen::Index j = 0; j < m; ++j)
    if (slackened.h[j] > kParallel * change.norm())
      length = std::min(length, -slackened.G.col(j).tail(n).dot(scaled) / slackened.h[j]);
  if (length > 0.) scaled += length * change;
}

// The weighted wrench of forces times their scales.
Vector6 WrenchDistribution::Workspace::giveScaled(const Eigen::VectorXd& forces) const {
  Vector6 wrench;
  wrench.noalias() = slackened.E.bottomRows(n).transpose() * forces;
  return wrench.cwiseProduct(slackened.norms);
}

// Where relax() has multiplied an inequality, all forces that come as close to the wrench hold it
// as an equation. Each touches one contact alone: in a basis of that contact's coordinates which
// begins with their normals, the cheapest forces have zeros there, and the rest are their
// variables.
void WrenchDistribution::Workspace::restrictToFace() {
  const double least = std::max(kMultiplied * distance.norm(), kMultiplierRounding);
  face.setZero(n, n);
  R.setZero(n, n);
  Eigen::Index col = 0, row = 0;
  for (const Contact& contact : result.contacts) {
    const Eigen::Index cols = contact.A.cols(), rows = contact.A.rows();
    auto basis = face.block(col, col, cols, cols);
    Eigen::Index size = 0;
    // Gram and Schmidt, twice, because once is not accurate; false if nothing is left.
    const auto append = [&](const auto& vector, double least) {
      auto added = basis.col(size);
      added = vector;
      for (int twice = 0; twice < 2; ++twice)
        for (Eigen::Index k = 0; k < size; ++k) added -= basis.col(k).dot(added) * basis.col(k);
      const double length = added.norm();
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
      if (!(relaxation_multipliers[j] > least)) continue;
      const auto normal = slackened.G.col(j).segment(6 + col, cols);
      if (!append(normal, kDependent * normal.norm())) continue;
      held[col + size - 1] = j;
      R.col(col + size - 1).segment(col, size).noalias() =
          basis.leftCols(size).transpose() * normal;
    }
    const Eigen::Index zeros = size;
    for (Eigen::Index i = 0; i < cols && size < cols; ++i)
      append(Eigen::VectorXd::Unit(cols, i), 0.5 / static_cast<double>(cols));

    auto coordinates = products.head(cols);
    const auto change = [&](auto&& vector) {
      coordinates.noalias() = basis.transpose() * vector;
      coordinates.head(zeros).setZero();
      // What depends on held inequalities is zero, and not what rounding has left of it.
      if (coordinates.norm() <= kDependent * vector.norm()) coordinates.setZero();
      vector = coordinates;
    };
    if (zeros > 0) {
      for (Eigen::Index j = row; j < row + rows; ++j)
        change(slackened.G.col(j).segment(6 + col, cols));
      for (Eigen::Index i = 0; i < 6; ++i) change(slackened.E.col(i).segment(6 + col, cols));
    } else {
      basis.setIdentity();
    }
    col += cols;
    row += rows;
  }
}

// Finds the forces, over the unit, for a wrench over the unit.
DistributionStatus WrenchDistribution::Workspace::distribute(const Vector6& wrench) {
  iterations = 0;
  relaxation_multipliers.setZero(m);
  held.setConstant(n, -1);
  on_face = false;
  if (minimizeCost(wrench, kNearlyDependent, kExactInequality)) return DistributionStatus::Solved;

  if (!relax(weighted(wrench_weights, wrench))) return DistributionStatus::NumericalFailure;
  on_face = true;
  // Large forces that cancel out want a larger tolerance.
  const Vector6 closest = wrench - distance.cwiseQuotient(wrench_weights);
  for (const double tolerance : {kTolerance, 10. * kTolerance, 100. * kTolerance})
    if (minimizeCostOnFace(closest, tolerance))
      return weighted(wrench_weights, wrench - give(lambda)).norm() <= kReach
                 ? DistributionStatus::Solved
                 : DistributionStatus::Relaxed;
  // Where contacts are nearly parallel, the first attempt may have been too strict.
  on_face = false;
  relaxation_multipliers.setZero();
  return minimizeCost(wrench, kDependentInequality, kAccurateInequality)
             ? DistributionStatus::Solved
             : DistributionStatus::NumericalFailure;
}

bool WrenchDistribution::Workspace::passesCheck(const Vector6& wrench, double reach,
                                                double inequality) const {
  if (!(weighted(wrench_weights, give(lambda) - wrench).norm() <= reach)) return false;
  inequality *= std::max(1., lambda.lpNorm<Eigen::Infinity>());
  Eigen::Index col = 0;
  for (const Contact& contact : result.contacts) {
    const Eigen::Index cols = contact.A.cols();
    for (Eigen::Index j = 0; j < contact.A.rows(); ++j)
      if (!(contact.A.row(j).dot(lambda.segment(col, cols)) <= inequality)) return false;
    col += cols;
  }
  return true;
}

Vector6 WrenchDistribution::Workspace::give(const Eigen::VectorXd& forces) const {
  Vector6 wrench = Vector6::Zero();
  Eigen::Index col = 0;
  for (const Contact& contact : result.contacts) {
    wrench.noalias() += contact.NE * forces.segment(col, contact.NE.cols());
    col += contact.NE.cols();
  }
  return wrench;
}

// Writes forces and multipliers into the result.
void WrenchDistribution::Workspace::takeAnswer() {
  const double cost_scale = unit * largest_weight * largest_weight;
  // D² is the square of the relative weights times this.
  const double distance_scale = unit * overall_weight * overall_weight;
  const Program& program = on_face ? slackened : direct;
  const MinimumNorm& solver = program.solver;
  result.iterations = iterations;
  Vector6 y = solver.y().cwiseQuotient(program.norms);
  if (on_face) y = weighted(wrench_weights, y);
  result.wrench_multipliers = -cost_scale * y;
  multipliers = solver.z();
  active.setConstant(m, false);
  for (const Eigen::Index inequality : solver.active()) active[inequality] = true;

  Eigen::Index col = 0, row = 0;
  for (Contact& contact : result.contacts) {
    const Eigen::Index rows = contact.A.rows(), cols = contact.A.cols();
    contact.force = unit * lambda.segment(col, cols);
    contact.relaxation_multipliers = distance_scale * relaxation_multipliers.segment(row, rows);

    // Those of held inequalities make up for what is missing: x + E y + G z = 0.
    Eigen::Index size = 0;
    while (size < cols && held[col + size] >= 0) ++size;
    if (size > 0) {
      auto missing = gradient.head(cols);
      missing.noalias() = contact.NE.transpose() * y;
      missing.noalias() += contact.A.transpose() * multipliers.segment(row, rows);
      missing = missing.cwiseQuotient(program.scales.segment(col, cols));
      missing += lambda.segment(col, cols).cwiseProduct(program.scales.segment(col, cols));
      auto of_held = products.head(size);
      of_held.noalias() = face.block(col, col, cols, size).transpose() * missing;
      of_held = -of_held;
      R.block(col, col, size, size).triangularView<Eigen::Upper>().solveInPlace(of_held);
      for (Eigen::Index k = 0; k < size; ++k) {
        multipliers[held[col + k]] = of_held[k];
        active[held[col + k]] = true;
      }
    }
    contact.multipliers = cost_scale * multipliers.segment(row, rows);
    contact.active = active.segment(row, rows);
    col += cols;
    row += rows;
  }
}

// Leaves the forces of the last answer where they are, or zeros if there is none.
void WrenchDistribution::Workspace::keepAnswer() {
  result.iterations = iterations;
  result.wrench_multipliers.setZero();
  for (Contact& contact : result.contacts) {
    const Eigen::Index rows = contact.A.rows();
    if (!has_answer) contact.force.setZero(contact.A.cols());
    contact.active.setConstant(rows, false);
    contact.multipliers.setZero(rows);
    contact.relaxation_multipliers.setZero(rows);
  }
}

// What the forces amount to.
void WrenchDistribution::Workspace::sumUp() {
  result.achieved.setZero();
  result.cost = 0.;
  for (const Contact& contact : result.contacts) {
    result.achieved.noalias() += contact.NE * contact.force;
    result.cost += 0.5 * contact.weights.cwiseProduct(contact.force).squaredNorm();
  }
  result.residual = result.wrench - result.achieved;
}

DistributionStatus WrenchDistribution::solve(const Vector6& wrench, double minimalScale) {
  Workspace& work = *work_;
  DistributionResult& result = work.result;
  work.takeProblem();
  work.reserve();
  work.iterations = 0;
  result.wrench = wrench;
  const Vector6& weights = work.settings;
  result.wrench_weights = weights;
  work.overall_weight = overallWeight(weights, wrench);
  result.scale = std::max(minimalScale, normOf(weighted(weights, wrench)));
  work.unit = result.scale / work.overall_weight;
  work.wrench_weights = weights / work.overall_weight;

  bool finite = wrench.allFinite() && std::isfinite(minimalScale);
  for (const Contact& contact : result.contacts) finite = finite && contact.NE.allFinite();
  if (!finite) {
    result.status = DistributionStatus::InvalidInput;
  } else if (!std::isfinite(work.unit) ||
             !std::isfinite(result.scale)) {  // beyond the largest numbers
    result.status = DistributionStatus::NumericalFailure;
  } else if (work.n == 0) {
    const bool zero = normOf(weighted(weights, wrench)) <= kReach * result.scale;
    result.status = zero ? DistributionStatus::Solved : DistributionStatus::NoContact;
  } else if (work.unit == 0.) {
    work.has_answer = false;  // all forces are zero
    result.status = DistributionStatus::Solved;
  } else {
    result.status = work.distribute(wrench / work.unit);
  }

  if (work.n > 0 && work.unit > 0. &&
      (result.status == DistributionStatus::Solved ||
       result.status == DistributionStatus::Relaxed)) {
    work.takeAnswer();
    work.has_answer = true;
  } else {
    work.keepAnswer();
  }
  work.sumUp();
  return result.status;
}

// The largest s, but for what is above a bound, for which a wrench plus s times a direction is
// reachable; all of them weighted and over the unit. From a point beyond, the plane between it and
// the reachable wrenches cuts the line closer to where it leaves them, until it is there. Negative
// if it fails.
double WrenchDistribution::Workspace::findBoundary(const Vector6& wrench, const Vector6& direction,
                                                   double bound) {
  double s = bound;
  for (int step = 0; step < kMarginSteps && s > 0.; ++step) {
    // Only the direction of what is out of reach matters, because the reachable is a cone.
    const Vector6 target = std::isfinite(s) ? Vector6(wrench + s * direction) : direction;
    if (target.norm() <= kMarginReach) break;  // no wrench at all
    if (!relax(target / target.norm())) return -1.;
    if (distance.norm() <= kMarginReach) break;
    const double cut = std::max(0., -distance.dot(wrench) / distance.dot(direction));
    if (!(cut < s * (1. - kMarginChange))) break;
    s = cut > kMarginChange ? cut : 0.;
  }
  return s;
}

WrenchMargin WrenchDistribution::computeMargin() {
  Workspace& work = *work_;
  const DistributionResult& result = work.result;
  WrenchMargin margin;
  if (std::isnan(result.scale) || result.status == DistributionStatus::InvalidInput ||
      result.status == DistributionStatus::NumericalFailure)
    return margin;
  margin.margin = 0.;
  if (result.status == DistributionStatus::Relaxed ||
      result.status == DistributionStatus::NoContact)
    return margin;

  Vector6 wrench = weighted(work.wrench_weights, result.achieved);
  if (work.unit > 0.) wrench /= work.unit;
  double least = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 6; ++axis) {
    for (const int sign : {1, -1}) {
      const double s = work.findBoundary(wrench, sign * Vector6::Unit(axis), least);
      if (s < 0.) return WrenchMargin();
      if (s < least) {
        least = s;
        margin.axis = axis;
        margin.sign = sign;
      }
    }
  }
  margin.margin = work.unit > 0. ? result.scale * least : least;
  return margin;
}

}  // namespace dynacom
