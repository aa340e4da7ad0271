// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE motion_repair
#include <cmath>
#include <limits>
#include <pinocchio/algorithm/frames.hpp>
#include <vector>

#include "swayer.hpp"

using namespace dynacom;
using namespace dynacom_tests;

BOOST_AUTO_TEST_CASE(what_contacts_can_give_comes_back_as_it_is) {
  const Swayer walker;
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
  const Swayer walker;
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

BOOST_AUTO_TEST_CASE(who_would_slip_does_not_on_exact_cones) {
  const double mu = 0.1;
  const Swayer exact(FrictionModel::Cone, mu), pyramids(FrictionModel::OuterPyramid, mu),
      facets(FrictionModel::Facets, mu);
  // Diagonally, where pyramids allow 41 % more.
  Motion motion = exact.stand(120);
  for (Index k = 0; k < 120; ++k) {
    const double x = 0.05 * std::sin(6. * motion.time[k]);
    for (const Index row : {0, 1}) {
      motion.q(row, k) += x;
      motion.q(7 + row, k) -= x;
      motion.q(10 + row, k) -= x;
    }
  }
  motion = differentiate(exact.model, motion.time, motion.q);
  const ContactSchedule schedule = exact.schedule(120);
  BOOST_TEST(exact.countUnsolved(motion, schedule) > 30);
  const RepairedMotion repaired = repairMotion(*exact.split, motion, schedule);
  BOOST_TEST(repaired.within_reach);
  BOOST_TEST(exact.countUnsolved(repaired.motion, schedule) == 0);
  BOOST_TEST(repaired.held_largest < 1e-3);
  const RepairedMotion again = repairMotion(*exact.split, repaired.motion, schedule);
  BOOST_TEST((again.motion.q == repaired.motion.q));
  // Within pyramids, it is changed less, and slips in earnest.
  const RepairedMotion outer = repairMotion(*pyramids.split, motion, schedule);
  BOOST_TEST(outer.within_reach);
  BOOST_TEST(pyramids.countUnsolved(outer.motion, schedule) == 0);
  BOOST_TEST(exact.countUnsolved(outer.motion, schedule) > 10);
  BOOST_TEST(outer.root_rms < repaired.root_rms);
  const RepairedMotion of_facets = repairMotion(*facets.split, motion, schedule);
  BOOST_TEST(of_facets.within_reach);
  BOOST_TEST(facets.countUnsolved(of_facets.motion, schedule) == 0);
}

BOOST_AUTO_TEST_CASE(in_flight_the_com_follows_its_parabola) {
  const Swayer walker;
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
  const Swayer walker;
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
  const Swayer walker;
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
  const Swayer walker;
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
  const Swayer walker;
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

BOOST_AUTO_TEST_CASE(feet_come_down_to_their_ground_and_up_from_below_it) {
  const Swayer walker;
  Motion motion = walker.sway(100);
  motion.q.row(9).array() += 0.004;  // the left one floats
  // The right one is in the air for a while, and sinks in there.
  const Index first = 40, behind = 70;
  ContactSchedule schedule = walker.schedule(100);
  schedule.active.middleCols(first, behind - first).bottomRows(4).setConstant(false);
  for (Index k = first; k < behind; ++k) {
    const double part = double(k - first + 1) / double(behind - first + 1);
    motion.q(12, k) -= 0.006 * std::pow(std::sin(M_PI * part), 2);
  }
  RepairGround ground;
  ground.height.setZero(8, 100);
  const RepairedMotion repaired = repairMotion(*walker.split, motion, schedule, {}, {}, ground);
  BOOST_TEST(repaired.within_reach);
  const RepairSettings settings;
  pinocchio::Data data(walker.model);
  for (Index frame = 0; frame < 100; ++frame) {
    pinocchio::framesForwardKinematics(walker.model, data, repaired.motion.q.col(frame));
    const auto heightOf = [&](const char* foot) {
      return data.oMf[walker.model.getFrameId(foot)].translation().z();
    };
    BOOST_TEST(std::abs(heightOf("left_foot")) < 1e-3);
    const bool flies = frame >= first && frame < behind;
    if (!flies)
      BOOST_TEST(std::abs(heightOf("right_foot")) < 1e-3);
    else
      BOOST_TEST(heightOf("right_foot") > -1e-3);
    if (frame > first + 8 && frame < behind - 8)
      BOOST_TEST(heightOf("right_foot") > settings.clearance - 1e-3);
  }
  BOOST_TEST(repaired.held_largest < 1e-3);
  BOOST_TEST(repaired.sunk_largest < 1e-3);
}

BOOST_AUTO_TEST_CASE(on_a_treadmill_feet_move_with_the_ground) {
  const Swayer walker;
  Motion motion = walker.sway(100);
  // All of it is carried along, and the left foot skates besides.
  const double speed = -0.4;
  for (Index k = 0; k < 100; ++k) {
    motion.q(0, k) += speed * motion.time[k];
    motion.q(7, k) += 0.01 * std::sin(3. * motion.time[k]);
  }
  RepairGround ground;
  ground.height.setZero(8, 100);
  ground.velocity.x() = speed;
  const ContactSchedule schedule = walker.schedule(100);
  const RepairedMotion repaired = repairMotion(*walker.split, motion, schedule, {}, {}, ground);
  BOOST_TEST(repaired.within_reach);
  BOOST_TEST(repaired.stances[0].is_still);
  BOOST_TEST(repaired.stances[1].drift < 1e-9);
  BOOST_TEST(repaired.held_largest < 1e-3);
}

BOOST_AUTO_TEST_CASE(who_slides_too_far_to_stand_still_does_so_slowly) {
  const Swayer walker;
  Motion motion = walker.sway(100);
  // 5 cm within a fifth of a second.
  for (Index k = 0; k < 100; ++k) motion.q(7, k) += 0.025 * std::tanh((motion.time[k] - 1.) / 0.05);
  const ContactSchedule schedule = walker.schedule(100);
  RepairGround ground;
  ground.height.setZero(8, 100);
  const RepairSettings settings;
  const auto findSpeed = [&](const Motion& some) {
    const Eigen::MatrixXd feet = some.q.row(0) + some.q.row(7);
    return (feet.rightCols(99) - feet.leftCols(99)).cwiseAbs().maxCoeff() * 50.;
  };
  BOOST_TEST(findSpeed(motion) > 0.4);
  const RepairedMotion repaired =
      repairMotion(*walker.split, motion, schedule, settings, {}, ground);
  BOOST_TEST(repaired.within_reach);
  BOOST_TEST(!repaired.stances[0].is_still);
  BOOST_TEST(findSpeed(repaired.motion) < 1.5 * settings.slide_speed);
}

BOOST_AUTO_TEST_CASE(joints_stay_within_their_positions_and_velocities) {
  Swayer walker;
  Motion motion = walker.sway(150);
  // The arm turns by 1.5 ± 0.3 rad, at up to 0.6 rad/s.
  walker.model.lowerPositionLimit[13] = 1.4;
  walker.model.upperPositionLimit[13] = 1.7;
  walker.model.upperVelocityLimit[12] = 0.55;
  walker.split.emplace(splitContacts([&] {
    DynaCoM robot(walker.model);
    for (const char* name : {"left", "right"})
      robot.addContact(makeSole(std::string(name) + "_foot"), name);
    return robot;
  }()));
  const ContactSchedule schedule = walker.schedule(150);
  const RepairedMotion repaired = repairMotion(*walker.split, motion, schedule);
  BOOST_TEST(repaired.within_reach);
  BOOST_TEST(repaired.motion.q.row(13).minCoeff() >= 1.4);
  BOOST_TEST(repaired.motion.q.row(13).maxCoeff() <= 1.7);
  BOOST_TEST(repaired.motion.q.row(13).maxCoeff() > 1.69);  // no farther than it must
  const Eigen::RowVectorXd steps =
      repaired.motion.q.row(13).tail(149) - repaired.motion.q.row(13).head(149);
  BOOST_TEST(steps.cwiseAbs().maxCoeff() * 50. <= 0.55 + 1e-9);
  BOOST_TEST(repaired.joint_excess == 0.);
  BOOST_TEST(repaired.speed_excess == 0.);
  RepairSettings settings;
  settings.joints = false;
  const RepairedMotion other = repairMotion(*walker.split, motion, schedule, settings);
  BOOST_TEST(other.joint_excess > 0.05);
  BOOST_TEST(other.speed_excess > 0.05);
}

BOOST_AUTO_TEST_CASE(ends_stay_where_they_are_pinned) {
  const Swayer walker;
  const Motion motion = walker.sway(150);
  const ContactSchedule schedule = walker.schedule(150);
  RepairSettings settings;
  settings.pinned_ends = true;
  const RepairedMotion repaired = repairMotion(*walker.split, motion, schedule, settings);
  BOOST_TEST(repaired.within_reach);
  BOOST_TEST(repaired.root_rms > 1e-4);
  BOOST_TEST(repaired.change.col(0).norm() < 1e-6);
  BOOST_TEST(repaired.change.col(149).norm() < 1e-6);
  BOOST_TEST(repairMotion(*walker.split, motion, schedule).change.col(149).norm() > 1e-4);
}

BOOST_AUTO_TEST_CASE(what_begins_near_the_end_is_only_mended) {
  const Swayer walker;
  const Motion motion = walker.sway(150);
  const ContactSchedule schedule = walker.schedule(150);
  const RepairedMotion repaired = repairMotion(*walker.split, motion, schedule);
  // One frame is pushed off, and found back; far from it nothing moves.
  Eigen::MatrixXd start = repaired.motion.q;
  start(0, 75) += 0.0003;
  const RepairedMotion mended =
      repairMotion(*walker.split, motion, schedule, {}, {}, {}, start, false);
  BOOST_TEST(mended.within_reach);
  BOOST_TEST((mended.motion.q.leftCols(40) == start.leftCols(40)));
  BOOST_TEST((mended.motion.q.rightCols(40) == start.rightCols(40)));
  BOOST_TEST(mended.root_largest < repaired.root_largest + 0.004);
}

BOOST_AUTO_TEST_CASE(stances_at_nearly_one_height_are_on_one_level) {
  const Swayer walker;
  const std::vector<PartRobot::Part>& parts = walker.split->parts;
  ContactInference inference;
  inference.schedule = walker.schedule(100);
  inference.ground.setZero(8, 100);
  VectorXd time = VectorXd::LinSpaced(100, 0., 1.98);
  // The left sole is tilted, its heel 4 cm up; the right one is 1 cm higher than its toes.
  const auto stand = [&](std::size_t part, double height) {
    inference.ground.row(Index(part)).setConstant(height);
    Stance stance = {};
    stance.part = part;
    stance.first = stance.begin = 0;
    stance.behind = stance.end = 100;
    stance.height = height;
    stance.on_ground = true;
    inference.stances.push_back(stance);
  };
  for (std::size_t part = 0; part < 8; ++part) {
    const bool is_rear = parts[part].name.find("rear") != std::string::npos;
    stand(part, part < 4 ? (is_rear ? 0.04 : 0.) : 0.01);
  }
  const RepairGround ground = findRepairGround(parts, inference, time);
  BOOST_TEST((ground.height.array() == ground.height(0, 0)).all());
  BOOST_TEST((ground.height(0, 0) == 0. || ground.height(0, 0) == 0.01));
  // A step is a level of its own.
  for (Stance& stance : inference.stances)
    if (stance.part >= 4) stance.height = 0.2;
  inference.ground.bottomRows(4).setConstant(0.2);
  const RepairGround step = findRepairGround(parts, inference, time);
  BOOST_TEST((step.height.topRows(4).array() == 0.).all());
  BOOST_TEST((step.height.bottomRows(4).array() == 0.2).all());
  BOOST_TEST(throws<std::invalid_argument>(
      [&] { findRepairGround(parts, inference, time.head(50)); }, {"inference", "50", "100"}));
}

BOOST_AUTO_TEST_CASE(mistakes_are_named) {
  const Swayer walker;
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
