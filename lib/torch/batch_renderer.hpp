// What the batches of the operator share: torch.classes.dpr.Renderer.
#pragma once

#include <torch/custom_class.h>

#include <memory>
#include <string>

#include "dpr/smoothing.hpp"
#include "torch/render_settings.hpp"
#include "torch/renderer_pool.hpp"

namespace dpr::torch_op {

/// Faces, image size, smoothing and device of the batches that render() renders: torch.classes.dpr.Renderer.
/// One thread at a time renders with it.
class BatchRenderer : public torch::CustomClassHolder {
 public:
  BatchRenderer(Faces faces, int width, int height, const Smoothing& smoothing, const Device& device);
  /// What Python calls. faces: int64 [face, 3]; preset: a name that smoothing_preset() knows; device: what
  /// open_device() takes. Errors are torch's.
  BatchRenderer(const at::Tensor& faces, std::int64_t width, std::int64_t height, const std::string& preset,
                const std::string& device);

  /// From the next render() on: what RenderSettings has names for; "znear" and "zfar" are 1 and 100 unless
  /// set. Errors are torch's.
  void set(const std::string& name, const at::IValue& value);
  /// Instead of the preset and what was set until now.
  void set_smoothing(const Smoothing& smoothing) { settings_.set_smoothing(smoothing); }

  const std::shared_ptr<const Faces>& faces() const { return faces_; }
  const RenderSettings& settings() const { return settings_; }
  const std::shared_ptr<RendererPool>& pool() const { return pool_; }

  /// Spent in render() and its backward passes until now.
  double seconds() const { return seconds_; }
  void add_seconds(double seconds) { seconds_ += seconds; }

 private:
  std::shared_ptr<const Faces> faces_;
  RenderSettings settings_;
  std::shared_ptr<RendererPool>
      pool_;  // each renderer remembers its last frame only, so every graph has its own
  double seconds_ = 0;
};

}  // namespace dpr::torch_op
