#include "stages/blur_sampled.hpp"

#include "stages/occupancy.hpp"

namespace dpr {
namespace {

/// Samples of a block, as kernels/noise.h has them.
std::size_t block_samples(const Device::Impl& device) { return device.info.lanes == 1 ? 4 : 8; }

}  // namespace

BlurSampled::BlurSampled(Device::Impl& device, const Smoothing& smoothing, const ShiftTable& table,
                         const BlurKernel& kernel)
    : device_(device), launch_(device), reduce_(device) {
  params_.sampling = sampling_params(smoothing);
  params_.supersampling = static_cast<cl_uint>(kernel.supersampling);
  params_.margin = static_cast<cl_uint>(kernel.margin);
  params_.radius = static_cast<cl_uint>(table.radius());
  cumulative_.upload(device, table.cumulative);
  scores_.upload(device, table.scores);
}

std::size_t BlurSampled::pixels() const {
  return std::size_t{params_.views} * params_.height * params_.width;
}

void BlurSampled::draw(const Blur::Size& size, cl_uint first_view) {
  if (starts_.size() != size.views + 1 || params_.width != size.width || params_.height != size.height) {
    std::vector<cl_uint> starts;
    for (std::size_t view = 0; view <= size.views; ++view)
      starts.push_back(static_cast<cl_uint>(view * size.height * size.width));
    starts_.upload(device_, starts);
  }
  params_.views = static_cast<cl_uint>(size.views);
  params_.first_view = first_view;
  params_.width = static_cast<cl_uint>(size.width);
  params_.height = static_cast<cl_uint>(size.height);
  const std::size_t samples = params_.sampling.samples;
  shifts_.resize(device_, size.views * samples);
  shift_scores_.resize(device_, size.views * samples);
  const std::size_t blocks = (samples + block_samples(device_) - 1) / block_samples(device_);
  launch_(size.views * blocks, kernel::blur_sampled_draw{.p = params_,
                                                         .cumulative = cumulative_,
                                                         .scores = scores_,
                                                         .shifts = shifts_,
                                                         .shift_scores = shift_scores_});
}

void BlurSampled::forward(const Buffer<cl_float4>& raster, Buffer<cl_float4>& image) {
  image.resize(device_, pixels());
  launch_(pixels(),
          kernel::blur_sampled_forward{.p = params_, .shifts = shifts_, .raster = raster, .image = image});
}

void BlurSampled::backward(const BufferRef<cl_float4>& grad_image, Buffer<cl_float4>& grad_raster) {
  const std::size_t around = 2 * std::size_t{params_.margin}, per_pixel = params_.supersampling;
  const std::size_t samples =
      params_.views * (params_.height * per_pixel + around) * (params_.width * per_pixel + around);
  grad_raster.resize(device_, samples);
  launch_(samples,
          kernel::blur_sampled_backward{
              .p = params_, .shifts = shifts_, .grad_image = grad_image, .grad_raster = grad_raster});
}

void BlurSampled::backward_scale(const Buffer<cl_float4>& raster, const BufferRef<cl_float4>& grad_image) {
  products_.resize(device_, pixels());
  launch_(pixels(), kernel::blur_sampled_scale{.p = params_,
                                               .shifts = shifts_,
                                               .shift_scores = shift_scores_,
                                               .raster = raster,
                                               .grad_image = grad_image,
                                               .products = products_});
  reduce_({pixels(), 1, params_.views, 1, starts_, products_}, grad_scale);
}

std::size_t BlurSampled::bytes() const {
  std::size_t bytes = shifts_.capacity_bytes() + starts_.capacity_bytes() + reduce_.bytes();
  for (const Buffer<float>* buffer : {&cumulative_, &scores_, &shift_scores_, &products_, &grad_scale})
    bytes += buffer->capacity_bytes();
  return bytes;
}

}  // namespace dpr
