#include "stages/transform.hpp"

#include <algorithm>

namespace dpr {

Transform::Transform(Device::Impl& device)
    : device_(device),
      forward_(device, "transform.cl", "transform_forward"),
      backward_(device, "transform.cl", "transform_backward"),
      backward_lens_(device, "transform.cl", "transform_backward_lens"),
      backward_positions_(device, "transform.cl", "transform_backward_positions") {}

void Transform::forward(const shared::FrameParams& p, const DeviceViews& views, const Geometry& geometry) {
  const std::size_t count = std::size_t{p.views} * p.vertices;
  world.resize(device_, count);
  ndc.resize(device_, count);
  forward_(count, p, views.cameras, views.models, geometry.positions_of(p), geometry.vertex_mesh,
           geometry.places, world, ndc);
}

void Transform::backward(const shared::FrameParams& p, const DeviceViews& views, bool lit,
                         const Buffer<cl_float4>& grad_clip, const Buffer<cl_float4>& grad_lit,
                         Buffer<cl_float4>& grad) {
  const std::size_t segments = std::size_t{p.views} * p.meshes;
  slots = slots_of_segments(p.vertices / std::max(p.meshes, 1U));
  partial_sums.resize(device_,
                      (p.distorts != 0 ? DPR_LENS_CHANNELS : DPR_POSE_CHANNELS) * segments * 2 * slots);
  if (p.distorts != 0) {
    backward_lens_(segments * slots, p, to_uint(slots), views.cameras, views.vertex_starts, world, grad,
                   partial_sums);
  }
  backward_(segments * slots, p, lit ? 1 : 0, to_uint(slots), views.cameras, views.models,
            views.vertex_starts, world, grad_clip, grad_lit, grad, partial_sums);
}

void Transform::backward_positions(const shared::FrameParams& p, const DeviceViews& views,
                                   const Geometry& geometry, const Buffer<cl_float4>& grad_world) {
  const std::size_t count = p.position_stride != 0 ? std::size_t{p.views} * p.vertices : p.vertices;
  grad_positions.resize(device_,
                        p.position_stride != 0 ? p.views * geometry.position_count : geometry.position_count);
  backward_positions_(count, p, views.models, geometry.vertex_mesh, geometry.places, grad_world,
                      grad_positions);
}

}  // namespace dpr
