// Inputs of the renderer from buffers, by copies on the device.
#include <optional>
#include <utility>

#include "renderer/renderer_impl.hpp"

namespace dpr {

Exchange& Renderer::Impl::made_exchange() {
  if (!exchange) exchange.emplace(device.impl());
  return *exchange;
}

void Renderer::Impl::take_positions(std::size_t mesh, const FloatVectors& from) {
  const MeshRange& range = geometry->meshes[mesh];
  made_exchange().take(from, range.vertices, geometry->positions, range.first_position);
  forget_positions(mesh);
  rendered = false;
}

void Renderer::Impl::forget_positions(std::size_t mesh) noexcept {
  near_plane.forget(mesh);
  has_moved = true;
  if (pixel_noise && pixel_noise->edges) pixel_noise->back_faces.forget(mesh);
}

void Renderer::Impl::take_colors(std::size_t mesh, const FloatVectors& from) {
  const MeshRange& range = geometry->meshes[mesh];
  made_exchange().take(from, range.colors, geometry->color_values, range.first_color);
  rendered = false;
}

void Renderer::Impl::take_texels(std::size_t mesh, std::size_t texture, const FloatVectors& from) {
  const shared::Texture& t = geometry->textures.list[geometry->meshes[mesh].first_texture + texture];
  made_exchange().take(from, std::size_t{t.width} * t.height, geometry->textures.texel_values, t.first);
  geometry->textures.has_levels = false;
  rendered = false;
}

/// The edges keep the seams that the host knows.
void Renderer::Impl::take_texcoords(std::size_t mesh, const FloatVectors& from) {
  const MeshRange& range = geometry->meshes[mesh];
  made_exchange().take(from, range.texcoords, geometry->textures.texcoord_values, range.first_texcoord);
  rendered = false;
}

/// The edges keep the jumps that the host knows.
void Renderer::Impl::take_normals(std::size_t mesh, const FloatVectors& from) {
  const MeshRange& range = geometry->meshes[mesh];
  made_exchange().take(from, range.normals, geometry->given_normals.values, range.first_normal);
  rendered = false;
}

void Renderer::Impl::take_materials(std::size_t mesh, const FloatVectors& from) {
  const MeshRange& range = geometry->meshes[mesh];
  made_exchange().take(from, range.materials, geometry->materials.values, range.first_material);
  rendered = false;
}

void Renderer::Impl::take_shapes(const std::optional<FloatVectors>& positions,
                                 const std::optional<FloatVectors>& colors) {
  const auto take = [&](const std::optional<FloatVectors>& from, std::size_t of_view,
                        Buffer<cl_float4>& values) {
    const std::size_t count = from ? views.size() * of_view : 0;
    values.resize(device.impl(), count);
    if (from) made_exchange().take(*from, count, values, 0);
    return static_cast<cl_uint>(from ? of_view : 0);
  };
  const cl_uint position_stride = take(positions, geometry->position_count, spare_view_positions_);
  const cl_uint color_stride = take(colors, geometry->colors, spare_view_colors_);

  std::swap(geometry->view_positions, spare_view_positions_);
  std::swap(geometry->view_colors, spare_view_colors_);
  frame.position_stride = position_stride;
  frame.color_stride = color_stride;
  near_plane.set_boxes_of_views({});
  if (positions) near_plane.forget_views();
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
