// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE motion_statistics
#include <cmath>
#include <limits>

#include "dynacom/contact6d.hpp"
#include "dynacom/motion_statistics.hpp"
#include "feet.hpp"
#include "random_robot.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

const double kNaN = std::numeric_limits<double>::quiet_NaN();

/// A body of 10 kg that floats above two soles. What is to be summed up is made up, so that sums
/// are known.
struct Case {
  explicit Case(Index frames = 4) : model(singleBody(10., stance(2))), robot(model) {
    for (const char* frame : {"sole0", "sole1"}) robot.addContact(makeSole(frame), frame);
    motion.time = VectorXd::LinSpaced(frames, 0., 0.5 * double(frames - 1));
    motion.q = restState(model).q.replicate(1, frames);
    motion.v = motion.a = MatrixXd::Zero(model.nv, frames);
    const ContactSchedule schedule{robot.getKnownContacts(),
                                   ContactSchedule::Matrix::Constant(2, frames, true)};
    analysis = analyzeMotion(robot, motion, schedule);
    analysis.residual.setZero();
    verdict.unsure.setConstant(frames, false);
  }

  MotionStatistics summarize() const { return summarizeMotion(robot, motion, analysis, verdict); }

  pinocchio::Model model;
  DynaCoM robot;
  Motion motion;
  MotionAnalysis analysis;
  MotionVerdict verdict = {};
};

}  // namespace

BOOST_AUTO_TEST_CASE(forces_are_parts_of_the_weight) {
  Case some;
  some.analysis.ground_force.row(2) << 90., 100., 110., 120.;
  some.analysis.vcom.row(2) << -1., 0., 0., 0.5;
  some.analysis.residual.col(1).head<3>() << 3., 4., 0.;
  some.analysis.residual.col(3).tail<3>() << 0., 6., 8.;
  some.analysis.status = {DistributionStatus::Solved, DistributionStatus::Relaxed,
                          DistributionStatus::Solved, DistributionStatus::NoContact};
  const MotionStatistics statistics = some.summarize();
  BOOST_TEST(statistics.frames == 4);
  BOOST_TEST(statistics.mass == 10.);
  BOOST_TEST(close(statistics.weight, 98.1));
  BOOST_TEST(close(statistics.mean_vertical_force, 105. / 98.1));
  BOOST_TEST(close(statistics.momentum_change, 10. * 1.5 / 1.5 / 98.1));
  BOOST_TEST(close(statistics.residual_force_rms, 2.5 / 98.1));
  BOOST_TEST(close(statistics.residual_torque_rms, 5. / 98.1));
  BOOST_TEST(statistics.share(DistributionStatus::Solved) == 0.5);
  BOOST_TEST(statistics.share(DistributionStatus::Relaxed) == 0.25);
  BOOST_TEST(statistics.share(DistributionStatus::InvalidInput) == 0.);
  BOOST_TEST(statistics.statuses.size() == 3u);
}

BOOST_AUTO_TEST_CASE(a_jump_gives_what_it_ends_with_in_momentum) {
  // Whatever is done between two velocities, the mean force is the weight and what changes them.
  const Index frames = 401;
  Case some(frames);
  const double rate = 200.;
  const auto t = VectorXd::LinSpaced(frames, 0., double(frames - 1) / rate).eval();
  some.motion.time = t;
  some.motion.q.row(2) = 1. + (t.array() * 1.3).sin() * 0.1;
  const Motion moved = differentiate(some.model, t, some.motion.q);
  const ContactSchedule schedule{some.robot.getKnownContacts(),
                                 ContactSchedule::Matrix::Constant(2, frames, true)};
  const MotionAnalysis analysis = analyzeMotion(some.robot, moved, schedule);
  const auto statistics = summarizeMotion(some.robot, moved, analysis, some.verdict);
  BOOST_TEST(std::abs(statistics.momentum_change) > 0.01);
  BOOST_TEST(statistics.mean_vertical_force == 1. + statistics.momentum_change,
             boost::test_tools::tolerance(0.05));
}

