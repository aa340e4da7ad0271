// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <vector>

namespace dynacom::internal {

/// A symmetric positive definite matrix of square blocks that are zero farther than a band from the
/// diagonal, and its Cholesky decomposition L Lᵀ, which has the same band: as many operations as
/// there are blocks, whatever their number.
template <int Size>
class BlockBand {
 public:
  using Block = Eigen::Matrix<double, Size, Size>;
  using Vector = Eigen::Matrix<double, Size, 1>;

  /// Makes room, and sets all to zero.
  /// @param blocks  along the diagonal
  /// @param band    how many of them there may be left of the diagonal in a row
  void resize(Eigen::Index blocks, Eigen::Index band) {
    count_ = blocks;
    band_ = band;
    blocks_.assign(static_cast<std::size_t>(blocks * (band + 1)), Block::Zero());
  }

  /// A block on or left of the diagonal: 0 ≤ row − column ≤ band. Of those on it, the lower half is
  /// read.
  Block& operator()(Eigen::Index row, Eigen::Index column) {
    return blocks_[static_cast<std::size_t>(row * (band_ + 1) + row - column)];
  }

  /// Puts L in the place of the matrix.
  /// @return false if the matrix is not positive definite
  bool factorize() {
    for (Eigen::Index row = 0; row < count_; ++row) {
      const Eigen::Index first = std::max<Eigen::Index>(row - band_, 0);
      for (Eigen::Index column = first; column <= row; ++column) {
        Block& block = (*this)(row, column);
        for (Eigen::Index k = first; k < column; ++k)
          block.noalias() -= (*this)(row, k) * (*this)(column, k).transpose();
        const Block& diagonal = (*this)(column, column);
        if (column < row)
          diagonal.template triangularView<Eigen::Lower>()
              .transpose()
              .template solveInPlace<Eigen::OnTheRight>(block);
        else if (!(Eigen::internal::llt_inplace<double, Eigen::Lower>::blocked(block) < 0))
          return false;
      }
    }
    return true;
  }

  /// Solves L Lᵀ x = b, after factorize().
  /// @param x  b, block by block, which becomes x
  void solve(std::vector<Vector>& x) {
    for (Eigen::Index row = 0; row < count_; ++row) {
      Vector& value = x[static_cast<std::size_t>(row)];
      for (Eigen::Index k = std::max<Eigen::Index>(row - band_, 0); k < row; ++k)
        value.noalias() -= (*this)(row, k) * x[static_cast<std::size_t>(k)];
      (*this)(row, row).template triangularView<Eigen::Lower>().solveInPlace(value);
    }
    for (Eigen::Index row = count_; row-- > 0;) {
      Vector& value = x[static_cast<std::size_t>(row)];
      for (Eigen::Index k = std::min(row + band_, count_ - 1); k > row; --k)
        value.noalias() -= (*this)(k, row).transpose() * x[static_cast<std::size_t>(k)];
      (*this)(row, row).template triangularView<Eigen::Lower>().transpose().solveInPlace(value);
    }
  }

 private:
  Eigen::Index count_ = 0, band_ = 0;
  std::vector<Block> blocks_;  // row by row, each from the diagonal on to the left
};

}  // namespace dynacom::internal
