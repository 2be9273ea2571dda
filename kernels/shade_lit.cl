// Fragment colours with lights: base colour * factor + material * specular, where factor and specular come
// from the light at the fragment (flat, Phong, Blinn, microfacet) or interpolate those at the corners (Gouraud).
// DPR_SHADING says which, DPR_LIGHTS in what lights, and DPR_BASE whether the base colour is interpolated
// here or comes from the surface stage. Loops over the corners are unrolled, as in geometry.h.
#include "lit_backward.h"

/// One work-item per pair, up to p.last_pair. Deterministic. Pairs, fragments and colours as shade_forward,
/// and
/// in   views   ViewParams[view]
/// in   lights  Light[view, or none where they share them][row]  an Environment, then the lights
/// in   faces   uint4[...][face]       vertex indices; those of colours, w = material; those of normals
/// in   world   float4[view][vertex], then float4[view][normal], which flat shading does not read
/// in   materials  float4[material]    RGB of the specular coefficient (microfacet: F0); w = shininess, or that of
///      the lights where it is below 1
/// in out  fragments  float[plane][fragment]  COLOR by BARY, and by BASE where DPR_BASE says so; the colours
///      are not read, then
kernel void shade_lit_forward(const FrameParams p, const LightingParams lp, global const uint* restrict pairs,
                              global const ViewParams* restrict views, global const Light* restrict lights,
                              global const uint4* restrict faces, global const float4* restrict colors,
                              global const float4* restrict world, global const float4* restrict materials,
                              global const uint* restrict pair_face,
                              global const uint* restrict fragment_starts, global float* restrict fragments) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(p.last_pair, pairs[0])) return;
  lights += first_light(p, lp, pair_face[pair]);
  const Surface s = load_surface(p, lp, pair_face[pair], views, lights, faces, colors, world, materials);
  const uint last = fragment_starts[pair + 1];
  for (uint i = fragment_starts[pair]; i < last; i += DPR_WIDTH) {
    const uint bary = i + DPR_PLANE(p, BARY);
    const realn c1 = load_n(bary, fragments), c2 = load_n(bary + p.fragments, fragments);
    const Vec3n base = load_base(p, lanes_before(last, i), i, fragments);
    const Shaded f = shade_fragment(s, lp, lights, c1, c2, base);
    const float4 coefficient = coefficient_of(s.material);
    store_run3(f.at.base.x * f.lit.factor.x + coefficient.x * f.lit.specular.x,
               f.at.base.y * f.lit.factor.y + coefficient.y * f.lit.specular.y,
               f.at.base.z * f.lit.factor.z + coefficient.z * f.lit.specular.z, i, last, DPR_PLANE(p, COLOR),
               p.fragments, fragments);
  }
}

static inline float4 sum_vec3n(Vec3n v) {
  return (float4)(sum_lanes(v.x), sum_lanes(v.y), sum_lanes(v.z), 0.0f);
}

static inline void store_channels(Vec3n v, uint channel, uint pairs, uint pair, global float* channels) {
  const float4 sum = sum_vec3n(v);
  channels[(size_t)channel * pairs + pair] = sum.x;
  channels[(size_t)(channel + 1) * pairs + pair] = sum.y;
  channels[(size_t)(channel + 2) * pairs + pair] = sum.z;
}

/// The three corners share one normal, cross(b - a, c - a) normalised: its gradient moves to the positions.
static inline void flat_normal_backward(const float4 world[3], float4 grad_unit, float4 grad_position[3]) {
  const float4 n = flat_normal(world[0], world[1], world[2]);
  const float inverse = n.w > DPR_MIN_LENGTH ? 1.0f / n.w : 0.0f;
  const float3 g = (grad_unit.xyz - n.xyz * dot(n.xyz, grad_unit.xyz)) * inverse;
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    grad_position[k] += (float4)(cross(world[(k + 1) % 3].xyz - world[(k + 2) % 3].xyz, g), 0.0f);
  }
}

/// Stores a pair's.
static inline void store_material(const FrameParams p, const MaterialGradients g, uint pair,
                                  global float* grad_pairs) {
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    if (DPR_BASE == DPR_BASE_OF_CORNERS)
      vstore3(sum_vec3n(g.color[k]).xyz, 0,
              grad_pairs + DPR_PAIR_COLORS * (size_t)p.pairs + 9 * pair + 3 * k);
  }
  vstore4(
      (float4)(sum_vec3n(g.coefficient).xyz, sum_lanes(g.shininess)), pair,
      grad_pairs + (DPR_PAIR_LIT(DPR_BASE == DPR_BASE_OF_FRAGMENTS) + DPR_PAIR_MATERIAL) * (size_t)p.pairs);
}

