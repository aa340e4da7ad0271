// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE contact_inference
#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "dynacom/contact_inference.hpp"
#include "feet.hpp"
#include "random_robot.hpp"
#include "walker.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

/// A body of 10 kg, 0.7 m above the soles of two massless feet that go wherever they are put.
struct Puppet {
  Puppet() {
    model = singleBody(10., {});
    addFeet(model);
    robot.emplace(model);
    for (const char* name : {"left", "right"})
      robot->addContact(makeSole(std::string(name) + "_foot"), name);
    split.emplace(splitContacts(*robot));
  }

  /// Stands above the middle between its feet, except that the right foot is up to so high for the
  /// middle third of the time, while the body is above the left one.
  Motion step(double height, Index frames = 301) const {
    Motion motion{VectorXd::LinSpaced(frames, 0., 0.01 * double(frames - 1)),
                  MatrixXd::Zero(model.nq, frames), MatrixXd::Zero(model.nv, frames),
                  MatrixXd::Zero(model.nv, frames)};
    motion.q.row(2).setConstant(0.7);
    motion.q.row(6).setOnes();
    motion.q.middleRows(7, 6).colwise() = (Vector6() << 0., 0.1, -0.7, 0., -0.1, -0.7).finished();
    const double third = motion.time[frames - 1] / 3.;
    const double pi = std::acos(-1.);
    for (Index frame = 0; frame < frames; ++frame) {
      const double part = (motion.time[frame] - third) / third;
      if (height == 0.) continue;
      // Nothing here asks how the body gets to the left foot and back.
      motion.q(1, frame) = part > -0.3 && part < 1.3 ? 0.1 : 0.;
      motion.q(8, frame) -= motion.q(1, frame);
      motion.q(11, frame) -= motion.q(1, frame);
      if (part <= 0. || part >= 1.) continue;
      motion.q(12, frame) += height * std::pow(std::sin(pi * part), 2);
      motion.v(11, frame) = height * pi / third * std::sin(2. * pi * part);
    }
    return motion;
  }

  ContactInference infer(const Motion& motion, const DetectionSettings& settings = {},
                         const ContactSchedule* recorded = nullptr, bool exact = true) const {
    const auto motions = computeContactMotions(split->robot, motion);
    ContactSchedule none;
    none.active.resize(0, motion.frames());
    return inferContacts(*split, motions, analyzeMotion(split->robot, motion, none), exact,
                         settings, recorded);
  }

  ContactSchedule gather(const ContactInference& found) const {
    return gatherParts(*robot, *split, found.schedule);
  }

  pinocchio::Model model;
  std::optional<DynaCoM> robot;
  std::optional<PartRobot> split;
};

}  // namespace

BOOST_AUTO_TEST_CASE(who_stands_is_in_contact_and_a_foot_in_the_air_is_not) {
  const Puppet puppet;
  const ContactInference stands = puppet.infer(puppet.step(0.));
  BOOST_TEST(stands.schedule.active.all());
  BOOST_TEST(stands.schedule.confidence.minCoeff() > 0.9);
  BOOST_TEST((stands.schedule.readiness.array() == 1.).all());
  BOOST_TEST(close(stands.ground, MatrixXd::Zero(8, 301), 1e-12));
  BOOST_TEST(stands.stances.size() == 8u);
  BOOST_TEST(stands.ground_velocity == Vector3d::Zero());

  const ContactInference steps = puppet.infer(puppet.step(0.1));
  const ContactSchedule feet = puppet.gather(steps);
  BOOST_TEST(feet.active.row(0).all());
  for (Index frame = 0; frame < 301; ++frame) {
    const bool up = frame > 100 && frame < 200;
    if (frame > 110 && frame < 190) BOOST_TEST(!feet.active(1, frame));
    if (!up) BOOST_TEST(feet.active(1, frame));
    BOOST_TEST(steps.schedule.confidence.col(frame).minCoeff() >= 0.);
    BOOST_TEST(steps.schedule.confidence.col(frame).maxCoeff() <= 1.);
  }
  // Where it is highest a foot is at rest, too, but nothing carries it there.
  for (const Stance& stance : steps.stances) {
    BOOST_TEST(stance.on_ground == (stance.height < 0.05));
    if (stance.on_ground) BOOST_TEST(std::abs(stance.height) < 1e-12);
  }
  // Loads ramp where contacts begin and end: over a tenth of a second.
  Index last = 100;
  while (!feet.active(1, last)) --last;
  while (feet.active(1, last)) ++last;
  --last;
  const auto part = static_cast<Index>(4);
  // One frame of ten before its end, from 0.3.
  BOOST_TEST(close(steps.schedule.readiness(part, last), 0.37, 1e-9));
  BOOST_TEST(steps.schedule.readiness(part, last - 15) == 1.);
}

