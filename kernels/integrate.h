// The integrals of exact aggregation over the slots of a pixel, in either composition. With
// T_k = F(t - beta_k), or T_k = 1 - p_k + p_k F(t - beta_k) where DPR_JOINT is defined, P = prod T_k,
// r_k = p_k f(t - beta_k) / T_k (p_k = 1 in the barrier composition):
//
//   w_j         = integral P r_j dt
//   dL/dbeta_k  = integral P r_k (g_k R - G) dt,  R = sum r_j,  G = sum g_j r_j,  g_k = dL/dw_k
//   dL/dp_k     = integral P f_k / T_k g_k + P (F_k - 1) / T_k (G - g_k r_k) dt
//
// with the same nodes t for every slot: one pass over the slots for the image, two for the gradients. Flops a
// slot and node (an exponential counts 15, a division 1): the terms below cost those of prior_cdf_density
// (Gaussian 41, logistic 20, Gumbel 33, Cauchy 27, uniform 3) and 6 (barrier 3); the forward pass adds 8, the
// backward pass 16 (barrier 10).
#ifndef DPR_INTEGRATE_H
#define DPR_INTEGRATE_H

#include "lanes.h"
#include "pixel.h"
#include "planes.h"
#include "priors.h"
#include "quadrature.h"

static inline float3 slot_color(const Slot s, const Fragments f, float3 background) {
  return s.fragment == DPR_BACKGROUND_SLOT ? background : fragment_color(f, s.fragment);
}

/// Sums of the slots' gradients: float[fragment], and the background's.
typedef struct {
  global float* weight;     // w_k, or w_k / p_k in the joint composition
  global float* beta;       // dL/dbeta_k
  global float* occupancy;  // dL/dp_k, joint
  float background_weight, background_beta;
} SlotGradients;

/// Sums of the derivatives of a pixel's colour, RGB each, by its slots: float[fragment] and float[3][fragment],
/// and the background's.
typedef struct {
  global float* weight;     // w_k, or w_k / p_k in the joint composition
  global float* beta;       // d colour / d beta_k
  global float* occupancy;  // d colour / d p_k, joint
  uint plane;               // from one to the next
  float background_weight;
  float3 background_beta;
} SlotRows;

#ifndef DPR_JOINT

/// Adds to a slot's weight and to the derivative of the colour by its beta.
static inline void add_row(uint fragment, float weight, float3 by_beta, SlotRows* out) {
  if (fragment == DPR_BACKGROUND_SLOT) {
    out->background_weight += weight;
    out->background_beta += by_beta;
  } else {
    out->weight[fragment] += weight;
    add_to_planes(by_beta, fragment, out->plane, out->beta);
  }
}

#endif

#if defined(DPR_JOINT) || !defined(DPR_SOFTMAX)

/// So many slots' terms are kept from the backward pass' first round to its second, those beyond are computed
/// again.
#ifndef DPR_KEPT_SLOTS
#if DPR_LANES == 1
#define DPR_KEPT_SLOTS 0 /* a GPU's registers have no index: an array is memory, slower than the terms */
#else
#define DPR_KEPT_SLOTS 24
#endif
#endif

/// The smallest T divided by: a product of a few of them is still a number, and 1 / T finite.
#define DPR_MIN_PASSING 1e-30f

/// A slot's terms at a block of nodes: T, f / T, and (F - 1) / T in the joint composition.
typedef struct {
  realn passing, density;
#ifdef DPR_JOINT
  realn absent;
#endif
} Terms;

static inline Terms slot_terms(const Slot s, realn t) {
  Terms terms;
  realn cdf, density;
  prior_cdf_density(t - s.beta, &cdf, &density);
#ifdef DPR_JOINT
  terms.passing = mad(cdf, s.occupancy, (realn)(slot_transparency(s)));
  const realn inverse = 1.0f / terms.passing;
  terms.density = density * inverse;
  terms.absent = (cdf - 1.0f) * inverse;
#else
  terms.passing = max(cdf, DPR_MIN_PASSING);
  terms.density = density / terms.passing;
#endif
  return terms;
}

