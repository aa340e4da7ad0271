// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE contact_parts
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "dynacom/contact_parts.hpp"
#include "feet.hpp"
#include "random_robot.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

/// A robot on two soles and a ball, anywhere, in motion.
struct Walker {
  explicit Walker(unsigned seed, Index frames = 12) : random(seed), model(randomHumanoid(seed)) {
    for (const char* name : {"sole0", "sole1", "sole2"}) {
      const auto joint = static_cast<pinocchio::JointIndex>(random.integer(2, model.njoints - 1));
      model.addFrame(pinocchio::Frame(name, joint, random.placement(0.3), pinocchio::OP_FRAME));
    }
    robot.emplace(model);
    Contact6DSettings sole;
    sole.mu = 0.8;
    sole.gu = 0.1;
    sole.half_length = 0.12;
    sole.half_width = 0.05;
    sole.weights << 1., 2., 3., 4., 5., 6.;
    for (const char* name : {"sole0", "sole1"}) {
      sole.frame_name = name;
      robot->addContact(std::make_shared<Contact6D>(sole), std::string(name) + "_contact");
    }
    ContactPointSettings ball;
    ball.frame_name = "sole2";
    ball.mu = 0.4;
    ball.radius = 0.03;
    ball.world_aligned = true;
    robot->addContact(std::make_shared<ContactPoint>(ball), "ball");

    const States states = randomStates(model, random, frames, 0.5);
    motion = {VectorXd::LinSpaced(frames, 0., 1.), states.q, states.v, states.a};
  }

  Random random;
  pinocchio::Model model;
  std::optional<DynaCoM> robot;
  Motion motion;
};

}  // namespace

BOOST_AUTO_TEST_CASE(parts_have_the_cone_unless_their_contact_or_a_caller_says_otherwise) {
  const Walker walker(1);
  const auto frictionOf = [](const PartRobot& split) {
    std::set<FrictionModel> found;
    for (const PartRobot::Part& part : split.parts)
      found.insert(std::dynamic_pointer_cast<const ContactPoint>(split.robot.getContact(part.name))
                       ->getSettings()
                       .friction);
    return found;
  };
  using Models = std::set<FrictionModel>;
  BOOST_TEST((frictionOf(splitContacts(*walker.robot)) == Models{FrictionModel::Cone}));
  BOOST_TEST((frictionOf(splitContacts(*walker.robot, {}, FrictionModel::OuterPyramid)) ==
              Models{FrictionModel::OuterPyramid}));
}

BOOST_AUTO_TEST_CASE(a_sole_is_its_corners_and_a_point_is_itself) {
  const Walker walker(1);
  const PartRobot split = splitContacts(*walker.robot);
  std::vector<std::string> names;
  for (const PartRobot::Part& part : split.parts) names.push_back(part.name);
  std::vector<std::string> expected;
  for (const std::string sole : {"sole0_contact", "sole1_contact"})
    for (const char* corner : {"front_left", "front_right", "rear_left", "rear_right"})
      expected.push_back(sole + "." + corner);
  expected.push_back("ball");
  BOOST_TEST((std::set<std::string>(names.begin(), names.end()) ==
              std::set<std::string>(expected.begin(), expected.end())));
  BOOST_TEST((names == split.robot.getKnownContacts()));
  BOOST_TEST(close(split.robot.getMass(), walker.robot->getMass()));

  const auto whole = computeContactMotions(*walker.robot, walker.motion);
  const auto parts = computeContactMotions(split.robot, walker.motion);
  for (std::size_t k = 0; k < names.size(); ++k) {
    const PartRobot::Part& part = split.parts[k];
    const auto point =
        std::dynamic_pointer_cast<const ContactPoint>(split.robot.getContact(part.name));
    BOOST_REQUIRE(point);
    const ContactPointSettings& settings = point->getSettings();
    if (part.name == "ball") {
      BOOST_TEST(part.contact == 2u);
      BOOST_TEST(settings.mu == 0.4);
      BOOST_TEST(settings.radius == 0.03);
      BOOST_TEST(close(parts[k].position, whole[2].position));
      continue;
    }
    BOOST_TEST(part.contact == (part.name[4] == '0' ? 0u : 1u));
    BOOST_TEST(settings.mu == 0.8);
    BOOST_TEST(settings.world_aligned);
    // Each of four carries a quarter: 4 (w f/4)² is (w f)² for w that are twice as large.
    BOOST_TEST(close(settings.weights, Vector3d(2., 4., 6.)));
    const double x = part.name.find("front") != std::string::npos ? 0.12 : -0.12;
    const double y = part.name.find("left") != std::string::npos ? 0.05 : -0.05;
    for (Index frame = 0; frame < walker.motion.frames(); ++frame) {
      const std::string sole = part.name.substr(0, 5);
      const SE3 placement = framePlacement(walker.model, walker.motion.q.col(frame), sole);
      BOOST_TEST(close(parts[k].position.col(frame), placement.act(Vector3d(x, y, 0.))));
      // Its normal is the ground's.
      BOOST_TEST(close(parts[k].rotation.col(frame).head<2>(), Vector2d::Zero()));
    }
  }
}

