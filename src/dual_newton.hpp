// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "dynacom/wrench_distribution.hpp"

namespace dynacom::internal {

/// A cone of contact forces that is a box whose size grows with the normal force: |λᵢ| ≤ βᵢ λ_z for
/// all components but the third, λ_z, and λ_z ≥ 0. Points and soles are such.
struct BoxCone {
  static constexpr int kNormal = 2;

  /// The rows of A λ ≤ 0 that bound a component from both sides.
  struct Side {
    double beta = 0.;
    std::array<Eigen::Index, 2> rows = {-1, -1};  // λᵢ ≤ βᵢ λ_z, −λᵢ ≤ βᵢ λ_z
    std::array<double, 2> factors = {0., 0.};     // of λᵢ there, without sign
  };

  /// The cone A λ ≤ 0 with 3 or 6 components, or nothing if it is of another kind.
  static std::optional<BoxCone> recognise(const Eigen::MatrixXd& A);

  int size = 0;
  std::array<Side, 6> sides;  // that of the normal component is not used
  Eigen::Index normal_row = -1;
  double normal_factor = 0.;
};

/// Both stages of a wrench distribution over contacts whose cones are boxes, by Newton's method on
/// the dual of
///
///     minimise ½ ‖W λ‖² + ½ ‖r‖² / ε   subject to   e λ + r = w,   λ in the cones
///
/// with e = D NE and w weighted by D, both over their units. For the six multipliers ν = r / ε of
/// the wrench, each contact's forces λ(ν) are the minimum of ½ ‖W λ‖² − νᵀ e λ in its cone: in
/// closed form, component by component once λ_z is known, which is the root of a function that
/// rises along straight lines. The dual's gradient e λ(ν) + ε ν − w is piecewise linear, so that
/// Newton's method ends at the root as soon as it knows which components are at their bounds, and
/// which contacts bear a load. With all components free, its first step is the closed form for
/// forces without inequalities.
///
/// What is found with ε serves to know that, and no more: the answer follows from it by linear
/// equations without ε, for both stages, and proves itself. What does not, and what hangs on the
/// last digits, is left to TwoStageSolver.
class DualNewton {
 public:
  using Contact = DistributionResult::Contact;
  using Vector6 = DistributionResult::Vector6;

  /// Takes the contacts' inequalities and weights.
  void setContacts(const std::vector<Contact>& contacts);

  /// Finds the forces.
  /// @param contacts         those of setContacts(), with the NE of now
  /// @param wrench           w over the unit of force, not weighted
  /// @param wrench_weights   D over its overall size
  /// @return Solved, Relaxed, or NumericalFailure where another solver has to be asked
  DistributionStatus solve(const std::vector<Contact>& contacts, const Vector6& wrench,
                           const Vector6& wrench_weights);

  /// Writes forces and multipliers of solve() into a result with these contacts.
  /// @param unit            newtons in the unit of force
  /// @param overall_weight  the wrench weights over those of solve()
  void writeAnswer(DistributionResult& result, double unit, double overall_weight) const;

  /// How many steps solve() took.
  int iterations() const { return iterations_; }

 private:
  using Matrix6 = Eigen::Matrix<double, 6, 6>;

  /// Whether a contact bears a load, and which of its components are at which bound, ±1.
  struct State {
    bool loaded = false;
    std::array<signed char, 6> bounds = {};

    bool operator!=(const State& other) const {
      return loaded != other.loaded || (loaded && bounds != other.bounds);
    }
  };

  /// A contact in units of its cost: its forces are x = W λ, with W the weights over the largest.
  struct Block {
    BoxCone cone;
    Vector6 weights;  // W
    Vector6 betas;    // of x
    Matrix6 e;        // D NE W⁻¹, and zeros
    // Of the multipliers at hand: eᵀ ν, x(ν), whether there is a load, and which components are at
    // which bound.
    Vector6 pull, force;
    State state, former, free;
    double stiffness = 0.;
    Vector6 pull_of_distance, terms;  // of provesItself()
  };

  void release();
  static void project(Block& block);
  static void computeStiffness(Block& block);
  static Vector6 respond(const Block& block, const Vector6& pull);
  static Vector6 normalDirection(const Block& block);
  bool evaluate();
  void restart(const Vector6& multipliers);
  void correct(const Vector6& change);
  void assembleCompliance();
  bool solveFreely();
  bool hasFullRank() const;
  void refine(const Vector6& wrench, double enough);
  bool findState();
  bool findRange();
  Vector6 solveRange(const Vector6& wrench) const;
  DistributionStatus finish();
  bool provesItself();

  std::vector<Block> blocks_;
  bool recognised_ = false;
  double largest_weight_ = 0.;
  Vector6 weights_ = Vector6::Ones(), target_ = Vector6::Zero();
  Vector6 multipliers_ = Vector6::Zero(), achieved_ = Vector6::Zero();
  Vector6 missing_ = Vector6::Zero();  // of the closest wrench
  double slack_ = 0.;                  // ε
  Matrix6 compliance_ = Matrix6::Zero();
  Eigen::LLT<Matrix6> factors_;
  int rank_ = 6;
  Matrix6 range_ = Matrix6::Zero();
  std::vector<Vector6> directions_;
  int iterations_ = 0;
};

}  // namespace dynacom::internal
