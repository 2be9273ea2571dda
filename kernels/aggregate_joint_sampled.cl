// The joint composition by Monte Carlo: every sample perturbs the distances and the depths of all of a
// pixel's fragments and renders them rigidly. A fragment covers if s / sigma + X > 0; of those that cover,
// the largest zeta / gamma + Z wins; where none does, the background is seen. The image is the mean of the
// samples, eq. (11).
//
// Gradients are score estimates with the baselines of noise.h, eq. (12)-(16), of y = <dL/dRGBA, RGBA of the
// sample>:
//
//   dL/ds_k     = 1/M sum_m (y_m - b_m) nu'(X_km) / sigma           samples where k wins if it covers
//   dL/dzeta_k  = 1/M sum_m (y_m - b_m) nu'(Z_km) / gamma           samples where k covers, and could win
//   dL/dsigma   = 1/M sum_m (y_m - b_m) sum_k (nu'(X_km) X_km - 1) / sigma, and gamma's with Z, over the same
//               samples
//
// y depends on X_k, given all the other noise, only where k would win, and on Z_k only where k covers: the
// rest has mean zero. A fragment so far inside or outside that no noise changes its sign draws no X.
#include "sampled_pixel.h"

#ifndef DPR_OCCUPANCY_PRIOR
#define DPR_OCCUPANCY_PRIOR gaussian
#endif
#ifndef DPR_DEPTH_PRIOR
#define DPR_DEPTH_PRIOR gaussian
#endif

/// Fragments by way of the pixels' lists, without occupancies; their distances, and whose noise they take.
typedef struct {
  Fragments fragments;
  global const float* distance;  // float[fragment]
  FaceOf face;
} Layers;

/// State shared by a pixel's fragments.
typedef struct {
  SampledRun run;
  float nearest;      // view depth of the nearest fragment
  float depth_scale;  // d beta / d (nearest - depth)
} Pixel;

static inline Layers make_layers(const AggregateParams p, global const uint* list,
                                 global const float* fragments, global const uint* fragment_pair,
                                 global const uint* pair_face) {
  Layers f;
  f.fragments = make_fragments(p, list, fragments);
  f.distance = fragments + DPR_PLANE(p, DISTANCE);
  f.face.fragment_pair = fragment_pair;
  f.face.pair_face = pair_face;
  return f;
}

static inline Pixel load_pixel(const AggregateParams p, uint pixel, global const ViewParams* restrict views,
                               global const uint* restrict starts, const Layers f) {
  Pixel q;
  q.run = locate_run(p, pixel, starts);
  q.depth_scale = views[q.run.view].inverse_range / p.gamma;
  q.nearest = INFINITY;
  float nearest_inside = INFINITY;
  for (int place = 0; place < run_length(q.run); ++place) {
    const uint k = fragment_at(q.run, f.fragments, place);
    const float depth = f.fragments.depth[k];
    q.nearest = depth < q.nearest ? depth : q.nearest;
    if (signbit(f.distance[k]) || depth >= nearest_inside) continue;
    nearest_inside = depth;
    q.run.rigid = place;
  }
  return q;
}

/// In units of the distances' noise; where sigma is 0 and they have none, all that is listed covers.
static inline float in_sigmas(const AggregateParams p, float value, float otherwise) {
  return p.sigma > 0.0f ? value / p.sigma : otherwise;
}

/// A fragment's two coordinates, in units of the noise, and its face.
typedef struct {
  float x, beta;
  uint face;
} Coordinates;

static inline Coordinates load_fragment(const AggregateParams p, const Pixel q, const Layers f, uint k) {
  Coordinates c;
  c.x = in_sigmas(p, f.distance[k], INFINITY);
  c.beta = (q.nearest - f.fragments.depth[k]) * q.depth_scale;
  c.face = face_of_fragment(p, q.run, f.face, k);
  return c;
}

static inline int never_covers(const Coordinates c) {
  return c.x + highest_noise(DPR_OCCUPANCY_PRIOR) <= 0.0f;
}
static inline int always_covers(const Coordinates c) {
  return c.x + lowest_noise(DPR_OCCUPANCY_PRIOR) > 0.0f;
}

DPR_ALWAYS_INLINE realn draw_distance(const AggregateParams p, const Pixel q, const Coordinates c,
                                      uint block) {
  const NoiseName name = name_of_noise(p, q.run, c.face, DPR_STAGE_OCCUPANCY);
  return draw_noise(p.sampling, DPR_OCCUPANCY_PRIOR, name, block);
}

