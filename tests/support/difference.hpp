// How far numbers are from what is expected of them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace dpr::test {

/// The greatest difference of the first n, relative to the greatest of what is expected.
template <typename Values>
double difference(const Values& found, const Values& expected, std::size_t n) {
  double error = 0, size = 0;
  for (std::size_t i = 0; i < n; ++i) {
    error = std::max(error, std::abs(found[i] - expected[i]));
    size = std::max(size, std::abs(expected[i]));
  }
  return error / size;
}

}  // namespace dpr::test
