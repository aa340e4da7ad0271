// SPDX-License-Identifier: BSD-2-Clause
#include "scaled_set.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "../pair.hpp"

namespace dynacom::internal {

using Eigen::Index;
using Eigen::Vector2d;

namespace {

constexpr int kNormal = 2, kYaw = 5;
// Of Newton's method for a normal force, and on an ellipse: far more than any has taken.
constexpr int kNormalSteps = 60, kEllipseSteps = 60;
// A point is so close to a curved boundary, over its radius, if it is not far beyond.
constexpr double kHeldByCost = 0.05;
// What is rounding of a sum, over its terms.
constexpr double kRounding = 4. * std::numeric_limits<double>::epsilon();

Vector2d perpendicular(const Vector2d& vector) { return {-vector.y(), vector.x()}; }

// The end of an interval that a value is at, −1 or 1; by a pull where it is a point.
signed char findSide(double value, double lower, double upper, double pull) {
  const double above = value - lower, below = upper - value;
  if (above == below) return pull < 0. ? -1 : 1;
  return above < below ? -1 : 1;
}

}  // namespace

ScaledSection::ScaledSection(const Section& section, const Vector2d& scale)
    : lower_(section.lower().cwiseProduct(scale)), upper_(section.upper().cwiseProduct(scale)) {
  switch (section.shape()) {
    case Section::Shape::Rectangle:
      break;
    case Section::Shape::Disc:
      shape_ = scale.x() == scale.y() ? Shape::Disc : Shape::Ellipse;
      radii_ = section.radius() * scale;
      break;
    case Section::Shape::Polygon: {
      const Eigen::Matrix2Xd vertices = scale.asDiagonal() * section.vertices();
      const Index count = vertices.cols();
      if (count == 2) {
        *this = ScaledSection(Edge(vertices.col(0), vertices.col(1)));
        break;
      }
      shape_ = Shape::Polygon;
      const auto edges = std::make_shared<std::vector<Edge>>();
      for (Index k = 0; k < count; ++k)
        edges->emplace_back(vertices.col(k), vertices.col((k + 1) % count));
      polygon_ = edges;
      break;
    }
  }
}

ScaledSection::Edge::Edge(const Vector2d& first_vertex, const Vector2d& last_vertex)
    : first(first_vertex),
      last(last_vertex),
      outward(Vector2d(last.y() - first.y(), first.x() - last.x()).normalized()),
      offset(outward.dot(first)),
      begin(along().dot(first)),
      end(along().dot(last)) {}

ScaledSection::ScaledSection(const Edge& edge) : shape_(Shape::Segment), edge_(edge) {}

void ScaledSection::project(const Vector2d& point, double normal, Response& response) const {
  if (normal <= 0.) {
    const Vector2d exposed = findExposed(point);
    response = {Vector2d::Zero(),     false, Vector2d::Zero(), exposed, point.dot(exposed),
                exposed.squaredNorm()};
    return;
  }
  switch (shape_) {
    case Shape::Disc: {
      const double radius = radii_.x(), size = point.norm();
      if (size <= radius * normal) break;
      const Vector2d outward = point / size;
      const double bend = std::sqrt(radius * normal / size);
      response = {radius * normal * outward,         false,
                  bend * perpendicular(outward),     radius * outward,
                  radius * (size - radius * normal), radius * radius};
      return;
    }
    case Shape::Ellipse:
      if (point.cwiseQuotient(radii_).norm() <= normal) break;
      projectOnEllipse(point, normal, response);
      return;
    case Shape::Segment:
      edge_.project(point, normal, response);
      return;
    case Shape::Polygon:
      if (const Edge* edge = findEdge(point, normal)) {
        edge->project(point, normal, response);
        return;
      }
      break;
    case Shape::Box:
      break;
  }
  response = {point, true, Vector2d::Zero(), Vector2d::Zero(), 0., 0.};
}

// The points p = A (A + t)⁻¹ g, A the squares of the radii, with pᵀ A⁻¹ p = z²: t > 0 is the root
// of ‖A^½ (A + t)⁻¹ g‖ − z, to which Newton's method on its inverse rises from 0 (the secular
// equation of trust regions, Conn, Gould and Toint, Trust-Region Methods, 2000, section 7.3).
void ScaledSection::projectOnEllipse(const Vector2d& point, double normal,
                                     Response& response) const {
  const Vector2d squares = radii_.cwiseAbs2();
  double t = 0.;
  for (int step = 0; step < kEllipseSteps; ++step) {
    const Vector2d sums = squares.array() + t;
    const Vector2d scaled = radii_.cwiseProduct(point).cwiseQuotient(sums);
    const double size = scaled.norm();
    const double change =
        (size / normal - 1.) * size * size / scaled.cwiseAbs2().cwiseQuotient(sums).sum();
    t += change;
    if (!(change > kRounding * t)) break;
  }
  // p = F g with F = A (A + t)⁻¹, and what keeps pᵀ A⁻¹ p leaves of F what is along the boundary.
  const Vector2d sums = squares.array() + t;
  const Vector2d factors = squares.cwiseQuotient(sums), outward = point.cwiseQuotient(sums);
  const Vector2d q = factors.cwiseProduct(outward);
  const double size = outward.dot(q);
  response.point = factors.cwiseProduct(point);
  response.is_free = false;
  response.along = std::sqrt(factors.prod() / size) * perpendicular(outward);
  response.by_normal = q * (normal / size);
  response.push = (point - response.point).dot(response.point) / normal;
  response.stiffening = (response.by_normal.dot(point) - response.push) / normal;
}

void ScaledSection::Edge::project(const Vector2d& point, double normal, Response& response) const {
  const double place = along().dot(point);
  const bool is_before = place <= normal * begin;
  if (is_before || place >= normal * end) {
    const Vector2d& vertex = is_before ? first : last;
    response = {
        normal * vertex,     false, Vector2d::Zero(), vertex, (point - normal * vertex).dot(vertex),
        vertex.squaredNorm()};
    return;
  }
  response = {
      place * along() + normal * offset * outward,     false,          along(), offset * outward,
      (outward.dot(point) - normal * offset) * offset, offset * offset};
}

// The nearest of the edges that a point is beyond, or null: by the square of the distance less that
// of the point's norm, since the latter leaves the former no digits where the section is small.
const ScaledSection::Edge* ScaledSection::findEdge(const Vector2d& point, double normal) const {
  const Edge* nearest = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const Edge& edge : *polygon_) {
    const double out = edge.outward.dot(point), depth = normal * edge.offset;
    if (out <= depth) continue;
    const double place = edge.along().dot(point);
    const double nearest_place = std::clamp(place, normal * edge.begin, normal * edge.end);
    const double distance =
        depth * (depth - 2. * out) + nearest_place * (nearest_place - 2. * place);
    if (distance >= least) continue;
    least = distance;
    nearest = &edge;
  }
  return nearest;
}

