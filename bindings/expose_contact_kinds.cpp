// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/contact_grasp.hpp"
#include "dynacom/contact_polygon.hpp"
#include "surface_options.hpp"

namespace dynacom::python {

namespace {

// Before initialize() there is nothing to tell.
template <class Contact>
std::string write(const char* name, const Contact& contact) {
  return contact.cols() == 0 ? internal::concat(name, "()")
                             : internal::concat(name, "(", contact.getSettings(), ")");
}
std::string writePolygon(const ContactPolygon& contact) { return write("ContactPolygon", contact); }
std::string writeGrasp(const ContactGrasp& contact) { return write("ContactGrasp", contact); }

bp::object getVertices(const ContactPolygonSettings& self) {
  return toArray(self.vertices.transpose());
}
void setVertices(ContactPolygonSettings& self, const bp::object& vertices) {
  self.vertices = toColumns<2>("vertices", vertices);
}

template <class Contact, class Settings>
bp::class_<Contact, bp::bases<ContactBase>, std::shared_ptr<Contact>> expose(const char* name,
                                                                             const char* doc) {
  bp::class_<Contact, bp::bases<ContactBase>, std::shared_ptr<Contact>> cls(
      name, doc, bp::init<>(bp::arg("self"), "A contact that waits for initialize()."));
  cls.def(bp::init<const Settings&>((bp::arg("self"), bp::arg("settings")),
                                    "Raises ValueError if a setting is out of its range."))
      .def("initialize", &Contact::initialize, (bp::arg("self"), bp::arg("settings")),
           "Takes new settings; may be called again. The force becomes zero. Raises ValueError if\n"
           "a setting is out of its range, and then nothing has changed.")
      .def("getSettings", &Contact::getSettings, bp::arg("self"), Copied(),
           "A copy of the settings.");
  return cls;
}

}  // namespace

void exposeFrictionModel() {
  bp::enum_<FrictionModel> model(
      "FrictionModel",
      "What of Coulomb's cone, |(f_x, f_y)| <= mu f_z, a contact uses.\n\n"
      "OuterPyramid: the pyramid around it, |f_x|, |f_y| <= mu f_z: up to sqrt(2) mu f_z on its\n"
      "diagonals. InnerPyramid: that within it. Facets: one around it of more sides. Cone: the\n"
      "cone itself.");
  model.value("OuterPyramid", FrictionModel::OuterPyramid)
      .value("InnerPyramid", FrictionModel::InnerPyramid)
      .value("Facets", FrictionModel::Facets)
      .value("Cone", FrictionModel::Cone);
  model.attr("__reduce__") = bp::make_function(&reduceEnum);
}

void exposeContactKinds() {
  using Polygon = ContactPolygonSettings;
  bp::class_<Polygon>(
      "ContactPolygonSettings",
      "What describes a ContactPolygon. The defaults describe a frictionless point.",
      bp::init<>(bp::arg("self")))
      .def_readwrite("mu", &Polygon::mu, "Friction coefficient, >= 0.")
      .def_readwrite("gu", &Polygon::gu, "Yaw friction: |tau_z| <= gu f_z, >= 0 [m].")
      .add_property("vertices", &getVertices, &setVertices,
                    "Places in the surface's plane between which pressure may be, (n, 2) [m]; one\n"
                    "at least.")
      .add_property("weights", getter(&Polygon::weights), setter(&Polygon::weights, "weights"),
                    "Weights of (force [1/N], moment [1/(N·m)]) in the cost, which squares them,\n"
                    "(6,), > 0.")
      .def_readwrite("frame_name", &Polygon::frame_name, "Name of the frame; not empty.")
      .def(SurfaceOptionsVisitor<Polygon>())
      .def(SettingsVisitor<Polygon>());
  expose<ContactPolygon, Polygon>(
      "ContactPolygon",
      "A convex polygon that gives a wrench (force [N], moment [N·m]): it pushes, with its centre\n"
      "of pressure between the vertices, with friction and a bound on the yaw moment.")
      .def(PrintVisitor<ContactPolygon>(&writePolygon));

  using Grasp = ContactGraspSettings;
  bp::class_<Grasp>("ContactGraspSettings",
                    "What describes a ContactGrasp. The defaults describe one that holds whatever\n"
                    "comes.",
                    bp::init<>(bp::arg("self")))
      .add_property("lower", getter(&Grasp::lower), setter(&Grasp::lower, "lower"),
                    "Least (force [N], moment [N·m]) in the grasp's frame, (6,).")
      .add_property("upper", getter(&Grasp::upper), setter(&Grasp::upper, "upper"),
                    "Greatest (force [N], moment [N·m]) in the grasp's frame, (6,), >= lower.")
      .add_property("weights", getter(&Grasp::weights), setter(&Grasp::weights, "weights"),
                    "Weights of (force [1/N], moment [1/(N·m)]) in the cost, which squares them,\n"
                    "(6,), > 0.")
      .add_property("reference", getter(&Grasp::reference), setter(&Grasp::reference, "reference"),
                    "Force that the cost pulls to, (6,) [N], [N·m].")
      .add_property(
          "placement",
          bp::make_getter(&Grasp::placement, bp::return_value_policy<bp::return_by_value>()),
          bp::make_setter(&Grasp::placement),
          "Of the grasp in the contact's frame (pinocchio.SE3).")
      .def_readwrite("frame_name", &Grasp::frame_name, "Name of the frame; not empty.")
      .def(SettingsVisitor<Grasp>());
  expose<ContactGrasp, Grasp>(
      "ContactGrasp",
      "A hand on a rail, a magnet, a suction cup: it gives a wrench (force [N], moment [N·m]) "
      "that\n"
      "pulls as well as it pushes, each component between bounds of its own.")
      .def(PrintVisitor<ContactGrasp>(&writeGrasp));
}

}  // namespace dynacom::python