BOOST_AUTO_TEST_CASE(parts_of_one_limb_share_a_number) {
  pinocchio::Model model = singleBody(10., {SE3::Identity()});
  const auto add = [&](pinocchio::JointIndex parent, const char* name) {
    const auto joint = model.addJoint(parent, pinocchio::JointModelRX(), SE3::Identity(),
                                      std::string(name) + "_joint");
    model.addFrame(pinocchio::Frame(name, joint, SE3::Identity(), pinocchio::OP_FRAME));
    return joint;
  };
  const auto heel = add(1, "heel");
  add(heel, "toe");
  add(1, "hand");
  DynaCoM robot(model);
  robot.addContact(makePoint("toe"), "toe");
  robot.addContact(makeSole("heel"), "heel");
  robot.addContact(makePoint("hand"), "hand");
  std::map<std::string, int> limbs;
  for (const PartRobot::Part& part : splitContacts(robot).parts) limbs[part.name] = part.limb;
  BOOST_TEST(limbs.at("heel.front_left") == limbs.at("heel.rear_right"));
  BOOST_TEST(limbs.at("heel.front_left") == limbs.at("toe"));
  BOOST_TEST(limbs.at("hand") != limbs.at("toe"));
}

BOOST_AUTO_TEST_CASE(a_frame_may_have_the_name_of_a_corner_already) {
  pinocchio::Model model = singleBody(10., {SE3::Identity()});
  model.addFrame(pinocchio::Frame(
      "foot.front_left", 1, SE3(Matrix3d::Identity(), Vector3d(9., 9., 9.)), pinocchio::OP_FRAME));
  DynaCoM robot(model);
  robot.addContact(makeSole("sole0"), "foot");
  Motion motion{VectorXd::Zero(1), restState(model).q, VectorXd::Zero(6), VectorXd::Zero(6)};
  for (const ContactMotion& part : computeContactMotions(splitContacts(robot).robot, motion))
    BOOST_TEST(part.position.cwiseAbs().maxCoeff() < 1.);
}

BOOST_AUTO_TEST_CASE(an_edge_without_width_has_corners_of_different_names) {
  for (const auto size : {&Contact6DSettings::half_length, &Contact6DSettings::half_width}) {
    DynaCoM robot(singleBody(10., {SE3::Identity()}));
    Contact6DSettings edge;
    edge.frame_name = "sole0";
    edge.mu = 0.5;
    edge.gu = 0.1;
    edge.half_length = edge.half_width = 0.1;
    edge.*size = 0.;
    robot.addContact(std::make_shared<Contact6D>(edge), "foot");
    std::set<std::string> names;
    for (const PartRobot::Part& part : splitContacts(robot).parts) names.insert(part.name);
    BOOST_TEST(names.size() == 4u);
  }
}

