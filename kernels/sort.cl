// A stable radix sort of (key, value) by some bits a pass: pairs leave it ordered by tile and, within a tile,
// still by face. Nothing depends on the order in which work-items run. The number of elements, `count`, is on
// the device; the host launches for the capacity of the buffers. A block is a work-item's on CPUs, which
// count eight bits in their caches, and a work-group's on GPUs, which count four in local memory. Few
// elements are sorted by one work-item or one group instead, to the same order.
#include "group.h"

#ifndef DPR_LANES
#define DPR_LANES 8
#endif

#define DPR_SORT_DIGITS (1u << DPR_SORT_BITS(DPR_LANES))

static inline uint sort_digit(uint key, uint shift) { return (key >> shift) & (DPR_SORT_DIGITS - 1); }

/// Columns of the histogram.
static inline uint sort_blocks(uint capacity) {
  return capacity / DPR_SORT_BLOCK + (capacity % DPR_SORT_BLOCK != 0);
}

#if DPR_LANES == 1

/// Elements of a block that are there.
static inline uint elements_of(uint block, uint count) {
  const uint first = block * DPR_SORT_BLOCK;
  return count > first ? min(count - first, (uint)DPR_SORT_BLOCK) : 0;
}

/// Counts the digits of every block. One work-group per block.
/// in   capacity   the largest number of elements
/// in   shift      of the pass' digit: the lowest of its bits
/// in   count      uint[1]                      the number of elements
/// in   keys       uint[count]
/// out  histogram  uint[DPR_SORT_DIGITS][block]
DPR_GROUP_KERNEL kernel void sort_histogram(const uint capacity, const uint shift,
                                            global const uint* restrict count,
                                            global const uint* restrict keys,
                                            global uint* restrict histogram) {
  local uint counts[DPR_SORT_DIGITS * DPR_GROUP];  // [digit][work-item]
  const uint block = (uint)get_group_id(0), item = (uint)get_local_id(0), here = elements_of(block, count[0]);
  for (uint d = 0; d < DPR_SORT_DIGITS; ++d) counts[d * DPR_GROUP + item] = 0;
  for (uint i = item; i < here; i += DPR_GROUP)
    ++counts[sort_digit(keys[block * DPR_SORT_BLOCK + i], shift) * DPR_GROUP + item];
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item >= DPR_SORT_DIGITS) return;
  uint sum = 0;
  for (uint k = 0; k < DPR_GROUP; ++k) sum += counts[item * DPR_GROUP + (k + item) % DPR_GROUP];
  histogram[item * sort_blocks(capacity) + block] = sum;
}

/// Moves every element to its place. One work-group per block: it sorts the block in local memory, so that
/// neighbours are written by neighbours. Inputs as sort_histogram, and
/// in   values   uint[count]                   move with their keys
/// in   offsets  uint[DPR_SORT_DIGITS][block]  exclusive scan of the histogram
/// out  sorted_keys, sorted_values  uint[count]
DPR_GROUP_KERNEL kernel void sort_scatter(const uint capacity, const uint shift,
                                          global const uint* restrict count, global const uint* restrict keys,
                                          global const uint* restrict values,
                                          global const uint* restrict offsets,
                                          global uint* restrict sorted_keys,
                                          global uint* restrict sorted_values) {
  const uint each = DPR_EACH(DPR_SORT_BLOCK), of_counts = DPR_SORT_DIGITS;
  local uint block_keys[DPR_LOCAL_PLACES(DPR_SORT_BLOCK)], order[DPR_SORT_BLOCK], group_sums[DPR_GROUP];
  local uint counts[DPR_LOCAL_PLACES(DPR_SORT_DIGITS * DPR_GROUP)];  // [digit][work-item]
  local uint targets[DPR_SORT_DIGITS];  // of a digit's first element, less its place in the block
  const uint block = (uint)get_group_id(0), item = (uint)get_local_id(0), here = elements_of(block, count[0]);
  const uint first = block * DPR_SORT_BLOCK, blocks = sort_blocks(capacity);
  for (uint i = item; i < here; i += DPR_GROUP) block_keys[local_place(i, each)] = keys[first + i];
  for (uint d = 0; d < DPR_SORT_DIGITS; ++d) counts[local_place(d * DPR_GROUP + item, of_counts)] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  const uint last = min(here, (item + 1) * each);
  for (uint i = item * each; i < last; ++i)
    ++counts[local_place(sort_digit(block_keys[local_place(i, each)], shift) * DPR_GROUP + item, of_counts)];
  barrier(CLK_LOCAL_MEM_FENCE);
  group_scan_chunk(counts, of_counts, group_sums);
  if (item < DPR_SORT_DIGITS)
    targets[item] = offsets[item * blocks + block] - counts[local_place(item * DPR_GROUP, of_counts)];
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint i = item * each; i < last; ++i)
    order[counts[local_place(sort_digit(block_keys[local_place(i, each)], shift) * DPR_GROUP + item,
                             of_counts)]++] = i;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint i = item; i < here; i += DPR_GROUP) {
    const uint key = block_keys[local_place(order[i], each)], target = targets[sort_digit(key, shift)] + i;
    sorted_keys[target] = key;
    sorted_values[target] = values[first + order[i]];
  }
}

