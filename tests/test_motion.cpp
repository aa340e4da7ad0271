// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE motion
#include <cmath>
#include <limits>

#include "dynacom/motion.hpp"
#include "random_robot.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

const double kPi = std::acos(-1.);

/// A motion along what a function gives of time, in the tangent space at q.
template <class Step>
MatrixXd along(const pinocchio::Model& model, const VectorXd& q, const VectorXd& time, Step step) {
  MatrixXd path(model.nq, time.size());
  for (Index frame = 0; frame < time.size(); ++frame)
    path.col(frame) = moved(model, q, step(time[frame]));
  return path;
}

/// A free-flying body with a joint that turns.
pinocchio::Model spinner() {
  pinocchio::Model model = singleBody(1., {});
  model.addJoint(1, pinocchio::JointModelRZ(), SE3::Identity(), "joint");
  return model;
}

/// Sines of a joint and along x of the root, whose accelerations are known.
struct Sine {
  double frequency, phase, size;

  double at(double t) const { return size * std::sin(2. * kPi * frequency * t + phase); }
  double acceleration(double t) const { return -std::pow(2. * kPi * frequency, 2) * at(t); }
  MatrixXd configurations(const pinocchio::Model& model, const VectorXd& time) const {
    MatrixXd q = restState(model).q.replicate(1, time.size());
    for (Index frame = 0; frame < time.size(); ++frame) q(0, frame) = q(7, frame) = at(time[frame]);
    return q;
  }
};

VectorXd evenTimes(double rate, Index frames) {
  return VectorXd::LinSpaced(frames, 0., double(frames - 1) / rate);
}

/// Positions of a body whose accelerations' noise has a deviation of 1 g, at that rate.
MatrixXd noisyPositions(const pinocchio::Model& model, double rate, Index frames, Random& random) {
  const double deviation = 9.81 / (std::sqrt(6.) * rate * rate) / std::sqrt(3.);
  MatrixXd q = restState(model).q.replicate(1, frames);
  for (Index frame = 0; frame < frames; ++frame)
    for (Index axis = 0; axis < 3; ++axis)  // twelve uniform numbers are nearly normal
      for (int k = 0; k < 12; ++k) q(axis, frame) += deviation * random.uniform(-0.5, 0.5);
  return q;
}

/// Of a free-flyer's configuration.
SE3 placementOf(const Eigen::Ref<const VectorXd>& q) {
  return SE3(Eigen::Quaterniond(q[6], q[3], q[4], q[5]).toRotationMatrix(), q.head<3>());
}

}  // namespace

BOOST_AUTO_TEST_CASE(parabolas_have_their_own_derivatives) {
  Random random(1);
  for (int trial = 0; trial < 20; ++trial) {
    const auto model = randomTree(random);
    const State x = randomState(model, random, 0.5);
    const double before = random.uniform(0.01, 0.1), after = random.uniform(0.01, 0.1);
    const auto parabola = [&](double s) { return VectorXd(s * x.v + 0.5 * s * s * x.a); };
    // Around a frame, and on the one side of it that there is at the ends.
    for (const double first : {-before, 0., before}) {
      VectorXd time(3);
      time << first, first + before, first + before + after;
      if (first == before) time << -before - after, -before, 0.;
      const Motion motion = differentiate(model, time, along(model, x.q, time, parabola));
      Index frame = 0;
      BOOST_REQUIRE(time.cwiseAbs().minCoeff(&frame) == 0.);
      BOOST_TEST(close(motion.v.col(frame), x.v, 1e-10));
      BOOST_TEST(close(motion.a.col(frame), x.a, 1e-8));
      BOOST_TEST(close(motion.q.col(frame), x.q));
      BOOST_TEST(close(motion.time, time, 0.));
    }
  }
}

