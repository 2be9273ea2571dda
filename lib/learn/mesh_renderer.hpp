// The renderer of training as a function of libtorch, with gradients.
#pragma once

#include <ATen/core/Tensor.h>
#include <c10/util/Exception.h>

#include <exception>
#include <memory>
#include <vector>

#include "batch/render_settings.hpp"
#include "batch/renderer_pool.hpp"
#include "dpr/error.hpp"

namespace dpr::learn {

/// Torch's error, with the library's that it was.
class RenderError : public c10::Error {
 public:
  /// Call this while the exception is being handled; original() keeps it.
  explicit RenderError(const dpr::Error& error);
  std::exception_ptr original() const { return original_; }

 private:
  std::exception_ptr original_;
};

/// Faces, image size, smoothing and device of the batches that it renders. One thread at a time renders with
/// it.
class MeshRenderer : public std::enable_shared_from_this<MeshRenderer> {
 public:
  MeshRenderer(const batch::Faces& faces, int size, const Smoothing& smoothing, const Device& device);

  /// From the next render() on.
  void set_smoothing(const Smoothing& smoothing) { settings_.set_smoothing(smoothing); }
  /// The images [view, size, size, 4] over black of vertices and colours [view, vertex, 3], world space and
  /// linear RGB, from views [view, 4, 4] and intrinsics [view, 4]; float32. Differentiable once with respect
  /// to vertices and colours. A graph keeps the frame's buffers on the device until it is freed. Throws
  /// RenderError.
  at::Tensor render(const at::Tensor& vertices, const at::Tensor& colors, const at::Tensor& views,
                    const at::Tensor& intrinsics);
  /// Spent in render() and its backward passes until now.
  double seconds() const { return seconds_; }

 private:
  struct Function;

  std::vector<std::int32_t> faces_;
  batch::RenderSettings settings_;
  std::shared_ptr<batch::RendererPool> pool_;
  double seconds_ = 0;
};

}  // namespace dpr::learn
