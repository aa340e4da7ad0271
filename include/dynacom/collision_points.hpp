// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <pinocchio/multibody/fwd.hpp>
#include <string>
#include <vector>

#include "dynacom/dyna_com.hpp"

namespace dynacom {

/// Where a link of a robot may touch something, besides the contacts that are described: balls, of
/// which some have the radius 0.
struct DYNACOM_EXPORT BodyPoints {
  std::string link;
  pinocchio::JointIndex joint;  ///< the one that moves the link
  Eigen::Matrix3Xd points;      ///< centres of the balls, in the joint's frame [m]
  Eigen::VectorXd radius;       ///< of each [m]
};

/// The points of a robot's links, and what of its geometry could not be read.
struct DYNACOM_EXPORT CollisionPoints {
  std::vector<BodyPoints> bodies;    ///< in the order of the joints, then of the links' names
  std::vector<std::string> missing;  ///< meshes that are not there or cannot be read, as named
};

/// Finds a few extreme points of each link's collision geometry: in whatever direction a link is
/// looked at, one of its points is within 0.01 m of the farthest, unless that takes more than 48.
/// Spheres are balls, and so are the ends of capsules, that is, of cylinders that have a sphere of
/// their radius at either end; boxes, cylinders and the convex hulls of meshes have their vertices.
///
/// Left out are what belongs to a described contact, that is, points which in the neutral posture
/// are within 0.12 m of its surface, on its joint or one that carries or is carried by it, and what
/// is fixed to the world.
/// @param robot    with its contacts
/// @param urdf     path of the file that its model was read from, or the XML itself
/// @param folders  where packages are looked for, besides the file's folder and those around it
/// @throws std::invalid_argument if the file cannot be read; meshes that cannot are listed as
///         missing. NotReadyError before the robot's initialize()
DYNACOM_EXPORT CollisionPoints findCollisionPoints(const DynaCoM& robot, const std::string& urdf,
                                                   const std::vector<std::string>& folders = {});

}  // namespace dynacom
