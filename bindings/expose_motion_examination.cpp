// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/motion_examination.hpp"

namespace dynacom::python {

namespace {

using Examination = MotionExamination;

bp::list getParts(const Examination& examination) { return toList(examination.parts); }

bp::list getLinks(const Examination& examination) { return toList(examination.links); }

bp::object getInferred(const Examination& examination) {
  return examination.inferred ? bp::object(*examination.inferred) : bp::object();
}

bp::object getMissingSupport(const Examination& examination) {
  return examination.missing_support ? bp::object(*examination.missing_support) : bp::object();
}

bp::object getDistance(const Examination& examination) {
  return examination.distance ? bp::object(*examination.distance) : bp::object();
}

bp::list getSeats(const Examination& examination) { return toList(examination.seats); }

std::shared_ptr<Seat> makeSeat(const std::string& link, Eigen::Index first, Eigen::Index behind,
                               Real height, Real weight_share) {
  return std::make_shared<Seat>(Seat{link, first, behind, height, weight_share});
}

std::string writeSeat(const Seat& seat) {
  return internal::concat("Seat(link='", seat.link, "', first=", seat.first,
                          ", behind=", seat.behind, ", height=", seat.height,
                          ", weight_share=", seat.weight_share, ")");
}

bp::list getSensitivity(const Examination& examination) { return toList(examination.sensitivity); }

std::string writeExamination(const Examination& examination) {
  return internal::concat("MotionExamination(frames=", examination.statistics.frames,
                          ", feasible=", examination.verdict.isFeasible() ? "True" : "False", ")");
}

std::string writeSensitivity(const CutoffSensitivity& sensitivity) {
  return internal::concat("CutoffSensitivity(cutoff=", sensitivity.cutoff,
                          ", feasible=", sensitivity.verdict.isFeasible() ? "True" : "False", ")");
}

std::string writeExaminer(const MotionExaminer& examiner) {
  const ExaminationSettings& settings = examiner.getSettings();
  return internal::concat("MotionExaminer(cutoff=", settings.cutoff,
                          ", sensitivity=", settings.sensitivity ? "True" : "False",
                          ", threads=", settings.analysis.threads, ")");
}

std::shared_ptr<MotionExaminer> makeExaminer(
    const DynaCoM& robot, Real cutoff, Truth flat_horizontal_ground, Real omega,
    const DetectionSettings& detection, const VerdictSettings& verdict, Truth sensitivity,
    const bp::object& progress, Integer threads, Integer lanes, const bp::object& bodies,
    Truth distance, const CentroidalFilterSettings& filter, FrictionModel friction) {
  const AnalysisSettings analysis = {flat_horizontal_ground, omega, nullptr, threads, lanes};
  const ExaminationSettings settings = {cutoff,      analysis,
                                        detection,   verdict,
                                        friction,    toVectorOf<BodyPoints>(bodies),
                                        distance,    filter,
                                        sensitivity, toProgress<double>(progress)};
  return std::make_shared<MotionExaminer>(robot, settings);
}

// Not by value: what Python is given that way is copied.
std::shared_ptr<Examination> examine(const MotionExaminer& examiner,
                                     const RecordedMotion& recorded) {
  const WithoutLock without_lock;
  return std::make_shared<Examination>(examiner.examine(recorded));
}

}  // namespace

void exposeMotionExamination() {
  bp::class_<CutoffSensitivity>("CutoffSensitivity",
                                "What another cut-off frequency would have led to.", bp::no_init)
      .def_readonly("cutoff", &CutoffSensitivity::cutoff, "[Hz]")
      .def_readonly("verdict", &CutoffSensitivity::verdict, "The MotionVerdict")
      .def_readonly("statistics", &CutoffSensitivity::statistics, "The MotionStatistics")
      .def(PrintVisitor<CutoffSensitivity>(&writeSensitivity))
      .def(CopyVisitor<CutoffSensitivity>());

  bp::class_<Seat, std::shared_ptr<Seat>>(
      "Seat",
      "A link that is held still high above all ground that is known while contacts\n"
      "cannot give what the motion needs, and that could give the rest. Its force\n"
      "counts nowhere.",
      bp::no_init)
      .def("__init__", bp::make_constructor(&makeSeat, bp::default_call_policies(),
                                            (bp::arg("link"), bp::arg("first"), bp::arg("behind"),
                                             bp::arg("height"), bp::arg("weight_share"))))
      .def_readonly("link", &Seat::link, "Its name")
      .def_readonly("first", &Seat::first, "Frame")
      .def_readonly("behind", &Seat::behind, "The frame after the last")
      .def_readonly("height", &Seat::height, "Of its lowest point [m]")
      .def_readonly("weight_share", &Seat::weight_share,
                    "Mean vertical force that it would have to give [m g]")
      .def(PrintVisitor<Seat>(&writeSeat))
      .def(CopyVisitor<Seat>());

  bp::class_<Examination, std::shared_ptr<Examination>>(
      "MotionExamination", "All that was found of a recorded motion, see MotionExaminer.",
      bp::no_init)
      .def_readonly("derived", &Examination::derived, "The DerivedMotion")
      .add_property("contacts", &Elements<&Examination::contacts>::get,
                    "A ContactMotion for each contact, with velocities relative to the ground")
      .add_property("links", &getLinks,
                    "The BodyPoints of each link that was looked at, if one carries; parts are\n"
                    "those of splitContacts with these")
      .add_property("parts", &getParts, "A PartRobot.Part for each part of the contacts")
      .add_property("part_motions", &Elements<&Examination::part_motions>::get,
                    "The same of each of them")
      .def_readonly("inference", &Examination::inference, "The ContactInference, of the parts")
      .add_property("ground", &Rows<&Examination::ground>::get,
                    "Height of the ground under each contact's lowest part, (T, C) [m]; NaN where\n"
                    "there is none")
      .def_readonly("schedule", &Examination::schedule, "The ContactSchedule of the contacts")
      .add_property("inferred", &getInferred,
                    "What inference finds on its own, where contacts were recorded; else None")
      .add_property("disagreement", getter(&Examination::disagreement),
                    "In which share of the frames each contact is otherwise there, (C,); (0,)\n"
                    "where contacts were not recorded")
      .def_readonly("terrain", &Examination::terrain, "The Terrain")
      .def_readonly("bodies", &Examination::bodies,
                    "The ContactSchedule of the links that carry at some time, by name")
      .add_property("seats", &getSeats,
                    "A Seat for each time in which a link may rest on what nothing is known of")
      .def_readonly("analysis", &Examination::analysis, "The MotionAnalysis")
      .def_readonly("verdict", &Examination::verdict, "The MotionVerdict")
      .add_property("missing_support", &getMissingSupport,
                    "The MissingSupport, or None where nothing is missing or can be said")
      .add_property("distance", &getDistance,
                    "The CentroidalChange to a feasible motion, or None where nobody asked for it\n"
                    "or nothing can be said")
      .def_readonly("statistics", &Examination::statistics, "The MotionStatistics")
      .add_property("sensitivity", &getSensitivity,
                    "A CutoffSensitivity for half, and for twice the cut-off")
      .def(PrintVisitor<Examination>(&writeExamination))
      .def(CopyVisitor<Examination>());

  const ExaminationSettings defaults;
  bp::class_<MotionExaminer, std::shared_ptr<MotionExaminer>>(
      "MotionExaminer",
      "Judges recorded motions of one robot, a DynaCoM, which is copied: deriveMotion,\n"
      "computeContactMotions, inferContacts for the contacts' parts, analyzeMotion, gatherParts,\n"
      "findTerrain, judgeMotion, distanceToFeasible, findMissingSupport and summarizeMotion, one "
      "after the other. The\n"
      "ground that the centre of pressure lies on is the mean of those that are stood on. "
      "Threads,\n"
      "solvers and storage are kept from one motion to the next.",
      bp::no_init)
      .def(
          "__init__",
          bp::make_constructor(
              &makeExaminer, bp::default_call_policies(),
              (bp::arg("robot"), bp::arg("cutoff") = defaults.cutoff,
               bp::arg("flatHorizontalGround") = defaults.analysis.flat_horizontal_ground,
               bp::arg("omega") = defaults.analysis.omega,
               bp::arg("detection") = defaults.detection, bp::arg("verdict") = defaults.verdict,
               bp::arg("sensitivity") = defaults.sensitivity, bp::arg("progress") = bp::object(),
               bp::arg("threads") = defaults.analysis.threads,
               bp::arg("lanes") = defaults.analysis.lanes, bp::arg("bodies") = bp::list(),
               bp::arg("distance") = defaults.distance, bp::arg("filter") = defaults.filter,
               bp::arg("friction") = defaults.friction)),
          "cutoff: of the filter where derivatives have to be computed, 0 for none [Hz];\n"
          "sensitivity: whether to judge motions with half and twice the cut-off, too; progress:\n"
          "called now and then with what part of the frames is analysed; bodies: BodyPoints of\n"
          "links that may touch the ground where contacts do not suffice, of "
          "findCollisionPoints():\n"
          "dynacom.analyze gives them, and without them nobody kneels or lies; distance:\n"
          "whether to find how far motions are from feasible ones, by distanceToFeasible with the\n"
          "settings of filter; friction: FrictionModel of contacts that are outer pyramids, as\n"
          "they are unless they say otherwise, and of links; the others as in the functions named "
          "above. Raises ValueError if "
          "one is out of its range, NotReadyError\n"
          "before the robot's initialize().")
      .def("examine", &examine, (bp::arg("self"), bp::arg("recorded")),
           "The MotionExamination of a RecordedMotion, whatever was examined before. Raises\n"
           "ValueError if the motion or its schedule is not valid.")
      .def(PrintVisitor<MotionExaminer>(&writeExaminer))
      .def(CopyVisitor<MotionExaminer>());
}

}  // namespace dynacom::python
