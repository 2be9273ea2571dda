// Lanes no wider than a row of a tile, to which the runs of fragments are padded.
#ifndef DPR_TILE_LANES_H
#define DPR_TILE_LANES_H

#ifdef DPR_LANES
#if DPR_LANES == 16
#define DPR_WIDTH 8
#endif
#endif
#include "lanes.h"

/// Where the fragments of a pair end, whose run begins at `first`: what follows is padding.
static inline uint end_of_fragments(uint first, uint2 mask) { return first + popcount(mask.x) + popcount(mask.y); }

/// Gradients of fragments from `i` on, zero from `last` on: what they hold of padding was never written.
static inline realn load_gradient(uint i, uint last, global const float* grad) {
  const intn is_fragment = DPR_LANE_INDEX < (intn)((int)(last - i));
  return choose(is_fragment, load_n(i, grad), (realn)(0.0f));
}

#endif
