// Vertices: object space -> world -> camera -> NDC and view depth; and back.
#include "affine.h"
#include "compensated.h"
#include "lens.h"
#include "shared_types.h"

DPR_COMPENSATED_ADD(add_channels, float8)

/// Projects vertices. One work-item per (view, vertex).
/// in   views        ViewParams[view]
/// in   models       float4[view][mesh][3]  rows of object to world
/// in   positions    float4[position] or, with a stride, float4[view][position]  object space; w unused
/// in   vertex_mesh  uint[vertex]
/// in   places       MeshPlace[mesh]
/// out  world        float4[view][vertex]   world space; w = 1
/// out  ndc          float4[view][vertex]   x, y in NDC, z = view depth, positive in front; w = 0
kernel void transform_forward(const FrameParams p, global const ViewParams* restrict views,
                              global const float4* restrict models, global const float4* restrict positions,
                              global const uint* restrict vertex_mesh,
                              global const MeshPlace* restrict places, global float4* restrict world,
                              global float4* restrict ndc) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.vertices) return;
  const uint view = i / p.vertices, vertex = i - view * p.vertices, mesh = vertex_mesh[vertex];
  const uint position = vertex - places[mesh].vertex_shift;
  global const float4* model = models + 3 * (view * p.meshes + mesh);
  global const ViewParams* camera = views + view;

  const float3 w =
      apply_affine(model[0], model[1], model[2], positions[view * p.position_stride + position].xyz);
  const float3 c = apply_affine(camera->row[0], camera->row[1], camera->row[2], w);
  const float depth = -c.z;
  world[i] = (float4)(w, 1.0f);
  const float2 xy = project(p, camera, c.xy, depth);
  ndc[i] = (float4)(xy.x, xy.y, depth, 0.0f);
}

/// What a vertex adds to the gradients of its poses and its camera, channel by channel, DPR_LENS_CHANNELS.
#define DPR_CHANNEL_VECTORS 3 /* of 8 */
typedef struct {
  float3 world;  // d loss / d world position
  float8 channels[DPR_CHANNEL_VECTORS];
} VertexGradient;

