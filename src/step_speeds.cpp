// SPDX-License-Identifier: BSD-2-Clause
#include "step_speeds.hpp"

#include <algorithm>

#include "configuration_steps.hpp"
#include "motion_check.hpp"

namespace dynacom::internal {

namespace {

double median(Eigen::ArrayXd values) {
  double* const middle = values.data() + values.size() / 2;
  std::nth_element(values.data(), middle, values.data() + values.size());
  return *middle;
}

}  // namespace

StepSpeeds measureStepSpeeds(const pinocchio::Model& model, const Eigen::VectorXd& time,
                             const Eigen::MatrixXd& q, const VerdictSettings& settings) {
  const Eigen::Index count = std::max<Eigen::Index>(q.cols() - 1, 0);
  StepSpeeds found = {Eigen::ArrayXd::Zero(count), ""};
  if (count == 0) return found;
  Eigen::ArrayXd durations = time.tail(count) - time.head(count);
  durations = durations.max(median(durations));

  double largest = 0.;
  const auto take = [&](const std::string& name, const auto& moved, double limit) {
    const Eigen::ArrayXd speed = moved / (limit * durations);
    const double own = speed.maxCoeff();
    if (own > largest) {
      largest = own;
      found.fastest = name;
    }
    found.speed = found.speed.max(speed);
  };
  const Eigen::MatrixXd steps = ConfigurationSteps(model).compute(q);
  const auto norms = [](const auto& rows) {
    return rows.colwise().norm().transpose().array().eval();
  };
  const bool flies = hasFreeFlyer(model);
  if (flies) {  // the linear part of a step in its tangent space is longer where it turns
    take("root", norms(q.topRows<3>().rightCols(count) - q.topRows<3>().leftCols(count)),
         settings.linear_speed);
    take("root's orientation", norms(steps.middleRows<3>(3)), settings.turning_speed);
  }
  for (std::size_t k = flies ? 2 : 1; k < static_cast<std::size_t>(model.njoints); ++k) {
    const pinocchio::JointModel& joint = model.joints[k];
    pinocchio::JointData data = joint.createData();
    joint.calc(data, q.col(0));
    const Eigen::MatrixXd axes = data.S().matrix();
    Eigen::ArrayXd slides = Eigen::ArrayXd::Zero(count), turns = slides;
    bool is_prismatic = false, is_revolute = false;
    for (Eigen::Index i = 0; i < joint.nv(); ++i) {
      const auto squares = steps.row(joint.idx_v() + i).transpose().array().square();
      const bool is_linear = axes.col(i).tail<3>().isZero(0.);
      (is_linear ? slides : turns) += squares;
      (is_linear ? is_prismatic : is_revolute) = true;
    }
    if (is_prismatic) take(model.names[k], slides.sqrt(), settings.linear_speed);
    if (is_revolute) take(model.names[k], turns.sqrt(), settings.joint_speed);
  }
  return found;
}

}  // namespace dynacom::internal
