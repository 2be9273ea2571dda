// Exclusive prefix sums of counts, in chunks, level by level. Sums saturate, so that a total that does not
// fit is seen as the largest number instead of wrapping around.
#include "shared_types.h"

/// Sums of chunks. One work-item per chunk of DPR_SCAN_CHUNK elements.
/// in   values  uint[count]
/// out  sums    uint[chunk]
kernel void scan_sum(const uint count, global const uint* restrict values, global uint* restrict sums) {
  const uint chunk = (uint)get_global_id(0);
  const uint first = chunk * DPR_SCAN_CHUNK;
  if (first >= count) return;
  const uint last = min(count, first + DPR_SCAN_CHUNK);
  uint sum = 0;
  for (uint i = first; i < last; ++i) sum = add_sat(sum, values[i]);
  sums[chunk] = sum;
}

/// The scan itself, given the scan of the chunks' sums. One work-item per chunk; one where there is nothing
/// to scan.
/// in   size     elements of a chunk: DPR_SCAN_CHUNK, or of the only one all
/// in   values   uint[count]
/// in   bases    uint[chunk]      exclusive scan of the chunks' sums
/// out  offsets  uint[count + 1]  exclusive scan; the last is the total
kernel void scan_apply(const uint count, const uint size, global const uint* restrict values,
                       global const uint* restrict bases, global uint* restrict offsets) {
  const uint chunk = (uint)get_global_id(0);
  const uint first = chunk * size;
  if (first >= count && chunk != 0) return;
  const uint last = min(count, first + size);
  uint sum = bases[chunk];
  for (uint i = first; i < last; ++i) {
    offsets[i] = sum;
    sum = add_sat(sum, values[i]);
  }
  if (last == count) offsets[count] = sum;
}
