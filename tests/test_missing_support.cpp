// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE missing_support
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "dynacom/missing_support.hpp"
#include "random_robot.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

using Intervals = std::vector<std::pair<Index, Index>>;

constexpr double kMass = 50., kWeight = kMass * 9.81;

const DynaCoM& robot() {
  static const DynaCoM made(singleBody(kMass, stance(2)));
  return made;
}

/// A verdict and an analysis that are made up: frames that are marked lack as much force.
struct Case {
  explicit Case(const std::string& marks, double force = 0.3, double step = 0.1) {
    const auto frames = static_cast<Index>(marks.size());
    analysis.time = step * VectorXd::LinSpaced(frames, 0., double(frames - 1));
    analysis.residual.setZero(6, frames);
    verdict.outcome = MotionOutcome::NotFeasible;
    verdict.unsure.setConstant(frames, false);
    for (MotionFinding& finding : verdict.findings) finding.measured.setZero(frames);
    for (Index frame = 0; frame < frames; ++frame)
      if (marks[std::size_t(frame)] == '#') lack(frame, force);
  }

  VectorXd& measured(MotionFault fault) {
    return verdict.findings[static_cast<std::size_t>(fault)].measured;
  }
  void lack(Index frame, double force) {
    measured(MotionFault::ResidualForce)[frame] = force;
    analysis.residual.col(frame).head<3>() = force * kWeight * Vector3d(2., 3., 6.) / 7.;
  }
  std::optional<MissingSupport> find() const {
    return findMissingSupport(robot(), analysis, verdict, settings);
  }
  Intervals intervals() const {
    Intervals found;
    if (const auto missing = find())
      for (const auto& interval : missing->intervals)
        found.emplace_back(interval.first, interval.last);
    return found;
  }

  MotionAnalysis analysis = {};
  MotionVerdict verdict = {};
  VerdictSettings settings;
};

Intervals findIntervals(const std::string& marks, double interruption) {
  Case some(marks);
  some.settings.interruption = interruption;
  return some.intervals();
}

/// The same by ticks of the clock: first pauses that are too short are filled, then what is left
/// too short is taken away.
Intervals findByTicks(const std::vector<Index>& ticks, const std::vector<bool>& beyond,
                      Index least) {
  const std::size_t frames = ticks.size();
  const Index end = 2 * ticks[frames - 1] - ticks[frames - 2];
  std::vector<bool> on;
  for (std::size_t k = 0; k < frames; ++k)
    on.resize(std::size_t((k + 1 < frames ? ticks[k + 1] : end) - ticks[0]), beyond[k]);
  // Changes every run of a value that is shorter than `least`; those at the ends on demand.
  const auto change = [&](bool value, bool at_ends) {
    for (std::size_t first = 0, behind; first < on.size(); first = behind) {
      for (behind = first; behind < on.size() && on[behind] == on[first];) ++behind;
      const bool is_inside = first > 0 && behind < on.size();
      if (on[first] == value && Index(behind - first) < least && (at_ends || is_inside))
        for (std::size_t k = first; k < behind; ++k) on[k] = !value;
    }
  };
  change(false, false);
  change(true, true);
  Intervals found;
  for (std::size_t k = 0; k < frames; ++k) {
    if (!on[std::size_t(ticks[k] - ticks[0])]) continue;
    const auto frame = static_cast<Index>(k);
    if (found.empty() || found.back().second < frame - 1) found.emplace_back(frame, frame);
    found.back().second = frame;
  }
  return found;
}

}  // namespace

BOOST_AUTO_TEST_CASE(intervals_are_long_but_for_short_interruptions) {
  // Of three frames and more, but for interruptions by two and less.
  const std::vector<std::pair<std::string, Intervals>> cases = {
      {"........", {}},
      {".##.....", {}},
      {".###....", {{1, 3}}},
      {"......##", {}},
      {".....###", {{5, 7}}},
      {"#.#.....", {{0, 2}}},
      {"##..##..", {{0, 5}}},
      {"##...##.", {}},
      {"#", {}},
      {"###...###", {{0, 2}, {6, 8}}},
  };
  for (const auto& [marks, expected] : cases)
    BOOST_TEST((findIntervals(marks, 0.3) == expected), marks);
  // Frames that follow each other are one interval all the same.
  BOOST_TEST((findIntervals("##.#..##", 0.) == Intervals{{0, 1}, {3, 3}, {6, 7}}));
  BOOST_TEST((findIntervals("#", 0.) == Intervals{{0, 0}}));
}

BOOST_AUTO_TEST_CASE(intervals_are_those_of_the_clock) {
  Random random(1);
  Index some = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const Index frames = random.integer(2, 40), least = random.integer(0, 60);
    std::vector<Index> ticks = {random.integer(-500, 500)};
    std::vector<bool> beyond;
    std::string marks;
    bool on = random.coin();
    for (Index k = 0; k < frames; ++k) {
      if (random.uniform(0., 1.) < 0.3) on = !on;
      beyond.push_back(on);
      marks += on ? '#' : '.';
      if (k > 0) ticks.push_back(ticks.back() + random.integer(1, 20));
    }
    Case made(marks);
    for (Index k = 0; k < frames; ++k) made.analysis.time[k] = 1e-3 * double(ticks[std::size_t(k)]);
    made.settings.interruption = 1e-3 * double(least);
    const Intervals expected = findByTicks(ticks, beyond, least);
    BOOST_TEST((made.intervals() == expected), marks << " in trial " << trial);
    const auto missing = made.find();
    BOOST_TEST(missing.has_value() == !expected.empty());
    Index inside = 0;
    for (const auto& [first, last] : expected) inside += last - first + 1;
    if (!missing) continue;
    ++some;
    BOOST_TEST(missing->frames == inside);
    BOOST_TEST(missing->share == double(inside) / double(frames));
    for (const MissingSupport::Interval& interval : missing->intervals) {
      BOOST_TEST(interval.begin == made.analysis.time[interval.first]);
      BOOST_TEST(interval.end == made.analysis.time[interval.last]);
    }
    // Whenever the motion begins, it lacks the same.
    Case later = made;
    later.analysis.time.array() += 64.;
    BOOST_TEST((later.intervals() == expected));
  }
  BOOST_TEST(some > 200);
}

