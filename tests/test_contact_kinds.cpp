// SPDX-License-Identifier: BSD-2-Clause
// Contacts whose sets are more than pyramids, and how they share a wrench.
#define BOOST_TEST_MODULE contact_kinds
#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>

#include "dynacom/contact6d.hpp"
#include "dynacom/contact_grasp.hpp"
#include "dynacom/contact_point.hpp"
#include "dynacom/contact_polygon.hpp"
#include "dynacom/wrench_distribution.hpp"
#include "test_tools.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

using Vector6 = WrenchDistribution::Vector6;

Contact6DSettings sole() {
  Contact6DSettings settings;
  settings.mu = 0.5;
  settings.gu = 0.05;
  settings.half_length = 0.1;
  settings.half_width = 0.05;
  settings.frame_name = "foot";
  return settings;
}

pinocchio::SE3 at(double y) { return {Eigen::Matrix3d::Identity(), Eigen::Vector3d(0., y, 0.)}; }

// Contacts side by side, below the CoM.
DistributionResult share(const std::vector<std::shared_ptr<ContactBase>>& contacts,
                         const Vector6& wrench, WrenchMargin* margin = nullptr) {
  WrenchDistribution distribution;
  double y = 0.1;
  for (const auto& contact : contacts) {
    contact->updateNewtonEuler({0., 0., 0.9}, at(y));
    distribution.add(*contact);
    y -= 0.2;
  }
  distribution.solve(wrench);
  if (margin) *margin = distribution.computeMargin();
  BOOST_TEST(distribution.result().isOptimal());
  return distribution.result();
}

Vector6 wrenchOf(double x, double y, double z) {
  Vector6 wrench = Vector6::Zero();
  wrench.head<3>() << x, y, z;
  wrench.tail<3>() = Eigen::Vector3d(0., 0., -0.9).cross(wrench.head<3>());  // of the ground
  return wrench;
}

}  // namespace

BOOST_AUTO_TEST_CASE(by_default_a_surface_is_the_manuals) {
  const Contact6D contact(sole());
  BOOST_TEST(contact.isPyramid());
  Eigen::Matrix<double, 5, 6> uni_A;
  uni_A << 0, 0, -1, 0, 0, 0, 0, 0, -0.1, 0, -1, 0, 0, 0, -0.05, 1, 0, 0, 0, 0, -0.1, 0, 1, 0, 0, 0,
      -0.05, -1, 0, 0;
  Eigen::Matrix<double, 6, 6> fri_A;
  fri_A << 1, 0, -0.5, 0, 0, 0, 0, 1, -0.5, 0, 0, 0, -1, 0, -0.5, 0, 0, 0, 0, -1, -0.5, 0, 0, 0, 0,
      0, -0.05, 0, 0, 1, 0, 0, -0.05, 0, 0, -1;
  BOOST_TEST((contact.uni_A() == uni_A));
  BOOST_TEST((contact.fri_A() == fri_A));
}

BOOST_AUTO_TEST_CASE(friction_models_allow_what_they_say) {
  // Along a diagonal a force of 0.5 N by 0.5 N for each newton of the normal force.
  const auto usageOf = [](FrictionModel model, double x, double y) {
    Contact6DSettings settings = sole();
    settings.friction = model;
    Contact6D contact(settings);
    Vector6 force;
    force << x, y, 10., 0., 0., 0.;
    contact.applyForce(force);
    return contact.getFrictionUsage();
  };
  BOOST_TEST(std::abs(usageOf(FrictionModel::OuterPyramid, 5., 5.) - 1.) < 1e-12);
  BOOST_TEST(std::abs(usageOf(FrictionModel::Cone, 5., 5.) - std::sqrt(2.)) < 1e-12);
  BOOST_TEST(std::abs(usageOf(FrictionModel::InnerPyramid, 5., 0.) - std::sqrt(2.)) < 1e-12);
  BOOST_TEST(std::abs(usageOf(FrictionModel::Facets, 5., 0.) - 1.) < 1e-12);
  BOOST_TEST(usageOf(FrictionModel::Facets, 5., 2.) < usageOf(FrictionModel::Cone, 5., 2.));

  const Vector6 wrench = wrenchOf(400., 100., 900.);
  for (const FrictionModel model : {FrictionModel::OuterPyramid, FrictionModel::InnerPyramid,
                                    FrictionModel::Facets, FrictionModel::Cone}) {
    Contact6DSettings settings = sole();
    settings.friction = model;
    const DistributionResult result = share(
        {std::make_shared<Contact6D>(settings), std::make_shared<Contact6D>(settings)}, wrench);
    // 412 N are within 450 N of the cone, 400 N not within 318 N of the pyramid in it.
    BOOST_TEST(
        (result.status == (model == FrictionModel::InnerPyramid ? DistributionStatus::Relaxed
                                                                : DistributionStatus::Solved)));
    for (const DistributionResult::Contact& contact : result.contacts) {
      const Eigen::Vector3d force = contact.force.head<3>();
      if (model == FrictionModel::Cone)
        BOOST_TEST(force.head<2>().norm() <= 0.5 * force[2] * (1. + 1e-9));
    }
  }
}

