// Exclusive prefix sums on the device.
#pragma once

#include <vector>

#include "device/kernel.hpp"

namespace dpr {

/// So many counts are scanned by one launch, sooner than by the three of more.
std::size_t scanned_at_once(const Device::Impl& device);

class Scan {
 public:
  explicit Scan(Device::Impl& device);

  /// offsets[i] = values[0] + ... + values[i - 1] for i in [0, count]; sums saturate at 2^32 - 1.
  void operator()(Length count, const Buffer<cl_uint>& values, Buffer<cl_uint>& offsets);

  std::size_t bytes() const;

 private:
  void scan_level(std::size_t count, const Buffer<cl_uint>& values, Buffer<cl_uint>& offsets,
                  std::size_t level);

  /// The sums of a level's chunks, and their scan.
  struct Level {
    Buffer<cl_uint> sums, bases;
  };

  Device::Impl& device_;
  Kernel<cl_uint, In<cl_uint>, Out<cl_uint>> sum_;
  Kernel<cl_uint, cl_uint, In<cl_uint>, In<cl_uint>, Out<cl_uint>> apply_;
  Buffer<cl_uint> zero_;
  std::vector<Level> levels_;
};

/// Throws InvalidArgument if a sum saturated: `what` were too many.
void check_total(std::size_t total, const char* what);

/// The last element, read back and checked.
std::size_t read_total(const Buffer<cl_uint>& offsets, std::size_t count, const char* what);

}  // namespace dpr
