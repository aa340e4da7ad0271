// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE contact_point
#include <cmath>
#include <limits>
#include <sstream>

#include "dynacom/contact_point.hpp"
#include "test_tools.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

const double kNaN = std::numeric_limits<double>::quiet_NaN();
const double kInfinity = std::numeric_limits<double>::infinity();

ContactPointSettings randomSettings(Random& random) {
  ContactPointSettings settings;
  settings.mu = random.uniform(0.1, 1.);
  settings.weights = random.vector(3, 0.1, 10.);
  settings.frame_name = "tip" + std::to_string(random.integer(0, 999));
  settings.world_aligned = random.coin();
  settings.radius = random.uniform(0., 0.1);
  return settings;
}

/// The rows of the manual.
void checkMatrices(const ContactPoint& contact, double mu, const Vector3d& weights) {
  BOOST_TEST(contact.uni_rows() == 1);
  BOOST_TEST(contact.fri_rows() == 4);
  BOOST_TEST(contact.cols() == 3);
  BOOST_TEST(close(contact.uni_A(), Eigen::RowVector3d(0, 0, -1), 0.));
  Eigen::Matrix<double, 4, 3> friction;
  friction << 1, 0, -mu,  //
      0, 1, -mu,          //
      -1, 0, -mu,         //
      0, -1, -mu;
  BOOST_TEST(close(contact.fri_A(), friction, 0.));
  BOOST_TEST(close(contact.reg_A(), weights, 0.));
  BOOST_TEST(close(contact.uni_b(), VectorXd::Zero(1), 0.));
  BOOST_TEST(close(contact.fri_b(), VectorXd::Zero(4), 0.));
  BOOST_TEST(close(contact.reg_b(), VectorXd::Zero(3), 0.));
  BOOST_TEST(contact.ne_A().cols() == 3);
}

}  // namespace

BOOST_AUTO_TEST_CASE(defaults_are_a_frictionless_point_in_the_frame) {
  const ContactPointSettings settings;
  BOOST_TEST(settings.mu == 0.);
  BOOST_TEST(close(settings.weights, Vector3d::Ones(), 0.));
  BOOST_TEST(settings.frame_name.empty());
  BOOST_TEST(!settings.world_aligned);
  BOOST_TEST(settings.radius == 0.);
}

BOOST_AUTO_TEST_CASE(matrices_are_those_of_the_manual) {
  Random random(1);
  for (int trial = 0; trial < 20; ++trial) {
    const auto settings = randomSettings(random);
    const ContactPoint contact(settings);
    checkMatrices(contact, settings.mu, settings.weights);
    BOOST_TEST((contact.getSettings() == settings));
    BOOST_TEST(contact.getFrameName() == settings.frame_name);
  }
}

BOOST_AUTO_TEST_CASE(matrices_follow_the_setters) {
  Random random(2);
  auto settings = randomSettings(random);
  ContactPoint contact(settings);
  for (int trial = 0; trial < 10; ++trial) {
    settings.mu = random.uniform(0., 2.);
    contact.setMu(settings.mu);
    checkMatrices(contact, settings.mu, settings.weights);
    BOOST_TEST((contact.getSettings() == settings));

    settings.weights = random.vector(3, 0.1, 10.);
    contact.setForceWeights(settings.weights);
    checkMatrices(contact, settings.mu, settings.weights);
    BOOST_TEST((contact.getSettings() == settings));
  }
}

BOOST_AUTO_TEST_CASE(setters_leave_pose_force_and_frame_alone) {
  Random random(3);
  ContactPoint contact(randomSettings(random));
  const Vector3d force(1., 2., 3.);
  contact.updateNewtonEuler(random.vector3(), random.placement());
  contact.applyForce(force);
  contact.setFrameID(4);
  const MatrixXd ne = contact.ne_A();
  contact.setMu(0.25);
  contact.setForceWeights(Vector3d(1., 2., 3.));
  BOOST_TEST(close(contact.ne_A(), ne, 0.));
  BOOST_TEST(close(contact.appliedForce(), force, 0.));
  BOOST_TEST(contact.getFrameID() == 4u);
}

