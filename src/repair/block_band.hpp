// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <vector>

namespace dynacom::internal {

/// A symmetric positive definite matrix of square blocks, in each row of which those left of a
/// first one are zero, and its Cholesky decomposition L Lᵀ, in which the same ones are (George and
/// Liu, Computer Solution of Large Sparse Positive Definite Systems, 1981, chapter 4).
/// @tparam Size  of the blocks, or Eigen::Dynamic
template <int Size>
class BlockBand {
 public:
  using Block = Eigen::Matrix<double, Size, Size>;
  using BlockMap = Eigen::Map<Block>;

  /// Makes room, and sets all to zero.
  /// @param size   of the blocks
  /// @param first  of each row of blocks, the first that is not zero, at most the row's own
  void resize(Eigen::Index size, const std::vector<Eigen::Index>& first) {
    size_ = size;
    first_ = first;
    rows_.resize(first.size());
    Eigen::Index blocks = 0;
    for (std::size_t row = 0; row < first.size(); ++row) {
      rows_[row] = blocks - first[row];
      blocks += Eigen::Index(row) - first[row] + 1;
    }
    numbers_.assign(static_cast<std::size_t>(blocks * size * size), 0.);
  }

  /// The same for a row that has so many blocks left of its diagonal, as far as there are any.
  void resize(Eigen::Index size, Eigen::Index rows, Eigen::Index band) {
    std::vector<Eigen::Index> first;
    for (Eigen::Index row = 0; row < rows; ++row)
      first.push_back(std::max<Eigen::Index>(row - band, 0));
    resize(size, first);
  }

  /// A block on or left of the diagonal, from the row's first on. Of those on it, the lower half is
  /// read.
  BlockMap operator()(Eigen::Index row, Eigen::Index column) {
    const Eigen::Index block = rows_[static_cast<std::size_t>(row)] + column;
    return BlockMap(numbers_.data() + block * size_ * size_, size_, size_);
  }

  /// Puts L in the place of the matrix.
  /// @return false if the matrix is not positive definite
  bool factorize() {
    for (Eigen::Index row = 0; row < Eigen::Index(first_.size()); ++row)
      for (Eigen::Index column = first(row); column <= row; ++column) {
        BlockMap block = (*this)(row, column);
        for (Eigen::Index k = std::max(first(row), first(column)); k < column; ++k)
          block.noalias() -= (*this)(row, k) * (*this)(column, k).transpose();
        if (column < row) {
          (*this)(column, column)
              .template triangularView<Eigen::Lower>()
              .transpose()
              .template solveInPlace<Eigen::OnTheRight>(block);
        } else {
          const Eigen::LLT<Eigen::Ref<Block>> diagonal(block);
          if (diagonal.info() != Eigen::Success) return false;
        }
      }
    return true;
  }

  /// Solves L Lᵀ x = b, after factorize().
  /// @param x  b, block by block in columns, which becomes x
  void solve(Eigen::Matrix<double, Size, Eigen::Dynamic>& x) {
    const auto rows = Eigen::Index(first_.size());
    for (Eigen::Index row = 0; row < rows; ++row) {
      auto value = x.col(row);
      for (Eigen::Index k = first(row); k < row; ++k) value.noalias() -= (*this)(row, k) * x.col(k);
      (*this)(row, row).template triangularView<Eigen::Lower>().solveInPlace(value);
    }
    for (Eigen::Index row = rows; row-- > 0;) {
      auto value = x.col(row);
      (*this)(row, row).template triangularView<Eigen::Lower>().transpose().solveInPlace(value);
      for (Eigen::Index k = first(row); k < row; ++k)
        x.col(k).noalias() -= (*this)(row, k).transpose() * value;
    }
  }

 private:
  Eigen::Index first(Eigen::Index row) const { return first_[static_cast<std::size_t>(row)]; }

  Eigen::Index size_ = 0;
  std::vector<Eigen::Index> first_, rows_;  // of each row: the first block, and where block 0 were
  std::vector<double> numbers_;             // block by block, row by row
};

}  // namespace dynacom::internal
