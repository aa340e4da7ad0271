// SPDX-License-Identifier: BSD-2-Clause
#include <limits>
#include <optional>
#include <proxsuite/proxqp/dense/dense.hpp>

#include "peers.hpp"

namespace dynacom::benchmarks {
namespace {

namespace proxqp = proxsuite::proxqp;

class Proxqp final : public Peer {
 public:
  void prepare(const QuadraticProgram& program) override {
    const Eigen::Index inequalities = program.CI.rows();
    const double none = std::numeric_limits<double>::infinity();
    const Eigen::VectorXd cost = Eigen::VectorXd::Zero(program.H.rows()),
                          least = Eigen::VectorXd::Zero(inequalities),
                          greatest = Eigen::VectorXd::Constant(inequalities, none);
    solver_.emplace(program.H.rows(), program.CE.rows(), inequalities,
                    proxqp::HessianType::Diagonal);
    solver_->init(program.H, cost, program.CE, Eigen::VectorXd(-program.ce0), program.CI, least,
                  greatest);
  }

  const Eigen::VectorXd& solve(const Eigen::VectorXd& ce0) override {
    equations_ = -ce0;
    solver_->update(proxsuite::nullopt, proxsuite::nullopt, proxsuite::nullopt, equations_,
                    proxsuite::nullopt, proxsuite::nullopt, proxsuite::nullopt);
    solver_->solve();
    return solver_->results.x;
  }

 private:
  Eigen::VectorXd equations_;
  std::optional<proxqp::dense::QP<double>> solver_;
};

}  // namespace

std::unique_ptr<Peer> makeProxqp() { return std::make_unique<Proxqp>(); }

}  // namespace dynacom::benchmarks
