// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <iosfwd>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "dynacom/export.hpp"

namespace dynacom {

/// The constants of inferContacts(), all in seconds, metres and parts of the weight m g: none is
/// about frames. docs/truth.md has what each was tried against, and what becomes of the figures
/// when it is 0.6 or 1.6 times as large.
///
/// Costs are dimensionless: 1 is what a measure costs that is as large as its scale. Scales with a
/// least and a greatest are taken from the motion itself, between these.
struct DYNACOM_EXPORT DetectionSettings {
  // Stances: where a point is at rest, and at which height.

  /// Speed [m/s] below which a point is at rest: this part of how fast it gets (the 95th percentile
  /// of its speeds above `moving_speed`), between a least and a greatest.
  double rest_speed_part = 0.2, rest_speed_least = 0.03, rest_speed_greatest = 0.2;
  /// The same bounds for exact motions, whose points are at rest where they stand [m/s].
  double exact_rest_speed_least = 0.02, exact_rest_speed_greatest = 0.05;
  /// From where on a point moves [m/s].
  double moving_speed = 0.1;
  /// Of a point's horizontal speed this part counts: soles drift more than they float.
  double horizontal_part = 0.4;
  /// How long a point is at rest at least [s].
  double rest_duration = 0.025;
  /// Rests between which a point moves no faster than so many times the speed below which it is at
  /// rest, and whose heights differ by no more than the second [m], are one.
  double same_rest_speed = 3., same_rest = 0.01;
  /// Of a motion's frames those count for heights and scales that are this close to one in which a
  /// point moves [s], and in which some point is faster than the second [m/s]: it does not matter
  /// for how long the robot stands still.
  double near_movement = 0.5, stir_speed = 0.01;

  // Which stances are on the ground.

  /// A stance that was landed on from above, or left upward, by this much is on the ground [m].
  double landing_height = 0.015;
  /// And so is one that is within this of such a one, or of the lowest [m]; of exact motions within
  /// the second.
  double same_ground = 0.035, exact_same_ground = 0.01;

  // Links that are no contacts, and so may rest anywhere: see screenBodies().

  /// A link may have touched what was within this below it while contacts could not give what the
  /// motion needs [m].
  double body_reach = 0.1;
  /// Only the ground of a contact, or the lowest rest of all, carries links: what is no higher than
  /// this above the lowest such level, or within this of another [m]. Having been landed on makes
  /// no ground for links, since hands come to rest in the air.
  double body_ground = 0.05;

  // Scales.

  /// Of heights above the rest: their scatter at rest, between these [m].
  double height_scale_least = 0.001, height_scale_greatest = 0.02;
  /// Of speeds: this many times the median speed at rest, between these [m/s].
  double speed_scale_part = 3., speed_scale_least = 0.01, speed_scale_greatest = 0.2;
  /// Of forces [m g]: this many for each m/s of the scale of speeds, between these.
  double force_scale_part = 0.3, force_scale_least = 0.01, force_scale_greatest = 0.1;
  /// Of moments, for each unit of the scale of forces: the lever ℓ [m]. What a set of points cannot
  /// give is the least ‖force‖² + ‖moment‖²/ℓ².
  double lever = 0.33;

  // Costs.

  /// What being in contact is worth, each of `rate` times a second: a point costs as much less.
  double contact_gain = 12.;
  /// By how much the cost of heights and speeds in their own scales exceeds that at most.
  double fine_excess = 4.;
  /// The same in absolute scales, [m] and [m/s], with a factor, and the greatest cost.
  double coarse_factor = 3., coarse_height = 0.05, coarse_speed = 0.4, coarse_greatest = 50.;
  /// How far below its rest a point is pressed, and not sunk [m].
  double pressed_depth = 0.07;
  /// Of what contacts cannot give, in its own scales, the greatest cost; and of [m g] and [m g m],
  /// in absolute scales, with a factor and without a greatest cost.
  double missing_greatest = 15., missing_factor = 2., missing_force = 0.1, missing_torque = 0.05;
  /// How much the cost of the dynamics counts.
  double dynamics_weight = 1.2;
  /// What each further point of a limb counts, where the first counts 1; no more than that.
  double further_points = 0.5;
  /// How many of all these costs make a second [1/s].
  double rate = 30.;
  /// What the beginning or end of a contact costs.
  double change = 4.5;

  // Shares of the load, see ContactSchedule::readiness.

  /// A contact takes its load on, and gives it back, over so long [s]; and this readily at the very
  /// beginning and end, where 1 is as readily as ever. The second is no more than 1.
  double ramp = 0.1, ramp_least = 0.3;

  /// The ground's height under all contacts [m]; NaN if it is to be found. What rests higher above
  /// it than `same_ground` is in the air.
  double ground_height = std::numeric_limits<double>::quiet_NaN();
  /// Velocity of the ground, a treadmill's, in the world, level [m/s]; NaN if it is to be found.
  Eigen::Vector3d ground_velocity =
      Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());

  /// The constants: all fields but those of the ground, by name.
  using Constant = std::pair<const char*, double DetectionSettings::*>;
  static const std::vector<Constant>& constants();

  /// @throws std::invalid_argument naming the first field out of its range: constants are > 0,
  ///         none that is called least is greater than its greatest, and further_points and
  ///         ramp_least are no more than 1; the ground's velocity is level
  void validate() const;
  std::string to_string() const;
  bool operator==(const DetectionSettings& other) const;
  bool operator!=(const DetectionSettings& other) const { return !(*this == other); }
};

DYNACOM_EXPORT std::ostream& operator<<(std::ostream& out, const DetectionSettings& settings);

}  // namespace dynacom
