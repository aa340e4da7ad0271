// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/ground_plane.hpp"

namespace dynacom::python {

namespace {

std::shared_ptr<GroundPlane> makeGroundPlane(const bp::object& point, const bp::object& normal) {
  return std::make_shared<GroundPlane>(
      GroundPlane{toVector<3>("point", point), toVector<3>("normal", normal)});
}

Eigen::Vector3d centreOfPressure(const CentroidalWrench& wrench, const bp::object& com,
                                 const GroundPlane& plane, Real minimal_normal_force) {
  return computeCoP(wrench, toVector<3>("com", com), plane, minimal_normal_force);
}

Eigen::Vector3d momentPivot(const bp::object& force, const bp::object& com,
                            const GroundPlane& plane, Real minimal_normal_force) {
  return computeCMP(toVector<3>("groundForce", force), toVector<3>("com", com), plane,
                    minimal_normal_force);
}

}  // namespace

void exposeGroundPlane() {
  bp::class_<GroundPlane>(
      "GroundPlane",
      "A plane that a robot presses on, or any other on which one wants to know where it would: a\n"
      "slope, a wall, a virtual plane between contacts of several heights. By default the world's\n"
      "z = 0.",
      bp::init<>(bp::arg("self")))
      .def("__init__",
           bp::make_constructor(
               &makeGroundPlane, bp::default_call_policies(),
               (bp::arg("point"), bp::arg("normal") = Eigen::VectorXd(Eigen::Vector3d::UnitZ()))),
           "point: (3,), any point of the plane, world [m]; normal: (3,), out of the ground, "
           "world,\n"
           "of any length.")
      .add_property("point", getter(&GroundPlane::point), setter(&GroundPlane::point, "point"),
                    "Any point of the plane, (3,), world [m]")
      .add_property("normal", getter(&GroundPlane::normal), setter(&GroundPlane::normal, "normal"),
                    "Its normal, out of the ground, of any length but zero, (3,), world")
      .def(SettingsVisitor<GroundPlane>());

  bp::def("computeCoP", &centreOfPressure,
          (bp::arg("groundWrench"), bp::arg("com"), bp::arg("plane"),
           bp::arg("minimalNormalForce") = kMinimalVerticalForce),
          "Centre of pressure of a ground wrench on a plane, equation (21), (3,), world [m]: the\n"
          "point of the plane about which the wrench's moment is parallel to the normal. Of a\n"
          "wrench that contacts give beside the plane, on others, it is the zero-moment point.\n"
          "NaN where the force along the normal is below minimalNormalForce [N].\n\n"
          "com: (3,), world [m]. Raises ValueError unless the plane is valid.");
  bp::def("computeCMP", &momentPivot,
          (bp::arg("groundForce"), bp::arg("com"), bp::arg("plane"),
           bp::arg("minimalNormalForce") = kMinimalVerticalForce),
          "Centroidal moment pivot, equation (22), (3,), world [m]: where the line along the\n"
          "ground's force through the centre of mass meets a plane. NaN where the force along the\n"
          "normal is below minimalNormalForce [N].\n\n"
          "groundForce: (3,) [N]; com: (3,), world [m]. Raises ValueError unless the plane is "
          "valid.");
}

}  // namespace dynacom::python
