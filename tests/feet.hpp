// SPDX-License-Identifier: BSD-2-Clause
// Contacts of the size of a robot's feet.
#pragma once

#include <memory>
#include <string>

#include "dynacom/contact6d.hpp"
#include "dynacom/contact_point.hpp"

namespace dynacom_tests {

inline std::shared_ptr<dynacom::Contact6D> makeSole(const std::string& frame, double mu = 0.7) {
  dynacom::Contact6DSettings settings;
  settings.mu = mu;
  settings.gu = 0.1;
  settings.half_length = 0.1;
  settings.half_width = 0.06;
  settings.frame_name = frame;
  return std::make_shared<dynacom::Contact6D>(settings);
}

inline std::shared_ptr<dynacom::ContactPoint> makePoint(const std::string& frame, double mu = 0.7) {
  dynacom::ContactPointSettings settings;
  settings.mu = mu;
  settings.frame_name = frame;
  return std::make_shared<dynacom::ContactPoint>(settings);
}

}  // namespace dynacom_tests
