// SPDX-License-Identifier: BSD-2-Clause
#include "random_robot.hpp"

#include <cstdlib>
#include <pinocchio/algorithm/center-of-mass.hpp>
#include <pinocchio/algorithm/centroidal.hpp>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody/sample-models.hpp>

namespace dynacom_tests {

namespace {

pinocchio::Inertia randomInertia(Random& random) {
  // That of an ellipsoid, somewhere in the joint's frame.
  const double mass = random.uniform(0.5, 5.);
  const Vector3d axes = random.vector(3, 0.05, 0.3);
  const auto ellipsoid = pinocchio::Inertia::FromEllipsoid(mass, axes.x(), axes.y(), axes.z());
  return ellipsoid.se3Action(random.placement(0.3));
}

pinocchio::JointModel randomJoint(Random& random) {
  const Vector3d axis = random.rotation().col(0);
  switch (random.integer(0, 7)) {
    case 0:
      return pinocchio::JointModelRX();
    case 1:
      return pinocchio::JointModelRY();
    case 2:
      return pinocchio::JointModelRevoluteUnaligned(axis);
    case 3:
      return pinocchio::JointModelPZ();
    case 4:
      return pinocchio::JointModelPrismaticUnaligned(axis);
    case 5:
      return pinocchio::JointModelSpherical();
    case 6:
      return pinocchio::JointModelRUBZ();
    default:
      return pinocchio::JointModelPlanar();
  }
}

void addSole(pinocchio::Model& model, int index, pinocchio::JointIndex joint, const SE3& oMs) {
  // The placement holds in the neutral configuration.
  pinocchio::Data data(model);
  pinocchio::forwardKinematics(model, data, pinocchio::neutral(model));
  model.addFrame(pinocchio::Frame("sole" + std::to_string(index), joint,
                                  data.oMi[joint].actInv(oMs), pinocchio::OP_FRAME));
}

}  // namespace

pinocchio::Model randomTree(Random& random, int joints) {
  pinocchio::Model model;
  auto joint = model.addJoint(0, pinocchio::JointModelFreeFlyer(), SE3::Identity(), "root_joint");
  model.appendBodyToJoint(joint, randomInertia(random), SE3::Identity());
  for (int i = 1; i <= joints; ++i) {
    const auto parent = static_cast<pinocchio::JointIndex>(random.integer(1, i));
    joint = model.addJoint(parent, randomJoint(random), random.placement(0.5),
                           "joint" + std::to_string(i));
    model.appendBodyToJoint(joint, randomInertia(random), SE3::Identity());
    model.addJointFrame(joint);
  }
  return model;
}

pinocchio::Model randomHumanoid(unsigned seed) {
  std::srand(seed);
  pinocchio::Model model;
  pinocchio::buildModels::humanoidRandom(model, true);
  return model;
}

pinocchio::Model standingRobot(Random& random, const std::vector<SE3>& soles) {
  pinocchio::Model model = randomTree(random, std::max<int>(6, soles.size()));
  const Vector3d com = comOf(model, pinocchio::neutral(model));
  const Vector3d projection(com.x(), com.y(), 0.);
  // Lift all joints but the root, and with them the CoM: in the neutral configuration the root is
  // at the origin, and legs of about 0.8 m reach down to the plane z = 0.
  for (pinocchio::JointIndex joint = 2; joint < static_cast<std::size_t>(model.njoints); ++joint)
    if (model.parents[joint] == 1) model.jointPlacements[joint].translation().z() += 0.8;
  for (std::size_t i = 0; i < soles.size(); ++i)
    addSole(model, static_cast<int>(i), i + 1,
            SE3(soles[i].rotation(), projection + soles[i].translation()));
  return model;
}

std::vector<SE3> stance(int n) {
  std::vector<SE3> soles;
  const int pairs = (n + 1) / 2;
  for (int i = 0; i < n; ++i) {
    const double forward = pairs == 1 ? 0. : 0.4 * (2. * (i / 2) / (pairs - 1) - 1.);
    soles.emplace_back(Matrix3d::Identity(), Vector3d(forward, i % 2 == 0 ? 0.15 : -0.15, 0.));
  }
  return soles;
}

pinocchio::Model singleBody(double mass, const std::vector<SE3>& soles) {
  pinocchio::Model model;
  const auto joint =
      model.addJoint(0, pinocchio::JointModelFreeFlyer(), SE3::Identity(), "root_joint");
  model.appendBodyToJoint(joint, pinocchio::Inertia::FromSphere(mass, 0.2), SE3::Identity());
  for (std::size_t i = 0; i < soles.size(); ++i)
    addSole(model, static_cast<int>(i), joint, soles[i]);
  return model;
}

State randomState(const pinocchio::Model& model, Random& random, double scale) {
  return {pinocchio::integrate(model, pinocchio::neutral(model), random.vector(model.nv, scale)),
          random.vector(model.nv, scale), random.vector(model.nv, scale)};
}

States randomStates(const pinocchio::Model& model, Random& random, Index frames, double scale) {
  States states = {MatrixXd(model.nq, frames), MatrixXd(model.nv, frames),
                   MatrixXd(model.nv, frames)};
  for (Index frame = 0; frame < frames; ++frame) {
    const State state = randomState(model, random, scale);
    states.q.col(frame) = state.q;
    states.v.col(frame) = state.v;
    states.a.col(frame) = state.a;
  }
  return states;
}

State restState(const pinocchio::Model& model) {
  return {pinocchio::neutral(model), VectorXd::Zero(model.nv), VectorXd::Zero(model.nv)};
}

Vector3d comOf(const pinocchio::Model& model, const VectorXd& q) {
  pinocchio::Data data(model);
  return pinocchio::centerOfMass(model, data, q);
}

SE3 framePlacement(const pinocchio::Model& model, const VectorXd& q, const std::string& frame) {
  pinocchio::Data data(model);
  pinocchio::framesForwardKinematics(model, data, q);
  return data.oMf[model.getFrameId(frame)];
}

double totalMass(const pinocchio::Model& model) {
  double mass = 0.;
  for (const auto& inertia : model.inertias) mass += inertia.mass();
  return mass;
}

Vector6 rootWrench(const pinocchio::Model& model, const State& state) {
  return rootWrench(model, state,
                    std::vector<pinocchio::Force>(static_cast<std::size_t>(model.njoints),
                                                  pinocchio::Force::Zero()));
}

Vector6 rootWrench(const pinocchio::Model& model, const State& state,
                   const std::vector<pinocchio::Force>& external) {
  pinocchio::Data data(model);
  const VectorXd& tau = pinocchio::rnea(model, data, state.q, state.v, state.a, external);
  const pinocchio::Force root(tau.head<6>());
  pinocchio::forwardKinematics(model, data, state.q);
  SE3 cM1 = data.oMi[1];
  cM1.translation() -= comOf(model, state.q);
  return cM1.act(root).toVector();
}

Vector6 momentum(const pinocchio::Model& model, const VectorXd& q, const VectorXd& v) {
  pinocchio::Data data(model);
  pinocchio::forwardKinematics(model, data, q, v);
  pinocchio::Force sum = pinocchio::Force::Zero();
  for (pinocchio::JointIndex joint = 1; joint < static_cast<std::size_t>(model.njoints); ++joint)
    sum += data.oMi[joint].act(model.inertias[joint] * data.v[joint]);
  const SE3 cMo(Matrix3d::Identity(), -comOf(model, q));
  return cMo.act(sum).toVector();
}

VectorXd moved(const pinocchio::Model& model, const VectorXd& q, const VectorXd& v) {
  return pinocchio::integrate(model, q, v);
}

void runForwardKinematics(const pinocchio::Model& model, pinocchio::Data& data, const VectorXd& q) {
  pinocchio::forwardKinematics(model, data, q);
}

void runFramesForwardKinematics(const pinocchio::Model& model, pinocchio::Data& data,
                                const VectorXd& q) {
  pinocchio::framesForwardKinematics(model, data, q);
}

void runCentroidalDynamics(const pinocchio::Model& model, pinocchio::Data& data,
                           const State& state) {
  pinocchio::computeCentroidalMomentumTimeVariation(model, data, state.q, state.v, state.a);
}

}  // namespace dynacom_tests
