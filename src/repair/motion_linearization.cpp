// SPDX-License-Identifier: BSD-2-Clause
#include "motion_linearization.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <pinocchio/algorithm/centroidal-derivatives.hpp>
#include <pinocchio/algorithm/centroidal.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>

#include "../standard_gravity.hpp"

namespace dynacom::internal {

using Eigen::Index;

namespace {

Eigen::Matrix3d skew(const Eigen::Vector3d& a) {
  Eigen::Matrix3d matrix;
  matrix << 0., -a.z(), a.y(), a.z(), 0., -a.x(), -a.y(), a.x(), 0.;
  return matrix;
}

}  // namespace

MotionLinearizer::MotionLinearizer(const pinocchio::Model& model, std::vector<BodyPoint> points)
    : model_(model), points_(std::move(points)), data_(model) {
  v_.resize(model.nv);
  a_.resize(model.nv);
  step_.resize(model.nv);
  for (auto* matrix : {&dh_dq_, &by_q_, &by_v_, &by_a_, &by_step_, &jacobian_})
    matrix->setZero(6, model.nv);
  by_here_.setZero(model.nv, model.nv);
  by_other_.setZero(model.nv, model.nv);
}

// As differentiate() has it: the parabola through a frame and its neighbours; at both ends the
// polynomial of third order through four frames.
void MotionLinearizer::findDifferences(const Eigen::VectorXd& time, Index frame) {
  const Index last = time.size() - 1;
  differences_.clear();
  if (frame > 0 && frame < last) {
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
  // differences = coefficients powers
  const Eigen::Matrix3d inverse = powers.inverse();
  for (int k = 0; k < 3; ++k)
    differences_.push_back({frame + inward * (k + 1), inverse(k, 0), 2. * inverse(k, 1)});
}

void MotionLinearizer::run(const Eigen::VectorXd& time, const Eigen::MatrixXd& q,
                           const std::vector<std::uint32_t>& sets,
                           std::vector<LinearizedFrame>& found) {
  const Index frames = time.size();
  found.resize(static_cast<std::size_t>(frames));
  double mass = 0.;
  for (const pinocchio::Inertia& inertia : model_.inertias) mass += inertia.mass();
  const double weight = mass * kStandardGravity;
  for (Index frame = 0; frame < frames; ++frame) {
    LinearizedFrame& linear = found[static_cast<std::size_t>(frame)];
    findDifferences(time, frame);
    v_.setZero();
    a_.setZero();
    for (const Difference& difference : differences_) {
      pinocchio::difference(model_, q.col(frame), q.col(difference.other), step_);
      v_ += difference.velocity * step_;
      a_ += difference.acceleration * step_;
    }
    pinocchio::computeCentroidalDynamicsDerivatives(model_, data_, q.col(frame), v_, a_, dh_dq_,
                                                    by_q_, by_v_, by_a_);
    linear.com = data_.com[0];
    linear.of_com = by_a_.topRows<3>() / mass;
    linear.wrench << data_.dhg.linear() - mass * model_.gravity.linear(), data_.dhg.angular();
    linear.wrench /= weight;

    linear.terms.assign(1, {frame, by_q_ / weight});
    for (const Difference& difference : differences_) {
      by_step_ = (difference.velocity * by_v_ + difference.acceleration * by_a_) / weight;
      pinocchio::dDifference(model_, q.col(frame), q.col(difference.other), by_here_,
                             pinocchio::ARG0);
      pinocchio::dDifference(model_, q.col(frame), q.col(difference.other), by_other_,
                             pinocchio::ARG1);
      linear.terms[0].derivative.noalias() += by_step_ * by_here_;
      linear.terms.push_back({difference.other, by_step_ * by_other_});
    }
    std::sort(linear.terms.begin(), linear.terms.end(),
              [](const auto& one, const auto& other) { return one.frame < other.frame; });

    const std::uint32_t set = sets[static_cast<std::size_t>(frame)];
    linear.points.resize(3, Index(points_.size()));
    linear.places.resize(points_.size());
    pinocchio::JointIndex joint = 0;
    for (std::size_t k = 0; k < points_.size(); ++k) {
      const BodyPoint& point = points_[k];
      linear.points.col(Index(k)) = data_.oMi[point.joint].act(point.place);
      if (!(set >> k & 1u)) continue;
      if (joint != point.joint) {
        jacobian_.setZero();
        pinocchio::getJointJacobian(model_, data_, point.joint, pinocchio::LOCAL_WORLD_ALIGNED,
                                    jacobian_);
        joint = point.joint;
      }
      const Eigen::Vector3d arm =
          linear.points.col(Index(k)) - data_.oMi[point.joint].translation();
      linear.places[k] = jacobian_.topRows<3>() - skew(arm) * jacobian_.bottomRows<3>();
    }
  }
}

}  // namespace dynacom::internal
