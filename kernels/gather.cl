// Gradients of the corners of pairs, gathered at what the corners refer to: each target adds its corners in
// order, each corner its pairs. No atomics, so the sum is the same from run to run.
#include "runs.h"

/// Sums chunks of the pairs of faces that have many. One work-item per (slot, channel).
/// in   slots        DPR_RUN_SLOTS() of the pairs
/// in   channels     of a pair
/// in   faces        of all views
/// in   pairs        uint[1]         how many there are
/// in   place_face   uint[place]     view * faces + face
/// in   pair_starts, face_pairs      as gather_corners
/// in   partial      float[pair][channel]
/// out  chunks       float[slot][channel]  of those that are chunks
kernel void gather_chunks(const uint slots, const uint channels, const uint faces,
                          global const uint* restrict pairs, global const uint* restrict place_face,
                          global const uint* restrict pair_starts, global const uint* restrict face_pairs,
                          global const float* restrict partial, const ulong first,
                          global float* restrict chunks) {
  const uint i = (uint)get_global_id(0), channel = i % channels;
  if (i >= slots * channels) return;
  const uint2 chunk = chunk_of_slot(i / channels, pairs[0], place_face, faces, pair_starts);
  float sum = 0.0f;
  for (uint place = chunk.x; place < chunk.y; ++place) {
    const uint pair = face_pairs[place];
    if (pair != DPR_NO_PAIR) sum += partial[first + (size_t)pair * channels + channel];
  }
  if (chunk.x < chunk.y) chunks[i] = sum;
}

/// One work-item per (view, target) of `targets`, or per target where the views are summed.
/// in   pair_starts    uint[view * face + 1]  runs of `face_pairs`
/// in   face_pairs     uint[...]              pairs of a face of a view, or DPR_NO_PAIR
/// in   corner_starts  uint[target + 1]
/// in   corners        uint[corner]           face * 3 + corner, by target
/// in   partial        float[pair][9]         gradients of the three corners
/// in   chunks         float[slot][9]         as gather_chunks left them, of faces of many pairs
/// in   sum_views      0: out is per view; else the views are added up
/// out  grad           float4[view][target] or float4[target]; w = 0
kernel void gather_corners(const FrameParams p, const uint targets, const uint sum_views,
                           global const uint* restrict pair_starts, global const uint* restrict face_pairs,
                           global const uint* restrict corner_starts, global const uint* restrict corners,
                           global const float* restrict partial, const ulong first,
                           global const float* restrict chunks, global float4* restrict grad) {
  const uint i = (uint)get_global_id(0);
  if (i >= (sum_views ? targets : p.views * targets)) return;
  const uint target = i % targets;
  const uint first_view = sum_views ? 0 : i / targets, last_view = sum_views ? p.views : first_view + 1;
  float3 sum = (float3)(0.0f);
  for (uint view = first_view; view < last_view; ++view) {
    for (uint k = corner_starts[target]; k < corner_starts[target + 1]; ++k) {
      const uint face = view * p.faces + corners[k] / 3, corner = corners[k] % 3;
      const uint2 run = (uint2)(pair_starts[face], pair_starts[face + 1]);
      if (has_chunks(run)) {
        for (uint place = run.x; place < run.y; place += DPR_RUN_CHUNK)
          sum += vload3(0, chunks + 9 * slot_of_chunk(run, place) + 3 * corner);
        continue;
      }
      for (uint place = run.x; place < run.y; ++place) {
        const uint pair = face_pairs[place];
        if (pair != DPR_NO_PAIR) sum += vload3(0, partial + first + 9 * pair + 3 * corner);
      }
    }
  }
  grad[i] = (float4)(sum, 0.0f);
}

/// Sums of targets whose corners gather_corners has summed in parts, in order. One work-item per (view, target), or per
/// target of summed views.
/// in   sums, targets, parts  how many: with every view's, in a view
/// in   part_starts  uint[target + 1]
/// in   partial      float4[view][part]
/// out  grad         float4[view][target]
kernel void gather_parts(const uint sums, const uint targets, const uint parts,
                         global const uint* restrict part_starts, global const float4* restrict partial,
                         global float4* restrict grad) {
  const uint i = (uint)get_global_id(0);
  if (i >= sums) return;
  const uint view = i / targets, target = i - view * targets;
  float4 sum = (float4)(0.0f);
  for (uint part = part_starts[target]; part < part_starts[target + 1]; ++part)
    sum += partial[(size_t)view * parts + part];
  grad[i] = sum;
}

/// The same of faces, in an order that brings together those of one material; the views are added up. One
/// work-item per place of `faces`.
/// in   pair_starts, face_pairs  as gather_corners
/// in   ordered   uint[face]
/// in   partial   float[pair][DPR_MATERIAL_CHANNELS]
/// in   chunks    float[slot][DPR_MATERIAL_CHANNELS]  as gather_chunks left them
/// out  channels  float[DPR_MATERIAL_CHANNELS][face]  in that order
kernel void gather_faces(const FrameParams p, global const uint* restrict pair_starts,
                         global const uint* restrict face_pairs, global const uint* restrict ordered,
                         global const float* restrict partial, const ulong first,
                         global const float* restrict chunks, global float* restrict channels) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.faces) return;
  float4 sum = (float4)(0.0f);
  for (uint view = 0; view < p.views; ++view) {
    const uint face = view * p.faces + ordered[i];
    const uint2 run = (uint2)(pair_starts[face], pair_starts[face + 1]);
    if (has_chunks(run)) {
      for (uint place = run.x; place < run.y; place += DPR_RUN_CHUNK)
        sum += vload4(slot_of_chunk(run, place), chunks);
      continue;
    }
    for (uint place = run.x; place < run.y; ++place) {
      const uint pair = face_pairs[place];
      if (pair != DPR_NO_PAIR) sum += vload4(pair, partial + first);
    }
  }
  channels[i] = sum.x;
  channels[p.faces + i] = sum.y;
  channels[2 * p.faces + i] = sum.z;
  channels[3 * p.faces + i] = sum.w;
}
