// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>

// General solvers, to be measured against.

namespace dynacom::benchmarks {

// Minimise ½ xᵀ H x subject to CE x + ce0 = 0 and CI x ≥ 0.
struct QuadraticProgram {
  Eigen::MatrixXd H, CE, CI;
  Eigen::VectorXd ce0;
};

class Peer {
 public:
  virtual ~Peer() = default;
  // Takes the matrices: storage, and all that is better done once, outside of what is measured.
  virtual void prepare(const QuadraticProgram& program) = 0;
  // The solution for this ce0, whatever it was in prepare().
  virtual const Eigen::VectorXd& solve(const Eigen::VectorXd& ce0) = 0;
};

// Those that were there when this was compiled, of programs of any size but for eiquadprog/rt,
// which takes those of two soles:
//   eiquadprog/plain, eiquadprog/fast, eiquadprog/rt
//   DAQP/wrench    reuses the factors and the active set of the last call, as it may where only the
//                  wrench moves
//   DAQP/feet      takes CE anew each time, and starts without active inequalities
//   PIQP/wrench, ProxQP/wrench    reuse what they may where only the wrench moves, but start cold
bool hasPeer(const std::string& name);
// @throws std::invalid_argument if there is none of that name
std::unique_ptr<Peer> makePeer(const std::string& name);

// What makePeer() asks; each is there where its solver is.
std::unique_ptr<Peer> makeEiquadprogPlain();
std::unique_ptr<Peer> makeEiquadprogFast();
std::unique_ptr<Peer> makeEiquadprogRt();
std::unique_ptr<Peer> makeDaqpForWrench();
std::unique_ptr<Peer> makeDaqpForFeet();
std::unique_ptr<Peer> makePiqp();
std::unique_ptr<Peer> makeProxqp();

}  // namespace dynacom::benchmarks
