// Auxiliary outputs and images of attributes in the C interface.
#include <algorithm>

#include "base/checks.hpp"
#include "c/buffers.hpp"
#include "dpr/aov.hpp"
#include "renderer/attribute_images_impl.hpp"
#include "renderer/on_device.hpp"

using dpr::InvalidArgument;
using namespace dpr::c;

namespace dpr::c {
namespace {

constexpr std::size_t k_channels_of_pixel = 4;  // floats

AttributeImages& images_of(dpr_attribute* attribute) { return deref(attribute, "attribute").images; }

std::size_t floats_of(Aov aov) {
  if (aov == Aov::normal || aov == Aov::barycentrics) return 3;
  return aov == Aov::uv ? 2 : 1;
}

std::size_t count_of(const Renderer& renderer, Aov aov) {
  impl_of(renderer).require_scene("auxiliary output");
  const Scene& scene = renderer.scene();
  require_shown(scene, aov);
  return renderer.views().size() * static_cast<std::size_t>(scene.width) *
         static_cast<std::size_t>(scene.height) * floats_of(aov);
}

/// A view's pixels of the output, from where `out` points on; behind them.
float* write_output(const AuxiliaryOutputs& outputs, Aov aov, float* out) {
  const Image image = aov_image(outputs, aov);
  for (const glm::vec4& pixel : image.pixels) {
    for (std::size_t k = 0; k < floats_of(aov); ++k) *out++ = pixel[static_cast<int>(k)];
  }
  return out;
}

std::size_t image_floats_of(const dpr_attribute& attribute) {
  const AttributeImages::Impl& m = impl_of(attribute.images);
  m.require_forward("dpr_attribute");
  return m.images().size() * k_channels_of_pixel;
}

/// [group][view] of the images' size.
std::vector<Image> to_grad_images(const dpr_attribute& attribute, const float* grad, std::size_t count) {
  require_count(count, image_floats_of(attribute), "grad");
  const AttributeImages::Impl& m = impl_of(attribute.images);
  const Scene& scene = m.renderer.scene();
  std::vector<Image> images(m.groups() * m.views, Image(scene.width, scene.height));
  for (Image& image : images) {
    for (glm::vec4& pixel : image.pixels) {
      pixel = glm::vec4(grad[0], grad[1], grad[2], grad[3]);
      grad += k_channels_of_pixel;
    }
  }
  return images;
}

std::vector<dpr_gradient::Array> arrays_of_attribute(const AttributeImages& images, SceneGradient gradient) {
  std::vector<dpr_gradient::Array> arrays;
  for (std::size_t m = 0; m < gradient.meshes.size(); ++m) {
    dpr_gradient::Array texcoords{checks::element("meshes", m) + ".texcoords", {}};
    for (const glm::vec2& uv : gradient.meshes[m].texcoords)
      texcoords.values.insert(texcoords.values.end(), {uv.x, uv.y});
    if (!texcoords.values.empty()) arrays.push_back(std::move(texcoords));
  }
  const std::span<const float> values = images.grad_values();
  if (!values.empty()) arrays.push_back({"values", {values.begin(), values.end()}});
  for (dpr_gradient::Array& array : arrays_of(impl_of(images).renderer, std::move(gradient)))
    arrays.push_back(std::move(array));
  return arrays;
}

}  // namespace
}  // namespace dpr::c

dpr_status dpr_renderer_aov_size(const dpr_renderer* renderer, const char* name, std::size_t* count) {
  return guarded([&] {
    deref(count, "count");
    *count = count_of(renderer_of(renderer), dpr::parse_aov(&deref(name, "name"), "name"));
  });
}

dpr_status dpr_renderer_read_aov(dpr_renderer* renderer, const char* name, float* values, std::size_t count) {
  return guarded([&] {
    dpr::Renderer& r = renderer_of(renderer);
    const dpr::Aov aov = dpr::parse_aov(&deref(name, "name"), "name");
    deref(values, "values");
    require_count(count, count_of(r, aov), "values");
    for (std::size_t view = 0; view < r.views().size(); ++view)
      values = write_output(dpr::auxiliary_outputs(r, view), aov, values);
  });
}

dpr_status dpr_renderer_aov_view(dpr_renderer* renderer, const char* name, dpr_buffer* view,
                                 const dpr_events* events) {
  return guarded([&] {
    const dpr::Aov aov = dpr::parse_aov(&deref(name, "name"), "name");
    fill(view, dpr::aov_view(renderer_of(renderer), aov, to_events(events)));
  });
}

dpr_status dpr_renderer_copy_aov(dpr_renderer* renderer, const char* name, const dpr_buffer* outputs,
                                 const dpr_events* events) {
  return guarded([&] {
    const dpr::Aov aov = dpr::parse_aov(&deref(name, "name"), "name");
    dpr::copy_aov(renderer_of(renderer), aov, to_span(outputs, "outputs"), to_events(events));
  });
}

