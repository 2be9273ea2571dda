// Vertices: object space -> world -> camera -> NDC and view depth; and back; and forward mode.
#include "affine.h"
#include "compensated.h"
#include "lens.h"
#include "world_tangents.h"

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

/// A vertex's share of the gradients of its poses and its camera, channel by channel, DPR_POSE_CHANNELS.
#define DPR_CHANNEL_VECTORS 2 /* of 8 */
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
  if (camera->distorts && used) {
    seen = bend_tangent(camera, tangent);
    g_tangent = bend_tangent_backward(camera, tangent, g_seen);
  }
  const float g_depth = p.orthographic ? g.z : g.z - dot(g_tangent, tangent) * inverse_depth;
  float3 g_camera = (float3)(g_tangent.x * inverse_depth, g_tangent.y * inverse_depth, -g_depth);
  float2 g_scale = g.xy * seen, g_offset = g.xy;
  if (any(clip != 0.0f)) {
    const float4 projection = camera->projection;
    used = 1;
    g_camera +=
        (float3)(clip.xy * projection.xy, -clip.z - (p.orthographic ? 0.0f : dot(clip.xy, projection.zw)));
    g_scale += clip.xy * c.xy;
    g_offset += clip.xy * (p.orthographic ? 1.0f : -c.z);
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
  return v;
}

/// The vertices [x, y) of a slot: slot k has the k-th run of a segment's, all as long.
static inline uint2 run_of_slot(global const uint* starts, uint segment, uint slot, uint slots) {
  const uint begin = starts[segment], end = starts[segment + 1], run = (end - begin + slots - 1) / slots;
  const uint first = begin + slot * run;
  return (uint2)(first, min(end, first + run));
}

/// Stores the first `count` channels of a slot, sums and their compensations, from channel `first` on.
static inline void store_sums(float8 sum, float8 error, uint first, uint count, uint segments, uint segment,
                              uint slots, uint slot, global float* partial) {
#pragma unroll
  for (uint c = 0; c < count; ++c) {
    global float* out = partial + (size_t)2 * slots * ((first + c) * segments + segment) + slot;
    out[0] = ((const float*)&sum)[c];
    out[slots] = ((const float*)&error)[c];
  }
}

/// From the gradients of what transform_forward leaves to those of the world positions, in place, and the
/// sums over the vertices of a mesh of what they add to the gradients of its pose and of the camera. A vertex
/// that no kept triangle uses has zero gradient, wherever it lies. One work-item per (view, mesh, slot).
/// Deterministic.
///
/// in      views, models, world  as transform_forward
/// in      starts      uint[view * mesh + 1]  of the vertices, [view][vertex]
/// in      grad_clip   float4[view][vertex]   what clipped faces add, of homogeneous coordinates: x and y in
///                     NDC, times depth, and depth; orthographic: x, y, depth. Where the lens distorts,
///                     without its distortion: what cuts add is in DPR_CUT_CHANNELS. Read where p.clips is
///                     set
/// in      lit         0: nothing was lit, grad_lit is not read
/// in      grad_lit    float4[view][vertex]   what shading adds to d loss / d world position
/// in      slots       of a segment
/// in out  grad        float4[view][vertex]   d loss / d (x, y, depth), then d loss / d world position
/// out     partial     float[DPR_POSE_CHANNELS][view][mesh][2][slot]  sums, and their compensations
kernel void transform_backward(const FrameParams p, const uint lit, const uint slots,
                               global const ViewParams* restrict views, global const float4* restrict models,
                               global const uint* restrict starts, global const float4* restrict world,
                               global const float4* restrict grad_clip,
                               global const float4* restrict grad_lit, global float4* restrict grad,
                               global float* restrict partial) {
  const uint i = (uint)get_global_id(0), segments = p.views * p.meshes;
  if (i >= segments * slots) return;
  const uint segment = i / slots, slot = i % slots;
  const uint2 run = run_of_slot(starts, segment, slot, slots);
  float8 sums[DPR_CHANNEL_VECTORS] = {0.0f, 0.0f}, errors[DPR_CHANNEL_VECTORS] = {0.0f, 0.0f};
  for (uint k = run.x; k < run.y; ++k) {
    const float3 clip = p.clips ? grad_clip[k].xyz : (float3)(0.0f);
    const float3 of_light = lit ? grad_lit[k].xyz : (float3)(0.0f);
    const VertexGradient v = vertex_gradient(p, views + segment / p.meshes, models + 3 * segment,
                                             world[k].xyz, grad[k].xyz, clip, of_light);
    grad[k] = (float4)(v.world, 0.0f);
#pragma unroll
    for (uint c = 0; c < DPR_CHANNEL_VECTORS; ++c) add_channels(&sums[c], &errors[c], v.channels[c]);
  }
#pragma unroll
  for (uint c = 0; c < DPR_CHANNEL_VECTORS; ++c)
    store_sums(sums[c], errors[c], 8 * c, 8, segments, segment, slots, slot, partial);
}

