// SPDX-License-Identifier: BSD-2-Clause
#include "problem_checker.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

namespace dynacom_tests {

namespace {

using Real = long double;
using R3 = Eigen::Matrix<Real, 3, 1>;
using R6 = Eigen::Matrix<Real, 6, 1>;
using RX = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
using dynacom::DistributionStatus;
using Eigen::Index;

R6 wrenchOf(const ProblemContact& contact, const RX& force) {
  const Eigen::Matrix<Real, 3, 3> rotation = contact.rotation.cast<Real>();
  const R3 f = rotation * force.head<3>();
  R3 moment = contact.lever.cast<Real>().cross(f);
  if (!contact.is_point) moment += rotation * force.tail<3>();
  R6 wrench;
  wrench << f, moment;
  return wrench;
}

/// The linear function y·w of the contact's wrench as one of its force.
RX pullBack(const ProblemContact& contact, const R6& y) {
  const Eigen::Matrix<Real, 3, 3> rotation = contact.rotation.cast<Real>();
  const R3 moment = y.tail<3>();
  RX g(contact.is_point ? 3 : 6);
  g.head<3>() = rotation.transpose() * (y.head<3>() + moment.cross(contact.lever.cast<Real>()));
  if (!contact.is_point) g.tail<3>() = rotation.transpose() * moment;
  return g;
}

/// The largest g·λ over the contact's forces λ of unit normal force.
Real support(const ProblemContact& contact, const RX& g) {
  Real value = g[2] + contact.mu * (std::abs(g[0]) + std::abs(g[1]));
  if (!contact.is_point)
    value += contact.half_width * std::abs(g[3]) + contact.half_length * std::abs(g[4]) +
             contact.gu * std::abs(g[5]);
  return value;
}

/// By how much a force is outside the contact's cone.
Real violation(const ProblemContact& contact, const RX& force) {
  const Real normal = force[2];
  Real largest = std::max({-normal, std::abs(force[0]) - contact.mu * normal,
                           std::abs(force[1]) - contact.mu * normal});
  if (!contact.is_point)
    largest = std::max({largest, std::abs(force[3]) - contact.half_width * normal,
                        std::abs(force[4]) - contact.half_length * normal,
                        std::abs(force[5]) - contact.gu * normal});
  return largest;
}

/// y with NEᵀ y = Aᵀ μ', by least squares, from what the result says of the relaxation.
R6 findNormal(const Problem& problem, const dynacom::DistributionResult& result) {
  std::vector<RX> pulls;
  Index size = 0;
  for (const auto& contact : result.contacts) {
    pulls.push_back(contact.A.cast<Real>().transpose() *
                    contact.relaxation_multipliers.cast<Real>());
    size += pulls.back().size();
  }
  Eigen::Matrix<Real, Eigen::Dynamic, 6> matrix(size, 6);
  RX all_pulls(size);
  Index row = 0;
  for (std::size_t k = 0; k < pulls.size(); ++k) {
    const Index rows = pulls[k].size();
    for (int i = 0; i < 6; ++i)
      matrix.col(i).segment(row, rows) = pullBack(problem.contacts[k], R6::Unit(i));
    all_pulls.segment(row, rows) = pulls[k];
    row += rows;
  }
  return matrix.completeOrthogonalDecomposition().solve(all_pulls);
}

}  // namespace

Verdict check(const Problem& problem, const dynacom::DistributionResult& result) {
  Verdict verdict;
  const auto wrong = [&](const char* what) {
    if (verdict.error.empty()) verdict.error = what;
  };
  if (result.status != DistributionStatus::Solved && result.status != DistributionStatus::Relaxed) {
    wrong(to_string(result.status));
    return verdict;
  }

  const R6 weights = problem.wrench_weights.cast<Real>();
  const R6 wrench = problem.wrench.cast<Real>();
  const Real scale = std::max<Real>(weights.cwiseProduct(wrench).norm(), problem.minimal_scale);
  if (scale == 0.) return verdict;

  std::vector<RX> forces;
  R6 achieved = R6::Zero();
  Real cost = 0., outside = 0., all_normal = 0.;
  Real largest_weight = 0., least_weight = std::numeric_limits<Real>::infinity();
  for (std::size_t k = 0; k < problem.contacts.size(); ++k) {
    const ProblemContact& contact = problem.contacts[k];
    forces.push_back(result.contacts[k].force.cast<Real>());
    achieved += wrenchOf(contact, forces[k]);
    cost += contact.weights.cast<Real>().cwiseProduct(forces[k]).squaredNorm() / 2;
    outside = std::max(outside, violation(contact, forces[k]));
    all_normal += std::abs(forces[k][2]);
    largest_weight = std::max<Real>(largest_weight, contact.weights.maxCoeff());
    least_weight = std::min<Real>(least_weight, contact.weights.minCoeff());
  }
  verdict.outside_cone = static_cast<double>(outside / std::max(scale, all_normal));
  if (!(verdict.outside_cone <= 1e-9)) wrong("a force is outside its cone");

  const R6 residual = wrench - achieved;
  const Real distance = weights.cwiseProduct(residual).norm();
  verdict.residual = static_cast<double>(distance / scale);
  const R6 reported = result.residual.cast<Real>();
  if (!(weights.cwiseProduct(residual - reported).norm() <= 1e-13 * (scale + all_normal)))
    wrong("the residual is not what is reported");

  // Any reachable wrench c, of forces κ, has ‖D (w − c)‖ ≥ y·(w − c) / ‖D⁻¹ y‖ for every y, and
  // y·c ≤ Σ support κ_z. With y = D² r and normal forces κ_z of about our own size. Forces have 53
  // digits, times their weights, and so has r, which leaves a doubt about y and that bound.
  const Real spread = largest_weight / least_weight;
  const R6 y = weights.cwiseAbs2().cwiseProduct(residual);
  const Real weighted_normal = weights.maxCoeff() * all_normal;
  const Real doubt =
      4 * std::numeric_limits<double>::epsilon() * spread * (scale + weighted_normal);
  if (result.status == DistributionStatus::Relaxed) {
    Real excess = 0.;
    for (const ProblemContact& contact : problem.contacts)
      excess = std::max(excess, support(contact, pullBack(contact, y)));
    const Real least = (y.dot(wrench) - excess * (all_normal + scale)) / distance;
    verdict.residual_gap = static_cast<double>((distance - least) / distance);
    const Real allowed = 1e-6 + 10 * doubt * (weighted_normal + scale) / (distance * distance);
    if (!(verdict.residual_gap <= allowed)) wrong("a closer wrench is reachable");
    if (!(distance >= 1e-9 * scale)) wrong("Relaxed, but within reach");
    if (!problem.distance) verdict.residual_gap -= static_cast<double>(allowed - 1e-6);
  } else if (!(verdict.residual <= 1e-7)) {
    wrong("Solved, but not reached");
  }
  if (problem.distance) {  // known by construction
    verdict.residual_gap = static_cast<double>(distance / scale - *problem.distance);
    if (*problem.distance > 1e-7 && result.status == DistributionStatus::Solved)
      wrong("Solved, but out of reach");
    if (*problem.distance < 1e-9 && result.status == DistributionStatus::Relaxed)
      wrong("Relaxed, but within reach");
    if (!(std::abs(verdict.residual_gap) <= 1e-9 + 1e-6 * *problem.distance))
      wrong("the distance is another");
  }

  // Any forces κ that give the same wrench cost at least cost(λ) + W² λ·(κ − λ), which is
  // cost(λ) − Σ g·κ + Σ g·λ with g = NEᵀ ν − W² λ for every ν, and g·κ ≤ support κ_z. Where the
  // wrench is on the boundary, ν may be moved along y, which all such forces are orthogonal
  // to; that is more accurate by the relaxation's multipliers than by what is left of the wrench.
  const R6 nu = result.wrench_multipliers.cast<Real>();
  R6 normal_to_face = findNormal(problem, result);
  // Orthogonal to what is achieved, but for rounding, which a large multiple would not be.
  const R6 pulled = weights.cwiseAbs2().cwiseProduct(achieved);
  if (pulled.dot(achieved) > 0.)
    normal_to_face -= normal_to_face.dot(achieved) / pulled.dot(achieved) * pulled;
  const Real nu_norm = nu.cwiseQuotient(weights).norm();
  const Real normal_norm = normal_to_face.cwiseQuotient(weights).norm();
  // Forces are as good as their digits: 1e-9 of the scale is nothing.
  const Real nothing = 1e-9 * scale * largest_weight;
  const Real cost_scale = cost + nothing * nothing;
  Real cost_gap = std::numeric_limits<Real>::infinity();
  const bool on_face = normal_norm > 0.;
  for (int power = -7; power <= (on_face ? 24 : -7); ++power) {
    const Real along =
        power > -7 ? std::pow(Real(10), Real(power) / 2) * nu_norm / normal_norm : Real(0);
    const R6 multiplier = nu + along * normal_to_face;
    Real gap = 0.;
    for (std::size_t k = 0; k < problem.contacts.size(); ++k) {
      const ProblemContact& contact = problem.contacts[k];
      const RX g = pullBack(contact, multiplier) -
                   contact.weights.cast<Real>().cwiseAbs2().cwiseProduct(forces[k]);
      // No cheaper forces have a larger normal force than this.
      const Real normal = std::sqrt(2 * cost) / contact.weights[2];
      gap += std::max<Real>(0., support(contact, g)) * normal - g.dot(forces[k]);
    }
    cost_gap = std::min(cost_gap, gap / cost_scale);
  }
  verdict.cost_gap = static_cast<double>(cost_gap);
  if (!(verdict.cost_gap <= 1e-6)) wrong("cheaper forces may exist");
  return verdict;
}

}  // namespace dynacom_tests
