// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <iosfwd>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "dynacom/contact_base.hpp"
#include "dynacom/distribution_status.hpp"

namespace dynacom {

/// What a distribution was asked, and what it answered.
///
/// Wrenches w are (force [N], moment [N·m]) about the CoM in the world's axes; their size is the
/// norm ‖D w‖ with D = diag(wrench_weights). Before the first solve() numbers are NaN. Where there
/// is no answer, multipliers are zero, and `achieved` and `cost` are those of the forces that stay.
struct DYNACOM_EXPORT DistributionResult {
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  /// One contact's share of the problem, and of the answer.
  struct Contact {
    Eigen::MatrixXd A;        ///< its inequalities A λ ≤ 0: unilaterality, then friction; m × n
    Eigen::VectorXd weights;  ///< wᵢ of the cost ½ Σ (wᵢ λᵢ)², n
    Eigen::Matrix<double, 6, Eigen::Dynamic> NE;  ///< takes λ to the wrench about the CoM, 6 × n
    Eigen::VectorXd force;                        ///< λ, in the surface's frame, n
    /// Which inequalities the answer was found with as equations, m. Others may be equations, too,
    /// where more meet than are needed.
    Eigen::Array<bool, Eigen::Dynamic, 1> active;
    /// The contact's set, where some contacts are more than A λ ≤ 0; then inequalities have no
    /// multipliers, and none is active: isOptimal() asks the sets.
    std::optional<ContactSet> set;
    Eigen::VectorXd reference;  ///< λ₀ of the cost ½ Σ (wᵢ (λ − λ₀)ᵢ)², n
    /// Multipliers μ of the inequalities in the minimum of the cost, m: zero where one is not
    /// active; ≥ 0, but for those that the relaxation multiplies, which are equations there.
    Eigen::VectorXd multipliers;
    /// Multipliers μ' ≥ 0 of the inequalities in the relaxation, m: where one is positive, all
    /// forces that come as close to the wrench lie on that inequality's bound. Zero where no
    /// relaxation was needed. Below 1e-10 of the distance, or 1e-14 of the scale, it is rounding.
    Eigen::VectorXd relaxation_multipliers;
  };

  static constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

  DistributionStatus status = DistributionStatus::NoContact;
  Vector6 wrench = Vector6::Constant(kNaN);    ///< what was asked for
  Vector6 achieved = Vector6::Constant(kNaN);  ///< what the forces give, Σ NE λ
  Vector6 residual = Vector6::Constant(kNaN);  ///< wrench − achieved
  Vector6 wrench_weights = Vector6::Ones();    ///< D
  double scale = kNaN;                         ///< of ‖D w‖, what tolerances are relative to
  double cost = kNaN;                          ///< ½ Σ (wᵢ λᵢ)²
  int iterations = 0;  ///< of all solvers that were asked, at most as many as are allowed
  std::vector<Contact> contacts;  ///< in the order of WrenchDistribution::add()
  /// Multipliers ν of NE λ = achieved in the minimum of the cost: W² λ = NEᵀ ν − Aᵀ μ.
  Vector6 wrench_multipliers = Vector6::Constant(kNaN);

  /// The forces λ of all contacts, one behind the other.
  Eigen::VectorXd forces() const;

  /// Whether the answer is optimal, judged by what stands in this result alone: the forces respect
  /// the inequalities; they are the cheapest that give the achieved wrench (stationarity, signs and
  /// complementarity of ν and μ); and the residual r is none, or it is orthogonal to what is
  /// achieved and in the polar of the cone of wrenches that the contacts can give,
  /// NEᵀ D² r = Aᵀ μ' with μ' ≥ 0, so that no reachable wrench is closer.
  /// @param tolerance  of each of these, relative to the terms that it compares
  /// @return false for InvalidInput and NumericalFailure, and before the first solve()
  bool isOptimal(double tolerance = 1e-6) const;
};

/// How far a wrench is from what the contacts cannot give.
struct DYNACOM_EXPORT WrenchMargin {
  /// The largest s for which the wrench stays within reach when s, divided by the axis's wrench
  /// weight, is added to or taken from any one of its components [N]. 0 if it is out of reach or
  /// the contacts cannot give some component at all; infinite if they can give any wrench; NaN if
  /// there is no answer (InvalidInput, NumericalFailure).
  double margin = std::numeric_limits<double>::quiet_NaN();
  /// The component that gives way first, 0 … 5, and the sign of what is added to it; −1 and 0 where
  /// the margin is infinite or NaN, or the wrench out of reach.
  int axis = -1;
  int sign = 0;
};

/// How contacts share a wrench: the quadratic program of equations (9–13),
///
///     minimise ½ Σ (wᵢ λᵢ)²   subject to   U λ ≤ 0,   C λ ≤ 0,   NE λ = w
///
/// and where no forces do that, in two stages: first the reachable wrench closest to w in the norm
/// ‖D w‖, then the cheapest forces that give it.
///
/// Usage: clear(), add() every contact, solve(), result(). What is added is copied.
///
/// Contacts are held in slots, numbered from 0 on. What is kept from one problem to the next is
/// kept by slot: storage, so that nothing is allocated for contacts that were reserved or have been
/// part of a problem before.
class DYNACOM_EXPORT WrenchDistribution {
 public:
  using Vector6 = DistributionResult::Vector6;

