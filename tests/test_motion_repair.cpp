// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE motion_repair
#include <cmath>
#include <limits>
#include <optional>

#include "dynacom/motion_analysis.hpp"
#include "dynacom/motion_repair.hpp"
#include "feet.hpp"
#include "random_robot.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

/// A body of 10 kg above two soles on massless legs, with an arm that turns.
struct Walker {
  Walker() {
    model = singleBody(10., {});
    addFeet(model);
    const auto arm = model.addJoint(1, pinocchio::JointModelRY(),
                                    SE3(Matrix3d::Identity(), Vector3d(0., 0., 0.3)), "arm");
    model.appendBodyToJoint(arm, pinocchio::Inertia::FromSphere(2., 0.1),
                            SE3(Matrix3d::Identity(), Vector3d(0.3, 0., 0.)));
    robot.emplace(model);
    for (const char* name : {"left", "right"})
      robot->addContact(makeSole(std::string(name) + "_foot"), name);
    split.emplace(splitContacts(*robot));
  }

  /// Stands with its feet side by side.
  Motion stand(Index frames, double rate = 50.) const {
    VectorXd q = VectorXd::Zero(model.nq);
    q[2] = 0.7;
    q[6] = 1.;
    q.segment<6>(7) << 0., 0.1, -0.7, 0., -0.1, -0.7;
    q[13] = 1.5;  // the arm hangs down
    return differentiate(model, VectorXd::LinSpaced(frames, 0., double(frames - 1) / rate),
                         q.replicate(1, frames));
  }

  /// The same, but that the body sways, too fast, and the feet stay where they are.
  Motion sway(Index frames, double size = 0.06) const {
    Motion motion = stand(frames);
    for (Index k = 0; k < frames; ++k) {
      const double x = size * std::sin(6. * motion.time[k]);
      motion.q(0, k) += x;
      motion.q(7, k) -= x;
      motion.q(10, k) -= x;
      motion.q(13, k) += 0.3 * std::sin(2. * motion.time[k]);
    }
    return differentiate(model, motion.time, motion.q);
  }

  ContactSchedule schedule(Index frames) const {
    ContactSchedule schedule;
    for (const PartRobot::Part& part : split->parts) schedule.names.push_back(part.name);
    schedule.active.setConstant(Index(schedule.names.size()), frames, true);
    return schedule;
  }

  /// How many frames the analysis of a motion does not solve.
  Index countUnsolved(const Motion& motion, const ContactSchedule& schedule) const {
    Index count = 0;
    for (const DistributionStatus status : analyzeMotion(split->robot, motion, schedule).status)
      if (status != DistributionStatus::Solved) ++count;
    return count;
  }

  pinocchio::Model model;
  std::optional<DynaCoM> robot;
  std::optional<PartRobot> split;
};

}  // namespace

BOOST_AUTO_TEST_CASE(what_contacts_can_give_comes_back_as_it_is) {
  const Walker walker;
  const Motion motion = walker.stand(40);
  const RepairedMotion repaired = repairMotion(*walker.split, motion, walker.schedule(40));
  BOOST_TEST(repaired.within_reach);
  BOOST_TEST((repaired.motion.q == motion.q));
  BOOST_TEST(repaired.change.isZero(0.));
  BOOST_TEST(repaired.root_rms == 0.);
  BOOST_TEST(repaired.stances.size() == 2u);
  for (const RepairedStance& stance : repaired.stances) {
    BOOST_TEST(!stance.is_still);  // nothing was done about it
    BOOST_TEST(stance.first == 0);
    BOOST_TEST(stance.behind == 40);
  }
}

BOOST_AUTO_TEST_CASE(who_sways_too_fast_is_held_back) {
  const Walker walker;
  const Motion motion = walker.sway(150);
  const ContactSchedule schedule = walker.schedule(150);
  BOOST_TEST(walker.countUnsolved(motion, schedule) > 30);
  const RepairedMotion repaired = repairMotion(*walker.split, motion, schedule);
  BOOST_TEST(repaired.within_reach);
  BOOST_TEST(walker.countUnsolved(repaired.motion, schedule) == 0);
  BOOST_TEST(repaired.root_rms > 1e-4);
  BOOST_TEST(repaired.root_largest < 0.06);
  BOOST_TEST(repaired.held_largest < 1e-3);
  BOOST_TEST(repaired.residual.colwise().norm().maxCoeff() < 1e-6 * 12. * 9.81);
  // And once more, there is nothing to be done.
  const RepairedMotion again = repairMotion(*walker.split, repaired.motion, schedule);
  BOOST_TEST((again.motion.q == repaired.motion.q));
}

