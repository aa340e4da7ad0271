// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE recorded_motion
#include <cmath>
#include <limits>

#include "dynacom/recorded_motion.hpp"
#include "random_robot.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

const double kNaN = std::numeric_limits<double>::quiet_NaN();
const double kPi = std::acos(-1.);

/// A free-flying body that goes to and fro, 100 times a second, with derivatives by hand.
struct Record {
  explicit Record(Index frames = 201) : model(singleBody(1., {})) {
    recorded.time = VectorXd::LinSpaced(frames, 0., 0.01 * double(frames - 1));
    recorded.q = restState(model).q.replicate(1, frames);
    recorded.v = recorded.a = MatrixXd::Zero(model.nv, frames);
    const Eigen::ArrayXd t = recorded.time.array();
    recorded.q.row(0) = (3. * t).sin();
    recorded.v.row(0) = 3. * (3. * t).cos();
    recorded.a.row(0) = -9. * (3. * t).sin();
  }

  pinocchio::Model model;
  RecordedMotion recorded;
};

/// A sine of 0.5 Hz and 3 cm along z, at that rate, without derivatives.
Record makeSine(double rate, double duration = 4.) {
  Record record(static_cast<Index>(duration * rate) + 1);
  record.recorded.time /= 0.01 * rate;
  record.recorded.q.row(0).setZero();
  record.recorded.q.row(2) = 0.03 * (kPi * record.recorded.time.array()).sin();
  record.recorded.v.resize(6, 0);
  return record;
}

/// With noise of that much [m].
Record makeNoisySine(double rate, double size, double duration = 4.) {
  Random random(3);
  Record record = makeSine(rate, duration);
  for (Index frame = 0; frame < record.recorded.time.size(); ++frame)
    record.recorded.q.col(frame).head<3>() += random.vector3(size);
  return record;
}

}  // namespace

BOOST_AUTO_TEST_CASE(frame_rates_are_even_or_none) {
  BOOST_TEST(findFrameRate(VectorXd::LinSpaced(301, 2., 7.)) == 60.,
             boost::test_tools::tolerance(1e-12));
  BOOST_TEST(std::isnan(findFrameRate(VectorXd())));
  BOOST_TEST(std::isnan(findFrameRate(VectorXd::Zero(1))));
  BOOST_TEST(findFrameRate(Vector2d(0., 0.5)) == 2.);
  BOOST_TEST(std::isnan(findFrameRate(Vector2d(0.5, 0.))));
  BOOST_TEST(std::isnan(findFrameRate(Vector3d(0., kNaN, 1.))));
  BOOST_TEST(std::isnan(findFrameRate(Vector3d::Ones())));
  // Rounded to milliseconds, at 30 Hz; and a frame that is late by 0.19 of one, and by 0.21.
  VectorXd time = VectorXd::LinSpaced(31, 0., 1.);
  BOOST_TEST(findFrameRate((time * 1000.).array().round() / 1000.) == 30.,
             boost::test_tools::tolerance(1e-12));
  time[11] += 0.19 / 30.;
  BOOST_TEST(findFrameRate(time) == 30., boost::test_tools::tolerance(1e-12));
  time[11] += 0.02 / 30.;
  BOOST_TEST(std::isnan(findFrameRate(time)));
}

BOOST_AUTO_TEST_CASE(derivatives_that_fit_are_used) {
  const Record record;
  for (const double cutoff : {0., 6.}) {
    const DerivedMotion derived = deriveMotion(record.model, record.recorded, cutoff);
    BOOST_TEST(derived.is_recorded);
    BOOST_TEST(derived.cutoff == 0.);
    BOOST_TEST(derived.frame_rate == 100., boost::test_tools::tolerance(1e-12));
    BOOST_TEST(derived.mismatch.velocity < 0.02);
    BOOST_TEST(derived.mismatch.acceleration < 0.02);
    BOOST_TEST(close(derived.motion.q, record.recorded.q, 0.));
    BOOST_TEST(close(derived.motion.v, record.recorded.v, 0.));
    BOOST_TEST(close(derived.motion.a, record.recorded.a, 0.));
  }
}

