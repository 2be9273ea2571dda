// Prefix sums, stable sorting and compensated sums against serial ones: at the sizes where a chunk, a block
// or a level begins, with saturation, with empty segments, with sums that cancel.
#include <doctest/doctest.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "stages/bin.hpp"
#include "stages/reduce.hpp"
#include "stages/scan.hpp"
#include "stages/sort.hpp"
#include "support/messages.hpp"
#include "support/probe.hpp"
#include "support/reduced.hpp"

namespace scan_sort_reduce_test {

namespace {

using dpr::Buffer;
using dpr::test::device_impl;
using dpr::test::poison;
using dpr::test::reduced;

constexpr cl_uint k_poison = 0xdeadbeefU;
constexpr cl_uint k_most = 0xffffffffU;

std::vector<cl_uint> random_values(std::size_t count, cl_uint below, unsigned seed) {
  std::mt19937 engine(seed);
  std::vector<cl_uint> values(count);
  for (cl_uint& value : values) value = static_cast<cl_uint>(engine()) % below;
  return values;
}

Buffer<cl_uint> on_device(const std::vector<cl_uint>& values) {
  Buffer<cl_uint> buffer;
  poison(buffer, std::max<std::size_t>(values.size(), 1), k_poison);
  buffer.upload(device_impl(), values);
  return buffer;
}

Buffer<cl_uint> with_room_for_sum(std::vector<cl_uint> values) {
  values.push_back(k_poison);
  return on_device(values);
}

std::vector<cl_uint> scan(const std::vector<cl_uint>& values) {
  dpr::Scan operation(device_impl());
  Buffer<cl_uint> scanned = with_room_for_sum(values);
  operation(values.size(), scanned);
  return scanned.download();
}

std::vector<cl_uint> serial_scan(const std::vector<cl_uint>& values) {
  std::vector<cl_uint> offsets{0};
  for (const cl_uint value : values) {
    offsets.push_back(value > k_most - offsets.back() ? k_most : offsets.back() + value);
  }
  return offsets;
}

/// Around a chunk of 1024, its square, what one work-item takes, and more; under a simulator few of them.
std::vector<std::size_t> sizes() {
  const std::size_t serial = dpr::scanned_at_once(device_impl());
  if (dpr::test::is_reduced()) return {0, 1, 1025, serial + 1};
  return {0, 1, 2, 63, 256, 1023, 1024, 1025, 2047, serial, serial + 1, 1U << 20, (1U << 20) + 1, 5000000};
}

struct Sorted {
  std::vector<cl_uint> keys, values, starts;
};

/// With so much more room than there are keys.
Sorted sort(const std::vector<cl_uint>& keys, std::size_t key_count, std::size_t spare = 0) {
  dpr::Sort operation(device_impl());
  Buffer<cl_uint> key_buffer = on_device(keys), value_buffer, starts;
  if (!dpr::test::is_reduced())
    poison(starts, key_count + 1, k_poison);  // oclgrind takes it for uninitialised
  const Buffer<cl_uint> count = on_device({static_cast<cl_uint>(keys.size())});
  operation(keys.size() + spare, count, key_count, key_buffer, value_buffer, starts);
  key_buffer.resize(device_impl(), keys.size());
  value_buffer.resize(device_impl(), keys.size());
  return {key_buffer.download(), value_buffer.download(), starts.download()};
}

/// Sorted by key, equal keys in their first order, and every run where `starts` says.
bool is_stably_sorted(const std::vector<cl_uint>& keys, std::size_t key_count, const Sorted& sorted) {
  std::vector<cl_uint> places(keys.size());
  std::iota(places.begin(), places.end(), 0U);
  std::stable_sort(places.begin(), places.end(), [&](cl_uint a, cl_uint b) { return keys[a] < keys[b]; });
  if (sorted.values != places || sorted.starts.size() != key_count + 1) return false;
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (sorted.keys[i] != keys[places[i]]) return false;
  }
  for (std::size_t key = 0; key <= key_count; ++key) {
    const auto before = std::ranges::lower_bound(sorted.keys, static_cast<cl_uint>(key));
    if (sorted.starts[key] != static_cast<cl_uint>(before - sorted.keys.begin())) return false;
  }
  return true;
}

struct Reduction {
  std::size_t channels = 1, segments = 1, stride = 1;
  std::vector<cl_uint> starts;
  std::vector<float> values;  // [channel][count]
};

std::vector<float> reduce(const Reduction& r) {
  dpr::Reduce operation(device_impl());
  const Buffer<cl_uint> starts = on_device(r.starts);
  Buffer<float> values, sums;
  poison(values, std::max<std::size_t>(r.values.size(), 1));
  values.upload(device_impl(), r.values);
  poison(sums, r.channels * r.segments);
  const dpr::Summation what{r.values.size() / r.channels, r.channels, r.segments, r.stride, starts, values};
  operation(what, sums);
  std::vector<float> found = sums.download();
  CHECK(operation.read({what, what}) == std::vector<std::vector<float>>{found, found});
  return found;
}

std::vector<float> repeated(std::initializer_list<float> pattern, std::size_t times) {
  std::vector<float> values;
  for (std::size_t i = 0; i < times; ++i) values.insert(values.end(), pattern);
  return values;
}

float plain_sum(const std::vector<float>& values) {
  float sum = 0;
  for (const float value : values) sum += value;
  return sum;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("scan: every size around a chunk and a level") {
    for (const std::size_t count : sizes()) {
      CAPTURE(count);
      const std::vector<cl_uint> values = random_values(count, 100, static_cast<unsigned>(count) + 1);
      CHECK(scan(values) == serial_scan(values));
    }
  }

  TEST_CASE("scan: one operation serves sizes that grow and shrink") {
    dpr::Scan operation(device_impl());
    for (const std::size_t count :
         {std::size_t{300}, std::size_t{3}, static_cast<std::size_t>(reduced(70000, 600))}) {
      const std::vector<cl_uint> values = random_values(count, 5, 3);
      Buffer<cl_uint> scanned = with_room_for_sum(values);
      operation(count, scanned);
      CHECK(scanned.download() == serial_scan(values));
      CHECK(dpr::read_total(scanned, count, "items") == serial_scan(values).back());
    }
  }

  TEST_CASE("scan: of counts that the device alone can number") {
    for (const std::size_t count : sizes()) {
      const std::vector<cl_uint> values = random_values(count, 100, static_cast<unsigned>(count) + 2);
      for (const std::size_t present : {std::size_t{0}, count / 3, count}) {
        CAPTURE(count);
        CAPTURE(present);
        dpr::Scan operation(device_impl());
        Buffer<cl_uint> scanned = with_room_for_sum(values);
        operation(count, on_device({static_cast<cl_uint>(present)}), scanned);
        const std::vector<cl_uint> found = scanned.download();
        const auto end = values.begin() + static_cast<std::ptrdiff_t>(present);
        const std::vector<cl_uint> expected = serial_scan({values.begin(), end});
        CHECK(std::equal(expected.begin(), expected.end(), found.begin()));
        CHECK(found.back() == expected.back());
        // Between, nothing is touched.
        if (present + 1 < count) CHECK(found[present + 1] == values[present + 1]);
      }
    }
  }

  TEST_CASE("scan: a total beyond what gradients of pairs can be numbered by is refused") {
    static_assert(9 * dpr::k_most_pairs <= k_most && 9 * (dpr::k_most_pairs + 1) > k_most);
    const auto most = static_cast<cl_uint>(dpr::k_most_pairs);
    const Buffer<cl_uint> fits = on_device({0, most}), exceeds = on_device({0, most + 1});
    CHECK(dpr::read_total(fits, 1, "pairs (frame)", dpr::k_most_pairs) == most);
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument,
                          dpr::read_total(exceeds, 1, "pairs (frame)", dpr::k_most_pairs),
                          "pairs (frame): got more than " + std::to_string(dpr::k_most_pairs));
  }

