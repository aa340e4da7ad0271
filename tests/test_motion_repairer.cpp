// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE motion_repairer
#include <cmath>
#include <limits>
#include <string>

#include "dynacom/motion_repairer.hpp"
#include "swayer.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

RecordedMotion record(const Motion& motion) { return {motion.time, motion.q}; }

Index countUnsolved(const MotionExamination& found) {
  Index count = 0;
  for (const DistributionStatus status : found.analysis.status)
    if (status != DistributionStatus::Solved) ++count;
  return count;
}

bool hasReason(const MotionRepair& repair, const std::string& code) {
  for (const RepairReason& reason : repair.reasons)
    if (reason.code == code) return true;
  return false;
}

}  // namespace

BOOST_AUTO_TEST_CASE(what_is_feasible_stays_as_it_is) {
  const Swayer walker;
  const RecordedMotion recorded = record(walker.stand(100));
  const MotionRepair repair = repairRecordedMotion(*walker.robot, recorded);
  BOOST_TEST((repair.outcome == RepairOutcome::Feasible));
  BOOST_TEST((repair.recorded.q == recorded.q));
  BOOST_TEST(!repair.recorded.is_exact);
  BOOST_TEST(repair.steps.empty());
  BOOST_TEST(repair.reasons.empty());
  BOOST_TEST(repair.root.largest == 0.);
}

BOOST_AUTO_TEST_CASE(who_sways_too_fast_is_repaired) {
  const Swayer walker;
  const RecordedMotion recorded = record(walker.sway(300, 0.09));
  const MotionRepairer repairer(*walker.robot);
  const MotionRepair repair = repairer.repair(recorded);
  BOOST_TEST(!repair.before.verdict.isFeasible());
  BOOST_TEST(repair.missing_before > 30);
  BOOST_TEST((repair.outcome == RepairOutcome::Repaired));
  BOOST_TEST(repair.missing == 0);
  BOOST_TEST(repair.recorded.is_exact);
  BOOST_TEST(repair.after.verdict.isFeasible());
  BOOST_TEST(repair.after.derived.cutoff == 0.);
  // By an examination that knows nothing of how it was made.
  ExaminationSettings plain;
  plain.cutoff = 0.;
  BOOST_TEST(
      countUnsolved(examineMotion(*walker.robot, {recorded.time, repair.recorded.q}, plain)) == 0);
  // It is what the change leads to, which is small.
  BOOST_TEST(repair.root.largest > 1e-3);
  BOOST_TEST(repair.root.largest < 0.09);
  BOOST_TEST(close(repair.recorded.q.topRows(3),
                   repair.before.derived.motion.q.topRows(3) + repair.change.topRows(3), 1e-3));
  // And once more, nothing is to be done.
  const MotionRepair again = repairer.repair(repair.recorded);
  BOOST_TEST((again.outcome == RepairOutcome::Feasible));
  BOOST_TEST((again.recorded.q == repair.recorded.q));
}

