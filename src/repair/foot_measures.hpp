// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include "dynacom/motion_repairer.hpp"

namespace dynacom::internal {

/// How far a part that carries in a stance is from where it is on average there, at most [m]. The
/// ground of a treadmill goes with it.
/// @param found     says where parts are
/// @param carrying  says which carry when; its parts are the first of `found`'s, or the other way
std::vector<double> measureDrifts(const MotionExamination& found, const MotionExamination& carrying,
                                  const std::vector<RepairedStance>& stances);

/// How the contacts of the robot stand, without other links.
/// @param found, carrying, stances  as there
RepairedFeet measureFeet(const MotionExamination& found, const MotionExamination& carrying,
                         const std::vector<RepairedStance>& stances);

}  // namespace dynacom::internal
