// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <iosfwd>
#include <string>

#include "dynacom/surface_options.hpp"

namespace dynacom::internal {

/// @param settings  name of the struct, for messages
/// @throws std::invalid_argument naming the first field out of its range
void validate(const SurfaceOptions& options, const std::string& settings);

/// Whether the contact is a pyramid at its frame, without bounds.
bool isPlain(const SurfaceOptions& options);

/// What is not as by default.
void write(std::ostream& out, const SurfaceOptions& options);

}  // namespace dynacom::internal
