// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE motion_examination
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>
#include <mutex>
#include <optional>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

#include "dynacom/motion_examination.hpp"
#include "feet.hpp"
#include "random_robot.hpp"
#include "walker.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

/// A body above two soles, and clips of it: it sways, each time by another amount, so that some
/// frames are out of reach, and its right foot is off the ground for a while.
struct Clips {
  Clips() : model(singleBody(10., stance(2))), robot(model) {
    for (const char* frame : {"sole0", "sole1"}) robot.addContact(makeSole(frame), frame);
  }

  RecordedMotion make(std::size_t number, Index frames = 600) const {
    RecordedMotion recorded;
    recorded.time = VectorXd::LinSpaced(frames, 0., 0.01 * double(frames - 1));
    recorded.q = restState(model).q.replicate(1, frames);
    const Eigen::ArrayXd t = recorded.time.array();
    const double size = 0.15 * double(number + 1);
    recorded.q.row(0) = size * (4. * t).sin() * (1.3 * t).cos();
    recorded.q.row(1) = 0.5 * size * (3. * t).sin();
    recorded.schedule = ContactSchedule{robot.getKnownContacts(),
                                        ContactSchedule::Matrix::Constant(2, frames, true)};
    recorded.schedule->active.row(1).segment(frames / 3, frames / 4).setConstant(false);
    return recorded;
  }

  pinocchio::Model model;
  DynaCoM robot;
};

/// All numbers of a matrix and others, bit for bit.
void append(std::vector<double>& numbers, const Eigen::Ref<const MatrixXd>& values) {
  for (Index col = 0; col < values.cols(); ++col)
    for (Index row = 0; row < values.rows(); ++row) numbers.push_back(values(row, col));
}

std::vector<double> numbersOf(const MotionExamination& found) {
  std::vector<double> numbers;
  append(numbers, found.derived.motion.a);
  append(numbers, found.ground);
  append(numbers, found.analysis.residual);
  append(numbers, found.analysis.cop);
  append(numbers, found.analysis.nl);
  for (const ContactMotion& contact : found.contacts) append(numbers, contact.velocity);
  for (const MotionAnalysis::Contact& contact : found.analysis.contacts)
    append(numbers, contact.wrench);
  for (const MotionFinding& finding : found.verdict.findings) append(numbers, finding.measured);
  append(numbers, found.statistics.mean_residual);
  numbers.push_back(found.statistics.residual_torque_rms);
  for (const CutoffSensitivity& other : found.sensitivity) {
    numbers.push_back(other.cutoff);
    numbers.push_back(other.statistics.residual_torque_rms);
  }
  return numbers;
}

/// A schedule around whose flights contacts are active that are so within some frames.
ContactSchedule widen(ContactSchedule schedule, Index width) {
  const ContactSchedule::Matrix active = schedule.active;
  const Index frames = active.cols();
  for (Index edge = 1; edge < frames; ++edge) {
    if (active.col(edge).any() == active.col(edge - 1).any()) continue;
    for (Index frame = edge - 1 - width; frame <= edge + width; ++frame)
      for (Index other = frame - width; other <= frame + width; ++other)
        if (frame >= 0 && frame < frames && other >= 0 && other < frames)
          for (Index k = 0; k < active.rows(); ++k)
            if (active(k, other)) schedule.active(k, frame) = true;
  }
  return schedule;
}

bool sameBits(const std::vector<double>& one, const std::vector<double>& other) {
  return one.size() == other.size() &&
         std::memcmp(one.data(), other.data(), one.size() * sizeof(double)) == 0;
}

}  // namespace

