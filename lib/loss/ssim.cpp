#include "loss/ssim.hpp"

#include "base/checks.hpp"
#include "image_losses.h"

namespace dpr {

void require_window(int width, int height) {
  constexpr int k_side = 2 * DPR_SSIM_RADIUS + 1;
  if (width >= k_side && height >= k_side) return;
  throw InvalidArgument("size (ssim)", checks::size(width, height),
                        checks::size(k_side, k_side) + " or more on every level, a window's");
}

std::vector<float> ssim_windows(std::span<const Image> masks) {
  constexpr double k_channels = 3;
  std::vector<float> windows;
  for (const Image& mask : masks) {
    const std::size_t first = windows.size();
    windows.resize(first + mask.pixels.size());
    double sum = 0;
    for (int row = DPR_SSIM_RADIUS; row + DPR_SSIM_RADIUS < mask.height; ++row) {
      for (int column = DPR_SSIM_RADIUS; column + DPR_SSIM_RADIUS < mask.width; ++column) {
        windows[first + static_cast<std::size_t>(row * mask.width + column)] = mask.at(column, row).x;
        sum += static_cast<double>(mask.at(column, row).x);
      }
    }
    if (!(sum > 0)) {
      throw InvalidArgument(
          "mask (ssim)", "0 at the middle of every window",
          "a pixel above 0, " + std::to_string(DPR_SSIM_RADIUS) + " or more from the border");
    }
    for (std::size_t i = first; i < windows.size(); ++i)
      windows[i] = static_cast<float>(static_cast<double>(windows[i]) / (k_channels * sum));
  }
  return windows;
}

void Ssim::forward(const Images& in, std::size_t first, Buffer<float>& similarity) {
  const std::size_t pixels = in.views * in.width * in.height;
  of_rows_.resize(device_, DPR_SSIM_MOMENTS * pixels);
  grad_moments_.resize(device_, DPR_SSIM_GRADIENTS * pixels);
  launch_(pixels, kernel::ssim_rows{.width = to_uint(in.width),
                                    .height = to_uint(in.height),
                                    .pixels = to_uint(pixels),
                                    .image = in.image,
                                    .target = in.target,
                                    .rows = of_rows_});
  launch_(pixels, kernel::ssim_columns{.width = to_uint(in.width),
                                       .height = to_uint(in.height),
                                       .pixels = to_uint(pixels),
                                       .first = to_uint(first),
                                       .rows = of_rows_,
                                       .window = in.windows,
                                       .similarity = similarity,
                                       .grad_moments = grad_moments_});
}

void Ssim::backward(const Images& in, const Buffer<float>& weights, Buffer<cl_float4>& grad_image) {
  const std::size_t pixels = in.views * in.width * in.height;
  launch_(pixels, kernel::ssim_columns_backward{.width = to_uint(in.width),
                                                .height = to_uint(in.height),
                                                .pixels = to_uint(pixels),
                                                .grad_moments = grad_moments_,
                                                .grad_rows = of_rows_});
  launch_(pixels, kernel::ssim_rows_backward{.width = to_uint(in.width),
                                             .height = to_uint(in.height),
                                             .pixels = to_uint(pixels),
                                             .weights = weights,
                                             .image = in.image,
                                             .target = in.target,
                                             .grad_rows = of_rows_,
                                             .grad_image = grad_image});
}

}  // namespace dpr
