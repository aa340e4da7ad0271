// SPDX-License-Identifier: BSD-2-Clause
// How long does distributeForce take at worst, for what cap on its iterations? It does where the
// wrench is next to the boundary of what the contacts can give: there Newton's method leaves the
// problem to the robust solver, and that often has too few digits.
//
// Usage: bench_boundary WRENCHES REPETITIONS CAP...
//
// The wrenches are random, the same ones every time, and not far from the limit of friction, all
// contacts pushing along the same side of it. Each is distributed without warm start, so many
// times. For each robot and cap it prints a line of JSON: how many wrenches had no answer, how many
// iterations were taken at most, and the median time of each wrench [ns].
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include "robots.hpp"

using namespace dynacom;
using namespace dynacom::benchmarks;

namespace {

// Loads, and what a contact may do besides, are random. The distance from the limit, over the
// wrench, is from 1e-13 to 1e-3, on either side.
std::vector<Wrench> makeWrenches(const DynaCoM& robot, int number) {
  std::mt19937 random(1);
  const auto uniform = [&random](double low, double high) {
    return low + (high - low) * (double(random()) / double(std::mt19937::max()));
  };
  std::vector<Wrench> wrenches;
  while (int(wrenches.size()) < number) {
    const double side = uniform(-1., 1.) < 0. ? -1. : 1.;
    const double beyond = (uniform(-1., 1.) < 0. ? -1. : 1.) * std::pow(10., uniform(-13., -3.));
    Wrench wrench = Wrench::Zero();
    for (const std::string& name : robot.getActiveContacts()) {
      const ContactBase& contact = *robot.getContact(name);
      Wrench force;
      force << side * kFriction * (1. + beyond), uniform(-1., 1.) * kFriction, 1.,
          uniform(-1., 1.) * kHalfWidth, uniform(-1., 1.) * kHalfLength,
          uniform(-1., 1.) * kYawFriction;
      wrench += uniform(100., 500.) * (contact.ne_A() * force.head(contact.cols()));
    }
    wrenches.push_back(wrench);
  }
  return wrenches;
}

void measure(const std::string& name, DynaCoM robot, int number, int repetitions, int cap) {
  const pinocchio::Model& model = robot.getModel();
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(model.nv);
  robot.computeDynamics(pinocchio::neutral(model), rest, rest);
  robot.setWarmStart(false);
  robot.setMaximalIterations(cap);
  int failures = 0, iterations = 0;
  std::vector<double> medians, times(repetitions);
  for (const Wrench& wrench : makeWrenches(robot, number)) {
    for (double& time : times) {
      const auto start = std::chrono::steady_clock::now();
      distribute(robot, wrench);
      const auto end = std::chrono::steady_clock::now();
      time = std::chrono::duration<double, std::nano>(end - start).count();
    }
    std::sort(times.begin(), times.end());
    medians.push_back(times[times.size() / 2]);
    if (robot.getDistributionStatus() == DistributionStatus::NumericalFailure) ++failures;
    iterations = std::max(iterations, robot.getDistribution().iterations);
  }
  std::printf("{\"robot\": \"%s\", \"cap\": %d, \"failures\": %d, \"iterations\": %d, \"times\": [",
              name.c_str(), cap, failures, iterations);
  for (std::size_t i = 0; i < medians.size(); ++i)
    std::printf("%s%.0f", i > 0 ? ", " : "", medians[i]);
  std::printf("]}\n");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) return 2;
  const int number = std::stoi(argv[1]), repetitions = std::stoi(argv[2]);
  const DynaCoM talos = makeTalos(), quadruped = makeQuadruped();
  for (int i = 3; i < argc; ++i) {
    measure("soles", talos, number, repetitions, std::stoi(argv[i]));
    measure("points", quadruped, number, repetitions, std::stoi(argv[i]));
  }
  return 0;
}
