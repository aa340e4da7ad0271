// SPDX-License-Identifier: BSD-2-Clause
#include <map>

#include "bindings.hpp"
#include "dynacom/motion.hpp"

// In C++ a frame is a column, in Python a row: the same memory, in numpy's usual order.

namespace dynacom::python {

namespace {

using Schedule = ContactSchedule;

std::shared_ptr<Motion> makeMotion(const Eigen::VectorXd& time, const Eigen::MatrixXd& q,
                                   const Eigen::MatrixXd& v, const Eigen::MatrixXd& a) {
  return std::make_shared<Motion>(Motion{time, q.transpose(), v.transpose(), a.transpose()});
}

std::shared_ptr<Schedule> makeSchedule(const bp::object& names, const Schedule::Matrix& active) {
  auto schedule = std::make_shared<Schedule>();
  if (PyUnicode_Check(names.ptr())) {  // whose letters would be the names
    PyErr_SetString(PyExc_TypeError, "names must be several names, got one text");
    bp::throw_error_already_set();
  }
  // list() takes any iterable, and refuses what is none.
  const bp::list list(names);
  for (bp::ssize_t i = 0; i < bp::len(list); ++i)
    schedule->names.push_back(bp::extract<std::string>(list[i]));
  schedule->active = active.transpose();
  return schedule;
}

bp::list getNames(const Schedule& schedule) {
  bp::list names;
  for (const std::string& name : schedule.names) names.append(name);
  return names;
}

bp::list getStatus(const MotionAnalysis& analysis) {
  bp::list status;
  for (const DistributionStatus frame : analysis.status) status.append(frame);
  return status;
}

bp::list getContacts(const MotionAnalysis& analysis) {
  bp::list contacts;
  for (const MotionAnalysis::Contact& contact : analysis.contacts) contacts.append(contact);
  return contacts;
}

std::string writeMotion(const Motion& motion) {
  return internal::concat("Motion(frames=", motion.frames(), ", nq=", motion.q.rows(),
                          ", nv=", motion.v.rows(), ")");
}

std::string writeSchedule(const Schedule& schedule) {
  return internal::concat("ContactSchedule(frames=", schedule.active.cols(),
                          ", names=", toText(schedule.names), ")");
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

// Reads a matrix member with a row per frame.
template <auto member>
struct Rows;
template <class Class, class Matrix, Matrix Class::*member>
struct Rows<member> {
  static bp::object get(const Class& self) {
    using Transposed = Eigen::Matrix<typename Matrix::Scalar, Eigen::Dynamic, Eigen::Dynamic>;
    return toArray(Transposed((self.*member).transpose()));
  }
};

bp::object getContactActive(const MotionAnalysis::Contact& contact) {
  return bp::object(Schedule::Matrix(contact.active.matrix())).attr("reshape")(-1);
}

// Runs without Python's lock, which progress takes for its call.
class WithoutLock {
 public:
  WithoutLock() : state_(PyEval_SaveThread()) {}
  ~WithoutLock() { PyEval_RestoreThread(state_); }
  WithoutLock(const WithoutLock&) = delete;
  WithoutLock& operator=(const WithoutLock&) = delete;

 private:
  PyThreadState* state_;
};

MotionAnalysis analyze(const DynaCoM& robot, const Motion& motion, const Schedule& schedule,
                       bool flat_horizontal_ground, double omega, const bp::object& progress) {
  AnalysisSettings settings;
  settings.flat_horizontal_ground = flat_horizontal_ground;
  settings.omega = omega;
  if (!progress.is_none())
    settings.progress = [&progress](Eigen::Index frames) {
      const PyGILState_STATE state = PyGILState_Ensure();
      PyObject* result = PyObject_CallFunction(progress.ptr(), "n", Py_ssize_t(frames));
      const bool failed = result == nullptr;
      Py_XDECREF(result);
      PyGILState_Release(state);
      // The Python error stays set in this thread until Boost.Python raises it again.
      if (failed) throw bp::error_already_set();
    };
  // Copies: without the lock, others may change what they hold.
  const DynaCoM own_robot(robot);
  const Motion own_motion(motion);
  const Schedule own_schedule(schedule);
  const WithoutLock without_lock;
  return analyzeMotion(own_robot, own_motion, own_schedule, settings);
}

}  // namespace

void exposeMotion() {
  bp::class_<Motion, std::shared_ptr<Motion>>("Motion", "A robot's motion, one row per frame.",
                                              bp::no_init)
      .def("__init__",
           bp::make_constructor(&makeMotion, bp::default_call_policies(),
                                (bp::arg("time"), bp::arg("q"), bp::arg("v"), bp::arg("a"))),
           "time: (T,) [s]; q: (T, nq); v: (T, nv); a: (T, nv).")
      .add_property("time", getter(&Motion::time), "(T,), strictly increasing [s]")
      .add_property("q", &Rows<&Motion::q>::get, "Configurations, (T, nq)")
      .add_property("v", &Rows<&Motion::v>::get, "Velocities, (T, nv)")
      .add_property("a", &Rows<&Motion::a>::get, "Accelerations, (T, nv)")
      .add_property("frames", &Motion::frames, "T")
      .def("validate", &Motion::validate, (bp::arg("self"), bp::arg("model")),
           "Raises ValueError, naming the array and the frame, if sizes do not fit the model, a\n"
           "number is not finite, or time does not increase.")
      .def(PrintVisitor<Motion>(&writeMotion))
      .def(CopyVisitor<Motion>());

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

  bp::def(
      "analyzeMotion", &analyze,
      (bp::arg("robot"), bp::arg("motion"), bp::arg("schedule"),
       bp::arg("flatHorizontalGround") = true, bp::arg("omega") = 0.,
       bp::arg("progress") = bp::object()),
      "Computes dynamics and distribution for every frame of a motion, whose contacts are placed\n"
      "by the model: a pose that was measured once says nothing of them. The robot, a DynaCoM, is\n"
      "left as it is; contacts without schedule are never active.\n\n"
      "flatHorizontalGround: as in DynaCoM.computeDynamics; omega: of the virtual repellent\n"
      "point [rad/s], 0 stands for sqrt(g / mean height of the centre of mass above the\n"
      "ground); progress: called now and then with the number of frames done. Raises ValueError\n"
      "if motion or schedule is not valid, or names a contact that the robot does not know.");

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
          .add_property("cop", &Rows<&Analysis::cop>::get, "Centre of pressure, (T, 2) [m]")
          .add_property("vrp", &Rows<&Analysis::vrp>::get, "Virtual repellent point, (T, 2) [m]")
          .add_property("nl", &Rows<&Analysis::nl>::get, "Non-linearity, (T, 2) [m]")
          .add_property("status", &getStatus, "T times a DistributionStatus")
          .add_property("residual", &Rows<&Analysis::residual>::get,
                        "Ground wrench minus what the contacts give, (T, 6)")
          .add_property("contacts", &getContacts, "A MotionAnalysis.Contact for each contact")
          .def(PrintVisitor<Analysis>(&writeAnalysis))
          .def(CopyVisitor<Analysis>());
  bp::class_<Contact>("Contact", "What one contact does.", bp::no_init)
      .def_readonly("name", &Contact::name, "The name under which the robot knows it.")
      .add_property("active", &getContactActive, "(T,) of bool")
      .add_property("wrench", &Rows<&Contact::wrench>::get,
                    "(force, moment) in the surface's frame about its origin, (T, 6)")
      .add_property("vertical_force", getter(&Contact::vertical_force), "In the world, (T,) [N]")
      .def(PrintVisitor<Contact>(&writeContact))
      .def(CopyVisitor<Contact>());
}

}  // namespace dynacom::python
