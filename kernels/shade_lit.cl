// Fragment colours with lights: base colour * factor + specular, where factor and specular come from the
// light at the fragment (flat, Phong) or interpolate those at the corners (Gouraud). DPR_SHADING says which,
// and DPR_BASE whether the base colour is interpolated here or comes from the surface stage. Loops over the
// corners are unrolled, as in geometry.h.
#include "tile_lanes.h"

#include "lighting.h"

#ifndef DPR_SHADING
#define DPR_SHADING DPR_PHONG
#endif
#ifndef DPR_BASE
#define DPR_BASE DPR_BASE_OF_CORNERS
#endif

/// Channels of a light's gradient: position, diffuse, specular; ambient follows.
#define DPR_LIGHT_CHANNELS 9

/// A triangle's corners: colours, world positions, normals; and for Gouraud the light there.
typedef struct {
  Vec3n color[3], position[3], normal[3], factor[3], specular[3];
  float4 eye;
} Surface;

/// The face's own normal, of length one.
static inline float4 flat_normal(float4 a, float4 b, float4 c) {
  const float3 n = cross(b.xyz - a.xyz, c.xyz - a.xyz);
  const float size = length(n);
  return (float4)(size > DPR_MIN_LENGTH ? n / size : (float3)(0.0f), size);
}

static inline Surface load_surface(const FrameParams p, const LightingParams lp, uint view_face,
                                   global const ViewParams* restrict views,
                                   global const Light* restrict lights, global const uint4* restrict faces,
                                   global const uint4* restrict face_colors,
                                   global const float4* restrict colors, global const float4* restrict world,
                                   global const float4* restrict normals) {
  const uint view = view_face / p.faces;
  const uint4 f = faces[view_face % p.faces], c = face_colors[view_face % p.faces];
  const uint vertex[3] = {f.x, f.y, f.z}, color[3] = {c.x, c.y, c.z};
  global const float4* corner = world + view * p.vertices;
  Surface s;
  s.eye = views[view].eye;
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    if (DPR_BASE == DPR_BASE_OF_CORNERS) s.color[k] = splat3(colors[view * p.color_stride + color[k]]);
    s.position[k] = splat3(corner[vertex[k]]);
    if (DPR_SHADING == DPR_FLAT) {
      s.normal[k] = splat3(flat_normal(corner[f.x], corner[f.y], corner[f.z]));
    } else {
      s.normal[k] = splat3(normals[view * p.vertices + vertex[k]]);
    }
    if (DPR_SHADING == DPR_GOURAUD) {
      light_point(lp, lights, s.position[k], s.normal[k], s.eye, &s.factor[k], &s.specular[k]);
    }
  }
  return s;
}

static inline Vec3n interpolate3(const Vec3n corner[3], realn c1, realn c2) {
  return mad3n(sub3n(corner[2], corner[0]), c2, mad3n(sub3n(corner[1], corner[0]), c1, corner[0]));
}

/// Value at a fragment, with what the gradient needs again.
typedef struct {
  Vec3n base, factor, specular, position, normal;
  realn inverse_normal;  // 1 / length of the interpolated normal
} Shaded;

/// `base` is read where base colours come from fragments.
static inline Shaded shade_fragment(const Surface s, const LightingParams lp,
                                    global const Light* restrict lights, realn c1, realn c2, Vec3n base) {
  Shaded f;
  f.base = DPR_BASE == DPR_BASE_OF_CORNERS ? interpolate3(s.color, c1, c2) : base;
  f.position = interpolate3(s.position, c1, c2);
  f.normal = interpolate3(s.normal, c1, c2);
  f.inverse_normal = normalize3n(&f.normal);
  if (DPR_SHADING == DPR_GOURAUD) {
    f.factor = interpolate3(s.factor, c1, c2);
    f.specular = interpolate3(s.specular, c1, c2);
  } else {
    light_point(lp, lights, f.position, f.normal, s.eye, &f.factor, &f.specular);
  }
  return f;
}

/// RGB of the fragments from `first` on that are in the run; 0 in the other lanes.
static inline Vec3n load_rgb(intn in_run, uint first, global const float* red, global const float* green,
                             global const float* blue) {
  return make_vec3n(load_run(in_run, first, red), load_run(in_run, first, green),
                    load_run(in_run, first, blue));
}

/// Their base colours; 0 where those are interpolated here.
static inline Vec3n load_base(intn in_run, uint first, global const float* red, global const float* green,
                              global const float* blue) {
  return DPR_BASE == DPR_BASE_OF_CORNERS ? zero3n() : load_rgb(in_run, first, red, green, blue);
}