// A point that is as far as any in a direction.
Vector2d ScaledSection::findExposed(const Vector2d& direction) const {
  switch (shape_) {
    case Shape::Box:
      return (direction.array() > 0.).select(upper_, lower_);
    case Shape::Disc:
    case Shape::Ellipse: {
      const Vector2d stretched = radii_.cwiseProduct(direction);
      const double size = stretched.norm();
      return size > 0. ? Vector2d(radii_.cwiseProduct(stretched) / size) : Vector2d::Zero();
    }
    case Shape::Segment:
      return direction.dot(edge_.last - edge_.first) > 0. ? edge_.last : edge_.first;
    case Shape::Polygon:
      break;
  }
  const Edge* farthest = &polygon_->front();
  for (const Edge& edge : *polygon_)
    if (direction.dot(edge.first - farthest->first) > 0.) farthest = &edge;
  return farthest->first;
}

double ScaledSection::support(const Vector2d& direction) const {
  return direction.dot(findExposed(direction));
}

Vector2d ScaledSection::findExtent() const {
  switch (shape_) {
    case Shape::Box:
      return lower_.cwiseAbs().cwiseMax(upper_.cwiseAbs());
    case Shape::Disc:
    case Shape::Ellipse:
      return radii_;
    case Shape::Segment:
      return edge_.first.cwiseAbs().cwiseMax(edge_.last.cwiseAbs());
    case Shape::Polygon:
      break;
  }
  Vector2d extent = Vector2d::Zero();
  for (const Edge& edge : *polygon_) extent = extent.cwiseMax(edge.first.cwiseAbs());
  return extent;
}