BOOST_AUTO_TEST_CASE(it_does_not_matter_for_how_long_who_has_moved_stands_still) {
  const Puppet puppet;
  Motion motion = puppet.step(0.1);
  const Index frames = motion.frames();
  // Feet that tremble, so that scales are those of the motion, and not where they end.
  for (Index frame = 0; frame < frames; ++frame)
    for (const Index foot : {9, 12}) {
      const double phase = 0.7 * double(frame) + double(foot);
      motion.q(foot, frame) += 0.0003 * std::sin(phase) + 1e-5 * double(frames - frame);
      motion.v(foot - 1, frame) += 0.0003 * 70. * std::cos(phase);
    }
  const Index still = 2000;
  Motion longer{VectorXd::LinSpaced(frames + 2 * still, 0., 0.01 * double(frames + 2 * still - 1)),
                MatrixXd(puppet.model.nq, frames + 2 * still),
                MatrixXd::Zero(puppet.model.nv, frames + 2 * still),
                MatrixXd::Zero(puppet.model.nv, frames + 2 * still)};
  longer.q << motion.q.col(0).replicate(1, still), motion.q,
      motion.q.col(frames - 1).replicate(1, still);
  longer.v.middleCols(still, frames) = motion.v;
  const ContactInference alone = puppet.infer(motion, {}, nullptr, false);
  const ContactInference between = puppet.infer(longer, {}, nullptr, false);
  BOOST_TEST(
      (alone.schedule.active.array() == between.schedule.active.middleCols(still, frames).array())
          .all());
  const MatrixXd ground = between.ground.middleCols(still, frames);
  // A foot that is held in the air has none.
  BOOST_TEST((ground.array().isNaN() == alone.ground.array().isNaN()).all());
  const MatrixXd off = ground.array().isNaN().select(0., ground - alone.ground);
  BOOST_TEST(off.cwiseAbs().maxCoeff() < 1e-4);
  BOOST_TEST(alone.ground.leftCols(100).allFinite());
  BOOST_TEST(between.schedule.active.leftCols(still - 30).all());
  BOOST_TEST(between.schedule.active.rightCols(still - 30).all());
}

BOOST_AUTO_TEST_CASE(a_single_frame_is_enough_to_stand_in) {
  const Puppet puppet;
  const ContactInference found = puppet.infer(puppet.step(0., 1));
  BOOST_TEST(found.schedule.active.rows() == 8);
  BOOST_TEST(found.schedule.active.all());
  BOOST_TEST(found.schedule.confidence.minCoeff() > 0.9);
}

BOOST_AUTO_TEST_CASE(recorded_contacts_are_kept) {
  const Puppet puppet;
  ContactSchedule recorded{{"right", "left"}, ContactSchedule::Matrix::Constant(2, 301, true)};
  recorded.active.row(0).head(50).setConstant(false);
  for (const double height : {0., 0.1}) {
    const ContactInference found = puppet.infer(puppet.step(height), {}, &recorded);
    const ContactSchedule feet = puppet.gather(found);
    BOOST_TEST((feet.active.row(0).array() == recorded.active.row(1).array()).all());
    BOOST_TEST((feet.active.row(1).array() == recorded.active.row(0).array()).all());
  }
  // A foot that is held up stands, if the record says so, and the ground is up there.
  Motion on_box = puppet.step(0.);
  on_box.q.row(12).array() += 0.1;
  for (const bool is_told : {true, false}) {
    const ContactInference box = puppet.infer(on_box, {}, is_told ? &recorded : nullptr);
    BOOST_TEST(box.stances.size() == 8u);
    for (const Stance& stance : box.stances)
      BOOST_TEST(stance.on_ground == (is_told || stance.height < 0.05));
  }
  // Who is not named is never active.
  const ContactSchedule left{{"left"}, ContactSchedule::Matrix::Constant(1, 301, true)};
  BOOST_TEST(!puppet.gather(puppet.infer(puppet.step(0.), {}, &left)).active.row(1).any());
}

