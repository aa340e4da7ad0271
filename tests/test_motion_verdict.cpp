// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE motion_verdict
#include <cmath>
#include <limits>

#include "dynacom/contact6d.hpp"
#include "dynacom/motion_verdict.hpp"
#include "random_robot.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

const double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kMass = 10., kWeight = kMass * 9.81;

/// A body of 10 kg that stands on two soles, 100 frames, one second.
struct Stand {
  Stand() : model(singleBody(kMass, stance(2))), robot(model) {
    Contact6DSettings sole;
    sole.mu = 0.5;
    sole.gu = 0.05;
    sole.half_length = 0.1;
    sole.half_width = 0.05;
    for (const char* frame : {"sole0", "sole1"}) {
      sole.frame_name = frame;
      robot.addContact(std::make_shared<Contact6D>(sole), frame);
    }
    const Index frames = 100;
    motion.time = VectorXd::LinSpaced(frames, 0., 0.99);
    motion.q = restState(model).q.replicate(1, frames);
    motion.v = motion.a = MatrixXd::Zero(model.nv, frames);
    schedule.names = robot.getKnownContacts();
    schedule.active.setConstant(2, frames, true);
    recorded.q = motion.q;
    recorded.quaternion_error.setZero(frames);
    ground.setZero(2);
  }

  MotionVerdict judge() const {
    return judgeMotion(robot, motion, recorded, computeContactMotions(robot, motion), ground,
                       analyzeMotion(robot, motion, schedule), settings);
  }

  pinocchio::Model model;
  DynaCoM robot;
  Motion motion;
  RecordedMotion recorded;
  ContactSchedule schedule;
  VectorXd ground;
  VerdictSettings settings;
};

/// Whether of all faults one holds, beyond its limit in so many frames, the worst of this size at
/// this time.
boost::test_tools::predicate_result holdsAlone(const MotionVerdict& verdict, MotionFault fault,
                                               Index frames, double worst, double time) {
  boost::test_tools::predicate_result result(false);
  for (std::size_t k = 0; k < kMotionFaults; ++k) {
    const auto other = static_cast<MotionFault>(k);
    if (verdict[other].holds != (other == fault)) {
      result.message() << to_string(other) << " is " << verdict[other].holds;
      return result;
    }
  }
  const MotionFinding& finding = verdict[fault];
  if (verdict.isFeasible() || finding.frames != frames ||
      !(std::abs(finding.worst - worst) <= 1e-6 * std::max(1., worst)) ||
      std::abs(finding.time - time) > 1e-9) {
    result.message() << finding.frames << " frames, worst " << finding.worst << " at "
                     << finding.time;
    return result;
  }
  return true;
}

}  // namespace

BOOST_AUTO_TEST_CASE(standing_still_is_feasible) {
  const MotionVerdict verdict = Stand().judge();
  BOOST_TEST(verdict.isFeasible());
  for (std::size_t k = 0; k < kMotionFaults; ++k) {
    const MotionFinding& finding = verdict.findings[k];
    BOOST_TEST(!finding.holds);
    BOOST_TEST(finding.frames == 0);
    BOOST_TEST(finding.measured.size() == 100);
    BOOST_TEST(std::abs(finding.worst) < 1e-9);
  }
}

