// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <iosfwd>
#include <string>
#include <utility>
#include <vector>

#include "dynacom/contact_inference.hpp"
#include "dynacom/motion.hpp"

namespace dynacom {

/// What changes of a motion cost in repairMotion(), and how far from the limits it ends.
struct DYNACOM_EXPORT RepairSettings {
  /// Displacements of the root and of joints that slide [m], and turns of the root and of joints
  /// [rad], that cost 1 in a second each.
  double displacement = 0.005, turn = 0.05;
  /// The changes of their accelerations that do [m/s²], [rad/s²].
  double linear_acceleration = 1., angular_acceleration = 25.;
  /// By which part friction is left unused, and how far inside what carries wrenches press [m], so
  /// that a motion that is written and read again is still feasible.
  double friction_margin = 0.02, support_margin = 0.001;
  /// An active part that is so far from its place costs 1 in a second [m].
  double held_point = 0.0003;
  /// A contact that moves by no more than this in a stance stands still in it, where it is on
  /// average [m]. One that drifts by more slides as it did, but no faster than the second [m/s], or
  /// 1.8 times as fast, as long as that keeps it within the third of where it was [m]; else it
  /// slides in earnest, and goes on so.
  double largest_drift = 0.02, slide_speed = 0.1, largest_shift = 0.1;
  /// How high above the ground a contact that does not carry is at least, as far as it can get
  /// there from one stance to the next [m].
  double clearance = 0.01;
  /// How far within their ranges joints stay [rad], [m], and which part of their speeds is left
  /// unused.
  double joint_margin = 0.002, speed_margin = 0.01;
  /// Longer motions are repaired in windows of this length; each also finds so much beyond its end,
  /// which the next one finds anew [s].
  double window = 10., overlap = 2.;
  /// Whether contacts stand still, level with their ground, and parts in the air keep above theirs;
  /// whether joints keep within their positions and velocities; and whether the first and the last
  /// configuration stay as they are.
  bool feet = true, joints = true, pinned_ends = false;

  using Field = std::pair<const char*, double RepairSettings::*>;
  using Switch = std::pair<const char*, bool RepairSettings::*>;
  /// All numbers by name, and what is on or off.
  static const std::vector<Field>& fields();
  static const std::vector<Switch>& switches();

