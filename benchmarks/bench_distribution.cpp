// SPDX-License-Identifier: BSD-2-Clause
// What does distributeForce cost beside general solvers? These are given the same problem, with all
// matrices prepared beforehand; distributeForce has to place the contacts and prepare them each
// time. Where the wrench is out of reach they have no answer: there a feasible problem of the same
// contacts is what they are given. What exact cones and polygons cost is measured against pyramids
// and rectangles.
//
// Each wrench comes with neighbours, and all solvers go round them: that one problem is solved
// again and again, with all branches predicted, would say little about a controller, and nothing
// about a warm start.
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

#include "cases.hpp"
#include "robots.hpp"

namespace dynacom::benchmarks {
namespace {

constexpr int kNeighbours = 8;

// A wrench for a robot whose computeDynamics() was called, at rest. The angle goes round the
// neighbours, from 0 to 2π.
using MakeWrench = std::function<Wrench(const DynaCoM& robot, double angle)>;

// What is asked of which robot's contacts.
struct Task {
  std::string name;
  std::function<DynaCoM()> makeRobot;
  MakeWrench makeWrench;
  int active = -1;  // how many inequalities are, if it matters
  DistributionStatus status = DistributionStatus::Solved;
  bool steps = false;  // whether the last foot is lifted for every other wrench
};

// Standing still, but for a force and a moment from outside.
MakeWrench pushed(double fx, double fy, double fz, double mx, double my, double mz) {
  return [=](const DynaCoM& robot, double angle) {
    Wrench push, change;
    push << fx, fy, fz, mx, my, mz;
    change << 3. * std::sin(angle), 3. * std::cos(angle), 1.5 * std::sin(2. * angle),
        0.6 * std::cos(angle), 0.6 * std::sin(angle), 0.6 * std::sin(3. * angle);
    return Wrench(groundWrench(robot) - push - change);
  };
}

// The sum of what contacts can give: the i-th of them the force of that number.
Wrench sumOfForces(const DynaCoM& robot, const std::function<Wrench(int)>& makeForce) {
  Wrench wrench = Wrench::Zero();
  int number = 0;
  for (const std::string& name : robot.getActiveContacts()) {
    const ContactBase& contact = *robot.getContact(name);
    wrench += contact.ne_A() * makeForce(number++).head(contact.cols());
  }
  return wrench;
}

// On the boundary of what the contacts can give: all of them push as far along x as friction holds,
// the second with twice the load of the first, and so on. In each, the other components are the
// same share of their limits: 1 is the corner of a cone, where two sides of the friction pyramid,
// two edges of a sole and its yaw friction meet.
MakeWrench onBoundary(const std::vector<double>& shares) {
  return [shares](const DynaCoM& robot, double angle) {
    return sumOfForces(robot, [&](int number) {
      Wrench force;
      force << 0., kFriction, 0., kHalfWidth, kHalfLength, kYawFriction;
      force *= shares[number];
      force[0] = kFriction;
      force[2] = 1.;
      return Wrench((100. * (number + 1) + 5. * std::sin(angle + number)) * force);
    });
  };
}

// Each contact carries its share of the weight, and leans a little.
Wrench carried(const DynaCoM& robot, double angle) {
  const double share = groundWrench(robot)[2] / double(robot.getActiveContacts().size());
  return sumOfForces(robot, [=](int number) {
    Wrench force = Wrench::Zero();
    force.head<3>() << 0.02 * std::cos(angle), 0.02 * std::sin(angle),
        1. + 0.02 * std::sin(angle + number);
    return Wrench(share * force);
  });
}

// Leaning so far forward that the centre of pressure would have to be 3 cm in front of all feet.
Wrench leaning(const DynaCoM& robot, double angle) {
  double front = -std::numeric_limits<double>::infinity();
  for (const std::string& name : robot.getActiveContacts()) {
    const ContactBase& contact = *robot.getContact(name);
    const pinocchio::SE3 pose = contact.getSurfacePose();
    const Eigen::Matrix2Xd corners = contact.getCorners();
    for (const Eigen::Vector2d corner : corners.colwise())
      front = std::max(front, pose.act(Eigen::Vector3d(corner[0], corner[1], 0.)).x());
  }
  Wrench wrench = pushed(0., 0., 0., 0., 0., 0.)(robot, angle);
  wrench[4] -= (front + 0.03 - robot.getCoM().x()) * wrench[2];
  return wrench;
}

// Inequalities that hold forces back; where contacts are no pyramids, which have no multipliers,
// the friction cones, edges and yaw frictions that forces are at the limit of.
int countActive(const DynaCoM& robot) {
  const DistributionResult& distribution = robot.getDistribution();
  const std::vector<std::string>& names = robot.getActiveContacts();
  int active = 0;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const DistributionResult::Contact& solved = distribution.contacts[i];
    const ContactBase& contact = *robot.getContact(names[i]);
    active += int((solved.multipliers.array() > 1e-9 * distribution.scale).count());
    if (solved.set)
      active += int(contact.getFrictionUsage() > 1. - 1e-9) +
                int(contact.getYawUsage() > 1. - 1e-9) + int(contact.getCoPMargin() < 1e-9);
  }
  return active;
}

// A robot, its wrenches, and the same as quadratic programs.
class Problem {
 public:
  Problem(const Task& task, bool warmStart) : steps_(task.steps), robot_(task.makeRobot()) {
    robot_.setWarmStart(warmStart);
    const pinocchio::Model& model = robot_.getModel();
    const Eigen::VectorXd rest = Eigen::VectorXd::Zero(model.nv);
    robot_.computeDynamics(pinocchio::neutral(model), rest, rest);
    foot_ = robot_.getActiveContacts().back();
    for (int i = 0; i < kNeighbours; ++i) {
      if (steps_) step(i);
      wrenches_.push_back(task.makeWrench(robot_, 2. * std::acos(-1.) * i / kNeighbours));
      if (distribute(robot_, wrenches_.back()) != task.status ||
          (task.active >= 0 && countActive(robot_) != task.active))
        throw std::logic_error("a wrench of '" + task.name + "' is not what it was chosen for");
      programs_.push_back(makeProgram(robot_));
    }
  }