ScaledSection ScaledSection::expose(const Vector2d& direction, const Vector2d& rounding) const {
  ScaledSection face;
  if (shape_ == Shape::Box) {
    face.lower_ = (direction.array() > rounding.array()).select(upper_, lower_);
    face.upper_ = (direction.array() < -rounding.array()).select(lower_, upper_);
    return face;
  }
  if (direction.norm() <= rounding.norm()) return *this;
  const auto isAcross = [&](const Edge& edge) {
    return std::abs(direction.dot(edge.along())) <= rounding.dot(edge.along().cwiseAbs());
  };
  if (shape_ == Shape::Segment && isAcross(edge_)) return *this;
  if (shape_ == Shape::Polygon)
    for (const Edge& edge : *polygon_)
      if (isAcross(edge) && direction.dot(edge.outward) > 0.) return ScaledSection(edge);
  face.lower_ = face.upper_ = findExposed(direction);
  return face;
}

ScaledSection ScaledSection::hold(const Vector2d& point, const Vector2d& free,
                                  const Vector2d& along, double normal, const Vector2d& direction,
                                  Vector2d& bend) const {
  bend.setZero();
  ScaledSection face;
  if (shape_ == Shape::Box) {
    const Vector2d place = point / normal;
    face.lower_ = (free.array() != 0.).select(lower_, place);
    face.upper_ = (free.array() != 0.).select(upper_, place);
    return face;
  }
  if (free[0] != 0.) return *this;
  if (shape_ == Shape::Segment || shape_ == Shape::Polygon) {
    face.lower_ = face.upper_ = point / normal;
    if (along.isZero(0.)) return face;
    if (shape_ == Shape::Segment) return *this;
    const auto findOff = [&](const Edge& edge) {
      return std::abs(edge.outward.dot(point) - normal * edge.offset);
    };
    return ScaledSection(
        *std::min_element(polygon_->begin(), polygon_->end(),
                          [&](const Edge& a, const Edge& b) { return findOff(a) < findOff(b); }));
  }
  // Held by what it costs, and not by the direction, which is far beyond.
  if (along.squaredNorm() > kHeldByCost) return *this;
  face.lower_ = face.upper_ = findExposed(direction);
  // The curvature of the support function, whose gradient is the point.
  const double size = radii_.cwiseProduct(direction).norm();
  if (size > 0.) bend = radii_.prod() * std::sqrt(normal / size) / size * perpendicular(direction);
  return face;
}

ScaledSection::Span ScaledSection::span() const {
  Span span;
  const auto add = [&](const Vector2d& axis) { span.axes.col(span.count++) = axis; };
  switch (shape_) {
    case Shape::Box:
      span.offset = (lower_.array() == upper_.array()).select(lower_, 0.);
      if (lower_.x() < upper_.x()) add(Vector2d::UnitX());
      if (lower_.y() < upper_.y()) add(Vector2d::UnitY());
      break;
    case Shape::Segment:
      span.offset = edge_.offset * edge_.outward;
      add(edge_.along());
      break;
    case Shape::Polygon:
    case Shape::Disc:
    case Shape::Ellipse:
      add(Vector2d::UnitX());
      add(Vector2d::UnitY());
      break;
  }
  return span;
}

Eigen::Matrix<signed char, 2, 1> ScaledSection::findBounds(const Vector2d& point,
                                                           const Vector2d& free, double normal,
                                                           const Vector2d& pull) const {
  Eigen::Matrix<signed char, 2, 1> bounds = Eigen::Matrix<signed char, 2, 1>::Zero();
  for (int k = 0; k < 2; ++k)
    if (free[k] == 0.)
      bounds[k] = shape_ != Shape::Box
                      ? 1
                      : findSide(point[k], normal * lower_[k], normal * upper_[k], pull[k]);
  return bounds;
}

