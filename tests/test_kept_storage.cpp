// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE kept_storage
#include <Eigen/QR>
#include <boost/test/unit_test.hpp>
#include <limits>
#include <type_traits>
#include <vector>

#include "kept_storage.hpp"

using dynacom::internal::Kept;
using dynacom::internal::KeptList;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using KeptMatrix = Kept<MatrixXd>;
using KeptVector = Kept<VectorXd>;

namespace {

/// A matrix in which every number says where it stands.
MatrixXd numbered(Index rows, Index cols) {
  return MatrixXd::NullaryExpr(rows, cols, [](Index row, Index col) { return 100. * row + col; });
}

bool same(const Eigen::Ref<const MatrixXd>& one, const Eigen::Ref<const MatrixXd>& other) {
  return one.rows() == other.rows() && one.cols() == other.cols() && one == other;
}

}  // namespace

BOOST_AUTO_TEST_CASE(without_a_size_there_is_nothing) {
  const KeptMatrix matrix;
  const KeptVector vector;
  const Kept<Eigen::Matrix<double, 6, Eigen::Dynamic>> wide;
  BOOST_TEST(wide.rows() == 6);
  BOOST_TEST(wide.cols() == 0);
  BOOST_TEST(matrix.rows() + matrix.cols() + vector.size() == 0);
  const KeptMatrix copy = KeptMatrix();
  BOOST_TEST(copy.size() == 0);
}

BOOST_AUTO_TEST_CASE(it_becomes_what_is_assigned) {
  const MatrixXd a = numbered(3, 4), b = numbered(4, 2);
  KeptMatrix matrix;
  matrix = a;
  BOOST_TEST(same(matrix, a));
  matrix = a * b;  // products, too, and smaller ones
  BOOST_TEST(same(matrix, a * b));
  matrix = 2. * a.transpose();
  BOOST_TEST(same(matrix, 2. * a.transpose()));
  matrix = a.block(1, 1, 2, 3).cwiseAbs2();
  BOOST_TEST(same(matrix, a.block(1, 1, 2, 3).cwiseAbs2()));
  matrix = MatrixXd(0, 5);
  BOOST_TEST(matrix.rows() == 0);
  BOOST_TEST(matrix.cols() == 5);

  KeptVector vector;
  vector = a.col(2);
  BOOST_TEST(same(vector, a.col(2)));
  vector.head(2) += a.col(1).head(2);
  BOOST_TEST(same(vector, Eigen::Vector3d(3., 203., 202.)));
  Kept<Eigen::Matrix<double, 6, Eigen::Dynamic>> wide;
  wide = numbered(6, 3);
  BOOST_TEST(same(wide, numbered(6, 3)));

  Kept<Eigen::Array<bool, Eigen::Dynamic, 1>> flags;
  flags = vector.array() > 202.5;
  BOOST_TEST((!flags[0] && flags[1] && !flags[2]));
  Kept<Eigen::Matrix<long double, Eigen::Dynamic, 1>> accurate;
  accurate = vector.cast<long double>() / 3.L;
  BOOST_TEST((accurate[0] == 1.L && accurate[2] == 202.L / 3.L));
}

BOOST_AUTO_TEST_CASE(it_can_be_filled) {
  KeptMatrix matrix;
  matrix.setZero(2, 3);
  BOOST_TEST(same(matrix, MatrixXd::Zero(2, 3)));
  matrix.setConstant(4.);
  BOOST_TEST(same(matrix, MatrixXd::Constant(2, 3, 4.)));
  matrix.setZero();
  BOOST_TEST(same(matrix, MatrixXd::Zero(2, 3)));
  matrix.setIdentity();
  BOOST_TEST(same(matrix, MatrixXd::Identity(2, 3)));
  KeptVector vector;
  vector.setConstant(5, -1.);
  BOOST_TEST(same(vector, VectorXd::Constant(5, -1.)));
  vector.setZero(2);
  BOOST_TEST(same(vector, VectorXd::Zero(2)));
}