BOOST_AUTO_TEST_CASE(without_gravity_forces_are_parts_of_the_weight_on_earth) {
  Case some;
  some.model.gravity.linear().setZero();
  some.robot.initialize(some.model);
  BOOST_TEST(
      close(summarizeMotion(some.robot, some.motion, some.analysis, some.verdict).weight, 98.1));
  some.model.gravity.linear() << 0., 0., -1.62;
  some.robot.initialize(some.model);
  BOOST_TEST(
      close(summarizeMotion(some.robot, some.motion, some.analysis, some.verdict).weight, 16.2));
}

BOOST_AUTO_TEST_CASE(the_mean_residual_is_in_the_headings_axes) {
  Case some;
  // To the left of a robot that looks along y is −x; roll and pitch are no heading.
  const Eigen::Quaterniond left(Eigen::AngleAxisd(0.5 * std::acos(-1.), Vector3d::UnitZ()) *
                                Eigen::AngleAxisd(0.3, Vector3d::UnitY()));
  for (Index frame = 1; frame < 4; ++frame) some.motion.q.col(frame).segment<4>(3) = left.coeffs();
  some.analysis.residual.col(0) << 1., 2., 3., 4., 5., 6.;
  some.analysis.residual.col(1) << -2., 1., 3., -5., 4., 6.;  // the same, seen from the robot
  some.analysis.residual.col(2).setConstant(1e3);
  some.analysis.residual.col(3).setConstant(1e3);
  some.verdict.unsure[2] = true;
  for (MotionAnalysis::Contact& contact : some.analysis.contacts) contact.active[3] = false;
  const Vector6 expected = (Vector6() << 1., 2., 3., 4., 5., 6.).finished();
  BOOST_TEST(close(some.summarize().mean_residual, expected));
  some.analysis.contacts[1].active[3] = true;  // one suffices
  BOOST_TEST(some.summarize().mean_residual[0] > 300.);
  some.verdict.unsure.setConstant(true);
  BOOST_TEST(some.summarize().mean_residual.isZero(0.));
}

BOOST_AUTO_TEST_CASE(without_a_free_flyer_axes_are_the_worlds) {
  // This one has as many velocities as a free-flyer, but no quaternion.
  pinocchio::JointModelComposite root(2);
  root.addJoint(pinocchio::JointModelTranslation());
  root.addJoint(pinocchio::JointModelSphericalZYX());
  pinocchio::Model model;
  model.appendBodyToJoint(model.addJoint(0, root, SE3::Identity(), "root"),
                          pinocchio::Inertia::FromSphere(1., 0.1));
  const DynaCoM robot(model);
  const Motion motion{VectorXd::LinSpaced(2, 0., 1.), MatrixXd::Ones(6, 2), MatrixXd::Zero(6, 2),
                      MatrixXd::Zero(6, 2)};
  MotionAnalysis analysis = analyzeMotion(robot, motion, {{}, ContactSchedule::Matrix(0, 2)});
  analysis.residual.setOnes();
  analysis.contacts.emplace_back();  // one that is active
  analysis.contacts[0].active.setConstant(2, true);
  analysis.contacts[0].vertical_force.setZero(2);
  analysis.contacts[0].wrench.setZero(6, 2);
  analysis.contacts[0].friction_usage = analysis.contacts[0].cop_margin = VectorXd::Zero(2);
  MotionVerdict verdict = {};
  verdict.unsure.setConstant(2, false);
  BOOST_TEST(
      close(summarizeMotion(robot, motion, analysis, verdict).mean_residual, Vector6::Ones()));
}