/// r_k
static inline realn slot_ratio(const Slot s, const Terms terms) {
#ifdef DPR_JOINT
  return s.occupancy * terms.density;
#else
  (void)s;
  return terms.density;
#endif
}

/// Sum of the weights times (colour, 1).
static inline float4 integrate_colors(const Slots run, const Fragments f, float3 background) {
  realn red = 0.0f, green = 0.0f, blue = 0.0f, mass = 0.0f;
  Stretch stretch = first_stretch(run);
  do {
    // Many stretches of few lanes would be a long sum of small numbers: each has one of its own.
    realn stretch_red = 0.0f, stretch_green = 0.0f, stretch_blue = 0.0f, stretch_mass = 0.0f;
    for (uint block = 0; block < stretch.blocks; ++block) {
      realn t, product, r = 0.0f, g = 0.0f, b = 0.0f, sum = 0.0f;
      stretch_nodes(stretch, block, &t, &product);
      for (uint i = 0; i < run.count; ++i) {
        const Slot s = run.slot[i];
        const Terms terms = slot_terms(s, t);
        const realn ratio = slot_ratio(s, terms);
        const float3 color = slot_color(s, f, background);
        product *= terms.passing;
        r = mad(ratio, color.x, r);
        g = mad(ratio, color.y, g);
        b = mad(ratio, color.z, b);
        sum += ratio;
      }
      stretch_red = mad(product, r, stretch_red);
      stretch_green = mad(product, g, stretch_green);
      stretch_blue = mad(product, b, stretch_blue);
      stretch_mass = mad(product, sum, stretch_mass);
    }
    red += stretch_red;
    green += stretch_green;
    blue += stretch_blue;
    mass += stretch_mass;
  } while (next_stretch(run, &stretch));
  return sum_lanes_of_4(red, green, blue, mass);
}

#ifndef DPR_JOINT

/// Adds to a slot's weight and to its gradient by beta.
static inline void add_gradient(uint fragment, float weight, float by_beta, SlotGradients* out) {
  if (fragment == DPR_BACKGROUND_SLOT) {
    out->background_weight += weight;
    out->background_beta += by_beta;
  } else {
    out->weight[fragment] += weight;
    out->beta[fragment] += by_beta;
  }
}

#endif

/// Adds a block's share of the integrals to a slot's gradients. `product` is P times the nodes' weights.
static inline void add_gradients(const Slot s, const Terms terms, realn product, realn ratio_sum,
                                 realn grad_sum, SlotGradients* out) {
  const realn share = product * terms.density;
  const realn ratio = slot_ratio(s, terms);
  const realn by_beta = product * ratio * mad(s.grad, ratio_sum, -grad_sum);
#ifdef DPR_JOINT
  const realn by_occupancy = mad(s.grad, share, product * terms.absent * mad(-s.grad, ratio, grad_sum));
  const float4 sums = sum_lanes_of_4(share, by_beta, by_occupancy, (realn)(0.0f));
  out->occupancy[s.fragment] += sums.z;
  out->weight[s.fragment] += sums.x;
  out->beta[s.fragment] += sums.y;
#else
  const float4 sums = sum_lanes_of_4(share, by_beta, (realn)(0.0f), (realn)(0.0f));
  add_gradient(s.fragment, sums.x, sums.y, out);
#endif
}

