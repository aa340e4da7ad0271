// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/motion_verdict.hpp"

namespace dynacom::python {

namespace {

bp::dict getFindings(const MotionVerdict& verdict) {
  bp::dict findings;
  for (std::size_t k = 0; k < kMotionFaults; ++k)
    findings[to_string(static_cast<MotionFault>(k))] = verdict.findings[k];
  return findings;
}

std::string writeFinding(const MotionFinding& finding) {
  return internal::concat("MotionFinding(frames=", finding.frames, ", worst=", finding.worst,
                          ", time=", finding.time, ", holds=", finding.holds ? "True" : "False",
                          ")");
}

std::string writeVerdict(const MotionVerdict& verdict) {
  std::vector<std::string> codes;
  for (std::size_t k = 0; k < kMotionFaults; ++k)
    if (verdict.findings[k].holds) codes.emplace_back(to_string(static_cast<MotionFault>(k)));
  return internal::concat("MotionVerdict(feasible=", verdict.isFeasible() ? "True" : "False",
                          ", holding=", toText(codes), ")");
}

std::string writeLimit(const FaultLimit& limit) {
  return internal::concat("FaultLimit(limit=", limit.limit, ", allowed_share=", limit.allowed_share,
                          ")");
}

std::shared_ptr<FaultLimit> makeLimit(double limit, double allowed_share) {
  return std::make_shared<FaultLimit>(FaultLimit{limit, allowed_share});
}

MotionVerdict judge(const DynaCoM& robot, const Motion& motion, const RecordedMotion& recorded,
                    const bp::object& contacts, const Eigen::VectorXd& ground,
                    const MotionAnalysis& analysis, const VerdictSettings& settings, int threads) {
  const auto own_contacts = toVectorOf<ContactMotion>(contacts);
  const DynaCoM own_robot(robot);  // without the lock, others may change it and the settings
  const VerdictSettings own_settings(settings);
  const WithoutLock without_lock;
  return judgeMotion(own_robot, motion, recorded, own_contacts, ground, analysis, own_settings,
                     threads);
}

}  // namespace

void exposeMotionVerdict() {
  bp::class_<FaultLimit, std::shared_ptr<FaultLimit>>(
      "FaultLimit", "From where on a fault of a motion is one.", bp::no_init)
      .def("__init__", bp::make_constructor(&makeLimit, bp::default_call_policies(),
                                            (bp::arg("limit"), bp::arg("allowed_share"))))
      .def_readwrite("limit", &FaultLimit::limit, "Of what is measured in a frame")
      .def_readwrite("allowed_share", &FaultLimit::allowed_share,
                     "Of the frames, that may be beyond the limit")
      .def(bp::self == bp::self)
      .def(bp::self != bp::self)
      .def(PrintVisitor<FaultLimit>(&writeLimit))
      .def(CopyVisitor<FaultLimit>());

  using Settings = VerdictSettings;
  bp::class_<Settings>("VerdictSettings",
                       "The limits of all faults of a motion, see MotionVerdict.")
      .def_readwrite("residual_force", &Settings::residual_force, "[m g]")
      .def_readwrite("residual_torque", &Settings::residual_torque, "[m g m]")
      .def_readwrite("flight_with_support_needed", &Settings::flight_with_support_needed,
                     "[m g], [m g m]")
      .def_readwrite("contact_missing", &Settings::contact_missing, "[m g], [m g m]")
      .def_readwrite("ground_penetration", &Settings::ground_penetration, "[m]")
      .def_readwrite("foot_sliding", &Settings::foot_sliding, "[m/s]")
      .def_readwrite("discontinuity", &Settings::discontinuity, "[m], [rad]")
      .def_readwrite("quaternion", &Settings::quaternion, "Of the norm")
      .def_readwrite("near_ground", &Settings::near_ground,
                     "Up to which height above its ground a contact is just above it [m]")
      .def(SettingsVisitor<Settings>());

  bp::class_<MotionFinding>("MotionFinding", "What was found of one fault.", bp::no_init)
      .add_property("measured", getter(&MotionFinding::measured), "In each frame, (T,)")
      .def_readonly("frames", &MotionFinding::frames, "How many are beyond the limit")
      .def_readonly("worst", &MotionFinding::worst, "The largest measured")
      .def_readonly("time", &MotionFinding::time, "Of the first frame where that is [s]")
      .def_readonly("holds", &MotionFinding::holds,
                    "Whether more frames than allowed are beyond the limit")
      .def(PrintVisitor<MotionFinding>(&writeFinding))
      .def(CopyVisitor<MotionFinding>());

  bp::class_<MotionVerdict>(
      "MotionVerdict",
      "Whether a motion is feasible, and what speaks against it.\n\n"
      "residual_force, residual_torque: what the contacts cannot give;\n"
      "flight_with_support_needed: no contact is active, but something must be\n"
      "given; contact_missing: contacts just above the ground would give what is\n"
      "out of reach; ground_penetration: how deep a contact is below its ground;\n"
      "foot_sliding: how fast an active contact moves along it; discontinuity:\n"
      "how unlike its neighbours a step from frame to frame is; quaternion: how\n"
      "far the root's norm, as recorded, is from 1. Forces are parts of the\n"
      "weight m g, moments of m g times a metre.",
      bp::no_init)
      .add_property("findings", &getFindings, "A MotionFinding for each fault, by its code")
      .add_property("feasible", &MotionVerdict::isFeasible, "Whether no fault holds")
      .def(PrintVisitor<MotionVerdict>(&writeVerdict))
      .def(CopyVisitor<MotionVerdict>());

  bp::def(
      "judgeMotion", &judge,
      (bp::arg("robot"), bp::arg("motion"), bp::arg("recorded"), bp::arg("contacts"),
       bp::arg("ground"), bp::arg("analysis"), bp::arg("settings") = VerdictSettings(),
       bp::arg("threads") = 0),
      "Judges a motion, for which computeContactMotions, estimateGround and analyzeMotion have\n"
      "been called. recorded: the RecordedMotion before any filter, of which q and\n"
      "quaternion_error are looked at; threads as in analyzeMotion. Raises ValueError if settings\n"
      "or motion are not valid, or sizes differ.");
}

}  // namespace dynacom::python
