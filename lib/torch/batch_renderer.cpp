// Faces, settings and device from Python's values.
#include "torch/batch_renderer.hpp"

#include <utility>

#include "torch/errors.hpp"
#include "torch/index_tensors.hpp"

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

BatchRenderer::BatchRenderer(Faces faces, int width, int height, const Smoothing& smoothing,
                             const Device& device)
    : faces_(std::make_shared<const Faces>(std::move(faces))),
      settings_(with_default_clipping({width, height})),
      pool_(std::make_shared<RendererPool>(device)) {
  set_smoothing(smoothing);
}

BatchRenderer::BatchRenderer(const at::Tensor& faces, std::int64_t width, std::int64_t height,
                             const std::string& preset, const std::string& device)
    : faces_(with_torch_errors(
          [&] { return std::make_shared<const Faces>(read_faces(faces, "faces (dpr::Renderer)")); })),
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
