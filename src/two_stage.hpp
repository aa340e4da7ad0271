// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dynacom/wrench_distribution.hpp"
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
/// Nothing is allocated once a problem of the same sizes was solved.
template <class Scalar>
class TwoStageSolver {
 public:
  using Vector6 = Eigen::Matrix<Scalar, 6, 1>;
  using Vector = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;

  /// Takes the contacts' matrices and the wrench weights, the latter over their overall size, and
  /// gets storage.
  void setProblem(const std::vector<DistributionResult::Contact>& contacts,
                  const DistributionResult::Vector6& weights);

  /// Finds the forces for a wrench.
  /// @return Solved, Relaxed or NumericalFailure
  DistributionStatus solve(const Vector6& wrench);

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

  /// How often the active set has changed in the last solve().
  int iterations() const { return iterations_; }

 private:
  using Matrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
  using Solver = MinimumNorm<Scalar>;
  using Status = typename Solver::Status;

  struct Contact {
    Matrix A;
    Vector weights;
    Eigen::Matrix<Scalar, 6, Eigen::Dynamic> NE;
  };

  /// The contacts side by side, as a problem of least norm. Its variable begins with slacks, if
  /// there are any, and goes on with the forces λ, each times its scale; the columns of E are the
  /// rows of NE over the scales, at unit length, those of G the rows of A over the scales.
  struct Program {
    Vector scales;  // n
    Matrix E, G;
    Vector6 norms;  // of the columns of E before
    Vector d, h;
    Solver solver;
  };

  void reserve();
  void assemble(Program& program, const Vector6& row_weights, Scalar slack);
  void assembleCheapest(Program& program, Scalar slack);
  void assembleClosest(Scalar proximity);
  bool minimizeCost(const Vector6& wrench, Scalar dependent, Scalar inequality);
  bool minimizeCostOnFace(const Vector6& wrench, Scalar tolerance);
  void extrapolate();
  Vector6 giveScaled(const Vector& forces) const;
  void restrictToFace();
  bool passesCheck(const Vector6& wrench, Scalar reach, Scalar inequality) const;
  Vector6 give(const Vector& forces) const;

  std::vector<Contact> contacts_;
  Vector6 weights_ = Vector6::Ones();
  Eigen::Index n_ = 0, m_ = 0;  // components of λ, inequalities
  Scalar largest_weight_ = 0;   // of the contacts
  Program direct_, slackened_;  // without and with slacks
  int iterations_ = 0;
  Vector lambda_;                  // the forces at hand
  Vector scaled_, change_;         // of relax(): forces times their scales, and the last step
  Vector6 distance_;               // of relax(): D (w − NE λ)
  Vector relaxation_multipliers_;  // of relax()
  bool on_face_ = false;           // whether the forces are those of minimizeCostOnFace()
  // Of restrictToFace(), contact by contact along the diagonals: a basis for x of the cheapest
  // forces, its first vectors times R are the normals of inequalities that are equations there; and
  // which inequality that is, or −1 for the other vectors. Before it has been called, there are
  // none of the former.
  Matrix face_, R_;
  Eigen::Array<Eigen::Index, Eigen::Dynamic, 1> held_;
  // Of writeAnswer().
  Vector multipliers_, gradient_, products_;
  Eigen::Array<bool, Eigen::Dynamic, 1> active_;
};

}  // namespace dynacom::internal
