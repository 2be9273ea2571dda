// The blur of the rigid image by samples of the noise of the pixel's position: the mean of shifted frames.
#pragma once

#include "dpr/smoothing.hpp"
#include "kernels/blur_sampled.hpp"
#include "smoothing/blur_kernel.hpp"
#include "stages/blur.hpp"
#include "stages/reduce.hpp"

namespace dpr {

/// Rasters and images as Blur has them. A pass goes over the image or the raster once a sample.
class BlurSampled {
 public:
  /// Samples, their draws and their baselines are the smoothing's; the raster is that of `kernel`.
  BlurSampled(Device::Impl& device, const Smoothing& smoothing, const ShiftTable& table,
              const BlurKernel& kernel);

  /// The frames' shifts; `first_view` is that of the batch that names the noise.
  void draw(const Blur::Size& size, cl_uint first_view);
  /// With the shifts that were drawn last.
  void forward(const Buffer<cl_float4>& raster, Buffer<cl_float4>& image);
  /// The transpose of forward().
  void backward(const BufferRef<cl_float4>& grad_image, Buffer<cl_float4>& grad_raster);
  /// An estimate of the derivative by the scale of sum grad_image . image, in `grad_scale`.
  void backward_scale(const Buffer<cl_float4>& raster, const BufferRef<cl_float4>& grad_image);

  Buffer<float> grad_scale;  ///< [view], by the scale in pixels

  std::size_t bytes() const;

 private:
  std::size_t pixels() const;

  Device::Impl& device_;
  shared::ShiftParams params_{};
  Launcher<kernel::blur_sampled_draw, kernel::blur_sampled_forward, kernel::blur_sampled_backward,
           kernel::blur_sampled_scale>
      launch_;
  Reduce reduce_;
  Buffer<float> cumulative_, scores_;
  Buffer<cl_uint2> shifts_;     ///< [view][sample]
  Buffer<float> shift_scores_;  ///< [view][sample]
  Buffer<float> products_;      ///< [view][height][width]
  Buffer<cl_uint> starts_;      ///< of the views' products
};

}  // namespace dpr