/// Adds the integrals to the gradients of the slots, whose `grad` holds g. Returns the sums of w and of w g.
static inline float2 integrate_gradients(const Slots run, SlotGradients* out) {
  realn mass = 0.0f, seen = 0.0f;
  Stretch stretch = first_stretch(run);
  do {
    for (uint block = 0; block < stretch.blocks; ++block) {
      realn t, product, ratio_sum = 0.0f, grad_sum = 0.0f;
      Terms kept[DPR_KEPT_SLOTS + 1];
      stretch_nodes(stretch, block, &t, &product);
      for (uint i = 0; i < run.count; ++i) {
        const Slot s = run.slot[i];
        const Terms terms = slot_terms(s, t);
        if (i < DPR_KEPT_SLOTS) kept[i] = terms;
        const realn ratio = slot_ratio(s, terms);
        product *= terms.passing;
        ratio_sum += ratio;
        grad_sum = mad(ratio, s.grad, grad_sum);
      }
      mass += product * ratio_sum;
      seen += product * grad_sum;
      for (uint i = 0; i < run.count; ++i) {
        const Slot s = run.slot[i];
        add_gradients(s, i < DPR_KEPT_SLOTS ? kept[i] : slot_terms(s, t), product, ratio_sum, grad_sum, out);
      }
    }
  } while (next_stretch(run, &stretch));
  return (float2)(sum_lanes(mass), sum_lanes(seen));
}

/// Adds a block's share of the integrals to the rows of a slot of that colour: the gradients of each of the
/// colour's channels.
static inline void add_rows(const Slot s, const Terms terms, realn product, realn ratio_sum, float3 color,
                            realn red, realn green, realn blue, SlotRows* out) {
  const realn share = product * terms.density, ratio = slot_ratio(s, terms), by_ratio = product * ratio;
  const float4 sums =
      sum_lanes_of_4(share, by_ratio * (color.x * ratio_sum - red), by_ratio * (color.y * ratio_sum - green),
                     by_ratio * (color.z * ratio_sum - blue));
#ifdef DPR_JOINT
  const realn absent = product * terms.absent;
  const float4 by_occupancy =
      sum_lanes_of_4(color.x * share + absent * (red - color.x * ratio),
                     color.y * share + absent * (green - color.y * ratio),
                     color.z * share + absent * (blue - color.z * ratio), (realn)(0.0f));
  out->weight[s.fragment] += sums.x;
  add_to_planes(sums.yzw, s.fragment, out->plane, out->beta);
  add_to_planes(by_occupancy.xyz, s.fragment, out->plane, out->occupancy);
#else
  add_row(s.fragment, sums.x, sums.yzw, out);
#endif
}

/// Adds the integrals to the slots' rows. Colours count from `origin`, which is the background's. Returns the
/// sum of w times (colour, 1).
static inline float4 integrate_rows(const Slots run, const Fragments f, float3 origin, SlotRows* out) {
  realn seen_red = 0.0f, seen_green = 0.0f, seen_blue = 0.0f, mass = 0.0f;
  Stretch stretch = first_stretch(run);
  do {
    for (uint block = 0; block < stretch.blocks; ++block) {
      realn t, product, ratio_sum = 0.0f, red = 0.0f, green = 0.0f, blue = 0.0f;
      Terms kept[DPR_KEPT_SLOTS + 1];
      stretch_nodes(stretch, block, &t, &product);
      for (uint i = 0; i < run.count; ++i) {
        const Slot s = run.slot[i];
        const Terms terms = slot_terms(s, t);
        if (i < DPR_KEPT_SLOTS) kept[i] = terms;
        const realn ratio = slot_ratio(s, terms);
        const float3 color = slot_color(s, f, origin) - origin;
        product *= terms.passing;
        ratio_sum += ratio;
        red = mad(ratio, color.x, red);
        green = mad(ratio, color.y, green);
        blue = mad(ratio, color.z, blue);
      }
      seen_red = mad(product, red, seen_red);
      seen_green = mad(product, green, seen_green);
      seen_blue = mad(product, blue, seen_blue);
      mass = mad(product, ratio_sum, mass);
      for (uint i = 0; i < run.count; ++i) {
        const Slot s = run.slot[i];
        add_rows(s, i < DPR_KEPT_SLOTS ? kept[i] : slot_terms(s, t), product, ratio_sum,
                 slot_color(s, f, origin) - origin, red, green, blue, out);
      }
    }
  } while (next_stretch(run, &stretch));
  return sum_lanes_of_4(seen_red, seen_green, seen_blue, mass);
}

#endif

#endif