/// One work-item per pair, up to p.last_pair. Deterministic. Inputs as shade_lit_forward.
/// in out  grads    float[plane][fragment]  of BARY by those of COLOR; of BASE where DPR_BASE says so
/// out  grad_pairs  DPR_PAIR_COLORS where the colours are read, and from DPR_PAIR_LIT on: POSITIONS, NORMALS but
///                  in flat shading, MATERIAL, EYE
kernel void shade_lit_backward(const FrameParams p, const LightingParams lp,
                               global const uint* restrict pairs, global const ViewParams* restrict views,
                               global const Light* restrict lights, global const uint4* restrict faces,
                               global const float4* restrict colors, global const float4* restrict world,
                               global const float4* restrict materials, global const uint* restrict pair_face,
                               global const uint* restrict fragment_starts,
                               global const float* restrict fragments, global float* restrict grads,
                               global float* restrict grad_pairs) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(p.last_pair, pairs[0])) return;
  lights += first_light(p, lp, pair_face[pair]);
  const Surface s = load_surface(p, lp, pair_face[pair], views, lights, faces, colors, world, materials);
  const uint first = fragment_starts[pair], last = fragment_starts[pair + 1];
  const uint bary1 = DPR_GRAD_PLANE(p, BARY), bary2 = bary1 + p.grad_fragments;
  MaterialGradients of_material = no_material_gradients();
  for (uint i = first; i < last; i += DPR_WIDTH) {
    realn b1, b2;
    const Vec3n grad_base =
        material_backward(s, lp, lights, load_fragment(p, last, i, fragments, grads), &of_material, &b1, &b2);
    store_run(b1, i + bary1, last + bary1, grads);
    store_run(b2, i + bary2, last + bary2, grads);
    if (DPR_BASE == DPR_BASE_OF_CORNERS) continue;
    store_run3(grad_base.x, grad_base.y, grad_base.z, i, last, DPR_GRAD_PLANE_BASE * p.grad_fragments,
               p.grad_fragments, grads);
  }
  store_material(p, of_material, pair, grad_pairs);
  PlaceGradients g = no_place_gradients();
  if (DPR_SHADING == DPR_GOURAUD) {
    const realn share = 1.0f / DPR_WIDTH;  // each lane carries its part of the sum
#pragma unroll
    for (int k = 0; k < 3; ++k) {
      of_material.factor[k] = scale3n(splat3(sum_vec3n(of_material.factor[k])), share);
      of_material.specular[k] = scale3n(splat3(sum_vec3n(of_material.specular[k])), share);
    }
    corners_backward(s, lp, lights, of_material, &g);
  }
  for (uint i = first; DPR_SHADING != DPR_GOURAUD && i < last; i += DPR_WIDTH) {
    realn b1, b2;
    place_backward(s, lp, lights, load_fragment(p, last, i, fragments, grads), &g, &b1, &b2);
    store_run(load_own_run(last + bary1, i + bary1, grads) + b1, i + bary1, last + bary1, grads);
    store_run(load_own_run(last + bary2, i + bary2, grads) + b2, i + bary2, last + bary2, grads);
  }
  float4 position[3];
#pragma unroll
  for (int k = 0; k < 3; ++k) position[k] = sum_vec3n(g.position[k]);
  if (DPR_SHADING == DPR_FLAT) {
    const uint4 f = faces[row_of_face(p, pair_face[pair])];
    global const float4* view_world = world + pair_face[pair] / p.faces * p.vertices;
    const float4 corners[3] = {view_world[f.x], view_world[f.y], view_world[f.z]};
    flat_normal_backward(corners, sum_vec3n(g.normal[0]) + sum_vec3n(g.normal[1]) + sum_vec3n(g.normal[2]),
                         position);
  }
  const size_t channel = p.pairs;
  grad_pairs += DPR_PAIR_LIT(DPR_BASE == DPR_BASE_OF_FRAGMENTS) * channel;
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    const uint at = 9 * pair + 3 * k;
    vstore3(position[k].xyz, 0, grad_pairs + DPR_PAIR_POSITIONS * channel + at);
    if (DPR_SHADING != DPR_FLAT)
      vstore3(sum_vec3n(g.normal[k]).xyz, 0, grad_pairs + DPR_PAIR_NORMALS * channel + at);
  }
  store_channels(g.eye, DPR_PAIR_EYE, p.pairs, pair, grad_pairs);
}

/// Gradients of the environment and of one light.
typedef struct {
  Vec3n ambient, harmonics[DPR_HARMONICS];
  LightGradient light;
} LightSums;

static inline LightSums zero_light_sums(void) {
  LightSums sums;
  sums.ambient = zero3n();
#pragma unroll
  for (int k = 0; k < DPR_HARMONICS; ++k) sums.harmonics[k] = zero3n();
  sums.light = zero_light_gradient();
  return sums;
}

