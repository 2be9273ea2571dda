// Forward mode of shade_lit.cl, with its options: the derivatives of the colour's channels by the points at which
// light is found, times the tangents of these.
#include "face_normal.h"
#include "lit_backward.h"
#include "world_tangents.h"

/// Where light is found: at the corners, or at the fragment.
#if DPR_SHADING == DPR_GOURAUD
#define DPR_LIT_POINTS 3
#else
#define DPR_LIT_POINTS 1
#endif

/// Tangents of those points, or the derivatives of a channel by them.
typedef struct {
  Vec3n position[DPR_LIT_POINTS], normal[DPR_LIT_POINTS], eye;
} LitPoints;

/// Channels whose derivatives are held at once: a GPU has no registers for all.
#if DPR_LANES == 1
#define DPR_CHANNELS_AT_ONCE 1
#else
#define DPR_CHANNELS_AT_ONCE 3
#endif

/// A vector's component, 0 in the others.
static inline Vec3n only3n(Vec3n v, int channel) {
  const realn none = 0.0f;
  return make_vec3n(channel == 0 ? v.x : none, channel == 1 ? v.y : none, channel == 2 ? v.z : none);
}

/// Adds the gradients of the channels from `first` on of base * factor + coefficient * specular, through the light at
/// a point.
static inline void light_point_rows(const LightingParams lp, global const Light* restrict lights,
                                    float4 material, float4 eye, Vec3n position, Vec3n normal, Vec3n base,
                                    Vec3n coefficient, int first, PointGradient* point) {
  if (DPR_LIGHTS & DPR_LIGHTS_HARMONICS) {
#pragma unroll
    for (int k = 0; k < DPR_CHANNELS_AT_ONCE; ++k)
      harmonics_backward(environment_of(lights), normal, only3n(base, first + k), point + k);
  }
  LightGradient unused = zero_light_gradient();
  for (uint l = 0; l < lp.lights; ++l) {
    const LightTerm t = light_term(position, normal, eye, lights + l, material);
#pragma unroll
    for (int k = 0; k < DPR_CHANNELS_AT_ONCE; ++k) {
      light_term_backward(t, eye, lights + l, material, normal, only3n(base, first + k),
                          only3n(coefficient, first + k), point + k, &unused);
    }
  }
}

/// The derivatives of the channels from `first` on, of a colour at these weights of corners 1 and 2.
static inline void rows_of_points(const Surface s, const LightingParams lp,
                                  global const Light* restrict lights, const SurfacePoint at, realn c1,
                                  realn c2, int first, LitPoints row[DPR_CHANNELS_AT_ONCE]) {
#pragma unroll
  for (int channel = 0; channel < DPR_CHANNELS_AT_ONCE; ++channel) row[channel].eye = zero3n();
#pragma unroll
  for (int k = 0; k < DPR_LIT_POINTS; ++k) {
    PointGradient g[DPR_CHANNELS_AT_ONCE];
#pragma unroll
    for (int channel = 0; channel < DPR_CHANNELS_AT_ONCE; ++channel) {
      g[channel] = zero_point_gradient();
      g[channel].eye = row[channel].eye;
    }
    if (DPR_SHADING == DPR_GOURAUD) {
      const realn share = k == 0 ? 1.0f - c1 - c2 : k == 1 ? c1 : c2;
      light_point_rows(lp, lights, s.material, s.eye, s.position[k], s.normal[k], scale3n(at.base, share),
                       scale3n(splat3(s.material), share), first, g);
    } else {
      light_point_rows(lp, lights, s.material, s.eye, at.position, at.normal, at.base,
                       splat3(coefficient_of(s.material)), first, g);
    }
#pragma unroll
    for (int channel = 0; channel < DPR_CHANNELS_AT_ONCE; ++channel) {
      row[channel].position[k] = g[channel].position;
      row[channel].normal[k] = g[channel].normal;
      row[channel].eye = g[channel].eye;
    }
  }
}

static inline realn along_points(const LitPoints row, const LitPoints moved) {
  realn sum = dot3n(row.eye, moved.eye);
#pragma unroll
  for (int k = 0; k < DPR_LIT_POINTS; ++k)
    sum += dot3n(row.position[k], moved.position[k]) + dot3n(row.normal[k], moved.normal[k]);
  return sum;
}

/// The tangents of a triangle's corners in a direction.
typedef struct {
  Vec3n position[3], normal[3], eye;
} PlaceTangent;

static inline PlaceTangent load_place_tangent(const FrameParams p, uint direction, uint view_face,
                                              global const uint4* faces, global const float4* world,
                                              global const float4* world_tangents) {
  const uint view = view_face / p.faces;
  faces += row_of_face(p, view_face);
  const uint4 f = faces[0], n = faces[p.normal_faces];
  const uint vertex[3] = {f.x, f.y, f.z}, normal[3] = {n.x, n.y, n.z};
  world_tangents += world_tangents_at(p, direction);
  global const float4 *positions = world_tangents + view * p.vertices,
                      *normals = world_tangents + p.views * p.vertices + view * p.normals;
  float4 flat = 0.0f;
  if (DPR_SHADING == DPR_FLAT) {
    global const float4* corners = world + view * p.vertices;
    const float4 unit = flat_normal(corners[f.x], corners[f.y], corners[f.z]);
    const float3 moved = face_normal_tangent(corners, positions, f);
    if (unit.w > DPR_MIN_LENGTH) flat = (float4)((moved - unit.xyz * dot(unit.xyz, moved)) / unit.w, 0.0f);
  }
  PlaceTangent t;
  t.eye = splat3(world_tangents[eyes_at(p) + view]);
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    t.position[k] = splat3(positions[vertex[k]]);
    t.normal[k] = splat3(DPR_SHADING == DPR_FLAT ? flat : normals[normal[k]]);
  }
  return t;
}

