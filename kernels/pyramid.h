// A texture and ever smaller versions of it. A level has half the texels of the one before on a side, rounded
// down; its texels are means over the area that they cover of it.
#ifndef DPR_PYRAMID_H
#define DPR_PYRAMID_H

#include "shared_types.h"

typedef struct {
  uint first, width, height;  // number of the first texel
} Level;

static inline Level next_level(Level l) {
  l.first += l.width * l.height;
  l.width = max(l.width / 2, 1u);
  l.height = max(l.height / 2, 1u);
  return l;
}

static inline Level find_level(const Texture t, uint level) {
  Level l;
  l.first = t.first;
  l.width = t.width;
  l.height = t.height;
  for (uint k = 0; k < level; ++k) l = next_level(l);
  return l;
}

/// The level of a pyramid's texel `i`, counted through all levels; `i` becomes its number in the level.
static inline Level level_of(const Texture t, uint* i) {
  Level l = find_level(t, 0);
  while (*i >= l.width * l.height) {
    *i -= l.width * l.height;
    l = next_level(l);
  }
  return l;
}

/// The part of texel `small` of `count` that texel `large` of `large_count` covers, along one axis.
static inline float covered_part(uint small, uint count, uint large, uint large_count) {
  // In units of 1 / (count * large_count) of the side, which are whole.
  const uint begin = max(small * large_count, large * count),
             end = min((small + 1) * large_count, (large + 1) * count);
  return end > begin ? (float)(end - begin) / (float)large_count : 0.0f;
}

#endif
