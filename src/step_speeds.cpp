// SPDX-License-Identifier: BSD-2-Clause
#include "step_speeds.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "configuration_steps.hpp"
#include "motion_check.hpp"

namespace dynacom::internal {

namespace {

double median(Eigen::ArrayXd values) {
  double* const middle = values.data() + values.size() / 2;
  std::nth_element(values.data(), middle, values.data() + values.size());
  return *middle;
}

// What moves at a speed of its own: components of a step, and the greatest length that they make
// in a second.
struct Part {
  std::string name;
  std::vector<Eigen::Index> components;
  double limit;
};

// The root's place comes from configurations: the linear part of a step in its tangent space is
// longer where it turns.
constexpr Eigen::Index kRootPlace = 0, kRootOrientation = 3;

std::vector<Part> listParts(const pinocchio::Model& model, const Eigen::VectorXd& q,
                            const VerdictSettings& settings) {
  std::vector<Part> parts;
  const bool flies = hasFreeFlyer(model);
  const auto threeFrom = [](Eigen::Index first) {
    return std::vector<Eigen::Index>{first, first + 1, first + 2};
  };
  if (flies) {
    parts.push_back({"root", threeFrom(kRootPlace), settings.linear_speed});
    parts.push_back({"root's orientation", threeFrom(kRootOrientation), settings.turning_speed});
  }
  for (std::size_t k = flies ? 2 : 1; k < static_cast<std::size_t>(model.njoints); ++k) {
    const pinocchio::JointModel& joint = model.joints[k];
    pinocchio::JointData data = joint.createData();
    joint.calc(data, q);
    const Eigen::MatrixXd axes = data.S().matrix();
    std::vector<Eigen::Index> slides, turns;
    for (Eigen::Index i = 0; i < joint.nv(); ++i) {
      const bool is_linear = axes.col(i).tail<3>().isZero(0.);
      (is_linear ? slides : turns).push_back(joint.idx_v() + i);
    }
    if (!slides.empty()) parts.push_back({model.names[k], slides, settings.linear_speed});
    if (!turns.empty()) parts.push_back({model.names[k], turns, settings.joint_speed});
  }
  return parts;
}

}  // namespace

StepSpeeds measureStepSpeeds(const pinocchio::Model& model, const Eigen::VectorXd& time,
                             const Eigen::MatrixXd& q, const VerdictSettings& settings) {
  const Eigen::Index count = std::max<Eigen::Index>(q.cols() - 1, 0);
  StepSpeeds found = {Eigen::ArrayXd::Zero(count), ""};
  if (count == 0) return found;
  Eigen::ArrayXd durations = time.tail(count) - time.head(count);
  durations = durations.max(median(durations));

  const std::vector<Part> parts = listParts(model, q.col(0), settings);
  Eigen::MatrixXd steps = ConfigurationSteps(model).compute(q);
  if (hasFreeFlyer(model))
    steps.middleRows<3>(kRootPlace) =
        q.topRows<3>().rightCols(count) - q.topRows<3>().leftCols(count);
  double largest = 0.;
  for (Eigen::Index step = 0; step < count; ++step) {
    const auto moved = steps.col(step);
    double square = 0.;
    const Part* fastest = nullptr;
    for (const Part& part : parts) {
      double own = 0.;
      for (const Eigen::Index component : part.components)
        own += moved[component] * moved[component];
      own /= part.limit * part.limit;
      if (!(own > square)) continue;
      square = own;
      fastest = &part;
    }
    found.speed[step] = std::sqrt(square) / durations[step];
    if (!(found.speed[step] > largest)) continue;
    largest = found.speed[step];
    found.fastest = fastest->name;
  }
  return found;
}

}  // namespace dynacom::internal
