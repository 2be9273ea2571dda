// Compensated sums over segments, in a fixed order.
#pragma once

#include <vector>

#include "device/kernel.hpp"

namespace dpr {

class Reduce {
 public:
  explicit Reduce(Device::Impl& device);

  /// Sums values[channel][starts[s * stride] .. starts[(s + 1) * stride]) for every channel and segment s, of
  /// `count` values a channel, into sums[channel][segment].
  void operator()(std::size_t count, std::size_t channels, std::size_t segments, std::size_t stride,
                  const Buffer<cl_uint>& starts, const Buffer<float>& values, Buffer<float>& sums);
  /// The same, read back.
  std::vector<float> read(std::size_t count, std::size_t channels, std::size_t segments, std::size_t stride,
                          const Buffer<cl_uint>& starts, const Buffer<float>& values);

  std::size_t bytes() const { return partial_.capacity_bytes() + sums_.capacity_bytes(); }

 private:
  Device::Impl& device_;
  Kernel<cl_uint, cl_uint, cl_uint, cl_uint, In<cl_uint>, In<float>, Out<cl_float2>> partial_sums_;
  Kernel<cl_uint, cl_uint, In<cl_float2>, Out<float>> final_sums_;
  Buffer<cl_float2> partial_;
  Buffer<float> sums_;
};

}  // namespace dpr
