// Opacity of surfaces: a triangle covers a pixel with its opacity times its perturbed occupancy, as if chance
// decided whether it is there.
#include "face_rows.h"
#include "shared_types.h"
#include "tile_lanes.h"

/// A triangle's opacity: c1, c2 of the way along `along1`, `along2` from `base`.
typedef struct {
  float base, along1, along2;
} CornerOpacities;

static inline CornerOpacities load_opacities(const FrameParams p, uint view_face,
                                             global const uint4* restrict faces,
                                             global const float4* restrict opacities) {
  const uint4 corners = faces[p.opacity_faces + row_of_face(p, view_face)];
  CornerOpacities o;
  o.base = opacities[corners.x].x;
  o.along1 = opacities[corners.y].x - o.base;
  o.along2 = opacities[corners.z].x - o.base;
  return o;
}

static inline realn opacity_at(const CornerOpacities o, const OpacityParams in_force, realn c1, realn c2) {
  return clamp(o.base + c1 * o.along1 + c2 * o.along2, in_force.least, in_force.largest);
}

/// One work-item per group of pairs in `range`. Deterministic.
/// in   pair_face        uint[pair]      view * faces + face
/// in   fragment_starts  uint[pair + 1]  runs of fragments
/// in   faces        uint4[...][face]    from p.opacity_faces on indices into opacities, by corner
/// in   opacities    float4[opacity]     x in [0, 1]
/// in out  fragments  float[plane][fragment]  LOG_OCCUPANCY and OCCUPANCY, by BARY
kernel void opacity_forward(const FrameParams p, const OpacityParams in_force, const uint2 range,
                            global const uint* restrict pairs, global const uint* restrict pair_face,
                            global const uint* restrict fragment_starts, global const uint4* restrict faces,
                            global const float4* restrict opacities, global float* restrict fragments) {
  global const float* const bary = fragments + DPR_PLANE(p, BARY);
  global float *const log_p = fragments + DPR_PLANE(p, LOG_OCCUPANCY), *const occupancy =
                                                                           fragments +
                                                                           DPR_PLANE(p, OCCUPANCY);
  const uint2 group = pair_group(range, pairs[0]);
  for (uint pair = group.x; pair < group.y; ++pair) {
    const CornerOpacities o = load_opacities(p, pair_face[pair], faces, opacities);
    if (in_force.largest == 1.0f && o.base == 1.0f && o.along1 == 0.0f && o.along2 == 0.0f) continue;
    const uint last = fragment_starts[pair + 1];
    for (uint i = fragment_starts[pair]; i < last; i += DPR_WIDTH) {
      const realn a = opacity_at(o, in_force, load_n(i, bary), load_n(i, bary + p.fragments));
      store_run(load_own_run(last, i, log_p) + log_n(a), i, last, log_p);
      store_run(load_own_run(last, i, occupancy) * a, i, last, occupancy);
    }
  }
}

