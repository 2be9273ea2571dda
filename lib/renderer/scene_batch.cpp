// The scenes of a batch, each by a renderer of its own.
#include "dpr/scene_batch.hpp"

#include <string>
#include <utility>

#include "base/checks.hpp"
#include "dpr/opencl_handles.hpp"
#include "renderer/buffer_span.hpp"
#include "renderer/scene_batch_impl.hpp"
#include "renderer/setter_checks.hpp"

namespace dpr {
namespace {

constexpr std::size_t k_rgba = 4;  // floats of a pixel

void require_size_of_first(const Scene& scene, const Scene& first, const std::string& name) {
  if (scene.width == first.width && scene.height == first.height) return;
  throw InvalidArgument("size (" + name + ")", checks::size(scene.width, scene.height),
                        checks::size(first.width, first.height) + ", the first scene's");
}

/// Throws InvalidArgument, which says in which of the scenes, for what a renderer refuses.
void check_scenes(std::span<const Scene> scenes) {
  if (scenes.empty()) throw InvalidArgument("scenes (SceneBatch)", "none", "at least one");
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    const std::string name = checks::element("scenes", i);
    try {
      validate(scenes[i]);
      require_scales(scenes[i].camera, scenes[i].smoothing, scenes[i].lights.has_value());
    } catch (const InvalidArgument& error) {
      throw InvalidArgument(name + ": " + error.argument(), error.got(), error.expected());
    }
    require_size_of_first(scenes[i], scenes[0], name);
  }
}

/// Enqueues a copy of as many pixels as `to` has, from `first` on.
void copy_part(Device::Impl& device, const BufferRef<cl_float4>& from, std::size_t first, std::size_t count,
               const Buffer<cl_float4>& to) {
  constexpr std::size_t k_bytes = sizeof(cl_float4);
  check_cl(device.queue.enqueueCopyBuffer(cl::Buffer(from.handle(), /*retain*/ true), to.cl_buffer(),
                                          first * k_bytes, 0, count * k_bytes),
           "clEnqueueCopyBuffer");
}

}  // namespace

void SceneBatch::Impl::require_one_size() const {
  for (std::size_t i = 0; i < renderers.size(); ++i)
    require_size_of_first(renderers[i].scene(), renderers[0].scene(), checks::element("scenes", i));
  constexpr std::size_t k_most_pixels = 0xfffffffeU / DPR_PIXEL_CHANNELS;
  if (views() <= k_most_pixels / pixels_per_view()) return;
  throw InvalidArgument("views (SceneBatch)", std::to_string(views()),
                        "at most " + std::to_string(k_most_pixels / pixels_per_view()) + " of this size");
}

std::size_t SceneBatch::Impl::views() const {
  std::size_t count = 0;
  for (const Renderer& renderer : renderers) count += renderer.views().size();
  return count;
}

std::size_t SceneBatch::Impl::pixels_per_view() const {
  const Scene& scene = renderers.front().scene();
  return static_cast<std::size_t>(scene.width) * static_cast<std::size_t>(scene.height);
}

void SceneBatch::Impl::require_forward(const char* caller) {
  if (frames.empty()) throw InvalidArgument(caller, "no images of the scenes", "forward() first");
  for (std::size_t i = 0; i < renderers.size(); ++i) {
    const Renderer::Impl& scene = impl_of(renderers[i]);
    if (scene.rendered && scene.frame_number == frames[i]) continue;
    throw InvalidArgument(std::string(checks::element("scenes", i)) + " (" + caller + ")",
                          "a scene that was set or rendered since forward()", "forward() again");
  }
  if (is_gathered) return;
  image.resize(impl_of(device), views() * pixels_per_view());
  std::size_t first = 0;
  for (Renderer& renderer : renderers) {
    impl_of(renderer).require_forward(caller);
    const Buffer<cl_float4>& own = impl_of(renderer).image();
    own.copy_to(image, first);
    first += own.size();
  }
  is_gathered = true;
}

FrameImages SceneBatch::Impl::images() const {
  const Scene& scene = renderers.front().scene();
  return {frame_number, views(), scene.width, scene.height, image};
}

std::vector<SceneGradient> SceneBatch::Impl::backward(const BufferRef<cl_float4>& grad_images,
                                                      std::span<const AddToGradient> add_to_positions) {
  std::size_t first = 0;
  for (std::size_t i = 0; i < renderers.size(); ++i) {
    Renderer::Impl& scene = impl_of(renderers[i]);
    const std::size_t pixels = scene.image().size();
    const Buffer<cl_float4>& room = scene.room_for_grad_images(pixels);
    copy_part(impl_of(device), grad_images, first, pixels, room);
    scene.enqueue_backward(room, add_to_positions.empty() ? AddToGradient() : add_to_positions[i]);
    first += pixels;
  }
  std::vector<SceneGradient> gradients;
  for (Renderer& renderer : renderers) gradients.push_back(impl_of(renderer).read_gradient());
  return gradients;
}

SceneBatch::SceneBatch(Device device) : impl_(std::make_unique<Impl>(std::move(device))) {}
SceneBatch::~SceneBatch() = default;
SceneBatch::SceneBatch(SceneBatch&&) noexcept = default;
SceneBatch& SceneBatch::operator=(SceneBatch&&) noexcept = default;

