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
  for (auto* matrix : {&of_momentum_, &by_q_, &by_v_, &by_a_, &by_step_})
    matrix->setZero(6, model.nv);
  for (std::size_t k = 0; k < points_.size(); ++k) {
    const pinocchio::JointIndex joint = points_[k].joint;
    const auto body = std::find_if(bodies_.begin(), bodies_.end(),
                                   [&](const PointedBody& other) { return other.joint == joint; });
    const std::uint32_t own = std::uint32_t(1) << k;
    if (body == bodies_.end())
      bodies_.push_back({joint, own});
    else
      body->points |= own;
  }
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
  linear.arms.resize(3, Index(points_.size()));
  for (std::size_t k = 0; k < points_.size(); ++k) {
    const pinocchio::SE3& body = data_.oMi[points_[k].joint];
    linear.arms.col(Index(k)) = body.rotation() * points_[k].place;
    linear.points.col(Index(k)) = body.translation() + linear.arms.col(Index(k));
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
  linear.of_bodies.resize(bodies_.size());
  linear.terms.assign(1, {frame, by_q_ / weight_});
  for (const Difference& difference : differences_) {
    by_step_ = (difference.velocity * by_v_ + difference.acceleration * by_a_) / weight_;
    pinocchio::dDifference(model_, q.col(frame), q.col(difference.other), by_here_,
                           pinocchio::ARG0);
    pinocchio::dDifference(model_, q.col(frame), q.col(difference.other), by_other_,
                           pinocchio::ARG1);
    LinearizedFrame::Term& other = linear.terms.emplace_back();
    other.frame = difference.other;
    other.derivative.resize(6, model_.nv);
    // A joint's part of a step depends on the joint alone.
    for (std::size_t joint = 1; joint < std::size_t(model_.njoints); ++joint) {
      const Index v = model_.idx_vs[joint], nv = model_.nvs[joint];
      const auto by_own = by_step_.middleCols(v, nv);
      linear.terms[0].derivative.middleCols(v, nv) +=
          by_own.lazyProduct(by_here_.block(v, v, nv, nv));
      other.derivative.middleCols(v, nv) = by_own.lazyProduct(by_other_.block(v, v, nv, nv));
    }
  }
  std::sort(linear.terms.begin(), linear.terms.end(),
            [](const auto& one, const auto& other) { return one.frame < other.frame; });
  linearizePoints(asked, linear);
}

void MotionLinearizer::linearizePoints(std::uint32_t asked, LinearizedFrame& linear) {
  for (std::size_t k = 0; k < bodies_.size(); ++k) {
    if ((bodies_[k].points & asked) == 0) continue;
    linear.of_bodies[k].setZero(6, model_.nv);
    pinocchio::getJointJacobian(model_, data_, bodies_[k].joint, pinocchio::LOCAL_WORLD_ALIGNED,
                                linear.of_bodies[k]);
  }
}

Eigen::Matrix3Xd MotionLinearizer::findPointJacobian(const LinearizedFrame& linear,
                                                     Index point) const {
  const auto own = std::find_if(bodies_.begin(), bodies_.end(), [&](const PointedBody& body) {
    return (body.points >> point & 1u) != 0;
  });
  const auto& jacobian = linear.of_bodies[std::size_t(own - bodies_.begin())];
  return jacobian.topRows<3>() -
         pinocchio::skew(Eigen::Vector3d(linear.arms.col(point))) * jacobian.bottomRows<3>();
}

}  // namespace dynacom::internal