/// One work-item per group of pairs in `range`, after shading's backward pass and before that of occupancy.
/// Deterministic. Inputs as opacity_forward, and
/// in out  grads      float[plane][fragment]  BARY, to which it adds, by LOG_OCCUPANCY; and, sampled, this, by
///                                            opacities of textures that lie in DISTANCE, if there are any
/// out  grad_opacities  float[pair][9]        of the corners' opacities in the first of three each
kernel void opacity_backward(const FrameParams p, const OpacityParams in_force, const uint2 range,
                             global const uint* restrict pairs, global const uint* restrict pair_face,
                             global const uint* restrict fragment_starts, global const uint4* restrict faces,
                             global const float4* restrict opacities, global const float* restrict fragments,
                             global float* restrict grads, global float* restrict grad_opacities) {
  global const float* const bary = fragments + DPR_PLANE(p, BARY);
  global const float* const texture_opacities = grads + DPR_GRAD_PLANE(p, DISTANCE);
  global float *const grad_bary = grads + DPR_GRAD_PLANE(p, BARY), *const grad_log =
                                                                       grads +
                                                                       DPR_GRAD_PLANE(p, LOG_OCCUPANCY);
  const uint2 group = pair_group(range, pairs[0]);
  for (uint pair = group.x; pair < group.y; ++pair) {
    const CornerOpacities o = load_opacities(p, pair_face[pair], faces, opacities);
    const uint last = fragment_starts[pair + 1];
    realn sum0 = 0.0f, sum1 = 0.0f, sum2 = 0.0f;
    for (uint i = fragment_starts[pair]; i < last; i += DPR_WIDTH) {
      const intn in_run = lanes_before(last, i);
      const realn c1 = load_run(in_run, i, bary), c2 = load_run(in_run, i, bary + p.fragments);
      const realn a = opacity_at(o, in_force, c1, c2), by_log = load_own_run(last, i, grad_log),
                  grad = by_log / a;
      sum0 += (1.0f - c1 - c2) * grad;
      sum1 += c1 * grad;
      sum2 += c2 * grad;
      store_run(load_own_run(last, i, grad_bary) + o.along1 * grad, i, last, grad_bary);
      store_run(load_own_run(last, i, grad_bary + p.grad_fragments) + o.along2 * grad, i, last,
                grad_bary + p.grad_fragments);
      if (in_force.is_sampled) {
        const realn all = in_force.is_textured ? a * load_own_run(last, i, texture_opacities) : a;
        store_run(by_log * all, i, last, grad_log);
      }
    }
    vstore3((float3)(sum_lanes(sum0), 0.0f, 0.0f), 0, grad_opacities + 9 * pair);
    vstore3((float3)(sum_lanes(sum1), 0.0f, 0.0f), 1, grad_opacities + 9 * pair);
    vstore3((float3)(sum_lanes(sum2), 0.0f, 0.0f), 2, grad_opacities + 9 * pair);
  }
}

/// Tangents of ln p by those of barycentrics and of the corners' opacities, after those by distances. One
/// work-item per group of pairs in `range`. Deterministic. Inputs as opacity_forward, and
/// in   moving      how many opacities a direction has; 0: none changes
/// in   opacity_tangents  float4[direction][opacity]
/// in out  tangents  float[direction][q.planes][fragment]  LOG_OCCUPANCY, to which it adds
kernel void opacity_tangent(const FrameParams p, const OpacityParams in_force, const uint2 range,
                            const TangentParams q, const uint moving, global const uint* restrict pairs,
                            global const uint* restrict pair_face,
                            global const uint* restrict fragment_starts, global const uint4* restrict faces,
                            global const float4* restrict opacities,
                            global const float4* restrict opacity_tangents,
                            global const float* restrict fragments, global float* restrict tangents) {
  global const float* const bary = fragments + DPR_PLANE(p, BARY);
  const uint2 group = pair_group(range, pairs[0]);
  for (uint pair = group.x; pair < group.y; ++pair) {
    const uint last = fragment_starts[pair + 1];
    const CornerOpacities o = load_opacities(p, pair_face[pair], faces, opacities);
    for (uint d = 0; d < q.directions; ++d) {
      CornerOpacities m = {0.0f, 0.0f, 0.0f};
      if (moving != 0) m = load_opacities(p, pair_face[pair], faces, opacity_tangents + (size_t)d * moving);
      global float* const of = tangents + (size_t)d * q.planes * p.grad_fragments;
      global float* const by_log = of + DPR_GRAD_PLANE(p, LOG_OCCUPANCY);
      for (uint i = fragment_starts[pair]; i < last; i += DPR_WIDTH) {
        const intn in_run = lanes_before(last, i);
        const realn c1 = load_run(in_run, i, bary), c2 = load_run(in_run, i, bary + p.fragments);
        const realn b1 = load_run(in_run, i, of + DPR_GRAD_PLANE(p, BARY));
        const realn b2 = load_run(in_run, i, of + DPR_GRAD_PLANE(p, BARY) + p.grad_fragments);
        const realn moved = m.base + c1 * m.along1 + c2 * m.along2 + b1 * o.along1 + b2 * o.along2;
        store_run(load_own_run(last, i, by_log) + moved / opacity_at(o, in_force, c1, c2), i, last, by_log);
      }
    }
  }
}