  TEST_CASE("scan: sums saturate, and the total then is refused by name") {
    std::vector<cl_uint> values(1000, 0x00ffffffU);  // passes 2^32 after 256
    const std::vector<cl_uint> offsets = scan(values);
    CHECK(offsets == serial_scan(values));
    CHECK(offsets.back() == k_most);
    const Buffer<cl_uint> device_offsets = on_device(offsets);
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument,
                          dpr::read_total(device_offsets, values.size(), "fragments (frame)"),
                          "fragments (frame)");
    CHECK(dpr::read_total(device_offsets, 256, "fragments") == 256U * 0x00ffffffU);
  }

  TEST_CASE("scan: a sum that is wrong at one place is found out") {
    const std::vector<cl_uint> values = random_values(300, 9, 1);
    std::vector<cl_uint> offsets = scan(values);
    ++offsets[257];
    CHECK(offsets != serial_scan(values));
  }

  TEST_CASE("sort: stable, whatever the number of items and keys") {
    for (const std::size_t count : dpr::test::is_reduced()
                                       ? std::vector<std::size_t>{0, 1, 40}
                                       : std::vector<std::size_t>{0, 1, 1023, 1024, 1025, 5000}) {
      for (const std::size_t key_count : dpr::test::is_reduced()
                                             ? std::vector<std::size_t>{1, 257, 16384}
                                             : std::vector<std::size_t>{1, 2, 255, 256, 257, 16384, 70000}) {
        CAPTURE(count);
        CAPTURE(key_count);
        const auto keys = random_values(count, static_cast<cl_uint>(key_count), static_cast<unsigned>(count));
        CHECK(is_stably_sorted(keys, key_count, sort(keys, key_count)));
        CHECK(is_stably_sorted(keys, key_count, sort(keys, key_count, 1 + count / 2)));
      }
    }
  }

  TEST_CASE("sort: as few passes as the keys have bytes") {
    CHECK(dpr::sort_passes(1) == 0);
    for (const unsigned passes : {1U, 2U, 3U, 4U}) {
      const std::size_t last = std::size_t{1} << (8 * passes);
      CHECK(dpr::sort_passes(last / 256 + 1) == passes);
      CHECK(dpr::sort_passes(last) == passes);
    }
  }

  TEST_CASE("sort: many items of few keys, and keys of three digits") {
    const auto count = static_cast<std::size_t>(reduced(70000, 50));
    const std::vector<cl_uint> few = random_values(count, 3, 5), many = random_values(count, 1U << 24U, 6);
    CHECK(is_stably_sorted(few, 3, sort(few, 3)));
    if (!dpr::test::is_reduced()) CHECK(is_stably_sorted(many, 1U << 24U, sort(many, 1U << 24U)));
  }

  TEST_CASE("sort: all items of the last key, and of none") {
    const std::vector<cl_uint> keys(10, 299);
    const Sorted sorted = sort(keys, 300);
    CHECK(is_stably_sorted(keys, 300, sorted));
    CHECK(sorted.starts[299] == 0);
    CHECK(sorted.starts[300] == 10);
    CHECK(sort({}, 4).starts == std::vector<cl_uint>(5, 0));
  }

  TEST_CASE("sort: one work-item sorts as many do") {
    const auto count = static_cast<std::size_t>(reduced(3000, 40));
    const std::vector<cl_uint> keys = random_values(count, 500, 7);
    const Sorted serial = sort(keys, 500), parallel = sort(keys, 500, 16384);
    CHECK(serial.keys == parallel.keys);
    CHECK(serial.values == parallel.values);
    CHECK(serial.starts == parallel.starts);
  }

  TEST_CASE("sort: two equal keys that changed places are found out") {
    const std::vector<cl_uint> keys{2, 1, 2, 0};
    Sorted sorted = sort(keys, 3);
    CHECK(is_stably_sorted(keys, 3, sorted));
    std::swap(sorted.values[2], sorted.values[3]);
    CHECK_FALSE(is_stably_sorted(keys, 3, sorted));
  }

  TEST_CASE("reduce: what a plain sum loses is kept") {
    // Ones of one slot, 64 items apart, the slots' stride. The exact sum is their number.
    for (const std::size_t times : {1, 64, 640}) {
      std::vector<float> values;
      for (const float value : {1e8F, 1.0F, -1e8F}) values.insert(values.end(), times, value);
      CHECK(reduce({1, 1, 1, {0, static_cast<cl_uint>(values.size())}, values})[0] ==
            static_cast<float>(times));
    }
    const std::vector<float> values = repeated({1e8F, 1.0F, -1e8F}, 500);
    CHECK(reduce({1, 1, 1, {0, 1500}, values})[0] == 500.0F);
    CHECK(plain_sum(values) != 500.0F);
  }

  TEST_CASE("reduce: many small numbers beside a large one") {
    std::vector<float> values(static_cast<std::size_t>(reduced(100000, 1000)), 1e-3F);
    values[10] = 1e6F;
    double exact = 0;
    for (const float value : values) exact += static_cast<double>(value);
    const float found = reduce({1, 1, 1, {0, static_cast<cl_uint>(values.size())}, values})[0];
    CHECK(std::abs(static_cast<double>(found) - exact) <= 6e-8 * exact);
  }

  TEST_CASE("reduce: segments by stride, channels apart, empty segments zero") {
    const std::vector<cl_uint> starts{0, 2, 2, 5, 5, 5, 9};
    std::vector<float> values;
    for (int i = 0; i < 18; ++i) values.push_back(static_cast<float>(1 << i));  // two channels of nine
    CHECK(reduce({2, 6, 1, starts, values}) ==
          std::vector<float>{3, 0, 28, 0, 0, 480, 1536, 0, 14336, 0, 0, 245760});
    CHECK(reduce({2, 3, 2, starts, values}) == std::vector<float>{3, 28, 480, 1536, 14336, 245760});
    CHECK(reduce({2, 2, 3, starts, values}) == std::vector<float>{31, 480, 15872, 245760});
    CHECK(reduce({2, 1, 6, starts, values}) == std::vector<float>{511, 261632});
    CHECK(reduce({1, 2, 1, {0, 0, 0}, {}}) == std::vector<float>{0, 0});
  }

  TEST_CASE("reduce: the same bits from run to run, and a NaN is not swallowed") {
    std::mt19937 engine(4);
    std::vector<float> values(static_cast<std::size_t>(reduced(5000, 200)));
    for (float& value : values) value = static_cast<float>(engine()) * 0x1p-32F - 0.5F;
    const Reduction r{1, 1, 1, {0, static_cast<cl_uint>(values.size())}, values};
    CHECK(reduce(r) == reduce(r));
    dpr::Reduce operation(device_impl());
    values[7] = dpr::test::k_poison;
    const Buffer<float> poisoned(device_impl(), std::span<const float>(values));
    CHECK(std::isnan(operation.read({{values.size(), 1, 1, 1, on_device(r.starts), poisoned}})[0][0]));
  }
}

}  // namespace scan_sort_reduce_test
