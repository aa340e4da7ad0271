// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE contact6d
#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "dynacom/contact6d.hpp"
#include "test_tools.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

const double kNaN = std::numeric_limits<double>::quiet_NaN();
const double kInfinity = std::numeric_limits<double>::infinity();

Contact6DSettings randomSettings(Random& random) {
  Contact6DSettings settings;
  settings.mu = random.uniform(0.1, 1.);
  settings.gu = random.uniform(0.1, 1.);
  settings.half_length = random.uniform(0.01, 0.2);
  settings.half_width = random.uniform(0.01, 0.2);
  settings.weights = random.vector(6, 0.1, 10.);
  settings.frame_name = "sole" + std::to_string(random.integer(0, 999));
  return settings;
}

/// The rows of the manual.
void checkMatrices(const Contact6D& contact, const Contact6DSettings& settings) {
  const double mu = settings.mu, gu = settings.gu;
  const double dx = settings.half_length, dy = settings.half_width;
  BOOST_TEST(contact.uni_rows() == 5);
  BOOST_TEST(contact.fri_rows() == 6);
  BOOST_TEST(contact.cols() == 6);
  Eigen::Matrix<double, 5, 6> unilaterality;
  unilaterality << 0, 0, -1, 0, 0, 0,  //
      0, 0, -dx, 0, -1, 0,             //
      0, 0, -dy, 1, 0, 0,              //
      0, 0, -dx, 0, 1, 0,              //
      0, 0, -dy, -1, 0, 0;
  BOOST_TEST(close(contact.uni_A(), unilaterality, 0.));
  Eigen::Matrix<double, 6, 6> friction;
  friction << 1, 0, -mu, 0, 0, 0,  //
      0, 1, -mu, 0, 0, 0,          //
      -1, 0, -mu, 0, 0, 0,         //
      0, -1, -mu, 0, 0, 0,         //
      0, 0, -gu, 0, 0, 1,          //
      0, 0, -gu, 0, 0, -1;
  BOOST_TEST(close(contact.fri_A(), friction, 0.));
  BOOST_TEST(close(contact.reg_A(), settings.weights, 0.));
  BOOST_TEST(close(contact.uni_b(), VectorXd::Zero(5), 0.));
  BOOST_TEST(close(contact.fri_b(), VectorXd::Zero(6), 0.));
  BOOST_TEST(close(contact.reg_b(), VectorXd::Zero(6), 0.));
  BOOST_TEST(contact.ne_A().cols() == 6);
  BOOST_TEST((contact.getSettings() == settings));
}

}  // namespace

BOOST_AUTO_TEST_CASE(defaults_are_a_frictionless_point) {
  const Contact6DSettings settings;
  BOOST_TEST(settings.mu == 0.);
  BOOST_TEST(settings.gu == 0.);
  BOOST_TEST(settings.half_length == 0.);
  BOOST_TEST(settings.half_width == 0.);
  BOOST_TEST(close(settings.weights, Vector6::Ones(), 0.));
  BOOST_TEST(settings.frame_name.empty());
}

BOOST_AUTO_TEST_CASE(matrices_are_those_of_the_manual) {
  Random random(1);
  for (int trial = 0; trial < 20; ++trial) {
    const auto settings = randomSettings(random);
    const Contact6D contact(settings);
    checkMatrices(contact, settings);
    BOOST_TEST(contact.getFrameName() == settings.frame_name);
  }
}

BOOST_AUTO_TEST_CASE(matrices_follow_the_setters) {
  Random random(2);
  auto settings = randomSettings(random);
  Contact6D contact(settings);
  for (int trial = 0; trial < 10; ++trial) {
    contact.setMu(settings.mu = random.uniform(0., 2.));
    checkMatrices(contact, settings);
    contact.setGu(settings.gu = random.uniform(0., 2.));
    checkMatrices(contact, settings);
    contact.setSurfaceHalfLength(settings.half_length = random.uniform(0., 1.));
    checkMatrices(contact, settings);
    contact.setSurfaceHalfWidth(settings.half_width = random.uniform(0., 1.));
    checkMatrices(contact, settings);
    settings.weights.head<3>() = random.vector(3, 0.1, 10.);
    contact.setForceWeights(settings.weights.head<3>());
    checkMatrices(contact, settings);
    settings.weights.tail<3>() = random.vector(3, 0.1, 10.);
    contact.setTorqueWeights(settings.weights.tail<3>());
    checkMatrices(contact, settings);
  }
}

