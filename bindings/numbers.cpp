// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"

// Boost.Python takes Python's own numbers only. What comes out of an array, `contacts[k]` for
// example, is one of numpy's. Number takes them, too: floating-point numbers and integers become
// double, integers int and an index, booleans bool. Complex numbers and times do not say which
// number they would be, and are refused.

namespace dynacom::python {

namespace {

// A class of numpy; it lives as long as the process, as the converters do.
PyTypeObject* numpyClass(const char* name) {
  const bp::object cls = bp::import("numpy").attr(name);
  return reinterpret_cast<PyTypeObject*>(bp::incref(cls.ptr()));
}

bool isFloating(PyObject* object) {
  static PyTypeObject* const floating = numpyClass("floating");
  return PyObject_TypeCheck(object, floating) != 0;
}

// Without timedelta64, which numpy counts as one.
bool isInteger(PyObject* object) {
  static PyTypeObject* const integer = numpyClass("integer");
  static PyTypeObject* const time = numpyClass("timedelta64");
  return PyObject_TypeCheck(object, integer) != 0 && PyObject_TypeCheck(object, time) == 0;
}

bool isBool(PyObject* object) {
  static PyTypeObject* const boolean = numpyClass("bool_");
  return PyObject_TypeCheck(object, boolean) != 0;
}

// Of numpy's numbers those that stand for a value, as Python's; null for all else.
template <class Value>
bp::handle<> toPython(PyObject* object) {
  if constexpr (std::is_same_v<Value, bool>) {
    if (isBool(object)) return bp::handle<>(PyBool_FromLong(PyObject_IsTrue(object)));
  } else if constexpr (std::is_integral_v<Value>) {
    if (isInteger(object)) return bp::handle<>(PyNumber_Index(object));
  } else if (isFloating(object) || isInteger(object)) {
    return bp::handle<>(PyNumber_Float(object));
  }
  return {};
}

template <class Value>
struct FromPython {
  static void add() {
    bp::converter::registry::push_back(
        &convertible, &construct, bp::type_id<Number<Value>>(),
        &bp::converter::expected_from_python_type_direct<Value>::get_pytype);
  }

  static void* convertible(PyObject* object) {
    const bool fits = bp::extract<Value>(object).check() || toPython<Value>(object);
    return fits ? object : nullptr;
  }

  static void construct(PyObject* object, bp::converter::rvalue_from_python_stage1_data* data) {
    using Storage = bp::converter::rvalue_from_python_storage<Number<Value>>;
    const bp::handle<> number = toPython<Value>(object);
    const Value value = bp::extract<Value>(number ? number.get() : object)();
    data->convertible = new (reinterpret_cast<Storage*>(data)->storage.bytes) Number<Value>{value};
  }
};

}  // namespace

void takeNumbers() {
  FromPython<bool>::add();
  FromPython<int>::add();
  FromPython<std::size_t>::add();
  FromPython<double>::add();
}

bp::object toNumberAs(const bp::object& present, const bp::object& value) {
  bp::handle<> number;
  if (PyBool_Check(present.ptr()))
    number = toPython<bool>(value.ptr());
  else if (PyLong_Check(present.ptr()))
    number = toPython<int>(value.ptr());
  else if (PyFloat_Check(present.ptr()))
    number = toPython<double>(value.ptr());
  return number ? bp::object(number) : value;
}

}  // namespace dynacom::python
