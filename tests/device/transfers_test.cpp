// Transfers between host and device: writes wait only where many bytes are pending, reads can wait together;
// all are counted.
#include <doctest/doctest.h>

#include <optional>
#include <vector>

#include "device/buffer.hpp"
#include "support/reduced.hpp"

namespace transfers_test {

using dpr::Buffer;
using dpr::TransferCounts;
namespace cl = dpr::cl;
using dpr::test::reduced;

TEST_SUITE("unit") {
  TEST_CASE("transfers: bytes in either direction and waits are counted, and writes do not wait") {
    const dpr::Device device = dpr::open_device();
    const std::vector<cl_uint> few{1, 2, 3}, many(300'000, 7);  // more than a mebibyte
    Buffer<cl_uint> buffer(impl_of(device), std::span(few));
    const TransferCounts first = impl_of(device).transfers();
    CHECK(first.bytes_to_device == 12);
    CHECK(first.host_waits == 0);
    CHECK(buffer.download() == few);
    CHECK(impl_of(device).transfers().bytes_from_device == 12);
    CHECK(impl_of(device).transfers().host_waits == 1);
    buffer.upload(impl_of(device), many);
    CHECK(impl_of(device).transfers().host_waits == 1);
    CHECK(impl_of(device).transfers().bytes_to_device == 12 + 4 * many.size());
    CHECK(buffer.download() == many);
  }

  TEST_CASE("transfers: a write waits where the host would hold too much") {
    const dpr::Device device = dpr::open_device();
    const std::vector<cl_uint> values(dpr::Device::Impl::k_most_pending_bytes / sizeof(cl_uint) + 1, 5);
    Buffer<cl_uint> buffer(impl_of(device), std::span(values).first(values.size() - 1));
    CHECK(impl_of(device).transfers().host_waits == 0);
    buffer.upload(impl_of(device), values);
    CHECK(impl_of(device).transfers().host_waits == 1);
    CHECK(buffer.download() == values);
  }

  TEST_CASE("transfers: reads of several buffers wait once") {
    const dpr::Device device = dpr::open_device();
    const std::vector<cl_uint> few{1, 2, 3}, more{4, 5, 6, 7};
    const Buffer<cl_uint> first(impl_of(device), std::span(few)), second(impl_of(device), std::span(more));
    std::vector<cl_uint> read_first(3), read_second(2);
    dpr::PendingReads reads(impl_of(device));
    first.download(read_first, 0, reads);
    second.download(read_second, 1, reads);
    CHECK(impl_of(device).transfers().host_waits == 0);
    reads.finish();
    CHECK(impl_of(device).transfers().host_waits == 1);
    CHECK(read_first == few);
    CHECK(read_second == std::vector<cl_uint>{5, 6});
    reads.finish();  // of nothing
    CHECK(impl_of(device).transfers().host_waits == 1);
    CHECK_THROWS_AS(second.download(read_first, 2, reads), std::logic_error);
  }

  TEST_CASE("transfers: what a write read may be gone at once; writes arrive in order") {
    const dpr::Device device = dpr::open_device();
    Buffer<cl_uint> buffer(impl_of(device), 1000);
    cl_uint last = 0;
    for (int i = 0; i < reduced(200, 5); ++i) {
      last = static_cast<cl_uint>(i);
      const std::vector<cl_uint> values(1000, last);
      buffer.upload(impl_of(device), values);
    }
    CHECK(buffer.download() == std::vector<cl_uint>(1000, last));
  }

  TEST_CASE("transfers: a device may go while a write is under way") {
    std::optional<dpr::Device> device = dpr::open_device();
    const cl::CommandQueue queue = impl_of(*device).queue;
    const std::vector<cl_uint> values(100'000, 3);
    cl::Buffer kept;
    {
      const Buffer<cl_uint> buffer(impl_of(*device), std::span(values));
      kept = buffer.cl_buffer();
    }
    device.reset();
    std::vector<cl_uint> found(values.size());
    REQUIRE(queue.enqueueReadBuffer(kept, CL_TRUE, 0, found.size() * sizeof(cl_uint), found.data()) ==
            CL_SUCCESS);
    CHECK(found == values);
  }
}

}  // namespace transfers_test
