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

shared::AggregateParams Aggregate::params(const shared::FrameParams& p, const glm::vec3& background,
                                          bool with_channels) const {
  shared::AggregateParams a{};
  a.background = to_cl(background);
  a.sigma = now_.smoothing.sigma;
  a.gamma = now_.smoothing.gamma;
  a.alpha = now_.smoothing.alpha;
  a.background_depth = now_.smoothing.background_depth;
  a.sampling = sampling_params(now_.smoothing);
  a.pixels_per_view = p.width * p.height;
  a.first_pixel = p.first_sample;
  a.pixels = to_uint(pixels_of(p));
  a.faces = p.faces;
  a.first_view = p.first_view;
  a.channels = with_channels ? to_uint(channel_count()) : 0;
  a.fragments = p.fragments;
  a.grad_fragments = p.grad_fragments;
  return a;
}

/// What the kernels take, by the names of their arguments.
struct AggregateArguments {
  shared::AggregateParams p;
  const Buffer<shared::ViewParams>& views;
  const Buffer<cl_uint>&starts, &list, &fragment_pair, &pair_face;
  const Buffer<float>& fragments;
  Buffer<shared::Slot>& slots;
  Buffer<cl_uint>& slot_counts;
  Buffer<cl_float4>& image;
  BufferRef<cl_float4> grad_image;
  Buffer<float>&grads, &grad_sigma, &channels;
};

/// What the kernels of rows take, by the names of their arguments.
struct AggregateRowsArguments {
  shared::AggregateParams p;
  shared::TangentParams q;
  const Buffer<shared::ViewParams>& views;
  const Buffer<cl_uint>&starts, &list, &slot_counts;
  const Buffer<float>& fragments;
  const Buffer<shared::FrameTangent>& frames;
  Buffer<shared::Slot>& slots;
  Buffer<float>& rows;
  Buffer<cl_float4>& image_tangents;
};

/// Launches the kernels in force by runs of the band's pixels.
template <class Barrier, class Joint, class Sampled, class JointSampled>
void Aggregate::launch(const AggregateInputs& in, const glm::vec3& background,
                       const BufferRef<cl_float4>& grad_image, bool with_channels) {
  Rasterize& r = in.rasterize;
  AggregateArguments all{.p = params(in.p, background, with_channels),
                         .views = in.views.cameras,
                         .starts = r.pixel_starts,
                         .list = r.list,
                         .fragment_pair = r.fragment_pair,
                         .pair_face = in.bin.pair_face,
                         .fragments = r.values,
                         .slots = slots_,
                         .slot_counts = slot_counts_,
                         .image = image,
                         .grad_image = grad_image,
                         .grads = r.grads,
                         .grad_sigma = grad_sigma,
                         .channels = channels};
  AggregateKernels& kernels = *now_.kernels;
  for (const Range& pixels : r.pixels(in.p)) {
    all.p.last_pixel = pixels.last();
    if (kernels.barrier) (*kernels.barrier)(pixels, Barrier::pick(all));
    if (kernels.joint) (*kernels.joint)(pixels, Joint::pick(all));
    if (kernels.sampled) (*kernels.sampled)(pixels, Sampled::pick(all));
    if (kernels.joint_sampled) (*kernels.joint_sampled)(pixels, JointSampled::pick(all));
  }
}

void Aggregate::forward(const AggregateInputs& in, const glm::vec3& background) {
  const std::size_t pixels = pixels_of(in.p);
  image.resize(device_, pixels);
  if (now_.kernels->barrier || now_.kernels->joint) {
    const bool has_background_slots = now_.kernels->barrier.has_value();
    slots_.resize(device_, in.rasterize.fragments + (has_background_slots ? pixels : 0));
    slot_counts_.resize(device_, pixels);
  }
  launch<kernel::aggregate_forward, kernel::aggregate_joint_forward, kernel::aggregate_sampled_forward,
         kernel::aggregate_joint_sampled_forward>(in, background, BufferRef<cl_float4>(nullptr), false);
}

void Aggregate::backward(const AggregateInputs& in, const glm::vec3& background,
                         const BufferRef<cl_float4>& grad_image, bool with_channels) {
  const std::size_t pixels = pixels_of(in.p);
  in.rasterize.start_gradients(in.p);
  channels.resize(device_, with_channels ? channel_count() * pixels : 1);  // an argument all the same
  if (perturbs_distances()) grad_sigma.resize(device_, pixels);
  launch<kernel::aggregate_backward, kernel::aggregate_joint_backward, kernel::aggregate_sampled_backward,
         kernel::aggregate_joint_sampled_backward>(in, background, grad_image, with_channels);
}

void Aggregate::tangent(const AggregateInputs& in, const glm::vec3& background, Tangents& tangents,
                        std::size_t first, Buffer<cl_float4>& images) {
  Rasterize& r = in.rasterize;
  r.start_gradients(in.p);
  tangents.params.first = to_uint(first);
  const shared::TangentParams& q = tangents.params;
  tangents.shares.resize(device_, std::size_t{q.directions} * in.p.grad_fragments);
  if (!tangent_) tangent_.emplace(device_);
  AggregateRowsArguments all{.p = params(in.p, background, false),
                             .q = q,
                             .views = in.views.cameras,
                             .starts = r.pixel_starts,
                             .list = r.list,
                             .slot_counts = slot_counts_,
                             .fragments = r.values,
                             .frames = tangents.frames,
                             .slots = slots_,
                             .rows = r.grads,
                             .image_tangents = images};
  for (const Range& pixels : r.pixels(in.p)) {
    all.p.last_pixel = pixels.last();
    if (now_.kernels->barrier) (*now_.kernels->barrier)(pixels, kernel::aggregate_rows::pick(all));
    if (now_.kernels->joint) (*now_.kernels->joint)(pixels, kernel::aggregate_joint_rows::pick(all));
  }
  (*tangent_)(r.vectors(), kernel::aggregate_share_tangent{.p = all.p,
                                                           .q = q,
                                                           .last_pair = in.p.last_pair,
                                                           .fragment_starts = r.fragment_starts,
                                                           .rows = r.grads,
                                                           .tangents = tangents.fragments,
                                                           .shares = tangents.shares});
  for (const Range& pixels : r.pixels(in.p)) {
    all.p.last_pixel = pixels.last();
    (*tangent_)(pixels, kernel::aggregate_sum_tangent{.p = all.p,
                                                      .q = q,
                                                      .starts = r.pixel_starts,
                                                      .list = r.list,
                                                      .shares = tangents.shares,
                                                      .image_tangents = images});
  }
}

std::size_t Aggregate::bytes() const {
  return image.capacity_bytes() + slots_.capacity_bytes() + slot_counts_.capacity_bytes() +
         channels.capacity_bytes() + grad_sigma.capacity_bytes();
}

}  // namespace dpr
