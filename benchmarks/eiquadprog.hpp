// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>

namespace dynacom::benchmarks {

// Minimise ½ xᵀ H x subject to CE x + ce0 = 0 and CI x ≥ 0.
struct QuadraticProgram {
  Eigen::MatrixXd H, CE, CI;
  Eigen::VectorXd ce0;
};

// A general solver, to be measured against.
class Eiquadprog {
 public:
  virtual ~Eiquadprog() = default;
  // Takes the matrices: storage, and all that is better done once, outside of what is measured.
  virtual void prepare(const QuadraticProgram& program) = 0;
  // The solution for this ce0, whatever it was in prepare().
  virtual const Eigen::VectorXd& solve(const Eigen::VectorXd& ce0) = 0;
};

// The variants "plain" and "fast" take programs of any size, "rt" those of two soles.
std::unique_ptr<Eiquadprog> makeEiquadprog(const std::string& variant);

}  // namespace dynacom::benchmarks
