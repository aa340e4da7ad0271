// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <iosfwd>
#include <memory>

#include "dynacom/contact_base.hpp"

namespace dynacom {

/// How a distribution ended.
enum class DistributionStatus {
  /// The forces sum to the wrench, respect every inequality, and are the cheapest that do.
  Solved,
  /// No forces within the inequalities sum to the wrench. The forces are zero.
  Infeasible,
  /// There is no contact to give a force.
  NoContact,
  /// A number was not finite, the iterations were used up, or the solver's answer did not pass the
  /// check. The forces are zero.
  NumericalFailure,
};

/// The value's name, as written above.
DYNACOM_EXPORT const char* to_string(DistributionStatus status);
DYNACOM_EXPORT std::ostream& operator<<(std::ostream& out, DistributionStatus status);

/// How contacts share a wrench: the quadratic program of equations (9–13),
///
///     minimise ½ Σ (wᵢ λᵢ)²   subject to   U λ ≤ u,   C λ ≤ c,   NE λ = w
///
/// Usage: clear(), add() every contact, solve(), forces(). What is added is copied; nothing is
/// allocated once a problem of the same sizes has been solved.
class DYNACOM_EXPORT WrenchDistribution {
 public:
  WrenchDistribution();
  WrenchDistribution(const WrenchDistribution& other);
  WrenchDistribution(WrenchDistribution&&) noexcept;
  WrenchDistribution& operator=(WrenchDistribution other) noexcept;
  ~WrenchDistribution();

  /// Begins a new problem, without contacts.
  void clear();

  /// Adds a contact, with the matrices that it has now; its force takes the next cols() components
  /// of forces().
  /// @throws std::invalid_argument if the contact was never initialised
  void add(const ContactBase& contact);

  /// Solves for the forces that give a wrench.
  /// @param wrench        (force [N], moment [N·m]) about the CoM, world axes
  /// @param minimalScale  tolerances are relative to the norm of the wrench, but at least to this,
  ///                      ≥ 0 [N]: the robot's weight, say, so that a free fall, where the wrench
  ///                      is all rounding, is one
  DistributionStatus solve(const Eigen::Matrix<double, 6, 1>& wrench, double minimalScale = 0.);

  /// The forces λ of all contacts, in the order of add(), each in its surface's frame; zero unless
  /// solve() returned DistributionStatus::Solved.
  const Eigen::VectorXd& forces() const;

 private:
  struct Workspace;
  std::unique_ptr<Workspace> work_;
};

}  // namespace dynacom
