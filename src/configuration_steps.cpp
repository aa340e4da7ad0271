// SPDX-License-Identifier: BSD-2-Clause
#include "configuration_steps.hpp"

#include <algorithm>
#include <pinocchio/algorithm/joint-configuration.hpp>

namespace dynacom::internal {

ConfigurationSteps::ConfigurationSteps(const pinocchio::Model& model) : nv_(model.nv) {
  for (std::size_t k = 1; k < static_cast<std::size_t>(model.njoints); ++k) {
    const pinocchio::JointModel& joint = model.joints[k];
    const Range range = {joint.idx_q(), joint.nq(), joint.idx_v(), joint.nv()};
    if (range.nq != range.nv) {
      curved_.push_back(range);
      model_.addJoint(0, joint, pinocchio::SE3::Identity(), model.names[k]);
    } else if (!numbers_.empty() && numbers_.back().q + numbers_.back().nq == range.q &&
               numbers_.back().v + numbers_.back().nv == range.v) {
      numbers_.back().nq += range.nq;
      numbers_.back().nv += range.nv;
    } else {
      numbers_.push_back(range);
    }
  }
}

Eigen::MatrixXd ConfigurationSteps::compute(const Eigen::MatrixXd& q) const {
  const Eigen::Index count = std::max<Eigen::Index>(q.cols() - 1, 0);
  Eigen::MatrixXd steps(nv_, count);
  for (const Range& range : numbers_) {
    const auto rows = q.middleRows(range.q, range.nq);
    steps.middleRows(range.v, range.nv) = rows.rightCols(count) - rows.leftCols(count);
  }
  if (curved_.empty()) return steps;

  Eigen::VectorXd from(model_.nq), to(model_.nq), step(model_.nv);
  const auto gather = [&](Eigen::Index frame, Eigen::VectorXd& part) {
    Eigen::Index first = 0;
    for (const Range& range : curved_) {
      part.segment(first, range.nq) = q.col(frame).segment(range.q, range.nq);
      first += range.nq;
    }
  };
  if (count > 0) gather(0, to);
  for (Eigen::Index frame = 0; frame < count; ++frame) {
    from.swap(to);
    gather(frame + 1, to);
    pinocchio::difference(model_, from, to, step);
    Eigen::Index first = 0;
    for (const Range& range : curved_) {
      steps.col(frame).segment(range.v, range.nv) = step.segment(first, range.nv);
      first += range.nv;
    }
  }
  return steps;
}

}  // namespace dynacom::internal
