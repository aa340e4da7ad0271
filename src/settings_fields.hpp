// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <ostream>
#include <utility>
#include <vector>

#include "check.hpp"

// What settings have in common that list their numbers.

namespace dynacom::internal {

/// Numbers of settings: the name of each, and where it is.
template <class Settings>
using Fields = std::vector<std::pair<const char*, double Settings::*>>;

/// Refuses a number that is not finite and > 0, or >= 0 where it may be zero.
/// @param name  of the settings
template <class Settings>
void requirePositive(const char* name, const Settings& settings, const Fields<Settings>& fields,
                     std::initializer_list<double Settings::*> may_be_zero = {}) {
  for (const auto& [field, number] : fields) {
    const bool zero =
        std::find(may_be_zero.begin(), may_be_zero.end(), number) != may_be_zero.end();
    const double value = settings.*number;
    requireField(std::isfinite(value) && (value > 0. || (zero && value == 0.)),
                 concat(name, ".", field).c_str(), zero ? "finite and >= 0" : "finite and > 0",
                 value);
  }
}

template <class Settings>
bool areEqual(const Settings& one, const Settings& other, const Fields<Settings>& fields) {
  return std::all_of(fields.begin(), fields.end(),
                     [&](const auto& field) { return one.*field.second == other.*field.second; });
}

/// Writes "name=value, name=value".
template <class Settings>
void write(std::ostream& out, const Settings& settings, const Fields<Settings>& fields) {
  const char* separator = "";
  for (const auto& [name, number] : fields) {
    out << separator << name << "=" << settings.*number;
    separator = ", ";
  }
}

}  // namespace dynacom::internal
