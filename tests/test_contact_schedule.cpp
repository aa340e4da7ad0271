// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE contact_schedule
#include <cmath>
#include <limits>

#include "dynacom/contact6d.hpp"
#include "dynacom/contact_point.hpp"
#include "dynacom/contact_schedule.hpp"
#include "random_robot.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

const double kNaN = std::numeric_limits<double>::quiet_NaN();

/// A hundred frames a second.
VectorXd timeOf(Index frames) {
  return VectorXd::LinSpaced(frames, 0., 0.01 * static_cast<double>(frames - 1));
}

}  // namespace

BOOST_AUTO_TEST_CASE(contacts_are_where_pinocchio_says_and_move_as_their_places_differ) {
  Random random(1);
  const auto model = standingRobot(random, stance(3));
  DynaCoM robot(model);
  Contact6DSettings sole;
  sole.half_length = 0.2;
  sole.half_width = 0.1;
  sole.frame_name = "sole0";
  robot.addContact(std::make_shared<Contact6D>(sole), "sole");
  ContactPointSettings ball;
  ball.frame_name = "sole1";
  ball.world_aligned = true;
  ball.radius = 0.04;
  robot.addContact(std::make_shared<ContactPoint>(ball), "ball", false);

  const Index frames = 15;
  Motion motion{timeOf(frames), MatrixXd(model.nq, frames), MatrixXd(model.nv, frames),
                MatrixXd::Zero(model.nv, frames)};
  for (Index frame = 0; frame < frames; ++frame) {
    const State x = randomState(model, random);
    motion.q.col(frame) = x.q;
    motion.v.col(frame) = x.v;
  }
  // A pose that was measured once says nothing of a motion.
  robot.setContactPose("sole", random.placement());
  const auto contacts = computeContactMotions(robot, motion);
  BOOST_REQUIRE(contacts.size() == 2u);
  BOOST_TEST(contacts[0].name == "sole");
  BOOST_TEST(contacts[1].name == "ball");

  for (Index frame = 0; frame < frames; ++frame) {
    const VectorXd q = motion.q.col(frame);
    const SE3 placement = framePlacement(model, q, "sole0");
    BOOST_TEST(close(contacts[0].position.col(frame), placement.translation()));
    const Eigen::Quaterniond rotation(Eigen::Vector4d(contacts[0].rotation.col(frame)));
    BOOST_TEST(close(rotation.toRotationMatrix(), placement.rotation()));
    Vector3d lowest = Vector3d::Constant(1e9);
    for (const double x : {-0.2, 0.2})
      for (const double y : {-0.1, 0.1})
        if (const Vector3d corner = placement.act(Vector3d(x, y, 0.)); corner.z() < lowest.z())
          lowest = corner;
    BOOST_TEST(close(contacts[0].height[frame], lowest.z()));

    // The same points of the bodies, a moment later.
    const double moment = 1e-7;
    const VectorXd later = moved(model, q, moment * motion.v.col(frame));
    const VectorXd sooner = moved(model, q, -moment * motion.v.col(frame));
    const auto velocityOf = [&](const std::string& frame_name, const Vector3d& point) {
      const Vector3d local = framePlacement(model, q, frame_name).actInv(point);
      return Vector3d((framePlacement(model, later, frame_name).act(local) -
                       framePlacement(model, sooner, frame_name).act(local)) /
                      (2. * moment));
    };
    BOOST_TEST(close(contacts[0].velocity.col(frame), velocityOf("sole0", lowest), 1e-6));

    const Vector3d centre = framePlacement(model, q, "sole1").translation();
    const Vector3d touching = centre - 0.04 * Vector3d::UnitZ();
    BOOST_TEST(close(contacts[1].position.col(frame), touching));
    BOOST_TEST(close(contacts[1].height[frame], touching.z()));
    BOOST_TEST(close(contacts[1].velocity.col(frame), velocityOf("sole1", touching), 1e-6));
  }
  BOOST_TEST(
      throws<NotReadyError>([&] { computeContactMotions(DynaCoM(), motion); }, {"initialize"}));
  BOOST_TEST(throws<std::invalid_argument>([&] { computeContactMotions(robot, motion, -1); },
                                           {"threads", "-1"}));
  motion.v(0, 3) = kNaN;
  BOOST_TEST(
      throws<std::invalid_argument>([&] { computeContactMotions(robot, motion); }, {"v", "3"}));
}

BOOST_AUTO_TEST_CASE(a_schedule_is_checked) {
  ContactSchedule schedule{{"left", "right"}, ContactSchedule::Matrix::Constant(2, 5, true)};
  schedule.validate(5);
  schedule.confidence = MatrixXd::Constant(2, 5, 0.5);
  schedule.readiness = MatrixXd::Constant(2, 5, 1.);
  schedule.validate(5);
  const auto refused = [&](auto change, std::initializer_list<std::string> words) {
    ContactSchedule wrong = schedule;
    change(wrong);
    BOOST_TEST(throws<std::invalid_argument>([&] { wrong.validate(5); }, words));
  };
  refused([](auto& s) { s.names[1] = "left"; }, {"left", "twice"});
  refused([](auto& s) { s.names.pop_back(); }, {"active", "contacts"});
  refused([](auto& s) { s.active.resize(2, 4); }, {"active", "5", "frames", "4"});
  refused([](auto& s) { s.confidence.resize(3, 5); }, {"confidence", "contacts", "3"});
  refused([](auto& s) { s.confidence.resize(2, 6); }, {"confidence", "frames", "6"});
  refused([](auto& s) { s.readiness.resize(1, 5); }, {"readiness", "contacts", "1"});
  refused([](auto& s) { s.readiness.resize(2, 1); }, {"readiness", "frames", "1"});
  for (const double value : {-0.25, 1.25, kNaN})
    refused([&](auto& s) { s.confidence(1, 3) = value; }, {"confidence", ">=", "frame 3"});
  for (const double value : {0., -0.25, 1.25, kNaN})
    refused([&](auto& s) { s.readiness(1, 3) = value; }, {"readiness", ">", "frame 3"});
}
