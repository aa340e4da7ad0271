// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE detection_settings
#include <limits>
#include <set>
#include <sstream>
#include <string>

#include "dynacom/detection_settings.hpp"
#include "test_tools.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

const double kNaN = std::numeric_limits<double>::quiet_NaN();
const double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

BOOST_AUTO_TEST_CASE(the_list_of_constants_has_each_field_once) {
  std::set<std::string> names;
  DetectionSettings settings;
  double number = 0.;
  for (const auto& [name, field] : DetectionSettings::constants()) {
    names.insert(name);
    settings.*field = ++number;
  }
  BOOST_TEST(names.size() == DetectionSettings::constants().size());
  // Each kept its own number, so that no two are one; and there are no doubles but these, the
  // height and the velocity of the ground.
  number = 0.;
  for (const DetectionSettings::Constant& constant : DetectionSettings::constants()) {
    const double value = settings.*constant.second;
    BOOST_TEST(value == ++number);
  }
  BOOST_TEST(sizeof(DetectionSettings) == (names.size() + 4) * sizeof(double));
}

BOOST_AUTO_TEST_CASE(defaults_are_valid_and_the_ground_is_to_be_found) {
  const DetectionSettings settings;
  settings.validate();
  BOOST_TEST(allNaN(settings.ground_velocity));
  BOOST_TEST(std::isnan(settings.ground_height));
}

BOOST_AUTO_TEST_CASE(what_is_out_of_range_is_refused) {
  const auto refused = [](auto change, std::initializer_list<std::string> words) {
    DetectionSettings settings;
    change(settings);
    BOOST_TEST(throws<std::invalid_argument>([&] { settings.validate(); }, words));
  };
  for (const auto& [name, field] : DetectionSettings::constants()) {
    const std::string full = "DetectionSettings." + std::string(name);
    for (const double value : {0., -0.5, kNaN, kInfinity}) {
      const auto change = [&, field = field](auto& s) { s.*field = value; };
      refused(change, {full, "> 0"});
    }
  }
  // Bounds are in order.
  for (const std::string name :
       {"rest_speed", "exact_rest_speed", "height_scale", "speed_scale", "force_scale"}) {
    const auto raise = [&](auto& s) {
      for (const auto& [other, field] : DetectionSettings::constants())
        if (other == name + "_least") s.*field = 77.;
    };
    refused(raise, {"DetectionSettings." + name + "_greatest", ">=", name + "_least"});
  }
  for (const auto& [name, field] : {std::pair("further_points", &DetectionSettings::further_points),
                                    std::pair("ramp_least", &DetectionSettings::ramp_least)})
    refused([field = field](auto& s) { s.*field = 1.5; }, {name, "<= 1", "1.5"});
  refused([](auto& s) { s.ground_height = kInfinity; }, {"DetectionSettings.ground_height", "inf"});
  refused([](auto& s) { s.ground_velocity << 1., kNaN, 0.; },
          {"DetectionSettings.ground_velocity", "finite", "level"});
  refused([](auto& s) { s.ground_velocity << 1., 0., 0.1; },
          {"DetectionSettings.ground_velocity", "level", "0.1"});
  DetectionSettings settings;
  settings.ground_velocity << -1., 0.5, 0.;
  settings.ground_height = -3.;
  settings.validate();
}

BOOST_AUTO_TEST_CASE(settings_are_the_same_if_all_fields_are) {
  const DetectionSettings defaults;
  BOOST_TEST((defaults == DetectionSettings()));
  const auto differs = [&](auto change) {
    DetectionSettings one, other;
    change(one), change(other);
    BOOST_TEST((one != defaults));
    BOOST_TEST((one == other));
  };
  for (const DetectionSettings::Constant& constant : DetectionSettings::constants())
    differs([&](auto& s) { s.*constant.second = 0.625; });
  differs([](auto& s) { s.ground_height = 0.; });
  differs([](auto& s) { s.ground_velocity.setZero(); });
  DetectionSettings one, other;
  one.ground_velocity << 1., 0., 0.;
  other.ground_velocity << 0., 1., 0.;
  BOOST_TEST((one != other));
}

BOOST_AUTO_TEST_CASE(settings_are_written_with_all_their_fields) {
  DetectionSettings settings;
  settings.ground_velocity << -1.25, 0., 0.;
  for (const auto& [name, field] : DetectionSettings::constants()) settings.*field = 0.625;
  const std::string text = settings.to_string();
  std::ostringstream stream;
  stream << settings;
  BOOST_TEST(text == stream.str());
  for (const auto& [name, field] : DetectionSettings::constants())
    BOOST_TEST(mentions(text, std::string(name) + "=0.625"));
  BOOST_TEST(mentions(text, "ground_height=nan"));
  BOOST_TEST(mentions(text, "ground_velocity=(-1.25"));
}
