// SPDX-License-Identifier: BSD-2-Clause
#include "centroidal_window.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <pinocchio/spatial.hpp>

namespace dynacom::internal {

using Eigen::Index;

namespace {

// Of ADMM: the penalty to begin with, for what cannot be given, squared, in a second, and
// over-relaxation. Dances and walks take 9 to 13 iterations with these, from 300 to 2000.
constexpr double kPenalty = 1000., kRelaxation = 1.6;
// Who leans all the time needs a larger penalty: every so many iterations it is made larger or
// smaller by a factor, if what is missing is so many times what changes of the wrenches, or the
// other way round (Boyd et al., 3.4.1).
constexpr int kAdaptation = 5;
constexpr double kImbalance = 4., kFactor = 8.;
// A displacement that is smaller does not matter, and one that is larger is none, RMS [m].
constexpr double kNegligible = 1e-5, kLost = 10.;
// Moments count as forces with this lever [m].
constexpr double kLever = 1.;

constexpr double square(double value) { return value * value; }

}  // namespace

CentroidalWindow::CentroidalWindow(const CentroidalProblem& problem,
                                   const CentroidalFilterSettings& settings)
    : problem_(problem),
      settings_(settings),
      of_displacement_(1. / square(settings.com)),
      of_acceleration_(square(problem.gravity / settings.com_acceleration)),
      of_momentum_(1. / square(settings.angular_momentum)),
      projection_(kLever),
      levers_(3, Index(problem.points.size())) {}

Eigen::Vector3d CentroidalWindow::angularMomentum(Index k) const {
  Eigen::Vector3d sum = x_.col(k).tail<3>();
  if (k > 0) sum += x_.col(k - 1).tail<3>();
  return 0.5 * sum;
}

void CentroidalWindow::solve(Index first, Index frames) {
  first_ = first;
  frames_ = frames;
  discretize();
  const auto count = static_cast<std::size_t>(frames);
  x_.setZero(6, frames);
  step_.setZero(6, frames);
  for (Vectors* values : {&dual_, &last_given_}) values->assign(count, Vector6::Zero());
  answers_.assign(count, {});
  moved_.resize(count);
  for (Index k = 0; k < frames; ++k) moved_[at(k)] = problem_.wrench.col(first + k);
  given_ = moved_;
  penalty_ = kPenalty;
  factorize();
  project();
  converged_ = false;
  for (iterations_ = 1; iterations_ <= settings_.maximal_iterations; ++iterations_) {
    change();
    last_given_ = given_;
    project();
    converged_ = isDone();
    if (converged_ || !(x_.topRows<3>().squaredNorm() < square(kLost) * double(frames))) return;
    if (iterations_ % kAdaptation == 0) {
      adaptPenalty();
      factorize();
    }
  }
  --iterations_;
}

// Second differences for times that need not be even, of a path that stays at its first and last
// place before and behind the window. Where an end is in flight, nobody knows how fast the CoM was
// before: nothing is asked there, and nothing costs.
void CentroidalWindow::discretize() {
  differences_.resize(static_cast<std::size_t>(frames_));
  if (frames_ == 1) {  // as long as one likes
    differences_[0] = {0., 0., 0., 1., 0., problem_.free[first_] ? 0. : 1.};
    return;
  }
  for (Index k = 0; k < frames_; ++k) {
    const auto stepFrom = [&](Index frame) {
      return problem_.time[first_ + frame + 1] - problem_.time[first_ + frame];
    };
    const double before = stepFrom(std::max<Index>(k - 1, 0));
    const double after = stepFrom(std::min(k, frames_ - 2));
    const double duration = 0.5 * (before + after);
    const double to_before = k > 0 ? 1. / (before * duration * problem_.gravity) : 0.;
    const double to_after = isLast(k) ? 0. : 1. / (after * duration * problem_.gravity);
    const bool is_open = (k == 0 || isLast(k)) && isFlight(k);
    differences_[at(k)] = {
        to_before, -to_before - to_after,           to_after,
        duration,  is_open ? 0. : of_acceleration_, is_open || problem_.free[first_ + k] ? 0. : 1.};
  }
}

bool CentroidalWindow::isFlight(Index k) const { return problem_.sets[at(first_ + k)] == 0; }

// δ̈ over g.
Eigen::Vector3d CentroidalWindow::acceleration(Index k) const {
  const Difference& difference = differences_[at(k)];
  Eigen::Vector3d sum = difference.here * x_.col(k).head<3>();
  if (k > 0) sum += difference.before * x_.col(k - 1).head<3>();
  if (!isLast(k)) sum += difference.after * x_.col(k + 1).head<3>();
  return sum;
}

// About the CoM of before; in flight, where there must be none about any point, about that of
// after, which is linear in the changes.
CentroidalWindow::Vector6 CentroidalWindow::computeWrench(Index k) const {
  Vector6 wrench = problem_.wrench.col(first_ + k);
  wrench.head<3>() += acceleration(k);
  Eigen::Vector3d momentum_step = Eigen::Vector3d::Zero();
  if (!isLast(k)) momentum_step += x_.col(k).tail<3>();
  if (k > 0) momentum_step -= x_.col(k - 1).tail<3>();
  wrench.tail<3>() += momentum_step / differences_[at(k)].duration;
  if (!isFlight(k))
    wrench.tail<3>() += x_.col(k).head<3>().cross(Eigen::Vector3d(wrench.head<3>()));
  return wrench;
}

// The second derivative of the augmented Lagrangian, in which a frame's wrench has the derivative A
// by the changes of the frame and its neighbours.
void CentroidalWindow::factorize() {
  system_.resize(6, frames_, 2);
  Eigen::Matrix<double, 6, 18> A;
  for (Index k = 0; k < frames_; ++k) {
    const Difference& difference = differences_[at(k)];
    const double dt = difference.duration;
    system_(k, k).diagonal().head<3>().array() += dt * of_displacement_;
    system_(k, k).diagonal().tail<3>().array() += dt * of_momentum_;
    const double factors[3] = {difference.before, difference.here, difference.after};
    A.setZero();
    for (int i = 0; i < 3; ++i) A.block<3, 3>(0, 6 * i).diagonal().setConstant(factors[i]);
    if (!isFlight(k)) {
      const Eigen::Matrix3d displaced = pinocchio::skew(x_.col(k).head<3>()) / kLever;
      for (int i = 0; i < 3; ++i) A.block<3, 3>(3, 6 * i) = factors[i] * displaced;
      A.block<3, 3>(3, 6) -= pinocchio::skew(moved_[at(k)].head<3>()) / kLever;
    }
    if (!isLast(k)) A.block<3, 3>(3, 9).diagonal().setConstant(1. / (dt * kLever));
    if (k > 0) A.block<3, 3>(3, 3).diagonal().setConstant(-1. / (dt * kLever));
    const Eigen::Matrix<double, 18, 18> square =
        dt * penalty_ * difference.asked * (A.transpose() * A);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j <= i; ++j) {
        const Index row = k - 1 + i, column = k - 1 + j;
        if (column < 0 || row >= frames_) continue;
        system_(row, column) += square.block<6, 6>(6 * i, 6 * j);
        system_(row, column).diagonal().head<3>().array() +=
            dt * difference.cost * factors[i] * factors[j];
      }
  }
  system_.factorize();
}

