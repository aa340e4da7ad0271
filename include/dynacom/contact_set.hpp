// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <iosfwd>
#include <limits>
#include <memory>
#include <string>

#include "dynacom/export.hpp"

namespace dynacom {

/// A convex set in a plane, not empty: what two components of a contact's force may be at a normal
/// force of 1.
class DYNACOM_EXPORT Section {
 public:
  enum class Shape { Rectangle, Disc, Polygon };

  /// The point at the origin.
  Section() = default;
  /// All from `lower` to `upper`; a point where these are the same.
  /// @throws std::invalid_argument unless both are finite and lower ≤ upper
  static Section rectangle(const Eigen::Vector2d& lower, const Eigen::Vector2d& upper);
  /// The disc around the origin.
  /// @throws std::invalid_argument unless the radius is finite and ≥ 0
  static Section disc(double radius);
  /// The convex hull of points, 2 × points; an edge of two, or a vertex alone, are such, too.
  /// @throws std::invalid_argument if there is none, or one is not finite
  static Section polygon(const Eigen::Ref<const Eigen::Matrix2Xd>& points);
  /// The regular polygon around a disc: as many sides as facets, the first one's normal at an angle
  /// from the x axis. With four at 0 it is the rectangle from −radius to radius.
  /// @param facets  from 4 to 64
  /// @param angle   [rad]
  /// @throws std::invalid_argument if a number is out of its range
  static Section facets(double radius, int facets, double angle = 0.);

  Shape shape() const { return shape_; }
  /// Corners of a rectangle; of others, of the box around them.
  const Eigen::Vector2d& lower() const { return lower_; }
  const Eigen::Vector2d& upper() const { return upper_; }
  /// Of a disc; else 0.
  double radius() const { return radius_; }
  /// Of a polygon, two at least, counter-clockwise, 2 × vertices; else none.
  const Eigen::Matrix2Xd& vertices() const;

  /// The largest value of ⟨direction, p⟩ for points p of the section: its support function.
  double support(const Eigen::Vector2d& direction) const;
  /// By how much a point is outside, at the normal force that makes the section as many times
  /// larger: the largest of its inequalities, each with a normal of length 1; ≤ 0 inside.
  double excess(const Eigen::Vector2d& point, double normal_force) const;

  /// The shape, and what it needs; of a polygon the number of vertices and the box around them.
  std::string to_string() const;

  bool operator==(const Section& other) const;
  bool operator!=(const Section& other) const { return !(*this == other); }

 private:
  Shape shape_ = Shape::Rectangle;
  Eigen::Vector2d lower_ = Eigen::Vector2d::Zero(), upper_ = Eigen::Vector2d::Zero();
  double radius_ = 0.;
  std::shared_ptr<const Eigen::Matrix2Xd> vertices_;  // of a polygon; copies allocate nothing
};

/// The convex set of the forces λ that a contact can give, in its surface's frame: of points
/// (f_x, f_y, f_z) [N], of surfaces and grasps (f_x, f_y, f_z, τ_x, τ_y, τ_z) [N], [N·m].
///
/// Of points and surfaces, with the normal force f_z between its bounds, and sections that grow
/// with it,
///
///     lo ≤ f_z ≤ hi,   (f_x, f_y) ∈ f_z F,   (τ_x, τ_y) ∈ f_z P,   |τ_z| ≤ γ f_z,
///
/// F is the friction: Coulomb's cone of radius μ is a disc, pyramids are polygons. P are the
/// moments of a force at the places of the surface, (y, −x). Of grasps, each component is between
/// bounds of its own. Equations (24) to (26) in docs/equations.md.
class DYNACOM_EXPORT ContactSet {
 public:
  enum class Kind { Point, Surface, Grasp };
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();

  /// A frictionless point.
  ContactSet() = default;
  /// @param friction  F
  static ContactSet point(const Section& friction);
  /// @param friction  F
  /// @param places    where pressure may be [m]; P is that, turned by −90°
  /// @param gamma     γ [m]
  /// @throws std::invalid_argument unless γ is finite and ≥ 0
  static ContactSet surface(const Section& friction, const Section& places, double gamma);
  /// @throws std::invalid_argument if a bound is NaN, or lower > upper
  static ContactSet grasp(const Vector6& lower, const Vector6& upper);

  /// Of points and surfaces: bounds of f_z [N].
  /// @throws std::invalid_argument unless 0 ≤ least ≤ greatest, and least is finite, or if it is a
  ///         grasp
  void boundNormalForce(double least, double greatest);

  Kind kind() const { return kind_; }
  /// Number of components of λ: 3 or 6.
  Eigen::Index size() const { return kind_ == Kind::Point ? 3 : 6; }
  const Section& friction() const { return friction_; }  ///< F
  const Section& moments() const { return moments_; }    ///< P
  double gamma() const { return gamma_; }
  /// Of each component; of points and surfaces, of the third only.
  const Vector6& lower() const { return lower_; }
  const Vector6& upper() const { return upper_; }

  /// Whether the set is a cone: points and surfaces without bounds, zero and scale among them.
  bool isCone() const;

  /// The largest value of ⟨direction, λ⟩, which may be infinite: the set's support function.
  /// @param direction  size()
  /// @param tolerance  what of the rate at which the value grows with f_z is rounding
  double support(const Eigen::Ref<const Eigen::VectorXd>& direction, double tolerance = 0.) const;
  /// By how much a force is outside: the largest of the inequalities above, with normals of length
  /// 1 in their sections; ≤ 0 inside.
  /// @param force  size()
  double excess(const Eigen::Ref<const Eigen::VectorXd>& force) const;

  /// The kind, and what it needs.
  std::string to_string() const;

  bool operator==(const ContactSet& other) const;
  bool operator!=(const ContactSet& other) const { return !(*this == other); }

 private:
  Kind kind_ = Kind::Point;
  Section friction_, moments_;
  double gamma_ = 0.;
  Vector6 lower_ = Vector6::Zero(), upper_ = Vector6::Constant(kInfinity);
};

/// Each written as by its to_string().
DYNACOM_EXPORT std::ostream& operator<<(std::ostream& out, const Section& section);
DYNACOM_EXPORT std::ostream& operator<<(std::ostream& out, const ContactSet& set);

}  // namespace dynacom
