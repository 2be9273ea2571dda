// A triangle's surface in the light, at its corners and at its fragments. Loops over the corners are
// unrolled, as in geometry.h.
#ifndef DPR_LIT_SURFACE_H
#define DPR_LIT_SURFACE_H

#include "tile_lanes.h"

#include "face_rows.h"
#include "lighting.h"

#ifndef DPR_BASE
#define DPR_BASE DPR_BASE_OF_CORNERS
#endif

/// A triangle's corners: colours, world positions, normals; and for Gouraud the light there.
typedef struct {
  Vec3n color[3], position[3], normal[3], factor[3], specular[3], by_shininess[3];
  float4 eye, material;  // RGB of the specular coefficient (microfacet: F0), shininess
} Surface;

/// The face's own normal, of length one.
static inline float4 flat_normal(float4 a, float4 b, float4 c) {
  const float3 n = cross(b.xyz - a.xyz, c.xyz - a.xyz);
  const float size = length(n);
  return (float4)(size > DPR_MIN_LENGTH ? n / size : (float3)(0.0f), size);
}

/// Where the lights of a face's view begin in the list of all.
static inline uint first_light(const FrameParams p, const LightingParams lp, uint view_face) {
  return view_face / p.faces * lp.stride + DPR_ENVIRONMENT_ROWS;
}

/// `lights` are those of the face's view.
static inline Surface load_surface(const FrameParams p, const LightingParams lp, uint view_face,
                                   global const ViewParams* restrict views,
                                   global const Light* restrict lights, global const uint4* restrict faces,
                                   global const float4* restrict colors, global const float4* restrict world,
                                   global const float4* restrict materials) {
  const uint view = view_face / p.faces;
  faces += row_of_face(p, view_face);
  const uint4 f = faces[0], c = faces[p.color_faces], n = faces[p.normal_faces];
  const uint vertex[3] = {f.x, f.y, f.z}, color[3] = {c.x, c.y, c.z}, normal[3] = {n.x, n.y, n.z};
  global const float4 *corner = world + view * p.vertices,
                      *normals = world + p.views * p.vertices + view * p.normals;
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
      s.normal[k] = splat3(normals[normal[k]]);
    }
    if (DPR_SHADING == DPR_GOURAUD) {
      const Lit lit = light_point(lp, lights, s.material, s.position[k], s.normal[k], s.eye);
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
    f.lit = light_point(lp, lights, s.material, f.at.position, f.at.normal, s.eye);
  }
  return f;
}

/// Derivative of the colour with respect to the material's specular coefficient, channel by channel.
static inline Vec3n by_coefficient(const Shaded f) {
#if DPR_SHADING == DPR_MICROFACET
  return mad3n(mul3n(f.at.base, f.lit.factor_by_straight), (realn)(1.0f), f.lit.specular_by_straight);
#else
  return f.lit.specular;
#endif
}

/// Values of three planes that are in the run; 0 in the other lanes. Those of the first are from `first` on.
static inline Vec3n load_run3(intn in_run, uint first, uint plane, global const float* values) {
  return make_vec3n(load_run(in_run, first, values), load_run(in_run, first + plane, values),
                    load_run(in_run, first + 2 * plane, values));
}

/// Base colours; 0 where those are interpolated here.
static inline Vec3n load_base(const FrameParams p, intn in_run, uint first, global const float* fragments) {
  return DPR_BASE == DPR_BASE_OF_CORNERS
             ? zero3n()
             : load_run3(in_run, first + DPR_PLANE(p, BASE), p.fragments, fragments);
}

#endif