BOOST_AUTO_TEST_CASE(polynomials_of_third_order_have_their_own_derivatives_at_both_ends) {
  const auto model = spinner();
  VectorXd time(5);
  time << 0., 0.1, 0.25, 0.3, 0.42;
  MatrixXd q = restState(model).q.replicate(1, 5);
  q.row(7) = 1. + 2. * time.array() - 3. * time.array().square() + 4. * time.array().cube();
  const Motion motion = differentiate(model, time, q);
  for (const Index frame : {0, 4}) {
    const double t = time[frame];
    BOOST_TEST(close(motion.v(6, frame), 2. - 6. * t + 12. * t * t, 1e-10));
    BOOST_TEST(close(motion.a(6, frame), -6. + 24. * t, 1e-9));
  }
}

BOOST_AUTO_TEST_CASE(derivatives_are_those_that_pinocchio_takes) {
  // The body's velocity gives back the next configuration, and a is how v changes: both to the
  // order of the formula, so that half the step has a quarter of the error.
  Random random(2);
  const auto model = randomTree(random);
  const State x = randomState(model, random, 0.5);
  const VectorXd other = random.vector(model.nv);
  const auto path = [&](double t) {
    return VectorXd(std::sin(2. * t) * x.v + std::cos(3. * t) * other);
  };
  double errors[2] = {};
  for (const int halved : {0, 1}) {
    const double step = halved ? 0.005 : 0.01;
    const VectorXd time = VectorXd::LinSpaced(21, 0., 20. * step);
    const Motion motion = differentiate(model, time, along(model, x.q, time, path));
    // At the middle, against the same in a hundredth of the time.
    const double middle = 10. * step, fine = step / 100.;
    const VectorXd fine_time = VectorXd::LinSpaced(5, middle - 2. * fine, middle + 2. * fine);
    const Motion exact = differentiate(model, fine_time, along(model, x.q, fine_time, path));
    errors[halved] = (motion.v.col(10) - exact.v.col(2)).norm();
    BOOST_TEST(close((exact.v.col(3) - exact.v.col(1)) / (2. * fine), exact.a.col(2), 1e-3));
  }
  BOOST_TEST(errors[0] > 1e-6);
  BOOST_TEST(errors[0] / errors[1] > 3.5);
}

BOOST_AUTO_TEST_CASE(short_motions_have_derivatives_too) {
  Random random(3);
  const auto model = randomTree(random);
  const State x = randomState(model, random, 0.5);
  const auto line = [&](double s) { return VectorXd(s * x.v); };
  VectorXd time(2);
  time << 1., 1.25;
  const Motion two = differentiate(model, time, along(model, x.q, time, line));
  BOOST_TEST(close(two.v.col(0), two.v.col(1)));
  BOOST_TEST(close(moved(model, two.q.col(0), 0.25 * two.v.col(0)), two.q.col(1)));
  BOOST_TEST(two.a.isZero(0.));
  const Motion one = differentiate(model, time.head(1), x.q);
  BOOST_TEST(one.v.isZero(0.));
  BOOST_TEST(one.a.isZero(0.));
  BOOST_CHECK_NO_THROW(one.validate(model));
}

BOOST_AUTO_TEST_CASE(what_is_steady_passes_the_filter) {
  // Straight on through the world while turning, to the ends.
  const auto model = spinner();
  Random random(4);
  const Vector3d start = random.vector3(), velocity = random.vector3(), spin = random.vector3(3.);
  MatrixXd q(model.nq, 200);
  for (Index frame = 0; frame < q.cols(); ++frame) {
    const double t = 0.02 * static_cast<double>(frame);
    q.col(frame).head<3>() = start + t * velocity;
    q.col(frame).segment<4>(3) =
        Eigen::Quaterniond(Eigen::AngleAxisd(t * spin.norm(), spin.normalized())).coeffs();
    q(7, frame) = 1. - 2. * t;
  }
  // The filter forgets how it began.
  const MatrixXd filtered = filterConfigurations(model, q, 50., 3.);
  BOOST_TEST(close(filtered, q, 1e-6));
  BOOST_TEST(filtered.allFinite());
}

