// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <pinocchio/multibody.hpp>

#include "dynacom/export.hpp"

namespace dynacom {

/// The motion of a robot's centre of mass c, and its momentum about it, in the world's axes.
struct CentroidalState {
  double mass;                  ///< m [kg]
  Eigen::Vector3d com;          ///< c, world [m]
  Eigen::Vector3d vcom;         ///< ċ [m/s]
  Eigen::Vector3d acom;         ///< c̈ [m/s²], without gravity
  Eigen::Vector3d am;           ///< L, angular momentum about c [kg·m²/s]
  Eigen::Vector3d amVariation;  ///< L̇ [N·m]
};

/// A wrench about the CoM, in the world's axes.
struct CentroidalWrench {
  Eigen::Vector3d force;   ///< f [N]
  Eigen::Vector3d torque;  ///< τ about c [N·m]
};

/// The centroidal state of a robot in motion, by pinocchio::computeCentroidalMomentumTimeVariation,
/// which leaves kinematics (oMi, v, a) and momenta (hg, dhg) in data.
/// @param q  configuration, model.nq
/// @param v  velocity, model.nv
/// @param a  acceleration, model.nv
/// @throws std::invalid_argument if a vector has another size
DYNACOM_EXPORT CentroidalState computeCentroidalState(const pinocchio::Model& model,
                                                      pinocchio::Data& data,
                                                      const Eigen::Ref<const Eigen::VectorXd>& q,
                                                      const Eigen::Ref<const Eigen::VectorXd>& v,
                                                      const Eigen::Ref<const Eigen::VectorXd>& a);

/// The centroidal state found in data, in which
/// pinocchio::computeCentroidalMomentumTimeVariation(model, data, q, v, a) has run before.
DYNACOM_EXPORT CentroidalState readCentroidalState(const pinocchio::Data& data);

/// Newton and Euler, equations (1, 2): the wrench about c that the ground must give,
///
///     f = m (c̈ − g) − f_e      τ = L̇ − τ_e
///
/// @param gravity    g, world [m/s²]
/// @param extWrench  (f_e [N], τ_e [N·m]): what else acts on the robot, about c, world axes
DYNACOM_EXPORT CentroidalWrench computeGroundWrench(
    const CentroidalState& state, const Eigen::Vector3d& gravity,
    const Eigen::Matrix<double, 6, 1>& extWrench = Eigen::Matrix<double, 6, 1>::Zero());

/// The inverse of computeGroundWrench(): the state, with the accelerations that a ground wrench
/// causes,
///
///     c̈ = (f + f_e)/m + g      L̇ = τ + τ_e
DYNACOM_EXPORT CentroidalState applyGroundWrench(
    const CentroidalState& state, const CentroidalWrench& groundWrench,
    const Eigen::Vector3d& gravity,
    const Eigen::Matrix<double, 6, 1>& extWrench = Eigen::Matrix<double, 6, 1>::Zero());

/// Below this vertical force a centre of pressure means nothing, unless one says otherwise [N].
constexpr double kMinimalVerticalForce = 1.;

/// Centre of pressure of a ground wrench on flat horizontal ground, equation (5),
///
///     p = c + (S τ − f (c_z − h)) / f_z,   S = [0 −1; 1 0]
///
/// of which x and y are meant.
/// @param com           c, world [m]
/// @param groundHeight  h, world [m]
/// @param minimalVerticalForce  what f_z must have at least, > 0 [N]
/// @return p, world [m]; NaN where f_z is below that, or p is beyond the largest numbers
DYNACOM_EXPORT Eigen::Vector2d computeFlatGroundCoP(
    const CentroidalWrench& groundWrench, const Eigen::Vector3d& com, double groundHeight = 0.,
    double minimalVerticalForce = kMinimalVerticalForce);

/// Virtual repellent point on the ground's plane, equation (7): v = c − c̈ / ω² [m]; NaN where that
/// is beyond the largest numbers.
/// @param omega  ω > 0, natural frequency of the linear inverted pendulum [rad/s]
/// @throws std::invalid_argument unless ω is finite and > 0
DYNACOM_EXPORT Eigen::Vector2d computeVRP(const CentroidalState& state, double omega);

/// The same in three dimensions: the total force on the robot, gravity's included, is m ω² (c − v).
/// A pendulum whose v is to stay Δz above its eCMP has ω = √(|g|/Δz).
/// @throws std::invalid_argument unless ω > 0
DYNACOM_EXPORT Eigen::Vector3d computeVRP3D(const CentroidalState& state, double omega);

/// Enhanced centroidal moment pivot, equation (23): e = c − (c̈ − g) / ω² [m], so that the force on
/// the robot besides gravity's, the ground's where nothing else acts, is m ω² (c − e). It lies on
/// that force's line through c, and v = e − g/ω² above it. NaN where that is beyond the largest
/// numbers.
/// @param gravity  g, world [m/s²]
/// @param omega    ω > 0, natural frequency of the linear inverted pendulum [rad/s]
/// @throws std::invalid_argument unless ω > 0
DYNACOM_EXPORT Eigen::Vector3d computeECMP(const CentroidalState& state,
                                           const Eigen::Vector3d& gravity, double omega);

/// Divergent component of motion on the ground's plane, equation (20): ξ = c + ċ / ω [m]; NaN where
/// that is beyond the largest numbers.
/// @param omega  ω > 0, natural frequency of the linear inverted pendulum [rad/s]
/// @throws std::invalid_argument unless ω is finite and > 0
DYNACOM_EXPORT Eigen::Vector2d computeDCM(const CentroidalState& state, double omega);

}  // namespace dynacom
