#include "stages/occupancy.hpp"

namespace dpr {

std::string prior_option(Prior prior) { return " -DDPR_PRIOR=" + std::string(to_string(prior)); }

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

Occupancy::Exact::Exact(Device::Impl& device, const std::string& options)
    : forward(device, "occupancy.cl", "occupancy_forward", options),
      backward(device, "occupancy.cl", "occupancy_backward", options) {}

Occupancy::Sampled::Sampled(Device::Impl& device, const std::string& options)
    : forward(device, "occupancy_sampled.cl", "occupancy_sampled_forward", options),
      backward(device, "occupancy_sampled.cl", "occupancy_sampled_backward", options) {}

void Occupancy::set_smoothing(const Smoothing& smoothing) {
  if (samples_jointly(smoothing)) return;
  const bool exact = smoothing.occupancy_estimator == Estimator::exact;
  const bool variable = smoothing.occupancy_width == OccupancyWidth::variable;
  const std::string options =
      prior_option(smoothing.occupancy_prior) + (variable ? " -DDPR_VARIABLE_WIDTH" : "");
  const std::string wanted = std::string(to_string(smoothing.occupancy_estimator)) + options;
  if (wanted != built_) {
    // New kernels first: if they do not build, the old ones stay.
    std::optional<Exact> new_exact;
    std::optional<Sampled> new_sampled;
    if (exact) new_exact.emplace(device_, options);
    if (!exact) new_sampled.emplace(device_, options);
    exact_ = std::move(new_exact);
    sampled_ = std::move(new_sampled);
    built_ = wanted;
  }
  smoothing_ = smoothing;
}

shared::OccupancyParams Occupancy::params(const shared::FrameParams& p) const {
  shared::OccupancyParams o{};
  o.sigma = smoothing_.sigma;
  o.sampling = sampling_params(smoothing_);
  o.width = p.width;
  o.faces = p.faces;
  o.first_view = p.first_view;
  return o;
}

void Occupancy::forward(const shared::FrameParams& p, const Bin& bin, const Rasterize& rasterize) {
  log_occupancy.resize(device_, rasterize.fragments);
  occupancy.resize(device_, rasterize.fragments);
  const Range pairs = rasterize.pairs(bin);
  if (exact_) {
    const std::size_t width = std::min<std::size_t>(device_.info.lanes, DPR_TILE);
    exact_->forward((rasterize.fragments + width - 1) / width, params(p), pairs.last(),
                    rasterize.fragment_starts, rasterize.distance, log_occupancy, occupancy);
  } else {
    sampled_->forward(pairs, params(p), pairs.last(), bin.pair_face, rasterize.fragment_starts,
                      rasterize.fragment_pixel, rasterize.distance, log_occupancy, occupancy);
  }
}

void Occupancy::backward(const shared::FrameParams& p, const Bin& bin, const Rasterize& rasterize,
                         const Buffer<float>& grad_log_occupancy) {
  const Range pairs = rasterize.pairs(bin);
  grad_distance.resize(device_, rasterize.fragments);
  grad_sigma.resize(device_, bin.pairs);
  if (exact_) {
    exact_->backward(pairs, params(p), pairs.last(), rasterize.masks, rasterize.fragment_starts,
                     rasterize.distance, grad_log_occupancy, grad_distance, grad_sigma);
  } else {
    sampled_->backward(pairs, params(p), pairs.last(), bin.pair_face, rasterize.masks,
                       rasterize.fragment_starts, rasterize.fragment_pixel, rasterize.distance, occupancy,
                       grad_log_occupancy, grad_distance, grad_sigma);
  }
}

std::size_t Occupancy::bytes() const {
  return log_occupancy.capacity_bytes() + occupancy.capacity_bytes() + grad_distance.capacity_bytes() +
         grad_sigma.capacity_bytes();
}

}  // namespace dpr
