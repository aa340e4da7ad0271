// SPDX-License-Identifier: BSD-2-Clause
// Who sways too fast for its feet.
#pragma once

#include <cmath>
#include <optional>
#include <string>

#include "dynacom/motion_analysis.hpp"
#include "dynacom/motion_repair.hpp"
#include "feet.hpp"
#include "random_robot.hpp"

namespace dynacom_tests {

/// A body of 10 kg above two soles on massless legs, with an arm that turns.
struct Swayer {
  explicit Swayer(dynacom::FrictionModel friction = dynacom::FrictionModel::OuterPyramid,
                  double mu = 0.7) {
    model = singleBody(10., {});
    addFeet(model);
    const auto arm = model.addJoint(1, pinocchio::JointModelRY(),
                                    SE3(Matrix3d::Identity(), Vector3d(0., 0., 0.3)), "arm");
    model.appendBodyToJoint(arm, pinocchio::Inertia::FromSphere(2., 0.1),
                            SE3(Matrix3d::Identity(), Vector3d(0.3, 0., 0.)));
    setUpRobot(mu);
    split.emplace(dynacom::splitContacts(*robot, {}, friction));
  }

  /// The robot of the model, with soles on both feet; again, once that was changed.
  void setUpRobot(double mu = 0.7) {
    robot.emplace(model);
    for (const char* name : {"left", "right"})
      robot->addContact(makeSole(std::string(name) + "_foot", mu), name);
  }

  /// Stands with its feet side by side.
  dynacom::Motion stand(Index frames, double rate = 50.) const {
    Eigen::VectorXd q = Eigen::VectorXd::Zero(model.nq);
    q[2] = 0.7;
    q[6] = 1.;
    q.segment<6>(7) << 0., 0.1, -0.7, 0., -0.1, -0.7;
    q[13] = 1.5;  // the arm hangs down
    return dynacom::differentiate(model,
                                  Eigen::VectorXd::LinSpaced(frames, 0., double(frames - 1) / rate),
                                  q.replicate(1, frames));
  }

  /// The same, but that the body sways, too fast, and the feet stay where they are.
  dynacom::Motion sway(Index frames, double size = 0.06) const {
    dynacom::Motion motion = stand(frames);
    for (Index k = 0; k < frames; ++k) {
      const double x = size * std::sin(6. * motion.time[k]);
      motion.q(0, k) += x;
      motion.q(7, k) -= x;
      motion.q(10, k) -= x;
      motion.q(13, k) += 0.3 * std::sin(2. * motion.time[k]);
    }
    return dynacom::differentiate(model, motion.time, motion.q);
  }

  dynacom::ContactSchedule schedule(Index frames) const {
    dynacom::ContactSchedule schedule;
    for (const dynacom::PartRobot::Part& part : split->parts) schedule.names.push_back(part.name);
    schedule.active.setConstant(Index(schedule.names.size()), frames, true);
    return schedule;
  }

  /// How many frames the analysis of a motion does not solve.
  Index countUnsolved(const dynacom::Motion& motion,
                      const dynacom::ContactSchedule& schedule) const {
    Index count = 0;
    for (const dynacom::DistributionStatus status :
         dynacom::analyzeMotion(split->robot, motion, schedule).status)
      if (status != dynacom::DistributionStatus::Solved) ++count;
    return count;
  }

  pinocchio::Model model;
  std::optional<dynacom::DynaCoM> robot;
  std::optional<dynacom::PartRobot> split;
};

}  // namespace dynacom_tests
