// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <unistd.h>

#include <atomic>
#include <memory>

namespace dynacom::internal {

/// What threads share under a mutex, and what that guards. A process that was forked gets a new
/// one: in the old one, a thread that was not forked with it may have the mutex, for ever, or may
/// have been amid a change.
template <class State>
class PerProcess {
 public:
  PerProcess() : own_(new Own) {}
  PerProcess(const PerProcess&) = delete;
  PerProcess& operator=(const PerProcess&) = delete;
  ~PerProcess() {
    Own* const own = own_;
    if (own->process == getpid()) delete own;
  }

  State& get() {
    Own* own = own_;
    if (own->process == getpid()) return own->state;
    auto fresh = std::make_unique<Own>();
    // Else another thread of this process was faster; the old one stays where it is.
    if (own_.compare_exchange_strong(own, fresh.get())) own = fresh.release();
    return own->state;
  }

 private:
  struct Own {
    const pid_t process = getpid();
    State state;
  };

  std::atomic<Own*> own_;
};

}  // namespace dynacom::internal
