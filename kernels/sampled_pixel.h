// Code shared by the sampled compositions: a pixel's run of fragments, the noise of each, and what a block of
// samples sees.
#ifndef DPR_SAMPLED_PIXEL_H
#define DPR_SAMPLED_PIXEL_H

#include "noise.h"
#include "pixel.h"

/// The face index that names the background's noise.
#define DPR_BACKGROUND_FACE 0xffffffffu

/// Faces whose noise fragments take: uint[fragment], uint[pair].
typedef struct {
  global const uint *fragment_pair, *pair_face;
} FaceOf;

/// A pixel's run of the fragment lists. A place counts from its first; where a winner is meant, -1 is the
/// background.
typedef struct {
  uint first, last;
  uint view, in_view;  // the pixel's view, and its number in it: they name its noise
  int rigid;           // the winner without noise
} SampledRun;

static inline SampledRun locate_run(const AggregateParams p, uint pixel, global const uint* restrict starts) {
  SampledRun run;
  run.first = starts[pixel];
  run.last = starts[pixel + 1];
  run.view = (pixel + p.first_pixel) / p.pixels_per_view;
  run.in_view = pixel + p.first_pixel - run.view * p.pixels_per_view;
  run.rigid = -1;
  return run;
}

static inline int run_length(const SampledRun run) { return (int)(run.last - run.first); }

static inline uint fragment_at(const SampledRun run, const Fragments f, int place) {
  return f.list[run.first + (uint)place];
}

/// The face of a fragment, counted in its own view.
static inline uint face_of_fragment(const AggregateParams p, const SampledRun run, const FaceOf face,
                                    uint fragment) {
  return face.pair_face[face.fragment_pair[fragment]] - run.view * p.faces;
}

static inline NoiseName name_of_noise(const AggregateParams p, const SampledRun run, uint face, uint stage) {
  return name_noise(p.first_view + run.view, run.in_view, face, stage);
}

/// RGBA of a winner.
static inline float4 winner_color(const AggregateParams p, const SampledRun run, const Fragments f,
                                  int winner) {
  if (winner < 0) return (float4)(p.background.xyz, 0.0f);
  return (float4)(fragment_color(f, fragment_at(run, f, winner)), 1.0f);
}

/// True if a lane of a block holds a sample: the last block may be a part of one.
static inline int lane_counts(const AggregateParams p, uint block, uint lane) {
  return DPR_WIDTH * block + lane < p.sampling.samples;
}

/// The sum of what a block's samples see.
static inline float4 add_winners(const AggregateParams p, const SampledRun run, const Fragments f, uint block,
                                 intn winner, float4 sum) {
  int winners[DPR_WIDTH];
  store_n(winner, 0, winners);
  for (uint lane = 0; lane < DPR_WIDTH && lane_counts(p, block, lane); ++lane) {
    sum += winner_color(p, run, f, winners[lane]);
  }
  return sum;
}

/// y = <grad, RGBA> of the rigid solution, from which the samples' count; 0 without a baseline.
static inline float rigid_value(const AggregateParams p, const SampledRun run, const Fragments f,
                                float4 grad) {
  return p.sampling.baseline * dot(grad, winner_color(p, run, f, run.rigid));
}

/// y of every sample of a block, relative to `rigid`, 0 in lanes without a sample; adds 1 to the wins of each
/// winner.
static inline realn sample_values(const AggregateParams p, const SampledRun run, const Fragments f,
                                  float4 grad, float rigid, uint block, intn winner, global float* wins) {
  int winners[DPR_WIDTH];
  float y[DPR_WIDTH];
  store_n(winner, 0, winners);
  for (uint lane = 0; lane < DPR_WIDTH; ++lane) {
    y[lane] = 0.0f;
    if (!lane_counts(p, block, lane)) continue;
    y[lane] = dot(grad, winner_color(p, run, f, winners[lane])) - rigid;
    if (winners[lane] >= 0) wins[fragment_at(run, f, winners[lane])] += 1.0f;
  }
  return load_n(0, y);
}

#endif
