// The public face of the renderer: checks what it is given and hands it to the pipeline.
#include "dpr/renderer.hpp"

#include <algorithm>

#include "base/checks.hpp"
#include "renderer/renderer_impl.hpp"
#include "renderer/setter_checks.hpp"
#include "scene/light_table.hpp"
#include "scene/see_through.hpp"

namespace dpr {

Renderer::Renderer(Device device) : impl_(std::make_unique<Impl>(std::move(device))) {}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;

void Renderer::set_scene(const Scene& scene) {
  validate(scene);
  require_scales(scene.camera, scene.smoothing, scene.lights.has_value());
  impl_->set_scene(scene);
}

void Renderer::set_views(std::span<const View> views, std::size_t first_view) {
  impl_->require_scene("Renderer::set_views");
  check_views(impl_->scene, views);
  impl_->set_views(views, first_view);
}

void Renderer::set_smoothing(const Smoothing& smoothing) {
  impl_->require_scene("Renderer::set_smoothing");
  validate(smoothing);
  for (const View& view : impl_->views) {
    require_scales(view.camera, smoothing, impl_->scene.lights.has_value());
  }
  if (impl_->is_see_through) require_sees_through(smoothing);
  impl_->set(impl_->prepare(smoothing));
}

void Renderer::set_shapes(std::span<const glm::vec3> positions, std::span<const glm::vec3> colors) {
  Impl& m = *impl_;
  m.require_scene("Renderer::set_shapes");
  const auto check = [&](const char* name, std::span<const glm::vec3> values, std::size_t of_view) {
    if (values.empty()) return;
    require_count(name, values, m.views.size() * of_view);
    check_values(name, values);
  };
  check("positions", positions, m.geometry->position_count);
  check("colors", colors, m.geometry->colors);
  m.set_shapes(positions, colors);
}

void Renderer::set_lights(const std::optional<Lights>& lights) {
  impl_->require_scene("Renderer::set_lights");
  check_lights(impl_->scene, impl_->views, lights);
  impl_->set_lights(span_of(lights));
}

void Renderer::set_cull(Cull cull) {
  impl_->require_scene("Renderer::set_cull");
  checks::require_enumerator(cull, Cull::front, "cull (Renderer::set_cull)");
  impl_->set_cull(cull);
}

void Renderer::set_background(const glm::vec3& background) {
  impl_->require_scene("Renderer::set_background");
  checks::require_finite(background, "background");
  impl_->scene.background = background;
  impl_->rendered = false;
}

void Renderer::set_gradients(const GradientRequest& gradients) {
  impl_->require_scene("Renderer::set_gradients");
  impl_->scene.gradients = gradients;
  impl_->gradient_map.reset();
  impl_->device_gradient_frame = 0;  // its gradients are those of another request
}

const Scene& Renderer::scene() const { return impl_->scene; }
std::span<const View> Renderer::views() const { return impl_->views; }
const Device& Renderer::device() const { return impl_->device; }

namespace {

/// The pixels of a frame from `first` on. Blocks.
void read_image(const Renderer::Impl& m, std::size_t first, std::span<glm::vec4> pixels) {
  static_assert(sizeof(glm::vec4) == sizeof(cl_float4));
  impl_of(m.device).read(m.image().cl_buffer(), first * sizeof(cl_float4), std::as_writable_bytes(pixels));
}

}  // namespace

Image Renderer::image(std::size_t view) const {
  Impl& m = *impl_;
  m.require_forward("Renderer::image");
  if (view >= m.views.size()) {
    throw InvalidArgument("view", std::to_string(view), "below " + std::to_string(m.views.size()));
  }
  Image image(m.scene.width, m.scene.height);
  read_image(m, view * image.pixels.size(), image.pixels);
  return image;
}

void Renderer::read_pixels(std::span<glm::vec4> pixels) const {
  Impl& m = *impl_;
  m.require_forward("Renderer::read_pixels");
  require_pixel_count(pixels.size(), m.image().size());
  read_image(m, 0, pixels);
}

namespace {

/// Of the gradient of all pixels, which is not copied: the host waits for what comes of it anyway.
SceneGradient backward_from(Renderer::Impl& m, std::span<const std::byte> grad_pixels) {
  const Buffer<cl_float4>& room = m.room_for_grad_images(m.image().size());
  const LentWrite write(impl_of(m.device), room.cl_buffer(), grad_pixels);
  return m.backward(room);
}

}  // namespace

SceneGradient Renderer::backward_pixels(std::span<const glm::vec4> grad_pixels) {
  Impl& m = *impl_;
  m.require_forward("Renderer::backward_pixels");
  require_pixel_count(grad_pixels.size(), m.image().size());
  checks::require_finite(grad_pixels, "grad_pixels");
  return backward_from(m, std::as_bytes(grad_pixels));
}

SceneGradient Renderer::backward(std::span<const Image> grad_images) {
  Impl& m = *impl_;
  m.require_forward("Renderer::backward");
  if (grad_images.size() != m.views.size()) {
    throw InvalidArgument("grad_images", std::to_string(grad_images.size()) + " images",
                          "one for each of the " + std::to_string(m.views.size()) + " views");
  }
  const std::vector<cl_float4> pixels = checked_pixels(grad_images, m.scene.width, m.scene.height);
  return backward_from(m, std::as_bytes(std::span(pixels)));
}

RenderStatistics Renderer::statistics() const {
  Impl& m = *impl_;
  m.require_forward("Renderer::statistics");
  RenderStatistics s;
  s.faces = std::size_t{m.frame.views} * m.frame.faces;
  s.faces_dropped = static_cast<std::size_t>(std::ranges::count(m.setup.kept.download(), cl_uchar{0}));
  s.pairs = m.bin.pairs;
  s.fragments = m.rasterize.frame_fragments;
  s.bands = m.bands.size();
  s.device_bytes = m.bytes();
  return s;
}

std::size_t Renderer::Impl::bytes() const {
  return (geometry ? geometry->bytes() : 0) + transform.bytes() + setup.bytes() + clip.bytes() + bin.bytes() +
         rasterize.bytes() + shade.bytes() + occupancy.bytes() + opacity.bytes() + aggregate.bytes() +
         (texels ? texels->bytes() : 0) + (texel_opacities ? texel_opacities->bytes() : 0) + gather.bytes() +
         reduce.bytes() + tangents.bytes() + (shown_normals ? shown_normals->bytes() : 0) +
         (aov ? aov->bytes() : 0) + (surface_samples ? surface_samples->bytes() : 0) +
         own_samples_.capacity_bytes() + own_pixels_.capacity_bytes() + own_tangents_.capacity_bytes() +
         own_group_.capacity_bytes() + own_image_.capacity_bytes() + grad_group_.capacity_bytes() +
         (pixel_noise ? pixel_noise->bytes() : 0) + ViewSet::bytes() + hidden_.capacity_bytes() +
         spare_views_.bytes() + spare_values_.capacity_bytes() + spare_view_positions_.capacity_bytes() +
         spare_view_colors_.capacity_bytes() + packed_.capacity_bytes() + grad_images_.capacity_bytes() +
         grad_vertices.capacity_bytes() + grad_lit.capacity_bytes() + grad_colors.capacity_bytes() +
         grad_texcoords.capacity_bytes() + material_channels.capacity_bytes() +
         grad_materials.capacity_bytes() + grad_opacities.capacity_bytes() + grad_numbers.capacity_bytes() +
         gradient_sums_.capacity_bytes() + (gradient_map ? gradient_map->bytes() : 0) +
         aov_surface.capacity_bytes() + aov_coverage.capacity_bytes() + all_pixels_.starts.capacity_bytes() +
         all_views_.starts.capacity_bytes() + pixel_parts_.capacity_bytes() +
         (corner_texcoords ? corner_texcoords->bytes() : 0);
}

}  // namespace dpr