BOOST_AUTO_TEST_CASE(an_examination_is_its_steps) {
  const Clips clips;
  RecordedMotion recorded = clips.make(2);
  for (const bool scheduled : {true, false}) {
    if (!scheduled) recorded.schedule.reset();
    ExaminationSettings settings;
    settings.cutoff = 11.;
    settings.analysis.omega = 3.;
    settings.detection.contact_gain = 9.;
    settings.verdict.cop_force = 0.02;
    const MotionExamination found = examineMotion(clips.robot, recorded, settings);

    const DerivedMotion derived = deriveMotion(clips.model, recorded, 11.);
    const Motion& motion = derived.motion;
    const PartRobot split = splitContacts(clips.robot);
    const auto contacts = computeContactMotions(clips.robot, motion);
    const auto motions = computeContactMotions(split.robot, motion);
    ContactSchedule none;
    none.active.resize(0, motion.frames());
    const MotionAnalysis dynamics = analyzeMotion(split.robot, motion, none, settings.analysis);
    const ContactInference inference =
        inferContacts(split, motions, dynamics, false, settings.detection,
                      scheduled ? &*recorded.schedule : nullptr);
    const ContactSchedule schedule = gatherParts(clips.robot, split, inference.schedule);
    // The centre of pressure lies on the mean of what is stood on.
    DynaCoM robot = split.robot;
    robot.setGroundHeight(
        (inference.schedule.active.array()).select(inference.ground.array(), 0.).sum() /
        double(inference.schedule.active.count()));
    const MotionAnalysis parts =
        analyzeMotion(robot, motion, inference.schedule, settings.analysis);
    // A filter smears what happens around take-offs and landings.
    Eigen::Array<bool, Eigen::Dynamic, 1> unsure = derived.unsure;
    if (unsure.size() == 0) unsure.setConstant(motion.frames(), false);
    for (Index edge = 1; edge < motion.frames(); ++edge)
      if (schedule.active.col(edge).any() != schedule.active.col(edge - 1).any())
        for (Index frame = 0; frame < motion.frames(); ++frame)
          if (frame >= edge - 5 && frame <= edge + 4) unsure[frame] = true;
    const MotionVerdict verdict = judgeMotion(robot, motion, recorded, motions, inference.ground,
                                              parts, settings.verdict, 0, unsure);
    const MotionAnalysis analysis = gatherParts(clips.robot, split, contacts, motions, parts);
    const MotionStatistics statistics = summarizeMotion(clips.robot, motion, analysis, verdict);

    BOOST_TEST(close(found.derived.motion.a, motion.a, 0.));
    BOOST_TEST(found.parts.size() == 8u);
    BOOST_TEST(close(found.ground, MatrixXd::Zero(2, motion.frames()), 1e-12));
    BOOST_TEST((found.schedule.active.array() == schedule.active.array()).all());
    BOOST_TEST(
        (found.inference.schedule.active.array() == inference.schedule.active.array()).all());
    BOOST_TEST(found.inferred.has_value() == scheduled);
    BOOST_TEST(close(
        found.schedule.confidence,
        scheduled ? MatrixXd(recorded.schedule->active.cast<double>()) : schedule.confidence, 0.));
    BOOST_TEST(close(found.analysis.cop, analysis.cop, 1e-9));
    BOOST_TEST(close(found.analysis.residual, analysis.residual, 1e-9));
    for (const std::size_t k : {0, 1})
      BOOST_TEST(close(found.analysis.contacts[k].wrench, analysis.contacts[k].wrench, 1e-9));
    BOOST_TEST(found.analysis.omega == 3.);
    for (std::size_t k = 0; k < kMotionFaults; ++k)
      BOOST_TEST(close(found.verdict.findings[k].measured, verdict.findings[k].measured, 1e-9));
    BOOST_TEST(close(found.statistics.residual_force_rms, statistics.residual_force_rms, 1e-9));
    BOOST_TEST(found.sensitivity.empty());
    const Terrain terrain =
        findTerrain(split.parts, inference, schedule, MatrixXd::Zero(2, motion.frames()),
                    motion.time, settings.detection.ground_height);
    BOOST_TEST(close(found.terrain.lowest, terrain.lowest));
    BOOST_TEST(found.terrain.contacts[1].name == clips.robot.getKnownContacts()[1]);
    BOOST_TEST(close(found.terrain.contacts[1].height, 0.));
    BOOST_TEST(found.terrain.held.size() == terrain.held.size());
    const auto missing = findMissingSupport(clips.robot, analysis, verdict, settings.verdict);
    BOOST_TEST_REQUIRE(missing.has_value());
    BOOST_TEST_REQUIRE(found.missing_support.has_value());
    BOOST_TEST(found.missing_support->frames == missing->frames);
    BOOST_TEST(close(found.missing_support->force, missing->force, 1e-9));
    BOOST_TEST(found.missing_support->force <=
               std::max(found.verdict[MotionFault::ResidualForce].worst,
                        found.verdict[MotionFault::FlightWithSupportNeeded].worst));
    const CentroidalChange change = distanceToFeasible(
        split, motions, parts, widen(inference.schedule, 4), settings.filter, derived.unsure);
    BOOST_TEST_REQUIRE(found.distance.has_value());
    BOOST_TEST(close(found.distance->com, change.com, 1e-9));
    BOOST_TEST(change.largest > 0.01);
    // Something is out of reach, and something is not.
    BOOST_TEST(statistics.share(DistributionStatus::Solved) > 0.1);
    BOOST_TEST(statistics.share(DistributionStatus::Relaxed) > 0.05);
  }
}

