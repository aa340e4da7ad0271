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

bp::dict describeFaults() {
  bp::dict faults;
  for (std::size_t k = 0; k < kMotionFaults; ++k) {
    const auto fault = static_cast<MotionFault>(k);
    faults[to_string(fault)] = bp::make_tuple(getUnit(fault), getMeaning(fault));
  }
  return faults;
}

bp::list getWindows(const MotionVerdict& verdict) { return toList(verdict.windows); }

bp::list getNormals(const MotionVerdict& verdict) { return toList(verdict.normals); }

bp::list getCodes(const MotionVerdict& verdict) { return toList(verdict.getCodes()); }

std::string getOutcome(const MotionVerdict& verdict) { return to_string(verdict.outcome); }

bp::object getUnsure(const MotionVerdict& verdict) {
  return bp::object(Eigen::Matrix<bool, Eigen::Dynamic, 1>(verdict.unsure.matrix()));
}

std::string writeWindow(const MotionWindow& window) {
  return internal::concat("MotionWindow(first=", window.first, ", last=", window.last,
                          ", begin=", window.begin, ", end=", window.end, ")");
}

std::string writeNormal(const ContactNormal& normal) {
  return internal::concat("ContactNormal(up=", normal.up,
                          ", downward_share=", normal.downward_share, ")");
}

std::string writeFinding(const MotionFinding& finding) {
  return internal::concat("MotionFinding(frames=", finding.frames, ", worst=", finding.worst,
                          ", time=", finding.time, ", holds=", finding.holds ? "True" : "False",
                          ", subject='", finding.subject, "')");
}

std::string writeVerdict(const MotionVerdict& verdict) {
  return internal::concat("MotionVerdict(outcome='", to_string(verdict.outcome),
                          "', codes=", toText(verdict.getCodes()),
                          ", feasible_share=", verdict.feasible_share, ")");
}

std::string writeLimit(const FaultLimit& limit) {
  return internal::concat("FaultLimit(limit=", limit.limit, ", allowed_share=", limit.allowed_share,
                          ")");
}

std::shared_ptr<FaultLimit> makeLimit(Real limit, Real allowed_share) {
  return std::make_shared<FaultLimit>(FaultLimit{limit, allowed_share});
}

