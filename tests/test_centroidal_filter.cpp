// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE centroidal_filter
#include <cmath>
#include <limits>

#include "dynacom/centroidal_filter.hpp"
#include "feet.hpp"
#include "random_robot.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

constexpr double kMass = 10., kGravity = 9.81, kWeight = kMass * kGravity, kFriction = 0.5;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// A body on the corners of a rectangle, whose CoM goes where it is told.
struct Stander {
  explicit Stander(Index frames, double rate = 100.,
                   FrictionModel friction = FrictionModel::OuterPyramid) {
    pinocchio::Model model = singleBody(kMass, {});
    std::vector<PartRobot::Part> list;
    for (std::size_t k = 0; k < 4; ++k) {
      const std::string name = "corner" + std::to_string(k);
      model.addFrame(pinocchio::Frame(name, 1, SE3::Identity(), pinocchio::OP_FRAME));
      list.push_back({name, k, 0});
    }
    parts.emplace_back(PartRobot{DynaCoM(model), list, {}});
    dynamics.time = VectorXd::LinSpaced(frames, 0., double(frames - 1) / rate);
    dynamics.com = Vector3d(0., 0., 0.8).replicate(1, frames);
    dynamics.ground_force = Vector3d(0., 0., kWeight).replicate(1, frames);
    dynamics.ground_torque.setZero(3, frames);
    schedule.active.setConstant(4, frames, true);
    for (std::size_t k = 0; k < 4; ++k) {
      ContactPointSettings point = makePoint(list[k].name, kFriction)->getSettings();
      point.friction = friction;
      parts[0].robot.addContact(std::make_shared<ContactPoint>(point), list[k].name);
      schedule.names.push_back(list[k].name);
      ContactMotion motion;
      motion.name = list[k].name;
      motion.position =
          Vector3d(k % 2 == 0 ? 0.1 : -0.1, k < 2 ? 0.06 : -0.06, 0.).replicate(1, frames);
      motions.push_back(motion);
    }
  }

  Index frames() const { return dynamics.time.size(); }

  CentroidalChange filter(const CentroidalFilterSettings& settings = {},
                          const Eigen::Array<bool, Eigen::Dynamic, 1>& free = {},
                          int threads = 1) const {
    return distanceToFeasible(parts[0], motions, dynamics, schedule, settings, free, threads);
  }

  std::vector<PartRobot> parts;  // one
  std::vector<ContactMotion> motions;
  MotionAnalysis dynamics;
  ContactSchedule schedule;
};

CentroidalFilterSettings exactSettings() {
  CentroidalFilterSettings settings;
  settings.reach = 1e-7;
  settings.change = 1e-7;
  settings.maximal_iterations = 1e5;
  return settings;
}

/// Sways, is pushed and turned, and is in the air for some frames.
Stander makeSwaying(Index frames, unsigned seed,
                    FrictionModel friction = FrictionModel::OuterPyramid) {
  Stander stander(frames, 50., friction);
  Random random(seed);
  const Vector3d push = random.vector3(0.2), turn = random.vector3(0.05);
  for (Index k = 0; k < frames; ++k) {
    const double phase = 8. * stander.dynamics.time[k];
    stander.dynamics.com.col(k) += Vector3d(0.1 * std::sin(phase), 0.03, 0.);
    stander.dynamics.ground_force.col(k) += kWeight * std::sin(phase + 1.) * push;
    stander.dynamics.ground_torque.col(k) += kWeight * std::cos(phase) * turn;
    if (k > frames / 2 && k < frames / 2 + 4) stander.schedule.active.col(k).setConstant(false);
    if (k < frames / 4) stander.schedule.active(0, k) = false;
  }
  return stander;
}

}  // namespace

BOOST_AUTO_TEST_CASE(what_contacts_can_give_needs_no_change) {
  const CentroidalChange found = Stander(50).filter();
  BOOST_TEST(found.com.cols() == 50);
  BOOST_TEST(found.com.isZero(0.));
  BOOST_TEST(found.residual.isZero(0.));
  BOOST_TEST(found.rms == 0.);
  BOOST_TEST(found.largest == 0.);
  BOOST_TEST(found.iterations == 0);
  BOOST_TEST(found.converged);
}

BOOST_AUTO_TEST_CASE(who_leans_is_put_over_the_support) {
  Stander leaning(300);
  leaning.dynamics.com.row(0).setConstant(0.15);
  const CentroidalChange found = leaning.filter(exactSettings());
  BOOST_TEST(found.converged);
  BOOST_TEST(close(found.com.row(0), VectorXd::Constant(300, -0.05).transpose(), 1e-4));
  BOOST_TEST(found.com.bottomRows(2).isZero(1e-4));
  BOOST_TEST(close(found.rms, 0.05, 1e-4));
  BOOST_TEST(close(found.largest, 0.05, 1e-4));
  // The default is not as exact.
  BOOST_TEST(close(leaning.filter().rms, 0.05, 1e-3));

  // Who leans for a moment may turn in place of moving, if that costs nothing.
  leaning.dynamics.com.row(0).setZero();
  leaning.dynamics.com.row(0).segment(140, 20).setConstant(0.15);
  CentroidalFilterSettings turning = exactSettings();
  const double moved = leaning.filter(turning).largest;
  turning.angular_momentum = 1.;
  BOOST_TEST(leaning.filter(turning).largest < 0.1 * moved);
}