BOOST_AUTO_TEST_CASE(a_polygon_of_four_vertices_is_the_rectangle) {
  ContactPolygonSettings settings;
  settings.mu = 0.5;
  settings.gu = 0.05;
  settings.frame_name = "foot";
  settings.vertices.resize(2, 4);
  settings.vertices << 0.1, -0.1, -0.1, 0.1, 0.05, 0.05, -0.05, -0.05;
  const auto polygon = std::make_shared<ContactPolygon>(settings);
  BOOST_TEST((polygon->uni_A() == Contact6D(sole()).uni_A()));
  BOOST_TEST((polygon->getCorners() == Contact6D(sole()).getCorners()));
  BOOST_TEST(polygon->isPyramid());
  // And with a vertex more, on an edge, it is the same set, by another way.
  const Vector6 wrench = wrenchOf(50., 20., 900.);
  const DistributionResult rectangle =
      share({std::make_shared<Contact6D>(sole()), std::make_shared<Contact6D>(sole())}, wrench);
  settings.greatest_normal_force = 1e6;
  const DistributionResult bounded = share(
      {std::make_shared<ContactPolygon>(settings), std::make_shared<ContactPolygon>(settings)},
      wrench);
  BOOST_TEST(bounded.contacts[0].set.has_value());
  for (std::size_t k = 0; k < 2; ++k)
    BOOST_TEST((bounded.contacts[k].force - rectangle.contacts[k].force).norm() < 1e-6);
}

BOOST_AUTO_TEST_CASE(toes_and_edges_carry_where_they_are) {
  ContactPolygonSettings settings;
  settings.mu = 0.5;
  settings.frame_name = "foot";
  settings.vertices = Eigen::Vector2d(0.1, 0.02);
  ContactPolygon toe(settings);
  Vector6 force;
  force << 0., 0., 10., 0.2, -1., 0.;  // at (0.1, 0.02)
  toe.applyForce(force);
  BOOST_TEST(std::abs(toe.getCoPMargin()) < 1e-12);
  settings.vertices.resize(2, 2);
  settings.vertices << 0.1, 0.1, -0.05, 0.05;
  const DistributionResult result = share(
      {std::make_shared<ContactPolygon>(settings), std::make_shared<ContactPolygon>(settings)},
      wrenchOf(0., 0., 900.));
  // Nothing behind the toes carries: it tips forward, or rather, the moment is out of reach.
  BOOST_TEST((result.status == DistributionStatus::Relaxed));
  for (const DistributionResult::Contact& contact : result.contacts)
    if (contact.force[2] > 1.)
      BOOST_TEST(std::abs(contact.force[4] / contact.force[2] + 0.1) < 1e-9);
}

BOOST_AUTO_TEST_CASE(bounds_of_the_normal_force_and_references_are_kept) {
  Contact6DSettings weak = sole();
  weak.greatest_normal_force = 200.;
  const auto contact = std::make_shared<Contact6D>(weak);
  BOOST_TEST(contact->uni_rows() == 6);
  BOOST_TEST(contact->uni_b()[1] == 200.);
  const DistributionResult result =
      share({contact, std::make_shared<Contact6D>(sole())}, wrenchOf(0., 0., 900.));
  BOOST_TEST(result.contacts[0].force[2] <= 200. * (1. + 1e-12));
  // What was asked for before is as good as ever, with a reference.
  Contact6DSettings settings = sole();
  settings.reference << 10., 0., 600., 0., 0., 0.;
  Contact6DSettings other = sole();
  other.reference << -10., 0., 300., 0., 0., 0.;
  Vector6 wrench = wrenchOf(0., 0., 900.);
  wrench[3] += 0.1 * 300.;
  wrench[5] += -0.1 * 20.;
  const DistributionResult near =
      share({std::make_shared<Contact6D>(settings), std::make_shared<Contact6D>(other)}, wrench);
  BOOST_TEST((near.contacts[0].force - settings.reference).norm() < 1e-6);
  BOOST_TEST(near.cost < 1e-10);
}

