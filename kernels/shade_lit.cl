// Fragment colours with lights: base colour * factor + material * specular, where factor and specular come
// from the light at the fragment (flat, Phong, Blinn) or interpolate those at the corners (Gouraud).
// DPR_SHADING says which, DPR_LIGHTS in what lights, and DPR_BASE whether the base colour is interpolated
// here or comes from the surface stage. Loops over the corners are unrolled, as in geometry.h.
#include "tile_lanes.h"

#include "lighting.h"

#ifndef DPR_BASE
#define DPR_BASE DPR_BASE_OF_CORNERS
#endif

/// A triangle's corners: colours, world positions, normals; and for Gouraud the light there.
typedef struct {
  Vec3n color[3], position[3], normal[3], factor[3], specular[3], by_shininess[3];
  float4 eye, material;  // RGB of the specular coefficient, shininess
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
                                   global const uint4* restrict face_normals,
                                   global const float4* restrict normals,
                                   global const float4* restrict materials) {
  const uint view = view_face / p.faces;
  const uint4 f = faces[view_face % p.faces], c = face_colors[view_face % p.faces];
  const uint4 n = face_normals[view_face % p.faces];
  const uint vertex[3] = {f.x, f.y, f.z}, color[3] = {c.x, c.y, c.z}, normal[3] = {n.x, n.y, n.z};
  global const float4* corner = world + view * p.vertices;
  Surface s;
  s.eye = views[view].eye;
  s.material = materials[c.w];
  if (s.material.w < 1.0f) s.material.w = lp.shininess;
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    if (DPR_BASE == DPR_BASE_OF_CORNERS) s.color[k] = splat3(colors[view * p.color_stride + color[k]]);
    s.position[k] = splat3(corner[vertex[k]]);
    if (DPR_SHADING == DPR_FLAT) {
      s.normal[k] = splat3(flat_normal(corner[f.x], corner[f.y], corner[f.z]));
    } else {
      s.normal[k] = splat3(normals[view * p.normals + normal[k]]);
    }
    if (DPR_SHADING == DPR_GOURAUD) {
      const Lit lit = light_point(lp, lights, s.material.w, s.position[k], s.normal[k], s.eye);
      s.factor[k] = lit.factor;
      s.specular[k] = lit.specular;
      s.by_shininess[k] = lit.by_shininess;
    }
  }
  return s;
}

static inline Vec3n interpolate3(const Vec3n corner[3], realn c1, realn c2) {
  return mad3n(sub3n(corner[2], corner[0]), c2, mad3n(sub3n(corner[1], corner[0]), c1, corner[0]));
}

/// A surface at fragments.
typedef struct {
  Vec3n base, position, normal;
  realn inverse_normal;  // 1 / length of the interpolated normal
} SurfacePoint;

/// `base` is taken where base colours come from fragments.
static inline SurfacePoint point_on(const Surface s, realn c1, realn c2, Vec3n base) {
  SurfacePoint f;
  f.base = DPR_BASE == DPR_BASE_OF_CORNERS ? interpolate3(s.color, c1, c2) : base;
  f.position = interpolate3(s.position, c1, c2);
  f.normal = interpolate3(s.normal, c1, c2);
  f.inverse_normal = normalize3n(&f.normal);
  return f;
}

/// The same, and the light there.
typedef struct {
  SurfacePoint at;
  Lit lit;
} Shaded;

static inline Shaded shade_fragment(const Surface s, const LightingParams lp,
                                    global const Light* restrict lights, realn c1, realn c2, Vec3n base) {
  Shaded f;
  f.at = point_on(s, c1, c2, base);
  if (DPR_SHADING == DPR_GOURAUD) {
    f.lit.factor = interpolate3(s.factor, c1, c2);
    f.lit.specular = interpolate3(s.specular, c1, c2);
    f.lit.by_shininess = interpolate3(s.by_shininess, c1, c2);
  } else {
    f.lit = light_point(lp, lights, s.material.w, f.at.position, f.at.normal, s.eye);
  }
  return f;
}

/// RGB of fragments.
typedef struct {
  global const float *red, *green, *blue;
} RgbPlanes;