BOOST_AUTO_TEST_CASE(around_flights_contacts_push_a_little_earlier_and_later) {
  // It stands still, but is said to be in the air for a while: there it would have to fall.
  const Clips clips;
  RecordedMotion recorded = clips.make(0, 300);
  recorded.q = restState(clips.model).q.replicate(1, 300);
  recorded.schedule->active.setConstant(true);
  ExaminationSettings settings;
  settings.cutoff = 9.6;
  settings.filter.reach = settings.filter.change = 1e-6;
  const auto examine = [&](Index flight) {
    recorded.schedule->active.middleCols(150, flight).setConstant(false);
    return examineMotion(clips.robot, recorded, settings);
  };
  // Half a period of the cut-off is a little more than five frames: both sides bridge ten.
  const MotionExamination bridged = examine(10);
  BOOST_TEST(bridged.verdict.unsure.segment(150, 10).all());
  BOOST_TEST_REQUIRE(bridged.distance.has_value());
  BOOST_TEST(bridged.distance->largest == 0.);
  // Of twenty, ten remain: a tenth of a second of free fall, and two without a filter.
  const MotionExamination falling = examine(20);
  BOOST_TEST_REQUIRE(falling.distance.has_value());
  BOOST_TEST(falling.distance->largest > 0.002);
  settings.cutoff = 0.;
  const MotionExamination all = examine(20);
  BOOST_TEST_REQUIRE(all.distance.has_value());
  BOOST_TEST(all.distance->largest > falling.distance->largest);
  // In the flight that remains, the CoM is on a parabola.
  const auto height = falling.distance->com.row(2);
  for (Index frame = 156; frame < 164; ++frame)
    BOOST_TEST(
        close((height[frame - 1] - 2. * height[frame] + height[frame + 1]) * 1e4, -9.81, 1e-2));
}

BOOST_AUTO_TEST_CASE(the_distance_may_be_left_out_and_makes_motions_repairable) {
  const Clips clips;
  const RecordedMotion recorded = clips.make(2);
  ExaminationSettings settings;
  settings.cutoff = 6.;
  settings.sensitivity = true;
  const MotionExamination found = examineMotion(clips.robot, recorded, settings);
  BOOST_TEST_REQUIRE(found.distance.has_value());
  const double rms = found.distance->rms, largest = found.distance->largest;
  BOOST_TEST(close(rms, std::sqrt(found.distance->com.squaredNorm() / 600.)));
  BOOST_TEST(close(largest, found.distance->com.col(found.distance->frame).norm()));
  BOOST_TEST((found.verdict.outcome == MotionOutcome::NotFeasible));

  settings.distance = false;
  settings.verdict.repairable_distance = settings.verdict.repairable_largest_distance = 10.;
  settings.verdict.repairable_slide = 10.;
  const MotionExamination without = examineMotion(clips.robot, recorded, settings);
  BOOST_TEST(!without.distance.has_value());
  BOOST_TEST((without.verdict.outcome == MotionOutcome::NotFeasible));
  BOOST_TEST(sameBits(numbersOf(without), numbersOf(found)));

  settings.distance = true;
  const MotionExamination near = examineMotion(clips.robot, recorded, settings);
  BOOST_TEST((near.verdict.outcome == MotionOutcome::Repairable));
  BOOST_TEST(near.verdict.getCodes() == found.verdict.getCodes());
  BOOST_TEST_REQUIRE(near.sensitivity.size() == 2u);
  for (const CutoffSensitivity& other : near.sensitivity)
    BOOST_TEST((other.verdict.outcome != MotionOutcome::NotFeasible));
  for (const double part : {0.99, 1.01}) {
    settings.verdict.repairable_distance = part * rms;
    BOOST_TEST((examineMotion(clips.robot, recorded, settings).verdict.outcome ==
                (part < 1. ? MotionOutcome::NotFeasible : MotionOutcome::Repairable)));
  }

  // Of what cannot be judged, nothing is said.
  RecordedMotion shorter = clips.make(2, 3);
  BOOST_TEST(
      (examineMotion(clips.robot, shorter, settings).verdict.outcome == MotionOutcome::Unknown));
  BOOST_TEST(!examineMotion(clips.robot, shorter, settings).distance.has_value());
  settings.filter.window = 0.;
  BOOST_TEST(throws<std::invalid_argument>([&] { examineMotion(clips.robot, recorded, settings); },
                                           {"CentroidalFilterSettings.window", "> 0"}));
}

