// SPDX-License-Identifier: BSD-2-Clause
// What does distributeForce cost beside general solvers? These are given the same problem, with all
// matrices prepared beforehand; distributeForce has to place the contacts and prepare them each
// time. Where the wrench is out of reach they have no answer: there a feasible problem of the same
// contacts is what they are given.
#include <benchmark/benchmark.h>

#include <eiquadprog/eiquadprog-fast.hpp>
#include <eiquadprog/eiquadprog-rt.hpp>
#include <eiquadprog/eiquadprog.hpp>
#include <functional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "robots.hpp"

namespace {

using dynacom::DistributionStatus;
using dynacom::DynaCoM;
using dynacom::benchmarks::kFriction, dynacom::benchmarks::kYawFriction;
using dynacom::benchmarks::kHalfLength, dynacom::benchmarks::kHalfWidth;
using dynacom::benchmarks::makeQuadruped, dynacom::benchmarks::makeTalos;
using Wrench = Eigen::Matrix<double, 6, 1>;

constexpr int kForces = 12, kEqualities = 6, kSoleInequalities = 22;

// A wrench about the CoM of a robot whose computeDynamics() was called, at rest.
using MakeWrench = std::function<Wrench(const DynaCoM&)>;

// What is asked of which robot's contacts.
struct Task {
  std::string name;
  DynaCoM (*makeRobot)();
  MakeWrench makeWrench;
  DistributionStatus status = DistributionStatus::Solved;
};

// Standing still, but for a force and a moment from outside.
MakeWrench pushed(double fx, double fy, double fz, double mx, double my, double mz) {
  return [=](const DynaCoM& robot) {
    Wrench wrench, push;
    wrench << robot.getGroundCoMForce(), robot.getGroundCoMTorque();
    push << fx, fy, fz, mx, my, mz;
    return Wrench(wrench - push);
  };
}

// On the boundary of what the contacts can give: all of them push as far along x as friction holds,
// the second with twice the load of the first, and so on. In each, the other components are the
// same share of their limits: 1 is the corner of a cone, where two sides of the friction pyramid,
// two edges of a sole and its yaw friction meet.
MakeWrench onBoundary(const std::vector<double>& shares) {
  return [shares](const DynaCoM& robot) {
    Wrench wrench = Wrench::Zero();
    double load = 0.;
    auto share = shares.begin();
    for (const std::string& name : robot.getActiveContacts()) {
      const dynacom::ContactBase& contact = *robot.getContact(name);
      Wrench force;
      force << 0., kFriction, 0., kHalfWidth, kHalfLength, kYawFriction;
      force *= *share++;
      force[0] = kFriction;
      force[2] = 1.;
      load += 100.;
      wrench += load * contact.ne_A() * force.head(contact.cols());
    }
    return wrench;
  };
}

// A robot with that wrench to distribute, and the same as a quadratic program: minimise ½ xᵀ H x,
// subject to CE x + ce0 = 0 and CI x + ci0 ≥ 0.
struct Problem {
  explicit Problem(const Task& task) : robot(task.makeRobot()) {
    robot.setWarmStart(false);
    const pinocchio::Model& model = robot.getModel();
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(model.nv);
    robot.computeDynamics(pinocchio::neutral(model), zero, zero);
    wrench = task.makeWrench(robot);
    if (distribute() != task.status)
      throw std::logic_error("the wrench '" + task.name + "' is not what it was chosen for");

    H = robot.reg_A().cwiseAbs2().asDiagonal();
    CE = robot.ne_A();
    ce0 = -wrench;
    const Eigen::MatrixXd U = robot.uni_A(), C = robot.fri_A();
    CI.resize(U.rows() + C.rows(), kForces);
    CI << -U, -C;
    ci0.setZero(CI.rows());
  }

  DistributionStatus distribute() {
    return robot.distributeForce(wrench.head<3>(), wrench.tail<3>(), robot.getCoM());
  }

  // A solver that answers another question would be no reference.
  void check(const Eigen::VectorXd& forces) const {
    if (!forces.isApprox(robot.allForces(), 1e-6))
      throw std::logic_error("the reference's forces differ");
  }

