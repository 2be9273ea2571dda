#include "renderer/frame.hpp"

#include "renderer/renderer_impl.hpp"

namespace dpr {

Frame last_frame(const Renderer& renderer, const char* caller) {
  Renderer::Impl& r = impl_of(renderer);
  r.require_forward(caller);
  return {{r.frame_number, r.views.size(), r.scene.width, r.scene.height, r.image()},
          r.geometry->positions,
          r.geometry->meshes,
          r.frame.position_stride != 0};
}

const Buffer<cl_float4>& last_tangents(Renderer& renderer, std::span<const SceneTangent> directions,
                                       const char* caller) {
  Renderer::Impl& r = impl_of(renderer);
  r.require_forward(caller);
  r.tangent(directions);
  return r.tangents.shown.images;
}

void show_normals(Renderer& renderer) {
  Renderer::Impl& r = impl_of(renderer);
  r.shown_normals.emplace(impl_of(r.device), r.scene);
  r.rendered = false;
}

const Buffer<cl_float4>& last_normals(const Renderer& renderer, const char* caller) {
  Renderer::Impl& r = impl_of(renderer);
  r.require_forward(caller);
  return r.pixel_noise ? r.shown_normals->smoothed : r.shown_normals->raster;
}

const Buffer<cl_float4>& last_normal_tangents(const Renderer& renderer) {
  return impl_of(renderer).shown_normals->tangents.images;
}

void show_depths(Renderer& renderer) {
  Renderer::Impl& r = impl_of(renderer);
  if (!r.geometry_colors) r.geometry_colors.emplace(impl_of(r.device), Attribute::depth);
  r.geometry_colors->shown_views = r.views.size();
  r.frame.color_stride = to_uint(r.geometry->colors);
}

FrameFragments last_fragments(const Renderer& renderer, const char* caller) {
  Renderer::Impl& r = impl_of(renderer);
  r.require_forward(caller);
  if (r.bands.size() > 1) {
    throw InvalidArgument(std::string("bands (") + caller + ")", std::to_string(r.bands.size()),
                          "a frame in one");
  }
  const auto plane = [&](cl_uint number) { return r.rasterize.plane(r.frame, number); };
  return {r.bin.pairs,
          r.rasterize.fragments,
          r.rasterize.pixel_starts,
          r.rasterize.list,
          plane(DPR_PLANE_DEPTH),
          plane(DPR_PLANE_LOG_OCCUPANCY),
          plane(DPR_PLANE_OCCUPANCY)};
}

void require_same_device(const Device& device, const Device& other, const char* what) {
  const Device::Impl &mine = impl_of(device), &its = impl_of(other);
  if (mine.context() == its.context() && mine.queue() == its.queue()) return;
  throw InvalidArgument(std::string("device (") + what + ")",
                        mine.info.name + (mine.device() == its.device() ? ", opened a second time" : ""),
                        "the renderer's own Device, Renderer::device()");
}

}  // namespace dpr
