// Base colours of the fragments of textured scenes: the corners' colours, interpolated, times the texture.
// Shading interpolates the colours itself where no mesh has a texture.
#include "surface_texels.h"

/// One work-item per pair, up to p.last_pair. Deterministic.
/// in   pairs            uint[1]         how many there are
/// in   pair_face        uint[pair]      view * faces + face
/// in   fragment_starts  uint[pair + 1]  runs of fragments
/// in   faces            uint4[...][face]  of SurfaceScene
/// in   colors           float4[color] or, with a stride, float4[view][color]  linear RGB; w unused
/// in   texcoords        float4[texcoord]  u, v
/// in   textures         Texture[texture]
/// in   texels           float4[texel]   linear RGB, every level; w unused
/// in   triangles        Triangle[view][face]
/// in   clipped          ClippedFace[view][face]  read where p.clips is set
/// in out  fragments     float[plane][fragment]  BASE by BARY where p.has_base is set, else COLOR
kernel void surface_forward(const FrameParams p, global const uint* restrict pairs,
                            global const uint* restrict pair_face,
                            global const uint* restrict fragment_starts, global const uint4* restrict faces,
                            global const float4* restrict colors, global const float4* restrict texcoords,
                            global const Texture* restrict textures, global const float4* restrict texels,
                            global const Triangle* restrict triangles,
                            global const ClippedFace* restrict clipped, global float* restrict fragments) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(p.last_pair, pairs[0])) return;
  const uint first = fragment_starts[pair], last = fragment_starts[pair + 1];
  if (first == last) return;
  const SurfaceScene scene = {faces, colors, texcoords, textures, triangles, clipped};
  const TexturedFace face = load_face(scene, p, pair_face[pair]);
  const uint red = p.has_base ? DPR_PLANE(p, BASE) : DPR_PLANE(p, COLOR);
  for (uint i = first; i < last; ++i) {
    const float c1 = fragments[i + DPR_PLANE(p, BARY)], c2 = fragments[i + DPR_PLANE(p, BARY) + p.fragments];
    const float4 base = base_of_corners(&face, c1, c2) *
                        sample_face(&face, find_detail(p, &face, c1, c2), c1, c2, texels).color;
    fragments[i + red] = base.x;
    fragments[i + red + p.fragments] = base.y;
    fragments[i + red + 2 * p.fragments] = base.z;
  }
}

