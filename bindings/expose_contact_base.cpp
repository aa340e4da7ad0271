// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/contact_base.hpp"

namespace dynacom::python {

namespace {

std::shared_ptr<ContactBase> deepcopy(const ContactBase& self, const bp::dict&) {
  return self.clone();
}

void updateNewtonEuler(ContactBase& self, const bp::object& com, const pinocchio::SE3& oMs) {
  self.updateNewtonEuler(toVector<3>("com", com), oMs);
}

void applyForce(ContactBase& self, const bp::object& force) {
  self.applyForce(toNumbers("force", force, int(self.cols())));
}

bp::object getSet(const ContactBase& self) {
  return self.getSet() ? bp::object(*self.getSet()) : bp::object();
}

}  // namespace

void exposeContactBase() {
  bp::class_<ContactBase, std::shared_ptr<ContactBase>, boost::noncopyable>(
      "ContactBase",
      "What every contact is: a frame of the robot, through which the environment gives the robot\n"
      "a force lambda, limited by linear inequalities. lambda is expressed in the surface's "
      "frame,\n"
      "z along the normal, into the robot: force [N], then, for surfaces, moment [N·m].\n\n"
      "|f_x|, |f_y| <= mu f_z is a pyramid around the friction cone: on its diagonals it allows\n"
      "sqrt(2) mu f_z.",
      bp::no_init)
      .def("clone", &ContactBase::clone, bp::arg("self"), "A copy that shares nothing with this.")
      .def("__copy__", &ContactBase::clone, bp::arg("self"))
      .def("__deepcopy__", &deepcopy, (bp::arg("self"), bp::arg("memo")))
      .def("getFrameName", &ContactBase::getFrameName, bp::arg("self"), Copied(),
           "Name of the contact's frame in the robot's model.")
      .def("getFrameID", &ContactBase::getFrameID, bp::arg("self"),
           "Index of that frame in a model; a very large number before DynaCoM.addContact.")
      .def("setFrameID", method(&ContactBase::setFrameID, "frame_id"),
           "Tells which frame of a model is the contact's. DynaCoM does.")
      .def("getRevision", &ContactBase::getRevision, bp::arg("self"),
           "Number of the matrices but for ne_A: another one whenever they may have changed, and "
           "no\n"
           "other contact's unless they are copies of each other; 0 before there are any.")
      .def("getPose", &ContactBase::getPose, bp::arg("self"), Copied(),
           "Placement of the contact's frame in the world (pinocchio.SE3).")
      .def("setPose", &ContactBase::setPose, (bp::arg("self"), bp::arg("pose")),
           "Places the contact's frame in the world (pinocchio.SE3), and leaves ne_A as it is.")
      .def("getSurfacePose", &ContactBase::getSurfacePose, bp::arg("self"),
           "Placement of the surface in the world: getPose(), unless world_aligned or radius say\n"
           "otherwise.")
      .def(
          "getCorners",
          +[](const ContactBase& self) { return toArray(self.getCorners().transpose()); },
          bp::arg("self"),
          "Corners of the surface, in its plane and in order around it, (corners, 2) [m]: of "
          "points\n"
          "the origin.")
      .def("uni_rows", &ContactBase::uni_rows, bp::arg("self"), "Rows of uni_A.")
      .def("fri_rows", &ContactBase::fri_rows, bp::arg("self"), "Rows of fri_A.")
      .def("cols", &ContactBase::cols, bp::arg("self"), "Components of lambda: 3 or 6.")
      .def("uni_A", DYNACOM_MATRIX(ContactBase, uni_A), bp::arg("self"),
           "Unilaterality: uni_A lambda <= uni_b, (uni_rows, cols).")
      .def("uni_b", &ContactBase::uni_b, bp::arg("self"), Copied(), "Zero, (uni_rows,).")
      .def("fri_A", DYNACOM_MATRIX(ContactBase, fri_A), bp::arg("self"),
           "Friction: fri_A lambda <= fri_b, (fri_rows, cols).")
      .def("fri_b", &ContactBase::fri_b, bp::arg("self"), Copied(), "Zero, (fri_rows,).")
      .def("reg_A", &ContactBase::reg_A, bp::arg("self"), Copied(),
           "Weights of lambda in the cost, which squares them, (cols,).")
      .def("reg_b", &ContactBase::reg_b, bp::arg("self"), Copied(), "Zero, (cols,).")
      .def("getSet", &getSet, bp::arg("self"),
           "The ContactSet of lambda; None for kinds that are described by matrices alone.")
      .def("isPyramid", &ContactBase::isPyramid, bp::arg("self"),
           "Whether lambda is in the pyramid uni_A lambda <= 0, fri_A lambda <= 0, and the cost\n"
           "pulls it to zero: then distributions have a multiplier for each of these inequalities.")
      .def("ne_A", DYNACOM_MATRIX(ContactBase, ne_A), bp::arg("self"),
           "Newton-Euler matrix, (6, cols): takes lambda to (force, moment) about the centre of\n"
           "mass in the world's axes, at the last updateNewtonEuler.")
      .def("updateNewtonEuler", &updateNewtonEuler,
           (bp::arg("self"), bp::arg("com"), bp::arg("oMs")),
           "Sets the pose and brings ne_A up to date.\n\n"
           "com: (3,), world [m]; oMs: placement of the contact's frame (pinocchio.SE3).")
      .def("appliedForce", &ContactBase::appliedForce, bp::arg("self"), Copied(),
           "The force lambda in force, (cols,), in the surface's frame.")
      .def("applyForce", &applyForce, (bp::arg("self"), bp::arg("force")),
           "Records the force lambda that acts here; ValueError unless it is (cols,).")
      .def("deactivate", &ContactBase::deactivate, bp::arg("self"),
           "The applied force becomes zero.")
      .def("toWorldForces", &ContactBase::toWorldForces, bp::arg("self"),
           "The applied force as (force, moment), (6,), in the world's axes about its origin.")
      .def("toCoMForces", &ContactBase::toCoMForces, bp::arg("self"),
           "The same about the centre of mass of the last updateNewtonEuler.")
      .def("getCoP", &ContactBase::getCoP, bp::arg("self"),
           "Centre of pressure in the surface's plane, (2,) [m]; NaN unless the normal force is\n"
           "positive.")
      .def("getFrictionUsage", &ContactBase::getFrictionUsage, bp::arg("self"),
           "The larger of |f_x| and |f_y| over mu f_z, 1 on the pyramid: NaN without friction; "
           "else\n"
           "0 where there is no force, and infinite where there is one without a positive normal\n"
           "force.")
      .def("getCoPMargin", &ContactBase::getCoPMargin, bp::arg("self"),
           "Distance of getCoP() to the nearest edge, negative beyond it [m]; NaN unless the "
           "normal\n"
           "force is positive, and for points.")
      .def("getYawUsage", &ContactBase::getYawUsage, bp::arg("self"),
           "|tau_z| over gu f_z, as getFrictionUsage; NaN for points.");
}

}  // namespace dynacom::python
