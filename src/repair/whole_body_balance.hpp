// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "../inference/cone_projection.hpp"
#include "block_band.hpp"
#include "motion_linearization.hpp"

namespace dynacom::internal {

struct BalanceProblem {
  Eigen::VectorXd time;
  Eigen::MatrixXd q;
  std::vector<double> mu;
  std::vector<std::uint32_t> sets;
  Eigen::Array<bool, Eigen::Dynamic, 1> free;
  std::vector<std::uint32_t> held;       // points that are to be at their targets, at least those of sets
  std::vector<Eigen::Matrix3Xd> targets; // of each point 3 × frames
  double hold = 0.;                      // cost of the square of what they are off
};

struct BalanceCosts {
  Eigen::VectorXd change, acceleration;  // σ of each component of the tangent space
  double friction_margin = 0.02, support_margin = 0.001;
};

class WholeBodyBalance {
 public:
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  WholeBodyBalance(const pinocchio::Model& model, std::vector<BodyPoint> points,
                   const BalanceProblem& problem, const BalanceCosts& costs);
  void solve();
  const Eigen::MatrixXd& q() const { return q_; }
  const Eigen::MatrixXd& change() const { return change_; }
  double worst() const { return worst_; }
  double heldRms() const { return held_rms_; }
  double heldWorst() const { return held_worst_; }

 private:
  using Matrix6X = Eigen::Matrix<double, 6, Eigen::Dynamic>;
  void linearize();
  bool factorize(double penalty, bool cost);
  void project(bool relax);
  void iterate(bool cost);
  void apply();
  double flightFactor(Eigen::Index frame) const {
    return problem_.sets[std::size_t(frame)] ? 1. : 300.;
  }

  const pinocchio::Model& model_;
  const BalanceProblem& problem_;
  const BalanceCosts& costs_;
  MotionLinearizer linearizer_;
  ConeProjection projection_;
  std::vector<LinearizedFrame> frames_;
  std::vector<double> mu_;
  std::vector<double> durations_;
  std::vector<Eigen::Vector3d> differences_;  // second: before, here, after
  Eigen::MatrixXd q_, change_, at_;           // at_: the change at which frames_ are linearised
  Eigen::MatrixXd step_;
  Matrix6X moved_, given_, dual_;
  std::vector<ConeProjection::Answer> answers_;
  double penalty_ = 0.;
  BlockBand<Eigen::Dynamic> system_;
  double worst_ = 0.;
  std::vector<Eigen::Matrix3Xd> off_;
  double held_rms_ = 0., held_worst_ = 0.;
};

}  // namespace dynacom::internal
