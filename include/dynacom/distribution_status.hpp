// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <iosfwd>

#include "dynacom/export.hpp"

namespace dynacom {

/// How a distribution ended. Whatever it says, the forces lie within all inequalities, but for
/// rounding of 1e-9 of the scale.
enum class DistributionStatus {
  /// The wrench can be reached: its distance to what the contacts can give is at most 1e-8 of the
  /// scale. The forces give it, and are the cheapest that do.
  Solved,
  /// The wrench is out of reach. The forces give the closest one that the contacts can give, and
  /// are the cheapest that do.
  Relaxed,
  /// There is no contact, and the wrench is not zero (1e-8 of the scale is). Also before the first
  /// solve().
  NoContact,
  /// A number that came in was not finite. The forces are those of the last Solved or Relaxed, if
  /// contacts and settings are still the same, else zero.
  InvalidInput,
  /// The iterations were used up, see WrenchDistribution::setMaximalIterations(), or the answer did
  /// not pass the check. The forces are as for InvalidInput.
  NumericalFailure,
};

/// The value's name, as written above.
DYNACOM_EXPORT const char* to_string(DistributionStatus status);
DYNACOM_EXPORT std::ostream& operator<<(std::ostream& out, DistributionStatus status);

}  // namespace dynacom
