// SPDX-License-Identifier: BSD-2-Clause
// The benchmarks' main(). Without the arguments below it is Google Benchmark's:
//   --list                what there is, each with its reference behind a tab
//   --repeat NAME NUMBER  does one so many times, for tools that count instructions
#include <benchmark/benchmark.h>

#include <algorithm>
#include <iostream>
#include <string>

#include "cases.hpp"

namespace {

using dynacom::benchmarks::Case;

int repeat(const std::vector<Case>& cases, const std::string& name, long number) {
  const auto found = std::find_if(cases.begin(), cases.end(),
                                  [&name](const Case& one) { return one.name == name; });
  if (found == cases.end()) {
    std::cerr << "there is no benchmark '" << name << "'\n";
    return 1;
  }
  const std::function<void()> run = found->prepare();
  for (long i = 0; i < number; ++i) run();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<Case> cases = dynacom::benchmarks::makeCases();
  const std::string first = argc > 1 ? argv[1] : "";
  if (first == "--list") {
    for (const Case& one : cases) std::cout << one.name << '\t' << one.reference << '\n';
    return 0;
  }
  if (first == "--repeat" && argc == 4) return repeat(cases, argv[2], std::stol(argv[3]));

  for (const Case& one : cases)
    benchmark::RegisterBenchmark(one.name.c_str(), [&one](benchmark::State& state) {
      const std::function<void()> run = one.prepare();
      for (auto _ : state) run();
    });
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
