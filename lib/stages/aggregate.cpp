#include "stages/aggregate.hpp"

namespace dpr {
namespace {

const char* file_of(Composition composition) {
  return composition == Composition::joint ? "aggregate_joint.cl" : "aggregate.cl";
}

/// The build options that choose the priors: the sampled joint composition draws from both.
std::string prior_options(const Smoothing& smoothing) {
  if (!samples_jointly(smoothing)) return prior_option(smoothing.depth_prior);
  return " -DDPR_OCCUPANCY_PRIOR=" + std::string(to_string(smoothing.occupancy_prior)) +
         " -DDPR_DEPTH_PRIOR=" + std::string(to_string(smoothing.depth_prior));
}

}  // namespace

AggregateKernels::Exact::Exact(Device::Impl& device, Composition composition, const std::string& options)
    : forward(device, file_of(composition),
              composition == Composition::joint ? "aggregate_joint_forward" : "aggregate_forward", options),
      backward(device, file_of(composition),
               composition == Composition::joint ? "aggregate_joint_backward" : "aggregate_backward",
               options) {}

AggregateKernels::Sampled::Sampled(Device::Impl& device, const std::string& options)
    : forward(device, "aggregate_sampled.cl", "aggregate_sampled_forward", options),
      backward(device, "aggregate_sampled.cl", "aggregate_sampled_backward", options) {}

AggregateKernels::JointSampled::JointSampled(Device::Impl& device, const std::string& options)
    : forward(device, "aggregate_joint_sampled.cl", "aggregate_joint_sampled_forward", options),
      backward(device, "aggregate_joint_sampled.cl", "aggregate_joint_sampled_backward", options) {}

Aggregate::Setting Aggregate::prepare(const Smoothing& smoothing) const {
  const std::string options = prior_options(smoothing);
  const std::string wanted = std::string(to_string(smoothing.composition)) +
                             std::string(to_string(smoothing.aggregation_estimator)) + options;
  return SmoothedStage::prepare(smoothing, wanted, [&](AggregateKernels& kernels) {
    if (smoothing.aggregation_estimator == Estimator::exact) {
      kernels.exact.emplace(device_, smoothing.composition, options);
    } else if (samples_jointly(smoothing)) {
      kernels.joint_sampled.emplace(device_, options);
    } else {
      kernels.sampled.emplace(device_, options);
    }
  });
}

shared::AggregateParams Aggregate::params(const shared::FrameParams& p, const glm::vec3& background) const {
  shared::AggregateParams a{};
  a.background = to_cl(background);
  a.sigma = now_.smoothing.sigma;
  a.gamma = now_.smoothing.gamma;
  a.alpha = now_.smoothing.alpha;
  a.background_depth = now_.smoothing.background_depth;
  a.sampling = sampling_params(now_.smoothing);
  a.pixels_per_view = p.width * p.height;
  a.pixels = p.views * a.pixels_per_view;
  a.faces = p.faces;
  a.first_view = p.first_view;
  a.channels = to_uint(channel_count());
  return a;
}

void Aggregate::forward(const AggregateInputs& in, const glm::vec3& background) {
  shared::AggregateParams a = params(in.p, background);
  image.resize(device_, a.pixels);
  if (now_.kernels->exact) {
    const bool has_background_slots = now_.smoothing.composition == Composition::barrier;
    slots_.resize(device_, in.rasterize.fragments + (has_background_slots ? a.pixels : 0));
    slot_counts_.resize(device_, a.pixels);
  }
  for (const Range& pixels : in.rasterize.pixels(in.p)) {
    a.last_pixel = pixels.last();
    forward(in, a, pixels);
  }
}

void Aggregate::forward(const AggregateInputs& in, const shared::AggregateParams& a, const Range& pixels) {
  const Rasterize& r = in.rasterize;
  if (now_.kernels->exact) {
    now_.kernels->exact->forward(pixels, a, in.views.cameras, r.pixel_starts, r.list, r.depth,
                                 in.occupancy.log_occupancy, in.occupancy.occupancy, in.shade.color.red,
                                 in.shade.color.green, in.shade.color.blue, slots_, slot_counts_, image);
  } else if (now_.kernels->joint_sampled) {
    now_.kernels->joint_sampled->forward(pixels, a, in.views.cameras, r.pixel_starts, r.list, r.distance,
                                         r.depth, in.shade.color.red, in.shade.color.green,
                                         in.shade.color.blue, r.fragment_pair, in.bin.pair_face, image);
  } else {
    now_.kernels->sampled->forward(pixels, a, in.views.cameras, r.pixel_starts, r.list, r.depth,
                                   in.occupancy.log_occupancy, in.occupancy.occupancy, in.shade.color.red,
                                   in.shade.color.green, in.shade.color.blue, r.fragment_pair,
                                   in.bin.pair_face, image);
  }
}

void Aggregate::backward(const AggregateInputs& in, const glm::vec3& background,
                         const BufferRef<cl_float4>& grad_image) {
  shared::AggregateParams a = params(in.p, background);
  for (Buffer<float>* buffer :
       {&grad_depth, &grad_log_occupancy, &grad_color.red, &grad_color.green, &grad_color.blue}) {
    buffer->resize(device_, in.rasterize.fragments);
  }
  channels.resize(device_, channel_count() * a.pixels);
  if (now_.kernels->joint_sampled) {
    grad_distance.resize(device_, in.rasterize.fragments);
    grad_sigma.resize(device_, a.pixels);
  }
  for (const Range& pixels : in.rasterize.pixels(in.p)) {
    a.last_pixel = pixels.last();
    backward(in, a, pixels, grad_image);
  }
}

void Aggregate::backward(const AggregateInputs& in, const shared::AggregateParams& a, const Range& pixels,
                         const BufferRef<cl_float4>& grad_image) {
  const Rasterize& r = in.rasterize;
  if (now_.kernels->exact) {
    now_.kernels->exact->backward(pixels, a, in.views.cameras, r.pixel_starts, r.list, r.depth,
                                  in.occupancy.log_occupancy, in.occupancy.occupancy, in.shade.color.red,
                                  in.shade.color.green, in.shade.color.blue, slots_, slot_counts_, grad_image,
                                  grad_depth, grad_log_occupancy, grad_color.red, grad_color.green,
                                  grad_color.blue, channels);
  } else if (now_.kernels->joint_sampled) {
    now_.kernels->joint_sampled->backward(
        pixels, a, in.views.cameras, r.pixel_starts, r.list, r.distance, r.depth, in.shade.color.red,
        in.shade.color.green, in.shade.color.blue, r.fragment_pair, in.bin.pair_face, grad_image,
        grad_distance, grad_depth, grad_color.red, grad_color.green, grad_color.blue, grad_sigma, channels);
  } else {
    now_.kernels->sampled->backward(pixels, a, in.views.cameras, r.pixel_starts, r.list, r.depth,
                                    in.occupancy.log_occupancy, in.occupancy.occupancy, in.shade.color.red,
                                    in.shade.color.green, in.shade.color.blue, r.fragment_pair,
                                    in.bin.pair_face, grad_image, grad_depth, grad_log_occupancy,
                                    grad_color.red, grad_color.green, grad_color.blue, channels);
  }
}

std::size_t Aggregate::bytes() const {
  std::size_t bytes = image.capacity_bytes() + slots_.capacity_bytes() + slot_counts_.capacity_bytes();
  for (const Buffer<float>* buffer : {&grad_depth, &grad_log_occupancy, &grad_color.red, &grad_color.green,
                                      &grad_color.blue, &channels, &grad_distance, &grad_sigma}) {
    bytes += buffer->capacity_bytes();
  }
  return bytes;
}

}  // namespace dpr