  // distributeForce for the next wrench.
  void solve() {
    if (steps_) step(next_);
    distribute(robot_, wrenches_[next_]);
    next_ = (next_ + 1) % kNeighbours;
  }

  // The same by a general solver, to be called again and again.
  std::function<void()> makeReference(const std::string& peer) {
    std::vector<std::shared_ptr<Peer>> solvers;  // one for all, or one with each foot
    for (int i = 0; i < kNeighbours; ++i) {
      if (i < (steps_ ? 2 : 1)) {
        solvers.push_back(makePeer(peer));
        solvers.back()->prepare(programs_[i]);
      }
      solve();
      requireSameForces(robot_, solvers[i % solvers.size()]->solve(programs_[i].ce0));
    }
    return [programs = programs_, solvers, next = 0]() mutable {
      solvers[next % solvers.size()]->solve(programs[next].ce0);
      next = (next + 1) % kNeighbours;
    };
  }

 private:
  void step(int number) {
    if (number % 2)
      robot_.deactivateContact(foot_);
    else
      robot_.activateContact(foot_);
  }

  bool steps_;
  DynaCoM robot_;
  std::string foot_;
  std::vector<Wrench> wrenches_;
  std::vector<QuadraticProgram> programs_;
  int next_ = 0;
};

// @param reference  the case that it is measured against
// @param against    what the name says of that
Case ours(const Task& task, bool warmStart, const std::string& against,
          const std::string& reference) {
  const auto prepare = [task, warmStart] {
    const auto problem = std::make_shared<Problem>(task, warmStart);
    return [problem] { problem->solve(); };
  };
  return {"distributeForce/" + task.name + (warmStart ? "/warm" : "") + "/vs_" + against, prepare,
          reference};
}

const std::string kFast = "eiquadprog/fast";

// The last word of eiquadprog's variants, else all: fast, DAQP_feet.
std::string shorten(std::string peer) {
  if (peer.rfind("eiquadprog/", 0) == 0) return peer.substr(peer.find('/') + 1);
  std::replace(peer.begin(), peer.end(), '/', '_');
  return peer;
}

// A wrench for each solver, and for distributeForce once for every solver it is measured against;
// with a warm start against eiquadprog's fast one only.
void addSolved(std::vector<Case>& cases, const Task& task,
               const std::vector<std::string>& peers = {kFast}) {
  for (const std::string& peer : peers) {
    if (!hasPeer(peer)) continue;
    const std::string name = peer + "/" + task.name;
    cases.push_back({name, [task, peer] { return Problem(task, false).makeReference(peer); }});
    cases.push_back(ours(task, false, shorten(peer), name));
  }
  cases.push_back(ours(task, true, "fast", kFast + "/" + task.name));
}

// A wrench for which eiquadprog has no answer, against another one that it has one for.
void addUnequal(std::vector<Case>& cases, const Task& task, const std::string& reference) {
  for (const bool warmStart : {false, true})
    cases.push_back(ours(task, warmStart, "fast", kFast + "/" + reference));
}

// One that is out of reach, against one that is hard for eiquadprog and, cold, an easy one.
void addRelaxed(std::vector<Case>& cases, Task task, const std::string& hard,
                const std::string& easy) {
  task.status = DistributionStatus::Relaxed;
  addUnequal(cases, task, hard);
  cases.push_back(ours(task, false, "fast_inside", kFast + "/" + easy));
}

// The same of other contacts, against that of rectangles or points with pyramids.
void addOther(std::vector<Case>& cases, const Task& task, const std::string& pyramids) {
  cases.push_back(ours(task, false, "pyramids", "distributeForce/" + pyramids + "/vs_fast"));
}

// Reading a robot takes long: it is done once, where the robot is wanted at all.
std::function<DynaCoM()> once(const std::function<DynaCoM()>& makeRobot) {
  return [makeRobot, robot = std::make_shared<std::optional<DynaCoM>>()] {
    if (!*robot) *robot = makeRobot();
    return **robot;
  };
}

}  // namespace