BOOST_AUTO_TEST_CASE(the_filter_halves_its_cut_off_and_delays_nothing) {
  const auto model = spinner();
  const double rate = 100.;
  const Index frames = 8000;
  const auto gain = [&](double frequency, double cutoff) {
    MatrixXd q = restState(model).q.replicate(1, frames);
    for (Index frame = 0; frame < frames; ++frame)
      q(7, frame) = std::sin(2. * kPi * frequency * static_cast<double>(frame) / rate);
    const MatrixXd filtered = filterConfigurations(model, q, rate, cutoff);
    const Eigen::RowVectorXd middle = filtered.row(7).segment(3500, 1000);
    const Eigen::RowVectorXd was = q.row(7).segment(3500, 1000);
    const double factor = middle.dot(was) / was.squaredNorm();
    BOOST_TEST((middle - factor * was).norm() <= 1e-6 * was.norm());  // in phase
    return factor;
  };
  for (const double cutoff : {0.7, 5., 20., 39.}) {
    BOOST_TEST(close(gain(cutoff, cutoff), 0.5, 1e-6));
    // 1 / (1 + (tan(π f / rate) / tan(π cutoff / rate))⁸)
    for (const double part : {0.3, 0.8, 1.1}) {
      const double f = part * cutoff;
      const double ratio = std::tan(kPi * f / rate) / std::tan(kPi * cutoff / rate);
      BOOST_TEST(close(gain(f, cutoff), 1. / (1. + std::pow(ratio, 8.)), 1e-6));
    }
  }
}

BOOST_AUTO_TEST_CASE(accelerations_of_a_clip_that_is_cut_in_motion) {
  // Over all phases of a sine of 1 Hz, parts of the root mean square of the true accelerations. A
  // point reflection has no acceleration at the ends: it is off by all of them.
  const auto model = spinner();
  for (const double rate : {60., 120., 500.}) {
    double at_ends = 0., within = 0., all = 0.;
    const auto half_period = static_cast<Index>(0.5 * rate / 6.) + 1;
    for (int k = 0; k < 24; ++k) {
      const Sine sine{1., 2. * kPi * k / 24., 0.05};
      const VectorXd time = evenTimes(rate, static_cast<Index>(rate));
      const Motion motion = differentiate(
          model, time, filterConfigurations(model, sine.configurations(model, time), rate, 6.));
      for (const Index row : {0, 6}) {
        const auto error = [&](Index frame) {
          return std::pow(motion.a(row, frame) - sine.acceleration(time[frame]), 2);
        };
        at_ends += 0.5 * (error(0) + error(time.size() - 1));
        within += 0.5 * (error(half_period) + error(time.size() - 1 - half_period));
        all += std::pow(sine.acceleration(0.), 2);
      }
    }
    BOOST_TEST(std::sqrt(at_ends / all) < 0.4);
    BOOST_TEST(std::sqrt(within / all) < 0.06);
  }
}

BOOST_AUTO_TEST_CASE(every_direction_is_filtered_alike) {
  // As much by a joint as by the root's place and, about an axis, its orientation, whether that
  // turns by little from frame to frame, or by much.
  const auto model = spinner();
  const VectorXd time = evenTimes(60., 45);
  for (const double size : {1e-6, 0.4, 2.}) {
    const Sine sine{1.3, 0.7, size};
    MatrixXd q = sine.configurations(model, time);
    for (Index frame = 0; frame < time.size(); ++frame)
      q.col(frame).segment<4>(3) =
          Eigen::Quaterniond(Eigen::AngleAxisd(sine.at(time[frame]), Vector3d(0.6, 0., 0.8)))
              .coeffs();
    const MatrixXd filtered = filterConfigurations(model, q, 60., 5.);
    BOOST_TEST((filtered - q).col(0).norm() > 1e-5 * size);
    BOOST_TEST(close(filtered.row(0), filtered.row(7)));
    for (Index frame = 0; frame < time.size(); ++frame) {
      const Eigen::Quaterniond turned(Eigen::Vector4d(filtered.col(frame).segment<4>(3)));
      const double angle = 2. * std::atan2(turned.vec().dot(Vector3d(0.6, 0., 0.8)), turned.w());
      BOOST_TEST(close(angle, filtered(7, frame), 1e-12));
    }
  }
}

