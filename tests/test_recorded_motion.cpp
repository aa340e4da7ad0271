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

BOOST_AUTO_TEST_CASE(a_single_frame_is_at_rest) {
  Record record(1);
  record.recorded.v.resize(6, 0);
  const DerivedMotion derived = deriveMotion(record.model, record.recorded, 6.);
  BOOST_TEST(derived.cutoff == 0.);
  BOOST_TEST(derived.motion.v.isZero(0.));
  BOOST_TEST(derived.motion.a.isZero(0.));
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
  refused(nothing, kNaN, {"cutoff", "nan"});
  refused(nothing, 40., {"cutoff", "< 40 Hz", "0.4", "got 40 Hz"});
  refused([](RecordedMotion& recorded) { recorded.time[50] += 0.004; }, 6.,
          {"times", "evenly spaced", "0.006", "0.014", "without a filter"});
  for (const double cutoff : {0., 6.}) {
    refused([](RecordedMotion& recorded) { recorded.time[50] = recorded.time[49]; }, cutoff,
            {"time must increase"});
    refused([](RecordedMotion& recorded) { recorded.time[50] = kNaN; }, cutoff,
            {"time must be finite", "frame 50"});
    refused([](RecordedMotion& recorded) { recorded.time.reverseInPlace(); }, cutoff,
            {"time must increase"});
  }
  refused([](RecordedMotion& recorded) { recorded.time.resize(0); }, 6., {"at least one frame"});
  refused([](RecordedMotion& recorded) { recorded.q(2, 7) = kNaN; }, 6., {"q", "frame 7"});
  refused([](RecordedMotion& recorded) { recorded.v.setZero(5, 201); }, 6., {"v", "6", "5"});
  refused([](RecordedMotion& recorded) { recorded.a.setZero(6, 3); }, 6., {"a", "201", "3"});
}