std::vector<Case> makeCases() {
  const auto talos = once([] { return makeTalos(); }),
             quadruped = once([] { return makeQuadruped(); }),
             talos_cones = once([] { return makeTalos(FrictionModel::Cone); }),
             quadruped_cones = once([] { return makeQuadruped(FrictionModel::Cone); }),
             octagons = once(makeTalosOnOctagons);
  const std::vector<std::string> two = {kFast, "DAQP/feet"},
                                 all = {"eiquadprog/plain", kFast,       "eiquadprog/rt",
                                        "DAQP/wrench",      "DAQP/feet", "PIQP/wrench",
                                        "ProxQP/wrench"};
  const MakeWrench still = pushed(0., 0., 0., 0., 0., 0.),
                   edge = pushed(120., -60., 0., 10., 40., 30.),
                   active4 = pushed(60., -60., 0., 20., 30., 60.),
                   slipping = pushed(800., 300., 0., 0., 0., 0.),
                   tipping = pushed(0., 0., 0., 100., 200., 0.),
                   points_slipping = pushed(500., 200., 0., 0., 0., 0.),
                   points_tipping = pushed(0., 0., 0., 200., 300., 0.),
                   pyramid = onBoundary({0.4, -0.6, 0.6, -0.8}),
                   corner = onBoundary({1., 1., 1., 1.});
  std::vector<Case> cases;

  // Well inside what the contacts can give, and where inequalities are active.
  addSolved(cases, {"soles/inside", talos, still, 0}, all);
  addSolved(cases, {"soles/active2", talos, pushed(-10., 50., 0., -10., -10., 0.), 2}, two);
  addSolved(cases, {"soles/active3", talos, pushed(-80., 90., -10., 0., 10., 0.), 3}, two);
  addSolved(cases, {"soles/active4", talos, active4, 4}, all);
  addSolved(cases, {"soles/active5", talos, pushed(0., 140., -40., 0., -10., 10.), 5}, two);
  addSolved(cases, {"soles/active6", talos, pushed(80., 130., 30., 0., 0., -20.), 6}, two);
  addSolved(cases, {"soles/pyramid", talos, pyramid});
  addSolved(cases, {"soles/corner", talos, corner});
  addSolved(cases, {"points/inside", quadruped, still, 0}, two);
  addSolved(cases, {"points/edge", quadruped, edge});
  addSolved(cases, {"points/pyramid", quadruped, pyramid});
  addSolved(cases, {"points/corner", quadruped, corner});

  // A foot is lifted or put down in each tick.
  for (const auto& [name, robot] : {std::pair("soles/step", talos), {"points/step", quadruped}}) {
    Task task = {name, robot, carried};
    task.steps = true;
    addSolved(cases, task);
  }

  // More than friction holds, more than the weight holds down, and as much as lifts the robot.
  addRelaxed(cases, {"soles/slipping", talos, slipping}, "soles/active4", "soles/inside");
  addRelaxed(cases, {"soles/tipping", talos, tipping}, "soles/active4", "soles/inside");
  addRelaxed(cases, {"soles/lifted", talos, pushed(50., 0., 2000., 0., 0., 0.)}, "soles/active4",
             "soles/inside");
  addRelaxed(cases, {"points/slipping", quadruped, points_slipping}, "points/edge",
             "points/inside");
  addRelaxed(cases, {"points/tipping", quadruped, points_tipping}, "points/edge", "points/inside");
  addRelaxed(cases, {"points/lifted", quadruped, pushed(50., 0., 1000., 0., 0., 0.)}, "points/edge",
             "points/inside");

  // Exact cones, and polygons.
  const auto relaxed = DistributionStatus::Relaxed;
  addOther(cases, {"soles_cones/inside", talos_cones, still, 0}, "soles/inside");
  addOther(cases, {"soles_cones/limit", talos_cones, active4, 3}, "soles/active4");
  addOther(cases, {"soles_cones/slipping", talos_cones, slipping, -1, relaxed}, "soles/slipping");
  addOther(cases, {"soles_cones/tipping", talos_cones, tipping, -1, relaxed}, "soles/tipping");
  addOther(cases, {"points_cones/inside", quadruped_cones, still, 0}, "points/inside");
  addOther(cases, {"points_cones/limit", quadruped_cones, edge}, "points/edge");
  addOther(cases, {"points_cones/slipping", quadruped_cones, points_slipping, -1, relaxed},
           "points/slipping");
  addOther(cases, {"points_cones/tipping", quadruped_cones, points_tipping, -1, relaxed},
           "points/tipping");
  addOther(cases, {"octagons/inside", octagons, still, 0}, "soles/inside");
  addOther(cases, {"octagons/active", octagons, active4, 3}, "soles/active4");

  // Out of reach by centimetres.
  addUnequal(cases, {"soles/leaning", talos, leaning, -1, relaxed}, "soles/active4");
  addUnequal(cases, {"points8/leaning", [] { return makePoints(8); }, leaning, -1, relaxed},
             "points8/inside");

  // Growth with the number of contacts. One point or two cannot give every wrench, which leaves
  // eiquadprog with equations that depend on each other, and without an answer.
  for (const int number : {1, 2, 3, 4, 6, 8, 10, 12, 14, 16}) {
    const std::string size = std::to_string(number) + "/inside";
    const Task points = {"points" + size, [number] { return makePoints(number); }, carried, 0};
    if (number < 3)
      addUnequal(cases, points, "points3/inside");
    else
      addSolved(cases, points);
    addSolved(cases, {"soles" + size, [number] { return makeSoles(number); }, carried, 0});
  }
  return cases;
}

}  // namespace dynacom::benchmarks
