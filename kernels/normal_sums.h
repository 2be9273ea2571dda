// What the sums of normal_equations.cl and normal_measured.cl share: vectors of an image's pixels, the slots that add
// them up, residuals of all kinds, and the light that multiplies an object's colours.
#include "tile_lanes.h"

#include "harmonics.h"

#ifndef DPR_TERMS
#define DPR_TERMS 10 /* of a channel's light: 0; gain and offset; harmonics and offset */
#endif
#ifndef DPR_DIRECTIONS
#define DPR_DIRECTIONS 6 /* in which hypotheses move */
#endif

#ifndef DPR_MEASURED
#define DPR_MEASURED 0 /* 1: images of coverage and depth are compared beside colours (normal_measured.cl) */
#endif

#define DPR_FACTORS (DPR_TERMS - 1) /* terms that the colour multiplies */
#define DPR_FIT_LENGTH (1 + 3 * DPR_TERMS)
#define DPR_TRIANGLE(n) ((n) * ((n) + 1) / 2)

/// A vector of pixels, RGBA.
typedef struct {
  Vec3n color;
  realn alpha;
} PixelsN;

/// Those from `first` on; lanes from `last` on repeat the pixel before.
static inline PixelsN load_pixels(uint first, uint last, global const float4* image) {
  PixelsN p;
#if DPR_WIDTH == 1
  (void)last;
  p.color = splat3(image[first]);
  p.alpha = image[first].w;
#else
  float16 a, b;
  if (last - first >= DPR_WIDTH) {
    a = vload16(0, (global const float*)(image + first));
    b = vload16(1, (global const float*)(image + first));
  } else {
    float4 lanes[DPR_WIDTH];
    for (uint lane = 0; lane < DPR_WIDTH; ++lane) lanes[lane] = image[min(first + lane, last - 1)];
    a = vload16(0, (const float*)lanes);
    b = vload16(1, (const float*)lanes);
  }
  p.color = make_vec3n((realn)(a.s048c, b.s048c), (realn)(a.s159d, b.s159d), (realn)(a.s26ae, b.s26ae));
  p.alpha = (realn)(a.s37bf, b.s37bf);
#endif
  return p;
}

/// Three planes; lanes from `last` on are 0.
static inline Vec3n load_planes(uint first, uint last, uint pixels, global const float* planes) {
  const intn in_run = lanes_before(last, first);
  return make_vec3n(load_run(in_run, first, planes), load_run(in_run, first, planes + pixels),
                    load_run(in_run, first, planes + 2 * (size_t)pixels));
}

static inline void store_planes(Vec3n v, uint first, uint last, uint pixels, global float* planes) {
  store_run(v.x, first, last, planes);
  store_run(v.y, first, last, planes + pixels);
  store_run(v.z, first, last, planes + 2 * (size_t)pixels);
}

/// The background of normal_equations.cl.
static inline Vec3n behind_object(float4 background, Vec3n target) {
  return background.w == 0.0f ? splat3(background) : target;
}

#define DPR_THRESHOLDS 16    /* a pass of the search for a median tells so many parts apart */
#define DPR_MEASURED_KINDS 2 /* coverage and depth */

/// Residuals of a vector of pixels, or their derivatives.
typedef struct {
  Vec3n color;
#if DPR_MEASURED
  realn coverage, depth;  // times the roots of their weights
#endif
} ResidualsN;

/// From planes [pixel] of colours and of what is measured; lanes from `last` on are 0.
static inline ResidualsN load_residuals(uint first, uint last, uint pixels, global const float* colors,
                                        global const float* measured) {
  ResidualsN r;
  r.color = load_planes(first, last, pixels, colors);
#if DPR_MEASURED
  r.coverage = load_run(lanes_before(last, first), first, measured);
  r.depth = load_run(lanes_before(last, first), first, measured + pixels);
#else
  (void)measured;
#endif
  return r;
}

/// Adds the products of channels, colours' times a weight.
static inline realn add_product(realn sum, const ResidualsN a, const ResidualsN b, realn weight) {
  sum += weight * dot3n(a.color, b.color);
#if DPR_MEASURED
  sum += a.coverage * b.coverage + a.depth * b.depth;
#endif
  return sum;
}

/// Adds half of a * rest_of_b + rest_of_a * b: the light takes nothing of what is measured.
static inline realn add_symmetric_product(realn sum, const ResidualsN a, const ResidualsN rest_of_a,
                                          const ResidualsN b, const ResidualsN rest_of_b, realn weight) {
  sum += 0.5f * weight * (dot3n(a.color, rest_of_b.color) + dot3n(rest_of_a.color, b.color));
#if DPR_MEASURED
  sum += a.coverage * b.coverage + a.depth * b.depth;
#endif
  return sum;
}

/// A vector of slots, and the pixels that it sums.
typedef struct {
  uint slot, view, part;
  uint first, last, step;
} Slots;

static inline Slots make_slots(uint pixels, uint views, uint slots) {
  const uint i = (uint)get_global_id(0), vectors = slots / DPR_WIDTH;
  Slots s;
  s.slot = i % vectors * DPR_WIDTH;
  s.view = i / vectors % views;
  s.part = i / vectors / views;
#if DPR_WIDTH == 1
  s.first = s.slot;
  s.last = pixels;
  s.step = slots;
#else
  const uint run = (pixels + slots - 1) / slots;  // vectors
  s.first = s.slot * run;
  s.last = min(pixels, s.first + DPR_WIDTH * run);
  s.step = DPR_WIDTH;
#endif
  return s;
}

/// A vector of pixels of a view moved in a direction.
typedef struct {
  uint first, view;
  size_t image;  // direction * views + view
} Moved;

static inline Moved make_moved(uint pixels, uint views) {
  const uint i = (uint)get_global_id(0), vectors = (pixels + DPR_WIDTH - 1) / DPR_WIDTH;
  Moved m;
  m.first = i % vectors * DPR_WIDTH;
  m.image = i / vectors;
  m.view = i / vectors % views;
  return m;
}

static inline void store_sum(realn sum, uint number, const Slots s, uint views, uint slots,
                             global float* sums) {
  store_n(sum, 0, sums + ((size_t)number * views + s.view) * slots + s.slot);
}

#if DPR_TERMS > 0
/// Coefficient of a term of a light, by channel.
static inline Vec3n light_at(global const float* light, uint term) {
  return make_vec3n((realn)(light[term]), (realn)(light[DPR_TERMS + term]),
                    (realn)(light[2 * DPR_TERMS + term]));
}

/// Normals that pixels show, 0 without any, and the polynomials that the light multiplies.
typedef struct {
  Vec3n normal;
  realn inverse_length;  // of the normal in the image
  realn basis[DPR_FACTORS];
} Facing;

static inline Facing load_facing(uint first, uint last, global const float4* normals) {
  Facing f;
#if DPR_FACTORS == DPR_HARMONICS
  f.normal = load_pixels(first, last, normals).color;
  f.inverse_length = normalize3n(&f.normal);
  harmonic_basis(f.normal, f.basis);
#else
  (void)first, (void)last, (void)normals;
  f.basis[0] = 1.0f;
#endif
  return f;
}

/// Sum of the terms that the colour multiplies, times a light, by channel.
static inline Vec3n shade(const realn basis[DPR_FACTORS], global const float* light) {
  Vec3n shading = zero3n();
  DPR_UNROLL_ON_GPU
  for (uint k = 0; k < DPR_FACTORS; ++k) shading = mad3n(light_at(light, k), basis[k], shading);
  return shading;
}
#endif
