// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE motion_analysis
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <mutex>

#include "dynacom/contact6d.hpp"
#include "dynacom/contact_point.hpp"
#include "dynacom/motion_analysis.hpp"
#include "random_robot.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

const double kNaN = std::numeric_limits<double>::quiet_NaN();

/// A robot on two soles and a point, and a motion near its rest, in which some of them take part.
struct Walk {
  explicit Walk(unsigned seed, Index frames = 40)
      : random(seed), model(standingRobot(random, stance(3))), robot(model) {
    Contact6DSettings sole;
    sole.mu = 0.7;
    sole.gu = 0.1;
    sole.half_length = 0.5;
    sole.half_width = 0.2;
    for (const char* frame : {"sole0", "sole1"}) {
      sole.frame_name = frame;
      robot.addContact(std::make_shared<Contact6D>(sole), std::string("foot on ") + frame);
    }
    ContactPointSettings point;
    point.mu = 0.7;
    point.frame_name = "sole2";
    robot.addContact(std::make_shared<ContactPoint>(point), "hand", false);

    motion.time = VectorXd::LinSpaced(frames, 0., 1.);
    motion.q.resize(model.nq, frames);
    motion.v.resize(model.nv, frames);
    motion.a.resize(model.nv, frames);
    for (Index frame = 0; frame < frames; ++frame) {
      const State x = randomState(model, random, 0.02);
      motion.q.col(frame) = x.q;
      motion.v.col(frame) = x.v;
      motion.a.col(frame) = x.a;
    }
    // Not in the robot's order.
    schedule.names = {"hand", "foot on sole1", "foot on sole0"};
    schedule.active.resize(3, frames);
    for (Index frame = 0; frame < frames; ++frame)
      schedule.active.col(frame) << random.coin(), frame % 10 != 3, frame % 7 != 0;
    schedule.active.col(5).setConstant(false);
  }

  Random random;
  pinocchio::Model model;
  DynaCoM robot;
  Motion motion;
  ContactSchedule schedule;
};

/// Whether two numbers, or all of two vectors, are the same, or NaN both.
boost::test_tools::predicate_result sameOrNaN(const VectorXd& actual, const VectorXd& expected,
                                              double tolerance = 1e-12) {
  if (allNaN(expected)) return allNaN(actual);
  return close(actual, expected, tolerance);
}

}  // namespace

BOOST_AUTO_TEST_CASE(every_frame_is_what_a_dynacom_says) {
  std::map<DistributionStatus, int> count;
  for (const bool flat : {true, false}) {
    Walk walk(1);
    // Faster than friction allows.
    walk.motion.a.col(11).head<3>() << 30., 0., 0.;
    walk.robot.setGroundHeight(-0.1);
    AnalysisSettings settings;
    settings.flat_horizontal_ground = flat;
    settings.omega = 3.5;
    const auto result = analyzeMotion(walk.robot, walk.motion, walk.schedule, settings);
    BOOST_TEST(result.omega == 3.5);
    BOOST_TEST(close(result.time, walk.motion.time, 0.));
    BOOST_REQUIRE(result.contacts.size() == 3u);
    BOOST_REQUIRE(result.status.size() == static_cast<std::size_t>(walk.motion.frames()));

    for (Index frame = 0; frame < walk.motion.frames(); ++frame) {
      BOOST_TEST_CONTEXT("frame " << frame) {
        // A DynaCoM that knows no other frame.
        DynaCoM expected(walk.robot);
        for (const auto& name : expected.getKnownContacts()) expected.deactivateContact(name);
        for (Index k = 0; k < 3; ++k)
          if (walk.schedule.active(k, frame)) expected.activateContact(walk.schedule.names[k]);
        expected.computeNL(3.5, walk.motion.q.col(frame), walk.motion.v.col(frame),
                           walk.motion.a.col(frame), Vector6::Zero(), flat);
        const auto status = expected.distributeForce(
            expected.getGroundCoMForce(), expected.getGroundCoMTorque(), expected.getCoM());

        BOOST_TEST(close(result.com.col(frame), expected.getCoM()));
        BOOST_TEST(close(result.vcom.col(frame), expected.getVCoM()));
        BOOST_TEST(close(result.acom.col(frame), expected.getACoM()));
        BOOST_TEST(close(result.am.col(frame), expected.getAM()));
        BOOST_TEST(close(result.dam.col(frame), expected.getAMVariation()));
        BOOST_TEST(close(result.ground_force.col(frame), expected.getGroundCoMForce()));
        BOOST_TEST(close(result.ground_torque.col(frame), expected.getGroundCoMTorque()));
        BOOST_TEST(sameOrNaN(result.cop.col(frame), expected.getCoP(), 1e-9));
        BOOST_TEST(close(result.vrp.col(frame), expected.getVRP(), 1e-9));
        BOOST_TEST(sameOrNaN(result.nl.col(frame), expected.getNL(), 1e-9));
        BOOST_TEST(result.status[frame] == status);
        ++count[status];

        Vector6 sum = Vector6::Zero();
        for (const auto& contact : result.contacts) {
          const ContactBase& known = *expected.getContact(contact.name);
          Vector6 wrench = Vector6::Zero();
          wrench.head(known.cols()) = known.appliedForce();
          BOOST_TEST(close(contact.wrench.col(frame), wrench, 1e-9));
          BOOST_TEST(close(contact.vertical_force[frame], known.toWorldForces().z(), 1e-9));
          sum += known.toCoMForces();
        }
        Vector6 ground;
        ground << expected.getGroundCoMForce(), expected.getGroundCoMTorque();
        BOOST_TEST(close(result.residual.col(frame), ground - sum, 1e-9));
        if (status == DistributionStatus::Solved)
          BOOST_TEST(close(result.residual.col(frame), Vector6::Zero(), 1e-6));
      }
    }
  }
  // All have been met.
  BOOST_TEST(count[DistributionStatus::Solved] > 30);
  BOOST_TEST(count[DistributionStatus::Relaxed] >= 2);
  BOOST_TEST(count[DistributionStatus::NoContact] >= 2);
}

