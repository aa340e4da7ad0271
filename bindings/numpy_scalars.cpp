// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"

// Boost.Python takes Python's own numbers only. What comes out of an array, `contacts[k]` for
// example, is one of numpy's. For them there are these converters: floating-point numbers and
// integers become double, integers int and an index, booleans bool. Complex numbers and times do
// not say which number they would be, and are refused.
//
// A process has one registry of converters, so that Pinocchio's functions, and those of every other
// module of Boost.Python, take these numbers too, once DynaCoM is imported. That does no harm: the
// converters stand behind all others of their type, so what was taken before is taken as before,
// and what was refused before is the same number as it would be in Python.

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

template <class Value>
struct FromNumpyScalar {
  static void add() {
    bp::converter::registry::push_back(&convertible, &construct, bp::type_id<Value>());
  }

  static void* convertible(PyObject* object) {
    bool fits = false;
    if constexpr (std::is_same_v<Value, bool>) {
      fits = isBool(object);
    } else if constexpr (std::is_integral_v<Value>) {
      fits = isInteger(object);
    } else {
      fits = isFloating(object) || isInteger(object);
    }
    return fits ? object : nullptr;
  }

  static void construct(PyObject* object, bp::converter::rvalue_from_python_stage1_data* data) {
    void* storage =
        reinterpret_cast<bp::converter::rvalue_from_python_storage<Value>*>(data)->storage.bytes;
    if constexpr (std::is_same_v<Value, bool>) {
      new (storage) Value(PyObject_IsTrue(object) == 1);
    } else if constexpr (std::is_integral_v<Value>) {
      const bp::object index(bp::handle<>(PyNumber_Index(object)));
      new (storage) Value(bp::extract<Value>(index));
    } else {
      new (storage) Value(PyFloat_AsDouble(object));
      if (PyErr_Occurred()) bp::throw_error_already_set();
    }
    data->convertible = storage;
  }
};

}  // namespace

void takeNumpyScalars() {
  FromNumpyScalar<bool>::add();
  FromNumpyScalar<int>::add();
  FromNumpyScalar<unsigned long>::add();  // pinocchio::FrameIndex, std::size_t
  FromNumpyScalar<double>::add();
}

}  // namespace dynacom::python
