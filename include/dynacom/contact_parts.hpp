// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "dynacom/collision_points.hpp"
#include "dynacom/motion_analysis.hpp"
#include "dynacom/surface_options.hpp"

namespace dynacom {

/// A robot whose contacts are points: what of a sole carries load is what touches.
struct DYNACOM_EXPORT PartRobot {
  DynaCoM robot;  ///< knows each part as a ContactPoint, in the order of `parts`
  struct Part {
    std::string name;  ///< of the contact, and for one of several parts `<contact>.<part>`
    /// Whose part it is: an index of getKnownContacts() of the whole robot, or, behind these, of
    /// `bodies`.
    std::size_t contact;
    int limb;  ///< parts on one joint, or on a joint that moves another's, share a number
  };
  std::vector<Part> parts;
  /// Links that may touch something besides the contacts; their parts come last, and are called
  /// `body.<link>.<number>`.
  std::vector<std::string> bodies;

  /// How many contacts the whole robot has.
  std::size_t countContacts() const;
};

/// Takes the contacts of a robot apart. A ContactPoint is a part of its own, where it is. A
/// Contact6D is one part for each of its corners, `front_left`, `front_right`, `rear_left` and
/// `rear_right` (x is forward, y is left): points whose normal is vertical, with the surface's μ.
/// The weights of their forces are those of the surface times √4, so that an evenly loaded surface
/// costs as much; γ is left to the corners' friction, which is what coupled yaw is, too.
///
/// Bodies are points, too, each of which pushes along the vertical, with the least μ of the
/// contacts and the weights of the first part of these; where the robot has no contacts, with μ =
/// 0.7 and weights of 1. Each body is a limb of its own.
/// @param friction  of bodies, and of contacts that are outer pyramids; others keep their own
/// @throws std::invalid_argument if a contact is of another kind, or has bounds of its normal force
///         or a reference, or a body's joint is none of the model's; NotReadyError before the
///         robot's initialize()
DYNACOM_EXPORT PartRobot splitContacts(const DynaCoM& robot,
                                       const std::vector<BodyPoints>& bodies = {},
                                       FrictionModel friction = FrictionModel::Cone);

/// What the contacts of a robot do, from what their parts do: a contact is active if any of its
/// parts is, and its wrench is the sum of theirs, in its own axes about its own origin. The forces
/// of bodies are summed up, too. The yaw usage of soles of coupled yaw is NaN: what their corners
/// use has it. All else is as in the analysis of the parts, whose contacts become
/// MotionAnalysis::parts.
/// @param robot     whose contacts were split
/// @param contacts  of computeContactMotions() for that robot
/// @param motions   the same for the parts
/// @param analysis  of analyzeMotion() for the parts
/// @throws std::invalid_argument if sizes differ
DYNACOM_EXPORT MotionAnalysis gatherParts(const DynaCoM& robot, const PartRobot& parts,
                                          const std::vector<ContactMotion>& contacts,
                                          const std::vector<ContactMotion>& motions,
                                          MotionAnalysis analysis);

/// The same of a schedule, without bodies: a contact is as probable as its most probable part.
/// @throws std::invalid_argument if sizes differ
DYNACOM_EXPORT ContactSchedule gatherParts(const DynaCoM& robot, const PartRobot& parts,
                                           const ContactSchedule& schedule);

/// The same of a schedule for the bodies alone, by the names of their links.
/// @throws std::invalid_argument if sizes differ
DYNACOM_EXPORT ContactSchedule gatherBodies(const PartRobot& parts,
                                            const ContactSchedule& schedule);

}  // namespace dynacom
