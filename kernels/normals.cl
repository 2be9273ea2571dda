// Normals in world space: of vertices, the faces' area-weighted normals, summed in order and normalised;
// those that meshes give, turned with the mesh; and back. A view has those of all vertices, then those given.
#include "face_normal.h"
#include "face_rows.h"
#include "world_tangents.h"

/// Normal sums shorter than this have no direction, squared world units; nor have those that overflow.
#define DPR_MIN_NORMAL 1e-20f

/// Vector of length one, or zero where there is no direction; w = 1 / length, or zero.
static inline float4 unit_normal(float3 sum) {
  const float size = length(sum);
  const int has_direction = size > DPR_MIN_NORMAL && size < INFINITY;
  const float inverse = has_direction ? 1.0f / size : 0.0f;
  return has_direction ? (float4)(sum * inverse, inverse) : (float4)(0.0f);
}

/// Place of a normal behind the vertices in world space.
static inline uint normal_at(const FrameParams p, uint view, uint normal) {
  return p.views * p.vertices + view * p.normals + normal;
}

/// One work-item per (view, vertex).
/// in   faces          uint4[row]            vertex indices
/// in   corner_starts  uint[vertex + 1]      runs of `corners`; of views' own faces by [view][vertex]
/// in   corners        uint[corner]          the faces around a vertex, as row * 3 + corner
/// in   world          float4[view][vertex]  world space
/// out  world          float4[view][normal]  behind the vertices, those of vertices: unit, or zero; w = 1 / length
///      of the sum, or zero
kernel void normals_forward(const FrameParams p, global const uint4* restrict faces,
                            global const uint* restrict corner_starts, global const uint* restrict corners,
                            global float4* restrict world) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.vertices) return;
  const uint view = i / p.vertices, vertex = i - view * p.vertices;
  global const uint* const run = starts_of_view(p, view, p.vertices, corner_starts) + vertex;
  float3 sum = (float3)(0.0f);
  for (uint k = run[0]; k < run[1]; ++k) {
    sum += face_normal(world + view * p.vertices, faces[corners[k] / 3]);
  }
  world[normal_at(p, view, vertex)] = unit_normal(sum);
}

/// The transposed inverse of a model's linear part, but for a factor above 0, by rows: it takes normals to
/// world space, also where the model mirrors.
typedef struct {
  float3 row[3];
} NormalMap;

static inline NormalMap normal_map(global const float4* model) {
  const float3 a = model[0].xyz, b = model[1].xyz, c = model[2].xyz;
  const float3 bc = cross(b, c);
  const float side = dot(a, bc) < 0.0f ? -1.0f : 1.0f;
  NormalMap m;
  m.row[0] = side * bc;
  m.row[1] = side * cross(c, a);
  m.row[2] = side * cross(a, b);
  return m;
}

/// One work-item per (view, given normal).
/// in   models       float4[view][mesh][3]  rows of the models' matrices
/// in   values       float4[value]          object space; any length
/// in   given_mesh   uint[given]
/// in   places       MeshPlace[mesh]
/// out  world        float4[view][normal]   those given: as normals_forward
kernel void normals_given_forward(const FrameParams p, global const float4* restrict models,
                                  global const float4* restrict values,
                                  global const uint* restrict given_mesh,
                                  global const MeshPlace* restrict places, global float4* restrict world) {
  const uint i = (uint)get_global_id(0), count = p.normals - p.vertices;
  if (i >= p.views * count) return;
  const uint view = i / count, g = i - view * count, mesh = given_mesh[g];
  const NormalMap m = normal_map(models + 3 * (view * p.meshes + mesh));
  const float3 n = values[g - places[mesh].normal_shift].xyz;
  world[normal_at(p, view, p.vertices + g)] =
      unit_normal((float3)(dot(m.row[0], n), dot(m.row[1], n), dot(m.row[2], n)));
}

/// From the unit normals' gradients to those of the sums. One work-item per (view, normal).
/// in      world         as the forward kernels left it
/// in out  grad_normals  float4[view][normal]
kernel void normals_backward_normalize(const FrameParams p, global const float4* restrict world,
                                       global float4* restrict grad_normals) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.normals) return;
  const float4 n = world[normal_at(p, 0, i)];
  const float3 g = grad_normals[i].xyz;
  grad_normals[i] = (float4)((g - n.xyz * dot(n.xyz, g)) * n.w, 0.0f);
}

/// From the sums' gradients to the world positions': a face's normal belongs to its three vertices' sums.
/// One work-item per (view, vertex). Faces, corners and world positions as normals_forward, and
/// in      grad_sums   float4[view][normal]
/// in out  grad_world  float4[view][vertex]  added to
kernel void normals_backward(const FrameParams p, global const uint4* restrict faces,
                             global const uint* restrict corner_starts, global const uint* restrict corners,
                             global const float4* restrict world, global const float4* restrict grad_sums,
                             global float4* restrict grad_world) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.vertices) return;
  const uint view = i / p.vertices, vertex = i - view * p.vertices;
  global const float4* positions = world + view * p.vertices;
  global const float4* sums = grad_sums + view * p.normals;
  global const uint* const run = starts_of_view(p, view, p.vertices, corner_starts) + vertex;
  float3 sum = (float3)(0.0f);
  for (uint k = run[0]; k < run[1]; ++k) {
    const uint4 face = faces[corners[k] / 3];
    const uint corner = corners[k] % 3;
    const uint next = corner == 0 ? face.y : corner == 1 ? face.z : face.x;
    const uint previous = corner == 0 ? face.z : corner == 1 ? face.x : face.y;
    // cross(b - a, c - a) . g has the gradient cross(b - c, g) for a, and so on around the face.
    const float3 g = sums[face.x].xyz + sums[face.y].xyz + sums[face.z].xyz;
    // An unseen face may lie anywhere, at infinity too.
    if (any(g != 0.0f)) sum += cross(positions[next].xyz - positions[previous].xyz, g);
  }
  grad_world[i] += (float4)(sum, 0.0f);
}

