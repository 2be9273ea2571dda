// Exclusive prefix sums of counts, in place, in chunks, level by level. Sums saturate, so that a total that
// does not fit is seen as the largest number instead of wrapping around. A chunk is a work-item's on CPUs, a
// work-group's on GPUs.
#include "group.h"

#if DPR_LANES == 1

/// Sums of chunks. One work-group per chunk of DPR_SCAN_CHUNK elements.
/// in   values  uint[count]
/// out  sums    uint[chunk]
DPR_GROUP_KERNEL kernel void scan_sum(const uint count, global const uint* restrict values,
                                      global uint* restrict sums) {
  local uint group_sums[DPR_GROUP];
  const uint chunk = (uint)get_group_id(0), item = (uint)get_local_id(0);
  const uint first = chunk * DPR_SCAN_CHUNK, last = min(count, first + DPR_SCAN_CHUNK);
  uint sum = 0;
  for (uint i = first + item; i < last; i += DPR_GROUP) sum = add_sat(sum, values[i]);
  group_scan(sum, group_sums);
  if (item == 0) sums[chunk] = group_sums[DPR_GROUP - 1];
}

/// The scan itself, given the scan of the chunks' sums. One work-group per chunk; one where there is nothing
/// to scan.
/// in      size    elements of a chunk, at most DPR_SCAN_CHUNK
/// in      bases   uint[chunk]      exclusive scan of the chunks' sums
/// in out  values  uint[count + 1]  counts, then their exclusive scan, whose last is the total
DPR_GROUP_KERNEL kernel void scan_apply(const uint count, const uint size, global const uint* restrict bases,
                                        global uint* restrict values) {
  const uint each = DPR_EACH(DPR_SCAN_CHUNK);
  local uint places[DPR_LOCAL_PLACES(DPR_SCAN_CHUNK)], group_sums[DPR_GROUP];
  const uint chunk = (uint)get_group_id(0), item = (uint)get_local_id(0);
  const uint first = chunk * size, here = min(count - first, size), base = bases[chunk];
  for (uint i = item; i < DPR_SCAN_CHUNK; i += DPR_GROUP)
    places[local_place(i, each)] = i < here ? values[first + i] : 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  group_scan_chunk(places, each, group_sums);
  for (uint i = item; i < here; i += DPR_GROUP)
    values[first + i] = add_sat(base, places[local_place(i, each)]);
  if (item == 0 && first + here == count) values[count] = add_sat(base, group_sums[DPR_GROUP - 1]);
}

#else

/// Exclusive prefix sums of eight counts, by doubling; `sum` is that of all before, and then of these too.
/// Lanes one by one: oclgrind 21.10 crashes where vectors of other lengths are joined.
static inline uint8 scan_eight(uint8 v, uint* sum) {
  v = add_sat(v, (uint8)(0, v.s0, v.s1, v.s2, v.s3, v.s4, v.s5, v.s6));
  v = add_sat(v, (uint8)(0, 0, v.s0, v.s1, v.s2, v.s3, v.s4, v.s5));
  v = add_sat(v, (uint8)(0, 0, 0, 0, v.s0, v.s1, v.s2, v.s3));
  const uint8 before = add_sat((uint8)(0, v.s0, v.s1, v.s2, v.s3, v.s4, v.s5, v.s6), (uint8)(*sum));
  *sum = add_sat(*sum, v.s7);
  return before;
}

/// As above. One work-item per chunk.
kernel void scan_sum(const uint count, global const uint* restrict values, global uint* restrict sums) {
  const uint chunk = (uint)get_global_id(0);
  const uint first = chunk * DPR_SCAN_CHUNK;
  if (first >= count) return;
  const uint last = min(count, first + DPR_SCAN_CHUNK);
  uint8 eight = 0;
  uint i = first;
  for (; last - i >= 8; i += 8) eight = add_sat(eight, vload8(0, values + i));
  uint sum = 0;
  scan_eight(eight, &sum);
  for (; i < last; ++i) sum = add_sat(sum, values[i]);
  sums[chunk] = sum;
}

/// As above, but the only chunk may have any size. One work-item per chunk.
kernel void scan_apply(const uint count, const uint size, global const uint* restrict bases,
                       global uint* restrict values) {
  const uint chunk = (uint)get_global_id(0);
  const uint first = chunk * size;
  if (first >= count && chunk != 0) return;
  const uint last = min(count, first + size);
  uint sum = bases[chunk];
  uint i = first;
  for (; last - i >= 8; i += 8) vstore8(scan_eight(vload8(0, values + i), &sum), 0, values + i);
  for (; i < last; ++i) {
    const uint value = values[i];
    values[i] = sum;
    sum = add_sat(sum, value);
  }
  if (last == count) values[count] = sum;
}

#endif