/// One work-item per pair, up to p.last_pair. Deterministic. Inputs as surface_forward, and
/// in out  grads  float[plane][fragment]  of BARY by that of the base colours; where p.has_base is set, added
///                to what the light has left
/// out  grad_pairs  DPR_PAIR_COLORS: RGB of the corners' colours, summed over the pair's fragments;
///                  DPR_PAIR_TEXCOORDS: u, v of the corners, and 0; DPR_PAIR_STEPS: of the levels of detail's
///                  q_k along x, along y, and depths; not written for faces whose texture has one level
kernel void surface_backward(const FrameParams p, global const uint* restrict pairs,
                             global const uint* restrict pair_face,
                             global const uint* restrict fragment_starts, global const uint4* restrict faces,
                             global const float4* restrict colors, global const float4* restrict texcoords,
                             global const Texture* restrict textures, global const float4* restrict texels,
                             global const Triangle* restrict triangles,
                             global const ClippedFace* restrict clipped,
                             global const float* restrict fragments, global float* restrict grads,
                             global float* restrict grad_pairs) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(p.last_pair, pairs[0])) return;
  const SurfaceScene scene = {faces, colors, texcoords, textures, triangles, clipped};
  const TexturedFace face = load_face(scene, p, pair_face[pair]);
  float3 color[3] = {0.0f, 0.0f, 0.0f};
  PlaceSums sums = {{0.0f, 0.0f, 0.0f}, {0.0f, 0.0f, 0.0f}};
  for (uint i = fragment_starts[pair]; i < fragment_starts[pair + 1]; ++i) {
    const float c1 = fragments[i + DPR_PLANE(p, BARY)], c2 = fragments[i + DPR_PLANE(p, BARY) + p.fragments],
                c0 = 1.0f - c1 - c2;
    const Detail detail = find_detail(p, &face, c1, c2);
    const Sample sample = sample_face(&face, detail, c1, c2, texels);
    const float3 grad = load_planes(i + base_plane(p), p.grad_fragments, grads);
    const float3 grad_color = grad * sample.color.xyz,
                 grad_sample = grad * base_of_corners(&face, c1, c2).xyz;
    const float2 grad_place = (float2)(dot(grad_sample, sample.by_x.xyz), dot(grad_sample, sample.by_y.xyz));
    float along1 = dot(grad_color, face.color1.xyz), along2 = dot(grad_color, face.color2.xyz);
    add_fragment(&face, detail, c1, c2, grad_place, dot(grad_sample, sample.by_detail.xyz), &sums, &along1,
                 &along2);
    const uint at1 = i + DPR_GRAD_PLANE(p, BARY), at2 = at1 + p.grad_fragments;
    grads[at1] = p.has_base ? grads[at1] + along1 : along1;
    grads[at2] = p.has_base ? grads[at2] + along2 : along2;
    color[0] += c0 * grad_color;
    color[1] += c1 * grad_color;
    color[2] += c2 * grad_color;
  }
  finish_steps(&face, &sums);
  for (size_t k = 0; k < 3; ++k) {
    vstore3(color[k], k, grad_pairs + DPR_PAIR_COLORS * (size_t)p.pairs + 9 * pair);
    vstore3(place_gradient(sums, k), k, grad_pairs + DPR_PAIR_TEXCOORDS * (size_t)p.pairs + 9 * pair);
    if (face.texture.levels > 1)
      vstore3(sums.steps[k], k, grad_pairs + DPR_PAIR_STEPS * (size_t)p.pairs + 9 * pair);
  }
}

/// From the q_k along an axis to the corners of a whole triangle on the screen, whose depths have their own.
static inline void add_to_corners(const Triangle t, float3 depth, int along_y, float3 grad_q,
                                  float3 corner[3]) {
  const float inverse_area = is_sliver(t) ? 0.0f : 1.0f / doubled_area(t);
  const float3 of_step = grad_q * inverse_area / depth;
  const float of_area = -inverse_area * dot(of_step, screen_steps(t, along_y));
  const float3 turned = of_step.zxy - of_step.yzx, by_x = screen_steps(t, 0), by_y = screen_steps(t, 1);
  // The doubled area changes with x and y as the steps along y and x say, exchanged.
  const float3 x = of_area * by_x - (along_y ? turned : (float3)(0.0f)),
               y = of_area * by_y + (along_y ? (float3)(0.0f) : turned);
  corner[0].xy += (float2)(x.x, y.x);
  corner[1].xy += (float2)(x.y, y.y);
  corner[2].xy += (float2)(x.z, y.z);
}

/// To the homogeneous corners of a clipped face.
static inline void add_to_clipped_corners(const ClippedFace c, int along_y, float3 grad_q, float3 corner[3]) {
  const float inverse = 1.0f / determinant(c);
  const float of_step[3] = {grad_q.x * inverse, grad_q.y * inverse, grad_q.z * inverse};
  float of_determinant = 0.0f;
  for (int k = 0; k < 3; ++k) {
    const float3 step = cofactor(c, k);
    of_determinant -= inverse * of_step[k] * (along_y ? step.y : step.x);
  }
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    const float3 of_cofactor = along_y ? (float3)(0.0f, of_step[k], 0.0f) : (float3)(of_step[k], 0.0f, 0.0f);
    corner[k] += of_determinant * cofactor(c, k);
    corner[i] += cross(c.corner[j].xyw, of_cofactor);
    corner[j] += cross(of_cofactor, c.corner[i].xyw);
  }
}

