// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <iosfwd>
#include <string>
#include <utility>
#include <vector>

#include "dynacom/contact_parts.hpp"

namespace dynacom {

/// What changes of a motion cost in distanceToFeasible(), and how exactly the cheapest is found.
struct DYNACOM_EXPORT CentroidalFilterSettings {
  /// The displacement of the CoM [m], the change of its acceleration [m/s²], and that of the
  /// angular momentum about it [m g·m·s], that cost 1 in a second each. Without the last, a robot
  /// that leans too far would be given a moment from nowhere in place of being moved.
  double com = 0.01, com_acceleration = 1., angular_momentum = 0.003;
  /// When the iterations end: what contacts cannot give is no more than the first [m g, m g·m],
  /// root mean square over the frames, and the displacement changes by no more than the second, as
  /// a part of itself.
  double reach = 1e-3, change = 0.01;
  /// Iterations end after so many in any case.
  double maximal_iterations = 200.;
  /// What is longer is filtered in windows of this length, each with so much before and behind it
  /// [s].
  double window = 12., overlap = 1.5;

  using Field = std::pair<const char*, double CentroidalFilterSettings::*>;
  /// All fields by name.
  static const std::vector<Field>& fields();

  /// @throws std::invalid_argument naming the first field that is not finite and > 0
  void validate() const;
  std::string to_string() const;
  bool operator==(const CentroidalFilterSettings& other) const;
  bool operator!=(const CentroidalFilterSettings& other) const { return !(*this == other); }
};

DYNACOM_EXPORT std::ostream& operator<<(std::ostream& out,
                                        const CentroidalFilterSettings& settings);

/// The smallest change of a motion after which its contacts can give what it needs.
struct DYNACOM_EXPORT CentroidalChange {
  Eigen::Matrix3Xd com;               ///< displacement δ of the CoM, 3 × frames, in the world [m]
  Eigen::Matrix3Xd angular_momentum;  ///< change h of that about the CoM, 3 × frames [N·m·s]
  /// What contacts cannot give even so, (force [N], moment [N·m]) about the CoM of before, 6 ×
  /// frames.
  Eigen::Matrix<double, 6, Eigen::Dynamic> residual;
  double rms = 0., largest = 0.;  ///< of ‖δ‖ over the frames: the distance to feasible [m]
  Eigen::Index frame = 0;         ///< the first with the largest ‖δ‖
  int iterations = 0;             ///< the most that were taken in a window
  bool converged = true;          ///< whether all windows are as exact as the settings say
};

/// Finds how far a motion is from a feasible one: the change of the CoM's path, δ(t), and of the
/// angular momentum about it, h(t), that minimises
///
///     ∫ ‖δ‖²/σ_δ² + ‖δ̈‖²/σ_a² + ‖h‖²/σ_h² dt
///
/// while contacts can give the wrench of each frame, which is (f + m δ̈, τ + ḣ + δ × (f + m δ̈))
/// about the CoM of before. δ is at rest at both ends, and h is zero there. Where nothing touches,
/// the CoM is put on its parabola. Forces do not show what is Galilean or kinematic, such as an
/// offset of all heights, and so this is no distance here.
///
/// Changes are split from wrenches, and both are found in turn by the alternating direction method
/// of multipliers (Boyd et al., Distributed Optimization and Statistical Learning via the ADMM,
/// 2011): changes by a banded system whose factors are kept, wrenches frame by frame as the closest
/// ones that the contacts can give. What is bilinear in δ is linearised anew in each iteration.
/// Where nothing is to be changed for longer than the overlap, nothing is.
/// @param parts     whose contacts are points, of splitContacts()
/// @param motions   of computeContactMotions() for the parts
/// @param dynamics  of analyzeMotion() for the parts: its time, CoM and ground wrench
/// @param schedule  of the parts, by their names; without schedule a part is never active
/// @param settings  costs and tolerances
/// @param free      frames of which nothing is asked, since their accelerations are not known;
///                  empty if there are none
/// @param threads   as AnalysisSettings::threads
/// @throws std::invalid_argument if settings are not valid, the schedule names a part that there is
///         not, sizes differ, there are more than 32 parts, or numbers are not finite
DYNACOM_EXPORT CentroidalChange
distanceToFeasible(const PartRobot& parts, const std::vector<ContactMotion>& motions,
                   const MotionAnalysis& dynamics, const ContactSchedule& schedule,
                   const CentroidalFilterSettings& settings = {},
                   const Eigen::Array<bool, Eigen::Dynamic, 1>& free = {}, int threads = 0);

}  // namespace dynacom