BOOST_AUTO_TEST_CASE(noise_of_accelerations_is_measured) {
  Random random(7);
  const auto model = singleBody(1., {});
  for (const double rate : {30., 120., 500.}) {
    const Index frames = 2000;
    const VectorXd time = evenTimes(rate, frames);
    const MatrixXd noise = noisyPositions(model, rate, frames, random);
    const double measured = estimateAccelerationNoise(model, time, noise);
    BOOST_TEST(close(measured, 1., 0.25));
    // Half the rate has a quarter of it.
    BOOST_TEST(close(estimateAccelerationNoise(model, time, noise, 2), 0.25, 0.07));
    // It is there in a motion as well as at rest, and not less because most of the clip stands
    // still without any; nor because frames are not evenly spaced.
    MatrixXd moving = noise;
    moving.row(2) += (3. * time.array()).sin().matrix().transpose();
    BOOST_TEST(close(estimateAccelerationNoise(model, time, moving), 1., 0.25));
    MatrixXd standing = moving;
    standing.leftCols(900).colwise() = VectorXd(moving.col(900));
    standing.rightCols(900).colwise() = VectorXd(moving.col(1099));
    BOOST_TEST(estimateAccelerationNoise(model, time, standing) > 0.5);
    VectorXd uneven = time;
    for (Index frame = 0; frame < frames; ++frame) uneven[frame] += random.uniform(0., 0.3) / rate;
    BOOST_TEST(close(estimateAccelerationNoise(model, uneven, noise), 1., 0.4));
  }
}

BOOST_AUTO_TEST_CASE(smooth_motions_and_those_with_contacts_have_no_noise) {
  const auto model = spinner();
  for (const double rate : {30., 60., 120., 500.}) {
    // A sine of 3 Hz and 6.5 m/s² with a 0.1 g that begins and ends twice a second.
    const VectorXd time = evenTimes(rate, static_cast<Index>(4. * rate));
    MatrixXd q = Sine{2., 0.3, 0.04}.configurations(model, time);
    BOOST_TEST(estimateAccelerationNoise(model, time, q) < 0.005);
    for (Index frame = 0; frame < time.size(); ++frame) {
      const double t = std::fmod(time[frame], 1.);
      const double push =
          t < 0.5 ? 0.5 * t * t : 0.125 + 0.5 * (t - 0.5) - 0.5 * (t - 0.5) * (t - 0.5);
      q(2, frame) += 0.981 * (0.25 * std::floor(time[frame]) + push);
    }
    BOOST_TEST(estimateAccelerationNoise(model, time, q) < 0.005);
    // Uneven frames of the same.
    VectorXd uneven = time;
    for (Index frame = 0; frame < time.size(); ++frame)
      uneven[frame] += 0.3 * std::sin(5. * double(frame)) / rate;
    const MatrixXd other = Sine{2., 0.3, 0.04}.configurations(model, uneven);
    BOOST_TEST(estimateAccelerationNoise(model, uneven, other) < 0.005);
  }
  const VectorXd time = evenTimes(100., 6);
  const MatrixXd rest = restState(model).q.replicate(1, 20);
  BOOST_TEST(std::isnan(estimateAccelerationNoise(model, time, rest.leftCols(6))));
  BOOST_TEST(estimateAccelerationNoise(model, evenTimes(100., 7), rest.leftCols(7)) == 0.);
  BOOST_TEST(
      std::isnan(estimateAccelerationNoise(model, evenTimes(100., 12), rest.leftCols(12), 2)));
  BOOST_TEST(throws<std::invalid_argument>(
      [&] { estimateAccelerationNoise(model, evenTimes(100., 20), rest, 0); }, {"stride", "0"}));
  BOOST_TEST(throws<std::invalid_argument>([&] { estimateAccelerationNoise(model, time, rest); },
                                           {"q", "6", "20"}));
}