BOOST_AUTO_TEST_CASE(a_plane_that_is_given_is_the_ground) {
  const Puppet puppet;
  DetectionSettings settings;
  settings.ground_height = 0.;
  const ContactInference found = puppet.infer(puppet.step(0.), settings);
  BOOST_TEST(found.schedule.active.all());
  settings.ground_height = -0.2;  // far below both feet
  const ContactInference above = puppet.infer(puppet.step(0.), settings);
  BOOST_TEST((above.ground.array() == -0.2).all());
  BOOST_TEST(!above.schedule.active.any());
  settings.ground_velocity << 0.5, 0., 0.;
  BOOST_TEST(puppet.infer(puppet.step(0.), settings).ground_velocity == Vector3d(0.5, 0., 0.));
}

BOOST_AUTO_TEST_CASE(what_does_not_fit_is_refused) {
  const Puppet puppet;
  const Motion motion = puppet.step(0.1, 30);
  const auto motions = computeContactMotions(puppet.split->robot, motion);
  ContactSchedule none;
  none.active.resize(0, 30);
  const MotionAnalysis dynamics = analyzeMotion(puppet.split->robot, motion, none);
  const auto refused = [&](auto change, std::initializer_list<std::string> words) {
    auto own_motions = motions;
    auto own_dynamics = dynamics;
    DetectionSettings settings;
    ContactSchedule recorded{{"left"}, ContactSchedule::Matrix::Constant(1, 30, true)};
    change(own_motions, own_dynamics, settings, recorded);
    BOOST_TEST(throws<std::invalid_argument>(
        [&] { inferContacts(*puppet.split, own_motions, own_dynamics, true, settings, &recorded); },
        words));
  };
  refused([](auto& m, auto&, auto&, auto&) { m.pop_back(); }, {"motions", "8", "parts", "7"});
  refused([](auto& m, auto&, auto&, auto&) { m[3].position.conservativeResize(3, 29); },
          {"motions", "30", "29"});
  refused([](auto&, auto& d, auto&, auto&) { d.com.conservativeResize(3, 29); },
          {"dynamics", "30", "29"});
  refused([](auto&, auto&, auto& s, auto&) { s.rate = -1.; }, {"DetectionSettings.rate", "-1"});
  refused([](auto&, auto&, auto&, auto& r) { r.active.resize(1, 29); }, {"active", "30", "29"});
}

BOOST_AUTO_TEST_CASE(more_parts_than_bits_are_refused) {
  std::vector<SE3> soles(9, SE3::Identity());
  DynaCoM robot(singleBody(10., soles));
  for (int k = 0; k < 9; ++k)
    robot.addContact(makeSole("sole" + std::to_string(k)), std::to_string(k));
  const PartRobot split = splitContacts(robot);
  Motion motion{VectorXd::Zero(1), restState(robot.getModel()).q, VectorXd::Zero(6),
                VectorXd::Zero(6)};
  ContactSchedule none;
  none.active.resize(0, 1);
  const auto motions = computeContactMotions(split.robot, motion);
  const MotionAnalysis dynamics = analyzeMotion(split.robot, motion, none);
  BOOST_TEST(throws<std::invalid_argument>([&] { inferContacts(split, motions, dynamics, true); },
                                           {"32", "36"}));
}

