// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "dynacom/contact_set.hpp"
#include "dynacom/distribution_status.hpp"
#include "dynacom/export.hpp"

namespace dynacom {

/// How contacts are to share a wrench: the forces λ_k of all contacts that
///
///     minimise ½ Σ ‖W_k (λ_k − λ₀_k)‖²   subject to   Σ NE_k λ_k = w,   λ_k ∈ S_k
///
/// and where none do that, in two stages: first the reachable wrench closest to w in the norm
/// ‖D w‖, then the cheapest forces that give it. Wrenches are (force [N], moment [N·m]) about the
/// CoM in the world's axes, forces λ_k in the frame of the contact's surface.
struct DYNACOM_EXPORT DistributionProblem {
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  /// Of three components or six, which allocates nothing.
  using Components = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 6, 1>;

  struct DYNACOM_EXPORT Contact {
    ContactSet set;  ///< S
    /// Of the surface, in the world; its columns are the surface's axes.
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    Eigen::Vector3d lever = Eigen::Vector3d::Zero();  ///< from the CoM to the surface's origin [m]
    Components weights;    ///< the diagonal of W, > 0, set.size(); 1 if empty
    Components reference;  ///< λ₀, set.size(); 0 if empty

    /// @param prefix  of names in messages
    /// @throws std::invalid_argument naming what is not finite, or of another size or range
    void validate(const std::string& prefix = "") const;
    /// Takes λ to the wrench about the CoM: [R 0; [p]×R R], of points its first three columns.
    Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, 6> NE() const;
  };

  std::vector<Contact> contacts;
  Vector6 wrench = Vector6::Zero();          ///< w
  Vector6 wrench_weights = Vector6::Ones();  ///< the diagonal of D, > 0
  /// Tolerances are relative to ‖D w‖, but at least to that of a force of this size, ≥ 0 [N].
  double minimal_scale = 0.;

  /// @throws std::invalid_argument naming what is not finite, or of another size or range
  void validate() const;
  /// What tolerances are relative to.
  double scale() const;
};

/// The answer, and with its problem its proof.
struct DYNACOM_EXPORT DistributionSolution {
  using Vector6 = DistributionProblem::Vector6;

  DistributionStatus status = DistributionStatus::NoContact;
  std::vector<DistributionProblem::Components> forces;  ///< λ of each contact
  Vector6 achieved = Vector6::Zero();                   ///< Σ NE λ
  Vector6 residual = Vector6::Zero();                   ///< w − achieved
  double cost = 0.;                                     ///< ½ Σ ‖W (λ − λ₀)‖²
  /// ν of NE λ = achieved in the minimum of the cost: each λ is the projection of λ₀ + W⁻² NEᵀ ν,
  /// in the metric of W, on its set, or where the wrench is out of reach, on the face of that in
  /// which NEᵀ D² residual · λ is largest. It may be so by less than the tolerance that makes it
  /// Solved: then ν would grow without limit.
  Vector6 multipliers = Vector6::Zero();
  /// Of each contact and component the bound that it is at, −1 or 1, or 0: of f_z its own bounds,
  /// of others those that grow with it. Of sections that are no rectangles both components are 1 on
  /// the boundary. There, W² (λ − λ₀) − NEᵀ ν is what the bounds push with.
  std::vector<Eigen::Matrix<signed char, 6, 1>> bounds;
  int iterations = 0;  ///< steps of Newton's method
  /// How many of these were tried from the last answer, and led nowhere: the others are what a
  /// search without it takes.
  int iterations_in_vain = 0;
  /// Whether the answer has all digits that doubles have: not where only the proximal point method
  /// has led to it, and, of Relaxed ones, next to the boundary and where rounding decides what the
  /// residual exposes.
  bool is_accurate = false;
  /// Whether it has all digits but for how close the boundary is, too: its faces are known for
  /// sure, and the forces on them, but of the residual not more digits than it is large.
  bool is_clear = false;

  /// Whether this is the answer to a problem, judged by nothing but both: forces in their sets; no
  /// reachable wrench closer (the support functions of the sets in the direction of the residual
  /// are reached); and no cheaper forces (a variational inequality on the faces, by ν).
  /// @param tolerance  of each of these, relative to the terms that it compares
  /// @return false for InvalidInput and NumericalFailure
  bool isOptimal(const DistributionProblem& problem, double tolerance = 1e-6) const;
};

/// Solves such problems: Newton's method on the dual in the six multipliers of the wrench (see
/// docs/algorithm.md).
///
/// Nothing is allocated for problems that are no larger than one before, contact by contact.
class DYNACOM_EXPORT DistributionSolver {
 public:
  DistributionSolver();
  DistributionSolver(const DistributionSolver& other);
  DistributionSolver(DistributionSolver&& other) noexcept;
  DistributionSolver& operator=(DistributionSolver other) noexcept;
  ~DistributionSolver();

  /// How many steps of Newton's method a problem may take unless setMaximalIterations() says
  /// otherwise; those that are tried from the last answer, as many at most, come on top.
  static constexpr int kMaximalIterations = 100000;

  /// @throws std::invalid_argument unless > 0
  void setMaximalIterations(int maximal_iterations);

  /// Whether the search begins with the multipliers of the last answer, as is the default, if it
  /// was for as many contacts.
  void setWarmStart(bool warm_start);

  /// Gets storage for problems of so many contacts.
  void reserve(std::size_t contacts);

  /// Forgets the last answer: what comes next does not depend on it.
  void forget();

  /// @param problem  whose validate() would not throw; that is not looked at here
  /// @return the answer, until the next call; InvalidInput if a wrench or a placement is not finite
  const DistributionSolution& solve(const DistributionProblem& problem);

  /// The same for a problem that differs from that of the last solve() in rotations, levers, the
  /// wrench, its weights and minimal_scale alone: nothing else of contacts is looked at again.
  /// @throws std::invalid_argument if the contacts are more or fewer, or have other sizes
  const DistributionSolution& solveMoved(const DistributionProblem& problem);

  /// What the last of these has returned.
  const DistributionSolution& solution() const;

 private:
  struct Workspace;
  std::unique_ptr<Workspace> work_;
};

}  // namespace dynacom