/// What an interpolated quantity changes by where the weights of corners 1 and 2 do.
static inline Vec3n along_corners(const Vec3n corner[3], realn moved1, realn moved2) {
  return mad3n(sub3n(corner[2], corner[0]), moved2, scale3n(sub3n(corner[1], corner[0]), moved1));
}

/// The tangents of the points at which light is found, by those of the corners and of the weights.
static inline LitPoints moved_points(const Surface s, const SurfacePoint at, const PlaceTangent t, realn c1,
                                     realn c2, realn moved1, realn moved2) {
  LitPoints moved;
  moved.eye = t.eye;
  if (DPR_SHADING == DPR_GOURAUD) {
#pragma unroll
    for (int k = 0; k < DPR_LIT_POINTS; ++k) {
      moved.position[k] = t.position[k];
      moved.normal[k] = t.normal[k];
    }
    return moved;
  }
  moved.position[0] =
      mad3n(along_corners(s.position, moved1, moved2), (realn)(1.0f), interpolate3(t.position, c1, c2));
  const Vec3n normal =
      mad3n(along_corners(s.normal, moved1, moved2), (realn)(1.0f), interpolate3(t.normal, c1, c2));
  moved.normal[0] = normalize3n_backward(at.normal, at.inverse_normal, normal);  // its own transpose
  return moved;
}

/// Tangents of colours by those of what the surface is made of: barycentrics, base colours, the corners and the eye.
/// One work-item per pair, up to p.last_pair. Deterministic. Inputs as shade_lit_forward, and
/// in   world_tangents  as transform_tangent and normals.cl leave them
/// in out  tangents     float[direction][planes][fragment]  COLOR by BARY, and by the tangents of base colours: BASE
///                      where DPR_BASE says so, else, where the corners' colours move, COLOR as shade_tangent has it
kernel void shade_lit_tangent(const FrameParams p, const LightingParams lp, const TangentParams q,
                              global const ViewParams* restrict views, global const Light* restrict lights,
                              global const uint4* restrict faces, global const float4* restrict colors,
                              global const float4* restrict world, global const float4* restrict materials,
                              global const uint* restrict pair_face,
                              global const uint* restrict fragment_starts,
                              global const float4* restrict world_tangents,
                              global const float* restrict fragments, global float* restrict tangents) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= p.last_pair) return;
  const uint view_face = pair_face[pair];
  lights += first_light(p, lp, view_face);
  const Surface s = load_surface(p, lp, view_face, views, lights, faces, colors, world, materials);
  const uint last = fragment_starts[pair + 1], bary = DPR_GRAD_PLANE(p, BARY),
             color = DPR_GRAD_PLANE(p, COLOR), plane = p.grad_fragments;
  for (uint i = fragment_starts[pair]; i < last; i += DPR_WIDTH) {
    const intn in_run = lanes_before(last, i);
    const realn c1 = load_run(in_run, i + DPR_PLANE(p, BARY), fragments),
                c2 = load_run(in_run, i + DPR_PLANE(p, BARY) + p.fragments, fragments);
    const Shaded f = shade_fragment(s, lp, lights, c1, c2, load_base(p, in_run, i, fragments));
#pragma unroll 1
    for (int first = 0; first < 3; first += DPR_CHANNELS_AT_ONCE) {
      LitPoints row[DPR_CHANNELS_AT_ONCE];
      rows_of_points(s, lp, lights, f.at, c1, c2, first, row);
#pragma unroll 1
      for (uint d = 0; d < q.directions; ++d) {
        global float* const of = tangents + (size_t)d * q.planes * plane;
        const realn moved1 = load_run(in_run, i + bary, of), moved2 = load_run(in_run, i + bary + plane, of);
        const Vec3n base = DPR_BASE == DPR_BASE_OF_FRAGMENTS
                               ? load_run3(in_run, i + DPR_TANGENT_PLANE_BASE * plane, plane, of)
                               : along_corners(s.color, moved1, moved2);
        Vec3n of_light = zero3n();
        if (DPR_SHADING == DPR_GOURAUD) {
          of_light = mul3n(f.at.base, along_corners(s.factor, moved1, moved2));
          of_light = mad3n(mul3n(splat3(s.material), along_corners(s.specular, moved1, moved2)),
                           (realn)(1.0f), of_light);
        }
        const LitPoints moved =
            moved_points(s, f.at, load_place_tangent(p, d, view_face, faces, world, world_tangents), c1, c2,
                         moved1, moved2);
#pragma unroll
        for (int k = 0; k < DPR_CHANNELS_AT_ONCE; ++k) {
          const uint out = color + (uint)(first + k) * plane;
          const int has_own = DPR_BASE == DPR_BASE_OF_CORNERS && q.colors != 0;
          const realn of_base =
              has_own ? load_own_run(last + out, i + out, of) : channel_of(base, (uint)(first + k));
          store_run(channel_of(f.lit.factor, (uint)(first + k)) * of_base +
                        channel_of(of_light, (uint)(first + k)) + along_points(row[k], moved),
                    i + out, last + out, of);
        }
      }
    }
  }
}
