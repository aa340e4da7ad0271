// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/motion.hpp"

#include <algorithm>
#include <cmath>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <vector>

#include "check.hpp"
#include "configuration_steps.hpp"
#include "motion_check.hpp"
#include "nan.hpp"

namespace dynacom {

using internal::requireConfigurations;
using internal::requireFrames;
using internal::requireTime;
using internal::throwInvalid;

namespace {

// What mismatches of derivatives are a part of at least: [m/s, rad/s], [m/s², rad/s²].
constexpr double kLeastVelocity = 0.05, kLeastAcceleration = 0.5;

// Rotation vectors and quaternions, as pinocchio::quaternion::log3() and exp3(): by their series
// where angles are small, as they are from frame to frame, since trigonometry takes most of the
// time that there is to it. Of squares below this, the terms left out are less than rounding.
constexpr double kSmallSquare = 0.01;

Eigen::Vector3d logarithm(const Eigen::Quaterniond& rotation) {
  const double t2 = rotation.vec().squaredNorm() / (rotation.w() * rotation.w());  // tan²(θ/2)
  if (!(rotation.w() > 0.) || !(t2 < kSmallSquare)) return pinocchio::quaternion::log3(rotation);
  double series = 0.;  // arctan(t) / t
  for (int k = 7; k >= 0; --k) series = 1. / (2 * k + 1) - t2 * series;
  return (2. * series / rotation.w()) * rotation.vec();
}

Eigen::Quaterniond exponential(const Eigen::Vector3d& rotation) {
  const double x2 = 0.25 * rotation.squaredNorm();  // (θ/2)²
  Eigen::Quaterniond exponential;
  if (!(x2 < kSmallSquare)) {
    pinocchio::quaternion::exp3(rotation, exponential);
    return exponential;
  }
  double sine = 1., cosine = 1.;  // sin(x) / x, and cos(x)
  for (int k = 6; k >= 1; --k) {
    sine = 1. - x2 * (1. / (2 * k * (2 * k + 1))) * sine;
    cosine = 1. - x2 * (1. / (2 * k * (2 * k - 1))) * cosine;
  }
  exponential.vec() = 0.5 * sine * rotation;
  exponential.w() = cosine;
  return exponential;
}

// Components of configurations, by how they move.

// Numbers, each on its own: joints, and places in the world.
struct Numbers {
  std::vector<Eigen::Index> components;

  Eigen::Index size() const { return Eigen::Index(components.size()); }
  void difference(const Eigen::VectorXd& from, const Eigen::VectorXd& to,
                  Eigen::VectorXd& step) const {
    step = to - from;
  }
  void integrate(const Eigen::VectorXd& from, const Eigen::VectorXd& step,
                 Eigen::VectorXd& to) const {
    to = from + step;
  }
};

// Quaternions.
struct Rotations {
  std::vector<Eigen::Index> components;

  Eigen::Index count() const { return Eigen::Index(components.size()) / 4; }
  Eigen::Index size() const { return 3 * count(); }
  void difference(const Eigen::VectorXd& from, const Eigen::VectorXd& to,
                  Eigen::VectorXd& step) const {
    for (Eigen::Index k = 0; k < count(); ++k)
      step.segment<3>(3 * k) = logarithm(read(from, k).conjugate() * read(to, k));
  }
  void integrate(const Eigen::VectorXd& from, const Eigen::VectorXd& step,
                 Eigen::VectorXd& to) const {
    for (Eigen::Index k = 0; k < count(); ++k)
      to.segment<4>(4 * k) =
          (read(from, k) * exponential(step.segment<3>(3 * k))).normalized().coeffs();
  }

 private:
  static Eigen::Map<const Eigen::Quaterniond> read(const Eigen::VectorXd& numbers, Eigen::Index k) {
    return Eigen::Map<const Eigen::Quaterniond>(numbers.data() + 4 * k);
  }
};

// All others: a model of nothing but these joints.
struct Others {
  std::vector<Eigen::Index> components;
  pinocchio::Model model;

