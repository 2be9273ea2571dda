// Forward mode of shade_lit.cl, with its options: the derivatives of each channel of the colour with respect to
// all that it is made of, times the tangents of these.
#include "face_normal.h"
#include "lit_backward.h"
#include "world_tangents.h"

/// The gradient of one channel of the colour, on all lanes.
static inline Vec3n unit_gradient(int channel) {
  const realn one = 1.0f, none = 0.0f;
  return make_vec3n(channel == 0 ? one : none, channel == 1 ? one : none, channel == 2 ? one : none);
}

/// The derivatives of a channel of the colour by where the surface lies.
static inline PlaceGradients place_row(const Surface s, const LightingParams lp,
                                       global const Light* restrict lights, const LitFragment f, realn* bary1,
                                       realn* bary2) {
  PlaceGradients row = no_place_gradients();
  *bary1 = *bary2 = 0.0f;
  if (DPR_SHADING == DPR_GOURAUD) {
    MaterialGradients of_corners = no_material_gradients();
    realn b1, b2;
    material_backward(s, lp, lights, f, &of_corners, &b1, &b2);
    corners_backward(s, lp, lights, of_corners, &row);
  } else {
    place_backward(s, lp, lights, f, &row, bary1, bary2);
  }
  return row;
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

/// A vector of fragments, for the gradient of one channel.
static inline LitFragment load_of_channel(const FrameParams p, intn in_run, uint i, int channel,
                                          global const float* fragments) {
  const LitFragment f = {load_run(in_run, i + DPR_PLANE(p, BARY), fragments),
                         load_run(in_run, i + DPR_PLANE(p, BARY) + p.fragments, fragments),
                         load_base(p, in_run, i, fragments), unit_gradient(channel)};
  return f;
}

/// Tangents of colours by those of what the surface is made of: barycentrics, base colours and the corners'. One
/// work-item per pair, up to p.last_pair. Deterministic. Inputs as shade_lit_forward, and
/// in   color_tangents  as shade_tangent has them
/// in out  tangents     float[direction][planes][fragment]  COLOR by BARY, and by the base colours where DPR_BASE
///                      says so
kernel void shade_lit_tangent(const FrameParams p, const LightingParams lp, const TangentParams q,
                              global const ViewParams* restrict views, global const Light* restrict lights,
                              global const uint4* restrict faces, global const float4* restrict colors,
                              global const float4* restrict world, global const float4* restrict materials,
                              global const uint* restrict pair_face,
                              global const uint* restrict fragment_starts,
                              global const float4* restrict color_tangents,
                              global const float* restrict fragments, global float* restrict tangents) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= p.last_pair) return;
  const uint view_face = pair_face[pair], view = view_face / p.faces;
  const Surface s = load_surface(p, lp, view_face, views, lights, faces, colors, world, materials);
  const uint4 color = faces[p.color_faces + view_face - view * p.faces] + view * p.color_stride;
  const uint last = fragment_starts[pair + 1], bary = DPR_GRAD_PLANE(p, BARY);
  for (uint i = fragment_starts[pair]; i < last; i += DPR_WIDTH) {
    const intn in_run = lanes_before(last, i);
#pragma unroll 1
    for (int channel = 0; channel < 3; ++channel) {
      MaterialGradients row = no_material_gradients();
      realn bary1, bary2;
      const Vec3n base = material_backward(s, lp, lights, load_of_channel(p, in_run, i, channel, fragments),
                                           &row, &bary1, &bary2);
      for (uint d = 0; d < q.directions; ++d) {
        global float* const of = tangents + (size_t)d * q.planes * p.grad_fragments;
        realn sum = bary1 * load_run(in_run, i + bary, of) +
                    bary2 * load_run(in_run, i + bary + p.grad_fragments, of);
        if (DPR_BASE == DPR_BASE_OF_FRAGMENTS)
          sum += dot3n(
              base, load_run3(in_run, i + DPR_TANGENT_PLANE_BASE * p.grad_fragments, p.grad_fragments, of));
        if (DPR_BASE == DPR_BASE_OF_CORNERS && q.colors != 0) {
          global const float4* const moved = color_tangents + (size_t)d * q.colors;
          sum += dot3n(row.color[0], splat3(moved[color.x])) + dot3n(row.color[1], splat3(moved[color.y])) +
                 dot3n(row.color[2], splat3(moved[color.z]));
        }
        const uint out = DPR_GRAD_PLANE(p, COLOR) + (uint)channel * p.grad_fragments;
        store_run(sum, i + out, last + out, of);
      }
    }
  }
}

/// Adds the part of the place of the surface: of barycentrics, corners and the eye, by the light. One work-item per
/// pair, up to p.last_pair; one launch for each channel of the colour, for want of registers. Deterministic.
/// Inputs as shade_lit_tangent, and
/// in   world_tangents  as transform_tangent and normals.cl leave them
/// in out  tangents     float[direction][planes][fragment]  COLOR
kernel void shade_lit_place_tangent(const FrameParams p, const LightingParams lp, const TangentParams q,
                                    global const ViewParams* restrict views,
                                    global const Light* restrict lights, global const uint4* restrict faces,
                                    global const float4* restrict colors, global const float4* restrict world,
                                    global const float4* restrict materials,
                                    global const uint* restrict pair_face,
                                    global const uint* restrict fragment_starts,
                                    global const float4* restrict world_tangents,
                                    global const float* restrict fragments, global float* restrict tangents) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= p.last_pair) return;
  const uint view_face = pair_face[pair];
  const Surface s = load_surface(p, lp, view_face, views, lights, faces, colors, world, materials);
  const uint last = fragment_starts[pair + 1], bary = DPR_GRAD_PLANE(p, BARY);
  for (uint i = fragment_starts[pair]; i < last; i += DPR_WIDTH) {
    const intn in_run = lanes_before(last, i);
    realn bary1, bary2;
    const PlaceGradients row =
        place_row(s, lp, lights, load_of_channel(p, in_run, i, (int)q.channel, fragments), &bary1, &bary2);
#pragma unroll 1
    for (uint d = 0; d < q.directions; ++d) {
      global float* const of = tangents + (size_t)d * q.planes * p.grad_fragments;
      const PlaceTangent t = load_place_tangent(p, d, view_face, faces, world, world_tangents);
      realn sum = bary1 * load_run(in_run, i + bary, of) +
                  bary2 * load_run(in_run, i + bary + p.grad_fragments, of) + dot3n(row.eye, t.eye);
#pragma unroll
      for (int k = 0; k < 3; ++k)
        sum += dot3n(row.position[k], t.position[k]) + dot3n(row.normal[k], t.normal[k]);
      const uint out = DPR_GRAD_PLANE(p, COLOR) + q.channel * p.grad_fragments;
      store_run(load_own_run(last + out, i + out, of) + sum, i + out, last + out, of);
    }
  }
}
