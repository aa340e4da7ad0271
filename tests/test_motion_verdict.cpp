// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE motion_verdict
#include <cmath>
#include <limits>
#include <pinocchio/algorithm/joint-configuration.hpp>

#include "dynacom/contact6d.hpp"
#include "dynacom/motion_verdict.hpp"
#include "feet.hpp"
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
    ground.setZero(2, 1);
  }

  MotionVerdict judge() const {
    return judgeMotion(robot, motion, recorded, computeContactMotions(robot, motion), ground,
                       analyzeMotion(robot, motion, schedule), settings, 0, unsure);
  }

  pinocchio::Model model;
  DynaCoM robot;
  Motion motion;
  RecordedMotion recorded;
  ContactSchedule schedule;
  MatrixXd ground;
  VerdictSettings settings;
  Eigen::Array<bool, Eigen::Dynamic, 1> unsure;
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
  BOOST_TEST(holdsAlone(stand.judge(), MotionFault::FlightWithSupportNeeded, 10, 1., 0.3));
  // A fall is none, and what is nearly one neither.
  stand.motion.a.row(2).segment(30, 10).setConstant(-9.81 * 0.96);
  BOOST_TEST(stand.judge().isFeasible());
  stand.motion.a.row(2).segment(30, 10).setConstant(-9.81 * 0.94);
  BOOST_TEST(holdsAlone(stand.judge(), MotionFault::FlightWithSupportNeeded, 10, 0.06, 0.3));
}

BOOST_AUTO_TEST_CASE(a_lean_is_measured_in_metres) {
  // The soles reach 0.1 m to the front of what is below the centre of mass: see singleBody().
  Stand stand;
  const double inertia = stand.model.inertias[1].inertia()(1, 1);
  const auto lean = [&](double metres) {
    // A moment that takes the centre of pressure so far to the front of the centre of mass.
    stand.motion.a.row(4).setConstant(-metres * kWeight / inertia);
    return stand.judge()[MotionFault::CoPOutside];
  };
  const auto analysis = analyzeMotion(stand.robot, stand.motion, stand.schedule);
  const auto contacts = computeContactMotions(stand.robot, stand.motion);
  double front = -1.;
  for (const ContactMotion& contact : contacts)
    front = std::max(front, contact.position(0, 0) + 0.1 - analysis.com(0, 0));
  BOOST_TEST(lean(front - 0.01).worst == 0.);
  BOOST_TEST(close(lean(front + 0.05).measured, VectorXd::Constant(100, 0.05), 1e-6));
  BOOST_TEST(lean(front + 0.05).holds);
  BOOST_TEST(!lean(front + 0.019).holds);
  BOOST_TEST(lean(front + 0.021).holds);
  // Neither force nor moment that is missing says so.
  const MotionVerdict verdict = stand.judge();
  BOOST_TEST((verdict.getCodes() == std::vector<std::string>{"cop_outside"}));
  // Without much force, where the moment presses does not matter.
  stand.settings.cop_force = 1.1;
  BOOST_TEST(lean(front + 0.05).worst == 0.);
  stand.settings.cop_force = 0.9;
  BOOST_TEST(lean(front + 0.05).worst > 0.04);
  stand.schedule.active.setConstant(false);
  BOOST_TEST(lean(front + 0.05).worst == 0.);
}