/// From the gradients of the turned normals to the values given, the views and instances added up. One
/// work-item per given normal, of which instances' do nothing. Models, values, meshes and places as
/// normals_given_forward, and
/// in   grad_sums    float4[view][normal]
/// out  grad_values  float4[value]
/// out  channels     float[3][view][given]  of the model's rotation vector
kernel void normals_given_backward(const FrameParams p, global const float4* restrict models,
                                   global const float4* restrict values,
                                   global const uint* restrict given_mesh,
                                   global const MeshPlace* restrict places,
                                   global const float4* restrict grad_sums,
                                   global float4* restrict grad_values, global float* restrict channels) {
  const uint g = (uint)get_global_id(0), count = p.normals - p.vertices;
  if (g >= count) return;
  const uint first_mesh = given_mesh[g];
  if (places[first_mesh].is_instance) return;
  const uint value = g - places[first_mesh].normal_shift;
  const float3 n = values[value].xyz;
  float3 sum = (float3)(0.0f);
  for (uint view = 0; view < p.views; ++view) {
    for (uint mesh = first_mesh; mesh < p.meshes; mesh = places[mesh].next) {
      const uint seen = value + places[mesh].normal_shift;
      const NormalMap m = normal_map(models + 3 * (view * p.meshes + mesh));
      const float3 grad = grad_sums[view * p.normals + p.vertices + seen].xyz;
      sum += m.row[0] * grad.x + m.row[1] * grad.y + m.row[2] * grad.z;
      const float3 turned = (float3)(dot(m.row[0], n), dot(m.row[1], n), dot(m.row[2], n));
      const float3 by_rotation = cross(turned, grad);
      global float* channel = channels + view * count + seen;
      channel[0] = by_rotation.x;
      channel[p.views * count] = by_rotation.y;
      channel[2 * p.views * count] = by_rotation.z;
    }
  }
  grad_values[value] = (float4)(sum, 0.0f);
}

/// Tangents of the normals of vertices: they turn with the mesh where its positions do not move by themselves. One
/// work-item per (view, vertex).
/// in   faces, corner_starts, corners, world  as normals_forward left them
/// in   vertex_mesh     uint[vertex]
/// in   model_tangents  ModelTangent[direction][view][mesh]
/// in out  tangents     float4[direction][...]  of vertices' normals by those of world positions
kernel void normals_tangent(const FrameParams p, const TangentParams q, global const uint4* restrict faces,
                            global const uint* restrict corner_starts, global const uint* restrict corners,
                            global const float4* restrict world, global const uint* restrict vertex_mesh,
                            global const ModelTangent* restrict model_tangents,
                            global float4* restrict tangents) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.vertices) return;
  const uint view = i / p.vertices, vertex = i - view * p.vertices;
  global const float4* positions = world + view * p.vertices;
  const float4 n = world[normal_at(p, view, vertex)];
  for (uint d = 0; d < q.directions; ++d) {
    global float4* const moved = tangents + world_tangents_at(p, d);
    if (q.positions == 0) {
      const float4 turn =
          model_tangents[((size_t)d * p.views + view) * p.meshes + vertex_mesh[vertex]].rotation;
      moved[normal_at(p, view, vertex)] = (float4)(cross(turn.xyz, n.xyz), 0.0f);
      continue;
    }
    global const uint* const run = starts_of_view(p, view, p.vertices, corner_starts) + vertex;
    float3 sum = 0.0f;
    for (uint k = run[0]; k < run[1]; ++k)
      sum += face_normal_tangent(positions, moved + view * p.vertices, faces[corners[k] / 3]);
    moved[normal_at(p, view, vertex)] = (float4)((sum - n.xyz * dot(n.xyz, sum)) * n.w, 0.0f);
  }
}

/// Tangents of the normals that meshes give, which turn with them. One work-item per (view, given normal).
/// in   given_mesh, world  as normals_given_forward
/// in   model_tangents  ModelTangent[direction][view][mesh]
/// out  tangents        float4[direction][...]  those of given normals
kernel void normals_given_tangent(const FrameParams p, const TangentParams q,
                                  global const uint* restrict given_mesh,
                                  global const ModelTangent* restrict model_tangents,
                                  global const float4* restrict world, global float4* restrict tangents) {
  const uint i = (uint)get_global_id(0), count = p.normals - p.vertices;
  if (i >= p.views * count) return;
  const uint view = i / count, g = i - view * count, at = normal_at(p, view, p.vertices + g);
  for (uint d = 0; d < q.directions; ++d) {
    const float4 turn = model_tangents[((size_t)d * p.views + view) * p.meshes + given_mesh[g]].rotation;
    tangents[world_tangents_at(p, d) + at] = (float4)(cross(turn.xyz, world[at].xyz), 0.0f);
  }
}
