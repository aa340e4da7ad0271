// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE terrain
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "dynacom/terrain.hpp"
#include "test_tools.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

const double kNaN = std::numeric_limits<double>::quiet_NaN();

/// A foot of two parts, a hand that is a point, and a knee that is no contact, all of which may be
/// anywhere: stances and schedules are made up. There are ten frames a second.
struct Case {
  explicit Case(Index frames = 40)
      : time(VectorXd::LinSpaced(frames, 0., 0.1 * double(frames - 1))),
        ground(MatrixXd::Zero(2, frames)) {
    inference.schedule.active.setConstant(4, frames, false);
    schedule = {{"foot", "hand"}, ContactSchedule::Matrix::Constant(2, frames, false)};
  }

  /// A part is at rest, and active there if it carries.
  void rest(std::size_t part, Index first, Index behind, double height, bool on_ground,
            bool carries) {
    inference.stances.push_back({part, first, behind, height, on_ground, first, behind});
    if (carries) activate(part, first, behind);
  }
  void activate(std::size_t part, Index first, Index behind) {
    inference.schedule.active.row(Index(part)).segment(first, behind - first).setConstant(true);
    const std::size_t owner = parts[part].contact;
    if (owner < 2)
      schedule.active.row(Index(owner)).segment(first, behind - first).setConstant(true);
  }
  Terrain find(double ground_height = kNaN) const {
    return findTerrain(parts, inference, schedule, ground, time, ground_height);
  }

  std::vector<PartRobot::Part> parts = {
      {"foot.front", 0, 0}, {"foot.back", 0, 0}, {"hand", 1, 1}, {"body.knee.0", 2, 2}};
  VectorXd time;
  ContactInference inference;
  ContactSchedule schedule;
  MatrixXd ground;
};

constexpr std::size_t kFront = 0, kBack = 1, kHand = 2, kKnee = 3;

}  // namespace

BOOST_AUTO_TEST_CASE(heights_of_the_ground_are_medians_while_active) {
  Random random(1);
  for (int trial = 0; trial < 200; ++trial) {
    const Index frames = random.integer(1, 30);
    Case some(frames);
    for (Index k = 0; k < 2; ++k)
      for (Index frame = 0; frame < frames; ++frame) {
        some.schedule.active(k, frame) = random.coin();
        some.ground(k, frame) = random.integer(0, 4) == 0 ? kNaN : random.uniform(-1., 1.);
      }
    const Terrain terrain = some.find();
    BOOST_TEST_REQUIRE(terrain.contacts.size() == 2u);
    BOOST_TEST(terrain.contacts[0].name == "foot");
    BOOST_TEST(terrain.contacts[1].name == "hand");
    double lowest = kNaN;
    for (Index k = 0; k < 2; ++k) {
      std::vector<double> heights;
      for (Index frame = 0; frame < frames; ++frame)
        if (some.schedule.active(k, frame) && !std::isnan(some.ground(k, frame)))
          heights.push_back(some.ground(k, frame));
      std::sort(heights.begin(), heights.end());
      const double found = terrain.contacts[std::size_t(k)].height;
      if (heights.empty()) {
        BOOST_TEST(std::isnan(found));
        continue;
      }
      const std::size_t size = heights.size();
      BOOST_TEST(close(found, 0.5 * (heights[(size - 1) / 2] + heights[size / 2])));
      lowest = std::fmin(lowest, found);
    }
    // Nothing is at rest: the grounds are all that is known.
    BOOST_TEST((std::isnan(lowest) ? std::isnan(terrain.lowest) : terrain.lowest == lowest));
    BOOST_TEST(terrain.level == 0.);
  }
}

