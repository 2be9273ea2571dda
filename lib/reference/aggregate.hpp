/// Reference for the aggregation stage, exact: weights, colour and silhouette of one pixel and all
/// derivatives. Le Lidec et al. 2021, eq. (3), (7), (9), (10).
///
/// One integrator serves both compositions. With occupancies p_k, F_k(t) = F(t - beta_k), f_k its density:
///
///     T_k = 1 - p_k + p_k F_k,   P = prod_k T_k,   q_k = p_k f_k / T_k
///     w_k = integral P q_k dt
///
/// The barrier composition is the case p_k = 1 (T_k = F_k, q_k = r_k) with the background as one more slot;
/// its occupancies are inside beta. Gumbel noise in the barrier composition is softmax (40) and needs no
/// integral.
#pragma once

#include "quadrature.hpp"
#include "vec.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <vector>

namespace dpr::reference {

enum class Composition { barrier, joint };

struct AggregateParameters {
  Composition composition = Composition::barrier;
  Prior prior = Prior::gaussian;
  double gamma = 1e-2;
  double alpha = 1.0;  ///< barrier only
  double znear = 1.0;
  double zfar = 100.0;
  double background_depth = 1e-10;  ///< zeta of the background slot, barrier only
  Vec3d background;
};

struct FragmentInput {
  double depth = 0.0;
  double occupancy = 0.0;  ///< p; zero means the fragment is absent
  double log_occupancy = k_minus_infinity;
  Vec3d color;
};

struct AggregateResult {
  std::vector<double> weights;  ///< one per fragment, in their order
  double background_weight = 1.0;
  Vec3d color;
  double silhouette = 0.0;  ///< A = 1 - prod (1 - p_k)
};

struct FragmentInputGradient {
  double depth = 0.0;
  double occupancy = 0.0;
  double log_occupancy = 0.0;  ///< barrier: through beta, on top of `occupancy`
  Vec3d color;
};

struct AggregateGradient {
  std::vector<FragmentInputGradient> fragments;
  double gamma = 0.0;  ///< total, with the gamma inside b of the barrier
  double alpha = 0.0;
  Vec3d background;
};

/// One coordinate of the perturbed arg-max.
struct Slot {
  double beta = 0.0;       ///< b / gamma
  double occupancy = 1.0;  ///< in (0, 1]
};

/// The factors of the integrand at one node.
struct Integrand {
  std::vector<double> log_survivor;  ///< ln T_k; -infinity for the uniform prior and p = 1 below the slot
  std::vector<double> ratio;         ///< q_k / p_k = f_k / T_k
  std::vector<double> absent;        ///< F_k - 1
  double product = 1.0;              ///< P
};

inline void evaluate_integrand(Prior prior, const std::vector<Slot>& slots, const Node& node, Integrand& at) {
  const double upper = panel_rule(prior).upper;
  at.log_survivor.assign(slots.size(), 0.0);
  at.ratio.assign(slots.size(), 0.0);
  at.absent.assign(slots.size(), 0.0);
  double log_product = 0.0;
  for (std::size_t k = 0; k < slots.size(); ++k) {
    const double x = node.offset + (node.anchor - slots[k].beta);
    if (x >= upper) continue;  // F = 1, f = 0 within the neglected mass
    const double p = slots[k].occupancy;
    const double log_f = log_cdf(prior, x);
    const double log_t = p == 1.0 ? log_f : std::log(1.0 - p + p * std::exp(log_f));
    at.log_survivor[k] = log_t;
    at.absent[k] = std::expm1(log_f);
    if (log_t > k_minus_infinity) at.ratio[k] = std::exp(log_density(prior, x) - log_t);
    log_product += log_t;
  }
  at.product = std::exp(log_product);
}

/// Below `floor` the integrand is negligible; without one the nodes follow every slot.
inline std::vector<Node> nodes_for(Prior prior, const std::vector<Slot>& slots, double floor) {
  std::vector<double> betas;
  for (const Slot& slot : slots) betas.push_back(slot.beta);
  return quadrature_nodes(prior, betas, floor);
}

/// A slot that covers for certain (p = 1) hides everything below its own support: there the product vanishes.
inline double visible_floor(Prior prior, const std::vector<Slot>& slots) {
  double floor = k_minus_infinity;
  for (const Slot& slot : slots) {
    if (slot.occupancy == 1.0) floor = std::max(floor, slot.beta + panel_rule(prior).lower);
  }
  return floor;
}

/// w_k for every slot.
inline std::vector<double> integrate_weights(Prior prior, const std::vector<Slot>& slots) {
  if (slots.size() == 1) return {slots[0].occupancy};
  std::vector<double> weights(slots.size(), 0.0);
  if (slots.empty()) return weights;
  Integrand at;
  for (const Node& node : nodes_for(prior, slots, visible_floor(prior, slots))) {
    evaluate_integrand(prior, slots, node, at);
    if (at.product == 0.0) continue;
    for (std::size_t k = 0; k < slots.size(); ++k) {
      weights[k] += node.weight * at.product * slots[k].occupancy * at.ratio[k];
    }
  }
  return weights;
}

/// The sum of all values but the k-th, for every k. Subtracting from the total would lose small values beside
/// a huge one.
inline std::vector<double> sums_of_others(const std::vector<double>& values) {
  std::vector<double> sums(values.size(), 0.0);
  double before = 0.0;
  double after = 0.0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::size_t j = values.size() - 1 - i;
    sums[i] += before;
    sums[j] += after;
    before += values[i];
    after += values[j];
  }
  return sums;
}