BOOST_AUTO_TEST_CASE(what_is_recorded_says_how_sure_it_is) {
  const Clips clips;
  RecordedMotion recorded = clips.make(0);
  const Index frames = recorded.time.size();
  // One contact only, as sure as it says.
  recorded.schedule =
      ContactSchedule{{"sole1"}, ContactSchedule::Matrix::Constant(1, frames, true)};
  recorded.schedule->confidence = MatrixXd::Constant(1, frames, 0.75);
  MotionExamination found = examineMotion(clips.robot, recorded);
  BOOST_TEST((found.schedule.names == clips.robot.getKnownContacts()));
  BOOST_TEST((found.schedule.confidence.row(0).array() == 0.).all());
  BOOST_TEST((found.schedule.confidence.row(1).array() == 0.75).all());
  BOOST_TEST(!found.schedule.active.row(0).any());
  // The other one stands, too: what is given and what is found differ in it.
  BOOST_TEST_REQUIRE(found.disagreement.size() == 2);
  for (const Index k : {0, 1}) {
    Index frames_that_differ = 0;
    for (Index frame = 0; frame < frames; ++frame)
      frames_that_differ += found.schedule.active(k, frame) != found.inferred->active(k, frame);
    BOOST_TEST(found.disagreement[k] == double(frames_that_differ) / double(frames));
  }
  BOOST_TEST(found.disagreement[0] > 0.5);
  BOOST_TEST(found.disagreement[1] < 0.1);
  recorded.schedule->confidence.resize(0, 0);
  found = examineMotion(clips.robot, recorded);
  BOOST_TEST((found.schedule.confidence.row(1).array() == 1.).all());
  recorded.schedule.reset();
  BOOST_TEST(examineMotion(clips.robot, recorded).disagreement.size() == 0);
}

BOOST_AUTO_TEST_CASE(other_cutoffs_are_tried_where_there_was_a_filter) {
  const Clips clips;
  RecordedMotion recorded = clips.make(2);
  ExaminationSettings settings;
  settings.cutoff = 6.;
  settings.sensitivity = true;
  std::vector<double> told;
  settings.progress = [&](double part) { told.push_back(part); };
  MotionExamination found = examineMotion(clips.robot, recorded, settings);
  BOOST_REQUIRE(found.sensitivity.size() == 2u);
  for (const std::size_t k : {0, 1}) {
    ExaminationSettings other;
    other.cutoff = k == 0 ? 3. : 12.;
    const MotionExamination expected = examineMotion(clips.robot, recorded, other);
    BOOST_TEST(found.sensitivity[k].cutoff == other.cutoff);
    BOOST_TEST(found.sensitivity[k].statistics.residual_torque_rms ==
               expected.statistics.residual_torque_rms);
    BOOST_TEST(expected.statistics.residual_torque_rms != found.statistics.residual_torque_rms);
  }
  BOOST_TEST(std::is_sorted(told.begin(), told.end()));
  BOOST_TEST(told.back() == 1.);

  // Twice this is too much for the frame rate.
  settings.cutoff = 25.;
  BOOST_TEST(examineMotion(clips.robot, recorded, settings).sensitivity.size() == 1u);
  settings.cutoff = 0.;
  BOOST_TEST(examineMotion(clips.robot, recorded, settings).sensitivity.empty());
  // By itself: the motion is a sine, and exact.
  settings.cutoff = kAutomaticCutoff;
  found = examineMotion(clips.robot, recorded, settings);
  BOOST_TEST(found.derived.is_automatic);
  BOOST_TEST(found.derived.cutoff == 0.);
  BOOST_TEST(found.sensitivity.empty());
  BOOST_TEST(told.back() == 1.);
}

