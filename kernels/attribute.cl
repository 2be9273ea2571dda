// Images of attributes (include/dpr/attribute_images.hpp): their alpha in the barrier composition, and what a
// loss compares of them.
#include "face_normal.h"
#include "face_rows.h"
#include "shared_types.h"
#include "world_tangents.h"

/// Puts the sum of the faces' weights into alpha: the red of a group of images that shows 1. One work-item
/// per pixel of the groups.
/// in   groups, pixels  the pixels of all views
/// in   rendered  float4[groups + 1][pixel]  the last group's red is the sum of the weights
/// out  images    float4[groups][pixel]
kernel void attribute_weigh_forward(const uint groups, const uint pixels,
                                    global const float4* restrict rendered, global float4* restrict images) {
  const uint i = (uint)get_global_id(0);
  if (i >= groups * pixels) return;
  images[i] = (float4)(rendered[i].xyz, rendered[groups * pixels + i % pixels].x);
}

/// One work-item per pixel of one group.
/// in   groups, pixels  as attribute_weigh_forward
/// in   grad_images    float4[groups][pixel]
/// out  grad_rendered  float4[groups + 1][pixel]
kernel void attribute_weigh_backward(const uint groups, const uint pixels,
                                     global const float4* restrict grad_images,
                                     global float4* restrict grad_rendered) {
  const uint i = (uint)get_global_id(0);
  if (i >= pixels) return;
  float grad_weight = 0.0f;
  for (uint group = 0; group < groups; ++group) {
    const float4 grad = grad_images[group * pixels + i];
    grad_rendered[group * pixels + i] = (float4)(grad.xyz, 0.0f);
    grad_weight += grad.w;
  }
  grad_rendered[groups * pixels + i] = (float4)(grad_weight, 0.0f, 0.0f, 0.0f);
}

/// Attributes minus a target: sum_j w_j (a_j - target) = RGB - A target. One work-item per pixel.
/// in   pixels    of all views
/// in   images    float4[pixel]  RGB, and A, the sum of the weights
/// in   target    float4[pixel]
/// out  residual  float4[pixel]  w = 0
kernel void attribute_residual_forward(const uint pixels, global const float4* restrict images,
                                       global const float4* restrict target,
                                       global float4* restrict residual) {
  const uint i = (uint)get_global_id(0);
  if (i >= pixels) return;
  residual[i] = (float4)(images[i].xyz - images[i].w * target[i].xyz, 0.0f);
}

/// One work-item per pixel.
/// in   pixels, target  as attribute_residual_forward
/// in   grad_residual  float4[pixel]
/// out  grad_images    float4[pixel]
kernel void attribute_residual_backward(const uint pixels, global const float4* restrict target,
                                        global const float4* restrict grad_residual,
                                        global float4* restrict grad_images) {
  const uint i = (uint)get_global_id(0);
  if (i >= pixels) return;
  const float3 grad = grad_residual[i].xyz;
  grad_images[i] = (float4)(grad, -dot(grad, target[i].xyz));
}

/// Attributes of vertices: depths or positions. One work-item per (view, vertex).
/// in   shows_depth  1: view depth, in all three channels; 0: the world position
/// in   shown_views  those behind these show 1
/// in   world        float4[view][vertex]
/// in   ndc          float4[view][vertex]  z = view depth
/// out  colors       float4[view][vertex]
kernel void attribute_vertices_forward(const FrameParams p, const uint shows_depth, const uint shown_views,
                                       global const float4* restrict world, global const float4* restrict ndc,
                                       global float4* restrict colors) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.vertices) return;
  const float3 shown = shows_depth ? (float3)(ndc[i].z) : world[i].xyz;
  colors[i] = (float4)(i < shown_views * p.vertices ? shown : (float3)(1.0f), 0.0f);
}

/// Its gradient, put where the way of vertices back to positions and poses begins. One work-item per
/// (view, vertex).
/// in      shows_depth, shown_views  as attribute_vertices_forward
/// in      grad_colors  float4[view][vertex]
/// in out  grad_depth   float4[view][vertex]  whose z is of view depth; not touched unless that is shown
/// out     grad_world   float4[view][vertex]
kernel void attribute_vertices_backward(const FrameParams p, const uint shows_depth, const uint shown_views,
                                        global const float4* restrict grad_colors,
                                        global float4* restrict grad_depth,
                                        global float4* restrict grad_world) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.vertices) return;
  const float3 grad = i < shown_views * p.vertices ? grad_colors[i].xyz : (float3)(0.0f);
  if (shows_depth) grad_depth[i].z += grad.x + grad.y + grad.z;
  grad_world[i] = (float4)(shows_depth ? (float3)(0.0f) : grad, 0.0f);
}

