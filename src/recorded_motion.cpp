// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/recorded_motion.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "check.hpp"
#include "dynacom/centroidal.hpp"
#include "motion_check.hpp"
#include "motion_derivation.hpp"
#include "nan.hpp"
#include "standard_gravity.hpp"

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

// Of the configurations as they were recorded.
void estimateNoise(const internal::Derivation& derivation, const Eigen::VectorXd& time,
                   const Eigen::MatrixXd& q, DerivedMotion& derived) {
  const auto estimate = [&](Eigen::Index stride) {
    return internal::estimateAccelerationNoise(derivation.model, derivation.findCoM, time, q,
                                               stride);
  };
  const double rate = derived.frame_rate;
  derived.noise = derived.thinned_noise = estimate(1);
  if (rate >= 1.5 * kThinnedRate) {
    const auto stride =
        static_cast<Eigen::Index>(std::min(std::round(rate / kThinnedRate), double(time.size())));
    const double thinned = estimate(stride);
    if (!std::isnan(thinned)) derived.thinned_noise = thinned;
  }
}

// Says which cut-off suits the noise.
double chooseCutoff(const DerivedMotion& derived) {
  const double rate = derived.frame_rate;
  if (!(derived.thinned_noise <= kExactNoise))
    return std::isnan(rate) ? kMeasuredCutoff
                            : std::min(kMeasuredCutoff, kMeasuredCutoffPart * rate);
  return derived.noise <= kExactNoise ? 0. : kRoundedCutoff;
}

// Marks the frames near one end, the first or the last, of a motion that was filtered.
void markUnsure(const pinocchio::Model& model, pinocchio::Data& data, bool is_first,
                DerivedMotion& derived) {
  constexpr Eigen::Index kSamples = 4;
  const Motion& motion = derived.motion;
  const Eigen::Index last = motion.frames() - 1;
  const auto periods = [&](double count) {
    return std::min(static_cast<Eigen::Index>(count * derived.frame_rate / derived.cutoff), last);
  };
  double force = 0., torque = 0.;
  for (Eigen::Index sample = 0; sample < kSamples; ++sample) {
    const Eigen::Index away = sample * periods(1.) / (kSamples - 1);
    const Eigen::Index frame = is_first ? away : last - away;
    const CentroidalState state = computeCentroidalState(model, data, motion.q.col(frame),
                                                         motion.v.col(frame), motion.a.col(frame));
    const double gravity = internal::findUnitGravity(model.gravity.linear());
    const double weight = state.mass * gravity;
    force += (state.acom / gravity).squaredNorm() / double(kSamples);
    torque += (state.amVariation / weight).squaredNorm() / double(kSamples);
  }
  if (std::sqrt(force) <= kUnsureForce && std::sqrt(torque) <= kUnsureTorque) return;
  const Eigen::Index count = periods(0.5) + 1;
  (is_first ? derived.unsure.head(count) : derived.unsure.tail(count)).setConstant(true);
}

}  // namespace

bool DerivedMotion::isExact() const {
  if (cutoff == 0.) return is_told_exact || !(thinned_noise > kExactNoise);
  return is_automatic && thinned_noise <= kExactNoise;
}

double findFrameRate(const Eigen::VectorXd& time) {
  const Eigen::Index steps = time.size() - 1;
  if (steps < 1 || !internal::areFinite(time) || !(smallestStep(time) > 0.)) return kNaN;
  const double duration = time[steps] - time[0];
  const Eigen::VectorXd off = time - makeEven(time);
  const bool is_even =
      off.maxCoeff() - off.minCoeff() <= 2. * kEvenTimes * duration / double(steps);
  return is_even ? double(steps) / duration : kNaN;
}

namespace {

// Calls one of the functions below with what is needed for this once.
template <class Function>
DerivedMotion deriveOnce(const pinocchio::Model& model, Function derive) {
  internal::DataPool data([&] { return std::make_unique<pinocchio::Data>(model); });
  return derive(internal::Derivation{model, data, [&](const Eigen::MatrixXd& q) {
                                       return internal::findCoM(model, *data.take(), q);
                                     }});
}

}  // namespace

