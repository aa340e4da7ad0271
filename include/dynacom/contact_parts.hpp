// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "dynacom/motion_analysis.hpp"

namespace dynacom {

/// A robot whose contacts are points: what of a sole carries load is what touches.
struct DYNACOM_EXPORT PartRobot {
  DynaCoM robot;  ///< knows each part as a ContactPoint, in the order of `parts`
  struct Part {
    std::string name;     ///< of the contact, and for one of several parts `<contact>.<part>`
    std::size_t contact;  ///< whose part it is: an index of getKnownContacts() of the whole robot
    int limb;  ///< parts on one joint, or on a joint that moves another's, share a number
  };
  std::vector<Part> parts;
};

/// Takes the contacts of a robot apart. A ContactPoint is a part of its own, as it is. A Contact6D
/// is one part for each of its corners, `front_left`, `front_right`, `rear_left` and `rear_right`
/// (x is forward, y is left): points whose normal is vertical, with the surface's μ. The weights of
/// their forces are those of the surface times √4, so that an evenly loaded surface costs as much;
/// γ is left to the corners' friction.
/// @throws std::invalid_argument if a contact is of another kind; NotReadyError before the robot's
///         initialize()
DYNACOM_EXPORT PartRobot splitContacts(const DynaCoM& robot);

/// What the contacts of a robot do, from what their parts do: a contact is active if any of its
/// parts is, and its wrench is the sum of theirs, in its own axes about its own origin. All else is
/// as in the analysis of the parts, whose contacts become MotionAnalysis::parts.
/// @param robot     whose contacts were split
/// @param contacts  of computeContactMotions() for that robot
/// @param motions   the same for the parts
/// @param analysis  of analyzeMotion() for the parts
/// @throws std::invalid_argument if sizes differ
DYNACOM_EXPORT MotionAnalysis gatherParts(const DynaCoM& robot, const PartRobot& parts,
                                          const std::vector<ContactMotion>& contacts,
                                          const std::vector<ContactMotion>& motions,
                                          MotionAnalysis analysis);

/// The same of a schedule: a contact is as probable as its most probable part.
/// @throws std::invalid_argument if sizes differ
DYNACOM_EXPORT ContactSchedule gatherParts(const DynaCoM& robot, const PartRobot& parts,
                                           const ContactSchedule& schedule);

}  // namespace dynacom
