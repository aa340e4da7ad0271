// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/missing_support.hpp"

namespace dynacom::python {

namespace {

using Interval = MissingSupport::Interval;

bp::list getIntervals(const MissingSupport& missing) { return toList(missing.intervals); }

std::string writeInterval(const Interval& interval) {
  return internal::concat("MissingSupport.Interval(first=", interval.first,
                          ", last=", interval.last, ", begin=", interval.begin,
                          ", end=", interval.end, ")");
}

std::string writeMissing(const MissingSupport& missing) {
  return internal::concat("MissingSupport(intervals=", missing.intervals.size(),
                          ", frames=", missing.frames, ", force=", missing.force,
                          ", torque=", missing.torque, ", cop_distance=", missing.cop_distance,
                          ")");
}

bp::object find(const DynaCoM& robot, const MotionAnalysis& analysis, const MotionVerdict& verdict,
                const VerdictSettings& settings) {
  const auto missing = findMissingSupport(robot, analysis, verdict, settings);
  return missing ? bp::object(*missing) : bp::object();
}

}  // namespace

void exposeMissingSupport() {
  {
    const bp::scope missing =
        bp::class_<MissingSupport>(
            "MissingSupport",
            "When and by how much that which carries cannot give what a motion needs, see\n"
            "findMissingSupport.",
            bp::no_init)
            .add_property("intervals", &getIntervals, "A MissingSupport.Interval for each")
            .def_readonly("frames", &MissingSupport::frames, "In intervals")
            .def_readonly("share", &MissingSupport::share, "That these are of the motion's frames")
            .def_readonly(
                "force", &MissingSupport::force,
                "Largest norm of the residual's force over the frames of intervals whose\n"
                "accelerations are known [m g]")
            .def_readonly("torque", &MissingSupport::torque, "And of its moment [m g m]")
            .def_readonly(
                "cop_distance", &MissingSupport::cop_distance,
                "How far the centre of pressure is needed outside what carries there, at\n"
                "most [m]")
            .def(PrintVisitor<MissingSupport>(&writeMissing))
            .def(CopyVisitor<MissingSupport>());
    bp::class_<Interval>("Interval", "Frames that follow each other.", bp::no_init)
        .def_readonly("first", &Interval::first, "Frame")
        .def_readonly("last", &Interval::last, "The last frame")
        .def_readonly("begin", &Interval::begin, "Time of the first [s]")
        .def_readonly("end", &Interval::end, "Time of the last [s]")
        .def(PrintVisitor<Interval>(&writeInterval))
        .def(CopyVisitor<Interval>());
  }

  bp::def(
      "findMissingSupport", &find,
      (bp::arg("robot"), bp::arg("analysis"), bp::arg("verdict"),
       bp::arg("settings") = VerdictSettings()),
      "The MissingSupport of what analyzeMotion and, with the same settings, judgeMotion found:\n"
      "frames beyond the limit of a fault that is about forces, for settings.interruption and\n"
      "longer, but for interruptions that are shorter. None where nothing is missing or the\n"
      "outcome is 'unknown'. Raises ValueError if settings are not valid or sizes differ,\n"
      "NotReadyError before initialize().");
}

}  // namespace dynacom::python
