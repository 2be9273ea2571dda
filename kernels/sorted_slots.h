// Slots of a pixel in the joint composition, sorted by depth. A CPU counts on lanes how many come before each; a GPU's
// work-item counts by blocks in registers. Heaps sort long lists.
#ifndef DPR_SORTED_SLOTS_H
#define DPR_SORTED_SLOTS_H

#include "pixel.h"

/// Fragments that cover less than this of what the pixel's most covering one does are left out.
#define DPR_NEGLIGIBLE 1e-8f

/// Up to so many fragments are few.
#ifndef DPR_FEW_SLOTS
#define DPR_FEW_SLOTS 64
#endif

/// Fragments of a GPU's work-item that are in registers at once, to be sorted.
#define DPR_SORTED_SLOTS 8

/// By view depth, which a slot's beta holds until it is in a cluster; equal depths by fragment.
static inline int comes_before(const Slot a, const Slot b) {
  return a.beta < b.beta || (a.beta == b.beta && a.fragment < b.fragment);
}

static inline void sift_down(global Slot* slots, uint root, uint count) {
  const Slot moved = slots[root];
  for (uint child; (child = 2 * root + 1) < count; root = child) {
    if (child + 1 < count && comes_before(slots[child], slots[child + 1])) ++child;
    if (!comes_before(moved, slots[child])) break;
    slots[root] = slots[child];
  }
  slots[root] = moved;
}

#if DPR_LANES != 1

/// Each goes where as many come before it as there are: counted on lanes, without a branch to mispredict.
/// Slots come in the order of their fragments.
static inline void sort_few_slots(global Slot* slots, uint count) {
  Slot moved[DPR_FEW_SLOTS];
  float depths[DPR_FEW_SLOTS];
  int ranks[DPR_FEW_SLOTS];
  for (uint i = 0; i < count; ++i) {
    moved[i] = slots[i];
    depths[i] = moved[i].beta;
  }
  for (uint first = 0; first < count; first += DPR_WIDTH) {
    const realn depth = load_n(first, depths);
    const intn place = (int)first + DPR_LANE_INDEX;
    intn before = 0;
    for (uint k = 0; k < count; ++k) before -= depths[k] < depth || (depths[k] == depth && (int)k < place);
    store_n(before, first, ranks);
  }
  for (uint i = 0; i < count; ++i) slots[ranks[i]] = moved[i];
}

#endif

/// Heap sort for many.
static inline void sort_slots(global Slot* slots, uint count) {
#if DPR_LANES != 1
  if (count <= DPR_FEW_SLOTS) {
    sort_few_slots(slots, count);
    return;
  }
#endif
  for (uint root = count / 2; root-- > 0;) sift_down(slots, root, count);
  for (uint end = count; end > 1; --end) {
    swap_slots(slots, slots + end - 1);  // the furthest
    sift_down(slots, 0, end - 1);
  }
}

#if DPR_LANES == 1

/// Up to DPR_SORTED_SLOTS of a pixel's fragments, in registers: places in the arrays are known once loops are
/// unrolled. What covers no more than `least` has no rank.
typedef struct {
  float depth[DPR_SORTED_SLOTS], occupancy[DPR_SORTED_SLOTS];
  uint fragment[DPR_SORTED_SLOTS], rank[DPR_SORTED_SLOTS];
} Block;

/// Those from place `start` of the list on.
static inline void load_block(const Fragments f, uint start, uint last, Block* b) {
#pragma unroll
  for (uint i = 0; i < DPR_SORTED_SLOTS; ++i) {
    const uint k = f.list[min(start + i, last - 1)];
    b->fragment[i] = k;
    b->depth[i] = f.depth[k];
    b->occupancy[i] = start + i < last ? f.occupancy[k] : 0.0f;
    b->rank[i] = 0;
  }
}

static inline float largest_of(const Block* b) {
  float largest = 0.0f;
#pragma unroll
  for (uint i = 0; i < DPR_SORTED_SLOTS; ++i) largest = max(largest, b->occupancy[i]);
  return largest;
}

/// Ranks of a block that is a whole list. Returns how many there are.
static inline uint rank_block(float least, Block* b) {
  uint count = 0;
#pragma unroll
  for (uint i = 0; i < DPR_SORTED_SLOTS; ++i) {
    count += b->occupancy[i] > least;
#pragma unroll
    for (uint k = i + 1; k < DPR_SORTED_SLOTS; ++k) {
      const int is_behind = b->depth[k] < b->depth[i];
      b->rank[i] += is_behind && b->occupancy[k] > least;
      b->rank[k] += !is_behind && b->occupancy[i] > least;
    }
  }
  return count;
}

/// Ranks in the whole list of the block from place `start` of it on. Returns how many there are.
static inline uint rank_in_list(const Fragments f, uint first, uint last, uint start, float least, Block* b) {
  uint count = 0;
  for (uint j = first; j < last; ++j) {
    const uint k = f.list[j];
    if (!(f.occupancy[k] > least)) continue;
    ++count;
    const float depth = f.depth[k];
#pragma unroll
    for (uint i = 0; i < DPR_SORTED_SLOTS; ++i)
      b->rank[i] += depth < b->depth[i] || (depth == b->depth[i] && j < start + i);
  }
  return count;
}

static inline void store_block(const Block* b, float least, global Slot* slots) {
#pragma unroll
  for (uint i = 0; i < DPR_SORTED_SLOTS; ++i) {
    const Slot s = {b->depth[i], b->occupancy[i], -1.0f, b->fragment[i]};
    if (s.occupancy > least) slots[b->rank[i]] = s;
  }
}

/// gather_slots() of few: each goes where as many come before it as there are, so that memory is written once a
/// slot. Equal depths are by the list's order, which is that of fragments.
static inline uint gather_few(const Fragments f, uint first, uint last, global Slot* slots) {
  Block b;
  if (last - first <= DPR_SORTED_SLOTS) {
    load_block(f, first, last, &b);
    const float least = DPR_NEGLIGIBLE * largest_of(&b);
    const uint count = rank_block(least, &b);
    store_block(&b, least, slots);
    return count;
  }
  float largest = 0.0f;
  for (uint i = first; i < last; ++i) largest = max(largest, f.occupancy[f.list[i]]);
  const float least = DPR_NEGLIGIBLE * largest;
  uint count = 0;
  for (uint start = first; start < last; start += DPR_SORTED_SLOTS) {
    load_block(f, start, last, &b);
    count = rank_in_list(f, first, last, start, least, &b);
    store_block(&b, least, slots);
  }
  return count;
}

#endif

/// The fragments that cover, as slots sorted by depth, with their view depths in place of the betas. Left out
/// are those that cover less than DPR_NEGLIGIBLE of what another does: an error of at most that, relative to
/// the pixel's coverage, so that the smallest difference to the background keeps its sign. Returns how many
/// are left.
static inline uint gather_slots(const Fragments f, uint first, uint last, global Slot* slots) {
#if DPR_LANES == 1
  if (last - first <= DPR_FEW_SLOTS) return gather_few(f, first, last, slots);
#endif
  float largest = 0.0f;
  for (uint i = first; i < last; ++i) largest = max(largest, f.occupancy[f.list[i]]);
  uint count = 0;
  for (uint i = first; i < last; ++i) {
    const uint k = f.list[i];
    const Slot s = {f.depth[k], f.occupancy[k], -1.0f, k};
    slots[count] = s;
    count += s.occupancy > DPR_NEGLIGIBLE * largest;
  }
  sort_slots(slots, count);
  return count;
}

#endif
