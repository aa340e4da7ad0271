// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <eigenpy/eigenpy.hpp>
#include <utility>

// What the bindings have in common. Vectors and matrices come in as any numpy array of numbers and
// go out as copies; errors of C++ become those of Python, see module.cpp.

namespace dynacom::python {

namespace bp = boost::python;

void exposeCentroidal();
void exposeContactBase();
void exposeContactPoint();
void exposeContact6D();
void exposeWrenchDistribution();
void exposeDynaCoM();
void exposeMotion();

/// A property that hands out a copy of a member, and takes one if it may be written.
template <class Class, class Value>
bp::object getter(Value Class::*member) {
  return bp::make_getter(member, bp::return_value_policy<bp::return_by_value>());
}
template <class Class, class Value>
bp::object setter(Value Class::*member) {
  return bp::make_setter(member, bp::default_call_policies());
}

/// A matrix as an array with two dimensions: a matrix of one row or column would have only one.
template <class Derived>
bp::object toArray(const Eigen::MatrixBase<Derived>& matrix) {
  return bp::object(matrix.eval()).attr("reshape")(matrix.rows(), matrix.cols());
}

/// A method that returns a matrix.
template <class Class, class Result, Result (Class::*method)() const>
bp::object callForArray(const Class& self) {
  return toArray((self.*method)());
}
#define DYNACOM_MATRIX(Class, method) \
  &callForArray<Class, decltype(std::declval<const Class&>().method()), &Class::method>

/// For methods that return a reference: Python gets a copy.
using Copied = bp::return_value_policy<bp::copy_const_reference>;

/// Gives a class __copy__ and __deepcopy__, both by its copy constructor.
template <class Class>
struct CopyVisitor : bp::def_visitor<CopyVisitor<Class>> {
  template <class PyClass>
  void visit(PyClass& cls) const {
    cls.def("copy", &copy, bp::arg("self"), "A copy that shares nothing with this.")
        .def("__copy__", &copy, bp::arg("self"))
        .def("__deepcopy__", &deepcopy, (bp::arg("self"), bp::arg("memo")));
  }
  static Class copy(const Class& self) { return self; }
  static Class deepcopy(const Class& self, const bp::dict&) { return self; }
};

/// Gives a settings struct its printing, comparing and copying.
template <class Settings>
struct SettingsVisitor : bp::def_visitor<SettingsVisitor<Settings>> {
  template <class PyClass>
  void visit(PyClass& cls) const {
    cls.def(bp::self == bp::self)
        .def(bp::self != bp::self)
        .def("validate", &Settings::validate, bp::arg("self"),
             "Raises ValueError, naming the first field out of its range.")
        .def("to_string", &Settings::to_string, bp::arg("self"))
        .def("__str__", &Settings::to_string, bp::arg("self"))
        .def("__repr__", &Settings::to_string, bp::arg("self"))
        .def(CopyVisitor<Settings>());
  }
};

}  // namespace dynacom::python
