// SPDX-License-Identifier: BSD-2-Clause
// Soles of coupled yaw against what they stand for: a force at each corner, within its pyramid.
#define BOOST_TEST_MODULE coupled_yaw
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "dynacom/contact6d.hpp"
#include "dynacom/contact_grasp.hpp"
#include "dynacom/contact_point.hpp"
#include "dynacom/wrench_distribution.hpp"
#include "test_tools.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

using Generators = Eigen::Matrix<double, 6, 16>;
using Vector16 = Eigen::Matrix<double, 16, 1>;

Contact6DSettings randomSole(Random& random) {
  Contact6DSettings settings;
  settings.mu = random.uniform(0.1, 1.2);
  settings.half_length = random.uniform(0.02, 0.2);
  settings.half_width = random.uniform(0.01, 0.1);
  if (random.coin()) settings.friction = FrictionModel::InnerPyramid;
  settings.coupled_yaw = true;
  settings.frame_name = "foot";
  return settings;
}

double pyramidMu(const Contact6DSettings& settings) {
  return settings.friction == FrictionModel::InnerPyramid ? settings.mu / std::sqrt(2.)
                                                          : settings.mu;
}

/// The wrenches, of unit norm, of the edges of the pyramids at the corners: what the corners can
/// give is their sums.
Generators cornerForces(const Contact6DSettings& settings) {
  Generators generators;
  const double mu = pyramidMu(settings);
  Index col = 0;
  for (const double x : {-settings.half_length, settings.half_length})
    for (const double y : {-settings.half_width, settings.half_width})
      for (const double fx : {-mu, mu})
        for (const double fy : {-mu, mu}) {
          const Vector3d force(fx, fy, 1.);
          generators.col(col++) << force, Vector3d(x, y, 0.).cross(force);
        }
  generators.colwise().normalize();
  return generators;
}

/// Lawson and Hanson's least ‖G s − w‖ over s ≥ 0: what is left of w, r = w − G s, for which
/// Gᵀ r ≤ 0 proves that no sum is closer.
Vector6 leftByCorners(const Generators& G, const Vector6& w) {
  Vector16 s = Vector16::Zero();
  std::vector<Index> used;
  for (int step = 0; step < 200; ++step) {
    const Vector6 left = w - G * s;
    const Vector16 rates = G.transpose() * left;
    const double rounding = 1e-12 * left.norm() + 1e-15;
    Index best = -1;
    for (Index k = 0; k < 16; ++k)
      if (std::find(used.begin(), used.end(), k) == used.end() && rates[k] > rounding &&
          (best < 0 || rates[k] > rates[best]))
        best = k;
    if (best < 0 || used.size() == 6) break;
    used.push_back(best);
    while (!used.empty()) {
      MatrixXd columns(6, Index(used.size()));
      for (std::size_t i = 0; i < used.size(); ++i) columns.col(Index(i)) = G.col(used[i]);
      const VectorXd whole = columns.colPivHouseholderQr().solve(w);
      double part = 1.;
      for (std::size_t i = 0; i < used.size(); ++i)
        if (whole[Index(i)] <= 0.)
          part = std::min(part, s[used[i]] / (s[used[i]] - whole[Index(i)]));
      std::vector<Index> kept;
      for (std::size_t i = 0; i < used.size(); ++i) {
        double& share = s[used[i]];
        share += part * (whole[Index(i)] - share);
        if (whole[Index(i)] <= 0. && share <= 1e-15)
          share = 0.;
        else
          kept.push_back(used[i]);
      }
      const bool done = kept.size() == used.size();
      used = kept;
      if (done) break;
    }
  }
  return w - G * s;
}

/// The rows of a contact, of unit length, without f_z ≥ 0, which follows from the others.
Eigen::Matrix<double, 16, 6> unitRows(const Contact6D& contact) {
  Eigen::Matrix<double, 16, 6> rows;
  rows << contact.uni_A().bottomRows<4>(), contact.fri_A();
  rows.rowwise().normalize();
  return rows;
}

std::shared_ptr<Contact6D> placed(const Contact6DSettings& settings, const SE3& pose) {
  const auto contact = std::make_shared<Contact6D>(settings);
  contact->updateNewtonEuler(Vector3d::Zero(), pose);
  return contact;
}

