// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <stdexcept>

#include "dynacom/export.hpp"

namespace dynacom {

/// Something was used before it was ready: a contact or a DynaCoM before initialize(), a result
/// before it was computed. Arguments that are wrong throw std::invalid_argument.
class DYNACOM_EXPORT NotReadyError : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

}  // namespace dynacom
