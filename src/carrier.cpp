// SPDX-License-Identifier: BSD-2-Clause
#include "carrier.hpp"

#include "contact_frame.hpp"

namespace dynacom::internal {

Carrier describeCarrier(const DynaCoM& robot) {
  Carrier carrier = {{},
                     robot.getMass(),
                     robot.getSettings().gravity,
                     robot.getWrenchWeights(),
                     robot.getMinimalVerticalForce(),
                     robot.getWarmStart(),
                     robot.getMaximalIterations()};
  for (const std::string& name : robot.getKnownContacts()) {
    const std::shared_ptr<const ContactBase> contact = robot.getContact(name)->clone();
    const pinocchio::Frame& frame = getFrame(robot.getModel(), *contact, name);
    carrier.contacts.push_back({name, contact, frame.parentJoint, frame.placement});
  }
  return carrier;
}

}  // namespace dynacom::internal
