// SPDX-License-Identifier: BSD-2-Clause
#include <map>
#include <string>

#include "bindings.hpp"
#include "dynacom/centroidal_filter.hpp"

namespace dynacom::python {

namespace {

using Settings = CentroidalFilterSettings;

const char* getMeaning(const std::string& field) {
  static const std::map<std::string, const char*> all = {
      {"com", "The displacement of the CoM that costs 1 in a second [m]"},
      {"com_acceleration", "The change of its acceleration that costs 1 in a second [m/s^2]"},
      {"angular_momentum",
       "The change of the angular momentum about it that costs 1 in a second [m g m s]"},
      {"reach",
       "Iterations end where contacts lack no more than this, root mean square [m g, m g m]"},
      {"change",
       "Iterations end where the displacement changes by no more than this part of itself"},
      {"maximal_iterations", "Iterations end after so many in any case"},
      {"window", "What is longer is filtered in windows of this length [s]"},
      {"overlap", "Windows take in so much before and behind them [s]"},
  };
  return all.at(field);
}

std::string writeChange(const CentroidalChange& change) {
  return internal::concat("CentroidalChange(frames=", change.com.cols(), ", rms=", change.rms,
                          ", largest=", change.largest, ", frame=", change.frame,
                          ", converged=", change.converged ? "True" : "False", ")");
}

CentroidalChange find(const PartRobot& parts, const bp::object& motions,
                      const MotionAnalysis& dynamics, const ContactSchedule& schedule,
                      const Settings& settings, const bp::object& free, Integer threads) {
  const auto own_motions = toVectorOf<ContactMotion>(motions);
  Eigen::Array<bool, Eigen::Dynamic, 1> free_frames;
  if (!free.is_none())
    free_frames = bp::extract<Eigen::Matrix<bool, Eigen::Dynamic, 1>>(free)().array();
  const WithoutLock unlocked;
  return distanceToFeasible(parts, own_motions, dynamics, schedule, settings, free_frames, threads);
}

}  // namespace

void exposeCentroidalFilter() {
  bp::class_<Settings> settings("CentroidalFilterSettings",
                                "What changes of a motion cost in distanceToFeasible, and how "
                                "exactly the cheapest is found.");
  for (const auto& [name, field] : Settings::fields())
    settings.add_property(name, bp::make_getter(field), bp::make_setter(field), getMeaning(name));
  settings.def(SettingsVisitor<Settings>());

  bp::class_<CentroidalChange>(
      "CentroidalChange",
      "The smallest change of a motion after which its contacts can give what it needs.",
      bp::no_init)
      .add_property("com", &Rows<&CentroidalChange::com>::get,
                    "Displacement of the CoM in the world, (T, 3) [m]")
      .add_property("angular_momentum", &Rows<&CentroidalChange::angular_momentum>::get,
                    "Change of the angular momentum about the CoM, (T, 3) [N m s]")
      .add_property("residual", &Rows<&CentroidalChange::residual>::get,
                    "What contacts cannot give even so, force and moment about the CoM of before,\n"
                    "(T, 6) [N, N m]")
      .def_readonly("rms", &CentroidalChange::rms,
                    "Root mean square of the displacement: the distance to feasible [m]")
      .def_readonly("largest", &CentroidalChange::largest, "Largest displacement [m]")
      .def_readonly("frame", &CentroidalChange::frame, "The first with the largest displacement")
      .def_readonly("iterations", &CentroidalChange::iterations, "The most of a window")
      .def_readonly("converged", &CentroidalChange::converged,
                    "Whether all windows are as exact as the settings say")
      .def(PrintVisitor<CentroidalChange>(&writeChange))
      .def(CopyVisitor<CentroidalChange>());

  bp::def(
      "distanceToFeasible", &find,
      (bp::arg("parts"), bp::arg("motions"), bp::arg("dynamics"), bp::arg("schedule"),
       bp::arg("settings") = Settings(), bp::arg("free") = bp::object(), bp::arg("threads") = 0),
      "How far a motion is from a feasible one: the CentroidalChange d(t) of the CoM's path and\n"
      "h(t) of the angular momentum about it that minimises the integral of\n"
      "|d|^2/com^2 + |d''|^2/com_acceleration^2 + |h|^2/angular_momentum^2 while contacts can\n"
      "give the wrench of each frame, (f + m d'', tau + h' + d x (f + m d'')) about the CoM of\n"
      "before. By the alternating direction method of multipliers (Boyd et al. 2011).\n"
      "parts: of splitContacts; motions: of computeContactMotions for parts.robot; dynamics: of\n"
      "analyzeMotion for it; schedule: of the parts; free: (T,), frames of which nothing is\n"
      "asked; threads: as in analyzeMotion. Raises ValueError if settings are not valid, the\n"
      "schedule names a part that there is not, sizes differ, numbers are not finite, or there\n"
      "are more than 32 parts.");
}

}  // namespace dynacom::python
