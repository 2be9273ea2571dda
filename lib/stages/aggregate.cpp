#include "stages/aggregate.hpp"

namespace dpr {
namespace {

/// The build options that choose the priors: the sampled joint composition draws from both.
std::string prior_options(const Smoothing& smoothing) {
  if (!samples_jointly(smoothing)) return prior_option(smoothing.depth_prior);
  return " -DDPR_OCCUPANCY_PRIOR=" + std::string(to_string(smoothing.occupancy_prior)) +
         " -DDPR_DEPTH_PRIOR=" + std::string(to_string(smoothing.depth_prior));
}

}  // namespace

Aggregate::Setting Aggregate::prepare(const Smoothing& smoothing) const {
  const std::string options = prior_options(smoothing);
  const std::string wanted = std::string(to_string(smoothing.composition)) +
                             std::string(to_string(smoothing.aggregation_estimator)) + options;
  return SmoothedStage::prepare(smoothing, wanted, [&](AggregateKernels& kernels) {
    const bool is_exact = smoothing.aggregation_estimator == Estimator::exact;
    if (is_exact && smoothing.composition == Composition::barrier) {
      kernels.barrier.emplace(device_, options);
    } else if (is_exact) {
      kernels.joint.emplace(device_, options);
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
  if (now_.kernels->barrier || now_.kernels->joint) {
    const bool has_background_slots = now_.kernels->barrier.has_value();
    slots_.resize(device_, in.rasterize.fragments + (has_background_slots ? a.pixels : 0));
    slot_counts_.resize(device_, a.pixels);
  }
  for (const Range& pixels : in.rasterize.pixels(in.p)) {
    a.last_pixel = pixels.last();
    forward(in, a, pixels);
  }
}

template <class Arguments>
Arguments Aggregate::exact_forward(const AggregateInputs& in, const shared::AggregateParams& a) {
  const Rasterize& r = in.rasterize;
  return {.p = a,
          .views = in.views.cameras,
          .starts = r.pixel_starts,
          .list = r.list,
          .depth = r.depth,
          .log_occupancy = in.occupancy.log_occupancy,
          .occupancy = in.occupancy.occupancy,
          .red = in.shade.color.red,
          .green = in.shade.color.green,
          .blue = in.shade.color.blue,
          .slots = slots_,
          .slot_counts = slot_counts_,
          .image = image};
}

void Aggregate::forward(const AggregateInputs& in, const shared::AggregateParams& a, const Range& pixels) {
  const Rasterize& r = in.rasterize;
  if (now_.kernels->barrier) {
    (*now_.kernels->barrier)(pixels, exact_forward<kernel::aggregate_forward>(in, a));
  } else if (now_.kernels->joint) {
    (*now_.kernels->joint)(pixels, exact_forward<kernel::aggregate_joint_forward>(in, a));
  } else if (now_.kernels->joint_sampled) {
    (*now_.kernels->joint_sampled)(pixels,
                                   kernel::aggregate_joint_sampled_forward{.p = a,
                                                                           .views = in.views.cameras,
                                                                           .starts = r.pixel_starts,
                                                                           .list = r.list,
                                                                           .distance = r.distance,
                                                                           .depth = r.depth,
                                                                           .red = in.shade.color.red,
                                                                           .green = in.shade.color.green,
                                                                           .blue = in.shade.color.blue,
                                                                           .fragment_pair = r.fragment_pair,
                                                                           .pair_face = in.bin.pair_face,
                                                                           .image = image});
  } else {
    (*now_.kernels->sampled)(pixels,
                             kernel::aggregate_sampled_forward{.p = a,
                                                               .views = in.views.cameras,
                                                               .starts = r.pixel_starts,
                                                               .list = r.list,
                                                               .depth = r.depth,
                                                               .log_occupancy = in.occupancy.log_occupancy,
                                                               .occupancy = in.occupancy.occupancy,
                                                               .red = in.shade.color.red,
                                                               .green = in.shade.color.green,
                                                               .blue = in.shade.color.blue,
                                                               .fragment_pair = r.fragment_pair,
                                                               .pair_face = in.bin.pair_face,
                                                               .image = image});
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

template <class Arguments>
Arguments Aggregate::exact_backward(const AggregateInputs& in, const shared::AggregateParams& a,
                                    const BufferRef<cl_float4>& grad_image) {
  const Rasterize& r = in.rasterize;
  return {.p = a,
          .views = in.views.cameras,
          .starts = r.pixel_starts,
          .list = r.list,
          .depth = r.depth,
          .log_occupancy = in.occupancy.log_occupancy,
          .occupancy = in.occupancy.occupancy,
          .red = in.shade.color.red,
          .green = in.shade.color.green,
          .blue = in.shade.color.blue,
          .slots = slots_,
          .slot_counts = slot_counts_,
          .grad_image = grad_image,
          .grad_depth = grad_depth,
          .grad_log_occupancy = grad_log_occupancy,
          .grad_red = grad_color.red,
          .grad_green = grad_color.green,
          .grad_blue = grad_color.blue,
          .channels = channels};
}

void Aggregate::backward(const AggregateInputs& in, const shared::AggregateParams& a, const Range& pixels,
                         const BufferRef<cl_float4>& grad_image) {
  const Rasterize& r = in.rasterize;
  if (now_.kernels->barrier) {
    (*now_.kernels->barrier)(pixels, exact_backward<kernel::aggregate_backward>(in, a, grad_image));
  } else if (now_.kernels->joint) {
    (*now_.kernels->joint)(pixels, exact_backward<kernel::aggregate_joint_backward>(in, a, grad_image));
  } else if (now_.kernels->joint_sampled) {
    (*now_.kernels->joint_sampled)(pixels,
                                   kernel::aggregate_joint_sampled_backward{.p = a,
                                                                            .views = in.views.cameras,
                                                                            .starts = r.pixel_starts,
                                                                            .list = r.list,
                                                                            .distance = r.distance,
                                                                            .depth = r.depth,
                                                                            .red = in.shade.color.red,
                                                                            .green = in.shade.color.green,
                                                                            .blue = in.shade.color.blue,
                                                                            .fragment_pair = r.fragment_pair,
                                                                            .pair_face = in.bin.pair_face,
                                                                            .grad_image = grad_image,
                                                                            .grad_distance = grad_distance,
                                                                            .grad_depth = grad_depth,
                                                                            .grad_red = grad_color.red,
                                                                            .grad_green = grad_color.green,
                                                                            .grad_blue = grad_color.blue,
                                                                            .grad_sigma = grad_sigma,
                                                                            .channels = channels});
  } else {
    (*now_.kernels->sampled)(pixels,
                             kernel::aggregate_sampled_backward{.p = a,
                                                                .views = in.views.cameras,
                                                                .starts = r.pixel_starts,
                                                                .list = r.list,
                                                                .depth = r.depth,
                                                                .log_occupancy = in.occupancy.log_occupancy,
                                                                .occupancy = in.occupancy.occupancy,
                                                                .red = in.shade.color.red,
                                                                .green = in.shade.color.green,
                                                                .blue = in.shade.color.blue,
                                                                .fragment_pair = r.fragment_pair,
                                                                .pair_face = in.bin.pair_face,
                                                                .grad_image = grad_image,
                                                                .grad_depth = grad_depth,
                                                                .grad_log_occupancy = grad_log_occupancy,
                                                                .grad_red = grad_color.red,
                                                                .grad_green = grad_color.green,
                                                                .grad_blue = grad_color.blue,
                                                                .channels = channels});
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
