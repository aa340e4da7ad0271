// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/contact_set.hpp"

#include <algorithm>
#include <cmath>
#include <ostream>
#include <vector>

#include "../check.hpp"

namespace dynacom {

using Eigen::Index;
using Eigen::Vector2d;
using internal::throwInvalid;

namespace {

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// The convex hull, counter-clockwise, without points on its edges (Andrew 1979).
std::vector<Vector2d> findHull(std::vector<Vector2d> points) {
  std::sort(points.begin(), points.end(), [](const Vector2d& a, const Vector2d& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  points.erase(std::unique(points.begin(), points.end()), points.end());
  if (points.size() < 3) return points;
  std::vector<Vector2d> hull;
  const auto addChain = [&](auto begin, auto end) {
    const std::size_t first = hull.size();
    for (auto point = begin; point != end; ++point) {
      while (hull.size() >= first + 2 &&
             cross(hull.back() - hull[hull.size() - 2], *point - hull[hull.size() - 2]) <= 0.)
        hull.pop_back();
      hull.push_back(*point);
    }
    hull.pop_back();  // the next chain begins with it
  };
  addChain(points.begin(), points.end());
  addChain(points.rbegin(), points.rend());
  return hull;
}

// Writes "lower=[1 2], upper=[3 4]".
template <class Vector>
std::ostream& writeBox(std::ostream& out, const Vector& lower, const Vector& upper) {
  const Eigen::IOFormat row(Eigen::StreamPrecision, Eigen::DontAlignCols, " ", " ", "", "", "[",
                            "]");
  return out << "lower=" << lower.transpose().format(row)
             << ", upper=" << upper.transpose().format(row);
}

}  // namespace

Section Section::rectangle(const Vector2d& lower, const Vector2d& upper) {
  if (!lower.allFinite() || !upper.allFinite() || !(lower.array() <= upper.array()).all())
    throwInvalid("a rectangle must go from finite coordinates to others that are no less, got ",
                 lower.transpose(), " to ", upper.transpose());
  Section section;
  section.lower_ = lower;
  section.upper_ = upper;
  return section;
}

Section Section::disc(double radius) {
  if (!(std::isfinite(radius) && radius >= 0.))
    throwInvalid("a disc's radius must be finite and >= 0, got ", radius);
  Section section = rectangle(Vector2d::Constant(-radius), Vector2d::Constant(radius));
  if (radius == 0.) return section;
  section.shape_ = Shape::Disc;
  section.radius_ = radius;
  return section;
}

Section Section::polygon(const Eigen::Ref<const Eigen::Matrix2Xd>& points) {
  if (points.cols() == 0) throwInvalid("a polygon must have a point at least, got none");
  if (!points.allFinite()) throwInvalid("a polygon's points must be finite, got ", points);
  std::vector<Vector2d> all;
  for (Index k = 0; k < points.cols(); ++k) all.emplace_back(points.col(k));
  const std::vector<Vector2d> hull = findHull(std::move(all));
  Section section = rectangle(points.rowwise().minCoeff(), points.rowwise().maxCoeff());
  const bool is_rectangle =
      hull.size() == 1 || (hull.size() == 2 && (hull[1] - hull[0]).cwiseAbs().minCoeff() == 0.) ||
      (hull.size() == 4 && std::all_of(hull.begin(), hull.end(), [&](const Vector2d& vertex) {
         return ((vertex - section.lower_).array() * (vertex - section.upper_).array() == 0.).all();
       }));
  if (is_rectangle) return section;
  section.shape_ = Shape::Polygon;
  Eigen::Matrix2Xd vertices(2, Index(hull.size()));
  for (std::size_t k = 0; k < hull.size(); ++k) vertices.col(Index(k)) = hull[k];
  section.vertices_ = std::make_shared<const Eigen::Matrix2Xd>(std::move(vertices));
  return section;
}

Section Section::facets(double radius, int facets, double angle) {
  constexpr int kLeast = 4, kMost = 64;
  constexpr double kPi = 3.14159265358979323846;
  if (!(std::isfinite(radius) && radius >= 0.))
    throwInvalid("a polygon's inner radius must be finite and >= 0, got ", radius);
  if (facets < kLeast || facets > kMost)
    throwInvalid("facets must be from ", kLeast, " to ", kMost, ", got ", facets);
  if (!std::isfinite(angle)) throwInvalid("angle must be finite, got ", angle);
  if (facets == 4 && angle == 0.)
    return rectangle(Vector2d::Constant(-radius), Vector2d::Constant(radius));
  Eigen::Matrix2Xd vertices(2, facets);
  for (int k = 0; k < facets; ++k) {
    const double direction = angle + (2 * k + 1) * kPi / facets;
    vertices.col(k) =
        radius / std::cos(kPi / facets) * Vector2d(std::cos(direction), std::sin(direction));
  }
  return polygon(vertices);
}

double Section::support(const Vector2d& direction) const {
  switch (shape_) {
    case Shape::Disc:
      return radius_ * direction.norm();
    case Shape::Polygon:
      return (direction.transpose() * vertices()).maxCoeff();
    case Shape::Rectangle:
      break;
  }
  return direction.cwiseProduct(lower_).cwiseMax(direction.cwiseProduct(upper_)).sum();
}

const Eigen::Matrix2Xd& Section::vertices() const {
  static const Eigen::Matrix2Xd none(2, 0);
  return vertices_ ? *vertices_ : none;
}

double Section::excess(const Vector2d& point, double normal_force) const {
  if (shape_ == Shape::Disc) return point.norm() - radius_ * normal_force;
  double most = std::max((point - normal_force * upper_).maxCoeff(),
                         (normal_force * lower_ - point).maxCoeff());
  const Eigen::Matrix2Xd& corners = vertices();
  for (Index k = 0; k < corners.cols(); ++k) {
    const Vector2d edge = corners.col((k + 1) % corners.cols()) - corners.col(k);
    const Vector2d outward = Vector2d(edge.y(), -edge.x()).normalized();
    most = std::max(most, outward.dot(point - normal_force * corners.col(k)));
  }
  return most;
}

std::string Section::to_string() const { return internal::concat(*this); }

bool Section::operator==(const Section& other) const {
  return shape_ == other.shape_ && lower_ == other.lower_ && upper_ == other.upper_ &&
         radius_ == other.radius_ &&
         (vertices_ == other.vertices_ ||
          (vertices().cols() == other.vertices().cols() && vertices() == other.vertices()));
}

ContactSet ContactSet::point(const Section& friction) {
  ContactSet set;
  set.friction_ = friction;
  return set;
}

ContactSet ContactSet::surface(const Section& friction, const Section& places, double gamma) {
  if (!(std::isfinite(gamma) && gamma >= 0.))
    throwInvalid("gamma must be finite and >= 0, got ", gamma);
  ContactSet set;
  set.kind_ = Kind::Surface;
  set.friction_ = friction;
  set.gamma_ = gamma;
  // A unit force at (x, y) has the moment (y, −x).
  switch (places.shape()) {
    case Section::Shape::Disc:
      set.moments_ = places;
      break;
    case Section::Shape::Rectangle:
      set.moments_ = Section::rectangle({places.lower().y(), -places.upper().x()},
                                        {places.upper().y(), -places.lower().x()});
      break;
    case Section::Shape::Polygon: {
      Eigen::Matrix2Xd turned(2, places.vertices().cols());
      turned << places.vertices().row(1), -places.vertices().row(0);
      set.moments_ = Section::polygon(turned);
      break;
    }
  }
  return set;
}

ContactSet ContactSet::grasp(const Vector6& lower, const Vector6& upper) {
  for (Index k = 0; k < 6; ++k)
    if (!(lower[k] <= upper[k]) || lower[k] == kInfinity || upper[k] == -kInfinity)
      throwInvalid("lower bounds must be at most the upper ones, got ", lower.transpose(), " and ",
                   upper.transpose());
  ContactSet set;
  set.kind_ = Kind::Grasp;
  set.lower_ = lower;
  set.upper_ = upper;
  return set;
}

void ContactSet::boundNormalForce(double least, double greatest) {
  if (kind_ == Kind::Grasp) throwInvalid("a grasp has bounds of its own");
  if (!(least >= 0. && std::isfinite(least) && least <= greatest))
    throwInvalid("the normal force must have bounds 0 <= least <= greatest, got ", least, " and ",
                 greatest);
  lower_[2] = least;
  upper_[2] = greatest;
}

bool ContactSet::isCone() const {
  return kind_ != Kind::Grasp && lower_[2] == 0. && upper_[2] == kInfinity;
}

double ContactSet::support(const Eigen::Ref<const Eigen::VectorXd>& direction,
                           double tolerance) const {
  internal::requireSize("direction", direction.size(), size(), "components");
  if (kind_ == Kind::Grasp) {
    double sum = 0.;
    for (Index k = 0; k < 6; ++k)
      if (std::abs(direction[k]) > tolerance)
        sum += direction[k] * (direction[k] > 0. ? upper_[k] : lower_[k]);
    return sum;
  }
  double rate = direction[2] + friction_.support(direction.head<2>());
  if (kind_ == Kind::Surface)
    rate += moments_.support(direction.segment<2>(3)) + gamma_ * std::abs(direction[5]);
  if (std::abs(rate) <= tolerance) rate = 0.;
  if (rate == 0.) return 0.;
  return rate * (rate > 0. ? upper_[2] : lower_[2]);
}

double ContactSet::excess(const Eigen::Ref<const Eigen::VectorXd>& force) const {
  internal::requireSize("force", force.size(), size(), "components");
  if (kind_ == Kind::Grasp)
    return std::max((lower_ - force).maxCoeff(), (force - upper_).maxCoeff());
  const double normal = force[2];
  double most =
      std::max({lower_[2] - normal, normal - upper_[2], friction_.excess(force.head<2>(), normal)});
  if (kind_ == Kind::Surface)
    most = std::max(
        {most, moments_.excess(force.segment<2>(3), normal), std::abs(force[5]) - gamma_ * normal});
  return most;
}

std::string ContactSet::to_string() const { return internal::concat(*this); }

bool ContactSet::operator==(const ContactSet& other) const {
  return kind_ == other.kind_ && friction_ == other.friction_ && moments_ == other.moments_ &&
         gamma_ == other.gamma_ && lower_ == other.lower_ && upper_ == other.upper_;
}

std::ostream& operator<<(std::ostream& out, const Section& section) {
  switch (section.shape()) {
    case Section::Shape::Disc:
      return out << "Section(shape=Disc, radius=" << section.radius() << ")";
    case Section::Shape::Polygon:
      out << "Section(shape=Polygon, vertices=" << section.vertices().cols();
      break;
    case Section::Shape::Rectangle:
      out << "Section(shape=Rectangle";
      break;
  }
  return writeBox(out << ", ", section.lower(), section.upper()) << ")";
}

std::ostream& operator<<(std::ostream& out, const ContactSet& set) {
  if (set.kind() == ContactSet::Kind::Grasp)
    return writeBox(out << "ContactSet(kind=Grasp, ", set.lower(), set.upper()) << ")";
  const bool is_point = set.kind() == ContactSet::Kind::Point;
  out << "ContactSet(kind=" << (is_point ? "Point" : "Surface") << ", friction=" << set.friction();
  if (!is_point) out << ", moments=" << set.moments() << ", gamma=" << set.gamma();
  return out << ", normal_force=[" << set.lower()[2] << " " << set.upper()[2] << "])";
}

}  // namespace dynacom