  /// How many iterations solve() may take unless setMaximalIterations() says otherwise: more than
  /// any random problem has taken. For those who can wait; a controller sets less.
  static constexpr int kMaximalIterations = 100000;

  /// One that was moved from is as new; storage, which moving does not take, it gets at its next
  /// use.
  WrenchDistribution();
  WrenchDistribution(const WrenchDistribution& other);
  WrenchDistribution(WrenchDistribution&&) noexcept;
  WrenchDistribution& operator=(WrenchDistribution other) noexcept;
  ~WrenchDistribution();

  /// Weights D of the norm in which the closest wrench is the closest: three of the force, three of
  /// the moment [1/m]. All 1 by default: 1 for forces, 1/ℓ for moments with ℓ = 1 m. Their common
  /// factor means nothing; apart by more than about 1e4, some wrenches out of reach end as
  /// DistributionStatus::NumericalFailure, and computeMargin() may be wrong.
  /// @throws std::invalid_argument unless all are finite and > 0
  void setWrenchWeights(const Vector6& weights);
  const Vector6& getWrenchWeights() const;

  /// Whether solve() starts from the multipliers of the last answer, as is the default, as long as
  /// contacts are the same but for where they are. That changes how long it takes, and answers by
  /// no more than rounding.
  void setWarmStart(bool warmStart);
  bool getWarmStart() const;

  /// How many iterations solve() may take, kMaximalIterations by default: those of
  /// DistributionResult::iterations. Of feet on level ground nearly all problems take less than 10;
  /// a problem that needs more than this ends as DistributionStatus::NumericalFailure. A controller
  /// sets 50, or what docs/real_time.md says of the time that it has. A warm start finds its answer
  /// within the same number as a cold one: iterations that it takes in vain come on top.
  /// @throws std::invalid_argument unless maximalIterations > 0
  void setMaximalIterations(int maximalIterations);
  int getMaximalIterations() const;

  /// Gets a slot's storage ready for a contact, so that a problem with it allocates nothing,
  /// whichever of the other slots take part.
  /// @param slot  at most the number of slots so far: that of the first new one
  /// @throws std::invalid_argument if the contact was never initialised, or the slot is beyond that
  ///         or taken by what was added since clear()
  void reserve(const ContactBase& contact, std::size_t slot);

  /// Forgets contacts, slots, and the answer; weights and settings stay.
  void reset();

  /// Begins a new problem, without contacts. If what is added next has the slots, inequalities and
  /// weights of before, a solve() without an answer keeps the forces of before.
  void clear();

  /// Adds a contact, with the matrices that it has now, in the slot of its position.
  /// @throws std::invalid_argument if the contact was never initialised, the slot is taken, or one
  ///         of the contacts is described by its matrices alone, ContactBase::getSet(), and another
  ///         is more than a pyramid, ContactBase::isPyramid(); NotReadyError if it was never placed
  ///         by updateNewtonEuler()
  void add(const ContactBase& contact);

  /// The same in another slot, as in reserve(), for contacts that are not always the same ones.
  void add(const ContactBase& contact, std::size_t slot);

  /// Adds a contact by its matrices, in the slot of its position.
  /// @param A        inequalities A λ ≤ 0, m × n
  /// @param weights  wᵢ > 0 of the cost, n
  /// @param NE       takes λ to the wrench about the CoM, 6 × n
  /// @throws std::invalid_argument if the sizes do not fit, n is 0, A is not finite, a weight is
  ///         not finite and > 0, the slot is taken, or another contact is more than a pyramid
  void add(const Eigen::Ref<const Eigen::MatrixXd>& A,
           const Eigen::Ref<const Eigen::VectorXd>& weights,
           const Eigen::Ref<const Eigen::Matrix<double, 6, Eigen::Dynamic>>& NE);

  /// Solves for the forces that give a wrench, or the closest to it.
  /// @param wrench        (force [N], moment [N·m]) about the CoM, world axes
  /// @param minimalScale  the scale, which tolerances are relative to, is ‖D w‖, but at least that
  ///                      of a force of this size, ≥ 0 [N]: the robot's weight, say, so that a free
  ///                      fall, where the wrench is all rounding, is one
  /// @throws std::invalid_argument if minimalScale is negative
  DistributionStatus solve(const Vector6& wrench, double minimalScale = 0.);

  /// The last solve()'s answer.
  const DistributionResult& result() const;

  /// Forgets all answers: the next solve() starts from no inequality, and without an answer its
  /// forces are zero. What comes then does not depend on what was before.
  void forgetAnswers();

  /// Forgets the forces that a solve() without an answer would keep: until there is one again, they
  /// are zero. For contacts that are others than before, but have the same matrices.
  void forgetForces();

  /// How far the last solve()'s wrench is from what the contacts cannot give: up to twelve small
  /// problems, too much for a control loop.
  WrenchMargin computeMargin();

 private:
  struct Workspace;

  Workspace& use();
  const Workspace& look() const;

  std::unique_ptr<Workspace> work_;  // null after a move
};

}  // namespace dynacom
