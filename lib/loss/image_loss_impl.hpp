// State of an ImageLoss on its device.
#pragma once

#include <cstdint>
#include <optional>

#include "dpr/image_loss.hpp"
#include "image_losses.h"
#include "kernels/image_loss.hpp"
#include "loss/attribute_loss.hpp"
#include "loss/ssim.hpp"
#include "renderer/frame.hpp"
#include "stages/reduce.hpp"

namespace dpr {

/// A loss of kernels/image_losses.h as the host knows it.
struct ImageLossRow {
  std::string_view name;
  float LossWeights::*weight;
  std::size_t sums;  ///< numbers that it sums over the pixels of a view
  bool reads_alpha;  ///< counts only where the target has a silhouette
  /// Weight times the loss of a view of so many pixels times colour channels, from its sums.
  double (*value)(double weight, const double* sums, double channels);
};

/// In the order of LossKind.
std::span<const ImageLossRow> image_losses();

/// Throws InvalidArgument for what an ImageLoss refuses.
void check_loss(const LossOptions& options, std::span<const Image> targets);

/// Throws InvalidArgument, which calls the mask `name`, unless its first channel can say how much the pixels
/// of an image count.
void require_mask(const Image& mask, const Image& image, const std::string& name);

struct ImageLoss::Impl {
  /// The images, or smaller versions of them.
  struct Level {
    int width, height;
    Buffer<cl_float4> target;     // [view][height][width]
    Buffer<float> mask;           // [view][height][width]
    std::vector<float> channels;  // [view] sums of the mask times colour channels
    Buffer<float> device_channels;
    Buffer<float> windows;          // [view][height][width] of ssim, where it counts
    Buffer<cl_uint> view_starts;    // [view + 1] pixels
    Buffer<float> per_pixel, sums;  // [sum used][view][pixel], [sum used][view]
    Buffer<cl_float4> image;        // [view][height][width] of smaller levels than the first
    Buffer<cl_float4> grad_image;   // [view][height][width]

    std::size_t pixels_per_view() const {
      return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    }
  };

  Impl(const Device& device, const LossOptions& options, std::span<const Image> targets);

  /// The weight of a loss in a view: 0 for one that reads an alpha which the target does not have.
  float weight(std::size_t view, std::size_t loss) const {
    return view_weights[view * shared::DPR_LOSS_COUNT + loss];
  }
  /// Number of views in the mean whose gradients are taken: `views` at first, or a batch that has these.
  void set_views_of_mean(std::size_t count);
  const Buffer<cl_float4>& grad_image() const { return levels.front().grad_image; }

  Level make_level(std::span<const Image> targets, std::span<const Image> masks);
  /// The images of a level as ssim reads them.
  Ssim::Images windowed(const Level& level, const Buffer<cl_float4>& image) const {
    return {views,
            static_cast<std::size_t>(level.width),
            static_cast<std::size_t>(level.height),
            image,
            level.target,
            level.windows};
  }
  /// Evaluates the loss. Throws InvalidArgument for images of another size or number than the targets.
  void evaluate(const FrameImages& images);
  /// The total, once everything of that frame is there.
  double finish(std::uint64_t number);
  /// Evaluates the mean over the levels: a value a view, and the gradient.
  void evaluate(const Buffer<cl_float4>& image);
  /// Adds the gradients of the attributes after evaluate().
  void add_attribute_gradients(SceneGradient& gradient);
  void add_values(const Level& level);
  /// A loss that counts in some view.
  bool is_used(std::size_t loss) const { return (used >> loss & 1U) != 0; }
  /// Number of sums of the losses in use before this one.
  std::size_t sums_before(std::size_t loss) const;

  Device device;
  int width, height;
  std::size_t views;
  std::size_t views_of_mean;
  std::vector<double> per_view;
  std::vector<float> view_weights;  // [view][loss]
  cl_uint used = 0;                 // bit k: is_used(k)
  float inverse_scale_squared;
  std::uint64_t frame_number = 0;  // of the render that grad_image belongs to; 0: none

  Launcher<kernel::image_loss_forward, kernel::image_loss_backward, kernel::image_loss_shrink,
           kernel::image_loss_shrink_backward>
      launch;
  Reduce reduce;
  Buffer<float> device_weights;  // `view_weights`
  std::optional<Ssim> ssim;      // where it counts
  float ssim_weight = 0;         // in the mean over the levels
  Buffer<float> ssim_weights;    // [view] in that over the views too
  std::vector<Level> levels;
  std::vector<AttributeLoss> attributes;
};

}  // namespace dpr
