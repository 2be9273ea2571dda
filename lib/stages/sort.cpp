#include "stages/sort.hpp"

#include <algorithm>
#include <bit>
#include <utility>

namespace dpr {

namespace {

/// Bits of the largest of so many keys.
unsigned key_bits(std::size_t key_count) {
  return static_cast<unsigned>(std::bit_width(std::max<std::size_t>(key_count, 1) - 1));
}

}  // namespace

unsigned sort_passes(std::size_t key_count) {
  return (key_bits(key_count) + DPR_SORT_BITS - 1) / DPR_SORT_BITS;
}

bool is_sorted_at_once(const Device::Impl& device, std::size_t capacity, std::size_t key_count) {
  constexpr std::size_t k_of_a_work_item = 16384;  // 20 microseconds; a launch takes 5 to 10
  constexpr std::size_t k_keys_of_a_group = 4096;  // 64 bisections a work-item
  if (device.info.lanes != 1) return capacity + key_count <= k_of_a_work_item;
  return capacity <= DPR_SORT_BLOCK && key_count <= k_keys_of_a_group;
}

void Sort::operator()(std::size_t capacity, const Buffer<cl_uint>& count, std::size_t key_count,
                      Buffer<cl_uint>& keys, Buffer<cl_uint>& values, Buffer<cl_uint>& starts) {
  const auto last_key = static_cast<cl_uint>(key_count);
  other_keys_.resize(device_, keys.length());
  for (Buffer<cl_uint>* numbers : {&values, &other_values_}) numbers->resize(device_, keys.length());
  starts.resize(device_, key_count + 1);
  const auto exchange = [&] {
    std::swap(keys, other_keys_);
    std::swap(values, other_values_);
  };
  if (capacity > 0 && is_sorted_at_once(device_, capacity, key_count)) {
    launch_.in_groups(1, kernel::sort_few{.last_key = last_key,
                                          .count = count,
                                          .keys = keys,
                                          .sorted_keys = other_keys_,
                                          .sorted_values = other_values_,
                                          .starts = starts});
    exchange();
    return;
  }
  const unsigned all_bits = key_bits(key_count),
                 passes = capacity > 0 ? std::max(sort_passes(key_count), 1U) : 0;
  for (unsigned k = 0, shift = 0; k < passes; ++k) {  // of bits as equal as may be: fewer digits to count
    const unsigned bits = (all_bits - shift + passes - k - 1) / (passes - k);
    pass(capacity, shift, bits, count, keys, values);
    exchange();
    shift += bits;
  }
  launch_(key_count + 1,
          kernel::sort_ranges{.keys = last_key, .count = count, .sorted_keys = keys, .starts = starts});
}

void Sort::pass(std::size_t capacity, unsigned shift, unsigned bits, const Buffer<cl_uint>& count,
                const Buffer<cl_uint>& keys, const Buffer<cl_uint>& values) {
  const std::size_t blocks = (capacity + DPR_SORT_BLOCK - 1) / DPR_SORT_BLOCK;
  offsets_.resize(device_, (blocks << DPR_SORT_BITS) + 1);
  offset_count_.resize(device_, 1);
  launch_.in_groups(blocks, kernel::sort_histogram{.shift = shift,
                                                   .bits = bits,
                                                   .count = count,
                                                   .keys = keys,
                                                   .histogram = offsets_,
                                                   .size = offset_count_});
  scan_(blocks << bits, offset_count_, offsets_);
  launch_.in_groups(blocks, kernel::sort_scatter{.shift = shift,
                                                 .bits = bits,
                                                 .count = count,
                                                 .keys = keys,
                                                 .values = values,
                                                 .offsets = offsets_,
                                                 .sorted_keys = other_keys_,
                                                 .sorted_values = other_values_});
}

std::size_t Sort::bytes() const {
  return scan_.bytes() + offsets_.capacity_bytes() + offset_count_.capacity_bytes() +
         other_keys_.capacity_bytes() + other_values_.capacity_bytes();
}

}  // namespace dpr