/// The sums of what vertices add to the gradients of the lens, where some view distorts. One work-item per
/// (view, mesh, slot). Deterministic. Inputs as transform_backward, before it, and
/// in   grad_ndc  float4[view][vertex]  d loss / d (x, y, depth)
/// out  partial  its channels from DPR_POSE_CHANNELS to DPR_LENS_CHANNELS
kernel void transform_backward_lens(const FrameParams p, const uint slots,
                                    global const ViewParams* restrict views,
                                    global const uint* restrict starts, global const float4* restrict world,
                                    global const float4* restrict grad_ndc, global float* restrict partial) {
  const uint i = (uint)get_global_id(0), segments = p.views * p.meshes;
  if (i >= segments * slots) return;
  const uint segment = i / slots, slot = i % slots;
  const uint2 run = run_of_slot(starts, segment, slot, slots);
  global const ViewParams* camera = views + segment / p.meshes;
  float8 sum = 0.0f, error = 0.0f;
  for (uint k = run.x; k < run.y && camera->distorts; ++k) {
    const float2 grad = grad_ndc[k].xy;
    if (!any(grad != 0.0f)) continue;
    const float3 c = apply_affine(camera->row[0], camera->row[1], camera->row[2], world[k].xyz);
    add_channels(&sum, &error, coefficients_gradient(camera, c.xy / -c.z, grad * camera->projection.xy));
  }
  store_sums(sum, error, DPR_POSE_CHANNELS, DPR_LENS_CHANNELS - DPR_POSE_CHANNELS, segments, segment, slots,
             slot, partial);
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

/// Tangent of the place behind the lens at which (x, y) / depth, `tangent`, is seen: by its own tangent, `moved`,
/// and by that of the lens.
static inline float2 move_seen(global const ViewParams* camera, float2 tangent, float2 moved,
                               global const ViewTangent* by) {
  if (!camera->distorts) return moved;
  float2 seen;
#pragma unroll
  for (int axis = 0; axis < 2; ++axis) {
    const float2 unit = axis == 0 ? (float2)(1.0f, 0.0f) : (float2)(0.0f, 1.0f);
    const float8 by_lens = coefficients_gradient(camera, tangent, unit);
    const float sum = dot(bend_tangent_backward(camera, tangent, unit), moved) +
                      dot(by_lens.lo, by->lens[0]) + dot(by_lens.hi, by->lens[1]);
    if (axis == 0) {
      seen.x = sum;
    } else {
      seen.y = sum;
    }
  }
  return seen;
}

/// Tangents of what transform_forward leaves. One work-item per (view, vertex).
/// in   views, models, vertex_mesh, places, world  as transform_forward has them
/// in   view_tangents   ViewTangent[direction][view]
/// in   model_tangents  ModelTangent[direction][view][mesh]
/// in   position_tangents  float4[direction][position] or, with a stride, float4[direction][view][position]
/// out  ndc_tangents    float4[direction][view][vertex]  of x, y (NDC) and view depth
/// out  world_tangents  where q.lit is set: float4[direction][...], [view][vertex] of world positions, then
///                      [view][normal], which normals.cl fills, then [view] of eyes
/// out  clip_tangents   where p.clips is set: float4[direction][view][vertex]  of homogeneous coordinates without
///                      distortion: x and y in NDC, times depth, and depth; orthographic: x, y, depth
kernel void transform_tangent(const FrameParams p, const TangentParams q,
                              global const ViewParams* restrict views, global const float4* restrict models,
                              global const uint* restrict vertex_mesh,
                              global const MeshPlace* restrict places, global const float4* restrict world,
                              global const ViewTangent* restrict view_tangents,
                              global const ModelTangent* restrict model_tangents,
                              global const float4* restrict position_tangents,
                              global float4* restrict ndc_tangents, global float4* restrict world_tangents,
                              global float4* restrict clip_tangents) {
  const uint i = (uint)get_global_id(0), count = p.views * p.vertices;
  if (i >= count) return;
  const uint view = i / p.vertices, vertex = i - view * p.vertices, mesh = vertex_mesh[vertex];
  const uint segment = view * p.meshes + mesh, position = vertex - places[mesh].vertex_shift;
  global const float4* model = models + 3 * segment;
  global const ViewParams* camera = views + view;
  const float3 w = world[i].xyz;
  const float3 c = apply_affine(camera->row[0], camera->row[1], camera->row[2], w);
  const float3 turned_in_world = w - (float3)(model[0].w, model[1].w, model[2].w);
  const float3 turned_in_camera = c - (float3)(camera->row[0].w, camera->row[1].w, camera->row[2].w);
  const float inverse_depth = p.orthographic ? 1.0f : -1.0f / c.z;
  const float2 tangent = c.xy * inverse_depth;
  const float2 seen = camera->distorts ? bend_tangent(camera, tangent) : tangent;
  const float4 projection = camera->projection;
  for (uint d = 0; d < q.directions; ++d) {
    global const ModelTangent* of_mesh = model_tangents + (size_t)d * p.views * p.meshes + segment;
    global const ViewTangent* of_view = view_tangents + d * p.views + view;
    float3 move = cross(of_mesh->rotation.xyz, turned_in_world) + of_mesh->translation.xyz;
    if (q.positions != 0) {
      const float3 own = position_tangents[(size_t)d * q.positions + view * p.position_stride + position].xyz;
      move += (float3)(dot(model[0].xyz, own), dot(model[1].xyz, own), dot(model[2].xyz, own));
    }
    const float3 in_camera = (float3)(dot(camera->row[0].xyz, move), dot(camera->row[1].xyz, move),
                                      dot(camera->row[2].xyz, move)) +
                             cross(of_view->rotation.xyz, turned_in_camera) + of_view->translation.xyz;
    const float depth = -in_camera.z;
    const float2 moved = p.orthographic ? in_camera.xy : (in_camera.xy - tangent * depth) * inverse_depth;
    const float2 ndc = move_seen(camera, tangent, moved, of_view) * projection.xy +
                       seen * of_view->projection.xy + of_view->projection.zw;
    ndc_tangents[(size_t)d * count + i] = (float4)(ndc.x, ndc.y, depth, 0.0f);
    if (q.lit) {
      global float4* const of = world_tangents + world_tangents_at(p, d);
      of[i] = (float4)(move, 0.0f);
      if (vertex == 0) of[eyes_at(p) + view] = of_view->eye;
    }
    if (!p.clips) continue;
    const float w_clip = p.orthographic ? 1.0f : -c.z, w_moved = p.orthographic ? 0.0f : depth;
    const float2 clip = in_camera.xy * projection.xy + c.xy * of_view->projection.xy +
                        projection.zw * w_moved + of_view->projection.zw * w_clip;
    clip_tangents[(size_t)d * count + i] = (float4)(clip.x, clip.y, depth, 0.0f);
  }
}
