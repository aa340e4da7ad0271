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

using internal::requireTime;
using internal::throwInvalid;

namespace {

// What mismatches of derivatives are a part of at least: [m/s, rad/s], [m/s², rad/s²].
constexpr double kLeastVelocity = 0.05, kLeastAcceleration = 0.5;

void requireFrames(const char* name, const Eigen::MatrixXd& values, Eigen::Index size,
                   const char* unit, Eigen::Index frames) {
  internal::requireSize(name, values.rows(), size, unit);
  internal::requireSize(name, values.cols(), frames, "frames");
  for (Eigen::Index frame = 0; frame < frames; ++frame)
    if (!internal::areFinite(values.col(frame)))
      throwInvalid(name, " must be finite, got another number in frame ", frame);
}

void requireConfigurations(const pinocchio::Model& model, const Eigen::MatrixXd& q,
                           Eigen::Index frames) {
  requireFrames("q", q, model.nq, "components (nq)", frames);
  const internal::MotionCheck check(model);
  for (Eigen::Index frame = 0; frame < frames; ++frame)
    if (!check.isConfiguration(q.col(frame)))
      throwInvalid("q must have quaternions of norm 1, got another in frame ", frame);
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
    for (Eigen::Index k = 0; k < count(); ++k) {
      const Eigen::Quaterniond turned = read(from, k).conjugate() * read(to, k);
      step.segment<3>(3 * k) = pinocchio::quaternion::log3(turned);
    }
  }
  void integrate(const Eigen::VectorXd& from, const Eigen::VectorXd& step,
                 Eigen::VectorXd& to) const {
    Eigen::Quaterniond turned;
    for (Eigen::Index k = 0; k < count(); ++k) {
      pinocchio::quaternion::exp3(step.segment<3>(3 * k), turned);
      to.segment<4>(4 * k) = (read(from, k) * turned).normalized().coeffs();
    }
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

// Filters some components, which lie in a space of their own, forward and backward.
template <class Space>
void filterComponents(const Space& space, double rate, double cutoff, Eigen::MatrixXd& q) {
  const Eigen::Index frames = q.cols(), rows = Eigen::Index(space.components.size());
  if (rows == 0) return;
  // Eight periods of the cut-off are enough for the filter to have forgotten how it began.
  const auto periods = static_cast<Eigen::Index>(std::ceil(8. * rate / cutoff));
  const Eigen::Index padding = std::min(frames - 1, periods);
  Eigen::MatrixXd padded(rows, frames + 2 * padding);
  for (Eigen::Index frame = 0; frame < frames; ++frame)
    for (Eigen::Index row = 0; row < rows; ++row)
      padded(row, padding + frame) = q(space.components[static_cast<std::size_t>(row)], frame);
  // Step by step: what lies further away may have turned by more than a tangent space can tell.
  Eigen::VectorXd step(space.size()), next(rows);
  const auto reflect = [&](Eigen::Index from, Eigen::Index to, Eigen::Index at, int direction) {
    space.difference(padded.col(from), padded.col(to), step);
    step = -step;
    space.integrate(padded.col(at), step, next);
    padded.col(at + direction) = next;
  };
  const Eigen::Index first = padding, last = padding + frames - 1;
  for (Eigen::Index k = 0; k < padding; ++k) {
    reflect(first + k, first + k + 1, first - k, -1);
    reflect(last - k, last - k - 1, last + k, 1);
  }
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
  const auto fitEnd = [&](Eigen::Index frame, Eigen::Index one, Eigen::Index other) {
    Eigen::VectorXd first(model.nv), second(model.nv);
    pinocchio::difference(model, q.col(frame), q.col(one), first);
    pinocchio::difference(model, q.col(frame), q.col(other), second);
    fit(frame, time[one] - time[frame], first, time[other] - time[frame], second);
  };
  fitEnd(0, 1, 2);
  fitEnd(frames - 1, frames - 2, frames - 3);
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
      return std::sqrt(mismatch / steps) / std::max(std::sqrt(size / steps), least);
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