  /// @throws std::invalid_argument naming the first field out of its range: all are finite and > 0,
  ///         but margins and the largest drift may be 0, and those of friction and speed are < 1
  void validate() const;
  std::string to_string() const;
  bool operator==(const RepairSettings& other) const;
  bool operator!=(const RepairSettings& other) const { return !(*this == other); }
};

DYNACOM_EXPORT std::ostream& operator<<(std::ostream& out, const RepairSettings& settings);

/// What was made of a contact that carries for some time.
struct RepairedStance {
  std::size_t contact;         ///< whose parts these are: PartRobot::Part::contact
  Eigen::Index first, behind;  ///< frames
  double drift;   ///< largest distance of a part from where it is on average, before [m]
  bool is_still;  ///< whether it was held still; not where the motion stays as it is
};

/// What is known of the ground that parts stand on.
struct DYNACOM_EXPORT RepairGround {
  /// Under each part, as ContactInference::ground, parts × frames [m]; NaN where it is not known.
  /// Without rows, nothing is.
  Eigen::MatrixXd height = {};
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< a treadmill's [m/s]
};

/// The ground for contacts to stand on level: ContactInference::ground, but that stances within
/// kSameLevel of each other which are on no slope are on one level, the median of their lowest
/// parts' heights by their durations. Of a sole that is tilted, the lowest part tells where the
/// ground is.
/// @param parts      whose stances the inference has
/// @param inference  with its schedule
/// @param time       of the frames [s]
/// @throws std::invalid_argument if sizes differ
DYNACOM_EXPORT RepairGround findRepairGround(const std::vector<PartRobot::Part>& parts,
                                             const ContactInference& inference,
                                             const Eigen::VectorXd& time);

/// A motion whose contacts can give what it needs, near another one.
struct DYNACOM_EXPORT RepairedMotion {
  Motion motion;           ///< with the derivatives of differentiate()
  Eigen::MatrixXd change;  ///< of the configurations, in the tangent space before, nv × frames
  /// What contacts still cannot give, (force [N], moment [N·m]) about the CoM, 6 × frames; zero in
  /// frames that are free.
  Eigen::Matrix<double, 6, Eigen::Dynamic> residual;
  std::vector<RepairedStance> stances;
  double root_rms = 0., root_largest = 0.;    ///< of the root's displacement [m]
  double joint_rms = 0., joint_largest = 0.;  ///< of the changes of joints that turn [rad]
  double held_largest = 0.;                   ///< distance of an active part from its place [m]
  double sunk_largest = 0.;  ///< of a part in the air, below its ground, if that is known [m]
  /// How far a joint is beyond its range at most [rad], [m], and by which part faster than it can
  /// be; zero if none is. Joints of one number are looked at.
  double joint_excess = 0., speed_excess = 0.;
  /// Whether all wrenches are within reach, but for 1e-7 of the weight.
  bool within_reach = true;
};

/// Finds the smallest change of a motion after which its contacts can give what it needs: changes
/// d_t of the configurations that minimise
///
///     ∫ ‖d‖²/σ_d² + ‖d̈‖²/σ_a² + Σ ‖p_k − p̄_k‖²/σ_p² dt
///
/// while the wrench of each frame, of the velocities and accelerations that differentiate() gives
/// it, is within what its contacts can give where they are then. The sum is over the active parts,
/// whose places are p_k: p̄_k is where a contact stands still that drifts by little, else where the
/// part was. Gauss–Newton over the whole motion: wrenches are linearised by the derivatives of the
/// centroidal dynamics (Carpentier and Mansard, Analytical Derivatives of Rigid Body Dynamics
/// Algorithms, 2018), and split from the changes as in distanceToFeasible(); last steps take the
/// nearest motion within all cones, of whose costs only the sum counts. What takes place in frames
/// of which nothing is asked, or has no feasible motion nearby, shows in the residual.
///
/// Where they are to (RepairSettings), contacts that stand still do so level with their ground:
/// where their placement, on average, is closest to the heights of the ground under the parts that
/// carry; what drifts keeps those heights. Parts in the air that are below their ground are lifted
/// to it, and joints beyond their limits held at these: by costs, from when they are so on.
///
/// A motion whose wrenches are all within reach, whose joints are within their limits and whose
/// parts are within a millimetre from where they are to be comes back as it is, bit for bit.
/// @param parts     whose contacts are points, of splitContacts(); the root must be a free-flyer
/// @param motion    whose time and configurations are read; four frames at least
/// @param schedule  of the parts, by their names; without schedule a part never carries
/// @param settings  costs and margins
/// @param free      frames of whose wrench nothing is asked; empty if there are none
/// @param ground    that parts stand on
/// @param start     configurations with which the search begins, nq × frames; the motion's own if
///                  empty
/// @param anew      whether all is found anew although a start is given; else only what is out of
///                  reach there is mended
/// @throws std::invalid_argument if settings or the motion are not valid, the root is another, the
///         schedule names a part that there is not, sizes differ, there are more than 32 parts, or
///         what a frame needs is too large for numbers
DYNACOM_EXPORT RepairedMotion repairMotion(const PartRobot& parts, const Motion& motion,
                                           const ContactSchedule& schedule,
                                           const RepairSettings& settings = {},
                                           const Eigen::Array<bool, Eigen::Dynamic, 1>& free = {},
                                           const RepairGround& ground = {},
                                           const Eigen::MatrixXd& start = {}, bool anew = true);

}  // namespace dynacom