/// Those from `first` on that are in the run; 0 in the other lanes.
static inline Vec3n load_rgb(intn in_run, uint first, const RgbPlanes from) {
  return make_vec3n(load_run(in_run, first, from.red), load_run(in_run, first, from.green),
                    load_run(in_run, first, from.blue));
}

/// Base colours; 0 where those are interpolated here.
static inline Vec3n load_base(intn in_run, uint first, const RgbPlanes from) {
  return DPR_BASE == DPR_BASE_OF_CORNERS ? zero3n() : load_rgb(in_run, first, from);
}

/// One work-item per pair, up to `last_pair`. Deterministic. Pairs, fragments and colours as shade_forward,
/// and
/// in   views   ViewParams[view]
/// in   lights  Light[light]
/// in   faces   uint4[face]            vertex indices
/// in   face_colors  as shade_forward; w = material
/// in   world   float4[view][vertex]
/// in   face_normals  uint4[face]      normals of the corners
/// in   normals  float4[view][normal]; not read by flat shading
/// in   materials  float4[material]    RGB of the specular coefficient; w = shininess, or that of the lights
///      where it is below 1
/// in   base_red, base_green, base_blue  float[fragment]  read where DPR_BASE says so; the colours are not,
///      then
/// out  red, green, blue  float[fragment]
kernel void shade_lit_forward(const FrameParams p, const LightingParams lp, const uint last_pair,
                              global const uint* restrict pair_count, global const ViewParams* restrict views,
                              global const Light* restrict lights, global const uint4* restrict faces,
                              global const uint4* restrict face_colors, global const float4* restrict colors,
                              global const float4* restrict world, global const uint4* restrict face_normals,
                              global const float4* restrict normals, global const float4* restrict materials,
                              global const uint* restrict pair_face,
                              global const uint* restrict fragment_starts, global const float* restrict bary1,
                              global const float* restrict bary2, global const float* restrict base_red,
                              global const float* restrict base_green, global const float* restrict base_blue,
                              global float* restrict red, global float* restrict green,
                              global float* restrict blue) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(last_pair, pair_count[0])) return;
  const Surface s = load_surface(p, lp, pair_face[pair], views, lights, faces, face_colors, colors, world,
                                 face_normals, normals, materials);
  const RgbPlanes bases = {base_red, base_green, base_blue};
  const uint last = fragment_starts[pair + 1];
  for (uint i = fragment_starts[pair]; i < last; i += DPR_WIDTH) {
    const realn c1 = load_n(i, bary1), c2 = load_n(i, bary2);
    const Vec3n base = load_base(lanes_before(last, i), i, bases);
    const Shaded f = shade_fragment(s, lp, lights, c1, c2, base);
    store_run(f.at.base.x * f.lit.factor.x + s.material.x * f.lit.specular.x, i, last, red);
    store_run(f.at.base.y * f.lit.factor.y + s.material.y * f.lit.specular.y, i, last, green);
    store_run(f.at.base.z * f.lit.factor.z + s.material.z * f.lit.specular.z, i, last, blue);
  }
}

/// The fragments [first, last) of a pair, and their gradients.
typedef struct {
  uint first, last;
  global const float *bary1, *bary2;
  RgbPlanes base, grad;
} LitRun;

/// A vector of them; 0 in the lanes that are not in the run.
typedef struct {
  realn c1, c2;
  Vec3n base, grad;
} LitFragment;

static inline LitFragment load_fragment(const LitRun run, uint i) {
  const intn in_run = lanes_before(run.last, i);
  const LitFragment f = {load_run(in_run, i, run.bary1), load_run(in_run, i, run.bary2),
                         load_base(in_run, i, run.base), load_rgb(in_run, i, run.grad)};
  return f;
}

/// Gradients of what a surface is made of, and for Gouraud of the light at its corners, as sums over lanes.
typedef struct {
  Vec3n color[3], factor[3], specular[3], coefficient;
  realn shininess;
} MaterialGradients;

/// Gradients of where a surface lies, as sums over lanes.
typedef struct {
  Vec3n position[3], normal[3], eye;
} PlaceGradients;

static inline void add_corners(Vec3n grad[3], Vec3n g, realn c1, realn c2) {
  grad[0] = mad3n(g, 1.0f - c1 - c2, grad[0]);
  grad[1] = mad3n(g, c1, grad[1]);
  grad[2] = mad3n(g, c2, grad[2]);
}

