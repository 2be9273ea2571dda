// Opacity of textures: a triangle covers a pixel with its texture's opacity there times its perturbed occupancy, beside
// the opacities of vertices or faces (opacity.cl).
#include "surface_texels.h"

static inline TexturedFace load_texture(const FrameParams p, uint view_face, global const uint4* faces,
                                        global const float4* texcoords, global const Texture* textures,
                                        global const Triangle* triangles, global const ClippedFace* clipped) {
  const SurfaceScene scene = {faces, 0, texcoords, textures, triangles, clipped};
  return load_place(scene, p, view_face);
}

static inline float opacity_of(const Sample sample, const OpacityParams in_force) {
  return clamp(sample.color.x, in_force.least, in_force.largest);
}

/// One work-item per pair, up to p.last_pair. Deterministic.
/// in   pairs, pair_face, fragment_starts, texcoords, textures, triangles, clipped  as surface_forward has them
/// in   faces        uint4[...][face]  from p.texcoord_faces on indices into texcoords, by corner; w = texture
/// in   opacities    float4[texel]     x in [0, 1], every level
/// in out  fragments  float[plane][fragment]  LOG_OCCUPANCY and OCCUPANCY, by BARY
kernel void opacity_texels_forward(
    const FrameParams p, const OpacityParams in_force, global const uint* restrict pairs,
    global const uint* restrict pair_face, global const uint* restrict fragment_starts,
    global const uint4* restrict faces, global const float4* restrict texcoords,
    global const Texture* restrict textures, global const float4* restrict opacities,
    global const Triangle* restrict triangles, global const ClippedFace* restrict clipped,
    global float* restrict fragments) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(p.last_pair, pairs[0])) return;
  const TexturedFace face = load_texture(p, pair_face[pair], faces, texcoords, textures, triangles, clipped);
  if (!face.is_textured) return;
  for (uint i = fragment_starts[pair]; i < fragment_starts[pair + 1]; ++i) {
    const float c1 = fragments[i + DPR_PLANE(p, BARY)], c2 = fragments[i + DPR_PLANE(p, BARY) + p.fragments];
    const float a =
        opacity_of(sample_face(&face, find_detail(p, &face, c1, c2), c1, c2, opacities), in_force);
    fragments[i + DPR_PLANE(p, LOG_OCCUPANCY)] += log(a);
    fragments[i + DPR_PLANE(p, OCCUPANCY)] *= a;
  }
}

/// One work-item per pair, up to p.last_pair, after surface_backward and surface_list. Deterministic. Inputs as
/// opacity_texels_forward, and
/// in out  grads  float[plane][fragment]  BARY, to which it adds, by LOG_OCCUPANCY. The gradient of the opacity, for
///                opacity_texels_list, takes the place of the base colours' first; sampled, the opacity takes that of
///                DISTANCE, for opacity_backward
/// in out  grad_pairs  DPR_PAIR_TEXCOORDS and DPR_PAIR_STEPS as surface_backward leaves them, to which it adds
kernel void opacity_texels_backward(
    const FrameParams p, const OpacityParams in_force, global const uint* restrict pairs,
    global const uint* restrict pair_face, global const uint* restrict fragment_starts,
    global const uint4* restrict faces, global const float4* restrict texcoords,
    global const Texture* restrict textures, global const float4* restrict opacities,
    global const Triangle* restrict triangles, global const ClippedFace* restrict clipped,
    global const float* restrict fragments, global float* restrict grads, global float* restrict grad_pairs) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(p.last_pair, pairs[0])) return;
  const TexturedFace face = load_texture(p, pair_face[pair], faces, texcoords, textures, triangles, clipped);
  PlaceSums sums = {{0.0f, 0.0f, 0.0f}, {0.0f, 0.0f, 0.0f}};
  for (uint i = fragment_starts[pair]; i < fragment_starts[pair + 1]; ++i) {
    const float c1 = fragments[i + DPR_PLANE(p, BARY)], c2 = fragments[i + DPR_PLANE(p, BARY) + p.fragments];
    const Detail detail = find_detail(p, &face, c1, c2);
    const Sample sample = sample_face(&face, detail, c1, c2, opacities);
    const uint at1 = i + DPR_GRAD_PLANE(p, BARY), at2 = at1 + p.grad_fragments;
    const float a = face.is_textured ? opacity_of(sample, in_force) : 1.0f;
    const float grad = grads[i + DPR_GRAD_PLANE(p, LOG_OCCUPANCY)] / a;
    float along1 = 0.0f, along2 = 0.0f;
    add_fragment(&face, detail, c1, c2, grad * (float2)(sample.by_x.x, sample.by_y.x),
                 grad * sample.by_detail.x, &sums, &along1, &along2);
    grads[at1] += along1;
    grads[at2] += along2;
    grads[i + base_plane(p)] = grad;
    if (in_force.is_sampled) grads[i + DPR_GRAD_PLANE(p, DISTANCE)] = a;
  }
  finish_steps(&face, &sums);
  global float *const places = grad_pairs + DPR_PAIR_TEXCOORDS * (size_t)p.pairs + 9 * pair,
                      *const steps = grad_pairs + DPR_PAIR_STEPS * (size_t)p.pairs + 9 * pair;
  for (size_t k = 0; k < 3; ++k) {
    vstore3(vload3(k, places) + place_gradient(sums, k), k, places);
    if (face.texture.levels > 1) vstore3(vload3(k, steps) + sums.steps[k], k, steps);
  }
}