BOOST_AUTO_TEST_CASE(an_examiner_has_no_memory_of_motions) {
  const Clips clips;
  ExaminationSettings settings;
  settings.analysis.threads = 3;
  const MotionExaminer examiner(clips.robot, settings);
  for (const std::size_t number : {3, 0, 2, 3, 1}) {
    const auto expected = numbersOf(examineMotion(clips.robot, clips.make(number), settings));
    BOOST_TEST(sameBits(numbersOf(examiner.examine(clips.make(number))), expected));
  }
  BOOST_TEST(examiner.getSettings().analysis.threads == 3);

  // Neither has a copy, or what was moved to.
  MotionExaminer copy(examiner);
  const auto expected_of_copy = numbersOf(examineMotion(clips.robot, clips.make(2), settings));
  BOOST_TEST(sameBits(numbersOf(copy.examine(clips.make(2))), expected_of_copy));
  const MotionExaminer moved(std::move(copy));
  BOOST_TEST(sameBits(numbersOf(moved.examine(clips.make(2))), expected_of_copy));

  // It has a robot of its own.
  Clips other;
  const RecordedMotion recorded = other.make(1);
  const auto expected = numbersOf(examineMotion(other.robot, recorded));
  const MotionExaminer own(other.robot);
  other.robot.removeContact("sole0");
  BOOST_TEST(sameBits(numbersOf(own.examine(recorded)), expected));
}

BOOST_AUTO_TEST_CASE(threads_may_share_an_examiner) {
  const Clips clips;
  ExaminationSettings settings;
  settings.analysis.threads = 2;
  const MotionExaminer examiner(clips.robot, settings);
  std::vector<std::vector<double>> found(4);
  std::vector<std::thread> threads;
  for (std::size_t k = 0; k < found.size(); ++k)
    threads.emplace_back([&, k] { found[k] = numbersOf(examiner.examine(clips.make(k))); });
  for (std::thread& thread : threads) thread.join();
  for (std::size_t k = 0; k < found.size(); ++k)
    BOOST_TEST(sameBits(found[k], numbersOf(examineMotion(clips.robot, clips.make(k)))));
}

BOOST_AUTO_TEST_CASE(progress_is_told_by_one_thread_at_a_time) {
  const Clips clips;
  std::atomic<int> inside{0}, told{0};
  std::atomic<bool> alone{true};
  ExaminationSettings settings;
  settings.progress = [&](double) {
    if (++inside > 1) alone = false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    --inside;
    ++told;
  };
  const MotionExaminer examiner(clips.robot, settings);
  std::vector<std::thread> threads;
  for (std::size_t k = 0; k < 4; ++k)
    threads.emplace_back([&, k] { examiner.examine(clips.make(k)); });
  for (std::thread& thread : threads) thread.join();
  BOOST_TEST(alone);
  BOOST_TEST(told >= 4);
}

BOOST_AUTO_TEST_CASE(who_is_told_of_progress_may_examine_too) {
  const Clips clips;
  std::optional<MotionExaminer> examiner;
  int depth = 0, inner = 0;
  ExaminationSettings settings;
  settings.progress = [&](double) {
    if (++depth == 1 && inner == 0) {
      examiner->examine(clips.make(1));
      ++inner;
    }
    --depth;
  };
  examiner.emplace(clips.robot, settings);
  BOOST_TEST(sameBits(numbersOf(examiner->examine(clips.make(0))),
                      numbersOf(examineMotion(clips.robot, clips.make(0)))));
  BOOST_TEST(inner == 1);
}

BOOST_AUTO_TEST_CASE(a_process_that_was_forked_while_a_thread_examines_examines_too) {
  const Clips clips;
  ExaminationSettings settings;
  settings.analysis.threads = 2;
  settings.progress = [](double) {};
  const MotionExaminer examiner(clips.robot, settings);
  const std::vector<double> expected = numbersOf(examiner.examine(clips.make(0)));
  std::atomic<bool> ends{false};
  std::thread other([&] {
    while (!ends) examiner.examine(clips.make(1));
  });
  int failed = 0;
  for (int trial = 0; trial < 10 && failed == 0; ++trial) {
    const pid_t child = fork();
    if (child == 0) {
      alarm(60);
      _exit(sameBits(numbersOf(examiner.examine(clips.make(0))), expected) ? 0 : 1);
    }
    int status = -1;
    if (waitpid(child, &status, 0) != child || status != 0) ++failed;
  }
  ends = true;
  other.join();
  BOOST_TEST(failed == 0);
}