DerivedMotion rederiveMotion(const pinocchio::Model& model, const RecordedMotion& recorded,
                             double cutoff) {
  return deriveOnce(model, [&](const internal::Derivation& derivation) {
    return internal::rederiveMotion(derivation, recorded, cutoff);
  });
}

DerivedMotion deriveMotion(const pinocchio::Model& model, const RecordedMotion& recorded,
                           double cutoff) {
  return deriveOnce(model, [&](const internal::Derivation& derivation) {
    return internal::deriveMotion(derivation, recorded, cutoff);
  });
}

DerivedMotion internal::rederiveMotion(const Derivation& derivation, const RecordedMotion& recorded,
                                       double cutoff) {
  const pinocchio::Model& model = derivation.model;
  internal::requireTime(recorded.time);
  DerivedMotion derived = {};
  derived.mismatch = {kNaN, kNaN};
  derived.frame_rate = findFrameRate(recorded.time);
  const bool is_even = !std::isnan(derived.frame_rate);
  const Eigen::VectorXd time = is_even ? makeEven(recorded.time) : recorded.time;
  derived.is_automatic = std::isnan(cutoff) && recorded.time.size() > 1;
  internal::requireSize("q", recorded.q.rows(), Eigen::Index(model.nq), "components (nq)");
  internal::requireSize("q", recorded.q.cols(), recorded.time.size(), "frames");
  requireConfigurations(model, recorded.q, recorded.time.size());
  if (!std::isnan(cutoff) && !(cutoff >= 0. && std::isfinite(cutoff)))
    throwInvalid("cutoff must be finite and >= 0 Hz, got ", cutoff);
  estimateNoise(derivation, time, recorded.q, derived);
  derived.is_told_exact = recorded.is_exact;
  if (std::isnan(cutoff))
    cutoff = derived.is_automatic && !recorded.is_exact ? chooseCutoff(derived) : 0.;
  if (cutoff > 0. && recorded.time.size() > 1) {
    if (!is_even)
      throwInvalid("times must be evenly spaced to be filtered, got steps from ",
                   smallestStep(recorded.time), " to ", largestStep(recorded.time),
                   " s; without a filter (cutoff 0) they need not be");
    derived.cutoff = cutoff;
  }
  derived.motion = differentiate(
      model, time,
      derived.cutoff > 0.
          ? filterConfigurations(model, recorded.q, derived.frame_rate, derived.cutoff)
          : recorded.q);
  derived.motion.time = recorded.time;
  derived.unsure.setConstant(recorded.time.size(), false);
  if (derived.cutoff > 0.) {
    const auto data = derivation.data.take();
    for (const bool is_first : {true, false}) markUnsure(model, *data, is_first, derived);
  }
  if (is_even) derived.time_error = (recorded.time - time).cwiseAbs().maxCoeff();
  return derived;
}

DerivedMotion internal::deriveMotion(const Derivation& derivation, const RecordedMotion& recorded,
                                     double cutoff) {
  const pinocchio::Model& model = derivation.model;
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
    if (mismatch.velocity <= kVelocityMismatch && mismatch.acceleration <= kAccelerationMismatch) {
      DerivedMotion derived = {};
      derived.motion = std::move(motion);
      derived.is_recorded = true;
      derived.is_told_exact = recorded.is_exact;
      derived.mismatch = mismatch;
      derived.frame_rate = findFrameRate(recorded.time);
      const bool is_even = !std::isnan(derived.frame_rate);
      estimateNoise(derivation, is_even ? makeEven(recorded.time) : recorded.time, recorded.q,
                    derived);
      derived.unsure.setConstant(recorded.time.size(), false);
      return derived;
    }
  }
  DerivedMotion derived = rederiveMotion(derivation, recorded, cutoff);
  derived.mismatch = mismatch;
  return derived;
}

}  // namespace dynacom
