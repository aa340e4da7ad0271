// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/contact_schedule.hpp"

#include <algorithm>
#include <utility>

#include "check.hpp"
#include "motion_sweep.hpp"

namespace dynacom {

using internal::requireField;
using internal::throwInvalid;

void ContactSchedule::validate(Eigen::Index frames) const {
  for (auto name = names.begin(); name != names.end(); ++name)
    if (std::find(names.begin(), name, *name) != name)
      throwInvalid("the schedule names the contact '", *name, "' twice");
  internal::requireSize("active", active.rows(), Eigen::Index(names.size()), "contacts");
  internal::requireSize("active", active.cols(), frames, "frames");
  for (const auto& [name, values] :
       {std::pair("confidence", &confidence), std::pair("readiness", &readiness)}) {
    if (values->size() == 0) continue;
    internal::requireSize(name, values->rows(), active.rows(), "contacts");
    internal::requireSize(name, values->cols(), frames, "frames");
  }
  const auto requireRange = [](const char* name, const Eigen::MatrixXd& values, bool may_be_zero) {
    for (Eigen::Index frame = 0; frame < values.cols(); ++frame)
      for (Eigen::Index row = 0; row < values.rows(); ++row) {
        const double value = values(row, frame);
        if (!((may_be_zero ? value >= 0. : value > 0.) && value <= 1.))
          throwInvalid(name, " must be ", may_be_zero ? ">= 0" : "> 0", " and <= 1, got ", value,
                       " in frame ", frame);
      }
  };
  requireRange("confidence", confidence, true);
  requireRange("readiness", readiness, false);
}

std::vector<ContactMotion> computeContactMotions(const DynaCoM& robot, const Motion& motion,
                                                 int threads, int lanes) {
  requireField(threads >= 0, "threads", ">= 0", threads);
  requireField(lanes >= 1, "lanes", ">= 1", lanes);
  if (!robot.isInitialized())
    throw NotReadyError("DynaCoM is used by computeContactMotions before initialize()");
  const pinocchio::Model& model = robot.getModel();
  motion.validate(model);
  internal::DataPool data([&] { return std::make_unique<pinocchio::Data>(model); });
  const internal::MotionSweep sweep(model, internal::describeCarrier(robot).contacts, lanes, data);
  internal::Workers workers(threads);
  std::vector<ContactMotion> contacts;
  sweep.run(motion, workers, contacts, nullptr);
  return contacts;
}

}  // namespace dynacom
