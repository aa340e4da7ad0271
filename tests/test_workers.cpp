// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE workers
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <boost/test/unit_test.hpp>
#include <chrono>
#include <memory>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "pool.hpp"
#include "workers.hpp"

using dynacom::internal::BlockWork;
using dynacom::internal::forEachBlock;
using dynacom::internal::kBlockFrames;
using dynacom::internal::Pool;
using dynacom::internal::Workers;
using Eigen::Index;

namespace {

/// Waits for something that other threads do. Ten seconds stand for never.
template <class Condition>
bool waitFor(const Condition& condition) {
  for (int k = 0; k < 10000 && !condition(); ++k)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  return condition();
}

/// The threads that did something.
class Threads {
 public:
  void add() {
    const std::lock_guard<std::mutex> lock(mutex_);
    ids_.insert(std::this_thread::get_id());
  }
  std::size_t count() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return ids_.size();
  }

 private:
  std::mutex mutex_;
  std::set<std::thread::id> ids_;
};

}  // namespace

BOOST_AUTO_TEST_CASE(each_item_is_done_once) {
  for (const int threads : {0, 1, 2, 7}) {
    Workers workers(threads);
    for (const Index count : {0, 1, 2, 1000}) {
      std::vector<std::atomic<int>> times(static_cast<std::size_t>(count));
      std::atomic<int> made{0};
      workers.forEach(count, [&]() -> Workers::Work {
        ++made;
        return [&](Index item) { ++times[static_cast<std::size_t>(item)]; };
      });
      for (const std::atomic<int>& time : times) BOOST_TEST(time == 1);
      // No more often than there are threads, and not at all without an item.
      if (count == 0) BOOST_TEST(made == 0);
      if (threads > 0) BOOST_TEST(made <= threads);
    }
  }
}

BOOST_AUTO_TEST_CASE(all_threads_take_part_and_stay) {
  Workers workers(4);
  Threads all;
  std::atomic<bool> took_part{true};  // Boost's checks are for one thread
  for (int loop = 0; loop < 3; ++loop) {
    Threads threads;
    workers.forEach(4, [&]() -> Workers::Work {
      return [&](Index) {
        threads.add();
        all.add();
        if (!waitFor([&] { return threads.count() == 4; })) took_part = false;
      };
    });
  }
  BOOST_TEST(took_part);
  BOOST_TEST(all.count() == 4u);
}

BOOST_AUTO_TEST_CASE(those_without_work_take_part_in_loops_within_loops) {
  // Of two items the second one is done at once; its thread then has part in the first one's loop.
  for (const Index slow : {0, 1}) {
    Workers workers(2);
    Threads threads;
    workers.forEach(2, [&]() -> Workers::Work {
      return [&, slow](Index item) {
        if (item != slow) return;
        workers.forEach(2, [&]() -> Workers::Work {
          return [&](Index) {
            threads.add();
            waitFor([&] { return threads.count() == 2; });
          };
        });
      };
    });
    BOOST_TEST(threads.count() == 2u);
  }
}

BOOST_AUTO_TEST_CASE(loops_within_loops_are_done_once) {
  for (const int threads : {1, 2, 5}) {
    Workers workers(threads);
    const Index outer = 40, inner = 50;
    std::vector<std::atomic<int>> times(static_cast<std::size_t>(outer * inner));
    std::atomic<bool> ended{true};
    workers.forEach(outer, [&]() -> Workers::Work {
      return [&](Index i) {
        std::atomic<int> own{0};
        workers.forEach(inner, [&, i]() -> Workers::Work {
          return [&, i](Index k) {
            ++times[static_cast<std::size_t>(inner * i + k)];
            ++own;
          };
        });
        if (own != inner) ended = false;
      };
    });
    BOOST_TEST(ended);  // inner loops have, before it goes on
    for (const std::atomic<int>& time : times) BOOST_TEST(time == 1);
  }
}

BOOST_AUTO_TEST_CASE(the_exception_of_the_first_item_ends_the_loop) {
  for (const int threads : {1, 4}) {
    Workers workers(threads);
    std::atomic<Index> done{0};
    const auto failing = [&](Index first) {
      workers.forEach(100000, [&, first]() -> Workers::Work {
        return [&, first](Index item) {
          if (item >= first) throw std::runtime_error(std::to_string(item));
          ++done;
        };
      });
    };
    BOOST_CHECK_EXCEPTION(failing(50), std::runtime_error,
                          [](const auto& error) { return std::string(error.what()) == "50"; });
    BOOST_TEST(done == 50);
    BOOST_CHECK_THROW(
        workers.forEach(5, []() -> Workers::Work { throw std::logic_error("no work"); }),
        std::logic_error);
    // And there is nothing left of it.
    done = 0;
    BOOST_CHECK_NO_THROW(
        workers.forEach(30, [&]() -> Workers::Work { return [&](Index) { ++done; }; }));
    BOOST_TEST(done == 30);
  }
}

