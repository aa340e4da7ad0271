// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <functional>

namespace dynacom::internal {

/// How many frames make a block. Blocks do not depend on the number of threads, and each is begun
/// as if there were no other, so that neither do results, bit for bit.
constexpr Eigen::Index kBlockFrames = 256;

/// What a thread does with a block of frames: the first, and how many.
using BlockWork = std::function<void(Eigen::Index, Eigen::Index)>;

/// Goes through all blocks of frames in several threads, each of which takes one block after the
/// other: the caller's, and others that end with this call.
/// @param frames       how many; none is no work
/// @param threads      at most so many, or as many as the machine has if it is 0
/// @param makeWork     called in each thread, for what it does with its blocks
/// @param progress     called in the caller's thread with the number of frames done, which
///                     increases up to all of them, if there is such a function
/// @throws whatever these functions have thrown: of several exceptions, that of the first block
void forEachBlock(Eigen::Index frames, int threads, const std::function<BlockWork()>& makeWork,
                  const std::function<void(Eigen::Index)>& progress = nullptr);

}  // namespace dynacom::internal
