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

Ssim::Ssim(Device::Impl& device)
    : device_(device),
      rows_(device, "ssim.cl", "ssim_rows"),
      columns_(device, "ssim.cl", "ssim_columns"),
      columns_backward_(device, "ssim.cl", "ssim_columns_backward"),
      rows_backward_(device, "ssim.cl", "ssim_rows_backward") {}

void Ssim::forward(const Images& in, std::size_t first, Buffer<float>& similarity) {
  const std::size_t pixels = in.views * in.width * in.height;
  of_rows_.resize(device_, DPR_SSIM_MOMENTS * pixels);
  grad_moments_.resize(device_, DPR_SSIM_GRADIENTS * pixels);
  rows_(pixels, to_uint(in.width), to_uint(in.height), to_uint(pixels), in.image, in.target, of_rows_);
  columns_(pixels, to_uint(in.width), to_uint(in.height), to_uint(pixels), to_uint(first), of_rows_,
           in.windows, similarity, grad_moments_);
}

void Ssim::backward(const Images& in, const Buffer<float>& weights, Buffer<cl_float4>& grad_image) {
  const std::size_t pixels = in.views * in.width * in.height;
  columns_backward_(pixels, to_uint(in.width), to_uint(in.height), to_uint(pixels), grad_moments_, of_rows_);
  rows_backward_(pixels, to_uint(in.width), to_uint(in.height), to_uint(pixels), weights, in.image, in.target,
                 of_rows_, grad_image);
}

}  // namespace dpr