BOOST_AUTO_TEST_CASE(an_exception_within_a_loop_is_the_items) {
  Workers workers(3);
  std::atomic<int> caught{0};
  workers.forEach(20, [&]() -> Workers::Work {
    return [&](Index) {
      try {
        workers.forEach(
            20, []() -> Workers::Work { return [](Index) { throw std::runtime_error("inner"); }; });
      } catch (const std::runtime_error&) {
        ++caught;
      }
    };
  });
  BOOST_TEST(caught == 20);
}

BOOST_AUTO_TEST_CASE(progress_increases_in_the_callers_thread) {
  for (const int threads : {1, 3}) {
    Workers workers(threads);
    std::vector<Index> told;
    const auto caller = std::this_thread::get_id();
    const auto progress = [&](Index done) {
      BOOST_TEST((std::this_thread::get_id() == caller));
      if (!told.empty()) BOOST_TEST(done > told.back());
      told.push_back(done);
    };
    workers.forEach(
        200, []() -> Workers::Work { return [](Index) {}; }, progress);
    BOOST_TEST(told.back() == 200);
    // What it throws ends the loop.
    BOOST_CHECK_THROW(workers.forEach(
                          200, []() -> Workers::Work { return [](Index) {}; },
                          [](Index) { throw std::runtime_error("enough"); }),
                      std::runtime_error);
  }
}

BOOST_AUTO_TEST_CASE(a_process_that_was_forked_does_all_by_itself) {
  auto workers = std::make_unique<Workers>(3);
  std::atomic<int> done{0};
  const auto work = [&] {
    workers->forEach(50, [&]() -> Workers::Work { return [&](Index) { ++done; }; });
  };
  work();
  const pid_t child = fork();
  if (child == 0) {
    alarm(20);
    work();
    workers.reset();
    _exit(done == 100 ? 0 : 1);
  }
  BOOST_REQUIRE(child > 0);
  int status = -1;
  BOOST_REQUIRE(waitpid(child, &status, 0) == child);
  BOOST_TEST(status == 0);
  work();
  BOOST_TEST(done == 100);
}

BOOST_AUTO_TEST_CASE(a_process_that_comes_back_from_a_loop_in_which_it_was_forked_is_told) {
  Workers workers(2);
  std::atomic<int> others{0};  // that wait in the loop
  std::atomic<pid_t> child{-1};
  const auto caller = std::this_thread::get_id();
  const auto forks = [&](Index) {
    if (child >= 0) return;
    waitFor([&] { return others > 0; });
    child = fork();
    if (child == 0) alarm(20);
  };
  bool is_told = false;
  try {
    workers.forEach(
        50,
        [&]() -> Workers::Work {
          return [&](Index) {
            if (std::this_thread::get_id() == caller) return;
            ++others;
            waitFor([&] { return child >= 0; });
          };
        },
        forks);
  } catch (const std::runtime_error&) {
    is_told = true;
  }
  if (child == 0) _exit(is_told ? 0 : 1);
  BOOST_TEST(!is_told);
  int status = -1;
  BOOST_REQUIRE(waitpid(child, &status, 0) == child);
  BOOST_TEST(status == 0);
}

BOOST_AUTO_TEST_CASE(a_pool_is_free_in_a_process_that_was_forked_while_another_thread_takes_of_it) {
  std::atomic<int> made{0};
  Pool<int> pool([&] { return std::make_unique<int>(++made); });
  auto mine = pool.take();
  std::atomic<bool> ends{false};
  std::thread other([&] {
    while (!ends) pool.take();
  });
  int failed = 0;
  for (int trial = 0; trial < 300 && failed == 0; ++trial) {
    const pid_t child = fork();
    if (child == 0) {
      alarm(20);
      const int number = *mine;
      mine.reset();  // which does not give it back: it is of the other process
      _exit(*pool.take() != number ? 0 : 1);
    }
    int status = -1;
    if (waitpid(child, &status, 0) != child || status != 0) ++failed;
  }
  ends = true;
  other.join();
  BOOST_TEST(failed == 0);
  // In the process itself they are used again.
  BOOST_TEST(made == 2);
}

BOOST_AUTO_TEST_CASE(blocks_are_the_same_whatever_the_number_of_threads) {
  const Index frames = 3 * kBlockFrames + 7;
  for (const int threads : {1, 4}) {
    Workers workers(threads);
    std::mutex mutex;
    std::set<std::pair<Index, Index>> blocks;
    Index told = 0;
    forEachBlock(
        workers, frames,
        [&]() -> BlockWork {
          return [&](Index first, Index size) {
            const std::lock_guard<std::mutex> lock(mutex);
            blocks.emplace(first, size);
          };
        },
        [&](Index done) { told = done; });
    const std::set<std::pair<Index, Index>> expected = {{0, kBlockFrames},
                                                        {kBlockFrames, kBlockFrames},
                                                        {2 * kBlockFrames, kBlockFrames},
                                                        {3 * kBlockFrames, 7}};
    BOOST_TEST((blocks == expected));
    BOOST_TEST(told == frames);
  }
}
