// SPDX-License-Identifier: BSD-2-Clause
#include "bindings.hpp"
#include "dynacom/motion.hpp"

// In C++ a frame is a column, in Python a row.

namespace dynacom::python {

namespace {

std::shared_ptr<Motion> makeMotion(const Eigen::VectorXd& time, const Eigen::MatrixXd& q,
                                   const Eigen::MatrixXd& v, const Eigen::MatrixXd& a) {
  return std::make_shared<Motion>(Motion{time, q.transpose(), v.transpose(), a.transpose()});
}

std::string writeMotion(const Motion& motion) {
  return internal::concat("Motion(frames=", motion.frames(), ", nq=", motion.q.rows(),
                          ", nv=", motion.v.rows(), ")");
}

std::string writeMismatch(const DerivativeMismatch& mismatch) {
  return internal::concat("DerivativeMismatch(velocity=", mismatch.velocity,
                          ", acceleration=", mismatch.acceleration, ")");
}

bp::object filter(const pinocchio::Model& model, const Eigen::MatrixXd& q, Real rate, Real cutoff) {
  const auto compute = [&] {
    const WithoutLock without_lock;
    return filterConfigurations(model, q.transpose(), rate, cutoff);
  };
  return toArray(compute().transpose());
}

Motion differentiateRows(const pinocchio::Model& model, const Eigen::VectorXd& time,
                         const Eigen::MatrixXd& q) {
  const WithoutLock without_lock;
  return differentiate(model, time, q.transpose());
}

double estimateNoise(const pinocchio::Model& model, const Eigen::VectorXd& time,
                     const Eigen::MatrixXd& q, Eigen::Index stride) {
  const WithoutLock without_lock;
  return estimateAccelerationNoise(model, time, q.transpose(), stride);
}

}  // namespace

void exposeMotion() {
  bp::class_<Motion, std::shared_ptr<Motion>>("Motion", "A robot's motion, one row per frame.",
                                              bp::no_init)
      .def("__init__",
           bp::make_constructor(&makeMotion, bp::default_call_policies(),
                                (bp::arg("time"), bp::arg("q"), bp::arg("v"), bp::arg("a"))),
           "time: (T,) [s]; q: (T, nq); v: (T, nv); a: (T, nv).")
      .add_property("time", getter(&Motion::time), "(T,), strictly increasing [s]")
      .add_property("q", &Rows<&Motion::q>::get, "Configurations, (T, nq)")
      .add_property("v", &Rows<&Motion::v>::get, "Velocities, (T, nv)")
      .add_property("a", &Rows<&Motion::a>::get, "Accelerations, (T, nv)")
      .add_property("frames", &Motion::frames, "T")
      .def("validate", &Motion::validate, (bp::arg("self"), bp::arg("model")),
           "Raises ValueError, naming the array and the frame, if sizes do not fit the model, a\n"
           "number is not finite, or time does not increase.")
      .def(PrintVisitor<Motion>(&writeMotion))
      .def(CopyVisitor<Motion>());

  bp::class_<DerivativeMismatch>("DerivativeMismatch",
                                 "How well derivatives fit what they are the derivatives of.",
                                 bp::no_init)
      .def_readonly("velocity", &DerivativeMismatch::velocity,
                    "Of velocities and differences of configurations, as a part of the velocities")
      .def_readonly("acceleration", &DerivativeMismatch::acceleration,
                    "Of accelerations and differences of velocities, likewise")
      .def(PrintVisitor<DerivativeMismatch>(&writeMismatch))
      .def(CopyVisitor<DerivativeMismatch>());

  bp::scope().attr("kMinimalCutoff") = kMinimalCutoff;
  bp::scope().attr("kMaximalCutoff") = kMaximalCutoff;
  bp::def(
      "filterConfigurations", &filter,
      (bp::arg("model"), bp::arg("q"), bp::arg("rate"), bp::arg("cutoff")),
      "Configurations (T, nq) without what is faster than a cut-off frequency: a Butterworth\n"
      "filter of fourth order, forward and backward, so that nothing is delayed and the gain at\n"
      "the cut-off is 1/2. Positions of free-flyers are filtered in the world, orientations and\n"
      "joints in the tangent space at the filter's last output.\n\n"
      "rate: frames per second [Hz]; cutoff: from kMinimalCutoff * rate to below\n"
      "kMaximalCutoff * rate [Hz]. Raises ValueError for others, and for configurations that are\n"
      "not valid.");
  bp::def("differentiate", &differentiateRows, (bp::arg("model"), bp::arg("time"), bp::arg("q")),
          "The Motion through configurations (T, nq) at times (T,): velocities and accelerations\n"
          "are those of the parabola through a frame and its two neighbours, in the tangent space\n"
          "at the frame; at both ends, those of the polynomial of third order through four.\n"
          "Raises ValueError as Motion.validate.");
  bp::def("estimateAccelerationNoise", &estimateNoise,
          (bp::arg("model"), bp::arg("time"), bp::arg("q"), bp::arg("stride") = 1),
          "How noisy accelerations of the centre of mass are, if they are computed from every\n"
          "stride-th of the configurations (T, nq) at times (T,) without a filter: the deviation\n"
          "of their noise, by differences of sixth order, of which the lower quartile counts [g].\n"
          "NaN for fewer than seven frames. Raises ValueError as Motion.validate, and for strides\n"
          "below 1.");
  bp::def("compareDerivatives", &compareDerivatives, (bp::arg("model"), bp::arg("motion")),
          "Compares a motion's derivatives with its differences, as root mean squares. Raises\n"
          "ValueError as Motion.validate.");
}

}  // namespace dynacom::python
