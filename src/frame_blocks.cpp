// SPDX-License-Identifier: BSD-2-Clause
#include "frame_blocks.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace dynacom::internal {

namespace {

class Blocks {
 public:
  Blocks(Eigen::Index frames, const std::function<BlockWork()>& makeWork,
         const std::function<void(Eigen::Index)>& progress)
      : frames_(frames), makeWork_(makeWork), progress_(progress) {}

  Eigen::Index count() const { return (frames_ + kBlockFrames - 1) / kBlockFrames; }

  // Works on blocks until there are no more, or until something was thrown somewhere.
  void work(bool in_callers_thread) {
    Eigen::Index block = 0;
    try {
      const BlockWork work = makeWork_();
      while ((block = next_++) < count() && !failed_) {
        const Eigen::Index first = block * kBlockFrames;
        const Eigen::Index size = std::min(kBlockFrames, frames_ - first);
        work(first, size);
        done_ += size;
        if (in_callers_thread) tell();
      }
    } catch (...) {
      keep(std::current_exception(), block);
    }
  }

  // After all threads have come back.
  void finish() {
    if (exception_) std::rethrow_exception(exception_);
    tell();
  }

 private:
  void tell() {
    const Eigen::Index done = done_;
    if (!progress_ || done == told_) return;
    told_ = done;
    progress_(done);
  }

  void keep(std::exception_ptr exception, Eigen::Index block) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (exception_ && block >= its_block_) return;
    exception_ = std::move(exception);
    its_block_ = block;
    failed_ = true;
  }

  const Eigen::Index frames_;
  const std::function<BlockWork()>& makeWork_;
  const std::function<void(Eigen::Index)>& progress_;
  std::atomic<Eigen::Index> next_{0}, done_{0};
  std::atomic<bool> failed_{false};
  Eigen::Index told_ = 0;  // of the caller's thread
  std::mutex mutex_;       // of the next two
  std::exception_ptr exception_;
  Eigen::Index its_block_ = 0;
};

}  // namespace

void forEachBlock(Eigen::Index frames, int threads, const std::function<BlockWork()>& makeWork,
                  const std::function<void(Eigen::Index)>& progress) {
  Blocks blocks(frames, makeWork, progress);
  if (blocks.count() == 0) return;
  if (threads == 0) threads = static_cast<int>(std::thread::hardware_concurrency());
  const Eigen::Index others = std::min<Eigen::Index>(threads, blocks.count()) - 1;
  std::vector<std::thread> pool;
  try {
    for (Eigen::Index k = 0; k < others; ++k) pool.emplace_back([&blocks] { blocks.work(false); });
  } catch (const std::system_error&) {
    // The machine gives no more threads: those that there are do the work.
  }
  blocks.work(true);
  for (std::thread& thread : pool) thread.join();
  blocks.finish();
}

}  // namespace dynacom::internal
