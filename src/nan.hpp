// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <limits>

namespace dynacom::internal {

/// What is not known, or means nothing.
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

}  // namespace dynacom::internal