/// Its tangents. One work-item per (direction, view, vertex).
/// in   shows_depth, shown_views  as attribute_vertices_forward
/// in   world_tangents  as transform_tangent leaves them; of positions alone
/// in   ndc_tangents    float4[direction][view][vertex]  z = view depth
/// out  color_tangents  float4[direction][view][vertex]
kernel void attribute_vertices_tangent(const FrameParams p, const TangentParams q, const uint shows_depth,
                                       const uint shown_views, global const float4* restrict world_tangents,
                                       global const float4* restrict ndc_tangents,
                                       global float4* restrict color_tangents) {
  const uint i = (uint)get_global_id(0), count = p.views * p.vertices;
  if (i >= q.directions * count) return;
  const uint direction = i / count, vertex = i % count;
  float3 moved = 0.0f;
  if (vertex < shown_views * p.vertices) {
    moved = shows_depth ? (float3)(ndc_tangents[i].z)
                        : world_tangents[world_tangents_at(p, direction) + vertex].xyz;
  }
  color_tangents[i] = (float4)(moved, 0.0f);
}

/// 0: a face without area has no normal.
static inline float inverse_length(float3 v) {
  const float size = length(v);
  return size > 0.0f && isfinite(size) ? 1.0f / size : 0.0f;
}

static inline float3 corner_at(global const float4* world, uint4 face, uint corner) {
  return world[corner == 0 ? face.x : corner == 1 ? face.y : face.z].xyz;
}

/// Attributes of faces: their normals, of length 1. One work-item per (view, face).
/// in   shown_views  those behind these show 1
/// in   faces        uint4[face]  vertex indices
/// in   world        float4[view][vertex]
/// out  colors       float4[view][face]
kernel void attribute_normals_forward(const FrameParams p, const uint shown_views,
                                      global const uint4* restrict faces, global const float4* restrict world,
                                      global float4* restrict colors) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.faces) return;
  const uint view = i / p.faces;
  const float3 normal = face_normal(world + view * p.vertices, faces[row_of_face(p, i)]);
  colors[i] = (float4)(view < shown_views ? normal * inverse_length(normal) : (float3)(1.0f), 0.0f);
}

/// Its gradient at the vertices. One work-item per (view, vertex).
/// in   shown_views, faces, world  as attribute_normals_forward
/// in   corner_starts  uint[vertex + 1]    runs of `corners`
/// in   corners        uint[corner]        the faces around a vertex, as face * 3 + corner
/// in   grad_colors    float4[view][face]
/// out  grad_world     float4[view][vertex]
kernel void attribute_normals_backward(const FrameParams p, const uint shown_views,
                                       global const uint4* restrict faces,
                                       global const uint* restrict corner_starts,
                                       global const uint* restrict corners,
                                       global const float4* restrict world,
                                       global const float4* restrict grad_colors,
                                       global float4* restrict grad_world) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.vertices) return;
  const uint view = i / p.vertices, vertex = i - view * p.vertices;
  float3 sum = (float3)(0.0f);
  global const uint* const run = starts_of_view(p, view, p.vertices, corner_starts) + vertex;
  const uint last = view < shown_views ? run[1] : run[0];
  for (uint k = run[0]; k < last; ++k) {
    const uint row = corners[k] / 3, at = corners[k] % 3;
    const uint4 face = faces[row];
    global const float4* of_view = world + view * p.vertices;
    const float3 normal = face_normal(of_view, face),
                 grad = grad_colors[view * p.faces + row - first_row(p, view)].xyz;
    const float scale = inverse_length(normal);
    const float3 unit = normal * scale, g = scale * (grad - unit * dot(unit, grad));
    // cross(b - a, c - a) . g has the gradient cross(b - c, g) by a, and so on around the face.
    sum += cross(corner_at(of_view, face, (at + 1) % 3) - corner_at(of_view, face, (at + 2) % 3), g);
  }
  grad_world[i] = (float4)(sum, 0.0f);
}

