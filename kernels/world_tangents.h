// Tangents in world space: of a direction those of positions and normals, as the stages' own lie, then the eyes'.
#ifndef DPR_WORLD_TANGENTS_H
#define DPR_WORLD_TANGENTS_H

#include "shared_types.h"

/// Where a direction's eyes are, behind its positions and normals.
static inline uint eyes_at(const FrameParams p) { return p.views * (p.vertices + p.normals); }

/// Where a direction's begin.
static inline size_t world_tangents_at(const FrameParams p, uint direction) {
  return (size_t)direction * p.views * (p.vertices + p.normals + 1);
}

#endif