  Eigen::Index size() const { return model.nv; }
  void difference(const Eigen::VectorXd& from, const Eigen::VectorXd& to,
                  Eigen::VectorXd& step) const {
    pinocchio::difference(model, from, to, step);
  }
  void integrate(const Eigen::VectorXd& from, const Eigen::VectorXd& step,
                 Eigen::VectorXd& to) const {
    pinocchio::integrate(model, from, step, to);
    pinocchio::normalize(model, to);
  }
};

// Takes the configurations of a model apart. The steps of a free-flyer are those of its place in
// the world and of its orientation, independently: a body that flies straight on while it turns
// does so for the filter, too.
void separate(const pinocchio::Model& model, Numbers& numbers, Rotations& rotations,
              Others& others) {
  const auto take = [](std::vector<Eigen::Index>& components, int first, int size) {
    for (int i = 0; i < size; ++i) components.push_back(first + i);
  };
  for (std::size_t k = 1; k < static_cast<std::size_t>(model.njoints); ++k) {
    const pinocchio::JointModel& joint = model.joints[k];
    const int first = joint.idx_q();
    const std::string name = joint.shortname();
    if (joint.nq() == joint.nv()) {
      take(numbers.components, first, joint.nq());
    } else if (name == pinocchio::JointModelFreeFlyer::classname()) {
      take(numbers.components, first, 3);
      take(rotations.components, first + 3, 4);
    } else if (name == pinocchio::JointModelSpherical::classname()) {
      take(rotations.components, first, 4);
    } else {
      take(others.components, first, joint.nq());
      others.model.addJoint(0, joint, pinocchio::SE3::Identity(), model.names[k]);
    }
  }
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
  template <class Space>
  void filter(const Space& space, Eigen::MatrixXd& q) const {
    Eigen::VectorXd x = q.col(0), x1 = x, x2 = x, y1 = x, y(x.size());
    Eigen::VectorXd difference(space.size()), step = Eigen::VectorXd::Zero(space.size());
    const auto add = [&](double factor, const Eigen::VectorXd& point) {
      space.difference(y1, point, difference);
      step += factor * difference;
    };
    for (Eigen::Index frame = 0; frame < q.cols(); ++frame) {
      x = q.col(frame);
      step *= a2;  // the way back to y2 is −step
      add(b, x);
      add(2. * b, x1);
      add(b, x2);
      space.integrate(y1, step, y);
      x2.swap(x1);
      x1.swap(x);
      y1 = y;
      q.col(frame) = y;
    }
  }

  // The same for numbers, in one go.
  void filter(const Numbers&, Eigen::MatrixXd& q) const {
    Eigen::VectorXd x = q.col(0), x1 = x, x2 = x, y1 = x, y2 = x;
    for (Eigen::Index frame = 0; frame < q.cols(); ++frame) {
      x = q.col(frame);
      y2 = y1 + a2 * (y1 - y2) + b * ((x - y1) + 2. * (x1 - y1) + (x2 - y1));
      y2.swap(y1);
      x2.swap(x1);
      x1.swap(x);
      q.col(frame) = y1;
    }
  }
};

// Beyond its ends a motion is continued with a constant acceleration: a part of that of the
// parabola that fits the frames of so many periods of the cut-off best, and at least so many steps.
// Longer times tell of an acceleration that was there before, and shorter ones and larger parts of
// noise: these were the best for sinusoids of 0.5 to 3 Hz and for walks that were cut anywhere,
// with noise of 0 to 1 mm.
constexpr double kEndPeriods = 0.5, kEndPart = 0.75;
constexpr Eigen::Index kLeastEndSteps = 4;
// After so many periods there is no more acceleration: little of it would be felt inside, and what
// turns must not turn by half a turn while the filter lags behind.
constexpr double kAcceleratedPeriods = 0.5;

// Weights of as many steps, from one frame to the next: their sum is the acceleration of the
// parabola that fits the frames best, per frame², times kEndPart.
Eigen::VectorXd makeEndWeights(Eigen::Index steps) {
  const Eigen::ArrayXd squares =
      (Eigen::ArrayXd::LinSpaced(steps + 1, 0., double(steps)) - 0.5 * double(steps)).square();
  Eigen::ArrayXd weights = squares - squares.mean();  // of the frames, up to a factor
  weights *= 2. * kEndPart / (weights * squares).sum();
  Eigen::VectorXd sums(steps);
  double sum = 0.;
  for (Eigen::Index step = steps; step > 0; --step) sums[step - 1] = sum += weights[step];
  return sums;
}

// Filters some components, which lie in a space of their own, forward and backward.
template <class Space>
void filterComponents(const Space& space, double rate, double cutoff, Eigen::MatrixXd& q) {
  const Eigen::Index frames = q.cols(), rows = Eigen::Index(space.components.size());
  if (rows == 0) return;
  const auto inPeriods = [&](double count) {
    return static_cast<Eigen::Index>(std::ceil(count * rate / cutoff));
  };
  // Eight periods of the cut-off are enough for the filter to have forgotten how it began.
  const Eigen::Index padding = std::min(frames - 1, inPeriods(8.));
  Eigen::MatrixXd padded(rows, frames + 2 * padding);
  for (Eigen::Index frame = 0; frame < frames; ++frame)
    for (Eigen::Index row = 0; row < rows; ++row)
      padded(row, padding + frame) = q(space.components[static_cast<std::size_t>(row)], frame);
  const Eigen::Index fitted =
      std::min(std::max(inPeriods(kEndPeriods), kLeastEndSteps), frames - 1);
  const Eigen::VectorXd weights =
      fitted < kLeastEndSteps ? Eigen::VectorXd() : makeEndWeights(fitted);
  // Step by step: what lies further away may have turned by more than a tangent space can tell.
  // The way out from the end is the way in, reflected, but for what an acceleration, which is the
  // same on both sides, makes of it.
  Eigen::VectorXd step(space.size()), next(rows);
  const auto extend = [&](Eigen::Index end, int outward) {
    Eigen::VectorXd acceleration = Eigen::VectorXd::Zero(space.size());
    for (Eigen::Index k = 0; k < weights.size(); ++k) {
      space.difference(padded.col(end - outward * k), padded.col(end - outward * (k + 1)), step);
      acceleration += weights[k] * step;
    }
    for (Eigen::Index k = 0; k < padding; ++k) {
      const Eigen::Index inner = end - outward * k, outer = end + outward * k;
      space.difference(padded.col(inner), padded.col(inner - outward), step);
      const Eigen::Index accelerated = std::min(k, inPeriods(kAcceleratedPeriods));
      step = double(2 * accelerated + 1) * acceleration - step;
      space.integrate(padded.col(outer), step, next);
      padded.col(outer + outward) = next;
    }
  };
  extend(padding, -1);
  extend(padding + frames - 1, 1);
  for (int pass = 0; pass < 2; ++pass) {
    for (const int number : {0, 1})
      Section::butterworth(number, cutoff / rate).filter(space, padded);
    padded.rowwise().reverseInPlace();
  }
  for (Eigen::Index frame = 0; frame < frames; ++frame)
    for (Eigen::Index row = 0; row < rows; ++row)
      q(space.components[static_cast<std::size_t>(row)], frame) = padded(row, padding + frame);
}

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
  if (!(cutoff >= kMinimalCutoff * rate))
    throwInvalid("cutoff must be >= ", kMinimalCutoff * rate, " Hz, which is ", kMinimalCutoff,
                 " of the frame rate, got ", cutoff, " Hz");
  const Eigen::Index frames = q.cols();
  requireConfigurations(model, q, frames);
  if (frames < 2) return q;