BOOST_AUTO_TEST_CASE(many_motions_are_each_what_they_are_alone) {
  const Clips clips;
  const std::size_t count = 23;
  std::vector<std::vector<double>> expected;
  for (std::size_t k = 0; k < count; ++k)
    expected.push_back(
        numbersOf(examineMotion(clips.robot, clips.make(k % 5, 100 + 40 * Index(k)))));
  for (const int threads : {1, 2, 5}) {
    ExaminationSettings settings;
    settings.analysis.threads = threads;
    settings.progress = [](double) { BOOST_ERROR("nobody asked"); };
    std::vector<int> times(count);
    std::atomic<int> in_memory{0};
    std::atomic<bool> inside{false};
    bool is_alone = true;
    int most = 0;
    std::mutex mutex;
    analyzeMotions(
        clips.robot, count,
        [&](std::size_t k) {
          const int now = ++in_memory;
          const std::lock_guard<std::mutex> lock(mutex);
          most = std::max(most, now);
          return clips.make(k % 5, 100 + 40 * Index(k));
        },
        [&](std::size_t k, const MotionExamination* found, const std::string& error) {
          is_alone = is_alone && !inside.exchange(true);
          ++times[k];
          BOOST_REQUIRE(found != nullptr);
          BOOST_TEST(error.empty());
          BOOST_TEST(sameBits(numbersOf(*found), expected[k]));
          --in_memory;
          inside = false;
        },
        settings);
    BOOST_TEST(is_alone);
    BOOST_TEST((std::set<int>(times.begin(), times.end()) == std::set<int>{1}));
    BOOST_TEST(most <= threads);
  }
}

BOOST_AUTO_TEST_CASE(a_clip_that_fails_is_no_end) {
  const Clips clips;
  for (const int threads : {1, 3}) {
    ExaminationSettings settings;
    settings.analysis.threads = threads;
    std::vector<std::string> errors(6, "not done");
    analyzeMotions(
        clips.robot, errors.size(),
        [&](std::size_t k) {
          RecordedMotion recorded = clips.make(k, 50);
          if (k == 1) throw std::runtime_error("no such file");
          if (k == 2) throw 7;
          if (k == 3) recorded.q(0, 5) = std::numeric_limits<double>::quiet_NaN();
          if (k == 4) recorded.time.resize(0);
          return recorded;
        },
        [&](std::size_t k, const MotionExamination* found, const std::string& error) {
          BOOST_TEST((found == nullptr) == !error.empty());
          errors[k] = error;
        },
        settings);
    BOOST_TEST(errors[0] == "");
    BOOST_TEST(errors[1] == "no such file");
    BOOST_TEST(errors[2] == "unknown exception");
    BOOST_TEST(mentions(errors[3], "frame 5"));
    BOOST_TEST(mentions(errors[4], "time"));
    BOOST_TEST(errors[5] == "");
  }
}

BOOST_AUTO_TEST_CASE(what_is_done_with_results_may_end_the_job) {
  const Clips clips;
  std::atomic<int> read{0};
  const auto work = [&] {
    analyzeMotions(
        clips.robot, 1000,
        [&](std::size_t) {
          ++read;
          return clips.make(0, 20);
        },
        [](std::size_t, const MotionExamination*, const std::string&) {
          throw std::runtime_error("disk full");
        });
  };
  BOOST_TEST(throws<std::runtime_error>(work, {"disk full"}));
  BOOST_TEST(read < 1000);
  int done = 0;
  analyzeMotions(
      clips.robot, 0, [&](std::size_t k) { return clips.make(k); },
      [&](std::size_t, const MotionExamination*, const std::string&) { ++done; });
  BOOST_TEST(done == 0);
}

