// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <pinocchio/multibody.hpp>
#include <utility>
#include <vector>

#include "per_process.hpp"

namespace dynacom::internal {

/// Things that are expensive to make: each thread has one for itself, as long as it needs it, and
/// the next one of the same process gets it after that.
template <class Thing>
class Pool {
 public:
  explicit Pool(std::function<std::unique_ptr<Thing>()> make) : make_(std::move(make)) {}

  /// One that nobody has; what was done with it before is not undone. It must not outlive this.
  std::shared_ptr<Thing> take() {
    Shelf& shelf = shelf_.get();
    std::unique_ptr<Thing> thing;
    {
      const std::lock_guard<std::mutex> lock(shelf.mutex);
      if (!shelf.free.empty()) {
        thing = std::move(shelf.free.back());
        shelf.free.pop_back();
      }
    }
    if (!thing) {
      thing = make_();
      const std::lock_guard<std::mutex> lock(shelf.mutex);
      shelf.free.reserve(++shelf.count);  // giving back must not fail
    }
    return {thing.release(), [this, &shelf](Thing* done) {
              std::unique_ptr<Thing> own(done);
              if (&shelf != &shelf_.get()) return;  // it was taken before this process was forked
              const std::lock_guard<std::mutex> lock(shelf.mutex);
              shelf.free.push_back(std::move(own));
            }};
  }

 private:
  struct Shelf {
    std::mutex mutex;                          // of the next two
    std::vector<std::unique_ptr<Thing>> free;  // with room for all
    std::size_t count = 0;
  };

  const std::function<std::unique_ptr<Thing>()> make_;
  PerProcess<Shelf> shelf_;
};

/// Storage of Pinocchio's, which has megabytes.
using DataPool = Pool<pinocchio::Data>;

}  // namespace dynacom::internal
