// SPDX-License-Identifier: BSD-2-Clause
#include <cstring>

#include "bindings.hpp"

// Boost.Python takes Python's own numbers only. What comes out of an array, `contacts[k]` for
// example, is one of numpy's.

namespace dynacom::python {

namespace {

bool isNumpyScalar(PyObject* object) {
  return std::strncmp(Py_TYPE(object)->tp_name, "numpy.", 6) == 0 &&
         !PyObject_HasAttrString(object, "__len__");
}

template <class Value>
struct FromNumpyScalar {
  static void add() {
    bp::converter::registry::push_back(&convertible, &construct, bp::type_id<Value>());
  }

  static void* convertible(PyObject* object) {
    if (!isNumpyScalar(object)) return nullptr;
    const PyNumberMethods* number = Py_TYPE(object)->tp_as_number;
    if (number == nullptr) return nullptr;
    const bool is_bool = std::strncmp(Py_TYPE(object)->tp_name, "numpy.bool", 10) == 0;
    if constexpr (std::is_same_v<Value, bool>) return is_bool ? object : nullptr;
    if constexpr (std::is_integral_v<Value>) return PyIndex_Check(object) ? object : nullptr;
    return number->nb_float != nullptr && !is_bool ? object : nullptr;
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
  FromNumpyScalar<unsigned long>::add();  // pinocchio::FrameIndex
  FromNumpyScalar<double>::add();
}

}  // namespace dynacom::python