BOOST_AUTO_TEST_CASE(turns_and_limits_are_told) {
  Swayer walker;
  walker.model.upperPositionLimit[13] = 1.6;
  walker.model.lowerPositionLimit[13] = 0.;
  walker.setUpRobot();
  const RecordedMotion recorded = record(walker.sway(300, 0.09));
  RepairerSettings settings;
  const MotionRepair limited = repairRecordedMotion(*walker.robot, recorded, settings);
  BOOST_TEST(limited.turn.largest > 1e-4);
  BOOST_TEST(std::abs(limited.joint_excess_before - 0.2) < 0.02);
  // Who is beyond is never called repaired.
  const bool is_beyond = limited.joint_excess > 1e-9;
  BOOST_TEST(hasReason(limited, "joint_limits") == is_beyond);
  BOOST_TEST((limited.outcome == RepairOutcome::Repaired) == !is_beyond);
  // Nobody asked for limits, and yet who is beyond is not repaired, even if not more than before.
  settings.repair.joints = settings.repair.feet = false;
  const MotionRepair other = repairRecordedMotion(*walker.robot, recorded, settings);
  BOOST_TEST(other.missing == 0);
  BOOST_TEST(other.joint_excess > 0.1);
  BOOST_TEST(hasReason(other, "joint_limits"));
  BOOST_TEST((other.outcome == RepairOutcome::NotRepaired));
  for (const RepairReason& reason : other.reasons)
    if (reason.code == "joint_limits") BOOST_TEST(reason.text.find(" rad") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(what_slides_is_beyond_its_limits_in_metres) {
  Swayer walker;
  const auto slider = walker.model.addJoint(1, pinocchio::JointModelPZ(), SE3::Identity(), "mast");
  walker.model.appendBodyToJoint(slider, pinocchio::Inertia::FromSphere(0.1, 0.1), SE3::Identity());
  walker.model.lowerPositionLimit[14] = -0.3;
  walker.model.upperPositionLimit[14] = -0.05;
  walker.setUpRobot();
  RepairerSettings settings;
  settings.repair.joints = settings.repair.feet = false;
  const MotionRepair repair =
      repairRecordedMotion(*walker.robot, record(walker.sway(300, 0.09)), settings);
  BOOST_TEST(close(repair.joint_excess, 0.05, 5e-3));
  for (const RepairReason& reason : repair.reasons)
    if (reason.code == "joint_limits") BOOST_TEST(reason.text.find(" m") != std::string::npos);
  BOOST_TEST(hasReason(repair, "joint_limits"));
}

namespace {

// It sways, too fast, on feet that slide to and fro along y, as far as `reach`.
Motion skate(const Swayer& walker, double reach) {
  Motion motion = walker.sway(400, 0.09);
  for (Index k = 0; k < 400; ++k) motion.q(1, k) += reach * std::sin(2. * motion.time[k]);
  return motion;
}

bool isKept(const MotionRepair& repair, RepairRung rung) {
  for (const RepairStep& step : repair.steps)
    if (step.rung == rung) return step.is_kept;
  return false;
}

}  // namespace

BOOST_AUTO_TEST_CASE(feet_that_cannot_be_held_are_told) {
  const Swayer walker;
  // Never faster than a verdict allows, but farther than a foot may be displaced.
  const RecordedMotion recorded = record(skate(walker, 0.04));
  RepairerSettings settings;
  settings.examination.verdict.foot_sliding.allowed_share = 1.;
  const MotionRepair repair = repairRecordedMotion(*walker.robot, recorded, settings);
  BOOST_TEST(repair.after.verdict.isFeasible());
  BOOST_TEST(repair.feet.drift > settings.repair.largest_drift);
  BOOST_TEST(hasReason(repair, "feet_not_held"));
  BOOST_TEST((repair.outcome == RepairOutcome::NotRepaired));
  // Who asks for balance only leaves feet as they are.
  settings.repair.feet = settings.repair.joints = false;
  const MotionRepair balanced = repairRecordedMotion(*walker.robot, recorded, settings);
  BOOST_TEST((balanced.outcome == RepairOutcome::Repaired));
  // Those that may drift so far are held.
  settings = {};
  settings.repair.largest_drift = 0.06;
  settings.examination.verdict.foot_sliding = {0.01, 0.};
  const MotionRepair held = repairRecordedMotion(*walker.robot, recorded, settings);
  BOOST_TEST(held.feet_before.drift > 0.03);
  BOOST_TEST(held.feet.drift < 1e-3);
  BOOST_TEST((held.outcome == RepairOutcome::Repaired));
}

BOOST_AUTO_TEST_CASE(joints_are_limited_where_feet_are_not_held) {
  Swayer walker;
  walker.model.upperPositionLimit[13] = 1.6;
  walker.model.lowerPositionLimit[13] = 0.;
  walker.setUpRobot();
  RepairerSettings settings;
  settings.repair.largest_drift = 0.1;
  settings.largest_displacement = 0.06;  // less than feet drift
  const MotionRepair repair =
      repairRecordedMotion(*walker.robot, record(skate(walker, 0.08)), settings);
  BOOST_TEST(isKept(repair, RepairRung::Balance));
  BOOST_TEST(!isKept(repair, RepairRung::Feet));
  BOOST_TEST(isKept(repair, RepairRung::Joints));
  BOOST_TEST(repair.joint_excess_before > 0.1);
  BOOST_TEST(repair.joint_excess < 1e-9);
  BOOST_TEST(repair.missing == 0);
  // Each is told beside the rung below it.
  BOOST_TEST(repair.steps.back().before > 0.1);
  BOOST_TEST(repair.steps.back().after == repair.joint_excess);
}

BOOST_AUTO_TEST_CASE(feet_are_at_rest_from_the_first_frame_to_the_last) {
  const Swayer walker;
  // It leans so far that it would fall, all the time.
  Motion motion = walker.stand(100);
  for (Index k = 0; k < 100; ++k)
    for (const Index row : {0, 7, 10}) motion.q(row, k) += row == 0 ? 0.12 : -0.12;
  const MotionRepair repair = repairRecordedMotion(*walker.robot, record(motion));
  BOOST_TEST(repair.missing_before > 50);
  BOOST_TEST(repair.missing == 0);
  BOOST_TEST(repair.feet.speed < 3e-3);
  BOOST_TEST(repair.feet.sunk < 1e-3);
  BOOST_TEST(repair.feet.floating < 1e-3);
}

BOOST_AUTO_TEST_CASE(how_feet_stand_is_told) {
  const Swayer walker;
  Motion motion = walker.sway(300, 0.09);
  // A foot sinks and rises by 6 mm, while the other stays.
  for (Index k = 0; k < 300; ++k) motion.q(9, k) += 0.006 * std::sin(3. * motion.time[k]);
  RepairerSettings settings;
  settings.examination.verdict.ground_penetration = {0.002, 0.};
  const MotionRepair repair = repairRecordedMotion(*walker.robot, record(motion), settings);
  BOOST_TEST(repair.feet_before.sunk > 3e-3);
  BOOST_TEST(repair.feet_before.sunk < 0.012);
  BOOST_TEST(repair.feet_before.floating > 3e-3);
  BOOST_TEST(repair.feet.sunk < 1e-3);
  BOOST_TEST(repair.feet.floating < 1e-3);
}

BOOST_AUTO_TEST_CASE(strictly_single_frames_are_mended_too) {
  const Swayer walker;
  // A few frames out of reach, which a verdict allows.
  Motion motion = walker.stand(400);
  for (Index k = 0; k < 400; ++k) {
    const double s = (motion.time[k] - 4.) / 0.15;
    const double x = 0.02 * std::exp(-s * s);
    motion.q(0, k) += x;
    motion.q(7, k) -= x;
    motion.q(10, k) -= x;
  }
  RepairerSettings settings;
  const MotionRepair kept = repairRecordedMotion(*walker.robot, record(motion), settings);
  BOOST_TEST((kept.outcome == RepairOutcome::Feasible));
  BOOST_TEST(kept.missing_before > 0);
  settings.strict = true;
  const MotionRepair mended = repairRecordedMotion(*walker.robot, record(motion), settings);
  BOOST_TEST((mended.outcome == RepairOutcome::Repaired));
  BOOST_TEST(mended.missing == 0);
  BOOST_TEST(mended.root.largest > 0.);
}

BOOST_AUTO_TEST_CASE(what_cannot_be_is_not_called_repaired) {
  const Swayer walker;
  // It hovers, half a metre up, and its feet with it, for a second.
  Motion motion = walker.stand(250);
  for (Index k = 0; k < 250; ++k) {
    const double s = (motion.time[k] - 2.5) / 1.2;
    motion.q(2, k) += 0.5 * std::exp(-s * s * s * s);
  }
  const MotionRepair repair = repairRecordedMotion(*walker.robot, record(motion));
  BOOST_TEST((repair.outcome == RepairOutcome::NotRepaired));
  BOOST_TEST(!repair.reasons.empty());
  BOOST_TEST((hasReason(repair, "contact_needed") || hasReason(repair, "bound") ||
              hasReason(repair, "flight_with_support_needed")));
  // Three frames tell nothing.
  const MotionRepair few = repairRecordedMotion(*walker.robot, record(walker.stand(4)));
  BOOST_TEST((few.outcome == RepairOutcome::NotRepaired));
  BOOST_TEST(hasReason(few, "too_short"));
}

BOOST_AUTO_TEST_CASE(time_is_stretched_where_that_is_allowed) {
  const Swayer walker;
  // So far, and so fast, that it would have to be moved more than settings allow.
  const RecordedMotion recorded = record(walker.sway(300, 0.07));
  RepairerSettings settings;
  settings.largest_displacement = 0.005;
  const MotionRepair fast = repairRecordedMotion(*walker.robot, recorded, settings);
  BOOST_TEST((fast.outcome == RepairOutcome::NotRepaired));
  BOOST_TEST(hasReason(fast, "bound"));
  settings.largest_stretch = 4.;
  const MotionRepair slow = repairRecordedMotion(*walker.robot, recorded, settings);
  BOOST_TEST((slow.outcome == RepairOutcome::Repaired));
  BOOST_TEST(slow.stretch > 1.);
  BOOST_TEST((slow.steps.front().rung == RepairRung::Time));
  BOOST_TEST(std::abs(slow.recorded.time[299] - slow.stretch * recorded.time[299]) < 1e-9);
}

BOOST_AUTO_TEST_CASE(who_floats_above_a_ground_that_is_told_is_put_on_it) {
  const Swayer walker;
  Motion motion = walker.sway(300, 0.09);
  motion.q.row(2).array() += 0.05;
  RepairerSettings settings;
  settings.examination.detection.ground_height = 0.;
  const MotionRepair repair = repairRecordedMotion(*walker.robot, record(motion), settings);
  BOOST_TEST((repair.outcome == RepairOutcome::Repaired));
  BOOST_TEST((repair.steps.front().rung == RepairRung::Ground));
  BOOST_TEST(std::abs(repair.ground_offset + 0.05) < 2e-3);
  BOOST_TEST(repair.root.largest < 0.09);
  // Whose ground is to be found stands where it is.
  settings.examination.detection.ground_height = std::numeric_limits<double>::quiet_NaN();
  const MotionRepair free = repairRecordedMotion(*walker.robot, record(motion), settings);
  BOOST_TEST((free.outcome == RepairOutcome::Repaired));
  BOOST_TEST(free.ground_offset == 0.);
}

BOOST_AUTO_TEST_CASE(settings_out_of_range_are_named) {
  RepairerSettings settings;
  settings.rounds = 0;
  BOOST_TEST(throws<std::invalid_argument>([&] { settings.validate(); }, {"rounds", "1", "0"}));
  settings = {};
  settings.largest_stretch = 0.5;
  BOOST_TEST(
      throws<std::invalid_argument>([&] { settings.validate(); }, {"largest_stretch", "0.5"}));
  settings = {};
  settings.largest_turn = std::numeric_limits<double>::quiet_NaN();
  BOOST_TEST(throws<std::invalid_argument>([&] { settings.validate(); }, {"largest_turn"}));
}
