// SPDX-License-Identifier: BSD-2-Clause
// How regular is a control loop of 1 kHz, beside a core that is under load?
//
// Usage: bench_jitter WALK SAMPLES SECONDS
//
// A tick is one of the walk: it wakes up, lifts feet or puts them down, and calls computeDynamics
// and distributeForce. Writes three times of each tick [ns, float] to SAMPLES: how late it woke up,
// what computeDynamics took with the steps of the feet, and what distributeForce took. Prints, as
// JSON, what the system has permitted.
#include <sched.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cstdio>
#include <functional>
#include <numeric>

#include "walk.hpp"

namespace {

using Clock = std::chrono::steady_clock;  // CLOCK_MONOTONIC, by which the loop sleeps

constexpr std::chrono::nanoseconds kPeriod = std::chrono::milliseconds(1);

void stayOn(int cpu) {
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(cpu, &set);
  sched_setaffinity(0, sizeof set, &set);
}

// Keeps a core and the memory that all cores share busy, until it is killed.
[[noreturn]] void load(int cpu) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  stayOn(cpu);
  std::vector<double> numbers(8 << 20, 1.);
  for (;;) std::partial_sum(numbers.rbegin(), numbers.rend(), numbers.rbegin(), std::minus<>());
}

void sleepUntil(Clock::time_point time) {
  const auto since = std::chrono::nanoseconds(time.time_since_epoch()).count();
  const timespec until = {time_t(since / 1'000'000'000), long(since % 1'000'000'000)};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) != 0) continue;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  dynacom::benchmarks::Walk walk(argv[1]);
  const std::size_t ticks = std::size_t(std::stod(argv[3]) * 1000.);

  cpu_set_t allowed;
  sched_getaffinity(0, sizeof allowed, &allowed);
  std::vector<int> cpus;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu)
    if (CPU_ISSET(cpu, &allowed)) cpus.push_back(cpu);
  const pid_t child = fork();
  if (child == 0) load(cpus.front());
  if (child < 0) return 1;
  stayOn(cpus.back());
  sched_param priority = {};
  priority.sched_priority = 80;
  const bool fifo = sched_setscheduler(0, SCHED_FIFO, &priority) == 0;
  std::vector<float> samples(3 * ticks);  // touched, so that no page is missing later
  const bool locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;

  // Once through the walk unrecorded: what a controller does before it closes its loop.
  const std::size_t warm_up = walk.size();
  Clock::time_point due = Clock::now();
  for (std::size_t tick = 0; tick < warm_up + ticks; ++tick) {
    due += kPeriod;
    sleepUntil(due);
    const Clock::time_point woken = Clock::now();
    walk.step(tick % walk.size());
    walk.computeDynamics(tick % walk.size());
    const Clock::time_point computed = Clock::now();
    walk.distributeForce();
    const Clock::time_point done = Clock::now();
    if (tick < warm_up) continue;
    float* const sample = &samples[3 * (tick - warm_up)];
    sample[0] = dynacom::benchmarks::nanoseconds(woken - due);
    sample[1] = dynacom::benchmarks::nanoseconds(computed - woken);
    sample[2] = dynacom::benchmarks::nanoseconds(done - computed);
  }

  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  dynacom::benchmarks::writeSamples(argv[2], samples);
  std::printf("{\"fifo\": %s, \"locked\": %s, \"cores\": %zu}\n", fifo ? "true" : "false",
              locked ? "true" : "false", cpus.size());
  return 0;
}
