// Buffers of a caller's as tests lay them out and read them back.
#pragma once

#include <cmath>
#include <cstring>
#include <limits>
#include <span>
#include <vector>

#include "dpr/opencl_handles.hpp"
#include "support/caller.hpp"

namespace dpr::test::pipeline {

/// The floats of vectors, `stride` floats apart from `first` on, between numbers that nobody may read.
template <class Vector>
std::vector<float> laid_out(std::span<const Vector> vectors, std::size_t first, std::size_t stride) {
  std::vector<float> floats(first + vectors.size() * stride, std::numeric_limits<float>::quiet_NaN());
  for (std::size_t i = 0; i < vectors.size(); ++i)
    std::memcpy(&floats[first + i * stride], &vectors[i], sizeof(Vector));
  return floats;
}

template <class Vector>
std::vector<float> packed(std::span<const Vector> vectors) {
  return laid_out(vectors, 0, sizeof(Vector) / sizeof(float));
}

/// Rows of an affine matrix.
inline std::vector<float> rows_of(const glm::mat4& m) {
  std::vector<float> rows;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) rows.push_back(m[column][row]);
  }
  return rows;
}

inline std::vector<float> read_view(const Caller& caller, const BufferView& view) {
  const cl::Buffer whole(view.buffer, true);
  const std::vector<float> all = caller.read(whole);
  std::vector<float> values;
  for (std::size_t i = 0; i < view.count; ++i) {
    const std::size_t first = (view.offset + i * view.stride) / sizeof(float);
    values.insert(values.end(), &all[first], &all[first] + view.components);
  }
  return values;
}

inline bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

/// Numbers that the device adds up of several sums are rounded once there, and twice on the host.
inline bool is_near(const std::vector<float>& a, const std::vector<float>& b) {
  bool near = a.size() == b.size();
  for (std::size_t i = 0; near && i < a.size(); ++i)
    near = std::abs(a[i] - b[i]) <= 2 * std::numeric_limits<float>::epsilon() * std::abs(b[i]);
  return near;
}

}  // namespace dpr::test::pipeline
