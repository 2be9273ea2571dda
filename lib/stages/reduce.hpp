// Compensated sums over segments, in a fixed order.
#pragma once

#include <initializer_list>
#include <vector>

#include "kernels/reduce.hpp"

namespace dpr {

/// Values to sum: values[channel][starts[s * stride] .. starts[(s + 1) * stride]) for every channel and segment
/// s, of `count` values a channel. The sums are [channel][segment]. How they are rounded depends on
/// `expected`, roughly how many values of a channel there are.
struct Summation {
  std::size_t count, channels, segments, stride;
  const Buffer<cl_uint>& starts;
  const Buffer<float>& values;
  std::size_t expected = count;
  std::size_t first_channel = 0;
  std::size_t slots = 0;  ///< not 0: values are [channel][segment][2][slot], sums already and what they lost
};

/// Partial sums of a segment: enough to keep a device busy, of enough elements each to be worth a work-item.
std::size_t slots_of_segments(std::size_t elements_of_segment);

class Reduce {
 public:
  explicit Reduce(Device::Impl& device) : device_(device), launch_(device) {}

  void operator()(const Summation& what, Buffer<float>& sums);
  /// Writes them from `first_sum` on. Nothing is done where there are no channels.
  void add(const Summation& what, Buffer<float>& sums, std::size_t first_sum);
  /// Adds elements `held` of a sum of one segment, which lie from `shift` on in every channel of `what.values`, to
  /// what the elements before, in order, left in `partial`: add() makes the sums of that, with part_slots() and
  /// the bits that all elements at once would have. `what.count` is from one channel to the next.
  void add_part(const Summation& what, const Range& held, std::size_t shift, Buffer<float>& partial);
  /// The slots of sums that are made by parts.
  static std::size_t part_slots(std::size_t expected) { return slots_of_segments(expected); }
  /// The sums of each, read back at once.
  std::vector<std::vector<float>> read(std::initializer_list<Summation> all);

  std::size_t bytes() const { return partial_.capacity_bytes() + sums_.capacity_bytes(); }

 private:
  void start(const Summation& what, const cl_uint2& held, std::size_t shift, Buffer<float>& partial);

  Device::Impl& device_;
  Launcher<kernel::reduce_partial, kernel::reduce_final> launch_;
  Buffer<float> partial_, sums_;
};

}  // namespace dpr
