#include "costs.hpp"

namespace dpr::bench {
namespace {

StageCost rasterize_cost(const FrameWork& w) {
  return {w.pairs * (k_cover_per_pair + k_list_per_pair + k_rasterize_per_pair) +
              w.pixels * k_list_per_pixel + w.fragments * (k_list_per_fragment + k_rasterize_per_fragment),
          w.pairs * k_rasterize_backward_per_pair + w.fragments * k_rasterize_backward_per_fragment};
}

StageCost shade_cost(const FrameWork& w) {
  return {w.pairs * k_shade_per_pair + w.fragments * k_shade_per_fragment,
          w.pairs * k_shade_backward_per_pair + w.fragments * k_shade_backward_per_fragment};
}

std::optional<StageCost> occupancy_cost(const FrameWork& w, const Smoothing& s) {
  if (s.noise == Noise::pixel) return std::nullopt;  // triangles are sharp: what runs evaluates no noise
  const bool sampled = s.occupancy_estimator == Estimator::monte_carlo;
  double forward = 0, backward = 0;
  if (s.occupancy_prior == Prior::gaussian) {
    forward = sampled ? s.samples * k_occupancy_sample : k_gaussian_log + k_exp + 1;
    backward = sampled ? s.samples * k_occupancy_backward_sample : k_gaussian_log + 5;
  } else if (s.occupancy_prior == Prior::logistic && !sampled) {
    forward = k_logistic_log + k_exp + 1;
    backward = k_logistic_log + 5;
  } else {
    return std::nullopt;
  }
  return StageCost{
      w.fragments * Cost{forward, k_occupancy_bytes},
      w.pairs * k_occupancy_backward_per_pair + w.fragments * Cost{backward, k_occupancy_backward_bytes}};
}

std::optional<StageCost> aggregate_cost(const FrameWork& w, const Smoothing& s) {
  if (w.forward_evaluations == 0) return std::nullopt;
  double forward = k_barrier_slot, backward = k_barrier_slot_backward;
  if (s.aggregation_estimator == Estimator::monte_carlo) {
    if (s.depth_prior != Prior::gaussian || s.composition == Composition::joint) return std::nullopt;
    forward = k_sampled_slot;
    backward = k_sampled_slot_backward;
  } else if (s.composition == Composition::joint) {
    forward = k_joint_slot;
    backward = k_joint_slot_backward;
  } else if (s.depth_prior == Prior::gumbel) {
    forward = k_softmax_slot;
    backward = k_softmax_slot_backward;
  }
  return StageCost{w.pixels * k_aggregate_per_pixel + w.fragments * k_aggregate_per_fragment +
                       w.forward_evaluations * Cost{forward, 0},
                   w.pixels * k_aggregate_backward_per_pixel +
                       w.fragments * k_aggregate_backward_per_fragment +
                       w.backward_evaluations * Cost{backward, 0}};
}

}  // namespace

std::optional<StageCost> stage_cost(std::string_view stage, const FrameWork& work,
                                    const Smoothing& smoothing) {
  if (stage == "rasterize") return rasterize_cost(work);
  if (stage == "shade") return shade_cost(work);
  if (stage == "occupancy") return occupancy_cost(work, smoothing);
  if (stage == "aggregate") return aggregate_cost(work, smoothing);
  return std::nullopt;
}

}  // namespace dpr::bench
