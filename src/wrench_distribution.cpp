// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/wrench_distribution.hpp"

#include <algorithm>
#include <cmath>
#include <ostream>
#include <utility>

#include "check.hpp"
#include "dynacom/distribution_solver.hpp"
#include "two_stage.hpp"

namespace dynacom {

namespace {

using internal::kMultiplied;
using internal::kReach;
using internal::throwInvalid;
using internal::TwoStageSolver;
using Contact = DistributionResult::Contact;
using Vector6 = DistributionResult::Vector6;
using NewtonEuler = Eigen::Matrix<double, 6, Eigen::Dynamic>;
using MatrixRef = Eigen::Ref<const Eigen::MatrixXd>;
using VectorRef = Eigen::Ref<const Eigen::VectorXd>;

// These are for a problem whose weighted wrench has unit size.

// Forces below this are as good as none.
constexpr double kNegligible = 1e-9;
// How many units in the last place of its terms a sum may be off.
constexpr double kRounding = 8.;
// How far the wrench of an answer may be from the closest one.
constexpr double kInaccuracy = 1e-11;
// By what tolerance of DistributionResult::isOptimal() an answer proves itself.
constexpr double kProof = 1e-8;
// The margin's search has arrived when it is this close to what can be reached, or when a step
// changes it by less than this part; below that it is zero.
constexpr double kMarginReach = 1e-11;
constexpr double kMarginChange = 1e-10;
constexpr int kMarginSteps = 50;
constexpr Eigen::Index kNormal = 2;

Vector6 weighted(const Vector6& weights, const Vector6& wrench) {
  return weights.cwiseProduct(wrench);
}

// The norm, also of numbers whose squares would be too large or too small: that takes longer.
inline double normOf(const Vector6& wrench) {
  const double norm = wrench.norm();
  return norm > 1e-140 && norm < 1e140 ? norm : wrench.stableNorm();
}

// What D amounts to for a wrench: forces in newtons are a weighted wrench over this.
double overallWeight(const Vector6& weights, double wrench_size, double weighted_size) {
  return wrench_size > 0. ? weighted_size / wrench_size : weights.maxCoeff();
}

bool areSame(const MatrixRef& a, const MatrixRef& b) {
  return a.rows() == b.rows() && a.cols() == b.cols() && a == b;
}

void requireInitialised(const ContactBase& contact) {
  if (contact.cols() == 0) throwInvalid("a contact was never initialised");
}

// Whether some contacts are more than pyramids.
bool hasSets(const std::vector<Contact>& contacts) {
  return std::any_of(contacts.begin(), contacts.end(),
                     [](const Contact& contact) { return contact.set.has_value(); });
}

// Which inequalities bound a component of a pyramid: λᵢ from above or below, by its sign.
struct Row {
  Eigen::Index component;  // of the normal force where it is the third
  signed char sign;
  double factor;  // of the component, without sign
};

// Where a contact is, from its NE = [R 0; [p]×R R].
void place(const Contact& contact, DistributionProblem::Contact& placed) {
  const auto R = contact.NE.topLeftCorner<3, 3>(), of_moment = contact.NE.bottomLeftCorner<3, 3>();
  placed.rotation = R;
  // Elements of [p]× = [p]×R Rᵀ.
  placed.lever << of_moment.row(2).dot(R.row(1)), of_moment.row(0).dot(R.row(2)),
      of_moment.row(1).dot(R.row(0));
}

// Gives a contact's share of a result its sizes.
void resize(Contact& contact, Eigen::Index rows, Eigen::Index cols) {
  contact.A.resize(rows, cols);
  contact.weights.resize(cols);
  contact.NE.resize(6, cols);
  contact.set.reset();
  contact.reference.setZero(cols);
  contact.force.setZero(cols);
  contact.active.setConstant(rows, false);
  contact.multipliers.setZero(rows);
  contact.relaxation_multipliers.setZero(rows);
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
  if (hasSets(contacts)) {
    DistributionProblem problem;
    for (const Contact& contact : contacts) {
      DistributionProblem::Contact& described = problem.contacts.emplace_back();
      described.set = *contact.set;
      described.weights = contact.weights;
      described.reference = contact.reference;
      place(contact, described);
    }
    problem.wrench = wrench;
    problem.wrench_weights = wrench_weights;
    problem.minimal_scale = scale / wrench_weights.head<3>().maxCoeff();
    DistributionSolution solution;
    solution.status = status;
    for (const Contact& contact : contacts) solution.forces.push_back(contact.force);
    solution.achieved = achieved;
    solution.residual = residual;
    solution.multipliers = wrench_multipliers;
    return solution.isOptimal(problem, tolerance);
  }
  const double overall_weight =
      overallWeight(wrench_weights, normOf(wrench), normOf(weighted(wrench_weights, wrench)));
  const double unit = scale / overall_weight;  // of forces
  const double size = weighted(wrench_weights, residual).norm();
  const double within_reach = kReach * scale;
  switch (status) {
    case DistributionStatus::Solved:
      if (!(size <= within_reach * (1. + tolerance))) return false;
      break;
    case DistributionStatus::Relaxed:
      if (!(size >= within_reach * (1. - tolerance))) return false;
      break;
    case DistributionStatus::NoContact:
      return contacts.empty() && size > within_reach && achieved.isZero(0.);
    default:
      return false;
  }

  // The relaxation's multipliers say what holds on the face of the closest wrench. They are to be
  // believed where they are more than rounding, and what they must be themselves is looked at.
  const Vector6 pull = weighted(wrench_weights.cwiseAbs2(), residual);
  Vector6 terms = wrench.cwiseAbs();  // of the residual, without signs
  bool relaxed = status == DistributionStatus::Relaxed;
  for (const Contact& contact : contacts) {
    for (Eigen::Index i = 0; i < contact.force.size(); ++i)
      terms += std::abs(contact.force[i]) * contact.NE.col(i).cwiseAbs();
    relaxed = relaxed || !contact.relaxation_multipliers.isZero(0.);
  }
  const Vector6 rounding = kRounding * std::numeric_limits<double>::epsilon() *
                           weighted(wrench_weights.cwiseAbs2(), terms);
  const double least_of_distance =
      std::max(kMultiplied * overall_weight * size, rounding.maxCoeff());
  if (relaxed && !(std::abs(pull.dot(achieved)) <=
                   tolerance * scale * size + rounding.dot(achieved.cwiseAbs())))
    return false;

  Vector6 given = Vector6::Zero();
  double all_costs = 0., gap = 0., nothing = 0.;
  for (const Contact& contact : contacts) {
    given += contact.NE * contact.force;
    const auto cost_weights = contact.weights.cwiseAbs2();
    const double gradient_size =
        std::max(kNegligible * unit * cost_weights.maxCoeff(),
                 cost_weights.cwiseProduct(contact.force.cwiseAbs()).maxCoeff());

    // The minimum of the cost: W² λ − NEᵀ ν + Aᵀ μ = 0. That of the distance: NEᵀ D² r = Aᵀ μ'.
    // What the former lacks, e, and slacks that are multiplied, leave a gap between the cost and
    // the least: that of the dual is − ½ ‖W⁻¹ (W² λ − e)‖² + νᵀ w*.
    // The latter may lack as much as w* may be off, but then no multiplier is believed that is
    // less.
    const double largest = std::max(1., contact.NE.lpNorm<Eigen::Infinity>());
    const double enough = tolerance * pull.lpNorm<Eigen::Infinity>() * largest;
    const double inaccuracy = kInaccuracy * unit * wrench_weights.cwiseAbs2().maxCoeff() * largest;
    double believed = least_of_distance;
    for (Eigen::Index i = 0; i < contact.force.size(); ++i) {
      const double lacking = cost_weights[i] * contact.force[i] -
                             contact.NE.col(i).dot(wrench_multipliers) +
                             contact.A.col(i).dot(contact.multipliers);
      gap += std::abs(lacking * contact.force[i]) + 0.5 * lacking * lacking / cost_weights[i];
      const double of_distance = std::abs(contact.NE.col(i).dot(pull) -
                                          contact.A.col(i).dot(contact.relaxation_multipliers));
      if (relaxed && !(of_distance <= enough + inaccuracy)) return false;
      if (!(of_distance <= enough + contact.NE.col(i).cwiseAbs().dot(rounding)))
        believed = std::max(believed, of_distance);
    }
    for (Eigen::Index j = 0; j < contact.A.rows(); ++j) {
      const double slack = contact.A.row(j).dot(contact.force);
      const double multiplier = contact.multipliers[j];
      const double of_distance = contact.relaxation_multipliers[j];
      if (!(slack <= tolerance * unit) || !(of_distance >= 0.)) return false;
      if (!(of_distance > believed) && !(multiplier >= -tolerance * gradient_size)) return false;
      if (multiplier != 0. && !(std::abs(slack) <= tolerance * unit)) return false;
      gap += std::abs(multiplier * slack);
    }
    all_costs += cost_weights.dot(contact.force.cwiseAbs2());
    nothing = std::max(nothing, kNegligible * unit * contact.weights.maxCoeff());
  }
  return gap <= tolerance * (all_costs + nothing * nothing) &&
         weighted(wrench_weights, given - achieved).norm() <= tolerance * scale &&
         weighted(wrench_weights, wrench - achieved - residual).norm() <= tolerance * scale;
}

struct WrenchDistribution::Workspace {
  // What is kept of a contact from one problem to the next.
  struct Slot {
    // As last added: inequalities in two parts, those of a contact.
    Eigen::MatrixXd unilaterality, friction;
    Eigen::VectorXd weights, reference;
    std::optional<ContactSet> set;  // of contacts
    bool is_pyramid = true;         // whether that is what inequalities say
    std::vector<Row> sides;         // of a pyramid
    std::uint64_t revision = 0;     // of the contact, if it was one
    NewtonEuler NE;
    bool changed = true;             // whether the last solve() knew other inequalities and weights
    bool moved = false;              // whether it knew another NE
    std::size_t problem_number = 0;  // of the last that it was added to
    Contact parked;                  // its share of the result while it is not part of that
    Contact spare;                   // storage for another size
    Eigen::VectorXd former_force;    // of the answer before