ScaledSet::ScaledSet(const ContactSet& set, const Vector6& weights)
    : is_grasp_(set.kind() == ContactSet::Kind::Grasp), size_(int(set.size())) {
  if (is_grasp_) return;
  friction_ = ScaledSection(set.friction(), weights.head<2>() / weights[kNormal]);
  if (size_ == 6) {
    moments_ = ScaledSection(set.moments(), weights.segment<2>(3) / weights[kNormal]);
    high_slopes_[kYaw] = set.gamma() * weights[kYaw] / weights[kNormal];
    low_slopes_[kYaw] = -high_slopes_[kYaw];
  }
  gatherSlopes();
}

// Of sections that are boxes.
void ScaledSet::gatherSlopes() {
  const auto gather = [&](const ScaledSection& section, int first) {
    low_slopes_.segment<2>(first) = section.isBox() ? section.lower() : Vector2d::Zero();
    high_slopes_.segment<2>(first) = section.isBox() ? section.upper() : Vector2d::Zero();
  };
  gather(friction_, 0);
  gather(moments_, 3);
  are_boxes_ = friction_.isBox() && moments_.isBox();
}

void ScaledSet::setUnit(const ContactSet& set, const Vector6& weights, double unit) {
  const Vector6 scale = weights / unit;
  lower_ = set.lower().cwiseProduct(scale);
  upper_ = set.upper().cwiseProduct(scale);
}

// What a normal force leads components with bounds of their own to.
// @param push, stiffness  Σ ∂/∂z of −½ ‖g − p‖², and 1 − Σ ∂²/∂z² of that
inline void ScaledSet::respond(const Vector6& point, double normal, Response& response,
                               double& push, double& stiffness) const {
  Pair pushes = {0., 0.}, squares = {0., 0.};
  for (int i = 0; i < size_; i += 2) {
    const Pair g = loadPair(&point[i]);
    const Pair slope_below = loadPair(&low_slopes_[i]), slope_above = loadPair(&high_slopes_[i]);
    const Pair low = normal * slope_below, high = normal * slope_above;
    const auto is_above = g > high, is_below = g < low;
    const auto follows = ~(is_above | is_below) & (slope_below < slope_above);
    const Pair value = is_above ? high : is_below ? low : g;
    const Pair slope = follows ? Pair{0., 0.} : is_below ? slope_below : slope_above;
    storePair(value, &response.force[i]);
    storePair(follows ? Pair{1., 1.} : Pair{0., 0.}, &response.free[i]);
    storePair(slope, &response.growth[i]);
    pushes += (g - value) * slope;
    squares += slope * slope;
  }
  push = pushes[0] + pushes[1];
  stiffness = 1. + squares[0] + squares[1];
  response.force[kNormal] = normal;
  response.growth[kNormal] = 1.;
}

// The same of sections that are no boxes.
void ScaledSet::respondInSections(const Vector6& point, double normal, Response& response,
                                  double& push, double& stiffness) const {
  const auto take = [&](const ScaledSection& section, int first, Vector2d& along) {
    if (section.isBox()) return;
    ScaledSection::Response part;
    section.project(point.segment<2>(first), normal, part);
    response.force.segment<2>(first) = part.point;
    response.free.segment<2>(first).setConstant(part.is_free ? 1. : 0.);
    response.growth.segment<2>(first) = part.by_normal;
    along = part.along;
    push += part.push;
    stiffness += part.stiffening;
  };
  take(friction_, 0, response.friction_along);
  take(moments_, 3, response.moments_along);
}

