// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "bindings.hpp"
#include "dynacom/surface_options.hpp"

namespace dynacom::python {

/// The fields of SurfaceOptions, and the force that the cost pulls to, of settings that have both.
template <class Settings>
struct SurfaceOptionsVisitor : bp::def_visitor<SurfaceOptionsVisitor<Settings>> {
  /// Of the settings, which Boost.Python takes for a member of their base.
  template <class Value>
  static Value Settings::*own(Value SurfaceOptions::*field) {
    return field;
  }

  template <class PyClass>
  void visit(PyClass& cls) const {
    cls.def_readwrite("friction", own(&Settings::friction),
                      "FrictionModel; OuterPyramid by default.")
        .def_readwrite("facets", own(&Settings::facets),
                       "Sides of FrictionModel.Facets, from 4 to 64; 8 by default.")
        .def_readwrite("facet_angle", own(&Settings::facet_angle),
                       "Of the first side's normal, from the x axis [rad].")
        .def_readwrite("least_normal_force", own(&Settings::least_normal_force),
                       "The normal force is no less, >= 0; 0 by default [N].")
        .def_readwrite("greatest_normal_force", own(&Settings::greatest_normal_force),
                       "The normal force is no more, >= least_normal_force; infinite by default "
                       "[N].")
        .add_property("placement",
                      bp::make_getter(own(&Settings::placement),
                                      bp::return_value_policy<bp::return_by_value>()),
                      bp::make_setter(own(&Settings::placement)),
                      "Of the surface in the contact's frame (pinocchio.SE3).")
        .add_property("reference", getter(&Settings::reference),
                      setter(&Settings::reference, "reference"),
                      "Force that the cost pulls to, as many components as weights.");
  }
};

}  // namespace dynacom::python
