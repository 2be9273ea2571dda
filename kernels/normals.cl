// Vertex normals in world space: the faces' area-weighted normals, summed in order and normalised; and back.
#include "shared_types.h"

/// Normal sums shorter than this have no direction, squared world units; nor have those that overflow.
#define DPR_MIN_NORMAL 1e-20f

static inline float3 face_normal(global const float4* world, uint4 face) {
  const float3 a = world[face.x].xyz;
  return cross(world[face.y].xyz - a, world[face.z].xyz - a);
}

/// One work-item per (view, vertex).
/// in   faces          uint4[face]           vertex indices
/// in   corner_starts  uint[vertex + 1]      runs of `corners`
/// in   corners        uint[corner]          the faces around a vertex, as face * 3 + corner
/// in   world          float4[view][vertex]  world space
/// out  normals        float4[view][vertex]  unit, or zero; w = 1 / length of the sum, or zero
kernel void normals_forward(const FrameParams p, global const uint4* restrict faces,
                            global const uint* restrict corner_starts, global const uint* restrict corners,
                            global const float4* restrict world, global float4* restrict normals) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.vertices) return;
  const uint view = i / p.vertices, vertex = i - view * p.vertices;
  float3 sum = (float3)(0.0f);
  for (uint k = corner_starts[vertex]; k < corner_starts[vertex + 1]; ++k) {
    sum += face_normal(world + view * p.vertices, faces[corners[k] / 3]);
  }
  const float size = length(sum);
  const int has_direction = size > DPR_MIN_NORMAL && size < INFINITY;
  const float inverse = has_direction ? 1.0f / size : 0.0f;
  normals[i] = has_direction ? (float4)(sum * inverse, inverse) : (float4)(0.0f);
}

/// From the unit normals' gradients to those of the sums. One work-item per (view, vertex).
/// in      normals       as normals_forward left them
/// in out  grad_normals  float4[view][vertex]
kernel void normals_backward_normalize(const FrameParams p, global const float4* restrict normals,
                                       global float4* restrict grad_normals) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.vertices) return;
  const float3 n = normals[i].xyz, g = grad_normals[i].xyz;
  grad_normals[i] = (float4)((g - n * dot(n, g)) * normals[i].w, 0.0f);
}

/// From the sums' gradients to the world positions': a face's normal belongs to its three vertices' sums.
/// One work-item per (view, vertex). Faces, corners and world positions as normals_forward, and
/// in      grad_sums   float4[view][vertex]
/// in out  grad_world  float4[view][vertex]  added to
kernel void normals_backward(const FrameParams p, global const uint4* restrict faces,
                             global const uint* restrict corner_starts, global const uint* restrict corners,
                             global const float4* restrict world, global const float4* restrict grad_sums,
                             global float4* restrict grad_world) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.vertices) return;
  const uint view = i / p.vertices, vertex = i - view * p.vertices;
  global const float4* positions = world + view * p.vertices;
  global const float4* sums = grad_sums + view * p.vertices;
  float3 sum = (float3)(0.0f);
  for (uint k = corner_starts[vertex]; k < corner_starts[vertex + 1]; ++k) {
    const uint4 face = faces[corners[k] / 3];
    const uint corner = corners[k] % 3;
    const uint next = corner == 0 ? face.y : corner == 1 ? face.z : face.x;
    const uint previous = corner == 0 ? face.z : corner == 1 ? face.x : face.y;
    // cross(b - a, c - a) . g has the gradient cross(b - c, g) for a, and so on around the face.
    const float3 g = sums[face.x].xyz + sums[face.y].xyz + sums[face.z].xyz;
    // Where nothing is seen of the face it may lie anywhere, at infinity too.
    if (any(g != 0.0f)) sum += cross(positions[next].xyz - positions[previous].xyz, g);
  }
  grad_world[i] += (float4)(sum, 0.0f);
}
