// Steps between neighbouring samples: what crosses them, what the sample at either end takes of the colour
// beyond, and how a colour continues towards them.
//
// A step at whose fraction t a contour passes separates two colours that need not be constant: each continues
// to the contour as it came, along the line of samples. Their difference at s in [0, 1] is J(s), and the
// first sample's tent takes the integral of (1 - s) J(s) from t on, whose derivative by t is J where the
// contour is.
#ifndef DPR_STEPS_H
#define DPR_STEPS_H

#include "crossing.h"
#include "window.h"

/// Mark of a step that a contour passes without counting: a flat one, which counts by columns, or one that
/// only one of the samples shows.
#define DPR_PASSED (DPR_NO_CROSSING - 1)

/// The steps from a sample: to the right, down, to the left, up. The sample at the other end counts a step as
/// its opposite.
#define DPR_STEPS 4
#define DPR_OPPOSITE(step) ((step) ^ 2)

/// A sample of a view: its place in the window (window.h), its column and row.
typedef struct {
  uint index;
  int2 at;
} Sample;

static inline Sample sample_beside(const FrameParams p, Sample s, int step) {
  const int ahead = step < 2 ? 1 : -1, is_column = step & 1;
  const Sample beside = {s.index + (uint)(is_column ? ahead * (int)p.width : ahead),
                         s.at + (is_column ? (int2)(0, ahead) : (int2)(ahead, 0))};
  return beside;
}

static inline int is_on_raster(const FrameParams p, Sample s) {
  return s.at.x >= 0 && s.at.y >= 0 && s.at.x < (int)p.width && s.at.y < (int)p.height;
}

/// Contours that cross the steps: planes [2][sample of the window], to the right and down.
typedef struct {
  global const uint* winner;
  global const float2* cut;
  uint pixels;  // of a plane
} Steps;

/// The place of a step in the planes. Its first sample is the left or the upper one.
static inline uint place_of(const FrameParams p, const Steps steps, Sample s, int step) {
  const Sample first = step < 2 ? s : sample_beside(p, s, step);
  return (step & 1 ? steps.pixels : 0) + first.index;
}

static inline Cut cut_at(const FrameParams p, const Steps steps, Sample s, int step) {
  return steps.cut[place_of(p, steps, s, step)];
}

static inline Sample sample_at(const FrameParams p, uint index) {
  const int2 at = {(int)((index + p.first_sample) % p.width), (int)(line_of_place(p, index) % p.height)};
  const Sample s = {index, at};
  return s;
}

/// Entry of a step: a contour, DPR_PASSED, or DPR_NO_CROSSING, also for a step that leaves the raster.
static inline uint at_step(const FrameParams p, const Steps steps, Sample s, int step) {
  return is_on_raster(p, sample_beside(p, s, step)) ? steps.winner[place_of(p, steps, s, step)]
                                                    : DPR_NO_CROSSING;
}

static inline int is_contour(uint at_step) { return at_step < DPR_PASSED; }

/// End of a step that a sample is: -1 its first, 1 its second.
static inline float turn_of(int step) { return step < 2 ? -1.0f : 1.0f; }

/// Parts that a sample takes of the colours at a step: x of the difference to the other end's sample, y of
/// the changes of both colours towards it, of which the sample's own counts x - y.
typedef float2 Parts;

/// The variance of a tent, over 2: of a slanted edge the tents across the lines spread its crossings as far
/// as the slope is, and the two samples take that much more of each other.
#define DPR_HALF_TENT (1.0f / 12.0f)

/// x is the tent beyond the contour, y the tent there times the way to the other end.
static inline Parts parts_taken(Cut cut, float turn) {
  const float way = 0.5f + turn * cut.x;
  return weight_of_slope(cut.y) * (Parts)(0.5f * way * way + DPR_HALF_TENT * cut.y, way * way * way / 3.0f);
}

/// The gradient of a cut by those of its parts.
static inline Cut parts_taken_gradient(Cut cut, float turn, Parts grad) {
  const float way = 0.5f + turn * cut.x, weight = weight_of_slope(cut.y);
  const float grad_weight =
      grad.x * (0.5f * way * way + DPR_HALF_TENT * cut.y) + grad.y * way * way * way / 3.0f;
  return (Cut)(turn * weight * way * (grad.x + way * grad.y),
               weight * DPR_HALF_TENT * grad.x + weight_of_slope_gradient(cut.y) * grad_weight);
}

/// The sum of what a sample takes of the others, or 1 if that is less: contours on all sides of a sample may
/// leave nothing of it. Then the others share it.
static inline float total_taken(const FrameParams p, const Steps steps, Sample s) {
  float sum = 0.0f;
#pragma unroll
  for (int k = 0; k < DPR_STEPS; ++k) {
    if (is_contour(at_step(p, steps, s, k))) sum += parts_taken(cut_at(p, steps, s, k), turn_of(k)).x;
  }
  return fmax(sum, 1.0f);
}

/// True if a sample's colour is known to continue towards a step: nothing lies between it and the sample
/// behind it.
static inline int continues(const FrameParams p, const Steps steps, Sample s, int step) {
  const Sample behind = sample_beside(p, s, DPR_OPPOSITE(step));
  return is_on_raster(p, behind) && at_step(p, steps, s, DPR_OPPOSITE(step)) == DPR_NO_CROSSING;
}

/// The change of a colour from the sample behind towards a step; 0 where it is not known.
static inline float4 change_towards(const FrameParams p, const Steps steps, Sample s, int step,
                                    global const float4* raster) {
  if (!continues(p, steps, s, step)) return 0.0f;
  return raster[s.index] - raster[sample_beside(p, s, DPR_OPPOSITE(step)).index];
}

#endif
