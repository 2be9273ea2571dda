// The joint composition, exactly: the expected rigid image when distances and depths are both perturbed. With
// beta = zeta / gamma, T_k(t) = 1 - p_k + p_k F(t - beta_k), P = prod T_k, r_k = p_k f(t - beta_k) / T_k:
//
//   w_j         = integral P r_j dt,  w_0 = prod (1 - p_k)
//   dL/dbeta_k  = integral P r_k (g_k R - G) dt,  R = sum r_j,  G = sum g_j r_j,  g_k = <dL/dcolour, C_k>
//   dL/dp_k     = g_k w_k / p_k + integral (P / T_k) (F_k - 1) (G - g_k r_k) dt - g_0 prod_{l != k} (1 - p_l)
//
// A pixel's fragments, sorted by depth, fall into clusters: runs whose neighbours' noise overlaps. Between clusters the
// integral is the front-to-back product, so each cluster is integrated alone, weighed by what is in front of it; and
// for its gradients everything behind it is one background whose g_0 is what would be seen there. Fragments alone need
// no integral. Reached when the transparency in front falls below DPR_OPAQUE, the rest is left out: an error of at most
// that in the weights. Errors: tests/stages/aggregate_joint_test.cpp.
#ifndef DPR_NODE_LANES
#define DPR_NODE_LANES 16
#endif
#define DPR_WIDTH DPR_NODE_LANES /* lanes are quadrature nodes */
#include "pixel.h"
#include "priors.h"
#include "quadrature.h"

#define DPR_OPAQUE 1e-9f

/// The backward pass skips fragments whose occupancy is below this: an error of at most that in the weights. The
/// forward pass keeps them, since an L1 loss asks for the sign of the smallest difference.
#define DPR_NEGLIGIBLE 1e-8f

/// Runs up to this length are sorted by insertion.
#define DPR_INSERTION_SORT 24

static inline int comes_before(float depth_a, uint a, float depth_b, uint b) {
  return depth_a < depth_b || (depth_a == depth_b && a < b);
}

static inline void sift_down(global uint* run, global const float* depth, uint root, uint count) {
  const uint moved = run[root];
  for (uint child; (child = 2 * root + 1) < count; root = child) {
    if (child + 1 < count && comes_before(depth[run[child]], run[child], depth[run[child + 1]], run[child + 1])) ++child;
    if (!comes_before(depth[moved], moved, depth[run[child]], run[child])) break;
    run[root] = run[child];
  }
  run[root] = moved;
}

/// Sorts every pixel's fragments by depth, equal depths by number. Insertion for short runs, heap sort for long ones.
/// One work-item per pixel.
/// in out  list  uint[...]
kernel void aggregate_joint_sort(const uint pixels, global const uint* restrict starts,
                                 global const float* restrict depth, global uint* restrict list) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= pixels) return;
  global uint* run = list + starts[pixel];
  const uint count = starts[pixel + 1] - starts[pixel];
  if (count <= DPR_INSERTION_SORT) {
    for (uint i = 1; i < count; ++i) {
      const uint moved = run[i];
      uint k = i;
      for (; k > 0 && comes_before(depth[moved], moved, depth[run[k - 1]], run[k - 1]); --k) run[k] = run[k - 1];
      run[k] = moved;
    }
    return;
  }
  for (uint root = count / 2; root-- > 0;) sift_down(run, depth, root, count);
  for (uint end = count - 1; end > 0; --end) {
    const uint furthest = run[0];
    run[0] = run[end];
    run[end] = furthest;
    sift_down(run, depth, 0, end);
  }
}

/// A run [first, last) of sorted fragments whose noise overlaps, and where its integral is evaluated.
typedef struct {
  uint first, last;
  float nearest;      // view depth of the first: betas are relative to its
  float depth_scale;  // d beta / d (nearest - depth)
  float top, step;    // t = top - step * node
  uint blocks;
} Cluster;

/// False if the noise of two neighbours in depth does not overlap: the nearer one is always in front.
static inline int overlaps(float nearer, float further, float depth_scale) {
  return (further - nearer) * depth_scale < DPR_JOINT_BELOW + DPR_JOINT_ABOVE;
}

/// As many blocks as the largest step allows; their nodes share the whole span evenly.
static inline void place_nodes(const Fragments f, Cluster* c) {
  c->nearest = f.depth[f.list[c->first]];
  const float extent = (f.depth[f.list[c->last - 1]] - c->nearest) * c->depth_scale;
  const float span = extent + DPR_JOINT_BELOW + DPR_JOINT_ABOVE;
  const float largest_step = c->last - c->first > DPR_CROWD ? DPR_JOINT_CROWD_STEP : DPR_JOINT_STEP;
  c->blocks = (uint)ceil(span / (largest_step * DPR_WIDTH));
  c->step = span / (float)(DPR_WIDTH * c->blocks);
  c->top = DPR_JOINT_ABOVE - 0.5f * c->step;
}

