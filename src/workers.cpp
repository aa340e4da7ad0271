// SPDX-License-Identifier: BSD-2-Clause
#include "workers.hpp"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <new>
#include <stdexcept>
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
              1u),
      process_(getpid()),
      pool_(std::make_unique<Pool>()) {}

Workers::~Workers() {
  if (isForked()) {
    static_cast<void>(
        pool_.release());  // to end it would be to wait for threads of another process
    return;
  }
  {
    const std::lock_guard<std::mutex> lock(pool_->mutex);
    pool_->ends = true;
  }
  pool_->changed.notify_all();
  for (std::thread& thread : pool_->threads) thread.join();
}

bool Workers::isForked() const { return getpid() != process_; }

void Workers::forEach(Eigen::Index count, const std::function<Work()>& makeWork,
                      const std::function<void(Eigen::Index)>& progress) {
  if (count == 0) return;
  Loop loop(count, makeWork, progress);
  if (count == 1 || others_ == 0 || isForked()) {
    loop.work(true);
    loop.finish();
    return;
  }
  Pool& pool = *pool_;
  {
    const std::lock_guard<std::mutex> lock(pool.mutex);
    pool.start(std::min(others_, static_cast<std::size_t>(count - 1)));
    pool.loops.push_back(&loop);
  }
  pool.changed.notify_all();
  loop.work(true);
  if (isForked())  // since it began, and the other threads' items will never be done here
    throw std::runtime_error("the process was forked within a loop, whose other threads it lacks");
  {
    std::unique_lock<std::mutex> lock(pool.mutex);
    // Those that are still in it may have begun loops of their own, where there is something to do.
    while (loop.threads > 0) {
      if (Loop* other = pool.findLoop(&loop))
        pool.help(*other, lock);
      else
        pool.changed.wait(lock);
    }
    pool.loops.erase(std::find(pool.loops.begin(), pool.loops.end(), &loop));
  }
  loop.finish();
}

// So that there are that many. Where the machine gives no more, or no memory for them, those that
// there are do the work.
void Workers::Pool::start(std::size_t wanted) {
  try {
    while (threads.size() < wanted) threads.emplace_back([this] { serve(); });
  } catch (const std::system_error&) {
  } catch (const std::bad_alloc&) {
  }
}

void Workers::Pool::serve() {
  std::unique_lock<std::mutex> lock(mutex);
  while (!ends) {
    if (Loop* loop = findLoop(nullptr))
      help(*loop, lock);
    else
      changed.wait(lock);
  }
}

// The last that began, behind another one if there is one: what lies within is done first.
Loop* Workers::Pool::findLoop(const Loop* behind) const {
  for (auto loop = loops.rbegin(); loop != loops.rend() && *loop != behind; ++loop)
    if ((*loop)->hasMore()) return *loop;
  return nullptr;
}

void Workers::Pool::help(Loop& loop, std::unique_lock<std::mutex>& lock) {
  ++loop.threads;
  lock.unlock();
  loop.work(false);
  lock.lock();
  --loop.threads;
  changed.notify_all();
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
