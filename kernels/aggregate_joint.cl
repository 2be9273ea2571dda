// The joint composition, exactly: the expected rigid image when distances and depths are both perturbed, by
// the integrals of integrate.h with beta = zeta / gamma. What no fragment covers is the background: w_0 =
// prod (1 - p_k), and dL/dp_k has a further - g_0 prod_{l != k} (1 - p_l).
//
// A pixel's fragments, sorted by depth, fall into clusters: runs whose neighbours' noise overlaps. Between
// clusters the integral is the front-to-back product, so each cluster is integrated alone, weighed by what is
// in front of it; and for its gradients everything behind it is one background whose g_0 is what would be
// seen there. Fragments alone need no integral. Reached when the transparency in front falls below
// DPR_OPAQUE, the rest is left out: an error of at most that in the weights. Errors:
// tests/stages/aggregate_joint_test.cpp.
#ifndef DPR_LANES
#define DPR_LANES 8
#endif
#if DPR_LANES == 1
#define DPR_WIDTH 4 /* nodes of a work-item, which adds to its slots' sums in memory once for them */
#else
#define DPR_WIDTH 16 /* lanes are quadrature nodes */
#endif
#define DPR_JOINT
#include "integrate.h"
#include "sorted_slots.h"

#define DPR_OPAQUE 1e-12f

/// A run of a pixel's slots whose noise overlaps.
typedef struct {
  Slots run;
  float transparency;  // prod (1 - p)
  float coverage;      // 1 - that, added up so that coverages far below 1 keep their digits
} Cluster;

/// The cluster that begins with the first of `count` slots that hold view depths, which become betas relative
/// to the first's. It ends where the noise of two neighbours in depth does not overlap: the nearer one is
/// always in front.
static inline Cluster first_cluster(global Slot* slots, uint count, float depth_scale) {
  Cluster c = {{slots, 0, 0.0f}, 1.0f, 0.0f};
  const float nearest = slots[0].beta;
  float last = nearest;
  for (uint i = 0; i < count; ++i) {
    const float depth = slots[i].beta, p = slots[i].occupancy;
    if ((depth - last) * depth_scale >= DPR_JOINT_BELOW + DPR_JOINT_ABOVE) break;
    last = depth;
    slots[i].beta = (nearest - depth) * depth_scale;
    c.run.count = i + 1;
    c.run.covering += p;
    c.coverage += (1.0f - c.coverage) * p;
    c.transparency *= slot_transparency(slots[i]);
  }
  return c;
}

/// The colour a cluster adds if nothing is in front of it.
static inline float3 cluster_color(const Cluster c, const Fragments f) {
  const Slot only = c.run.slot[0];
  if (c.run.count == 1) return only.occupancy * fragment_color(f, only.fragment);
  const float4 sum = integrate_colors(c.run, f, (float3)(0.0f));
  // The weights sum to the cluster's coverage: dividing by their own sum gives back what the nodes left out.
  return sum.w > 0.0f ? sum.xyz * (c.coverage / sum.w) : sum.xyz;
}

/// One work-item per pixel. Deterministic. Arguments as aggregate_forward, but there are as many slots as the
/// lists are long: a pixel's begin at starts[pixel], sorted by depth, and those are left that anything is
/// seen of. A fragment alone has no slot.
kernel void aggregate_joint_forward(const AggregateParams p, global const ViewParams* restrict views,
                                    global const uint* restrict starts, global const uint* restrict list,
                                    global const float* restrict fragments, global Slot* restrict slots,
                                    global uint* restrict slot_counts, global float4* restrict image) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= p.last_pixel) return;
  if (starts[pixel] == starts[pixel + 1]) {
    slot_counts[pixel] = 0;
    image[pixel] = (float4)(p.background.xyz, 0.0f);
    return;
  }
  const Fragments f = make_fragments(p, list, fragments);
  if (starts[pixel] + 1 == starts[pixel + 1]) {  // most pixels of a sharp image: no cluster to look for
    const uint k = list[starts[pixel]];
    const float transparency = fragment_transparency(f, k);
    slot_counts[pixel] = f.occupancy[k] > 0.0f ? 1 : 0;
    image[pixel] = (float4)(f.occupancy[k] * fragment_color(f, k) + transparency * p.background.xyz,
                            1.0f - transparency);
    return;
  }
  const float depth_scale = views[(pixel + p.first_pixel) / p.pixels_per_view].inverse_range / p.gamma;
  global Slot* pixel_slots = slots + starts[pixel];
  const uint count = gather_slots(f, starts[pixel], starts[pixel + 1], pixel_slots);
  float transparency = 1.0f;
  float3 color = 0.0f;
  uint seen = 0;
  while (seen < count && transparency > DPR_OPAQUE) {
    const Cluster c = first_cluster(pixel_slots + seen, count - seen, depth_scale);
    pixel_slots[seen].grad = transparency;
    color += transparency * cluster_color(c, f);
    transparency *= c.transparency;
    seen += c.run.count;
  }
  slot_counts[pixel] = seen;
  image[pixel] = (float4)(color + transparency * p.background.xyz, 1.0f - transparency);
}

