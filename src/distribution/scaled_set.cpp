// SPDX-License-Identifier: BSD-2-Clause
#include "scaled_set.hpp"

#include <algorithm>
#include <cmath>

namespace dynacom::internal {

using Eigen::Index;
using Eigen::Matrix2d;
using Eigen::Vector2d;

namespace {

constexpr int kNormal = 2, kYaw = 5;
// Of Newton's method for a normal force, and on an ellipse: far more than any has taken.
constexpr int kNormalSteps = 60, kEllipseSteps = 60;
// A point is so close to a curved boundary, over its radius, if it is not far beyond.
constexpr double kHeldByCost = 0.05;
// What is rounding of a sum, over its terms.
constexpr double kRounding = 4. * std::numeric_limits<double>::epsilon();

// The normal of an edge, of length 1.
Vector2d findOutward(const Vector2d& first, const Vector2d& last) {
  return Vector2d(last.y() - first.y(), first.x() - last.x()).normalized();
}

// A number limited to an interval that is z times as large, and what that means.
struct Limited {
  double value, by_value, by_normal, push;
};
Limited limit(double value, double normal, double lower, double upper) {
  const double low = normal * lower, high = normal * upper;
  if (value > high || lower == upper) return {high, 0., upper, (value - high) * upper};
  if (value < low) return {low, 0., lower, (value - low) * lower};
  return {value, 1., 0., 0.};
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
        *this = segment(vertices.col(0), vertices.col(1));
        break;
      }
      shape_ = Shape::Polygon;
      const auto polygon = std::make_shared<Polygon>();
      polygon->normals.resize(2, count);
      for (Index k = 0; k < count; ++k)
        polygon->normals.col(k) = findOutward(vertices.col(k), vertices.col((k + 1) % count));
      polygon->offsets = polygon->normals.cwiseProduct(vertices).colwise().sum();
      polygon->vertices = vertices;
      polygon_ = polygon;
      break;
    }
  }
}

ScaledSection ScaledSection::segment(const Vector2d& first, const Vector2d& last) {
  ScaledSection segment;
  segment.shape_ = Shape::Segment;
  segment.lower_ = first;
  segment.upper_ = last;
  return segment;
}

void ScaledSection::project(const Vector2d& point, double normal, Response& response) const {
  if (normal <= 0.) {
    const Vector2d exposed = findExposed(point);
    response = {Vector2d::Zero(), Matrix2d::Zero(), exposed, point.dot(exposed),
                exposed.squaredNorm()};
    return;
  }
  switch (shape_) {
    case Shape::Box: {
      const Limited x = limit(point.x(), normal, lower_.x(), upper_.x());
      const Limited y = limit(point.y(), normal, lower_.y(), upper_.y());
      response.point << x.value, y.value;
      response.by_point << x.by_value, 0., 0., y.by_value;
      response.by_normal << x.by_normal, y.by_normal;
      response.push = x.push + y.push;
      response.stiffening = response.by_normal.squaredNorm();
      return;
    }
    case Shape::Disc: {
      const double radius = radii_.x(), size = point.norm();
      if (size <= radius * normal) break;
      const Vector2d along = point / size;
      response.point = radius * normal * along;
      response.by_point =
          radius * normal / size * (Matrix2d::Identity() - along * along.transpose());
      response.by_normal = radius * along;
      response.push = radius * (size - radius * normal);
      response.stiffening = radius * radius;
      return;
    }
    case Shape::Ellipse:
      if (point.cwiseQuotient(radii_).norm() <= normal) break;
      projectOnEllipse(point, normal, response);
      return;
    case Shape::Segment:
      projectOnSegment(point, normal, response);
      return;
    case Shape::Polygon:
      projectOnPolygon(point, normal, response);
      return;
  }
  response = {point, Matrix2d::Identity(), Vector2d::Zero(), 0., 0.};
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
  const Vector2d sums = squares.array() + t;
  const Vector2d factors = squares.cwiseQuotient(sums);
  const Vector2d q = factors.cwiseProduct(point).cwiseQuotient(sums);
  response.point = factors.cwiseProduct(point);
  const double outward = response.point.cwiseQuotient(squares).dot(q);
  response.by_point = Matrix2d(factors.asDiagonal()) - q * q.transpose() / outward;
  response.by_normal = q * (normal / outward);
  response.push = (point - response.point).dot(response.point) / normal;
  response.stiffening = (response.by_normal.dot(point) - response.push) / normal;
}

