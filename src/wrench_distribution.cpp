// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/wrench_distribution.hpp"

#include <algorithm>
#include <cmath>
#include <ostream>
#include <utility>
#include <vector>

#include "check.hpp"
#include "minimum_norm.hpp"

namespace dynacom {

namespace {

using internal::MinimumNorm;

// All for a wrench of unit size: by how much the solver may leave an inequality behind, and how far
// an answer may be from its inequalities and from the wrench.
constexpr double kTolerance = 1e-11;
constexpr double kAccurateInequality = 1e-9;
constexpr double kAccurateWrench = 1e-9;

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

  // The problem as the solver wants it. Its variable is x = W λ / scale, with W the weights over
  // their largest: the cost becomes the norm of x, and tolerances mean the same for a mouse and for
  // an elephant.
  Eigen::VectorXd inverse_weights;
  Eigen::MatrixXd E, G;               // columns: of NE W⁻¹, at unit length; of A W⁻¹
  Eigen::Matrix<double, 6, 1> norms;  // of the columns of E before
  Eigen::VectorXd d, h;
  MinimumNorm solver;

  void assemble(const Eigen::Matrix<double, 6, 1>& wrench, double scale);
};

void WrenchDistribution::Workspace::assemble(const Eigen::Matrix<double, 6, 1>& wrench,
                                             double scale) {
  Eigen::Index n = 0, m = 0;
  double largest_weight = 0.;
  for (std::size_t k = 0; k < count; ++k) {
    n += contacts[k].A.cols();
    m += contacts[k].A.rows();
    largest_weight = std::max(largest_weight, contacts[k].weights.maxCoeff());
  }
  inverse_weights.resize(n);
  E.resize(n, 6);
  G.setZero(n, m);
  h.resize(m);
  Eigen::Index col = 0, row = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const Contact& contact = contacts[k];
    const Eigen::Index cols = contact.A.cols(), rows = contact.A.rows();
    for (Eigen::Index i = 0; i < cols; ++i) {
      const double inverse_weight = largest_weight / contact.weights[i];
      inverse_weights[col + i] = inverse_weight;
      E.row(col + i) = inverse_weight * contact.NE.col(i).transpose();
      G.row(col + i).segment(row, rows) = inverse_weight * contact.A.col(i).transpose();
    }
    h.segment(row, rows) = contact.b / scale;
    col += cols;
    row += rows;
  }
  d = wrench / scale;
  for (Eigen::Index i = 0; i < 6; ++i) {
    norms[i] = E.col(i).norm();
    if (norms[i] == 0.) norms[i] = 1.;  // a component that the contacts cannot give
    E.col(i) /= norms[i];
    d[i] /= norms[i];
  }
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
  if (contact.cols() == 0) internal::throwInvalid("a contact was never initialised");
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

DistributionStatus WrenchDistribution::solve(const Eigen::Matrix<double, 6, 1>& wrench,
                                             double minimalScale) {
  Workspace& work = *work_;
  Eigen::Index n = 0;
  for (std::size_t k = 0; k < work.count; ++k) n += work.contacts[k].A.cols();
  work.forces.setZero(n);
  if (n == 0) return DistributionStatus::NoContact;

  if (!wrench.allFinite()) return DistributionStatus::NumericalFailure;
  const double scale = std::max(wrench.stableNorm(), minimalScale);
  if (!std::isfinite(scale)) return DistributionStatus::NumericalFailure;
  if (scale == 0.) return DistributionStatus::Solved;
  work.assemble(wrench, scale);
  if (!work.E.allFinite()) return DistributionStatus::NumericalFailure;

  switch (work.solver.solve(work.E, work.d, work.G, work.h, kTolerance)) {
    case MinimumNorm::Status::Solved:
      break;
    case MinimumNorm::Status::Infeasible:
      return DistributionStatus::Infeasible;
    case MinimumNorm::Status::IterationLimit:
      return DistributionStatus::NumericalFailure;
  }
  // The solver leaves out equalities that depend on others; if they contradict them, no forces give
  // the wrench.
  const Eigen::VectorXd& x = work.solver.x();
  for (Eigen::Index i = 0; i < 6; ++i)
    if (!(std::abs(work.E.col(i).dot(x) - work.d[i]) * work.norms[i] <= kAccurateWrench))
      return DistributionStatus::Infeasible;
  for (Eigen::Index j = 0; j < work.G.cols(); ++j)
    if (!(work.G.col(j).dot(x) - work.h[j] <= kAccurateInequality))
      return DistributionStatus::NumericalFailure;
  work.forces = scale * work.inverse_weights.cwiseProduct(x);
  if (!work.forces.allFinite()) {  // beyond the largest numbers
    work.forces.setZero();
    return DistributionStatus::NumericalFailure;
  }
  return DistributionStatus::Solved;
}

const Eigen::VectorXd& WrenchDistribution::forces() const { return work_->forces; }

}  // namespace dynacom
