// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/centroidal.hpp"

namespace dynacom::python {

namespace {

std::string writeState(const CentroidalState& state) {
  return internal::concat("CentroidalState(mass=", state.mass, ", com=", toText(state.com),
                          ", vcom=", toText(state.vcom), ", acom=", toText(state.acom),
                          ", am=", toText(state.am), ", amVariation=", toText(state.amVariation),
                          ")");
}

std::string writeWrench(const CentroidalWrench& wrench) {
  return internal::concat("CentroidalWrench(force=", toText(wrench.force),
                          ", torque=", toText(wrench.torque), ")");
}

CentroidalWrench groundWrench(const CentroidalState& state, const bp::object& gravity,
                              const bp::object& ext_wrench) {
  return computeGroundWrench(state, toVector<3>("gravity", gravity),
                             toVector<6>("extWrench", ext_wrench));
}

CentroidalState applyWrench(const CentroidalState& state, const CentroidalWrench& wrench,
                            const bp::object& gravity, const bp::object& ext_wrench) {
  return applyGroundWrench(state, wrench, toVector<3>("gravity", gravity),
                           toVector<6>("extWrench", ext_wrench));
}

Eigen::Vector3d vrp3D(const CentroidalState& state, Real omega) {
  return computeVRP3D(state, omega);
}

Eigen::Vector3d enhancedMomentPivot(const CentroidalState& state, const bp::object& gravity,
                                    Real omega) {
  return computeECMP(state, toVector<3>("gravity", gravity), omega);
}

Eigen::Vector2d flatGroundCoP(const CentroidalWrench& wrench, const bp::object& com,
                              Real ground_height, Real minimal_vertical_force) {
  return computeFlatGroundCoP(wrench, toVector<3>("com", com), ground_height,
                              minimal_vertical_force);
}

Eigen::Vector2d vrp(const CentroidalState& state, Real omega) { return computeVRP(state, omega); }
Eigen::Vector2d dcm(const CentroidalState& state, Real omega) { return computeDCM(state, omega); }

}  // namespace

void exposeCentroidal() {
  bp::class_<CentroidalState>(
      "CentroidalState",
      "Motion of the centre of mass c, and momentum about it, in the world's axes.", bp::init<>())
      .def_readwrite("mass", &CentroidalState::mass, "m [kg]")
      .add_property("com", getter(&CentroidalState::com), setter(&CentroidalState::com, "com"),
                    "c, (3,), world [m]")
      .add_property("vcom", getter(&CentroidalState::vcom), setter(&CentroidalState::vcom, "vcom"),
                    "dc/dt, (3,) [m/s]")
      .add_property("acom", getter(&CentroidalState::acom), setter(&CentroidalState::acom, "acom"),
                    "d²c/dt², (3,), without gravity [m/s²]")
      .add_property("am", getter(&CentroidalState::am), setter(&CentroidalState::am, "am"),
                    "L, angular momentum about c, (3,) [kg·m²/s]")
      .add_property("amVariation", getter(&CentroidalState::amVariation),
                    setter(&CentroidalState::amVariation, "amVariation"), "dL/dt, (3,) [N·m]")
      .def(PrintVisitor<CentroidalState>(&writeState))
      .def(CopyVisitor<CentroidalState>());

  bp::class_<CentroidalWrench>(
      "CentroidalWrench", "A wrench about the centre of mass, in the world's axes.", bp::init<>())
      .add_property("force", getter(&CentroidalWrench::force),
                    setter(&CentroidalWrench::force, "force"), "f, (3,) [N]")
      .add_property("torque", getter(&CentroidalWrench::torque),
                    setter(&CentroidalWrench::torque, "torque"), "tau about c, (3,) [N·m]")
      .def(PrintVisitor<CentroidalWrench>(&writeWrench))
      .def(CopyVisitor<CentroidalWrench>());

  bp::def("computeCentroidalState", &computeCentroidalState,
          (bp::arg("model"), bp::arg("data"), bp::arg("q"), bp::arg("v"), bp::arg("a")),
          "The centroidal state of a robot in motion, by\n"
          "pinocchio.computeCentroidalMomentumTimeVariation, which leaves kinematics and momenta\n"
          "in data.\n\n"
          "q: (nq,); v: (nv,); a: (nv,). Raises ValueError if one has another size.");
  bp::def("readCentroidalState", &readCentroidalState, bp::arg("data"),
          "The centroidal state found in data, in which\n"
          "pinocchio.computeCentroidalMomentumTimeVariation(model, data, q, v, a) has run.");
  bp::def("computeGroundWrench", &groundWrench,
          (bp::arg("state"), bp::arg("gravity"),
           bp::arg("extWrench") = Eigen::VectorXd(Eigen::VectorXd::Zero(6))),
          "Newton and Euler, equations (1, 2): the wrench about c that the ground must give,\n"
          "f = m (d²c/dt² - g) - f_e and tau = dL/dt - tau_e.\n\n"
          "gravity: (3,), world [m/s²]; extWrench: (6,), force [N] and moment [N·m] about c.");
  bp::def("applyGroundWrench", &applyWrench,
          (bp::arg("state"), bp::arg("groundWrench"), bp::arg("gravity"),
           bp::arg("extWrench") = Eigen::VectorXd(Eigen::VectorXd::Zero(6))),
          "The inverse of computeGroundWrench: the state, with the accelerations that a ground\n"
          "wrench causes, (f + f_e)/m + g and tau + tau_e.");
  bp::def("computeFlatGroundCoP", &flatGroundCoP,
          (bp::arg("groundWrench"), bp::arg("com"), bp::arg("groundHeight") = 0.,
           bp::arg("minimalVerticalForce") = kMinimalVerticalForce),
          "Centre of pressure on flat horizontal ground, equation (5), (2,), world [m]; NaN where\n"
          "the vertical force is below minimalVerticalForce [N].");
  bp::def(
      "computeVRP", &vrp, (bp::arg("state"), bp::arg("omega")),
      "Virtual repellent point c - d²c/dt² / omega², equation (7), (2,) [m]; NaN where that is\n"
      "beyond the largest numbers.\n\n"
      "omega: finite and > 0 [rad/s], else ValueError.");
  bp::def("computeVRP3D", &vrp3D, (bp::arg("state"), bp::arg("omega")),
          "Virtual repellent point in three dimensions, (3,) [m], of which computeVRP is x and y:\n"
          "the total force on the robot, gravity's included, is m omega² (c - v). NaN where that\n"
          "is beyond the largest numbers.\n\n"
          "omega: finite and > 0 [rad/s], else ValueError.");
  bp::def("computeECMP", &enhancedMomentPivot,
          (bp::arg("state"), bp::arg("gravity"), bp::arg("omega")),
          "Enhanced centroidal moment pivot e = c - (d²c/dt² - g) / omega², equation (23), (3,)\n"
          "[m]: the force on the robot besides gravity's is m omega² (c - e). NaN where that is\n"
          "beyond the largest numbers.\n\n"
          "gravity: (3,), world [m/s²]; omega: finite and > 0 [rad/s], else ValueError.");
  bp::def(
      "computeDCM", &dcm, (bp::arg("state"), bp::arg("omega")),
      "Divergent component of motion c + dc/dt / omega, equation (20), (2,) [m]; NaN where that\n"
      "is beyond the largest numbers.\n\n"
      "omega: finite and > 0 [rad/s], else ValueError.");
}

}  // namespace dynacom::python