BOOST_AUTO_TEST_CASE(what_cannot_be_examined_is_refused) {
  const Clips clips;
  const auto refused = [&](const auto& change, std::initializer_list<std::string> words) {
    ExaminationSettings settings;
    change(settings);
    BOOST_TEST(throws<std::invalid_argument>([&] { settings.validate(); }, words));
    BOOST_TEST(throws<std::invalid_argument>(
        [&] { examineMotion(clips.robot, clips.make(0), settings); }, words));
  };
  refused([](auto& s) { s.cutoff = -1.; }, {"ExaminationSettings.cutoff", ">=", "-1"});
  refused([](auto& s) { s.cutoff = std::numeric_limits<double>::infinity(); }, {"finite", "inf"});
  refused([](auto& s) { s.analysis.threads = -1; }, {"AnalysisSettings.threads", "-1"});
  refused([](auto& s) { s.detection.change = -1.; }, {"DetectionSettings.change"});
  refused([](auto& s) { s.verdict.cop_force = -1.; }, {"VerdictSettings.cop_force"});

  RecordedMotion recorded = clips.make(0);
  recorded.schedule->names[0] = "nose";
  BOOST_TEST(
      throws<std::invalid_argument>([&] { examineMotion(clips.robot, recorded); }, {"nose"}));
  BOOST_TEST(throws<NotReadyError>([&] { MotionExaminer{DynaCoM()}; }, {"MotionExaminer"}));
  BOOST_TEST(throws<NotReadyError>(
      [&] {
        analyzeMotions(
            DynaCoM(), 1, [&](std::size_t k) { return clips.make(k); },
            [](std::size_t, const MotionExamination*, const std::string&) {});
      },
      {"initialize"}));
}

BOOST_AUTO_TEST_CASE(on_a_ramp_forces_have_its_normal_and_elsewhere_nothing_changes) {
  const Walker walker;
  constexpr double degrees = 12.;
  const RecordedMotion recorded = walker.walk(Walker::walkAhead(ramp(degrees, 0.65, 1.6), 11));
  const MotionExamination found = examineMotion(*walker.robot, recorded, {});
  const Index frames = recorded.time.size();
  std::vector<std::vector<bool>> on_slope(8, std::vector<bool>(std::size_t(frames), false));
  for (const Stance& stance : found.inference.stances)
    for (Index frame = stance.begin; frame < stance.end; ++frame)
      on_slope[stance.part][std::size_t(frame)] = !stance.slope.isZero(0.);

  // The same with points that push along the vertical everywhere.
  const PartRobot split = splitContacts(*walker.robot);
  DynaCoM robot = split.robot;
  robot.setGroundHeight(
      found.inference.schedule.active.select(found.inference.ground.array(), 0.).sum() /
      double(found.inference.schedule.active.count()));
  AnalysisSettings settings;
  const MotionAnalysis vertical =
      analyzeMotion(robot, found.derived.motion, found.inference.schedule, settings);

  const double gradient = std::tan(degrees * std::acos(-1.) / 180.);
  Index level = 0, steep = 0;
  for (Index frame = 0; frame < frames; ++frame) {
    bool any = false, all = true;
    for (std::size_t k = 0; k < 8; ++k)
      if (found.inference.schedule.active(Index(k), frame)) {
        any = any || on_slope[k][std::size_t(frame)];
        all = all && on_slope[k][std::size_t(frame)];
      }
    const Vector3d force = found.analysis.ground_force.col(frame);
    for (std::size_t k = 0; k < 8; ++k) {
      const MotionAnalysis::Contact& part = found.analysis.parts[k];
      if (!part.active[frame]) continue;
      const Vector3d normal =
          Eigen::Quaterniond(Eigen::Vector4d(found.part_motions[k].rotation.col(frame))) *
          Vector3d::UnitZ();
      const Vector2d slope = -normal.head<2>() / normal.z();
      BOOST_TEST(close(slope, Vector2d(on_slope[k][std::size_t(frame)] ? gradient : 0., 0.), 1e-3));
    }
    if (!any) {
      ++level;
      for (std::size_t k = 0; k < 8; ++k)
        BOOST_TEST((found.analysis.parts[k].wrench.col(frame).array() ==
                    vertical.contacts[k].wrench.col(frame).array())
                       .all());
    } else if (all && found.analysis.status[std::size_t(frame)] == DistributionStatus::Solved &&
               std::abs(force.x()) < 1e-6 && std::abs(force.y()) < 1e-6) {
      // Who stands still asks of the ground what its weight does.
      ++steep;
      for (const MotionAnalysis::Contact& contact : found.analysis.contacts)
        if (contact.active[frame])
          BOOST_TEST(close(contact.friction_usage[frame], gradient / 0.7, 2e-3));
    }
  }
  BOOST_TEST(level > frames / 4);
  BOOST_TEST(steep > 100);
}