BOOST_AUTO_TEST_CASE(slopes_are_those_of_stances_that_carry) {
  Case some(40);
  some.rest(kFront, 0, 10, 0., true, true);
  some.rest(kFront, 10, 20, 0., true, true);
  some.rest(kBack, 20, 30, 0., true, true);
  some.rest(kHand, 0, 10, 0., true, false);
  some.rest(kKnee, 0, 10, 0., true, true);
  BOOST_TEST(some.find().contacts[0].slopes.empty());
  some.inference.stances[1].slope << -std::tan(0.2), 0.;
  some.inference.stances[2].slope << 0., std::tan(0.1);
  for (const std::size_t k : {3, 4}) some.inference.stances[k].slope << 1., 0.;
  const Terrain terrain = some.find();
  BOOST_TEST_REQUIRE(terrain.contacts[0].slopes.size() == 2u);
  BOOST_TEST(close(terrain.contacts[0].slopes[0], 0.1));
  BOOST_TEST(close(terrain.contacts[0].slopes[1], 0.2));
  BOOST_TEST(terrain.contacts[1].slopes.empty());
  // The same slope again is none of its own.
  some.inference.stances[0].slope << std::tan(0.2005), 0.;
  BOOST_TEST(some.find().contacts[0].slopes.size() == 2u);
}

BOOST_AUTO_TEST_CASE(levels_are_those_of_stances_that_carry) {
  Case some;
  some.rest(kFront, 0, 4, 0.01, true, true);
  some.rest(kFront, 10, 14, 0.30, true, true);
  some.rest(kBack, 0, 4, 0.04, true, true);     // the first level again
  some.rest(kBack, 10, 14, 0.361, true, true);  // more than 5 cm above the second
  some.rest(kBack, 20, 24, 0.15, true, true);
  some.rest(kHand, 5, 6, 1.1, true, true);
  some.rest(kHand, 20, 30, 0.7, true, false);  // carries nothing
  some.rest(kKnee, 0, 9, -0.3, true, true);    // is no contact's
  const Terrain terrain = some.find();
  BOOST_TEST((terrain.contacts[0].levels == std::vector<double>{0.01, 0.15, 0.30, 0.361}));
  BOOST_TEST((terrain.contacts[1].levels == std::vector<double>{1.1}));
  BOOST_TEST(terrain.lowest == 0.01);
  BOOST_TEST(close(terrain.level, 0.5 * (0.15 + 0.30)));  // of 0.01 0.04 0.15 0.30 0.361 1.1
  BOOST_TEST(terrain.held.empty());
  BOOST_TEST(some.find(-0.2).level == -0.2);
  BOOST_TEST(some.find(-0.2).lowest == 0.01);
}

BOOST_AUTO_TEST_CASE(a_frame_of_load_makes_a_stance_of_a_rest) {
  Case some;
  some.rest(kHand, 20, 30, 0.7, true, false);
  BOOST_TEST(some.find().contacts[1].levels.empty());
  some.activate(kHand, 30, 40);  // behind it
  BOOST_TEST(some.find().contacts[1].levels.empty());
  some.activate(kHand, 29, 30);
  BOOST_TEST((some.find().contacts[1].levels == std::vector<double>{0.7}));
}

BOOST_AUTO_TEST_CASE(what_is_held_is_told_once_where_it_is_lowest) {
  Case some;
  some.rest(kFront, 0, 5, 0.02, true, true);
  some.rest(kHand, 2, 7, 0.4, false, false);  // lasts 0.4 s
  some.rest(kKnee, 0, 40, 0.3, false, false);
  BOOST_TEST(some.find().held.empty());
  some.rest(kHand, 10, 16, 0.9, false, false);  // 0.5 s
  some.rest(kHand, 20, 30, 0.52, false, false);
  some.rest(kHand, 31, 40, 0.6, false, false);
  Terrain terrain = some.find();
  BOOST_TEST_REQUIRE(terrain.held.size() == 1u);
  BOOST_TEST(terrain.held[0].name == "hand");
  BOOST_TEST(terrain.held[0].parts.empty());
  BOOST_TEST(terrain.held[0].first == 20);
  BOOST_TEST(terrain.held[0].behind == 30);
  BOOST_TEST(close(terrain.held[0].begin, 2.));
  BOOST_TEST(close(terrain.held[0].height, 0.5));  // above the foot's
  BOOST_TEST(close(some.find(0.12).held[0].height, 0.4));
}

