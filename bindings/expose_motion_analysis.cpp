// SPDX-License-Identifier: BSD-2-Clause
#include <map>

#include "bindings.hpp"
#include "dynacom/motion_analysis.hpp"

namespace dynacom::python {

namespace {

bp::list getStatus(const MotionAnalysis& analysis) { return toList(analysis.status); }

std::string writeBody(const MotionAnalysis::Body& body) {
  return internal::concat("MotionAnalysis.Body(link='", body.link, "', frames=", body.active.size(),
                          ", active_frames=", body.active.count(), ")");
}

bp::object getBodyActive(const MotionAnalysis::Body& body) {
  return bp::object(ContactSchedule::Matrix(body.active.matrix())).attr("reshape")(-1);
}

std::string writeAnalysis(const MotionAnalysis& analysis) {
  std::map<DistributionStatus, int> counts;
  for (const DistributionStatus status : analysis.status) ++counts[status];
  std::string frames;  // with each status
  for (const auto& [status, count] : counts)
    frames += internal::concat(frames.empty() ? "" : ", ", status, ": ", count);
  std::vector<std::string> names;
  for (const MotionAnalysis::Contact& contact : analysis.contacts) names.push_back(contact.name);
  return internal::concat("MotionAnalysis(frames=", analysis.status.size(), ", status={", frames,
                          "}, omega=", analysis.omega, ", contacts=", toText(names), ")");
}

std::string writeContact(const MotionAnalysis::Contact& contact) {
  return internal::concat("MotionAnalysis.Contact(name='", contact.name,
                          "', frames=", contact.active.size(),
                          ", active_frames=", contact.active.count(), ")");
}

bp::object getContactActive(const MotionAnalysis::Contact& contact) {
  return bp::object(ContactSchedule::Matrix(contact.active.matrix())).attr("reshape")(-1);
}

MotionAnalysis analyze(const DynaCoM& robot, const Motion& motion, const ContactSchedule& schedule,
                       Truth flat_horizontal_ground, Real omega, const bp::object& progress,
                       Integer threads, Integer lanes) {
  AnalysisSettings settings;
  settings.flat_horizontal_ground = flat_horizontal_ground;
  settings.omega = omega;
  settings.threads = threads;
  settings.lanes = lanes;
  settings.progress = toProgress<Eigen::Index>(progress);
  const DynaCoM own_robot(robot);  // without the lock, others may change it
  const WithoutLock without_lock;
  return analyzeMotion(own_robot, motion, schedule, settings);
}

int count(const DynaCoM& robot, Integer lanes) { return countLanes(robot, lanes); }

}  // namespace

void exposeMotionAnalysis() {
  bp::def(
      "analyzeMotion", &analyze,
      (bp::arg("robot"), bp::arg("motion"), bp::arg("schedule"),
       bp::arg("flatHorizontalGround") = true, bp::arg("omega") = 0.,
       bp::arg("progress") = bp::object(), bp::arg("threads") = 0,
       bp::arg("lanes") = kMaximalLanes),
      "Computes dynamics and distribution for every frame of a motion, whose contacts are placed\n"
      "by the model: a pose that was measured once says nothing of them. The robot, a DynaCoM, is\n"
      "left as it is; contacts without schedule are never active.\n\n"
      "flatHorizontalGround: as in DynaCoM.computeDynamics; omega: of the virtual repellent\n"
      "point and the divergent component of motion [rad/s], 0 stands for sqrt(g / mean height of "
      "the centre of mass above the\n"
      "ground); progress: called now and then with the number of frames done; threads: how many "
      "do\n"
      "the work, 0 for as many as the machine has, with the same results bit for bit; lanes: how\n"
      "many frames a thread computes at once, at most, see countLanes. Raises ValueError if "
      "motion\n"
      "or schedule is not valid, or names a contact that the robot does not know; but a frame "
      "with\n"
      "a quaternion whose norm is not 1 is NaN, and its status InvalidInput.");
  bp::def(
      "countLanes", &count, (bp::arg("robot"), bp::arg("lanes") = kMaximalLanes),
      "How many lanes of SIMD registers this machine has for a robot, and no more than so many:\n"
      "8 with AVX-512, 4 with AVX2, 1 where there is neither, or the robot has joints or\n"
      "contacts that lanes do not know.");

  using Analysis = MotionAnalysis;
  using Contact = MotionAnalysis::Contact;
  const bp::scope analysis =
      bp::class_<Analysis>("MotionAnalysis",
                           "What analyzeMotion found: a row per frame, world axes, SI units.",
                           bp::no_init)
          .def_readonly("omega", &Analysis::omega, "omega in use [rad/s]; NaN where there is none")
          .add_property("time", getter(&Analysis::time), "(T,) [s]")
          .add_property("com", &Rows<&Analysis::com>::get, "(T, 3) [m]")
          .add_property("vcom", &Rows<&Analysis::vcom>::get, "(T, 3) [m/s]")
          .add_property("acom", &Rows<&Analysis::acom>::get, "(T, 3) [m/s²]")
          .add_property("am", &Rows<&Analysis::am>::get, "Angular momentum, (T, 3) [kg·m²/s]")
          .add_property("dam", &Rows<&Analysis::dam>::get, "Its rate, (T, 3) [N·m]")
          .add_property("ground_force", &Rows<&Analysis::ground_force>::get, "(T, 3) [N]")
          .add_property("ground_torque", &Rows<&Analysis::ground_torque>::get,
                        "About the centre of mass, (T, 3) [N·m]")
          .add_property("feasible_acom", &Rows<&Analysis::feasible_acom>::get,
                        "Acceleration that the contacts can cause, (T, 3) [m/s²]")
          .add_property("feasible_dam", &Rows<&Analysis::feasible_dam>::get,
                        "Rate of angular momentum that the contacts can cause, (T, 3) [N·m]")
          .add_property("cop", &Rows<&Analysis::cop>::get, "Centre of pressure, (T, 2) [m]")
          .add_property("vrp", &Rows<&Analysis::vrp>::get, "Virtual repellent point, (T, 2) [m]")
          .add_property("nl", &Rows<&Analysis::nl>::get, "Non-linearity, (T, 2) [m]")
          .add_property("dcm", &Rows<&Analysis::dcm>::get,
                        "Divergent component of motion, (T, 2) [m]")
          .add_property("status", &getStatus, "T times a DistributionStatus")
          .add_property("residual", &Rows<&Analysis::residual>::get,
                        "Ground wrench minus what the contacts give, (T, 6)")
          .add_property("contacts", &Elements<&Analysis::contacts>::get,
                        "A MotionAnalysis.Contact for each contact")
          .add_property("parts", &Elements<&Analysis::parts>::get,
                        "The same for the contacts' parts, where these were gathered")
          .add_property("bodies", &Elements<&Analysis::bodies>::get,
                        "A MotionAnalysis.Body for each link that touches something, besides")
          .def(PrintVisitor<Analysis>(&writeAnalysis))
          .def(CopyVisitor<Analysis>());
  using Body = MotionAnalysis::Body;
  bp::class_<Body>("Body", "What a link does that touches something.", bp::no_init)
      .def_readonly("link", &Body::link, "Its name")
      .add_property("active", &getBodyActive, "(T,) of bool")
      .add_property("force", &Rows<&Body::force>::get, "In the world's axes, (T, 3) [N]")
      .add_property("position", &Rows<&Body::position>::get,
                    "Where it pushes, (T, 3) [m]; NaN without load")
      .def(PrintVisitor<Body>(&writeBody))
      .def(CopyVisitor<Body>());
  bp::class_<Contact>("Contact", "What one contact does.", bp::no_init)
      .def_readonly("name", &Contact::name, "The name under which the robot knows it.")
      .add_property("active", &getContactActive, "(T,) of bool")
      .add_property("wrench", &Rows<&Contact::wrench>::get,
                    "(force, moment) in the surface's frame about its origin, (T, 6)")
      .add_property("vertical_force", getter(&Contact::vertical_force), "In the world, (T,) [N]")
      .add_property("cop", &Rows<&Contact::cop>::get,
                    "Centre of pressure in the surface's plane, (T, 2) [m]; NaN without load")
      .add_property("friction_usage", getter(&Contact::friction_usage),
                    "(T,), 1 on the friction pyramid; NaN where not active")
      .add_property("yaw_usage", getter(&Contact::yaw_usage), "Likewise, of the yaw moment")
      .add_property("cop_margin", getter(&Contact::cop_margin),
                    "Distance of cop to the nearest edge, (T,) [m]; NaN without load or edges")
      .def(PrintVisitor<Contact>(&writeContact))
      .def(CopyVisitor<Contact>());
}

}  // namespace dynacom::python