BOOST_AUTO_TEST_CASE(forces_of_parts_sum_to_the_contacts_wrench) {
  int inside = 0;
  for (unsigned seed = 1; seed < 6; ++seed) {
    Walker walker(seed);
    const Index frames = walker.motion.frames();
    const PartRobot split = splitContacts(*walker.robot);
    ContactSchedule schedule;
    for (const PartRobot::Part& part : split.parts) schedule.names.push_back(part.name);
    schedule.active = ContactSchedule::Matrix::NullaryExpr(
        Index(split.parts.size()), frames, [&](Index, Index) { return walker.random.coin(); });
    const auto whole = computeContactMotions(*walker.robot, walker.motion);
    const auto motions = computeContactMotions(split.robot, walker.motion);
    const MotionAnalysis parts = analyzeMotion(split.robot, walker.motion, schedule);
    const MotionAnalysis gathered = gatherParts(*walker.robot, split, whole, motions, parts);
    const ContactSchedule of_contacts = gatherParts(*walker.robot, split, schedule);

    BOOST_REQUIRE(gathered.contacts.size() == 3u);
    BOOST_REQUIRE(gathered.parts.size() == split.parts.size());
    BOOST_TEST(close(gathered.residual, parts.residual, 0.));
    const MatrixXd needed =
        (MatrixXd(6, frames) << parts.ground_force, parts.ground_torque).finished() -
        parts.residual;
    for (Index frame = 0; frame < frames; ++frame) {
      const VectorXd q = walker.motion.q.col(frame);
      Vector6 sum_about_com = Vector6::Zero();
      for (std::size_t k = 0; k < 3; ++k) {
        const MotionAnalysis::Contact& contact = gathered.contacts[k];
        const std::string frame_name = "sole" + std::to_string(k);
        // Of the parts, in the world about the contact's origin: by places of Pinocchio.
        SE3 surface = framePlacement(walker.model, q, frame_name);
        if (k == 2)
          surface = SE3(Matrix3d::Identity(), surface.translation() - Vector3d(0, 0, .03));
        Vector3d force = Vector3d::Zero(), torque = Vector3d::Zero();
        bool active = false;
        for (std::size_t part = 0; part < split.parts.size(); ++part) {
          if (split.parts[part].contact != k) continue;
          active = active || schedule.active(Index(part), frame);
          const std::string& name = split.parts[part].name;
          const double x = name.find("front") != std::string::npos ? 0.12 : -0.12;
          const double y = name.find("left") != std::string::npos ? 0.05 : -0.05;
          const Vector3d lever =
              k == 2 ? Vector3d::Zero().eval() : (surface.rotation() * Vector3d(x, y, 0.)).eval();
          // A part's axes: the world's z, and no more is said of the others.
          const Matrix3d axes =
              Eigen::Quaterniond(motions[part].rotation.col(frame).eval()).toRotationMatrix();
          const Vector3d own = axes * parts.contacts[part].wrench.col(frame).head<3>();
          force += own;
          torque += lever.cross(own);
        }
        BOOST_TEST(contact.active[frame] == active);
        BOOST_TEST(of_contacts.active(Index(k), frame) == active);
        Vector6 wrench;
        wrench << surface.rotation().transpose() * force, surface.rotation().transpose() * torque;
        BOOST_TEST(close(contact.wrench.col(frame), wrench, 1e-9));
        BOOST_TEST(close(contact.vertical_force[frame], force.z(), 1e-9));
        const Vector3d lever = surface.translation() - comOf(walker.model, q);
        sum_about_com.head<3>() += force;
        sum_about_com.tail<3>() += torque + lever.cross(force);
        // What pushes at corners presses within them, where the surface is loaded from above.
        if (k < 2 && active && wrench[2] > 1. && surface.rotation()(2, 2) > 0.) {
          const Vector2d cop = contact.cop.col(frame);
          BOOST_TEST(close(cop, Vector2d(-wrench[4], wrench[3]) / wrench[2], 1e-9));
          // Each part's force has a positive normal component if the pyramid allows no other.
          if (surface.rotation()(2, 2) > 0.85) {
            BOOST_TEST(std::abs(cop.x()) < 0.12 + 1e-9);
            BOOST_TEST(std::abs(cop.y()) < 0.05 + 1e-9);
            ++inside;
          }
        }
      }
      BOOST_TEST(close(sum_about_com, needed.col(frame), 1e-8));
    }
  }
  BOOST_TEST(inside >= 3);
}

BOOST_AUTO_TEST_CASE(a_contact_is_as_probable_as_its_most_probable_part) {
  const Walker walker(3, 2);
  const PartRobot split = splitContacts(*walker.robot);
  ContactSchedule schedule;
  for (const PartRobot::Part& part : split.parts) schedule.names.push_back(part.name);
  const auto count = Index(split.parts.size());
  schedule.active.setConstant(count, 2, false);
  schedule.confidence = MatrixXd::Constant(count, 2, 0.1);
  BOOST_TEST(!gatherParts(*walker.robot, split, schedule).active.any());
  for (Index part = 0; part < count; ++part) {
    schedule.active(part, 1) = true;
    schedule.confidence(part, 1) = 0.8;
    const ContactSchedule gathered = gatherParts(*walker.robot, split, schedule);
    const auto owner = Index(split.parts[std::size_t(part)].contact);
    BOOST_TEST((gathered.names == walker.robot->getKnownContacts()));
    for (Index k = 0; k < 3; ++k) {
      BOOST_TEST(gathered.active(k, 1) == (k == owner));
      BOOST_TEST(!gathered.active(k, 0));
      BOOST_TEST(gathered.confidence(k, 1) == (k == owner ? 0.8 : 0.1));
    }
    schedule.active(part, 1) = false;
    schedule.confidence(part, 1) = 0.1;
  }
  schedule.confidence.resize(0, 0);
  BOOST_TEST(gatherParts(*walker.robot, split, schedule).confidence.size() == 0);
}

BOOST_AUTO_TEST_CASE(what_cannot_be_split_or_gathered_is_refused) {
  BOOST_TEST(throws<NotReadyError>([] { splitContacts(DynaCoM()); }, {"splitContacts"}));
  Walker walker(2, 3);
  const PartRobot split = splitContacts(*walker.robot);
  const auto whole = computeContactMotions(*walker.robot, walker.motion);
  const auto motions = computeContactMotions(split.robot, walker.motion);
  ContactSchedule none;
  none.active.resize(0, 3);
  const MotionAnalysis parts = analyzeMotion(split.robot, walker.motion, none);
  const auto refused = [&](const auto& a, const auto& b, const auto& c, const char* word) {
    BOOST_TEST(
        throws<std::invalid_argument>([&] { gatherParts(*walker.robot, split, a, b, c); }, {word}));
  };
  refused(motions, motions, parts, "contacts");
  refused(whole, whole, parts, "motions");
  refused(whole, motions, analyzeMotion(*walker.robot, walker.motion, none), "analysis");
  auto shorter = whole;
  shorter[1].height.resize(2);
  refused(shorter, motions, parts, "sole1_contact");
  BOOST_TEST(throws<std::invalid_argument>([&] { gatherParts(*walker.robot, split, none); },
                                           {"schedule"}));
}
