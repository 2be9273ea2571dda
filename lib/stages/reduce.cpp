#include "stages/reduce.hpp"

#include <algorithm>
#include <bit>

namespace dpr {

std::size_t slots_of_segments(std::size_t elements_of_segment) {
  constexpr std::size_t k_elements_of_slot = 64, k_least = 16, k_most = 1024;
  return std::clamp(std::bit_floor(elements_of_segment / k_elements_of_slot), k_least, k_most);
}

Reduce::Reduce(Device::Impl& device)
    : device_(device),
      partial_sums_(device, "reduce.cl", "reduce_partial"),
      final_sums_(device, "reduce.cl", "reduce_final") {}

void Reduce::add(const Summation& what, Buffer<float>& sums, std::size_t first_sum) {
  const std::size_t count = what.channels * what.segments;
  if (count == 0) return;
  if (what.slots != 0) {
    final_sums_(count, to_uint(count), to_uint(what.slots), to_uint(first_sum), what.values, sums);
    return;
  }
  const auto slots = static_cast<cl_uint>(slots_of_segments(what.expected / what.segments));
  partial_.resize(device_, 2 * count * slots);
  const std::size_t width = std::min<std::size_t>(device_.info.lanes, DPR_TILE);
  partial_sums_(count * slots / width, static_cast<cl_uint>(what.count), static_cast<cl_uint>(what.channels),
                static_cast<cl_uint>(what.segments), static_cast<cl_uint>(what.stride), slots, what.starts,
                what.values, partial_);
  final_sums_(count, static_cast<cl_uint>(count), slots, static_cast<cl_uint>(first_sum), partial_, sums);
}

void Reduce::operator()(const Summation& what, Buffer<float>& sums) {
  sums.resize(device_, what.channels * what.segments);
  add(what, sums, 0);
}

std::vector<std::vector<float>> Reduce::read(std::initializer_list<Summation> all) {
  std::size_t total = 0;
  for (const Summation& what : all) total += what.channels * what.segments;
  sums_.resize(device_, total);
  std::size_t first = 0;
  for (const Summation& what : all) {
    add(what, sums_, first);
    first += what.channels * what.segments;
  }
  const std::vector<float> values = sums_.download();
  std::vector<std::vector<float>> result;
  auto at = values.begin();
  for (const Summation& what : all) {
    const auto end = at + static_cast<std::ptrdiff_t>(what.channels * what.segments);
    result.emplace_back(at, end);
    at = end;
  }
  return result;
}

}  // namespace dpr
