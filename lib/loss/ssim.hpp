// Structural similarity of images and targets on the device.
#pragma once

#include "dpr/image.hpp"
#include "kernels/ssim.hpp"

namespace dpr {

/// Throws InvalidArgument unless an image of that size holds a window.
void require_window(int width, int height);

/// Weights of the windows, [view][height][width]: in proportion to the mask at a window's centre, with a sum
/// of 1 over a view's colour channels. Throws InvalidArgument where a mask leaves no window.
std::vector<float> ssim_windows(std::span<const Image> masks);

class Ssim {
 public:
  /// Images of a level: [view][height][width] RGBA, and the windows on the device.
  struct Images {
    std::size_t views, width, height;
    const Buffer<cl_float4>&image, &target;
    const Buffer<float>& windows;
  };

  explicit Ssim(Device::Impl& device) : device_(device), launch_(device) {}

  /// Writes each window's share of its view's similarity, by pixel, from `similarity[first]` on.
  void forward(const Images& in, std::size_t first, Buffer<float>& similarity);
  /// After forward() of the same images: takes the gradient of `weights[view]` times the similarity from
  /// `grad_image`.
  void backward(const Images& in, const Buffer<float>& weights, Buffer<cl_float4>& grad_image);

 private:
  Device::Impl& device_;
  Launcher<kernel::ssim_rows, kernel::ssim_columns, kernel::ssim_columns_backward, kernel::ssim_rows_backward>
      launch_;
  Buffer<cl_float4> of_rows_, grad_moments_;  // [DPR_SSIM_MOMENTS or DPR_SSIM_GRADIENTS][view][pixel]
};

}  // namespace dpr
