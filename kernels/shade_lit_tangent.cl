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

/// The channels' derivatives, of a colour at these weights of corners 1 and 2.
static inline void rows_of_points(const Surface s, const LightingParams lp,
                                  global const Light* restrict lights, const SurfacePoint at, realn c1,
                                  realn c2, LitPoints row[3]) {
#pragma unroll
  for (int channel = 0; channel < 3; ++channel) row[channel].eye = zero3n();
#pragma unroll
  for (int k = 0; k < DPR_LIT_POINTS; ++k) {
    PointGradient g[3];
#pragma unroll
    for (int channel = 0; channel < 3; ++channel) {
      g[channel] = zero_point_gradient();
      g[channel].eye = row[channel].eye;
    }
    if (DPR_SHADING == DPR_GOURAUD) {
      const realn share = k == 0 ? 1.0f - c1 - c2 : k == 1 ? c1 : c2;
      light_point_rows(lp, lights, s.material.w, s.eye, s.position[k], s.normal[k], scale3n(at.base, share),
                       scale3n(splat3(s.material), share), g);
    } else {
      light_point_rows(lp, lights, s.material.w, s.eye, at.position, at.normal, at.base, splat3(s.material),
                       g);
    }
#pragma unroll
    for (int channel = 0; channel < 3; ++channel) {
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
  faces += view_face - view * p.faces;
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
  const Surface s = load_surface(p, lp, view_face, views, lights, faces, colors, world, materials);
  const uint last = fragment_starts[pair + 1], bary = DPR_GRAD_PLANE(p, BARY),
             color = DPR_GRAD_PLANE(p, COLOR), plane = p.grad_fragments;
  for (uint i = fragment_starts[pair]; i < last; i += DPR_WIDTH) {
    const intn in_run = lanes_before(last, i);
    const realn c1 = load_run(in_run, i + DPR_PLANE(p, BARY), fragments),
                c2 = load_run(in_run, i + DPR_PLANE(p, BARY) + p.fragments, fragments);
    const Shaded f = shade_fragment(s, lp, lights, c1, c2, load_base(p, in_run, i, fragments));
    LitPoints row[3];
    rows_of_points(s, lp, lights, f.at, c1, c2, row);
#pragma unroll 1
    for (uint d = 0; d < q.directions; ++d) {
      global float* const of = tangents + (size_t)d * q.planes * plane;
      const realn moved1 = load_run(in_run, i + bary, of), moved2 = load_run(in_run, i + bary + plane, of);
      Vec3n base;
      if (DPR_BASE == DPR_BASE_OF_FRAGMENTS) {
        base = load_run3(in_run, i + DPR_TANGENT_PLANE_BASE * plane, plane, of);
      } else if (q.colors != 0) {
        base = make_vec3n(load_own_run(last + color, i + color, of),
                          load_own_run(last + color + plane, i + color + plane, of),
                          load_own_run(last + color + 2 * plane, i + color + 2 * plane, of));
      } else {
        base = along_corners(s.color, moved1, moved2);
      }
      Vec3n sum = mul3n(f.lit.factor, base);
      if (DPR_SHADING == DPR_GOURAUD) {
        const Vec3n factor = along_corners(s.factor, moved1, moved2),
                    specular = along_corners(s.specular, moved1, moved2);
        sum = mad3n(mul3n(f.at.base, factor), (realn)(1.0f), sum);
        sum = mad3n(mul3n(splat3(s.material), specular), (realn)(1.0f), sum);
      }
      const LitPoints moved = moved_points(
          s, f.at, load_place_tangent(p, d, view_face, faces, world, world_tangents), c1, c2, moved1, moved2);
      store_run3(sum.x + along_points(row[0], moved), sum.y + along_points(row[1], moved),
                 sum.z + along_points(row[2], moved), i, last, color, plane, of);
    }
  }
}
