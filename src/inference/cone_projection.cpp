// SPDX-License-Identifier: BSD-2-Clause
#include "cone_projection.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace dynacom::internal {

namespace {

// A direction is taken to be within the span of the others if the square of its part outside is
// smaller than this.
constexpr double kDependent = 1e-10;
// An edge is turned to a pull, instead of another being added, if the cosine of the angle between
// them is larger than this; where a point has several, which are the chords of its disc, those that
// are so close become one.
constexpr double kNear = 0.8, kMerged = 0.97;
// Newton's method is left if it has come no closer in so many steps in a row, or is so many times
// as far, squared.
constexpr int kFailures = 3;
constexpr double kLost = 2.;

using Edge = ConeProjection::Edge;

Eigen::Vector2d placeOf(const Edge& edge, const Section& section) {
  if (section.shape() == Section::Shape::Rectangle) {
    // Without branches, which nobody could predict.
    const double x[2] = {section.upper().x(), section.lower().x()};
    const double y[2] = {section.upper().y(), section.lower().y()};
    return {x[edge.corner & 1], y[edge.corner >> 1]};
  }
  if (section.shape() == Section::Shape::Polygon) return section.vertices().col(edge.corner);
  return section.radius() * Eigen::Vector2d(edge.x, edge.y);
}

double along(const Edge& edge, const Eigen::Vector3d& pull) {
  return edge.x * pull.x() + edge.y * pull.y();
}

}  // namespace

ConeProjection::Vector6 ConeProjection::direction(const Edge& edge) const {
  Eigen::Vector3d force;
  force << placeOf(edge, friction_[edge.point]), 1.;
  const Eigen::Vector3d lever = levers_->col(edge.point);
  Vector6 wrench;
  wrench << force, lever.cross(force) / lever_;
  return wrench;
}

Eigen::Vector3d ConeProjection::pull(const Vector6& residual, int point) const {
  const Eigen::Vector3d torque = residual.tail<3>() / lever_;
  return residual.head<3>() + torque.cross(Eigen::Vector3d(levers_->col(point)));
}

void ConeProjection::add(const Edge& edge, const Vector6& column) {
  edges_[count_] = edge;
  factors_[count_] = 0.;
  columns_.col(count_) = column;
  for (int k = 0; k <= count_; ++k) products_[count_][k] = columns_.col(k).dot(column);
  pulls_[count_] = column.dot(target_);
  ++count_;
}

void ConeProjection::drop(int position) {
  --count_;
  decomposed_ = std::min(decomposed_, position);
  for (int k = position; k < count_; ++k) {
    edges_[k] = edges_[k + 1];
    factors_[k] = factors_[k + 1];
    columns_.col(k) = columns_.col(k + 1);
    pulls_[k] = pulls_[k + 1];
    for (int i = 0; i <= k; ++i) products_[k][i] = products_[k + 1][i + (i >= position)];
  }
}

// The factors of least squares, by Cholesky's decomposition of the normal equations, of which the
// rows are kept that are still those of the same edges; false if an edge, the one behind those that
// are decomposed then, is within the span of these.
bool ConeProjection::solve() {
  for (; decomposed_ < count_; ++decomposed_) {
    const int i = decomposed_;
    double rhs = pulls_[i], sum = products_[i][i];
    for (int j = 0; j < i; ++j) {
      double product = products_[i][j];
      for (int k = 0; k < j; ++k) product -= L_[i][k] * L_[j][k];
      L_[i][j] = product * inverse_[j];
      rhs -= L_[i][j] * y_[j];
      sum -= L_[i][j] * L_[i][j];
    }
    if (!(sum > kDependent)) return false;
    inverse_[i] = 1. / std::sqrt(sum);
    y_[i] = rhs * inverse_[i];
  }
  for (int i = count_ - 1; i >= 0; --i) {
    double value = y_[i];
    for (int k = i + 1; k < count_; ++k) value -= L_[k][i] * solution_[k];
    solution_[i] = value * inverse_[i];
  }
  return true;
}

double ConeProjection::lift(std::uint32_t set) const {
  double sum = 0.;
  for (int k = 0; k < count_; ++k)
    if (set >> edges_[k].point & 1u) sum += factors_[k] * columns_(2, k);
  return sum;
}