/// `lit` is what shading adds, `clip` what clipped faces do.
static inline VertexGradient vertex_gradient(const FrameParams p, global const ViewParams* camera,
                                             global const float4* model, float3 world, float3 g, float3 clip,
                                             float3 lit) {
  const float3 c = apply_affine(camera->row[0], camera->row[1], camera->row[2], world);
  int used = any(g != 0.0f);
  const float inverse_depth = !used ? 0.0f : p.orthographic ? 1.0f : -1.0f / c.z;
  const float2 tangent = used ? c.xy * inverse_depth : (float2)(0.0f);
  const float2 g_seen = g.xy * camera->projection.xy;
  float2 seen = tangent, g_tangent = g_seen;
  float g_coefficients[5] = {0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
  if (camera->distorts && used) {
    seen = bend_tangent(camera, tangent);
    g_tangent = bend_tangent_backward(camera, tangent, g_seen);
    coefficients_backward(camera, tangent, g_seen, g_coefficients);
  }
  const float g_depth = p.orthographic ? g.z : g.z - dot(g_tangent, tangent) * inverse_depth;
  float3 g_camera = (float3)(g_tangent.x * inverse_depth, g_tangent.y * inverse_depth, -g_depth);
  float2 g_scale = g.xy * seen, g_offset = g.xy;
  if (any(clip != 0.0f)) {
    const float4 projection = camera->projection;
    used = 1;
    g_camera +=
        (float3)(clip.xy * projection.xy, -clip.z - (p.orthographic ? 0.0f : dot(clip.xy, projection.zw)));
    if (!camera->distorts) {
      g_scale += clip.xy * c.xy;
      g_offset += clip.xy * (p.orthographic ? 1.0f : -c.z);
    }
  }
  VertexGradient v;
  v.world = apply_transposed(camera->row[0], camera->row[1], camera->row[2], g_camera) + lit;
  const float3 turned_in_world = world - (float3)(model[0].w, model[1].w, model[2].w);
  const float3 turned_in_camera = c - (float3)(camera->row[0].w, camera->row[1].w, camera->row[2].w);
  const float3 model_rotation = any(v.world != 0.0f) ? cross(turned_in_world, v.world) : (float3)(0.0f);
  const float3 view_rotation = used ? cross(turned_in_camera, g_camera) : (float3)(0.0f);
  v.channels[0] = (float8)(model_rotation.x, model_rotation.y, model_rotation.z, v.world.x, v.world.y,
                           v.world.z, view_rotation.x, view_rotation.y);
  v.channels[1] = (float8)(view_rotation.z, g_camera.x, g_camera.y, g_camera.z, g_scale.x, g_scale.y,
                           g_offset.x, g_offset.y);
  v.channels[2] = (float8)(g_coefficients[0], g_coefficients[1], g_coefficients[2], g_coefficients[3],
                           g_coefficients[4], 0.0f, 0.0f, 0.0f);
  return v;
}

/// Gradients at the world positions, and the sums over the vertices of a mesh of what they add to the
/// gradients of its pose and of the camera. A vertex that no kept triangle uses has zero gradient, wherever
/// it lies. Slot k sums the k-th run of a mesh's vertices, all as long. One work-item per (view, mesh, slot).
/// Deterministic.
/// in      views, models, world  as transform_forward
/// in      starts      uint[view * mesh + 1]  of the vertices, [view][vertex]
/// in      grad_ndc    float4[view][vertex]   d loss / d (x, y, depth)
/// in      grad_clip   float4[view][vertex]   what clipped faces add, of homogeneous coordinates: x and y in
///                     NDC, times depth, and depth; orthographic: x, y, depth. Where the lens distorts,
///                     without its distortion: what it does to cuts is left out of its own gradients. Read
///                     where p.clips is set
/// in      lit         0: nothing was lit, grad_world is only written
/// in      slots       of a segment
/// in out  grad_world  float4[view][vertex]   in: what shading adds; out: the whole d loss / d world position
/// out     partial     float[DPR_POSE_CHANNELS][view][mesh][2][slot]  sums, and their compensations;
///                     DPR_LENS_CHANNELS where p.distorts is set
kernel void transform_backward(const FrameParams p, const uint lit, const uint slots,
                               global const ViewParams* restrict views, global const float4* restrict models,
                               global const uint* restrict starts, global const float4* restrict world,
                               global const float4* restrict grad_ndc,
                               global const float4* restrict grad_clip, global float4* restrict grad_world,
                               global float* restrict partial) {
  const uint i = (uint)get_global_id(0), segments = p.views * p.meshes;
  if (i >= segments * slots) return;
  const uint segment = i / slots, slot = i % slots, begin = starts[segment], end = starts[segment + 1];
  const uint run = (end - begin + slots - 1) / slots, first = begin + slot * run,
             last = min(end, first + run);
  const uint channels = p.distorts ? DPR_LENS_CHANNELS : DPR_POSE_CHANNELS;
  float8 sums[DPR_CHANNEL_VECTORS] = {0.0f, 0.0f, 0.0f}, errors[DPR_CHANNEL_VECTORS] = {0.0f, 0.0f, 0.0f};
  for (uint k = first; k < last; ++k) {
    const float3 clip = p.clips ? grad_clip[k].xyz : (float3)(0.0f);
    const float3 of_light = lit ? grad_world[k].xyz : (float3)(0.0f);
    const VertexGradient v = vertex_gradient(p, views + segment / p.meshes, models + 3 * segment,
                                             world[k].xyz, grad_ndc[k].xyz, clip, of_light);
    grad_world[k] = (float4)(v.world, 0.0f);
#pragma unroll
    for (uint c = 0; c < DPR_CHANNEL_VECTORS; ++c) {
      if (8 * c < channels) add_channels(&sums[c], &errors[c], v.channels[c]);
    }
  }
#pragma unroll
  for (uint c = 0; c < DPR_LENS_CHANNELS; ++c) {
    if (c >= channels) continue;
    global float* out = partial + (size_t)2 * slots * (c * segments + segment) + slot;
    out[0] = ((const float*)sums)[c];
    out[slots] = ((const float*)errors)[c];
  }
}

/// Gradients of the object-space positions: the views' contributions in order, or, where every view has a
/// shape of its own, its contribution alone; of a view that of the mesh, then those of its instances. One
/// work-item per vertex, or per (view, vertex), of which instances' do nothing. Models, the vertices' meshes
/// and their places as transform_forward.
/// in   grad_world      float4[view][vertex]
/// out  grad_positions  float4[position] or, with a stride, float4[view][position]
kernel void transform_backward_positions(const FrameParams p, global const float4* restrict models,
                                         global const uint* restrict vertex_mesh,
                                         global const MeshPlace* restrict places,
                                         global const float4* restrict grad_world,
                                         global float4* restrict grad_positions) {
  const uint i = (uint)get_global_id(0);
  if (i >= (p.position_stride ? p.views * p.vertices : p.vertices)) return;
  const uint vertex = i % p.vertices, first_mesh = vertex_mesh[vertex];
  if (places[first_mesh].is_instance) return;
  const uint position = vertex - places[first_mesh].vertex_shift;
  const uint first_view = i / p.vertices, last_view = p.position_stride ? first_view + 1 : p.views;
  float3 sum = (float3)(0.0f);
  for (uint view = first_view; view < last_view; ++view) {
    for (uint mesh = first_mesh; mesh < p.meshes; mesh = places[mesh].next) {
      global const float4* model = models + 3 * (view * p.meshes + mesh);
      const uint seen = view * p.vertices + position + places[mesh].vertex_shift;
      sum += apply_transposed(model[0], model[1], model[2], grad_world[seen].xyz);
    }
  }
  grad_positions[first_view * p.position_stride + position] = (float4)(sum, 0.0f);
}
