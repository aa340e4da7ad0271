// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/dyna_com.hpp"

namespace dynacom::python {

namespace {

bp::list toList(const std::vector<std::string>& names) {
  bp::list list;
  for (const std::string& name : names) list.append(name);
  return list;
}

bp::list getActiveContacts(const DynaCoM& self) { return toList(self.getActiveContacts()); }
bp::list getKnownContacts(const DynaCoM& self) { return toList(self.getKnownContacts()); }

std::string write(const DynaCoM& robot) {
  if (!robot.isInitialized()) return "DynaCoM()";
  const pinocchio::Model& model = robot.getModel();
  return internal::concat("DynaCoM(mass=", robot.getMass(), ", nq=", model.nq, ", nv=", model.nv,
                          ", active_contacts=", toText(robot.getActiveContacts()),
                          ", known_contacts=", toText(robot.getKnownContacts()), ")");
}

using VectorRef = DynaCoM::VectorRef;

void computeDynamics(DynaCoM& self, const VectorRef& q, const VectorRef& v, const VectorRef& a,
                     const bp::object& ext_wrench, Truth flat_horizontal_ground) {
  self.computeDynamics(q, v, a, toVector<6>("extWrench", ext_wrench), flat_horizontal_ground);
}

void computeDynamicsOfData(DynaCoM& self, const pinocchio::Data& data, const bp::object& ext_wrench,
                           Truth flat_horizontal_ground) {
  self.computeDynamics(data, toVector<6>("extWrench", ext_wrench), flat_horizontal_ground);
}

void computeDynamicsOnPlane(DynaCoM& self, const VectorRef& q, const VectorRef& v,
                            const VectorRef& a, const bp::object& ext_wrench,
                            const GroundPlane& ground) {
  self.computeDynamics(q, v, a, toVector<6>("extWrench", ext_wrench), ground);
}

void computeDynamicsOfDataOnPlane(DynaCoM& self, const pinocchio::Data& data,
                                  const bp::object& ext_wrench, const GroundPlane& ground) {
  self.computeDynamics(data, toVector<6>("extWrench", ext_wrench), ground);
}

void computeNL(DynaCoM& self, Real omega, const VectorRef& q, const VectorRef& v,
               const VectorRef& a, const bp::object& ext_wrench, Truth flat_horizontal_ground) {
  self.computeNL(omega, q, v, a, toVector<6>("extWrench", ext_wrench), flat_horizontal_ground);
}

void computeNLOnPlane(DynaCoM& self, Real omega, const VectorRef& q, const VectorRef& v,
                      const VectorRef& a, const bp::object& ext_wrench, const GroundPlane& ground) {
  self.computeNL(omega, q, v, a, toVector<6>("extWrench", ext_wrench), ground);
}

DistributionStatus distributeForce(DynaCoM& self, const bp::object& force, const bp::object& torque,
                                   const bp::object& com) {
  return self.distributeForce(toVector<3>("groundCoMForce", force),
                              toVector<3>("groundCoMTorque", torque), toVector<3>("com", com));
}

void addContact(DynaCoM& self, const std::shared_ptr<ContactBase>& contact, const std::string& name,
                Truth active) {
  self.addContact(contact, name, active);
}

}  // namespace

void exposeDynaCoM() {
  using Settings = DynaCoMSettings;
  const Eigen::VectorXd no_wrench = Eigen::VectorXd::Zero(6);

  bp::class_<Settings>("DynaCoMSettings", "What describes a DynaCoM.", bp::init<>(bp::arg("self")))
      .def_readwrite("urdf", &Settings::urdf,
                     "Path of a URDF file, or the XML itself. The root joint will be a free-flyer: "
                     "the file's own, where a massless root link holds all others by a floating "
                     "joint, whose origin is left out.")
      .add_property("gravity", getter(&Settings::gravity), setter(&Settings::gravity, "gravity"),
                    "Along -z or zero, (3,) [m/s²]; (0, 0, -9.81) by default.")
      .def(SettingsVisitor<Settings>());

  bp::class_<DynaCoM>(
      "DynaCoM",
      "The ground wrench of a robot in motion, where it presses, and how the contacts share it.\n\n"
      "Vectors are in the world's axes, SI units; q is (nq,), v and a are (nv,), as in Pinocchio.\n"
      "Before computeDynamics all numbers of the motion are NaN.",
      bp::init<>(bp::arg("self"), "A DynaCoM that waits for initialize()."))
      .def(bp::init<const Settings&>((bp::arg("self"), bp::arg("settings")),
                                     "Raises ValueError as initialize()."))
      .def(bp::init<const pinocchio::Model&>((bp::arg("self"), bp::arg("model")),
                                             "Raises ValueError as initialize()."))
      .def<void (DynaCoM::*)(const Settings&)>(
          "initialize", &DynaCoM::initialize, (bp::arg("self"), bp::arg("settings")),
          "Reads the robot and forgets the contacts; may be called again. Raises ValueError if "
          "the\n"
          "settings are not valid, the URDF cannot be read or the robot has no mass; nothing has\n"
          "changed then.")
      .def<void (DynaCoM::*)(const pinocchio::Model&)>(
          "initialize", &DynaCoM::initialize, (bp::arg("self"), bp::arg("model")),
          "The same for a pinocchio.Model, which is copied, with its gravity.")
      .def("isInitialized", &DynaCoM::isInitialized, bp::arg("self"),
           "Whether there is a robot: False before initialize().")
      .def("getSettings", &DynaCoM::getSettings, bp::arg("self"), Copied(),
           "A copy of the settings.")
      .def("getModel", &DynaCoM::getModel, bp::arg("self"), bp::return_internal_reference<>(),
           "The robot's model (pinocchio.Model).")
      .def<pinocchio::Data& (DynaCoM::*)()>(
          "getData", &DynaCoM::getData, bp::arg("self"), bp::return_internal_reference<>(),
          "The robot's data (pinocchio.Data). Pinocchio's algorithms may be run on it; contacts\n"
          "are placed by its oMi.")
      .def("getMass", &DynaCoM::getMass, bp::arg("self"), "Mass of the robot [kg].")
      .def("getGroundHeight", &DynaCoM::getGroundHeight, bp::arg("self"),
           "Height of the flat horizontal ground [m].")
      .def("setGroundHeight", method(&DynaCoM::setGroundHeight, "groundHeight"),
           "Height of the flat horizontal ground, finite [m].")
      .def("getMinimalVerticalForce", &DynaCoM::getMinimalVerticalForce, bp::arg("self"),
           "Below this vertical force a centre of pressure means nothing, nor what is on a\n"
           "GroundPlane below this force along its normal [N]; 1 by default.")
      .def("setMinimalVerticalForce",
           method(&DynaCoM::setMinimalVerticalForce, "minimalVerticalForce"),
           "ValueError unless minimalVerticalForce is finite and > 0 [N].")
      .def("getWrenchWeights", &DynaCoM::getWrenchWeights, bp::arg("self"), Copied(),
           "Weights of the norm in which a wrench out of reach is replaced by the closest, (6,).")
      .def(
          "setWrenchWeights", method<DynaCoM>(&DynaCoM::setWrenchWeights, "weights"),
          "Three of the force, three of the moment [1/m]; all 1 by default. ValueError unless all\n"
          "are finite and > 0.")
      .def("getWarmStart", &DynaCoM::getWarmStart, bp::arg("self"),
           "Whether a distribution starts from the inequalities that were active in the last one,\n"
           "contact by contact; True by default.")
      .def("setWarmStart", method(&DynaCoM::setWarmStart, "warmStart"),
           "Whether it does, see WrenchDistribution.setWarmStart().")
      .def("getMaximalIterations", &DynaCoM::getMaximalIterations, bp::arg("self"),
           "How many iterations a distribution may take.")
      .def("setMaximalIterations", method(&DynaCoM::setMaximalIterations, "maximalIterations"),
           "How many it may take, 100,000 by default; a controller sets 50, see\n"
           "WrenchDistribution.setMaximalIterations(). ValueError unless maximalIterations > 0.")

      .def("computeDynamics", &computeDynamics,
           (bp::arg("self"), bp::arg("q"), bp::arg("v"), bp::arg("a"),
            bp::arg("extWrench") = no_wrench, bp::arg("flatHorizontalGround") = true),
           "Computes the centroidal state, the ground wrench (1, 2), the placements of the\n"
           "contacts and the centre of pressure: by (5) on flat horizontal ground, else by (6),\n"
           "after distributing the wrench. All results are NaN if a number is not finite, or "
           "becomes\n"
           "so, or a quaternion's norm is not 1.\n\n"
           "q: (nq,); v: (nv,); a: (nv,); extWrench: (6,), force [N] and moment [N·m] about the\n"
           "centre of mass. Raises ValueError if one has another size.")
      .def(
          "computeDynamics", &computeDynamicsOfData,
          (bp::arg("self"), bp::arg("data"), bp::arg("extWrench") = no_wrench,
           bp::arg("flatHorizontalGround") = true),
          "The same for a motion of which all that Pinocchio computes is known:\n"
          "pinocchio.computeCentroidalMomentumTimeVariation(getModel(), data, q, v, a) has run\n"
          "on data (pinocchio.Data), and nothing since that changes its com, vcom, hg, dhg, mass\n"
          "or oMi. Those are read, and oMi is copied to getData(), so that contacts can be placed\n"
          "later; nothing else in getData() is that of the motion.\n\n"
          "Raises ValueError if data has another number of joints, or extWrench another size;\n"
          "NotReadyError if data's mass is not the robot's, because that algorithm has never run\n"
          "on it.")
      .def(
          "computeDynamics", &computeDynamicsOnPlane,
          (bp::arg("self"), bp::arg("q"), bp::arg("v"), bp::arg("a"), bp::arg("extWrench"),
           bp::arg("ground")),
          "The same on any plane, a slope or a wall: the centre of pressure is that of the ground\n"
          "wrench by (21). Nothing is distributed.\n\n"
          "ground: GroundPlane. Raises ValueError unless it is valid.")
      .def("computeDynamics", &computeDynamicsOfDataOnPlane,
           (bp::arg("self"), bp::arg("data"), bp::arg("extWrench"), bp::arg("ground")),
           "The same on any plane, of a motion that is known.")
      .def("getGroundCoMForce", &DynaCoM::getGroundCoMForce, bp::arg("self"), Copied(),
           "Force that the ground must give, (3,) [N].")
      .def("getGroundCoMTorque", &DynaCoM::getGroundCoMTorque, bp::arg("self"), Copied(),
           "Moment that the ground must give, about the centre of mass, (3,) [N·m].")
      .def("getCoM", &DynaCoM::getCoM, bp::arg("self"), Copied(), "Centre of mass, (3,) [m].")
      .def("getVCoM", &DynaCoM::getVCoM, bp::arg("self"), Copied(), "Its velocity, (3,) [m/s].")
      .def("getACoM", &DynaCoM::getACoM, bp::arg("self"), Copied(), "Its acceleration (3,) [m/s²].")
      .def("getAM", &DynaCoM::getAM, bp::arg("self"), Copied(),
           "Angular momentum about the centre of mass, (3,) [kg·m²/s].")
      .def("getAMVariation", &DynaCoM::getAMVariation, bp::arg("self"), Copied(),
           "Its rate, (3,) [N·m].")
      .def("getCoP", &DynaCoM::getCoP, bp::arg("self"), Copied(),
           "x and y of the centre of pressure, (2,) [m]; NaN unless isCoPDefined().")
      .def("getCoP3D", &DynaCoM::getCoP3D, bp::arg("self"), Copied(),
           "The whole of it, (3,) [m]: on the ground's plane, or, on uneven ground, the mean of\n"
           "the contacts' centres of pressure by vertical force.")
      .def("isCoPDefined", &DynaCoM::isCoPDefined, bp::arg("self"),
           "Whether the vertical force, on a GroundPlane that along its normal, is\n"
           "getMinimalVerticalForce() or more.")
      .def("getCMP", &DynaCoM::getCMP, (bp::arg("self"), bp::arg("plane")),
           "Centroidal moment pivot on a plane, (22), (3,) [m]: where the line along the ground's\n"
           "force through the centre of mass meets it; on uneven ground the force that the "
           "contacts\n"
           "achieve. NaN where it is below getMinimalVerticalForce() along the normal.\n\n"
           "plane: GroundPlane. Raises ValueError unless it is valid.")
      .def(
          "getFeasibleACoM", &DynaCoM::getFeasibleACoM, bp::arg("self"), Copied(),
          "Acceleration of the centre of mass that the contacts can really cause, (3,) [m/s²]: by\n"
          "what the last distribution since computeDynamics achieved; NaN before.")
      .def("getFeasibleAMVariation", &DynaCoM::getFeasibleAMVariation, bp::arg("self"), Copied(),
           "The same for the rate of the angular momentum, (3,) [N·m].")
      .def("computeNL", method<DynaCoM, void, double>(&DynaCoM::computeNL, "omega"),
           "Computes virtual repellent point and non-linearity, (7, 8), of the last\n"
           "computeDynamics; where that has distributed the wrench, with getFeasibleACoM().\n"
           "omega: finite and > 0 [rad/s], else ValueError.")
      .def("computeNL", &computeNL,
           (bp::arg("self"), bp::arg("omega"), bp::arg("q"), bp::arg("v"), bp::arg("a"),
            bp::arg("extWrench") = no_wrench, bp::arg("flatHorizontalGround") = true),
           "computeDynamics, then computeNL(omega).")
      .def("computeNL", &computeNLOnPlane,
           (bp::arg("self"), bp::arg("omega"), bp::arg("q"), bp::arg("v"), bp::arg("a"),
            bp::arg("extWrench"), bp::arg("ground")),
           "The same on any plane. ground: GroundPlane.")
      .def("getVRP", &DynaCoM::getVRP, bp::arg("self"), Copied(),
           "Virtual repellent point, (2,) [m].")
      .def("getNL", &DynaCoM::getNL, bp::arg("self"), Copied(), "Non-linearity p - v, (2,) [m].")
      .def("getVRP3D", &DynaCoM::getVRP3D, bp::arg("self"), Copied(),
           "Virtual repellent point, (3,) [m]; getVRP() is x and y of it.")
      .def("getECMP", &DynaCoM::getECMP, bp::arg("self"), Copied(),
           "Enhanced centroidal moment pivot of the last computeNL, (23), (3,) [m].")

      .def(
          "addContact", &addContact,
          (bp::arg("self"), bp::arg("contact"), bp::arg("name"), bp::arg("active") = true),
          "Makes a contact known under a name. It is shared, not copied. Raises ValueError if the\n"
          "name is taken, the contact known, here or to another DynaCoM, or not initialised, or "
          "its\n"
          "frame not in the model.")
      .def("removeContact", &DynaCoM::removeContact, (bp::arg("self"), bp::arg("name")),
           "Forgets a contact. Raises ValueError if the name is not known.")
      .def("activateContact", &DynaCoM::activateContact, (bp::arg("self"), bp::arg("name")),
           "The contact takes part from now on, as the last in order. Raises ValueError if the\n"
           "name is not known.")
      .def("deactivateContact", &DynaCoM::deactivateContact, (bp::arg("self"), bp::arg("name")),
           "The contact takes no part any more, its force becomes zero. Raises ValueError if the\n"
           "name is not known.")
      .def("addContact6d", &addContact,
           (bp::arg("self"), bp::arg("contact"), bp::arg("name"), bp::arg("active") = true),
           "Another name of addContact.")
      .def("removeContact6d", &DynaCoM::removeContact6d, (bp::arg("self"), bp::arg("name")),
           "Another name of removeContact.")
      .def("activateContact6d", &DynaCoM::activateContact6d, (bp::arg("self"), bp::arg("name")),
           "Another name of activateContact.")
      .def("deactivateContact6d", &DynaCoM::deactivateContact6d, (bp::arg("self"), bp::arg("name")),
           "Another name of deactivateContact.")
      .def("setContactPose", &DynaCoM::setContactPose,
           (bp::arg("self"), bp::arg("name"), bp::arg("oMs")),
           "Places a contact's frame where it was measured, wherever the model says that it is:\n"
           "from now on, until it is set again or resetContactPose(). Raises ValueError if the\n"
           "name is not known.\n\n"
           "oMs: placement of the contact's frame in the world (pinocchio.SE3); see\n"
           "ContactBase.getSurfacePose().")
      .def("resetContactPose", &DynaCoM::resetContactPose, (bp::arg("self"), bp::arg("name")),
           "Places a contact by the model again, from the next computeDynamics() or\n"
           "distributeForce() on. Raises ValueError if the name is not known.")
      .def("getContact", &DynaCoM::getContact, (bp::arg("self"), bp::arg("name")),
           "The contact of that name. Raises ValueError if it is not known.")
      .def("getActiveContacts", &getActiveContacts, bp::arg("self"),
           "Names of the active contacts, in the order of their activation.")
      .def("getKnownContacts", &getKnownContacts, bp::arg("self"),
           "Names of all contacts: the active ones, then the others.")

      .def("distributeForce", &distributeForce,
           (bp::arg("self"), bp::arg("groundCoMForce"), bp::arg("groundCoMTorque"), bp::arg("com")),
           "Shares a wrench between the active contacts, placed by getData() or setContactPose():\n"
           "the cheapest forces within all inequalities that give it, (9-13), or the closest that\n"
           "they can give. Each contact is given its force. Returns the DistributionStatus;\n"
           "getDistribution() has all.\n\n"
           "groundCoMForce: (3,) [N]; groundCoMTorque: (3,), about the centre of mass [N·m];\n"
           "com: (3,), that of getCoM(), or getFeasibleAMVariation() means nothing [m]. ValueError "
           "if\n"
           "active contacts cannot share a wrench, see WrenchDistribution.add().")
      .def("forgetAnswers", &DynaCoM::forgetAnswers, bp::arg("self"),
           "Forgets which inequalities were active, and forces that would be kept: the next\n"
           "distribution starts cold, and does not depend on those before.")
      .def(
          "getDistribution", &DynaCoM::getDistribution, bp::arg("self"), Copied(),
          "The last distribution, be it distributeForce()'s or that of computeDynamics on uneven\n"
          "ground: a DistributionResult, a copy; its contacts are those that were active then, in\n"
          "the order of their activation.")
      .def("getDistributionStatus", &DynaCoM::getDistributionStatus, bp::arg("self"),
           "How the last distribution ended; NoContact before the first.")
      .def("computeWrenchMargin", &DynaCoM::computeWrenchMargin, bp::arg("self"),
           "How far the last distribution's wrench is from what its contacts cannot give: a\n"
           "WrenchMargin. Takes many times as long as a distribution.")
      .def("getZMP", &DynaCoM::getZMP, (bp::arg("self"), bp::arg("plane")),
           "Zero-moment point of the last distribution on a plane, (3,) [m]: (21) of the wrench\n"
           "that its contacts achieve, wherever they stand. NaN where its force along the normal\n"
           "is below getMinimalVerticalForce().\n\n"
           "plane: GroundPlane. Raises ValueError unless it is valid.")
      .def("getContactCoP", &DynaCoM::getContactCoP, (bp::arg("self"), bp::arg("name")),
           "A contact's centre of pressure in its surface's plane, (2,) [m]; NaN where its normal\n"
           "force is below getMinimalVerticalForce(). ValueError if the name is not known.")
      .def("getContactFrictionUsage", &DynaCoM::getContactFrictionUsage,
           (bp::arg("self"), bp::arg("name")),
           "The contact's getFrictionUsage(); 0 where its normal force is below\n"
           "getMinimalVerticalForce(), unless it is NaN for all forces. ValueError if the name is "
           "not known.")
      .def("getContactCoPMargin", &DynaCoM::getContactCoPMargin, (bp::arg("self"), bp::arg("name")),
           "The contact's getCoPMargin() [m]; NaN where its normal force is below\n"
           "getMinimalVerticalForce(). ValueError if the name is not known.")
      .def("getContactYawUsage", &DynaCoM::getContactYawUsage, (bp::arg("self"), bp::arg("name")),
           "The contact's getYawUsage(); 0 where its normal force is below\n"
           "getMinimalVerticalForce(), unless it is NaN for all forces. ValueError if the name is "
           "not known.")
      .def("uni_A", DYNACOM_MATRIX(DynaCoM, uni_A), bp::arg("self"),
           "Unilaterality of the active contacts, block-diagonal.")
      .def("uni_b", &DynaCoM::uni_b, bp::arg("self"), "Right-hand side of unilaterality, zero.")
      .def("fri_A", DYNACOM_MATRIX(DynaCoM, fri_A), bp::arg("self"),
           "Friction of the active contacts, block-diagonal.")
      .def("fri_b", &DynaCoM::fri_b, bp::arg("self"), "Right-hand side of friction, zero.")
      .def("reg_A", &DynaCoM::reg_A, bp::arg("self"), "Weights of the active contacts, stacked.")
      .def("reg_b", &DynaCoM::reg_b, bp::arg("self"), "What the cost pulls the forces to, zero.")
      .def("ne_A", DYNACOM_MATRIX(DynaCoM, ne_A), bp::arg("self"),
           "Newton-Euler matrices of the active contacts, side by side, (6, n).")
      .def("ne_b", &DynaCoM::ne_b, bp::arg("self"), Copied(),
           "The wrench that the last distribution was asked for, (6,).")
      .def("allForces", &DynaCoM::allForces, bp::arg("self"),
           "Forces of the active contacts, stacked, each in its surface's frame.")
      .def(PrintVisitor<DynaCoM>(&write))
      .def(CopyVisitor<DynaCoM>());
}

}  // namespace dynacom::python
