#include "stages/occupancy.hpp"

namespace dpr {

std::string prior_option(Prior prior) {
  return prior == Prior::gaussian ? "" : " -DDPR_PRIOR=" + std::string(to_string(prior));
}

bool samples_jointly(const Smoothing& smoothing) {
  return smoothing.composition == Composition::joint &&
         smoothing.aggregation_estimator == Estimator::monte_carlo;
}

shared::Sampling sampling_params(const Smoothing& smoothing) {
  shared::Sampling s{};
  s.samples = smoothing.samples;
  s.draws = static_cast<cl_uint>(smoothing.draws);
  s.baseline = smoothing.variance_reduction == VarianceReduction::none ? 0.0F : 1.0F;
  if (smoothing.variance_reduction == VarianceReduction::leave_one_out) {
    const std::uint32_t group = smoothing.draws == Draws::antithetic ? 2 : 1;
    s.leave_out = 1.0F / static_cast<float>(smoothing.samples - group);
  }
  s.seed_low = static_cast<cl_uint>(smoothing.seed);
  s.seed_high = static_cast<cl_uint>(smoothing.seed >> 32U);
  return s;
}

Occupancy::Setting Occupancy::prepare(const Smoothing& smoothing) const {
  if (samples_jointly(smoothing)) return {smoothing, now_.kernels};
  const std::string options = prior_option(smoothing.occupancy_prior);
  return SmoothedStage::prepare(smoothing, std::string(to_string(smoothing.occupancy_estimator)) + options,
                                [&](OccupancyKernels& kernels) {
                                  if (smoothing.occupancy_estimator == Estimator::exact) {
                                    kernels.exact.emplace(device_, options);
                                  } else {
                                    kernels.sampled.emplace(device_, options);
                                  }
                                });
}

shared::OccupancyParams Occupancy::params(const shared::FrameParams& p) const {
  shared::OccupancyParams o{};
  o.sigma = now_.smoothing.sigma;
  o.noise_width = static_cast<cl_uint>(now_.smoothing.occupancy_width);
  o.sampling = sampling_params(now_.smoothing);
  o.width = p.width;
  o.faces = p.faces;
  o.first_view = p.first_view;
  o.fragments = p.fragments;
  o.grad_fragments = p.grad_fragments;
  return o;
}

void Occupancy::forward(const shared::FrameParams& p, const Bin& bin, Rasterize& rasterize) {
  if (now_.kernels->exact) {
    (*now_.kernels->exact)(rasterize.vectors(),
                           kernel::occupancy_forward{.p = params(p),
                                                     .last_pair = p.last_pair,
                                                     .fragment_starts = rasterize.fragment_starts,
                                                     .fragments = rasterize.values});
  } else {
    const Range pairs = rasterize.pairs(bin);
    (*now_.kernels->sampled)(Range(pairs.first, std::min(pairs.count, bin.launched)),
                             kernel::occupancy_sampled_forward{.p = params(p),
                                                               .last_pair = p.last_pair,
                                                               .pairs = bin.pair_count,
                                                               .pair_face = bin.pair_face,
                                                               .fragment_starts = rasterize.fragment_starts,
                                                               .pixels = rasterize.fragment_pixel,
                                                               .fragments = rasterize.values});
  }
}

void Occupancy::backward(const shared::FrameParams& p, const Bin& bin, Rasterize& rasterize) {
  grad_sigma.resize(device_, bin.pairs);
  if (now_.kernels->exact) {
    const PairGroups groups = rasterize.pair_groups(bin);
    (*now_.kernels->exact)(groups.count,
                           kernel::occupancy_backward{.p = params(p),
                                                      .range = groups.pairs,
                                                      .pairs = bin.pair_count,
                                                      .fragment_starts = rasterize.fragment_starts,
                                                      .fragments = rasterize.values,
                                                      .grads = rasterize.grads,
                                                      .grad_sigma = grad_sigma});
  } else {
    (*now_.kernels->sampled)(rasterize.pairs(bin),
                             kernel::occupancy_sampled_backward{.p = params(p),
                                                                .last_pair = p.last_pair,
                                                                .pairs = bin.pair_count,
                                                                .pair_face = bin.pair_face,
                                                                .fragment_starts = rasterize.fragment_starts,
                                                                .pixels = rasterize.fragment_pixel,
                                                                .fragments = rasterize.values,
                                                                .grads = rasterize.grads,
                                                                .grad_sigma = grad_sigma});
  }
}

void Occupancy::tangent(const shared::FrameParams& p, const Rasterize& rasterize, Tangents& tangents) {
  (*now_.kernels->exact)(rasterize.vectors(),
                         kernel::occupancy_tangent{.p = params(p),
                                                   .last_pair = p.last_pair,
                                                   .q = tangents.params,
                                                   .fragment_starts = rasterize.fragment_starts,
                                                   .fragments = rasterize.values,
                                                   .frames = tangents.frames,
                                                   .tangents = tangents.fragments});
}

}  // namespace dpr