/// One work-item per pair, up to `last_pair`. Deterministic. Pairs, fragments and colours as shade_forward,
/// and
/// in   views   ViewParams[view]
/// in   lights  Light[light]
/// in   faces   uint4[face]            vertex indices
/// in   world, normals  float4[view][vertex]; normals are not read by flat shading
/// in   base_red, base_green, base_blue  float[fragment]  read where DPR_BASE says so; the colours are not,
///      then
/// out  red, green, blue  float[fragment]
kernel void shade_lit_forward(const FrameParams p, const LightingParams lp, const uint last_pair,
                              global const ViewParams* restrict views, global const Light* restrict lights,
                              global const uint4* restrict faces, global const uint4* restrict face_colors,
                              global const float4* restrict colors, global const float4* restrict world,
                              global const float4* restrict normals, global const uint* restrict pair_face,
                              global const uint* restrict fragment_starts, global const float* restrict bary1,
                              global const float* restrict bary2, global const float* restrict base_red,
                              global const float* restrict base_green, global const float* restrict base_blue,
                              global float* restrict red, global float* restrict green,
                              global float* restrict blue) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= last_pair) return;
  const Surface s =
      load_surface(p, lp, pair_face[pair], views, lights, faces, face_colors, colors, world, normals);
  const uint last = fragment_starts[pair + 1];
  for (uint i = fragment_starts[pair]; i < last; i += DPR_WIDTH) {
    const Vec3n base = load_base(lanes_before(last, i), i, base_red, base_green, base_blue);
    const Shaded f = shade_fragment(s, lp, lights, load_n(i, bary1), load_n(i, bary2), base);
    store_run(f.base.x * f.factor.x + f.specular.x, i, last, red);
    store_run(f.base.y * f.factor.y + f.specular.y, i, last, green);
    store_run(f.base.z * f.factor.z + f.specular.z, i, last, blue);
  }
}

/// Gradients of a surface's corners, as sums over lanes.
typedef struct {
  Vec3n color[3], position[3], normal[3], factor[3], specular[3], eye;
} SurfaceGradients;

static inline void add_corners(Vec3n grad[3], Vec3n g, const realn c[3]) {
#pragma unroll
  for (int k = 0; k < 3; ++k) grad[k] = mad3n(g, c[k], grad[k]);
}

/// What moving weight from corner 0 to corner k does to an interpolated quantity with gradient g.
static inline realn along_corner(const Vec3n corner[3], int k, Vec3n g) {
  return dot3n(sub3n(corner[k], corner[0]), g);
}

/// Gradients through the light at a point: of its position and unit normal, and of the eye.
static inline void light_point_backward(const LightingParams lp, global const Light* restrict lights,
                                        float4 eye, Vec3n position, Vec3n normal, Vec3n grad_factor,
                                        Vec3n grad_specular, Vec3n* grad_position, Vec3n* grad_normal,
                                        Vec3n* grad_eye) {
  *grad_position = zero3n();
  *grad_normal = zero3n();
  Vec3n grad_light = zero3n();
  for (uint l = 0; l < lp.lights; ++l) {
    const LightTerm t = light_term(position, normal, eye, lights[l].position, lp.shininess);
    light_term_backward(t, lights[l], lp.shininess, normal, grad_factor, grad_specular, grad_position,
                        grad_normal, grad_eye, &grad_light);
  }
}

/// One fragment's share of everything: the gradients of its base colour, and of the barycentrics, relative to
/// corner 0's.
static inline void shade_fragment_backward(const Surface s, const LightingParams lp,
                                           global const Light* restrict lights, realn c1, realn c2,
                                           Vec3n base, Vec3n grad, SurfaceGradients* g, Vec3n* grad_base,
                                           realn* grad_bary1, realn* grad_bary2) {
  const Shaded f = shade_fragment(s, lp, lights, c1, c2, base);
  const realn c[3] = {1.0f - c1 - c2, c1, c2};
  const Vec3n grad_factor = mul3n(grad, f.base);
  *grad_base = mul3n(grad, f.factor);
  *grad_bary1 = *grad_bary2 = 0.0f;
  if (DPR_BASE == DPR_BASE_OF_CORNERS) {
    add_corners(g->color, *grad_base, c);
    *grad_bary1 = along_corner(s.color, 1, *grad_base);
    *grad_bary2 = along_corner(s.color, 2, *grad_base);
  }
  if (DPR_SHADING == DPR_GOURAUD) {
    add_corners(g->factor, grad_factor, c);
    add_corners(g->specular, grad, c);
    *grad_bary1 += along_corner(s.factor, 1, grad_factor) + along_corner(s.specular, 1, grad);
    *grad_bary2 += along_corner(s.factor, 2, grad_factor) + along_corner(s.specular, 2, grad);
    return;
  }
  Vec3n grad_position, grad_unit;
  light_point_backward(lp, lights, s.eye, f.position, f.normal, grad_factor, grad, &grad_position, &grad_unit,
                       &g->eye);
  const Vec3n grad_normal = normalize3n_backward(f.normal, f.inverse_normal, grad_unit);
  add_corners(g->position, grad_position, c);
  add_corners(g->normal, grad_normal, c);
  *grad_bary1 += along_corner(s.position, 1, grad_position) + along_corner(s.normal, 1, grad_normal);
  *grad_bary2 += along_corner(s.position, 2, grad_position) + along_corner(s.normal, 2, grad_normal);
}

