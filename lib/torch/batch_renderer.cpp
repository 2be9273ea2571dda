// Faces, settings and device from Python's values.
#include "torch/batch_renderer.hpp"

#include <limits>
#include <utility>

#include "torch/errors.hpp"

namespace dpr::torch_op {
namespace {

OptionValue option_value(const at::IValue& value, const std::string& name) {
  if (value.isDouble()) return value.toDouble();
  if (value.isInt()) return value.toInt();
  if (value.isString()) return value.toStringRef();
  throw InvalidArgument(name + " (dpr::Renderer)", value.tagKind(), "a number or a word");
}

/// The planes of a Camera, which a batch has unless it says otherwise.
RenderSettings with_default_clipping(RenderSettings settings) {
  settings.set("znear", Camera().znear);
  settings.set("zfar", Camera().zfar);
  return settings;
}

RenderSettings with_preset(RenderSettings settings, const std::string& preset) {
  settings.set("preset", preset);
  return settings;
}

}  // namespace

Faces read_faces(const at::Tensor& faces) {
  if (faces.scalar_type() != at::kLong || faces.dim() != 2 || faces.size(1) != 3 ||
      !faces.device().is_cpu()) {
    throw InvalidArgument("faces (dpr::Renderer)", faces.toString() + " " + shape_text(faces),
                          "an int64 tensor [face, 3] on the CPU");
  }
  const at::Tensor values = faces.contiguous();
  const auto* index = values.data_ptr<std::int64_t>();
  Faces result(static_cast<std::size_t>(faces.size(0)));
  for (glm::uvec3& face : result) {
    for (int corner = 0; corner < 3; ++corner, ++index) {
      if (*index < 0 || *index > std::numeric_limits<std::uint32_t>::max()) {
        throw InvalidArgument("faces (dpr::Renderer)", std::to_string(*index), "indices of vertices");
      }
      face[corner] = static_cast<std::uint32_t>(*index);
    }
  }
  return result;
}

BatchRenderer::BatchRenderer(Faces faces, int width, int height, const Smoothing& smoothing,
                             const Device& device)
    : faces_(std::make_shared<const Faces>(std::move(faces))),
      settings_(with_default_clipping({width, height})),
      pool_(std::make_shared<RendererPool>(device)) {
  set_smoothing(smoothing);
}

BatchRenderer::BatchRenderer(const at::Tensor& faces, std::int64_t width, std::int64_t height,
                             const std::string& preset, const std::string& device)
    : faces_(with_torch_errors([&] { return std::make_shared<const Faces>(read_faces(faces)); })),
      settings_(with_torch_errors([&] {
        return with_preset(with_default_clipping({width, height}), preset);
      })),
      pool_(
          with_torch_errors([&] { return std::make_shared<RendererPool>(open_device_of_process(device)); })) {
}

void BatchRenderer::set(const std::string& name, const at::IValue& value) {
  with_torch_errors([&] { settings_.set(name, option_value(value, name)); });
}

}  // namespace dpr::torch_op
