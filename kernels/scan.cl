// Exclusive prefix sums of counts, in place, in chunks, level by level. Sums saturate, so that a total that
// does not fit is seen as the largest number instead of wrapping around. A chunk is a work-item's on CPUs, a
// work-group's on GPUs. Of the counts that the host launches for, `present` are there; chunks behind them
// cost next to nothing.
#include "group.h"

#if DPR_LANES == 1

/// Sums of chunks. One work-group per chunk of DPR_SCAN_CHUNK elements.
/// in   present  uint[1]        how many of `count` there are
/// in   values   uint[present]
/// out  sums     uint[chunk]    0 behind them
DPR_GROUP_KERNEL kernel void scan_sum(const uint count, global const uint* restrict present,
                                      global const uint* restrict values, global uint* restrict sums) {
  local uint group_sums[DPR_GROUP];
  const uint chunk = (uint)get_group_id(0), item = (uint)get_local_id(0);
  const uint first = chunk * DPR_SCAN_CHUNK, last = min(min(count, present[0]), first + DPR_SCAN_CHUNK);
  uint sum = 0;
  for (uint i = first + item; i < last; i += DPR_GROUP) sum = add_sat(sum, values[i]);
  group_scan(sum, group_sums);
  if (item == 0) sums[chunk] = group_sums[DPR_GROUP - 1];
}

/// The scan itself, given the scan of the chunks' sums. One work-group per chunk; one where there is nothing
/// to scan.
/// in      size     elements of a chunk, at most DPR_SCAN_CHUNK
/// in      present  uint[1]           how many of `count` there are
/// in      bases    uint[chunk]       exclusive scan of the chunks' sums
/// in out  values   uint[count + 1]   counts, then their exclusive scan; [present] and [count] are the total
DPR_GROUP_KERNEL kernel void scan_apply(const uint count, const uint size,
                                        global const uint* restrict present,
                                        global const uint* restrict bases, global uint* restrict values) {
  const uint each = DPR_EACH(DPR_SCAN_CHUNK);
  local uint places[DPR_LOCAL_PLACES(DPR_SCAN_CHUNK)], group_sums[DPR_GROUP];
  const uint chunk = (uint)get_group_id(0), item = (uint)get_local_id(0);
  const uint there = min(count, present[0]), first = chunk * size, base = bases[chunk];
  const uint here = first < there ? min(there - first, size) : 0;
  for (uint i = item; i < DPR_SCAN_CHUNK; i += DPR_GROUP)
    places[local_place(i, each)] = i < here ? values[first + i] : 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  group_scan_chunk(places, each, group_sums);
  for (uint i = item; i < here; i += DPR_GROUP)
    values[first + i] = add_sat(base, places[local_place(i, each)]);
  if (item == 0 && first + here == there && (here > 0 || chunk == 0))
    values[there] = values[count] = add_sat(base, group_sums[DPR_GROUP - 1]);
}

#else

/// As above. One work-item per chunk.
kernel void scan_sum(const uint count, global const uint* restrict present,
                     global const uint* restrict values, global uint* restrict sums) {
  const uint chunk = (uint)get_global_id(0);
  const uint first = chunk * DPR_SCAN_CHUNK;
  if (first >= count) return;
  const uint last = max(first, min(min(count, present[0]), first + DPR_SCAN_CHUNK));
  uint8 eight = 0;
  uint i = first;
  for (; last - i >= 8; i += 8) eight = add_sat(eight, vload8(0, values + i));
  uint lanes[8], sum = 0;
  vstore8(eight, 0, lanes);
  for (uint lane = 0; lane < 8; ++lane) sum = add_sat(sum, lanes[lane]);
  for (; i < last; ++i) sum = add_sat(sum, values[i]);
  sums[chunk] = sum;
}

/// As above, but the only chunk may have any size. One work-item per chunk.
kernel void scan_apply(const uint count, const uint size, global const uint* restrict present,
                       global const uint* restrict bases, global uint* restrict values) {
  const uint chunk = (uint)get_global_id(0);
  const uint first = chunk * size, there = min(count, present[0]);
  if (first >= there && chunk != 0) return;
  const uint last = min(there, first + size);
  uint sum = bases[chunk];
  for (uint i = first; i < last; ++i) {
    const uint value = values[i];
    values[i] = sum;
    sum = add_sat(sum, value);
  }
  if (last == there) values[there] = values[count] = sum;
}

#endif