    Eigen::Index rows() const { return unilaterality.rows() + friction.rows(); }
  };

  DistributionResult result;
  Vector6 settings = Vector6::Ones();  // D of the next solve()
  bool warm_start = true;
  int maximal_iterations = kMaximalIterations;

  std::vector<Slot> slots;
  std::size_t problem_number = 1;   // counts clear()
  std::vector<std::size_t> added;   // slots of the next solve()
  std::vector<std::size_t> solved;  // slots of the result's contacts
  bool has_answer = false;          // whether the forces in result are an answer for its contacts

  // What forces and wrenches are divided by, and D over its overall weight: for weights of 1 the
  // unit is the scale, and it is the same for all common factors of the weights.
  double unit = 0., overall_weight = 1.;
  Vector6 wrench_weights = Vector6::Ones();

  bool has_sets = false;        // whether some contacts of the result are more than pyramids
  bool knows_all_sets = false;  // whether none of them is described by matrices alone
  bool are_sets_new = false;    // whether `sets` has not seen them
  // Whether inequalities of the result may be active or have multipliers.
  bool has_multipliers = true;
  DistributionProblem problem;  // these, where their sets are known
  DistributionSolver sets;
  TwoStageSolver<double> solver;                // for others, and for pyramids what that leaves
  TwoStageSolver<long double> accurate_solver;  // several times slower

