// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <cstring>
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

/// L D Lᵀ of a symmetric positive matrix, of which the lower half is read. Without square roots,
/// and with sizes that the compiler knows, it takes half the time of Eigen's Cholesky
/// decompositions.
class Factors6 {
 public:
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;

  void compute(const Matrix6& matrix);
  Vector6 solve(const Vector6& rhs) const;
  /// The diagonal of D: not positive where the matrix is not.
  const Vector6& pivots() const { return pivots_; }

 private:
  Matrix6 L_ = Matrix6::Identity();
  Vector6 pivots_ = Vector6::Ones(), inverse_pivots_ = Vector6::Ones();
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
/// Newton's method ends at the root as soon as it knows the state of the contacts: which components
/// are at their bounds, and which contacts bear a load.
///
/// It starts from the state of the last answer, or from none at their bounds, where its first step
/// is the closed form for forces without inequalities, simpler still for a sole on its own. At
/// first there is no ε: as long as the state can give all wrenches, a step leads to the multipliers
/// that would be the answer if the state stayed. Where that does not end, ε > 0 makes steps whose
/// length can be chosen so that the dual falls. What is found with ε serves to know the state, and
/// no more: the answer follows from it by linear equations without ε, for both stages, and proves
/// itself. What does not, and what hangs on the last digits, is left to TwoStageSolver.
///
/// Contacts are known by slot. Nothing is allocated but by reserve().
class DualNewton {
 public:
  using Contact = DistributionResult::Contact;
  using Vector6 = DistributionResult::Vector6;

  /// Gets the storage for this many slots.
  void reserve(std::size_t slots);

  /// Takes the inequalities and weights of a slot's contact, of whose state nothing is known then.
  void setContact(std::size_t slot, const Contact& contact);

  /// Says whose contacts take part from now on, in this order.
  void setActive(const std::vector<std::size_t>& slots, const std::vector<Contact>& contacts);

  /// Finds the forces.
  /// @param contacts            those that take part, with the NE of now
  /// @param target              D w over its unit
  /// @param wrench_weights      D over its overall size
  /// @param warm_start          whether to start from the state of the last answer
  /// @param maximal_iterations  after how many to give up
  /// @return Solved, Relaxed, or NumericalFailure where another solver has to be asked
  DistributionStatus solve(const std::vector<Contact>& contacts, const Vector6& target,
                           const Vector6& wrench_weights, bool warm_start, int maximal_iterations);

  /// Writes forces, multipliers and what they amount to into a result with these contacts.
  /// @param unit            newtons in the unit of force
  /// @param overall_weight  the wrench weights over those of solve()
  void writeAnswer(DistributionResult& result, double unit, double overall_weight) const;

  /// Forgets the states of all answers: what comes next is as it would be if there had been none.
  void forget();

  /// How many steps solve() took.
  int iterations() const { return iterations_; }

  /// How many of them were an attempt from the last answer that led nowhere: at most
  /// maximal_iterations, which counts the others on their own, so that a warm start finds whatever
  /// is found without.
  int iterationsInVain() const { return iterations_in_vain_; }

 private:
  using Matrix6 = Factors6::Matrix6;

  /// Whether a contact bears a load, and which of its components are at which bound, ±1.
  struct State {
    bool loaded = false;
    std::array<signed char, 8> bounds = {};  // as many as compare at once

    bool hasBounds(const State& other) const {
      std::uint64_t mine, others;  // compilers call a function to compare the arrays
      std::memcpy(&mine, bounds.data(), sizeof mine);
      std::memcpy(&others, other.bounds.data(), sizeof others);
      return mine == others;
    }
    bool operator==(const State& other) const {
      return loaded == other.loaded && (!loaded || hasBounds(other));
    }
  };

  /// Where to start from: no component at its bound but for those that are always zero, or the
  /// state that led to the last answer.
  enum class Start { Free, LastAnswer };

  /// A contact in units of its cost: its forces are x = W λ, with W the weights over the largest.
  /// What a point does not have is zero.
  struct Block {
    BoxCone cone;
    bool is_box;
    double largest_weight;             // of the contact
    Vector6 weights, inverse_weights;  // W
    Vector6 betas;                     // of x
    Vector6 reaches;                   // by which components are free; ∞ without extent
    Matrix6 e;                         // D NE W⁻¹
    bool has_pure_moments;             // whether the moments give no force
    // The state with no component at its bound, but for those without extent; that at hand, and at
    // the last keepStates(); and the one that led to the last answer.
    State free, state, former, last;
    std::size_t last_problem_number;  // of that it took part in, when it did not any more
    // In this state, forces that respond to a pull are its projection on the free components, and
    // on the direction in which those at their bounds go with the normal force.
    Vector6 is_free, edge;
    double inverse_stiffness;                // 1 / ‖edge‖²
    Vector6 normal_wrench, normal_response;  // e edge, and the same over the stiffness
    // Of the multipliers at hand: eᵀ ν, x(ν).
    Vector6 pull, force;
    // Of provesItself().
    Vector6 pull_of_distance, terms;
  };

  void forget(Block& block);
  static void enter(Block& block, const State& state);
  template <int kSize>
  static State findState(const Block& block);
  static bool isInside(const Block& block, const Vector6& force);
  static Vector6 respond(const Block& block, const Vector6& pull);
  static Vector6 pullOf(const Block& block, const Vector6& multipliers);
  static void addWrench(const Block& block, const Vector6& force, Vector6& wrench);
  static Vector6 normalWrench(const Block& block);
  bool begin(Start start);
  void keepStates();
  bool evaluate();
  void restart(const Vector6& multipliers);
  void correct(const Vector6& change);
  void assembleCompliance();
  bool hasFullRank() const;
  bool isReached(const Vector6& wrench, double enough) const;
  void refine(const Vector6& wrench, double enough);
  bool isFinite() const;
  int stepsTaken() const { return iterations_ - iterations_in_vain_; }
  bool stepAsSole();
  bool stepFreely(int steps);
  bool stepWithSlack();
  DistributionStatus search(bool from_last_answer);
  void settle();
  bool findRange();
  Vector6 projectOnRange(const Vector6& wrench) const;
  Vector6 solveRange(const Vector6& wrench) const;
  DistributionStatus finish();
  bool provesItself();

  std::vector<Block> blocks_;        // by slot
  std::vector<std::size_t> active_;  // slots
  bool recognised_ = false;          // whether all active cones are boxes
  bool has_answer_ = false;          // whether the last solve() had one
  bool finished_ = false;            // and whether by finish()
  double largest_weight_ = 0.;       // of the active contacts
  Vector6 weights_ = Vector6::Ones(), target_ = Vector6::Zero();
  Vector6 multipliers_ = Vector6::Zero(), achieved_ = Vector6::Zero();
  Vector6 missing_ = Vector6::Zero();  // of the closest wrench
  double slack_ = 0.;                  // ε
  Matrix6 compliance_ = Matrix6::Zero();
  Factors6 factors_;
  int rank_ = 6;
  Matrix6 range_ = Matrix6::Zero();
  std::vector<Vector6> directions_;
  int iterations_ = 0, iterations_in_vain_ = 0, maximal_iterations_ = 0;
  std::size_t problem_number_ = 0;  // counts solve()
};

}  // namespace dynacom::internal