/// Adds those at a point in the light; `l` is the light.
static inline void add_light_sums(const LightingParams lp, uint l, global const Light* restrict lights,
                                  float4 material, float4 eye, Vec3n position, Vec3n normal,
                                  Vec3n grad_factor, Vec3n grad_specular, LightSums* sums) {
  if ((DPR_LIGHTS & DPR_LIGHTS_HARMONICS) && l == 0)
    add_harmonics_gradient(normal, grad_factor, sums->harmonics);
  if (l < lp.lights)
    add_light_gradient(lights + l, material, eye, position, normal, grad_factor, grad_specular, &sums->light);
}

/// The environment's channels go before those of the lights.
static inline void store_light_sums(const LightSums sums, global const Light* light, uint pairs, uint pair,
                                    global float* channels) {
  const LightGradient g = sums.light;
  store_channels(g.position, DPR_CHANNEL_POSITION, pairs, pair, channels);
  store_channels(g.diffuse, DPR_CHANNEL_DIFFUSE, pairs, pair, channels);
  store_channels(g.specular, DPR_CHANNEL_SPECULAR, pairs, pair, channels);
  if (!(DPR_LIGHTS & DPR_LIGHTS_CONES)) return;
  const Vec3n axis = normalize3n_backward(splat3(light->axis), (realn)(light->axis.w), g.axis);
  store_channels(axis, DPR_CHANNEL_AXIS, pairs, pair, channels);
  channels[(size_t)DPR_CHANNEL_COS_INNER * pairs + pair] = sum_lanes(g.cos_inner);
  channels[(size_t)DPR_CHANNEL_COS_OUTER * pairs + pair] = sum_lanes(g.cos_outer);
}

/// Gradients of lp.light, and with light 0 those of the environment, per pair. One work-item per pair, up to
/// p.last_pair; one launch per light, or for light 0 where there is none. Inputs as shade_lit_backward.
/// out  channels  float[DPR_ENVIRONMENT_CHANNELS][pair], then float[light][DPR_LIGHT_CHANNELS][pair]
kernel void shade_lit_backward_lights(
    const FrameParams p, const LightingParams lp, global const uint* restrict pairs,
    global const ViewParams* restrict views, global const Light* restrict lights,
    global const uint4* restrict faces, global const float4* restrict colors,
    global const float4* restrict world, global const float4* restrict materials,
    global const uint* restrict pair_face, global const uint* restrict fragment_starts,
    global const float* restrict fragments, global const float* restrict grads,
    global float* restrict channels) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(p.last_pair, pairs[0])) return;
  lights += first_light(p, lp, pair_face[pair]);
  const Surface s = load_surface(p, lp, pair_face[pair], views, lights, faces, colors, world, materials);
  LightSums sums = zero_light_sums();
  const uint light = lp.light, last = fragment_starts[pair + 1];
  for (uint i = fragment_starts[pair]; i < last; i += DPR_WIDTH) {
    const LitFragment f = load_fragment(p, last, i, fragments, grads);
    // point_on() is enough, but inlined here it takes CPUs twice as long.
    const SurfacePoint at = shade_fragment(s, lp, lights, f.c1, f.c2, f.base).at;
    const Vec3n grad_factor = mul3n(f.grad, at.base),
                grad_specular = mul3n(f.grad, splat3(coefficient_of(s.material)));
    sums.ambient = mad3n(grad_factor, (realn)(1.0f), sums.ambient);
    if (DPR_SHADING != DPR_GOURAUD) {
      add_light_sums(lp, light, lights, s.material, s.eye, at.position, at.normal, grad_factor, grad_specular,
                     &sums);
      continue;
    }
    const realn c[3] = {1.0f - f.c1 - f.c2, f.c1, f.c2};
#pragma unroll
    for (int k = 0; k < 3; ++k) {
      add_light_sums(lp, light, lights, s.material, s.eye, s.position[k], s.normal[k],
                     scale3n(grad_factor, c[k]), scale3n(grad_specular, c[k]), &sums);
    }
  }
  if (light == 0) {
    store_channels(sums.ambient, 0, p.pairs, pair, channels);
    if (DPR_LIGHTS & DPR_LIGHTS_HARMONICS) {
#pragma unroll
      for (uint k = 0; k < DPR_HARMONICS; ++k)
        store_channels(sums.harmonics[k], 3 + 3 * k, p.pairs, pair, channels);
    }
  }
  if (light >= lp.lights) return;
  channels +=
      (size_t)(DPR_ENVIRONMENT_CHANNELS(DPR_LIGHTS) + light * DPR_LIGHT_CHANNELS(DPR_LIGHTS)) * p.pairs;
  store_light_sums(sums, lights + light, p.pairs, pair, channels);
}