BOOST_AUTO_TEST_CASE(feet_below_the_ground_and_sliding_ones_are_faults) {
  Stand stand;
  stand.ground << 0.03, 0.;
  BOOST_TEST(holdsAlone(stand.judge(), MotionFault::GroundPenetration, 100, 0.03, 0.));
  BOOST_TEST(stand.judge()[MotionFault::GroundPenetration].subject == "sole0");
  // Ground that changes, and ground that nobody knows.
  stand.ground.setConstant(2, 100, kNaN);
  stand.ground.row(1).setZero();
  BOOST_TEST(stand.judge().isFeasible());
  stand.ground.row(1).segment(40, 5).setConstant(0.05);
  BOOST_TEST(holdsAlone(stand.judge(), MotionFault::GroundPenetration, 5, 0.05, 0.4));
  BOOST_TEST(stand.judge()[MotionFault::GroundPenetration].subject == "sole1");
  stand.ground.setConstant(kNaN);
  BOOST_TEST(stand.judge()[MotionFault::GroundPenetration].worst == 0.);

  Stand sliding;
  sliding.motion.v.row(0).segment(10, 20).setConstant(0.3);
  sliding.motion.v.row(1).segment(10, 20).setConstant(0.4);
  sliding.motion.v.row(2).setConstant(5.);  // lifting is not sliding
  BOOST_TEST(holdsAlone(sliding.judge(), MotionFault::FootSliding, 20, 0.5, 0.1));
  // Who does not touch does not slide.
  sliding.schedule.active.setConstant(false);
  sliding.settings.flight_with_support_needed.allowed_share = 1.;
  BOOST_TEST(sliding.judge().isFeasible());
}

BOOST_AUTO_TEST_CASE(jumps_of_the_record_are_faults) {
  // 0.2 m in a hundredth of a second are 20 m/s, of 10 m/s.
  Stand stand;
  stand.recorded.q.rightCols(40).row(0).setConstant(0.2);
  BOOST_TEST(holdsAlone(stand.judge(), MotionFault::Discontinuity, 2, 2., 0.59));
  BOOST_TEST(stand.judge()[MotionFault::Discontinuity].subject == "root");
  stand.settings.linear_speed = 40.;
  BOOST_TEST(stand.judge().isFeasible());
  BOOST_TEST(close(stand.judge()[MotionFault::Discontinuity].worst, 0.5));
  // A fast motion is no jump, from its first frame to its last.
  stand.settings = {};
  for (Index frame = 0; frame < 100; ++frame) stand.recorded.q(0, frame) = 0.099 * double(frame);
  BOOST_TEST(stand.judge().isFeasible());
  // Turned, by half a radian, in the last frame; and in the first.
  for (const bool last : {true, false}) {
    stand.recorded.q = stand.motion.q;
    const Index frame = last ? 99 : 0;
    // Whatever the quaternion's sign.
    stand.recorded.q.col(frame).segment<4>(3) =
        -Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Vector3d::UnitY())).coeffs();
    BOOST_TEST(
        holdsAlone(stand.judge(), MotionFault::Discontinuity, 2, 50. / 30., last ? 0.98 : 0.));
    BOOST_TEST(stand.judge()[MotionFault::Discontinuity].subject == "root's orientation");
  }
  // A frame that comes early has not moved faster.
  stand.recorded.q = stand.motion.q;
  stand.recorded.q.rightCols(40).row(0).setConstant(0.09);
  stand.motion.time[60] -= 0.009;
  BOOST_TEST(stand.judge().isFeasible());
}

