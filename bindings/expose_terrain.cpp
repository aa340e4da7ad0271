// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/terrain.hpp"

namespace dynacom::python {

namespace {

bp::list getContacts(const Terrain& terrain) { return toList(terrain.contacts); }

bp::list getHeld(const Terrain& terrain) { return toList(terrain.held); }

bp::list getLevels(const ContactTerrain& contact) { return toList(contact.levels); }

bp::list getSlopes(const ContactTerrain& contact) { return toList(contact.slopes); }

bp::list getParts(const HeldContact& held) { return toList(held.parts); }

std::string writeContact(const ContactTerrain& contact) {
  return internal::concat("ContactTerrain(name='", contact.name, "', height=", contact.height,
                          ", levels=", contact.levels.size(), ", slopes=", contact.slopes.size(),
                          ")");
}

std::string writeHeld(const HeldContact& held) {
  return internal::concat("HeldContact(name='", held.name, "', parts=", toText(held.parts),
                          ", begin=", held.begin, ", height=", held.height, ")");
}

std::string writeTerrain(const Terrain& terrain) {
  return internal::concat("Terrain(contacts=", terrain.contacts.size(), ", lowest=", terrain.lowest,
                          ", level=", terrain.level, ", held=", terrain.held.size(), ")");
}

Terrain find(const bp::object& parts, const ContactInference& inference,
             const ContactSchedule& schedule, const Eigen::MatrixXd& ground,
             const Eigen::VectorXd& time, Real ground_height) {
  return findTerrain(toVectorOf<PartRobot::Part>(parts), inference, schedule, ground.transpose(),
                     time, ground_height);
}

}  // namespace

void exposeTerrain() {
  bp::class_<ContactTerrain>("ContactTerrain", "The ground under one contact.", bp::no_init)
      .def_readonly("name", &ContactTerrain::name, "The contact's")
      .def_readonly(
          "height", &ContactTerrain::height,
          "Its median over the frames in which the contact is active [m]; NaN where that\n"
          "is never, or the ground is not known")
      .add_property("levels", &getLevels,
                    "Heights of the stances on which it stands, increasing [m]: of the first, and\n"
                    "of each that differs from all before it by more than kSameLevel")
      .add_property(
          "slopes", &getSlopes,
          "Inclinations of those that are on a slope, increasing [rad]: of the first, and\n"
          "of each that differs from all before it by more than kSameSlope")
      .def(PrintVisitor<ContactTerrain>(&writeContact))
      .def(CopyVisitor<ContactTerrain>());

  bp::class_<HeldContact>("HeldContact",
                          "A contact that is held still where nothing carries it, in the lowest\n"
                          "stance in which it is.",
                          bp::no_init)
      .def_readonly("name", &HeldContact::name, "The contact's")
      .add_property(
          "parts", &getParts,
          "Names of the parts that are held, without the contact's, while the rest of it\n"
          "carries: it is tilted. Empty where nothing of it carries all the time")
      .def_readonly("first", &HeldContact::first, "Frame")
      .def_readonly("behind", &HeldContact::behind, "The frame after the last")
      .def_readonly("begin", &HeldContact::begin, "Time of the first [s]")
      .def_readonly("height", &HeldContact::height, "Above Terrain.level [m]")
      .def(PrintVisitor<HeldContact>(&writeHeld))
      .def(CopyVisitor<HeldContact>());

  bp::class_<Terrain>("Terrain", "What a motion stands on, see findTerrain.", bp::no_init)
      .add_property("contacts", &getContacts, "A ContactTerrain for each contact")
      .def_readonly("lowest", &Terrain::lowest,
                    "Height of all stances on which contacts stand, or, if there are none, of\n"
                    "their grounds [m]; NaN where none is known")
      .def_readonly("level", &Terrain::level,
                    "Of the ground as a whole: as given, else the median height of these stances;\n"
                    "0 if there are none [m]")
      .add_property(
          "held", &getHeld,
          "A HeldContact for each contact that is held for kHeldDuration and longer, and\n"
          "for what is tilted of it")
      .def(PrintVisitor<Terrain>(&writeTerrain))
      .def(CopyVisitor<Terrain>());

  bp::scope().attr("kSameLevel") = kSameLevel;
  bp::scope().attr("kSameSlope") = kSameSlope;
  bp::scope().attr("kHeldDuration") = kHeldDuration;
  bp::def("findTerrain", &find,
          (bp::arg("parts"), bp::arg("inference"), bp::arg("schedule"), bp::arg("ground"),
           bp::arg("time"), bp::arg("ground_height") = std::numeric_limits<double>::quiet_NaN()),
          "The Terrain of what inferContacts found for parts, PartRobot.Part of contacts and of\n"
          "other links behind them. schedule: of the contacts, gathered from the inference's;\n"
          "ground: height under each contact, (T, C) [m], NaN where it is not known; time: (T,)\n"
          "[s]; ground_height: of DetectionSettings. Raises ValueError if sizes differ.");
}

}  // namespace dynacom::python