BOOST_AUTO_TEST_CASE(it_shrinks_and_grows_in_its_place) {
  const MatrixXd large = numbered(6, 8), small = numbered(2, 3), tall = numbered(48, 1),
                 flat = numbered(1, 48);
  KeptMatrix matrix;
  matrix.resize(6, 8);
  const double* const place = matrix.data();
  for (const MatrixXd* other : {&large, &small, &tall, &flat, &small, &large}) {
    matrix = *other;
    BOOST_TEST(same(matrix, *other));
  }
  for (Index rows = 0; rows <= 6; ++rows)
    for (Index cols = 8; cols >= 0; --cols) {
      matrix.resize(rows, cols);
      matrix.setZero(6 - rows, 8 - cols);
    }
  matrix.setZero(8, 6);
  BOOST_TEST(same(matrix, MatrixXd::Zero(8, 6)));
  BOOST_TEST(matrix.data() == place);
  // More than there ever was.
  matrix = numbered(7, 7);
  BOOST_TEST(same(matrix, numbered(7, 7)));

  KeptVector vector;
  vector.resize(10);
  for (const Index size : {3, 0, 10, 7}) vector.setConstant(size, double(size));
  BOOST_TEST(same(vector, VectorXd::Constant(7, 7.)));
}

BOOST_AUTO_TEST_CASE(a_copy_is_independent) {
  KeptMatrix matrix;
  matrix = numbered(5, 5);
  matrix = numbered(2, 3);  // smaller than its storage
  KeptMatrix copy = matrix;
  BOOST_TEST(same(copy, numbered(2, 3)));
  BOOST_TEST(copy.data() != matrix.data());
  matrix(1, 2) = -1.;
  BOOST_TEST(same(copy, numbered(2, 3)));
  copy.setZero(4, 4);
  BOOST_TEST(matrix(1, 2) == -1.);
  BOOST_TEST(matrix.rows() == 2);

  // Into what has the storage already.
  KeptMatrix other;
  other.resize(3, 4);
  const double* const place = other.data();
  other = matrix;
  BOOST_TEST(same(other, matrix));
  BOOST_TEST(other.data() == place);
  const KeptMatrix& self = other;
  other = self;
  BOOST_TEST(same(other, matrix));
  other = KeptMatrix();
  BOOST_TEST(other.size() == 0);

  // As a vector of them grows, as members of a struct that is copied or moved.
  std::vector<KeptVector> list;
  for (int i = 0; i < 20; ++i) {
    list.emplace_back();
    list.back().setConstant(i, double(i));
  }
  for (int i = 0; i < 20; ++i) BOOST_TEST(same(list[i], VectorXd::Constant(i, double(i))));
}

BOOST_AUTO_TEST_CASE(functions_of_eigen_take_it_as_it_is) {
  KeptMatrix matrix;
  matrix.resize(40, 40);
  matrix = numbered(5, 3) + 7. * MatrixXd::Identity(5, 3);
  const auto rank = [](const Eigen::Ref<const MatrixXd>& ref) {
    return ref.colPivHouseholderQr().rank();
  };
  BOOST_TEST(rank(matrix) == 3);
  // Without a copy.
  const auto place = [](const Eigen::Ref<const MatrixXd>& ref) { return ref.data(); };
  BOOST_TEST(place(matrix) == matrix.data());
  static_assert(std::is_same_v<KeptMatrix::Scalar, double>);
}

BOOST_AUTO_TEST_CASE(a_list_keeps_its_elements) {
  KeptList<KeptVector> list;
  BOOST_TEST(list.size() == 0u);
  BOOST_TEST((list.begin() == list.end()));
  list.resize(3);
  for (std::size_t k = 0; k < 3; ++k) list[k].setConstant(4, double(k));
  list.resize(1);
  list.resize(0);
  list.resize(2);
  list[1].setZero(2);
  list.resize(3);
  list[1].setConstant(4, 5.);
  BOOST_TEST(list.size() == 3u);
  BOOST_TEST(same(list[0], VectorXd::Zero(4)));
  BOOST_TEST(same(list[1], VectorXd::Constant(4, 5.)));
  BOOST_TEST(same(list[2], VectorXd::Constant(4, 2.)));
  list.resize(2);
  Index sum = 0;
  for (const KeptVector& vector : list) sum += vector.size();
  BOOST_TEST(sum == 8);

  KeptList<KeptVector> copy = list;
  copy[0][0] = 9.;
  BOOST_TEST(list[0][0] == 0.);
  BOOST_TEST(copy.size() == 2u);
}
