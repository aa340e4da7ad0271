// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/contact_schedule.hpp"

namespace dynacom::python {

namespace {

using Schedule = ContactSchedule;

std::shared_ptr<Schedule> makeSchedule(const bp::object& names, const Schedule::Matrix& active,
                                       const bp::object& confidence, const bp::object& readiness) {
  auto schedule = std::make_shared<Schedule>();
  if (PyUnicode_Check(names.ptr())) {  // whose letters would be the names
    PyErr_SetString(PyExc_TypeError, "names must be several names, got one text");
    bp::throw_error_already_set();
  }
  schedule->names = toVectorOf<std::string>(names);
  schedule->active = active.transpose();
  for (const auto& [given, matrix] :
       {std::pair(&confidence, &schedule->confidence), std::pair(&readiness, &schedule->readiness)})
    if (!given->is_none()) *matrix = bp::extract<Eigen::MatrixXd>(*given)().transpose();
  return schedule;
}

bp::list getNames(const Schedule& schedule) { return toList(schedule.names); }

bp::object toRows(const Eigen::MatrixXd& matrix) {
  return matrix.size() > 0 ? toArray(matrix.transpose()) : bp::object();
}

bp::object getConfidence(const Schedule& schedule) { return toRows(schedule.confidence); }

bp::object getReadiness(const Schedule& schedule) { return toRows(schedule.readiness); }

std::string writeSchedule(const Schedule& schedule) {
  return internal::concat("ContactSchedule(frames=", schedule.active.cols(),
                          ", names=", toText(schedule.names), ")");
}

std::string writeContactMotion(const ContactMotion& contact) {
  return internal::concat("ContactMotion(name='", contact.name, "', frames=", contact.height.size(),
                          ")");
}

bp::list listContactMotions(const DynaCoM& robot, const Motion& motion, Integer threads,
                            Integer lanes) {
  const auto compute = [&, own_robot = DynaCoM(robot)] {
    const WithoutLock without_lock;
    return computeContactMotions(own_robot, motion, threads, lanes);
  };
  return toList(compute());
}

}  // namespace

void exposeContactSchedule() {
  bp::class_<Schedule, std::shared_ptr<Schedule>>("ContactSchedule",
                                                  "Which contacts are active when.", bp::no_init)
      .def("__init__",
           bp::make_constructor(
               &makeSchedule, bp::default_call_policies(),
               (bp::arg("names"), bp::arg("active"), bp::arg("confidence") = bp::object(),
                bp::arg("readiness") = bp::object())),
           "names: C names; active: (T, C) of bool; confidence, readiness: (T, C), or None where\n"
           "nobody has said so.")
      .add_property("names", &getNames, "Names of the C contacts")
      .add_property("active", &Rows<&Schedule::active>::get, "(T, C) of bool")
      .add_property("confidence", &getConfidence,
                    "Probability that a contact is active, (T, C), or None")
      .add_property(
          "readiness", &getReadiness,
          "How readily a contact bears load while it is active, rho: weights are divided\n"
          "by its square root; (T, C), or None for 1")
      .def("validate", &Schedule::validate, (bp::arg("self"), bp::arg("frames")),
           "Raises ValueError if a name is there twice, or a matrix is not (frames, C) or has a\n"
           "number out of its range.")
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

  bp::def("computeContactMotions", &listContactMotions,
          (bp::arg("robot"), bp::arg("motion"), bp::arg("threads") = 0,
           bp::arg("lanes") = kMaximalLanes),
          "A ContactMotion for each contact that a robot knows, in its order; threads and lanes\n"
          "as in analyzeMotion. Raises ValueError if the motion is not valid,\n"
          "NotReadyError before initialize().");
}

}  // namespace dynacom::python
