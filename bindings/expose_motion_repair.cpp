// SPDX-License-Identifier: BSD-2-Clause
#include <map>
#include <string>

#include "bindings.hpp"
#include "dynacom/motion_repair.hpp"

namespace dynacom::python {

namespace {

using Settings = RepairSettings;

const char* getMeaning(const std::string& field) {
  static const std::map<std::string, const char*> all = {
      {"displacement",
       "The displacement of the root and of joints that slide that costs 1 in a second [m]"},
      {"turn", "The turn of the root and of joints that costs 1 in a second [rad]"},
      {"linear_acceleration",
       "The change of the acceleration of what is displaced that costs 1 in a second [m/s^2]"},
      {"angular_acceleration",
       "The change of the acceleration of what turns that costs 1 in a second [rad/s^2]"},
      {"friction_margin", "Which part of the friction is left unused"},
      {"support_margin", "How far inside what carries wrenches press [m]"},
      {"held_point", "An active part that is so far from its place costs 1 in a second [m]"},
      {"largest_drift", "Contacts that drift by no more than this in a stance are held still [m]"},
      {"slide_speed", "Contacts that drift by more slide no faster than this [m/s]"},
      {"largest_shift", "By how much contacts are displaced for that at most [m]"},
      {"clearance", "How high above the ground contacts that do not carry are at least [m]"},
      {"joint_margin", "How far within their ranges joints stay [rad], [m]"},
      {"speed_margin", "Which part of the speeds of joints is left unused"},
      {"feet", "Whether contacts stand still, level with their ground, and parts keep above it"},
      {"joints", "Whether joints keep within their positions and velocities"},
      {"pinned_ends", "Whether the first and the last configuration stay as they are"},
      {"window", "Longer motions are repaired in windows of this length [s]"},
      {"overlap", "Windows find so much beyond their end, which the next one finds anew [s]"},
  };
  return all.at(field);
}

bp::list getStances(const RepairedMotion& repaired) { return toList(repaired.stances); }

std::string writeStance(const RepairedStance& stance) {
  return internal::concat("RepairedStance(contact=", stance.contact, ", first=", stance.first,
                          ", behind=", stance.behind, ", drift=", stance.drift,
                          ", is_still=", stance.is_still ? "True" : "False", ")");
}

std::string writeMotion(const RepairedMotion& repaired) {
  return internal::concat("RepairedMotion(frames=", repaired.change.cols(),
                          ", root_rms=", repaired.root_rms, ", joint_rms=", repaired.joint_rms,
                          ", within_reach=", repaired.within_reach ? "True" : "False", ")");
}

void setHeight(RepairGround& ground, const Eigen::MatrixXd& rows) {
  ground.height = rows.transpose();
}

void setVelocity(RepairGround& ground, const Eigen::Vector3d& velocity) {
  ground.velocity = velocity;
}

std::string writeGround(const RepairGround& ground) {
  return internal::concat("RepairGround(parts=", ground.height.rows(),
                          ", frames=", ground.height.cols(), ")");
}

RepairGround findGround(const PartRobot& parts, const ContactInference& inference,
                        const Eigen::VectorXd& time) {
  return findRepairGround(parts.parts, inference, time);
}

RepairedMotion repair(const PartRobot& parts, const Motion& motion, const ContactSchedule& schedule,
                      const Settings& settings, const bp::object& free, const RepairGround& ground,
                      const bp::object& start, Truth anew) {
  Eigen::Array<bool, Eigen::Dynamic, 1> free_frames;
  if (!free.is_none())
    free_frames = bp::extract<Eigen::Matrix<bool, Eigen::Dynamic, 1>>(free)().array();
  Eigen::MatrixXd first;
  if (!start.is_none()) first = bp::extract<Eigen::MatrixXd>(start)().transpose();
  const WithoutLock unlocked;
  return repairMotion(parts, motion, schedule, settings, free_frames, ground, first, anew);
}

}  // namespace

void exposeMotionRepair() {
  bp::class_<Settings> settings(
      "RepairSettings",
      "What changes of a motion cost in repairMotion, and how far from the limits it ends.");
  for (const auto& [name, field] : Settings::fields())
    settings.add_property(name, bp::make_getter(field), bp::make_setter(field), getMeaning(name));
  for (const auto& [name, field] : Settings::switches())
    settings.add_property(name, bp::make_getter(field), bp::make_setter(field), getMeaning(name));
  settings.def(SettingsVisitor<Settings>());

  bp::class_<RepairGround>("RepairGround", "What is known of the ground that parts stand on.")
      .add_property(
          "height", &Rows<&RepairGround::height>::get, &setHeight,
          "Under each part, (T, parts) [m], NaN where it is not known; (0, 0) if nothing\n"
          "is")
      .add_property("velocity", getter(&RepairGround::velocity), &setVelocity,
                    "A treadmill's, (3,) [m/s]")
      .def(PrintVisitor<RepairGround>(&writeGround))
      .def(CopyVisitor<RepairGround>());
  bp::def(
      "findRepairGround", &findGround, (bp::arg("parts"), bp::arg("inference"), bp::arg("time")),
      "The RepairGround for contacts to stand on level: ContactInference.ground, but that\n"
      "stances within 5 cm of each other which are on no slope are on one level, the median of\n"
      "their lowest parts' heights by their durations. parts: a PartRobot, whose stances the\n"
      "ContactInference has; time: (T,) [s]. Raises ValueError if sizes differ.");

  bp::class_<RepairedStance>("RepairedStance",
                             "What was made of a contact that carries for some time.", bp::no_init)
      .def_readonly("contact", &RepairedStance::contact, "Its place: PartRobot.Part.contact")
      .def_readonly("first", &RepairedStance::first, "Frame")
      .def_readonly("behind", &RepairedStance::behind, "The frame after the last")
      .def_readonly("drift", &RepairedStance::drift,
                    "Largest distance of a part from where it is on average, before [m]")
      .def_readonly("is_still", &RepairedStance::is_still, "Whether it was held still")
      .def(PrintVisitor<RepairedStance>(&writeStance))
      .def(CopyVisitor<RepairedStance>());

  bp::class_<RepairedMotion>("RepairedMotion",
                             "A motion whose contacts can give what it needs, near another one.",
                             bp::no_init)
      .def_readonly("motion", &RepairedMotion::motion, "The Motion")
      .add_property("change", &Rows<&RepairedMotion::change>::get,
                    "Of the configurations, in the tangent space before, (T, nv)")
      .add_property("residual", &Rows<&RepairedMotion::residual>::get,
                    "What contacts still cannot give, force and moment about the CoM, (T, 6)\n"
                    "[N, N m]; zero in frames that are free")
      .add_property("stances", &getStances, "A RepairedStance for each")
      .def_readonly("root_rms", &RepairedMotion::root_rms,
                    "Root mean square of the root's displacement [m]")
      .def_readonly("root_largest", &RepairedMotion::root_largest, "The largest [m]")
      .def_readonly("joint_rms", &RepairedMotion::joint_rms,
                    "Root mean square of the changes of joints [rad]")
      .def_readonly("joint_largest", &RepairedMotion::joint_largest, "The largest [rad]")
      .def_readonly("held_largest", &RepairedMotion::held_largest,
                    "Largest distance of a part that carries from its place [m]")
      .def_readonly("sunk_largest", &RepairedMotion::sunk_largest,
                    "Largest depth of a part in the air below its ground, if that is known [m]")
      .def_readonly("joint_excess", &RepairedMotion::joint_excess,
                    "How far a joint is beyond its range at most [rad], [m]")
      .def_readonly("speed_excess", &RepairedMotion::speed_excess,
                    "By which part a joint is faster than it can be, at most")
      .def_readonly("within_reach", &RepairedMotion::within_reach,
                    "Whether all wrenches are within reach, but for 1e-7 of the weight")
      .def(PrintVisitor<RepairedMotion>(&writeMotion))
      .def(CopyVisitor<RepairedMotion>());

  bp::def(
      "repairMotion", &repair,
      (bp::arg("parts"), bp::arg("motion"), bp::arg("schedule"), bp::arg("settings") = Settings(),
       bp::arg("free") = bp::object(), bp::arg("ground") = RepairGround(),
       bp::arg("start") = bp::object(), bp::arg("anew") = true),
      "The RepairedMotion: the smallest change d(t) of a motion's configurations after which\n"
      "contacts can give the wrench of each frame, of the derivatives that differentiate()\n"
      "gives it. Minimises the integral of |d|^2, |d''|^2 and of how far active parts are from\n"
      "their places, over the squares of settings, by Gauss-Newton and the alternating direction\n"
      "method of multipliers; see docs/repair.md. parts: of splitContacts, with a free-flyer as\n"
      "root; motion: whose time and q are read, four frames at least; schedule: of the parts;\n"
      "free: (T,), frames of whose wrench nothing is asked; ground: its height under each part, "
      "as\n"
      "ContactInference.ground, (T, parts) [m], NaN where it is not known, and ground_velocity, a\n"
      "treadmill's [m/s]; anew: whether all is\n"
      "found anew although a start is given, or only what is out of reach mended; start: "
      "configurations with which the search begins, (T, nq). A motion\n"
      "within reach and limits, whose parts are within a millimetre of where they are to be, "
      "comes\n"
      "back as it is. Raises ValueError if settings or the motion are not valid, the\n"
      "root is another, the schedule names a part that there is not, sizes differ, there are more\n"
      "than 32 parts, or what a frame needs is too large for numbers.");
}

}  // namespace dynacom::python
