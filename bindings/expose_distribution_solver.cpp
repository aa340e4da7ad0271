// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/distribution_solver.hpp"

namespace dynacom::python {

namespace {

using Problem = DistributionProblem;
using Contact = DistributionProblem::Contact;
using Solution = DistributionSolution;

// One number for each component of the force; no numbers for None.
Eigen::VectorXd toForce(const char* name, const bp::object& values, const ContactSet& set) {
  if (values.is_none()) return {};
  const int size = static_cast<int>(set.size());
  const Eigen::VectorXd numbers = toNumbers(name, values, size);
  internal::requireSize(name, numbers.size(), set.size(), "components");
  return numbers;
}

template <Problem::Components Contact::*member>
bp::object getForce(const Contact& self) {
  return (self.*member).size() == 0 ? bp::object() : bp::object(Eigen::VectorXd(self.*member));
}

Eigen::Matrix3d toRotation(const bp::object& rows) {
  if (rows.is_none()) return Eigen::Matrix3d::Identity();
  const Eigen::Matrix3Xd columns = toColumns<3>("rotation", rows);
  internal::requireSize("rotation", columns.cols(), Eigen::Index(3), "rows");
  return columns.transpose();
}

std::shared_ptr<Contact> makeContact(const ContactSet& set, const bp::object& rotation,
                                     const bp::object& lever, const bp::object& weights,
                                     const bp::object& reference) {
  const Contact contact = {set, toRotation(rotation), toVector<3>("lever", lever),
                           toForce("weights", weights, set), toForce("reference", reference, set)};
  contact.validate();
  return std::make_shared<Contact>(contact);
}

bp::object getNE(const Contact& self) {
  return toArray(Eigen::Matrix<double, 6, Eigen::Dynamic>(self.NE()));
}

std::vector<Contact> toContacts(const bp::object& contacts) {
  requireSequence("contacts", contacts, "DistributionContact");
  std::vector<Contact> all;
  for (bp::ssize_t k = 0; k < bp::len(contacts); ++k) {
    const bp::object element = contacts[k];
    const bp::extract<const Contact&> contact(element);
    if (!contact.check()) {
      const std::string message = internal::concat("contacts[", k, "] must be a ",
                                                   "DistributionContact, got ", typeName(element));
      PyErr_SetString(PyExc_TypeError, message.c_str());
      throw bp::error_already_set();
    }
    all.push_back(contact());
  }
  return all;
}

// A tuple: Python could append to a list, to no effect.
bp::tuple getContacts(const Problem& self) { return bp::tuple(toList(self.contacts)); }
void setContacts(Problem& self, const bp::object& contacts) {
  self.contacts = toContacts(contacts);
}

Eigen::Matrix<double, 6, 1> toWrenchWeights(const bp::object& weights) {
  if (weights.is_none()) return Eigen::Matrix<double, 6, 1>::Ones();
  return toVector<6>("wrench_weights", weights);
}

std::shared_ptr<Problem> makeProblem(const bp::object& contacts, const bp::object& wrench,
                                     const bp::object& wrench_weights, double minimal_scale) {
  Problem problem{toContacts(contacts), toVector<6>("wrench", wrench),
                  toWrenchWeights(wrench_weights), minimal_scale};
  problem.validate();
  return std::make_shared<Problem>(std::move(problem));
}

Solution solve(DistributionSolver& self, const Problem& problem) {
  problem.validate();
  return self.solve(problem);
}

Solution solveMoved(DistributionSolver& self, const Problem& problem) {
  problem.validate();
  return self.solveMoved(problem);
}

bp::list getForces(const Solution& self) {
  return toList(std::vector<Eigen::VectorXd>(self.forces.begin(), self.forces.end()));
}

bp::list getBounds(const Solution& self) {
  bp::list all;
  for (std::size_t k = 0; k < self.bounds.size(); ++k) {
    const auto components = self.bounds[k].head(self.forces[k].size());
    all.append(Eigen::VectorXi(components.cast<int>()));
  }
  return all;
}

std::string writeContact(const Contact& contact) {
  std::string text = internal::concat("DistributionContact(set=", contact.set, ", rotation=[");
  for (Eigen::Index k = 0; k < 3; ++k)
    text += (k > 0 ? ", " : "") + toText(contact.rotation.row(k).transpose());
  text += internal::concat("], lever=", toText(contact.lever));
  if (contact.weights.size() > 0) text += ", weights=" + toText(Eigen::VectorXd(contact.weights));
  if (contact.reference.size() > 0)
    text += ", reference=" + toText(Eigen::VectorXd(contact.reference));
  return text + ")";
}

std::string writeProblem(const Problem& problem) {
  return internal::concat("DistributionProblem(contacts=", problem.contacts.size(),
                          ", wrench=", toText(problem.wrench),
                          ", wrench_weights=", toText(problem.wrench_weights),
                          ", minimal_scale=", problem.minimal_scale, ")");
}

std::string writeSolution(const Solution& solution) {
  std::string forces;
  for (const auto& force : solution.forces)
    forces += (forces.empty() ? "" : ", ") + toText(Eigen::VectorXd(force));
  return internal::concat("DistributionSolution(status=", solution.status,
                          ", achieved=", toText(solution.achieved),
                          ", residual=", toText(solution.residual), ", cost=", solution.cost,
                          ", iterations=", solution.iterations, ", forces=[", forces, "])");
}

std::string writeSolver(const DistributionSolver&) { return "DistributionSolver()"; }

}  // namespace

void exposeDistributionSolver() {
  bp::class_<Contact, std::shared_ptr<Contact>>(
      "DistributionContact",
      "A contact of a DistributionProblem: its set of forces lambda, and where it is. It does not\n"
      "change once it is made; DistributionProblem::Contact in C++.",
      bp::no_init)
      .def("__init__",
           bp::make_constructor(
               &makeContact, bp::default_call_policies(),
               (bp::arg("set"), bp::arg("rotation") = bp::object(),
                bp::arg("lever") = bp::make_tuple(0., 0., 0.), bp::arg("weights") = bp::object(),
                bp::arg("reference") = bp::object())),
           "set: a ContactSet; rotation: of its surface, in the world, (3, 3), whose columns are\n"
           "the surface's axes, the world's by default; lever: from the CoM to the surface's "
           "origin,\n"
           "(3,) [m]; weights: of each component in the cost, which squares them, (set.size(),),\n"
           "> 0, 1 by default; reference: the lambda_0 from which the cost is counted,\n"
           "(set.size(),), 0 by default. ValueError if one is not finite, or of another size or "
           "range.")
      .add_property("set", getter(&Contact::set), "ContactSet, a copy.")
      .add_property("rotation", getter(&Contact::rotation), "(3, 3).")
      .add_property("lever", getter(&Contact::lever), "(3,) [m].")
      .add_property("weights", &getForce<&Contact::weights>, "(set.size(),), or None: 1.")
      .add_property("reference", &getForce<&Contact::reference>, "(set.size(),), or None: 0.")
      .def("NE", &getNE, bp::arg("self"),
           "Takes lambda to the wrench about the CoM, (6, set.size()), (13).")
      .def(PrintVisitor<Contact>(&writeContact))
      .def(CopyVisitor<Contact>());

  bp::class_<Problem, std::shared_ptr<Problem>>(
      "DistributionProblem",
      "How contacts are to share a wrench: the forces lambda_k of all contacts, each in its set,\n"
      "that give it at the least half sum of |W_k (lambda_k - lambda_0k)|^2; and where none give\n"
      "it, in two stages: first the reachable wrench closest to it in the norm |D w|, then the\n"
      "cheapest forces that give that. Wrenches are (6,): force [N] and moment [N·m] about the\n"
      "CoM, in the world's axes.",
      bp::no_init)
      .def("__init__",
           bp::make_constructor(
               &makeProblem, bp::default_call_policies(),
               (bp::arg("contacts"), bp::arg("wrench"), bp::arg("wrench_weights") = bp::object(),
                bp::arg("minimal_scale") = 0.)),
           "contacts: DistributionContact; wrench: (6,); wrench_weights: the diagonal of D, (6,),\n"
           "> 0, 1 by default; minimal_scale: >= 0 [N]. ValueError as of validate().")
      .add_property("contacts", &getContacts, &setContacts,
                    "DistributionContact each, copies; to change one, set all.")
      .add_property("wrench", getter(&Problem::wrench), setter(&Problem::wrench, "wrench"),
                    "What is asked for, (6,).")
      .add_property("wrench_weights", getter(&Problem::wrench_weights),
                    setter(&Problem::wrench_weights, "wrench_weights"),
                    "The diagonal of D, (6,), > 0.")
      .def_readwrite("minimal_scale", &Problem::minimal_scale,
                     "Tolerances are relative to |D w|, but at least to that of a force of this\n"
                     "size, >= 0 [N].")
      .def("validate", &Problem::validate, bp::arg("self"),
           "Raises ValueError, naming what is not finite, or of another size or range.")
      .def("scale", &Problem::scale, bp::arg("self"), "What tolerances are relative to.")
      .def(PrintVisitor<Problem>(&writeProblem))
      .def(CopyVisitor<Problem>());

  bp::class_<Solution>("DistributionSolution",
                       "The answer to a DistributionProblem, and with it its proof.", bp::no_init)
      .def_readonly("status", &Solution::status, "DistributionStatus.")
      .add_property("forces", &getForces, "lambda of each contact, (3,) or (6,).")
      .add_property("achieved", getter(&Solution::achieved), "The wrench that they give, (6,).")
      .add_property("residual", getter(&Solution::residual), "wrench - achieved, (6,).")
      .def_readonly("cost", &Solution::cost, "Half the sum of |W (lambda - lambda_0)|^2.")
      .add_property(
          "multipliers", getter(&Solution::multipliers),
          "Multipliers nu of NE lambda = achieved in the minimum of the cost, (6,): each\n"
          "lambda is the projection of lambda_0 + W^-2 NE' nu, in the metric of W, on its\n"
          "set, or where the wrench is out of reach, on the face of that in which\n"
          "NE' D^2 residual · lambda is largest; (29).")
      .add_property(
          "bounds", &getBounds,
          "Of each contact and component the bound that it is at, -1 or 1, or 0, (3,) or\n"
          "(6,) of integers: of f_z its own bounds, of others those that grow with it. Of\n"
          "sections that are no rectangles both components are 1 on the boundary.")
      .def_readonly("iterations", &Solution::iterations, "Steps of Newton's method.")
      .def_readonly("iterations_in_vain", &Solution::iterations_in_vain,
                    "How many of these were tried from the last answer, and led nowhere.")
      .def_readonly(
          "is_accurate", &Solution::is_accurate,
          "Whether the answer has all digits that doubles have: not where only the\n"
          "proximal point method has led to it, and, of Relaxed ones, next to the boundary\n"
          "and where rounding decides what the residual exposes.")
      .def_readonly(
          "is_clear", &Solution::is_clear,
          "Whether it has all digits but for how close the boundary is, too: its faces are\n"
          "known for sure, and the forces on them, but of the residual not more digits than\n"
          "it is large.")
      .def("isOptimal", &Solution::isOptimal,
           (bp::arg("self"), bp::arg("problem"), bp::arg("tolerance") = 1e-6),
           "Whether this is the answer to a problem, judged by nothing but both: forces in their\n"
           "sets, no reachable wrench closer, and no cheaper forces, (25, 26). tolerance: of each\n"
           "of these, relative to the terms that it compares. False for InvalidInput and\n"
           "NumericalFailure.")
      .def(PrintVisitor<Solution>(&writeSolution))
      .def(CopyVisitor<Solution>());

  bp::class_<DistributionSolver>(
      "DistributionSolver",
      "Solves DistributionProblem: Newton's method on the dual in the six multipliers of the\n"
      "wrench. One solver serves one problem after another.",
      bp::init<>(bp::arg("self")))
      .def("setMaximalIterations", &DistributionSolver::setMaximalIterations,
           (bp::arg("self"), bp::arg("maximal_iterations")),
           "Steps of Newton's method that a problem may take,\n"
           "WrenchDistribution.kMaximalIterations by default. ValueError unless > 0.")
      .def("setWarmStart", &DistributionSolver::setWarmStart,
           (bp::arg("self"), bp::arg("warm_start")),
           "Whether the search begins with the multipliers of the last answer, as is the default,\n"
           "if it was for as many contacts.")
      .def("solve", &solve, (bp::arg("self"), bp::arg("problem")),
           "The DistributionSolution of a problem, a copy. ValueError as of its validate().")
      .def(
          "solveMoved", &solveMoved, (bp::arg("self"), bp::arg("problem")),
          "The same for a problem that differs from that of the last solve() in rotations, "
          "levers,\n"
          "the wrench, its weights and minimal_scale alone: nothing else of contacts is looked at\n"
          "again. ValueError as of its validate(), or if the contacts are more or fewer.")
      .def(PrintVisitor<DistributionSolver>(&writeSolver))
      .def(CopyVisitor<DistributionSolver>());
}

}  // namespace dynacom::python