dpr_status dpr_attribute_create(const dpr_device* device, const char* name, dpr_attribute** attribute) {
  return guarded([&] {
    deref(attribute, "attribute");
    give(attribute, dpr::AttributeImages(deref(device, "device").device,
                                         dpr::parse_attribute(&deref(name, "name"), "name")));
  });
}

dpr_status dpr_attribute_create_values(const dpr_device* device, std::size_t channels,
                                       dpr_attribute** attribute) {
  return guarded([&] {
    deref(attribute, "attribute");
    give(attribute, dpr::AttributeImages(deref(device, "device").device, channels, {}));
  });
}

dpr_status dpr_attribute_set_values(dpr_attribute* attribute, const float* values, std::size_t count) {
  return guarded([&] { images_of(attribute).set_values(numbers(values, count, 1, "values")); });
}

dpr_status dpr_attribute_forward(dpr_attribute* attribute, const dpr_renderer* renderer) {
  return guarded([&] { images_of(attribute).forward(renderer_of(renderer)); });
}

dpr_status dpr_attribute_image_size(const dpr_attribute* attribute, std::size_t* count) {
  return guarded([&] { deref(count, "count") = image_floats_of(deref(attribute, "attribute")); });
}

dpr_status dpr_attribute_read_image(const dpr_attribute* attribute, float* pixels, std::size_t count) {
  return guarded([&] {
    const dpr_attribute& a = deref(attribute, "attribute");
    deref(pixels, "pixels");
    require_count(count, image_floats_of(a), "pixels");
    const dpr::AttributeImages::Impl& m = impl_of(a.images);
    static_assert(sizeof(cl_float4) == 4 * sizeof(float));
    impl_of(m.renderer.device())
        .read(m.images().cl_buffer(), 0, std::as_writable_bytes(std::span(pixels, count)));
  });
}

dpr_status dpr_attribute_backward_pixels(dpr_attribute* attribute, const float* grad, std::size_t count,
                                         dpr_gradient** gradient) {
  return guarded([&] {
    deref(gradient, "gradient");
    dpr::AttributeImages& images = images_of(attribute);
    deref(grad, "grad");
    dpr::SceneGradient found = images.backward(to_grad_images(*attribute, grad, count));
    give(gradient, arrays_of_attribute(images, std::move(found)));
  });
}

void dpr_attribute_destroy(dpr_attribute* attribute) { destroy(attribute); }

dpr_status dpr_attribute_set_values_from(dpr_attribute* attribute, const dpr_buffer* values,
                                         std::size_t vertices, const dpr_events* events) {
  return guarded(
      [&] { dpr::set_values(images_of(attribute), to_span(values, "values"), vertices, to_events(events)); });
}

dpr_status dpr_attribute_reserve(dpr_attribute* attribute, const dpr_frame_room* room) {
  return guarded([&] { dpr::reserve(images_of(attribute), to_room(room)); });
}

dpr_status dpr_attribute_forward_on_device(dpr_attribute* attribute, const dpr_renderer* renderer,
                                           const dpr_events* events) {
  return guarded([&] {
    require_none_emptied(
        dpr::forward_on_device(images_of(attribute), renderer_of(renderer), to_events(events)));
  });
}

dpr_status dpr_attribute_frame_history(dpr_attribute* attribute, std::size_t* emptied,
                                       dpr_frame_room* largest) {
  return guarded([&] {
    deref(emptied, "emptied");
    versioned<dpr_frame_room>(largest, DPR_FRAME_ROOM_INIT, "largest");
    fill_history(emptied, largest, dpr::frame_history(images_of(attribute)));
  });
}

dpr_status dpr_attribute_backward_on_device(dpr_attribute* attribute, const dpr_buffer* grad,
                                            const dpr_events* events) {
  return guarded(
      [&] { dpr::backward_on_device(images_of(attribute), to_span(grad, "grad"), to_events(events)); });
}

dpr_status dpr_attribute_image_view(dpr_attribute* attribute, dpr_buffer* view) {
  return guarded([&] { fill(view, dpr::image_view(images_of(attribute))); });
}

dpr_status dpr_attribute_gradient_view(dpr_attribute* attribute, const char* name, dpr_buffer* view,
                                       std::size_t* byte_offset) {
  return guarded([&] {
    deref(byte_offset, "byte_offset");
    fill(view, dpr::gradient_view(images_of(attribute), &deref(name, "name")));
    *byte_offset = view->byte_offset;
  });
}

dpr_status dpr_attribute_copy_images(dpr_attribute* attribute, const dpr_buffer* images,
                                     const dpr_events* events) {
  return guarded(
      [&] { dpr::copy_images(images_of(attribute), to_span(images, "images"), to_events(events)); });
}

dpr_status dpr_attribute_copy_gradient(dpr_attribute* attribute, const char* name, const dpr_buffer* gradient,
                                       const dpr_events* events) {
  return guarded([&] {
    dpr::copy_gradient(images_of(attribute), &deref(name, "name"), to_span(gradient, "gradient"),
                       to_events(events));
  });
}
