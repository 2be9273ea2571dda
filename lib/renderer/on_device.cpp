// The renderer for programs that keep everything on the device: dpr/opencl_handles.hpp.
#include <algorithm>
#include <optional>

#include "base/checks.hpp"
#include "renderer/on_device.hpp"

namespace dpr {
namespace {

constexpr std::size_t k_vector = 3, k_pair = 2, k_pixel = 4;  // floats
constexpr std::size_t k_rows = 3, k_columns = 4;              // of an affine matrix

FloatVectors source(const Renderer::Impl& m, const BufferSpan& span, const VectorShape& shape,
                    const char* name) {
  return require_vectors(impl_of(m.device), span, shape, Access::read, name);
}

}  // namespace

void set_shapes(Renderer& renderer, const BufferSpan& positions, const BufferSpan& colors,
                const Events& events) {
  Renderer::Impl& m = impl_of(renderer);
  m.require_scene("set_shapes");
  const auto optional_source = [&](const BufferSpan& span, std::size_t of_view, const char* name) {
    std::optional<FloatVectors> from;
    if (span.buffer != nullptr) from = source(m, span, {m.views.size() * of_view, k_vector}, name);
    return from;
  };
  const auto from_positions = optional_source(positions, m.geometry->position_count, "positions");
  const auto from_colors = optional_source(colors, m.geometry->colors, "colors");
  enqueue(impl_of(m.device), events, [&] { m.take_shapes(from_positions, from_colors); });
}

void set_transforms(Renderer& renderer, const BufferSpan& transforms, const Events& events) {
  Renderer::Impl& m = impl_of(renderer);
  m.require_scene("set_transforms");
  const VectorShape shape{m.views.size() * m.scene.meshes.size(), k_columns, k_rows};
  const FloatVectors from = source(m, transforms, shape, "transforms");
  enqueue(impl_of(m.device), events, [&] { m.take_transforms(from); });
}

void set_view_matrices(Renderer& renderer, const BufferSpan& matrices, const Events& events) {
  Renderer::Impl& m = impl_of(renderer);
  m.require_scene("set_view_matrices");
  const FloatVectors from = source(m, matrices, {m.views.size(), k_columns, k_rows}, "matrices");
  enqueue(impl_of(m.device), events, [&] { m.take_view_matrices(from); });
}

namespace {

/// With the headroom of buffers it can still be counted.
void require_countable(std::size_t count, const char* name) {
  constexpr std::size_t k_most = 0xfffffffeU / 5 * 4;
  static_assert(with_headroom(k_most) <= 0xfffffffeU);
  if (count <= k_most) return;
  throw InvalidArgument(std::string(name) + " (reserve)", std::to_string(count),
                        "at most " + std::to_string(k_most));
}

}  // namespace

FrameCounts counts_of(const FrameRoom& room) {
  require_countable(room.pairs, "pairs");
  require_countable(room.fragments, "fragments");
  require_countable(room.contours, "contours");
  return {room.pairs, room.fragments, room.contours};
}

void reserve(Renderer& renderer, const FrameRoom& room) {
  impl_of(renderer).require_scene("reserve");
  impl_of(renderer).reserve(counts_of(room));
}

std::size_t forward_on_device(Renderer& renderer, const Events& events) {
  Renderer::Impl& m = impl_of(renderer);
  m.require_scene("forward_on_device");
  enqueue(impl_of(m.device), events, [&] { m.forward(FrameSizes::kept); });
  return m.take_emptied();
}

FrameHistory history_of(Renderer::Impl& m) {
  cl_uint4 found{};
  m.rasterize.history().download(std::span(&found, 1));
  m.rasterize.forget_history();
  const FrameCounts largest{found.s[0], found.s[1], found.s[2]};
  m.expect(largest);
  return {found.s[3], {largest.pairs, largest.fragments, largest.contours}};
}

FrameHistory frame_history(Renderer& renderer) {
  impl_of(renderer).require_scene("frame_history");
  return history_of(impl_of(renderer));
}

BufferView frame_history_view(Renderer& renderer) {
  return {impl_of(renderer).rasterize.history().cl_buffer()(), 0, sizeof(cl_uint4), 1, 4};
}

BufferRef<cl_float4> gradient_of_images(Renderer::Impl& m, const FloatVectors& from, std::size_t count) {
  const bool is_packed = from.first == 0 && from.stride == k_pixel;
  if (is_packed && !(m.pixel_noise && m.pixel_noise->blur.loads_behind_images()))
    return BufferRef<cl_float4>(from.buffer);
  const Buffer<cl_float4>& room = m.room_for_grad_images(count);
  m.made_exchange().give(from, count, vectors_of(room, 0, k_pixel));
  return room;
}

void backward_on_device(Renderer& renderer, const BufferSpan& grad_images, const Events& events) {
  Renderer::Impl& m = impl_of(renderer);
  m.require_rendered("backward_on_device");
  const std::size_t count = m.image().size();
  const FloatVectors from = source(m, grad_images, {count, k_pixel}, "grad_images");
  enqueue(impl_of(m.device), events, [&] { m.backward_on_device(gradient_of_images(m, from, count)); });
}

BufferView image_view(Renderer& renderer) {
  const Renderer::Impl& m = impl_of(renderer);
  m.require_rendered("image_view");
  return {m.image().cl_buffer()(), 0, sizeof(cl_float4), m.image().size(), k_pixel};
}

void copy_view(Renderer::Impl& m, const BufferView& view, const BufferSpan& span, const Events& events,
               const char* name) {
  const FloatVectors to =
      require_vectors(impl_of(m.device), span, {view.count, view.components}, Access::write, name);
  const FloatVectors from{view.buffer, view.offset / sizeof(float), view.stride / sizeof(float),
                          view.components};
  enqueue(impl_of(m.device), events, [&] { m.made_exchange().give(from, view.count, to); });
}

namespace {

/// Materials' exponents lie behind the three numbers of their specular coefficients, opacities come first.
std::optional<BufferView> view_of(const std::optional<DeviceGradient>& gradient, const GradientArray& array) {
  if (!gradient) return std::nullopt;
  const bool is_exponent = std::holds_alternative<std::vector<double>*>(array);
  const bool is_number = is_exponent || std::holds_alternative<std::vector<float>*>(array) ||
                         std::holds_alternative<std::vector<std::vector<float>>*>(array);
  const bool is_pair = std::holds_alternative<std::vector<glm::vec2>*>(array);
  return BufferView{gradient->values.cl_buffer()(),
                    gradient->first * sizeof(cl_float4) + (is_exponent ? k_vector * sizeof(float) : 0),
                    sizeof(cl_float4), gradient->count,
                    is_number ? 1
                    : is_pair ? k_pair
                              : k_vector};
}

/// A number, a vector or a list of vectors among the numbers, from `first` on.
BufferView numbers_view(const Buffer<float>& all, const GradientArray& array, std::size_t first,
                        std::size_t numbers) {
  const std::size_t components = std::holds_alternative<double*>(array) ? 1 : k_vector;
  return {all.cl_buffer()(), first * sizeof(float), components * sizeof(float), numbers / components,
          components};
}

}  // namespace

std::optional<BufferView> summed_view(SceneGradient& arrays, const Renderer::Impl& m,
                                      const Buffer<float>& all, const std::string& name) {
  std::optional<BufferView> found;
  std::size_t first = 0;
  for_each_array(arrays, [&](const GradientRow& row, GradientIndex index, const GradientArray& array) {
    if (!is_summed(row)) return;
    std::size_t numbers = 0;
    transform_numbers(array, [&](double value) { return ++numbers, value; });
    if (m.scene.gradients.*row.wanted && exists(row, index, m.scene, m.views) && name_of(row, index) == name)
      found = numbers_view(all, array, first, numbers);
    first += numbers;
  });
  return found;
}

void copy_images(Renderer& renderer, const BufferSpan& images, const Events& events) {
  copy_view(impl_of(renderer), image_view(renderer), images, events, "images");
}

BufferView gradient_view(Renderer& renderer, const std::string& name) {
  Renderer::Impl& m = impl_of(renderer);
  m.require_rendered("gradient_view");
  if (m.device_gradient_frame != m.frame_number)
    throw InvalidArgument("gradient_view", "no gradient of the last frame", "backward_on_device() first");
  SceneGradient arrays = m.empty_gradient();
  std::optional<BufferView> found = summed_view(arrays, m, m.grad_numbers, name);
  for_each_array(arrays, [&](const GradientRow& row, GradientIndex index, const GradientArray& array) {
    if (is_summed(row) || found) return;
    const bool of_textures = is_of_texture(id_of(row.wanted));
    const std::size_t parts = of_textures ? m.scene.meshes[index.item].mesh.textures.size() : 1;
    for (std::size_t k = 0; k < parts; ++k) {
      if (name == name_of(row, index) + (of_textures ? checks::element("", k) : ""))
        found = view_of(m.mesh_gradient(row, index.item, k), array);
    }
  });
  if (found) return *found;
  throw InvalidArgument("name (gradient_view)", "\"" + name + "\"",
                        "a gradient that the scene has and GradientRequest asks for, such as "
                        "\"meshes[0].positions\", \"views[0].camera.rotation\" or \"sigma\"");
}

void copy_gradient(Renderer& renderer, const std::string& name, const BufferSpan& gradient,
                   const Events& events) {
  copy_view(impl_of(renderer), gradient_view(renderer, name), gradient, events, "gradient");
}

cl_mem image_handle(const Renderer& renderer) {
  impl_of(renderer).require_forward("image_handle");
  return impl_of(renderer).image().cl_buffer()();
}

SceneGradient backward(Renderer& renderer, cl_mem grad_images) {
  Renderer::Impl& m = impl_of(renderer);
  m.require_forward("backward");
  const std::size_t count = m.image().size();
  const FloatVectors from = source(m, {grad_images}, {count, k_pixel}, "grad_images");
  return m.backward(gradient_of_images(m, from, count));
}

}  // namespace dpr