BOOST_AUTO_TEST_CASE(in_flight_the_com_follows_its_parabola) {
  const Walker walker;
  Motion motion = walker.stand(60);
  // Up and down as gravity wants it, but for a few centimetres.
  const Index first = 20, behind = 40;
  ContactSchedule schedule = walker.schedule(60);
  schedule.active.middleCols(first, behind - first).setConstant(false);
  for (Index k = first; k < behind; ++k) {
    const double since = motion.time[k] - motion.time[first - 1],
                 until = motion.time[behind] - motion.time[k];
    motion.q(2, k) += 0.45 * 9.81 * since * until;
  }
  motion = differentiate(walker.model, motion.time, motion.q);
  const RepairedMotion repaired = repairMotion(*walker.split, motion, schedule);
  BOOST_TEST(repaired.within_reach);
  const MotionAnalysis analysis = analyzeMotion(walker.split->robot, repaired.motion, schedule);
  for (Index k = first; k < behind; ++k) {
    BOOST_TEST(close(analysis.acom.col(k), Vector3d(0., 0., -9.81), 1e-6));
    BOOST_TEST(close(analysis.dam.col(k), Vector3d::Zero(), 1e-6));
  }
}

BOOST_AUTO_TEST_CASE(feet_that_skate_a_little_stand_still) {
  const Walker walker;
  Motion motion = walker.sway(100);
  for (Index k = 0; k < 100; ++k) motion.q(7, k) += 0.01 * std::sin(3. * motion.time[k]);
  const ContactSchedule schedule = walker.schedule(100);
  const RepairedMotion repaired = repairMotion(*walker.split, motion, schedule);
  BOOST_TEST(repaired.within_reach);
  BOOST_TEST(repaired.stances[0].is_still);
  BOOST_TEST(repaired.stances[0].drift > 0.005);
  BOOST_TEST(repaired.held_largest < 1e-3);
  // Those that drift too far move as they did.
  RepairSettings settings;
  settings.largest_drift = 0.005;
  const RepairedMotion moving = repairMotion(*walker.split, motion, schedule, settings);
  BOOST_TEST(!moving.stances[0].is_still);
  BOOST_TEST(moving.stances[1].is_still);
  BOOST_TEST(moving.within_reach);
}

BOOST_AUTO_TEST_CASE(windows_go_on_where_the_last_one_ended) {
  const Walker walker;
  const Motion motion = walker.sway(500);
  const ContactSchedule schedule = walker.schedule(500);
  RepairSettings whole, windows;
  whole.window = 100.;
  windows.window = 3.;
  const RepairedMotion one = repairMotion(*walker.split, motion, schedule, whole);
  const RepairedMotion several = repairMotion(*walker.split, motion, schedule, windows);
  BOOST_TEST(one.within_reach);
  BOOST_TEST(several.within_reach);
  BOOST_TEST(walker.countUnsolved(several.motion, schedule) == 0);
  // Not the same to a millimetre, for the search ends near the cheapest change, but as good.
  BOOST_TEST(std::abs(several.root_rms / one.root_rms - 1.) < 0.01);
  BOOST_TEST(std::abs(several.root_largest / one.root_largest - 1.) < 0.02);
  BOOST_TEST((one.change - several.change).topRows(3).cwiseAbs().maxCoeff() <
             0.2 * one.root_largest);
}

