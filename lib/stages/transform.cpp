#include "stages/transform.hpp"

#include <algorithm>

namespace dpr {

void Transform::forward(const shared::FrameParams& p, const DeviceViews& views, const Geometry& geometry,
                        bool has_normals) {
  const std::size_t count = std::size_t{p.views} * p.vertices;
  world.resize(device_, count + (has_normals ? std::size_t{p.views} * p.normals : 0));
  ndc.resize(device_, count);
  launch_(count, kernel::transform_forward{.p = p,
                                           .views = views.cameras,
                                           .models = views.models,
                                           .positions = geometry.positions_of(p),
                                           .vertex_mesh = geometry.vertex_mesh,
                                           .places = geometry.places,
                                           .world = world,
                                           .ndc = ndc});
}

void Transform::backward(const shared::FrameParams& p, const DeviceViews& views, bool lit,
                         const Buffer<cl_float4>& grad_clip, const Buffer<cl_float4>& grad_lit,
                         Buffer<cl_float4>& grad) {
  const std::size_t segments = std::size_t{p.views} * p.meshes;
  slots = slots_of_segments(p.vertices / std::max(p.meshes, 1U));
  partial_sums.resize(device_,
                      (p.distorts != 0 ? DPR_LENS_CHANNELS : DPR_POSE_CHANNELS) * segments * 2 * slots);
  if (p.distorts != 0) {
    launch_(segments * slots, kernel::transform_backward_lens{.p = p,
                                                              .slots = to_uint(slots),
                                                              .views = views.cameras,
                                                              .starts = views.vertex_starts,
                                                              .world = world,
                                                              .grad_ndc = grad,
                                                              .partial = partial_sums});
  }
  launch_(segments * slots, kernel::transform_backward{.p = p,
                                                       .lit = cl_uint{lit},
                                                       .slots = to_uint(slots),
                                                       .views = views.cameras,
                                                       .models = views.models,
                                                       .starts = views.vertex_starts,
                                                       .world = world,
                                                       .grad_clip = grad_clip,
                                                       .grad_lit = grad_lit,
                                                       .grad = grad,
                                                       .partial = partial_sums});
}

void Transform::backward_positions(const shared::FrameParams& p, const DeviceViews& views,
                                   const Geometry& geometry, const Buffer<cl_float4>& grad_world) {
  const std::size_t count = p.position_stride != 0 ? std::size_t{p.views} * p.vertices : p.vertices;
  grad_positions.resize(device_,
                        p.position_stride != 0 ? p.views * geometry.position_count : geometry.position_count);
  launch_(count, kernel::transform_backward_positions{.p = p,
                                                      .models = views.models,
                                                      .vertex_mesh = geometry.vertex_mesh,
                                                      .places = geometry.places,
                                                      .grad_world = grad_world,
                                                      .grad_positions = grad_positions});
}

void Transform::tangent(const shared::FrameParams& p, const DeviceViews& views, const Geometry& geometry,
                        Tangents& tangents) {
  const std::size_t count = std::size_t{p.views} * p.vertices;
  tangents.ndc.resize(device_, tangents.params.directions * count);
  tangents.world.resize(device_, tangents.params.lit != 0
                                     ? tangents.params.directions * p.views * (p.vertices + p.normals + 1)
                                     : 1);  // an argument all the same
  tangents.clip.resize(device_, p.clips != 0 ? tangents.params.directions * count : 1);
  launch_(count, kernel::transform_tangent{.p = p,
                                           .q = tangents.params,
                                           .views = views.cameras,
                                           .models = views.models,
                                           .vertex_mesh = geometry.vertex_mesh,
                                           .places = geometry.places,
                                           .world = world,
                                           .view_tangents = tangents.views,
                                           .model_tangents = tangents.models,
                                           .position_tangents = tangents.positions,
                                           .ndc_tangents = tangents.ndc,
                                           .world_tangents = tangents.world,
                                           .clip_tangents = tangents.clip});
}

}  // namespace dpr
