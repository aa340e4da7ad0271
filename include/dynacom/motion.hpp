// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "dynacom/dyna_com.hpp"

namespace dynacom {

/// A robot's motion, one column per frame.
struct DYNACOM_EXPORT Motion {
  Eigen::VectorXd time;  ///< frames, strictly increasing [s]
  Eigen::MatrixXd q;     ///< configurations, nq × frames
  Eigen::MatrixXd v;     ///< velocities, nv × frames
  Eigen::MatrixXd a;     ///< accelerations, nv × frames

  Eigen::Index frames() const { return time.size(); }

  /// @throws std::invalid_argument naming the first array (and frame) that has another size than
  ///         the model or time says, or a number that is not finite, a quaternion whose norm is not
  ///         1, or a time that does not increase
  void validate(const pinocchio::Model& model) const;
};

/// Which contacts are active when.
struct DYNACOM_EXPORT ContactSchedule {
  using Matrix = Eigen::Matrix<bool, Eigen::Dynamic, Eigen::Dynamic>;

  std::vector<std::string> names;  ///< of contacts
  Matrix active;                   ///< names.size() × frames

  /// @throws std::invalid_argument if a name is there twice, or active has another size
  void validate(Eigen::Index frames) const;
};

/// What analyzeMotion() needs to know besides.
struct DYNACOM_EXPORT AnalysisSettings {
  /// Whether the centre of pressure is that of flat horizontal ground; see
  /// DynaCoM::computeDynamics.
  bool flat_horizontal_ground = true;
  /// ω of the virtual repellent point [rad/s]. 0 stands for √(g / mean height of the CoM above the
  /// ground).
  double omega = 0.;
  /// Called now and then with the number of frames done.
  std::function<void(Eigen::Index)> progress;

  /// @throws std::invalid_argument unless omega is finite and >= 0
  void validate() const;
};

/// What analyzeMotion() found: one column per frame, in the world's axes, SI units.
struct MotionAnalysis {
  /// What one contact does.
  struct Contact {
    std::string name;
    Eigen::Array<bool, Eigen::Dynamic, 1> active;
    /// Wrench (force, moment) in the surface's frame, about its origin; zero where not active.
    Eigen::Matrix<double, 6, Eigen::Dynamic> wrench;
    /// Vertical component of the force, in the world [N].
    Eigen::VectorXd vertical_force;
  };

  double omega;  ///< The ω in use; NaN where there is none, and then vrp and nl are NaN.
  Eigen::VectorXd time;
  Eigen::Matrix3Xd com, vcom, acom;              ///< c, ċ, c̈
  Eigen::Matrix3Xd am, dam;                      ///< L, L̇
  Eigen::Matrix3Xd ground_force, ground_torque;  ///< about c
  Eigen::Matrix2Xd cop, vrp, nl;
  std::vector<DistributionStatus> status;
  /// Ground wrench minus what the contacts give, about c.
  Eigen::Matrix<double, 6, Eigen::Dynamic> residual;
  std::vector<Contact> contacts;  ///< all, as getKnownContacts() of the robot
};

/// Computes dynamics and distribution for every frame of a motion, whose contacts are placed by the
/// model: a pose that was measured once says nothing of them. The robot given is left as it is.
/// @throws std::invalid_argument if motion or schedule is not valid, or the schedule names a
///         contact that the robot does not know; contacts without schedule are never active.
///         NotReadyError before the robot's initialize()
DYNACOM_EXPORT MotionAnalysis analyzeMotion(const DynaCoM& robot, const Motion& motion,
                                            const ContactSchedule& schedule,
                                            const AnalysisSettings& settings = AnalysisSettings());

}  // namespace dynacom
