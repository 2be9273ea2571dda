// The noise of the Monte Carlo estimators, and their control variates. Samples are taken in blocks, one a
// lane. Noise is a pure function of (seed, view, pixel, face, sample, stage): the backward pass draws
// that of the forward pass again, so nothing is stored, and memory does not depend on the number of samples.
//
// With M samples y_m of a function of the noise, gradients are score estimates (12), (14) with a baseline b:
//
//   1/M sum_m (y_m - b_m) nu'(Z_m)
//
//   none           b = 0
//   rigid          b = y without noise
//   leave_one_out  b_m = (S - G_m) / (M - g): the mean of the samples outside the group of m, S = sum y, G_m
//                  the sum of the group; a group is one sample, or an antithetic pair, whose halves know of
//                  each other
//
// The last needs S before its first term; but it is linear: 1/M (sum_m (y_m + G_m / (M - g)) nu'(Z_m) - S
// B / (M - g)) with B = sum_m nu'(Z_m). So one pass over the samples collects both sums. Its y count from the
// rigid solution, which changes nothing but the rounding.
//
// A variable that y cannot depend on, given all the others, adds noise of mean zero to the gradients: such
// terms are left out. What is left has the same expectation and less variance.
#ifndef DPR_NOISE_H
#define DPR_NOISE_H

/// Samples of a block, one a lane: on a GPU those that one call of the generator has words for.
#ifndef DPR_WIDTH
#if defined(DPR_LANES) && DPR_LANES == 1
#define DPR_WIDTH 4
#else
#define DPR_WIDTH 8
#endif
#endif
#include "philox.h"
#include "priors.h"

/// Slots of a pixel whose noise the backward pass keeps between its two uses; that of others is drawn twice.
/// On a GPU that of all: what an index that varies reaches lies in memory there.
#ifndef DPR_NOISE_CACHE
#define DPR_NOISE_CACHE 32
#endif
static inline int is_kept(int slot) { return DPR_LANES != 1 && slot < DPR_NOISE_CACHE; }

/// Decisions that noise is for: the last word of the counter, beside the view.
#define DPR_STAGE_OCCUPANCY 0u
#define DPR_STAGE_AGGREGATE 1u

/// The block of the counter whose words choose the permutation of the stratified draws; samples end far below
/// it.
#define DPR_PERMUTATION_BLOCK 0x80000000u

/// Whose noise: that of a face, or of the background, in a pixel of a view, for a stage.
typedef struct {
  uint pixel, face, stream;
} NoiseName;

static inline NoiseName name_noise(uint view, uint pixel, uint face, uint stage) {
  NoiseName name;
  name.pixel = pixel;
  name.face = face;
  name.stream = view << 1 | stage;
  return name;
}

/// Number of each lane's sample.
static inline uintn sample_index(uint block) { return DPR_WIDTH * block + convert_uintn(DPR_LANE_INDEX); }

/// Lanes that hold a sample: the last block may be a part of one.
static inline intn sample_counts(const Sampling s, uint block) {
  return sample_index(block) < (uintn)(s.samples);
}

/// Kensler, "Correlated multi-jittered sampling" (Pixar 13-01, 2013): a permutation of [0, count) that a hash
/// of `seed` chooses, for any count, by walking the cycles of one of the next power of two. `i` is below
/// `count`. Standard errors are those of true random permutations; a mere rotation, which leaves the samples
/// of all variables on diagonals, doubles them at M = 32.
static inline uintn permute(uintn i, uint count, uint seed) {
  uint mask = count - 1;
  mask |= mask >> 1;
  mask |= mask >> 2;
  mask |= mask >> 4;
  mask |= mask >> 8;
  mask |= mask >> 16;
  intn is_outside = (intn)(-1);
  do {
    uintn k = (i ^ seed) * 0xe170893du;
    k ^= seed >> 16;
    k ^= (k & mask) >> 4;
    k = (k ^ seed >> 8) * 0x0929eb3fu;
    k ^= seed >> 23;
    k = (k ^ (k & mask) >> 1) * (1u | seed >> 27) * 0x6935fa69u;
    k = (k ^ (k & mask) >> 11) * 0x74dcb303u;
    k = (k ^ (k & mask) >> 2) * 0x9e501cc3u;
    k = (k ^ (k & mask) >> 2) * 0xc860a3dfu & mask;
    i = select(i, k ^ k >> 5, is_outside);
    is_outside = i >= count;
  } while (any_lane(is_outside));
  return i;
}

