// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <pinocchio/multibody.hpp>
#include <vector>

#include "dynacom/collision_points.hpp"
#include "dynacom/motion.hpp"

namespace dynacom::internal {

/// Those points of links that may have touched the ground: in frames in which contacts cannot give
/// what is needed, they are no higher above one of the ground's levels than `reach`. If they are
/// too many, those stay that are lowest for longest, of each link as many as of others.
/// Frames are looked at that are some hundredths of a second apart.
/// @param data     the model's
/// @param missing  the frames in which something is missing
/// @param levels   heights of the ground [m]; the lowest point of all is one, too
/// @param most     how many points may stay
std::vector<BodyPoints> screenBodies(const pinocchio::Model& model, pinocchio::Data& data,
                                     const std::vector<BodyPoints>& bodies, const Motion& motion,
                                     const Eigen::Array<bool, Eigen::Dynamic, 1>& missing,
                                     std::vector<double> levels, double reach, std::size_t most);

}  // namespace dynacom::internal
