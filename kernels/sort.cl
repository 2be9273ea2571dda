// A stable radix sort of (key, value) by eight bits a pass: pairs leave it ordered by tile and, within a
// tile, still by face. Nothing depends on the order in which work-items run. The number of elements, `count`,
// is on the device; the host launches for the capacity of the buffers. Few elements are sorted by one
// work-item instead, to the same order.
#include "shared_types.h"

#define DPR_SORT_DIGITS 256

static inline uint sort_digit(uint key, uint shift) { return (key >> shift) & (DPR_SORT_DIGITS - 1); }

/// Work-items, and columns of the histogram.
static inline uint sort_blocks(uint capacity) {
  return capacity / DPR_SORT_BLOCK + (capacity % DPR_SORT_BLOCK != 0);
}

/// Counts the digits of every block. One work-item per block.
/// in   capacity   the largest number of elements
/// in   shift      of the pass' digit: the lowest of its bits
/// in   count      uint[1]                      the number of elements
/// in   keys       uint[count]
/// out  histogram  uint[DPR_SORT_DIGITS][block]
kernel void sort_histogram(const uint capacity, const uint shift, global const uint* restrict count,
                           global const uint* restrict keys, global uint* restrict histogram) {
  const uint block = (uint)get_global_id(0);
  const uint blocks = sort_blocks(capacity);
  if (block >= blocks) return;
  uint counts[DPR_SORT_DIGITS];
  for (uint d = 0; d < DPR_SORT_DIGITS; ++d) counts[d] = 0;
  const uint last = min(count[0], (block + 1) * DPR_SORT_BLOCK);
  for (uint i = block * DPR_SORT_BLOCK; i < last; ++i) ++counts[sort_digit(keys[i], shift)];
  for (uint d = 0; d < DPR_SORT_DIGITS; ++d) histogram[d * blocks + block] = counts[d];
}

/// Moves every element to its place. One work-item per block. Inputs as sort_histogram, and
/// in   values   uint[count]                   move with their keys
/// in   offsets  uint[DPR_SORT_DIGITS][block]  exclusive scan of the histogram
/// out  sorted_keys, sorted_values  uint[count]
kernel void sort_scatter(const uint capacity, const uint shift, global const uint* restrict count,
                         global const uint* restrict keys, global const uint* restrict values,
                         global const uint* restrict offsets, global uint* restrict sorted_keys,
                         global uint* restrict sorted_values) {
  const uint block = (uint)get_global_id(0);
  const uint blocks = sort_blocks(capacity);
  if (block >= blocks) return;
  uint next[DPR_SORT_DIGITS];
  for (uint d = 0; d < DPR_SORT_DIGITS; ++d) next[d] = offsets[d * blocks + block];
  const uint last = min(count[0], (block + 1) * DPR_SORT_BLOCK);
  for (uint i = block * DPR_SORT_BLOCK; i < last; ++i) {
    const uint target = next[sort_digit(keys[i], shift)]++;
    sorted_keys[target] = keys[i];
    sorted_values[target] = values[i];
  }
}

/// Sorts few elements of few keys by counting. One work-item.
/// in   last_key  the number of keys, from 0 on
/// in   count     uint[1]       the number of elements
/// in   keys      uint[count]
/// in   values    uint[count]   move with their keys
/// out  sorted_keys, sorted_values  uint[count]
/// out  starts    uint[last_key + 1]  where each key's run begins in the sorted list
kernel void sort_serial(const uint last_key, global const uint* restrict count,
                        global const uint* restrict keys, global const uint* restrict values,
                        global uint* restrict sorted_keys, global uint* restrict sorted_values,
                        global uint* restrict starts) {
  if (get_global_id(0) != 0) return;
  const uint elements = count[0];
  for (uint key = 0; key <= last_key; ++key) starts[key] = 0;
  for (uint i = 0; i < elements; ++i) ++starts[keys[i]];
  uint end = elements;
  for (uint key = last_key + 1; key-- > 0;) starts[key] = end -= starts[key];
  for (uint i = 0; i < elements; ++i) {
    const uint target = starts[keys[i]]++;
    sorted_keys[target] = keys[i];
    sorted_values[target] = values[i];
  }
  // Every start has become its run's end, the next run's start.
  for (uint key = last_key; key > 0; --key) starts[key] = starts[key - 1];
  starts[0] = 0;
}

/// Where each key's run begins in the sorted list: lower bound by bisection. One work-item per key, and one
/// more.
/// in   keys         how many there are, from 0 on
/// in   count        uint[1]         the number of elements
/// in   sorted_keys  uint[count]
/// out  starts       uint[keys + 1]
kernel void sort_ranges(const uint keys, global const uint* restrict count,
                        global const uint* restrict sorted_keys, global uint* restrict starts) {
  const uint key = (uint)get_global_id(0);
  if (key > keys) return;
  uint low = 0, high = count[0];
  while (low < high) {
    const uint middle = low + (high - low) / 2;
    if (sorted_keys[middle] < key) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  starts[key] = low;
}
