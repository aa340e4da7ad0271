// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/recorded_motion.hpp"

namespace dynacom::python {

namespace {

// Rows of frames as columns; no columns for None.
Eigen::MatrixXd toColumns(const bp::object& rows) {
  if (rows.is_none()) return {};
  return bp::extract<Eigen::MatrixXd>(rows)().transpose();
}

std::shared_ptr<RecordedMotion> makeRecorded(const Eigen::VectorXd& time, const Eigen::MatrixXd& q,
                                             const bp::object& v, const bp::object& a,
                                             const bp::object& schedule, Truth is_exact) {
  RecordedMotion recorded{time, q.transpose()};
  recorded.v = toColumns(v);
  recorded.a = toColumns(a);
  recorded.is_exact = is_exact;
  if (!schedule.is_none()) recorded.schedule = bp::extract<ContactSchedule>(schedule)();
  return std::make_shared<RecordedMotion>(std::move(recorded));
}

template <Eigen::MatrixXd RecordedMotion::*member>
bp::object getRows(const RecordedMotion& recorded) {
  return (recorded.*member).cols() == 0 ? bp::object() : Rows<member>::get(recorded);
}

bp::object getSchedule(const RecordedMotion& recorded) {
  return recorded.schedule ? bp::object(*recorded.schedule) : bp::object();
}

std::string writeRecorded(const RecordedMotion& recorded) {
  return internal::concat("RecordedMotion(frames=", recorded.time.size(),
                          ", nq=", recorded.q.rows(), ")");
}

std::string writeDerived(const DerivedMotion& derived) {
  return internal::concat("DerivedMotion(frames=", derived.motion.frames(),
                          ", is_recorded=", derived.is_recorded ? "True" : "False",
                          ", frame_rate=", derived.frame_rate, ", cutoff=", derived.cutoff, ")");
}

bp::object getUnsure(const DerivedMotion& derived) {
  const Eigen::Matrix<bool, Eigen::Dynamic, 1> unsure = derived.unsure.matrix();
  return bp::object(unsure);
}

DerivedMotion derive(const pinocchio::Model& model, const RecordedMotion& recorded, Real cutoff) {
  const WithoutLock without_lock;
  return deriveMotion(model, recorded, cutoff);
}

DerivedMotion rederive(const pinocchio::Model& model, const RecordedMotion& recorded, Real cutoff) {
  const WithoutLock without_lock;
  return rederiveMotion(model, recorded, cutoff);
}

}  // namespace

void exposeRecordedMotion() {
  bp::class_<RecordedMotion, std::shared_ptr<RecordedMotion>>(
      "RecordedMotion", "A motion as it was recorded, before any filter: one row per frame.",
      bp::no_init)
      .def("__init__",
           bp::make_constructor(&makeRecorded, bp::default_call_policies(),
                                (bp::arg("time"), bp::arg("q"), bp::arg("v") = bp::object(),
                                 bp::arg("a") = bp::object(), bp::arg("schedule") = bp::object(),
                                 bp::arg("is_exact") = false)),
           "time: (T,) [s]; q: (T, nq), with quaternions of norm 1; v: (T, nv); a: (T, nv);\n"
           "schedule: a ContactSchedule. None stands for what was not recorded. is_exact:\n"
           "whether it is known to be free of noise, as what repair has written.")
      .add_property("time", getter(&RecordedMotion::time), "(T,), strictly increasing [s]")
      .add_property("q", &Rows<&RecordedMotion::q>::get, "Configurations, (T, nq)")
      .add_property("v", &getRows<&RecordedMotion::v>, "Velocities, (T, nv), or None")
      .add_property("a", &getRows<&RecordedMotion::a>, "Accelerations, (T, nv), or None")
      .add_property("schedule", &getSchedule, "The ContactSchedule, or None")
      .def_readonly("is_exact", &RecordedMotion::is_exact,
                    "Whether it is known to be free of noise")
      .def(PrintVisitor<RecordedMotion>(&writeRecorded))
      .def(CopyVisitor<RecordedMotion>());

  bp::class_<DerivedMotion>("DerivedMotion", "A motion with derivatives, see deriveMotion.",
                            bp::no_init)
      .def_readonly("motion", &DerivedMotion::motion, "The Motion")
      .def_readonly("is_recorded", &DerivedMotion::is_recorded,
                    "Whether velocities and accelerations are those that were recorded")
      .def_readonly("mismatch", &DerivedMotion::mismatch,
                    "The DerivativeMismatch of those; of NaN where they were not both recorded")
      .def_readonly("frame_rate", &DerivedMotion::frame_rate,
                    "Frames per second; NaN where they are not evenly spaced [Hz]")
      .def_readonly("cutoff", &DerivedMotion::cutoff, "Of the filter; 0 where there was none [Hz]")
      .def_readonly("time_error", &DerivedMotion::time_error,
                    "By how much times were moved to be evenly spaced [s]")
      .def_readonly("is_automatic", &DerivedMotion::is_automatic,
                    "Whether the cut-off, or that there is none, was chosen for the noise")
      .def_readonly("is_told_exact", &DerivedMotion::is_told_exact, "RecordedMotion.is_exact")
      .def_readonly("noise", &DerivedMotion::noise,
                    "estimateAccelerationNoise of what was recorded; NaN of few frames [g]")
      .def("isExact", &DerivedMotion::isExact,
           "Whether it is free of noise, and was not filtered, or for rounding only")
      .def_readonly("thinned_noise", &DerivedMotion::thinned_noise,
                    "The same of about kThinnedRate frames a second, where there are more [g]")
      .add_property("unsure", &getUnsure,
                    "Whether a frame's accelerations hang on what was before the first frame or\n"
                    "after the last one, (T,): it was filtered, is within half a period of the\n"
                    "cut-off from that end, and moves there by more than kUnsureForce [m g] or\n"
                    "kUnsureTorque [m g m]")
      .def(PrintVisitor<DerivedMotion>(&writeDerived))
      .def(CopyVisitor<DerivedMotion>());

  bp::scope().attr("kVelocityMismatch") = kVelocityMismatch;
  bp::scope().attr("kAccelerationMismatch") = kAccelerationMismatch;
  bp::scope().attr("kEvenTimes") = kEvenTimes;
  bp::scope().attr("kExactNoise") = kExactNoise;
  bp::scope().attr("kAutomaticCutoff") = kAutomaticCutoff;
  bp::scope().attr("kMeasuredCutoff") = kMeasuredCutoff;
  bp::scope().attr("kMeasuredCutoffPart") = kMeasuredCutoffPart;
  bp::scope().attr("kThinnedRate") = kThinnedRate;
  bp::scope().attr("kRoundedCutoff") = kRoundedCutoff;
  bp::scope().attr("kUnsureForce") = kUnsureForce;
  bp::scope().attr("kUnsureTorque") = kUnsureTorque;
  bp::def("findFrameRate", &findFrameRate, bp::arg("time"),
          "Frames per second, where times (T,) are evenly spaced, up to kEvenTimes of a step;\n"
          "else NaN [Hz].");
  bp::def("deriveMotion", &derive,
          (bp::arg("model"), bp::arg("recorded"), bp::arg("cutoff") = kAutomaticCutoff),
          "The DerivedMotion of a RecordedMotion: its own velocities and accelerations, if they\n"
          "agree with the configurations up to kVelocityMismatch and kAccelerationMismatch, else\n"
          "those of differentiate after filterConfigurations at the cut-off [Hz], or without a\n"
          "filter if that is 0. If it is kAutomaticCutoff, which is NaN, exact motions are not\n"
          "filtered, those that are so at kThinnedRate only at kRoundedCutoff, and all others at\n"
          "kMeasuredCutoff, or kMeasuredCutoffPart of the frame rate if that is lower: a motion\n"
          "is exact up to kExactNoise of its accelerations. Raises ValueError as Motion.validate, "
          "and if frames are to be\n"
          "filtered that are not evenly spaced, or with a cut-off that is out of range.");
  bp::def("rederiveMotion", &rederive,
          (bp::arg("model"), bp::arg("recorded"), bp::arg("cutoff") = kAutomaticCutoff),
          "As deriveMotion, whatever velocities and accelerations were recorded.");
}

}  // namespace dynacom::python