BOOST_AUTO_TEST_CASE(in_flight_the_com_is_put_on_its_parabola) {
  Stander jumping(100);
  const Index first = 30, behind = 70;
  jumping.schedule.active.middleCols(first, behind - first).setConstant(false);
  // It hangs in the air, a little.
  jumping.dynamics.ground_force.middleCols(first, behind - first) *= 0.02;
  const CentroidalChange found = jumping.filter(exactSettings());
  BOOST_TEST(found.converged);
  BOOST_TEST(found.largest > 1e-3);
  const double dt = 0.01;
  for (Index k = first; k < behind; ++k) {
    const Vector3d change =
        (found.com.col(k + 1) - 2. * found.com.col(k) + found.com.col(k - 1)) / (dt * dt);
    BOOST_TEST(close(change, Vector3d(0., 0., -0.02 * kGravity), 1e-5));
  }
  BOOST_TEST(found.residual.isZero(1e-4 * kWeight));
}

BOOST_AUTO_TEST_CASE(who_is_in_the_air_all_the_time_falls) {
  Stander falling(60);
  falling.schedule.active.setConstant(false);
  const CentroidalChange found = falling.filter(exactSettings());
  BOOST_TEST(found.converged);
  BOOST_TEST(found.com.allFinite());
  for (Index k = 1; k < 59; ++k) {
    const Vector3d change =
        (found.com.col(k + 1) - 2. * found.com.col(k) + found.com.col(k - 1)) / (0.01 * 0.01);
    BOOST_TEST(close(change, Vector3d(0., 0., -kGravity), 1e-4));
  }
}

BOOST_AUTO_TEST_CASE(windows_hardly_show_and_threads_do_not) {
  Stander stander = makeSwaying(1200, 4);
  for (Index k = 0; k < 1200; ++k) stander.schedule.active.col(k).setConstant(true);
  CentroidalFilterSettings whole;
  whole.reach = 1e-5;
  whole.change = 1e-4;
  whole.window = 1e3;
  CentroidalFilterSettings windows = whole;
  windows.window = 5.;
  const CentroidalChange one = stander.filter(whole), several = stander.filter(windows);
  BOOST_TEST(one.largest > 0.01);
  BOOST_TEST((one.com - several.com).colwise().norm().maxCoeff() < 2e-4);
  const CentroidalChange threads = stander.filter(windows, {}, 3);
  BOOST_TEST((threads.com == several.com));
  BOOST_TEST((threads.angular_momentum == several.angular_momentum));
  BOOST_TEST((threads.residual == several.residual));
}

BOOST_AUTO_TEST_CASE(far_from_what_is_out_of_reach_nothing_changes) {
  Stander stander(1000);
  stander.dynamics.com.block(0, 500, 1, 20).setConstant(0.15);
  const CentroidalChange found = stander.filter();
  BOOST_TEST(found.largest > 1e-3);
  BOOST_TEST(found.com.leftCols(345).isZero(0.));
  BOOST_TEST(found.com.rightCols(325).isZero(0.));
}

BOOST_AUTO_TEST_CASE(a_mirrored_motion_changes_mirrored) {
  const Stander stander = makeSwaying(60, 5);
  Stander mirrored = stander;
  const Vector3d of_vector(1., -1., 1.), of_moment(-1., 1., -1.);
  mirrored.dynamics.com = of_vector.asDiagonal() * stander.dynamics.com;
  mirrored.dynamics.ground_force = of_vector.asDiagonal() * stander.dynamics.ground_force;
  mirrored.dynamics.ground_torque = of_moment.asDiagonal() * stander.dynamics.ground_torque;
  for (ContactMotion& motion : mirrored.motions) motion.position.row(1) *= -1.;
  const CentroidalChange found = stander.filter(), other = mirrored.filter();
  BOOST_TEST(close(other.com, of_vector.asDiagonal() * found.com, 1e-9));
  BOOST_TEST(close(other.angular_momentum, of_moment.asDiagonal() * found.angular_momentum, 1e-9));

  // Elsewhere it is the same.
  Stander moved = stander;
  moved.dynamics.com.colwise() += Vector3d(3., -2., 1.);
  for (ContactMotion& motion : moved.motions) motion.position.colwise() += Vector3d(3., -2., 1.);
  BOOST_TEST(close(moved.filter().com, found.com, 1e-6));
}

