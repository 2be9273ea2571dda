// What the batches of the operator share: torch.classes.dpr.Renderer.
#pragma once

#include <torch/custom_class.h>

#include <glm/glm.hpp>
#include <mutex>
#include <string>
#include <vector>

#include "dpr/renderer.hpp"

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

  /// From the next render() on: "sigma", "gamma", "alpha", "occupancy_threshold", "blur_radius", "samples" or
  /// "seed" of the smoothing; "znear" or "zfar", which are 1 and 100 unless set. A preset's blur radius
  /// follows sigma, so the radius is set after it. Errors are torch's.
  void set(const std::string& name, double value);
  void set_smoothing(const Smoothing& smoothing);

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
  Smoothing smoothing_;
  float znear_ = 1.0F, zfar_ = 100.0F;
  Device device_;
  Topology topology_;           // of the free renderers
  std::vector<Renderer> free_;  // each remembers its last frame only, so every graph in flight has its own
  std::mutex mutex_;
  double seconds_ = 0;
};

}  // namespace dpr::torch_op