static inline float4 sum_vec3n(Vec3n v) {
  return (float4)(sum_lanes(v.x), sum_lanes(v.y), sum_lanes(v.z), 0.0f);
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

/// The light was evaluated at the corners: all lanes hold the same, and lane sums have been taken before.
static inline void corners_backward(const Surface s, const LightingParams lp,
                                    global const Light* restrict lights, SurfaceGradients* g) {
  const realn share = 1.0f / DPR_WIDTH;  // each lane carries its part of the sum
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    const Vec3n grad_factor = scale3n(splat3(sum_vec3n(g->factor[k])), share);
    const Vec3n grad_specular = scale3n(splat3(sum_vec3n(g->specular[k])), share);
    light_point_backward(lp, lights, s.eye, s.position[k], s.normal[k], grad_factor, grad_specular,
                         &g->position[k], &g->normal[k], &g->eye);
  }
}

/// One work-item per pair, up to `last_pair`; there are `pairs` in the frame. Deterministic. Inputs as
/// shade_lit_forward, and grad_red, grad_green, grad_blue as shade_backward.
/// out  grad_bary1, grad_bary2  float[fragment]  relative to corner 0's
/// out  grad_base_red, grad_base_green, grad_base_blue  float[fragment]  written where DPR_BASE says so;
///      grad_colors is not, then
/// out  grad_colors, grad_positions, grad_normals  float[pair][9]  of the corners; positions in world space.
///      grad_normals is not written by flat shading
/// out  grad_eye     float[3][pair]    of the camera centre
kernel void shade_lit_backward(const FrameParams p, const LightingParams lp, const uint pairs,
                               const uint last_pair, global const ViewParams* restrict views,
                               global const Light* restrict lights, global const uint4* restrict faces,
                               global const uint4* restrict face_colors, global const float4* restrict colors,
                               global const float4* restrict world, global const float4* restrict normals,
                               global const uint* restrict pair_face,
                               global const uint* restrict fragment_starts,
                               global const float* restrict bary1, global const float* restrict bary2,
                               global const float* restrict base_red, global const float* restrict base_green,
                               global const float* restrict base_blue, global const float* restrict grad_red,
                               global const float* restrict grad_green,
                               global const float* restrict grad_blue, global float* restrict grad_bary1,
                               global float* restrict grad_bary2, global float* restrict grad_base_red,
                               global float* restrict grad_base_green, global float* restrict grad_base_blue,
                               global float* restrict grad_colors, global float* restrict grad_positions,
                               global float* restrict grad_normals, global float* restrict grad_eye) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= last_pair) return;
  const Surface s =
      load_surface(p, lp, pair_face[pair], views, lights, faces, face_colors, colors, world, normals);
  SurfaceGradients g;
#pragma unroll
  for (int k = 0; k < 3; ++k)
    g.color[k] = g.position[k] = g.normal[k] = g.factor[k] = g.specular[k] = zero3n();
  g.eye = zero3n();
  const uint first = fragment_starts[pair], last = fragment_starts[pair + 1];
  for (uint i = first; i < last; i += DPR_WIDTH) {
    const intn in_run = lanes_before(last, i);
    const Vec3n grad = load_rgb(in_run, i, grad_red, grad_green, grad_blue);
    const Vec3n base = load_base(in_run, i, base_red, base_green, base_blue);
    Vec3n grad_base;
    realn b1, b2;
    shade_fragment_backward(s, lp, lights, load_run(in_run, i, bary1), load_run(in_run, i, bary2), base, grad,
                            &g, &grad_base, &b1, &b2);
    store_run(b1, i, last, grad_bary1);
    store_run(b2, i, last, grad_bary2);
    if (DPR_BASE == DPR_BASE_OF_CORNERS) continue;
    store_run(grad_base.x, i, last, grad_base_red);
    store_run(grad_base.y, i, last, grad_base_green);
    store_run(grad_base.z, i, last, grad_base_blue);
  }
  if (DPR_SHADING == DPR_GOURAUD) corners_backward(s, lp, lights, &g);
  float4 position[3];
