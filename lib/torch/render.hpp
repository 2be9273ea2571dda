// The renderer as a libtorch operator: torch.classes.dpr.Renderer holds what a batch shares,
// torch.ops.dpr.render renders it, with gradients.
#pragma once

#include <torch/custom_class.h>

#include <exception>
#include <glm/glm.hpp>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "dpr/error.hpp"
#include "dpr/renderer.hpp"

namespace dpr::torch_op {

/// Torch's error, with the library's that it was.
class RenderError : public c10::Error {
 public:
  /// Of the exception that is being handled.
  explicit RenderError(const dpr::Error& error);
  std::exception_ptr original() const { return original_; }

 private:
  std::exception_ptr original_;
};

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

/// Renders a batch in one set of launches. All tensors are float32 on the CPU; nothing is copied that is
/// contiguous.
/// @param vertices    [view or 1, vertex, 3] world space
/// @param colors      [view or 1, vertex, 3] linear RGB; or [view or 1, face, 3], if there are not as many
/// faces as
///                    vertices
/// @param views       [view, 4, 4] world to camera, OpenGL axes, acting on column vectors; affine
/// @param intrinsics  [view, 4] fx, fy, cx, cy in pixels; the origin is the corner of the top-left pixel
/// @param background  [3] linear RGB
/// @return [view, height, width, 4] RGBA over the background; alpha is the silhouette
/// Differentiable once with respect to all five, the matrices of the views as any affine matrices. A graph
/// keeps the frame's buffers on the device until it is freed. Throws RenderError; c10::Error where second
/// derivatives are asked for.
at::Tensor render(const c10::intrusive_ptr<BatchRenderer>& renderer, const at::Tensor& vertices,
                  const at::Tensor& colors, const at::Tensor& views, const at::Tensor& intrinsics,
                  const at::Tensor& background);

}  // namespace dpr::torch_op
