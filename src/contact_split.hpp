// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

#include "carrier.hpp"
#include "dynacom/contact_parts.hpp"

namespace dynacom::internal {

/// Contacts that were taken apart, see splitContacts(): all of a PartRobot but a robot that knows
/// them, which takes long to make.
struct ContactSplit {
  std::vector<PartRobot::Part> parts;
  std::vector<std::string> bodies;
  Carrier carrier;  // its contacts are the parts, in the same order

  std::size_t countContacts() const;
  /// The names of the contacts, which those of their parts begin with.
  std::vector<std::string> nameContacts() const;
};

/// @throws as splitContacts()
ContactSplit splitCarrier(const DynaCoM& robot, const std::vector<BodyPoints>& bodies = {},
                          FrictionModel friction = FrictionModel::Cone);

/// What a PartRobot has of one.
ContactSplit describeSplit(const PartRobot& parts);

/// The friction of links: the least of some points, which are ContactPoints; 0.7 if there are none.
double findBodyFriction(const std::vector<FixedContact>& points);

/// @param contacts  the names of the contacts that were split
ContactSchedule gatherParts(const std::vector<std::string>& contacts, const ContactSplit& split,
                            const ContactSchedule& schedule);
ContactSchedule gatherBodies(const ContactSplit& split, const ContactSchedule& schedule);
/// @param robot  whose contacts were split
MotionAnalysis gatherParts(const DynaCoM& robot, const ContactSplit& split,
                           const std::vector<ContactMotion>& contacts,
                           const std::vector<ContactMotion>& motions, MotionAnalysis analysis);

}  // namespace dynacom::internal