BOOST_AUTO_TEST_CASE(setters_leave_pose_force_and_frame_alone) {
  Random random(3);
  Contact6D contact(randomSettings(random));
  const Vector6 force = random.vector(6);
  contact.updateNewtonEuler(random.vector3(), random.placement());
  contact.applyForce(force);
  contact.setFrameID(4);
  const MatrixXd ne = contact.ne_A();
  contact.setMu(0.25);
  contact.setGu(0.25);
  contact.setSurfaceHalfLength(0.25);
  contact.setSurfaceHalfWidth(0.25);
  contact.setForceWeights(Vector3d(1., 2., 3.));
  contact.setTorqueWeights(Vector3d(1., 2., 3.));
  BOOST_TEST(close(contact.ne_A(), ne, 0.));
  BOOST_TEST(close(contact.appliedForce(), force, 0.));
  BOOST_TEST(contact.getFrameID() == 4u);
}

BOOST_AUTO_TEST_CASE(the_surface_is_the_frame) {
  Random random(5);
  Contact6D contact(randomSettings(random));
  const SE3 pose = random.placement();
  contact.setPose(pose);
  BOOST_TEST((contact.getSurfacePose() == pose));
}

BOOST_AUTO_TEST_CASE(corners_are_where_the_pressure_may_be_at_most) {
  // With all of its force in a corner, a contact is at its limits there, and beyond them further
  // out.
  Random random(9);
  for (int i = 0; i < 20; ++i) {
    const Contact6D contact(randomSettings(random));
    const Eigen::Matrix2Xd corners = contact.getCorners();
    BOOST_REQUIRE(corners.cols() == 4);
    double area = 0.;
    for (Index k = 0; k < 4; ++k) {
      const Vector2d corner = corners.col(k), next = corners.col((k + 1) % 4);
      Vector6 force;
      force << 0., 0., 1., corner.y(), -corner.x(), 0.;
      const VectorXd slack = contact.uni_A() * force;
      BOOST_TEST((slack.array() <= 1e-15).all());
      BOOST_TEST((slack.array().abs() <= 1e-15).count() == 2);
      area += 0.5 * (corner.x() * next.y() - corner.y() * next.x());
    }
    const auto& settings = contact.getSettings();
    BOOST_TEST(close(area, 4. * settings.half_length * settings.half_width));
  }
}

BOOST_AUTO_TEST_CASE(inequalities_hold_the_pressure_inside_the_rectangle) {
  // U λ ≤ 0 means: it pushes, and the centre of pressure is in the rectangle. Signs and the order
  // of length and width are told apart by putting the pressure beyond each edge in turn.
  Random random(6);
  const auto settings = randomSettings(random);
  const Contact6D contact(settings);
  const auto holds = [&](double x, double y) {
    const Vector3d force(0., 0., 100.);
    Vector6 lambda;
    lambda << force, Vector3d(x, y, 0.).cross(force);
    return (contact.uni_A() * lambda).maxCoeff() <= 0.;
  };
  const double dx = settings.half_length, dy = settings.half_width;
  for (const double sign : {-1., 1.}) {
    BOOST_TEST(holds(sign * 0.99 * dx, sign * 0.99 * dy));
    BOOST_TEST(!holds(sign * 1.01 * dx, 0.));
    BOOST_TEST(!holds(0., sign * 1.01 * dy));
  }
}

BOOST_AUTO_TEST_CASE(friction_circumscribes_the_cone) {
  // On the axes the pyramid allows μ f_z, on the diagonals √2 μ f_z.
  Contact6DSettings settings;
  settings.mu = 0.5;
  settings.gu = 0.25;
  settings.frame_name = "sole";
  const Contact6D contact(settings);
  const auto excess = [&](double fx, double fy, double tz) {
    Vector6 lambda;
    lambda << fx, fy, 100., 0., 0., tz;
    return (contact.fri_A() * lambda).maxCoeff();
  };
  for (const double sign : {-1., 1.}) {
    BOOST_TEST(excess(sign * 50., 0., 0.) == 0.);
    BOOST_TEST(excess(0., sign * 50., 0.) == 0.);
    BOOST_TEST(excess(sign * 50., sign * 50., 0.) == 0.);
    BOOST_TEST(excess(0., 0., sign * 25.) == 0.);
    BOOST_TEST(excess(sign * 51., 0., 0.) == 1.);
    BOOST_TEST(excess(0., sign * 51., 0.) == 1.);
    BOOST_TEST(excess(0., 0., sign * 26.) == 1.);
  }
}

