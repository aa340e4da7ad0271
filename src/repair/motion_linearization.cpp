// SPDX-License-Identifier: BSD-2-Clause
#include "motion_linearization.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <pinocchio/algorithm/centroidal-derivatives.hpp>
#include <pinocchio/algorithm/centroidal.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/spatial.hpp>
#include <utility>

#include "../standard_gravity.hpp"

namespace dynacom::internal {

using Eigen::Index;

Eigen::Array<bool, Eigen::Dynamic, 1> findSliding(const pinocchio::Model& model) {
  pinocchio::Data data(model);
  pinocchio::computeJointJacobians(model, data, pinocchio::neutral(model));
  return data.J.bottomRows<3>().colwise().norm().transpose().array() < 1e-9;
}

LinearizedFrame::Term& LinearizedFrame::own(Index frame) {
  return *std::find_if(terms.begin(), terms.end(),
                       [&](const Term& term) { return term.frame == frame; });
}

MotionLinearizer::MotionLinearizer(const pinocchio::Model& model, std::vector<BodyPoint> points)
    : model_(model), points_(std::move(points)), data_(model) {
  for (const pinocchio::Inertia& inertia : model.inertias) mass_ += inertia.mass();
  weight_ = mass_ * findUnitGravity(model.gravity.linear());
  for (Eigen::VectorXd* vector : {&v_, &a_, &step_}) vector->setZero(model.nv);
  for (auto* matrix : {&of_momentum_, &by_q_, &by_v_, &by_a_, &by_step_, &jacobian_})
    matrix->setZero(6, model.nv);
  for (Eigen::MatrixXd* matrix : {&by_here_, &by_other_}) matrix->setZero(model.nv, model.nv);
}

std::pair<Index, Index> MotionLinearizer::findReach(Index frame, Index frames) {
  if (frame == 0) return {0, 3};
  if (frame == frames - 1) return {frames - 4, frames - 1};
  return {frame - 1, frame + 1};
}

// As differentiate() has it: of the parabola through a frame and its neighbours, and at both ends
// of the polynomial of third order through four frames.
void MotionLinearizer::findDifferences(const Eigen::VectorXd& time, Index frame) {
  differences_.clear();
  if (frame > 0 && frame < time.size() - 1) {
    const double s1 = time[frame - 1] - time[frame], s2 = time[frame + 1] - time[frame];
    const double first = -2. / (s1 * (s2 - s1)), second = 2. / (s2 * (s2 - s1));
    differences_.push_back({frame - 1, 1. / s1 - 0.5 * s1 * first, first});
    differences_.push_back({frame + 1, -0.5 * s1 * second, second});
    return;
  }
  const int inward = frame == 0 ? 1 : -1;
  Eigen::Matrix3d powers;
  for (int k = 0; k < 3; ++k)
    for (int power = 0; power < 3; ++power)
      powers(power, k) = std::pow(time[frame + inward * (k + 1)] - time[frame], power + 1);
  const Eigen::Matrix3d inverse = powers.inverse();
  for (int k = 0; k < 3; ++k)
    differences_.push_back({frame + inward * (k + 1), inverse(k, 0), 2. * inverse(k, 1)});
}

void MotionLinearizer::findDerivatives(const Eigen::VectorXd& time, const Eigen::MatrixXd& q,
                                       Index frame) {
  findDifferences(time, frame);
  v_.setZero();
  a_.setZero();
  for (const Difference& difference : differences_) {
    pinocchio::difference(model_, q.col(frame), q.col(difference.other), step_);
    v_ += difference.velocity * step_;
    a_ += difference.acceleration * step_;
  }
}

void MotionLinearizer::locate(LinearizedFrame& linear) const {
  linear.com = data_.com[0];
  linear.wrench << data_.dhg.linear() - mass_ * model_.gravity.linear(), data_.dhg.angular();
  linear.wrench /= weight_;
  linear.points.resize(3, Index(points_.size()));
  for (std::size_t k = 0; k < points_.size(); ++k) {
    linear.points.col(Index(k)) = data_.oMi[points_[k].joint].act(points_[k].place);
    linear.points(2, Index(k)) -= points_[k].drop;
  }
}

void MotionLinearizer::evaluate(const Eigen::VectorXd& time, const Eigen::MatrixXd& q, Index frame,
                                LinearizedFrame& linear) {
  findDerivatives(time, q, frame);
  pinocchio::computeCentroidalMomentumTimeVariation(model_, data_, q.col(frame), v_, a_);
  locate(linear);
}

void MotionLinearizer::linearize(const Eigen::VectorXd& time, const Eigen::MatrixXd& q, Index frame,
                                 std::uint32_t asked, LinearizedFrame& linear) {
  findDerivatives(time, q, frame);
  pinocchio::computeCentroidalDynamicsDerivatives(model_, data_, q.col(frame), v_, a_, of_momentum_,
                                                  by_q_, by_v_, by_a_);
  locate(linear);
  linear.of_com = by_a_.topRows<3>() / mass_;
  linear.of_points.resize(points_.size());
  linear.terms.assign(1, {frame, by_q_ / weight_});
  for (const Difference& difference : differences_) {
    by_step_ = (difference.velocity * by_v_ + difference.acceleration * by_a_) / weight_;
    pinocchio::dDifference(model_, q.col(frame), q.col(difference.other), by_here_,
                           pinocchio::ARG0);
    pinocchio::dDifference(model_, q.col(frame), q.col(difference.other), by_other_,
                           pinocchio::ARG1);
    linear.terms[0].derivative.noalias() += by_step_ * by_here_;
    linear.terms.push_back({difference.other, by_step_ * by_other_});
  }
  std::sort(linear.terms.begin(), linear.terms.end(),
            [](const auto& one, const auto& other) { return one.frame < other.frame; });
  linearizePoints(asked, linear);
}

void MotionLinearizer::linearizePoints(std::uint32_t asked, LinearizedFrame& linear) {
  pinocchio::JointIndex joint = 0;  // of the Jacobian
  for (std::size_t k = 0; k < points_.size(); ++k) {
    if (!(asked >> k & 1u)) continue;
    if (joint != points_[k].joint) {
      joint = points_[k].joint;
      jacobian_.setZero();
      pinocchio::getJointJacobian(model_, data_, joint, pinocchio::LOCAL_WORLD_ALIGNED, jacobian_);
    }
    const Eigen::Vector3d arm = data_.oMi[joint].rotation() * points_[k].place;
    linear.of_points[k] = jacobian_.topRows<3>() - pinocchio::skew(arm) * jacobian_.bottomRows<3>();
  }
}

}  // namespace dynacom::internal
