// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <pinocchio/multibody.hpp>
#include <vector>

namespace dynacom::internal {

/// A point that may push, and the joint on which it is.
struct BodyPoint {
  pinocchio::JointIndex joint;
  Eigen::Vector3d place;  // in the joint's frame
};

/// What a frame of a motion needs, and how that changes with small changes of the configurations,
/// in the tangent spaces at these. Wrenches are about the CoM, over the weight m g.
struct LinearizedFrame {
  using Matrix6X = Eigen::Matrix<double, 6, Eigen::Dynamic>;

  /// The derivative by the configuration of some frame.
  struct Term {
    Eigen::Index frame;
    Matrix6X derivative;  // 6 × nv
  };

  Eigen::Matrix<double, 6, 1> wrench;
  std::vector<Term> terms;  // of the frame and its neighbours, in order
  Eigen::Vector3d com;
  Eigen::Matrix3Xd points;  // places in the world
  Eigen::Matrix3Xd of_com;        // derivative of the CoM, 3 × nv
  std::vector<Eigen::Matrix3Xd> places;  // and of the points that it is asked for
};

/// Linearizes motions whose velocities and accelerations are those of differentiate().
class MotionLinearizer {
 public:
  MotionLinearizer(const pinocchio::Model& model, std::vector<BodyPoint> points);

  /// @param q     configurations, nq × frames; at least four
  /// @param sets  of each frame: a bit for each point whose derivative is asked for
  void run(const Eigen::VectorXd& time, const Eigen::MatrixXd& q,
           const std::vector<std::uint32_t>& sets, std::vector<LinearizedFrame>& found);

 private:
  // v = Σ velocity Δ(q, other), a = Σ acceleration Δ(q, other).
  struct Difference {
    Eigen::Index other;
    double velocity, acceleration;
  };
  void findDifferences(const Eigen::VectorXd& time, Eigen::Index frame);

  const pinocchio::Model& model_;
  const std::vector<BodyPoint> points_;
  pinocchio::Data data_;
  std::vector<Difference> differences_;
  Eigen::VectorXd v_, a_, step_;
  Eigen::Matrix<double, 6, Eigen::Dynamic> dh_dq_, by_q_, by_v_, by_a_, by_step_, jacobian_;
  Eigen::MatrixXd by_here_, by_other_;
};

}  // namespace dynacom::internal
