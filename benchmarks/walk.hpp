// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <chrono>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "robots.hpp"

namespace dynacom::benchmarks {

// Talos, and a motion of it that goes on for ever: after the last tick comes the first.
class Walk {
 public:
  // @param path  of a text file: one line a tick, which soles are active (left, right), q, v and a
  explicit Walk(const std::string& path) {
    std::ifstream file(path);
    Tick tick;
    const auto read = [&file](auto& numbers) {
      for (auto& number : numbers) file >> number;
    };
    const pinocchio::Model& model = talos.getModel();
    tick.q.resize(model.nq);
    tick.v.resize(model.nv);
    tick.a.resize(model.nv);
    while (read(tick.active), read(tick.q), read(tick.v), read(tick.a), file)
      ticks_.push_back(tick);
    if (ticks_.empty() || !file.eof()) throw std::invalid_argument("no walk in " + path);
  }

  std::size_t size() const { return ticks_.size(); }

  // Lifts the feet, or puts them down.
  void step(std::size_t i) {
    for (const int side : {0, 1}) {
      if (ticks_[i].active[side])
        talos.activateContact(sides_[side]);
      else
        talos.deactivateContact(sides_[side]);
    }
  }

  void computeDynamics(std::size_t i) {
    talos.computeDynamics(ticks_[i].q, ticks_[i].v, ticks_[i].a);
  }

  // For the wrench of the last computeDynamics().
  DistributionStatus distributeForce() {
    return talos.distributeForce(talos.getGroundCoMForce(), talos.getGroundCoMTorque(),
                                 talos.getCoM());
  }

  DynaCoM talos = makeTalos();

 private:
  struct Tick {
    std::array<bool, 2> active;
    Eigen::VectorXd q, v, a;
  };
  const std::string sides_[2] = {"left", "right"};
  std::vector<Tick> ticks_;
};

inline float nanoseconds(std::chrono::steady_clock::duration time) {
  return std::chrono::duration<float, std::nano>(time).count();
}

// Samples, as they lie in memory: the one who reads them knows how many there are of what.
inline void writeSamples(const std::string& path, const std::vector<float>& samples) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(samples.data()), samples.size() * sizeof(float));
  if (!file.flush()) throw std::runtime_error("cannot write " + path);
}

}  // namespace dynacom::benchmarks