/// The cluster whose last slot is before `end`; `in_front` is set to the transparency in front of it.
static inline Slots cluster_before(global Slot* slots, uint end, float* in_front) {
  uint first = end - 1;
  while (first > 0 && slots[first].grad < 0.0f) --first;
  *in_front = slots[first].grad;
  Slots run = {slots + first, end - first, 0.0f};
  return run;
}

/// Gradients within a cluster that nothing hides, with `behind` the g of what lies behind it. Adds up, per
/// fragment: w_k / p_k, dL/dbeta_k, dL/dp_k. Returns what is seen of the cluster and behind.
static inline float cluster_gradients(Slots run, const Fragments f, float3 grad, float behind,
                                      SlotGradients* out) {
  float transparency = 1.0f;
  for (uint i = 0; i < run.count; ++i) transparency *= slot_transparency(run.slot[i]);
  for (uint i = 0; i < run.count; ++i) {
    const Slot s = run.slot[i];
    run.slot[i].grad = dot(grad, fragment_color(f, s.fragment));
    run.covering += s.occupancy;
    out->occupancy[s.fragment] = -behind * transparency / slot_transparency(s);
  }
  if (run.count == 1) {
    const Slot s = run.slot[0];
    out->weight[s.fragment] = 1.0f;
    out->occupancy[s.fragment] += s.grad;
    return s.occupancy * s.grad + transparency * behind;
  }
  return transparency * behind + integrate_gradients(run, out).y;
}

/// One work-item per pixel; every fragment belongs to one pixel, so no two write the same place.
/// Deterministic. Arguments as aggregate_backward, with the slots that aggregate_joint_forward left.
kernel void aggregate_joint_backward(const AggregateParams p, global const ViewParams* restrict views,
                                     global const uint* restrict starts, global const uint* restrict list,
                                     global const float* restrict fragments, global Slot* restrict slots,
                                     global const uint* restrict slot_counts,
                                     global const float4* restrict grad_image, global float* restrict grads,
                                     global float* restrict channels) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= p.last_pixel) return;
  const float4 grad = grad_image[pixel];
  if (starts[pixel] == starts[pixel + 1]) {
    write_channels(p, pixel, 0.0f, 0.0f, 1.0f, grad, channels);
    return;
  }
  const Fragments f = make_fragments(p, list, fragments);
  const FragmentGradients g = make_gradients(p, grads);
  if (starts[pixel] + 1 == starts[pixel + 1]) {  // most pixels of a sharp image: no cluster to look for
    const uint k = list[starts[pixel]];
    const float weight = f.occupancy[k], jump = dot(grad.xyz, fragment_color(f, k) - p.background.xyz);
    g.depth[k] = 0.0f;
    g.log_occupancy[k] = weight * (jump + grad.w);
    store_color(g, k, weight, grad);
    write_channels(p, pixel, 0.0f, 0.0f, fragment_transparency(f, k), grad, channels);
    return;
  }
  const float depth_scale = views[(pixel + p.first_pixel) / p.pixels_per_view].inverse_range / p.gamma;
  global Slot* pixel_slots = slots + starts[pixel];
  const uint seen = slot_counts[pixel];
  for (uint i = starts[pixel]; i < starts[pixel + 1]; ++i) {
    const uint k = list[i];
    g.depth[k] = g.log_occupancy[k] = g.red[k] = g.green[k] = g.blue[k] = 0.0f;
  }
  float transparency = 1.0f;
  for (uint i = 0; i < seen; ++i) transparency *= slot_transparency(pixel_slots[i]);

  // Back to front: what lies behind each cluster, as one background.
  float grad_gamma = 0.0f;
  float behind = dot(grad.xyz, p.background.xyz);
  SlotGradients sums = {g.red, g.depth, g.log_occupancy, 0.0f, 0.0f};
  for (uint last = seen; last > 0;) {
    float in_front;
    const Slots run = cluster_before(pixel_slots, last, &in_front);
    behind = cluster_gradients(run, f, grad.xyz, behind, &sums);
    for (uint i = 0; i < run.count; ++i) {
      const Slot s = run.slot[i];
      const uint k = s.fragment;
      const float weight = g.red[k] * s.occupancy * in_front, grad_beta = g.depth[k] * in_front;
      // d beta / d gamma = -beta / gamma; shifting a whole cluster changes nothing, so betas count from its
      // first.
      grad_gamma -= grad_beta * s.beta / p.gamma;
      g.depth[k] = -grad_beta * depth_scale;
      g.log_occupancy[k] *= s.occupancy * in_front;
      g.log_occupancy[k] += grad.w * s.occupancy * transparency / slot_transparency(s);
      store_color(g, k, weight, grad);
      run.slot[i].grad = i == 0 ? in_front : -1.0f;  // as it was: the next backward pass reads it again
    }
    last -= run.count;
  }
  write_channels(p, pixel, grad_gamma, 0.0f, transparency, grad, channels);
}