/// As surface_list, of the opacities that opacity_texels_backward has found the gradients of: in the first of three.
kernel void opacity_texels_list(const FrameParams p, global const uint* restrict pairs,
                                global const uint* restrict pair_face,
                                global const uint* restrict fragment_starts,
                                global const uint4* restrict faces, global const float4* restrict texcoords,
                                global const Texture* restrict textures,
                                global const Triangle* restrict triangles,
                                global const ClippedFace* restrict clipped,
                                global const float* restrict fragments, global const float* restrict grads,
                                global uint* restrict cells, global SeenTexels* restrict seen) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(p.last_pair, pairs[0])) return;
  const TexturedFace face = load_texture(p, pair_face[pair], faces, texcoords, textures, triangles, clipped);
  for (uint i = fragment_starts[pair]; i < fragment_starts[pair + 1]; ++i) {
    const float c1 = fragments[i + DPR_PLANE(p, BARY)], c2 = fragments[i + DPR_PLANE(p, BARY) + p.fragments];
    const float3 grad = (float3)(grads[i + base_plane(p)], 0.0f, 0.0f);
    list_fragment(p, &face, find_detail(p, &face, c1, c2), i, c1, c2, grad, cells, seen);
  }
}

/// Tangents of ln p by those of barycentrics. One work-item per pair, up to p.last_pair, before surface_tangent.
/// Deterministic. Inputs as opacity_texels_forward, and
/// in out  tangents  float[direction][q.planes][fragment]  LOG_OCCUPANCY, to which it adds; then, where textures have
///                   levels, float[3][fragment]  the derivative of ln p with respect to these, in the third
kernel void opacity_texels_tangent(
    const FrameParams p, const OpacityParams in_force, const TangentParams q,
    global const uint* restrict pair_face, global const uint* restrict fragment_starts,
    global const uint4* restrict faces, global const float4* restrict texcoords,
    global const Texture* restrict textures, global const float4* restrict opacities,
    global const Triangle* restrict triangles, global const ClippedFace* restrict clipped,
    global const float* restrict fragments, global float* restrict tangents) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= p.last_pair) return;
  const TexturedFace face = load_texture(p, pair_face[pair], faces, texcoords, textures, triangles, clipped);
  for (uint i = fragment_starts[pair]; i < fragment_starts[pair + 1]; ++i) {
    const float c1 = fragments[i + DPR_PLANE(p, BARY)], c2 = fragments[i + DPR_PLANE(p, BARY) + p.fragments];
    const Sample sample = sample_face(&face, find_detail(p, &face, c1, c2), c1, c2, opacities);
    const float inverse = 1.0f / opacity_of(sample, in_force);
    const float2 by_place = inverse * (float2)(sample.by_x.x, sample.by_y.x);
    const float by_b1 = dot(by_place, face.place1), by_b2 = dot(by_place, face.place2);
    if (face.texture.levels > 1)
      store_planes((float3)(0.0f, 0.0f, inverse * sample.by_detail.x), i, p.grad_fragments,
                   details_of(p, q, tangents));
    for (uint d = 0; d < q.directions; ++d) {
      global float* const of = tangents + (size_t)d * q.planes * p.grad_fragments + i;
      of[DPR_GRAD_PLANE(p, LOG_OCCUPANCY)] +=
          of[DPR_GRAD_PLANE(p, BARY)] * by_b1 + of[DPR_GRAD_PLANE(p, BARY) + p.grad_fragments] * by_b2;
    }
  }
}
