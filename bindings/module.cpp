// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/errors.hpp"

namespace dynacom::python {

namespace {

// std::invalid_argument is ValueError already.
void translate(const NotReadyError& error) {
  const bp::object type = bp::import("dynacom.errors").attr("NotReadyError");
  PyErr_SetString(type.ptr(), error.what());
}

}  // namespace

}  // namespace dynacom::python

BOOST_PYTHON_MODULE(dynacom_pywrap) {
  using namespace dynacom::python;
  // First of all: Pinocchio registers the types that ours take and return.
  bp::import("pinocchio");
  eigenpy::enableEigenPy();
  eigenpy::enableEigenPySpecific<Eigen::Matrix<double, 6, 1>>();
  eigenpy::enableEigenPySpecific<Eigen::Matrix<double, 6, Eigen::Dynamic>>();
  eigenpy::enableEigenPySpecific<Eigen::Matrix<bool, Eigen::Dynamic, Eigen::Dynamic>>();

  const bp::docstring_options docstrings(/*user*/ true, /*python signatures*/ true, /*C++*/ false);
  bp::scope().attr("__version__") = DYNACOM_VERSION;
  bp::register_exception_translator<dynacom::NotReadyError>(&translate);
  takeNumbers();
  exposeCentroidal();
  exposeGroundPlane();
  exposeContactSet();
  exposeFrictionModel();
  exposeContactBase();
  exposeContactPoint();
  exposeContact6D();
  exposeContactKinds();
  exposeWrenchDistribution();
  exposeDistributionSolver();
  exposeDynaCoM();
  exposeNumberTable();
  exposeMotion();
  exposeContactSchedule();
  exposeRecordedMotion();
  exposeMotionAnalysis();
  exposeCollisionPoints();
  exposeContactInference();
  exposeCentroidalFilter();
  exposeMotionRepair();
  exposeMotionRepairer();
  exposeMotionVerdict();
  exposeMissingSupport();
  exposeTerrain();
  exposeMotionStatistics();
  exposeMotionExamination();
}