BOOST_AUTO_TEST_CASE(each_joint_has_its_own_greatest_speed) {
  pinocchio::Model model;
  const auto add = [&](pinocchio::JointIndex parent, const pinocchio::JointModel& joint,
                       const char* name) {
    const pinocchio::JointIndex index = model.addJoint(parent, joint, SE3::Identity(), name);
    model.appendBodyToJoint(index, pinocchio::Inertia::FromSphere(1., 0.1), SE3::Identity());
    return index;
  };
  const pinocchio::JointIndex root = add(0, pinocchio::JointModelFreeFlyer(), "base");
  add(root, pinocchio::JointModelRX(), "hinge");
  add(root, pinocchio::JointModelPrismaticUnaligned(1., 2., 3.), "slide");
  add(root, pinocchio::JointModelRUBZ(), "wheel");
  add(root, pinocchio::JointModelSpherical(), "ball");
  add(root, pinocchio::JointModelPlanar(), "puck");
  const DynaCoM robot(model);
  const Index frames = 20;
  Motion motion;
  motion.time = VectorXd::LinSpaced(frames, 0., 0.19);
  motion.q = restState(model).q.replicate(1, frames);
  motion.v = motion.a = MatrixXd::Zero(model.nv, frames);
  const auto analysis = analyzeMotion(robot, motion, {{}, ContactSchedule::Matrix(0, frames)});
  const auto judge = [&](const char* name, const VectorXd& step) {
    RecordedMotion recorded{motion.time, motion.q};
    const auto joint = model.joints[model.getJointId(name)];
    VectorXd v = VectorXd::Zero(model.nv);
    v.segment(joint.idx_v(), joint.nv()) = step;
    for (Index frame = 10; frame < frames; ++frame)
      recorded.q.col(frame) = pinocchio::integrate(model, VectorXd(motion.q.col(frame)), v);
    const MotionVerdict verdict =
        judgeMotion(robot, motion, recorded, {}, MatrixXd(0, 1), analysis, {});
    return verdict[MotionFault::Discontinuity];
  };
  const auto is = [&](const char* name, const VectorXd& step, double worst) {
    const MotionFinding finding = judge(name, step);
    return finding.subject == name && close(finding.worst, worst) && finding.time == 0.09 &&
           finding.frames == (worst > 1. ? 2 : 0);
  };
  const auto one = [](double value) { return VectorXd::Constant(1, value); };
  BOOST_TEST(is("hinge", one(-0.6), 60. / 50.));
  BOOST_TEST(is("hinge", one(7.), 700. / 50.));
  BOOST_TEST(is("slide", one(0.2), 20. / 10.));
  BOOST_TEST(is("slide", one(0.09), 9. / 10.));
  BOOST_TEST(is("wheel", one(0.6), 60. / 50.));
  BOOST_TEST(is("wheel", one(6.), (2. * std::acos(-1.) - 6.) / 0.5));  // the short way round
  BOOST_TEST(is("ball", Vector3d(0.3, 0., 0.4), 50. / 50.));
  BOOST_TEST(is("puck", Vector3d(0., 0., 0.9), 90. / 50.));
  BOOST_TEST(is("puck", Vector3d(0.12, -0.16, 0.), 20. / 10.));
}

BOOST_AUTO_TEST_CASE(what_is_near_a_jump_is_not_measured) {
  // Without a load, for half of the time; and it slides.
  Stand stand;
  stand.motion.a.row(2).segment(25, 50).setConstant(-20.);
  stand.motion.v.row(0).setConstant(1.);
  stand.recorded.q.rightCols(50).row(0).setConstant(0.2);
  stand.settings.jump_time = 0.1;
  const MotionVerdict verdict = stand.judge();
  // The step is from frame 49 to frame 50.
  for (Index frame = 0; frame < 100; ++frame) {
    const bool near = frame >= 39 && frame <= 60;
    BOOST_TEST(verdict.unsure[frame] == near);
    const bool is_beyond = !near && frame >= 25 && frame < 75;
    BOOST_TEST((verdict[MotionFault::ResidualForce].measured[frame] > 0.) == is_beyond);
    BOOST_TEST((verdict[MotionFault::FootSliding].measured[frame] > 0.) == !near);
  }
  // Two frames at either side, at least.
  stand.settings.jump_time = 0.;
  BOOST_TEST(stand.judge().unsure.count() == 6);
  BOOST_TEST(stand.judge().unsure.segment(47, 6).all());
}

