// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/wrench_distribution.hpp"

namespace dynacom::python {

namespace {

DistributionStatus solve(WrenchDistribution& self, const Eigen::VectorXd& wrench,
                         double minimal_scale) {
  return self.solve(toVector<6>("wrench", wrench), minimal_scale);
}

}  // namespace

void exposeWrenchDistribution() {
  bp::enum_<DistributionStatus>("DistributionStatus",
                                "How a distribution ended.\n\n"
                                "Solved: the forces sum to the wrench, respect every inequality,\n"
                                "and are the cheapest that do.\n"
                                "Infeasible: no forces within the inequalities sum to it.\n"
                                "NoContact: there is no contact to give a force.\n"
                                "NumericalFailure: a number was not finite, the iterations were\n"
                                "used up, or the answer did not pass the check.\n\n"
                                "The forces are zero in all but the first.")
      .value("Solved", DistributionStatus::Solved)
      .value("Infeasible", DistributionStatus::Infeasible)
      .value("NoContact", DistributionStatus::NoContact)
      .value("NumericalFailure", DistributionStatus::NumericalFailure);

  bp::class_<WrenchDistribution>(
      "WrenchDistribution",
      "How contacts share a wrench: the cheapest forces within all inequalities that give it,\n"
      "equations (9-13). clear(), add() every contact, solve(), forces().",
      bp::init<>(bp::arg("self")))
      .def("clear", &WrenchDistribution::clear, bp::arg("self"),
           "Begins a new problem, without contacts.")
      .def("add", &WrenchDistribution::add, (bp::arg("self"), bp::arg("contact")),
           "Adds a contact with the matrices that it has now.")
      .def("solve", &solve, (bp::arg("self"), bp::arg("wrench"), bp::arg("minimalScale") = 0.),
           "Solves for the forces that give a wrench, (6,): force [N], moment [N·m] about the\n"
           "centre of mass, world axes. Tolerances are relative to its norm, but at least to\n"
           "minimalScale [N]. Returns the DistributionStatus.")
      .def("forces", &WrenchDistribution::forces, bp::arg("self"), Copied(),
           "The forces of all contacts, in the order of add(), each in its surface's frame; zero\n"
           "unless solved.")
      .def(CopyVisitor<WrenchDistribution>());
}

}  // namespace dynacom::python
