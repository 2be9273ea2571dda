// Exclusive prefix sums on the device, in place.
#pragma once

#include <limits>
#include <vector>

#include "kernels/scan.hpp"

namespace dpr {

/// So many counts are scanned by one launch, sooner than by the three of more.
std::size_t scanned_at_once(const Device::Impl& device);

class Scan {
 public:
  explicit Scan(Device::Impl& device);

  /// Makes `count` values, of a buffer of one more, the sums of those before each, and the last the sum of
  /// all. Sums saturate at 2^32 - 1.
  void operator()(std::size_t count, Buffer<cl_uint>& values) { scan_level(count, all_, values, 0); }
  /// The same of the first present[0] values of at most `capacity`: values[present[0]] and values[capacity]
  /// are the sum of all, those between are left as they are.
  void operator()(std::size_t capacity, const Buffer<cl_uint>& present, Buffer<cl_uint>& values) {
    scan_level(capacity, present, values, 0);
  }

  std::size_t bytes() const;

 private:
  void scan_level(std::size_t count, const Buffer<cl_uint>& present, Buffer<cl_uint>& values,
                  std::size_t level);

  Device::Impl& device_;
  Launcher<kernel::scan_sum, kernel::scan_apply> launch_;
  Buffer<cl_uint> zero_, all_;          // [1] 0, and the largest number
  std::vector<Buffer<cl_uint>> bases_;  // [level][chunk + 1] the scan of the chunks' sums
};

/// The largest total of a sum that has not saturated.
inline constexpr std::size_t k_most_counted = std::numeric_limits<cl_uint>::max() - 1;

/// Throws InvalidArgument where `what` are more than `most`.
void check_total(std::size_t total, const char* what, std::size_t most = k_most_counted);

/// The last element, read back and checked.
std::size_t read_total(const Buffer<cl_uint>& offsets, std::size_t count, const char* what,
                       std::size_t most = k_most_counted);

}  // namespace dpr
