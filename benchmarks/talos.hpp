// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <dynacom/contact6d.hpp>
#include <dynacom/dyna_com.hpp>

// The robot of the benchmarks: Talos, upright, with its two soles.

namespace dynacom::benchmarks {

inline DynaCoM makeTalos() {
  DynaCoMSettings settings;
  settings.urdf = DYNACOM_TALOS_URDF;
  DynaCoM talos(settings);
  for (const char* side : {"left", "right"}) {
    Contact6DSettings sole;
    sole.mu = 0.7;
    sole.gu = 0.1;
    sole.half_length = 0.10;
    sole.half_width = 0.06;
    sole.frame_name = std::string("leg_") + side + "_sole_fix_joint";
    talos.addContact(std::make_shared<Contact6D>(sole), side);
  }
  return talos;
}

}  // namespace dynacom::benchmarks
