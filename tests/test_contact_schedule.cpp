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

/// A contact that is at a height and moves at a speed, as functions of time say.
template <class Height, class Speed>
ContactMotion contactOf(const std::string& name, const VectorXd& time, Height height, Speed speed) {
  ContactMotion contact{name, Eigen::Matrix3Xd::Zero(3, time.size()),
                        Eigen::Matrix4Xd::Zero(4, time.size()), VectorXd(time.size()),
                        Eigen::Matrix3Xd::Zero(3, time.size())};
  for (Index frame = 0; frame < time.size(); ++frame) {
    contact.height[frame] = height(time[frame]);
    contact.velocity(frame % 3, frame) = speed(time[frame]);
  }
  return contact;
}

auto constant(double value) {
  return [value](double) { return value; };
}

/// A hundred frames a second.
VectorXd timeOf(Index frames) {
  return VectorXd::LinSpaced(frames, 0., 0.01 * static_cast<double>(frames - 1));
}

/// The frames in which a schedule's only contact is active, as a text of dots and hashes.
std::string drawn(const ContactSchedule& schedule) {
  std::string text;
  for (Index frame = 0; frame < schedule.active.cols(); ++frame)
    text += schedule.active(0, frame) ? '#' : '.';
  return text;
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

BOOST_AUTO_TEST_CASE(a_contact_begins_low_and_slow_and_ends_high_or_fast) {
  DetectionSettings settings;
  settings.height = 0.01;
  settings.release_height = 0.02;
  settings.speed = 0.1;
  settings.release_speed = settings.rest_speed = 0.2;
  settings.minimal_duration = 0.;
  const VectorXd time = timeOf(8);
  const auto detect = [&](const std::vector<double>& heights, const std::vector<double>& speeds,
                          double ground = 0.) {
    const auto at = [&](const std::vector<double>& values) {
      return [&](double t) { return values[static_cast<std::size_t>(std::lround(t / 0.01))]; };
    };
    const auto contact = contactOf("foot", time, at(heights), at(speeds));
    return drawn(detectContacts({contact}, time, VectorXd::Constant(1, ground), settings));
  };
  const std::vector<double> low(8, 0.), slow(8, 0.), deep(8, -0.1);
  BOOST_TEST(detect(low, slow) == "########");
  BOOST_TEST(detect({0.03, 0.015, 0.01, 0.015, 0.02, 0.021, 0.015, 0.01}, slow) == "..###..#");
  BOOST_TEST(detect(low, {0.3, 0.15, 0.1, 0.15, 0.2, 0.21, 0.15, 0.1}) == "..###..#");
  // Both must hold to begin, and one is enough to end.
  BOOST_TEST(detect({0., 0., 0.03, 0.03, 0., 0., 0., 0.}, {0., 0., 0., 0., 0.3, 0.3, 0., 0.}) ==
             "##....##");
  // Heights are those above the ground; below it is no higher than it.
  BOOST_TEST(detect(low, slow, -0.05) == "........");
  BOOST_TEST(detect(deep, slow) == "########");
}

BOOST_AUTO_TEST_CASE(a_contact_is_at_rest_at_both_ends) {
  DetectionSettings settings;
  settings.speed = settings.release_speed = 1.;
  settings.rest_speed = 0.1;
  settings.minimal_duration = 0.;
  const auto detect = [&](const std::vector<double>& speeds) {
    const VectorXd time = timeOf(static_cast<Index>(speeds.size()));
    const auto speed = [&](double t) {
      return speeds[static_cast<std::size_t>(std::lround(t / 0.01))];
    };
    return drawn(detectContacts({contactOf("foot", time, constant(0.), speed)}, time,
                                VectorXd::Zero(1), settings));
  };
  BOOST_TEST(detect({2., 0.5, 0.1, 0., 0.5, 0., 0., 0., 0., 0.11, 2.}) == "..#######..");
  // What is never quite at rest may move three times as fast as it mostly does.
  BOOST_TEST(detect({2., 0.61, 0.6, 0.2, 0.2, 0.2, 0.2, 0.2, 0.6, 2.}) == "..#######.");
  // Nobody knows what was before the beginning and what comes after the end.
  BOOST_TEST(detect({0.5, 0.5, 0., 0., 0., 0., 0.5, 0.5}) == "########");
  // And what is left may be too short.
  BOOST_TEST(detect({2., 0.9, 0.9, 0., 0., 0., 0., 2., 2., 2.}) == "...####...");
  settings.minimal_duration = 0.05;
  BOOST_TEST(detect({2., 0.9, 0.9, 0., 0., 0., 0., 2., 2., 2.}) == "..........");
}

BOOST_AUTO_TEST_CASE(what_is_too_short_is_none) {
  DetectionSettings settings;
  settings.height = settings.release_height = 0.5;
  settings.minimal_duration = 0.03;
  const auto detect = [&](const std::string& touching) {
    const VectorXd time = timeOf(static_cast<Index>(touching.size()));
    const auto height = [&](double t) {
      return touching[static_cast<std::size_t>(std::lround(t / 0.01))] == '#' ? 0. : 1.;
    };
    const auto contact = contactOf("foot", time, height, constant(0.));
    return drawn(detectContacts({contact}, time, VectorXd::Zero(1), settings));
  };
  BOOST_TEST(detect("....###....") == "....###....");
  BOOST_TEST(detect("....##.....") == "...........");
  // 0.43 − 0.33 is a little less than 0.1.
  settings.minimal_duration = 0.1;
  const std::string late = std::string(33, '.') + std::string(10, '#') + "...";
  BOOST_TEST(detect(late) == late);
  settings.minimal_duration = 0.03;
  BOOST_TEST(detect("####...####") == "####...####");
  BOOST_TEST(detect("####..#####") == "###########");
  // Interruptions are mended first.
  BOOST_TEST(detect("...##.##...") == "...#####...");
  // At the ends, nobody knows how long it was.
  BOOST_TEST(detect("##.........") == "##.........");
  BOOST_TEST(detect("..#########") == "..#########");
  BOOST_TEST(detect("#") == "#");
}

BOOST_AUTO_TEST_CASE(the_ground_is_where_contacts_are_slow) {
  Random random(2);
  const VectorXd time = timeOf(1000);
  // Up and down, and up to noise on the ground in between.
  const auto swinging = [&](double ground, double phase) {
    const auto height = [=, &random](double t) {
      return ground + std::max(0., 0.2 * std::sin(3. * t + phase)) + random.uniform(0., 0.004);
    };
    const auto speed = [=](double t) { return std::sin(3. * t + phase) > 0. ? 1. : 0.02; };
    return contactOf("foot", time, height, speed);
  };
  // Frames of feet that differ, a foot on a step, and one that is never slow.
  std::vector<ContactMotion> contacts = {swinging(0.1, 0.), swinging(0.12, 2.), swinging(0.3, 1.)};
  contacts.push_back(contactOf("hand", time, constant(0.15), constant(0.4)));
  VectorXd ground = estimateGround(contacts, time);
  BOOST_REQUIRE(ground.size() == 4);
  BOOST_TEST(close(ground[0], 0.1, 0.004));
  BOOST_TEST(close(ground[1], 0.12, 0.004));
  BOOST_TEST(close(ground[2], 0.3, 0.004));
  BOOST_TEST(ground[3] == ground[0]);

  // Slow in the air, but never still, is not on a step.
  contacts[2] = contactOf("foot", time, constant(0.3), constant(0.15));
  ground = estimateGround(contacts, time);
  BOOST_TEST(ground[2] == ground[0]);
  // Still for a moment only.
  contacts[2] = contactOf("foot", time, constant(0.3),
                          [](double t) { return std::abs(t - 5.) < 0.04 ? 0. : 0.15; });
  ground = estimateGround(contacts, time);
  BOOST_TEST(ground[2] == ground[0]);

  DetectionSettings settings;
  settings.ground_height = -0.25;
  BOOST_TEST(close(estimateGround(contacts, time, settings), VectorXd::Constant(4, -0.25), 0.));
  // Where nothing ever is slow, the lowest place of all.
  contacts = {contactOf(
                  "foot", time, [](double t) { return t; }, constant(3.)),
              contactOf(
                  "hand", time, [](double t) { return 2. - 0.1 * t; }, constant(3.))};
  BOOST_TEST(close(estimateGround(contacts, time), VectorXd::Zero(2), 0.));
  BOOST_TEST(estimateGround({}, time).size() == 0);
}

BOOST_AUTO_TEST_CASE(settings_and_sizes_are_checked) {
  const VectorXd time = timeOf(4);
  const std::vector<ContactMotion> contacts = {contactOf("foot", time, constant(0.), constant(0.))};
  const VectorXd ground = VectorXd::Zero(1);
  const auto refused = [&](auto change, std::initializer_list<std::string> words) {
    DetectionSettings settings;
    change(settings);
    BOOST_TEST(throws<std::invalid_argument>([&] { settings.validate(); }, words));
    BOOST_TEST(
        throws<std::invalid_argument>([&] { estimateGround(contacts, time, settings); }, words));
    BOOST_TEST(throws<std::invalid_argument>(
        [&] { detectContacts(contacts, time, ground, settings); }, words));
  };
  refused([](auto& s) { s.height = -0.25; }, {"DetectionSettings.height", "-0.25"});
  refused([](auto& s) { s.speed = kNaN; }, {"DetectionSettings.speed", "nan"});
  refused([](auto& s) { s.release_height = 0.001; }, {"DetectionSettings.release_height", "0.001"});
  refused([](auto& s) { s.release_speed = 0.001; }, {"DetectionSettings.release_speed", "0.001"});
  refused([](auto& s) { s.rest_speed = -1.; }, {"DetectionSettings.rest_speed", "-1"});
  refused([](auto& s) { s.minimal_duration = -1.; }, {"DetectionSettings.minimal_duration", "-1"});
  refused([](auto& s) { s.ground_height = 1. / 0.; }, {"DetectionSettings.ground_height", "inf"});
  refused([](auto& s) { s.same_ground = -1.; }, {"DetectionSettings.same_ground", "-1"});
  BOOST_TEST(throws<std::invalid_argument>([&] { detectContacts(contacts, timeOf(5), ground); },
                                           {"height", "5", "4"}));
  BOOST_TEST(throws<std::invalid_argument>(
      [&] { detectContacts(contacts, time, VectorXd::Zero(2)); }, {"ground", "1", "2"}));
  DetectionSettings one, other;
  BOOST_TEST((one == other));
  other.same_ground = 1.;
  BOOST_TEST((one != other));
  BOOST_TEST(mentions(other.to_string(), "same_ground"));
}
