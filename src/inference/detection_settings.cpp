// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/detection_settings.hpp"

#include <cmath>
#include <ostream>
#include <string>

#include "../check.hpp"
#include "../settings_fields.hpp"

namespace dynacom {

namespace {

// What must not be less than the one before it.
constexpr std::pair<double DetectionSettings::*, double DetectionSettings::*> kBounds[] = {
    {&DetectionSettings::rest_speed_least, &DetectionSettings::rest_speed_greatest},
    {&DetectionSettings::exact_rest_speed_least, &DetectionSettings::exact_rest_speed_greatest},
    {&DetectionSettings::height_scale_least, &DetectionSettings::height_scale_greatest},
    {&DetectionSettings::speed_scale_least, &DetectionSettings::speed_scale_greatest},
    {&DetectionSettings::force_scale_least, &DetectionSettings::force_scale_greatest},
};

const char* nameOf(double DetectionSettings::*field) {
  for (const DetectionSettings::Constant& known : DetectionSettings::constants())
    if (known.second == field) return known.first;
  return "";
}

}  // namespace

const std::vector<DetectionSettings::Constant>& DetectionSettings::constants() {
  static const std::vector<Constant> all = {
      {"rest_speed_part", &DetectionSettings::rest_speed_part},
      {"rest_speed_least", &DetectionSettings::rest_speed_least},
      {"rest_speed_greatest", &DetectionSettings::rest_speed_greatest},
      {"exact_rest_speed_least", &DetectionSettings::exact_rest_speed_least},
      {"exact_rest_speed_greatest", &DetectionSettings::exact_rest_speed_greatest},
      {"moving_speed", &DetectionSettings::moving_speed},
      {"horizontal_part", &DetectionSettings::horizontal_part},
      {"rest_duration", &DetectionSettings::rest_duration},
      {"same_rest_speed", &DetectionSettings::same_rest_speed},
      {"same_rest", &DetectionSettings::same_rest},
      {"near_movement", &DetectionSettings::near_movement},
      {"stir_speed", &DetectionSettings::stir_speed},
      {"landing_height", &DetectionSettings::landing_height},
      {"same_ground", &DetectionSettings::same_ground},
      {"exact_same_ground", &DetectionSettings::exact_same_ground},
      {"body_reach", &DetectionSettings::body_reach},
      {"body_ground", &DetectionSettings::body_ground},
      {"height_scale_least", &DetectionSettings::height_scale_least},
      {"height_scale_greatest", &DetectionSettings::height_scale_greatest},
      {"speed_scale_part", &DetectionSettings::speed_scale_part},
      {"speed_scale_least", &DetectionSettings::speed_scale_least},
      {"speed_scale_greatest", &DetectionSettings::speed_scale_greatest},
      {"force_scale_part", &DetectionSettings::force_scale_part},
      {"force_scale_least", &DetectionSettings::force_scale_least},
      {"force_scale_greatest", &DetectionSettings::force_scale_greatest},
      {"lever", &DetectionSettings::lever},
      {"contact_gain", &DetectionSettings::contact_gain},
      {"fine_excess", &DetectionSettings::fine_excess},
      {"coarse_factor", &DetectionSettings::coarse_factor},
      {"coarse_height", &DetectionSettings::coarse_height},
      {"coarse_speed", &DetectionSettings::coarse_speed},
      {"coarse_greatest", &DetectionSettings::coarse_greatest},
      {"pressed_depth", &DetectionSettings::pressed_depth},
      {"missing_greatest", &DetectionSettings::missing_greatest},
      {"missing_factor", &DetectionSettings::missing_factor},
      {"missing_force", &DetectionSettings::missing_force},
      {"missing_torque", &DetectionSettings::missing_torque},
      {"dynamics_weight", &DetectionSettings::dynamics_weight},
      {"further_points", &DetectionSettings::further_points},
      {"rate", &DetectionSettings::rate},
      {"change", &DetectionSettings::change},
      {"ramp", &DetectionSettings::ramp},
      {"ramp_least", &DetectionSettings::ramp_least},
  };
  return all;
}

void DetectionSettings::validate() const {
  internal::requirePositive("DetectionSettings", *this, constants());
  for (const auto& [least, greatest] : kBounds)
    internal::requireField(this->*greatest >= this->*least,
                           ("DetectionSettings." + std::string(nameOf(greatest))).c_str(),
                           internal::concat(">= ", nameOf(least)).c_str(), this->*greatest);
  for (const auto field : {&DetectionSettings::further_points, &DetectionSettings::ramp_least})
    internal::requireField(this->*field <= 1.,
                           ("DetectionSettings." + std::string(nameOf(field))).c_str(), "<= 1",
                           this->*field);
  internal::requireField(!std::isinf(ground_height), "DetectionSettings.ground_height",
                         "finite or NaN", ground_height);
  internal::requireField((ground_velocity.allFinite() && ground_velocity.z() == 0.) ||
                             ground_velocity.array().isNaN().all(),
                         "DetectionSettings.ground_velocity", "finite and level, or NaN",
                         ground_velocity.transpose());
}

std::string DetectionSettings::to_string() const { return internal::concat(*this); }

bool DetectionSettings::operator==(const DetectionSettings& other) const {
  if (!internal::areEqual(*this, other, constants())) return false;
  const auto same = [](double one, double two) {
    return one == two || (std::isnan(one) && std::isnan(two));
  };
  for (int i = 0; i < 3; ++i)
    if (!same(ground_velocity[i], other.ground_velocity[i])) return false;
  return same(ground_height, other.ground_height);
}

std::ostream& operator<<(std::ostream& out, const DetectionSettings& settings) {
  out << "DetectionSettings(";
  internal::write(out, settings, DetectionSettings::constants());
  return out << ", ground_height=" << settings.ground_height << ", ground_velocity=("
             << settings.ground_velocity.x() << ", " << settings.ground_velocity.y() << ", "
             << settings.ground_velocity.z() << "))";
}

}  // namespace dynacom