/// Derivative by weight moved from corner 0 to corner k, of an interpolated quantity with gradient g.
static inline realn along_corner(const Vec3n corner[3], int k, Vec3n g) {
  return dot3n(sub3n(corner[k], corner[0]), g);
}

/// One fragment's share in what the surface is made of, its part of the gradients of the barycentrics,
/// relative to corner 0's, and the gradient of its base colour, which is returned.
static inline Vec3n material_backward(const Surface s, const LightingParams lp,
                                      global const Light* restrict lights, const LitFragment f,
                                      MaterialGradients* g, realn* grad_bary1, realn* grad_bary2) {
  const Shaded shaded = shade_fragment(s, lp, lights, f.c1, f.c2, f.base);
  const Vec3n grad_base = mul3n(f.grad, shaded.lit.factor), grad_specular = mul3n(f.grad, splat3(s.material));
  g->coefficient = mad3n(mul3n(f.grad, shaded.lit.specular), (realn)(1.0f), g->coefficient);
  g->shininess += dot3n(grad_specular, shaded.lit.by_shininess);
  *grad_bary1 = *grad_bary2 = 0.0f;
  if (DPR_BASE == DPR_BASE_OF_CORNERS) {
    add_corners(g->color, grad_base, f.c1, f.c2);
    *grad_bary1 = along_corner(s.color, 1, grad_base);
    *grad_bary2 = along_corner(s.color, 2, grad_base);
  }
  if (DPR_SHADING == DPR_GOURAUD) {
    const Vec3n grad_factor = mul3n(f.grad, shaded.at.base);
    add_corners(g->factor, grad_factor, f.c1, f.c2);
    add_corners(g->specular, grad_specular, f.c1, f.c2);
    *grad_bary1 += along_corner(s.factor, 1, grad_factor) + along_corner(s.specular, 1, grad_specular);
    *grad_bary2 += along_corner(s.factor, 2, grad_factor) + along_corner(s.specular, 2, grad_specular);
  }
  return grad_base;
}

/// Its share in where the surface lies, by the light at the fragment: adds to the gradients of the
/// barycentrics.
static inline void place_backward(const Surface s, const LightingParams lp,
                                  global const Light* restrict lights, const LitFragment f, PlaceGradients* g,
                                  realn* grad_bary1, realn* grad_bary2) {
  const SurfacePoint at = point_on(s, f.c1, f.c2, f.base);
  PointGradient point = zero_point_gradient();
  point.eye = g->eye;
  light_point_backward(lp, lights, s.material.w, s.eye, at.position, at.normal, mul3n(f.grad, at.base),
                       mul3n(f.grad, splat3(s.material)), &point);
  g->eye = point.eye;
  const Vec3n grad_normal = normalize3n_backward(at.normal, at.inverse_normal, point.normal);
  add_corners(g->position, point.position, f.c1, f.c2);
  add_corners(g->normal, grad_normal, f.c1, f.c2);
  *grad_bary1 = along_corner(s.position, 1, point.position) + along_corner(s.normal, 1, grad_normal);
  *grad_bary2 = along_corner(s.position, 2, point.position) + along_corner(s.normal, 2, grad_normal);
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

/// Stores a pair's.
static inline void store_material(const MaterialGradients g, uint pair, global float* grad_colors,
                                  global float* grad_materials) {
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    if (DPR_BASE == DPR_BASE_OF_CORNERS)
      vstore3(sum_vec3n(g.color[k]).xyz, 0, grad_colors + 9 * pair + 3 * k);
  }
  vstore4((float4)(sum_vec3n(g.coefficient).xyz, sum_lanes(g.shininess)), pair, grad_materials);
}

/// Backward pass of light evaluated at the corners: all lanes hold the same, and lane sums have been taken
/// before.
static inline void corners_backward(const Surface s, const LightingParams lp,
                                    global const Light* restrict lights, const MaterialGradients of,
                                    PlaceGradients* g) {
  const realn share = 1.0f / DPR_WIDTH;  // each lane carries its part of the sum
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    const Vec3n grad_factor = scale3n(splat3(sum_vec3n(of.factor[k])), share);
    const Vec3n grad_specular = scale3n(splat3(sum_vec3n(of.specular[k])), share);
    PointGradient point = zero_point_gradient();
    point.eye = g->eye;
    light_point_backward(lp, lights, s.material.w, s.eye, s.position[k], s.normal[k], grad_factor,
                         grad_specular, &point);
    g->position[k] = point.position;
    g->normal[k] = point.normal;
    g->eye = point.eye;
  }
}

