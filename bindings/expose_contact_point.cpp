// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/contact_point.hpp"
#include "surface_options.hpp"

namespace dynacom::python {

namespace {

std::string write(const ContactPoint& contact) {
  // Before initialize() there is nothing to tell.
  return contact.cols() == 0 ? "ContactPoint()"
                             : internal::concat("ContactPoint(", contact.getSettings(), ")");
}

}  // namespace

void exposeContactPoint() {
  using Settings = ContactPointSettings;
  bp::class_<Settings>("ContactPointSettings",
                       "What describes a ContactPoint. The defaults describe a frictionless point.",
                       bp::init<>(bp::arg("self")))
      .def_readwrite("mu", &Settings::mu, "Friction coefficient, >= 0.")
      .add_property("weights", getter(&Settings::weights), setter(&Settings::weights, "weights"),
                    "Weights of (f_x, f_y, f_z) in the cost, which squares them, (3,), > 0 [1/N].")
      .def_readwrite("frame_name", &Settings::frame_name, "Name of the frame; not empty.")
      .def_readwrite("world_aligned", &Settings::world_aligned,
                     "True: the surface's axes are the world's. For ball feet.")
      .def_readwrite("radius", &Settings::radius,
                     "The point lies this far below the frame's origin along the normal, >= 0 [m].")
      .def(SurfaceOptionsVisitor<Settings>())
      .def(SettingsVisitor<Settings>());

  bp::class_<ContactPoint, bp::bases<ContactBase>, std::shared_ptr<ContactPoint>>(
      "ContactPoint", "A point that gives a force (f_x, f_y, f_z) [N]: it pushes, with friction.",
      bp::init<>(bp::arg("self"), "A contact that waits for initialize()."))
      .def(bp::init<const Settings&>((bp::arg("self"), bp::arg("settings")),
                                     "Raises ValueError if a setting is out of its range."))
      .def("initialize", &ContactPoint::initialize, (bp::arg("self"), bp::arg("settings")),
           "Takes new settings; may be called again. The force becomes zero. Raises ValueError if\n"
           "a setting is out of its range, and then nothing has changed.")
      .def("getSettings", &ContactPoint::getSettings, bp::arg("self"), Copied(),
           "A copy of the settings.")
      .def("setMu", method(&ContactPoint::setMu, "mu"), "Friction coefficient, >= 0.")
      .def("setForceWeights", method(&ContactPoint::setForceWeights, "force_weights"),
           "force_weights: (3,), > 0 [1/N].")
      .def(PrintVisitor<ContactPoint>(&write));
}

}  // namespace dynacom::python