BOOST_AUTO_TEST_CASE(derivatives_that_do_not_fit_or_are_not_there_are_computed) {
  const auto check = [](const RecordedMotion& recorded, bool has_mismatch) {
    const Record record;
    const DerivedMotion derived = deriveMotion(record.model, recorded, 6.);
    BOOST_TEST(!derived.is_recorded);
    BOOST_TEST(derived.cutoff == 6.);
    BOOST_TEST(std::isnan(derived.mismatch.velocity) == !has_mismatch);
    // In the middle, the filter takes (f/6 Hz)⁸ of so slow a sine away.
    const Index first = 60, frames = 80;
    BOOST_TEST(close(derived.motion.v.middleCols(first, frames),
                     record.recorded.v.middleCols(first, frames), 2e-3));
    BOOST_TEST(close(derived.motion.a.middleCols(first, frames),
                     record.recorded.a.middleCols(first, frames), 5e-3));
    const DerivedMotion again = rederiveMotion(record.model, recorded, 6.);
    BOOST_TEST(close(again.motion.a, derived.motion.a, 0.));
    BOOST_TEST(std::isnan(again.mismatch.velocity));
  };
  RecordedMotion recorded = Record().recorded;
  recorded.v *= 1.2;
  check(recorded, true);
  recorded = Record().recorded;
  recorded.a *= 1.5;
  check(recorded, true);
  recorded = Record().recorded;
  recorded.a.resize(6, 0);
  check(recorded, false);
  recorded.v.resize(6, 0);
  check(recorded, false);

  // Those that fit may be asked for, too.
  const Record record;
  BOOST_TEST(!rederiveMotion(record.model, record.recorded, 0.).is_recorded);
}

BOOST_AUTO_TEST_CASE(without_a_filter_derivatives_are_differences) {
  Record record;
  record.recorded.v.resize(6, 0);
  record.recorded.time[50] += 0.004;  // uneven
  const DerivedMotion derived = deriveMotion(record.model, record.recorded, 0.);
  const Motion expected = differentiate(record.model, record.recorded.time, record.recorded.q);
  BOOST_TEST(close(derived.motion.v, expected.v, 0.));
  BOOST_TEST(close(derived.motion.a, expected.a, 0.));
  BOOST_TEST(derived.cutoff == 0.);
  BOOST_TEST(derived.time_error == 0.);
  BOOST_TEST(std::isnan(derived.frame_rate));
}

BOOST_AUTO_TEST_CASE(times_are_made_even_for_derivatives_only) {
  Record record;
  record.recorded.v.resize(6, 0);
  const VectorXd exact = record.recorded.time;
  record.recorded.time[50] += 0.0005;
  const DerivedMotion derived = deriveMotion(record.model, record.recorded, 0.);
  BOOST_TEST(derived.time_error == 0.0005, boost::test_tools::tolerance(1e-9));
  BOOST_TEST(close(derived.motion.time, record.recorded.time, 0.));
  BOOST_TEST(close(derived.motion.a, differentiate(record.model, exact, record.recorded.q).a));
}

BOOST_AUTO_TEST_CASE(exact_motions_are_not_filtered_by_default) {
  for (const double rate : {30., 60., 120., 500.}) {
    const Record record = makeSine(rate);
    const DerivedMotion derived = deriveMotion(record.model, record.recorded);
    BOOST_TEST(derived.is_automatic);
    BOOST_TEST(derived.cutoff == 0.);
    BOOST_TEST(derived.noise < kExactNoise);
    BOOST_TEST(derived.thinned_noise < kExactNoise);
    BOOST_TEST(derived.unsure.size() == record.recorded.time.size());
    BOOST_TEST(!derived.unsure.any());
    // To the ends, accelerations are right.
    const Eigen::ArrayXd expected = -kPi * kPi * record.recorded.q.row(2);
    BOOST_TEST(close(derived.motion.a.row(2).transpose(), expected.matrix(), 2e-3));
  }
  // Those that are recorded need no choice.
  const Record record;
  const DerivedMotion derived = deriveMotion(record.model, record.recorded);
  BOOST_TEST(derived.is_recorded);
  BOOST_TEST(!derived.is_automatic);
  BOOST_TEST(derived.isExact());
  BOOST_TEST(derived.unsure.size() == 201);
  BOOST_TEST(!derived.unsure.any());
}