static inline Cluster cluster_from(const Fragments f, uint first, uint end, float depth_scale) {
  Cluster c;
  c.depth_scale = depth_scale;
  c.first = first;
  c.last = first + 1;
  while (c.last < end && overlaps(f.depth[f.list[c.last - 1]], f.depth[f.list[c.last]], depth_scale)) ++c.last;
  place_nodes(f, &c);
  return c;
}

/// The cluster that ends at `last`.
static inline Cluster cluster_before(const Fragments f, uint start, uint last, float depth_scale) {
  Cluster c;
  c.depth_scale = depth_scale;
  c.last = last;
  c.first = last - 1;
  while (c.first > start && overlaps(f.depth[f.list[c.first - 1]], f.depth[f.list[c.first]], depth_scale)) --c.first;
  place_nodes(f, &c);
  return c;
}

static inline realn block_nodes(const Cluster c, uint block) {
  return c.top - c.step * (convert_realn(DPR_LANE_INDEX) + (float)(DPR_WIDTH * block));
}

/// T_k and r_k at a block of nodes; F_k too.
static inline void slot_terms(const Cluster c, const Fragments f, uint k, realn t, realn* passing, realn* ratio,
                              realn* cdf) {
  const float beta = (c.nearest - f.depth[k]) * c.depth_scale;
  realn density_ratio;
  prior_cdf_ratio(t - beta, cdf, &density_ratio);
  const realn covering = f.occupancy[k] * *cdf;
  *passing = fragment_transparency(f, k) + covering;
  *ratio = covering * density_ratio / *passing;
}

/// The colour a cluster adds if nothing is in front of it.
static inline float3 cluster_color(const Cluster c, const Fragments f) {
  const uint only = f.list[c.first];
  if (c.last == c.first + 1) return f.occupancy[only] * fragment_color(f, only);
  float3 sum = 0.0f;
  float mass = 0.0f;
  for (uint block = 0; block < c.blocks; ++block) {
    const realn t = block_nodes(c, block);
    realn product = 1.0f, all = 0.0f, red = 0.0f, green = 0.0f, blue = 0.0f;
    for (uint i = c.first; i < c.last; ++i) {
      const uint k = f.list[i];
      realn passing, ratio, cdf;
      slot_terms(c, f, k, t, &passing, &ratio, &cdf);
      product *= passing;
      all += ratio;
      red += ratio * f.red[k];
      green += ratio * f.green[k];
      blue += ratio * f.blue[k];
    }
    mass += sum_lanes(product * all);
    sum += (float3)(sum_lanes(product * red), sum_lanes(product * green), sum_lanes(product * blue));
  }
  // The weights sum to the cluster's coverage: dividing by their own sum gives back what the nodes left out.
  return mass > 0.0f ? sum * (run_coverage(f, c.first, c.last) / mass) : sum;
}

/// One work-item per pixel. Deterministic. Buffers as in aggregate.cl; `list` is sorted by depth.
kernel void aggregate_joint_forward(const AggregateParams p, global const ViewParams* restrict views,
                                    global const uint* restrict starts, global const uint* restrict list,
                                    global const float* restrict depth, global const float* restrict log_occupancy,
                                    global const float* restrict occupancy, global const float* restrict red,
                                    global const float* restrict green, global const float* restrict blue,
                                    global float4* restrict image) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= p.pixels) return;
  const Fragments f = make_fragments(list, depth, log_occupancy, occupancy, red, green, blue);
  const float depth_scale = views[pixel / p.pixels_per_view].inverse_range / p.gamma;
  const uint end = starts[pixel + 1];
  float transparency = 1.0f;
  float3 color = 0.0f;
  for (uint first = starts[pixel]; first < end && transparency > DPR_OPAQUE;) {
    const Cluster c = cluster_from(f, first, end, depth_scale);
    color += transparency * cluster_color(c, f);
    transparency *= run_transparency(f, c.first, c.last);
    first = c.last;
  }
  image[pixel] = (float4)(color + transparency * p.background.xyz, 1.0f - transparency);
}

