// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/wrench_distribution.hpp"

namespace dynacom::python {

namespace {

using Contact = DistributionResult::Contact;

void addMatrices(WrenchDistribution& self, const Eigen::MatrixXd& A, const Eigen::VectorXd& weights,
                 const Eigen::MatrixXd& NE) {
  internal::requireSize("NE", NE.rows(), Eigen::Index(6), "rows");
  self.add(A, weights, NE);
}

DistributionStatus solve(WrenchDistribution& self, const bp::object& wrench, Real minimal_scale) {
  return self.solve(toVector<6>("wrench", wrench), minimal_scale);
}

void reserve(WrenchDistribution& self, const ContactBase& contact, Index slot) {
  self.reserve(contact, slot);
}

void addInSlot(WrenchDistribution& self, const ContactBase& contact, Index slot) {
  self.add(contact, slot);
}

bool isOptimal(const DistributionResult& self, Real tolerance) { return self.isOptimal(tolerance); }

bp::list getContacts(const DistributionResult& self) {
  bp::list contacts;
  for (const Contact& contact : self.contacts) contacts.append(contact);
  return contacts;
}

std::string writeResult(const DistributionResult& result) {
  std::string forces;
  for (const Contact& contact : result.contacts)
    forces += (forces.empty() ? "" : ", ") + toText(contact.force);
  return internal::concat(
      "DistributionResult(status=", result.status, ", wrench=", toText(result.wrench),
      ", achieved=", toText(result.achieved), ", residual=", toText(result.residual),
      ", wrench_weights=", toText(result.wrench_weights), ", scale=", result.scale,
      ", cost=", result.cost, ", iterations=", result.iterations, ", forces=[", forces, "])");
}

std::string writeContact(const Contact& contact) {
  return internal::concat("DistributionResult.Contact(force=", toText(contact.force),
                          ", active=", toText(contact.active.cast<double>()),
                          ", multipliers=", toText(contact.multipliers),
                          ", relaxation_multipliers=", toText(contact.relaxation_multipliers), ")");
}

std::string writeMargin(const WrenchMargin& margin) {
  return internal::concat("WrenchMargin(margin=", margin.margin, ", axis=", margin.axis,
                          ", sign=", margin.sign, ")");
}

std::string writeDistribution(const WrenchDistribution& distribution) {
  return internal::concat(
      "WrenchDistribution(wrench_weights=", toText(distribution.getWrenchWeights()),
      ", status=", distribution.result().status, ")");
}

bp::object getSet(const Contact& self) { return self.set ? bp::object(*self.set) : bp::object(); }
bp::object getA(const Contact& self) { return toArray(self.A); }
bp::object getNE(const Contact& self) { return toArray(self.NE); }
bp::object getActive(const Contact& self) {
  return bp::object(Eigen::Matrix<bool, Eigen::Dynamic, 1>(self.active.matrix()));
}

}  // namespace

void exposeWrenchDistribution() {
  bp::enum_<DistributionStatus> status(
      "DistributionStatus",
      "How a distribution ended. Whatever it says, the forces lie within all inequalities, but "
      "for\n"
      "rounding of 1e-9 of the scale.\n\n"
      "Solved: the wrench can be reached, its distance to what the contacts can give is at most\n"
      "1e-8 of the scale; the forces give it and are the cheapest that do.\n"
      "Relaxed: it is out of reach; the forces give the closest that the contacts can give, and\n"
      "are the cheapest that do.\n"
      "NoContact: there is no contact, and the wrench is not zero. Also before the first solve().\n"
      "InvalidInput: a number that came in was not finite; the forces are those of the last "
      "answer\n"
      "if contacts and settings are still the same, else zero.\n"
      "NumericalFailure: the iterations were used up (WrenchDistribution.setMaximalIterations()),\n"
      "or the answer did not pass the check; the forces are as for InvalidInput.");
  status.value("Solved", DistributionStatus::Solved)
      .value("Relaxed", DistributionStatus::Relaxed)
      .value("NoContact", DistributionStatus::NoContact)
      .value("InvalidInput", DistributionStatus::InvalidInput)
      .value("NumericalFailure", DistributionStatus::NumericalFailure);
  status.attr("__reduce__") = bp::make_function(&reduceEnum);

  {
    const bp::scope result =
        bp::class_<DistributionResult>(
            "DistributionResult",
            "What a distribution was asked, and what it answered.\n\n"
            "Wrenches are (6,): force [N] and moment [N·m] about the centre of mass, world axes;\n"
            "their size is the norm of wrench_weights * wrench. Before the first solve() numbers\n"
            "are NaN. Where there is no answer, multipliers are zero, and achieved and cost are\n"
            "those of the forces that stay.",
            bp::no_init)
            .def_readonly("status", &DistributionResult::status, "DistributionStatus.")
            .add_property("wrench", getter(&DistributionResult::wrench),
                          "What was asked for, (6,).")
            .add_property("achieved", getter(&DistributionResult::achieved),
                          "What the forces give, (6,).")
            .add_property("residual", getter(&DistributionResult::residual),
                          "wrench - achieved, (6,).")
            .add_property("wrench_weights", getter(&DistributionResult::wrench_weights),
                          "Weights of the norm of wrenches, (6,).")
            .def_readonly("scale", &DistributionResult::scale,
                          "Of the norm of wrenches, what tolerances are relative to.")
            .def_readonly("cost", &DistributionResult::cost, "Half the sum of (w_i lambda_i)^2.")
            .def_readonly("iterations", &DistributionResult::iterations,
                          "Steps of all solvers that were asked.")
            .add_property("contacts", &getContacts,
                          "One DistributionResult.Contact each, in the order of add().")
            .add_property("wrench_multipliers", getter(&DistributionResult::wrench_multipliers),
                          "Multipliers nu of NE lambda = achieved, (6,):\n"
                          "W^2 lambda = NE' nu - A' mu.")
            .def("forces", &DistributionResult::forces, bp::arg("self"),
                 "The forces of all contacts, one behind the other.")
            .def("isOptimal", &isOptimal, (bp::arg("self"), bp::arg("tolerance") = 1e-6),
                 "Whether the answer is optimal, judged by what stands in this result alone:\n"
                 "forces within the inequalities, the cheapest that give the achieved wrench, and\n"
                 "no reachable wrench closer. False for InvalidInput and NumericalFailure, and\n"
                 "before the first solve().\n\n"
                 "tolerance: of each of these, relative to the terms that it compares.")
            .def(PrintVisitor<DistributionResult>(&writeResult))
            .def(CopyVisitor<DistributionResult>());

    bp::class_<Contact>("Contact", "One contact's share of a problem, and of its answer.",
                        bp::no_init)
        .add_property("A", &getA,
                      "Its inequalities A lambda <= 0: unilaterality, then friction; (m, n).")
        .add_property("weights", getter(&Contact::weights), "Weights of the cost, (n,).")
        .add_property("set", &getSet,
                      "The ContactSet, where the inequalities alone do not describe it; then none\n"
                      "is active, and they have no multipliers. Else None.")
        .add_property("reference", getter(&Contact::reference),
                      "Force that the cost pulls to, (n,).")
        .add_property("NE", &getNE, "Takes lambda to the wrench about the centre of mass, (6, n).")
        .add_property("force", getter(&Contact::force), "lambda, in the surface's frame, (n,).")
        .add_property(
            "active", &getActive,
            "Which inequalities the answer was found with as equations, (m,) of bool. Others\n"
            "may be equations, too, where more meet than are needed.")
        .add_property("multipliers", getter(&Contact::multipliers),
                      "mu of the inequalities in the minimum of the cost, (m,): zero where one is\n"
                      "not active; not negative, but for those that the relaxation multiplies.")
        .add_property(
            "relaxation_multipliers", getter(&Contact::relaxation_multipliers),
            "mu' of the inequalities in the relaxation, (m,), not negative: where one is\n"
            "positive, all forces that come as close to the wrench hold it as an\n"
            "equation. Zero where no relaxation was needed. Below 1e-10 of the distance, or\n"
            "1e-14 of the scale, it is rounding.")
        .def(PrintVisitor<Contact>(&writeContact))
        .def(CopyVisitor<Contact>());
  }

  bp::class_<WrenchMargin>("WrenchMargin",
                           "How far a wrench is from what the contacts cannot give.", bp::no_init)
      .def_readonly("margin", &WrenchMargin::margin,
                    "The largest s for which the wrench stays within reach when s, divided by the\n"
                    "axis's wrench weight, is added to or taken from any of its components [N]. 0\n"
                    "out of reach or where some component cannot be given at all; infinite where\n"
                    "any wrench can be given; NaN where there is no answer.")
      .def_readonly("axis", &WrenchMargin::axis,
                    "The component that gives way first, 0 to 5; -1 where the margin is infinite\n"
                    "or NaN, or the wrench out of reach.")
      .def_readonly("sign", &WrenchMargin::sign, "The sign of what is added to it; 0 likewise.")
      .def(PrintVisitor<WrenchMargin>(&writeMargin))
      .def(CopyVisitor<WrenchMargin>());

  bp::class_<WrenchDistribution>(
      "WrenchDistribution",
      "How contacts share a wrench: the cheapest forces within all inequalities that give it,\n"
      "equations (9-13), or the closest wrench that the contacts can give. clear(), add() every\n"
      "contact, solve(), result().\n\n"
      "Contacts are held in slots, numbered from 0 on. What is kept from one problem to the next\n"
      "is kept by slot: storage, and which inequalities were active, from where the next solve()\n"
      "starts.",
      bp::init<>(bp::arg("self")))
      .def(
          "setWrenchWeights",
          method<WrenchDistribution>(&WrenchDistribution::setWrenchWeights, "weights"),
          "Weights of the norm in which the closest wrench is the closest, (6,): three of the\n"
          "force, three of the moment [1/m]; all 1 by default. Their common factor means nothing;\n"
          "apart by more than about 1e4, some wrenches out of reach end as NumericalFailure, and\n"
          "computeMargin() may be wrong. ValueError unless all are finite and > 0.")
      .def("getWrenchWeights", &WrenchDistribution::getWrenchWeights, bp::arg("self"), Copied(),
           "Those weights, (6,).")
      .def("setWarmStart", method(&WrenchDistribution::setWarmStart, "warmStart"),
           "Whether solve() starts from the inequalities that were active in each slot's last\n"
           "answer, as is the default; else it starts with none. A slot that takes no part in up\n"
           "to ten solve() still knows its own afterwards; after more it starts with none. That\n"
           "changes how long it takes, and answers by no more than rounding.")
      .def("getWarmStart", &WrenchDistribution::getWarmStart, bp::arg("self"),
           "Whether it does; True by default.")
      .def("setMaximalIterations",
           method(&WrenchDistribution::setMaximalIterations, "maximalIterations"),
           "How many iterations solve() may take, kMaximalIterations by default: those of\n"
           "DistributionResult.iterations. Of feet on level ground nearly all problems take less\n"
           "than 10; a problem that needs more than this ends as NumericalFailure. A controller\n"
           "sets 50, or what docs/real_time.md says of the time that it has. ValueError unless\n"
           "maximalIterations > 0.")
      .def("getMaximalIterations", &WrenchDistribution::getMaximalIterations, bp::arg("self"),
           "How many iterations solve() may take.")
      .def("reserve", &reserve, (bp::arg("self"), bp::arg("contact"), bp::arg("slot")),
           "Gets a slot's storage ready for a contact, so that a problem with it allocates\n"
           "nothing, whichever of the other slots take part. ValueError if the contact was never\n"
           "initialised, slot is more than the number of slots that there are, or it is taken.")
      .def("reset", &WrenchDistribution::reset, bp::arg("self"),
           "Forgets contacts, slots, and the answer; weights and settings stay.")
      .def("clear", &WrenchDistribution::clear, bp::arg("self"),
           "Begins a new problem, without contacts. If what is added next has the slots,\n"
           "inequalities and weights of before, a solve() without an answer keeps the forces of\n"
           "before.")
      .def<void (WrenchDistribution::*)(const ContactBase&)>(
          "add", &WrenchDistribution::add, (bp::arg("self"), bp::arg("contact")),
          "Adds a contact, with the matrices that it has now, in the slot of its position.\n"
          "ValueError if it was never initialised, the slot is taken, or one of the contacts has\n"
          "no set, getSet(), and another is more than a pyramid; NotReadyError if\n"
          "updateNewtonEuler() never placed it.")
      .def("add", &addInSlot, (bp::arg("self"), bp::arg("contact"), bp::arg("slot")),
           "The same in another slot, for contacts that are not always the same ones. ValueError,\n"
           "too, if slot is more than the number of slots that there are.")
      .def("add", &addMatrices, (bp::arg("self"), bp::arg("A"), bp::arg("weights"), bp::arg("NE")),
           "Adds a contact by its matrices, in the slot of its position: inequalities\n"
           "A lambda <= 0, (m, n); weights > 0 of the cost, (n,); NE, (6, n), takes lambda to the\n"
           "wrench about the centre of mass. ValueError if the sizes do not fit, A is not finite,\n"
           "a weight is not finite and > 0, the slot is taken, or another contact is more than a\n"
           "pyramid.")
      .def(
          "solve", &solve, (bp::arg("self"), bp::arg("wrench"), bp::arg("minimalScale") = 0.),
          "Solves for the forces that give a wrench, (6,): force [N], moment [N·m] about the\n"
          "centre of mass, world axes, or the closest to it. Tolerances are relative to its norm,\n"
          "but at least to that of a force of minimalScale, >= 0 [N]. Returns the\n"
          "DistributionStatus.")
      .def("result", &WrenchDistribution::result, bp::arg("self"), Copied(),
           "The last solve()'s DistributionResult, a copy.")
      .def("forgetAnswers", &WrenchDistribution::forgetAnswers, bp::arg("self"),
           "Forgets which inequalities were active, and forces that would be kept: the next\n"
           "solve() starts cold, and does not depend on those before.")
      .def("forgetForces", &WrenchDistribution::forgetForces, bp::arg("self"),
           "Forgets the forces that a solve() without an answer would keep: until there is one\n"
           "again, they are zero.")
      .def("computeMargin", &WrenchDistribution::computeMargin, bp::arg("self"),
           "How far the last solve()'s wrench is from what the contacts cannot give: a\n"
           "WrenchMargin. Up to twelve small problems, too much for a control loop.")
      .def(PrintVisitor<WrenchDistribution>(&writeDistribution))
      .def(CopyVisitor<WrenchDistribution>())
      .attr("kMaximalIterations") = WrenchDistribution::kMaximalIterations;
}

}  // namespace dynacom::python
