// Faces that cross the near plane or the far one, and gradients by way of the cuts that they get there. A cut divides
// the way between two corners in homogeneous coordinates, NDC times depth, where that way is straight: part =
// (z_kept - z) / (z_kept - z_lost), z being the plane's depth. Orthographic, NDC are such coordinates themselves. A
// lens distorts what is left: the cuts, not the way to what is behind the camera.
#ifndef DPR_CLIP_H
#define DPR_CLIP_H

#include "lens.h"
#include "shared_types.h"

/// A corner of a list of faces, read where it lies: an index that varies would put the face into memory. 3,
/// that of no corner, names the last.
static inline uint corner_in(global const uint4* face, uint corner) {
  return ((global const uint*)face)[min(corner, 2u)];
}

/// The corner of the face that a cut lies between, on the side that is kept, and on the other.
static inline uint kept_corner(const ClippedFace c, uint cut) {
  return (c.first + (c.corners == 4 && cut == 0 ? 1 : 0)) % 3;
}
static inline uint lost_corner(const ClippedFace c, uint cut) {
  return (c.first + (c.corners == 4 ? 2 : 1 + cut)) % 3;
}

/// Corner that a clipped face loses.
static inline int is_lost(const ClippedFace c, uint corner) {
  const uint place = (corner + 3 - c.first) % 3;
  return c.corners == 4 ? place == 2 : place > 0;
}

/// The cut between two corners of a face; 2 where there is none.
static inline uint cut_between(const ClippedFace c, uint kept, uint lost) {
  for (uint cut = 0; cut < 2; ++cut) {
    if (kept_corner(c, cut) == kept && lost_corner(c, cut) == lost) return cut;
  }
  return 2;
}

/// A corner or a cut by its number. Compared, because an index that varies would put the face into memory.
static inline float4 clipped_corner(const ClippedFace c, uint k) {
  return k == 0 ? c.corner[0] : k == 1 ? c.corner[1] : c.corner[2];
}
static inline float4 clipped_cut(const ClippedFace c, uint cut) { return cut == 0 ? c.cut[0] : c.cut[1]; }

/// By what homogeneous coordinates on the plane are divided.
static inline float cut_divisor(const FrameParams p, float plane) { return p.orthographic ? 1.0f : plane; }

/// A cut's NDC, but for the lens.
static inline float2 cut_ndc(const FrameParams p, float3 kept, float3 lost, float part, float plane) {
#pragma OPENCL FP_CONTRACT OFF
  return (kept.xy + part * (lost.xy - kept.xy)) / cut_divisor(p, plane);
}

/// Passes a cut's gradient, of x and y in NDC and of the part, to those of its corners' homogeneous
/// coordinates: 1 - part of it to that which is kept, part of it to the other. For the depths,
/// d part / d z_kept = (1 - part) / (z_kept - z_lost) and d part / d z_lost = part / (z_kept - z_lost).
static inline float3 cut_gradient(const FrameParams p, global const ViewParams* view, const ClippedFace c,
                                  uint cut, float2 grad, float grad_part) {
  const float3 kept = clipped_corner(c, kept_corner(c, cut)).xyz;
  const float3 lost = clipped_corner(c, lost_corner(c, cut)).xyz;
  const float plane = clipped_cut(c, cut).z, part = clipped_cut(c, cut).w;
  if (view->distorts) grad = bend_ndc_backward(view, cut_ndc(p, kept, lost, part, plane), grad);
  const float2 g = grad / cut_divisor(p, plane);
  return (float3)(g, (grad_part + dot(g, lost.xy - kept.xy)) / (kept.z - lost.z));
}

/// Gradients of the projection, scale and offset, and of the lens' coefficients.
typedef struct {
  float4 projection;
  float8 lens;
} CutChannels;

/// Adds what a cut's gradient, of x and y in NDC, gives to projection and lens beyond what it gives by way of
/// the homogeneous coordinates, which cut_gradient() has. Seen at b(t) scale + offset, with b the lens and
/// t = (n - offset) / scale of the cut's NDC n but for the lens: the derivatives where n stays.
static inline void add_cut_channels(const FrameParams p, global const ViewParams* view, const ClippedFace c,
                                    uint cut, float2 grad, CutChannels* sum) {
  const float3 kept = clipped_corner(c, kept_corner(c, cut)).xyz;
  const float3 lost = clipped_corner(c, lost_corner(c, cut)).xyz;
  const float4 at = clipped_cut(c, cut);
  const float2 scale = view->projection.xy, offset = view->projection.zw;
  const float2 tangent = (cut_ndc(p, kept, lost, at.w, at.z) - offset) / scale;
  const float2 by_corners = bend_tangent_backward(view, tangent, grad * scale) / scale;
  sum->projection += (float4)((at.xy - offset) / scale * grad - tangent * by_corners, grad - by_corners);
  sum->lens += coefficients_gradient(view, tangent, grad * scale);
}

/// The tangent of a cut: x, y (NDC), and of its part. `kept` and `lost` are those of its corners' homogeneous
/// coordinates.
static inline float3 cut_tangent(const FrameParams p, global const ViewParams* view, const ClippedFace c,
                                 uint cut, float3 kept, float3 lost, global const ViewTangent* by) {
  const float3 from = clipped_corner(c, kept_corner(c, cut)).xyz;
  const float3 to = clipped_corner(c, lost_corner(c, cut)).xyz;
  const float4 at = clipped_cut(c, cut);
  const float part = at.w, moved_part = ((1.0f - part) * kept.z + part * lost.z) / (from.z - to.z);
  float2 moved =
      ((1.0f - part) * kept.xy + part * lost.xy + moved_part * (to.xy - from.xy)) / cut_divisor(p, at.z);
  if (view->distorts) {
    const float2 ndc = cut_ndc(p, from, to, part, at.z);
    float seen[2];
#pragma unroll
    for (int axis = 0; axis < 2; ++axis) {
      const float2 unit = axis == 0 ? (float2)(1.0f, 0.0f) : (float2)(0.0f, 1.0f);
      CutChannels row = {0.0f, 0.0f};
      add_cut_channels(p, view, c, cut, unit, &row);
      seen[axis] = dot(bend_ndc_backward(view, ndc, unit), moved) + dot(row.projection, by->projection) +
                   dot(row.lens.lo, by->lens[0]) + dot(row.lens.hi, by->lens[1]);
    }
    moved = (float2)(seen[0], seen[1]);
  }
  return (float3)(moved.x, moved.y, moved_part);
}

/// Stores them as float[DPR_CUT_CHANNELS][count].
static inline void store_cut_channels(const CutChannels sum, size_t count, size_t i, global float* channels) {
#pragma unroll
  for (uint k = 0; k < 4; ++k) channels[k * count + i] = ((const float*)&sum.projection)[k];
#pragma unroll
  for (uint k = 0; k < DPR_CUT_CHANNELS - 4; ++k)
    channels[(4 + k) * count + i] = ((const float*)&sum.lens)[k];
}

#endif
