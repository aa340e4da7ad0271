// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/motion_statistics.hpp"

namespace dynacom::python {

namespace {

using Statistics = MotionStatistics;

bp::dict getStatuses(const Statistics& statistics) {
  bp::dict statuses;
  for (const auto& [status, frames] : statistics.statuses) statuses[status] = frames;
  return statuses;
}

bp::list getContacts(const Statistics& statistics) { return toList(statistics.contacts); }

bp::list getBodies(const Statistics& statistics) { return toList(statistics.bodies); }

std::string writeStatistics(const Statistics& statistics) {
  return internal::concat("MotionStatistics(frames=", statistics.frames,
                          ", mean_vertical_force=", statistics.mean_vertical_force,
                          ", residual_force_rms=", statistics.residual_force_rms,
                          ", residual_torque_rms=", statistics.residual_torque_rms, ")");
}

std::string writeContact(const ContactStatistics& contact) {
  return internal::concat("ContactStatistics(name='", contact.name,
                          "', active_share=", contact.active_share,
                          ", weight_share=", contact.weight_share, ")");
}

std::shared_ptr<BodyStatistics> makeBody(const std::string& link, Real active_share,
                                         Real weight_share, Real largest_vertical_force) {
  return std::make_shared<BodyStatistics>(
      BodyStatistics{link, active_share, weight_share, largest_vertical_force});
}

std::string writeBody(const BodyStatistics& body) {
  return internal::concat("BodyStatistics(link='", body.link, "', active_share=", body.active_share,
                          ", weight_share=", body.weight_share, ")");
}

std::string writeDifference(const MeasuredDifference& difference) {
  return internal::concat("MeasuredDifference(frames=", difference.frames,
                          ", bias=", toText(difference.bias), ", rms=", toText(difference.rms),
                          ", correlation=", toText(difference.correlation), ")");
}

MeasuredDifference compare(const Eigen::MatrixXd& computed, const Eigen::MatrixXd& measured) {
  return compareMeasured(computed.transpose(), measured.transpose());
}

}  // namespace

void exposeMotionStatistics() {
  bp::class_<ContactStatistics>("ContactStatistics",
                                "What one contact does in a motion as a whole. Forces are parts of "
                                "the\nweight m g; NaN stands for what does not exist.",
                                bp::no_init)
      .def_readonly("name", &ContactStatistics::name, "The name under which the robot knows it.")
      .def_readonly("active_share", &ContactStatistics::active_share, "Of the frames")
      .def_readonly("weight_share", &ContactStatistics::weight_share,
                    "Mean of its vertical force [m g]")
      .def_readonly("weight_share_while_active", &ContactStatistics::weight_share_while_active,
                    "The same over the frames where it is active [m g]")
      .def_readonly("largest_vertical_force", &ContactStatistics::largest_vertical_force, "[m g]")
      .def_readonly("largest_friction_usage", &ContactStatistics::largest_friction_usage,
                    "1 on the friction pyramid")
      .def_readonly("largest_cone_usage", &ContactStatistics::largest_cone_usage,
                    "1 on the friction cone, see computeConeUsage")
      .def_readonly("least_cop_margin", &ContactStatistics::least_cop_margin,
                    "Distance of its centre of pressure to the nearest edge [m]")
      .def(PrintVisitor<ContactStatistics>(&writeContact))
      .def(CopyVisitor<ContactStatistics>());

  bp::class_<BodyStatistics, std::shared_ptr<BodyStatistics>>(
      "BodyStatistics",
      "What a link does in a motion as a whole that touches something "
      "besides the\ncontacts. Forces are parts of the weight m g.",
      bp::no_init)
      .def("__init__",
           bp::make_constructor(&makeBody, bp::default_call_policies(),
                                (bp::arg("link"), bp::arg("active_share"), bp::arg("weight_share"),
                                 bp::arg("largest_vertical_force"))))
      .def_readonly("link", &BodyStatistics::link, "Its name")
      .def_readonly("active_share", &BodyStatistics::active_share, "Of the frames")
      .def_readonly("weight_share", &BodyStatistics::weight_share,
                    "Mean of its vertical force [m g]")
      .def_readonly("largest_vertical_force", &BodyStatistics::largest_vertical_force, "[m g]")
      .def(PrintVisitor<BodyStatistics>(&writeBody))
      .def(CopyVisitor<BodyStatistics>());

  bp::class_<Statistics>("MotionStatistics",
                         "A motion in a few numbers. Forces are parts of the weight m g, moments\n"
                         "of m g times a metre, unless they say otherwise.",
                         bp::no_init)
      .def_readonly("frames", &Statistics::frames, "T")
      .def_readonly("mass", &Statistics::mass, "Of the robot [kg]")
      .def_readonly("weight", &Statistics::weight,
                    "m g, of standard gravity where there is none [N]")
      .add_property("statuses", &getStatuses, "DistributionStatus -> how many frames have it")
      .def_readonly("mean_vertical_force", &Statistics::mean_vertical_force,
                    "Of the ground's; 1 for a motion that begins and ends at rest [m g]")
      .def_readonly("momentum_change", &Statistics::momentum_change,
                    "What part of that ends in momentum: a clip may begin in a fall [m g]")
      .def_readonly("residual_force_rms", &Statistics::residual_force_rms,
                    "Root mean square of the residual's force [m g]")
      .def_readonly("residual_torque_rms", &Statistics::residual_torque_rms,
                    "And of its moment about the centre of mass [m g m]")
      .add_property("mean_residual", getter(&Statistics::mean_residual),
                    "Force [N] and moment [N m] over the frames in which a contact is active and\n"
                    "accelerations are known, (6,): forward, left and up, as the free-flyer's\n"
                    "heading has it")
      .add_property("contacts", &getContacts, "A ContactStatistics for each contact")
      .add_property("bodies", &getBodies,
                    "A BodyStatistics for each link that touches something besides these")
      .def_readonly("bodies_active_share", &Statistics::bodies_active_share,
                    "Of the frames, in which any of these links is active")
      .def_readonly("bodies_weight_share_while_active",
                    &Statistics::bodies_weight_share_while_active,
                    "Mean over these frames of the vertical force of all of them [m g]")
      .def("mayBeLoad", &Statistics::mayBeLoad, bp::arg("self"),
           "Whether the mean residual may be that of a load which nobody has told of: it is large\n"
           "enough, and much the same all the time, but no larger than what is carried, and pulls\n"
           "along the ground by no more than a load does. Not where a number is NaN.")
      .def("share", &Statistics::share, (bp::arg("self"), bp::arg("status")),
           "Which part of the frames has a DistributionStatus.")
      .def(PrintVisitor<Statistics>(&writeStatistics))
      .def(CopyVisitor<Statistics>());

  bp::class_<MeasuredDifference>("MeasuredDifference",
                                 "How computed values differ from measured ones, component by "
                                 "component;\nsee compareMeasured.",
                                 bp::no_init)
      .def_readonly("frames", &MeasuredDifference::frames,
                    "In which all that was measured is finite; without any, all else is NaN")
      .add_property("bias", getter(&MeasuredDifference::bias), "Mean of computed - measured, (n,)")
      .add_property("rms", getter(&MeasuredDifference::rms), "Root mean square of that, (n,)")
      .add_property("correlation", getter(&MeasuredDifference::correlation),
                    "Pearson's, (n,); NaN where one of both does not change")
      .def(PrintVisitor<MeasuredDifference>(&writeDifference))
      .def(CopyVisitor<MeasuredDifference>());

  bp::def("summarizeMotion", &summarizeMotion,
          (bp::arg("robot"), bp::arg("motion"), bp::arg("analysis"), bp::arg("verdict")),
          "The MotionStatistics of what analyzeMotion and judgeMotion found. Raises ValueError if\n"
          "sizes differ.");
  bp::def("computeConeUsage", &computeConeUsage, bp::arg("contact"),
          "How much of its friction cone a contact, a MotionAnalysis.Contact, uses in each frame,\n"
          "(T,): |(f_x, f_y)| over mu f_z, 1 on the cone. The friction pyramid around it allows\n"
          "sqrt(2) on its diagonals. NaN, infinite and zero where friction_usage is.");
  bp::def("compareMeasured", &compare, (bp::arg("computed"), bp::arg("measured")),
          "The MeasuredDifference of forces (T, n). Raises ValueError if sizes differ.");
}

}  // namespace dynacom::python
