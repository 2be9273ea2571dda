// Work-groups that share what a work-item of a CPU does in order. A kernel of such groups has the attribute
// DPR_GROUP_KERNEL, and is launched by Kernel::in_groups().
#ifndef DPR_GROUP_H
#define DPR_GROUP_H

#include "shared_types.h"

#ifndef DPR_LANES
#define DPR_LANES 8
#endif

#define DPR_GROUP_KERNEL __attribute__((reqd_work_group_size(DPR_GROUP, 1, 1)))

/// Attribute of a kernel that runs in such groups on GPUs alone. It has one work-item per element, and the
/// work-items of a group help each other; or one work-item on a CPU does what a group does on a GPU
/// (Kernel::in_groups()).
#if DPR_LANES == 1
#define DPR_SHARING_KERNEL DPR_GROUP_KERNEL
#else
#define DPR_SHARING_KERNEL
#endif

/// Elements of a chunk that a work-item of a group has, one after the other.
#define DPR_EACH(chunk) ((chunk) / DPR_GROUP)

/// The place of element i of a chunk in local memory: work-items that read a run each do not meet in a bank.
static inline uint local_place(uint i, uint each) { return i + i / each; }
#define DPR_LOCAL_PLACES(chunk) ((chunk) + DPR_GROUP)

/// The sum of the values of the work-items before this one; sums[DPR_GROUP - 1] becomes the sum of all. Sums
/// saturate. To be called by all of the group, whose next use of `sums` a barrier has to precede.
static inline uint group_scan(uint value, local uint* sums) {
  const uint item = (uint)get_local_id(0);
  sums[item] = value;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint step = 1; step < DPR_GROUP; step *= 2) {
    const uint before = item >= step ? sums[item - step] : 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    sums[item] = add_sat(sums[item], before);
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  return item > 0 ? sums[item - 1] : 0;
}

/// The same over a chunk of `each` values a work-item in local memory, at their local_place(), in place.
static inline void group_scan_chunk(local uint* values, uint each, local uint* sums) {
  const uint first = (uint)get_local_id(0) * each;
  uint sum = 0;
  for (uint i = 0; i < each; ++i) sum = add_sat(sum, values[local_place(first + i, each)]);
  sum = group_scan(sum, sums);
  for (uint i = 0; i < each; ++i) {
    const uint place = local_place(first + i, each), value = values[place];
    values[place] = sum;
    sum = add_sat(sum, value);
  }
  barrier(CLK_LOCAL_MEM_FENCE);
}

/// Collects the `element`s of the work-items for which `is_in` holds, in order, for all of the group; returns
/// how many. To be called by all of the group, whose next use of `sums` and `elements` a barrier has to
/// precede.
static inline uint group_collect(int is_in, uint element, local uint* elements, local uint* sums) {
  const uint place = group_scan(is_in ? 1 : 0, sums);
  if (is_in) elements[place] = element;
  const uint count = sums[DPR_GROUP - 1];
  barrier(CLK_LOCAL_MEM_FENCE);
  return count;
}

#endif
