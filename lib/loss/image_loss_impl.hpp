// What an ImageLoss holds on its device.
#pragma once

#include <cstdint>

#include "device/kernel.hpp"
#include "dpr/image_loss.hpp"
#include "image_losses.h"
#include "stages/reduce.hpp"

namespace dpr {

/// A loss of kernels/image_losses.h as the host knows it.
struct ImageLossRow {
  std::string_view name;
  float LossWeights::*weight;
  std::size_t first_sum;  ///< of DPR_LOSS_SUMS
  bool reads_alpha;       ///< counts only where the target has a silhouette
  /// Weight times the loss of a view of so many pixels times colour channels, from its sums.
  double (*value)(double weight, const double* sums, double channels);
};

/// In the order of LossKind.
std::span<const ImageLossRow> image_losses();

/// Throws InvalidArgument for what an ImageLoss refuses.
void check_loss(const LossWeights& weights, std::span<const Image> targets);

struct ImageLoss::Impl {
  Impl(const Device& device, LossWeights weights, std::span<const Image> targets,
       std::span<const unsigned char> has_alpha);

  /// The weight of a loss in a view: 0 for one that reads an alpha which the target does not have.
  float weight(std::size_t view, std::size_t loss) const {
    return view_weights[view * shared::DPR_LOSS_COUNT + loss];
  }

  Device device;
  int width, height;
  std::size_t views;
  std::vector<double> per_view;
  std::vector<float> view_weights;  // [view][loss]
  std::uint64_t frame_number = 0;   // of the render that grad_image belongs to; 0: none

  Kernel<cl_uint, In<cl_float4>, In<cl_float4>, Out<float>> forward;
  Kernel<cl_uint, cl_uint, In<cl_float4>, In<cl_float4>, In<float>, In<float>, Out<cl_float4>> backward;
  Reduce reduce;
  Buffer<cl_float4> target;      // [view][height][width]
  Buffer<float> device_weights;  // `view_weights`
  Buffer<cl_uint> view_starts;   // [view + 1] pixels
  Buffer<float> channels, sums;  // [DPR_LOSS_SUMS][view][pixel], [DPR_LOSS_SUMS][view]
  Buffer<cl_float4> grad_image;  // [view][height][width]
};

}  // namespace dpr