struct SlotGradient {
  double beta = 0.0;
  double occupancy = 0.0;
};

/// With g_k = dL/dw_k, R = sum q, G = sum g q:
///     dL/dbeta_k = integral P q_k (g_k R - G) dt
/// The integrand vanishes with P, though q may be huge there.
inline void add_beta_gradient(const std::vector<Slot>& slots, const std::vector<double>& grad_weights,
                              const Integrand& at, double node_weight, std::vector<SlotGradient>& grad) {
  if (at.product == 0.0) return;
  double ratio_sum = 0.0;
  double grad_sum = 0.0;
  for (std::size_t k = 0; k < slots.size(); ++k) {
    ratio_sum += slots[k].occupancy * at.ratio[k];
    grad_sum += grad_weights[k] * slots[k].occupancy * at.ratio[k];
  }
  for (std::size_t k = 0; k < slots.size(); ++k) {
    const double q = slots[k].occupancy * at.ratio[k];
    grad[k].beta += node_weight * at.product * q * (grad_weights[k] * ratio_sum - grad_sum);
  }
}

/// dL/dp_k = integral g_k f_k P/T_k dt + integral (P/T_k) (F_k - 1) (G - g_k q_k) dt, but for the weight of
/// the uncovered background, prod (1 - p_k), which is the caller's.
inline void add_occupancy_gradient(const std::vector<Slot>& slots, const std::vector<double>& grad_weights,
                                   const Integrand& at, double node_weight, std::vector<SlotGradient>& grad) {
  std::vector<double> weighted;
  for (std::size_t k = 0; k < slots.size(); ++k) {
    weighted.push_back(grad_weights[k] * slots[k].occupancy * at.ratio[k]);
  }
  const std::vector<double> other_weighted = sums_of_others(weighted);
  const std::vector<double> other_logs = sums_of_others(at.log_survivor);
  for (std::size_t k = 0; k < slots.size(); ++k) {
    if (at.product > 0.0) grad[k].occupancy += node_weight * at.product * at.ratio[k] * grad_weights[k];
    const double others = std::exp(other_logs[k]);
    if (others > 0.0) grad[k].occupancy += node_weight * others * at.absent[k] * other_weighted[k];
  }
}

