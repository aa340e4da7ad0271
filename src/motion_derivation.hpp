// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "acceleration_noise.hpp"
#include "dynacom/recorded_motion.hpp"
#include "pool.hpp"

namespace dynacom::internal {

/// What motions of a robot are derived with.
struct Derivation {
  const pinocchio::Model& model;
  DataPool& data;  // the model's
  CoMFunction findCoM;
};

/// As their public namesakes.
DerivedMotion deriveMotion(const Derivation& derivation, const RecordedMotion& recorded,
                           double cutoff);
DerivedMotion rederiveMotion(const Derivation& derivation, const RecordedMotion& recorded,
                             double cutoff);

}  // namespace dynacom::internal
