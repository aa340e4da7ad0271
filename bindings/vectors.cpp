// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"

namespace dynacom::python {

namespace {

[[noreturn]] void refuse(const char* name, int size, const std::string& got) {
  const std::string message = internal::concat(name, " must be an array, a list or a tuple of ",
                                               size, " numbers, got ", got);
  PyErr_SetString(PyExc_TypeError, message.c_str());
  throw bp::error_already_set();
}

std::string describeRefused(const bp::object& values) {
  if (!PyObject_HasAttrString(values.ptr(), "dtype")) return typeName(values);
  const bp::object shape = values.attr("shape"), type = values.attr("dtype");
  const bp::object description = bp::str("{}, shape {}, type {}").attr("format");
  return bp::extract<std::string>(description(typeName(values), shape, type));
}

}  // namespace

std::string typeName(const bp::object& object) { return Py_TYPE(object.ptr())->tp_name; }

void requireSequence(const char* name, const bp::object& values, const char* elements) {
  const bool is_array =
      PyArray_Check(values.ptr()) &&
      PyArray_NDIM(reinterpret_cast<PyArrayObject*>(values.ptr())) > 0;  // else it has no length
  if (is_array || PyList_Check(values.ptr()) || PyTuple_Check(values.ptr())) return;
  const std::string message = internal::concat(name, " must be an array, a list or a tuple of ",
                                               elements, ", got ", typeName(values));
  PyErr_SetString(PyExc_TypeError, message.c_str());
  throw bp::error_already_set();
}

const double* findNumbers(const bp::object& values, int size) {
  if (!PyArray_Check(values.ptr())) return nullptr;
  auto* const array = reinterpret_cast<PyArrayObject*>(values.ptr());
  const bool fits = PyArray_NDIM(array) == 1 && PyArray_DIM(array, 0) == size &&
                    PyArray_TYPE(array) == NPY_DOUBLE && PyArray_ISCARRAY_RO(array);
  return fits ? static_cast<const double*>(PyArray_DATA(array)) : nullptr;
}

Eigen::VectorXd toNumbers(const char* name, const bp::object& values, int size) {
  const bp::extract<Eigen::VectorXd> array(values);
  if (array.check()) return array();
  if (!PyList_Check(values.ptr()) && !PyTuple_Check(values.ptr()))
    refuse(name, size, describeRefused(values));
  Eigen::VectorXd numbers(bp::len(values));
  for (Eigen::Index k = 0; k < numbers.size(); ++k) {
    const bp::object value = values[k];
    const bp::extract<Real> number(value);
    if (!number.check())
      refuse(name, size,
             internal::concat(typeName(value), " as number ", k, " of a ", typeName(values)));
    numbers[k] = number();
  }
  return numbers;
}

std::string toText(const Eigen::VectorXd& values) {
  const Eigen::IOFormat row(Eigen::StreamPrecision, Eigen::DontAlignCols, " ", " ", "", "", "[",
                            "]");
  return internal::concat(values.transpose().format(row));
}

std::string toText(const std::vector<std::string>& names) {
  std::string text = "[";
  for (const std::string& name : names) text += (text.size() > 1 ? ", '" : "'") + name + "'";
  return text + "]";
}

bp::tuple reduceEnum(const bp::object& self) {
  const bp::object cls = self.attr("__class__"), name = self.attr("name");
  return bp::make_tuple(bp::object(bp::import("builtins").attr("getattr")),
                        bp::make_tuple(cls, name));
}

void setKnownAttribute(const bp::object& self, const bp::str& name, const bp::object& value) {
  // Classes of a user's own, derived from ours, may have what they like.
  PyObject* const type = reinterpret_cast<PyObject*>(Py_TYPE(self.ptr()));
  const bool ours = PyMapping_HasKeyString(Py_TYPE(self.ptr())->tp_dict, "__setattr__") != 0;
  if (ours && !PyObject_HasAttr(type, name.ptr())) {
    PyErr_Format(PyExc_AttributeError, "'%s' has no attribute '%U'", Py_TYPE(self.ptr())->tp_name,
                 name.ptr());
    bp::throw_error_already_set();
  }
  const bp::handle<> property(bp::allow_null(PyObject_GetAttr(type, name.ptr())));
  if (!property) PyErr_Clear();
  const bool is_field = property && PyObject_TypeCheck(property.get(), &PyProperty_Type);
  const bp::object own = is_field ? toNumberAs(self.attr(name), value) : value;
  if (PyObject_GenericSetAttr(self.ptr(), name.ptr(), own.ptr()) != 0)
    bp::throw_error_already_set();
}

}  // namespace dynacom::python
