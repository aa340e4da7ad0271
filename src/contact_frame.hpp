// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <pinocchio/multibody.hpp>
#include <string>

#include "check.hpp"
#include "dynacom/contact_base.hpp"

namespace dynacom::internal {

/// The index of a contact's frame. Frames of different types may share a name: that says too
/// little.
/// @throws std::invalid_argument unless the model has one frame of that name
inline pinocchio::FrameIndex findFrame(const pinocchio::Model& model, const std::string& frame_name,
                                       const std::string& contact_name) {
  const auto has_name = [&](const pinocchio::Frame& frame) { return frame.name == frame_name; };
  const auto count = std::count_if(model.frames.begin(), model.frames.end(), has_name);
  if (count != 1)
    throwInvalid("contact '", contact_name, "': the model must have one frame '", frame_name,
                 "', got ", count);
  const auto frame = std::find_if(model.frames.begin(), model.frames.end(), has_name);
  return static_cast<pinocchio::FrameIndex>(frame - model.frames.begin());
}

/// The frame of a contact that a robot knows. One whose settings were changed since has lost its
/// index.
/// @throws as findFrame()
inline const pinocchio::Frame& getFrame(const pinocchio::Model& model, const ContactBase& contact,
                                        const std::string& contact_name) {
  const pinocchio::FrameIndex known = contact.getFrameID();
  const bool is_known = known < model.frames.size();
  return model.frames[is_known ? known : findFrame(model, contact.getFrameName(), contact_name)];
}

}  // namespace dynacom::internal
