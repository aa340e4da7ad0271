// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE motion_linearization
#include <pinocchio/algorithm/joint-configuration.hpp>

#include "dynacom/centroidal.hpp"
#include "dynacom/motion.hpp"
#include "random_robot.hpp"
#include "repair/motion_linearization.hpp"

using namespace dynacom;
using namespace dynacom_tests;
using dynacom::internal::BodyPoint;
using dynacom::internal::LinearizedFrame;
using dynacom::internal::MotionLinearizer;

namespace {

constexpr Index kFrames = 6;

/// A robot that moves somehow, and points on it.
struct Case {
  explicit Case(Random& random)
      : model(randomTree(random, 6)),
        time(kFrames),
        q(model.nq, kFrames),
        points(makePoints(random)),
        linearizer(model, points) {
    const State start = randomState(model, random);
    const VectorXd sway = random.vector(model.nv, 0.05);
    double moment = 0.;
    for (Index k = 0; k < kFrames; ++k) {
      time[k] = moment;
      moment += random.uniform(0.03, 0.05);
      q.col(k) = pinocchio::integrate(
          model, start.q, VectorXd(0.3 * moment * start.v + std::sin(9. * moment) * sway));
    }
  }

  std::vector<BodyPoint> makePoints(Random& random) const {
    std::vector<BodyPoint> made;
    for (int k = 0; k < 3; ++k) {
      const auto joint = static_cast<pinocchio::JointIndex>(random.integer(1, model.njoints - 1));
      made.push_back({joint, random.vector3(), k == 0 ? 0.1 : 0.});
    }
    return made;
  }

  LinearizedFrame linearize(const MatrixXd& configurations, Index frame) {
    LinearizedFrame linear;
    linearizer.linearize(time, configurations, frame, 7, linear);
    return linear;
  }

  /// The configurations, one of which is changed by a small part of a component.
  MatrixXd move(Index frame, Index component, double size) const {
    MatrixXd moved = q;
    moved.col(frame) = pinocchio::integrate(model, VectorXd(q.col(frame)),
                                            VectorXd(size * VectorXd::Unit(model.nv, component)));
    return moved;
  }

  pinocchio::Model model;
  VectorXd time;
  MatrixXd q;
  std::vector<BodyPoint> points;
  MotionLinearizer linearizer;
};

}  // namespace

BOOST_AUTO_TEST_CASE(wrenches_are_those_of_the_derivatives_of_differentiate) {
  Random random(1);
  for (int trial = 0; trial < 20; ++trial) {
    Case some(random);
    const Motion motion = differentiate(some.model, some.time, some.q);
    pinocchio::Data data(some.model);
    for (Index frame = 0; frame < kFrames; ++frame) {
      const LinearizedFrame linear = some.linearize(some.q, frame);
      const CentroidalState state = computeCentroidalState(
          some.model, data, motion.q.col(frame), motion.v.col(frame), motion.a.col(frame));
      const CentroidalWrench wrench =
          computeGroundWrench(state, some.model.gravity.linear(), Vector6::Zero());
      Vector6 expected;
      expected << wrench.force, wrench.torque;
      BOOST_TEST(close(linear.wrench, expected / (state.mass * 9.81), 1e-9));
      BOOST_TEST(close(linear.com, state.com, 1e-12));
    }
  }
}

BOOST_AUTO_TEST_CASE(what_slides_is_told_from_what_turns) {
  pinocchio::Model model = singleBody(1., {});
  pinocchio::JointModelComposite both{pinocchio::JointModelRX()};
  both.addJoint(pinocchio::JointModelPZ());
  model.addJoint(1, pinocchio::JointModelPlanar(), SE3::Identity(), "planar");
  model.addJoint(1, pinocchio::JointModelTranslation(), SE3::Identity(), "translation");
  model.addJoint(1, pinocchio::JointModelPY(), SE3::Identity(), "slide");
  model.addJoint(1, both, SE3::Identity(), "both");
  Eigen::Array<bool, Eigen::Dynamic, 1> expected(6 + 3 + 3 + 1 + 2);
  expected << 1, 1, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1;
  BOOST_TEST((internal::findSliding(model) == expected).all());
}

BOOST_AUTO_TEST_CASE(derivatives_are_those_of_finite_differences) {
  Random random(2);
  const double size = 1e-5;
  for (int trial = 0; trial < 10; ++trial) {
    Case some(random);
    for (const Index frame : {Index(0), Index(2), kFrames - 1}) {
      const LinearizedFrame linear = some.linearize(some.q, frame);
      const auto [low, high] = MotionLinearizer::findReach(frame, kFrames);
      BOOST_TEST(linear.terms.front().frame == low);
      BOOST_TEST(linear.terms.back().frame == high);
      for (const LinearizedFrame::Term& term : linear.terms)
        for (Index k = 0; k < some.model.nv; ++k) {
          const LinearizedFrame more = some.linearize(some.move(term.frame, k, size), frame);
          const LinearizedFrame less = some.linearize(some.move(term.frame, k, -size), frame);
          BOOST_TEST(
              close((more.wrench - less.wrench) / (2. * size), term.derivative.col(k), 1e-5));
          if (term.frame != frame) continue;
          BOOST_TEST(close((more.com - less.com) / (2. * size), linear.of_com.col(k), 1e-7));
          for (Index point = 0; point < 3; ++point)
            BOOST_TEST(close((more.points.col(point) - less.points.col(point)) / (2. * size),
                             some.linearizer.findPointJacobian(linear, point).col(k), 1e-7));
        }
    }
  }
}