/// Sorts few elements of few keys. One work-group, in local memory: one launch instead of three a pass.
/// in   last_key  the number of keys, from 0 on
/// in   count     uint[1]       the number of elements, at most DPR_SORT_BLOCK
/// in   keys      uint[count]
/// in   values    uint[count]   move with their keys
/// out  sorted_keys, sorted_values  uint[count]
/// out  starts    uint[last_key + 1]  where each key's run begins in the sorted list
DPR_GROUP_KERNEL kernel void sort_few(const uint last_key, global const uint* restrict count,
                                      global const uint* restrict keys, global const uint* restrict values,
                                      global uint* restrict sorted_keys, global uint* restrict sorted_values,
                                      global uint* restrict starts) {
  const uint each = DPR_EACH(DPR_SORT_BLOCK), of_counts = DPR_SORT_DIGITS;
  local uint list_keys[2][DPR_SORT_BLOCK], order[2][DPR_SORT_BLOCK], group_sums[DPR_GROUP];
  local uint counts[DPR_LOCAL_PLACES(DPR_SORT_DIGITS * DPR_GROUP)];  // [digit][work-item]
  const uint item = (uint)get_local_id(0), here = min(count[0], (uint)DPR_SORT_BLOCK);
  const uint first = item * each, last = min(here, first + each);
  uint from = 0;
  for (uint i = item; i < here; i += DPR_GROUP) {
    list_keys[from][i] = keys[i];
    order[from][i] = i;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint shift = 0; shift < 32 && (last_key - 1) >> shift != 0; shift += DPR_SORT_BITS(DPR_LANES)) {
    for (uint d = 0; d < DPR_SORT_DIGITS; ++d) counts[local_place(d * DPR_GROUP + item, of_counts)] = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = first; i < last; ++i)
      ++counts[local_place(sort_digit(list_keys[from][i], shift) * DPR_GROUP + item, of_counts)];
    barrier(CLK_LOCAL_MEM_FENCE);
    group_scan_chunk(counts, of_counts, group_sums);
    for (uint i = first; i < last; ++i) {
      const uint key = list_keys[from][i];
      const uint target = counts[local_place(sort_digit(key, shift) * DPR_GROUP + item, of_counts)]++;
      list_keys[1 - from][target] = key;
      order[1 - from][target] = order[from][i];
    }
    from = 1 - from;
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  for (uint i = item; i < here; i += DPR_GROUP) {
    sorted_keys[i] = list_keys[from][i];
    sorted_values[i] = values[order[from][i]];
  }
  for (uint key = item; key <= last_key; key += DPR_GROUP) {
    uint low = 0, high = here;
    while (low < high) {
      const uint middle = (low + high) / 2;
      if (list_keys[from][middle] < key) {
        low = middle + 1;
      } else {
        high = middle;
      }
    }
    starts[key] = low;
  }
}

#else

/// As above. One work-item per block.
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

/// As above. One work-item per block.
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

/// As above, by counting. One work-item.
kernel void sort_few(const uint last_key, global const uint* restrict count, global const uint* restrict keys,
                     global const uint* restrict values, global uint* restrict sorted_keys,
                     global uint* restrict sorted_values, global uint* restrict starts) {
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

#endif

/// Finds the begin of each key's run in the sorted list, by bisection. One work-item per key, and one
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