/// From the gradients of a level of detail's q_k along an axis to the corners, homogeneous of a clipped face.
static inline void add_axis_to_corners(const FrameParams p, uint view_face, int is_clipped, int along_y,
                                       float3 grad_q, global const Triangle* triangles,
                                       global const ClippedFace* clipped, float3 corner[3]) {
  if (is_clipped) {
    add_to_clipped_corners(clipped[view_face], along_y, grad_q, corner);
  } else {
    const Triangle t = triangles[view_face];
    const float3 depths = p.perspective_correct ? (float3)(t.z0, t.z1, t.z2) : (float3)(1.0f);
    add_to_corners(t, depths, along_y, grad_q, corner);
  }
}

/// From the levels of detail to the corners on the screen: what a triangle that turns or goes away does to
/// the texture's sharpness. One work-item per pair, up to p.last_pair. Deterministic.
/// in   pairs, pair_face, faces, textures, triangles, clipped  as surface_forward has them
/// in   grad_pairs     as surface_backward leaves them
/// in out  grad_corners  float[pair][9]  x, y (NDC) and view depth of the corners
/// in out  grad_clip     float[pair][9]  of the homogeneous corners of clipped faces, if p.clips is set
kernel void surface_detail_backward(const FrameParams p, global const uint* restrict pairs,
                                    global const uint* restrict pair_face, global const uint4* restrict faces,
                                    global const Texture* restrict textures,
                                    global const Triangle* restrict triangles,
                                    global const ClippedFace* restrict clipped,
                                    global const float* restrict grad_pairs,
                                    global float* restrict grad_corners, global float* restrict grad_clip) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(p.last_pair, pairs[0])) return;
  const uint view_face = pair_face[pair], texture = faces[p.texcoord_faces + row_of_face(p, view_face)].w;
  global const float* const grad_steps = grad_pairs + DPR_PAIR_STEPS * (size_t)p.pairs + 9 * pair;
  if (texture == DPR_NO_TEXTURE || textures[texture].levels == 1) return;
  const float3 depth = vload3(2, grad_steps);
  const int is_clipped = p.clips && clipped[view_face].corners != 0;
  float3 corner[3] = {0.0f, 0.0f, 0.0f};
  if (is_clipped || p.perspective_correct) {
    corner[0].z = depth.x;
    corner[1].z = depth.y;
    corner[2].z = depth.z;
  }
  for (int along_y = 0; along_y < 2; ++along_y) {
    add_axis_to_corners(p, view_face, is_clipped, along_y, vload3((size_t)along_y, grad_steps), triangles,
                        clipped, corner);
  }
  if (p.orthographic) corner[0].z = corner[1].z = corner[2].z = 0.0f;  // nothing is divided by depths
  global float* grad = (is_clipped ? grad_clip : grad_corners) + 9 * pair;
  for (int k = 0; k < 3; ++k) vstore3(vload3((size_t)k, grad) + corner[k], (size_t)k, grad);
}

/// Lists each fragment's texels: a cell, which is a texel and its neighbours to the right and
/// below, and the parts of these. Sorted by cell, fragments are added up without atomics. One work-item per
/// pair, up to p.last_pair. Inputs as surface_backward, and
/// out  cells  uint[fragment][p.levels]        the first of the cell's texels; p.texels without texture
/// out  seen   SeenTexels[fragment][p.levels]  without the tile
kernel void surface_list(const FrameParams p, global const uint* restrict pairs,
                         global const uint* restrict pair_face, global const uint* restrict fragment_starts,
                         global const uint4* restrict faces, global const float4* restrict colors,
                         global const float4* restrict texcoords, global const Texture* restrict textures,
                         global const Triangle* restrict triangles,
                         global const ClippedFace* restrict clipped, global const float* restrict fragments,
                         global const float* restrict grads, global uint* restrict cells,
                         global SeenTexels* restrict seen) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(p.last_pair, pairs[0])) return;
  const SurfaceScene scene = {faces, colors, texcoords, textures, triangles, clipped};
  const TexturedFace face = load_face(scene, p, pair_face[pair]);
  for (uint i = fragment_starts[pair]; i < fragment_starts[pair + 1]; ++i) {
    const float c1 = fragments[i + DPR_PLANE(p, BARY)], c2 = fragments[i + DPR_PLANE(p, BARY) + p.fragments];
    const Detail detail = find_detail(p, &face, c1, c2);
    const float3 grad =
        load_planes(i + base_plane(p), p.grad_fragments, grads) * base_of_corners(&face, c1, c2).xyz;
    list_fragment(p, &face, detail, i, c1, c2, grad, cells, seen);
  }
}

