// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE motion_analysis
#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <map>
#include <set>
#include <thread>

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

    const States states = randomStates(model, random, frames, 0.02);
    motion = {VectorXd::LinSpaced(frames, 0., 1.), states.q, states.v, states.a};
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

/// All numbers of an analysis, by what they are.
std::map<std::string, MatrixXd> numbersOf(const MotionAnalysis& analysis) {
  std::map<std::string, MatrixXd> numbers = {{"com", analysis.com},
                                             {"vcom", analysis.vcom},
                                             {"acom", analysis.acom},
                                             {"am", analysis.am},
                                             {"dam", analysis.dam},
                                             {"ground_force", analysis.ground_force},
                                             {"ground_torque", analysis.ground_torque},
                                             {"feasible_acom", analysis.feasible_acom},
                                             {"feasible_dam", analysis.feasible_dam},
                                             {"cop", analysis.cop},
                                             {"vrp", analysis.vrp},
                                             {"nl", analysis.nl},
                                             {"dcm", analysis.dcm},
                                             {"residual", analysis.residual}};
  for (const MotionAnalysis::Contact& contact : analysis.contacts) {
    numbers[contact.name + " wrench"] = contact.wrench;
    numbers[contact.name + " vertical_force"] = contact.vertical_force.transpose();
    numbers[contact.name + " cop"] = contact.cop;
    numbers[contact.name + " friction_usage"] = contact.friction_usage.transpose();
    numbers[contact.name + " yaw_usage"] = contact.yaw_usage.transpose();
    numbers[contact.name + " cop_margin"] = contact.cop_margin.transpose();
  }
  return numbers;
}

/// Bit for bit, so that a NaN is the same as itself, and 0 is not −0.
bool sameBits(const MatrixXd& one, const MatrixXd& other) {
  return one.size() == other.size() &&
         std::memcmp(one.data(), other.data(), sizeof(double) * std::size_t(one.size())) == 0;
}

void checkSameBits(const MotionAnalysis& one, const MotionAnalysis& other) {
  const auto numbers = numbersOf(one), others = numbersOf(other);
  for (const auto& [name, values] : numbers)
    BOOST_TEST_CONTEXT(name) BOOST_TEST(sameBits(values, others.at(name)));
  BOOST_TEST((one.status == other.status));
  BOOST_TEST(one.omega == other.omega);
}

/// Whether lanes can be expected of this machine.
bool hasLanes([[maybe_unused]] int lanes) {
#if defined(DYNACOM_HAS_LANES)
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  const bool avx512 = avx2 && __builtin_cpu_supports("avx512f") &&
                      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
                      __builtin_cpu_supports("avx512bw");
  return lanes == 8 ? avx512 : lanes == 4 && avx2;
#else
  return false;
#endif
}

/// Checks that each frame is the same with lanes and without, and that it was lanes that answered,
/// if they are there: they round otherwise.
void checkLanes(const DynaCoM& robot, const Motion& motion, const ContactSchedule& schedule,
                bool flat = true) {
  AnalysisSettings settings;
  settings.flat_horizontal_ground = flat;
  settings.omega = 3.;
  settings.lanes = 1;
  const auto expected = analyzeMotion(robot, motion, schedule, settings);
  const auto others = numbersOf(expected);
  for (const int lanes : {4, 8}) {
    if (!hasLanes(lanes)) continue;
    BOOST_TEST(countLanes(robot, lanes) == lanes);
    settings.lanes = lanes;
    const auto actual = analyzeMotion(robot, motion, schedule, settings);
    BOOST_TEST((actual.status == expected.status));
    bool rounds = false;
    for (const auto& [name, values] : numbersOf(actual)) {
      rounds = rounds || !sameBits(values, others.at(name));
      for (Index frame = 0; frame < values.cols(); ++frame)
        BOOST_TEST_CONTEXT(name << ", frame " << frame) {
          const double scale = name == "residual" ? robot.getMass() * 9.81 : 1.;
          BOOST_TEST(
              sameOrNaN(values.col(frame) / scale, others.at(name).col(frame) / scale, 1e-10));
        }
    }
    BOOST_TEST(rounds);
    const auto placed = computeContactMotions(robot, motion, 1, lanes);
    const auto alone = computeContactMotions(robot, motion, 1, 1);
    for (std::size_t k = 0; k < alone.size(); ++k) BOOST_TEST_CONTEXT(alone[k].name) {
        BOOST_TEST(close(placed[k].position, alone[k].position, 1e-10));
        BOOST_TEST(close(placed[k].rotation, alone[k].rotation, 1e-10));
        BOOST_TEST(close(placed[k].height, alone[k].height, 1e-10));
        BOOST_TEST(close(placed[k].velocity, alone[k].velocity, 1e-10));
      }
  }
}