BOOST_AUTO_TEST_CASE(the_filter_knows_no_direction) {
  // Moving the world, mirroring time, or taking −quaternion for quaternion changes nothing.
  Random random(5);
  const auto model = spinner();
  MatrixXd q(model.nq, 60);
  q.col(0) = randomState(model, random).q;
  for (Index frame = 1; frame < q.cols(); ++frame)
    q.col(frame) = moved(model, q.col(frame - 1), random.vector(model.nv, 0.05));
  const MatrixXd filtered = filterConfigurations(model, q, 60., 6.);
  BOOST_TEST((filtered - q).norm() > 0.01);

  const SE3 shift = random.placement();
  MatrixXd shifted = q;
  for (Index frame = 0; frame < q.cols(); ++frame) {
    const SE3 placement = shift * placementOf(q.col(frame));
    shifted.col(frame).head<3>() = placement.translation();
    shifted.col(frame).segment<4>(3) = Eigen::Quaterniond(placement.rotation()).coeffs();
    if (random.coin()) shifted.col(frame).segment<4>(3) *= -1.;
  }
  const MatrixXd filtered_shifted = filterConfigurations(model, shifted, 60., 6.);
  for (Index frame = 0; frame < q.cols(); ++frame) {
    const SE3 expected = shift * placementOf(filtered.col(frame));
    BOOST_TEST(close(placementOf(filtered_shifted.col(frame)).toHomogeneousMatrix(),
                     expected.toHomogeneousMatrix()));
  }
}