BOOST_AUTO_TEST_CASE(each_fault_of_forces_counts_and_no_other) {
  for (std::size_t k = 0; k < kMotionFaults; ++k) {
    const auto fault = static_cast<MotionFault>(k);
    Case some("..........");
    const double limit = some.settings[fault].limit;
    some.measured(fault).segment(3, 4).setConstant(limit);
    BOOST_TEST(!some.find().has_value(), to_string(fault));
    some.measured(fault).segment(3, 4).setConstant(1.01 * limit);
    const bool is_of_forces =
        fault == MotionFault::ResidualForce || fault == MotionFault::ResidualTorque ||
        fault == MotionFault::CoPOutside || fault == MotionFault::FlightWithSupportNeeded;
    BOOST_TEST((some.intervals() == (is_of_forces ? Intervals{{3, 6}} : Intervals())),
               to_string(fault));
    some.settings[fault].limit *= 2.;
    BOOST_TEST(!some.find().has_value(), to_string(fault));
  }
}

BOOST_AUTO_TEST_CASE(amounts_are_the_largest_in_intervals) {
  Case some("..####..####.....#..", 0.3, 0.05);
  some.settings.interruption = 0.1;
  some.lack(9, 0.5);
  some.lack(17, 4.);  // alone: too short
  some.analysis.residual.col(3).tail<3>() = kWeight * Vector3d(0., 0.06, 0.08);
  some.analysis.residual.col(14).tail<3>().setConstant(kWeight);  // not in an interval
  some.measured(MotionFault::CoPOutside)[2] = 0.07;
  some.measured(MotionFault::CoPOutside)[17] = 0.7;
  auto missing = some.find();
  BOOST_REQUIRE(missing.has_value());
  BOOST_TEST((some.intervals() == Intervals{{2, 5}, {8, 11}}));
  BOOST_TEST(missing->frames == 8);
  BOOST_TEST(missing->share == 0.4);
  BOOST_TEST(close(missing->force, 0.5));
  BOOST_TEST(close(missing->torque, 0.1));
  BOOST_TEST(missing->cop_distance == 0.07);
  BOOST_TEST(missing->intervals[1].begin == some.analysis.time[8]);
  BOOST_TEST(missing->intervals[1].end == some.analysis.time[11]);

  // Nobody knows what unsure frames lack, which may lie in an interruption.
  some.verdict.unsure[9] = true;
  some.measured(MotionFault::ResidualForce)[9] = 0.;
  missing = some.find();
  BOOST_TEST((some.intervals() == Intervals{{2, 5}, {8, 11}}));
  BOOST_TEST(close(missing->force, 0.3));
}

BOOST_AUTO_TEST_CASE(what_is_no_number_is_missing_without_end) {
  Case some("..####..####.....#..", 0.3, 0.05);
  some.settings.interruption = 0.1;
  some.analysis.residual.col(3).setConstant(std::numeric_limits<double>::quiet_NaN());
  const auto missing = some.find();
  BOOST_REQUIRE(missing.has_value());
  BOOST_TEST(std::isinf(missing->force));
  BOOST_TEST(std::isinf(missing->torque));
}

BOOST_AUTO_TEST_CASE(nothing_is_missing_of_what_is_unknown) {
  Case some("##########");
  BOOST_TEST(some.find().has_value());
  some.verdict.outcome = MotionOutcome::Feasible;
  BOOST_TEST(some.find().has_value());
  some.verdict.outcome = MotionOutcome::Unknown;
  BOOST_TEST(!some.find().has_value());
}

BOOST_AUTO_TEST_CASE(what_does_not_belong_together_is_refused) {
  const Case some("#####");
  Case other = some;
  other.analysis.time.conservativeResize(4);
  BOOST_TEST(throws<std::invalid_argument>([&] { other.find(); }, {"analysis", "4", "5"}));
  other = some;
  other.analysis.residual.setZero(6, 7);
  BOOST_TEST(throws<std::invalid_argument>([&] { other.find(); }, {"analysis", "7", "5"}));
  other = some;
  other.measured(MotionFault::CoPOutside).setZero(2);
  BOOST_TEST(throws<std::invalid_argument>([&] { other.find(); }, {"verdict", "2", "5"}));
  other = some;
  other.settings.interruption = -1.;
  BOOST_TEST(throws<std::invalid_argument>([&] { other.find(); }, {"interruption", "-1"}));
  BOOST_CHECK_THROW(findMissingSupport(DynaCoM(), some.analysis, some.verdict), NotReadyError);
}
