// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "../contact_split.hpp"
#include "dynacom/contact_set.hpp"

namespace dynacom::internal {

/// What pushes in each frame: a bit for each part.
/// @throws std::invalid_argument if the schedule is not valid for so many frames, or names a part
///         that there is not, or there are more than 32 parts
std::vector<std::uint32_t> listSets(const std::vector<PartRobot::Part>& parts,
                                    const ContactSchedule& schedule, Eigen::Index frames);

/// F of each part.
/// @throws std::invalid_argument if one is no ContactPoint
std::vector<Section> listFriction(const ContactSplit& parts);

/// Sections as many times larger as the factor says, which is ≥ 0.
std::vector<Section> scale(const std::vector<Section>& friction, double factor);

}  // namespace dynacom::internal
