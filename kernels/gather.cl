// Gradients of the corners of pairs, gathered at what the corners refer to: each target adds its corners in
// order, each corner its pairs. No atomics, so the sum is the same from run to run.
#include "shared_types.h"

/// One work-item per (view, target) of `targets`, or per target where the views are summed.
/// in   pair_starts    uint[view * face + 1]  runs of `face_pairs`
/// in   face_pairs     uint[...]              pairs of a face of a view, or DPR_NO_PAIR
/// in   corner_starts  uint[target + 1]
/// in   corners        uint[corner]           face * 3 + corner, by target
/// in   partial        float[pair][9]         gradients of the three corners
/// in   sum_views      0: out is per view; else the views are added up
/// out  grad           float4[view][target] or float4[target]; w = 0
kernel void gather_corners(const FrameParams p, const uint targets, const uint sum_views,
                           global const uint* restrict pair_starts, global const uint* restrict face_pairs,
                           global const uint* restrict corner_starts, global const uint* restrict corners,
                           global const float* restrict partial, global float4* restrict grad) {
  const uint i = (uint)get_global_id(0);
  if (i >= (sum_views ? targets : p.views * targets)) return;
  const uint target = i % targets;
  const uint first_view = sum_views ? 0 : i / targets, last_view = sum_views ? p.views : first_view + 1;
  float3 sum = (float3)(0.0f);
  for (uint view = first_view; view < last_view; ++view) {
    for (uint k = corner_starts[target]; k < corner_starts[target + 1]; ++k) {
      const uint face = view * p.faces + corners[k] / 3, corner = corners[k] % 3;
      for (uint place = pair_starts[face]; place < pair_starts[face + 1]; ++place) {
        const uint pair = face_pairs[place];
        if (pair != DPR_NO_PAIR) sum += vload3(0, partial + 9 * pair + 3 * corner);
      }
    }
  }
  grad[i] = (float4)(sum, 0.0f);
}

/// The same of faces, in an order that brings together those of one material; the views are added up. One
/// work-item per place of `faces`.
/// in   pair_starts, face_pairs  as gather_corners
/// in   ordered   uint[face]
/// in   partial   float[pair][DPR_MATERIAL_CHANNELS]
/// out  channels  float[DPR_MATERIAL_CHANNELS][face]  in that order
kernel void gather_faces(const FrameParams p, global const uint* restrict pair_starts,
                         global const uint* restrict face_pairs, global const uint* restrict ordered,
                         global const float* restrict partial, global float* restrict channels) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.faces) return;
  float4 sum = (float4)(0.0f);
  for (uint view = 0; view < p.views; ++view) {
    const uint face = view * p.faces + ordered[i];
    for (uint place = pair_starts[face]; place < pair_starts[face + 1]; ++place) {
      const uint pair = face_pairs[place];
      if (pair != DPR_NO_PAIR) sum += vload4(pair, partial);
    }
  }
  channels[i] = sum.x;
  channels[p.faces + i] = sum.y;
  channels[2 * p.faces + i] = sum.z;
  channels[3 * p.faces + i] = sum.w;
}