BOOST_AUTO_TEST_CASE(the_surface_is_the_frame_unless_settings_say_otherwise) {
  Random random(5);
  auto settings = randomSettings(random);
  settings.world_aligned = false;
  settings.radius = 0.;
  ContactPoint contact(settings);
  const SE3 pose = random.placement();
  contact.setPose(pose);
  BOOST_TEST((contact.getSurfacePose() == pose));
}

BOOST_AUTO_TEST_CASE(a_ball_touches_below_its_centre_along_the_normal) {
  Random random(6);
  for (int trial = 0; trial < 20; ++trial) {
    const auto settings = randomSettings(random);
    ContactPoint contact(settings);
    const SE3 pose = random.placement();
    const Vector3d com = random.vector3();
    contact.updateNewtonEuler(com, pose);

    const Matrix3d axes = settings.world_aligned ? Matrix3d::Identity() : pose.rotation();
    const Vector3d normal = axes.col(2);
    const Vector3d point = pose.translation() - settings.radius * normal;
    BOOST_TEST((contact.getPose() == pose));
    BOOST_TEST(close(contact.getSurfacePose().rotation(), axes, 0.));
    BOOST_TEST(close(contact.getSurfacePose().translation(), point, 1e-15));

    // Force and lever start from there, too.
    const Vector3d lambda = random.vector3(100.);
    const Vector3d force = axes * lambda;
    contact.applyForce(lambda);
    Vector6 expected;
    expected << force, (point - com).cross(force);
    BOOST_TEST(close(contact.toCoMForces(), expected));
    expected.tail<3>() = point.cross(force);
    BOOST_TEST(close(contact.toWorldForces(), expected));
  }
}

BOOST_AUTO_TEST_CASE(a_point_is_its_own_corner) {
  Random random(8);
  const ContactPoint contact(randomSettings(random));
  BOOST_TEST(close(contact.getCorners(), MatrixXd::Zero(2, 1), 0.));
}

BOOST_AUTO_TEST_CASE(friction_usage_is_the_larger_tangential_force_over_what_is_allowed) {
  ContactPointSettings settings;
  settings.mu = 0.5;
  settings.frame_name = "tip";
  ContactPoint contact(settings);
  const auto usage = [&](double fx, double fy, double fz) {
    contact.applyForce(Vector3d(fx, fy, fz));
    return contact.getFrictionUsage();
  };
  BOOST_TEST(close(usage(10., 0., 100.), 0.2));
  BOOST_TEST(close(usage(-20., 10., 100.), 0.4));
  BOOST_TEST(close(usage(10., -30., 100.), 0.6));
  // On the pyramid, at its edge too, and beyond.
  BOOST_TEST(usage(50., 0., 100.) == 1.);
  BOOST_TEST(usage(-50., 50., 100.) == 1.);
  BOOST_TEST(close(usage(0., 100., 100.), 2.));
  BOOST_TEST(usage(0., 0., 100.) == 0.);
  BOOST_TEST(usage(0., 0., 0.) == 0.);
  // A force that does not push cannot be there.
  BOOST_TEST(usage(1., 0., 0.) == kInfinity);
  BOOST_TEST(usage(1., 0., -100.) == kInfinity);
  BOOST_TEST(usage(0., 0., -100.) == kInfinity);

  contact.setMu(0.25);
  BOOST_TEST(close(usage(10., 0., 100.), 0.4));
  contact.setMu(0.);
  BOOST_TEST(std::isnan(usage(0., 0., 100.)));
  BOOST_TEST(std::isnan(usage(1., 0., 100.)));
}

