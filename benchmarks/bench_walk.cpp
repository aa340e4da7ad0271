// SPDX-License-Identifier: BSD-2-Clause
// What does distributeForce cost along a walk, call by call, beside eiquadprog?
//
// Usage: bench_walk WALK SAMPLES REPETITIONS
//
// Writes the time of each call [ns, float] to SAMPLES: for each repetition, for each way to solve
// (in the order of the calls of `pass` below), for each tick of the walk. Prints, as JSON, how many
// iterations each tick takes, warm and cold.
#include <cstdio>

#include "walk.hpp"

using namespace dynacom::benchmarks;

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  Walk walk(argv[1]);
  const int repetitions = std::stoi(argv[3]);

  std::vector<QuadraticProgram> programs;
  const std::unique_ptr<Peer> plain = makePeer("eiquadprog/plain"),
                              fast = makePeer("eiquadprog/fast");
  for (std::size_t i = 0; i < walk.size(); ++i) {
    walk.step(i);
    walk.computeDynamics(i);
    if (walk.distributeForce() != dynacom::DistributionStatus::Solved)
      throw std::logic_error("tick " + std::to_string(i) + " of the walk is out of reach");
    programs.push_back(makeProgram(walk.talos));
    for (Peer* solver : {plain.get(), fast.get()}) {
      solver->prepare(programs[i]);
      requireSameForces(walk.talos, solver->solve(programs[i].ce0));
    }
  }

  for (const bool warm : {true, false}) {
    walk.talos.setWarmStart(warm);
    std::printf("%s: [", warm ? "{\"warm\"" : "], \"cold\"");
    for (std::size_t tick = 0; tick < 2 * walk.size(); ++tick) {
      const std::size_t i = tick % walk.size();
      walk.step(i);
      walk.computeDynamics(i);
      walk.distributeForce();
      if (tick >= walk.size())
        std::printf("%s%d", i > 0 ? ", " : "", walk.talos.getDistribution().iterations);
    }
  }
  std::printf("]}\n");

  std::vector<float> samples;
  // Each goes through the walk on its own, as in a controller that has no other solver: what comes
  // before the call that is measured is the same for all of them, computeDynamics included. The
  // first time through is not recorded: caches and branch predictors still know the other ways.
  const auto pass = [&](const auto& prepare, const auto& solve) {
    for (std::size_t tick = 0; tick < 2 * walk.size(); ++tick) {
      const std::size_t i = tick % walk.size();
      walk.step(i);
      walk.computeDynamics(i);
      prepare(i);
      const auto start = std::chrono::steady_clock::now();
      solve(i);
      const auto end = std::chrono::steady_clock::now();
      if (tick >= walk.size()) samples.push_back(nanoseconds(end - start));
    }
  };
  const auto nothing = [](std::size_t) {};
  const auto distribute = [&walk](std::size_t) { walk.distributeForce(); };
  const auto reference = [&](Peer& solver) {
    pass([&](std::size_t i) { solver.prepare(programs[i]); },
         [&](std::size_t i) { solver.solve(programs[i].ce0); });
  };
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    walk.talos.setWarmStart(true);
    pass(nothing, distribute);
    walk.talos.setWarmStart(false);
    pass(nothing, distribute);
    reference(*plain);
    reference(*fast);
    pass(nothing, nothing);  // the clock's own cost
  }
  writeSamples(argv[2], samples);
  return 0;
}
