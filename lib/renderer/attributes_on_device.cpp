// Images of attributes for programs that keep everything on the device: dpr/opencl_handles.hpp.
#include "base/checks.hpp"
#include "dpr/error.hpp"
#include "renderer/attribute_images_impl.hpp"
#include "renderer/frame.hpp"
#include "renderer/on_device.hpp"

namespace dpr {
namespace {

constexpr std::size_t k_rgba = 4;  // floats

Device::Impl& device_of(const AttributeImages& images) { return impl_of(impl_of(images).renderer.device()); }

}  // namespace

void set_values(AttributeImages& images, const BufferSpan& values, std::size_t vertices,
                const Events& events) {
  AttributeImages::Impl& m = impl_of(images);
  m.require_own_values();
  const FloatVectors from =
      require_vectors(device_of(images), values, {vertices, m.channels}, Access::read, "values");
  enqueue(device_of(images), events, [&] { m.take_values(from, vertices); });
}

void reserve(AttributeImages& images, const FrameRoom& room) {
  AttributeImages::Impl& m = impl_of(images);
  m.room = counts_of(room);
  if (impl_of(m.renderer).geometry) impl_of(m.renderer).reserve(*m.room);
}

std::size_t forward_on_device(AttributeImages& images, const Renderer& renderer, const Events& events) {
  AttributeImages::Impl& m = impl_of(images);
  require_same_device(m.renderer.device(), renderer.device(), "forward_on_device");
  impl_of(renderer).require_rendered("forward_on_device");
  enqueue(device_of(images), events, [&] { m.forward(impl_of(renderer), FrameSizes::kept); });
  return impl_of(m.renderer).take_emptied();
}

FrameHistory frame_history(AttributeImages& images) {
  impl_of(images).require_forward("frame_history");
  return history_of(impl_of(impl_of(images).renderer));
}

void backward_on_device(AttributeImages& images, const BufferSpan& grad_images, const Events& events) {
  AttributeImages::Impl& m = impl_of(images);
  m.require_forward("backward_on_device");
  const std::size_t count = m.images().size();
  const FloatVectors from =
      require_vectors(device_of(images), grad_images, {count, k_rgba}, Access::read, "grad_images");
  enqueue(device_of(images), events,
          [&] { m.backward_on_device(gradient_of_images(impl_of(m.renderer), from, count)); });
}

BufferView image_view(const AttributeImages& images) {
  const AttributeImages::Impl& m = impl_of(images);
  m.require_forward("image_view");
  return {m.images().cl_buffer()(), 0, sizeof(cl_float4), m.images().size(), k_rgba};
}

void copy_images(AttributeImages& images, const BufferSpan& to, const Events& events) {
  copy_view(impl_of(impl_of(images).renderer), image_view(images), to, events, "images");
}

BufferView AttributeImages::Impl::gradient_view(const std::string& name) {
  Renderer::Impl& r = impl_of(renderer);
  if (r.device_gradient_frame != r.frame_number)
    throw InvalidArgument("gradient_view", "no gradient of the last images", "backward_on_device() first");
  const auto rows = [&](std::size_t first, std::size_t count) {
    return BufferView{grad_rows_.cl_buffer()(), first * channels * sizeof(float), channels * sizeof(float),
                      count, channels};
  };
  const auto positions = [&](std::size_t first, std::size_t count) {
    return BufferView{grad_positions_.cl_buffer()(), first * sizeof(cl_float4), sizeof(cl_float4), count, 3};
  };
  if (!attribute && name == "values") return rows(0, vertices_.rows);
  if (wanted_.positions && has_own_shapes_ && name == "shapes.positions")
    return positions(0, views * positions_.rows);
  std::size_t first_position = 0;
  for (std::size_t m = 0; m < meshes_.size(); ++m) {
    if (meshes_[m].instance_of) continue;
    const std::string mesh = checks::element("meshes", m);
    if (wanted_.positions && !has_own_shapes_ && name == mesh + ".positions")
      return positions(first_position, meshes_[m].vertices);
    if (attribute == Attribute::texcoords && wanted_.texcoords && name == mesh + ".texcoords")
      return rows(texcoords_->first[m], texcoords_->first[m + 1] - texcoords_->first[m]);
    first_position += meshes_[m].vertices;
  }
  SceneGradient arrays = empty_gradient();
  if (const auto numbers = summed_view(arrays, r, grad_numbers_, name)) return *numbers;
  throw InvalidArgument("name (gradient_view)", "\"" + name + "\"",
                        "a gradient that attribute images have and the scene asks for, such as "
                        "\"meshes[0].positions\", \"views[0].camera.rotation\", \"sigma\" or \"values\"");
}

BufferView gradient_view(AttributeImages& images, const std::string& name) {
  impl_of(images).require_forward("gradient_view");
  return impl_of(images).gradient_view(name);
}

void copy_gradient(AttributeImages& images, const std::string& name, const BufferSpan& gradient,
                   const Events& events) {
  copy_view(impl_of(impl_of(images).renderer), gradient_view(images, name), gradient, events, "gradient");
}

}  // namespace dpr
