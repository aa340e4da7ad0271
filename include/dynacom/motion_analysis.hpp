// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "dynacom/contact_schedule.hpp"
#include "dynacom/surface_options.hpp"

namespace dynacom {

/// What analyzeMotion() needs to know besides.
struct DYNACOM_EXPORT AnalysisSettings {
  /// Whether the centre of pressure is that of flat horizontal ground; see
  /// DynaCoM::computeDynamics.
  bool flat_horizontal_ground = true;
  /// ω of the virtual repellent point and the divergent component of motion [rad/s]. 0 stands for
  /// √(g / mean height of the CoM above the ground).
  double omega = 0.;
  /// Called now and then, in the caller's thread, with the number of frames done, which increases.
  /// Dynamics come first, of all frames, without a call.
  std::function<void(Eigen::Index)> progress;
  /// How many threads do the work, at most; 0 stands for as many as the machine has. Blocks of 256
  /// frames, each of which starts cold, are what a thread takes: results are the same, bit for bit,
  /// whatever the number of threads.
  int threads = 0;
  /// How many frames a thread computes at once, at most, in the lanes of SIMD registers; see
  /// countLanes(). 1 stands for none of that. Results are the same but for rounding.
  int lanes = kMaximalLanes;

  /// @throws std::invalid_argument unless omega is finite and >= 0, threads >= 0 and lanes >= 1
  void validate() const;
};

/// How many lanes this machine has for a robot, and no more than so many: 8 with AVX-512, 4 with
/// AVX2, and 1 where there is neither, or where the robot has what lanes do not know: other joints
/// than those of URDFs, other contacts than ContactPoint and Contact6D, or one that is fixed to the
/// world.
/// @throws std::invalid_argument unless lanes >= 1; NotReadyError before the robot's initialize()
DYNACOM_EXPORT int countLanes(const DynaCoM& robot, int lanes = kMaximalLanes);

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
    /// DynaCoM::getContactCoP() [m], getContactFrictionUsage(), getContactYawUsage() and
    /// getContactCoPMargin() [m]; NaN where not active.
    Eigen::Matrix2Xd cop;
    Eigen::VectorXd friction_usage, yaw_usage, cop_margin;
    SurfaceOptions friction;  ///< whose usage that is
  };

  /// What a link does that touches something besides the contacts.
  struct Body {
    std::string link;
    Eigen::Array<bool, Eigen::Dynamic, 1> active;
    Eigen::Matrix3Xd force;  ///< [N]; zero where not active
    /// Where it pushes: the mean of its parts' positions, weighed by their vertical forces [m]; NaN
    /// where there is no such force.
    Eigen::Matrix3Xd position;
  };

  double omega;  ///< The ω in use; NaN where there is none, and then vrp, nl and dcm are NaN.
  Eigen::VectorXd time;
  Eigen::Matrix3Xd com, vcom, acom;              ///< c, ċ, c̈
  Eigen::Matrix3Xd am, dam;                      ///< L, L̇
  Eigen::Matrix3Xd ground_force, ground_torque;  ///< about c
  Eigen::Matrix3Xd feasible_acom, feasible_dam;  ///< c̈*, L̇*: what the contacts can cause
  Eigen::Matrix2Xd cop, vrp, nl;
  Eigen::Matrix2Xd dcm;  ///< divergent component of motion c + ċ/ω, (20)
  std::vector<DistributionStatus> status;
  /// Ground wrench minus what the contacts give, about c.
  Eigen::Matrix<double, 6, Eigen::Dynamic> residual;
  std::vector<Contact> contacts;  ///< all, as getKnownContacts() of the robot
  /// Of gatherParts(): the same for the parts of these contacts.
  std::vector<Contact> parts;
  std::vector<Body> bodies;  ///< of gatherParts(), as PartRobot::bodies
};

/// Computes dynamics and distribution for every frame of a motion, whose contacts are placed by the
/// model: a pose that was measured once says nothing of them. The robot given is left as it is.
/// A frame with a quaternion whose norm is not 1 (up to 1e-3) is as one of
/// DynaCoM::computeDynamics: its numbers are NaN, and its status is
/// DistributionStatus::InvalidInput.
/// @throws std::invalid_argument if the schedule or else of the motion is not valid, or the
/// schedule
///         names a contact that the robot does not know; contacts without schedule are never
///         active. NotReadyError before the robot's initialize()
DYNACOM_EXPORT MotionAnalysis analyzeMotion(const DynaCoM& robot, const Motion& motion,
                                            const ContactSchedule& schedule,
                                            const AnalysisSettings& settings = AnalysisSettings());

}  // namespace dynacom