  Slot& findSlot(std::size_t slot);
  Slot& takeSlot(std::size_t slot);
  void requireShareable(const ContactBase* contact) const;
  void describe(Slot& slot, const ContactBase& contact);
  void describe(Slot& slot, const MatrixRef& unilaterality, const MatrixRef& friction,
                const VectorRef& weights, const VectorRef& reference,
                const std::optional<ContactSet>& set, bool is_pyramid);
  static void listSides(Slot& slot);
  void reserve();
  void takeProblem();
  void rearrange();
  void takeSets();
  void keepForces();
  bool distribute(double minimal_scale);
  bool solveSets(double minimal_scale);
  void writeAnswerOfSets();
  bool writeMultipliers(const DistributionSolution& solution);
  bool isCertain(const DistributionSolution& solution) const;
  bool distributeRobustly();
  template <class Scalar>
  bool distributeBy(TwoStageSolver<Scalar>& solver);
  template <class Scalar>
  void writeAnswer(TwoStageSolver<Scalar>& solver);
  bool hasFiniteMatrices() const;
  void keepAnswer();
  void sumUp();
  bool findDistance(const Vector6& target, Vector6& distance);
  double findBoundary(const Vector6& wrench, const Vector6& direction, double bound);
  double findBoundaryOfSets(const Vector6& direction, double bound);
};

WrenchDistribution::WrenchDistribution() : work_(std::make_unique<Workspace>()) {}
WrenchDistribution::WrenchDistribution(const WrenchDistribution& other)
    : work_(std::make_unique<Workspace>(other.look())) {
  work_->reserve();  // which copying has undone
}
WrenchDistribution::WrenchDistribution(WrenchDistribution&& other) noexcept = default;
WrenchDistribution& WrenchDistribution::operator=(WrenchDistribution other) noexcept {
  std::swap(work_, other.work_);
  return *this;
}
WrenchDistribution::~WrenchDistribution() = default;

// The workspace, where it was moved away a new one.
WrenchDistribution::Workspace& WrenchDistribution::use() {
  if (!work_) work_ = std::make_unique<Workspace>();
  return *work_;
}

const WrenchDistribution::Workspace& WrenchDistribution::look() const {
  if (work_) return *work_;
  static const Workspace fresh{};
  return fresh;
}

void WrenchDistribution::setWrenchWeights(const Vector6& weights) {
  if (!weights.allFinite() || !(weights.array() > 0.).all())
    throwInvalid("wrench weights must be finite and > 0, got ", weights.transpose());
  Workspace& work = use();
  if (weights != work.settings) work.has_answer = false;
  work.settings = weights;
}

const Vector6& WrenchDistribution::getWrenchWeights() const { return look().settings; }

void WrenchDistribution::setWarmStart(bool warmStart) { use().warm_start = warmStart; }

bool WrenchDistribution::getWarmStart() const { return look().warm_start; }

void WrenchDistribution::setMaximalIterations(int maximalIterations) {
  if (maximalIterations <= 0)
    throwInvalid("maximalIterations must be > 0, got ", maximalIterations);
  use().maximal_iterations = maximalIterations;
}

int WrenchDistribution::getMaximalIterations() const { return look().maximal_iterations; }

void WrenchDistribution::clear() {
  Workspace& work = use();
  work.added.clear();
  ++work.problem_number;
}

void WrenchDistribution::reset() {
  Workspace& work = use();
  Workspace fresh;
  fresh.settings = work.settings;
  fresh.warm_start = work.warm_start;
  fresh.maximal_iterations = work.maximal_iterations;
  work = std::move(fresh);  // in place, because others may refer to the result
}

void WrenchDistribution::forgetAnswers() {
  Workspace& work = use();
  work.sets.forget();
  work.has_answer = false;
}

void WrenchDistribution::forgetForces() { use().has_answer = false; }

const DistributionResult& WrenchDistribution::result() const { return look().result; }

WrenchDistribution::Workspace::Slot& WrenchDistribution::Workspace::findSlot(std::size_t slot) {
  if (slot > slots.size())
    throwInvalid("slot must be at most ", slots.size(), ", the first that is free, got ", slot);
  if (slot == slots.size()) slots.emplace_back();
  return slots[slot];
}

// The slot, as a part of the next problem.
WrenchDistribution::Workspace::Slot& WrenchDistribution::Workspace::takeSlot(std::size_t slot) {
  Slot& found = findSlot(slot);
  if (found.problem_number == problem_number) throwInvalid("slot ", slot, " is taken already");
  found.problem_number = problem_number;
  added.push_back(slot);
  return found;
}

// No solver knows both: what is described by matrices alone, and what is more than a pyramid.
// Without a contact it is of the former.
void WrenchDistribution::Workspace::requireShareable(const ContactBase* contact) const {
  const bool has_set = contact && contact->getSet();
  if (has_set && contact->isPyramid()) return;
  const auto other = std::find_if(added.begin(), added.end(), [&](std::size_t number) {
    return has_set ? !slots[number].set : !slots[number].is_pyramid;
  });
  if (other == added.end()) return;
  constexpr const char* kMatrices = "described by its matrices alone, as soles of coupled yaw are";
  constexpr const char* kMore = "more than a pyramid";
  throwInvalid("contact '", contact ? contact->getFrameName() : "A", "' is ",
               has_set ? kMore : kMatrices, ": it cannot share a wrench with that of slot ", *other,
               ", which is ", has_set ? kMatrices : kMore);
}

// What is the same as before is not written: this happens at every tick.
void WrenchDistribution::Workspace::describe(Slot& slot, const ContactBase& contact) {
  if (slot.revision == contact.getRevision()) return;
  describe(slot, contact.uni_A(), contact.fri_A(), contact.reg_A(), contact.reg_b(),
           contact.getSet(), contact.isPyramid());
  slot.revision = contact.getRevision();
}

void WrenchDistribution::Workspace::describe(Slot& slot, const MatrixRef& unilaterality,
                                             const MatrixRef& friction, const VectorRef& weights,
                                             const VectorRef& reference,
                                             const std::optional<ContactSet>& set,
                                             bool is_pyramid) {
  slot.revision = 0;
  if (areSame(slot.unilaterality, unilaterality) && areSame(slot.friction, friction) &&
      areSame(slot.weights, weights) && areSame(slot.reference, reference) && slot.set == set &&
      slot.is_pyramid == is_pyramid)
    return;
  const Eigen::Index rows = unilaterality.rows() + friction.rows(), cols = weights.size();
  const bool same_sizes = slot.rows() == rows && slot.weights.size() == cols;
  slot.unilaterality = unilaterality;
  slot.friction = friction;
  slot.weights = weights;
  slot.reference = reference;
  slot.set = set;
  slot.is_pyramid = is_pyramid;
  slot.changed = true;
  listSides(slot);
  if (same_sizes) return;
  slot.NE.resize(6, cols);
  resize(slot.spare, rows, cols);
  slot.former_force.setZero(cols);
  reserve();
}

// Which inequalities bound a component of a pyramid that is known as a set.
void WrenchDistribution::Workspace::listSides(Slot& slot) {
  slot.sides.clear();
  if (!slot.set || !slot.is_pyramid) return;
  const auto list = [&](const Eigen::MatrixXd& A) {
    for (Eigen::Index row = 0; row < A.rows(); ++row) {
      Eigen::Index component = kNormal;
      for (Eigen::Index i = 0; i < A.cols(); ++i)
        if (i != kNormal && A(row, i) != 0.) component = i;
      const double factor = A(row, component);
      slot.sides.push_back(
          {component, static_cast<signed char>(factor > 0. ? 1 : -1), std::abs(factor)});
    }
  };
  list(slot.unilaterality);
  list(slot.friction);
}

// Gets storage for problems with any of the slots.
void WrenchDistribution::Workspace::reserve() {
  Eigen::Index rows = 0, cols = 0, all_rows = 0, all_cols = 0;
  for (const Slot& slot : slots) {
    rows = std::max(rows, slot.rows());
    cols = std::max(cols, slot.weights.size());
    all_rows += slot.rows();
    all_cols += slot.weights.size();
  }
  added.reserve(slots.size());
  solved.reserve(slots.size());
  result.contacts.reserve(slots.size());
  problem.contacts.reserve(slots.size());
  sets.reserve(slots.size());
  solver.reserve(slots.size(), rows, cols, all_rows, all_cols);
  accurate_solver.reserve(slots.size(), rows, cols, all_rows, all_cols);
}

void WrenchDistribution::reserve(const ContactBase& contact, std::size_t slot) {
  requireInitialised(contact);
  Workspace& work = use();
  Workspace::Slot& found = work.findSlot(slot);
  if (found.problem_number == work.problem_number) throwInvalid("slot ", slot, " is taken already");
  work.describe(found, contact);
}

void WrenchDistribution::add(const ContactBase& contact) { add(contact, use().added.size()); }

void WrenchDistribution::add(const ContactBase& contact, std::size_t slot) {
  requireInitialised(contact);
  if (contact.ne_A().isZero(0.))
    throw NotReadyError("contact '" + contact.getFrameName() +
                        "' is used before updateNewtonEuler()");
  Workspace& work = use();
  work.requireShareable(&contact);
  Workspace::Slot& taken = work.takeSlot(slot);
  work.describe(taken, contact);
  taken.NE = contact.ne_A();
  taken.moved = true;
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
  Workspace& work = use();
  work.requireShareable(nullptr);
  Workspace::Slot& taken = work.takeSlot(work.added.size());
  const Eigen::MatrixXd no_friction(0, A.cols());
  work.describe(taken, A, no_friction, weights, Eigen::VectorXd::Zero(weights.size()), std::nullopt,
                true);
  taken.NE = NE;
  taken.moved = true;
}

// The contacts that were added become those of the result, which keeps its forces if only their
// places have changed.
void WrenchDistribution::Workspace::takeProblem() {
  bool same = added == solved;
  // Multipliers of the wrench do not know the order of contacts.
  bool are_others =
      !same && !std::is_permutation(added.begin(), added.end(), solved.begin(), solved.end());
  if (!same) rearrange();
  for (std::size_t k = 0; k < solved.size(); ++k) {
    Slot& slot = slots[solved[k]];
    Contact& contact = result.contacts[k];
    if (slot.changed) {
      if (contact.A.rows() != slot.rows() || contact.A.cols() != slot.weights.size())
        std::swap(slot.spare, contact);
      contact.A.topRows(slot.unilaterality.rows()) = slot.unilaterality;
      contact.A.bottomRows(slot.friction.rows()) = slot.friction;
      contact.weights = slot.weights;
      contact.reference = slot.reference;
      are_others = true;
      slot.changed = same = false;
    }
    if (slot.moved) contact.NE.swap(slot.NE);
    slot.moved = false;
  }
  if (!same) takeSets();
  if (are_others) sets.forget();
  if (knows_all_sets)
    for (std::size_t k = 0; k < solved.size(); ++k) place(result.contacts[k], problem.contacts[k]);
}

// Of contacts that are others than before.
void WrenchDistribution::Workspace::takeSets() {
  has_answer = has_sets = false;
  knows_all_sets = are_sets_new = has_multipliers = true;
  for (const std::size_t number : solved) {
    has_sets = has_sets || !slots[number].is_pyramid;
    knows_all_sets = knows_all_sets && slots[number].set;
  }
  problem.contacts.resize(knows_all_sets ? solved.size() : 0);
  for (std::size_t k = 0; k < solved.size(); ++k) {
    const Slot& slot = slots[solved[k]];
    result.contacts[k].set.reset();
    if (has_sets) result.contacts[k].set = slot.set;
    if (!knows_all_sets) continue;
    problem.contacts[k].set = *slot.set;
    problem.contacts[k].weights = slot.weights;
    problem.contacts[k].reference.resize(slot.reference.isZero(0.) ? 0 : slot.reference.size());
    if (problem.contacts[k].reference.size() > 0) problem.contacts[k].reference = slot.reference;
  }
}

// Puts away the shares of the contacts that took part, and gets those of the ones that do now.
void WrenchDistribution::Workspace::rearrange() {
  const auto exchange = [&] {
    for (std::size_t k = 0; k < solved.size(); ++k)
      std::swap(slots[solved[k]].parked, result.contacts[k]);
  };
  exchange();
  solved = added;
  result.contacts.resize(solved.size());
  exchange();
}

// Returns false if there is no answer. What an attempt from the last one has taken in vain comes on
// top of the iterations that are allowed, and is counted where they leave room for it.
bool WrenchDistribution::Workspace::distribute(double minimal_scale) {
  bool answered = knows_all_sets && solveSets(minimal_scale);
  const int in_vain = knows_all_sets ? sets.solution().iterations_in_vain : 0;
  if (has_sets || (answered && sets.solution().is_accurate)) {
    if (answered) writeAnswerOfSets();
  } else {
    keepForces();
    if (answered) writeAnswerOfSets();
    result.iterations -= in_vain;
    if (!answered || !isCertain(sets.solution())) {
      if (hasFiniteMatrices()) {
        answered = distributeRobustly();
      } else {
        result.status = DistributionStatus::InvalidInput;
        answered = false;
      }
    }
    result.iterations += in_vain;
  }
  result.iterations = std::min(result.iterations, maximal_iterations);
  return answered;
}

// The forces of the answer before, for when there is no other.
void WrenchDistribution::Workspace::keepForces() {
  for (std::size_t k = 0; k < solved.size(); ++k)
    slots[solved[k]].former_force = result.contacts[k].force;
}

// Contacts whose sets are known. Returns false if there is no answer.
bool WrenchDistribution::Workspace::solveSets(double minimal_scale) {
  problem.wrench = result.wrench;
  problem.wrench_weights = settings;
  problem.minimal_scale = minimal_scale;
  sets.setMaximalIterations(maximal_iterations);
  sets.setWarmStart(warm_start);
  const DistributionSolution& solution =
      are_sets_new ? sets.solve(problem) : sets.solveMoved(problem);
  are_sets_new = false;
  if (has_sets) result.scale = problem.scale();
  result.status = solution.status;
  result.iterations = solution.iterations;
  return result.status == DistributionStatus::Solved ||
         result.status == DistributionStatus::Relaxed;
}

void WrenchDistribution::Workspace::writeAnswerOfSets() {
  const DistributionSolution& solution = sets.solution();
  result.achieved = solution.achieved;
  result.residual = result.wrench - result.achieved;
  result.cost = solution.cost;
  result.wrench_multipliers = solution.multipliers;
  for (std::size_t k = 0; k < result.contacts.size(); ++k)
    result.contacts[k].force = solution.forces[k];
  if (has_multipliers)
    for (Contact& contact : result.contacts) {
      contact.active.setConstant(false);
      contact.multipliers.setZero();
      contact.relaxation_multipliers.setZero();
    }
  has_multipliers = !has_sets && writeMultipliers(solution);
}

// Multipliers of the inequalities that the forces are at: what W² λ = NEᵀ ν − Aᵀ μ and
// NEᵀ D² r = Aᵀ μ' leave for each component, and last for the normal force. Returns whether there
// are any.
bool WrenchDistribution::Workspace::writeMultipliers(const DistributionSolution& solution) {
  // Or hardly out of reach, which no answer with all digits is.
  const bool is_relaxed = solution.status == DistributionStatus::Relaxed ||
                          (solution.is_clear && !solution.is_accurate);
  const Vector6 distance = weighted(settings.cwiseAbs2(), solution.residual);
  bool are_any = false;
  for (std::size_t k = 0; k < solved.size(); ++k) {
    Contact& contact = result.contacts[k];
    const auto& bounds = solution.bounds[k];
    if (bounds.isZero()) continue;
    are_any = true;
    const auto write = [&](Eigen::Index row, const Row& side, double rest, double of_distance) {
      contact.active[row] = true;
      if (is_relaxed) contact.relaxation_multipliers[row] = std::max(0., of_distance / side.factor);
      // Of equations of any sign; else what is below zero is rounding.
      const double multiplier = rest / side.factor;
      contact.multipliers[row] =
          contact.relaxation_multipliers[row] > 0. ? multiplier : std::max(0., multiplier);
    };
    const auto findRest = [&](Eigen::Index i) {
      return contact.NE.col(i).dot(result.wrench_multipliers) -
             contact.weights[i] * contact.weights[i] * contact.force[i];
    };
    double rest_of_normal = 0., distance_of_normal = 0.;
    Eigen::Index normal_row = -1;
    const std::vector<Row>& sides = slots[solved[k]].sides;
    for (std::size_t j = 0; j < sides.size(); ++j) {
      const Row& side = sides[j];
      const auto row = static_cast<Eigen::Index>(j);
      if (bounds[side.component] != side.sign) continue;
      if (side.component == kNormal) {
        normal_row = row;
        continue;
      }
      write(row, side, side.sign * findRest(side.component),
            side.sign * contact.NE.col(side.component).dot(distance));
      rest_of_normal += contact.A(row, kNormal) * contact.multipliers[row];
      distance_of_normal += contact.A(row, kNormal) * contact.relaxation_multipliers[row];
    }
    if (normal_row >= 0)
      write(normal_row, sides[static_cast<std::size_t>(normal_row)],
            rest_of_normal - findRest(kNormal),
            distance_of_normal - contact.NE.col(kNormal).dot(distance));
  }
  return are_any;
}

// Whether an answer for pyramids without all digits proves itself; else others may know it better.
bool WrenchDistribution::Workspace::isCertain(const DistributionSolution& solution) const {
  const double distance = weighted(settings, solution.residual).norm() / result.scale;
  // What is missing has a price, by the multipliers.
  const double price =
      solution.multipliers.cwiseQuotient(settings).norm() * distance * result.scale;
  const bool is_exact = solution.status == DistributionStatus::Solved && distance <= kInaccuracy &&
                        price <= kNegligible * solution.cost;
  return (solution.is_clear || is_exact) && result.isOptimal(kProof);
}

// Few problems need more digits than double has: those where contacts are nearly parallel, and
// where the wrench is so close to the boundary that it is barely known which side it is on.
bool WrenchDistribution::Workspace::distributeRobustly() {
  const bool answered = distributeBy(solver);
  const bool proved = answered && result.isOptimal(kProof);
  if (proved && !solver.hasFewDigits()) return true;
  const DistributionStatus status = result.status;
  const bool answered_accurately = distributeBy(accurate_solver);
  if (answered_accurately && (!proved || result.isOptimal(kProof))) return true;
  // Then the first answer is the one. Without proof it is not, if there was no time for a better
  // one.
  const bool had_time = result.iterations < maximal_iterations;
  if (answered && (proved || had_time)) {
    result.status = status;
    if (answered_accurately) writeAnswer(solver);
    return true;
  }
  result.status = DistributionStatus::NumericalFailure;
  for (std::size_t k = 0; k < solved.size(); ++k)
    result.contacts[k].force = slots[solved[k]].former_force;
  return false;
}

template <class Scalar>
bool WrenchDistribution::Workspace::distributeBy(TwoStageSolver<Scalar>& solver) {
  solver.setProblem(result.contacts, wrench_weights);
  result.status = solver.solve(result.wrench.template cast<Scalar>() / static_cast<Scalar>(unit),
                               maximal_iterations - result.iterations);
  result.iterations += solver.iterations();
  if (result.status == DistributionStatus::NumericalFailure) return false;
  writeAnswer(solver);
  return true;
}

template <class Scalar>
void WrenchDistribution::Workspace::writeAnswer(TwoStageSolver<Scalar>& solver) {
  solver.writeAnswer(result, unit, overall_weight);
  has_multipliers = true;
  sumUp();
}

bool WrenchDistribution::Workspace::hasFiniteMatrices() const {
  return std::all_of(result.contacts.begin(), result.contacts.end(),
                     [](const Contact& contact) { return contact.NE.allFinite(); });
}

// Leaves the forces of the last answer where they are, or zeros if there is none.
void WrenchDistribution::Workspace::keepAnswer() {
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
    result.cost +=
        0.5 * contact.weights.cwiseProduct(contact.force - contact.reference).squaredNorm();
  }
  result.residual = result.wrench - result.achieved;
}

DistributionStatus WrenchDistribution::solve(const Vector6& wrench, double minimalScale) {
  if (std::isfinite(minimalScale) && minimalScale < 0.)
    throwInvalid("minimalScale must be >= 0 N, got ", minimalScale);
  Workspace& work = use();
  DistributionResult& result = work.result;
  result.wrench = wrench;
  result.iterations = 0;
  const Vector6& weights = work.settings;
  result.wrench_weights = weights;
  const double weighted_size = normOf(weighted(weights, wrench));
  work.overall_weight = overallWeight(weights, normOf(wrench), weighted_size);
  const double inverse_weight = 1. / work.overall_weight;
  result.scale = std::max(minimalScale * weights.head<3>().maxCoeff(), weighted_size);
  work.unit = result.scale * inverse_weight;
  work.wrench_weights = weights * inverse_weight;
  work.takeProblem();

  bool answered = false;
  const bool finite = wrench.allFinite() && std::isfinite(minimalScale);
  const bool computable = std::isfinite(work.unit) && std::isfinite(result.scale);
  if (!finite || (!(computable && work.unit > 0.) && !work.hasFiniteMatrices())) {
    result.status = DistributionStatus::InvalidInput;
  } else if (!computable) {  // beyond the largest numbers
    result.status = DistributionStatus::NumericalFailure;
  } else if (work.solved.empty()) {
    const bool zero = weighted_size <= kReach * result.scale;
    result.status = zero ? DistributionStatus::Solved : DistributionStatus::NoContact;
  } else if (!work.has_sets && work.unit == 0.) {
    work.has_answer = false;  // all forces are zero
    result.status = DistributionStatus::Solved;
  } else {
    answered = work.distribute(minimalScale);
  }

  // Multipliers may be beyond the largest numbers where forces are not.
  if (answered && !result.wrench_multipliers.allFinite()) {
    answered = work.has_answer = false;
    result.status = DistributionStatus::NumericalFailure;
  }
  if (answered) {
    work.has_answer = true;
  } else {
    work.keepAnswer();
    work.sumUp();
  }
  return result.status;
}

// What is missing of a weighted wrench at the closest reachable one. False if that fails.
bool WrenchDistribution::Workspace::findDistance(const Vector6& target, Vector6& distance) {
  if (solver.relax(target)) {
    distance = solver.distance();
    return true;
  }
  if (!accurate_solver.relax(target.cast<long double>())) return false;
  distance = accurate_solver.distance().cast<double>();
  return true;
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
    Vector6 distance;
    if (!findDistance(target / target.norm(), distance)) return -1.;
    if (distance.norm() <= kMarginReach) break;
    const double cut = std::max(0., -distance.dot(wrench) / distance.dot(direction));
    if (!(cut < s * (1. - kMarginChange))) break;
    s = cut > kMarginChange ? cut : 0.;
  }
  return s;
}

