// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "dynacom/contact_set.hpp"

namespace dynacom::internal {

/// The wrench closest to a given one among those that points can give together, each of which
/// pushes within its friction cone: f_z ≥ 0, (f_x, f_y) ∈ f_z F, in the world's axes.
///
/// Such wrenches are sums of the cones' edges with factors ≥ 0, so that the closest one is a
/// problem of non-negative least squares, solved by the active-set method of Lawson and Hanson
/// (Solving Least Squares Problems, 1974, chapter 23). Of each point only that edge is looked at
/// which goes furthest along the residual's pull on the point: a corner of F or, of a disc, the
/// point of its rim in the pull's direction. Since that turns with the residual, ever more edges of
/// a disc would come ever closer to it. Newton's method turns those that there are; see
/// docs/repair.md.
class ConeProjection {
 public:
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  static constexpr std::size_t kMaximalPoints = 32;  // a set has so many bits

  /// What of a wrench cannot be given.
  struct Residual {
    double force, torque;  // norms, of the parts of a wrench as it was given
  };

  /// What is missing where nothing is: a thousandth of the wrench, and a millionth. The square of
  /// the distance is as exact as the slopes below are small.
  static constexpr double kCoarse = 1e-6, kExact = 1e-12;

  /// @param lever  ℓ: closest is what has the least ‖force‖² + ‖moment‖²/ℓ² [m]
  /// @param gain   an edge whose slope along the residual is less than this part of the wrench
  ///               brings nothing
  explicit ConeProjection(double lever, double gain = kCoarse) : lever_(lever), gain_(gain) {}

  /// The edges that made up the last answer are tried first: consecutive frames have much in
  /// common.
  /// @param wrench    (force, moment) about some point
  /// @param levers    from that point to the points that may push
  /// @param friction  F of each
  /// @param set       a bit for each point that pushes, of which there are at most kMaximalPoints
  Residual project(const Vector6& wrench, const Eigen::Matrix3Xd& levers,
                   const std::vector<Section>& friction, std::uint32_t set);

  /// What of the wrench the last answer does not give, as the wrench was given.
  Vector6 residual() const {
    Vector6 residual;
    residual << residual_.head<3>(), lever_ * residual_.tail<3>();
    return residual;
  }

  /// The vertical force that some points gave together in the last answer. There may be other
  /// answers that are as close.
  double lift(std::uint32_t set) const;

  /// The force of a point in the last answer; see lift().
  Eigen::Vector3d force(int point) const;

  /// The edge of a cone, along which a point pushes.
  struct Edge {
    std::int8_t point;
    std::int16_t corner;  // of a rectangle, a bit for each axis that is negative; or of a polygon
    double x, y;          // of a disc, the direction from its centre
    double turning;       // by how much the force turns with the pull across it; 0 if it need not

    bool operator==(const Edge& other) const {
      return point == other.point && corner == other.corner && x == other.x && y == other.y;
    }
  };
  static constexpr int kEdges = 6;  // more do not make a wrench, but for one that is dropped

  /// The edges that make up an answer, from which another may start if sections have the same
  /// shapes and numbers of corners.
  struct Answer {
    std::array<Edge, kEdges> edges;
    std::int8_t count = 0;
  };
  Answer answer() const { return {edges_, std::int8_t(count_)}; }
  void setAnswer(const Answer& answer) {
    edges_ = answer.edges;
    count_ = answer.count;
  }

 private:
  /// An answer that Newton's method may have to come back to.
  struct State {
    std::array<Edge, kEdges> edges;
    std::array<double, kEdges> factors;
    int count;
  };
  struct Search {
    Edge best;  ///< that may be added, and goes furthest along the residual; point −1 if none does
    double slope;  ///< of that
    bool turns;    ///< whether edges come closer to the wrench if they turn
  };

  Vector6 direction(const Edge& edge) const;
  Eigen::Vector3d pull(const Vector6& residual, int point) const;
  Vector6 whiten(Vector6 wrench) const;
  void addCurvature(const Edge& edge);
  void assemble();
  void add(const Edge& edge, const Vector6& column);
  void drop(int position);
  bool solve();
  bool exchange(double slope);
  void minimize();
  void begin();
  Search search(bool may_turn) const;
  bool isUseless(const Edge& edge) const;
  bool isBalanced() const;
  void merge(int position, const Eigen::Vector3d& pull);
  void findTurns();
  void applyTurns();

  const double lever_, gain_;
  const Eigen::Matrix3Xd* levers_ = nullptr;
  const Section* friction_ = nullptr;
  std::uint32_t set_ = 0;
  double negligible_ = 0.;  // slope
  int count_ = 0;
  std::array<Edge, kEdges> edges_ = {};
  Eigen::Matrix<double, 6, kEdges> columns_;
  std::array<std::array<double, kEdges>, kEdges> products_;  // of the columns, below the diagonal
  std::array<double, kEdges> pulls_;                         // of the columns with the target
  std::array<double, kEdges> factors_ = {};
  std::array<double, kEdges> solution_ = {};
  // Of the first edges, rows of Cholesky's factor L of their products, 1 over its diagonal, and
  // what solves L y = pulls.
  int decomposed_ = 0;
  std::array<std::array<double, kEdges>, kEdges> L_;
  std::array<double, kEdges> inverse_, y_;
  // The metric in which edges turn: by which part wrenches shrink along axes, one after another.
  int curvatures_ = 0;
  Eigen::Matrix<double, 6, kEdges> axes_;
  std::array<double, kEdges> shrinkage_;
  // Edges that are within the span of those that push, although rounding says that they would help.
  static constexpr int kRounds = 60;
  std::array<Edge, kRounds> useless_;
  int useless_count_ = 0;
  Vector6 target_;
  Vector6 residual_ = Vector6::Zero();
};

}  // namespace dynacom::internal