BOOST_AUTO_TEST_CASE(windows_neither_begin_nor_end_where_nothing_is_known) {
  Stand stand;
  stand.settings.minimal_window = 0.2;
  stand.unsure.setConstant(100, false);
  stand.unsure.head(30).setConstant(true);
  stand.unsure.segment(60, 10).setConstant(true);
  stand.unsure.tail(5).setConstant(true);
  const MotionVerdict verdict = stand.judge();
  BOOST_REQUIRE(verdict.windows.size() == 1u);
  BOOST_TEST(verdict.windows[0].first == 30);
  BOOST_TEST(verdict.windows[0].last == 94);
  BOOST_TEST(verdict.feasible_share == 0.65);
  // Nor with an interruption beside what is not known.
  stand.ground.setZero(2, 100);
  stand.ground.middleCols(31, 2).setConstant(0.1);
  stand.settings.ground_penetration.allowed_share = 1.;
  BOOST_REQUIRE(stand.judge().windows.size() == 1u);
  BOOST_TEST(stand.judge().windows[0].first == 33);
  stand.ground.setZero(2, 1);
  stand.settings.minimal_window = 0.;
  stand.unsure.setConstant(true);
  BOOST_TEST(stand.judge().windows.empty());
  stand.settings.minimal_window = 0.2;
  stand.unsure.segment(50, 10).setConstant(false);
  BOOST_TEST(stand.judge().windows.empty());
}

BOOST_AUTO_TEST_CASE(limits_are_parts_of_the_weight_that_there_is) {
  // Lifted by what a sixth of the weight on Earth gives, wherever it stands.
  for (const double gravity : {9.81, 1.62}) {
    Stand stand;
    stand.model.gravity.linear().z() = -gravity;
    stand.robot = DynaCoM(stand.model);
    for (const char* frame : {"sole0", "sole1"}) stand.robot.addContact(makeSole(frame), frame);
    stand.motion.a.row(2).setConstant(-1.2 * gravity);
    const MotionVerdict verdict = stand.judge();
    BOOST_TEST(close(verdict[MotionFault::ResidualForce].worst, 0.2, 1e-9));
  }
}

BOOST_AUTO_TEST_CASE(frames_that_are_unsure_count_neither_for_nor_against) {
  // Four frames of a hundred may be pulled down; of the fifty that are known, two.
  Stand stand;
  stand.motion.a.row(2).segment(10, 4).setConstant(-12.);
  BOOST_TEST(stand.judge().isFeasible());
  stand.unsure.setConstant(100, false);
  stand.unsure.tail(50).setConstant(true);
  BOOST_TEST(stand.judge()[MotionFault::ResidualForce].holds);
  BOOST_TEST(!stand.judge().isFeasible());
  stand.motion.a.row(2).segment(12, 2).setZero();
  BOOST_TEST(stand.judge().isFeasible());
  // A handful of known frames is too few to call a motion feasible.
  stand.unsure.tail(94).setConstant(true);
  BOOST_TEST(stand.judge().isFeasible());
  stand.unsure.tail(95).setConstant(true);
  BOOST_TEST((stand.judge().outcome == MotionOutcome::Unknown));
}

BOOST_AUTO_TEST_CASE(what_is_unsure_is_not_measured) {
  Stand stand;
  stand.motion.a.row(2).setConstant(-20.);
  stand.motion.v.row(0).setConstant(0.1);
  stand.schedule.active.leftCols(50).setConstant(false);
  BOOST_TEST(stand.judge()[MotionFault::ResidualForce].frames == 50);
  BOOST_TEST(stand.judge()[MotionFault::FlightWithSupportNeeded].frames == 50);
  stand.unsure.setConstant(100, false);
  stand.unsure.segment(45, 10).setConstant(true);
  const MotionVerdict verdict = stand.judge();
  BOOST_TEST(verdict[MotionFault::ResidualForce].frames == 45);
  BOOST_TEST(verdict[MotionFault::FlightWithSupportNeeded].frames == 45);
  BOOST_TEST(verdict[MotionFault::FootSliding].measured[52] == 0.1);
  BOOST_TEST((verdict.unsure == stand.unsure).all());
  // Where nothing is sure, nothing is known but what needs no accelerations.
  stand.unsure.setConstant(true);
  BOOST_TEST((stand.judge().getCodes() == std::vector<std::string>{"too_short"}));
  stand.ground.setConstant(0.1);
  BOOST_TEST((stand.judge().getCodes() == std::vector<std::string>{"ground_penetration"}));
}

