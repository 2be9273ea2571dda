// The bounds of what is set up on the raster: of triangles, and of clipped faces.
#ifndef DPR_SETUP_H
#define DPR_SETUP_H

#include "tiles.h"

/// Corners further away than this, NDC, have squared distances that single precision does not hold.
#define DPR_MAX_NDC 1e18f

/// Facing of a face with that orientation.
static inline uint facing_of(int orientation) {
  return orientation > 0 ? DPR_FACE_FRONT : orientation < 0 ? DPR_FACE_BACK : DPR_FACE_DROPPED;
}

/// Blurred bounds in pixels, of what lies between two corners of NDC.
typedef struct {
  float left, top, right, bottom;
} PixelBounds;

static inline PixelBounds bounds_of(const FrameParams p, float2 lowest, float2 highest) {
  const float2 low = lowest - p.blur_distance, high = highest + p.blur_distance;
  const float scale = 1.0f / p.pixel_size;
  // A centre lies half a pixel from its corner.
  const float x = 0.5f * (float)p.width - 0.5f, y = 0.5f * (float)p.height - 0.5f;
  const PixelBounds bounds = {low.x * scale + x, y - high.y * scale, high.x * scale + x, y - low.y * scale};
  return bounds;
}

/// True if [low, high], pixels, comes within a pixel of the image along one axis; along both. Written so that
/// a NaN does not.
static inline int meets_axis(float low, float high, uint size) { return high > -1.0f && low < (float)size; }
static inline int meets_image(const FrameParams p, const PixelBounds b) {
  return meets_axis(b.left, b.right, p.width) && meets_axis(b.top, b.bottom, p.height);
}

#endif
