// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <eigenpy/eigenpy.hpp>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "check.hpp"

// What the bindings have in common. Vectors and matrices come in as any numpy array of numbers,
// those of a fixed size as lists and tuples too, and go out as copies; errors of C++ become those
// of Python, see module.cpp.

namespace dynacom::python {

namespace bp = boost::python;

void takeNumbers();
void exposeCentroidal();
void exposeGroundPlane();
void exposeContactBase();
void exposeContactPoint();
void exposeContact6D();
void exposeContactSet();
void exposeFrictionModel();
void exposeContactKinds();
void exposeWrenchDistribution();
void exposeDistributionSolver();
void exposeDynaCoM();
void exposeNumberTable();
void exposeMotion();
void exposeContactSchedule();
void exposeCollisionPoints();
void exposeContactInference();
void exposeCentroidalFilter();
void exposeMotionRepair();
void exposeMotionRepairer();
void exposeRecordedMotion();
void exposeMotionAnalysis();
void exposeMotionVerdict();
void exposeMissingSupport();
void exposeTerrain();
void exposeMotionStatistics();
void exposeMotionExamination();

/// A number of Python's or of numpy's, as parameters of functions are. A process has one registry
/// of Boost.Python's converters: those of double itself and the like would act on Pinocchio's
/// functions, and those of every other module, too.
template <class Value>
struct Number {
  operator Value() const { return value; }
  Value value;
};
using Real = Number<double>;
using Integer = Number<int>;
using Index = Number<std::size_t>;
using Truth = Number<bool>;

/// Numpy's number as that of Python's which is of the same kind as the one that is there; all else
/// as it is.
bp::object toNumberAs(const bp::object& present, const bp::object& value);

/// The numbers of an array, a list or a tuple; everything else is a TypeError. Not a converter of
/// Boost.Python's, for the same reason.
Eigen::VectorXd toNumbers(const char* name, const bp::object& values, int size);

/// Where an array of that many numbers holds them, if they lie there one after the other as double,
/// as in nearly all that come in; else null. Spares them Boost.Python's converters, and storage.
const double* findNumbers(const bp::object& values, int size);

/// A vector of a fixed size. Boost.Python would refuse one of another size without naming it.
template <int size>
Eigen::Matrix<double, size, 1> toVector(const char* name, const bp::object& values) {
  if (const double* numbers = findNumbers(values, size))
    return Eigen::Map<const Eigen::Matrix<double, size, 1>>(numbers);
  const Eigen::VectorXd numbers = toNumbers(name, values, size);
  internal::requireSize(name, numbers.size(), Eigen::Index(size), "components");
  return numbers;
}

/// Refuses what is no array, list or tuple.
/// @param elements  what it should have, in the plural
void requireSequence(const char* name, const bp::object& values, const char* elements);

/// Rows of a fixed size, of a two-dimensional array or a list, as columns.
template <int size>
Eigen::Matrix<double, size, Eigen::Dynamic> toColumns(const char* name, const bp::object& rows) {
  requireSequence(name, rows, "rows");
  Eigen::Matrix<double, size, Eigen::Dynamic> columns(size, bp::len(rows));
  for (Eigen::Index k = 0; k < columns.cols(); ++k) {
    const std::string row = internal::concat(name, "[", k, "]");
    columns.col(k) = toVector<size>(row.c_str(), bp::object(rows[k]));
  }
  return columns;
}

/// A property that hands out a copy of a member.
template <class Class, class Value>
bp::object getter(Value Class::*member) {
  return bp::make_getter(member, bp::return_value_policy<bp::return_by_value>());
}

/// A property that takes a vector.
template <class Class, int size>
bp::object setter(Eigen::Matrix<double, size, 1> Class::*member, const char* name) {
  return bp::make_function(
      [member, name](Class& self, const bp::object& values) {
        self.*member = toVector<size>(name, values);
      },
      bp::default_call_policies(), boost::mpl::vector3<void, Class&, const bp::object&>());
}

/// A method that takes a vector and nothing else.
template <class Class, class Result, int size>
bp::object method(Result (Class::*member)(const Eigen::Matrix<double, size, 1>&),
                  const char* name) {
  return bp::make_function(
      [member, name](Class& self, const bp::object& values) {
        return (self.*member)(toVector<size>(name, values));
      },
      bp::default_call_policies(), (bp::arg("self"), bp::arg(name)),
      boost::mpl::vector3<Result, Class&, const bp::object&>());
}

/// A method that takes a number and nothing else.
template <class Class, class Result, class Value>
std::enable_if_t<std::is_arithmetic_v<Value>, bp::object> method(Result (Class::*member)(Value),
                                                                 const char* name) {
  return bp::make_function(
      [member](Class& self, Number<Value> number) { return (self.*member)(number); },
      bp::default_call_policies(), (bp::arg("self"), bp::arg(name)),
      boost::mpl::vector3<Result, Class&, Number<Value>>());
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

/// Reads a matrix member, which has a column per frame, with a row per frame, as is usual in
/// Python: the same memory in numpy's order.
template <auto member>
struct Rows;
template <class Class, class Matrix, Matrix Class::*member>
struct Rows<member> {
  static bp::object get(const Class& self) {
    using Transposed = Eigen::Matrix<typename Matrix::Scalar, Eigen::Dynamic, Eigen::Dynamic>;
    return toArray(Transposed((self.*member).transpose()));
  }
};

/// A list as Python's.
template <class Element>
bp::list toList(const std::vector<Element>& elements) {
  bp::list list;
  for (const Element& element : elements) list.append(element);
  return list;
}

/// Reads a vector member as a list of its elements themselves, which keep their owner: for what is
/// large, and Python cannot change.
template <auto member>
struct Elements;
template <class Class, class Element, std::vector<Element> Class::*member>
struct Elements<member> {
  static bp::list get(const bp::object& self) {
    const Class& owner = bp::extract<const Class&>(self);
    const typename bp::reference_existing_object::apply<const Element&>::type refer;
    bp::list list;
    for (const Element& element : owner.*member) {
      const bp::object reference{bp::handle<>(refer(element))};
      if (!bp::objects::make_nurse_and_patient(reference.ptr(), self.ptr()))
        bp::throw_error_already_set();
      list.append(reference);
    }
    return list;
  }
};

/// The elements of any iterable.
template <class Element>
std::vector<Element> toVectorOf(const bp::object& elements) {
  std::vector<Element> vector;
  const bp::list list(elements);  // refuses what is no iterable
  for (bp::ssize_t i = 0; i < bp::len(list); ++i) vector.push_back(bp::extract<Element>(list[i]));
  return vector;
}

/// Runs without Python's lock, which whoever calls Python meanwhile has to take.
class WithoutLock {
 public:
  WithoutLock() : state_(PyEval_SaveThread()) {}
  ~WithoutLock() { PyEval_RestoreThread(state_); }
  WithoutLock(const WithoutLock&) = delete;
  WithoutLock& operator=(const WithoutLock&) = delete;

 private:
  PyThreadState* state_;
};

/// What C++ tells of its progress: a call of what may be called in Python, for which it takes
/// Python's lock, or nothing for None. The last copy must go while the lock is held.
template <class Part>
std::function<void(Part)> toProgress(const bp::object& progress) {
  if (progress.is_none()) return nullptr;
  return [function = std::make_shared<const bp::object>(progress)](Part part) {
    const PyGILState_STATE state = PyGILState_Ensure();
    bool failed = false;
    try {
      (*function)(part);
    } catch (const bp::error_already_set&) {
      failed = true;
    }
    PyGILState_Release(state);
    // The Python error stays set in this thread until Boost.Python raises it again.
    if (failed) throw bp::error_already_set();
  };
}

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

/// For __reduce__ of enums: a value is copied, and sent to another process, by its name.
/// Boost.Python's enums are integers and would come back as such, without it.
bp::tuple reduceEnum(const bp::object& self);

/// Sets an attribute that there is, to numpy's numbers as to Python's. Python would make a new one
/// of a misspelt name, and say nothing.
void setKnownAttribute(const bp::object& self, const bp::str& name, const bp::object& value);

/// The name of an object's class.
std::string typeName(const bp::object& object);

/// "[1 2 3]", as in the printing of settings.
std::string toText(const Eigen::VectorXd& values);
/// "['left', 'right']"
std::string toText(const std::vector<std::string>& names);

/// Gives a class its printing, by a function that writes "Class(field=value, ...)", and lets nobody
/// give it new attributes.
template <class Class>
struct PrintVisitor : bp::def_visitor<PrintVisitor<Class>> {
  explicit PrintVisitor(std::string (*write)(const Class&)) : write_(write) {}
  template <class PyClass>
  void visit(PyClass& cls) const {
    cls.def("__str__", write_, bp::arg("self"))
        .def("__repr__", write_, bp::arg("self"))
        .def("__setattr__", &setKnownAttribute);
  }

 private:
  std::string (*write_)(const Class&);
};

/// Gives a settings struct its printing, comparing and copying, and lets nobody give it new fields.
template <class Settings>
struct SettingsVisitor : bp::def_visitor<SettingsVisitor<Settings>> {
  template <class PyClass>
  void visit(PyClass& cls) const {
    cls.def(bp::self == bp::self)
        .def(bp::self != bp::self)
        .def("validate", &Settings::validate, bp::arg("self"),
             "Raises ValueError, naming the first field out of its range.")
        .def("to_string", &Settings::to_string, bp::arg("self"), "Names and values of the fields.")
        .def("__str__", &Settings::to_string, bp::arg("self"))
        .def("__repr__", &Settings::to_string, bp::arg("self"))
        .def("__setattr__", &setKnownAttribute)
        .def(CopyVisitor<Settings>());
  }
};

}  // namespace dynacom::python