BOOST_AUTO_TEST_CASE(settings_print_every_field) {
  ContactPointSettings settings;
  settings.mu = 0.625;
  settings.weights << 1.5, 2.5, 3.5;
  settings.frame_name = "left_tip";
  settings.radius = 0.0375;
  const std::string text = settings.to_string();
  for (const char* word : {"mu", "0.625", "weights", "1.5", "2.5", "3.5", "frame_name", "left_tip",
                           "world_aligned", "radius", "0.0375"})
    BOOST_TEST(mentions(text, word), word << " is missing in " << text);

  std::ostringstream out;
  out << settings;
  BOOST_TEST(out.str() == text);
}

BOOST_AUTO_TEST_CASE(settings_out_of_range_are_refused_by_name_and_value) {
  ContactPointSettings good;
  good.frame_name = "tip";
  BOOST_CHECK_NO_THROW(good.validate());

  const auto refused = [&](auto change, std::initializer_list<std::string> words) {
    ContactPointSettings bad = good;
    change(bad);
    BOOST_TEST(throws<std::invalid_argument>([&] { bad.validate(); }, words));
    BOOST_TEST(throws<std::invalid_argument>([&] { ContactPoint contact(bad); }, words));

    // A contact that has settings keeps them, and all else.
    ContactPoint contact(good);
    contact.setFrameID(2);
    contact.applyForce(Vector3d(1., 2., 3.));
    BOOST_TEST(throws<std::invalid_argument>([&] { contact.initialize(bad); }, words));
    BOOST_TEST((contact.getSettings() == good));
    BOOST_TEST(contact.getFrameID() == 2u);
    BOOST_TEST(close(contact.appliedForce(), Vector3d(1., 2., 3.), 0.));
    checkMatrices(contact, good.mu, good.weights);
  };
  refused([](auto& bad) { bad.mu = -0.25; }, {"mu", "-0.25"});
  refused([](auto& bad) { bad.mu = kNaN; }, {"mu", "nan"});
  refused([](auto& bad) { bad.weights.y() = -0.25; }, {"weights", "-0.25"});
  refused([](auto& bad) { bad.weights.z() = 0.; }, {"weights", "0"});
  refused([](auto& bad) { bad.weights.x() = kNaN; }, {"weights", "nan"});
  refused([](auto& bad) { bad.frame_name.clear(); }, {"frame_name"});
  refused([](auto& bad) { bad.radius = -0.25; }, {"radius", "-0.25"});
  refused([](auto& bad) { bad.radius = kNaN; }, {"radius", "nan"});
}

BOOST_AUTO_TEST_CASE(setters_refuse_what_settings_refuse) {
  Random random(9);
  const auto settings = randomSettings(random);
  ContactPoint contact(settings);
  BOOST_TEST(throws<std::invalid_argument>([&] { contact.setMu(-0.25); }, {"mu", "-0.25"}));
  BOOST_TEST(throws<std::invalid_argument>([&] { contact.setMu(kNaN); }, {"mu", "nan"}));
  BOOST_TEST(throws<std::invalid_argument>(
      [&] { contact.setForceWeights(Vector3d(1., -0.25, 1.)); }, {"weights", "-0.25"}));
  BOOST_TEST(throws<std::invalid_argument>([&] { contact.setForceWeights(Vector3d(1., 1., kNaN)); },
                                           {"weights", "nan"}));
  BOOST_TEST((contact.getSettings() == settings));
  checkMatrices(contact, settings.mu, settings.weights);
}

BOOST_AUTO_TEST_CASE(setters_need_settings_first) {
  ContactPoint contact;
  BOOST_TEST(throws<NotReadyError>([&] { contact.setMu(0.5); }, {"initialize"}));
  BOOST_TEST(
      throws<NotReadyError>([&] { contact.setForceWeights(Vector3d::Ones()); }, {"initialize"}));
  BOOST_TEST(contact.cols() == 0);
  BOOST_TEST((contact.getSettings() == ContactPointSettings()));
}
