// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/motion.hpp"

#include <algorithm>
#include <cmath>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <vector>

#include "check.hpp"

namespace dynacom {

using internal::throwInvalid;

namespace {

// How far a quaternion's squared norm may be from 1: files are often rounded to a few digits.
constexpr double kNormalized = 1e-3;
// What mismatches of derivatives are a part of at least: [m/s, rad/s], [m/s², rad/s²].
constexpr double kLeastVelocity = 0.05, kLeastAcceleration = 0.5;

void requireFrames(const char* name, const Eigen::MatrixXd& values, Eigen::Index size,
                   const char* unit, Eigen::Index frames) {
  internal::requireSize(name, values.rows(), size, unit);
  internal::requireSize(name, values.cols(), frames, "frames");
  for (Eigen::Index frame = 0; frame < frames; ++frame)
    if (!values.col(frame).allFinite())
      throwInvalid(name, " must be finite, got another number in frame ", frame);
}

void requireTime(const Eigen::VectorXd& time) {
  if (time.size() == 0) throwInvalid("time must have at least one frame, got 0");
  for (Eigen::Index frame = 0; frame < time.size(); ++frame) {
    if (!std::isfinite(time[frame]))
      throwInvalid("time must be finite, got ", time[frame], " in frame ", frame);
    if (frame > 0 && !(time[frame] > time[frame - 1]))
      throwInvalid("time must increase, got ", time[frame - 1], " s and then ", time[frame],
                   " s in frame ", frame);
  }
}

void requireConfigurations(const pinocchio::Model& model, const Eigen::MatrixXd& q,
                           Eigen::Index frames) {
  requireFrames("q", q, model.nq, "components (nq)", frames);
  for (Eigen::Index frame = 0; frame < frames; ++frame)
    if (!pinocchio::isNormalized(model, q.col(frame), kNormalized))
      throwInvalid("q must have quaternions of norm 1, got another in frame ", frame);
}

// A model with the configurations of another, in which the steps of a free-flyer are those of its
// place in the world and of its orientation, independently: a body that flies straight on while it
// turns does so for the filter, too.
pinocchio::Model separateFreeFlyers(const pinocchio::Model& model) {
  pinocchio::Model separated;
  for (pinocchio::JointIndex joint = 1; joint < pinocchio::JointIndex(model.njoints); ++joint) {
    const pinocchio::SE3 placement = pinocchio::SE3::Identity();
    const std::string& name = model.names[joint];
    if (model.joints[joint].shortname() == pinocchio::JointModelFreeFlyer::classname()) {
      separated.addJoint(0, pinocchio::JointModelTranslation(), placement, name + " position");
      separated.addJoint(0, pinocchio::JointModelSpherical(), placement, name + " orientation");
    } else {
      separated.addJoint(0, model.joints[joint], placement, name);
    }
  }
  return separated;
}

// A second-order section of a low-pass filter, with b₁ = 2 b₀ and b₂ = b₀,
//
//     y[t] = b₀ (x[t] + 2 x[t−1] + x[t−2]) − a₁ y[t−1] − a₂ y[t−2].
//
// b₀ + b₁ + b₂ − a₁ − a₂ = 1, so that it does not matter from which point all of these are
// measured. From y[t−1], that one is zero, and the others are small.
struct Section {
  double b, a2;

  // One of the two sections of a Butterworth filter of fourth order, by the bilinear transform.
  static Section butterworth(int number, double cutoff_over_rate) {
    const double pi = std::acos(-1.);
    const double k = std::tan(pi * cutoff_over_rate);
    const double damping = 2. * std::cos(pi * (2 * number + 1) / 8.);
    const double scale = 1. / (1. + damping * k + k * k);
    return {k * k * scale, (1. - damping * k + k * k) * scale};
  }

