// SPDX-License-Identifier: BSD-2-Clause
#include "surface_matrices.hpp"

#include <cmath>
#include <vector>

namespace dynacom::internal {

namespace {

using Eigen::Index;

struct Side {
  Eigen::Vector2d outward;
  double offset;
};

// Of the rectangle, or of the box around a disc; of a polygon its own.
std::vector<Side> listSides(const Section& section) {
  std::vector<Side> sides;
  if (section.shape() != Section::Shape::Polygon) {
    for (const double sign : {1., -1.})
      for (int axis = 0; axis < 2; ++axis)
        sides.push_back({sign * Eigen::Vector2d::Unit(axis),
                         sign > 0. ? section.upper()[axis] : -section.lower()[axis]});
    return sides;
  }
  const Eigen::Matrix2Xd& vertices = section.vertices();
  for (Index k = 0; k < vertices.cols(); ++k) {
    const Eigen::Vector2d edge = vertices.col((k + 1) % vertices.cols()) - vertices.col(k);
    const Eigen::Vector2d outward = Eigen::Vector2d(edge.y(), -edge.x()).normalized();
    sides.push_back({outward, outward.dot(vertices.col(k))});
    if (vertices.cols() == 2) {  // an edge ends on both sides
      const Eigen::Vector2d along = edge.normalized();
      sides.push_back({along, along.dot(vertices.col((k + 1) % 2))});
    }
  }
  return sides;
}

}  // namespace

SurfaceMatrices listInequalities(const ContactSet& set, const Section* places) {
  const Index n = set.size();
  SurfaceMatrices matrices;
  const auto add = [n](Eigen::MatrixXd& A, Eigen::VectorXd& b, const Eigen::RowVectorXd& row,
                       double limit) {
    const Index rows = A.rows();
    A.conservativeResize(rows + 1, n);
    b.conservativeResize(rows + 1);
    A.row(rows) = row;
    b[rows] = limit;
  };
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(n);
  row[2] = -1.;
  add(matrices.uni_A, matrices.uni_b, row, -set.lower()[2]);
  if (std::isfinite(set.upper()[2])) add(matrices.uni_A, matrices.uni_b, -row, set.upper()[2]);
  if (places)
    for (const Side& side : listSides(*places)) {
      row.setZero();
      row[2] = -side.offset;
      row[3] = side.outward.y();
      row[4] = -side.outward.x();
      add(matrices.uni_A, matrices.uni_b, row, 0.);
    }
  for (const Side& side : listSides(set.friction())) {
    row.setZero();
    row.head<2>() = side.outward.transpose();
    row[2] = -side.offset;
    add(matrices.fri_A, matrices.fri_b, row, 0.);
  }
  if (n == 6)
    for (const double sign : {1., -1.}) {
      row.setZero();
      row[2] = -set.gamma();
      row[5] = sign;
      add(matrices.fri_A, matrices.fri_b, row, 0.);
    }
  return matrices;
}

}  // namespace dynacom::internal
