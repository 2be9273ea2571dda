// What a sample of the rigid image shows: the nearest surface, and those behind it.
#ifndef DPR_NEAREST_H
#define DPR_NEAREST_H

#include "shared_types.h"

/// One of a sample's surfaces: its depth, and its fragment's place in `list`.
typedef struct {
  float depth;
  uint place;
} DepthLayer;

/// What lies before the nearest surface: next_behind() of it is that.
static inline DepthLayer before_surfaces(void) {
  const DepthLayer none = {-INFINITY, 0};
  return none;
}

/// The nearest of a sample's surfaces that lie behind one of them; of several at one depth, which `list` has first.
/// Where there is none, its depth is INFINITY, and its place the end of the sample's run.
static inline DepthLayer next_behind(DepthLayer from, uint pixel, global const uint* starts,
                                     global const uint* list, global const float* depth) {
  DepthLayer next = {INFINITY, starts[pixel + 1]};
  for (uint i = starts[pixel]; i < starts[pixel + 1]; ++i) {
    const float at = depth[list[i]];
    if (!(at < next.depth) || at < from.depth || (at == from.depth && i <= from.place)) continue;
    next.depth = at;
    next.place = i;
  }
  return next;
}

static inline int is_surface(DepthLayer layer) { return layer.depth < INFINITY; }

#endif