BOOST_AUTO_TEST_CASE(contacts_are_those_of_the_robot_in_its_order) {
  Walk walk(2);
  const auto result = analyzeMotion(walk.robot, walk.motion, walk.schedule);
  const auto names = walk.robot.getKnownContacts();
  BOOST_REQUIRE(result.contacts.size() == names.size());
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto& contact = result.contacts[i];
    BOOST_TEST(contact.name == names[i]);
    const auto row = std::find(walk.schedule.names.begin(), walk.schedule.names.end(), names[i]) -
                     walk.schedule.names.begin();
    for (Index frame = 0; frame < walk.motion.frames(); ++frame) {
      BOOST_TEST(contact.active[frame] == walk.schedule.active(row, frame));
      if (!contact.active[frame]) {
        BOOST_TEST(close(contact.wrench.col(frame), Vector6::Zero(), 0.));
        BOOST_TEST(contact.vertical_force[frame] == 0.);
      }
    }
  }
}

BOOST_AUTO_TEST_CASE(contacts_without_schedule_are_never_active) {
  // Although they are so in the robot.
  Walk walk(3);
  const auto robotsOwn = walk.robot.getActiveContacts();
  BOOST_REQUIRE(robotsOwn.size() == 2u);
  const ContactSchedule::Matrix rows = walk.schedule.active.bottomRows(1);
  walk.schedule = {{"foot on sole0"}, rows};
  const auto result = analyzeMotion(walk.robot, walk.motion, walk.schedule);
  BOOST_REQUIRE(result.contacts.size() == 3u);
  for (const auto& contact : result.contacts) {
    if (contact.name == "foot on sole0") {
      BOOST_TEST(contact.active.any());
      continue;
    }
    BOOST_TEST(!contact.active.any());
    BOOST_TEST(contact.wrench.isZero(0.));
    BOOST_TEST(contact.vertical_force.isZero(0.));
  }

  // Nor is any, without a schedule.
  const auto flight = analyzeMotion(walk.robot, walk.motion,
                                    {{}, ContactSchedule::Matrix(0, walk.motion.frames())});
  for (Index frame = 0; frame < walk.motion.frames(); ++frame) {
    BOOST_TEST(flight.status[frame] == DistributionStatus::NoContact);
    BOOST_TEST(close(flight.residual.col(frame).head<3>(), flight.ground_force.col(frame), 0.));
    BOOST_TEST(close(flight.residual.col(frame).tail<3>(), flight.ground_torque.col(frame), 0.));
  }
}

