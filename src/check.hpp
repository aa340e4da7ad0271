// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>

// What the library's messages have in common. Each names the thing, what was expected, what came.

namespace dynacom::internal {

/// All arguments, written one after the other.
template <class... Args>
std::string concat(const Args&... args) {
  std::ostringstream out;
  (out << ... << args);
  return out.str();
}

/// A message that gives up the current action: the caller's argument was wrong.
template <class... Args>
[[noreturn]] void throwInvalid(const Args&... args) {
  throw std::invalid_argument(concat(args...));
}

/// Refuses a value of a settings struct.
/// @param field     "Struct.field"
/// @param expected  what it has to be, such as ">= 0"
template <class Value>
void requireField(bool holds, const char* field, const char* expected, const Value& value) {
  if (!holds) throwInvalid(field, " must be ", expected, ", got ", value);
}

/// Changes one field of settings, unless they would not be valid then.
template <class Settings, class Value>
void changeField(Settings& settings, Value Settings::*field, const Value& value) {
  const Value former = settings.*field;
  settings.*field = value;
  try {
    settings.validate();
  } catch (...) {
    settings.*field = former;
    throw;
  }
}

/// Refuses a natural frequency of the linear inverted pendulum.
inline void requireOmega(double omega) {
  if (!(omega > 0.)) throwInvalid("omega must be > 0 rad/s, got ", omega);
  if (std::isinf(omega)) throwInvalid("omega must be finite, got ", omega, " rad/s");
}

/// Refuses a vector or matrix of the wrong size.
template <class Index>
void requireSize(const char* name, Index size, Index expected, const char* unit) {
  if (size != expected) throwInvalid(name, " must have ", expected, " ", unit, ", got ", size);
}

}  // namespace dynacom::internal