DPR_ALWAYS_INLINE realn draw_depth(const AggregateParams p, const Pixel q, const Coordinates c, uint block) {
  const NoiseName name = name_of_noise(p, q.run, c.face, DPR_STAGE_AGGREGATE);
  return draw_noise(p.sampling, DPR_DEPTH_PRIOR, name, block);
}

/// Winner of each of a block's samples, at the beta `largest`: -INFINITY for the background.
typedef struct {
  intn winner;
  realn largest;
} Lead;

/// Samples that a fragment could win if it covers: its largest noise would not be too little.
static inline intn could_win(const Lead lead, const Coordinates c) {
  return c.beta + highest_noise(DPR_DEPTH_PRIOR) >= lead.largest;
}

/// Noise of a block's first fragments, kept for the backward pass: depths only where a sample covers.
typedef struct {
  realn distance[DPR_NOISE_CACHE], depth[DPR_NOISE_CACHE];
} NoiseCache;

/// A block's winners. The rigid one goes first: behind it most of the others need no noise.
static inline Lead find_winners(const AggregateParams p, const Pixel q, const Layers f, uint block,
                                NoiseCache* cache) {
  Lead lead;
  lead.winner = (intn)(-1);
  lead.largest = (realn)(-INFINITY);
  for (int turn = q.run.rigid < 0 ? 0 : -1; turn < run_length(q.run); ++turn) {
    if (turn == q.run.rigid) continue;
    const int place = turn < 0 ? q.run.rigid : turn;
    const Coordinates c = load_fragment(p, q, f, fragment_at(q.run, f.fragments, place));
    if (never_covers(c) || !any_lane(could_win(lead, c))) continue;
    intn covers = (intn)(-1);
    if (!always_covers(c)) {
      const realn x = draw_distance(p, q, c, block);
      if (is_kept(place)) cache->distance[place] = x;
      covers = c.x + x > 0.0f;
    }
    if (!any_lane(covers)) continue;
    const realn z = draw_depth(p, q, c, block);
    if (is_kept(place)) cache->depth[place] = z;
    const intn wins = covers && c.beta + z > lead.largest;
    lead.winner = select(lead.winner, (intn)(place), wins);
    lead.largest = choose(wins, c.beta + z, lead.largest);
  }
  return lead;
}

/// One work-item per pixel. Deterministic. Arguments as aggregate_forward, and
/// in   fragments      float[plane][fragment]  DEPTH, COLOR, DISTANCE
/// in   fragment_pair  uint[fragment],  pair_face  uint[pair]   name the noise of a fragment
/// out  image          float4[pixel]    means over the samples; alpha: the share in which any fragment covers
kernel void aggregate_joint_sampled_forward(const AggregateParams p, global const ViewParams* restrict views,
                                            global const uint* restrict starts,
                                            global const uint* restrict list,
                                            global const float* restrict fragments,
                                            global const uint* restrict fragment_pair,
                                            global const uint* restrict pair_face,
                                            global float4* restrict image) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= p.last_pixel) return;
  if (starts[pixel] == starts[pixel + 1]) {
    image[pixel] = (float4)(p.background.xyz, 0.0f);
    return;
  }
  const Layers f = make_layers(p, list, fragments, fragment_pair, pair_face);
  const Pixel q = load_pixel(p, pixel, views, starts, f);
  float4 sum = 0.0f;
  for (uint block = 0; DPR_WIDTH * block < p.sampling.samples; ++block) {
    NoiseCache unused;
    sum = add_winners(p, q.run, f.fragments, block, find_winners(p, q, f, block, &unused).winner, sum);
  }
  image[pixel] = sum / (float)p.sampling.samples;
}

/// Sums of a pixel's fragments: wins, and the sums of add_scores for distance and depth.
/// float[fragment]
typedef struct {
  global float *wins, *by_distance, *distance_scores, *by_depth, *depth_scores;
} FragmentSums;

/// Other sums of a pixel.
typedef struct {
  float y;
  ScaleSums sigma, gamma;
} PixelSums;

/// Adds a block's scores of one fragment.
DPR_ALWAYS_INLINE void add_fragment(const AggregateParams p, const Pixel q, const Layers f, uint block,
                                    int place, const Lead lead, const NoiseCache* cache, realn grouped,
                                    const FragmentSums out, PixelSums* sums) {
  const uint k = fragment_at(q.run, f.fragments, place);
  const Coordinates c = load_fragment(p, q, f, k);
  if (never_covers(c) || !any_lane(could_win(lead, c))) return;
  const intn counts = sample_counts(p.sampling, block);
  realn x = 0.0f;
  intn covers = (intn)(-1);
  if (!always_covers(c)) {
    x = is_kept(place) ? cache->distance[place] : draw_distance(p, q, c, block);
    covers = c.x + x > 0.0f;
  }
  const realn z = is_kept(place) && any_lane(covers) ? cache->depth[place] : draw_depth(p, q, c, block);
  if (!always_covers(c)) {
    const intn wins_if_it_covers = c.beta + z >= lead.largest;
    const float2 scores = add_scores(x, noise_score(DPR_OCCUPANCY_PRIOR, x), counts && wins_if_it_covers,
                                     grouped, &sums->sigma);
    out.by_distance[k] += scores.x;
    out.distance_scores[k] += scores.y;
  }
  const float2 scores = add_scores(z, noise_score(DPR_DEPTH_PRIOR, z), counts && covers && could_win(lead, c),
                                   grouped, &sums->gamma);
  out.by_depth[k] += scores.x;
  out.depth_scores[k] += scores.y;
}