BOOST_AUTO_TEST_CASE(the_robot_is_left_as_it_is) {
  Walk walk(4);
  const State x = restState(walk.model);
  walk.robot.computeNL(3., x.q, x.v, x.a, Vector6::Zero(), false);
  const auto active = walk.robot.getActiveContacts(), known = walk.robot.getKnownContacts();
  const VectorXd forces = walk.robot.allForces();
  const MatrixXd ne = walk.robot.ne_A();
  const Vector3d com = walk.robot.getCoM();
  const SE3 pose = walk.robot.getContact("hand")->getPose();
  const Vector2d nl = walk.robot.getNL();
  BOOST_REQUIRE(forces.norm() > 1.);

  analyzeMotion(walk.robot, walk.motion, walk.schedule);
  BOOST_TEST(walk.robot.getActiveContacts() == active, boost::test_tools::per_element());
  BOOST_TEST(walk.robot.getKnownContacts() == known, boost::test_tools::per_element());
  BOOST_TEST(close(walk.robot.allForces(), forces, 0.));
  BOOST_TEST(close(walk.robot.ne_A(), ne, 0.));
  BOOST_TEST(close(walk.robot.getCoM(), com, 0.));
  BOOST_TEST(close(walk.robot.getNL(), nl, 0.));
  BOOST_TEST((walk.robot.getContact("hand")->getPose() == pose));
}

BOOST_AUTO_TEST_CASE(omega_is_that_of_a_pendulum_of_the_mean_height) {
  Walk walk(5);
  for (const double height : {0., -0.5}) {
    walk.robot.setGroundHeight(height);
    const auto result = analyzeMotion(walk.robot, walk.motion, walk.schedule);
    double mean = 0.;
    for (Index frame = 0; frame < walk.motion.frames(); ++frame)
      mean += comOf(walk.model, walk.motion.q.col(frame)).z() / walk.motion.frames();
    const double omega = std::sqrt(9.81 / (mean - height));
    BOOST_TEST(close(result.omega, omega));
    for (Index frame = 0; frame < walk.motion.frames(); ++frame) {
      const Vector2d vrp =
          (result.com.col(frame) - result.acom.col(frame) / (omega * omega)).head<2>();
      BOOST_TEST(close(result.vrp.col(frame), vrp));
      BOOST_TEST(close(result.nl.col(frame), result.cop.col(frame) - vrp));
    }
  }
}

BOOST_AUTO_TEST_CASE(where_there_is_no_pendulum_there_is_no_omega) {
  Walk walk(6);
  // The CoM is below the ground.
  walk.robot.setGroundHeight(100.);
  auto result = analyzeMotion(walk.robot, walk.motion, walk.schedule);
  BOOST_TEST(std::isnan(result.omega));
  BOOST_TEST(allNaN(result.vrp));
  BOOST_TEST(allNaN(result.nl));
  BOOST_TEST(result.com.allFinite());

  // There is no gravity.
  walk.model.gravity.setZero();
  DynaCoM afloat(walk.model);
  result = analyzeMotion(afloat, walk.motion, {{}, ContactSchedule::Matrix(0, 40)});
  BOOST_TEST(std::isnan(result.omega));
  BOOST_TEST(allNaN(result.vrp));

  // An omega that is given is taken all the same.
  AnalysisSettings settings;
  settings.omega = 3.;
  result = analyzeMotion(walk.robot, walk.motion, walk.schedule, settings);
  BOOST_TEST(result.omega == 3.);
  BOOST_TEST(result.vrp.allFinite());
}

BOOST_AUTO_TEST_CASE(progress_is_told) {
  Walk walk(7, 700);
  AnalysisSettings settings;
  std::mutex mutex;
  std::vector<Index> told;
  settings.progress = [&](Index frames) {
    const std::lock_guard<std::mutex> lock(mutex);
    told.push_back(frames);
  };
  analyzeMotion(walk.robot, walk.motion, walk.schedule, settings);
  BOOST_REQUIRE(told.size() >= 2u);
  for (const Index frames : told) BOOST_TEST((frames > 0 && frames <= 700));
  BOOST_TEST(told.back() == 700);
}

