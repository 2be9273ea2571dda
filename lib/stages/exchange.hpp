// Vectors to and from buffers of the caller's, and numbers of a gradient from the sums of its channels.
#pragma once

#include "kernels/exchange.hpp"

namespace dpr {

/// Vectors of floats in a buffer: groups of `rows` vectors that follow one another, the groups `stride`
/// floats apart. Checked by whoever makes it.
struct FloatVectors {
  cl_mem buffer = nullptr;
  std::size_t first = 0, stride = 0, components = 0, rows = 1;  ///< floats, floats, floats, vectors
};

/// numbers[i] = the sum of factors[k] * sums[terms[k]] over k in [starts[i], starts[i + 1]).
struct SparseMap {
  Buffer<cl_uint> starts, terms;
  Buffer<float> factors;
  std::size_t numbers = 0;

  std::size_t bytes() const {
    return starts.capacity_bytes() + terms.capacity_bytes() + factors.capacity_bytes();
  }
};

class Exchange {
 public:
  explicit Exchange(Device::Impl& device) : device_(device), launch_(device) {}

  /// From the caller's `count` vectors to elements of `to` from `first` on, 0 behind their components.
  /// Numbers that are not finite become 0: kernels index by what they compute of them.
  void take(const FloatVectors& from, std::size_t count, Buffer<cl_float4>& to, std::size_t first);
  /// The same to packed vectors of so many floats, from the first element on.
  void take(const FloatVectors& from, std::size_t count, Buffer<float>& to, std::size_t components);
  /// From `count` world-to-camera matrices, of three rows each, to what cameras have of them.
  void take_cameras(const FloatVectors& from, std::size_t count, bool orthographic,
                    Buffer<shared::ViewParams>& cameras);
  /// `count` vectors to the caller; of integers of 32 bits too.
  void give(const FloatVectors& from, std::size_t count, const FloatVectors& to);
  void map(const SparseMap& map, const Buffer<float>& sums, Buffer<float>& numbers);

 private:
  void copy(const FloatVectors& from, std::size_t count, const FloatVectors& to, bool clean);

  Device::Impl& device_;
  Launcher<kernel::exchange_vectors, kernel::exchange_unpack, kernel::exchange_pack, kernel::exchange_cameras,
           kernel::exchange_map>
      launch_;
};

/// Elements of a buffer from `first` on, `components` of each.
FloatVectors vectors_of(const Buffer<cl_float4>& buffer, std::size_t first, std::size_t components);
FloatVectors vectors_of(const Buffer<float>& buffer, std::size_t first, std::size_t components);

}  // namespace dpr
