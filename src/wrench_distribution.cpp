// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/wrench_distribution.hpp"

#include <eiquadprog/eiquadprog-fast.hpp>
#include <ostream>
#include <utility>
#include <vector>

namespace dynacom {

namespace {

using eiquadprog::solvers::EIQUADPROG_FAST_INFEASIBLE;
using eiquadprog::solvers::EIQUADPROG_FAST_OPTIMAL;
using eiquadprog::solvers::EIQUADPROG_FAST_UNBOUNDED;
using eiquadprog::solvers::EiquadprogFast;

// How far an answer may be from its constraints, for a wrench of unit size. The solver's own
// tolerance is about 1e-10.
constexpr double kTolerance = 1e-8;

}  // namespace

const char* to_string(DistributionStatus status) {
  switch (status) {
    case DistributionStatus::Solved:
      return "Solved";
    case DistributionStatus::Infeasible:
      return "Infeasible";
    case DistributionStatus::NoContact:
      return "NoContact";
    case DistributionStatus::NumericalFailure:
      return "NumericalFailure";
  }
  return "unknown status";
}

std::ostream& operator<<(std::ostream& out, DistributionStatus status) {
  return out << to_string(status);
}

struct WrenchDistribution::Workspace {
  // What one contact brings: its inequalities A λ ≤ b, first unilaterality, then friction.
  struct Contact {
    Eigen::MatrixXd A;
    Eigen::VectorXd b;
    Eigen::VectorXd weights;
    Eigen::Matrix<double, 6, Eigen::Dynamic> NE;
  };

  // The first `count` elements are the problem's; those behind wait for a larger one.
  std::vector<Contact> contacts;
  std::size_t count = 0;
  Eigen::VectorXd forces;

  // The problem as the solver wants it, and its answer. Its variable is y = W λ / ‖w‖, with W the
  // weights over their largest: the cost's Hessian and the inverse of its root are the identity,
  // and the solver's tolerances, which are absolute, mean the same for a mouse and for an elephant.
  Eigen::VectorXd inverse_weights;
  Eigen::MatrixXd hessian, equalities, inequalities;
  Eigen::VectorXd gradient, equalities_rhs, inequalities_rhs, y;
  EiquadprogFast solver;

  void assemble(const Eigen::Matrix<double, 6, 1>& wrench, double scale);
  bool isAccurate() const;
};

// Brings the contacts into the solver's form: H = 1, equalities E y + e = 0, inequalities
// I y + i ≥ 0.
void WrenchDistribution::Workspace::assemble(const Eigen::Matrix<double, 6, 1>& wrench,
                                             double scale) {
  Eigen::Index n = 0, m = 0;
  double largest_weight = 0.;
  for (std::size_t k = 0; k < count; ++k) {
    n += contacts[k].A.cols();
    m += contacts[k].A.rows();
    largest_weight = std::max(largest_weight, contacts[k].weights.maxCoeff());
  }
  if (n != gradient.size() || m != inequalities_rhs.size()) {
    solver.reset(n, 6, m);
    solver.is_inverse_provided_ = true;
    hessian.setIdentity(n, n);
    gradient.setZero(n);
    equalities.resize(6, n);
    equalities_rhs.resize(6);
    inequalities.resize(m, n);
    inequalities_rhs.resize(m);
    inverse_weights.resize(n);
    y.resize(n);
  }

  inequalities.setZero();
  Eigen::Index col = 0, row = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const Contact& contact = contacts[k];
    const Eigen::Index cols = contact.A.cols(), rows = contact.A.rows();
    inverse_weights.segment(col, cols) = largest_weight * contact.weights.cwiseInverse();
    for (Eigen::Index j = 0; j < cols; ++j) {
      equalities.col(col + j) = inverse_weights[col + j] * contact.NE.col(j);
      inequalities.col(col + j).segment(row, rows) = -inverse_weights[col + j] * contact.A.col(j);
    }
    inequalities_rhs.segment(row, rows) = contact.b / scale;
    col += cols;
    row += rows;
  }
  equalities_rhs = -wrench / scale;
}

// Whether y is what the solver says it is. It takes nothing on trust: with dependent constraints
// the solver has been seen to stop at a point that is not feasible.
bool WrenchDistribution::Workspace::isAccurate() const {
  for (Eigen::Index i = 0; i < 6; ++i)
    if (!(std::abs(equalities.row(i).dot(y) + equalities_rhs[i]) <= kTolerance)) return false;
  for (Eigen::Index i = 0; i < inequalities.rows(); ++i)
    if (!(inequalities.row(i).dot(y) + inequalities_rhs[i] >= -kTolerance)) return false;
  return true;
}

WrenchDistribution::WrenchDistribution() : work_(std::make_unique<Workspace>()) {}
WrenchDistribution::WrenchDistribution(const WrenchDistribution& other)
    : work_(std::make_unique<Workspace>(*other.work_)) {}
WrenchDistribution::WrenchDistribution(WrenchDistribution&&) noexcept = default;
WrenchDistribution& WrenchDistribution::operator=(WrenchDistribution other) noexcept {
  std::swap(work_, other.work_);
  return *this;
}
WrenchDistribution::~WrenchDistribution() = default;

void WrenchDistribution::clear() { work_->count = 0; }

void WrenchDistribution::add(const ContactBase& contact) {
  Workspace& work = *work_;
  if (work.count == work.contacts.size()) work.contacts.emplace_back();
  Workspace::Contact& added = work.contacts[work.count++];
  added.A.resize(contact.uni_rows() + contact.fri_rows(), contact.cols());
  added.A.topRows(contact.uni_rows()) = contact.uni_A();
  added.A.bottomRows(contact.fri_rows()) = contact.fri_A();
  added.b.resize(added.A.rows());
  added.b.head(contact.uni_rows()) = contact.uni_b();
  added.b.tail(contact.fri_rows()) = contact.fri_b();
  added.weights = contact.reg_A();
  added.NE = contact.ne_A();
}

DistributionStatus WrenchDistribution::solve(const Eigen::Matrix<double, 6, 1>& wrench) {
  Workspace& work = *work_;
  Eigen::Index n = 0;
  for (std::size_t k = 0; k < work.count; ++k) n += work.contacts[k].A.cols();
  work.forces.setZero(n);
  if (n == 0) return DistributionStatus::NoContact;

  const double scale = wrench.norm();
  if (scale == 0.) return DistributionStatus::Solved;
  work.assemble(wrench, scale);
  if (!work.equalities.allFinite() || !work.equalities_rhs.allFinite())
    return DistributionStatus::NumericalFailure;

  // The solver rotates its factor in place; every solve begins with the identity.
  work.solver.m_J.setIdentity(n, n);
  switch (work.solver.solve_quadprog(work.hessian, work.gradient, work.equalities,
                                     work.equalities_rhs, work.inequalities, work.inequalities_rhs,
                                     work.y)) {
    case EIQUADPROG_FAST_OPTIMAL:
      break;
    case EIQUADPROG_FAST_INFEASIBLE:
    case EIQUADPROG_FAST_UNBOUNDED:  // the dual's unboundedness, which is infeasibility
      return DistributionStatus::Infeasible;
    default:
      return DistributionStatus::NumericalFailure;
  }
  if (!work.isAccurate()) return DistributionStatus::NumericalFailure;
  work.forces = scale * work.inverse_weights.cwiseProduct(work.y);
  return DistributionStatus::Solved;
}

const Eigen::VectorXd& WrenchDistribution::forces() const { return work_->forces; }

}  // namespace dynacom
