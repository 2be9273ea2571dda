// Side of an edge on which a point lies, without a rounding error, and the triangle that owns a sample.
// Triangles that share an edge own every sample there exactly once: the sign is that of the exact edge
// function of the rounded coordinates, and a sample on the edge itself belongs to the triangle whose left or
// upper edge it is. That is the sample moved to the right by less than any number, and down by much less, so
// the rule holds at shared vertices too.
//
// Whatever takes part is not contracted: fused with the product that a coordinate is, a difference would be
// one of another coordinate in each triangle that it is inlined for (tests/device/contraction.py).
#ifndef DPR_OWNERSHIP_H
#define DPR_OWNERSHIP_H

#include "shared_types.h"

#ifndef DPR_LANES
#define DPR_LANES 8 /* as lanes.h */
#endif

/// An edge function ex * dy - ey * dx whose factors are rounded differences is wrong by at most this times
/// the sum of its products' sizes (Shewchuk, "Adaptive precision floating-point arithmetic and fast robust
/// geometric predicates", 1997: 3 + 16 u times u = 2^-24), and where these underflow by less than the floor.
#define DPR_EDGE_ERROR 1.8e-7f
#define DPR_EDGE_FLOOR 1e-30f

/// Most that rounding moves a projected coordinate, in pixels of images up to 16384 wide or high.
#define DPR_BOUNDS_SLACK 1e-2f

/// The largest coordinate is scaled to about 2^60: the products' sum stays below 2^128, and the products of
/// coordinates down to 2^-99 of the largest have all their bits.
#define DPR_EXACT_EXPONENT 60

/// a + b without error: the rounded sum, and what rounding took away (Knuth's two-sum).
static inline float two_sum(float a, float b, float* error) {
#pragma OPENCL FP_CONTRACT OFF
  const float sum = a + b, part = sum - a;
  *error = (a - (sum - part)) + (b - part);
  return sum;
}

/// The parts of an exact sum: on a GPU in registers, where every index is known; on a CPU unrolling them only
/// takes the compiler's time.
#if DPR_LANES == 1
#define DPR_UNROLL_PARTS _Pragma("unroll")
#else
#define DPR_UNROLL_PARTS
#endif

/// The sign of cross(b - a, p - a), exactly: six products without error, added to a sum of parts that do not
/// overlap (Shewchuk's grow-expansion), whose largest has the sign.
static int exact_side(float2 a, float2 b, float2 p) {
#pragma OPENCL FP_CONTRACT OFF
  const float2 largest2 = fmax(fmax(fabs(a), fabs(b)), fabs(p));
  const int2 exponent =
      (int2)(DPR_EXACT_EXPONENT - ilogb(fmax(fmax(largest2.x, largest2.y), DPR_EDGE_FLOOR)));
  a = ldexp(a, exponent);
  b = ldexp(b, exponent);
  p = ldexp(p, exponent);
  const float left[6] = {a.x, -a.y, b.x, -b.y, p.x, -p.y}, right[6] = {b.y, b.x, p.y, p.x, a.y, a.x};
  float parts[12];
  DPR_UNROLL_PARTS
  for (int k = 0; k < 6; ++k) {
    const float product = left[k] * right[k];
    float low = fma(left[k], right[k], -product), high = product;
    DPR_UNROLL_PARTS
    for (int i = 0; i < 2 * k; ++i) low = two_sum(low, parts[i], &parts[i]);
    parts[2 * k] = low;
    DPR_UNROLL_PARTS
    for (int i = 0; i < 2 * k + 1; ++i) high = two_sum(high, parts[i], &parts[i]);
    parts[2 * k + 1] = high;
  }
  float sign_of = 0.0f;
  DPR_UNROLL_PARTS
  for (int i = 0; i < 12; ++i) sign_of = parts[i] != 0.0f ? parts[i] : sign_of;
  return (sign_of > 0.0f) - (sign_of < 0.0f);
}

/// +1 where p lies to the left of a -> b, -1 to the right, 0 on the line.
static inline int side_of_line(float2 a, float2 b, float2 p) {
#pragma OPENCL FP_CONTRACT OFF
  const float u = (b.x - a.x) * (p.y - a.y), v = (b.y - a.y) * (p.x - a.x);
  const float side = u - v;
  // Written so that a NaN is looked at again.
  if (fabs(side) > DPR_EDGE_ERROR * (fabs(u) + fabs(v)) + DPR_EDGE_FLOOR) return side > 0.0f ? 1 : -1;
  return exact_side(a, b, p);
}

/// True if a sample belongs to the triangle, so far as the edge a -> b says.
static inline int is_owned_at(float2 a, float2 b, float2 p, float orientation) {
  int side = side_of_line(a, b, p);
  if (side == 0) side = b.y < a.y || (b.y == a.y && b.x < a.x) ? 1 : -1;
  return (float)side * orientation > 0.0f;
}

/// NDC of a pixel's centre. Columns count to the right, rows down; NDC y is up. Not contracted into what uses
/// it, so that a pixel has one centre for all triangles.
static inline float2 pixel_centre(const FrameParams p, int column, int row) {
#pragma OPENCL FP_CONTRACT OFF
  return (float2)((float)column + 0.5f - 0.5f * (float)p.width, 0.5f * (float)p.height - 0.5f - (float)row) *
         p.pixel_size;
}

static inline int owns_sample(const Triangle t, float2 p) {
  float2 a = (float2)(t.x0, t.y0), b = (float2)(t.x1, t.y1), c = (float2)(t.x2, t.y2);
#pragma unroll 1
  for (int k = 0; k < 3; ++k) {
    if (!is_owned_at(a, b, p, t.orientation)) return 0;
    const float2 next = a;
    a = b;
    b = c;
    c = next;
  }
  return 1;
}

#endif
