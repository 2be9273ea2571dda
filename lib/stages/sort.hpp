// Stable radix sort of (key, value) on the device.
#pragma once

#include "kernels/sort.hpp"
#include "stages/scan.hpp"

namespace dpr {

/// Passes that a sort of so many keys takes, three launches each: as few as DPR_SORT_BITS allow.
unsigned sort_passes(std::size_t key_count);

/// Whether one work-item, or on a GPU one group, sorts them sooner than the launches of a sort by many take.
bool is_sorted_at_once(const Device::Impl& device, std::size_t capacity, std::size_t key_count);

class Sort {
 public:
  explicit Sort(Device::Impl& device) : device_(device), scan_(device), launch_(device) {}

  /// Sorts the first `count[0]` keys, all below `key_count`, and values with them, in place; `capacity` is
  /// what they are at most. `starts` gets the run of every key: [key_count + 1].
  void operator()(std::size_t capacity, const Buffer<cl_uint>& count, std::size_t key_count,
                  Buffer<cl_uint>& keys, Buffer<cl_uint>& values, Buffer<cl_uint>& starts);

  std::size_t bytes() const;

 private:
  /// A stable pass by `bits` from `shift` on.
  void pass(std::size_t capacity, unsigned shift, unsigned bits, const Buffer<cl_uint>& count,
            const Buffer<cl_uint>& keys, const Buffer<cl_uint>& values);

  Device::Impl& device_;
  Scan scan_;
  Launcher<kernel::sort_histogram, kernel::sort_scatter, kernel::sort_ranges, kernel::sort_few> launch_;
  Buffer<cl_uint> offsets_, offset_count_, other_keys_, other_values_;
};

}  // namespace dpr
