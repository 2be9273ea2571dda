#include "stages/reduce.hpp"

#include <algorithm>
#include <bit>
#include <limits>

namespace dpr {

std::size_t slots_of_segments(std::size_t elements_of_segment) {
  constexpr std::size_t k_elements_of_slot = 64, k_least = 16, k_most = 1024;
  return std::clamp(std::bit_floor(elements_of_segment / k_elements_of_slot), k_least, k_most);
}

void Reduce::add(const Summation& what, Buffer<float>& sums, std::size_t first_sum) {
  const std::size_t count = what.channels * what.segments;
  if (count == 0) return;
  if (what.slots != 0) {
    launch_(count, kernel::reduce_final{.count = to_uint(count),
                                        .slots = to_uint(what.slots),
                                        .first = to_uint(first_sum),
                                        .partial = what.values,
                                        .sums = sums});
    return;
  }
  start(what, {{0, std::numeric_limits<cl_uint>::max()}}, 0, partial_);
  launch_(count, kernel::reduce_final{.count = static_cast<cl_uint>(count),
                                      .slots = to_uint(slots_of_segments(what.expected / what.segments)),
                                      .first = static_cast<cl_uint>(first_sum),
                                      .partial = partial_,
                                      .sums = sums});
}

void Reduce::start(const Summation& what, const cl_uint2& held, std::size_t shift, Buffer<float>& partial) {
  const std::size_t count = what.channels * what.segments;
  const auto slots = static_cast<cl_uint>(slots_of_segments(what.expected / what.segments));
  partial.resize(device_, 2 * count * slots);
  const std::size_t width = std::min<std::size_t>(device_.info.lanes, DPR_TILE);
  launch_(count * slots / width, kernel::reduce_partial{.count = static_cast<cl_uint>(what.count),
                                                        .held = held,
                                                        .shift = to_uint(shift),
                                                        .first_channel = to_uint(what.first_channel),
                                                        .channels = static_cast<cl_uint>(what.channels),
                                                        .segments = static_cast<cl_uint>(what.segments),
                                                        .stride = static_cast<cl_uint>(what.stride),
                                                        .slots = slots,
                                                        .starts = what.starts,
                                                        .values = what.values,
                                                        .partial = partial});
}

void Reduce::add_part(const Summation& what, const Range& held, std::size_t shift, Buffer<float>& partial) {
  if (what.channels > 0) start(what, {{to_uint(held.first), held.last()}}, shift, partial);
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
