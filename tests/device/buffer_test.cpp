// The room that a buffer keeps.
#include <doctest/doctest.h>

#include <cstddef>

#include "support/probe.hpp"

namespace buffer_test {

using dpr::test::device_impl;

TEST_SUITE("unit") {
  TEST_CASE(
      "buffer: a vector of the widest lanes fits behind the last element, whatever the buffer held before") {
    constexpr std::size_t k_widest = 16;
    for (std::size_t first = 1; first < 100; first += 7) {
      dpr::Buffer<float> buffer(device_impl(), first);
      for (std::size_t count = first; count < 2 * first + 40; ++count) {
        buffer.resize(device_impl(), count);
        CAPTURE(first);
        CAPTURE(count);
        REQUIRE(buffer.size() == count);
        REQUIRE(buffer.capacity_bytes() >= (count + k_widest - 1) * sizeof(float));
      }
    }
  }

  TEST_CASE("buffer: nothing is allocated for no elements") {
    dpr::Buffer<float> buffer(device_impl(), 0);
    CHECK(buffer.capacity_bytes() == 0);
  }
}

}  // namespace buffer_test
