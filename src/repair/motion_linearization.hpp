// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <pinocchio/multibody.hpp>
#include <vector>

namespace dynacom::internal {

/// A point of a robot that may push, and where it is fixed.
struct BodyPoint {
  pinocchio::JointIndex joint;
  Eigen::Vector3d place;  // in the joint's frame
  double drop = 0.;       // how far below that it touches, whatever the joint's orientation
};

/// A body that has points.
struct PointedBody {
  pinocchio::JointIndex joint;
  std::uint32_t points;  // a bit for each
};

/// What a frame of a motion needs, and how that changes with the configurations, in their tangent
/// spaces. Wrenches are about the CoM, over the weight m g.
struct LinearizedFrame {
  /// A derivative of the wrench by the configuration of some frame, 6 × nv.
  struct Term {
    Eigen::Index frame;
    Eigen::Matrix<double, 6, Eigen::Dynamic> derivative;
  };

  Eigen::Matrix<double, 6, 1> wrench;
  std::vector<Term> terms;  // of the frame and those that its differences reach, in order
  Eigen::Vector3d com;
  Eigen::Matrix3Xd of_com;  // its derivative, 3 × nv
  Eigen::Matrix3Xd points;  // places in the world
  Eigen::Matrix3Xd arms;    // of points, from where the Jacobians of their bodies are
  // Of bodies that have points that were asked for: linear, then angular velocity in the world.
  std::vector<Eigen::Matrix<double, 6, Eigen::Dynamic>> of_bodies;

  Term& own(Eigen::Index frame);
};

/// Whether each component of a model's velocities displaces, and turns nothing.
Eigen::Array<bool, Eigen::Dynamic, 1> findSliding(const pinocchio::Model& model);

/// Linearizes motions whose velocities and accelerations are those of differentiate().
class MotionLinearizer {
 public:
  /// @param model  must outlive this
  MotionLinearizer(const pinocchio::Model& model, std::vector<BodyPoint> points);

  const std::vector<BodyPoint>& points() const { return points_; }
  const std::vector<PointedBody>& bodies() const { return bodies_; }

  /// What a frame of a motion needs that has four at least, and where its points are: nothing of
  /// the derivatives.
  void evaluate(const Eigen::VectorXd& time, const Eigen::MatrixXd& q, Eigen::Index frame,
                LinearizedFrame& linear);

  /// Linearizes a frame of a motion that has four at least.
  /// @param q         configurations, nq × frames
  /// @param asked     a bit for each point of whose body the Jacobian is asked for
  void linearize(const Eigen::VectorXd& time, const Eigen::MatrixXd& q, Eigen::Index frame,
                 std::uint32_t asked, LinearizedFrame& linear);

  /// Adds Jacobians of bodies of points, of the frame that was linearized last.
  void linearizePoints(std::uint32_t asked, LinearizedFrame& linear);

  /// The derivative of a point whose body was asked for, 3 × nv.
  Eigen::Matrix3Xd findPointJacobian(const LinearizedFrame& linear, Eigen::Index point) const;

  /// The frames whose configurations a frame's wrench depends on: the first and the last.
  static std::pair<Eigen::Index, Eigen::Index> findReach(Eigen::Index frame, Eigen::Index frames);

 private:
  // Velocities are Σ velocity (q_other ⊖ q), accelerations alike.
  struct Difference {
    Eigen::Index other;
    double velocity, acceleration;
  };

  void findDifferences(const Eigen::VectorXd& time, Eigen::Index frame);
  void findDerivatives(const Eigen::VectorXd& time, const Eigen::MatrixXd& q, Eigen::Index frame);
  void locate(LinearizedFrame& linear) const;

  const pinocchio::Model& model_;
  const std::vector<BodyPoint> points_;
  std::vector<PointedBody> bodies_;
  pinocchio::Data data_;
  double mass_ = 0., weight_ = 0.;
  std::vector<Difference> differences_;
  Eigen::VectorXd v_, a_, step_;
  Eigen::Matrix<double, 6, Eigen::Dynamic> of_momentum_, by_q_, by_v_, by_a_, by_step_;
  Eigen::MatrixXd by_here_, by_other_;
};

}  // namespace dynacom::internal
