// SPDX-License-Identifier: BSD-2-Clause
#pragma once

namespace dynacom::internal {

/// What turns a mass into the force that forces are compared with, whatever gravity is [m/s²].
constexpr double kStandardGravity = 9.81;

}  // namespace dynacom::internal