BOOST_AUTO_TEST_CASE(contacts_have_their_own) {
  Case some;
  MotionAnalysis::Contact& contact = some.analysis.contacts[1];
  contact.active << false, true, true, false;
  contact.vertical_force << 0., 60., 40., 0.;
  contact.wrench.topRows<2>() << 0., 3., 0., 0.,  //
      0., -4., 0., 0.;
  contact.friction_usage << kNaN, 0.8, 0.9, kNaN;
  contact.cop_margin << kNaN, 0.03, kNaN, kNaN;
  ContactStatistics statistics = some.summarize().contacts.at(1);
  BOOST_TEST(statistics.name == "sole1");
  BOOST_TEST(statistics.active_share == 0.5);
  BOOST_TEST(close(statistics.weight_share, 25. / 98.1));
  BOOST_TEST(close(statistics.weight_share_while_active, 50. / 98.1));
  BOOST_TEST(close(statistics.largest_vertical_force, 60. / 98.1));
  BOOST_TEST(statistics.largest_friction_usage == 0.9);
  BOOST_TEST(close(statistics.largest_cone_usage, 1.));  // 5 instead of 4
  const VectorXd usage = computeConeUsage(contact);
  BOOST_TEST(std::isnan(usage[0]));
  BOOST_TEST(usage[2] == 0.9);
  // A cone's usage is that already.
  contact.friction.friction = FrictionModel::Cone;
  BOOST_TEST(computeConeUsage(contact)[1] == 0.8);
  contact.friction.friction = FrictionModel::OuterPyramid;
  BOOST_TEST(statistics.least_cop_margin == 0.03);

  contact.active.setConstant(false);
  contact.vertical_force.setZero();
  contact.friction_usage.setConstant(kNaN);
  contact.cop_margin.setConstant(kNaN);
  statistics = some.summarize().contacts.at(1);
  BOOST_TEST(statistics.active_share == 0.);
  BOOST_TEST(std::isnan(statistics.weight_share_while_active));
  BOOST_TEST(std::isnan(statistics.largest_friction_usage));
  BOOST_TEST(std::isnan(statistics.largest_cone_usage));
  BOOST_TEST(std::isnan(statistics.least_cop_margin));
}

BOOST_AUTO_TEST_CASE(links_have_their_own_and_what_they_do_together) {
  Case some;
  BOOST_TEST(some.summarize().bodies.empty());
  BOOST_TEST(some.summarize().bodies_active_share == 0.);
  BOOST_TEST(some.summarize().bodies_weight_share_while_active == 0.);
  MotionAnalysis::Body knee = {"knee", {}, MatrixXd::Zero(3, 4), {}}, hand = knee;
  knee.active.setConstant(4, false);
  hand.link = "hand";
  hand.active = knee.active;
  knee.active.head(2).setConstant(true);
  hand.active.segment(1, 2).setConstant(true);
  knee.force.row(2) << 20., 30., 0., 0.;
  knee.force.row(0) << 5., 5., 0., 0.;
  hand.force.row(2) << 0., 10., 12., 0.;
  some.analysis.bodies = {knee, hand};
  const MotionStatistics statistics = some.summarize();
  BOOST_TEST_REQUIRE(statistics.bodies.size() == 2u);
  BOOST_TEST(statistics.bodies[0].link == "knee");
  BOOST_TEST(statistics.bodies[0].active_share == 0.5);
  BOOST_TEST(close(statistics.bodies[0].weight_share, 12.5 / 98.1));
  BOOST_TEST(close(statistics.bodies[0].largest_vertical_force, 30. / 98.1));
  BOOST_TEST(statistics.bodies[1].link == "hand");
  BOOST_TEST(close(statistics.bodies[1].weight_share, 5.5 / 98.1));
  BOOST_TEST(statistics.bodies_active_share == 0.75);
  BOOST_TEST(close(statistics.bodies_weight_share_while_active, 24. / 98.1));
}

BOOST_AUTO_TEST_CASE(a_load_is_lacked_all_the_time) {
  // What is missing in each frame, in m g and m g m, and whether that may be a load.
  const auto mayBeLoad = [](double force, double torque, double pull, bool alternates = false) {
    Case some;
    for (Index frame = 0; frame < 4; ++frame) {
      const double sign = alternates && frame % 2 == 1 ? -1. : 1.;
      some.analysis.residual.col(frame) << pull, 0., sign * force, 0., sign * torque, 0.;
    }
    some.analysis.residual *= 98.1;
    return some.summarize().mayBeLoad();
  };
  BOOST_TEST(!mayBeLoad(0., 0., 0.));
  BOOST_TEST(mayBeLoad(0.05, 0., 0.));
  BOOST_TEST(mayBeLoad(0., 0.01, 0.));
  BOOST_TEST(mayBeLoad(0.05, 0.01, 0.01));
  BOOST_TEST(!mayBeLoad(0.002, 0.002, 0.));      // nothing
  BOOST_TEST(!mayBeLoad(0.05, 0.01, 0., true));  // up and down
  BOOST_TEST(!mayBeLoad(0.05, 0.01, 0.03));      // nothing pulls along the ground
  BOOST_TEST(!mayBeLoad(0.4, 0., 0.));           // nobody carries as much
  BOOST_TEST(!mayBeLoad(0.05, 0.4, 0.));
}

