// SPDX-License-Identifier: BSD-2-Clause
#include "whole_body_balance.hpp"

#include <Eigen/Geometry>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <pinocchio/algorithm/joint-configuration.hpp>

#include "../standard_gravity.hpp"

namespace dynacom::internal {

using Eigen::Index;

namespace {
double env(const char* n, double d) {
  const char* s = getenv(n);
  return s ? atof(s) : d;
}
constexpr double kRelaxation = 1.6;
double now() { return clock() / 1e6; }
}  // namespace

WholeBodyBalance::WholeBodyBalance(const pinocchio::Model& model, std::vector<BodyPoint> points,
                                   const BalanceProblem& problem, const BalanceCosts& costs)
    : model_(model),
      problem_(problem),
      costs_(costs),
      linearizer_(model, std::move(points)),
      projection_(1.) {
  for (double mu : problem.mu) mu_.push_back(mu * (1. - costs.friction_margin));
}

void WholeBodyBalance::linearize() {
  linearizer_.run(problem_.time, q_, problem_.held, frames_);
  off_.assign(frames_.size(), Eigen::Matrix3Xd());
  held_rms_ = 0.; held_worst_ = 0.; double count = 0;
  for (std::size_t k = 0; k < frames_.size(); ++k) {
    off_[k].setZero(3, Index(problem_.mu.size()));
    for (std::uint32_t rest = problem_.held[k]; rest != 0; rest &= rest - 1) {
      const int p = __builtin_ctz(rest);
      off_[k].col(p) = frames_[k].points.col(p) - problem_.targets[std::size_t(p)].col(Index(k));
      held_rms_ += off_[k].col(p).squaredNorm(); ++count;
      held_worst_ = std::max(held_worst_, off_[k].col(p).norm());
    }
  }
  if (count) held_rms_ = std::sqrt(held_rms_ / count);
  // Cones that are shrunk, and how levers change the moment.
  for (std::size_t k = 0; k < frames_.size(); ++k) {
    LinearizedFrame& frame = frames_[k];
    const std::uint32_t set = problem_.sets[k];
    if (set == 0) continue;
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    for (std::uint32_t rest = set; rest != 0; rest &= rest - 1)
      centre += frame.points.col(__builtin_ctz(rest));
    centre /= double(__builtin_popcount(set));
    for (std::uint32_t rest = set; rest != 0; rest &= rest - 1) {
      auto point = frame.points.col(__builtin_ctz(rest));
      const Eigen::Vector3d inward = centre - point;
      const double size = inward.head<2>().norm();
      if (size > 0.) point += std::min(costs_.support_margin / size, 1.) * inward;
    }
    frame.points.colwise() -= frame.com;
    projection_.setAnswer(answers_[k]);
    projection_.project(frame.wrench, frame.points, mu_, set);
    answers_[k] = projection_.answer();
    auto& here = std::find_if(frame.terms.begin(), frame.terms.end(), [&](const auto& t) {
                   return t.frame == Index(k);
                 })->derivative;
    for (std::uint32_t rest = set; rest != 0; rest &= rest - 1) {
      const int point = __builtin_ctz(rest);
      const Eigen::Vector3d f = projection_.force(point, mu_);
      if (f.isZero(0.)) continue;
      for (Index c = 0; c < here.cols(); ++c)
        here.col(c).tail<3>() += f.cross(Eigen::Vector3d(frame.places[std::size_t(point)].col(c) - frame.of_com.col(c)));
    }
  }
}

bool WholeBodyBalance::factorize(double penalty, bool cost) {
  penalty_ = penalty;
  (void)cost;
  const Index n = Index(frames_.size()), nv = model_.nv;
  std::vector<Index> first;
  for (Index k = 0; k < n; ++k) first.push_back(std::max<Index>(k - 2, 0));
  first[3] = 0;
  first[std::size_t(n - 1)] = n - 4;
  system_.resize(nv, first);
  for (Index k = 0; k < n; ++k) {
    const double dt = durations_[std::size_t(k)];
    system_(k, k).diagonal().array() += dt * costs_.change.array().square().inverse();
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j <= i; ++j) {
        const Index row = k - 1 + i, column = k - 1 + j;
        if (column < 0 || row >= n) continue;
        system_(row, column).diagonal().array() += dt * differences_[std::size_t(k)][i] *
                                                   differences_[std::size_t(k)][j] *
                                                   costs_.acceleration.array().square().inverse();
      }
    for (std::uint32_t rest = problem_.held[std::size_t(k)]; rest != 0; rest &= rest - 1) {
      const auto& J = frames_[std::size_t(k)].places[std::size_t(__builtin_ctz(rest))];
      system_(k, k).noalias() += dt * problem_.hold * J.transpose() * J;
    }
    if (problem_.free[k]) continue;
    const auto& terms = frames_[std::size_t(k)].terms;
    const double weight = dt * penalty * flightFactor(k);
    for (std::size_t i = 0; i < terms.size(); ++i)
      for (std::size_t j = 0; j <= i; ++j)
        system_(terms[i].frame, terms[j].frame).noalias() +=
            weight * terms[i].derivative.transpose() * terms[j].derivative;
  }
  return system_.factorize();
}