/// Renderers that are there already keep their kernels and buffers.
void SceneBatch::set_scenes(std::span<const Scene> scenes) {
  check_scenes(scenes);
  Impl& m = *impl_;
  m.frames.clear();
  std::vector<Renderer> renderers = std::exchange(m.renderers, {});
  while (renderers.size() > scenes.size()) renderers.pop_back();
  while (renderers.size() < scenes.size()) renderers.emplace_back(m.device);
  for (std::size_t i = 0; i < scenes.size(); ++i) impl_of(renderers[i]).set_scene(scenes[i]);
  m.renderers = std::move(renderers);
}

std::size_t SceneBatch::scenes() const { return impl_->renderers.size(); }
std::size_t SceneBatch::views() const { return impl_->views(); }
const Device& SceneBatch::device() const { return impl_->device; }

Renderer& SceneBatch::renderer(std::size_t scene) {
  if (scene < scenes()) return impl_->renderers[scene];
  throw InvalidArgument("scene (SceneBatch::renderer)", std::to_string(scene),
                        "below " + std::to_string(scenes()));
}

void SceneBatch::forward() {
  Impl& m = *impl_;
  m.frames.clear();
  m.is_gathered = false;
  if (m.renderers.empty()) throw InvalidArgument("SceneBatch::forward", "no scenes", "set_scenes() first");
  m.require_one_size();
  std::vector<std::uint64_t> frames;
  for (Renderer& renderer : m.renderers) {
    renderer.forward();
    frames.push_back(impl_of(renderer).frame_number);
  }
  m.frames = std::move(frames);
  m.frame_number = next_frame_number();
}

Image SceneBatch::image(std::size_t view) const {
  Impl& m = *impl_;
  m.require_forward("SceneBatch::image");
  if (view >= m.views())
    throw InvalidArgument("view", std::to_string(view), "below " + std::to_string(m.views()));
  const FrameImages images = m.images();
  Image image(images.width, images.height);
  impl_of(m.device).read(m.image.cl_buffer(), view * m.pixels_per_view() * sizeof(cl_float4),
                         std::as_writable_bytes(std::span(image.pixels)));
  return image;
}

void SceneBatch::read_pixels(std::span<glm::vec4> pixels) const {
  Impl& m = *impl_;
  m.require_forward("SceneBatch::read_pixels");
  require_pixel_count(pixels.size(), m.image.size());
  impl_of(m.device).read(m.image.cl_buffer(), 0, std::as_writable_bytes(pixels));
}

std::vector<SceneGradient> SceneBatch::backward(std::span<const Image> grad_images) {
  Impl& m = *impl_;
  m.require_forward("SceneBatch::backward");
  const FrameImages images = m.images();
  if (grad_images.size() != images.views) {
    throw InvalidArgument("grad_images", std::to_string(grad_images.size()) + " images",
                          "one for each of the " + std::to_string(images.views) + " views");
  }
  m.host_grad_images.upload(impl_of(m.device), checked_pixels(grad_images, images.width, images.height));
  return m.backward(m.host_grad_images);
}

std::vector<SceneGradient> SceneBatch::backward_pixels(std::span<const glm::vec4> grad_pixels) {
  Impl& m = *impl_;
  m.require_forward("SceneBatch::backward_pixels");
  require_pixel_count(grad_pixels.size(), m.image.size());
  checks::require_finite(grad_pixels, "grad_pixels");
  m.host_grad_images.resize(impl_of(m.device), grad_pixels.size());
  impl_of(m.device).write(m.host_grad_images.cl_buffer(), 0, std::as_bytes(grad_pixels));
  return m.backward(m.host_grad_images);
}

RenderStatistics SceneBatch::statistics() const {
  Impl& m = *impl_;
  m.require_forward("SceneBatch::statistics");
  RenderStatistics sum;
  for (const Renderer& renderer : m.renderers) {
    const RenderStatistics own = renderer.statistics();
    sum.faces += own.faces;
    sum.faces_dropped += own.faces_dropped;
    sum.pairs += own.pairs;
    sum.fragments += own.fragments;
    sum.bands += own.bands;
    sum.device_bytes += own.device_bytes;
  }
  sum.device_bytes += m.image.capacity_bytes() + m.host_grad_images.capacity_bytes();
  return sum;
}

BufferView image_view(SceneBatch& batch) {
  SceneBatch::Impl& m = impl_of(batch);
  m.require_forward("image_view");
  return {m.image.cl_buffer()(), 0, sizeof(cl_float4), m.image.size(), k_rgba};
}

std::vector<SceneGradient> backward(SceneBatch& batch, cl_mem grad_images) {
  SceneBatch::Impl& m = impl_of(batch);
  m.require_forward("backward");
  const VectorShape shape{m.image.size(), k_rgba};
  const FloatVectors from =
      require_vectors(impl_of(m.device), {grad_images}, shape, Access::read, "grad_images");
  return m.backward(BufferRef<cl_float4>(from.buffer));
}

}  // namespace dpr