Eigen::Vector3d ConeProjection::force(int point) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int k = 0; k < count_; ++k)
    if (edges_[k].point == point) sum += factors_[k] * columns_.col(k).head<3>();
  return sum;
}

// Takes the last edge, which solve() found to be within the span of the others, in exchange for one
// of these: for that which becomes zero first where it pushes in place of them. False if it would
// come no closer.
bool ConeProjection::exchange(double slope) {
  const int last = count_ - 1;
  std::array<double, kEdges> parts;  // of the others
  double step = std::numeric_limits<double>::infinity(), outside = products_[last][last];
  int leaving = -1;
  for (int i = last - 1; i >= 0; --i) {
    double value = L_[last][i];
    outside -= value * value;
    for (int k = i + 1; k < last; ++k) value -= L_[k][i] * parts[k];
    parts[i] = value * inverse_[i];
    if (parts[i] > 0. && factors_[i] < step * parts[i]) step = factors_[i] / parts[i], leaving = i;
  }
  if (leaving < 0 || !(slope > step * std::max(outside, 0.))) return false;
  for (int k = 0; k < last; ++k) factors_[k] -= step * parts[k];
  factors_[last] = step;
  drop(leaving);
  while (count_ > 0 && !solve()) drop(decomposed_);
  return true;
}

// Leads on from the factors that there are to those of least squares. On the way, whichever becomes
// zero first is left.
void ConeProjection::minimize() {
  for (;;) {
    double step = 1.;
    int leaving = -1;
    for (int k = 0; k < count_; ++k) {
      if (solution_[k] > 0.) continue;
      const double part =
          factors_[k] / std::max(factors_[k] - solution_[k], std::numeric_limits<double>::min());
      if (leaving < 0 || part < step) step = part, leaving = k;
    }
    if (leaving < 0) break;
    for (int k = 0; k < count_; ++k) factors_[k] += step * (solution_[k] - factors_[k]);
    drop(leaving);
    if (count_ == 0) break;
    solve();
  }
  std::copy_n(solution_.begin(), count_, factors_.begin());
}

// A wrench in the metric H⁻¹, H = 1 + Σ turning T Tᵀ: multiplied by a root of that, one factor for
// each edge that turns.
ConeProjection::Vector6 ConeProjection::whiten(Vector6 wrench) const {
  for (int k = 0; k < curvatures_; ++k)
    wrench -= shrinkage_[k] * axes_.col(k).dot(wrench) * axes_.col(k);
  return wrench;
}

// Lets an edge turn: T is what its point does that pushes across it.
void ConeProjection::addCurvature(const Edge& edge) {
  const Eigen::Vector3d across(-edge.y, edge.x, 0.), lever = levers_->col(edge.point);
  Vector6 axis;
  axis << across, lever.cross(across) / lever_;
  axis = whiten(axis);
  const double square = axis.squaredNorm();
  if (!(square > 0.)) return;
  axes_.col(curvatures_) = axis / std::sqrt(square);
  shrinkage_[curvatures_] = 1. - 1. / std::sqrt(1. + edge.turning * square);
  ++curvatures_;
}

// Columns of the edges that there are, in the metric that there is, without those that are within
// the span of others; and solves for their factors.
void ConeProjection::assemble() {
  const Vector6 target = target_;
  if (curvatures_ > 0) target_ = whiten(target_);
  const int edges = std::exchange(count_, 0);
  decomposed_ = 0;
  for (int k = 0; k < edges; ++k) {
    const double factor = factors_[k];
    const Edge edge = edges_[k];
    const Vector6 column = direction(edge);
    add(edge, curvatures_ > 0 ? whiten(column) : column);
    factors_[count_ - 1] = factor;
  }
  target_ = target;
  while (count_ > 0 && !solve()) drop(decomposed_);
}

// Begins with what is left of the last answer, as far as its points are there and still push.
void ConeProjection::begin() {
  const int edges = std::exchange(count_, 0);
  curvatures_ = 0;
  for (int k = 0; k < edges; ++k) {
    if (!(set_ >> edges_[k].point & 1u)) continue;
    if (count_ < k) edges_[count_] = edges_[k];
    if (edges_[count_].turning > 0.) addCurvature(edges_[count_]);
    ++count_;
  }
  assemble();
  for (;;) {
    const auto least = std::min_element(solution_.begin(), solution_.begin() + count_);
    if (count_ == 0 || *least > 0.) break;
    drop(static_cast<int>(least - solution_.begin()));
    solve();
  }
  std::copy_n(solution_.begin(), count_, factors_.begin());
}

