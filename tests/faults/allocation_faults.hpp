// Makes a chosen allocation of the calling thread fail. OpenCL's own allocations do not count: a driver is
// not ours to test.
#pragma once

#include <cstddef>

namespace dpr::test {

/// From now on the `nth` call (from 1) of operator new by this thread throws std::bad_alloc, once.
void arm_allocation_fault(std::size_t nth) noexcept;
/// No allocation fails any more. Returns whether one did.
bool disarm_allocation_fault() noexcept;
/// Allocations of this thread since the last arming.
std::size_t allocations() noexcept;

}  // namespace dpr::test