MotionVerdict judge(const DynaCoM& robot, const Motion& motion, const RecordedMotion& recorded,
                    const bp::object& contacts, const Eigen::MatrixXd& ground,
                    const MotionAnalysis& analysis, const VerdictSettings& settings,
                    Integer threads, const bp::object& unsure) {
  const auto own_contacts = toVectorOf<ContactMotion>(contacts);
  const DynaCoM own_robot(robot);  // without the lock, others may change it and the settings
  const VerdictSettings own_settings(settings);
  // A vector, a height for each contact, comes as a column; else there is a row per frame.
  const bool is_vector =
      ground.cols() == 1 && !(own_contacts.size() == 1 && ground.rows() == motion.frames());
  const Eigen::MatrixXd heights = is_vector ? ground : ground.transpose();
  Eigen::Array<bool, Eigen::Dynamic, 1> unknown;
  if (!unsure.is_none())
    unknown = bp::extract<Eigen::Matrix<bool, Eigen::Dynamic, 1>>(unsure)().array();
  const WithoutLock without_lock;
  return judgeMotion(own_robot, motion, recorded, own_contacts, heights, analysis, own_settings,
                     threads, unknown);
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
      .def_readwrite("downward_normal", &Settings::downward_normal, "[rad]")
      .def_readwrite("residual_force", &Settings::residual_force, "[m g]")
      .def_readwrite("residual_torque", &Settings::residual_torque, "[m g m]")
      .def_readwrite("cop_outside", &Settings::cop_outside, "[m]")
      .def_readwrite("flight_with_support_needed", &Settings::flight_with_support_needed,
                     "[m g], [m g m]")
      .def_readwrite("ground_penetration", &Settings::ground_penetration, "[m]")
      .def_readwrite("foot_sliding", &Settings::foot_sliding, "[m/s]")
      .def_readwrite("discontinuity", &Settings::discontinuity, "Of the greatest speed")
      .def_readwrite("cop_force", &Settings::cop_force,
                     "The least vertical force for a centre of pressure to be looked at [m g]")
      .def_readwrite("linear_speed", &Settings::linear_speed,
                     "The greatest speed of the root and of prismatic joints [m/s]")
      .def_readwrite("turning_speed", &Settings::turning_speed,
                     "The greatest speed at which the root turns [rad/s]")
      .def_readwrite("joint_speed", &Settings::joint_speed, "The greatest speed of joints [rad/s]")
      .def_readwrite("jump_time", &Settings::jump_time,
                     "Frames so close to a jump are unsure, as are two at either side at least [s]")
      .def_readwrite("minimal_window", &Settings::minimal_window,
                     "How long a window is at least [s]")
      .def_readwrite("interruption", &Settings::interruption,
                     "Interruptions of a window that are shorter are none where there is as much\n"
                     "time without fault before and after them [s]")
      .def_readwrite("repairable_distance", &Settings::repairable_distance,
                     "A motion is repairable up to this distance to feasible, root mean square [m]")
      .def_readwrite("repairable_depth", &Settings::repairable_depth,
                     "As long as no contact is deeper below its ground [m]")
      .def_readwrite("repairable_slide", &Settings::repairable_slide,
                     "Or slides farther in a row of frames [m]")
      .def_readwrite("repairable_largest_distance", &Settings::repairable_largest_distance,
                     "And up to this largest one [m]")
      .def(SettingsVisitor<Settings>());

  bp::class_<MotionFinding>("MotionFinding", "What was found of one fault.", bp::no_init)
      .add_property("measured", getter(&MotionFinding::measured), "In each frame, (T,)")
      .def_readonly("frames", &MotionFinding::frames, "How many are beyond the limit")
      .def_readonly("worst", &MotionFinding::worst, "The largest measured")
      .def_readonly("time", &MotionFinding::time, "Of the first frame where that is [s]")
      .def_readonly("holds", &MotionFinding::holds,
                    "Whether more frames than allowed are beyond the limit")
      .def_readonly(
          "subject", &MotionFinding::subject,
          "Whose the worst is: a contact, a joint, 'root', \"root's orientation\"; else ''")
      .def(PrintVisitor<MotionFinding>(&writeFinding))
      .def(CopyVisitor<MotionFinding>());

  bp::class_<MotionWindow>("MotionWindow",
                           "A part of a motion, long enough, without a frame beyond the limit of\n"
                           "any fault, but for short interruptions.",
                           bp::no_init)
      .def_readonly("first", &MotionWindow::first, "Its first frame")
      .def_readonly("last", &MotionWindow::last, "Its last frame")
      .def_readonly("begin", &MotionWindow::begin, "Time of the first [s]")
      .def_readonly("end", &MotionWindow::end, "Time of the last [s]")
      .def(PrintVisitor<MotionWindow>(&writeWindow))
      .def(CopyVisitor<MotionWindow>());

  bp::class_<ContactNormal>("ContactNormal",
                            "Where a contact's normal points while the contact is active; NaN if\n"
                            "it never is.",
                            bp::no_init)
      .def_readonly("up", &ContactNormal::up, "Mean of its vertical component, 1 for up")
      .def_readonly("downward_share", &ContactNormal::downward_share,
                    "Of the frames in which the contact is active, where it points down")
      .def(PrintVisitor<ContactNormal>(&writeNormal))
      .def(CopyVisitor<ContactNormal>());

  bp::class_<MotionVerdict>(
      "MotionVerdict",
      "Whether a motion is feasible, and what speaks against it.\n\n"
      "downward_normal: how far below the horizontal an active contact's normal points [rad];\n"
      "residual_force, residual_torque: what the contacts cannot give; cop_outside: how\n"
      "far the centre of pressure that is needed lies outside what carries;\n"
      "flight_with_support_needed: no contact is active, but something must be given;\n"
      "ground_penetration: how deep a contact is below its ground; foot_sliding: how\n"
      "fast an active contact moves along it; discontinuity: how fast the root or a\n"
      "joint is from frame to frame, as a part of its greatest speed. Forces are parts\n"
      "of the weight m g, moments of m g times a metre.",
      bp::no_init)
      .add_property("findings", &getFindings, "A MotionFinding for each fault, by its code")
      .add_property("feasible", &MotionVerdict::isFeasible, "Whether that is the outcome")
      .add_property("outcome", &getOutcome, "'feasible', 'repairable', 'not feasible' or 'unknown'")
      .add_property("codes", &getCodes,
                    "Of the faults that hold; else 'feasible', or 'too_short' alone where the\n"
                    "outcome is unknown")
      .add_property("unsure", &getUnsure,
                    "Frames whose accelerations are not known, (T,) of bool: those given, and\n"
                    "those near jumps")
      .add_property("windows", &getWindows, "A MotionWindow for each")
      .add_property(
          "severity", &MotionVerdict::getSeverity,
          "The largest share of frames beyond the limit of a fault that holds; 0 if none\n"
          "does")
      .def_readonly("feasible_share", &MotionVerdict::feasible_share,
                    "Of the frames, that are in windows")
      .add_property("normals", &getNormals, "A ContactNormal for each contact")
      .def(PrintVisitor<MotionVerdict>(&writeVerdict))
      .def(CopyVisitor<MotionVerdict>());

  bp::scope().attr("kMinimalFrames") = kMinimalFrames;
  bp::def("describeFaults", &describeFaults,
          "What may be wrong with a motion: a fault's code -> its unit, and what it means.");
  bp::def(
      "judgeMotion", &judge,
      (bp::arg("robot"), bp::arg("motion"), bp::arg("recorded"), bp::arg("contacts"),
       bp::arg("ground"), bp::arg("analysis"), bp::arg("settings") = VerdictSettings(),
       bp::arg("threads") = 0, bp::arg("unsure") = bp::object()),
      "Judges a motion, for which computeContactMotions, inferContacts and analyzeMotion have\n"
      "been called. recorded: the RecordedMotion before any filter, in whose q jumps are looked\n"
      "for, and whose v and a say whether the motion's are recorded ones: if not, fewer than\n"
      "kMinimalFrames frames are unknown; ground: height under each contact, (C,) or (T, C) [m],\n"
      "NaN where it is not known; threads as in analyzeMotion; unsure: frames whose accelerations\n"
      "are not known, (T,) of bool. Raises ValueError if settings or motion are not valid, or\n"
      "sizes differ.");
}

}  // namespace dynacom::python
