// SPDX-License-Identifier: BSD-2-Clause
// Distributes random wrenches over sets of every kind, certifies every answer, and prints what came
// out, kind by kind.
#include <array>
#include <cstdio>
#include <cstdlib>

#include "set_problems.hpp"

using namespace dynacom_tests;
using dynacom::DistributionStatus;

// usage: set_reliability [PROBLEMS [SEED]]. Fails if an answer is not certified although its wrench
// is not on or next to the boundary, or if more than 1 in 200 problems have no certified answer,
// of discs 1 in 20.
int main(int argc, char** argv) {
  const long problems = argc > 1 ? std::atol(argv[1]) : 1000;
  const long seed = argc > 2 ? std::atol(argv[2]) : 1;
  if (problems < 1 || seed < 1 || argc > 3) {
    std::fprintf(stderr, "usage: set_reliability [PROBLEMS [SEED]], both > 0\n");
    return 2;
  }
  std::printf(
      "| sets | wrench | problems | Solved | Relaxed | failures | not certified | called accurate "
      "| not optimal | "
      "outside | distance gap | cost gap | iterations |\n|---|---|---|---|---|---|---|---|---|---|"
      "---|---|---|\n");
  constexpr double kNext = 1e-3;  // of the scale: no farther is next to the boundary
  bool failed = false;
  for (std::size_t kind = 0; kind < kSetKindNames.size(); ++kind) {
    SetProblemGenerator generator(static_cast<std::uint64_t>(seed));
    dynacom::DistributionSolver solver;
    struct Tally {
      long problems = 0, solved = 0, relaxed = 0, failures = 0, uncertified = 0, not_optimal = 0,
           called_accurate = 0;
      SetVerdict worst;
      int iterations = 0;
    };
    std::array<Tally, kSetPlaceNames.size()> tallies;
    long bad = 0, elsewhere = 0;
    for (long i = 0; i < problems; ++i) {
      const SetProblem made = generator.next(static_cast<SetKind>(kind));
      const dynacom::DistributionSolution& solution = solver.solve(made.problem);
      const SetVerdict verdict = check(made, solution);
      const bool is_optimal = solution.isOptimal(made.problem);
      Tally& tally = tallies[static_cast<std::size_t>(made.place)];
      ++tally.problems;
      tally.solved += solution.status == DistributionStatus::Solved;
      tally.relaxed += solution.status == DistributionStatus::Relaxed;
      const bool has_answer = verdict.error != "no answer";
      tally.failures += !has_answer;
      tally.uncertified += has_answer && !verdict.error.empty();
      tally.called_accurate += has_answer && !verdict.error.empty() && solution.is_accurate;
      tally.not_optimal += has_answer && !is_optimal;
      tally.worst.outside = std::max(tally.worst.outside, verdict.outside);
      tally.worst.distance_gap = std::max(tally.worst.distance_gap, verdict.distance_gap);
      tally.worst.cost_gap = std::max(tally.worst.cost_gap, verdict.cost_gap);
      tally.iterations = std::max(tally.iterations, solution.iterations);
      bad += !verdict.error.empty();
      const double distance = solution.residual.norm() / made.problem.scale();
      const bool is_next = made.place == SetPlace::Boundary ||
                           made.place == SetPlace::NearBoundary ||
                           (solution.status == DistributionStatus::Relaxed && distance < kNext);
      elsewhere += !verdict.error.empty() && !is_next;
      failed = failed || (has_answer && !verdict.error.empty() && solution.is_accurate && !is_next);
      if (!verdict.error.empty() || !is_optimal)
        std::fprintf(
            stderr,
            "%s %ld (%s, %zu contacts) %s: %s%s; outside %.1e, distance gap %.1e, cost gap "
            "%.1e, residual %.1e\n",
            kSetKindNames[kind], i, kSetPlaceNames[static_cast<std::size_t>(made.place)],
            made.contacts.size(), to_string(solution.status), verdict.error.c_str(),
            is_optimal ? "" : ", isOptimal() is false", verdict.outside, verdict.distance_gap,
            verdict.cost_gap, solution.residual.norm() / made.problem.scale());
    }
    for (std::size_t place = 0; place < tallies.size(); ++place) {
      const Tally& t = tallies[place];
      std::printf(
          "| %s | %s | %ld | %ld | %ld | %ld | %ld | %ld | %ld | %.1e | %.1e | %.1e | %d |\n",
          kSetKindNames[kind], kSetPlaceNames[place], t.problems, t.solved, t.relaxed, t.failures,
          t.uncertified, t.called_accurate, t.not_optimal, t.worst.outside, t.worst.distance_gap,
          t.worst.cost_gap, t.iterations);
    }
    const bool has_discs = static_cast<SetKind>(kind) == SetKind::Discs ||
                           static_cast<SetKind>(kind) == SetKind::Mixed;
    failed = failed || bad * (has_discs ? 20 : 200) > problems || elsewhere * 1000 > problems;
  }
  return failed;
}
