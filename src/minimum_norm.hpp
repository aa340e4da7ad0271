// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <limits>
#include <vector>

#include "kept_storage.hpp"

namespace dynacom::internal {

/// The point of least norm under linear constraints,
///
///     minimise ½ ‖x‖²   subject to   Eᵀ x = d,   Gᵀ x ≤ h
///
/// by the dual active-set method of Goldfarb and Idnani (Mathematical Programming 27, 1983): from
/// the point of least norm under the equalities alone, one violated inequality after the other is
/// made active, and those whose multiplier would become negative on the way are left.
///
/// Equalities may depend on each other: those that follow from others are left out, and whether
/// they hold is for the caller to see. Nothing is allocated once there was a problem that was as
/// large. Scalar is double or long double.
template <class Scalar>
class MinimumNorm {
 public:
  using Matrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
  using Vector = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;
  using MatrixRef = Eigen::Ref<const Matrix>;
  using VectorRef = Eigen::Ref<const Vector>;
  using KeptVector = Kept<Vector>;

  static constexpr int kMaximalEqualities = 6;

  enum class Status { Solved, Infeasible, IterationLimit };

  /// Gets the storage for problems of these sizes, as solve() does itself.
  void reserve(Eigen::Index n, Eigen::Index p, Eigen::Index m);

  /// Solves the problem.
  /// @param E, d       equalities, n × p and p, with p ≤ kMaximalEqualities; the columns of E have
  ///                   about unit length, or they are zero, up to rounding
  /// @param G, h       inequalities, n × m and m
  /// @param tolerance  by how much Gᵀ x may exceed h
  /// @param dependent  an inequality whose normal has no more than this part outside the span of
  ///                   the active ones follows from them or contradicts them
  /// @param maximal_iterations  after how many to give up
  Status solve(const MatrixRef& E, const VectorRef& d, const MatrixRef& G, const VectorRef& h,
               Scalar tolerance, Scalar dependent,
               int maximal_iterations = std::numeric_limits<int>::max());

  /// The solution, n.
  const KeptVector& x() const { return x_; }
  /// Multipliers of the equalities, p, and of the inequalities, m: x + E y + G z = 0.
  const KeptVector& y() const { return y_; }
  const KeptVector& z() const { return z_; }
  /// The active inequalities.
  const std::vector<Eigen::Index>& active() const { return active_; }
  /// How often an inequality was made active, or left.
  int iterations() const { return iterations_; }

 private:
  void startWithEqualities(const MatrixRef& E, const VectorRef& d);
  void decompose(const MatrixRef& E);
  void completeBasis();
  Status activateViolated(const MatrixRef& G, const VectorRef& h, Scalar tolerance,
                          Scalar dependent, int maximal_iterations);
  template <class Operand>
  void applyQ(Operand& operand);
  Eigen::Index findViolated(const MatrixRef& G, const VectorRef& h, Scalar tolerance);
  void computeDirections(const VectorRef& normal);
  void activate(Eigen::Index inequality, Scalar rhs, Scalar multiplier);
  void leave(Eigen::Index position);
  void computeSolution();
  void readMultipliers();

  // The equalities' normals, as decomposed by Householder reflections: the reflections' vectors and
  // coefficients, and which equalities they are of.
  Kept<Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic, 0, Eigen::Dynamic, kMaximalEqualities>>
      reflectors_;
  std::array<Scalar, kMaximalEqualities> coefficients_;
  std::array<Eigen::Index, kMaximalEqualities> permutation_;
  // J is orthogonal. Its first q columns span the normals N of the active constraints, equalities
  // first: N = J₁ R.
  Kept<Matrix> J_, R_;
  bool complete_ = false;  // whether J has been computed
  Eigen::Index q_ = 0, equalities_ = 0;
  std::vector<Eigen::Index> active_;   // inequalities, in the order of R
  std::vector<Eigen::Index> implied_;  // inequalities that follow from active ones, up to rounding
  int iterations_ = 0;
  KeptVector rhs_;  // of the active constraints, in the order of R
  KeptVector x_, y_, z_;
  KeptVector u_;      // multipliers: x + N u = 0
  KeptVector Jn_;     // Jᵀ times the normal at hand
  KeptVector r_;      // minus the change of u for a unit of the new multiplier
  KeptVector slack_;  // Gᵀ x − h
  KeptVector workspace_;
};

}  // namespace dynacom::internal
