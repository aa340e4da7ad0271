// SPDX-License-Identifier: BSD-2-Clause
#include <eiquadprog/eiquadprog-fast.hpp>
#include <eiquadprog/eiquadprog-rt.hpp>
#include <eiquadprog/eiquadprog.hpp>

#include "peers.hpp"

namespace dynacom::benchmarks {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

class Plain final : public Peer {
 public:
  void prepare(const QuadraticProgram& program) override {
    H_ = program.H;
    CE_ = program.CE.transpose();
    CI_ = program.CI.transpose();
    g0_.setZero(H_.rows());
    ci0_.setZero(CI_.cols());
    x_.resize(H_.rows());
    active_.resize(CE_.cols() + CI_.cols());
  }

  const VectorXd& solve(const VectorXd& ce0) override {
    factor_ = H_;  // it is overwritten
    std::size_t active = 0;
    eiquadprog::solvers::solve_quadprog(factor_, g0_, CE_, ce0, CI_, ci0_, x_, active_, active);
    return x_;
  }

 private:
  MatrixXd H_, factor_, CE_, CI_;
  VectorXd g0_, ci0_, x_;
  Eigen::VectorXi active_;
};

class Fast final : public Peer {
 public:
  void prepare(const QuadraticProgram& program) override {
    if (program.CI.rows() != program_.CI.rows() || program.CI.cols() != program_.CI.cols())
      solver_.reset(program.H.rows(), program.CE.rows(), program.CI.rows());
    program_ = program;
    g0_.setZero(program.H.rows());
    ci0_.setZero(program.CI.rows());
    x_.resize(program.H.rows());
  }

  const VectorXd& solve(const VectorXd& ce0) override {
    solver_.solve_quadprog(program_.H, g0_, program_.CE, ce0, program_.CI, ci0_, x_);
    return x_;
  }

 private:
  QuadraticProgram program_;
  VectorXd g0_, ci0_, x_;
  eiquadprog::solvers::EiquadprogFast solver_;
};

class Rt final : public Peer {
 public:
  void prepare(const QuadraticProgram& program) override {
    H_ = program.H;
    CE_ = program.CE;
    CI_ = program.CI;
    x_.resize(kForces);
  }

  const VectorXd& solve(const VectorXd& ce0) override {
    ce0_ = ce0;
    solver_.solve_quadprog(H_, g0_, CE_, ce0_, CI_, ci0_, solution_);
    x_ = solution_;
    return x_;
  }

 private:
  static constexpr int kForces = 12, kEqualities = 6, kInequalities = 22;
  template <int rows, int cols = 1>
  using Matrix = Eigen::Matrix<double, rows, cols>;

  Matrix<kForces, kForces> H_;
  Matrix<kEqualities, kForces> CE_;
  Matrix<kInequalities, kForces> CI_;
  Matrix<kEqualities> ce0_;
  Matrix<kForces> g0_ = Matrix<kForces>::Zero(), solution_;
  Matrix<kInequalities> ci0_ = Matrix<kInequalities>::Zero();
  VectorXd x_;
  eiquadprog::solvers::RtEiquadprog<kForces, kEqualities, kInequalities> solver_;
};

}  // namespace

std::unique_ptr<Peer> makeEiquadprogPlain() { return std::make_unique<Plain>(); }
std::unique_ptr<Peer> makeEiquadprogFast() { return std::make_unique<Fast>(); }
std::unique_ptr<Peer> makeEiquadprogRt() { return std::make_unique<Rt>(); }

}  // namespace dynacom::benchmarks