void ScaledSection::projectOnSegment(const Vector2d& point, double normal,
                                     Response& response) const {
  const Vector2d outward = findOutward(lower_, upper_), along(-outward.y(), outward.x());
  const double place = along.dot(point);
  const bool is_before = place <= normal * along.dot(lower_);
  if (is_before || place >= normal * along.dot(upper_)) {
    const Vector2d& end = is_before ? lower_ : upper_;
    response = {normal * end, Matrix2d::Zero(), end, (point - normal * end).dot(end),
                end.squaredNorm()};
    return;
  }
  const double offset = outward.dot(lower_);
  response = {place * along + normal * offset * outward, along * along.transpose(),
              offset * outward, (outward.dot(point) - normal * offset) * offset, offset * offset};
}

// On the nearest of the edges beyond which the point is.
void ScaledSection::projectOnPolygon(const Vector2d& point, double normal,
                                     Response& response) const {
  const Polygon& polygon = *polygon_;
  const Index count = polygon.vertices.cols();
  double nearest = std::numeric_limits<double>::infinity();
  Response on_edge;
  response = {point, Matrix2d::Identity(), Vector2d::Zero(), 0., 0.};
  for (Index k = 0; k < count; ++k) {
    if (polygon.normals.col(k).dot(point) <= normal * polygon.offsets[k]) continue;
    segment(polygon.vertices.col(k), polygon.vertices.col((k + 1) % count))
        .projectOnSegment(point, normal, on_edge);
    const double distance = (point - on_edge.point).squaredNorm();
    if (distance >= nearest) continue;
    nearest = distance;
    response = on_edge;
  }
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
      return direction.dot(upper_ - lower_) > 0. ? upper_ : lower_;
    case Shape::Polygon:
      break;
  }
  const Eigen::Matrix2Xd& vertices = polygon_->vertices;
  Index farthest = 0;
  for (Index k = 1; k < vertices.cols(); ++k)
    if (direction.dot(vertices.col(k) - vertices.col(farthest)) > 0.) farthest = k;
  return vertices.col(farthest);
}

double ScaledSection::support(const Vector2d& direction) const {
  return direction.dot(findExposed(direction));
}

ScaledSection ScaledSection::expose(const Vector2d& direction, double tolerance) const {
  ScaledSection face;
  if (shape_ == Shape::Box) {
    face.lower_ = (direction.array() > tolerance).select(upper_, lower_);
    face.upper_ = (direction.array() < -tolerance).select(lower_, upper_);
    return face;
  }
  if (direction.norm() <= tolerance) return *this;
  const auto areAsFar = [&](const Vector2d& first, const Vector2d& last) {
    return std::abs(direction.dot(last - first)) <= tolerance * (last - first).norm();
  };
  if (shape_ == Shape::Segment && areAsFar(lower_, upper_)) return *this;
  if (shape_ == Shape::Polygon) {
    const Eigen::Matrix2Xd& vertices = polygon_->vertices;
    for (Index k = 0; k < vertices.cols(); ++k) {
      const Vector2d first = vertices.col(k), last = vertices.col((k + 1) % vertices.cols());
      if (areAsFar(first, last) && direction.dot(polygon_->normals.col(k)) > 0.)
        return segment(first, last);
    }
  }
  face.lower_ = face.upper_ = findExposed(direction);
  return face;
}

ScaledSection ScaledSection::hold(const Vector2d& point, const Matrix2d& by_point, double normal,
                                  const Vector2d& direction, Matrix2d& bend) const {
  bend.setZero();
  ScaledSection face;
  if (shape_ == Shape::Box) {
    const Vector2d place = point / normal;
    face.lower_ = (by_point.diagonal().array() != 0.).select(lower_, place);
    face.upper_ = (by_point.diagonal().array() != 0.).select(upper_, place);
    return face;
  }
  if (by_point.isIdentity(0.)) return *this;
  if (shape_ == Shape::Segment || shape_ == Shape::Polygon) {
    face.lower_ = face.upper_ = point / normal;
    if (by_point.isZero(0.)) return face;
    if (shape_ == Shape::Segment) return *this;
    const auto findOff = [&](Index k) {
      return std::abs(polygon_->normals.col(k).dot(point) - normal * polygon_->offsets[k]);
    };
    Index nearest = 0;
    for (Index k = 1; k < polygon_->offsets.size(); ++k)
      if (findOff(k) < findOff(nearest)) nearest = k;
    const Eigen::Matrix2Xd& vertices = polygon_->vertices;
    return segment(vertices.col(nearest), vertices.col((nearest + 1) % vertices.cols()));
  }
  // Held by what it costs, and not by the direction, which is far beyond.
  if (by_point.trace() > kHeldByCost) return *this;
  face.lower_ = face.upper_ = findExposed(direction);
  const double size = radii_.cwiseProduct(direction).norm();
  if (size > 0.)
    bend = normal / size *
           (Matrix2d(radii_.cwiseAbs2().asDiagonal()) - face.lower_ * face.lower_.transpose());
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
    case Shape::Segment: {
      const Vector2d outward = findOutward(lower_, upper_);
      span.offset = outward.dot(lower_) * outward;
      add(Vector2d(-outward.y(), outward.x()));
      break;
    }
    case Shape::Polygon:
    case Shape::Disc:
    case Shape::Ellipse:
      add(Vector2d::UnitX());
      add(Vector2d::UnitY());
      break;
  }
  return span;
}