  // Filters columns in place, from the first to the last; before the first all was as it is there.
  void filter(const pinocchio::Model& model, Eigen::MatrixXd& q) const {
    Eigen::VectorXd x1 = q.col(0), x2 = x1, y1 = x1, y2 = x1, y(x1.size());
    Eigen::VectorXd difference(model.nv), step(model.nv);
    for (Eigen::Index frame = 0; frame < q.cols(); ++frame) {
      step.setZero();
      const auto add = [&](double factor, const Eigen::VectorXd& point) {
        pinocchio::difference(model, y1, point, difference);
        step += factor * difference;
      };
      add(b, q.col(frame));
      add(2. * b, x1);
      add(b, x2);
      add(-a2, y2);
      pinocchio::integrate(model, y1, step, y);
      pinocchio::normalize(model, y);
      x2.swap(x1);
      x1 = q.col(frame);
      y2.swap(y1);
      y1 = y;
      q.col(frame) = y;
    }
  }
};

}  // namespace

void Motion::validate(const pinocchio::Model& model) const {
  requireTime(time);
  requireConfigurations(model, q, frames());
  requireFrames("v", v, model.nv, "components (nv)", frames());
  requireFrames("a", a, model.nv, "components (nv)", frames());
}

Eigen::MatrixXd filterConfigurations(const pinocchio::Model& model, const Eigen::MatrixXd& q,
                                     double rate, double cutoff) {
  if (!(rate > 0.) || !std::isfinite(rate))
    throwInvalid("rate must be finite and > 0 Hz, got ", rate);
  if (!(cutoff > 0.) || !(cutoff < kMaximalCutoff * rate))
    throwInvalid("cutoff must be > 0 and < ", kMaximalCutoff * rate, " Hz, which is ",
                 kMaximalCutoff, " of the frame rate, got ", cutoff, " Hz");
  const Eigen::Index frames = q.cols();
  requireConfigurations(model, q, frames);
  if (frames < 2) return q;

  // Eight periods of the cut-off are enough for the filter to have forgotten how it began.
  const auto periods = static_cast<Eigen::Index>(std::ceil(8. * rate / cutoff));
  const Eigen::Index padding = std::min(frames - 1, periods);
  const pinocchio::Model separated = separateFreeFlyers(model);
  Eigen::MatrixXd padded(model.nq, frames + 2 * padding);
  padded.middleCols(padding, frames) = q;
  // Step by step: what lies further away may have turned by more than a tangent space can tell.
  Eigen::VectorXd step(model.nv), next(model.nq);
  const auto reflect = [&](Eigen::Index from, Eigen::Index to, Eigen::Index at, int direction) {
    pinocchio::difference(separated, padded.col(from), padded.col(to), step);
    step = -step;
    pinocchio::integrate(separated, padded.col(at), step, next);
    padded.col(at + direction) = next;
  };
  const Eigen::Index first = padding, last = padding + frames - 1;
  for (Eigen::Index k = 0; k < padding; ++k) {
    reflect(first + k, first + k + 1, first - k, -1);
    reflect(last - k, last - k - 1, last + k, 1);
  }
  for (int pass = 0; pass < 2; ++pass) {
    for (const int number : {0, 1})
      Section::butterworth(number, cutoff / rate).filter(separated, padded);
    padded.rowwise().reverseInPlace();
  }
  return padded.middleCols(padding, frames);
}

Motion differentiate(const pinocchio::Model& model, const Eigen::VectorXd& time,
                     const Eigen::MatrixXd& q) {
  requireTime(time);
  const Eigen::Index frames = time.size();
  requireConfigurations(model, q, frames);
  Motion motion{time, q, Eigen::MatrixXd::Zero(model.nv, frames),
                Eigen::MatrixXd::Zero(model.nv, frames)};
  if (frames < 2) return motion;

  Eigen::VectorXd first(model.nv), second(model.nv);
  // The parabola v s + ½ a s² through zero at s = 0 and two differences at others.
  const auto fit = [&](Eigen::Index frame, Eigen::Index one, Eigen::Index other) {
    pinocchio::difference(model, q.col(frame), q.col(one), first);
    pinocchio::difference(model, q.col(frame), q.col(other), second);
    const double s1 = time[one] - time[frame], s2 = time[other] - time[frame];
    motion.a.col(frame) = 2. * (second / s2 - first / s1) / (s2 - s1);
    motion.v.col(frame) = first / s1 - 0.5 * s1 * motion.a.col(frame);
  };
  if (frames == 2) {
    for (const Eigen::Index frame : {0, 1}) {
      pinocchio::difference(model, q.col(frame), q.col(1 - frame), first);
      motion.v.col(frame) = first / (time[1 - frame] - time[frame]);
    }
    return motion;
  }
  fit(0, 1, 2);
  for (Eigen::Index frame = 1; frame + 1 < frames; ++frame) fit(frame, frame - 1, frame + 1);
  fit(frames - 1, frames - 2, frames - 3);
  return motion;
}

DerivativeMismatch compareDerivatives(const pinocchio::Model& model, const Motion& motion) {
  motion.validate(model);
  // Apart, because joints move more than the root, of which a little error is a large force.
  const bool flies = model.njoints > 1 && model.joints[1].nv() == 6;
  const std::vector<Eigen::Index> begins =
      flies ? std::vector<Eigen::Index>{0, 3, 6, model.nv} : std::vector<Eigen::Index>{0, model.nv};

  // Mean squares of a part: of what does not fit, and of the derivatives themselves.
  struct Part {
    double mismatch = 0., size = 0.;

    void add(const Eigen::Ref<const Eigen::VectorXd>& slope,
             const Eigen::Ref<const Eigen::VectorXd>& from,
             const Eigen::Ref<const Eigen::VectorXd>& to) {
      mismatch += std::min({(slope - from).squaredNorm(), (slope - to).squaredNorm(),
                            (slope - 0.5 * (from + to)).squaredNorm()});
      size += 0.5 * (from.squaredNorm() + to.squaredNorm());
    }
    double ratio(double steps, double least) const {
      return std::sqrt(mismatch / steps) / std::max(std::sqrt(size / steps), least);
    }
  };
  const std::size_t count = begins.size() - 1;
  std::vector<Part> velocities(count), accelerations(count);
  Eigen::VectorXd step(model.nv), slope(model.nv);
  const Eigen::Index steps = motion.frames() - 1;
  for (Eigen::Index frame = 0; frame < steps; ++frame) {
    const double duration = motion.time[frame + 1] - motion.time[frame];
    pinocchio::difference(model, motion.q.col(frame), motion.q.col(frame + 1), step);
    step /= duration;
    slope = (motion.v.col(frame + 1) - motion.v.col(frame)) / duration;
    for (std::size_t part = 0; part < count; ++part) {
      const Eigen::Index begin = begins[part], size = begins[part + 1] - begin;
      const auto segment = [&](const Eigen::MatrixXd& values, Eigen::Index column) {
        return values.col(column).segment(begin, size);
      };
      velocities[part].add(step.segment(begin, size), segment(motion.v, frame),
                           segment(motion.v, frame + 1));
      accelerations[part].add(slope.segment(begin, size), segment(motion.a, frame),
                              segment(motion.a, frame + 1));
    }
  }
  DerivativeMismatch mismatch{0., 0.};
  if (steps == 0) return mismatch;
  for (std::size_t part = 0; part < count; ++part) {
    mismatch.velocity =
        std::max(mismatch.velocity, velocities[part].ratio(double(steps), kLeastVelocity));
    mismatch.acceleration = std::max(mismatch.acceleration,
                                     accelerations[part].ratio(double(steps), kLeastAcceleration));
  }
  return mismatch;
}

}  // namespace dynacom
