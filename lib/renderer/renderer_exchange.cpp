// Inputs of the renderer from buffers, by copies on the device.
#include <optional>
#include <utility>

#include "renderer/renderer_impl.hpp"

namespace dpr {

Exchange& Renderer::Impl::made_exchange() {
  if (!exchange) exchange.emplace(impl_of(device));
  return *exchange;
}

void Renderer::Impl::take(const ArrayRef& at, std::size_t count, const FloatVectors& from) {
  const MeshArray& row = row_of(at.id);
  made_exchange().take(from, count, row.device(*geometry), row.first(*geometry, at));
  row.changed(*this, at.mesh, /*on_host*/ false);
  rendered = false;
}

void Renderer::Impl::forget_positions(std::size_t mesh) noexcept {
  clip_planes.forget(mesh);
  has_moved = true;
  if (pixel_noise && pixel_noise->edges) pixel_noise->back_faces.forget(mesh);
}

void Renderer::Impl::take_shapes(const std::optional<FloatVectors>& positions,
                                 const std::optional<FloatVectors>& colors) {
  const auto take = [&](const std::optional<FloatVectors>& from, std::size_t of_view,
                        Buffer<cl_float4>& values) {
    const std::size_t count = from ? views.size() * of_view : 0;
    values.resize(impl_of(device), count);
    if (from) made_exchange().take(*from, count, values, 0);
    return static_cast<cl_uint>(from ? of_view : 0);
  };
  const cl_uint position_stride = take(positions, geometry->position_count, spare_view_positions_);
  const cl_uint color_stride = take(colors, geometry->colors, spare_view_colors_);

  std::swap(geometry->view_positions, spare_view_positions_);
  std::swap(geometry->view_colors, spare_view_colors_);
  frame.position_stride = position_stride;
  frame.color_stride = color_stride;
  clip_planes.set_boxes_of_views({});
  if (positions) clip_planes.forget_views();
  has_moved = true;
  rendered = false;
}

void Renderer::Impl::take_transforms(const FloatVectors& from) {
  made_exchange().take(from, views.size() * scene.meshes.size() * from.rows, device_views.models, 0);
  has_device_poses = true;
  rendered = false;
}

void Renderer::Impl::take_view_matrices(const FloatVectors& from) {
  made_exchange().take_cameras(from, views.size(), frame.orthographic != 0, device_views.cameras);
  has_device_poses = has_device_cameras = true;
  rendered = false;
}

}  // namespace dpr
