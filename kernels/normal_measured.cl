// What hypotheses about an object's pose leave of measured images beside colours: of its coverage, a silhouette, and of
// depths. normal_equations.cl adds both to what colours say; sums are as there.
//
// A pixel of coverage a and depth d, the mean over what is seen there, has the residuals
//
//   a - s   against a silhouette s,   a (d - z)   against a measured depth z,
//
// the latter without any division, and 0 where the object is not seen. The loss of either is that of loss_robust.h
// times a weight; residuals and their derivatives are kept times the roots of the weights w of the squares that have
// its derivative, so that products need no other.
//
// in   pixels, views, slots  as in normal_equations.cl
// in   fit       weight of squared coverages, 1 / scale^2 of their robust loss, 0: squares; the same of depths
// in   colors    float4[view][pixel]  alpha is the coverage a
// in   depths    float4[view][pixel]  red is a d, alpha a; like colours where no depths are compared
// in   target    float4[pixel]        s, how much it counts; z, how much it counts
//      measured  float[view][4][pixel]             residuals of coverage and depth; roots of their weights
//      moved     float[direction][view][2][pixel]  their derivatives
// out  sums      float[sum][view][slot]
#include "normal_sums.h"

/// Residuals, the roots of their weights, and losses. One part.
kernel void normal_measured_loss(const uint pixels, const uint views, const uint slots, const float4 fit,
                                 global const float4* restrict colors, global const float4* restrict depths,
                                 global const float4* restrict target, global float* restrict measured,
                                 global float* restrict sums) {
  const Slots s = make_slots(pixels, views, slots);
  if (s.part >= 1) return;
  const size_t view = s.view;
  realn loss = 0.0f;
  for (uint i = s.first; i < s.last; i += s.step) {
    const PixelsN wanted = load_pixels(i, s.last, target),
                  seen = load_pixels(i, s.last, depths + view * pixels);
    const realn coverage = load_pixels(i, s.last, colors + view * pixels).alpha - wanted.color.x;
    const realn depth = seen.color.x - seen.alpha * wanted.color.z;
    const realn slope = 1.0f / mad(square(coverage), (realn)(fit.y), (realn)(1.0f));
    const realn depth_slope = 1.0f / mad(square(depth), (realn)(fit.w), (realn)(1.0f));
    const intn in_run = lanes_before(s.last, i), has_depth = in_run & (seen.alpha > 0.0f);
    const realn weight = choose(in_run, fit.x * wanted.color.y, (realn)(0.0f));
    const realn depth_weight = choose(has_depth, fit.z * wanted.alpha, (realn)(0.0f));
    loss += weight * slope * square(coverage) + depth_weight * depth_slope * square(depth);
    const realn root = sqrt(weight) * slope, depth_root = sqrt(depth_weight) * depth_slope;
    global float* planes = measured + 4 * view * pixels;
    store_run(root * coverage, i, s.last, planes);
    store_run(depth_root * depth, i, s.last, planes + pixels);
    store_run(root, i, s.last, planes + 2 * (size_t)pixels);
    store_run(depth_root, i, s.last, planes + 3 * (size_t)pixels);
  }
  store_sum(loss, 0, s, views, slots, sums);
}

/// A coverage that differs from a silhouette by no more tells nothing of how far silhouettes may be trusted: such are
/// most pixels, wherever the object is.
#define DPR_LEAST_COVERAGE 0.01f

/// Number of residuals whose size is below thresholds, of squares: of coverages that differ, then of depths where the
/// object shows. One part.
/// in   thresholds  float[view][2][DPR_THRESHOLDS]
kernel void normal_measured_counts(const uint pixels, const uint views, const uint slots,
                                   global const float* restrict thresholds,
                                   global const float* restrict measured, global float* restrict sums) {
  const Slots s = make_slots(pixels, views, slots);
  if (s.part >= 1) return;
  for (uint kind = 0; kind < DPR_MEASURED_KINDS; ++kind) {
    global const float* of_kind = thresholds + (DPR_MEASURED_KINDS * s.view + kind) * DPR_THRESHOLDS;
    global const float* planes = measured + (4 * (size_t)s.view + kind) * pixels;
    realn sum[DPR_THRESHOLDS];
    DPR_UNROLL_ON_GPU
    for (uint k = 0; k < DPR_THRESHOLDS; ++k) sum[k] = 0.0f;
    for (uint i = s.first; i < s.last; i += s.step) {
      const intn in_run = lanes_before(s.last, i);
      const realn size = fabs(load_run(in_run, i, planes));
      const realn root = load_run(in_run, i, planes + 2 * (size_t)pixels);
      const realn least = kind == 0 ? DPR_LEAST_COVERAGE * root : (realn)(0.0f);
      const intn counts = (root > 0.0f) & (size >= least);
      if (!any_lane(counts)) continue;
      DPR_UNROLL_ON_GPU
      for (uint k = 0; k < DPR_THRESHOLDS; ++k)
        sum[k] += choose(counts & (size < of_kind[k] * root), (realn)(1.0f), (realn)(0.0f));
    }
    DPR_UNROLL_ON_GPU
    for (uint k = 0; k < DPR_THRESHOLDS; ++k)
      store_sum(sum[k], kind * DPR_THRESHOLDS + k, s, views, slots, sums);
  }
}

/// Derivatives of the residuals. One work-item per vector of pixels, view and direction.
/// in   tangents, depth_tangents  float4[direction][view][pixel]  of colors and depths
/// out  moved
kernel void normal_measured_moved(const uint pixels, const uint views, global const float4* restrict target,
                                  global const float* restrict measured,
                                  global const float4* restrict tangents,
                                  global const float4* restrict depth_tangents,
                                  global float* restrict moved) {
  const Moved m = make_moved(pixels, views);
  if (m.image >= DPR_DIRECTIONS * views) return;
  const intn in_run = lanes_before(pixels, m.first);
  global const float* roots = measured + (4 * (size_t)m.view + 2) * pixels;
  const PixelsN by = load_pixels(m.first, pixels, depth_tangents + m.image * pixels);
  const realn z = load_pixels(m.first, pixels, target).color.z;
  const realn coverage = load_pixels(m.first, pixels, tangents + m.image * pixels).alpha;
  global float* planes = moved + DPR_MEASURED_KINDS * m.image * pixels;
  store_run(load_run(in_run, m.first, roots) * coverage, m.first, pixels, planes);
  store_run(load_run(in_run, m.first, roots + pixels) * (by.color.x - by.alpha * z), m.first, pixels,
            planes + pixels);
}