// The largest s, but for what is above a bound, for which the wrench plus s times a direction is
// reachable, see findBoundary(); what is reachable need not be a cone. From a point far beyond, or
// infinite where all that was looked at is reachable. Negative if it fails.
double WrenchDistribution::Workspace::findBoundaryOfSets(const Vector6& direction, double bound) {
  constexpr double kFarthest = 1e6;  // of the scale
  const double scale = result.scale > 0. ? result.scale : 1.;
  double s = std::isfinite(bound) ? bound : kFarthest * scale;
  const Vector6 start = result.achieved;
  for (int step = 0; step < kMarginSteps && s > 0.; ++step) {
    problem.wrench = start + s * direction;
    const DistributionSolution& solution = sets.solve(problem);
    if (solution.status == DistributionStatus::Solved)
      return step == 0 && !std::isfinite(bound) ? bound : s;
    if (solution.status != DistributionStatus::Relaxed) return -1.;
    // The plane between the point and what is reachable.
    const Vector6 outward = weighted(settings.cwiseAbs2(), solution.residual);
    const double cut =
        std::max(0., outward.dot(solution.achieved - start) / outward.dot(direction));
    if (!(cut < s * (1. - kMarginChange))) break;
    s = cut > kMarginChange * scale ? cut : 0.;
  }
  return s;
}

