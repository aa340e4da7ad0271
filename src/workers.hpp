// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

namespace dynacom::internal {

class Loop;

/// A pool of threads, which work on loops: those that begin one, and those that have nothing else
/// to do. Loops may begin within loops, so that nobody waits while there is work.
class Workers {
 public:
  /// What a thread does with an item of a loop.
  using Work = std::function<void(Eigen::Index)>;

  /// @param threads  how many, with the caller's; 0 stands for as many as the machine has. The
  ///                 others begin when there is something for them.
  explicit Workers(int threads);
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;
  /// Ends the threads. No loop may be left. In a process that was forked meanwhile there are no
  /// threads: there, the caller's does all the work.
  ~Workers();

  /// Does something with each item from 0 to count − 1.
  /// @param makeWork  called in each thread that takes part, for what it does with its items
  /// @param progress  called in the caller's thread with the number of items done, which increases
  ///                  up to all of them, if there is such a function
  /// @throws whatever these functions have thrown, after all threads have left the loop; of several
  ///         exceptions, that of the first item. std::runtime_error in a process that one of them
  ///         has forked, and that comes back from it
  void forEach(Eigen::Index count, const std::function<Work()>& makeWork,
               const std::function<void(Eigen::Index)>& progress = nullptr);

 private:
  struct Pool {
    void start(std::size_t wanted);
    void serve();
    Loop* findLoop(const Loop* behind) const;
    void help(Loop& loop, std::unique_lock<std::mutex>& lock);

    std::mutex mutex;  // of all others
    std::condition_variable changed;
    std::vector<std::thread> threads;
    std::vector<Loop*> loops;  // in the order in which they began
    bool ends = false;
  };

  bool isForked() const;

  const std::size_t others_;  // how many threads there may be besides the caller's
  const int process_;         // that has them
  std::unique_ptr<Pool> pool_;
};

/// How many frames make a block. Blocks do not depend on the number of threads, and each is begun
/// as if there were no other, so that neither do results, bit for bit.
constexpr Eigen::Index kBlockFrames = 256;

/// What a thread does with a block of frames: the first, and how many.
using BlockWork = std::function<void(Eigen::Index, Eigen::Index)>;

/// Workers::forEach() with blocks of frames.
/// @param progress  called with the number of frames done
void forEachBlock(Workers& workers, Eigen::Index frames, const std::function<BlockWork()>& makeWork,
                  const std::function<void(Eigen::Index)>& progress = nullptr);

}  // namespace dynacom::internal
