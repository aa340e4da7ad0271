// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <pinocchio/multibody.hpp>
#include <utility>
#include <vector>

namespace dynacom::internal {

/// Things that are expensive to make: each thread has one for itself, as long as it needs it, and
/// the next one gets it after that.
template <class Thing>
class Pool {
 public:
  explicit Pool(std::function<std::unique_ptr<Thing>()> make) : make_(std::move(make)) {}

  /// One that nobody has; what was done with it before is not undone. It must not outlive this.
  std::shared_ptr<Thing> take() {
    std::unique_ptr<Thing> thing;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (!free_.empty()) {
        thing = std::move(free_.back());
        free_.pop_back();
      }
    }
    if (!thing) {
      thing = make_();
      const std::lock_guard<std::mutex> lock(mutex_);
      free_.reserve(++count_);  // giving back must not fail
    }
    return {thing.release(), [this](Thing* done) {
              std::unique_ptr<Thing> own(done);
              const std::lock_guard<std::mutex> lock(mutex_);
              free_.push_back(std::move(own));
            }};
  }

 private:
  const std::function<std::unique_ptr<Thing>()> make_;
  std::mutex mutex_;                          // of the next two
  std::vector<std::unique_ptr<Thing>> free_;  // with room for all
  std::size_t count_ = 0;
};

/// Storage of Pinocchio's, which has megabytes.
using DataPool = Pool<pinocchio::Data>;

}  // namespace dynacom::internal