/// One work-item per pair, up to `last_pair`; there are `pairs` in the frame. Deterministic. Inputs as
/// shade_lit_forward, and grad_red, grad_green, grad_blue as shade_backward.
/// out  grad_bary1, grad_bary2  float[fragment]  relative to corner 0's
/// out  grad_base_red, grad_base_green, grad_base_blue  float[fragment]  written where DPR_BASE says so;
///      grad_colors is not, then
/// out  grad_colors, grad_positions, grad_normals  float[pair][9]  of the corners; positions in world space.
///      grad_normals is not written by flat shading
/// out  grad_materials  float[pair][DPR_MATERIAL_CHANNELS]
/// out  grad_eye     float[3][pair]    of the camera centre
kernel void shade_lit_backward(const FrameParams p, const LightingParams lp, const uint pairs,
                               const uint last_pair, global const uint* restrict pair_count,
                               global const ViewParams* restrict views, global const Light* restrict lights,
                               global const uint4* restrict faces, global const uint4* restrict face_colors,
                               global const float4* restrict colors, global const float4* restrict world,
                               global const uint4* restrict face_normals,
                               global const float4* restrict normals, global const float4* restrict materials,
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
                               global float* restrict grad_normals, global float* restrict grad_materials,
                               global float* restrict grad_eye) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(last_pair, pair_count[0])) return;
  const Surface s = load_surface(p, lp, pair_face[pair], views, lights, faces, face_colors, colors, world,
                                 face_normals, normals, materials);
  const uint first = fragment_starts[pair], last = fragment_starts[pair + 1];
  const LitRun run = {
      first, last, bary1, bary2, {base_red, base_green, base_blue}, {grad_red, grad_green, grad_blue}};
  MaterialGradients of_material;
#pragma unroll
  for (int k = 0; k < 3; ++k)
    of_material.color[k] = of_material.factor[k] = of_material.specular[k] = zero3n();
  of_material.coefficient = zero3n();
  of_material.shininess = 0.0f;
  for (uint i = first; i < last; i += DPR_WIDTH) {
    realn b1, b2;
    const Vec3n grad_base = material_backward(s, lp, lights, load_fragment(run, i), &of_material, &b1, &b2);
    store_run(b1, i, last, grad_bary1);
    store_run(b2, i, last, grad_bary2);
    if (DPR_BASE == DPR_BASE_OF_CORNERS) continue;
    store_run(grad_base.x, i, last, grad_base_red);
    store_run(grad_base.y, i, last, grad_base_green);
    store_run(grad_base.z, i, last, grad_base_blue);
  }
  store_material(of_material, pair, grad_colors, grad_materials);
  PlaceGradients g;
#pragma unroll
  for (int k = 0; k < 3; ++k) g.position[k] = g.normal[k] = zero3n();
  g.eye = zero3n();
  if (DPR_SHADING == DPR_GOURAUD) corners_backward(s, lp, lights, of_material, &g);
  for (uint i = first; DPR_SHADING != DPR_GOURAUD && i < last; i += DPR_WIDTH) {
    realn b1, b2;
    place_backward(s, lp, lights, load_fragment(run, i), &g, &b1, &b2);
    store_run(load_own_run(last, i, grad_bary1) + b1, i, last, grad_bary1);
    store_run(load_own_run(last, i, grad_bary2) + b2, i, last, grad_bary2);
  }
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
    vstore3(position[k].xyz, 0, grad_positions + 9 * pair + 3 * k);
    if (DPR_SHADING != DPR_FLAT) vstore3(sum_vec3n(g.normal[k]).xyz, 0, grad_normals + 9 * pair + 3 * k);
  }
  const float4 eye = sum_vec3n(g.eye);
  grad_eye[pair] = eye.x;
  grad_eye[pairs + pair] = eye.y;
  grad_eye[2 * pairs + pair] = eye.z;
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
                                  float shininess, float4 eye, Vec3n position, Vec3n normal,
                                  Vec3n grad_factor, Vec3n grad_specular, LightSums* sums) {
  if ((DPR_LIGHTS & DPR_LIGHTS_HARMONICS) && l == 0)
    add_harmonics_gradient(normal, grad_factor, sums->harmonics);
  if (l < lp.lights)
    add_light_gradient(lights + l, shininess, eye, position, normal, grad_factor, grad_specular,
                       &sums->light);
}