BOOST_AUTO_TEST_CASE(short_clips_are_unknown) {
  for (const Index frames : {1, 2, 3, 5, 6}) {
    Stand stand;
    stand.motion.time.conservativeResize(frames);
    for (MatrixXd* values : {&stand.motion.q, &stand.motion.v, &stand.motion.a, &stand.recorded.q})
      values->conservativeResize(Eigen::NoChange, frames);
    stand.schedule.active.conservativeResize(2, frames);
    MotionVerdict verdict = stand.judge();
    const bool is_known = frames >= kMinimalFrames;
    BOOST_TEST(verdict.isFeasible() == is_known);
    BOOST_TEST((verdict.outcome == MotionOutcome::Unknown) == !is_known);
    BOOST_TEST(verdict.getCodes().at(0) == (is_known ? "feasible" : "too_short"));
    // Whatever else it is.
    stand.ground.setConstant(0.1);
    BOOST_TEST((stand.judge().outcome == MotionOutcome::Unknown) == !is_known);
    BOOST_TEST((stand.judge().outcome == MotionOutcome::NotFeasible) == is_known);
    // Recorded derivatives are known.
    stand.ground.setZero();
    stand.recorded.v = stand.motion.v;
    BOOST_TEST(stand.judge().isFeasible() == is_known);
    stand.recorded.a = stand.motion.a;
    BOOST_TEST(stand.judge().isFeasible());
    stand.recorded.a(0, 0) = 1.;  // others
    BOOST_TEST(stand.judge().isFeasible() == is_known);
  }
}

BOOST_AUTO_TEST_CASE(windows_are_what_is_long_and_without_fault) {
  // Penetration is a fault of any frame. Four seconds at 25 frames per second.
  Stand stand;
  stand.motion.time *= 4.;
  stand.ground.setZero(2, 100);
  const auto fail = [&](Index first, Index count) {
    stand.ground.row(0).segment(first, count).setConstant(1.);
  };
  const auto windows = [&](std::vector<std::pair<Index, Index>> expected) {
    const MotionVerdict verdict = stand.judge();
    Index inside = 0;
    bool is_so = verdict.windows.size() == expected.size();
    for (std::size_t k = 0; is_so && k < expected.size(); ++k) {
      const MotionWindow& window = verdict.windows[k];
      is_so = window.first == expected[k].first && window.last == expected[k].second &&
              window.begin == stand.motion.time[window.first] &&
              window.end == stand.motion.time[window.last];
      inside += window.last - window.first + 1;
    }
    return is_so && close(verdict.feasible_share, 0.01 * double(inside));
  };
  BOOST_TEST(windows({{0, 99}}));
  fail(0, 3);  // at an end, however short
  BOOST_TEST(windows({{3, 99}}));
  fail(60, 2);  // 0.08 s
  BOOST_TEST(windows({{3, 99}}));
  fail(62, 1);  // 0.12 s
  BOOST_TEST(windows({{3, 59}, {63, 99}}));
  stand.settings.interruption = 0.13;
  BOOST_TEST(windows({{3, 99}}));
  stand.settings.interruption = 0.1;
  stand.settings.minimal_window = 1.5;  // 36 frames later are 1.44 s
  BOOST_TEST(windows({{3, 59}}));
  stand.settings.minimal_window = 1.44;
  BOOST_TEST(windows({{3, 59}, {63, 99}}));
  // Faults every few frames are no short interruptions.
  for (Index frame = 6; frame < 60; frame += 3) fail(frame, 1);
  BOOST_TEST(windows({{63, 99}}));
  // A jump ends a window, however short it is, and with it what is unsure beside it.
  stand.ground.setZero();
  stand.recorded.q.rightCols(50).row(0).setConstant(1.);  // two frames, 0.08 s
  BOOST_TEST(windows({{0, 42}, {57, 99}}));
  // Frames that are unsure neither end one, nor are they beyond.
  stand.recorded.q = stand.motion.q;
  stand.motion.a.row(2).segment(40, 20).setConstant(-20.);
  BOOST_TEST(windows({}) == false);
  stand.settings.minimal_window = 0.5;
  BOOST_TEST(windows({{0, 39}, {60, 99}}));
  stand.unsure.setConstant(100, false);
  stand.unsure.segment(40, 20).setConstant(true);
  BOOST_TEST(windows({{0, 99}}));
}

