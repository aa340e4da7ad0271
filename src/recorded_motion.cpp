// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/recorded_motion.hpp"

#include <cmath>
#include <utility>

#include "check.hpp"
#include "motion_check.hpp"
#include "nan.hpp"

namespace dynacom {

using internal::kNaN;
using internal::throwInvalid;

namespace {

// The times that an even frame rate has, from the first to the last.
Eigen::VectorXd makeEven(const Eigen::VectorXd& time) {
  return Eigen::VectorXd::LinSpaced(time.size(), time[0], time[time.size() - 1]);
}

double smallestStep(const Eigen::VectorXd& time) {
  const Eigen::Index steps = time.size() - 1;
  return (time.tail(steps) - time.head(steps)).minCoeff();
}

double largestStep(const Eigen::VectorXd& time) {
  const Eigen::Index steps = time.size() - 1;
  return (time.tail(steps) - time.head(steps)).maxCoeff();
}

}  // namespace

double findFrameRate(const Eigen::VectorXd& time) {
  const Eigen::Index steps = time.size() - 1;
  if (steps < 1 || !internal::areFinite(time) || !(smallestStep(time) > 0.)) return kNaN;
  const double duration = time[steps] - time[0];
  const Eigen::VectorXd off = time - makeEven(time);
  const bool is_even =
      off.maxCoeff() - off.minCoeff() <= 2. * kEvenTimes * duration / double(steps);
  return is_even ? double(steps) / duration : kNaN;
}

DerivedMotion rederiveMotion(const pinocchio::Model& model, const RecordedMotion& recorded,
                             double cutoff) {
  internal::requireTime(recorded.time);
  DerivedMotion derived = {};
  derived.mismatch = {kNaN, kNaN};
  derived.frame_rate = findFrameRate(recorded.time);
  const bool is_even = !std::isnan(derived.frame_rate);
  if (!(cutoff >= 0.) || !std::isfinite(cutoff))
    throwInvalid("cutoff must be finite and >= 0 Hz, got ", cutoff);
  if (cutoff > 0. && recorded.time.size() > 1) {
    if (!is_even)
      throwInvalid("times must be evenly spaced to be filtered, got steps from ",
                   smallestStep(recorded.time), " to ", largestStep(recorded.time),
                   " s; without a filter (cutoff 0) they need not be");
    derived.cutoff = cutoff;
  }
  const Eigen::VectorXd time = is_even ? makeEven(recorded.time) : recorded.time;
  derived.motion = differentiate(
      model, time,
      derived.cutoff > 0.
          ? filterConfigurations(model, recorded.q, derived.frame_rate, derived.cutoff)
          : recorded.q);
  derived.motion.time = recorded.time;
  if (is_even) derived.time_error = (recorded.time - time).cwiseAbs().maxCoeff();
  return derived;
}

DerivedMotion deriveMotion(const pinocchio::Model& model, const RecordedMotion& recorded,
                           double cutoff) {
  internal::requireTime(recorded.time);
  DerivativeMismatch mismatch = {kNaN, kNaN};
  for (const auto& [name, values] : {std::pair("v", &recorded.v), std::pair("a", &recorded.a)}) {
    if (values->cols() == 0) continue;
    internal::requireSize(name, values->rows(), Eigen::Index(model.nv), "components (nv)");
    internal::requireSize(name, values->cols(), recorded.time.size(), "frames");
  }
  if (recorded.v.cols() > 0 && recorded.a.cols() > 0) {
    Motion motion{recorded.time, recorded.q, recorded.v, recorded.a};
    mismatch = compareDerivatives(model, motion);
    if (mismatch.velocity <= kVelocityMismatch && mismatch.acceleration <= kAccelerationMismatch)
      return {std::move(motion), true, mismatch, findFrameRate(recorded.time), 0., 0.};
  }
  DerivedMotion derived = rederiveMotion(model, recorded, cutoff);
  derived.mismatch = mismatch;
  return derived;
}

}  // namespace dynacom
