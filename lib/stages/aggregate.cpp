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

Aggregate::Exact::Exact(Device::Impl& device, Composition composition, const std::string& options)
    : forward(device, file_of(composition),
              composition == Composition::joint ? "aggregate_joint_forward" : "aggregate_forward", options),
      backward(device, file_of(composition),
               composition == Composition::joint ? "aggregate_joint_backward" : "aggregate_backward",
               options) {}

Aggregate::Sampled::Sampled(Device::Impl& device, const std::string& options)
    : forward(device, "aggregate_sampled.cl", "aggregate_sampled_forward", options),
      backward(device, "aggregate_sampled.cl", "aggregate_sampled_backward", options) {}

Aggregate::JointSampled::JointSampled(Device::Impl& device, const std::string& options)
    : forward(device, "aggregate_joint_sampled.cl", "aggregate_joint_sampled_forward", options),
      backward(device, "aggregate_joint_sampled.cl", "aggregate_joint_sampled_backward", options) {}

void Aggregate::set_smoothing(const Smoothing& smoothing) {
  const std::string options = prior_options(smoothing);
  const std::string wanted = std::string(to_string(smoothing.composition)) +
                             std::string(to_string(smoothing.aggregation_estimator)) + options;
  if (wanted != built_) {
    // New kernels first: if they do not build, the old ones stay.
    const bool exact = smoothing.aggregation_estimator == Estimator::exact;
    std::optional<Exact> new_exact;
    std::optional<Sampled> new_sampled;
    std::optional<JointSampled> new_joint_sampled;
    if (exact) {
      new_exact.emplace(device_, smoothing.composition, options);
    } else if (samples_jointly(smoothing)) {
      new_joint_sampled.emplace(device_, options);
    } else {
      new_sampled.emplace(device_, options);
    }
    exact_ = std::move(new_exact);
    sampled_ = std::move(new_sampled);
    joint_sampled_ = std::move(new_joint_sampled);
    built_ = wanted;
  }
  smoothing_ = smoothing;
}

shared::AggregateParams Aggregate::params(const shared::FrameParams& p, const glm::vec3& background) const {
  shared::AggregateParams a{};
  a.background = to_cl(background);
  a.sigma = smoothing_.sigma;
  a.gamma = smoothing_.gamma;
  a.alpha = smoothing_.alpha;
  a.background_depth = smoothing_.background_depth;
  a.sampling = sampling_params(smoothing_);
  a.pixels_per_view = p.width * p.height;
  a.pixels = p.views * a.pixels_per_view;
  a.faces = p.faces;
  a.first_view = p.first_view;
  return a;
}

void Aggregate::forward(const AggregateInputs& in, const glm::vec3& background) {
  const shared::AggregateParams a = params(in.p, background);
  image.resize(device_, a.pixels);
  const Range pixels = in.rasterize.pixels(in.p);
  const Rasterize& r = in.rasterize;
  if (exact_) {
    slots_.resize(device_, r.listed_fragments + a.pixels);
    slot_counts_.resize(device_, a.pixels);
    exact_->forward(pixels, a, in.views.cameras, r.pixel_starts, r.list, r.depth, in.occupancy.log_occupancy,
                    in.occupancy.occupancy, in.shade.red, in.shade.green, in.shade.blue, slots_, slot_counts_,
                    image);
  } else if (joint_sampled_) {
    joint_sampled_->forward(pixels, a, in.views.cameras, r.pixel_starts, r.list, r.distance, r.depth,
                            in.shade.red, in.shade.green, in.shade.blue, r.fragment_pair, in.bin.pair_face,
                            image);
  } else {
    sampled_->forward(pixels, a, in.views.cameras, r.pixel_starts, r.list, r.depth,
                      in.occupancy.log_occupancy, in.occupancy.occupancy, in.shade.red, in.shade.green,
                      in.shade.blue, r.fragment_pair, in.bin.pair_face, image);
  }
}

void Aggregate::backward(const AggregateInputs& in, const glm::vec3& background,
                         const Buffer<cl_float4>& grad_image) {
  const shared::AggregateParams a = params(in.p, background);
  for (Buffer<float>* buffer :
       {&grad_depth, &grad_log_occupancy, &grad_color.red, &grad_color.green, &grad_color.blue}) {
    buffer->resize(device_, in.rasterize.fragments);
  }
  channels.resize(device_, std::size_t{DPR_PIXEL_CHANNELS} * a.pixels);
  const Range pixels = in.rasterize.pixels(in.p);
  const Rasterize& r = in.rasterize;
  if (exact_) {
    exact_->backward(pixels, a, in.views.cameras, r.pixel_starts, r.list, r.depth, in.occupancy.log_occupancy,
                     in.occupancy.occupancy, in.shade.red, in.shade.green, in.shade.blue, slots_,
                     slot_counts_, grad_image, grad_depth, grad_log_occupancy, grad_color.red,
                     grad_color.green, grad_color.blue, channels);
  } else if (joint_sampled_) {
    grad_distance.resize(device_, in.rasterize.fragments);
    grad_sigma.resize(device_, a.pixels);
    joint_sampled_->backward(pixels, a, in.views.cameras, r.pixel_starts, r.list, r.distance, r.depth,
                             in.shade.red, in.shade.green, in.shade.blue, r.fragment_pair, in.bin.pair_face,
                             grad_image, grad_distance, grad_depth, grad_color.red, grad_color.green,
                             grad_color.blue, grad_sigma, channels);
  } else {
    sampled_->backward(pixels, a, in.views.cameras, r.pixel_starts, r.list, r.depth,
                       in.occupancy.log_occupancy, in.occupancy.occupancy, in.shade.red, in.shade.green,
                       in.shade.blue, r.fragment_pair, in.bin.pair_face, grad_image, grad_depth,
                       grad_log_occupancy, grad_color.red, grad_color.green, grad_color.blue, channels);
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
