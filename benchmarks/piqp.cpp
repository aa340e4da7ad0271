// SPDX-License-Identifier: BSD-2-Clause
#include <piqp/piqp.hpp>

#include "peers.hpp"

namespace dynacom::benchmarks {
namespace {

class Piqp final : public Peer {
 public:
  void prepare(const QuadraticProgram& program) override {
    const Eigen::VectorXd cost = Eigen::VectorXd::Zero(program.H.rows()),
                          least = Eigen::VectorXd::Zero(program.CI.rows());
    // What the update of the right-hand side leaves as it is need not be scaled again.
    solver_.settings().preconditioner_reuse_on_update = true;
    solver_.setup(program.H, cost, program.CE, Eigen::VectorXd(-program.ce0), program.CI, least);
  }

  const Eigen::VectorXd& solve(const Eigen::VectorXd& ce0) override {
    equations_ = -ce0;
    solver_.update(piqp::nullopt, piqp::nullopt, piqp::nullopt, equations_);
    solver_.solve();
    return solver_.result().x;
  }

 private:
  Eigen::VectorXd equations_;
  piqp::DenseSolver<double> solver_;
};

}  // namespace

std::unique_ptr<Peer> makePiqp() { return std::make_unique<Piqp>(); }

}  // namespace dynacom::benchmarks