ScaledSet::ScaledSet(const ContactSet& set, const Vector6& weights)
    : is_grasp_(set.kind() == ContactSet::Kind::Grasp), size_(int(set.size())) {
  if (is_grasp_) return;
  friction_ = ScaledSection(set.friction(), weights.head<2>() / weights[kNormal]);
  if (size_ == 3) return;
  moments_ = ScaledSection(set.moments(), weights.segment<2>(3) / weights[kNormal]);
  yaw_ = set.gamma() * weights[kYaw] / weights[kNormal] * Vector2d(-1., 1.);
}

void ScaledSet::setUnit(const ContactSet& set, const Vector6& weights, double unit) {
  lower_.head(size_) = set.lower().cwiseProduct(weights).head(size_) / unit;
  upper_.head(size_) = set.upper().cwiseProduct(weights).head(size_) / unit;
}

void ScaledSet::projectAt(const Vector6& point, double normal, Parts& parts) const {
  friction_.project(point.head<2>(), normal, parts.friction);
  parts.push = parts.friction.push;
  parts.stiffness = 1. + parts.friction.stiffening;
  if (size_ == 3) return;
  moments_.project(point.segment<2>(3), normal, parts.moments);
  const Limited yaw = limit(point[kYaw], normal, yaw_[0], yaw_[1]);
  parts.yaw = yaw.value;
  parts.yaw_growth = yaw.by_normal;
  parts.push += parts.moments.push + yaw.push;
  parts.stiffness += parts.moments.stiffening + yaw.by_normal * yaw.by_normal;
}

// The root of z − g_z − Σ push(z), which rises; Newton's method within a bracket, from where all
// are inside, or from zero. Returns whether it lies between the bounds of the normal force, and not
// at one of them.
bool ScaledSet::findNormal(const Vector6& point, double& normal, Parts& parts) const {
  const double pull = point[kNormal];
  double lower = lower_[kNormal], upper = upper_[kNormal];
  bool is_lower_known = false, is_upper_known = false;
  normal = std::clamp(pull, lower, upper);
  for (int step = 0; step < kNormalSteps; ++step) {
    projectAt(point, normal, parts);
    const double off = normal - pull - parts.push;
    if (std::abs(off) <= kRounding * (normal + std::abs(pull) + std::abs(parts.push))) break;
    (off > 0. ? upper : lower) = normal;
    (off > 0. ? is_upper_known : is_lower_known) = true;
    if (!(lower < upper)) break;
    // A step beyond the bracket ends at a bound that has not been looked at, or in the middle.
    double next = normal - off / parts.stiffness;
    if (next == normal) break;
    if (next <= lower)
      next = is_lower_known ? 0.5 * (lower + upper) : lower;
    else if (next >= upper)
      next = is_upper_known ? 0.5 * (lower + upper) : upper;
    normal = next;
  }
  return normal > lower_[kNormal] && normal < upper_[kNormal];
}

void ScaledSet::project(const Vector6& point, Response& response) const {
  response = Response();
  if (is_grasp_) {
    response.force = point.cwiseMax(lower_).cwiseMin(upper_);
    for (int k = 0; k < 6; ++k) {
      const double is_free = point[k] > lower_[k] && point[k] < upper_[k] ? 1. : 0.;
      (k < 3 ? response.of_force(k, k) : response.of_moment(k - 3, k - 3)) = is_free;
    }
    return;
  }
  double normal = 0.;
  Parts parts;
  const bool is_free = findNormal(point, normal, parts);
  if (normal <= 0.) return;
  response.force.head<2>() = parts.friction.point;
  response.force[kNormal] = normal;
  response.of_force.topLeftCorner<2, 2>() = parts.friction.by_point;
  if (size_ == 6) {
    response.force.segment<2>(3) = parts.moments.point;
    response.force[kYaw] = parts.yaw;
    response.of_moment.topLeftCorner<2, 2>() = parts.moments.by_point;
    response.of_moment(2, 2) =
        point[kYaw] > normal * yaw_[0] && point[kYaw] < normal * yaw_[1] ? 1. : 0.;
  }
  if (!is_free) return;
  response.growth.head<2>() = parts.friction.by_normal;
  response.growth[kNormal] = 1.;
  if (size_ == 6) {
    response.growth.segment<2>(3) = parts.moments.by_normal;
    response.growth[kYaw] = parts.yaw_growth;
  }
  response.inverse_stiffness = 1. / parts.stiffness;
}

