// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "../contact_split.hpp"

namespace dynacom::internal {

/// What pushes in each frame: a bit for each part.
/// @throws std::invalid_argument if the schedule is not valid for so many frames, or names a part
///         that there is not, or there are more than 32 parts
std::vector<std::uint32_t> listSets(const std::vector<PartRobot::Part>& parts,
                                    const ContactSchedule& schedule, Eigen::Index frames);

/// The friction of each part.
/// @throws std::invalid_argument if one is no ContactPoint
std::vector<double> listFriction(const ContactSplit& parts);

}  // namespace dynacom::internal
