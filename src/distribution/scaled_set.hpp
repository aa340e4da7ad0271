// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "dynacom/contact_set.hpp"

namespace dynacom::internal {

/// A section in the coordinates x = W λ of the cost, over that of the normal force.
class ScaledSection {
 public:
  using Vector2 = Eigen::Vector2d;

  /// The projection p of a point g on z times the section, and how it changes with both.
  struct Response {
    Vector2 point = Vector2::Zero();
    bool is_free = false;             ///< whether ∂p/∂g = 1
    Vector2 along = Vector2::Zero();  ///< else it is along alongᵀ: on a boundary of one dimension
    Vector2 by_normal = Vector2::Zero();  ///< ∂p/∂z
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

  /// Whether components have bounds of their own: then they are theirs to look after.
  bool isBox() const { return shape_ == Shape::Box; }
  /// Of boxes.
  const Vector2& lower() const { return lower_; }
  const Vector2& upper() const { return upper_; }

  /// Of sections that are no boxes.
  void project(const Vector2& point, double normal, Response& response) const;

  /// The support function.
  double support(const Vector2& direction) const;

  /// How far it reaches from the origin along each axis.
  Vector2 findExtent() const;

  /// The face in whose points ⟨direction, p⟩ is largest.
  /// @param rounding  what may be rounding of each component of the direction
  ScaledSection expose(const Vector2& direction, const Vector2& rounding) const;

  /// The face that a projection has come to at a normal force > 0: of a curved boundary the point
  /// that a direction exposes.
  /// @param free, along  of the set's response
  /// @param bend         ∂p/∂direction of that point is bend bendᵀ; zero where the face stays
  ScaledSection hold(const Vector2& point, const Vector2& free, const Vector2& along, double normal,
                     const Vector2& direction, Vector2& bend) const;

  Span span() const;

  /// See ScaledSet::findBounds().
  Eigen::Matrix<signed char, 2, 1> findBounds(const Vector2& point, const Vector2& free,
                                              double normal, const Vector2& pull) const;

 private:
  enum class Shape { Box, Disc, Ellipse, Segment, Polygon };
  /// A side of a polygon.
  struct Edge {
    Vector2 first = Vector2::Zero(), last = Vector2::Zero();  ///< counter-clockwise
    Vector2 outward = Vector2::Zero();                        ///< its normal, of length 1
    double offset = 0.;                                       ///< ⟨outward, first⟩
    double begin = 0., end = 0.;  ///< ⟨along, first⟩, ⟨along, last⟩

    Edge() = default;
    Edge(const Vector2& first_vertex, const Vector2& last_vertex);
    Vector2 along() const { return Vector2(-outward.y(), outward.x()); }
    void project(const Vector2& point, double normal, Response& response) const;
  };
  explicit ScaledSection(const Edge& edge);
  void projectOnEllipse(const Vector2& point, double normal, Response& response) const;
  const Edge* findEdge(const Vector2& point, double normal) const;
  Vector2 findExposed(const Vector2& direction) const;

  Shape shape_ = Shape::Box;
  Vector2 lower_ = Vector2::Zero(), upper_ = Vector2::Zero();  // of a box
  Vector2 radii_ = Vector2::Zero();
  Edge edge_;                                         // of a segment
  std::shared_ptr<const std::vector<Edge>> polygon_;  // copies of this allocate nothing
};

/// The set of a contact's forces in the coordinates x = W λ of the cost.
class ScaledSet {
 public:
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  /// The projection of a point on the set, and its generalised Jacobian, which is symmetric:
  ///
  ///     ∂x/∂g = diag(free) + along alongᵀ of both sections + growth growthᵀ / stiffness
  ///
  /// or 1 where the point is inside, and nothing but the force is set.
  struct Response {
    Vector6 force = Vector6::Zero();
    bool is_free = false;
    Vector6 free = Vector6::Zero();  ///< 1 for components that follow the point, else 0
    Eigen::Vector2d friction_along = Eigen::Vector2d::Zero();
    Eigen::Vector2d moments_along = Eigen::Vector2d::Zero();
    Vector6 growth = Vector6::Zero();  ///< by which a normal force that is free takes the others
    double inverse_stiffness = 0.;
  };

  /// The points of curved boundaries that a direction exposes: ∂x/∂direction is friction frictionᵀ,
  /// moments momentsᵀ.
  struct Bend {
    Eigen::Vector2d friction = Eigen::Vector2d::Zero(), moments = Eigen::Vector2d::Zero();
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
  /// @param rounding  what may be rounding of each component of the direction
  double support(const Vector6& direction, const Vector6& rounding) const;

  /// The face whose points ⟨direction, x⟩ is largest in.
  /// @return false if there is none, because that has no limit
  bool expose(const Vector6& direction, const Vector6& rounding, ScaledSet& face) const;

  /// The face that a projection has come to, see ScaledSection::hold().
  void hold(const Response& response, const Vector6& direction, ScaledSet& face, Bend& bend) const;

  Span span() const;

  /// At which of its bounds each component of a projection is: −1, 1, or 0 between them. Of curved
  /// and slanted sections, both components are 1 on the boundary.
  /// @param response  of this set, or of one of its faces
  /// @param pull      says which bound it is where both are the same
  Eigen::Matrix<signed char, 6, 1> findBounds(const Response& response, const Vector6& pull) const;

 private:
  void gatherSlopes();
  void respond(const Vector6& point, double normal, Response& response, double& push,
               double& stiffness) const;
  void respondInSections(const Vector6& point, double normal, Response& response, double& push,
                         double& stiffness) const;
  double findRate(const Vector6& direction) const;
  double findRounding(const Vector6& rounding) const;

  bool is_grasp_ = false;
  int size_ = 3;
  ScaledSection friction_, moments_;
  bool are_boxes_ = true;  // whether both are
  // Bounds of components over the normal force: those of the yaw, and of sections that are boxes;
  // of others both are zero.
  Vector6 low_slopes_ = Vector6::Zero(), high_slopes_ = Vector6::Zero();
  Vector6 lower_ = Vector6::Zero(), upper_ = Vector6::Zero();
};

}  // namespace dynacom::internal
