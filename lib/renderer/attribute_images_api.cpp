// The public face of images of attributes: checks what it is given and hands it on.
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "base/checks.hpp"
#include "base/name_list.hpp"
#include "dpr/attribute_images.hpp"
#include "renderer/attribute_images_impl.hpp"
#include "renderer/frame.hpp"
#include "renderer/setter_checks.hpp"

namespace dpr {
namespace {

constexpr std::array<std::string_view, 4> k_attribute_names{"depth", "position", "normal", "texcoords"};

}  // namespace

std::string_view to_string(Attribute attribute) {
  return k_attribute_names[static_cast<std::size_t>(attribute)];
}

Attribute parse_attribute(std::string_view word, std::string_view where) {
  return static_cast<Attribute>(position_of(word, k_attribute_names, std::string(where)));
}

AttributeImages::AttributeImages(const Device& device, Attribute attribute) {
  checks::require_enumerator(attribute, Attribute::texcoords, "attribute (attribute images)");
  impl_ = std::make_unique<Impl>(device, attribute,
                                 attribute == Attribute::depth       ? 1
                                 : attribute == Attribute::texcoords ? 2
                                                                     : 3);
}

AttributeImages::AttributeImages(const Device& device, std::size_t channels, std::span<const float> values) {
  checks::require_channels(channels, "channels (attribute images)");
  impl_ = std::make_unique<Impl>(device, std::nullopt, channels);
  set_values(values);
}

AttributeImages::~AttributeImages() = default;
AttributeImages::AttributeImages(AttributeImages&&) noexcept = default;
AttributeImages& AttributeImages::operator=(AttributeImages&&) noexcept = default;

void AttributeImages::set_values(std::span<const float> values) {
  impl_->require_own_values();
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) checks::require_finite(values[i], checks::element("values", i));
  }
  impl_->set_values(values);
}

void AttributeImages::forward(const Renderer& of) {
  require_same_device(impl_->renderer.device(), of.device(), "AttributeImages::forward");
  impl_of(of).require_forward("AttributeImages::forward");
  impl_->forward(impl_of(of), FrameSizes::read);
}

std::size_t AttributeImages::channels() const { return impl_->channels; }
std::size_t AttributeImages::groups() const { return impl_->groups(); }

Image AttributeImages::image(std::size_t view, std::size_t group) const {
  const Impl& m = *impl_;
  m.require_forward("AttributeImages::image");
  require(view < m.views, "view", view, ("below " + std::to_string(m.views)).c_str());
  require(group < m.groups(), "group", group, ("below " + std::to_string(m.groups())).c_str());
  const Scene& scene = m.renderer.scene();
  Image image(scene.width, scene.height);
  std::vector<cl_float4> pixels(image.pixels.size());
  m.images().download(pixels, (group * m.views + view) * pixels.size());
  std::ranges::transform(pixels, image.pixels.begin(),
                         [](const cl_float4& p) { return glm::vec4(p.s[0], p.s[1], p.s[2], p.s[3]); });
  return image;
}

SceneGradient AttributeImages::backward(std::span<const Image> grad_images) {
  Impl& m = *impl_;
  m.require_forward("AttributeImages::backward");
  const Scene& scene = m.renderer.scene();
  if (grad_images.size() != m.groups() * m.views) {
    throw InvalidArgument("grad_images", std::to_string(grad_images.size()) + " images",
                          std::to_string(m.groups() * m.views) + ", groups x views");
  }
  const std::vector<cl_float4> pixels = checked_pixels(grad_images, scene.width, scene.height);
  m.host_grad_images.upload(impl_of(m.renderer.device()), pixels);
  return m.backward(m.host_grad_images);
}

std::span<const float> AttributeImages::grad_values() const { return impl_->grad_values; }

}  // namespace dpr
