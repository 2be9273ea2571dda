// What a sample of the rigid image shows.
#ifndef DPR_NEAREST_H
#define DPR_NEAREST_H

#include "shared_types.h"

/// The nearest of a sample's fragments, DPR_NO_FACE where there is none.
static inline uint nearest_fragment(uint pixel, global const uint* starts, global const uint* list,
                                    global const float* depth) {
  float nearest = INFINITY;
  uint fragment = DPR_NO_FACE;
  for (uint i = starts[pixel]; i < starts[pixel + 1]; ++i) {
    if (!(depth[list[i]] < nearest)) continue;
    fragment = list[i];
    nearest = depth[fragment];
  }
  return fragment;
}

#endif