SE3 randomPose(Random& random, double y) {
  return {
      Eigen::AngleAxisd(random.uniform(0., 0.6), random.vector3().normalized()).toRotationMatrix(),
      Vector3d(random.uniform(-0.2, 0.2), y, random.uniform(-0.9, -0.7))};
}

}  // namespace

BOOST_AUTO_TEST_CASE(the_rows_are_the_facets_of_what_corners_can_give) {
  // All planes through five of the generators with the others on one side.
  Random random(1);
  for (int trial = 0; trial < 5; ++trial) {
    const Contact6DSettings settings = randomSole(random);
    const Contact6D contact(settings);
    BOOST_TEST(contact.uni_rows() == 5);
    BOOST_TEST(contact.fri_rows() == 12);
    const auto rows = unitRows(contact);
    const Generators G = cornerForces(settings);
    std::array<bool, 16> found = {};
    std::array<Index, 5> k;
    for (k[0] = 0; k[0] < 16; ++k[0])
      for (k[1] = 0; k[1] < k[0]; ++k[1])
        for (k[2] = 0; k[2] < k[1]; ++k[2])
          for (k[3] = 0; k[3] < k[2]; ++k[3])
            for (k[4] = 0; k[4] < k[3]; ++k[4]) {
              Eigen::Matrix<double, 6, 5> five;
              for (Index i = 0; i < 5; ++i) five.col(i) = G.col(k[std::size_t(i)]);
              const Eigen::JacobiSVD<Eigen::Matrix<double, 6, 5>> svd(five, Eigen::ComputeFullU);
              if (svd.singularValues()[4] < 1e-9) continue;
              Vector6 normal = svd.matrixU().col(5);
              const Vector16 sides = G.transpose() * normal;
              if (sides.maxCoeff() > 1e-12 && sides.minCoeff() < -1e-12) continue;
              if (sides.maxCoeff() > 1e-12) normal = -normal;
              Index row = 0;
              const double same = (rows * normal).maxCoeff(&row);
              BOOST_TEST(same > 1. - 1e-12);
              found[std::size_t(row)] = true;
            }
    for (const bool is_found : found) BOOST_TEST(is_found);
  }
}

BOOST_AUTO_TEST_CASE(the_rows_tell_what_corners_can_give) {
  Random random(2);
  long inside = 0, outside = 0;
  double worst_inside = 0., least_outside = 1.;
  for (int trial = 0; trial < 100; ++trial) {
    const Contact6DSettings settings = randomSole(random);
    const auto rows = unitRows(Contact6D(settings));
    const Generators G = cornerForces(settings);
    for (int i = 0; i < 1000; ++i) {
      Vector6 w;
      if (i % 4 < 2) {
        // Pressing anywhere around the sole, with any friction up to a little too much.
        const double mu = pyramidMu(settings);
        const double dx = settings.half_length, dy = settings.half_width;
        w << random.uniform(-1.1, 1.1) * mu, random.uniform(-1.1, 1.1) * mu, 1.,
            random.uniform(-1.1, 1.1) * dy, random.uniform(-1.1, 1.1) * dx,
            random.uniform(-1.1, 1.1) * mu * (dx + dy);
      } else {
        // On a facet, or next to it on either side.
        const Index row = random.integer(0, 15);
        w.setZero();
        for (Index k = 0; k < 16; ++k)
          if (std::abs(rows.row(row).dot(G.col(k))) < 1e-12) w += random.uniform(0., 1.) * G.col(k);
        w.normalize();
        const double distance = std::pow(10., random.uniform(-9., -2.));
        w += (random.coin() ? distance : -distance) * rows.row(row).transpose();
      }
      w.normalize();
      const double beyond = (rows * w).maxCoeff();  // no farther than the distance
      if (std::abs(beyond) < 1e-10) continue;       // rounding decides
      const Vector6 left = leftByCorners(G, w);
      if (beyond < 0.) {
        ++inside;
        worst_inside = std::max(worst_inside, left.norm());
      } else {
        ++outside;
        least_outside = std::min(least_outside, left.norm() / beyond);
        // No sum of corner forces is closer.
        BOOST_TEST((G.transpose() * left).maxCoeff() <= 1e-12 * left.norm() + 1e-15);
      }
    }
  }
  BOOST_TEST_MESSAGE(inside << " inside, " << outside << " outside");
  BOOST_TEST(inside + outside > 99900);
  BOOST_TEST(inside > 30000);
  BOOST_TEST(outside > 30000);
  BOOST_TEST(worst_inside < 1e-12);
  BOOST_TEST(least_outside > 1. - 1e-5);
}

