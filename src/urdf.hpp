// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <pinocchio/multibody.hpp>
#include <string>

namespace dynacom::internal {

/// The model of a robot with a free-flyer as root joint.
/// @param urdf  path of a URDF file, or the XML itself
/// @throws std::invalid_argument if it cannot be read
pinocchio::Model readUrdf(const std::string& urdf);

}  // namespace dynacom::internal
