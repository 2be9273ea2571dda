// Losses of a mesh's shape alone: Laplacian (77), edge length, normal consistency, flatness; and their
// gradients, which are gathered at the vertices in a fixed order.
#include "shared_types.h"

/// Normals shorter than this have no direction, squared object units.
#define DPR_MIN_HINGE_NORMAL 1e-20f

/// Terms of every vertex. One work-item per vertex of the mesh.
/// in   ring_starts  uint[vertex + 1]  runs of `ring`
/// in   ring         uint[...]         the other vertices of a vertex' faces, each once
/// in   positions    float4[...]       object space; the mesh's from p.first_vertex on
/// out  laplacians   float4[vertex]    v - mean of its one-ring; zero without one
/// out  channels     float[DPR_MESH_LOSS_CHANNELS][vertex]
kernel void mesh_loss_vertices(const MeshLossParams p, global const uint* restrict ring_starts,
                               global const uint* restrict ring, global const float4* restrict positions,
                               global float4* restrict laplacians, global float* restrict channels) {
  const uint v = (uint)get_global_id(0);
  if (v >= p.vertices) return;
  const uint first = ring_starts[v], last = ring_starts[v + 1];
  const float3 at = positions[p.first_vertex + v].xyz;
  float3 sum = (float3)(0.0f);
  float edges = 0.0f;
  for (uint k = first; k < last; ++k) {
    // Differences, not positions, are summed: far from the origin nothing is lost.
    const float3 edge = at - positions[p.first_vertex + ring[k]].xyz;
    const float excess = length(edge) - p.edge_target;
    sum += edge;
    edges += 0.5f * excess * excess;  // the other end adds the other half
  }
  const float3 laplacian = last > first ? sum / (float)(last - first) : sum;
  laplacians[v] = (float4)(laplacian, 0.0f);
  channels[v] = dot(laplacian, laplacian);
  channels[p.vertices + v] = edges;
}

/// Terms of every hinge: two faces with corners `a` and `b` across from their common edge from e0 to e1.
/// Their normals are formed along the edge, so the faces' own orientation has no part in it. One work-item
/// per hinge.
/// in   hinges     uint4[hinge]      a, b, e0, e1
/// in   positions  as mesh_loss_vertices
/// out  channels   float[DPR_MESH_LOSS_CHANNELS][hinge]
/// out  partial    float4[hinge][4]  gradient of the weighted terms for each of the four
kernel void mesh_loss_hinges(const MeshLossParams p, global const uint4* restrict hinges,
                             global const float4* restrict positions, global float* restrict channels,
                             global float4* restrict partial) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.hinges) return;
  const uint4 hinge = hinges[i] + (uint4)(p.first_vertex);
  const float3 e0 = positions[hinge.z].xyz;
  const float3 edge = positions[hinge.w].xyz - e0;
  const float3 u = positions[hinge.x].xyz - e0, w = positions[hinge.y].xyz - e0;
  const float3 normal0 = cross(u, edge), normal1 = cross(edge, w);
  const float length0 = length(normal0), length1 = length(normal1);
  const bool has_angle = length0 > DPR_MIN_HINGE_NORMAL && length1 > DPR_MIN_HINGE_NORMAL;
  const float3 unit0 = normal0 / (has_angle ? length0 : 1.0f), unit1 = normal1 / (has_angle ? length1 : 1.0f);
  const float cosine = has_angle ? dot(unit0, unit1) : 1.0f;
  const float bend = 1.0f - cosine;
  channels[i] = bend;
  channels[p.hinges + i] = bend * bend;

  const float grad_cosine = has_angle ? -(p.normal_consistency + 2.0f * p.flatness * bend) : 0.0f;
  const float3 grad0 = grad_cosine * (unit1 - cosine * unit0) / (has_angle ? length0 : 1.0f);
  const float3 grad1 = grad_cosine * (unit0 - cosine * unit1) / (has_angle ? length1 : 1.0f);
  const float3 grad_a = cross(edge, grad0), grad_b = cross(grad1, edge);
  const float3 grad_e1 = cross(grad0, u) + cross(w, grad1);
  partial[4 * i] = (float4)(grad_a, 0.0f);
  partial[4 * i + 1] = (float4)(grad_b, 0.0f);
  partial[4 * i + 2] = (float4)(-(grad_a + grad_b + grad_e1), 0.0f);
  partial[4 * i + 3] = (float4)(grad_e1, 0.0f);
}

/// Adds the gradient of all terms. One work-item per vertex of the mesh. Arguments as mesh_loss_vertices and
/// mesh_loss_hinges leave them, and
/// in   hinge_starts, hinge_places  the entries of `partial` that belong to a vertex: a compressed sparse row
/// out  grad  float4[...]  the mesh's from p.first_vertex on
kernel void mesh_loss_gather(const MeshLossParams p, global const uint* restrict ring_starts,
                             global const uint* restrict ring, global const float4* restrict positions,
                             global const float4* restrict laplacians,
                             global const uint* restrict hinge_starts,
                             global const uint* restrict hinge_places, global const float4* restrict partial,
                             global float4* restrict grad) {
  const uint v = (uint)get_global_id(0);
  if (v >= p.vertices) return;
  const float3 at = positions[p.first_vertex + v].xyz;
  float3 laplacian = laplacians[v].xyz, edges = (float3)(0.0f), bends = (float3)(0.0f);
  for (uint k = ring_starts[v]; k < ring_starts[v + 1]; ++k) {
    const uint other = ring[k];
    const float3 edge = at - positions[p.first_vertex + other].xyz;
    const float size = length(edge);
    laplacian -= laplacians[other].xyz / (float)(ring_starts[other + 1] - ring_starts[other]);
    if (size > 0.0f) edges += (1.0f - p.edge_target / size) * edge;
  }
  for (uint k = hinge_starts[v]; k < hinge_starts[v + 1]; ++k) bends += partial[hinge_places[k]].xyz;
  const float3 sum = 2.0f * (p.laplacian * laplacian + p.edge_length * edges) + bends;
  grad[p.first_vertex + v] += (float4)(sum, 0.0f);
}