/// Derivatives for every beta and, in the joint composition, every p; the barrier's slots have p = 1 for
/// good.
inline std::vector<SlotGradient> integrate_backward(Prior prior, Composition composition,
                                                    const std::vector<Slot>& slots,
                                                    const std::vector<double>& grad_weights) {
  const bool joint = composition == Composition::joint;
  if (slots.size() == 1) return {{0.0, joint ? grad_weights[0] : 0.0}};
  std::vector<SlotGradient> grad(slots.size());
  if (slots.empty()) return grad;
  // With p a little below 1 what lies behind shows through: its derivative needs the nodes down there.
  const double floor = joint ? k_minus_infinity : visible_floor(prior, slots);
  Integrand at;
  for (const Node& node : nodes_for(prior, slots, floor)) {
    evaluate_integrand(prior, slots, node, at);
    add_beta_gradient(slots, grad_weights, at, node.weight, grad);
    if (joint) add_occupancy_gradient(slots, grad_weights, at, node.weight, grad);
  }
  return grad;
}

/// (40): the perturbed arg-max of Gumbel noise. `slots` has at least one element.
inline std::vector<double> softmax_weights(const std::vector<Slot>& slots) {
  double maximum = k_minus_infinity;
  for (const Slot& slot : slots) maximum = std::max(maximum, slot.beta);
  std::vector<double> weights;
  double sum = 0.0;
  for (const Slot& slot : slots) {
    weights.push_back(std::exp(slot.beta - maximum));
    sum += weights.back();
  }
  for (double& w : weights) w /= sum;
  return weights;
}

inline std::vector<SlotGradient> softmax_backward(const std::vector<Slot>& slots,
                                                  const std::vector<double>& grad_weights) {
  const std::vector<double> weights = softmax_weights(slots);
  double mean = 0.0;
  for (std::size_t k = 0; k < slots.size(); ++k) mean += weights[k] * grad_weights[k];
  std::vector<SlotGradient> grad(slots.size());
  for (std::size_t k = 0; k < slots.size(); ++k) grad[k].beta = weights[k] * (grad_weights[k] - mean);
  return grad;
}

/// The slots of a pixel: the fragments that are present, then in the barrier composition the background.
struct PixelSlots {
  std::vector<std::size_t> fragment;  ///< of every slot but the background
  std::vector<double> zeta;           ///< of every slot, relative to the nearest fragment's
  std::vector<Slot> slots;
};

/// zeta = (zfar - z) / (zfar - znear); a common shift of all slots changes nothing, so differences of depths
/// are used, which keep their bits when gamma is small.
inline PixelSlots make_slots(const std::vector<FragmentInput>& fragments, const AggregateParameters& p) {
  PixelSlots pixel;
  double nearest = p.zfar;
  for (std::size_t k = 0; k < fragments.size(); ++k) {
    if (!(fragments[k].occupancy > 0.0) && !(fragments[k].log_occupancy > k_minus_infinity)) continue;
    if (p.composition == Composition::joint && !(fragments[k].occupancy > 0.0)) continue;
    pixel.fragment.push_back(k);
    nearest = std::min(nearest, fragments[k].depth);
  }
  const double range = p.zfar - p.znear;
  const bool barrier = p.composition == Composition::barrier;
  for (std::size_t k : pixel.fragment) {
    const double zeta = (nearest - fragments[k].depth) / range;
    pixel.zeta.push_back(zeta);
    if (barrier) {
      pixel.slots.push_back({zeta / p.gamma + fragments[k].log_occupancy / p.alpha, 1.0});
    } else {
      pixel.slots.push_back({zeta / p.gamma, fragments[k].occupancy});
    }
  }
  if (barrier) {
    pixel.zeta.push_back(p.background_depth - (p.zfar - nearest) / range);
    pixel.slots.push_back({pixel.zeta.back() / p.gamma, 1.0});
  }
  return pixel;
}

/// prod over l != skip of (1 - p_l); `skip` may be past the end.
inline double uncovered(const std::vector<FragmentInput>& fragments, std::size_t skip) {
  double product = 1.0;
  for (std::size_t l = 0; l < fragments.size(); ++l) {
    if (l != skip) product *= 1.0 - fragments[l].occupancy;
  }
  return product;
}

inline bool has_closed_form(const AggregateParameters& p) {
  return p.composition == Composition::barrier && p.prior == Prior::gumbel;
}