BOOST_AUTO_TEST_CASE(a_motion_that_is_not_valid_is_refused_by_array_and_frame) {
  const Walk walk(8);
  BOOST_CHECK_NO_THROW(walk.motion.validate(walk.model));
  const auto refused = [&](auto change, std::initializer_list<std::string> words) {
    Motion bad = walk.motion;
    change(bad);
    BOOST_TEST(throws<std::invalid_argument>([&] { bad.validate(walk.model); }, words));
    BOOST_TEST(throws<std::invalid_argument>([&] { analyzeMotion(walk.robot, bad, walk.schedule); },
                                             words));
  };
  const auto nq = walk.model.nq, nv = walk.model.nv;
  const auto text = [](auto number) { return std::to_string(number); };
  // Rows that are not the model's.
  refused([&](Motion& bad) { bad.q.conservativeResize(nq - 1, 40); },
          {"q", text(nq), text(nq - 1)});
  refused([&](Motion& bad) { bad.v.conservativeResize(nv - 1, 40); },
          {"v", text(nv), text(nv - 1)});
  refused([&](Motion& bad) { bad.a.conservativeResize(nv - 1, 40); },
          {"a", text(nv), text(nv - 1)});
  // Columns that are not the time's.
  refused([&](Motion& bad) { bad.q.conservativeResize(nq, 39); }, {"q", "40", "39"});
  refused([&](Motion& bad) { bad.v.conservativeResize(nv, 39); }, {"v", "40", "39"});
  refused([&](Motion& bad) { bad.a.conservativeResize(nv, 39); }, {"a", "40", "39"});
  // Numbers that are none.
  for (const double number : {kNaN, 1. / 0., -1. / 0.}) {
    refused([&](Motion& bad) { bad.q(1, 17) = number; }, {"q", "17"});
    refused([&](Motion& bad) { bad.v(1, 17) = number; }, {"v", "17"});
    refused([&](Motion& bad) { bad.a(1, 17) = number; }, {"a", "17"});
    refused([&](Motion& bad) { bad.time[17] = number; }, {"time", "17"});
  }
  // Time that stands still, or goes back.
  refused([&](Motion& bad) { bad.time[17] = bad.time[16]; }, {"time", "17"});
  refused([&](Motion& bad) { bad.time[17] = -1.; }, {"time", "17", "-1"});
}

BOOST_AUTO_TEST_CASE(a_schedule_that_is_not_valid_is_refused) {
  const Walk walk(9);
  BOOST_CHECK_NO_THROW(walk.schedule.validate(40));
  const auto refused = [&](auto change, std::initializer_list<std::string> words) {
    ContactSchedule bad = walk.schedule;
    change(bad);
    BOOST_TEST(throws<std::invalid_argument>([&] { bad.validate(40); }, words));
    BOOST_TEST(
        throws<std::invalid_argument>([&] { analyzeMotion(walk.robot, walk.motion, bad); }, words));
  };
  refused([](auto& bad) { bad.names[2] = "hand"; }, {"hand"});
  refused([](auto& bad) { bad.active.resize(3, 39); }, {"active", "40", "39"});
  refused([](auto& bad) { bad.active.resize(2, 40); }, {"active", "3", "2"});

  // A name that the robot does not know; the message tells those that it does.
  ContactSchedule bad = walk.schedule;
  bad.names[0] = "tail";
  BOOST_TEST(throws<std::invalid_argument>([&] { analyzeMotion(walk.robot, walk.motion, bad); },
                                           {"tail", "hand", "foot on sole0", "foot on sole1"}));
}

BOOST_AUTO_TEST_CASE(an_omega_out_of_range_is_refused) {
  const Walk walk(10);
  for (const double omega : {-0.25, kNaN, std::numeric_limits<double>::infinity()}) {
    AnalysisSettings settings;
    settings.omega = omega;
    BOOST_TEST(throws<std::invalid_argument>(
        [&] { analyzeMotion(walk.robot, walk.motion, walk.schedule, settings); },
        {"AnalysisSettings.omega", omega < 0.          ? "-0.25"
                                   : std::isnan(omega) ? "nan"
                                                       : "inf"}));
  }
}

BOOST_AUTO_TEST_CASE(a_robot_that_was_never_initialised_is_refused) {
  const Walk walk(11);
  BOOST_TEST(throws<NotReadyError>([&] { analyzeMotion(DynaCoM(), walk.motion, walk.schedule); },
                                   {"initialize"}));
}
