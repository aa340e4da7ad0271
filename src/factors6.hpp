// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <type_traits>
#include <utility>

#include "pair.hpp"

namespace dynacom::internal {

// Calls a function with 0, 1, ... 5, which the compiler knows.
template <class Function, int... Indices>
inline void unroll(Function function, std::integer_sequence<int, Indices...>) {
  (function(std::integral_constant<int, Indices>()), ...);
}
template <class Function>
inline void unroll6(Function function) {
  unroll(function, std::make_integer_sequence<int, 6>());
}

/// The lower half of a sum Σ a aᵀ: as pairs of rows, which all fit in registers, and of which some
/// have one from the upper half.
class SumOfSquares6 {
 public:
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;

  /// Adds a aᵀ of a vector whose components before `first`, 0 or 3, are zero.
  template <int first = 0>
  void add(const Vector6& a) {
    const Pair rows[3] = {loadPair(&a[0]), loadPair(&a[2]), loadPair(&a[4])};
    unroll6([&](auto column) {
      constexpr int j = column;
      if constexpr (j >= first)
        for (int pair = j / 2; pair < 3; ++pair) pairs_[3 * j + pair] += a[j] * rows[pair];
    });
  }

  /// The sum, and zeros above it, but for what is in pairs.
  Matrix6 toMatrix() const {
    Matrix6 matrix;
    for (int k = 0; k < 18; ++k) storePair(pairs_[k], matrix.data() + 2 * k);
    return matrix;
  }

 private:
  Pair pairs_[18] = {};  // column by column
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

// Column by column, with all numbers in registers.
inline void Factors6::compute(const Matrix6& matrix) {
  double rest[6][6];
  unroll6([&](auto row) {
    unroll6([&](auto column) {
      constexpr int i = row, j = column;
      if constexpr (j <= i) rest[i][j] = matrix(i, j);
    });
  });
  unroll6([&](auto column) {
    constexpr int j = column;
    pivots_[j] = rest[j][j];
    inverse_pivots_[j] = 1. / rest[j][j];
    unroll6([&](auto row) {
      constexpr int i = row;
      if constexpr (i > j) L_(i, j) = rest[i][j] * inverse_pivots_[j];
    });
    unroll6([&](auto row) {
      unroll6([&](auto next_column) {
        constexpr int i = row, k = next_column;
        if constexpr (k > j && k <= i) rest[i][k] -= L_(i, j) * rest[k][j];
      });
    });
  });
}

inline Factors6::Vector6 Factors6::solve(const Vector6& rhs) const {
  Vector6 x = rhs;
  unroll6([&](auto column) {
    unroll6([&](auto row) {
      constexpr int i = row, j = column;
      if constexpr (i > j) x[i] -= L_(i, j) * x[j];
    });
  });
  x = x.cwiseProduct(inverse_pivots_);
  unroll6([&](auto step) {
    unroll6([&](auto row) {
      constexpr int i = row, j = 5 - step;
      if constexpr (i < j) x[i] -= L_(j, i) * x[j];
    });
  });
  return x;
}

}  // namespace dynacom::internal