/// Collects the scores of all samples.
static inline PixelSums add_samples(const AggregateParams p, const Pixel q, const Layers f, float4 grad,
                                    const FragmentSums out) {
  PixelSums sums = {0.0f, {(realn)(0.0f), (realn)(0.0f)}, {(realn)(0.0f), (realn)(0.0f)}};
  for (uint i = q.run.first; i < q.run.last; ++i) {
    const uint k = f.fragments.list[i];
    out.wins[k] = out.by_distance[k] = out.distance_scores[k] = out.by_depth[k] = out.depth_scores[k] = 0.0f;
  }
  const float rigid = rigid_value(p, q.run, f.fragments, grad);
  for (uint block = 0; DPR_WIDTH * block < p.sampling.samples; ++block) {
    NoiseCache cache;
    const Lead lead = find_winners(p, q, f, block, &cache);
    const realn y = sample_values(p, q.run, f.fragments, grad, rigid, block, lead.winner, out.wins);
    if (p.sampling.leave_out == 0.0f && !any_lane(y != 0.0f)) continue;
    const realn grouped = add_group(p.sampling, y);
    sums.y += sum_lanes(y);
    for (int place = 0; place < run_length(q.run); ++place) {
      add_fragment(p, q, f, block, place, lead, &cache, grouped, out, &sums);
    }
  }
  return sums;
}

/// One work-item per pixel; every fragment belongs to one pixel, so no two write the same place.
/// Deterministic. Inputs as aggregate_joint_sampled_forward, and
/// in   grad_image  float4[pixel]
/// out  grads       float[plane][fragment]  of DEPTH, COLOR, DISTANCE
/// out  grad_sigma  float[pixel]                      what the pixel adds to dL/dsigma
/// out  channels    float[p.channels][pixel]  what the pixel adds to gamma and the background colour
kernel void aggregate_joint_sampled_backward(
    const AggregateParams p, global const ViewParams* restrict views, global const uint* restrict starts,
    global const uint* restrict list, global const float* restrict fragments,
    global const uint* restrict fragment_pair, global const uint* restrict pair_face,
    global const float4* restrict grad_image, global float* restrict grads, global float* restrict grad_sigma,
    global float* restrict channels) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= p.last_pixel) return;
  const Layers f = make_layers(p, list, fragments, fragment_pair, pair_face);
  const float4 grad = grad_image[pixel];
  float by_sigma = 0.0f, by_gamma = 0.0f, background_weight = 1.0f;
  if (starts[pixel] != starts[pixel + 1]) {
    const Pixel q = load_pixel(p, pixel, views, starts, f);
    // The colours' gradients are written last; until then their places hold sums.
    const FragmentGradients g = make_gradients(p, grads);
    global float* const grad_distance = grads + DPR_GRAD_PLANE(p, DISTANCE);
    const FragmentSums collected = {g.red, grad_distance, g.green, g.depth, g.blue};
    const PixelSums sums = add_samples(p, q, f, grad, collected);
    by_sigma = in_sigmas(p, scale_estimate(p.sampling, sums.sigma, sums.y), 0.0f);
    by_gamma = scale_estimate(p.sampling, sums.gamma, sums.y) / p.gamma;
    for (uint i = q.run.first; i < q.run.last; ++i) {
      const uint k = list[i];
      const float weight = g.red[k] / (float)p.sampling.samples;
      background_weight -= weight;
      const float by_distance = score_estimate(p.sampling, grad_distance[k], g.green[k], sums.y);
      grad_distance[k] = in_sigmas(p, by_distance, 0.0f);
      g.depth[k] = -score_estimate(p.sampling, g.depth[k], g.blue[k], sums.y) * q.depth_scale;
      store_color(g, k, weight, grad);
    }
  }
  grad_sigma[pixel] = by_sigma;
  write_channels(p, pixel, by_gamma, 0.0f, background_weight, grad, channels);
}
