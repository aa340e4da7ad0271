// SPDX-License-Identifier: BSD-2-Clause
#include <api.h>
#include <utils.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "peers.hpp"

namespace dynacom::benchmarks {
namespace {

using Eigen::Index;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

class Daqp final : public Peer {
 public:
  // @param anew  what of the problem is taken again in each call, DAQP_UPDATE_…
  explicit Daqp(int anew) : anew_(anew) {}
  ~Daqp() override { release(); }
  Daqp(const Daqp&) = delete;
  Daqp& operator=(const Daqp&) = delete;

  void prepare(const QuadraticProgram& program) override {
    release();
    const Index equations = program.CE.rows(), inequalities = program.CI.rows();
    const Index rows = equations + inequalities;
    H_ = program.H;
    A_.resize(rows, H_.cols());
    A_ << program.CE, program.CI;
    lower_.setZero(rows);
    upper_.setConstant(rows, DAQP_INF);
    lower_.head(equations) = upper_.head(equations) = -program.ce0;
    sense_.assign(std::size_t(rows), 0);
    std::fill_n(sense_.begin(), equations, DAQP_ACTIVE + DAQP_IMMUTABLE);
    x_.resize(H_.cols());
    multipliers_.resize(rows);
    equations_ = equations;

    problem_ = {};
    problem_.n = int(H_.cols());
    problem_.m = int(rows);
    problem_.H = H_.data();
    problem_.A = A_.data();
    problem_.bupper = upper_.data();
    problem_.blower = lower_.data();
    problem_.sense = sense_.data();
    workspace_ = {};
    if (setup_daqp(&problem_, &workspace_, nullptr) < 0)
      throw std::logic_error("DAQP does not take the problem");
    is_set_up_ = true;
    result_ = {};
    result_.x = x_.data();
    result_.lam = multipliers_.data();
  }

  const Eigen::VectorXd& solve(const Eigen::VectorXd& ce0) override {
    lower_.head(equations_) = upper_.head(equations_) = -ce0;
    daqp_update_ldp(anew_, &workspace_, &problem_);
    daqp_solve(&result_, &workspace_);
    return x_;
  }

 private:
  void release() {
    if (!is_set_up_) return;
    free_daqp_workspace(&workspace_);
    free_daqp_ldp(&workspace_);
    is_set_up_ = false;
  }

  int anew_;
  RowMajor H_, A_;
  Eigen::VectorXd lower_, upper_, x_, multipliers_;
  std::vector<int> sense_;
  Index equations_ = 0;
  bool is_set_up_ = false;
  DAQPProblem problem_ = {};
  DAQPWorkspace workspace_ = {};
  DAQPResult result_ = {};
};

}  // namespace

std::unique_ptr<Peer> makeDaqpForWrench() { return std::make_unique<Daqp>(DAQP_UPDATE_d); }
std::unique_ptr<Peer> makeDaqpForFeet() {
  return std::make_unique<Daqp>(DAQP_UPDATE_M + DAQP_UPDATE_d + DAQP_UPDATE_sense);
}

}  // namespace dynacom::benchmarks