// The normal force is the root of z − g_z − Σ push(z), which rises: by Newton's method within a
// bracket, from where all are inside, or from zero.
void ScaledSet::project(const Vector6& point, Response& response) const {
  response.is_free = false;
  response.friction_along.setZero();
  response.moments_along.setZero();
  if (is_grasp_) {
    const auto is_between = point.array() > lower_.array() && point.array() < upper_.array();
    response.force = point.cwiseMax(lower_).cwiseMin(upper_);
    response.free = is_between.select(Vector6::Ones(), 0.);
    response.growth = Vector6::Unit(kNormal);
    response.inverse_stiffness = std::exchange(response.free[kNormal], 0.);
    return;
  }
  const double pull = point[kNormal];
  double lower = lower_[kNormal], upper = upper_[kNormal];
  double normal = std::clamp(pull, lower, upper), stiffness = 1.;
  bool is_lower_known = false, is_upper_known = false;
  for (int step = 0;; ++step) {
    double push = 0.;
    respond(point, normal, response, push, stiffness);
    if (!are_boxes_) respondInSections(point, normal, response, push, stiffness);
    const double off = normal - pull - push;
    if (step == kNormalSteps ||
        std::abs(off) <= kRounding * (normal + std::abs(pull) + std::abs(push)))
      break;
    (off > 0. ? upper : lower) = normal;
    (off > 0. ? is_upper_known : is_lower_known) = true;
    if (!(lower < upper)) break;
    // A step beyond the bracket ends at a bound that has not been looked at, or in the middle.
    double next = normal - off / stiffness;
    if (next == normal) break;
    if (next <= lower)
      next = is_lower_known ? 0.5 * (lower + upper) : lower;
    else if (next >= upper)
      next = is_upper_known ? 0.5 * (lower + upper) : upper;
    normal = next;
  }
  if (normal <= 0.) {
    response = Response();
    return;
  }
  const bool is_normal_free = normal > lower_[kNormal] && normal < upper_[kNormal];
  response.inverse_stiffness = is_normal_free ? 1. / stiffness : 0.;
  response.is_free = is_normal_free && response.free.sum() == size_ - 1;
}

double ScaledSet::findRate(const Vector6& direction) const {
  double rate = direction[kNormal] + friction_.support(direction.head<2>());
  if (size_ == 6)
    rate += moments_.support(direction.segment<2>(3)) +
            std::max(direction[kYaw] * low_slopes_[kYaw], direction[kYaw] * high_slopes_[kYaw]);
  return rate;
}

// What may be rounding of the rate.
double ScaledSet::findRounding(const Vector6& rounding) const {
  double sum = rounding[kNormal] + friction_.findExtent().dot(rounding.head<2>());
  if (size_ == 6)
    sum += moments_.findExtent().dot(rounding.segment<2>(3)) +
           std::max(-low_slopes_[kYaw], high_slopes_[kYaw]) * rounding[kYaw];
  return sum;
}

double ScaledSet::support(const Vector6& direction, const Vector6& rounding) const {
  if (is_grasp_) {
    double sum = 0.;
    for (int k = 0; k < 6; ++k)
      if (std::abs(direction[k]) > rounding[k])
        sum += direction[k] * (direction[k] > 0. ? upper_[k] : lower_[k]);
    return sum;
  }
  const double rate = findRate(direction);
  return std::abs(rate) <= findRounding(rounding)
             ? 0.
             : rate * (rate > 0. ? upper_[kNormal] : lower_[kNormal]);
}

bool ScaledSet::expose(const Vector6& direction, const Vector6& rounding, ScaledSet& face) const {
  face = *this;
  if (is_grasp_) {
    const auto is_up = direction.array() > rounding.array();
    const auto is_down = direction.array() < -rounding.array();
    face.lower_ = is_up.select(upper_, lower_);
    face.upper_ = is_down.select(lower_, upper_);
    return is_up.select(upper_, 0.).allFinite() && is_down.select(lower_, 0.).allFinite();
  }
  face.friction_ = friction_.expose(direction.head<2>(), rounding.head<2>());
  if (size_ == 6) {
    face.moments_ = moments_.expose(direction.segment<2>(3), rounding.segment<2>(3));
    if (direction[kYaw] > rounding[kYaw]) face.low_slopes_[kYaw] = high_slopes_[kYaw];
    if (direction[kYaw] < -rounding[kYaw]) face.high_slopes_[kYaw] = low_slopes_[kYaw];
  }
  face.gatherSlopes();
  const double rate = findRate(direction), tolerance = findRounding(rounding);
  if (rate > tolerance) face.lower_[kNormal] = upper_[kNormal];
  if (rate < -tolerance) face.upper_[kNormal] = lower_[kNormal];
  return std::isfinite(face.lower_[kNormal]);
}