#pragma unroll
  for (int k = 0; k < 3; ++k) position[k] = sum_vec3n(g.position[k]);
  if (DPR_SHADING == DPR_FLAT) {
    const uint4 f = faces[pair_face[pair] % p.faces];
    global const float4* view_world = world + pair_face[pair] / p.faces * p.vertices;
    const float4 corners[3] = {view_world[f.x], view_world[f.y], view_world[f.z]};
    flat_normal_backward(corners, sum_vec3n(g.normal[0]) + sum_vec3n(g.normal[1]) + sum_vec3n(g.normal[2]),
                         position);
  }
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    if (DPR_BASE == DPR_BASE_OF_CORNERS)
      vstore3(sum_vec3n(g.color[k]).xyz, 0, grad_colors + 9 * pair + 3 * k);
    vstore3(position[k].xyz, 0, grad_positions + 9 * pair + 3 * k);
    if (DPR_SHADING != DPR_FLAT) vstore3(sum_vec3n(g.normal[k]).xyz, 0, grad_normals + 9 * pair + 3 * k);
  }
  const float4 eye = sum_vec3n(g.eye);
  grad_eye[pair] = eye.x;
  grad_eye[pairs + pair] = eye.y;
  grad_eye[2 * pairs + pair] = eye.z;
}

/// Adds the gradients of light `l` at a point.
static inline void add_light_gradient(const LightingParams lp, const Light light, float4 eye, Vec3n position,
                                      Vec3n normal, Vec3n grad_factor, Vec3n grad_specular, Vec3n sum[3]) {
  const LightTerm t = light_term(position, normal, eye, light.position, lp.shininess);
  Vec3n unused_position = sum[0], unused_normal = sum[0], unused_eye = sum[0];
  light_term_backward(t, light, lp.shininess, normal, grad_factor, grad_specular, &unused_position,
                      &unused_normal, &unused_eye, &sum[0]);
  sum[1] = mad3n(grad_factor, t.lambert, sum[1]);
  sum[2] = mad3n(grad_specular, t.highlight, sum[2]);
}

/// Gradients of one `light` and of the ambient light, per pair. One work-item per pair, up to `last_pair`;
/// one launch per light. Inputs as shade_lit_backward.
/// out  channels  float[light][DPR_LIGHT_CHANNELS + 3][pair]  position, diffuse, specular, ambient
kernel void shade_lit_backward_lights(
    const FrameParams p, const LightingParams lp, const uint pairs, const uint last_pair, const uint light,
    global const ViewParams* restrict views, global const Light* restrict lights,
    global const uint4* restrict faces, global const uint4* restrict face_colors,
    global const float4* restrict colors, global const float4* restrict world,
    global const float4* restrict normals, global const uint* restrict pair_face,
    global const uint* restrict fragment_starts, global const float* restrict bary1,
    global const float* restrict bary2, global const float* restrict base_red,
    global const float* restrict base_green, global const float* restrict base_blue,
    global const float* restrict grad_red, global const float* restrict grad_green,
    global const float* restrict grad_blue, global float* restrict channels) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= last_pair) return;
  const Surface s =
      load_surface(p, lp, pair_face[pair], views, lights, faces, face_colors, colors, world, normals);
  Vec3n sum[4] = {zero3n(), zero3n(), zero3n(), zero3n()};
  const uint first = fragment_starts[pair], last = fragment_starts[pair + 1];
  for (uint i = first; i < last; i += DPR_WIDTH) {
    const intn in_run = lanes_before(last, i);
    const Vec3n grad = load_rgb(in_run, i, grad_red, grad_green, grad_blue);
    const realn c1 = load_run(in_run, i, bary1), c2 = load_run(in_run, i, bary2);
    const Vec3n base = load_base(in_run, i, base_red, base_green, base_blue);
    const Shaded f = shade_fragment(s, lp, lights, c1, c2, base);
    const Vec3n grad_factor = mul3n(grad, f.base);
    sum[3] = mad3n(grad_factor, (realn)(1.0f), sum[3]);
    if (light >= lp.lights) continue;
    if (DPR_SHADING != DPR_GOURAUD) {
      add_light_gradient(lp, lights[light], s.eye, f.position, f.normal, grad_factor, grad, sum);
      continue;
    }
    const realn c[3] = {1.0f - c1 - c2, c1, c2};
#pragma unroll
    for (int k = 0; k < 3; ++k) {
      add_light_gradient(lp, lights[light], s.eye, s.position[k], s.normal[k], scale3n(grad_factor, c[k]),
                         scale3n(grad, c[k]), sum);
    }
  }
  global float* of_light = channels + (size_t)light * (DPR_LIGHT_CHANNELS + 3) * pairs;
#pragma unroll
  for (uint k = 0; k < 4; ++k) {
    const float4 v = sum_vec3n(sum[k]);
    of_light[(3 * k) * pairs + pair] = v.x;
    of_light[(3 * k + 1) * pairs + pair] = v.y;
    of_light[(3 * k + 2) * pairs + pair] = v.z;
  }
}