/// Gradients within a cluster that nothing hides, with `behind` the g of what lies behind it. Adds up, per fragment:
/// w_k / p_k in `share`, dL/dbeta_k in `grad_beta`, dL/dp_k in `grad_p`. Returns what is seen of the cluster and behind.
static inline float cluster_gradients(const Cluster c, const Fragments f, float3 grad, float behind,
                                      global float* share, global float* grad_beta, global float* grad_p) {
  const float transparency = run_transparency(f, c.first, c.last);
  for (uint i = c.first; i < c.last; ++i) {
    const uint k = f.list[i];
    share[k] = grad_beta[k] = 0.0f;
    grad_p[k] = -behind * transparency / fragment_transparency(f, k);
  }
  if (c.last == c.first + 1) {
    const uint k = f.list[c.first];
    const float g = dot(grad, fragment_color(f, k));
    share[k] = 1.0f;
    grad_p[k] += g;
    return f.occupancy[k] * g + transparency * behind;
  }
  float seen = transparency * behind;
  for (uint block = 0; block < c.blocks; ++block) {
    const realn t = block_nodes(c, block);
    realn product = c.step, ratio_sum = 0.0f, grad_sum = 0.0f, passing, ratio, cdf;
    for (uint i = c.first; i < c.last; ++i) {
      const uint k = f.list[i];
      if (f.occupancy[k] < DPR_NEGLIGIBLE) continue;
      slot_terms(c, f, k, t, &passing, &ratio, &cdf);
      product *= passing;
      ratio_sum += ratio;
      grad_sum += ratio * dot(grad, fragment_color(f, k));
    }
    seen += sum_lanes(product * grad_sum);
    for (uint i = c.first; i < c.last; ++i) {
      const uint k = f.list[i];
      if (f.occupancy[k] < DPR_NEGLIGIBLE) continue;
      const float g = dot(grad, fragment_color(f, k));
      slot_terms(c, f, k, t, &passing, &ratio, &cdf);
      const realn others = product / passing;
      // r_k / p_k without dividing by p: P r_k / p_k = (P / T_k) f_k.
      const realn density = product * ratio / f.occupancy[k];
      share[k] += sum_lanes(density);
      grad_beta[k] += sum_lanes(product * ratio * (g * ratio_sum - grad_sum));
      grad_p[k] += sum_lanes(g * density + others * (cdf - 1.0f) * (grad_sum - g * ratio));
    }
  }
  return seen;
}

/// One work-item per pixel; every fragment belongs to one pixel, so no two write the same place. Deterministic.
/// Buffers as in aggregate.cl; `list` is sorted by depth.
kernel void aggregate_joint_backward(const AggregateParams p, global const ViewParams* restrict views,
                                     global const uint* restrict starts, global const uint* restrict list,
                                     global const float* restrict depth, global const float* restrict log_occupancy,
                                     global const float* restrict occupancy, global const float* restrict red,
                                     global const float* restrict green, global const float* restrict blue,
                                     global const float4* restrict grad_image, global float* restrict grad_depth,
                                     global float* restrict grad_log_occupancy, global float* restrict grad_red,
                                     global float* restrict grad_green, global float* restrict grad_blue,
                                     global float* restrict channels) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= p.pixels) return;
  const Fragments f = make_fragments(list, depth, log_occupancy, occupancy, red, green, blue);
  const float4 grad = grad_image[pixel];
  const float depth_scale = views[pixel / p.pixels_per_view].inverse_range / p.gamma;
  const uint start = starts[pixel], end = starts[pixel + 1];

  // Front to back: the transparency in front of each cluster, kept at its first fragment's place until it is used.
  float transparency = 1.0f;
  uint visible_end = start;
  while (visible_end < end && transparency > DPR_OPAQUE) {
    const Cluster c = cluster_from(f, visible_end, end, depth_scale);
    grad_log_occupancy[list[c.first]] = transparency;
    transparency *= run_transparency(f, c.first, c.last);
    visible_end = c.last;
  }
  for (uint i = visible_end; i < end; ++i) {
    const uint k = list[i];
    grad_depth[k] = grad_log_occupancy[k] = grad_red[k] = grad_green[k] = grad_blue[k] = 0.0f;
  }

  // Back to front: what lies behind each cluster, as one background.
  float grad_gamma = 0.0f;
  float behind = dot(grad.xyz, p.background.xyz);
  for (uint last = visible_end; last > start;) {
    const Cluster c = cluster_before(f, start, last, depth_scale);
    const float in_front = grad_log_occupancy[list[c.first]];
    behind = cluster_gradients(c, f, grad.xyz, behind, grad_red, grad_depth, grad_log_occupancy);
    for (uint i = c.first; i < c.last; ++i) {
      const uint k = list[i];
      const float weight = grad_red[k] * occupancy[k] * in_front, grad_beta = grad_depth[k] * in_front;
      // d beta / d gamma = -beta / gamma; shifting a whole cluster changes nothing, so betas count from its first.
      grad_gamma -= grad_beta * (c.nearest - depth[k]) * depth_scale / p.gamma;
      grad_depth[k] = -grad_beta * depth_scale;
      grad_log_occupancy[k] *= occupancy[k] * in_front;
      grad_log_occupancy[k] += grad.w * alpha_sensitivity(f, k, transparency);
      grad_red[k] = weight * grad.x;
      grad_green[k] = weight * grad.y;
      grad_blue[k] = weight * grad.z;
    }
    last = c.first;
  }
  write_channels(p, pixel, grad_gamma, 0.0f, transparency, grad, channels);
}