void ScaledSet::hold(const Response& response, const Vector6& direction, ScaledSet& face,
                     Bend& bend) const {
  bend = Bend();
  face = *this;
  if (response.is_free) return;
  const Vector6& x = response.force;
  const auto fixAt = [&](int k) { face.lower_[k] = face.upper_[k] = x[k]; };
  if (response.inverse_stiffness == 0.) fixAt(kNormal);
  if (is_grasp_) {
    for (int k = 0; k < 6; ++k)
      if (k != kNormal && response.free[k] == 0.) fixAt(k);
    return;
  }
  const double normal = x[kNormal];
  if (normal <= 0.) return;
  face.friction_ = friction_.hold(x.head<2>(), response.free.head<2>(), response.friction_along,
                                  normal, direction.head<2>(), bend.friction);
  if (size_ == 6) {
    face.moments_ =
        moments_.hold(x.segment<2>(3), response.free.segment<2>(3), response.moments_along, normal,
                      direction.segment<2>(3), bend.moments);
    if (response.free[kYaw] == 0.)
      face.low_slopes_[kYaw] = face.high_slopes_[kYaw] = x[kYaw] / normal;
  }
  face.gatherSlopes();
}

ScaledSet::Span ScaledSet::span() const {
  Span span;
  const auto add = [&](const Vector6& axis) { span.axes.col(span.count++) = axis; };
  if (is_grasp_) {
    for (int k = 0; k < 6; ++k) {
      if (lower_[k] < upper_[k])
        add(Vector6::Unit(k));
      else
        span.fixed[k] = lower_[k];
    }
    return span;
  }
  if (upper_[kNormal] <= 0.) return span;
  Vector6 growth = Vector6::Unit(kNormal);
  const ScaledSection::Span friction = friction_.span();
  growth.head<2>() = friction.offset;
  for (int k = 0; k < friction.count; ++k) {
    Vector6 axis = Vector6::Zero();
    axis.head<2>() = friction.axes.col(k);
    add(axis);
  }
  if (size_ == 6) {
    const ScaledSection::Span moments = moments_.span();
    growth.segment<2>(3) = moments.offset;
    for (int k = 0; k < moments.count; ++k) {
      Vector6 axis = Vector6::Zero();
      axis.segment<2>(3) = moments.axes.col(k);
      add(axis);
    }
    if (low_slopes_[kYaw] < high_slopes_[kYaw])
      add(Vector6::Unit(kYaw));
    else
      growth[kYaw] = low_slopes_[kYaw];
  }
  if (lower_[kNormal] < upper_[kNormal])
    add(growth);
  else
    span.fixed = lower_[kNormal] * growth;
  return span;
}

Eigen::Matrix<signed char, 6, 1> ScaledSet::findBounds(const Response& response,
                                                       const Vector6& pull) const {
  Eigen::Matrix<signed char, 6, 1> bounds = Eigen::Matrix<signed char, 6, 1>::Zero();
  if (response.is_free) return bounds;
  const Vector6& x = response.force;
  const auto findOwn = [&](int k) { return findSide(x[k], lower_[k], upper_[k], pull[k]); };
  if (response.inverse_stiffness == 0.) bounds[kNormal] = findOwn(kNormal);
  if (is_grasp_) {
    for (int k = 0; k < 6; ++k)
      if (k != kNormal && response.free[k] == 0.) bounds[k] = findOwn(k);
    return bounds;
  }
  const double normal = x[kNormal];
  bounds.head<2>() =
      friction_.findBounds(x.head<2>(), response.free.head<2>(), normal, pull.head<2>());
  if (size_ == 3) return bounds;
  bounds.segment<2>(3) =
      moments_.findBounds(x.segment<2>(3), response.free.segment<2>(3), normal, pull.segment<2>(3));
  if (response.free[kYaw] == 0.)
    bounds[kYaw] =
        findSide(x[kYaw], normal * low_slopes_[kYaw], normal * high_slopes_[kYaw], pull[kYaw]);
  return bounds;
}

}  // namespace dynacom::internal
