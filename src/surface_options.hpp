// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <iosfwd>

#include "dynacom/surface_options.hpp"

namespace dynacom::internal {

/// @param settings  name of the struct, for messages
/// @throws std::invalid_argument naming the first field out of its range
void validate(const SurfaceOptions& options, const char* settings);

/// Whether friction is a pyramid of four sides, and the normal force has no bounds.
bool isPyramid(const SurfaceOptions& options);
/// The friction coefficient of that pyramid.
double getPyramidMu(const SurfaceOptions& options, double mu);

/// What is not as by default.
void write(std::ostream& out, const SurfaceOptions& options);

}  // namespace dynacom::internal
