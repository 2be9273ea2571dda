// Runs an operation with each of its OpenCL calls and each of its allocations failing in turn.
#pragma once

#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <string>

#include "dpr/error.hpp"
#include "faults/allocation_faults.hpp"
#include "faults/opencl_faults.hpp"

namespace dpr::test {

/// One way of failing.
struct FaultKind {
  std::string name;
  std::function<void(std::size_t nth)> arm;
  std::function<bool()> disarm;
  std::function<std::size_t()> calls;
};

inline FaultKind opencl_faults(const std::string& pattern = "cl*") {
  return {pattern, [pattern](std::size_t nth) { dpr_arm_opencl_fault(pattern.c_str(), nth); },
          [] { return dpr_disarm_opencl_fault(); }, [pattern] { return dpr_opencl_calls(pattern.c_str()); }};
}

inline FaultKind allocation_faults() {
  return {"operator new", arm_allocation_fault, disarm_allocation_fault, allocations};
}

/// Disarms whatever happens.
class Armed {
 public:
  Armed(const FaultKind& kind, std::size_t nth) : kind_(kind) { kind_.arm(nth); }
  ~Armed() { kind_.disarm(); }
  Armed(const Armed&) = delete;
  Armed& operator=(const Armed&) = delete;

 private:
  const FaultKind& kind_;
};

/// Ending of an operation with a fault.
enum class Ending { done, failed };

/// Calls prepare(), then operation() with the n-th call failing, then check(ending, n): for every n, or for
/// `most` of them spread over all where they are more. Returns how many faults there were. An operation may
/// throw nothing but the library's errors and std::bad_alloc.
inline std::size_t sweep(const FaultKind& kind, std::size_t most, const std::function<void()>& prepare,
                         const std::function<void()>& operation,
                         const std::function<void(Ending, std::size_t)>& check) {
  prepare();
  kind.arm(0);
  operation();
  const std::size_t calls = kind.calls();
  kind.disarm();
  std::size_t faults = 0;
  const std::size_t runs = std::min(calls, most);
  for (std::size_t run = 0; run < runs; ++run) {
    // The first and the last among them.
    const std::size_t n = runs < 2 ? 1 : 1 + run * (calls - 1) / (runs - 1);
    prepare();
    Ending ending = Ending::done;
    {
      const Armed armed(kind, n);
      try {
        operation();
      } catch (const Error&) {
        ending = Ending::failed;
      } catch (const std::bad_alloc&) {
        ending = Ending::failed;
      }
      faults += kind.disarm() ? 1U : 0U;
    }
    CAPTURE(kind.name);
    CAPTURE(n);
    check(ending, n);
  }
  return faults;
}

}  // namespace dpr::test