BOOST_AUTO_TEST_CASE(what_soles_reach_their_corners_reach) {
  Random random(3);
  int solved = 0, relaxed = 0;
  for (int trial = 0; trial < 300; ++trial) {
    WrenchDistribution soles, corners;
    std::vector<Contact6DSettings> settings;
    MatrixXd NE(6, 0);
    for (const double y : {0.1, -0.1}) {
      settings.push_back(randomSole(random));
      settings.back().weights = random.vector(6, 0.5, 2.);
      const auto sole = placed(settings.back(), randomPose(random, y));
      soles.add(*sole);
      const Eigen::Matrix2Xd places = sole->getCorners();
      for (Index k = 0; k < 4; ++k) {
        ContactPointSettings point;
        point.mu = settings.back().mu;
        point.friction = settings.back().friction;
        point.frame_name = "corner";
        ContactPoint corner(point);
        corner.updateNewtonEuler(
            Vector3d::Zero(),
            sole->getPose() * SE3(Matrix3d::Identity(), Vector3d(places(0, k), places(1, k), 0.)));
        corners.add(corner);
      }
      NE.conservativeResize(6, NE.cols() + 16);
      NE.rightCols<16>() = sole->ne_A() * cornerForces(settings.back());
    }
    Vector6 wrench = 1000. * NE * random.vector(32, 0., 1.);
    if (trial % 2) wrench += 0.3 * wrench.norm() * random.vector(6);
    const DistributionStatus status = soles.solve(wrench);
    BOOST_TEST((corners.solve(wrench) == status));
    const DistributionResult& result = soles.result();
    (status == DistributionStatus::Solved ? solved : relaxed) += 1;
    BOOST_TEST(close(result.achieved, corners.result().achieved, 1e-8));
    BOOST_TEST(result.isOptimal());
    // Each sole's force is one of its corners.
    for (std::size_t k = 0; k < 2; ++k) {
      const Vector6 force = result.contacts[k].force;
      if (force.norm() < 1e-6 * wrench.norm()) continue;
      const Vector6 left = leftByCorners(cornerForces(settings[k]), force / force.norm());
      BOOST_TEST(left.norm() < 1e-9);
    }
    if (trial % 10) continue;
    const WrenchMargin margin = soles.computeMargin(), other = corners.computeMargin();
    BOOST_TEST(std::abs(margin.margin - other.margin) <= 1e-6 * wrench.norm());
  }
  BOOST_TEST(solved > 100);
  BOOST_TEST(relaxed > 30);
}

BOOST_AUTO_TEST_CASE(they_share_a_wrench_with_pyramids) {
  Random random(4);
  for (int trial = 0; trial < 100; ++trial) {
    Contact6DSettings plain = randomSole(random);
    plain.coupled_yaw = false;
    plain.gu = 0.02;
    WrenchDistribution distribution;
    distribution.add(*placed(plain, randomPose(random, 0.1)));
    distribution.add(*placed(randomSole(random), randomPose(random, -0.1)));
    Vector6 wrench;
    wrench << 100. * random.vector(2), 700., 50. * random.vector(3);
    distribution.solve(wrench);
    BOOST_TEST(distribution.result().isOptimal());
    BOOST_TEST(distribution.computeMargin().margin >= 0.);
  }
}

BOOST_AUTO_TEST_CASE(soles_without_friction_or_extent) {
  Random random(5);
  for (int trial = 0; trial < 64; ++trial) {
    Contact6DSettings settings = randomSole(random);
    if (trial & 1) settings.mu = 0.;
    if (trial & 2) settings.half_length = 0.;
    if (trial & 4) settings.half_width = 0.;
    WrenchDistribution distribution;
    const auto sole = placed(settings, randomPose(random, 0.));
    distribution.add(*sole);
    Vector16 shares = random.vector(16, 0., 100.);
    distribution.solve(sole->ne_A() * (cornerForces(settings) * shares));
    BOOST_TEST((distribution.result().status == DistributionStatus::Solved));
    BOOST_TEST(distribution.result().isOptimal());
    distribution.solve(100. * random.vector(6));
    BOOST_TEST((distribution.result().status == DistributionStatus::Relaxed));
    BOOST_TEST(distribution.result().isOptimal());
  }
}