BOOST_AUTO_TEST_CASE(what_contacts_cannot_give_is_a_residual) {
  // Down faster than it falls: nothing pulls. The rest of the force is missing.
  Stand stand;
  stand.settings.residual_force.allowed_share = 0.02;
  for (const Index frame : {20, 21, 22}) stand.motion.a(2, frame) = -12.;
  stand.motion.a(2, 21) = -14.;
  BOOST_TEST(holdsAlone(stand.judge(), MotionFault::ResidualForce, 3, (14. - 9.81) / 9.81, 0.21));
  // Two of a hundred frames are allowed.
  stand.motion.a(2, 20) = 0.;
  BOOST_TEST(stand.judge().isFeasible());
  BOOST_TEST(stand.judge()[MotionFault::ResidualForce].frames == 2);
  stand.settings.residual_force.allowed_share = 0.01;
  BOOST_TEST(!stand.judge().isFeasible());
  stand.settings.residual_force.limit = 0.5;
  BOOST_TEST(stand.judge().isFeasible());

  // A moment that tips it: the soles reach 0.1 m to the front.
  Stand tipped;
  const double inertia = tipped.model.inertias[1].inertia()(1, 1);
  for (Index frame = 50; frame < 60; ++frame) tipped.motion.a(4, frame) = 0.5 * kWeight / inertia;
  const MotionVerdict verdict = tipped.judge();
  BOOST_TEST(verdict[MotionFault::ResidualTorque].holds);
  BOOST_TEST(verdict[MotionFault::ResidualTorque].frames == 10);
  const auto analysis = analyzeMotion(tipped.robot, tipped.motion, tipped.schedule);
  BOOST_TEST(close(verdict[MotionFault::ResidualTorque].measured[50],
                   analysis.residual.col(50).tail<3>().norm() / kWeight));
  BOOST_TEST(close(verdict[MotionFault::ResidualForce].measured[50],
                   analysis.residual.col(50).head<3>().norm() / kWeight));
}

BOOST_AUTO_TEST_CASE(flight_is_a_fault_where_support_is_needed) {
  Stand stand;
  stand.schedule.active.middleCols(30, 10).setConstant(false);
  stand.settings.near_ground = 0.;
  stand.motion.q.row(2).segment(30, 10).setConstant(0.01);  // too high to be near
  stand.recorded.q = stand.motion.q;
  BOOST_TEST(holdsAlone(stand.judge(), MotionFault::FlightWithSupportNeeded, 10, 1., 0.3));
  // A fall is none, and what is nearly one neither.
  stand.motion.a.row(2).segment(30, 10).setConstant(-9.81 * 0.96);
  BOOST_TEST(stand.judge().isFeasible());
  stand.motion.a.row(2).segment(30, 10).setConstant(-9.81 * 0.94);
  BOOST_TEST(holdsAlone(stand.judge(), MotionFault::FlightWithSupportNeeded, 10, 0.06, 0.3));
}

BOOST_AUTO_TEST_CASE(contacts_that_would_help_are_missing) {
  // The soles hover just above the ground, where nobody held them to touch it.
  Stand stand;
  stand.schedule.active.middleCols(30, 10).setConstant(false);
  stand.ground.setConstant(-0.05);
  BOOST_TEST(holdsAlone(stand.judge(), MotionFault::ContactMissing, 10, 1., 0.3));
  stand.ground.setConstant(-0.07);
  BOOST_TEST(holdsAlone(stand.judge(), MotionFault::FlightWithSupportNeeded, 10, 1., 0.3));

  // One of them is missing: the other alone cannot bear the weight beside it.
  Stand beside;
  beside.schedule.active.row(1).segment(60, 6).setConstant(false);
  const MotionVerdict verdict = beside.judge();
  BOOST_TEST(verdict[MotionFault::ContactMissing].holds);
  BOOST_TEST(verdict[MotionFault::ContactMissing].frames == 6);
  BOOST_TEST(!verdict[MotionFault::ResidualTorque].holds);
  // It would not help against what no sole can give.
  beside.motion.a.row(2).segment(60, 6).setConstant(-14.);
  BOOST_TEST(!beside.judge()[MotionFault::ContactMissing].holds);
  BOOST_TEST(beside.judge()[MotionFault::ResidualForce].holds);
}

BOOST_AUTO_TEST_CASE(feet_below_the_ground_and_sliding_ones_are_faults) {
  Stand stand;
  stand.ground << 0.03, 0.;
  BOOST_TEST(holdsAlone(stand.judge(), MotionFault::GroundPenetration, 100, 0.03, 0.));

  Stand sliding;
  sliding.motion.v.row(0).segment(10, 20).setConstant(0.3);
  sliding.motion.v.row(1).segment(10, 20).setConstant(0.4);
  sliding.motion.v.row(2).setConstant(5.);  // lifting is not sliding
  BOOST_TEST(holdsAlone(sliding.judge(), MotionFault::FootSliding, 20, 0.5, 0.1));
  // Who does not touch does not slide.
  sliding.schedule.active.setConstant(false);
  sliding.settings.flight_with_support_needed.allowed_share = 1.;
  sliding.settings.contact_missing.allowed_share = 1.;
  BOOST_TEST(sliding.judge().isFeasible());
}

