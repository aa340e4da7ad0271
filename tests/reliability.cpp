// SPDX-License-Identifier: BSD-2-Clause
// Distributes random wrenches, certifies every answer, and prints what came out, sort by sort.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "problem_checker.hpp"
#include "random_problems.hpp"

using namespace dynacom_tests;
using dynacom::DistributionStatus;

namespace {

struct Tally {
  long problems = 0, solved = 0, relaxed = 0, failures = 0, wrong = 0, not_optimal = 0;
  int iterations = 0;
  Verdict worst;

  void add(const dynacom::DistributionResult& result, const Verdict& verdict) {
    ++problems;
    solved += result.status == DistributionStatus::Solved;
    relaxed += result.status == DistributionStatus::Relaxed;
    failures += result.status == DistributionStatus::NumericalFailure;
    wrong += !verdict.error.empty();
    not_optimal += !result.isOptimal(1e-6);
    iterations = std::max(iterations, result.iterations);
    worst.outside_cone = std::max(worst.outside_cone, verdict.outside_cone);
    worst.residual_gap = std::max(worst.residual_gap, verdict.residual_gap);
    worst.cost_gap = std::max(worst.cost_gap, verdict.cost_gap);
    if (result.status == DistributionStatus::Solved)
      worst.residual = std::max(worst.residual, verdict.residual);
  }

  void print(const char* name) const {
    std::printf("| %s | %ld | %ld | %ld | %ld | %ld | %ld | %.1e | %.1e | %.1e | %.1e | %d |\n",
                name, problems, solved, relaxed, failures, wrong, not_optimal, worst.outside_cone,
                worst.residual, worst.residual_gap, worst.cost_gap, iterations);
  }
};

}  // namespace

// usage: reliability [PROBLEMS [SEED]]. Fails if an answer is not certified, or fails isOptimal();
// where contacts are nearly parallel or wrench weights far apart, so that costs may depend on
// digits that doubles do not have, if there is no answer, if more than 1 in 1,000 are not
// certified, or more than 1 in 200 fail isOptimal().
int main(int argc, char** argv) {
  const long problems = argc > 1 ? std::atol(argv[1]) : 1000;
  const long seed = argc > 2 ? std::atol(argv[2]) : 1;
  if (problems < 1 || seed < 1 || argc > 3) {
    std::fprintf(stderr, "usage: reliability [PROBLEMS [SEED]], both > 0\n");
    return 2;
  }
  ProblemGenerator generator(static_cast<unsigned long>(seed));
  std::array<Tally, kPlaceNames.size()> tallies;
  Tally all, nearly_parallel, weights_far_apart;
  dynacom::WrenchDistribution distribution;  // one for all: what was before must not matter
  for (long i = 0; i < problems; ++i) {
    const Problem problem = generator.next();
    distribution.clear();
    distribution.setWrenchWeights(problem.wrench_weights);
    for (const auto& contact : problem.makeContacts()) distribution.add(*contact);
    distribution.solve(problem.wrench, problem.minimal_scale);
    const Verdict verdict = check(problem, distribution.result());
    const auto place = static_cast<std::size_t>(problem.place);
    if (problem.nearly_parallel) {
      nearly_parallel.add(distribution.result(), verdict);
    } else if (problem.weights_far_apart) {
      weights_far_apart.add(distribution.result(), verdict);
    } else {
      tallies[place].add(distribution.result(), verdict);
      all.add(distribution.result(), verdict);
    }
    if (!verdict.error.empty() || !distribution.result().isOptimal(1e-6))
      std::fprintf(
          stderr,
          "problem %ld (%s, %zu%s contacts%s): %s; outside %.1e, residual %.1e (gap %.1e), "
          "cost gap %.1e\n",
          i, kPlaceNames[place], problem.contacts.size(),
          problem.nearly_parallel ? " nearly parallel" : "",
          problem.weights_far_apart ? ", weights far apart" : "",
          verdict.error.empty() ? "right, but isOptimal() is false" : verdict.error.c_str(),
          verdict.outside_cone, verdict.residual, verdict.residual_gap, verdict.cost_gap);
  }
  std::printf(
      "| wrench | problems | Solved | Relaxed | failures | wrong | not optimal | "
      "outside "
      "cone | residual of Solved | residual gap | cost gap | iterations |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (std::size_t i = 0; i < tallies.size(); ++i) tallies[i].print(kPlaceNames[i]);
  all.print("all of these");
  nearly_parallel.print("nearly parallel contacts");
  weights_far_apart.print("wrench weights far apart");
  bool failed = all.wrong + all.not_optimal > 0;
  for (const Tally& hard : {nearly_parallel, weights_far_apart})
    failed = failed || hard.failures > 0 || 1000 * hard.wrong > hard.problems ||
             200 * hard.not_optimal > hard.problems;
  return failed;
}