BOOST_AUTO_TEST_CASE(normals_point_up_or_down_while_they_carry) {
  Stand stand;
  std::vector<ContactNormal> normals = stand.judge().normals;
  BOOST_TEST(normals.size() == 2u);
  BOOST_TEST(normals[0].up == 1.);
  BOOST_TEST(normals[0].downward_share == 0.);
  // Tilted by 60° to the side for a quarter of the time, upside down for another; the other foot is
  // active then only.
  const auto tilt = [&](Index first, double angle) {
    stand.motion.q.middleCols(first, 25).bottomRows<4>().colwise() =
        Eigen::Quaterniond(Eigen::AngleAxisd(angle, Vector3d::UnitX())).coeffs();
  };
  tilt(0, std::acos(0.5));
  tilt(25, std::acos(-1.));
  stand.recorded.q = stand.motion.q;
  stand.schedule.active.row(1).setConstant(false);
  stand.schedule.active.row(1).segment(25, 25).setConstant(true);
  normals = stand.judge().normals;
  BOOST_TEST(close(normals[0].up, 0.25 * (0.5 - 1. + 1. + 1.)));
  BOOST_TEST(normals[0].downward_share == 0.25);
  BOOST_TEST(close(normals[1].up, -1.));
  BOOST_TEST(normals[1].downward_share == 1.);
  // That is a fault, by how far below the horizontal they point, and ends windows.
  const MotionVerdict verdict = stand.judge();
  const MotionFinding& downward = verdict[MotionFault::DownwardNormal];
  BOOST_TEST(downward.holds);
  BOOST_TEST(downward.frames == 25);
  BOOST_TEST(close(downward.worst, 0.5 * M_PI, 1e-7));
  BOOST_TEST(close(downward.time, 0.25));
  BOOST_TEST(downward.subject == "sole0");
  BOOST_TEST(downward.measured.head(25).isZero(0.));
  BOOST_TEST(verdict.getCodes().front() == "downward_normal");
  stand.schedule.active.row(1).setConstant(false);
  normals = stand.judge().normals;
  BOOST_TEST(std::isnan(normals[1].up));
  BOOST_TEST(std::isnan(normals[1].downward_share));
}

