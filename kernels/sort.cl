// A stable radix sort of (key, value) by some bits a pass: pairs leave it ordered by tile and, within a tile,
// still by face. Nothing depends on the order in which work-items run. The number of elements, `count`, is on
// the device; the host launches for the capacity of the buffers, and blocks without elements cost next to
// nothing. A block is a work-item's on CPUs, and a work-group's on GPUs, which sorts it in local memory by
// four bits at a time. Few elements are sorted by one work-item or one group instead, to the same order.
#include "group.h"

#ifndef DPR_LANES
#define DPR_LANES 8
#endif

static inline uint sort_digit(uint key, uint shift, uint bits) { return (key >> shift) & ((1u << bits) - 1); }

/// Columns of the histogram: blocks that have elements, and one where there are none.
static inline uint sort_blocks(uint count) {
  return max(count / DPR_SORT_BLOCK + (count % DPR_SORT_BLOCK != 0), 1u);
}

#if DPR_LANES == 1

/// Bits by which a group sorts at a time: a work-item has a count for each of their values.
#define DPR_SORT_GROUP_BITS 4
#define DPR_SORT_GROUP_DIGITS (1u << DPR_SORT_GROUP_BITS)

/// Elements of a block that are there.
static inline uint elements_of(uint block, uint count) {
  const uint first = block * DPR_SORT_BLOCK;
  return count > first ? min(count - first, (uint)DPR_SORT_BLOCK) : 0;
}

/// What a group sorts a block by: two lists of keys and of where they were, one behind the other; counts.
typedef struct {
  local uint *keys, *order;
  local uint *counts, *sums;
} GroupSort;

/// Declares a group's local memory. To be used in a kernel.
#define DPR_GROUP_SORT(name)                                                     \
  local uint name##_keys[2 * DPR_SORT_BLOCK], name##_order[2 * DPR_SORT_BLOCK];  \
  local uint name##_counts[DPR_LOCAL_PLACES(DPR_SORT_GROUP_DIGITS * DPR_GROUP)]; \
  local uint name##_sums[DPR_GROUP];                                             \
  const GroupSort name = {name##_keys, name##_order, name##_counts, name##_sums}

/// Sorts the first `here` keys of the first list by their bits from `shift` to `end`, with their places in the
/// block. Returns where the list with the result begins. To be called by all of the group, after the keys
/// are there.
static inline uint sort_group(const GroupSort s, uint here, uint shift, uint end) {
  const uint each = DPR_EACH(DPR_SORT_BLOCK), digits = DPR_SORT_GROUP_DIGITS;
  const uint item = (uint)get_local_id(0), first = item * each, last = min(here, first + each);
  uint from = 0;
  for (uint i = item; i < here; i += DPR_GROUP) s.order[i] = i;
  for (; shift < end; shift += DPR_SORT_GROUP_BITS) {
    const uint bits = min(end - shift, (uint)DPR_SORT_GROUP_BITS);
    for (uint d = 0; d < digits; ++d) s.counts[local_place(d * DPR_GROUP + item, digits)] = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = first; i < last; ++i)
      ++s.counts[local_place(sort_digit(s.keys[from + i], shift, bits) * DPR_GROUP + item, digits)];
    barrier(CLK_LOCAL_MEM_FENCE);
    group_scan_chunk(s.counts, digits, s.sums);
    for (uint i = first; i < last; ++i) {
      const uint key = s.keys[from + i];
      const uint target = s.counts[local_place(sort_digit(key, shift, bits) * DPR_GROUP + item, digits)]++;
      s.keys[DPR_SORT_BLOCK - from + target] = key;
      s.order[DPR_SORT_BLOCK - from + target] = s.order[from + i];
    }
    from = DPR_SORT_BLOCK - from;
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  return from;
}

/// Counts the digits of every block. One work-group per block of the capacity.
/// in   shift, bits  of the pass' digit: the lowest of its bits, and how many
/// in   count      uint[1]                the number of elements
/// in   keys       uint[count]
/// out  histogram  uint[1 << bits][block]  of blocks that have elements, at least one
/// out  size       uint[1]                its elements
DPR_GROUP_KERNEL kernel void sort_histogram(const uint shift, const uint bits,
                                            global const uint* restrict count,
                                            global const uint* restrict keys, global uint* restrict histogram,
                                            global uint* restrict size) {
  local uint counts[1u << DPR_SORT_BITS];
  const uint block = (uint)get_group_id(0), item = (uint)get_local_id(0), here = elements_of(block, count[0]);
  const uint digits = 1u << bits, blocks = sort_blocks(count[0]);
  for (uint d = item; d < digits; d += DPR_GROUP) counts[d] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint i = item; i < here; i += DPR_GROUP)
    atomic_inc(&counts[sort_digit(keys[block * DPR_SORT_BLOCK + i], shift, bits)]);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (block >= blocks) return;
  for (uint d = item; d < digits; d += DPR_GROUP) histogram[d * blocks + block] = counts[d];
  if (block == 0 && item == 0) size[0] = digits * blocks;
}

