// What the samples of a rigid image show, for shading outside of the library, and the gradients that come back.
#include "nearest.h"

/// One work-item per sample, up to `last_pixel`. Deterministic.
/// in   starts         uint[pixel + 1]         runs of `list`
/// in   list           uint[...]               fragments, by sample
/// in   fragments      float[plane][fragment]  DEPTH, BARY
/// in   fragment_pair  uint[fragment],  pair_face  uint[pair]
/// out  places         float4[pixel]  barycentrics of corners 1 and 2, view depth; 0 where nothing is
/// out  face           uint[pixel]    of the scene, DPR_NO_FACE where nothing is
kernel void samples_forward(const FrameParams p, const uint last_pixel, global const uint* restrict starts,
                            global const uint* restrict list, global const float* restrict fragments,
                            global const uint* restrict fragment_pair, global const uint* restrict pair_face,
                            global float4* restrict places, global uint* restrict face) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= last_pixel) return;
  global const float *const depth = fragments + DPR_PLANE(p, DEPTH), *const bary =
                                                                         fragments + DPR_PLANE(p, BARY);
  const uint k = nearest_fragment(pixel, starts, list, depth);
  const int is_seen = k != DPR_NO_FACE;
  places[pixel] = is_seen ? (float4)(bary[k], bary[p.fragments + k], depth[k], 0.0f) : (float4)(0.0f);
  face[pixel] = is_seen ? pair_face[fragment_pair[k]] % p.faces : DPR_NO_FACE;
}

/// One work-item per sample, up to `last_pixel`; every fragment belongs to one. Deterministic. Inputs as
/// samples_forward, and
/// in   grad_places  float4[pixel]
/// out  grads        float[plane][fragment]  of DEPTH, BARY
kernel void samples_backward(const FrameParams p, const uint last_pixel, global const uint* restrict starts,
                             global const uint* restrict list, global const float* restrict fragments,
                             global const float4* restrict grad_places, global float* restrict grads) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= last_pixel) return;
  global float *const depth = grads + DPR_GRAD_PLANE(p, DEPTH), *const bary = grads + DPR_GRAD_PLANE(p, BARY);
  const uint nearest = nearest_fragment(pixel, starts, list, fragments + DPR_PLANE(p, DEPTH));
  for (uint i = starts[pixel]; i < starts[pixel + 1]; ++i) {
    const uint k = list[i];
    const float4 grad = k == nearest ? grad_places[pixel] : (float4)(0.0f);
    bary[k] = grad.x;
    bary[p.grad_fragments + k] = grad.y;
    depth[k] = grad.z;
  }
}