WrenchMargin WrenchDistribution::computeMargin() {
  Workspace& work = use();
  const DistributionResult& result = work.result;
  WrenchMargin margin;
  if (std::isnan(result.scale) || result.status == DistributionStatus::InvalidInput ||
      result.status == DistributionStatus::NumericalFailure)
    return margin;
  margin.margin = 0.;
  if (result.status == DistributionStatus::Relaxed ||
      result.status == DistributionStatus::NoContact)
    return margin;

  double least = std::numeric_limits<double>::infinity();
  const auto take = [&](double s, int axis, int sign) {
    if (!(s < least)) return;
    least = s;
    margin.axis = axis;
    margin.sign = sign;
  };
  if (work.has_sets) {
    for (int axis = 0; axis < 6; ++axis)
      for (const int sign : {1, -1}) {
        const double s =
            work.findBoundaryOfSets(sign / work.settings[axis] * Vector6::Unit(axis), least);
        if (s < 0.) return WrenchMargin();
        take(s, axis, sign);
      }
    work.sets.forget();
    margin.margin = least;
    return margin;
  }

  Vector6 wrench = weighted(work.wrench_weights, result.achieved);
  if (work.unit > 0.) wrench /= work.unit;
  work.solver.setProblem(result.contacts, work.wrench_weights);
  work.accurate_solver.setProblem(result.contacts, work.wrench_weights);
  for (int axis = 0; axis < 6; ++axis) {
    for (const int sign : {1, -1}) {
      const double s = work.findBoundary(wrench, sign * Vector6::Unit(axis), least);
      if (s < 0.) return WrenchMargin();
      take(s, axis, sign);
    }
  }
  margin.margin = work.unit > 0. ? result.scale * least : least;
  return margin;
}

}  // namespace dynacom