BOOST_AUTO_TEST_CASE(what_is_close_to_a_feasible_motion_is_repairable) {
  const auto weigh = [](const Stand& stand, double rms, double largest, bool converged = true) {
    MotionVerdict verdict = stand.judge();
    CentroidalChange change;
    change.rms = rms;
    change.largest = largest;
    change.converged = converged;
    verdict.weighDistance(change, stand.motion.time, stand.settings);
    return verdict.outcome;
  };
  Stand pulled;
  pulled.motion.a.row(2).setConstant(-12.);
  BOOST_TEST(holdsAlone(pulled.judge(), MotionFault::ResidualForce, 100, 12. / 9.81 - 1., 0.));
  BOOST_TEST((weigh(pulled, 0.01, 0.05) == MotionOutcome::Repairable));
  BOOST_TEST((weigh(pulled, 0.0101, 0.05) == MotionOutcome::NotFeasible));
  BOOST_TEST((weigh(pulled, 0.01, 0.0501) == MotionOutcome::NotFeasible));
  BOOST_TEST((weigh(pulled, 0.01, 0.05, false) == MotionOutcome::NotFeasible));
  pulled.settings.repairable_distance = 0.3;
  pulled.settings.repairable_largest_distance = 0.4;
  BOOST_TEST((weigh(pulled, 0.3, 0.4) == MotionOutcome::Repairable));

  // A repairable motion is no feasible one, and what speaks against it stays.
  MotionVerdict verdict = pulled.judge();
  verdict.weighDistance(CentroidalChange(), pulled.motion.time, pulled.settings);
  BOOST_TEST((verdict.outcome == MotionOutcome::Repairable));
  BOOST_TEST(!verdict.isFeasible());
  BOOST_TEST(verdict.getCodes().at(0) == "residual_force");
  BOOST_TEST(verdict.getSeverity() == 1.);

  // However far a feasible motion or an unknown one is said to be, they stay what they are.
  BOOST_TEST((weigh(Stand(), 1., 1.) == MotionOutcome::Feasible));
  BOOST_TEST((weigh(Stand(), 0., 0.) == MotionOutcome::Feasible));
  Stand unsure;
  unsure.unsure.setConstant(100, true);
  BOOST_TEST((weigh(unsure, 0., 0.) == MotionOutcome::Unknown));

  // What slides or sinks far is not near a motion that does not, although its forces are possible.
  Stand sliding;
  sliding.motion.v.row(0).segment(10, 20).setConstant(0.249);
  BOOST_TEST(holdsAlone(sliding.judge(), MotionFault::FootSliding, 20, 0.249, 0.1));
  sliding.settings.repairable_slide = 0.05;
  BOOST_TEST((weigh(sliding, 0., 0.) == MotionOutcome::Repairable));  // by 4.98 cm
  sliding.motion.v.row(0).segment(10, 20).setConstant(0.251);
  BOOST_TEST((weigh(sliding, 0., 0.) == MotionOutcome::NotFeasible));
  sliding.motion.v.row(0).segment(20, 1).setZero();  // twice by less
  BOOST_TEST((weigh(sliding, 0., 0.) == MotionOutcome::Repairable));
  Stand sunk;
  sunk.ground.setConstant(0.069);
  BOOST_TEST(holdsAlone(sunk.judge(), MotionFault::GroundPenetration, 100, 0.069, 0.));
  BOOST_TEST((weigh(sunk, 0., 0.) == MotionOutcome::Repairable));
  sunk.ground.setConstant(0.071);
  BOOST_TEST((weigh(sunk, 0., 0.) == MotionOutcome::NotFeasible));

  // No displacement mends a jump, nor a robot whose normals point down.
  Stand jumping = pulled;
  jumping.recorded.q.row(0).tail(20).array() += 3.;
  BOOST_TEST(jumping.judge()[MotionFault::Discontinuity].holds);
  BOOST_TEST((weigh(jumping, 0., 0.) == MotionOutcome::NotFeasible));
  for (std::size_t k = 0; k < kMotionFaults; ++k) {
    const auto fault = static_cast<MotionFault>(k);
    BOOST_TEST(isMendable(fault) ==
               (fault != MotionFault::DownwardNormal && fault != MotionFault::Discontinuity));
  }
}

BOOST_AUTO_TEST_CASE(what_is_not_a_number_is_a_fault) {
  const Stand stand;
  const auto contacts = computeContactMotions(stand.robot, stand.motion);
  const auto expectFault = [&](const auto& change, MotionFault fault) {
    auto changed = contacts;
    change(changed[1]);
    const MotionVerdict verdict =
        judgeMotion(stand.robot, stand.motion, stand.recorded, changed, stand.ground,
                    analyzeMotion(stand.robot, stand.motion, stand.schedule));
    BOOST_TEST(!verdict.isFeasible());
    BOOST_TEST(verdict[fault].frames == 20);
    BOOST_TEST(verdict[fault].worst == std::numeric_limits<double>::infinity());
    BOOST_TEST(verdict[fault].subject == "sole1");
  };
  expectFault([](auto& contact) { contact.height.segment(30, 20).setConstant(kNaN); },
              MotionFault::GroundPenetration);
  expectFault([](auto& contact) { contact.velocity.middleCols(30, 20).setConstant(kNaN); },
              MotionFault::FootSliding);
  expectFault([](auto& contact) { contact.rotation.middleCols(30, 20).setConstant(kNaN); },
              MotionFault::DownwardNormal);
  // But there may be no ground.
  auto changed = contacts;
  changed[1].height.setConstant(kNaN);
  BOOST_TEST(judgeMotion(stand.robot, stand.motion, stand.recorded, changed, Vector2d(0., kNaN),
                         analyzeMotion(stand.robot, stand.motion, stand.schedule))
                 .isFeasible());
}