BOOST_AUTO_TEST_CASE(a_turned_motion_on_cones_changes_turned) {
  // Pushed diagonally, through the middle of what it stands on, as pyramids allow and cones do not.
  const auto makeSliding = [](FrictionModel friction) {
    Stander stander(60, 50., friction);
    for (Index k = 0; k < 60; ++k) {
      const double push = 0.95 * kFriction * kWeight * std::sin(0.2 * double(k));
      const Vector3d force(push, push, kWeight);
      stander.dynamics.ground_force.col(k) = force;
      stander.dynamics.ground_torque.col(k) = -stander.dynamics.com.col(k).cross(force);
    }
    return stander;
  };
  const Matrix3d about = Eigen::AngleAxisd(0.7, Vector3d::UnitZ()).toRotationMatrix();
  const auto turn = [&](Stander stander) {
    stander.dynamics.com = about * stander.dynamics.com;
    stander.dynamics.ground_force = about * stander.dynamics.ground_force;
    stander.dynamics.ground_torque = about * stander.dynamics.ground_torque;
    for (ContactMotion& motion : stander.motions) motion.position = about * motion.position;
    return stander;
  };
  const Stander cones = makeSliding(FrictionModel::Cone);
  const Stander pyramids = makeSliding(FrictionModel::OuterPyramid);
  BOOST_TEST(pyramids.filter().rms == 0.);
  const CentroidalChange here = cones.filter(exactSettings());
  const CentroidalChange turned = turn(cones).filter(exactSettings());
  BOOST_TEST(here.converged);
  BOOST_TEST(here.rms > 1e-3);
  BOOST_TEST(close(turned.com, about * here.com, 1e-6));
}

BOOST_AUTO_TEST_CASE(nothing_is_asked_of_frames_that_are_free) {
  Stander stander(200);
  stander.dynamics.ground_force.col(100) *= -3.;
  Eigen::Array<bool, Eigen::Dynamic, 1> free(200);
  free.setConstant(false);
  BOOST_TEST(stander.filter({}, free).largest > 1e-3);
  free[100] = true;
  BOOST_TEST(stander.filter({}, free).largest == 0.);
}

BOOST_AUTO_TEST_CASE(short_motions_and_uneven_times) {
  Stander one(1);
  one.dynamics.com(0, 0) = 0.15;
  BOOST_TEST(close(one.filter(exactSettings()).com, Vector3d(-0.05, 0., 0.), 1e-5));

  // A frame more changes little.
  Stander leaning(120);
  leaning.dynamics.com.row(0).setConstant(0.12);
  Stander denser(121);
  denser.dynamics.com.row(0).setConstant(0.12);
  denser.dynamics.time.tail(60) = leaning.dynamics.time.tail(60).eval();
  denser.dynamics.time.segment(0, 61) = VectorXd::LinSpaced(61, 0., leaning.dynamics.time[59]);
  const double even = leaning.filter(exactSettings()).rms;
  BOOST_TEST(std::abs(denser.filter(exactSettings()).rms - even) < 0.01 * even);
}

BOOST_AUTO_TEST_CASE(mistakes_are_named) {
  const Stander stander(10);
  CentroidalFilterSettings settings;
  settings.com = -1.;
  BOOST_TEST(throws<std::invalid_argument>([&] { stander.filter(settings); },
                                           {"CentroidalFilterSettings.com", "-1"}));
  settings = {};
  settings.window = kNaN;
  BOOST_TEST(throws<std::invalid_argument>([&] { settings.validate(); }, {"window", "nan"}));
  Stander wrong = stander;
  wrong.motions.pop_back();
  BOOST_TEST(throws<std::invalid_argument>([&] { wrong.filter(); }, {"motions", "4", "3"}));
  wrong = stander;
  wrong.dynamics.com(1, 3) = kNaN;
  BOOST_TEST(throws<std::invalid_argument>([&] { wrong.filter(); }, {"dynamics", "finite"}));
  wrong = stander;
  wrong.schedule.names[2] = "hand";
  BOOST_TEST(throws<std::invalid_argument>([&] { wrong.filter(); }, {"schedule", "hand"}));
  Eigen::Array<bool, Eigen::Dynamic, 1> free(3);
  BOOST_TEST(throws<std::invalid_argument>([&] { stander.filter({}, free); }, {"free", "10", "3"}));
  BOOST_TEST(throws<std::invalid_argument>([&] { stander.filter({}, {}, -1); }, {"threads", "-1"}));
}

BOOST_AUTO_TEST_CASE(settings_say_what_they_are) {
  CentroidalFilterSettings settings;
  BOOST_TEST(mentions(settings.to_string(), "com_acceleration"));
  CentroidalFilterSettings other;
  BOOST_TEST((settings == other));
  other.overlap = 2.;
  BOOST_TEST((settings != other));
}