BOOST_AUTO_TEST_CASE(what_is_not_known_may_be_no_load) {
  Case some;
  some.analysis.residual.row(2).setConstant(0.05 * 98.1);
  BOOST_TEST(some.summarize().mayBeLoad());
  MotionStatistics statistics = some.summarize();
  statistics.residual_force_rms = kNaN;
  BOOST_TEST(!statistics.mayBeLoad());
  // A frame that is left out of the mean, but not out of the root mean square.
  for (const Index row : {2, 4}) {
    Case other = some;
    other.analysis.residual(row, 3) = kNaN;
    other.verdict.unsure[3] = true;
    BOOST_TEST(other.summarize().mean_residual.allFinite());
    BOOST_TEST(!other.summarize().mayBeLoad());
    other.verdict.unsure[3] = false;
    BOOST_TEST(!other.summarize().mayBeLoad());
  }
}

BOOST_AUTO_TEST_CASE(a_single_frame_has_no_change) {
  const Case some(1);
  BOOST_TEST(some.summarize().momentum_change == 0.);
}

BOOST_AUTO_TEST_CASE(what_does_not_belong_together_is_refused) {
  const Case some;
  Case other = some;
  other.motion.time.conservativeResize(3);
  BOOST_TEST(throws<std::invalid_argument>([&] { other.summarize(); }, {"motion.q", "3", "4"}));
  other = some;
  other.analysis.status.resize(3);
  BOOST_TEST(throws<std::invalid_argument>([&] { other.summarize(); }, {"analysis", "4", "3"}));
  other = some;
  other.verdict.unsure.setConstant(5, false);
  BOOST_TEST(throws<std::invalid_argument>([&] { other.summarize(); }, {"verdict", "4", "5"}));
  BOOST_CHECK_THROW(summarizeMotion(DynaCoM(), some.motion, some.analysis, some.verdict),
                    NotReadyError);
}

BOOST_AUTO_TEST_CASE(measured_forces_are_compared_by_component) {
  MatrixXd measured(3, 5), computed(3, 5);
  measured << 1., 2., 3., kNaN, 5.,  //
      1., 1., 1., 1., 1.,            //
      4., 3., 2., 1., 0.;
  computed.row(0) = measured.row(0).array() + 0.5;
  computed.row(1) << 1., 2., 1., 9., 2.;
  computed.row(2) = -measured.row(2);
  computed.col(3).setConstant(100.);  // is left out
  MeasuredDifference difference = compareMeasured(computed, measured);
  BOOST_TEST(difference.frames == 4);
  BOOST_TEST(close(difference.bias, Vector3d(0.5, 0.5, -4.5)));
  BOOST_TEST(close(difference.rms, Vector3d(0.5, std::sqrt(0.5), std::sqrt(29.))));
  BOOST_TEST(difference.correlation[0] == 1., boost::test_tools::tolerance(1e-12));
  BOOST_TEST(std::isnan(difference.correlation[1]));
  BOOST_TEST(difference.correlation[2] == -1., boost::test_tools::tolerance(1e-12));

  // Neither does what is constant but for the rounding of its mean.
  measured.row(0).setConstant(1. / 3.);
  computed.row(0).setConstant(1.1);
  BOOST_TEST(std::isnan(compareMeasured(computed, measured).correlation[0]));

  measured.setConstant(kNaN);
  difference = compareMeasured(computed, measured);
  BOOST_TEST(difference.frames == 0);
  BOOST_TEST(allNaN(difference.bias));
  BOOST_TEST(throws<std::invalid_argument>([&] { compareMeasured(computed, measured.topRows(2)); },
                                           {"computed", "2", "3"}));
  BOOST_TEST(throws<std::invalid_argument>([&] { compareMeasured(computed, measured.leftCols(2)); },
                                           {"computed", "2", "5"}));
}
