// SPDX-License-Identifier: BSD-2-Clause
#include "robots.hpp"

#include <cmath>
#include <dynacom/contact6d.hpp>
#include <dynacom/contact_point.hpp>
#include <dynacom/contact_polygon.hpp>
#include <functional>
#include <stdexcept>

namespace dynacom::benchmarks {
namespace {

constexpr double kPi = 3.14159265358979323846;

using MakeContact = std::function<std::shared_ptr<ContactBase>(const std::string& frame)>;

MakeContact makeSole(FrictionModel friction = FrictionModel::OuterPyramid) {
  return [friction](const std::string& frame) {
    Contact6DSettings sole;
    sole.friction = friction;
    sole.mu = kFriction;
    sole.gu = kYawFriction;
    sole.half_length = kHalfLength;
    sole.half_width = kHalfWidth;
    sole.frame_name = frame;
    return std::make_shared<Contact6D>(sole);
  };
}

std::shared_ptr<ContactBase> makeOctagon(const std::string& frame) {
  constexpr double kCut = 0.02, length = kHalfLength, width = kHalfWidth;
  ContactPolygonSettings sole;
  sole.mu = kFriction;
  sole.gu = kYawFriction;
  sole.vertices.resize(2, 8);
  sole.vertices << length, length - kCut, kCut - length, -length, -length, kCut - length,
      length - kCut, length,  //
      width - kCut, width, width, width - kCut, kCut - width, -width, -width, kCut - width;
  sole.frame_name = frame;
  return std::make_shared<ContactPolygon>(sole);
}

MakeContact makePoint(FrictionModel friction = FrictionModel::OuterPyramid) {
  return [friction](const std::string& frame) {
    ContactPointSettings point;
    point.mu = kFriction;
    point.friction = friction;
    point.frame_name = frame;
    return std::make_shared<ContactPoint>(point);
  };
}

DynaCoM makeTalosOn(const MakeContact& makeContact) {
  DynaCoMSettings settings;
  settings.urdf = DYNACOM_TALOS_URDF;
  DynaCoM talos(settings);
  for (const char* side : {"left", "right"})
    talos.addContact(makeContact(std::string("leg_") + side + "_sole_fix_joint"), side);
  return talos;
}

DynaCoM makeTrunk(const std::vector<Eigen::Vector3d>& feet, const MakeContact& makeContact) {
  pinocchio::Model model;
  const auto trunk =
      model.addJoint(0, pinocchio::JointModelFreeFlyer(), pinocchio::SE3::Identity(), "trunk");
  model.appendBodyToJoint(trunk, pinocchio::Inertia::FromBox(50., 0.9, 0.4, 0.3));
  std::vector<std::string> names;
  for (const Eigen::Vector3d& foot : feet) {
    names.push_back("foot" + std::to_string(names.size() + 1));
    model.addFrame(pinocchio::Frame(names.back(), trunk,
                                    pinocchio::SE3(Eigen::Matrix3d::Identity(), foot),
                                    pinocchio::OP_FRAME));
  }
  DynaCoM robot(model);
  for (const std::string& name : names) robot.addContact(makeContact(name), name);
  return robot;
}

// Places around the trunk, not so regular that a solver could profit from it.
std::vector<Eigen::Vector3d> around(int number) {
  std::vector<Eigen::Vector3d> feet;
  for (int foot = 0; foot < number; ++foot) {
    const double angle = 2. * kPi * (foot + 0.2 * std::sin(3. * foot)) / number;
    const double stride = 1. + 0.15 * std::cos(5. * foot);
    feet.emplace_back(0.45 * stride * std::cos(angle), 0.30 * stride * std::sin(angle), -0.5);
  }
  return feet;
}

}  // namespace

DynaCoM makeTalos(FrictionModel friction) { return makeTalosOn(makeSole(friction)); }

DynaCoM makeTalosOnOctagons() { return makeTalosOn(makeOctagon); }

DynaCoM makeG1() {
  DynaCoMSettings settings;
  settings.urdf = DYNACOM_G1_URDF;
  pinocchio::Model model = DynaCoM(settings).getModel();
  const std::string sides[] = {"left", "right"};
  const pinocchio::SE3 placement(Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.035, 0., -0.035));
  for (const std::string& side : sides) {
    const pinocchio::Frame ankle = model.frames[model.getFrameId(side + "_ankle_roll_link")];
    model.addFrame(pinocchio::Frame(side + "_sole", ankle.parentJoint, ankle.placement * placement,
                                    pinocchio::OP_FRAME));
  }
  DynaCoM g1(model);
  Contact6DSettings sole;
  sole.mu = 0.7;
  sole.gu = 0.06;
  sole.half_length = 0.085;
  sole.half_width = 0.025;
  for (const std::string& side : sides) {
    sole.frame_name = side + "_sole";
    g1.addContact(std::make_shared<Contact6D>(sole), sole.frame_name);
  }
  return g1;
}

DynaCoM makeQuadruped(FrictionModel friction) {
  return makeTrunk(
      {{0.42, 0.22, -0.5}, {0.30, -0.20, -0.5}, {-0.33, 0.20, -0.5}, {-0.38, -0.21, -0.5}},
      makePoint(friction));
}

DynaCoM makePoints(int number) { return makeTrunk(around(number), makePoint()); }

DynaCoM makeSoles(int number) { return makeTrunk(around(number), makeSole()); }

Wrench groundWrench(const DynaCoM& robot) {
  Wrench wrench;
  wrench << robot.getGroundCoMForce(), robot.getGroundCoMTorque();
  return wrench;
}

QuadraticProgram makeProgram(const DynaCoM& robot) {
  QuadraticProgram program;
  program.H = robot.reg_A().cwiseAbs2().asDiagonal();
  program.CE = robot.ne_A();
  program.ce0 = -robot.ne_b();
  const Eigen::MatrixXd U = robot.uni_A(), C = robot.fri_A();
  program.CI.resize(U.rows() + C.rows(), U.cols());
  program.CI << -U, -C;
  return program;
}

void requireSameForces(const DynaCoM& robot, const Eigen::VectorXd& forces) {
  if (!forces.isApprox(robot.allForces(), 1e-6))
    throw std::logic_error("the reference's forces differ");
}

}  // namespace dynacom::benchmarks