/// Moves independent uniform numbers into the strata of a Latin hypercube.
static inline realn stratify(const Sampling s, const NoiseName name, uint block, realn u) {
  const uint4 counter = (uint4)(name.pixel, name.face, DPR_PERMUTATION_BLOCK, name.stream);
  const uint4 words = philox4x32_10(counter, (uint2)(s.seed_low, s.seed_high));
  const uintn hashed = permute(min(sample_index(block), (uintn)(s.samples - 1)), s.samples, words.x);
  const uintn rotated = hashed + words.y % s.samples;
  const uintn stratum = rotated - select((uintn)(0), (uintn)(s.samples), rotated >= s.samples);
  return clamp((convert_realn(stratum) + u) / (float)s.samples, DPR_LOWEST_UNIFORM, DPR_HIGHEST_UNIFORM);
}

/// The random words of a block of samples.
///   independent  sample m: word m mod 4 of the counter (pixel, face, m / 4, stream)
///   antithetic   samples 2 j and 2 j + 1: word j mod 4 of the counter (pixel, face, j / 4, stream), and that
///                word with all its bits turned
DPR_ALWAYS_INLINE uintn draw_words(const Sampling s, const NoiseName name, uint block) {
  const int is_paired = s.draws == DPR_ANTITHETIC;
  const uint first = (is_paired ? DPR_WIDTH / 2 : DPR_WIDTH) * block / DPR_COUNTER_WORDS;
  const uint4 counter = (uint4)(name.pixel, name.face, first, name.stream);
  const uint2 key = (uint2)(s.seed_low, s.seed_high);
#if DPR_WIDTH == 4
  const uint4 words = philox4x32_10(counter, key), turned = (uint4)(0, ~0u, 0, ~0u);
  return is_paired ? (block % 2 == 0 ? words.xxyy : words.zzww) ^ turned : words;
#else
  const uint8 words = philox4x32_10_twice(counter, key), turned = (uint8)(0, ~0u, 0, ~0u, 0, ~0u, 0, ~0u);
  return is_paired ? words.s00112233 ^ turned : words;
#endif
}

/// Uniform numbers for a block of samples, each in (0, 1) and never 0 or 1: those of its words; stratified
/// (pi(m) + u) / M with the independent u, and a permutation pi of its own for every name. pi is rotated by a
/// word of its own, so that pi(m) is uniform whatever the hash is worth.
DPR_ALWAYS_INLINE realn draw_uniform(const Sampling s, const NoiseName name, uint block) {
  const realn u = uniform_from_bits(draw_words(s, name, block));
  return s.draws == DPR_STRATIFIED ? stratify(s, name, block, u) : u;
}

/// The noise of a prior, by its name, for a block of samples.
#define draw_noise(s, prior, name, block) noise_quantile(prior, draw_uniform(s, name, block))

/// y_m + G_m / (M - g), or y_m where there is no leave-one-out baseline. `y` is 0 in lanes without a sample.
static inline realn add_group(const Sampling s, realn y) {
#if DPR_WIDTH == 4
  const realn partner = y.yxwz;
#else
  const realn partner = y.s10325476;
#endif
  return mad(s.leave_out, s.draws == DPR_ANTITHETIC ? y + partner : y, y);
}

/// Sums for a scale, sigma or gamma, over variables and samples: of (y + G / (M - g)) (nu'(Z)
/// Z - 1) and of nu'(Z) Z - 1.
typedef struct {
  realn by_score, scores;
} ScaleSums;

/// Adds a block's scores of one variable, where `counts`: those of the scale to `scale`; returns the
/// variable's own, sum (y + G / (M - g)) nu'(Z) and sum nu'(Z). `scores` is nu' of the noise, `grouped`
/// add_group of y.
static inline float2 add_scores(realn noise, realn scores, intn counts, realn grouped, ScaleSums* scale) {
  const realn score = choose(counts, scores, (realn)(0.0f));
  const realn scale_score = choose(counts, mad(score, noise, -1.0f), (realn)(0.0f));
  scale->by_score += grouped * scale_score;
  scale->scores += scale_score;
  return (float2)(sum_lanes(grouped * score), sum_lanes(score));
}

/// The estimate, from sum (y + G / (M - g)) nu', B = sum nu' and S = sum y.
static inline float score_estimate(const Sampling s, float by_score, float score_sum, float y_sum) {
  return (by_score - s.leave_out * y_sum * score_sum) / (float)s.samples;
}

static inline float scale_estimate(const Sampling s, const ScaleSums scale, float y_sum) {
  return score_estimate(s, sum_lanes(scale.by_score), sum_lanes(scale.scores), y_sum);
}

#endif