  DynaCoM robot;
  Wrench wrench;
  Eigen::MatrixXd H, CE, CI;
  Eigen::VectorXd ce0, ci0;
  Eigen::VectorXd g0 = Eigen::VectorXd::Zero(kForces);
};

void distributeForce(benchmark::State& state, const Task& task, const std::string& reference) {
  Problem problem(task);
  for (auto _ : state) benchmark::DoNotOptimize(problem.distribute());
  state.SetLabel("reference=" + reference);
  state.counters["iterations"] = problem.robot.getDistribution().iterations;
}

void eiquadprogPlain(benchmark::State& state, const Task& task) {
  const Problem problem(task);
  const Eigen::MatrixXd CE = problem.CE.transpose(), CI = problem.CI.transpose();
  Eigen::MatrixXd H(kForces, kForces);
  Eigen::VectorXd g0 = problem.g0, x(kForces);
  Eigen::VectorXi active(CI.cols() + kEqualities);
  std::size_t active_size = 0;
  for (auto _ : state) {
    H = problem.H;  // it is overwritten
    benchmark::DoNotOptimize(eiquadprog::solvers::solve_quadprog(
        H, g0, CE, problem.ce0, CI, problem.ci0, x, active, active_size));
  }
  problem.check(x);
  state.counters["active inequalities"] = double(active_size) - kEqualities;
}

void eiquadprogFast(benchmark::State& state, const Task& task) {
  const Problem problem(task);
  eiquadprog::solvers::EiquadprogFast solver;
  solver.reset(kForces, kEqualities, problem.CI.rows());
  Eigen::VectorXd x(kForces);
  for (auto _ : state)
    benchmark::DoNotOptimize(solver.solve_quadprog(problem.H, problem.g0, problem.CE, problem.ce0,
                                                   problem.CI, problem.ci0, x));
  problem.check(x);
  state.counters["active inequalities"] = double(solver.getActiveSetSize()) - kEqualities;
}

// For two soles.
void eiquadprogRt(benchmark::State& state, const Task& task) {
  const Problem problem(task);
  const Eigen::Matrix<double, kForces, kForces> H = problem.H;
  const Eigen::Matrix<double, kEqualities, kForces> CE = problem.CE;
  const Eigen::Matrix<double, kSoleInequalities, kForces> CI = problem.CI;
  const Eigen::Matrix<double, kForces, 1> g0 = problem.g0;
  const Eigen::Matrix<double, kEqualities, 1> ce0 = problem.ce0;
  const Eigen::Matrix<double, kSoleInequalities, 1> ci0 = problem.ci0;
  Eigen::Matrix<double, kForces, 1> x;
  eiquadprog::solvers::RtEiquadprog<kForces, kEqualities, kSoleInequalities> solver;
  for (auto _ : state) benchmark::DoNotOptimize(solver.solve_quadprog(H, g0, CE, ce0, CI, ci0, x));
  problem.check(x);
}

using Solver = std::pair<std::string, void (*)(benchmark::State&, const Task&)>;
const Solver kPlain = {"plain", eiquadprogPlain};
const Solver kFast = {"fast", eiquadprogFast};
const Solver kRt = {"rt", eiquadprogRt};

// A wrench with each solver, and distributeForce once for every solver it is measured against.
void registerSolved(const Task& task, const std::vector<Solver>& solvers) {
  for (const auto& [variant, solve] : solvers) {
    const std::string reference = "eiquadprog/" + variant + "/" + task.name;
    const std::string ours = "distributeForce/" + task.name + "/vs_" + variant;
    benchmark::RegisterBenchmark(reference.c_str(), solve, task);
    benchmark::RegisterBenchmark(ours.c_str(), distributeForce, task, reference);
  }
}

// A wrench that is out of reach, against a feasible one of the same contacts.
void registerRelaxed(Task task, const std::string& feasible) {
  task.status = DistributionStatus::Relaxed;
  const std::string ours = "distributeForce/" + task.name + "/vs_fast";
  const std::string reference = "eiquadprog/fast/" + feasible;
  benchmark::RegisterBenchmark(ours.c_str(), distributeForce, task, reference);
}

[[maybe_unused]] const bool registered = [] {
  const MakeWrench pyramid = onBoundary({0.4, -0.6, 0.6, -0.8}),
                   corner = onBoundary({1., 1., 1., 1.});

  // Well inside what the contacts can give, and where several inequalities are active.
  registerSolved({"soles/inside", makeTalos, pushed(0., 0., 0., 0., 0., 0.)}, {kPlain, kFast, kRt});
  registerSolved({"soles/edge", makeTalos, pushed(60., -60., 0., 20., 30., 60.)},
                 {kPlain, kFast, kRt});
  registerSolved({"soles/pyramid", makeTalos, pyramid}, {kFast});
  registerSolved({"soles/corner", makeTalos, corner}, {kFast});
  registerSolved({"points/inside", makeQuadruped, pushed(0., 0., 0., 0., 0., 0.)}, {kFast});
  registerSolved({"points/edge", makeQuadruped, pushed(120., -60., 0., 10., 40., 30.)}, {kFast});
  registerSolved({"points/pyramid", makeQuadruped, pyramid}, {kFast});
  registerSolved({"points/corner", makeQuadruped, corner}, {kFast});

  // More than friction holds, more than the weight holds down, and as much as lifts the robot.
  registerRelaxed({"soles/slipping", makeTalos, pushed(800., 300., 0., 0., 0., 0.)}, "soles/edge");
  registerRelaxed({"soles/tipping", makeTalos, pushed(0., 0., 0., 100., 200., 0.)}, "soles/edge");
  registerRelaxed({"soles/lifted", makeTalos, pushed(50., 0., 2000., 0., 0., 0.)}, "soles/edge");
  registerRelaxed({"points/slipping", makeQuadruped, pushed(500., 200., 0., 0., 0., 0.)},
                  "points/edge");
  registerRelaxed({"points/tipping", makeQuadruped, pushed(0., 0., 0., 200., 300., 0.)},
                  "points/edge");
  registerRelaxed({"points/lifted", makeQuadruped, pushed(50., 0., 1000., 0., 0., 0.)},
                  "points/edge");
  return true;
}();

}  // namespace
