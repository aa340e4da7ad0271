// SPDX-License-Identifier: BSD-2-Clause
// What does computeDynamics cost beside the call of Pinocchio that it cannot do without?
#include <benchmark/benchmark.h>

#include <pinocchio/algorithm/centroidal.hpp>

#include "robots.hpp"

namespace {

using dynacom::DynaCoM;

// A motion without symmetries, the same every time.
struct Posture {
  explicit Posture(const pinocchio::Model& model)
      : q(pinocchio::neutral(model)),
        v(Eigen::VectorXd::LinSpaced(model.nv, -0.5, 0.5)),
        a(Eigen::VectorXd::LinSpaced(model.nv, 1., -1.)) {
    q.tail(model.nq - 7).setLinSpaced(-0.2, 0.3);
  }
  Eigen::VectorXd q, v, a;
};

void computeCentroidalMomentumTimeVariation(benchmark::State& state) {
  const DynaCoM talos = dynacom::benchmarks::makeTalos();
  pinocchio::Data data(talos.getModel());
  const Posture posture(talos.getModel());
  for (auto _ : state)
    benchmark::DoNotOptimize(pinocchio::computeCentroidalMomentumTimeVariation(
        talos.getModel(), data, posture.q, posture.v, posture.a));
}
BENCHMARK(computeCentroidalMomentumTimeVariation);

void computeDynamics(benchmark::State& state) {
  DynaCoM talos = dynacom::benchmarks::makeTalos();
  const Posture posture(talos.getModel());
  for (auto _ : state) {
    talos.computeDynamics(posture.q, posture.v, posture.a);
    benchmark::DoNotOptimize(talos.getCoP().data());
  }
  state.SetLabel("reference=computeCentroidalMomentumTimeVariation");
}
BENCHMARK(computeDynamics);

}  // namespace