namespace {

ContactInference infer(const Walker& walker, const std::vector<Walker::Step>& steps) {
  const Motion motion = deriveMotion(walker.model, walker.walk(steps), 0.).motion;
  const PartRobot split = splitContacts(*walker.robot);
  ContactSchedule none;
  none.active.resize(0, motion.frames());
  return inferContacts(split, computeContactMotions(split.robot, motion),
                       analyzeMotion(split.robot, motion, none), true);
}

// Stances of parts that carry at some time.
std::vector<Stance> used(const ContactInference& found) {
  std::vector<Stance> stances;
  for (const Stance& stance : found.stances)
    if (stance.on_ground && found.schedule.active.row(Index(stance.part))
                                .segment(stance.first, stance.behind - stance.first)
                                .any())
      stances.push_back(stance);
  return stances;
}

bool isLevel(const ContactInference& found) {
  return found.slope.isZero(0.) &&
         std::all_of(found.stances.begin(), found.stances.end(),
                     [](const Stance& stance) { return stance.slope.isZero(0.); });
}

}  // namespace

BOOST_AUTO_TEST_CASE(stances_on_a_ramp_have_its_slope_and_those_before_and_behind_it_none) {
  const Walker walker;
  for (const double degrees : {5., 12.}) {
    const Ground ground = ramp(degrees, 0.65, 1.6);
    const auto steps = Walker::walkAhead(ground, 11);
    const ContactInference found = infer(walker, steps);
    BOOST_TEST(found.slope.isZero(0.));
    const std::vector<Stance> stances = used(found);
    BOOST_TEST(stances.size() == 4 * steps.size());
    Index part = -1, end = 0;
    for (const Stance& stance : found.stances) {
      // Each frame belongs to one stance of a part.
      BOOST_TEST(stance.begin == (Index(stance.part) == part ? end : 0));
      BOOST_TEST(stance.begin <= stance.first);
      BOOST_TEST(stance.behind <= stance.end);
      part = Index(stance.part), end = stance.end;
    }
    BOOST_TEST(end == found.schedule.active.cols());
    // By the order of a foot's stances, which is that of its steps.
    std::size_t number[8] = {};
    for (const Stance& stance : stances) {
      const std::size_t step = 2 * number[stance.part]++ + stance.part / 4;
      BOOST_TEST(steps[step].foot == int(stance.part / 4));
      const Vector3d& place = steps[step].place.translation();
      BOOST_TEST(close(stance.slope, gradientOf(ground, place.x(), place.y()), 1e-3));
    }
  }
}

BOOST_AUTO_TEST_CASE(a_plane_is_the_slope_of_all_and_level_soles_are_on_none) {
  const Walker walker;
  const Ground plane = [](double x, double y) { return 0.1 * x + 0.05 * y; };
  const ContactInference found = infer(walker, Walker::walkAhead(plane, 7));
  BOOST_TEST(close(found.slope, Vector2d(0.1, 0.05), 1e-3));
  for (const Stance& stance : used(found)) BOOST_TEST(stance.slope == found.slope);

  const Ground stairs = [](double x, double) { return 0.12 * std::floor(x / 0.25 + 0.5); };
  BOOST_TEST(isLevel(infer(walker, Walker::walkAhead(stairs, 7))));
  BOOST_TEST(isLevel(infer(walker, Walker::walkAhead([](double, double) { return 0.; }, 7))));
}

BOOST_AUTO_TEST_CASE(who_never_moves_or_stands_on_its_toes_shows_no_slope) {
  const Walker walker;
  const Ground slope = [](double x, double) { return 0.2 * x; };
  // Both feet stay; then, one of them is put down again where it was.
  std::vector<Walker::Step> steps = Walker::walkAhead(slope, 2);
  BOOST_TEST(isLevel(infer(walker, steps)));
  steps.push_back(steps[0]);
  BOOST_TEST(isLevel(infer(walker, steps)));
  // On toes where it is level: heels are up at each step.
  const SE3 tilt(
      pinocchio::SE3::Quaternion(Eigen::AngleAxisd(0.2, Vector3d::UnitY())).toRotationMatrix(),
      Vector3d(0., 0., 0.1 * std::sin(0.2)));
  steps = Walker::walkAhead([](double, double) { return 0.; }, 7);
  for (Walker::Step& step : steps) step.place = step.place * tilt;
  BOOST_TEST(isLevel(infer(walker, steps)));
}