/// A walk of several blocks, of which many frames are within what the contacts give, and some not.
Walk longWalk(unsigned seed, Index frames = 1100) {
  Walk walk(seed, frames);
  walk.robot.setGroundHeight(-0.1);
  for (Index frame = 0; frame < frames; frame += 11) walk.motion.a(0, frame) += 30.;
  return walk;
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

BOOST_AUTO_TEST_CASE(progress_is_told_in_the_callers_thread_and_increases) {
  Walk walk(7, 1300);
  for (const int threads : {1, 2, 3, 8}) {
    AnalysisSettings settings;
    settings.threads = threads;
    std::vector<Index> told;
    settings.progress = [&, caller = std::this_thread::get_id()](Index frames) {
      BOOST_TEST((std::this_thread::get_id() == caller));
      told.push_back(frames);
    };
    analyzeMotion(walk.robot, walk.motion, walk.schedule, settings);
    BOOST_REQUIRE(!told.empty());
    BOOST_TEST(told.front() > 0);
    for (std::size_t k = 1; k < told.size(); ++k) BOOST_TEST(told[k] > told[k - 1]);
    BOOST_TEST(told.back() == 1300);
    if (threads == 1) BOOST_TEST(told.size() == 6u);
  }
}

BOOST_AUTO_TEST_CASE(what_is_thrown_in_a_thread_comes_to_the_caller) {
  Walk walk(12, 1300);
  for (const int threads : {1, 2, 8}) {
    AnalysisSettings settings;
    settings.threads = threads;
    Motion bad = walk.motion;
    bad.v(3, 1299) = bad.a(2, 700) = kNaN;
    BOOST_TEST(throws<std::invalid_argument>(
        [&] { analyzeMotion(walk.robot, bad, walk.schedule, settings); }, {"v", "1299"}));
    int calls = 0;
    settings.progress = [&](Index) {
      ++calls;
      throw std::runtime_error("enough of it");
    };
    BOOST_TEST(throws<std::runtime_error>(
        [&] { analyzeMotion(walk.robot, walk.motion, walk.schedule, settings); },
        {"enough of it"}));
    BOOST_TEST(calls == 1);
  }
}

BOOST_AUTO_TEST_CASE(results_are_the_same_whatever_the_number_of_threads) {
  const Walk walk = longWalk(13);
  for (const bool flat : {true, false})
    for (const int lanes : {1, 4, 8})
      BOOST_TEST_CONTEXT("flat " << flat << ", " << lanes << " lanes") {
        AnalysisSettings settings;
        settings.flat_horizontal_ground = flat;
        settings.lanes = lanes;
        settings.threads = 1;
        const auto expected = analyzeMotion(walk.robot, walk.motion, walk.schedule, settings);
        for (const int threads : {2, 3, 8, 0}) {
          settings.threads = threads;
          checkSameBits(analyzeMotion(walk.robot, walk.motion, walk.schedule, settings), expected);
        }
      }
}

BOOST_AUTO_TEST_CASE(lanes_say_what_one_frame_at_a_time_says) {
  std::map<DistributionStatus, int> count;
  for (unsigned seed = 20; seed < 30; ++seed) {
    Walk walk = longWalk(seed, 301);
    if (seed % 2 == 0)
      walk.robot.setWrenchWeights((Vector6() << 1., 1., 1., 3., 3., 4.).finished());
    // Contacts without some extents, with other weights, and aligned with the world.
    Contact6DSettings edge;
    edge.frame_name = "sole0";
    edge.mu = 0.6;
    edge.half_width = 0.3;
    edge.weights << 1., 2., 1., 3., 4., 5.;
    ContactPointSettings ball;
    ball.frame_name = "sole1";
    ball.mu = 0.8;
    ball.radius = 0.05;
    ball.world_aligned = true;
    walk.robot.addContact(std::make_shared<Contact6D>(edge), "edge");
    walk.robot.addContact(std::make_shared<ContactPoint>(ball), "ball");
    ContactSchedule& schedule = walk.schedule;
    schedule.names.insert(schedule.names.end(), {"edge", "ball"});
    schedule.active.conservativeResize(5, Eigen::NoChange);
    for (Index frame = 0; frame < 301; ++frame)
      schedule.active.col(frame).tail<2>() << walk.random.coin(), walk.random.coin();
    // Far away from the world's origin.
    walk.motion.q.row(0).array() += 20.;

    for (const bool flat : {true, false}) BOOST_TEST_CONTEXT("seed " << seed)
    checkLanes(walk.robot, walk.motion, schedule, flat);
    for (const DistributionStatus status : analyzeMotion(walk.robot, walk.motion, schedule).status)
      ++count[status];
  }
  BOOST_TEST(count[DistributionStatus::Solved] > 500);
  BOOST_TEST(count[DistributionStatus::Relaxed] > 50);
}

namespace {

/// A chain of joints below a root, each with a body, and a sole on the last one.
struct Chain {
  explicit Chain(const std::vector<pinocchio::JointModel>& joints, bool has_mass = true) {
    Random random(17);
    pinocchio::JointIndex last = 0;
    for (const pinocchio::JointModel& joint : joints) {
      last = model.addJoint(last, joint, random.placement(0.3),
                            "joint" + std::to_string(model.njoints));
      const pinocchio::Symmetric3 rotor(Matrix3d(0.05 * Matrix3d::Identity()));
      const bool is_rotor = !has_mass && model.njoints > 2;
      model.appendBodyToJoint(last,
                              is_rotor ? pinocchio::Inertia(0., Vector3d::Zero(), rotor)
                                       : pinocchio::Inertia(5., random.vector3(0.1), rotor),
                              SE3::Identity());
    }
    model.addFrame(pinocchio::Frame("sole", last, random.placement(0.1), pinocchio::OP_FRAME));
    robot.initialize(model);
    Contact6DSettings settings;
    settings.frame_name = "sole";
    settings.mu = settings.gu = settings.half_length = settings.half_width = 100.;
    robot.addContact(std::make_shared<Contact6D>(settings), "sole");

    const Index frames = 53;
    const States states = randomStates(model, random, frames, 0.8);
    motion = {VectorXd::LinSpaced(frames, 0., 1.), states.q, states.v, states.a};
    schedule = {{"sole"}, ContactSchedule::Matrix::Constant(1, frames, true)};
  }

  pinocchio::Model model;
  DynaCoM robot;
  Motion motion;
  ContactSchedule schedule;
};

}  // namespace

BOOST_AUTO_TEST_CASE(lanes_know_the_joints_of_urdfs) {
  using namespace pinocchio;
  const Vector3d axis = Vector3d(1., -2., 0.5).normalized();
  const std::vector<JointModel> kinds = {
      JointModelRX(),          JointModelRY(),
      JointModelRZ(),          JointModelRevoluteUnaligned(axis),
      JointModelRUBX(),        JointModelRUBY(),
      JointModelRUBZ(),        JointModelRevoluteUnboundedUnaligned(axis),
      JointModelPX(),          JointModelPY(),
      JointModelPZ(),          JointModelPrismaticUnaligned(axis),
      JointModelFreeFlyer(),   JointModelSpherical(),
      JointModelTranslation(), JointModelPlanar()};
  for (const JointModel& kind : kinds) BOOST_TEST_CONTEXT(kind.shortname()) {
      const Chain last({JointModelFreeFlyer(), JointModelRX(), kind});
      checkLanes(last.robot, last.motion, last.schedule);
      const Chain between({JointModelFreeFlyer(), kind, JointModelRY()});
      checkLanes(between.robot, between.motion, between.schedule);
      const Chain first({kind, JointModelRY(), JointModelPX()});
      checkLanes(first.robot, first.motion, first.schedule);
    }
}

BOOST_AUTO_TEST_CASE(lanes_know_axes_next_to_those_of_the_frame) {
  // Such as are computed from angles, of which sin π is not zero.
  for (const double sign : {-1., 1.})
    for (int exponent = -1; exponent > -18; --exponent)
      BOOST_TEST_CONTEXT("exponent " << exponent) {
        const Vector3d axis = Vector3d(3.67 * std::pow(10., exponent), 0., sign).normalized();
        const Chain chain({pinocchio::JointModelFreeFlyer(),
                           pinocchio::JointModelRevoluteUnaligned(axis),
                           pinocchio::JointModelPrismaticUnaligned(-axis)});
        checkLanes(chain.robot, chain.motion, chain.schedule);
      }
}

BOOST_AUTO_TEST_CASE(lanes_know_inertia_without_mass) {
  const Chain chain({pinocchio::JointModelFreeFlyer(), pinocchio::JointModelRX(),
                     pinocchio::JointModelSpherical()},
                    false);
  checkLanes(chain.robot, chain.motion, chain.schedule);
}

BOOST_AUTO_TEST_CASE(lanes_know_angles_of_any_size) {
  Chain chain({pinocchio::JointModelFreeFlyer(), pinocchio::JointModelRX()});
  for (Index frame = 0; frame < chain.motion.frames(); ++frame)
    chain.motion.q(7, frame) = (frame % 2 == 0 ? 1. : -1.) * std::pow(10., double(frame) / 4.);
  checkLanes(chain.robot, chain.motion, chain.schedule);
}

BOOST_AUTO_TEST_CASE(contacts_whose_settings_were_changed_since_are_found_again) {
  Chain chain({pinocchio::JointModelFreeFlyer(), pinocchio::JointModelRX()});
  AnalysisSettings settings;
  const auto expected = analyzeMotion(chain.robot, chain.motion, chain.schedule, settings);
  const auto contacts = computeContactMotions(chain.robot, chain.motion);
  const auto sole = std::dynamic_pointer_cast<Contact6D>(chain.robot.getContact("sole"));
  for (const int lanes : {1, kMaximalLanes}) {
    sole->initialize(sole->getSettings());
    BOOST_REQUIRE(sole->getFrameID() >= chain.model.frames.size());
    settings.lanes = lanes;
    const auto actual = analyzeMotion(chain.robot, chain.motion, chain.schedule, settings);
    BOOST_TEST(close(actual.contacts[0].wrench, expected.contacts[0].wrench, 1e-10));
    const auto placed = computeContactMotions(chain.robot, chain.motion, 1, lanes);
    BOOST_TEST(close(placed[0].position, contacts[0].position, 1e-10));
  }
}

BOOST_AUTO_TEST_CASE(robots_that_lanes_do_not_know_are_analyzed_without) {
  Walk walk(14, 30);
  pinocchio::Model model;
  const auto root =
      model.addJoint(0, pinocchio::JointModelFreeFlyer(), SE3::Identity(), "root_joint");
  model.appendBodyToJoint(root, pinocchio::Inertia::Random());
  const auto joint =
      model.addJoint(root, pinocchio::JointModelSphericalZYX(), SE3::Identity(), "joint");
  model.appendBodyToJoint(joint, pinocchio::Inertia::Random());
  BOOST_TEST(countLanes(DynaCoM(model)) == 1);
  BOOST_TEST(countLanes(walk.robot, 1) == 1);
  BOOST_TEST(throws<std::invalid_argument>([&] { countLanes(walk.robot, 0); }, {"lanes", "0"}));

  // A contact of one's own.
  struct Grip : Contact6D {
    using Contact6D::Contact6D;
    std::shared_ptr<ContactBase> clone() const override { return std::make_shared<Grip>(*this); }
    SE3 getSurfacePose() const override {
      return getPose() * SE3(Matrix3d::Identity(), Vector3d::UnitZ());
    }
  };
  Contact6DSettings settings;
  settings.frame_name = "sole1";
  walk.robot.addContact(std::make_shared<Grip>(settings), "grip");
  BOOST_TEST(countLanes(walk.robot) == 1);
  const auto result = analyzeMotion(walk.robot, walk.motion, walk.schedule);
  BOOST_TEST(result.com.allFinite());
  BOOST_TEST(throws<NotReadyError>([] { countLanes(DynaCoM()); }, {"initialize"}));
}

BOOST_AUTO_TEST_CASE(quaternions_that_are_nearly_normalized_are_taken_as_they_are) {
  Walk walk(15);
  walk.motion.q.middleRows<4>(3) *= 1. + 1e-5;
  AnalysisSettings settings;
  const auto actual = analyzeMotion(walk.robot, walk.motion, walk.schedule, settings);
  settings.lanes = 1;
  const auto expected = analyzeMotion(walk.robot, walk.motion, walk.schedule, settings);
  BOOST_TEST((actual.status == expected.status));
  // Lanes leave the motion alone, and share what it needs all the same.
  const auto others = numbersOf(expected);
  for (const auto& [name, values] : numbersOf(actual)) BOOST_TEST_CONTEXT(name) {
      if (std::set<std::string>{"com", "vcom", "acom", "am", "dam", "ground_force", "ground_torque"}
              .count(name))
        BOOST_TEST(sameBits(values, others.at(name)));
      const double scale = name == "residual" ? walk.robot.getMass() * 9.81 : 1.;
      for (Index frame = 0; frame < values.cols(); ++frame)
        BOOST_TEST(sameOrNaN(values.col(frame) / scale, others.at(name).col(frame) / scale, 1e-10));
    }
}

BOOST_AUTO_TEST_CASE(a_frame_with_a_quaternion_that_is_none_is_unknown) {
  Walk walk(17);
  const auto whole = analyzeMotion(walk.robot, walk.motion, walk.schedule);
  walk.motion.q.col(8).segment<4>(3).setZero();
  walk.motion.q.col(21).segment<4>(3) *= 1.1;
  for (const int lanes : {kMaximalLanes, 1}) {
    AnalysisSettings settings;
    settings.lanes = lanes;
    settings.omega = whole.omega;
    const auto analysis = analyzeMotion(walk.robot, walk.motion, walk.schedule, settings);
    const auto others = numbersOf(whole);
    for (Index frame = 0; frame < 40; ++frame) {
      const bool known = frame != 8 && frame != 21;
      const auto status = static_cast<std::size_t>(frame);
      BOOST_TEST(analysis.status[status] ==
                 (known ? whole.status[status] : DistributionStatus::InvalidInput));
      for (const auto& [name, values] : numbersOf(analysis)) BOOST_TEST_CONTEXT(name) {
          if (known)
            BOOST_TEST(sameOrNaN(values.col(frame), others.at(name).col(frame), 1e-6));
          else if (name.find(' ') == name.npos)  // none of a contact's
            BOOST_TEST(allNaN(values.col(frame)));
        }
    }
    // As DynaCoM has it.
    DynaCoM robot = walk.robot;
    robot.computeDynamics(walk.motion.q.col(8), walk.motion.v.col(8), walk.motion.a.col(8),
                          Vector6::Zero(), false);
    BOOST_TEST(robot.getDistributionStatus() == DistributionStatus::InvalidInput);
  }
  // The pendulum's frequency is that of the frames that are known.
  const auto analysis = analyzeMotion(walk.robot, walk.motion, walk.schedule);
  BOOST_TEST(close(analysis.omega, whole.omega, 0.01));
  // All else is wrong as before, whatever comes first.
  walk.motion.v(1, 30) = kNaN;
  BOOST_TEST(throws<std::invalid_argument>(
      [&] { analyzeMotion(walk.robot, walk.motion, walk.schedule); }, {"v", "30"}));
}

BOOST_AUTO_TEST_CASE(numbers_of_threads_and_lanes_out_of_range_are_refused) {
  const Walk walk(16);
  AnalysisSettings settings;
  settings.threads = -1;
  BOOST_TEST(throws<std::invalid_argument>(
      [&] { analyzeMotion(walk.robot, walk.motion, walk.schedule, settings); },
      {"AnalysisSettings.threads", "-1"}));
  settings.threads = 0;
  settings.lanes = 0;
  BOOST_TEST(throws<std::invalid_argument>(
      [&] { analyzeMotion(walk.robot, walk.motion, walk.schedule, settings); },
      {"AnalysisSettings.lanes", "0"}));
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