/// The rows of a cluster that nothing hides, with `behind` the colour seen behind it. Returns what is seen of
/// the cluster and behind.
static inline float3 cluster_rows(Slots run, const Fragments f, float3 behind, SlotRows* out) {
  float transparency = 1.0f;
  for (uint i = 0; i < run.count; ++i) transparency *= slot_transparency(run.slot[i]);
  for (uint i = 0; i < run.count; ++i) {
    const Slot s = run.slot[i];
    run.covering += s.occupancy;
    store_planes(-behind * (transparency / slot_transparency(s)), s.fragment, out->plane, out->occupancy);
  }
  if (run.count == 1) {
    const Slot s = run.slot[0];
    const float3 color = fragment_color(f, s.fragment);
    out->weight[s.fragment] = 1.0f;
    add_to_planes(color, s.fragment, out->plane, out->occupancy);
    return s.occupancy * color + transparency * behind;
  }
  return transparency * behind + integrate_rows(run, f, (float3)(0.0f), out).xyz;
}

/// The first half of forward mode, as aggregate_rows, for the joint composition: `slots` and `slot_counts` as
/// aggregate_joint_backward has them.
kernel void aggregate_joint_rows(const AggregateParams p, const TangentParams q,
                                 global const ViewParams* restrict views, global const uint* restrict starts,
                                 global const uint* restrict list, global const float* restrict fragments,
                                 global Slot* restrict slots, global const uint* restrict slot_counts,
                                 global const FrameTangent* restrict frames, global float* restrict rows,
                                 global float4* restrict image_tangents) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= p.last_pixel) return;
  const uint first = starts[pixel], last = starts[pixel + 1], plane = p.grad_fragments;
  const Fragments f = make_fragments(p, list, fragments);
  global float *const by_depth = rows + DPR_ROW_DEPTH * plane,
                      *const by_log = rows + DPR_ROW_LOG_OCCUPANCY * plane;
  if (last - first < 2) {
    float transparency = 1.0f;
    if (first < last) {
      const uint k = list[first];
      transparency = fragment_transparency(f, k);
      clear_rows(k, plane, f.occupancy[k], rows);
      rows[k] = f.occupancy[k];
      store_planes(f.occupancy[k] * (fragment_color(f, k) - p.background.xyz), k, plane, by_log);
    }
    store_frame_tangents(p, q, pixel, transparency, 0.0f, 0.0f, frames, image_tangents);
    return;
  }
  const float inverse_range = views[(pixel + p.first_pixel) / p.pixels_per_view].inverse_range;
  const float depth_scale = inverse_range / p.gamma;
  global Slot* pixel_slots = slots + first;
  const uint seen = slot_counts[pixel];
  float transparency = 1.0f;
  for (uint i = 0; i < seen; ++i) transparency *= slot_transparency(pixel_slots[i]);
  for (uint i = first; i < last; ++i) clear_rows(list[i], plane, 0.0f, rows);
  SlotRows out = {rows, by_depth, by_log, plane, 0.0f, 0.0f};
  // Back to front, as the backward pass.
  float3 behind = p.background.xyz, by_gamma = 0.0f;
  for (uint end = seen; end > 0;) {
    float in_front;
    const Slots run = cluster_before(pixel_slots, end, &in_front);
    behind = cluster_rows(run, f, behind, &out);
    for (uint i = 0; i < run.count; ++i) {
      const Slot s = run.slot[i];
      const uint k = s.fragment;
      const float weight = s.occupancy * in_front;
      const float3 by_beta = in_front * load_planes(k, plane, by_depth);
      by_gamma -= s.beta * by_beta;  // d beta / d gamma = -beta / gamma
      rows[k] *= weight;
      store_planes(-depth_scale * by_beta, k, plane, by_depth);
      store_planes(weight * load_planes(k, plane, by_log), k, plane, by_log);
      rows[k + DPR_ROW_COVERAGE * plane] = s.occupancy * transparency / slot_transparency(s);
    }
    end -= run.count;
  }
  store_frame_tangents(p, q, pixel, transparency, by_gamma / p.gamma, 0.0f, frames, image_tangents);
}
