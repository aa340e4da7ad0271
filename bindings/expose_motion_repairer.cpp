// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/motion_repairer.hpp"

namespace dynacom::python {

namespace {

std::string getOutcome(const MotionRepair& repair) { return to_string(repair.outcome); }

bp::list getStances(const MotionRepair& repair) { return toList(repair.stances); }
bp::list getSteps(const MotionRepair& repair) { return toList(repair.steps); }
bp::list getReasons(const MotionRepair& repair) { return toList(repair.reasons); }

std::string getRung(const RepairStep& step) { return to_string(step.rung); }

std::string writeChange(const RepairChange& change) {
  return internal::concat("RepairChange(rms=", change.rms, ", largest=", change.largest,
                          ", frame=", change.frame, ", joint='", change.joint, "')");
}

std::string writeStep(const RepairStep& step) {
  return internal::concat("RepairStep(rung='", to_string(step.rung), "', before=", step.before,
                          ", after=", step.after, ", is_kept=", step.is_kept ? "True" : "False",
                          ")");
}

std::string writeReason(const RepairReason& reason) {
  return internal::concat("RepairReason(code='", reason.code, "', time=", reason.time, ", text='",
                          reason.text, "')");
}

std::string writeFeet(const RepairedFeet& feet) {
  return internal::concat("RepairedFeet(speed=", feet.speed, ", drift=", feet.drift,
                          ", sunk=", feet.sunk, ", floating=", feet.floating, ")");
}

std::string writeRepair(const MotionRepair& repair) {
  return internal::concat("MotionRepair(outcome='", to_string(repair.outcome),
                          "', frames=", repair.change.cols(), ", missing=", repair.missing, ")");
}

std::string writeRepairer(const MotionRepairer& repairer) {
  const RepairerSettings& settings = repairer.getSettings();
  return internal::concat("MotionRepairer(strict=", settings.strict ? "True" : "False",
                          ", rounds=", settings.rounds,
                          ", largest_stretch=", settings.largest_stretch, ")");
}

std::shared_ptr<MotionRepairer> makeRepairer(const DynaCoM& robot, const MotionExaminer& examiner,
                                             const RepairSettings& repair, Truth strict,
                                             Integer rounds, Real largest_displacement,
                                             Real largest_turn, Real largest_stretch) {
  const RepairerSettings settings = {examiner.getSettings(), repair,       strict,         rounds,
                                     largest_displacement,   largest_turn, largest_stretch};
  return std::make_shared<MotionRepairer>(robot, settings);
}

std::shared_ptr<MotionRepair> repair(const MotionRepairer& repairer,
                                     const RecordedMotion& recorded) {
  const WithoutLock without_lock;
  return std::make_shared<MotionRepair>(repairer.repair(recorded));
}

}  // namespace

void exposeMotionRepairer() {
  bp::class_<RepairChange>("RepairChange", "How much something was changed.", bp::no_init)
      .def_readonly("rms", &RepairChange::rms, "Root mean square over the frames")
      .def_readonly("largest", &RepairChange::largest, "The largest")
      .def_readonly("frame", &RepairChange::frame, "Where that is")
      .def_readonly("joint", &RepairChange::joint, "Whose that is, of joints; else empty")
      .def(PrintVisitor<RepairChange>(&writeChange))
      .def(CopyVisitor<RepairChange>());

  bp::class_<RepairStep>("RepairStep", "What a rung of MotionRepairer's ladder has gained.",
                         bp::no_init)
      .add_property("rung", &getRung,
                    "'ground', 'filter', 'schedule', 'balance', 'feet', 'joints' or 'time'")
      .def_readonly("before", &RepairStep::before,
                    "For the ground, the height of what is stood on above it [m]; for the filter,\n"
                    "the root's displacement by it [m]; for the schedule, the\n"
                    "distance to a feasible motion [m]; for balance, frames whose wrench is not\n"
                    "within reach; for feet, the largest speed of a contact along the ground\n"
                    "[m/s]; for joints, how far one is beyond its limits [rad]; for time, the\n"
                    "factor")
      .def_readonly("after", &RepairStep::after, "The same, then")
      .def_readonly("is_kept", &RepairStep::is_kept,
                    "Whether its motion counts, or that of the rung before")
      .def(PrintVisitor<RepairStep>(&writeStep))
      .def(CopyVisitor<RepairStep>());

  bp::class_<RepairReason>("RepairReason", "Why a motion is not repaired.", bp::no_init)
      .def_readonly("code", &RepairReason::code,
                    "What is left: a fault's, or 'contact_needed', 'out_of_reach',\n"
                    "'joint_limits', 'feet_not_held', 'bound', 'not_better' or 'too_short'")
      .def_readonly("time", &RepairReason::time,
                    "Where it is worst [s]; NaN where it is of no frame")
      .def_readonly("text", &RepairReason::text, "In words")
      .def(PrintVisitor<RepairReason>(&writeReason))
      .def(CopyVisitor<RepairReason>());

  bp::class_<RepairedFeet>("RepairedFeet", "How the contacts of a robot stand.", bp::no_init)
      .def_readonly("speed", &RepairedFeet::speed,
                    "The largest of one along the ground, that of foot_sliding [m/s]")
      .def_readonly("drift", &RepairedFeet::drift,
                    "The largest distance of a part that carries from where it is on average in "
                    "its\nstance [m]; NaN where there is no stance")
      .def_readonly("sunk", &RepairedFeet::sunk, "How deep a part is below its ground at most [m]")
      .def_readonly("floating", &RepairedFeet::floating,
                    "How high one that carries is above it at most [m]")
      .def(PrintVisitor<RepairedFeet>(&writeFeet))
      .def(CopyVisitor<RepairedFeet>());

  bp::class_<MotionRepair, std::shared_ptr<MotionRepair>>(
      "MotionRepair", "What was made of a recorded motion, see MotionRepairer.", bp::no_init)
      .add_property("outcome", &getOutcome, "'feasible', 'repaired' or 'not repaired'")
      .def_readonly("before", &MotionRepair::before, "The MotionExamination of what was recorded")
      .def_readonly("recorded", &MotionRepair::recorded, "What came out, a RecordedMotion")
      .def_readonly("after", &MotionRepair::after, "The MotionExamination of that, unfiltered")
      .def_readonly("filtered", &MotionRepair::filtered,
                    "The same as who does not know that it is exact finds it")
      .add_property("change", &Rows<&MotionRepair::change>::get,
                    "Of the configurations, from those of before, (T, nv)")
      .def_readonly("root", &MotionRepair::root, "RepairChange of the root's place [m]")
      .def_readonly("turn", &MotionRepair::turn, "RepairChange of the root's orientation [rad]")
      .def_readonly("joint_excess_before", &MotionRepair::joint_excess_before,
                    "How far a joint was beyond its limits at most, or a step of it [rad]")
      .def_readonly("joint_excess", &MotionRepair::joint_excess, "How far one is now [rad]")
      .def_readonly("joints", &MotionRepair::joints, "RepairChange of joints that turn [rad]")
      .def_readonly("com", &MotionRepair::com, "RepairChange of the CoM's place [m]")
      .def_readonly("missing_before", &MotionRepair::missing_before,
                    "In how many judged frames contacts could not give what is needed, by more\n"
                    "than 0.001 m g or m g m")
      .def_readonly("missing", &MotionRepair::missing, "In how many they cannot now")
      .add_property("stances", &getStances, "A RepairedStance for each, of the last rung")
      .def_readonly("feet_before", &MotionRepair::feet_before,
                    "The RepairedFeet of before, where what carries in after does")
      .def_readonly("feet", &MotionRepair::feet, "The RepairedFeet of after")
      .def_readonly("ground_offset", &MotionRepair::ground_offset,
                    "By how much all of it was lifted, besides these changes [m]")
      .def_readonly("ground_tilt", &MotionRepair::ground_tilt,
                    "By how much all of it was turned before that, so that a slope is level [rad]")
      .def_readonly("stretch", &MotionRepair::stretch, "By which factor time was stretched")
      .add_property("steps", &getSteps, "A RepairStep for each rung")
      .add_property("reasons", &getReasons, "A RepairReason for all that is left")
      .def(PrintVisitor<MotionRepair>(&writeRepair))
      .def(CopyVisitor<MotionRepair>());

  const RepairerSettings defaults;
  bp::class_<MotionRepairer, std::shared_ptr<MotionRepairer>, boost::noncopyable>(
      "MotionRepairer",
      "Repairs recorded motions of one robot, a DynaCoM, which is copied: a ladder, whose rungs "
      "are\n"
      "climbed as far as they lead. Motions are filtered as for their verdict, and taken for "
      "exact\n"
      "from then on; wrenches are brought within reach by repairMotion, and contacts found once\n"
      "more in what came out, until all is solved, some rounds at most; then the same with\n"
      "feet and joints, and where feet cannot be held with joints alone, which count only if they\n"
      "leave wrenches within reach. See docs/repair.md.",
      bp::no_init)
      .def("__init__",
           bp::make_constructor(
               &makeRepairer, bp::default_call_policies(),
               (bp::arg("robot"), bp::arg("examiner"), bp::arg("repair") = RepairSettings(),
                bp::arg("strict") = defaults.strict, bp::arg("rounds") = defaults.rounds,
                bp::arg("largest_displacement") = defaults.largest_displacement,
                bp::arg("largest_turn") = defaults.largest_turn,
                bp::arg("largest_stretch") = defaults.largest_stretch)),
           "examiner: the MotionExaminer whose settings judge motions; repair: RepairSettings;\n"
           "strict: whether single frames are mended of motions that are feasible as a whole;\n"
           "rounds: how often a motion is repaired at most on each rung; a motion whose root has\n"
           "to be displaced farther than largest_displacement [m], or a joint turned by more than\n"
           "largest_turn [rad], is not said to be repaired; largest_stretch: by which factor time\n"
           "may be stretched where nothing else helps. Raises ValueError if one is out of its\n"
           "range, NotReadyError before the robot's initialize().")
      .def("repair", &repair, (bp::arg("self"), bp::arg("recorded")),
           "The MotionRepair of a RecordedMotion. Raises ValueError if the motion or its schedule\n"
           "is not valid, or the robot's root is no free-flyer.")
      .def(PrintVisitor<MotionRepairer>(&writeRepairer));
}

}  // namespace dynacom::python