/// Moves every element to its place. One work-group per block: it sorts the block in local memory, so that
/// neighbours are written by neighbours. Inputs as sort_histogram, and
/// in   values   uint[count]              move with their keys; the elements' numbers in the first pass
/// in   offsets  uint[1 << bits][block]   exclusive scan of the histogram
/// out  sorted_keys, sorted_values  uint[count]
DPR_GROUP_KERNEL kernel void sort_scatter(const uint shift, const uint bits,
                                          global const uint* restrict count, global const uint* restrict keys,
                                          global const uint* restrict values,
                                          global const uint* restrict offsets,
                                          global uint* restrict sorted_keys,
                                          global uint* restrict sorted_values) {
  DPR_GROUP_SORT(sort);
  local uint firsts[1u << DPR_SORT_BITS];  // of a digit's elements in the block
  const uint block = (uint)get_group_id(0), item = (uint)get_local_id(0), here = elements_of(block, count[0]);
  const uint first = block * DPR_SORT_BLOCK, blocks = sort_blocks(count[0]);
  for (uint i = item; i < here; i += DPR_GROUP) sort.keys[i] = keys[first + i];
  barrier(CLK_LOCAL_MEM_FENCE);
  const uint list = sort_group(sort, here, shift, shift + bits);
  for (uint i = item; i < here; i += DPR_GROUP) {
    const uint digit = sort_digit(sort.keys[list + i], shift, bits);
    if (i == 0 || sort_digit(sort.keys[list + i - 1], shift, bits) != digit) firsts[digit] = i;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint i = item; i < here; i += DPR_GROUP) {
    const uint key = sort.keys[list + i], digit = sort_digit(key, shift, bits);
    const uint target = offsets[digit * blocks + block] + i - firsts[digit];
    sorted_keys[target] = key;
    const uint from = first + sort.order[list + i];
    sorted_values[target] = shift == 0 ? from : values[from];
  }
}

/// Sorts few elements of few keys. One work-group, in local memory: one launch instead of three a pass.
/// in   last_key  the number of keys, from 0 on
/// in   count     uint[1]       the number of elements, at most DPR_SORT_BLOCK
/// in   keys      uint[count]
/// out  sorted_keys, sorted_values  uint[count]  the values are the elements' numbers
/// out  starts    uint[last_key + 1]  where each key's run begins in the sorted list
DPR_GROUP_KERNEL kernel void sort_few(const uint last_key, global const uint* restrict count,
                                      global const uint* restrict keys, global uint* restrict sorted_keys,
                                      global uint* restrict sorted_values, global uint* restrict starts) {
  DPR_GROUP_SORT(sort);
  const uint item = (uint)get_local_id(0), here = min(count[0], (uint)DPR_SORT_BLOCK);
  for (uint i = item; i < here; i += DPR_GROUP) sort.keys[i] = keys[i];
  barrier(CLK_LOCAL_MEM_FENCE);
  const uint list = sort_group(sort, here, 0, last_key > 1 ? 32 - clz(last_key - 1) : 0);
  for (uint i = item; i < here; i += DPR_GROUP) {
    sorted_keys[i] = sort.keys[list + i];
    sorted_values[i] = sort.order[list + i];
  }
  for (uint key = item; key <= last_key; key += DPR_GROUP) {
    uint low = 0, high = here;
    while (low < high) {
      const uint middle = (low + high) / 2;
      if (sort.keys[list + middle] < key) {
        low = middle + 1;
      } else {
        high = middle;
      }
    }
    starts[key] = low;
  }
}

#else

/// As above. One work-item per block of the capacity.
kernel void sort_histogram(const uint shift, const uint bits, global const uint* restrict count,
                           global const uint* restrict keys, global uint* restrict histogram,
                           global uint* restrict size) {
  const uint block = (uint)get_global_id(0), elements = count[0];
  const uint digits = 1u << bits, blocks = sort_blocks(elements);
  if (block >= blocks) return;
  uint counts[1u << DPR_SORT_BITS];
  for (uint d = 0; d < digits; ++d) counts[d] = 0;
  const uint last = min(elements, (block + 1) * DPR_SORT_BLOCK);
  for (uint i = block * DPR_SORT_BLOCK; i < last; ++i) ++counts[sort_digit(keys[i], shift, bits)];
  for (uint d = 0; d < digits; ++d) histogram[d * blocks + block] = counts[d];
  if (block == 0) size[0] = digits * blocks;
}

/// As above. One work-item per block of the capacity.
kernel void sort_scatter(const uint shift, const uint bits, global const uint* restrict count,
                         global const uint* restrict keys, global const uint* restrict values,
                         global const uint* restrict offsets, global uint* restrict sorted_keys,
                         global uint* restrict sorted_values) {
  const uint block = (uint)get_global_id(0), elements = count[0];
  const uint digits = 1u << bits, blocks = sort_blocks(elements);
  if (block >= blocks) return;
  uint next[1u << DPR_SORT_BITS];
  for (uint d = 0; d < digits; ++d) next[d] = offsets[d * blocks + block];
  const uint last = min(elements, (block + 1) * DPR_SORT_BLOCK);
  for (uint i = block * DPR_SORT_BLOCK; i < last; ++i) {
    const uint target = next[sort_digit(keys[i], shift, bits)]++;
    sorted_keys[target] = keys[i];
    sorted_values[target] = shift == 0 ? i : values[i];
  }
}

/// As above, by counting. One work-item.
kernel void sort_few(const uint last_key, global const uint* restrict count, global const uint* restrict keys,
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
    sorted_values[target] = i;
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