BOOST_AUTO_TEST_CASE(a_filter_out_of_range_is_refused) {
  const auto model = spinner();
  const MatrixXd q = restState(model).q.replicate(1, 10);
  BOOST_CHECK_NO_THROW(filterConfigurations(model, q, 50., 19.9));
  const auto refused = [&](double rate, double cutoff, std::initializer_list<std::string> words) {
    BOOST_TEST(throws<std::invalid_argument>([&] { filterConfigurations(model, q, rate, cutoff); },
                                             words));
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  refused(50., 20., {"cutoff", "20", "0.4"});
  refused(50., 0., {"cutoff", "0"});
  refused(50., -1., {"cutoff", "-1"});
  refused(50., nan, {"cutoff", "nan"});
  refused(100., 1e-17, {"cutoff", "1e-07", "1e-09", "1e-17"});
  refused(1e308, 1., {"cutoff", "1e+299", "1"});
  BOOST_TEST(filterConfigurations(model, q, 100., 1.001e-7).allFinite());
  refused(0., 1., {"rate", "0"});
  refused(nan, 1., {"rate", "nan"});
  MatrixXd bad = q;
  bad(0, 3) = nan;
  BOOST_TEST(throws<std::invalid_argument>([&] { filterConfigurations(model, bad, 50., 5.); },
                                           {"q", "3"}));
  bad = q;
  bad(6, 4) = 0.5;
  BOOST_TEST(throws<std::invalid_argument>([&] { filterConfigurations(model, bad, 50., 5.); },
                                           {"q", "quaternions", "4"}));
  BOOST_TEST(throws<std::invalid_argument>(
      [&] { differentiate(model, VectorXd::LinSpaced(9, 0., 1.), q); }, {"q", "9", "10"}));
  BOOST_TEST(throws<std::invalid_argument>([&] { differentiate(model, VectorXd::Zero(10), q); },
                                           {"time", "increase"}));
  // One frame is its own mean.
  BOOST_TEST(close(filterConfigurations(model, q.leftCols(1), 50., 5.), q.leftCols(1), 0.));
}

BOOST_AUTO_TEST_CASE(derivatives_whose_squares_are_beyond_the_largest_numbers_do_not_fit) {
  const auto model = spinner();
  const Index frames = 10;
  Motion motion{VectorXd::LinSpaced(frames, 0., 1.), restState(model).q.replicate(1, frames),
                MatrixXd::Zero(model.nv, frames), MatrixXd::Zero(model.nv, frames)};
  BOOST_TEST(compareDerivatives(model, motion).velocity == 0.);
  motion.v(0, 3) = motion.v(0, 4) = 1e200;
  const DerivativeMismatch mismatch = compareDerivatives(model, motion);
  BOOST_TEST(mismatch.velocity == std::numeric_limits<double>::infinity());
  BOOST_TEST(mismatch.acceleration == std::numeric_limits<double>::infinity());
}

BOOST_AUTO_TEST_CASE(derivatives_of_any_integrator_fit_and_others_do_not) {
  Random random(6);
  const auto model = randomTree(random);
  const Index frames = 30;
  for (const bool semi_implicit : {false, true}) {
    Motion motion{VectorXd::LinSpaced(frames, 0., 0.58), MatrixXd(model.nq, frames),
                  MatrixXd(model.nv, frames), MatrixXd(model.nv, frames)};
    const double step = motion.time[1] - motion.time[0];
    State x = randomState(model, random);
    for (Index frame = 0; frame < frames; ++frame) {
      x.a = random.vector(model.nv);
      motion.q.col(frame) = x.q;
      motion.v.col(frame) = x.v;
      motion.a.col(frame) = x.a;
      const VectorXd next = x.v + step * x.a;
      x.q = moved(model, x.q, step * (semi_implicit ? next : x.v));
      x.v = next;
    }
    auto mismatch = compareDerivatives(model, motion);
    BOOST_TEST(mismatch.velocity < 1e-10);
    BOOST_TEST(mismatch.acceleration < 1e-10);
    Motion wrong = motion;
    wrong.v *= 1.1;
    wrong.a *= 1.1;
    mismatch = compareDerivatives(model, wrong);
    BOOST_TEST(close(mismatch.velocity, 1. - 1. / 1.1, 0.01));
    BOOST_TEST(mismatch.acceleration < 1e-10);
    wrong = motion;
    wrong.a *= -1.;
    mismatch = compareDerivatives(model, wrong);
    BOOST_TEST(mismatch.velocity < 1e-10);
    BOOST_TEST(mismatch.acceleration > 1.);
  }
  // An error of the root alone is not hidden by the joints, nor one of its place by its turning.
  for (const Index row : {0, 1, 2, 3, 4, 5, 6}) {
    Motion shifted{VectorXd::LinSpaced(frames, 0., 0.58), MatrixXd(model.nq, frames),
                   MatrixXd::Zero(model.nv, frames), MatrixXd::Zero(model.nv, frames)};
    shifted.v.bottomRows(model.nv - 6).setConstant(3.);
    for (Index frame = 0; frame < frames; ++frame)
      shifted.q.col(frame) =
          moved(model, restState(model).q, shifted.time[frame] * shifted.v.col(frame));
    BOOST_TEST(compareDerivatives(model, shifted).velocity < 1e-10);
    shifted.a.row(row).setConstant(1.);
    BOOST_TEST(compareDerivatives(model, shifted).acceleration > 0.2);
    shifted.a.setZero();
    shifted.v.row(row).array() += row < 6 ? 0.05 : 2.;
    BOOST_TEST(compareDerivatives(model, shifted).velocity > 0.1);
  }
  // At rest there is nothing to differ.
  const VectorXd zero = VectorXd::Zero(model.nv);
  const Motion rest{VectorXd::LinSpaced(3, 0., 1.), restState(model).q.replicate(1, 3),
                    zero.replicate(1, 3), zero.replicate(1, 3)};
  BOOST_TEST(compareDerivatives(model, rest).velocity == 0.);
  BOOST_TEST(compareDerivatives(model, rest).acceleration == 0.);
}