  Numbers numbers;
  Rotations rotations;
  Others others;
  separate(model, numbers, rotations, others);
  Eigen::MatrixXd filtered = q;
  filterComponents(numbers, rate, cutoff, filtered);
  filterComponents(rotations, rate, cutoff, filtered);
  filterComponents(others, rate, cutoff, filtered);
  return filtered;
}

Motion differentiate(const pinocchio::Model& model, const Eigen::VectorXd& time,
                     const Eigen::MatrixXd& q) {
  requireTime(time);
  const Eigen::Index frames = time.size();
  requireConfigurations(model, q, frames);
  Motion motion{time, q, Eigen::MatrixXd::Zero(model.nv, frames),
                Eigen::MatrixXd::Zero(model.nv, frames)};
  if (frames < 2) return motion;

  // From each frame to the next; back again it is the same with the other sign.
  const Eigen::MatrixXd steps = internal::ConfigurationSteps(model).compute(q);
  if (frames == 2) {
    motion.v.colwise() = steps.col(0) / (time[1] - time[0]);
    return motion;
  }
  // The parabola v s + ½ a s² through zero at s = 0 and two differences at others.
  const auto fit = [&](Eigen::Index frame, double s1, const auto& first, double s2,
                       const auto& second) {
    motion.a.col(frame) = 2. * (second / s2 - first / s1) / (s2 - s1);
    motion.v.col(frame) = first / s1 - 0.5 * s1 * motion.a.col(frame);
  };
  for (Eigen::Index frame = 1; frame + 1 < frames; ++frame)
    fit(frame, time[frame - 1] - time[frame], -steps.col(frame - 1), time[frame + 1] - time[frame],
        steps.col(frame));
  // The polynomial of third order through zero and three differences, or of second through two.
  const auto fitEnd = [&](Eigen::Index frame, int inward) {
    const Eigen::Index order = std::min<Eigen::Index>(frames - 1, 3);
    Eigen::MatrixXd powers(order, order), differences(model.nv, order);
    Eigen::VectorXd difference(model.nv);
    for (Eigen::Index k = 0; k < order; ++k) {
      const Eigen::Index other = frame + inward * (k + 1);
      pinocchio::difference(model, q.col(frame), q.col(other), difference);
      differences.col(k) = difference;
      for (Eigen::Index power = 0; power < order; ++power)
        powers(power, k) = std::pow(time[other] - time[frame], double(power + 1));
    }
    // differences = coefficients powers
    const Eigen::MatrixXd coefficients =
        powers.transpose().partialPivLu().solve(differences.transpose()).transpose();
    motion.v.col(frame) = coefficients.col(0);
    motion.a.col(frame) = 2. * coefficients.col(1);
  };
  fitEnd(0, 1);
  fitEnd(frames - 1, -1);
  return motion;
}

DerivativeMismatch compareDerivatives(const pinocchio::Model& model, const Motion& motion) {
  motion.validate(model);
  // Apart, because joints move more than the root, of which a little error is a large force.
  const std::vector<Eigen::Index> begins = internal::hasFreeFlyer(model)
                                               ? std::vector<Eigen::Index>{0, 3, 6, model.nv}
                                               : std::vector<Eigen::Index>{0, model.nv};

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
      return internal::orInfinity(std::sqrt(mismatch / steps) /
                                  std::max(std::sqrt(size / steps), least));
    }
  };
  const std::size_t count = begins.size() - 1;
  std::vector<Part> velocities(count), accelerations(count);
  const Eigen::MatrixXd steps = internal::ConfigurationSteps(model).compute(motion.q);
  Eigen::VectorXd step(model.nv), slope(model.nv);
  for (Eigen::Index frame = 0; frame < steps.cols(); ++frame) {
    const double duration = motion.time[frame + 1] - motion.time[frame];
    step = steps.col(frame) / duration;
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
  if (steps.cols() == 0) return mismatch;
  for (std::size_t part = 0; part < count; ++part) {
    mismatch.velocity =
        std::max(mismatch.velocity, velocities[part].ratio(double(steps.cols()), kLeastVelocity));
    mismatch.acceleration = std::max(
        mismatch.acceleration, accelerations[part].ratio(double(steps.cols()), kLeastAcceleration));
  }
  return mismatch;
}

}  // namespace dynacom