BOOST_AUTO_TEST_CASE(a_hand_on_a_rail_pulls) {
  ContactGraspSettings grasp;
  grasp.lower.setConstant(-100.);
  grasp.upper.setConstant(100.);
  grasp.frame_name = "hand";
  const auto hand = std::make_shared<ContactGrasp>(grasp);
  BOOST_TEST(hand->uni_rows() == 12);
  // Pulled up, which no foot can.
  const DistributionResult result =
      share({std::make_shared<Contact6D>(sole()), hand}, wrenchOf(0., 0., -50.));
  BOOST_TEST(result.contacts[1].force[2] < -40.);
  BOOST_TEST((result.status == DistributionStatus::Solved));
}

BOOST_AUTO_TEST_CASE(a_surface_may_be_turned_against_its_frame) {
  Contact6DSettings settings = sole();
  settings.placement = {
      pinocchio::SE3::Matrix3(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY()).toRotationMatrix()),
      Eigen::Vector3d(0.05, 0., -0.03)};
  Contact6D contact(settings);
  contact.updateNewtonEuler({0., 0., 0.9}, pinocchio::SE3::Identity());
  BOOST_TEST(contact.isPyramid());
  const Eigen::Matrix3d of_force = contact.ne_A().topLeftCorner<3, 3>();
  BOOST_TEST(of_force.isApprox(settings.placement.rotation()));
  const Eigen::Vector3d lever = settings.placement.translation() - Eigen::Vector3d(0., 0., 0.9);
  const Eigen::Vector3d normal = settings.placement.rotation().col(2);
  const Eigen::Vector3d of_normal = contact.ne_A().col(2).tail<3>();
  BOOST_TEST(of_normal.isApprox(lever.cross(normal)));
}

BOOST_AUTO_TEST_CASE(margins_of_sets_that_are_no_cones) {
  // A foot that carries 1,000 N at most has 100 N left above 900 N.
  Contact6DSettings settings = sole();
  settings.mu = 5.;
  settings.gu = 5.;
  settings.half_length = settings.half_width = 5.;
  settings.greatest_normal_force = 1000.;
  const auto contact = std::make_shared<Contact6D>(settings);
  WrenchMargin margin;
  WrenchDistribution distribution;
  contact->updateNewtonEuler({0., 0., 0.9}, pinocchio::SE3::Identity());
  distribution.add(*contact);
  distribution.solve(wrenchOf(0., 0., 900.));
  margin = distribution.computeMargin();
  BOOST_TEST(std::abs(margin.margin - 100.) < 1e-6);
  BOOST_TEST(margin.axis == 2);
  BOOST_TEST(margin.sign == 1);
}

BOOST_AUTO_TEST_CASE(settings_out_of_range_are_named) {
  Contact6DSettings settings = sole();
  settings.facets = 3;
  BOOST_TEST(throws<std::invalid_argument>([&] { settings.validate(); },
                                           {"Contact6DSettings.facets", "4", "3"}));
  settings = sole();
  settings.greatest_normal_force = -1.;
  BOOST_TEST(
      throws<std::invalid_argument>([&] { settings.validate(); }, {"greatest_normal_force", "-1"}));
  ContactGraspSettings grasp;
  grasp.frame_name = "hand";
  grasp.lower.setOnes();
  grasp.upper.setZero();
  BOOST_TEST(throws<std::invalid_argument>([&] { grasp.validate(); },
                                           {"ContactGraspSettings.lower", "upper"}));
  ContactPolygonSettings polygon;
  polygon.frame_name = "foot";
  polygon.vertices.resize(2, 0);
  BOOST_TEST(throws<std::invalid_argument>([&] { polygon.validate(); },
                                           {"ContactPolygonSettings.vertices", "none"}));
}