double ScaledSet::findRate(const Vector6& direction) const {
  double rate = direction[kNormal] + friction_.support(direction.head<2>());
  if (size_ == 6)
    rate += moments_.support(direction.segment<2>(3)) +
            std::max(direction[kYaw] * yaw_[0], direction[kYaw] * yaw_[1]);
  return rate;
}

double ScaledSet::support(const Vector6& direction, double tolerance) const {
  if (is_grasp_) {
    double sum = 0.;
    for (int k = 0; k < 6; ++k)
      if (std::abs(direction[k]) > tolerance)
        sum += direction[k] * (direction[k] > 0. ? upper_[k] : lower_[k]);
    return sum;
  }
  const double rate = findRate(direction);
  return std::abs(rate) <= tolerance ? 0. : rate * (rate > 0. ? upper_[kNormal] : lower_[kNormal]);
}

bool ScaledSet::expose(const Vector6& direction, double tolerance, ScaledSet& face) const {
  face = *this;
  if (is_grasp_) {
    face.lower_ = (direction.array() > tolerance).select(upper_, lower_);
    face.upper_ = (direction.array() < -tolerance).select(lower_, upper_);
    const auto is_up = direction.array() > tolerance;
    const auto is_down = direction.array() < -tolerance;
    return is_up.select(upper_, 0.).allFinite() && is_down.select(lower_, 0.).allFinite();
  }
  face.friction_ = friction_.expose(direction.head<2>(), tolerance);
  if (size_ == 6) {
    face.moments_ = moments_.expose(direction.segment<2>(3), tolerance);
    if (direction[kYaw] > tolerance) face.yaw_[0] = yaw_[1];
    if (direction[kYaw] < -tolerance) face.yaw_[1] = yaw_[0];
  }
  const double rate = findRate(direction);
  if (rate > tolerance) face.lower_[kNormal] = upper_[kNormal];
  if (rate < -tolerance) face.upper_[kNormal] = lower_[kNormal];
  return std::isfinite(face.lower_[kNormal]);
}

void ScaledSet::hold(const Response& response, const Vector6& direction, ScaledSet& face,
                     Eigen::Matrix3d& of_force, Eigen::Matrix3d& of_moment) const {
  of_force.setZero();
  of_moment.setZero();
  face = *this;
  const Vector6& x = response.force;
  if (is_grasp_) {
    for (int k = 0; k < 6; ++k)
      if ((k < 3 ? response.of_force(k, k) : response.of_moment(k - 3, k - 3)) == 0.)
        face.lower_[k] = face.upper_[k] = x[k];
    return;
  }
  const double normal = x[kNormal];
  if (response.inverse_stiffness == 0.) face.lower_[kNormal] = face.upper_[kNormal] = normal;
  if (normal <= 0.) return;
  const auto holdAt = [&](const ScaledSection& section, int first, const auto& by_point,
                          auto bend) {
    Matrix2d own;
    const ScaledSection held =
        section.hold(x.segment<2>(first), by_point, normal, direction.segment<2>(first), own);
    bend = own;
    return held;
  };
  face.friction_ = holdAt(friction_, 0, Matrix2d(response.of_force.topLeftCorner<2, 2>()),
                          of_force.topLeftCorner<2, 2>());
  if (size_ == 3) return;
  face.moments_ = holdAt(moments_, 3, Matrix2d(response.of_moment.topLeftCorner<2, 2>()),
                         of_moment.topLeftCorner<2, 2>());
  if (response.of_moment(2, 2) == 0.) face.yaw_.setConstant(x[kYaw] / normal);
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
    if (yaw_[0] < yaw_[1])
      add(Vector6::Unit(kYaw));
    else
      growth[kYaw] = yaw_[0];
  }
  if (lower_[kNormal] < upper_[kNormal])
    add(growth);
  else
    span.fixed = lower_[kNormal] * growth;
  return span;
}

}  // namespace dynacom::internal
