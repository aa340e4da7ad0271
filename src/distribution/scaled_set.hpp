// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <memory>

#include "dynacom/contact_set.hpp"

namespace dynacom::internal {

/// A section in the coordinates x = W λ of the cost, over that of the normal force.
class ScaledSection {
 public:
  using Vector2 = Eigen::Vector2d;

  /// The projection p of a point g on z times the section, and how it changes with both.
  struct Response {
    Vector2 point = Vector2::Zero();
    Eigen::Matrix2d by_point = Eigen::Matrix2d::Zero();  ///< ∂p/∂g, symmetric
    Vector2 by_normal = Vector2::Zero();                 ///< ∂p/∂z
    double push = 0.;  ///< −∂/∂z of ½ ‖g − p‖²: what of g is beyond the section asks of z
    double stiffening = 0.;  ///< ∂²/∂z² of the same
  };

  /// How a face is spanned: points are z (offset + Σ cᵢ axesᵢ), and how `offset` turns with the
  /// direction that exposes the face.
  struct Span {
    Vector2 offset = Vector2::Zero();
    Eigen::Matrix2d axes = Eigen::Matrix2d::Zero();
    int count = 0;  ///< of the axes
  };

  ScaledSection() = default;
  /// @param scale  of each coordinate
  ScaledSection(const Section& section, const Vector2& scale);

  void project(const Vector2& point, double normal, Response& response) const;

  /// The support function.
  double support(const Vector2& direction) const;

  /// The face in whose points ⟨direction, p⟩ is largest.
  /// @param tolerance  what of a direction's components is rounding
  ScaledSection expose(const Vector2& direction, double tolerance) const;

  /// The face that a projection has come to at a normal force > 0: of a curved boundary the point
  /// that a direction exposes.
  /// @param point, by_point  of its response
  /// @param bend             ∂p/∂direction of that point; zero where the face stays
  ScaledSection hold(const Vector2& point, const Eigen::Matrix2d& by_point, double normal,
                     const Vector2& direction, Eigen::Matrix2d& bend) const;

  Span span() const;

 private:
  enum class Shape { Box, Disc, Ellipse, Segment, Polygon };
  /// Vertices, and of the edges that begin there outward normals of length 1, and how far they are
  /// from the origin.
  struct Polygon {
    Eigen::Matrix2Xd vertices, normals;
    Eigen::VectorXd offsets;
  };
  static ScaledSection segment(const Vector2& first, const Vector2& last);
  void projectOnSegment(const Vector2& point, double normal, Response& response) const;
  void projectOnEllipse(const Vector2& point, double normal, Response& response) const;
  void projectOnPolygon(const Vector2& point, double normal, Response& response) const;
  Vector2 findExposed(const Vector2& direction) const;

  Shape shape_ = Shape::Box;
  Vector2 lower_ = Vector2::Zero(), upper_ = Vector2::Zero();  // of a box; ends of a segment
  Vector2 radii_ = Vector2::Zero();
  std::shared_ptr<const Polygon> polygon_;  // copies of this allocate nothing
};

/// The set of a contact's forces in the coordinates x = W λ of the cost.
class ScaledSet {
 public:
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  /// The projection of a point on the set, and its generalised Jacobian, which is symmetric:
  ///
  ///     ∂x/∂g = diag(of_force, of_moment) + growth growthᵀ / stiffness
  struct Response {
    Vector6 force = Vector6::Zero();
    Eigen::Matrix3d of_force = Eigen::Matrix3d::Zero(), of_moment = Eigen::Matrix3d::Zero();
    Vector6 growth = Vector6::Zero();  ///< by which a normal force that is free takes the others
    double inverse_stiffness = 0.;
  };

  /// Forces of a face are fixed + Σ cᵢ axesᵢ.
  struct Span {
    Vector6 fixed = Vector6::Zero();
    Eigen::Matrix<double, 6, 6> axes = Eigen::Matrix<double, 6, 6>::Zero();
    int count = 0;
  };

  ScaledSet() = default;
  /// @param weights  W; of points the first three count
  ScaledSet(const ContactSet& set, const Vector6& weights);

  /// Takes bounds anew.
  /// @param set, weights  of the constructor
  /// @param unit          of forces, which those of the set are divided by [N]
  void setUnit(const ContactSet& set, const Vector6& weights, double unit);

  /// @param point  six components, of points the first three
  void project(const Vector6& point, Response& response) const;

  /// The largest value of ⟨direction, x⟩.
  /// @param tolerance  what of the components, and of the rate at which it grows with the normal
  ///                   force, is rounding
  double support(const Vector6& direction, double tolerance) const;

  /// The face whose points ⟨direction, x⟩ is largest in.
  /// @return false if there is none, because that has no limit
  bool expose(const Vector6& direction, double tolerance, ScaledSet& face) const;

  /// The face that a projection has come to, see ScaledSection::hold().
  /// @param of_force, of_moment  ∂x/∂direction of the points on curved boundaries
  void hold(const Response& response, const Vector6& direction, ScaledSet& face,
            Eigen::Matrix3d& of_force, Eigen::Matrix3d& of_moment) const;

  Span span() const;

 private:
  /// The projections at a normal force.
  struct Parts {
    ScaledSection::Response friction, moments;
    double yaw, yaw_growth;
    double push, stiffness;  ///< sums of the parts', the latter with that of the normal force
  };
  void projectAt(const Vector6& point, double normal, Parts& parts) const;
  bool findNormal(const Vector6& point, double& normal, Parts& parts) const;
  double findRate(const Vector6& direction) const;

  bool is_grasp_ = false;
  int size_ = 3;
  ScaledSection friction_, moments_;
  Eigen::Vector2d yaw_ = Eigen::Vector2d::Zero();  // bounds, over the normal force
  Vector6 lower_ = Vector6::Zero(), upper_ = Vector6::Zero();
};

}  // namespace dynacom::internal