/// Says where what surface_list leaves lies. One work-item per place: a fragment's, of a level.
/// in   fragment_starts  uint[pair + 1]   up to p.last_pair: its last is the number of fragments
/// in   fragment_pair    uint[fragment]
/// in   pair_tile        uint[pair]       view * tiles + tile
/// out  places           uint[1]          how many there are
/// out  seen             SeenTexels[place]  the tile
kernel void surface_place(const FrameParams p, global const uint* restrict fragment_starts,
                          global const uint* restrict fragment_pair, global const uint* restrict pair_tile,
                          global uint* restrict places, global SeenTexels* restrict seen) {
  const uint i = (uint)get_global_id(0), last = p.levels * fragment_starts[p.last_pair];
  if (i == 0) places[0] = last;
  if (i < last) seen[i].tile = pair_tile[fragment_pair[i / p.levels]];
}

/// Tangents of base colours by those of barycentrics and of the corners' colours. One work-item per
/// pair, up to p.last_pair. Deterministic. Inputs as surface_forward, and
/// in   color_tangents  as shade_tangent has them
/// in out  tangents     float[direction][planes][fragment]  of the base colours by BARY; then, where textures have
///                      levels, float[3][fragment]  derivatives of the base colours with respect to these
kernel void surface_tangent(const FrameParams p, const TangentParams q, global const uint* restrict pair_face,
                            global const uint* restrict fragment_starts, global const uint4* restrict faces,
                            global const float4* restrict colors, global const float4* restrict texcoords,
                            global const Texture* restrict textures, global const float4* restrict texels,
                            global const Triangle* restrict triangles,
                            global const ClippedFace* restrict clipped,
                            global const float4* restrict color_tangents,
                            global const float* restrict fragments, global float* restrict tangents) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= p.last_pair) return;
  const uint first = fragment_starts[pair], last = fragment_starts[pair + 1];
  if (first == last) return;
  const SurfaceScene scene = {faces, colors, texcoords, textures, triangles, clipped};
  const uint view_face = pair_face[pair], view = view_face / p.faces;
  const uint4 color = faces[p.color_faces + row_of_face(p, view_face)] + view * p.color_stride;
  const TexturedFace face = load_face(scene, p, view_face);
  for (uint i = first; i < last; ++i) {
    const float c1 = fragments[i + DPR_PLANE(p, BARY)], c2 = fragments[i + DPR_PLANE(p, BARY) + p.fragments];
    const Detail detail = find_detail(p, &face, c1, c2);
    const Sample sample = sample_face(&face, detail, c1, c2, texels);
    const float3 base = base_of_corners(&face, c1, c2).xyz, by_corners = sample.color.xyz;
    if (face.texture.levels > 1)
      store_planes(base * sample.by_detail.xyz, i, p.grad_fragments, details_of(p, q, tangents));
    const float3 by_x = base * sample.by_x.xyz, by_y = base * sample.by_y.xyz;
    const float3 by_b1 = by_corners * face.color1.xyz + face.place1.x * by_x + face.place1.y * by_y;
    const float3 by_b2 = by_corners * face.color2.xyz + face.place2.x * by_x + face.place2.y * by_y;
    for (uint d = 0; d < q.directions; ++d) {
      global float* const of = tangents + (size_t)d * q.planes * p.grad_fragments + i;
      float3 moved =
          of[DPR_GRAD_PLANE(p, BARY)] * by_b1 + of[DPR_GRAD_PLANE(p, BARY) + p.grad_fragments] * by_b2;
      if (q.colors != 0) {
        global const float4* const colored = color_tangents + (size_t)d * q.colors;
        moved += by_corners *
                 ((1.0f - c1 - c2) * colored[color.x] + c1 * colored[color.y] + c2 * colored[color.z]).xyz;
      }
      store_planes(moved, q.base_plane * p.grad_fragments, p.grad_fragments, of);
    }
  }
}

