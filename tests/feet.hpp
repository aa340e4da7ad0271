// SPDX-License-Identifier: BSD-2-Clause
// Feet, and contacts of their size.
#pragma once

#include <memory>
#include <pinocchio/multibody.hpp>
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

/// Gives a body, which is joint 1, two massless feet that go wherever they are put: the frames
/// `left_foot` and `right_foot`.
inline void addFeet(pinocchio::Model& model) {
  for (const char* name : {"left", "right"}) {
    const auto joint = model.addJoint(1, pinocchio::JointModelTranslation(),
                                      pinocchio::SE3::Identity(), std::string(name) + "_joint");
    model.addFrame(pinocchio::Frame(std::string(name) + "_foot", joint, pinocchio::SE3::Identity(),
                                    pinocchio::OP_FRAME));
  }
}

inline std::shared_ptr<dynacom::ContactPoint> makePoint(const std::string& frame, double mu = 0.7) {
  dynacom::ContactPointSettings settings;
  settings.mu = mu;
  settings.frame_name = frame;
  return std::make_shared<dynacom::ContactPoint>(settings);
}

}  // namespace dynacom_tests