BOOST_AUTO_TEST_CASE(jumps_and_quaternions_of_the_record_are_faults) {
  Stand stand;
  stand.recorded.q.rightCols(40).row(0).setConstant(0.2);
  BOOST_TEST(holdsAlone(stand.judge(), MotionFault::Discontinuity, 1, 0.2, 0.6));
  // A fast motion is no jump, from its first frame to its last.
  for (Index frame = 0; frame < 100; ++frame) stand.recorded.q(0, frame) = 0.2 * double(frame);
  BOOST_TEST(stand.judge().isFeasible());
  // Turned, by half a radian, in the last frame; and in the first.
  for (const bool last : {true, false}) {
    stand.recorded.q = stand.motion.q;
    const Index frame = last ? 99 : 0;
    stand.recorded.q.col(frame).segment<4>(3) =
        Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Vector3d::UnitY())).coeffs();
    BOOST_TEST(holdsAlone(stand.judge(), MotionFault::Discontinuity, 1, 0.5, last ? 0.99 : 0.01));
  }
  stand.recorded.q = stand.motion.q;
  stand.recorded.quaternion_error[70] = 0.002;
  BOOST_TEST(holdsAlone(stand.judge(), MotionFault::Quaternion, 1, 0.002, 0.7));
}

BOOST_AUTO_TEST_CASE(codes_settings_and_sizes) {
  BOOST_TEST(to_string(MotionFault::ResidualForce) == std::string("residual_force"));
  BOOST_TEST(to_string(MotionFault::Quaternion) == std::string("quaternion"));
  const auto refused = [&](auto change, std::initializer_list<std::string> words) {
    Stand stand;
    change(stand);
    BOOST_TEST(throws<std::invalid_argument>([&] { stand.judge(); }, words));
  };
  refused([](auto& s) { s.settings.foot_sliding.limit = -1.; },
          {"VerdictSettings.foot_sliding.limit", "-1"});
  refused([](auto& s) { s.settings.quaternion.limit = kNaN; },
          {"VerdictSettings.quaternion.limit", "nan"});
  refused([](auto& s) { s.settings.discontinuity.allowed_share = 1.5; },
          {"VerdictSettings.discontinuity.allowed_share", "1.5"});
  refused([](auto& s) { s.settings.near_ground = 1. / 0.; },
          {"VerdictSettings.near_ground", "inf"});
  refused([](auto& s) { s.recorded.q.conservativeResize(7, 99); }, {"recorded.q", "100", "99"});
  refused([](auto& s) { s.recorded.quaternion_error.resize(3); },
          {"recorded.quaternion_error", "100", "3"});
  refused([](auto& s) { s.ground.resize(1); }, {"ground", "2", "1"});

  Stand stand;
  auto contacts = computeContactMotions(stand.robot, stand.motion);
  std::swap(contacts[0], contacts[1]);
  const auto analysis = analyzeMotion(stand.robot, stand.motion, stand.schedule);
  BOOST_TEST(throws<std::invalid_argument>(
      [&] {
        judgeMotion(stand.robot, stand.motion, stand.recorded, contacts, stand.ground, analysis);
      },
      {"sole0", "sole1"}));
  BOOST_TEST(throws<NotReadyError>(
      [&] {
        judgeMotion(DynaCoM(), stand.motion, stand.recorded, contacts, stand.ground, analysis);
      },
      {"initialize"}));

  VerdictSettings one, other;
  BOOST_TEST((one == other));
  other[MotionFault::FootSliding].limit = 7.;
  BOOST_TEST((one != other));
  BOOST_TEST(other.foot_sliding.limit == 7.);
  BOOST_TEST(mentions(other.to_string(), "foot_sliding"));
}