/// Its tangents. One work-item per (direction, view, face).
/// in   shown_views, faces, world  as attribute_normals_forward
/// in   world_tangents  as transform_tangent leaves them
/// out  color_tangents  float4[direction][view][face]
kernel void attribute_normals_tangent(const FrameParams p, const TangentParams q, const uint shown_views,
                                      global const uint4* restrict faces, global const float4* restrict world,
                                      global const float4* restrict world_tangents,
                                      global float4* restrict color_tangents) {
  const uint i = (uint)get_global_id(0), count = p.views * p.faces;
  if (i >= q.directions * count) return;
  const uint direction = i / count, view = i % count / p.faces;
  const uint4 face = faces[row_of_face(p, i % count)];
  global const float4* const of_view = world + view * p.vertices;
  global const float4* const moved = world_tangents + world_tangents_at(p, direction) + view * p.vertices;
  const float3 along1 = corner_at(of_view, face, 1) - corner_at(of_view, face, 0);
  const float3 along2 = corner_at(of_view, face, 2) - corner_at(of_view, face, 0);
  const float3 moved1 = corner_at(moved, face, 1) - corner_at(moved, face, 0);
  const float3 moved2 = corner_at(moved, face, 2) - corner_at(moved, face, 0);
  const float3 normal = face_normal(of_view, face);
  const float scale = inverse_length(normal);
  const float3 unit = normal * scale, by = scale * (cross(moved1, along2) + cross(along1, moved2));
  color_tangents[i] = (float4)(view < shown_views ? by - unit * dot(unit, by) : (float3)(0.0f), 0.0f);
}

/// Rows of numbers as colours of what shows them, three channels a pass; behind the last channel, and in
/// passes behind all of them, 0 and 1. One work-item per (pass, view, shown).
/// in   passes, views, shown, channels  in `size`
/// in   row_of  uint[shown]
/// in   values  float[row][channel]
/// out  colors  float4[pass][view][shown]
kernel void attribute_rows_forward(const uint4 size, global const uint* restrict row_of,
                                   global const float* restrict values, global float4* restrict colors) {
  const uint i = (uint)get_global_id(0), shown = size.z, channels = size.w;
  if (i >= size.x * size.y * shown) return;
  const uint first = 3 * (i / (size.y * shown));
  global const float* row = values + (size_t)row_of[i % shown] * channels + first;
  colors[i] = first >= channels ? (float4)(1.0f, 1.0f, 1.0f, 0.0f)
                                : (float4)(row[0], first + 1 < channels ? row[1] : 0.0f,
                                           first + 2 < channels ? row[2] : 0.0f, 0.0f);
}

/// Its gradient: the views in order, in each all that show the row. One work-item per (row, channel).
/// in   rows, views, shown, channels  in `size`
/// in   starts  uint[row + 1]  runs of `shown_by`
/// in   shown_by     uint[...]
/// in   grad_colors  float[pass][view][shown][4]
/// out  grad         float[row][channel]
kernel void attribute_rows_backward(const uint4 size, global const uint* restrict starts,
                                    global const uint* restrict shown_by,
                                    global const float* restrict grad_colors, global float* restrict grad) {
  const uint i = (uint)get_global_id(0), views = size.y, shown = size.z, channels = size.w;
  if (i >= size.x * channels) return;
  const uint row = i / channels, channel = i - row * channels;
  float sum = 0.0f;
  for (uint view = 0; view < views; ++view) {
    global const float* of_view = grad_colors + 4 * (size_t)((channel / 3 * views + view) * shown);
    for (uint k = starts[row]; k < starts[row + 1]; ++k) sum += of_view[4 * shown_by[k] + channel % 3];
  }
  grad[i] = sum;
}

/// Positions of vertices at what is shown, a whole shape after another: `copies` of `sources` shapes in turn.
/// One work-item per (copy, shown).
/// in   copies, sources, shown, vertices  in `size`
/// in   vertex_of  uint[shown]
/// in   positions  float4[source][vertex]
/// out  moved      float4[copy][shown]
kernel void attribute_positions_forward(const uint4 size, global const uint* restrict vertex_of,
                                        global const float4* restrict positions,
                                        global float4* restrict moved) {
  const uint i = (uint)get_global_id(0), shown = size.z;
  if (i >= size.x * shown) return;
  moved[i] = positions[i / shown % size.y * size.w + vertex_of[i % shown]];
}

/// Its gradient: the copies in order, in each all that show the vertex. One work-item per (source, vertex).
/// in   copies, sources, shown, vertices  in `size`
/// in   starts      uint[vertex + 1]  runs of `shown_by`
/// in   shown_by    uint[...]
/// in   grad_moved  float4[copy][shown]
/// out  grad        float4[source][vertex]  w = 0
kernel void attribute_positions_backward(const uint4 size, global const uint* restrict starts,
                                         global const uint* restrict shown_by,
                                         global const float4* restrict grad_moved,
                                         global float4* restrict grad) {
  const uint i = (uint)get_global_id(0), vertices = size.w;
  if (i >= size.y * vertices) return;
  const uint vertex = i % vertices;
  float3 sum = (float3)(0.0f);
  for (uint copy = i / vertices; copy < size.x; copy += size.y) {
    for (uint k = starts[vertex]; k < starts[vertex + 1]; ++k)
      sum += grad_moved[copy * size.z + shown_by[k]].xyz;
  }
  grad[i] = (float4)(sum, 0.0f);
}