static inline void store_channels(Vec3n v, uint channel, uint pairs, uint pair, global float* channels) {
  const float4 sum = sum_vec3n(v);
  channels[(size_t)channel * pairs + pair] = sum.x;
  channels[(size_t)(channel + 1) * pairs + pair] = sum.y;
  channels[(size_t)(channel + 2) * pairs + pair] = sum.z;
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

/// Gradients of one `light`, and with light 0 those of the environment, per pair. One work-item per pair, up
/// to `last_pair`; one launch per light, or for light 0 where there is none. Inputs as shade_lit_backward.
/// out  channels  float[DPR_ENVIRONMENT_CHANNELS][pair], then float[light][DPR_LIGHT_CHANNELS][pair]
kernel void shade_lit_backward_lights(
    const FrameParams p, const LightingParams lp, const uint pairs, const uint last_pair,
    global const uint* restrict pair_count, const uint light, global const ViewParams* restrict views,
    global const Light* restrict lights, global const uint4* restrict faces,
    global const uint4* restrict face_colors, global const float4* restrict colors,
    global const float4* restrict world, global const uint4* restrict face_normals,
    global const float4* restrict normals, global const float4* restrict materials,
    global const uint* restrict pair_face, global const uint* restrict fragment_starts,
    global const float* restrict bary1, global const float* restrict bary2,
    global const float* restrict base_red, global const float* restrict base_green,
    global const float* restrict base_blue, global const float* restrict grad_red,
    global const float* restrict grad_green, global const float* restrict grad_blue,
    global float* restrict channels) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(last_pair, pair_count[0])) return;
  const Surface s = load_surface(p, lp, pair_face[pair], views, lights, faces, face_colors, colors, world,
                                 face_normals, normals, materials);
  LightSums sums = zero_light_sums();
  const uint first = fragment_starts[pair], last = fragment_starts[pair + 1];
  const LitRun run = {
      first, last, bary1, bary2, {base_red, base_green, base_blue}, {grad_red, grad_green, grad_blue}};
  for (uint i = first; i < last; i += DPR_WIDTH) {
    const LitFragment f = load_fragment(run, i);
    // point_on() is enough, but inlined here it takes CPUs twice as long.
    const SurfacePoint at = shade_fragment(s, lp, lights, f.c1, f.c2, f.base).at;
    const Vec3n grad_factor = mul3n(f.grad, at.base), grad_specular = mul3n(f.grad, splat3(s.material));
    sums.ambient = mad3n(grad_factor, (realn)(1.0f), sums.ambient);
    if (DPR_SHADING != DPR_GOURAUD) {
      add_light_sums(lp, light, lights, s.material.w, s.eye, at.position, at.normal, grad_factor,
                     grad_specular, &sums);
      continue;
    }
    const realn c[3] = {1.0f - f.c1 - f.c2, f.c1, f.c2};
#pragma unroll
    for (int k = 0; k < 3; ++k) {
      add_light_sums(lp, light, lights, s.material.w, s.eye, s.position[k], s.normal[k],
                     scale3n(grad_factor, c[k]), scale3n(grad_specular, c[k]), &sums);
    }
  }
  if (light == 0) {
    store_channels(sums.ambient, 0, pairs, pair, channels);
    if (DPR_LIGHTS & DPR_LIGHTS_HARMONICS) {
#pragma unroll
      for (uint k = 0; k < DPR_HARMONICS; ++k)
        store_channels(sums.harmonics[k], 3 + 3 * k, pairs, pair, channels);
    }
  }
  if (light >= lp.lights) return;
  channels += (size_t)(DPR_ENVIRONMENT_CHANNELS(DPR_LIGHTS) + light * DPR_LIGHT_CHANNELS(DPR_LIGHTS)) * pairs;
  store_light_sums(sums, lights + light, pairs, pair, channels);
}
