// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <urdf_model/types.h>

#include <pinocchio/multibody.hpp>
#include <string>

namespace dynacom::internal {

/// The model of a robot with a free-flyer as root joint, whose coordinates are the pose of its
/// child link in the world. A floating joint by which a massless root link holds all others is that
/// free-flyer, and its origin is left out; otherwise one is added above the root link.
/// @param urdf  path of a URDF file, or the XML itself
/// @throws std::invalid_argument if it cannot be read
pinocchio::Model readUrdf(const std::string& urdf);

/// The links and joints of a URDF.
/// @throws std::invalid_argument if it cannot be read
urdf::ModelInterfaceSharedPtr readUrdfTree(const std::string& urdf);

/// Whether this is XML itself, and not a file's path.
bool isXml(const std::string& urdf);

}  // namespace dynacom::internal
