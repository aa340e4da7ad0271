// SPDX-License-Identifier: BSD-2-Clause
#pragma once

namespace dynacom::internal {

/// Two numbers that are reckoned with at once, and without branches: compilers do not find that by
/// themselves.
using Pair = double __attribute__((vector_size(16)));

inline Pair loadPair(const double* from) { return Pair{from[0], from[1]}; }

inline void storePair(const Pair& pair, double* to) {
  to[0] = pair[0];
  to[1] = pair[1];
}

}  // namespace dynacom::internal
