// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/contact6d.hpp"
#include "surface_options.hpp"

namespace dynacom::python {

namespace {

std::string write(const Contact6D& contact) {
  // Before initialize() there is nothing to tell.
  return contact.cols() == 0 ? "Contact6D()"
                             : internal::concat("Contact6D(", contact.getSettings(), ")");
}

}  // namespace

void exposeContact6D() {
  using Settings = Contact6DSettings;
  bp::class_<Settings>("Contact6DSettings",
                       "What describes a Contact6D. The defaults describe a frictionless point.",
                       bp::init<>(bp::arg("self")))
      .def_readwrite("mu", &Settings::mu, "Friction coefficient, >= 0.")
      .def_readwrite("gu", &Settings::gu,
                     "Yaw friction: |tau_z| <= gu f_z, >= 0 [m]; without meaning with coupled_yaw.")
      .def_readwrite(
          "coupled_yaw", &Settings::coupled_yaw,
          "Whether yaw is bounded by what friction at the four corners can give besides\n"
          "the rest of the wrench, equation (27), rather than by gu; False by default.\n"
          "For pyramids of four sides, without bounds and reference; such contacts are\n"
          "described by matrices alone, and share no wrench with ones that are more than\n"
          "pyramids.")
      .def_readwrite("half_length", &Settings::half_length, "Half extent along x, >= 0 [m].")
      .def_readwrite("half_width", &Settings::half_width, "Half extent along y, >= 0 [m].")
      .add_property("weights", getter(&Settings::weights), setter(&Settings::weights, "weights"),
                    "Weights of (force [1/N], moment [1/(N·m)]) in the cost, which squares them,\n"
                    "(6,), > 0.")
      .def_readwrite("frame_name", &Settings::frame_name,
                     "Name of the frame at the rectangle's centre; not empty.")
      .def(SurfaceOptionsVisitor<Settings>())
      .def(SettingsVisitor<Settings>());

  bp::class_<Contact6D, bp::bases<ContactBase>, std::shared_ptr<Contact6D>>(
      "Contact6D",
      "A rectangle that gives a wrench (force [N], moment [N·m]): it pushes, with its centre of\n"
      "pressure inside, with friction and a bound on the yaw moment.",
      bp::init<>(bp::arg("self"), "A contact that waits for initialize()."))
      .def(bp::init<const Settings&>((bp::arg("self"), bp::arg("settings")),
                                     "Raises ValueError if a setting is out of its range."))
      .def("initialize", &Contact6D::initialize, (bp::arg("self"), bp::arg("settings")),
           "Takes new settings; may be called again. The force becomes zero. Raises ValueError if\n"
           "a setting is out of its range, and then nothing has changed.")
      .def("getSettings", &Contact6D::getSettings, bp::arg("self"), Copied(),
           "A copy of the settings.")
      .def("setMu", method(&Contact6D::setMu, "mu"), "Friction coefficient, >= 0.")
      .def("setGu", method(&Contact6D::setGu, "gu"), "Yaw friction, >= 0 [m].")
      .def("setForceWeights", method(&Contact6D::setForceWeights, "force_weights"),
           "force_weights: (3,), > 0 [1/N].")
      .def("setTorqueWeights", method(&Contact6D::setTorqueWeights, "torque_weights"),
           "torque_weights: (3,), > 0 [1/(N·m)].")
      .def("setSurfaceHalfWidth", method(&Contact6D::setSurfaceHalfWidth, "half_width"),
           "half_width: >= 0 [m].")
      .def("setSurfaceHalfLength", method(&Contact6D::setSurfaceHalfLength, "half_length"),
           "half_length: >= 0 [m].")
      .def(PrintVisitor<Contact6D>(&write));
}

}  // namespace dynacom::python