// A step of ADMM; moved_ is where it leads by the linear model.
void WholeBodyBalance::iterate(bool cost) {
  const Index n = Index(frames_.size());
  step_.setZero(model_.nv, n);
  for (Index k = 0; k < n; ++k) {
    const double dt = durations_[std::size_t(k)];
    if (cost) {
      step_.col(k).array() -=
          dt * costs_.change.array().square().inverse() * change_.col(k).array();
      Eigen::VectorXd acc = differences_[std::size_t(k)][1] * change_.col(k);
      if (k > 0) acc += differences_[std::size_t(k)][0] * change_.col(k - 1);
      if (k + 1 < n) acc += differences_[std::size_t(k)][2] * change_.col(k + 1);
      acc.array() *= dt * costs_.acceleration.array().square().inverse();
      step_.col(k) -= differences_[std::size_t(k)][1] * acc;
      if (k > 0) step_.col(k - 1) -= differences_[std::size_t(k)][0] * acc;
      if (k + 1 < n) step_.col(k + 1) -= differences_[std::size_t(k)][2] * acc;
    }
    for (std::uint32_t rest = problem_.held[std::size_t(k)]; rest != 0; rest &= rest - 1) {
      const int p = __builtin_ctz(rest);
      step_.col(k).noalias() -= dt * problem_.hold * frames_[std::size_t(k)].places[std::size_t(p)].transpose() * off_[std::size_t(k)].col(p);
    }
    if (problem_.free[k]) continue;
    const double weight = dt * penalty_ * flightFactor(k);
    const Vector6 off = weight * (moved_.col(k) - given_.col(k) + dual_.col(k));
    for (const auto& term : frames_[std::size_t(k)].terms)
      step_.col(term.frame).noalias() -= term.derivative.transpose() * off;
  }
  system_.solve(step_);
  change_ += step_;
  for (Index k = 0; k < n; ++k)
    for (std::uint32_t rest = problem_.held[std::size_t(k)]; rest != 0; rest &= rest - 1) {
      const int p = __builtin_ctz(rest);
      off_[std::size_t(k)].col(p).noalias() += frames_[std::size_t(k)].places[std::size_t(p)] * step_.col(k);
    }
  for (Index k = 0; k < n; ++k)
    for (const auto& term : frames_[std::size_t(k)].terms)
      moved_.col(k).noalias() += term.derivative * step_.col(term.frame);
}

void WholeBodyBalance::project(bool relax) {
  worst_ = 0.;
  for (Index k = 0; k < Index(frames_.size()); ++k) {
    if (problem_.free[k]) {
      given_.col(k) = moved_.col(k);
      continue;
    }
    const double r = relax ? kRelaxation : 1.;
    const Vector6 target = r * moved_.col(k) + (1. - r) * given_.col(k) + dual_.col(k);
    dual_.col(k) = target;
    const std::uint32_t set = problem_.sets[std::size_t(k)];
    if (set != 0) {
      projection_.setAnswer(answers_[std::size_t(k)]);
      projection_.project(target, frames_[std::size_t(k)].points, mu_, set);
      answers_[std::size_t(k)] = projection_.answer();
      dual_.col(k) = projection_.residual();
    }
    given_.col(k) = target - dual_.col(k);
    worst_ = std::max(worst_, (moved_.col(k) - given_.col(k)).norm());
  }
}