bool ConeProjection::isUseless(const Edge& edge) const {
  const auto end = edges_.begin() + count_;
  const auto useless_end = useless_.begin() + useless_count_;
  return std::find(edges_.begin(), end, edge) != end ||
         std::find(useless_.begin(), useless_end, edge) != useless_end;
}

ConeProjection::Search ConeProjection::search(bool may_turn) const {
  const Eigen::Vector3d force = residual_.head<3>(), torque = residual_.tail<3>() / lever_;
  Search found = {{-1, 0, 0., 0., 0.}, negligible_, false};
  double& slope = found.slope;
  for (std::uint32_t rest = set_; rest != 0; rest &= rest - 1) {
    const int point = __builtin_ctz(rest);
    const Eigen::Vector3d pull = force + torque.cross(Eigen::Vector3d(levers_->col(point)));
    const Section& section = friction_[point];
    // Of the rectangle around the section.
    double value = std::max(pull.x() * section.lower().x(), pull.x() * section.upper().x()) +
                   std::max(pull.y() * section.lower().y(), pull.y() * section.upper().y()) +
                   pull.z();
    if (value <= slope) continue;
    Edge edge = {std::int8_t(point), std::int16_t((pull.x() < 0.) + 2 * (pull.y() < 0.)), 0., 0.,
                 0.};
    if (section.shape() == Section::Shape::Disc) {
      edge.corner = 0;
      const double size = pull.head<2>().norm();
      value = section.radius() * size + pull.z();
      if (value <= slope) continue;
      edge.x = size > 0. ? pull.x() / size : 1.;
      edge.y = size > 0. ? pull.y() / size : 0.;
      if (may_turn) {
        int own = 0;
        double nearest = -1.;
        for (int k = 0; k < count_; ++k) {
          if (edges_[k].point != point) continue;
          ++own;
          nearest = std::max(nearest, edges_[k].x * edge.x + edges_[k].y * edge.y);
        }
        if (nearest > (own > 1 ? kMerged : kNear)) {
          found.turns = true;
          continue;
        }
      }
    } else if (section.shape() == Section::Shape::Polygon) {
      Eigen::Index corner;
      value = (pull.head<2>().transpose() * section.vertices()).maxCoeff(&corner) + pull.z();
      if (value <= slope) continue;
      edge.corner = std::int16_t(corner);
    }
    if (isUseless(edge)) continue;
    found.best = edge;
    slope = value;
  }
  return found;
}

// Whether no edge pushes too much or too little.
bool ConeProjection::isBalanced() const {
  for (int k = 0; k < count_; ++k)
    if (!(std::abs(columns_.col(k).dot(residual_)) <= negligible_)) return false;
  return true;
}

// Makes one of an edge and of those of its point that are close to the pull, too.
void ConeProjection::merge(int position, const Eigen::Vector3d& pull) {
  Edge& edge = edges_[position];
  const double close = kMerged * pull.head<2>().norm();
  Eigen::Vector2d sum = factors_[position] * Eigen::Vector2d(edge.x, edge.y);
  for (int i = count_ - 1; i > position; --i) {
    if (edges_[i].point != edge.point || !(along(edges_[i], pull) > close)) continue;
    sum += factors_[i] * Eigen::Vector2d(edges_[i].x, edges_[i].y);
    factors_[position] += factors_[i];
    drop(i);
  }
  sum.normalize();
  edge.x = sum.x();
  edge.y = sum.y();
}

// The metric of Newton's method at the residual. An edge turns where its point has no other, which
// would be inside of its cone, or has no other that is close to a pull that goes on.
void ConeProjection::findTurns() {
  curvatures_ = 0;
  for (int k = 0; k < count_; ++k) {
    Edge& edge = edges_[k];
    edge.turning = 0.;
    const Section& section = friction_[edge.point];
    if (section.shape() != Section::Shape::Disc) continue;
    const Eigen::Vector3d pulled = pull(residual_, edge.point);
    const double size = pulled.head<2>().norm();
    if (size <= negligible_) continue;
    const bool is_alone = std::none_of(
        edges_.begin(), edges_.begin() + count_,
        [&](const Edge& other) { return &other != &edge && other.point == edge.point; });
    if (!is_alone) {
      const bool goes_on = section.radius() * size + pulled.z() > negligible_;
      if (!goes_on || !(along(edge, pulled) > kMerged * size)) continue;
      merge(k, pulled);
    }
    edge.turning = factors_[k] * section.radius() / std::max(along(edge, pulled), negligible_);
    if (edge.turning > 0.) addCurvature(edge);
  }
}

