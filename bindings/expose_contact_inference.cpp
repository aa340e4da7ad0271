// SPDX-License-Identifier: BSD-2-Clause
#include <map>
#include <string>

#include "bindings.hpp"
#include "dynacom/contact_inference.hpp"

namespace dynacom::python {

namespace {

// What a constant of DetectionSettings is; empty if it is not described here. docs/verdict.md has
// the same words, and a test makes sure that all are described.
const char* getMeaning(const std::string& constant) {
  static const std::map<std::string, const char*> all = {
      {"rest_speed_part",
       "A part is at rest below this part of the 95th percentile of its speeds, between a least "
       "and a greatest"},
      {"rest_speed_least", "The speed below which a part is at rest is no less than this [m/s]"},
      {"rest_speed_greatest", "The speed below which a part is at rest is no more than this [m/s]"},
      {"exact_rest_speed_least", "As rest_speed_least, of exact motions [m/s]"},
      {"exact_rest_speed_greatest", "As rest_speed_greatest, of exact motions [m/s]"},
      {"moving_speed", "A part moves from this speed on: percentiles are of what moves [m/s]"},
      {"horizontal_part", "Of horizontal speeds so much counts: soles drift more than they float"},
      {"rest_duration", "How long a rest is at least [s]"},
      {"same_rest_speed",
       "Rests are one if in between the part is no faster than so many times the speed below which "
       "it is at rest"},
      {"same_rest",
       "Rests are one if their heights differ by no more, and the part is slow in between [m]"},
      {"near_movement",
       "Frames count for heights and scales that are this close to one in which a part moves [s]"},
      {"stir_speed",
       "Frames count for heights and scales in which some part is faster than this [m/s]"},
      {"landing_height",
       "From, or to, how high above a stance a part has to be seen for the stance to be on the "
       "ground [m]"},
      {"same_ground",
       "A stance this close to one on the ground, or to the lowest, is on the ground, too [m]"},
      {"exact_same_ground", "As same_ground, of exact motions [m]"},
      {"body_reach",
       "A link that is no contact may have touched what was within this below it [m]"},
      {"body_ground",
       "A link that is no contact is carried by what is no higher than this above the lowest "
       "level, or within this of another [m]"},
      {"height_scale_least",
       "The scale of heights, their scatter in stances, is no less than this [m]"},
      {"height_scale_greatest", "The scale of heights is no more than this [m]"},
      {"speed_scale_part",
       "The scale of speeds is so many times their median in stances, between a least and a "
       "greatest"},
      {"speed_scale_least", "The scale of speeds is no less than this [m/s]"},
      {"speed_scale_greatest", "The scale of speeds is no more than this [m/s]"},
      {"force_scale_part",
       "The scale of forces is so many m g for each m/s of the scale of speeds, between a least "
       "and a greatest [s/m]"},
      {"force_scale_least", "The scale of forces is no less than this [m g]"},
      {"force_scale_greatest", "The scale of forces is no more than this [m g]"},
      {"lever", "The scale of moments is so many metres times that of forces [m]"},
      {"contact_gain", "What a part in contact is worth: it costs as much less"},
      {"fine_excess",
       "The most that heights and speeds cost in the motion's scales beyond contact_gain"},
      {"coarse_factor",
       "What heights and speeds cost besides, in coarse_height and coarse_speed, is multiplied "
       "by this"},
      {"coarse_height", "The height that costs 1 in the coarse scale [m]"},
      {"coarse_speed", "The speed that costs 1 in the coarse scale [m/s]"},
      {"coarse_greatest", "The most that heights and speeds cost in the coarse scales"},
      {"pressed_depth",
       "Down to this far below its rest a part is pressed, which costs nothing [m]"},
      {"missing_greatest", "The most that a missing wrench costs in the motion's scales"},
      {"missing_factor",
       "What a missing wrench costs besides, in missing_force and missing_torque, without a "
       "most, is multiplied by this"},
      {"missing_force", "The missing force that costs 1 in the coarse scale [m g]"},
      {"missing_torque", "The missing moment that costs 1 in the coarse scale [m g m]"},
      {"dynamics_weight", "What a missing wrench costs in all is multiplied by this"},
      {"further_points",
       "What parts of a limb that is in contact already cost and are worth is multiplied by this"},
      {"rate", "All costs of a frame count so often in a second [1/s]"},
      {"change", "What it costs that a contact begins or ends"},
      {"ramp", "A contact takes its load on, and gives it back, over so long [s]"},
      {"ramp_least",
       "A contact bears load this readily where it begins and ends; 1 is as readily as ever"},
  };
  const auto found = all.find(constant);
  return found == all.end() ? "" : found->second;
}

bp::list getParts(const PartRobot& split) { return toList(split.parts); }

bp::list getBodies(const PartRobot& split) { return toList(split.bodies); }

std::string writePart(const PartRobot::Part& part) {
  return internal::concat("PartRobot.Part(name='", part.name, "', contact=", part.contact,
                          ", limb=", part.limb, ")");
}

std::string writePartRobot(const PartRobot& split) {
  std::vector<std::string> names;
  for (const PartRobot::Part& part : split.parts) names.push_back(part.name);
  return internal::concat("PartRobot(parts=", toText(names), ")");
}

std::string writeStance(const Stance& stance) {
  return internal::concat("Stance(part=", stance.part, ", first=", stance.first,
                          ", behind=", stance.behind, ", height=", stance.height,
                          ", on_ground=", stance.on_ground ? "True" : "False",
                          ", begin=", stance.begin, ", end=", stance.end, ", slope=(",
                          stance.slope.x(), ", ", stance.slope.y(), "))");
}

bp::list getStances(const ContactInference& found) { return toList(found.stances); }

std::string writeInference(const ContactInference& found) {
  return internal::concat("ContactInference(frames=", found.schedule.active.cols(),
                          ", names=", toText(found.schedule.names),
                          ", stances=", found.stances.size(), ")");
}

ContactInference infer(const PartRobot& parts, const bp::object& motions,
                       const MotionAnalysis& dynamics, Truth exact,
                       const DetectionSettings& settings, const bp::object& recorded) {
  const auto own_motions = toVectorOf<ContactMotion>(motions);
  const ContactSchedule* known =
      recorded.is_none() ? nullptr : bp::extract<const ContactSchedule*>(recorded)();
  return inferContacts(parts, own_motions, dynamics, exact, settings, known);
}

PartRobot split(const DynaCoM& robot, const bp::object& bodies, FrictionModel friction) {
  return splitContacts(robot, toVectorOf<BodyPoints>(bodies), friction);
}

MotionAnalysis gather(const DynaCoM& robot, const PartRobot& parts, const bp::object& contacts,
                      const bp::object& motions, const MotionAnalysis& analysis) {
  return gatherParts(robot, parts, toVectorOf<ContactMotion>(contacts),
                     toVectorOf<ContactMotion>(motions), analysis);
}

ContactSchedule gatherSchedule(const DynaCoM& robot, const PartRobot& parts,
                               const ContactSchedule& schedule) {
  return gatherParts(robot, parts, schedule);
}

}  // namespace

void exposeContactInference() {
  using Settings = DetectionSettings;
  bp::class_<Settings> settings(
      "DetectionSettings",
      "The constants of inferContacts, all > 0, in seconds, metres and parts of the weight m g.\n"
      "docs/truth.md has what each was tried against.");
  for (const Settings::Constant& constant : Settings::constants()) {
    double Settings::*field = constant.second;
    settings.add_property(constant.first, bp::make_getter(field), bp::make_setter(field),
                          getMeaning(constant.first));
  }
  settings
      .def_readwrite("ground_height", &Settings::ground_height,
                     "The ground's height under all contacts [m]; NaN if it is to be found.")
      .add_property("ground_velocity", getter(&Settings::ground_velocity),
                    bp::make_setter(&Settings::ground_velocity),
                    "Velocity of the ground, a treadmill's, level [m/s]; NaN if it is to be found.")
      .def(SettingsVisitor<Settings>());

  {
    const bp::scope split =
        bp::class_<PartRobot>("PartRobot", "A robot whose contacts are points, see splitContacts.",
                              bp::no_init)
            .def_readonly("robot", &PartRobot::robot,
                          "A DynaCoM that knows each part as a ContactPoint")
            .add_property("bodies", &getBodies,
                          "Names of the links that may touch something besides the contacts")
            .add_property("parts", &getParts, "A PartRobot.Part for each of them")
            .def(PrintVisitor<PartRobot>(&writePartRobot))
            .def(CopyVisitor<PartRobot>());
    bp::class_<PartRobot::Part>("Part", "A point of a contact.", bp::no_init)
        .def_readonly("name", &PartRobot::Part::name,
                      "Of the contact; for one of several parts `<contact>.<part>`")
        .def_readonly("contact", &PartRobot::Part::contact,
                      "Whose part it is: its place among the whole robot's contacts, or, behind\n"
                      "these, among the bodies")
        .def_readonly("limb", &PartRobot::Part::limb,
                      "Parts on one joint, or on a joint that moves another's, share a number")
        .def(PrintVisitor<PartRobot::Part>(&writePart))
        .def(CopyVisitor<PartRobot::Part>());
  }

  bp::class_<Stance>("Stance",
                     "A time in which a part of the robot is at rest: on the ground, or held in\n"
                     "the air.",
                     bp::no_init)
      .def_readonly("part", &Stance::part, "Its place among PartRobot.parts")
      .def_readonly("first", &Stance::first, "Frame")
      .def_readonly("behind", &Stance::behind, "The frame after the last")
      .def_readonly("height", &Stance::height, "Of the part's lowest point there [m]")
      .def_readonly("on_ground", &Stance::on_ground, "Whether the ground may carry it there")
      .def_readonly("begin", &Stance::begin,
                    "The first frame that belongs to it: with those of the way here, since the\n"
                    "part was fastest")
      .def_readonly("end", &Stance::end,
                    "The frame after the last that belongs to it: with those of the way to the\n"
                    "next, until the part is fastest")
      .add_property("slope", getter(&Stance::slope),
                    "The ground's gradient (dz/dx, dz/dy) there, (2,); zero where it is level or\n"
                    "not known, or where the part is never active")
      .def(PrintVisitor<Stance>(&writeStance))
      .def(CopyVisitor<Stance>());

  bp::class_<ContactInference>(
      "ContactInference",
      "When which part of a robot touches the ground, and where that ground is.", bp::no_init)
      .def_readonly("schedule", &ContactInference::schedule,
                    "Of the parts: a ContactSchedule with confidence and readiness")
      .add_property("stances", &getStances, "All, as Stance")
      .add_property("ground", &Rows<&ContactInference::ground>::get,
                    "Height of the ground under each of P parts, (T, P) [m]; NaN where there is\n"
                    "none")
      .add_property("missing", &Rows<&ContactInference::missing>::get,
                    "What the schedule cannot give of the wrench that the motion needs,\n"
                    "frames x 2: the norms of the force [m g] and of the moment about the\n"
                    "CoM [m g m].")
      .add_property("slope", getter(&ContactInference::slope),
                    "The slope that all stances share in which a contact's part is active, (2,);\n"
                    "zero where there is no such one")
      .add_property("ground_velocity", getter(&ContactInference::ground_velocity),
                    "As given or found, (3,) [m/s]")
      .def(PrintVisitor<ContactInference>(&writeInference))
      .def(CopyVisitor<ContactInference>());

  bp::def(
      "splitContacts", &split,
      (bp::arg("robot"), bp::arg("bodies") = bp::list(), bp::arg("friction") = FrictionModel::Cone),
      "The PartRobot of a DynaCoM: a Contact6D becomes a point for each of its corners, called\n"
      "front_left, front_right, rear_left and rear_right; a ContactPoint stays what it is.\n"
      "Links of BodyPoints follow, whose points are called body.<link>.<number>. friction: of\n"
      "links, and of contacts that are outer pyramids; others keep their own. Raises\n"
      "ValueError if a contact is of another kind, NotReadyError before initialize().");
  bp::def("gatherParts", &gather,
          (bp::arg("robot"), bp::arg("parts"), bp::arg("contacts"), bp::arg("motions"),
           bp::arg("analysis")),
          "The MotionAnalysis of a robot from that of its parts, whose contacts become its parts.\n"
          "contacts, motions: of computeContactMotions for the robot and for its parts. Raises\n"
          "ValueError if sizes differ.");
  bp::def("gatherParts", &gatherSchedule, (bp::arg("robot"), bp::arg("parts"), bp::arg("schedule")),
          "The same of a ContactSchedule: a contact is active if any of its parts is, and as\n"
          "probable as its most probable part. Raises ValueError if sizes differ.");
  bp::def("inferContacts", &infer,
          (bp::arg("parts"), bp::arg("motions"), bp::arg("dynamics"), bp::arg("exact"),
           bp::arg("settings") = Settings(), bp::arg("recorded") = bp::object()),
          "The ContactInference of a motion: the cheapest path through time of sets of active\n"
          "parts, by where they are, how they move, and what they cannot give of the wrench that\n"
          "the motion needs. motions: of computeContactMotions for parts.robot; dynamics: of\n"
          "analyzeMotion for it, with whatever schedule; exact: whether the motion is free of\n"
          "noise; recorded: a ContactSchedule of the whole robot's contacts, within which the\n"
          "parts are found. Raises ValueError if settings are not valid, sizes differ, or there\n"
          "are more than 32 parts.");
}

}  // namespace dynacom::python