void WholeBodyBalance::apply() {
  Eigen::VectorXd q(model_.nq);
  for (Index k = 0; k < change_.cols(); ++k) {
    pinocchio::integrate(model_, problem_.q.col(k), change_.col(k), q);
    q_.col(k) = q;
  }
}

void WholeBodyBalance::solve() {
  const Index n = problem_.time.size();
  frames_.resize(std::size_t(n));
  q_ = problem_.q;
  change_.setZero(model_.nv, n);
  given_.setZero(6, n);
  dual_.setZero(6, n);
  moved_.setZero(6, n);
  answers_.assign(std::size_t(n), {});
  durations_.resize(std::size_t(n));
  differences_.resize(std::size_t(n));
  for (Index k = 0; k < n; ++k) {
    const double before =
        problem_.time[std::max<Index>(k, 1)] - problem_.time[std::max<Index>(k - 1, 0)];
    const double after = problem_.time[std::min(k + 1, n - 1)] - problem_.time[std::min(k, n - 2)];
    const double dt = 0.5 * (before + after);
    durations_[std::size_t(k)] = dt;
    auto& d = differences_[std::size_t(k)];
    d[0] = k > 0 ? 1. / (before * dt) : 0.;
    d[2] = k + 1 < n ? 1. / (after * dt) : 0.;
    d[1] = -d[0] - d[2];
  }
  static const double rho = env("RHO", 2000.), polish = env("POLISH", 100.);
  static const int rounds = int(env("ROUNDS", 1)), its = int(env("ITS", 12)),
                   polishes = int(env("POLISHES", 2)), pits = int(env("PITS", 4));
  double t0 = now();
  for (int round = 0; round < rounds; ++round) {
    linearize();
    double t1 = now();
    for (Index k = 0; k < n; ++k) moved_.col(k) = frames_[std::size_t(k)].wrench;
    if (round == 0) {
      given_ = moved_;
      project(false);
    }
    double w0 = worst_;
    if (!factorize(rho, true)) {
      fprintf(stderr, "not spd\n");
      return;
    }
    double t2 = now();
    for (int it = 0; it < its; ++it) {
      iterate(true);
      project(true);
      if (getenv("VERBOSE")) fprintf(stderr, "  it %d worst %.2e\n", it, worst_);
    }
    double t3 = now();
    apply();
    if (getenv("VERBOSE"))
      fprintf(stderr,
              "round %d linearize %.0f us/frame factor %.0f its %.1f each; worst %.2e -> %.2e "
              "(linear)\n",
              round, 1e6 * (t1 - t0) / n, 1e6 * (t2 - t1) / n, 1e6 * (t3 - t2) / n / its, w0,
              worst_);
    t0 = now();
  }
  for (int round = 0; round <= polishes; ++round) {
    linearize();
    for (Index k = 0; k < n; ++k) moved_.col(k) = frames_[std::size_t(k)].wrench;
    dual_.setZero();
    given_ = moved_;
    project(false);
    dual_.setZero();
    if (getenv("VERBOSE")) {
      Index w = 0, c = 0;
      double m = 0;
      for (Index k = 0; k < n; ++k) {
        double x = (moved_.col(k) - given_.col(k)).norm();
        if (x > m) m = x, w = k;
        c += x > 1e-8;
      }
      fprintf(stderr, "polish %d true worst %.3e in frame %ld, %ld frames; held rms %.3f worst %.3f mm\n", round, m, w, c, 1e3*held_rms_, 1e3*held_worst_);
    }
    if (round == polishes) break;
    if (!factorize(rho * polish, false)) return;
    for (int it = 0; it < pits; ++it) {
      iterate(false);
      project(false);
    }
    apply();
  }
}

}  // namespace dynacom::internal
