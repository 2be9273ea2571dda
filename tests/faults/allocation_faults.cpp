#include "faults/allocation_faults.hpp"

#include <cstdlib>
#include <new>

#include "faults/opencl_faults.hpp"

namespace {

thread_local std::size_t fails_at = 0, counted = 0;  // 0: none fails
thread_local bool has_failed = false;

}  // namespace

namespace dpr::test {

void arm_allocation_fault(std::size_t nth) noexcept {
  counted = 0;
  has_failed = false;
  fails_at = nth;
}

bool disarm_allocation_fault() noexcept {
  fails_at = 0;
  return has_failed;
}

std::size_t allocations() noexcept { return counted; }

}  // namespace dpr::test

void* operator new(std::size_t size) {
  if (!dpr::test::dpr_is_within_opencl() && ++counted == fails_at) {
    has_failed = true;
    throw std::bad_alloc();
  }
  void* const memory = std::malloc(size == 0 ? 1 : size);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

/// Never fails on demand; it is here since what it returns ends in the operator delete below.
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return std::malloc(size == 0 ? 1 : size);
}

void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
