// SPDX-License-Identifier: BSD-2-Clause
// What does distributeForce cost beside general solvers? These are given the same problem, with all
// matrices prepared beforehand; distributeForce has to place the contacts and prepare them each
// time.
#include <benchmark/benchmark.h>

#include <eiquadprog/eiquadprog-fast.hpp>
#include <eiquadprog/eiquadprog-rt.hpp>
#include <eiquadprog/eiquadprog.hpp>
#include <stdexcept>

#include "talos.hpp"

namespace {

using dynacom::DistributionStatus;
using dynacom::DynaCoM;

constexpr int kForces = 12, kEqualities = 6, kInequalities = 22;

// A wrench for Talos to distribute over its soles, and the problem as quadratic program: minimise
// ½ xᵀ H x, subject to CE x + ce0 = 0 and CI x + ci0 ≥ 0.
struct Problem {
  // Standing still, but for a force and a moment from outside.
  explicit Problem(const Eigen::Matrix<double, 6, 1>& ext_wrench)
      : talos(dynacom::benchmarks::makeTalos()) {
    const pinocchio::Model& model = talos.getModel();
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(model.nv);
    talos.computeDynamics(pinocchio::neutral(model), zero, zero, ext_wrench);
    if (distribute() != DistributionStatus::Solved)
      throw std::logic_error("the benchmark's wrench must be within reach");

    H = talos.reg_A().cwiseAbs2().asDiagonal();
    CE = talos.ne_A();
    ce0 = -talos.ne_b();
    CI.resize(kInequalities, kForces);
    CI << -talos.uni_A(), -talos.fri_A();
  }

  DistributionStatus distribute() {
    return talos.distributeForce(talos.getGroundCoMForce(), talos.getGroundCoMTorque(),
                                 talos.getCoM());
  }

  // A solver that answers another question would be no reference.
  void check(const Eigen::VectorXd& forces) const {
    if (!forces.isApprox(talos.allForces(), 1e-6))
      throw std::logic_error("the reference's forces differ");
  }

  DynaCoM talos;
  Eigen::MatrixXd H, CE, CI;
  Eigen::VectorXd ce0, ci0 = Eigen::VectorXd::Zero(kInequalities);
  Eigen::VectorXd g0 = Eigen::VectorXd::Zero(kForces);
};

using Wrench = Eigen::Matrix<double, 6, 1>;

void distributeForce(benchmark::State& state, const Wrench& wrench, const std::string& reference) {
  Problem problem(wrench);
  for (auto _ : state) benchmark::DoNotOptimize(problem.distribute());
  state.SetLabel("reference=" + reference);
}

void eiquadprogPlain(benchmark::State& state, const Wrench& wrench) {
  const Problem problem(wrench);
  const Eigen::MatrixXd CE = problem.CE.transpose(), CI = problem.CI.transpose();
  Eigen::MatrixXd H(kForces, kForces);
  Eigen::VectorXd g0 = problem.g0, x(kForces);
  Eigen::VectorXi active(kInequalities + kEqualities);
  std::size_t active_size = 0;
  for (auto _ : state) {
    H = problem.H;  // it is overwritten
    benchmark::DoNotOptimize(eiquadprog::solvers::solve_quadprog(
        H, g0, CE, problem.ce0, CI, problem.ci0, x, active, active_size));
  }
  problem.check(x);
  state.counters["active inequalities"] = double(active_size) - kEqualities;
}

void eiquadprogFast(benchmark::State& state, const Wrench& wrench) {
  const Problem problem(wrench);
  eiquadprog::solvers::EiquadprogFast solver;
  solver.reset(kForces, kEqualities, kInequalities);
  Eigen::VectorXd x(kForces);
  for (auto _ : state)
    benchmark::DoNotOptimize(solver.solve_quadprog(problem.H, problem.g0, problem.CE, problem.ce0,
                                                   problem.CI, problem.ci0, x));
  problem.check(x);
}

void eiquadprogRt(benchmark::State& state, const Wrench& wrench) {
  const Problem problem(wrench);
  const Eigen::Matrix<double, kForces, kForces> H = problem.H;
  const Eigen::Matrix<double, kEqualities, kForces> CE = problem.CE;
  const Eigen::Matrix<double, kInequalities, kForces> CI = problem.CI;
  const Eigen::Matrix<double, kForces, 1> g0 = problem.g0;
  const Eigen::Matrix<double, kEqualities, 1> ce0 = problem.ce0;
  const Eigen::Matrix<double, kInequalities, 1> ci0 = problem.ci0;
  Eigen::Matrix<double, kForces, 1> x;
  eiquadprog::solvers::RtEiquadprog<kForces, kEqualities, kInequalities> solver;
  for (auto _ : state) benchmark::DoNotOptimize(solver.solve_quadprog(H, g0, CE, ce0, CI, ci0, x));
  problem.check(x);
}

// Each wrench with each solver, and distributeForce once for every solver it is measured against.
void registerWrench(const std::string& name, const Wrench& wrench) {
  const std::pair<std::string, void (*)(benchmark::State&, const Wrench&)> solvers[] = {
      {"plain", eiquadprogPlain}, {"fast", eiquadprogFast}, {"rt", eiquadprogRt}};
  for (const auto& [variant, solver] : solvers) {
    const std::string reference = "eiquadprog/" + variant + "/" + name;
    const std::string ours = "distributeForce/" + name + "/vs_" + variant;
    benchmark::RegisterBenchmark(reference.c_str(), solver, wrench);
    benchmark::RegisterBenchmark(ours.c_str(), distributeForce, wrench, reference);
  }
}

[[maybe_unused]] const bool registered = [] {
  // Well inside what the soles can give, and where several inequalities are active.
  registerWrench("inside", Wrench::Zero());
  registerWrench("edge", (Wrench() << 60., -60., 0., 20., 30., 60.).finished());
  return true;
}();

}  // namespace