/// The derivatives of a level of detail by the barycentrics of corners 1 and 2, and by the corners: x, y (NDC)
/// and view depth, or homogeneous of a clipped face. Places in the texture stay.
typedef struct {
  float bary1, bary2;
  float3 corner[3];
} DetailRow;

static inline DetailRow detail_row(const FrameParams p, const TexturedFace* f, const Detail d, float c1,
                                   float c2, uint view_face, global const Triangle* triangles,
                                   global const ClippedFace* clipped) {
  const DetailGradient g = detail_backward(f, d, c1, c2, d.by_step);
  const float3 none = 0.0f, by_q = depths_by_steps(f, d.along_y ? none : g.q, d.along_y ? g.q : none);
  const float3 depth = p.orthographic || !(f->is_clipped || p.perspective_correct) ? none : g.depth + by_q;
  DetailRow row = {g.bary1, g.bary2, {{0.0f, 0.0f, depth.x}, {0.0f, 0.0f, depth.y}, {0.0f, 0.0f, depth.z}}};
  add_axis_to_corners(p, view_face, f->is_clipped, d.along_y, g.q, triangles, clipped, row.corner);
  if (p.orthographic) row.corner[0].z = row.corner[1].z = row.corner[2].z = 0.0f;
  return row;
}

/// Adds the part of levels of detail, which depend on barycentrics and corners, to the tangents of base colours.
/// One work-item per pair, up to p.last_pair. Deterministic. Inputs as surface_tangent, and
/// in   vertices        float4[direction][view][vertex]  tangents of x, y (NDC) and view depth
/// in   clip_vertices   the same of homogeneous coordinates, read where p.clips is set
/// in out  tangents     float[direction][planes][fragment]  the base colours, and BARY
kernel void surface_detail_tangent(
    const FrameParams p, const TangentParams q, global const uint* restrict pair_face,
    global const uint* restrict fragment_starts, global const uint4* restrict faces,
    global const float4* restrict colors, global const float4* restrict texcoords,
    global const Texture* restrict textures, global const Triangle* restrict triangles,
    global const ClippedFace* restrict clipped, global const float4* restrict vertices,
    global const float4* restrict clip_vertices, global const float* restrict fragments,
    global float* restrict tangents) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= p.last_pair) return;
  const SurfaceScene scene = {faces, colors, texcoords, textures, triangles, clipped};
  const uint view_face = pair_face[pair], view = view_face / p.faces, last = fragment_starts[pair + 1];
  const uint4 corner = faces[row_of_face(p, view_face)];
  const TexturedFace face = load_face(scene, p, view_face);
  if (face.texture.levels == 1) return;
  global const float4* const vertices_of = face.is_clipped ? clip_vertices : vertices;
  for (uint i = fragment_starts[pair]; i < last; ++i) {
    const float c1 = fragments[i + DPR_PLANE(p, BARY)], c2 = fragments[i + DPR_PLANE(p, BARY) + p.fragments];
    const Detail detail = find_detail(p, &face, c1, c2);
    if (!detail.varies) continue;
    const DetailRow row = detail_row(p, &face, detail, c1, c2, view_face, triangles, clipped);
    const float3 by_detail = load_planes(i, p.grad_fragments, details_of(p, q, tangents));
#pragma unroll 1
    for (uint d = 0; d < q.directions; ++d) {
      global float* const of = tangents + (size_t)d * q.planes * p.grad_fragments + i;
      global const float4* const move = vertices_of + (size_t)(d * p.views + view) * p.vertices;
      const float moved = row.bary1 * of[DPR_GRAD_PLANE(p, BARY)] +
                          row.bary2 * of[DPR_GRAD_PLANE(p, BARY) + p.grad_fragments] +
                          dot(row.corner[0], move[corner.x].xyz) + dot(row.corner[1], move[corner.y].xyz) +
                          dot(row.corner[2], move[corner.z].xyz);
      const uint red = q.base_plane * p.grad_fragments;
      store_planes(load_planes(red, p.grad_fragments, of) + moved * by_detail, red, p.grad_fragments, of);
    }
  }
}