/// Weights, colour and silhouette of a pixel. Any number of fragments in any order, none included.
inline AggregateResult aggregate_forward(const std::vector<FragmentInput>& fragments,
                                         const AggregateParameters& p) {
  const PixelSlots pixel = make_slots(fragments, p);
  const std::vector<double> slot_weights =
      has_closed_form(p) ? softmax_weights(pixel.slots) : integrate_weights(p.prior, pixel.slots);

  AggregateResult result;
  result.weights.assign(fragments.size(), 0.0);
  for (std::size_t i = 0; i < pixel.fragment.size(); ++i) result.weights[pixel.fragment[i]] = slot_weights[i];
  const bool barrier = p.composition == Composition::barrier;
  result.background_weight = barrier ? slot_weights.back() : uncovered(fragments, fragments.size());

  result.color = result.background_weight * p.background;
  double log_uncovered = 0.0;  // 1 - prod(1 - p) would lose small occupancies
  for (std::size_t k = 0; k < fragments.size(); ++k) {
    result.color += result.weights[k] * fragments[k].color;
    log_uncovered += std::log1p(-fragments[k].occupancy);
  }
  result.silhouette = -std::expm1(log_uncovered);
  return result;
}

/// Gradient of a function of the weights alone: `grad_weights` per fragment, `grad_background_weight` for the
/// background. In the result the colours and the background colour are zero.
inline AggregateGradient weights_backward(const std::vector<FragmentInput>& fragments,
                                          const AggregateParameters& p,
                                          const std::vector<double>& grad_weights,
                                          double grad_background_weight) {
  const PixelSlots pixel = make_slots(fragments, p);
  const bool barrier = p.composition == Composition::barrier;
  std::vector<double> grad_slots;
  for (std::size_t k : pixel.fragment) grad_slots.push_back(grad_weights[k]);
  if (barrier) grad_slots.push_back(grad_background_weight);
  const std::vector<SlotGradient> slot_grad =
      has_closed_form(p) ? softmax_backward(pixel.slots, grad_slots)
                         : integrate_backward(p.prior, p.composition, pixel.slots, grad_slots);

  AggregateGradient grad;
  grad.fragments.resize(fragments.size());
  for (std::size_t i = 0; i < pixel.slots.size(); ++i) {
    // beta = zeta/gamma + ln p/alpha in the barrier, zeta/gamma in the joint composition: the derivative for
    // gamma is total.
    grad.gamma -= pixel.zeta[i] * slot_grad[i].beta / (p.gamma * p.gamma);
    if (i == pixel.fragment.size()) continue;  // the background slot has neither depth nor occupancy
    const std::size_t k = pixel.fragment[i];
    grad.fragments[k].depth = -slot_grad[i].beta / (p.gamma * (p.zfar - p.znear));
    if (barrier) {
      grad.fragments[k].log_occupancy = slot_grad[i].beta / p.alpha;
      grad.alpha -= fragments[k].log_occupancy * slot_grad[i].beta / (p.alpha * p.alpha);
    } else {
      grad.fragments[k].occupancy = slot_grad[i].occupancy - grad_background_weight * uncovered(fragments, k);
    }
  }
  return grad;
}

inline AggregateGradient aggregate_backward(const std::vector<FragmentInput>& fragments,
                                            const AggregateParameters& p, const Vec3d& grad_color,
                                            double grad_silhouette) {
  std::vector<double> grad_weights;
  for (const FragmentInput& fragment : fragments) grad_weights.push_back(dot(grad_color, fragment.color));
  AggregateGradient grad = weights_backward(fragments, p, grad_weights, dot(grad_color, p.background));

  const AggregateResult result = aggregate_forward(fragments, p);
  grad.background = result.background_weight * grad_color;
  for (std::size_t k = 0; k < fragments.size(); ++k) {
    grad.fragments[k].color = result.weights[k] * grad_color;
    if (!(fragments[k].occupancy > 0.0)) continue;  // absent: no gradient
    grad.fragments[k].occupancy += grad_silhouette * uncovered(fragments, k);
  }
  return grad;
}

}  // namespace dpr::reference