BOOST_AUTO_TEST_CASE(yaw_usage_is_one_at_the_limit) {
  Random random(6);
  for (int trial = 0; trial < 100; ++trial) {
    const Contact6DSettings settings = randomSole(random);
    Contact6D contact(settings);
    BOOST_TEST(contact.getYawUsage() == 0.);
    // All yaw that there is, without anything sideways.
    const double most = pyramidMu(settings) * (settings.half_length + settings.half_width);
    Vector6 force;
    force << 0., 0., 10., 0., 0., -10. * most;
    contact.applyForce(force);
    BOOST_TEST(close(contact.getYawUsage(), 1.));
    // Half of the corners' forces are as they were, half push straight down.
    force[5] *= 0.5;
    contact.applyForce(force);
    BOOST_TEST(close(contact.getYawUsage(), 0.5));
    // A force at the front that slides to the left turns the sole, without any yaw beyond that.
    force << 0., 1., 10., 0., -10. * settings.half_length, settings.half_length;
    contact.applyForce(force);
    const auto rows = unitRows(contact);
    BOOST_TEST(contact.getYawUsage() <= 1. + 1e-12);
    force[5] += 1e-3;  // but not with more
    contact.applyForce(force);
    BOOST_TEST((contact.getYawUsage() > 1.) == ((rows.bottomRows<8>() * force).maxCoeff() > 0.));
  }
  Contact6DSettings settings = randomSole(random);
  settings.mu = 0.;
  BOOST_TEST(std::isnan(Contact6D(settings).getYawUsage()));
}

BOOST_AUTO_TEST_CASE(settings_that_they_cannot_have) {
  Random random(7);
  const Contact6DSettings good = randomSole(random);
  Contact6DSettings other = good;
  other.coupled_yaw = false;
  BOOST_TEST((other != good));
  BOOST_TEST(mentions(good.to_string(), "coupled_yaw"));
  BOOST_TEST(!mentions(other.to_string(), "coupled_yaw"));
  const auto isRefused = [](const Contact6DSettings& settings, const std::string& got) {
    return throws<std::invalid_argument>([&] { settings.validate(); },
                                         {"Contact6DSettings.coupled_yaw", got});
  };
  other = good;
  other.friction = FrictionModel::Cone;
  BOOST_TEST(isRefused(other, "Cone"));
  other = good;
  other.friction = FrictionModel::Facets;
  BOOST_TEST(isRefused(other, "Facets"));
  other = good;
  other.greatest_normal_force = 1234.;
  BOOST_TEST(isRefused(other, "1234"));
  other = good;
  other.reference[2] = 77.;
  BOOST_TEST(isRefused(other, "77"));
  Contact6D contact(good);
  BOOST_TEST(!contact.getSet());
  BOOST_TEST(contact.isPyramid());
  contact.setMu(0.25);  // the rows follow
  Contact6DSettings changed = good;
  changed.mu = 0.25;
  BOOST_TEST((contact.fri_A() == Contact6D(changed).fri_A()));
}

BOOST_AUTO_TEST_CASE(they_share_no_wrench_with_more_than_pyramids) {
  Random random(8);
  const auto sole = placed(randomSole(random), randomPose(random, 0.1));
  ContactGraspSettings settings;
  settings.lower.setConstant(-10.);
  settings.upper.setConstant(10.);
  settings.frame_name = "hand";
  ContactGrasp hand(settings);
  hand.updateNewtonEuler(Vector3d::Zero(), randomPose(random, -0.1));

  WrenchDistribution distribution;
  distribution.add(*sole);
  BOOST_TEST(throws<std::invalid_argument>([&] { distribution.add(hand); },
                                           {"hand", "more than a pyramid", "slot 0", "matrices"}));
  distribution.add(*sole);  // nothing has changed
  distribution.solve(Vector6::Zero(), 100.);
  BOOST_TEST(distribution.result().contacts.size() == 2u);
  distribution.clear();
  distribution.add(hand);
  BOOST_TEST(throws<std::invalid_argument>([&] { distribution.add(*sole); },
                                           {"foot", "coupled yaw", "slot 0", "pyramid"}));
  BOOST_TEST(throws<std::invalid_argument>(
      [&] { distribution.add(sole->uni_A(), sole->reg_A(), sole->ne_A()); },
      {"A", "matrices alone", "slot 0"}));
}
