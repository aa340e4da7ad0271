// SPDX-License-Identifier: BSD-2-Clause
// Counts what takes memory and what gives it back. Eigen's own check for that does not see into
// libraries, so this counts at malloc: a function of that name in the executable takes the place of
// the C library's for all shared libraries, too, and operator new ends there. To be included by one
// file of an executable.
#pragma once

#include <atomic>
#include <cerrno>
#include <cstdlib>

namespace dynacom_tests {

inline std::atomic<bool> counting{false};
inline std::atomic<int> allocations{0};

/// How often an action allocates or frees.
template <class Action>
int allocationsIn(Action action) {
  allocations = 0;
  counting = true;
  action();
  counting = false;
  return allocations;
}

inline void countAllocation() {
  if (counting) ++allocations;
}

}  // namespace dynacom_tests

// Those of the GNU C library, under the names that it keeps for this purpose.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t number, std::size_t size);
void* __libc_realloc(void* pointer, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void __libc_free(void* pointer);

#define VISIBLE __attribute__((visibility("default")))

VISIBLE void* malloc(std::size_t size) noexcept {
  dynacom_tests::countAllocation();
  return __libc_malloc(size);
}

VISIBLE void* calloc(std::size_t number, std::size_t size) noexcept {
  dynacom_tests::countAllocation();
  return __libc_calloc(number, size);
}

VISIBLE void* realloc(void* pointer, std::size_t size) noexcept {
  dynacom_tests::countAllocation();
  return __libc_realloc(pointer, size);
}

VISIBLE void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  dynacom_tests::countAllocation();
  return __libc_memalign(alignment, size);
}

VISIBLE void* memalign(std::size_t alignment, std::size_t size) noexcept {
  dynacom_tests::countAllocation();
  return __libc_memalign(alignment, size);
}

VISIBLE int posix_memalign(void** pointer, std::size_t alignment, std::size_t size) noexcept {
  dynacom_tests::countAllocation();
  *pointer = __libc_memalign(alignment, size);
  return *pointer ? 0 : ENOMEM;
}

VISIBLE void free(void* pointer) noexcept {
  if (pointer) dynacom_tests::countAllocation();
  __libc_free(pointer);
}

#undef VISIBLE
}
