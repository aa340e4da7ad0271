// SPDX-License-Identifier: BSD-2-Clause
#include "workers.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <new>
#include <system_error>

namespace dynacom::internal {

/// A loop, while there is work in it.
class Loop {
 public:
  Loop(Eigen::Index count, const std::function<Workers::Work()>& makeWork,
       const std::function<void(Eigen::Index)>& progress)
      : count_(count), makeWork_(makeWork), progress_(progress) {}

  // Works on items until there are no more, or until something was thrown somewhere.
  void work(bool in_callers_thread) {
    Eigen::Index item = 0;
    try {
      const Workers::Work work = makeWork_();
      while (!failed_ && (item = next_++) < count_) {
        work(item);
        ++done_;
        if (in_callers_thread) tell();
      }
    } catch (...) {
      keep(std::current_exception(), item);
    }
  }

  bool hasMore() const { return !failed_ && next_ < count_; }

  // After all threads have left.
  void finish() {
    if (exception_) std::rethrow_exception(exception_);
    tell();
  }

  int threads = 0;  // that are in it, but for the caller's; guarded by the workers

 private:
  void tell() {
    const Eigen::Index done = done_;
    if (!progress_ || done == told_) return;
    told_ = done;
    progress_(done);
  }

  void keep(std::exception_ptr exception, Eigen::Index item) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (exception_ && item >= its_item_) return;
    exception_ = std::move(exception);
    its_item_ = item;
    failed_ = true;
  }

  const Eigen::Index count_;
  const std::function<Workers::Work()>& makeWork_;
  const std::function<void(Eigen::Index)>& progress_;
  std::atomic<Eigen::Index> next_{0}, done_{0};
  std::atomic<bool> failed_{false};
  Eigen::Index told_ = 0;  // of the caller's thread
  std::mutex mutex_;       // of the next two
  std::exception_ptr exception_;
  Eigen::Index its_item_ = 0;
};

Workers::Workers(int threads)
    : others_(std::max(threads > 0 ? static_cast<unsigned>(threads)
                                   : std::thread::hardware_concurrency(),
                       1u) -
              1u) {}

Workers::~Workers() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ends_ = true;
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void Workers::forEach(Eigen::Index count, const std::function<Work()>& makeWork,
                      const std::function<void(Eigen::Index)>& progress) {
  if (count == 0) return;
  Loop loop(count, makeWork, progress);
  if (count == 1 || others_ == 0) {
    loop.work(true);
    loop.finish();
    return;
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    start(count - 1);
    loops_.push_back(&loop);
  }
  changed_.notify_all();
  loop.work(true);
  {
    std::unique_lock<std::mutex> lock(mutex_);
    // Those that are still in it may have begun loops of their own, where there is something to do.
    while (loop.threads > 0) {
      if (Loop* other = findLoop(&loop))
        help(*other, lock);
      else
        changed_.wait(lock);
    }
    loops_.erase(std::find(loops_.begin(), loops_.end(), &loop));
  }
  loop.finish();
}

// So that there are that many, as far as there may be.
void Workers::start(Eigen::Index others) {
  const std::size_t wanted = std::min(others_, static_cast<std::size_t>(others));
  // Where the machine gives no more threads, or memory for them, those that there are do the work.
  try {
    while (threads_.size() < wanted) threads_.emplace_back([this] { serve(); });
  } catch (const std::system_error&) {
  } catch (const std::bad_alloc&) {
  }
}

void Workers::serve() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!ends_) {
    if (Loop* loop = findLoop(nullptr))
      help(*loop, lock);
    else
      changed_.wait(lock);
  }
}

// The last that began, behind another one if there is one: what lies within is done first.
Loop* Workers::findLoop(const Loop* behind) const {
  for (auto loop = loops_.rbegin(); loop != loops_.rend() && *loop != behind; ++loop)
    if ((*loop)->hasMore()) return *loop;
  return nullptr;
}

void Workers::help(Loop& loop, std::unique_lock<std::mutex>& lock) {
  ++loop.threads;
  lock.unlock();
  loop.work(false);
  lock.lock();
  --loop.threads;
  changed_.notify_all();
}

void forEachBlock(Workers& workers, Eigen::Index frames, const std::function<BlockWork()>& makeWork,
                  const std::function<void(Eigen::Index)>& progress) {
  const auto makeItems = [&]() -> Workers::Work {
    return [frames, work = makeWork()](Eigen::Index block) {
      const Eigen::Index first = block * kBlockFrames;
      work(first, std::min(kBlockFrames, frames - first));
    };
  };
  std::function<void(Eigen::Index)> tell;
  if (progress)
    tell = [&](Eigen::Index blocks) { progress(std::min(blocks * kBlockFrames, frames)); };
  workers.forEach((frames + kBlockFrames - 1) / kBlockFrames, makeItems, tell);
}

}  // namespace dynacom::internal