BOOST_AUTO_TEST_CASE(a_foot_is_tilted_if_the_rest_of_it_carries) {
  Case some;
  some.activate(kFront, 0, 20);
  some.rest(kBack, 3, 20, 0.08, false, false);
  Terrain terrain = some.find();
  BOOST_TEST_REQUIRE(terrain.held.size() == 1u);
  BOOST_TEST((terrain.held[0].parts == std::vector<std::string>{"back"}));
  BOOST_TEST(terrain.held[0].height == 0.08);  // no stance carries: above 0
  // Not if it does so for a part of that time.
  some.schedule.active(0, 19) = false;
  BOOST_TEST(some.find().held[0].parts.empty());
  some.schedule.active(0, 19) = true;

  // Whatever of it is tilted is one, and what is in the air is another.
  some.activate(kBack, 20, 28);
  some.rest(kFront, 21, 28, 0.05, false, false);
  some.rest(kBack, 30, 40, 0.3, false, false);
  terrain = some.find();
  BOOST_TEST_REQUIRE(terrain.held.size() == 2u);
  BOOST_TEST((terrain.held[0].parts == std::vector<std::string>{"back", "front"}));
  BOOST_TEST(terrain.held[0].first == 21);
  BOOST_TEST(terrain.held[1].parts.empty());
  BOOST_TEST(terrain.held[1].first == 30);
}

BOOST_AUTO_TEST_CASE(time_and_height_may_begin_anywhere) {
  Case some;
  some.rest(kFront, 0, 8, 0., true, true);
  some.rest(kFront, 12, 20, 0.25, true, true);
  some.rest(kBack, 0, 8, 0.125, false, false);
  some.rest(kHand, 10, 30, 0.75, false, false);
  const Terrain terrain = some.find();
  Case moved = some;
  moved.time.array() += 512.;
  moved.ground.array() += 2.;
  for (Stance& stance : moved.inference.stances) stance.height += 2.;
  const Terrain other = moved.find();
  BOOST_TEST(other.lowest == terrain.lowest + 2.);
  BOOST_TEST(other.level == terrain.level + 2.);
  BOOST_TEST((other.contacts[0].levels == std::vector<double>{2., 2.25}));
  BOOST_TEST(other.contacts[0].height == terrain.contacts[0].height + 2.);
  BOOST_TEST_REQUIRE(other.held.size() == terrain.held.size());
  for (std::size_t k = 0; k < other.held.size(); ++k) {
    BOOST_TEST(other.held[k].name == terrain.held[k].name);
    BOOST_TEST(other.held[k].parts == terrain.held[k].parts);
    BOOST_TEST(other.held[k].height == terrain.held[k].height);
    BOOST_TEST(close(other.held[k].begin, terrain.held[k].begin + 512.));
  }
}

BOOST_AUTO_TEST_CASE(what_does_not_belong_together_is_refused) {
  const Case some;
  Case other = some;
  other.parts.pop_back();
  BOOST_TEST(throws<std::invalid_argument>([&] { other.find(); }, {"inference", "4", "3"}));
  other = some;
  other.schedule.active.setConstant(2, 41, true);
  BOOST_TEST(throws<std::invalid_argument>([&] { other.find(); }, {"schedule", "41", "40"}));
  other = some;
  other.ground.setZero(3, 40);
  BOOST_TEST(throws<std::invalid_argument>([&] { other.find(); }, {"ground", "3", "2"}));
  for (const Stance& wrong : {Stance{4, 0, 1, 0., true, 0, 1}, Stance{0, 0, 41, 0., true, 0, 41},
                              Stance{0, 5, 5, 0., true, 5, 5}, Stance{0, -1, 5, 0., true, -1, 5}}) {
    other = some;
    other.inference.stances.push_back(wrong);
    BOOST_TEST(throws<std::invalid_argument>([&] { other.find(); }, {"inference.stances", "40"}));
  }
}
