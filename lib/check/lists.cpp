// Self-test of the lists' stages: whole numbers, so nothing may differ; sums, compensated.
#include <algorithm>
#include <numeric>
#include <random>
#include <vector>

#include "check/check_log.hpp"
#include "stages/reduce.hpp"
#include "stages/scan.hpp"
#include "stages/sort.hpp"

namespace dpr::check {
namespace {

/// More than one work-item takes, and no multiple of a chunk.
constexpr std::size_t k_elements = 70001;

std::vector<cl_uint> random_numbers(cl_uint below) {
  std::mt19937 engine(1);
  std::vector<cl_uint> values(k_elements);
  for (cl_uint& value : values) value = static_cast<cl_uint>(engine()) % below;
  return values;
}

Buffer<cl_uint> uploaded(Device::Impl& device, const std::vector<cl_uint>& values) {
  return Buffer<cl_uint>(device, std::span<const cl_uint>(values));
}

/// Number of entries that differ; all where the lengths do.
double differing(const std::vector<cl_uint>& found, const std::vector<cl_uint>& expected) {
  if (found.size() != expected.size()) return static_cast<double>(expected.size());
  std::size_t count = 0;
  for (std::size_t i = 0; i < found.size(); ++i) count += found[i] != expected[i];
  return static_cast<double>(count);
}

void check_scan(Device::Impl& device, CheckLog& log) {
  const std::vector<cl_uint> values = random_numbers(100);
  std::vector<cl_uint> expected(values.size() + 1);
  std::partial_sum(values.begin(), values.end(), expected.begin() + 1);
  std::vector<cl_uint> counts = values;
  counts.push_back(0);
  Buffer<cl_uint> offsets = uploaded(device, counts);
  Scan scan(device);
  scan(values.size(), offsets);
  log.add("scan", "offsets that differ", differing(offsets.download(), expected), 0);
}

void check_sort(Device::Impl& device, CheckLog& log) {
  constexpr cl_uint k_keys = 3000;  // of more than eight bits: several passes
  const std::vector<cl_uint> keys = random_numbers(k_keys);
  std::vector<cl_uint> places(keys.size());
  std::iota(places.begin(), places.end(), 0U);
  Buffer<cl_uint> sorted_keys = uploaded(device, keys), sorted_places, starts;
  Sort sort(device);
  sort(keys.size(), uploaded(device, {static_cast<cl_uint>(keys.size())}), k_keys, sorted_keys, sorted_places,
       starts);
  std::ranges::stable_sort(places, {}, [&](cl_uint place) { return keys[place]; });
  log.add("sort", "places that differ", differing(sorted_places.download(), places), 0);
}

void check_reduce(Device::Impl& device, CheckLog& log) {
  std::vector<float> values;
  for (const cl_uint number : random_numbers(2001)) values.push_back(static_cast<float>(number) - 1e3F);
  const std::vector<cl_uint> starts{0, k_elements / 3, k_elements};
  const Buffer<cl_uint> device_starts = uploaded(device, starts);
  const Buffer<float> device_values(device, std::span<const float>(values));
  Reduce reduce(device);
  const Summation what{values.size(), 1, 2, 1, device_starts, device_values};
  const std::vector<float> found = reduce.read({what}).front();
  Largest worst;
  for (std::size_t segment = 0; segment < 2; ++segment) {
    double sum = 0, size = 0;
    for (cl_uint i = starts[segment]; i < starts[segment + 1]; ++i) {
      sum += static_cast<double>(values[i]);
      size += std::fabs(static_cast<double>(values[i]));
    }
    worst.add(std::fabs(static_cast<double>(found[segment]) - sum) / size);
  }
  log.add("reduce", "sums, of that of absolute values", worst.value(), 1e-7);
}

}  // namespace

void check_lists(const Device& device, CheckLog& log) {
  check_scan(impl_of(device), log);
  check_sort(impl_of(device), log);
  check_reduce(impl_of(device), log);
}

}  // namespace dpr::check
