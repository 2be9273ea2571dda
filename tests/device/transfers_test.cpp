// Transfers between host and device: small writes do not wait, large ones do; all are counted.
#include <doctest/doctest.h>

#include <vector>

#include "device/buffer.hpp"
#include "support/reduced.hpp"

using dpr::Buffer;
using dpr::TransferCounts;
using dpr::test::reduced;

TEST_SUITE("unit") {
  TEST_CASE("transfers: bytes in either direction and waits are counted, and small writes do not wait") {
    const dpr::Device device = dpr::open_device();
    const std::vector<cl_uint> few{1, 2, 3}, many(300'000, 7);  // more than a mebibyte
    Buffer<cl_uint> buffer(device.impl(), std::span(few));
    const TransferCounts first = device.impl().transfers();
    CHECK(first.bytes_to_device == 12);
    CHECK(first.host_waits == 0);
    CHECK(buffer.download() == few);
    CHECK(device.impl().transfers().bytes_from_device == 12);
    CHECK(device.impl().transfers().host_waits == 1);
    buffer.upload(device.impl(), many);
    CHECK(device.impl().transfers().host_waits == 2);
    CHECK(device.impl().transfers().bytes_to_device == 12 + 4 * many.size());
    CHECK(buffer.download() == many);
  }

  TEST_CASE("transfers: what a write read may be gone at once; writes arrive in order") {
    const dpr::Device device = dpr::open_device();
    Buffer<cl_uint> buffer(device.impl(), 1000);
    cl_uint last = 0;
    for (int i = 0; i < reduced(200, 5); ++i) {
      last = static_cast<cl_uint>(i);
      const std::vector<cl_uint> values(1000, last);
      buffer.upload(device.impl(), values);
    }
    CHECK(buffer.download() == std::vector<cl_uint>(1000, last));
  }

  TEST_CASE("transfers: a device may go while a write is under way") {
    const dpr::Device device = dpr::open_device();
    const std::vector<cl_uint> values(100'000, 3);
    const Buffer<cl_uint> buffer(device.impl(), std::span(values));
  }
}