BOOST_AUTO_TEST_CASE(measured_motions_are_filtered_by_default) {
  for (const double rate : {10., 15., 30., 60., 120., 500.}) {
    const Record record = makeNoisySine(rate, 2e-3);
    const DerivedMotion derived = deriveMotion(record.model, record.recorded, kAutomaticCutoff);
    BOOST_TEST(derived.is_automatic);
    BOOST_TEST(derived.cutoff == std::min(6., 0.3 * derived.frame_rate));
    BOOST_TEST(derived.noise > kExactNoise);
    const DerivedMotion same = deriveMotion(record.model, record.recorded, derived.cutoff);
    BOOST_TEST(close(same.motion.a, derived.motion.a, 0.));
    BOOST_TEST(!same.is_automatic);
    BOOST_TEST(same.noise == derived.noise);
    // It is noisy, whether somebody filters it or not.
    BOOST_TEST(!derived.isExact());
    BOOST_TEST(!deriveMotion(record.model, record.recorded, 0.).isExact());
    // And what is exact is so no more once it has been filtered for no reason.
    const Record exact = makeSine(rate, 2.);
    BOOST_TEST(deriveMotion(exact.model, exact.recorded).isExact());
    BOOST_TEST(deriveMotion(exact.model, exact.recorded, 0.).isExact());
    BOOST_TEST(!deriveMotion(exact.model, exact.recorded, derived.cutoff).isExact());
  }
  // Too few frames to tell are filtered as well.
  const Record few = makeSine(100., 0.05);
  BOOST_TEST(few.recorded.time.size() == 6);
  const DerivedMotion derived = deriveMotion(few.model, few.recorded);
  BOOST_TEST(derived.cutoff == 6.);
  BOOST_TEST(std::isnan(derived.noise));
}

BOOST_AUTO_TEST_CASE(a_cut_off_that_is_given_is_believed) {
  const Record exact = makeSine(100.), noisy = makeNoisySine(100., 2e-3);
  BOOST_TEST(deriveMotion(exact.model, exact.recorded, 4.).cutoff == 4.);
  BOOST_TEST(deriveMotion(noisy.model, noisy.recorded, 0.).cutoff == 0.);
}

BOOST_AUTO_TEST_CASE(what_was_rounded_or_interpolated_is_looked_at_more_slowly) {
  // Written with six digits behind the point, a motion is exact at 100 Hz and noisy at 1000.
  Record rounded = makeSine(1000.);
  rounded.recorded.q.row(2) = (rounded.recorded.q.row(2) * 1e6).array().round() / 1e6;
  const DerivedMotion derived = deriveMotion(rounded.model, rounded.recorded);
  BOOST_TEST(derived.noise > kExactNoise);
  BOOST_TEST(derived.thinned_noise < kExactNoise);
  BOOST_TEST(derived.cutoff == kRoundedCutoff);

  // Parabolas through the frames of a noisy motion of 100 Hz look exact at 1000 Hz.
  const Record noisy = makeNoisySine(100., 2e-3, 1.);
  Record fine = makeSine(1000., 0.98);
  for (Index frame = 0; frame < fine.recorded.time.size(); ++frame) {
    const Index k = frame / 10;
    const double s = 0.1 * double(frame % 10);
    for (const Index row : {0, 1, 2}) {
      const double a = noisy.recorded.q(row, k), b = noisy.recorded.q(row, k + 1),
                   c = noisy.recorded.q(row, k + 2);
      fine.recorded.q(row, frame) = a + s * (b - a) + 0.5 * s * (s - 1.) * (a - 2. * b + c);
    }
  }
  const DerivedMotion interpolated = deriveMotion(fine.model, fine.recorded);
  BOOST_TEST(interpolated.noise < kExactNoise);
  BOOST_TEST(interpolated.thinned_noise > kExactNoise);
  BOOST_TEST(interpolated.cutoff == 6.);
}

BOOST_AUTO_TEST_CASE(frames_that_are_not_even_may_be_exact) {
  Record record = makeSine(100.);
  VectorXd& time = record.recorded.time;
  time[50] += 0.004;
  record.recorded.q.row(2) = 0.03 * (kPi * time.array()).sin();
  const DerivedMotion derived = deriveMotion(record.model, record.recorded);
  BOOST_TEST(derived.is_automatic);
  BOOST_TEST(derived.cutoff == 0.);
  BOOST_TEST(derived.noise < kExactNoise);
  Record noisy = makeNoisySine(100., 2e-3);
  noisy.recorded.time[50] += 0.004;
  BOOST_TEST(throws<std::invalid_argument>([&] { deriveMotion(noisy.model, noisy.recorded); },
                                           {"times", "evenly spaced", "without a filter"}));
}

