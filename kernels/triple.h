// Two or three slots of Gaussian noise in the barrier composition, in closed form. With d_jk = (beta_j -
// beta_k) / sqrt 2, the differences' noises, which correlate by 1/2 where they share a slot, give
//
//   w_j            = Phi2(d_jk, d_jl; 1/2)
//   dw_j / dbeta_k = -phi(d_jk) / sqrt 2 Phi((d_jl + d_kl) / sqrt 3),   j != k
//
// where the bivariate normal distribution is, by Plackett's identity (Biometrika 41, 1954),
//
//   Phi2(h, k; 1/2) = Phi(h) Phi(k) + 1 / (2 pi) integral from 0 to pi/6 of
//                     exp(-(h^2 + k^2 - 2 h k sin u) / (2 cos^2 u)) du
//
// four Gauss-Legendre nodes are right to 3e-9. Of two slots the third lies where it has no weight.
#ifndef DPR_TRIPLE_H
#define DPR_TRIPLE_H

#include "lanes.h"
#include "pixel.h"
#include "priors.h"

#ifdef DPR_TRIPLE

/// The beta of a third slot that is not there: Phi is 0 or 1 there.
#define DPR_ABSENT_BETA (-40.0f)

/// Nodes of an integral. The tables have those of two, then lanes of no weight.
#define DPR_PLACKETT_NODES 4
/// 1 / (2 cos^2 u), sin u / cos^2 u, and the weights over 2 pi.
constant float k_plackett_squares[16] = {0.500661405f, 0.515230893f, 0.566956922f, 0.640372466f,
                                         0.500661405f, 0.515230893f, 0.566956922f, 0.640372466f};
constant float k_plackett_products[16] = {0.0363945006f, 0.177171406f, 0.389675201f, 0.599635429f,
                                          0.0363945006f, 0.177171406f, 0.389675201f, 0.599635429f};
constant float k_plackett_weights[16] = {0.0144939519f, 0.0271727148f, 0.0271727148f, 0.0144939519f,
                                         0.0144939519f, 0.0271727148f, 0.0271727148f, 0.0144939519f};

/// The differences d_jk.
typedef struct {
  float d01, d02, d12;
} Triple;

static inline Triple make_triple(const Slots run) {
  const float second = run.slot[1].beta, third = run.count > 2 ? run.slot[2].beta : DPR_ABSENT_BETA;
  const Triple t = {-M_SQRT1_2_F * second, -M_SQRT1_2_F * third, M_SQRT1_2_F * (second - third)};
  return t;
}

/// Three numbers in the first lanes.
static inline realn three_lanes(float a, float b, float c) {
  return choose(DPR_LANE_INDEX == 0, (realn)(a), choose(DPR_LANE_INDEX == 1, (realn)(b), (realn)(c)));
}

/// The weights of slots 1 and 2, which are not the largest.
static inline float2 smaller_weights(const Triple t) {
  const float squares1 = t.d01 * t.d01 + t.d12 * t.d12, product1 = -t.d01 * t.d12;
  const float squares2 = t.d02 * t.d02 + t.d12 * t.d12, product2 = t.d02 * t.d12;
  realn sum1 = 0.0f, sum2 = 0.0f;
  for (uint first = 0; first < 2 * DPR_PLACKETT_NODES; first += DPR_WIDTH) {
    const intn is_first = (int)first + DPR_LANE_INDEX < DPR_PLACKETT_NODES;
    const realn squares = choose(is_first, (realn)(squares1), (realn)(squares2));
    const realn product = choose(is_first, (realn)(product1), (realn)(product2));
    const realn exponent =
        product * load_n(first, k_plackett_products) - squares * load_n(first, k_plackett_squares);
    const realn term = load_n(first, k_plackett_weights) * exp_of_negative(exponent);
    sum1 += choose(is_first, term, (realn)(0.0f));
    sum2 += choose(is_first, (realn)(0.0f), term);
  }
  const float4 sums = sum_lanes_of_4(sum1, sum2, (realn)(0.0f), (realn)(0.0f));
  realn cdf, density;
  prior_cdf_density(three_lanes(-t.d01, -t.d02, t.d12), &cdf, &density);
  return (float2)(cdf.s0 * cdf.s2 + sums.x, cdf.s1 * (1.0f - cdf.s2) + sums.y);
}

/// -dw_j / dbeta_k of the pairs 01, 02 and 12.
static inline float4 pair_slopes(const Triple t) {
  const float inverse_sqrt_3 = 0.577350269f;
  realn cdf, density;
  prior_cdf_density(inverse_sqrt_3 * three_lanes(t.d02 + t.d12, t.d01 - t.d12, -t.d01 - t.d02), &cdf,
                    &density);
  const realn slopes = M_SQRT1_2_F * cdf * normal_density(three_lanes(t.d01, t.d02, t.d12));
  return (float4)(slopes.s0, slopes.s1, slopes.s2, 0.0f);
}

/// Sum of the weights times (colour, 1). The weights are kept where the slots' occupancies are.
static inline float4 weigh_triple(Slots run, const Fragments f, float3 background) {
  const float2 smaller = smaller_weights(make_triple(run));
  const float weights[DPR_TRIPLE] = {1.0f - smaller.x - smaller.y, smaller.x, smaller.y};
  float4 sum = 0.0f;
#pragma unroll
  for (uint i = 0; i < DPR_TRIPLE; ++i) {
    if (i >= run.count) continue;
    run.slot[i].occupancy = weights[i];
    sum += weights[i] * (float4)(slot_color(run.slot[i], f, background), 1.0f);
  }
  return sum;
}

/// The weights and gradients of the slots, whose `grad` holds g and whose `occupancy` the weights. Returns
/// their sum.
static inline float triple_gradients(const Slots run, SlotGradients* out) {
  const float4 slopes = pair_slopes(make_triple(run));
  const float grad0 = run.slot[0].grad, grad1 = run.slot[1].grad;
  const float grad2 = run.count > 2 ? run.slot[2].grad : grad0;
  const float by01 = slopes.x * (grad0 - grad1), by02 = slopes.y * (grad0 - grad2),
              by12 = slopes.z * (grad1 - grad2);
  const float by_beta[DPR_TRIPLE] = {by01 + by02, by12 - by01, -by02 - by12};
#pragma unroll
  for (uint i = 0; i < DPR_TRIPLE; ++i) {
    if (i >= run.count) continue;
    add_gradient(run.slot[i].fragment, run.slot[i].occupancy, by_beta[i], out);
  }
  return 1.0f;
}

/// The same of the slots' rows. Colours count from the background's.
static inline float triple_rows(const Slots run, const Fragments f, float3 background, SlotRows* out) {
  const float4 slopes = pair_slopes(make_triple(run));
  const float3 color0 = slot_color(run.slot[0], f, background),
               color1 = slot_color(run.slot[1], f, background);
  const float3 color2 = run.count > 2 ? slot_color(run.slot[2], f, background) : color0;
  const float3 by01 = slopes.x * (color0 - color1), by02 = slopes.y * (color0 - color2),
               by12 = slopes.z * (color1 - color2);
  const float3 by_beta[DPR_TRIPLE] = {by01 + by02, by12 - by01, -by02 - by12};
#pragma unroll
  for (uint i = 0; i < DPR_TRIPLE; ++i) {
    if (i >= run.count) continue;
    add_row(run.slot[i].fragment, run.slot[i].occupancy, by_beta[i], out);
  }
  return 1.0f;
}

#endif

#endif