// Newton's step for edges, whose factors are those of least squares in the metric: H⁻¹ times what
// is left there pulls a force across each, by which it is turned.
void ConeProjection::applyTurns() {
  Vector6 residual = whiten(target_);
  for (int k = 0; k < count_; ++k) residual -= factors_[k] * columns_.col(k);
  for (int k = curvatures_ - 1; k >= 0; --k)
    residual -= shrinkage_[k] * axes_.col(k).dot(residual) * axes_.col(k);
  for (int k = 0; k < count_; ++k) {
    Edge& edge = edges_[k];
    if (edge.turning > 0.) {
      const Eigen::Vector3d pulled = pull(residual, edge.point);
      const double pushed = factors_[k] * friction_[edge.point].radius();
      const double across = edge.turning * (edge.x * pulled.y() - edge.y * pulled.x());
      const double tangent = std::clamp(across / pushed, -1., 1.);
      const double cosine = 1. / std::sqrt(1. + tangent * tangent);
      const double x = cosine * (edge.x - tangent * edge.y);
      edge.y = cosine * (edge.y + tangent * edge.x);
      edge.x = x;
      const double size = along(edge, pulled);
      edge.turning = size > negligible_ ? pushed / size : 0.;
    }
    columns_.col(k) = direction(edge);
  }
}

ConeProjection::Residual ConeProjection::project(const Vector6& wrench,
                                                 const Eigen::Matrix3Xd& levers,
                                                 const std::vector<Section>& friction,
                                                 std::uint32_t set) {
  levers_ = &levers;
  friction_ = friction.data();
  set_ = set;
  target_ << wrench.head<3>(), wrench.tail<3>() / lever_;
  const double size = target_.norm();
  negligible_ = gain_ * size;
  useless_count_ = 0;
  begin();
  bool is_turned = curvatures_ > 0;  // then, factors are not those of least squares
  if (is_turned) applyTurns();

  double least = std::numeric_limits<double>::infinity();  // square of the distance
  int failures = 0;
  State closest;
  closest.count = 0;
  for (int round = 0; round < kRounds; ++round) {
    residual_ = target_;
    for (int k = 0; k < count_; ++k) residual_ -= factors_[k] * columns_.col(k);
    if (size == 0.) break;
    const double square = residual_.squaredNorm();
    const bool is_closer = square < least;
    if (is_closer)
      failures = 0;
    else if (is_turned)
      failures = square > kLost * least ? kFailures : failures + 1;
    least = std::min(square, least);
    const bool may_turn = failures < kFailures;
    const Search found = search(may_turn);
    if (is_turned && !found.turns && found.best.point < 0 && isBalanced()) break;
    if (may_turn && (found.turns || is_turned)) {
      // A step of Newton's method, with what may be added from where it is right to go on.
      if (is_closer) closest = {edges_, factors_, count_};
      findTurns();
      if (is_closer && found.best.point >= 0 && count_ < kEdges) {
        edges_[count_] = found.best;
        factors_[count_++] = 0.;
      }
      assemble();
      minimize();
      if (curvatures_ > 0) applyTurns();
      is_turned = true;
    } else if (is_turned) {
      // Least squares with the edges as they are lead on from the closest answer.
      if (!is_closer) {
        edges_ = closest.edges;
        factors_ = closest.factors;
        count_ = closest.count;
      }
      curvatures_ = 0;
      assemble();
      minimize();
      is_turned = false;
    } else {
      // A step of Lawson and Hanson's method.
      if (found.best.point < 0 || count_ == kEdges) break;
      add(found.best, direction(found.best));
      if (!solve() && !exchange(found.slope)) {
        drop(count_ - 1);
        useless_[static_cast<std::size_t>(useless_count_++)] = found.best;
        continue;
      }
      useless_count_ = 0;
      minimize();
    }
  }
  return {residual_.head<3>().norm(), residual_.tail<3>().norm() * lever_};
}

}  // namespace dynacom::internal