BOOST_AUTO_TEST_CASE(ends_in_motion_are_unsure_and_others_are_not) {
  // From rest to a squat that is cut in motion.
  Record record = makeSine(100.);
  const double step = 0.4 * 2. * kPi;  // of 0.4 Hz and 1 cm, which accelerates by 0.006 g
  Eigen::ArrayXd t = record.recorded.time.array();
  record.recorded.q.row(2) = 0.01 * (step * t).cos();
  BOOST_TEST(!deriveMotion(record.model, record.recorded, 6.).unsure.any());
  const Eigen::ArrayXd late = (t - 2.).max(0.);
  record.recorded.q.row(2) = 0.05 * (2. * kPi * late).cos();
  const DerivedMotion derived = deriveMotion(record.model, record.recorded, 6.);
  const Index marked = static_cast<Index>(0.5 * 100. / 6.) + 1;
  BOOST_TEST(derived.unsure.count() == marked);
  BOOST_TEST(derived.unsure.tail(marked).all());
  // What turns is not at rest, either.
  Record turning = makeSine(100.);
  turning.recorded.q.row(2).setZero();
  turning.recorded.q.row(5) = (0.3 * (6. * t).cos()).sin();
  turning.recorded.q.row(6) = (0.3 * (6. * t).cos()).cos();
  turning.model.inertias[1].inertia().data() *= 10.;
  BOOST_TEST(deriveMotion(turning.model, turning.recorded, 6.).unsure.count() == 2 * marked);
  BOOST_TEST(!deriveMotion(turning.model, turning.recorded, 0.).unsure.any());
  // A clip that is shorter than half a period is unsure as a whole.
  const Record brief = makeNoisySine(100., 0.1, 0.07);
  BOOST_TEST(deriveMotion(brief.model, brief.recorded, 6.).unsure.all());
}

BOOST_AUTO_TEST_CASE(a_single_frame_is_at_rest) {
  Record record(1);
  record.recorded.v.resize(6, 0);
  for (const double cutoff : {6., kAutomaticCutoff}) {
    const DerivedMotion derived = deriveMotion(record.model, record.recorded, cutoff);
    BOOST_TEST(derived.cutoff == 0.);
    BOOST_TEST(!derived.is_automatic);
    BOOST_TEST(derived.motion.v.isZero(0.));
    BOOST_TEST(derived.motion.a.isZero(0.));
  }
}

BOOST_AUTO_TEST_CASE(what_is_beyond_the_largest_numbers_is_not_exact) {
  Record record;
  // Frames that follow each other faster than they could be counted.
  for (const double step : {1e-300, 1e-15}) {
    record.recorded.time = VectorXd::LinSpaced(201, 0., 200. * step);
    BOOST_CHECK_NO_THROW(deriveMotion(record.model, record.recorded, 0.));
  }
  record.recorded.time = VectorXd::LinSpaced(201, 0., 2.);
  for (Index frame = 0; frame < 201; ++frame)
    record.recorded.q(0, frame) = frame % 2 == 0 ? 1.7e308 : -1.7e308;
  BOOST_TEST(!deriveMotion(record.model, record.recorded, 0.).isExact());
}

BOOST_AUTO_TEST_CASE(what_cannot_be_derived_is_refused) {
  const auto refused = [](const auto& change, double cutoff,
                          std::initializer_list<std::string> parts) {
    Record record;
    record.recorded.v.resize(6, 0);
    change(record.recorded);
    BOOST_TEST(throws<std::invalid_argument>(
        [&] { deriveMotion(record.model, record.recorded, cutoff); }, parts));
  };
  const auto nothing = [](RecordedMotion&) {};
  refused(nothing, -1., {"cutoff", ">= 0", "-1"});
  refused(nothing, std::numeric_limits<double>::infinity(), {"cutoff", "inf"});
  refused(nothing, 40., {"cutoff", "< 40 Hz", "0.4", "got 40 Hz"});
  refused([](RecordedMotion& recorded) { recorded.time[50] += 0.004; }, 6.,
          {"times", "evenly spaced", "0.006", "0.014", "without a filter"});
  for (const double cutoff : {0., 6., kAutomaticCutoff}) {
    refused([](RecordedMotion& recorded) { recorded.time[50] = recorded.time[49]; }, cutoff,
            {"time must increase"});
    refused([](RecordedMotion& recorded) { recorded.time[50] = kNaN; }, cutoff,
            {"time must be finite", "frame 50"});
    refused([](RecordedMotion& recorded) { recorded.time.reverseInPlace(); }, cutoff,
            {"time must increase"});
  }
  for (const double cutoff : {6., kAutomaticCutoff}) {
    refused([](RecordedMotion& recorded) { recorded.time.resize(0); }, cutoff,
            {"at least one frame"});
    refused([](RecordedMotion& recorded) { recorded.q(2, 7) = kNaN; }, cutoff, {"q", "frame 7"});
    refused([](RecordedMotion& recorded) { recorded.q.conservativeResize(6, 201); }, cutoff,
            {"q", "7", "6"});
    refused([](RecordedMotion& recorded) { recorded.q.conservativeResize(7, 200); }, cutoff,
            {"q", "201", "200"});
  }
  refused([](RecordedMotion& recorded) { recorded.v.setZero(5, 201); }, 6., {"v", "6", "5"});
  refused([](RecordedMotion& recorded) { recorded.a.setZero(6, 3); }, 6., {"a", "201", "3"});
}
