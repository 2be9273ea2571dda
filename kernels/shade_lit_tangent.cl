// Tangents of lit colours: each channel by all that it is made of, times the tangents of that. Options as
// shade_lit.cl has them.
#include "face_normal.h"
#include "lit_backward.h"

/// The derivatives of one channel of the colour.
typedef struct {
  realn bary1, bary2;
  Vec3n base;
  MaterialGradients material;
  PlaceGradients place;
} ChannelRow;

static inline ChannelRow channel_row(const Surface s, const LightingParams lp,
                                     global const Light* restrict lights, LitFragment f, int channel) {
  ChannelRow row;
  row.material = no_material_gradients();
  row.place = no_place_gradients();
  const realn one = 1.0f, none = 0.0f;
  f.grad = make_vec3n(channel == 0 ? one : none, channel == 1 ? one : none, channel == 2 ? one : none);
  row.base = material_backward(s, lp, lights, f, &row.material, &row.bary1, &row.bary2);
  if (DPR_SHADING == DPR_GOURAUD) {
    corners_backward(s, lp, lights, row.material, &row.place);
  } else {
    realn b1, b2;
    place_backward(s, lp, lights, f, &row.place, &b1, &b2);
    row.bary1 += b1;
    row.bary2 += b2;
  }
  return row;
}

/// The tangents of a triangle's corners in a direction.
typedef struct {
  Vec3n color[3], position[3], normal[3], eye;
} SurfaceTangent;

static inline SurfaceTangent load_surface_tangent(const FrameParams p, uint direction, uint moved_colors,
                                                  uint view_face, global const uint4* faces,
                                                  global const float4* world,
                                                  global const ViewTangent* view_tangents,
                                                  global const float4* world_tangents,
                                                  global const float4* color_tangents) {
  const uint view = view_face / p.faces;
  faces += view_face - view * p.faces;
  const uint4 f = faces[0], c = faces[p.color_faces] + view * p.color_stride, n = faces[p.normal_faces];
  const uint vertex[3] = {f.x, f.y, f.z}, color[3] = {c.x, c.y, c.z}, normal[3] = {n.x, n.y, n.z};
  world_tangents += (size_t)direction * p.views * (p.vertices + p.normals);
  global const float4 *positions = world_tangents + view * p.vertices,
                      *normals = world_tangents + p.views * p.vertices + view * p.normals;
  float4 flat = 0.0f;
  if (DPR_SHADING == DPR_FLAT) {
    global const float4* corners = world + view * p.vertices;
    const float4 unit = flat_normal(corners[f.x], corners[f.y], corners[f.z]);
    const float3 moved = face_normal_tangent(corners, positions, f);
    if (unit.w > DPR_MIN_LENGTH) flat = (float4)((moved - unit.xyz * dot(unit.xyz, moved)) / unit.w, 0.0f);
  }
  SurfaceTangent t;
  t.eye = splat3(view_tangents[direction * p.views + view].eye);
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    t.position[k] = splat3(positions[vertex[k]]);
    t.normal[k] = splat3(DPR_SHADING == DPR_FLAT ? flat : normals[normal[k]]);
    t.color[k] =
        moved_colors != 0 ? splat3(color_tangents[(size_t)direction * moved_colors + color[k]]) : zero3n();
  }
  return t;
}

/// Tangents of colours by those of barycentrics, base colours, the corners and the eye. One work-item per pair,
/// up to p.last_pair. Deterministic. Inputs as shade_lit_forward, and
/// in   moved_colors, color_tangents  as shade_tangent has them
/// in   view_tangents   ViewTangent[direction][view]
/// in   world_tangents  float4[direction][the length of world]
/// in out  tangents     float[direction][planes][fragment]  COLOR by BARY, and by the base colours where DPR_BASE
///                      says so
kernel void shade_lit_tangent(const FrameParams p, const LightingParams lp, const uint directions,
                              const uint planes, const uint moved_colors, global const uint* restrict pairs,
                              global const ViewParams* restrict views, global const Light* restrict lights,
                              global const uint4* restrict faces, global const float4* restrict colors,
                              global const float4* restrict world, global const float4* restrict materials,
                              global const uint* restrict pair_face,
                              global const uint* restrict fragment_starts,
                              global const float4* restrict color_tangents,
                              global const ViewTangent* restrict view_tangents,
                              global const float4* restrict world_tangents,
                              global const float* restrict fragments, global float* restrict tangents) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(p.last_pair, pairs[0])) return;
  const uint view_face = pair_face[pair];
  const Surface s = load_surface(p, lp, view_face, views, lights, faces, colors, world, materials);
  const uint last = fragment_starts[pair + 1], bary = DPR_GRAD_PLANE(p, BARY);
  for (uint i = fragment_starts[pair]; i < last; i += DPR_WIDTH) {
    const intn in_run = lanes_before(last, i);
    LitFragment f;
    f.c1 = load_run(in_run, i + DPR_PLANE(p, BARY), fragments);
    f.c2 = load_run(in_run, i + DPR_PLANE(p, BARY) + p.fragments, fragments);
    f.base = load_base(p, in_run, i, fragments);
    for (int channel = 0; channel < 3; ++channel) {
      const ChannelRow row = channel_row(s, lp, lights, f, channel);
      for (uint d = 0; d < directions; ++d) {
        global float* const of = tangents + (size_t)d * planes * p.grad_fragments;
        const SurfaceTangent t = load_surface_tangent(p, d, moved_colors, view_face, faces, world,
                                                      view_tangents, world_tangents, color_tangents);
        realn sum = row.bary1 * load_run(in_run, i + bary, of) +
                    row.bary2 * load_run(in_run, i + bary + p.grad_fragments, of) +
                    dot3n(row.place.eye, t.eye);
        if (DPR_BASE == DPR_BASE_OF_FRAGMENTS)
          sum += dot3n(row.base, load_run3(in_run, i + DPR_TANGENT_PLANE_BASE * p.grad_fragments,
                                           p.grad_fragments, of));
#pragma unroll
        for (int k = 0; k < 3; ++k) {
          sum += dot3n(row.place.position[k], t.position[k]) + dot3n(row.place.normal[k], t.normal[k]);
          if (DPR_BASE == DPR_BASE_OF_CORNERS) sum += dot3n(row.material.color[k], t.color[k]);
        }
        const uint out = DPR_GRAD_PLANE(p, COLOR) + (uint)channel * p.grad_fragments;
        store_run(sum, i + out, last + out, of);
      }
    }
  }
}
