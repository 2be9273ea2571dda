// What the samples of a rigid image show, for shading outside of the library, and the gradients that come back.
#include "nearest.h"
#include "texture.h"

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

/// How fast barycentrics change from sample to sample. One work-item per sample. Deterministic.
/// in   count   [layer][pixel]
/// in   places  float4[layer][pixel],  face  uint[layer][pixel]  as samples_forward leaves them
/// in   triangles, clipped  [view][face]
/// out  steps   float4[layer][pixel]  of corner 1 to the right and down, then of corner 2; 0 where nothing is
kernel void samples_steps(const FrameParams p, const uint count, global const float4* restrict places,
                          global const uint* restrict face, global const Triangle* restrict triangles,
                          global const ClippedFace* restrict clipped, global float4* restrict steps) {
  const size_t sample = get_global_id(0);
  if (sample >= count) return;
  if (face[sample] == DPR_NO_FACE) {
    steps[sample] = 0.0f;
    return;
  }
  const size_t view = (sample % samples_of_frame(p)) / (p.width * p.height),
               of_view = view * p.faces + face[sample];
  const Steps s = p.clips && clipped[of_view].corners != 0 ? clipped_steps(clipped[of_view])
                                                           : triangle_steps(p, triangles[of_view]);
  const float c1 = places[sample].x, c2 = places[sample].y;
  const float scale = p.pixel_size * ((1.0f - c1 - c2) * s.depth.x + c1 * s.depth.y + c2 * s.depth.z);
  const float all_x = s.q_x.x + s.q_x.y + s.q_x.z, all_y = s.q_y.x + s.q_y.y + s.q_y.z;
  steps[sample] = scale * (float4)(s.q_x.y - c1 * all_x, c1 * all_y - s.q_y.y, s.q_x.z - c2 * all_x,
                                   c2 * all_y - s.q_y.z);
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
