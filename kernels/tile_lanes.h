// Lanes no wider than a row of a tile, for runs of fragments. A pair's run begins anywhere and has any
// length, so its last vector reaches into the next run. What writes fragments by pair handles pairs in
// groups, in order: each run is written over what the one before has left there, and only where the group
// ends are lanes stored apart.
#ifndef DPR_TILE_LANES_H
#define DPR_TILE_LANES_H

#ifdef DPR_LANES
#if DPR_LANES == 16
#define DPR_WIDTH 8
#endif
#endif
#include "lanes.h"
#include "shared_types.h"

/// The pairs [x, y) of a work-item, out of those in `range` that there are; none if x is not less. Where there
/// are more than the host has launched for, groups are larger, by at most one pair than others.
static inline uint2 pair_group(uint2 range, uint pairs) {
  const uint last = min(range.y, pairs), count = last > range.x ? last - range.x : 0;
  const uint item = (uint)get_global_id(0), size = DPR_WIDTH == 1 ? 1 : DPR_PAIR_GROUP;
  const uint items = (uint)get_global_size(0);
  if (count <= items * size) {
    const uint first = range.x + item * size;
    return (uint2)(first, min(first + size, last));
  }
  return range.x + (uint2)((uint)((ulong)count * item / items), (uint)((ulong)count * (item + 1) / items));
}

/// Lanes of the vector at `first` that lie before `last`.
static inline intn lanes_before(uint last, uint first) {
  return DPR_LANE_INDEX < (intn)((int)(last - first));
}

/// Elements of a run in those lanes, 0 in the others.
static inline realn load_run(intn in_run, uint first, global const float* values) {
  return choose(in_run, load_n(first, values), (realn)(0.0f));
}

/// The same of a buffer that the kernel writes: the next run, which another work-item may be writing, is not
/// read.
static inline realn load_own_run(uint last, uint first, global const float* values) {
#if DPR_WIDTH == 1
  (void)last;
  return values[first];
#else
  const uint count = last - first;
  if (count >= DPR_WIDTH) return load_n(first, values);
  float lanes[DPR_WIDTH] = {0.0f};
  for (uint lane = 0; lane < count; ++lane) lanes[lane] = values[first + lane];
  return vload8(0, lanes);
#endif
}

/// Stores the lanes before `last`.
static inline void store_run(realn v, uint first, uint last, global float* values) {
#if DPR_WIDTH == 1
  (void)last;
  values[first] = v;
#else
  const uint count = last - first;
  if (count >= DPR_WIDTH) {
    store_n(v, first, values);
    return;
  }
  values += first;
  float4 rest4 = v.lo;
  if (count & 4) {
    vstore4(rest4, 0, values);
    values += 4;
    rest4 = v.hi;
  }
  float2 rest2 = rest4.lo;
  if (count & 2) {
    vstore2(rest2, 0, values);
    values += 2;
    rest2 = rest4.hi;
  }
  if (count & 1) *values = rest2.x;
#endif
}
/// Each to a plane of its own, of which the first begins at `first_plane`.
static inline void store_run3(realn x, realn y, realn z, uint first, uint last, uint first_plane, uint plane,
                              global float* values) {
  first += first_plane;
  last += first_plane;
  store_run(x, first, last, values);
  store_run(y, first + plane, last + plane, values);
  store_run(z, first + 2 * plane, last + 2 * plane, values);
}
static inline void store_run_uint(uintn v, uint first, uint last, global uint* values) {
  store_run(as_realn(v), first, last, (global float*)values);
}

#endif
