// What an ImageLoss holds on its device.
#pragma once

#include <cstdint>

#include "device/kernel.hpp"
#include "dpr/loss.hpp"
#include "stages/reduce.hpp"

namespace dpr {

/// Throws InvalidArgument for what an ImageLoss refuses.
void check_loss(const LossWeights& weights, std::span<const Image> targets);

struct ImageLoss::Impl {
  Impl(const Device& device, LossWeights weights, std::span<const Image> targets,
       std::span<const unsigned char> has_alpha);

  Device device;
  LossWeights weights;
  int width, height;
  std::size_t views;
  std::vector<double> per_view;
  std::vector<float> silhouettes;  // [view] weight of the silhouette loss
  std::uint64_t frame_number = 0;  // of the render that grad_image belongs to; 0: none

  Kernel<shared::LossParams, In<cl_float4>, In<cl_float4>, Out<float>> forward;
  Kernel<shared::LossParams, In<cl_float4>, In<cl_float4>, In<float>, In<float>, Out<cl_float4>> backward;
  Reduce reduce;
  Buffer<cl_float4> target;        // [view][height][width]
  Buffer<float> view_silhouettes;  // `silhouettes` on the device
  Buffer<cl_uint> view_starts;     // [view + 1] pixels
  Buffer<float> channels, sums;    // [DPR_LOSS_SUMS][view][pixel], [DPR_LOSS_SUMS][view]
  Buffer<cl_float4> grad_image;    // [view][height][width]
};

}  // namespace dpr
