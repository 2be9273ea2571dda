// What the samples of a rigid image show, for shading outside of the library, and the gradients that come back.
#include "nearest.h"

static inline size_t samples_of_frame(const FrameParams p) { return (size_t)p.views * p.width * p.height; }

/// One work-item per sample, up to `last_pixel`. Deterministic.
/// in   layers         how many of a sample's surfaces are told apart, from the nearest on
/// in   starts         uint[pixel + 1]         runs of `list`
/// in   list           uint[...]               fragments, by sample
/// in   fragments      float[plane][fragment]  DEPTH, BARY
/// in   fragment_pair  uint[fragment],  pair_face  uint[pair]
/// out  places         float4[layer][pixel]  barycentrics of corners 1 and 2, view depth; 0 where nothing is
/// out  face           uint[layer][pixel]    of the scene, DPR_NO_FACE where nothing is
kernel void samples_forward(const FrameParams p, const uint last_pixel, const uint layers,
                            global const uint* restrict starts, global const uint* restrict list,
                            global const float* restrict fragments, global const uint* restrict fragment_pair,
                            global const uint* restrict pair_face, global float4* restrict places,
                            global uint* restrict face) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= last_pixel) return;
  global const float *const depth = fragments + DPR_PLANE(p, DEPTH), *const bary =
                                                                         fragments + DPR_PLANE(p, BARY);
  DepthLayer surface = before_surfaces();
  for (uint layer = 0; layer < layers; ++layer) {
    surface = next_behind(surface, pixel, starts, list, depth);
    float4 place = 0.0f;
    uint seen = DPR_NO_FACE;
    if (is_surface(surface)) {
      const uint k = list[surface.place];
      place = (float4)(bary[k], bary[p.fragments + k], depth[k], 0.0f);
      seen = pair_face[fragment_pair[k]] % p.faces;
    }
    places[layer * samples_of_frame(p) + pixel] = place;
    face[layer * samples_of_frame(p) + pixel] = seen;
  }
}

/// One work-item per sample, up to `last_pixel`; every fragment belongs to one. Deterministic. Inputs as
/// samples_forward, and
/// in   grad_places  float4[layer][pixel]
/// out  grads        float[plane][fragment]  of DEPTH, BARY
kernel void samples_backward(const FrameParams p, const uint last_pixel, const uint layers,
                             global const uint* restrict starts, global const uint* restrict list,
                             global const float* restrict fragments,
                             global const float4* restrict grad_places, global float* restrict grads) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= last_pixel) return;
  global float *const depth = grads + DPR_GRAD_PLANE(p, DEPTH), *const bary = grads + DPR_GRAD_PLANE(p, BARY);
  for (uint i = starts[pixel]; i < starts[pixel + 1]; ++i) {
    const uint k = list[i];
    bary[k] = bary[p.grad_fragments + k] = depth[k] = 0.0f;
  }
  DepthLayer surface = before_surfaces();
  for (uint layer = 0; layer < layers; ++layer) {
    surface = next_behind(surface, pixel, starts, list, fragments + DPR_PLANE(p, DEPTH));
    if (!is_surface(surface)) return;
    const uint k = list[surface.place];
    const float4 grad = grad_places[layer * samples_of_frame(p) + pixel];
    bary[k] = grad.x;
    bary[p.grad_fragments + k] = grad.y;
    depth[k] = grad.z;
  }
}

/// Tangents of what the samples show. One work-item per sample, up to `last_pixel`. Deterministic. Inputs as
/// samples_forward, and
/// in   moved     float[direction][q.planes][fragment]  as rasterize_tangent leaves them
/// out  tangents  float4[direction][layer][pixel]       of barycentrics and view depth; 0 where nothing is
kernel void samples_tangent(const FrameParams p, const uint last_pixel, const uint layers,
                            const TangentParams q, global const uint* restrict starts,
                            global const uint* restrict list, global const float* restrict fragments,
                            global const float* restrict moved, global float4* restrict tangents) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= last_pixel) return;
  DepthLayer surface = before_surfaces();
  for (uint layer = 0; layer < layers; ++layer) {
    surface = next_behind(surface, pixel, starts, list, fragments + DPR_PLANE(p, DEPTH));
    for (uint d = 0; d < q.directions; ++d) {
      float4 tangent = 0.0f;
      if (is_surface(surface)) {
        global const float* const own = moved + (size_t)d * q.planes * p.grad_fragments + list[surface.place];
        global const float* const bary = own + DPR_GRAD_PLANE(p, BARY);
        tangent = (float4)(bary[0], bary[p.grad_fragments], own[DPR_GRAD_PLANE(p, DEPTH)], 0.0f);
      }
      tangents[((size_t)d * layers + layer) * samples_of_frame(p) + pixel] = tangent;
    }
  }
}
