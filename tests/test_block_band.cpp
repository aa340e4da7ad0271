// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE block_band
#include <Eigen/Cholesky>
#include <algorithm>

#include "repair/block_band.hpp"
#include "test_tools.hpp"

using namespace dynacom_tests;
using dynacom::internal::BlockBand;

namespace {

/// A positive definite matrix of blocks within a band.
MatrixXd randomMatrix(Random& random, Index blocks, Index size, Index band) {
  MatrixXd factor = MatrixXd::Zero(blocks * size, blocks * size);
  for (Index row = 0; row < blocks; ++row)
    for (Index column = std::max<Index>(row - band, 0); column <= row; ++column)
      factor.block(row * size, column * size, size, size) =
          random.vector(size * size).reshaped(size, size);
  return factor * factor.transpose() + 0.1 * MatrixXd::Identity(blocks * size, blocks * size);
}

}  // namespace

BOOST_AUTO_TEST_CASE(systems_are_solved_as_by_a_dense_decomposition) {
  Random random(1);
  for (const Index band : {0, 1, 2, 3})
    for (const Index blocks : {1, 2, 7}) {
      const MatrixXd matrix = randomMatrix(random, blocks, 3, band);
      BlockBand<3> system;
      system.resize(3, blocks, band);
      for (Index row = 0; row < blocks; ++row)
        for (Index column = std::max<Index>(row - band, 0); column <= row; ++column)
          system(row, column) = matrix.block<3, 3>(3 * row, 3 * column);
      BOOST_TEST(system.factorize());
      const VectorXd rhs = random.vector(3 * blocks);
      Eigen::Matrix3Xd x = rhs.reshaped(3, blocks);
      system.solve(x);
      BOOST_TEST(close(x.reshaped(), matrix.llt().solve(rhs), 1e-9));
    }
}

BOOST_AUTO_TEST_CASE(a_matrix_that_is_not_positive_is_refused) {
  BlockBand<3> system;
  system.resize(3, 2, 1);
  system(0, 0).setIdentity();
  system(1, 1).setIdentity();
  system(1, 0) = 2. * Matrix3d::Identity();
  BOOST_TEST(!system.factorize());
}