// Newton's step to the changes that minimise the augmented Lagrangian, with the factors that there
// are, and the gradient of now.
void CentroidalWindow::change() {
  step_.setZero();
  for (Index k = 0; k < frames_; ++k) {
    const Difference& difference = differences_[at(k)];
    const double dt = difference.duration;
    step_.col(k).head<3>() -= dt * of_displacement_ * x_.col(k).head<3>();
    step_.col(k).tail<3>() -= dt * of_momentum_ * x_.col(k).tail<3>();
    Eigen::Vector3d by_acceleration = difference.cost * acceleration(k);
    if (difference.asked > 0.) {
      const Vector6 off = penalty_ * (moved_[at(k)] - given_[at(k)] + dual_[at(k)]);
      const Eigen::Vector3d by_moment = off.tail<3>() / square(kLever);
      by_acceleration += off.head<3>();
      if (!isFlight(k)) {
        const Eigen::Vector3d force = moved_[at(k)].head<3>(), displaced = x_.col(k).head<3>();
        by_acceleration += by_moment.cross(displaced);
        step_.col(k).head<3>() -= dt * force.cross(by_moment);
      }
      if (!isLast(k)) step_.col(k).tail<3>() -= by_moment;
      if (k > 0) step_.col(k - 1).tail<3>() += by_moment;
    }
    step_.col(k).head<3>() -= dt * difference.here * by_acceleration;
    if (k > 0) step_.col(k - 1).head<3>() -= dt * difference.before * by_acceleration;
    if (!isLast(k)) step_.col(k + 1).head<3>() -= dt * difference.after * by_acceleration;
  }
  system_.solve(step_);
  x_ += step_;
  for (Index k = 0; k < frames_; ++k) moved_[at(k)] = computeWrench(k);
}

// The wrenches that contacts can give closest to those after the change, and the multipliers.
void CentroidalWindow::project() {
  for (Index k = 0; k < frames_; ++k) {
    const Index frame = first_ + k;
    if (differences_[at(k)].asked == 0.) {
      given_[at(k)] = moved_[at(k)];
      continue;
    }
    const Vector6 target =
        kRelaxation * moved_[at(k)] + (1. - kRelaxation) * given_[at(k)] + dual_[at(k)];
    const std::uint32_t set = problem_.sets[at(frame)];
    dual_[at(k)] = target;
    if (set != 0) {
      for (std::size_t point = 0; point < problem_.points.size(); ++point)
        if (set >> point & 1u)
          levers_.col(Index(point)) = problem_.points[point]->col(frame) - problem_.com.col(frame);
      projection_.setAnswer(answers_[at(k)]);
      projection_.project(target, levers_, problem_.friction, set);
      answers_[at(k)] = projection_.answer();
      dual_[at(k)] = projection_.residual();
    }
    given_[at(k)] = target - dual_[at(k)];
  }
}

bool CentroidalWindow::isDone() const {
  double missing = 0., step = 0., size = 0.;
  for (Index k = 0; k < frames_; ++k) {
    missing += residual(k).squaredNorm();
    step += step_.col(k).head<3>().squaredNorm();
    size += x_.col(k).head<3>().squaredNorm();
  }
  const auto frames = double(frames_);
  return missing <= square(settings_.reach) * frames &&
         step <= square(settings_.change) * (size + square(kNegligible) * frames);
}

void CentroidalWindow::adaptPenalty() {
  double missing = 0., moved = 0.;
  for (Index k = 0; k < frames_; ++k) {
    missing += residual(k).squaredNorm();
    moved += (given_[at(k)] - last_given_[at(k)]).squaredNorm();
  }
  double factor = 1.;
  if (missing > square(kImbalance) * moved) factor = kFactor;
  if (moved > square(kImbalance) * missing) factor = 1. / kFactor;
  if (factor == 1.) return;
  penalty_ *= factor;
  for (Vector6& dual : dual_) dual /= factor;
}

}  // namespace dynacom::internal