BOOST_AUTO_TEST_CASE(usages_are_what_is_given_over_what_is_allowed) {
  Random random(10);
  for (int trial = 0; trial < 50; ++trial) {
    const auto settings = randomSettings(random);
    Contact6D contact(settings);
    Vector6 force = random.vector(6, 10.);
    force[2] = random.uniform(10., 100.);
    contact.applyForce(force);
    BOOST_TEST(close(contact.getFrictionUsage(),
                     std::max(std::abs(force[0]), std::abs(force[1])) / (settings.mu * force[2])));
    BOOST_TEST(close(contact.getYawUsage(), std::abs(force[5]) / (settings.gu * force[2])));
    // 1 is where the inequalities begin to be violated.
    const auto excess = [&](Index from, Index rows) {
      return (contact.fri_A().middleRows(from, rows) * contact.appliedForce()).maxCoeff();
    };
    BOOST_TEST((contact.getFrictionUsage() <= 1.) == (excess(0, 4) <= 0.));
    BOOST_TEST((contact.getYawUsage() <= 1.) == (excess(4, 2) <= 0.));
  }
}

BOOST_AUTO_TEST_CASE(usages_of_forces_that_do_not_push_are_infinite) {
  Random random(11);
  Contact6D contact(randomSettings(random));
  for (const double fz : {0., -10.}) {
    Vector6 force = Vector6::Ones();
    force[2] = fz;
    contact.applyForce(force);
    BOOST_TEST(contact.getFrictionUsage() == kInfinity);
    BOOST_TEST(contact.getYawUsage() == kInfinity);
    BOOST_TEST(std::isnan(contact.getCoPMargin()));
  }
  // Nothing is used of what is not there.
  contact.setMu(0.);
  contact.setGu(0.);
  contact.applyForce(Vector6::Ones());
  BOOST_TEST(std::isnan(contact.getFrictionUsage()));
  BOOST_TEST(std::isnan(contact.getYawUsage()));
  BOOST_TEST(std::isfinite(contact.getCoPMargin()));
}

BOOST_AUTO_TEST_CASE(margin_of_pressure_is_the_distance_to_the_nearest_edge) {
  Contact6DSettings settings;
  settings.half_length = 0.1;
  settings.half_width = 0.06;
  settings.frame_name = "sole";
  Contact6D contact(settings);
  const auto marginAt = [&](double x, double y) {
    const Vector3d force(3., -4., 50.);
    Vector6 lambda;
    lambda << force, Vector3d(x, y, 0.).cross(force);
    contact.applyForce(lambda);
    return contact.getCoPMargin();
  };
  BOOST_TEST(close(marginAt(0., 0.), 0.06));
  for (const double sign : {-1., 1.}) {
    BOOST_TEST(close(marginAt(sign * 0.09, 0.), 0.01));
    BOOST_TEST(close(marginAt(sign * 0.09, 0.055), 0.005));
    BOOST_TEST(close(marginAt(0.01, sign * 0.04), 0.02));
    BOOST_TEST(close(marginAt(sign * 0.1, 0.), 0.));
    // Beyond an edge.
    BOOST_TEST(close(marginAt(sign * 0.13, 0.), -0.03));
    BOOST_TEST(close(marginAt(0., sign * 0.07), -0.01));
  }
  // Without extent, every place but the centre is beyond.
  contact.setSurfaceHalfLength(0.);
  BOOST_TEST(close(marginAt(0., 0.), 0.));
  BOOST_TEST(close(marginAt(0.01, 0.), -0.01));
}

BOOST_AUTO_TEST_CASE(settings_print_every_field) {
  Contact6DSettings settings;
  settings.mu = 0.625;
  settings.gu = 0.375;
  settings.half_length = 0.125;
  settings.half_width = 0.0625;
  settings.weights << 1.5, 2.5, 3.5, 4.5, 5.5, 6.5;
  settings.frame_name = "left_sole";
  const std::string text = settings.to_string();
  for (const char* word :
       {"mu", "0.625", "gu", "0.375", "half_length", "0.125", "half_width", "0.0625", "weights",
        "1.5", "2.5", "3.5", "4.5", "5.5", "6.5", "frame_name", "left_sole"})
    BOOST_TEST(mentions(text, word), word << " is missing in " << text);

  std::ostringstream out;
  out << settings;
  BOOST_TEST(out.str() == text);
}