BOOST_AUTO_TEST_CASE(severity_is_the_largest_share_of_what_holds) {
  MotionVerdict verdict = {};
  verdict.unsure.setConstant(20, false);
  BOOST_TEST(verdict.getSeverity() == 0.);
  verdict.findings[0].frames = 19;  // does not hold
  BOOST_TEST(verdict.getSeverity() == 0.);
  verdict.findings[3].holds = verdict.findings[5].holds = true;
  verdict.findings[3].frames = 5;
  verdict.findings[5].frames = 4;
  BOOST_TEST(verdict.getSeverity() == 0.25);
}

BOOST_AUTO_TEST_CASE(codes_settings_and_sizes) {
  BOOST_TEST(to_string(MotionFault::ResidualForce) == std::string("residual_force"));
  BOOST_TEST(to_string(MotionFault::Discontinuity) == std::string("discontinuity"));
  BOOST_TEST(getUnit(MotionFault::CoPOutside) == std::string("m"));
  BOOST_TEST(getMeaning(MotionFault::FootSliding) == std::string("an active contact slides"));
  BOOST_TEST(to_string(MotionOutcome::NotFeasible) == std::string("not feasible"));
  BOOST_TEST(to_string(MotionOutcome::Repairable) == std::string("repairable"));
  const auto refused = [&](auto change, std::initializer_list<std::string> words) {
    Stand stand;
    change(stand);
    BOOST_TEST(throws<std::invalid_argument>([&] { stand.judge(); }, words));
  };
  refused([](auto& s) { s.settings.foot_sliding.limit = -1.; },
          {"VerdictSettings.foot_sliding.limit", "-1"});
  refused([](auto& s) { s.settings.cop_outside.limit = kNaN; },
          {"VerdictSettings.cop_outside.limit", "nan"});
  refused([](auto& s) { s.settings.discontinuity.allowed_share = 1.5; },
          {"VerdictSettings.discontinuity.allowed_share", "1.5"});
  refused([](auto& s) { s.settings.cop_force = 1. / 0.; }, {"VerdictSettings.cop_force", "inf"});
  refused([](auto& s) { s.settings.joint_speed = 0.; }, {"VerdictSettings.joint_speed", "> 0"});
  refused([](auto& s) { s.settings.repairable_distance = 0.; },
          {"VerdictSettings.repairable_distance", "> 0"});
  refused([](auto& s) { s.settings.repairable_largest_distance = kNaN; },
          {"VerdictSettings.repairable_largest_distance", "nan"});
  refused([](auto& s) { s.recorded.q.conservativeResize(7, 99); }, {"recorded.q", "100", "99"});
  refused([](auto& s) { s.recorded.q(1, 50) = kNaN; }, {"recorded.q", "finite", "50"});
  refused([](auto& s) { s.recorded.q.col(50).tail(4).setZero(); },
          {"recorded.q", "quaternions", "50"});
  refused([](auto& s) { s.ground.resize(1, 1); }, {"ground", "2", "1"});
  refused([](auto& s) { s.ground.setZero(2, 99); }, {"ground", "100", "99"});
  refused([](auto& s) { s.unsure.setConstant(3, false); }, {"unsure", "100", "3"});

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
  other = one;
  other.minimal_window = 2.;
  BOOST_TEST((one != other));
  BOOST_TEST(mentions(other.to_string(), "minimal_window=2"));
}
