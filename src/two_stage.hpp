// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dynacom/wrench_distribution.hpp"
#include "kept_storage.hpp"
#include "minimum_norm.hpp"

namespace dynacom::internal {

// A wrench no farther than this from what the contacts can give, over its own size, is within
// reach.
constexpr double kReach = 1e-8;
// Where the first stage multiplies an inequality by less than this part of the distance, it is
// rounding.
constexpr double kMultiplied = 1e-10;

/// The two stages of a wrench distribution, robust rather than fast: the reachable wrench closest
/// to the one that is asked for, then the cheapest forces that give it.
///
/// Everything in here is over a unit of force: wrenches, forces and multipliers are those of a
/// problem whose weighted wrench has about unit size. Scalar is double or long double: with the
/// latter, all that is rounding is smaller by three digits.
///
/// Nothing is allocated once there was a problem that was as large, contact by contact.
template <class Scalar>
class TwoStageSolver {
 public:
  using Vector6 = Eigen::Matrix<Scalar, 6, 1>;
  using Vector = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;

  /// Gets the storage for any problem of so many contacts, with so many rows of A and columns each
  /// and all together.
  void reserve(std::size_t contacts, Eigen::Index rows, Eigen::Index cols, Eigen::Index all_rows,
               Eigen::Index all_cols);

  /// Takes the contacts' matrices and the wrench weights, the latter over their overall size.
  void setProblem(const std::vector<DistributionResult::Contact>& contacts,
                  const DistributionResult::Vector6& weights);

  /// Finds the forces for a wrench.
  /// @param maximal_iterations  after how many to give up
  /// @return Solved, Relaxed or NumericalFailure
  DistributionStatus solve(const Vector6& wrench, int maximal_iterations);

  /// The first stage alone: finds the reachable wrench closest to a target, which is weighted.
  /// @return false if it fails
  bool relax(const Vector6& target);

  /// The target of relax() less the closest reachable wrench, weighted.
  const Vector6& distance() const { return distance_; }

  /// Writes forces and multipliers of solve() into a result with the contacts of setProblem().
  /// @param unit            newtons in the unit of force
  /// @param overall_weight  the wrench weights over those of setProblem()
  void writeAnswer(DistributionResult& result, double unit, double overall_weight);

  /// Whether the answer of solve() may have lost digits: the wrench is next to the boundary of what
  /// is reachable, but not on it, or forces cancel out that are much larger than the wrench.
  bool hasFewDigits() const;

  /// How many problems of least norm the last solve() has solved, and how often their active sets
  /// have changed.
  int iterations() const { return iterations_; }

 private:
  using KeptMatrix = Kept<Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>>;
  using KeptVector = Kept<Vector>;
  using Solver = MinimumNorm<Scalar>;
  using Status = typename Solver::Status;

  struct Contact {
    KeptMatrix A;
    KeptVector weights;
    Kept<Eigen::Matrix<Scalar, 6, Eigen::Dynamic>> NE;
  };

  /// The contacts side by side, as a problem of least norm. Its variable begins with slacks, if
  /// there are any, and goes on with the forces λ, each times its scale; the columns of E are the
  /// rows of NE over the scales, at unit length, those of G the rows of A over the scales.
  struct Program {
    KeptVector scales;  // n
    KeptMatrix E, G;
    Vector6 norms;  // of the columns of E before
    KeptVector d, h;
    Solver solver;
  };

  void resize();
  bool findClosest(const Vector6& target);
  Status minimizeNorm(Program& program, Scalar tolerance, Scalar dependent);
  void assemble(Program& program, const Vector6& row_weights, Scalar slack);
  void assembleCheapest(Program& program, Scalar slack);
  void assembleClosest(Scalar proximity);
  bool minimizeCost(const Vector6& wrench, Scalar dependent, Scalar inequality);
  bool minimizeCostOnFace(const Vector6& wrench, Scalar tolerance);
  void extrapolate();
  Vector6 giveScaled(const KeptVector& forces) const;
  Scalar findLeastMultiplier() const;
  void restrictToFace();
  bool passesCheck(const Vector6& wrench, Scalar reach, Scalar inequality) const;
  Vector6 give(const KeptVector& forces) const;

  KeptList<Contact> contacts_;
  Vector6 weights_ = Vector6::Ones();
  Eigen::Index n_ = 0, m_ = 0;  // components of λ, inequalities
  Scalar largest_weight_ = 0;   // of the contacts
  Program direct_, slackened_;  // without and with slacks
  int iterations_ = 0, maximal_iterations_ = 0;
  KeptVector lambda_;                  // the forces at hand
  KeptVector scaled_, change_;         // of relax(): forces times their scales, and the last step
  Vector6 distance_;                   // of relax(): D (w − NE λ)
  KeptVector relaxation_multipliers_;  // of relax()
  bool on_face_ = false;               // whether the forces are those of minimizeCostOnFace()
  // Of restrictToFace(), contact by contact along the diagonals: a basis for x of the cheapest
  // forces, its first vectors times R are the normals of inequalities that are equations there; and
  // which inequality that is, or −1 for the other vectors. Before it has been called, there are
  // none of the former.
  KeptMatrix face_, R_;
  Kept<Eigen::Array<Eigen::Index, Eigen::Dynamic, 1>> held_;
  // Of writeAnswer().
  KeptVector multipliers_, gradient_, products_;
  Kept<Eigen::Array<bool, Eigen::Dynamic, 1>> active_;
};

}  // namespace dynacom::internal
