// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/centroidal.hpp"

#include <pinocchio/algorithm/centroidal.hpp>

#include "check.hpp"
#include "nan.hpp"

namespace dynacom {

namespace {

template <int size>
Eigen::Matrix<double, size, 1> finiteOrNaN(const Eigen::Matrix<double, size, 1>& point) {
  return point.allFinite() ? point : Eigen::Matrix<double, size, 1>::Constant(internal::kNaN);
}

// (7) and (23): the point from which an acceleration a repels the CoM.
Eigen::Vector3d repellentPoint(const CentroidalState& state, const Eigen::Vector3d& acceleration,
                               double omega) {
  internal::requireOmega(omega);
  return state.com - acceleration / (omega * omega);
}

}  // namespace

CentroidalState computeCentroidalState(const pinocchio::Model& model, pinocchio::Data& data,
                                       const Eigen::Ref<const Eigen::VectorXd>& q,
                                       const Eigen::Ref<const Eigen::VectorXd>& v,
                                       const Eigen::Ref<const Eigen::VectorXd>& a) {
  internal::requireSize("q", q.size(), Eigen::Index(model.nq), "components (nq)");
  internal::requireSize("v", v.size(), Eigen::Index(model.nv), "components (nv)");
  internal::requireSize("a", a.size(), Eigen::Index(model.nv), "components (nv)");
  pinocchio::computeCentroidalMomentumTimeVariation(model, data, q, v, a);
  return readCentroidalState(data);
}

CentroidalState readCentroidalState(const pinocchio::Data& data) {
  CentroidalState state;
  state.mass = data.mass[0];
  state.com = data.com[0];
  state.vcom = data.vcom[0];
  state.acom = data.dhg.linear() / state.mass;
  state.am = data.hg.angular();
  state.amVariation = data.dhg.angular();
  return state;
}

CentroidalWrench computeGroundWrench(const CentroidalState& state, const Eigen::Vector3d& gravity,
                                     const Eigen::Matrix<double, 6, 1>& extWrench) {
  return {state.mass * (state.acom - gravity) - extWrench.head<3>(),  // (1)
          state.amVariation - extWrench.tail<3>()};                   // (2)
}

CentroidalState applyGroundWrench(const CentroidalState& state,
                                  const CentroidalWrench& groundWrench,
                                  const Eigen::Vector3d& gravity,
                                  const Eigen::Matrix<double, 6, 1>& extWrench) {
  CentroidalState applied = state;
  applied.acom = (groundWrench.force + extWrench.head<3>()) / state.mass + gravity;  // (1)
  applied.amVariation = groundWrench.torque + extWrench.tail<3>();                   // (2)
  return applied;
}

Eigen::Vector2d computeFlatGroundCoP(const CentroidalWrench& groundWrench,
                                     const Eigen::Vector3d& com, double groundHeight,
                                     double minimalVerticalForce) {
  const Eigen::Vector3d& f = groundWrench.force;
  const Eigen::Vector3d& tau = groundWrench.torque;
  const Eigen::Vector2d s_tau(-tau.y(), tau.x());
  const Eigen::Vector2d cop =
      com.head<2>() + (s_tau - f.head<2>() * (com.z() - groundHeight)) / f.z();  // (5)
  if (!(f.z() >= minimalVerticalForce) || !cop.allFinite())
    return Eigen::Vector2d::Constant(internal::kNaN);
  return cop;
}

Eigen::Vector2d computeVRP(const CentroidalState& state, double omega) {
  return finiteOrNaN<2>(repellentPoint(state, state.acom, omega).head<2>());  // (7)
}

Eigen::Vector3d computeVRP3D(const CentroidalState& state, double omega) {
  return finiteOrNaN<3>(repellentPoint(state, state.acom, omega));  // (7)
}

Eigen::Vector3d computeECMP(const CentroidalState& state, const Eigen::Vector3d& gravity,
                            double omega) {
  return finiteOrNaN<3>(repellentPoint(state, state.acom - gravity, omega));  // (23)
}

Eigen::Vector2d computeDCM(const CentroidalState& state, double omega) {
  internal::requireOmega(omega);
  return finiteOrNaN<2>(state.com.head<2>() + state.vcom.head<2>() / omega);  // (20)
}

}  // namespace dynacom