BOOST_AUTO_TEST_CASE(a_mirrored_motion_is_repaired_to_a_mirrored_one) {
  const Walker walker;
  Motion motion = walker.sway(100);
  for (Index k = 0; k < 100; ++k) {
    const double y = 0.05 * std::sin(5. * motion.time[k]);
    motion.q(1, k) += y;
    motion.q(8, k) -= y;
    motion.q(11, k) -= y;
  }
  Motion mirrored = motion;
  mirrored.q.row(1) *= -1.;
  for (const Index component : {7, 8, 9}) {
    const double sign = component == 8 ? -1. : 1.;
    mirrored.q.row(component) = sign * motion.q.row(component + 3);
    mirrored.q.row(component + 3) = sign * motion.q.row(component);
  }
  const ContactSchedule schedule = walker.schedule(100);
  const RepairedMotion one = repairMotion(*walker.split, motion, schedule);
  const RepairedMotion other = repairMotion(*walker.split, mirrored, schedule);
  BOOST_TEST(one.root_rms > 1e-4);
  BOOST_TEST(close(other.change.row(0), one.change.row(0), 1e-6));
  BOOST_TEST(close(other.change.row(1), -one.change.row(1), 1e-6));
}

BOOST_AUTO_TEST_CASE(nothing_is_asked_of_frames_that_are_free) {
  const Walker walker;
  const Motion motion = walker.sway(100);
  const ContactSchedule schedule = walker.schedule(100);
  Eigen::Array<bool, Eigen::Dynamic, 1> free(100);
  free.setConstant(true);
  const RepairedMotion untouched = repairMotion(*walker.split, motion, schedule, {}, free);
  BOOST_TEST(untouched.within_reach);
  BOOST_TEST((untouched.motion.q == motion.q));
  // Half of them: the other half is mended, with less of a change.
  free.tail(50).setConstant(false);
  const RepairedMotion half = repairMotion(*walker.split, motion, schedule, {}, free);
  BOOST_TEST(half.within_reach);
  const MotionAnalysis analysis = analyzeMotion(walker.split->robot, half.motion, schedule);
  Index unsolved = 0;
  for (std::size_t frame = 0; frame < 100; ++frame) {
    const bool solved = analysis.status[frame] == DistributionStatus::Solved;
    if (!solved) ++unsolved;
    BOOST_TEST((solved || free[Index(frame)]));
  }
  BOOST_TEST(unsolved > 5);
  BOOST_TEST(half.root_rms < repairMotion(*walker.split, motion, schedule).root_rms);
}

BOOST_AUTO_TEST_CASE(mistakes_are_named) {
  const Walker walker;
  const Motion motion = walker.stand(10);
  const ContactSchedule schedule = walker.schedule(10);
  RepairSettings settings;
  settings.turn = 0.;
  BOOST_TEST(throws<std::invalid_argument>(
      [&] { repairMotion(*walker.split, motion, schedule, settings); },
      {"RepairSettings.turn", "0"}));
  settings = {};
  settings.friction_margin = 1.;
  BOOST_TEST(throws<std::invalid_argument>([&] { settings.validate(); }, {"friction_margin", "1"}));
  BOOST_TEST(throws<std::invalid_argument>(
      [&] { repairMotion(*walker.split, walker.stand(3), walker.schedule(3)); }, {"4", "3"}));
  BOOST_TEST(throws<std::invalid_argument>(
      [&] { repairMotion(*walker.split, motion, walker.schedule(9)); }, {"9", "10"}));
  Motion fast = walker.sway(10);
  fast.q(0, 5) = 1e200;
  BOOST_TEST(throws<std::invalid_argument>([&] { repairMotion(*walker.split, fast, schedule); },
                                           {"frame", "too large"}));
  ContactSchedule strange = schedule;
  strange.names[0] = "nose";
  BOOST_TEST(throws<std::invalid_argument>([&] { repairMotion(*walker.split, motion, strange); },
                                           {"nose", "part"}));
  Motion wrong = motion;
  wrong.q(0, 5) = std::numeric_limits<double>::quiet_NaN();
  BOOST_TEST(
      throws<std::invalid_argument>([&] { repairMotion(*walker.split, wrong, schedule); }, {"q"}));
  Eigen::Array<bool, Eigen::Dynamic, 1> free(3);
  BOOST_TEST(throws<std::invalid_argument>(
      [&] { repairMotion(*walker.split, motion, schedule, {}, free); }, {"free", "10", "3"}));
}
