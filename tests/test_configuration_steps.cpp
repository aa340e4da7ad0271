// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE configuration_steps
#include <pinocchio/algorithm/joint-configuration.hpp>

#include "configuration_steps.hpp"
#include "random_robot.hpp"

using namespace dynacom_tests;
using dynacom::internal::ConfigurationSteps;

namespace {

void check(const pinocchio::Model& model, Random& random) {
  const Index frames = 7;
  MatrixXd q(model.nq, frames);
  for (Index frame = 0; frame < frames; ++frame) q.col(frame) = randomState(model, random, 0.7).q;
  const MatrixXd steps = ConfigurationSteps(model).compute(q);
  BOOST_REQUIRE(steps.rows() == model.nv);
  BOOST_REQUIRE(steps.cols() == frames - 1);
  for (Index frame = 0; frame + 1 < frames; ++frame) {
    VectorXd expected(model.nv);
    pinocchio::difference(model, q.col(frame), q.col(frame + 1), expected);
    BOOST_TEST(close(steps.col(frame), expected));
  }
}

}  // namespace

BOOST_AUTO_TEST_CASE(steps_are_those_of_pinocchio) {
  Random random(1);
  for (int trial = 0; trial < 20; ++trial) check(randomTree(random), random);
}

BOOST_AUTO_TEST_CASE(joints_of_every_kind_are_known) {
  using namespace pinocchio;
  JointModelComposite composite(2);
  composite.addJoint(JointModelSpherical());
  composite.addJoint(JointModelRUBX());
  const std::vector<JointModel> kinds = {JointModelRX(),        JointModelRUBY(),
                                         JointModelPZ(),        JointModelFreeFlyer(),
                                         JointModelSpherical(), JointModelSphericalZYX(),
                                         JointModelPlanar(),    JointModelTranslation(),
                                         JointModelHX(),        composite,
                                         JointModelRUBX()};
  Random random(2);
  // Each between two of one number, which are no neighbours then.
  for (const JointModel& kind : kinds) BOOST_TEST_CONTEXT(kind.shortname()) {
      pinocchio::Model model;
      auto joint = model.addJoint(0, JointModelRY(), SE3::Identity(), "first");
      joint = model.addJoint(joint, kind, SE3::Identity(), "kind");
      model.addJoint(joint, JointModelPX(), SE3::Identity(), "last");
      check(model, random);
    }
}

BOOST_AUTO_TEST_CASE(without_a_next_there_is_no_step) {
  Random random(3);
  const auto model = randomTree(random);
  for (const Index frames : {0, 1})
    BOOST_TEST(ConfigurationSteps(model).compute(restState(model).q.replicate(1, frames)).cols() ==
               0);
}
