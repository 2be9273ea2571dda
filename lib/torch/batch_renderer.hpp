// What the batches of the operator share: torch.classes.dpr.Renderer.
#pragma once

#include <torch/custom_class.h>

#include <glm/glm.hpp>
#include <mutex>
#include <string>
#include <vector>

#include "dpr/renderer.hpp"
#include "dpr/smoothing_options.hpp"

namespace dpr::torch_op {

/// Faces, image size, smoothing and device of the batches that render() renders: torch.classes.dpr.Renderer.
/// One thread at a time renders with it.
class BatchRenderer : public torch::CustomClassHolder {
 public:
  BatchRenderer(std::vector<glm::uvec3> faces, int width, int height, const Smoothing& smoothing,
                const Device& device);
  /// What Python calls. faces: int64 [face, 3]; preset: a name that smoothing_preset() knows; device: what
  /// open_device() takes. Errors are torch's.
  BatchRenderer(const at::Tensor& faces, std::int64_t width, std::int64_t height, const std::string& preset,
                const std::string& device);

  /// From the next render() on: any key of a scene's "smoothing", with a number or a word, "znear" or "zfar",
  /// which are 1 and 100 unless set, and "shading" or "shininess" of lights. The smoothing is resolved from
  /// all that was set, in whatever order (dpr/smoothing_options.hpp). Errors are torch's.
  void set(const std::string& name, const at::IValue& value);
  /// Instead of the preset and what was set until now.
  void set_smoothing(const Smoothing& smoothing);

  /// How lights shade, for render_lit().
  const Lights& lights() const { return lights_; }

  /// Spent in render() and its backward passes until now.
  double seconds() const { return seconds_; }

 private:
  friend class Lease;
  friend struct RenderFunction;

  struct Topology {
    std::size_t vertices = 0;
    bool face_colors = false;
    bool operator==(const Topology&) const = default;
  };

  Renderer take(const Topology& topology);
  void put_back(Renderer renderer, const Topology& topology);

  std::vector<glm::uvec3> faces_;
  int width_, height_;
  SmoothingOptions options_;            // what was set
  std::optional<Smoothing> otherwise_;  // what they leave open
  Smoothing smoothing_;                 // what they come to
  float znear_ = 1.0F, zfar_ = 100.0F;
  Lights lights_;  // without their numbers
  Cull cull_ = Cull::none;
  Device device_;
  Topology topology_;           // of the free renderers
  std::vector<Renderer> free_;  // each remembers its last frame only, so every graph in flight has its own
  std::mutex mutex_;
  double seconds_ = 0;
};

}  // namespace dpr::torch_op
