// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/contact_schedule.hpp"

namespace dynacom::python {

namespace {

using Schedule = ContactSchedule;

std::shared_ptr<Schedule> makeSchedule(const bp::object& names, const Schedule::Matrix& active) {
  auto schedule = std::make_shared<Schedule>();
  if (PyUnicode_Check(names.ptr())) {  // whose letters would be the names
    PyErr_SetString(PyExc_TypeError, "names must be several names, got one text");
    bp::throw_error_already_set();
  }
  schedule->names = toVectorOf<std::string>(names);
  schedule->active = active.transpose();
  return schedule;
}

bp::list getNames(const Schedule& schedule) { return toList(schedule.names); }

std::string writeSchedule(const Schedule& schedule) {
  return internal::concat("ContactSchedule(frames=", schedule.active.cols(),
                          ", names=", toText(schedule.names), ")");
}

std::string writeContactMotion(const ContactMotion& contact) {
  return internal::concat("ContactMotion(name='", contact.name, "', frames=", contact.height.size(),
                          ")");
}

bp::list listContactMotions(const DynaCoM& robot, const Motion& motion, int threads, int lanes) {
  const auto compute = [&, own_robot = DynaCoM(robot)] {
    const WithoutLock without_lock;
    return computeContactMotions(own_robot, motion, threads, lanes);
  };
  return toList(compute());
}

Eigen::VectorXd estimate(const bp::object& contacts, const Eigen::VectorXd& time,
                         const DetectionSettings& settings) {
  return estimateGround(toVectorOf<ContactMotion>(contacts), time, settings);
}

Schedule detect(const bp::object& contacts, const Eigen::VectorXd& time,
                const Eigen::VectorXd& ground, const DetectionSettings& settings) {
  return detectContacts(toVectorOf<ContactMotion>(contacts), time, ground, settings);
}

}  // namespace

void exposeContactSchedule() {
  bp::class_<Schedule, std::shared_ptr<Schedule>>("ContactSchedule",
                                                  "Which contacts are active when.", bp::no_init)
      .def("__init__",
           bp::make_constructor(&makeSchedule, bp::default_call_policies(),
                                (bp::arg("names"), bp::arg("active"))),
           "names: C names; active: (T, C) of bool.")
      .add_property("names", &getNames, "Names of the C contacts")
      .add_property("active", &Rows<&Schedule::active>::get, "(T, C) of bool")
      .def("validate", &Schedule::validate, (bp::arg("self"), bp::arg("frames")),
           "Raises ValueError if a name is there twice or active is not (frames, C).")
      .def(PrintVisitor<Schedule>(&writeSchedule))
      .def(CopyVisitor<Schedule>());

  bp::class_<ContactMotion>(
      "ContactMotion",
      "How a contact moves through a motion, whether it touches something or\n"
      "not: one row per frame, in the world's axes.",
      bp::no_init)
      .def_readonly("name", &ContactMotion::name, "The name under which the robot knows it.")
      .add_property("position", &Rows<&ContactMotion::position>::get,
                    "Of the surface's origin, (T, 3) [m]")
      .add_property("rotation", &Rows<&ContactMotion::rotation>::get,
                    "Of the surface, quaternions (x, y, z, w), (T, 4)")
      .add_property("height", getter(&ContactMotion::height),
                    "z of the surface's lowest corner, (T,) [m]")
      .add_property("velocity", &Rows<&ContactMotion::velocity>::get,
                    "Of that corner, as a point of the robot, (T, 3) [m/s]")
      .def(PrintVisitor<ContactMotion>(&writeContactMotion))
      .def(CopyVisitor<ContactMotion>());

  using Settings = DetectionSettings;
  bp::class_<Settings>("DetectionSettings",
                       "Where the ground is, and when a contact is held to touch it.")
      .def_readwrite("height", &Settings::height,
                     "A contact begins to touch no higher above its ground than this [m]")
      .def_readwrite("speed", &Settings::speed, "and no faster than this [m/s].")
      .def_readwrite("release_height", &Settings::release_height,
                     "It ceases to where it is higher than this [m]")
      .def_readwrite("release_speed", &Settings::release_speed, "or faster than this [m/s].")
      .def_readwrite(
          "rest_speed", &Settings::rest_speed,
          "At both ends it is cut back to where it is no faster than this, or than three\n"
          "times its median speed in the contact [m/s].")
      .def_readwrite("minimal_duration", &Settings::minimal_duration,
                     "Contacts, and interruptions, shorter than this are none [s].")
      .def_readwrite("ground_height", &Settings::ground_height,
                     "The ground's height under all contacts [m]; NaN if it is to be estimated.")
      .def_readwrite("same_ground", &Settings::same_ground,
                     "Where a contact's lowest place is higher than another's by more than this,\n"
                     "it is in the air there, unless it stands still as on a step of a stair [m].")
      .def(SettingsVisitor<Settings>());

  bp::def("computeContactMotions", &listContactMotions,
          (bp::arg("robot"), bp::arg("motion"), bp::arg("threads") = 0,
           bp::arg("lanes") = kMaximalLanes),
          "A ContactMotion for each contact that a robot knows, in its order; threads and lanes\n"
          "as in analyzeMotion. Raises ValueError if the motion is not valid.");
  bp::def("estimateGround", &estimate,
          (bp::arg("contacts"), bp::arg("time"), bp::arg("settings") = DetectionSettings()),
          "The height of the ground under each of C contacts, (C,) [m]: the fifth percentile of\n"
          "each one's height where it is slow, or the lowest of all where that is in the air.");
  bp::def("detectContacts", &detect,
          (bp::arg("contacts"), bp::arg("time"), bp::arg("ground"),
           bp::arg("settings") = DetectionSettings()),
          "The ContactSchedule of when contacts touch their ground: with hysteresis in height and\n"
          "speed, and a minimal duration.");
}

}  // namespace dynacom::python