BOOST_AUTO_TEST_CASE(settings_out_of_range_are_refused_by_name_and_value) {
  Contact6DSettings good;
  good.frame_name = "sole";
  BOOST_CHECK_NO_THROW(good.validate());

  const auto refused = [&](auto change, std::initializer_list<std::string> words) {
    Contact6DSettings bad = good;
    change(bad);
    BOOST_TEST(throws<std::invalid_argument>([&] { bad.validate(); }, words));
    BOOST_TEST(throws<std::invalid_argument>([&] { Contact6D contact(bad); }, words));

    // A contact that has settings keeps them, and all else.
    Contact6D contact(good);
    contact.setFrameID(2);
    contact.applyForce(Vector6::Ones());
    BOOST_TEST(throws<std::invalid_argument>([&] { contact.initialize(bad); }, words));
    BOOST_TEST(contact.getFrameID() == 2u);
    BOOST_TEST(close(contact.appliedForce(), Vector6::Ones(), 0.));
    checkMatrices(contact, good);
  };
  refused([](auto& bad) { bad.mu = -0.25; }, {"mu", "-0.25"});
  refused([](auto& bad) { bad.mu = kNaN; }, {"mu", "nan"});
  refused([](auto& bad) { bad.gu = -0.25; }, {"gu", "-0.25"});
  refused([](auto& bad) { bad.gu = kNaN; }, {"gu", "nan"});
  refused([](auto& bad) { bad.half_length = -0.25; }, {"half_length", "-0.25"});
  refused([](auto& bad) { bad.half_length = kNaN; }, {"half_length", "nan"});
  refused([](auto& bad) { bad.half_width = -0.25; }, {"half_width", "-0.25"});
  refused([](auto& bad) { bad.half_width = kNaN; }, {"half_width", "nan"});
  for (Index i = 0; i < 6; ++i) {
    refused([i](auto& bad) { bad.weights[i] = -0.25; }, {"weights", "-0.25"});
    refused([i](auto& bad) { bad.weights[i] = 0.; }, {"weights", "0"});
    refused([i](auto& bad) { bad.weights[i] = kNaN; }, {"weights", "nan"});
  }
  refused([](auto& bad) { bad.frame_name.clear(); }, {"frame_name"});
}

BOOST_AUTO_TEST_CASE(setters_refuse_what_settings_refuse) {
  Random random(9);
  const auto settings = randomSettings(random);
  Contact6D contact(settings);
  for (const double bad : {-0.25, kNaN}) {
    const std::string value = bad < 0. ? "-0.25" : "nan";
    const auto refused = [&](auto set, const char* field) {
      BOOST_TEST(throws<std::invalid_argument>(set, {field, value}));
      checkMatrices(contact, settings);
    };
    refused([&] { contact.setMu(bad); }, "mu");
    refused([&] { contact.setGu(bad); }, "gu");
    refused([&] { contact.setSurfaceHalfLength(bad); }, "half_length");
    refused([&] { contact.setSurfaceHalfWidth(bad); }, "half_width");
    for (Index i = 0; i < 3; ++i) {
      Vector3d weights = Vector3d::Ones();
      weights[i] = bad;
      refused([&] { contact.setForceWeights(weights); }, "weights");
      refused([&] { contact.setTorqueWeights(weights); }, "weights");
    }
  }
}

BOOST_AUTO_TEST_CASE(setters_need_settings_first) {
  Contact6D contact;
  const auto refused = [&](auto set) {
    BOOST_TEST(throws<NotReadyError>(set, {"initialize"}));
    BOOST_TEST(contact.cols() == 0);
    BOOST_TEST((contact.getSettings() == Contact6DSettings()));
  };
  refused([&] { contact.setMu(0.5); });
  refused([&] { contact.setGu(0.5); });
  refused([&] { contact.setSurfaceHalfLength(0.5); });
  refused([&] { contact.setSurfaceHalfWidth(0.5); });
  refused([&] { contact.setForceWeights(Vector3d::Ones()); });
  refused([&] { contact.setTorqueWeights(Vector3d::Ones()); });
}
