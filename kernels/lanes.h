// Vectors of DPR_WIDTH floats under one name. A kernel file that works on lanes defines DPR_WIDTH before it
// includes this: 1 where the device's lanes are its work-items (GPUs), 8 or 16 where they are vector
// registers (CPUs), 8 where they are samples.
#ifndef DPR_LANES_H
#define DPR_LANES_H

#ifndef DPR_LANES
#define DPR_LANES 8 /* the device's width; the host chooses it */
#endif
#ifndef DPR_WIDTH
#define DPR_WIDTH DPR_LANES /* the width of this file's vectors */
#endif

/// Inlines functions whose call would cost more: the key's part in the rounds of inlined noise is computed
/// once for a whole launch on a CPU; and a structure that is handed over lies in memory.
#define DPR_ALWAYS_INLINE static inline __attribute__((always_inline))

/// Before a loop that a CPU unrolls where its number of turns is known: to mispredict where a loop of few
/// ends takes longer than its turns do. And before one whose arrays a GPU holds in registers; a CPU has none for
/// so much, and compiles faster.
#if DPR_LANES == 1
#define DPR_UNROLL_ON_CPU
#define DPR_UNROLL_ON_GPU _Pragma("unroll")
#else
#define DPR_UNROLL_ON_CPU _Pragma("unroll")
#define DPR_UNROLL_ON_GPU
#endif

#define DPR_CONCAT_(a, b) a##b
#define DPR_CONCAT(a, b) DPR_CONCAT_(a, b)

#if DPR_WIDTH == 1
typedef float realn;
typedef int intn;
typedef uint uintn;
#define load_n(index, pointer) ((pointer)[index])
#define store_n(value, index, pointer) ((pointer)[index] = (value))
#define as_intn as_int
#define as_realn as_float
#define convert_intn convert_int
#define convert_realn convert_float
#define convert_uintn convert_uint
#define DPR_LANE_INDEX 0
static inline float sum_lanes(float v) { return v; }
static inline float4 sum_lanes_of_4(float a, float b, float c, float d) { return (float4)(a, b, c, d); }
/// True if a comparison holds in any lane. By halves: PoCL's any() asks lane by lane.
static inline int any_lane(int condition) { return condition; }
#else
typedef DPR_CONCAT(float, DPR_WIDTH) realn;
typedef DPR_CONCAT(int, DPR_WIDTH) intn;
typedef DPR_CONCAT(uint, DPR_WIDTH) uintn;
#define load_n(index, pointer) DPR_CONCAT(vload, DPR_WIDTH)(0, (pointer) + (index))
#define store_n(value, index, pointer) DPR_CONCAT(vstore, DPR_WIDTH)(value, 0, (pointer) + (index))
#define as_intn DPR_CONCAT(as_int, DPR_WIDTH)
#define as_realn DPR_CONCAT(as_float, DPR_WIDTH)
#define convert_intn DPR_CONCAT(convert_int, DPR_WIDTH)
#define convert_realn DPR_CONCAT(convert_float, DPR_WIDTH)
#define convert_uintn DPR_CONCAT(convert_uint, DPR_WIDTH)
static inline int any_lane4(int4 v) {
  const int2 a = v.lo | v.hi;
  return a.x | a.y;
}
static inline float sum_lanes8(float8 v) {
  const float4 a = v.lo + v.hi;
  const float2 b = a.lo + a.hi;
  return b.x + b.y;
}
#if DPR_WIDTH == 4
#define DPR_LANE_INDEX ((intn)(0, 1, 2, 3))
static inline float sum_lanes(float4 v) { return (v.x + v.z) + (v.y + v.w); }
static inline int any_lane(int4 condition) { return any_lane4(condition); }
#elif DPR_WIDTH == 8
#define DPR_LANE_INDEX ((intn)(0, 1, 2, 3, 4, 5, 6, 7))
static inline float sum_lanes(float8 v) { return sum_lanes8(v); }
static inline int any_lane(int8 condition) { return any_lane4(condition.lo | condition.hi); }
#else
#define DPR_LANE_INDEX ((intn)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
static inline float sum_lanes(float16 v) { return sum_lanes8(v.lo + v.hi); }
static inline int any_lane(int16 condition) {
  const int8 half_lanes = condition.lo | condition.hi;
  return any_lane4(half_lanes.lo | half_lanes.hi);
}
#endif

static inline float4 add_neighbours(float4 a, float4 b) {
  return (float4)(a.x, a.z, b.x, b.z) + (float4)(a.y, a.w, b.y, b.w);
}
/// The sums over the lanes of four vectors at once: the transpose costs less than four sums.
static inline float4 sum_lanes_of_4x4(float4 a, float4 b, float4 c, float4 d) {
  return add_neighbours(add_neighbours(a, b), add_neighbours(c, d));
}
#if DPR_WIDTH == 4
static inline float4 sum_lanes_of_4(float4 a, float4 b, float4 c, float4 d) {
  return sum_lanes_of_4x4(a, b, c, d);
}
#else
static inline float4 sum_lanes_of_4x8(float8 a, float8 b, float8 c, float8 d) {
  return sum_lanes_of_4x4(a.lo + a.hi, b.lo + b.hi, c.lo + c.hi, d.lo + d.hi);
}
#if DPR_WIDTH == 8
static inline float4 sum_lanes_of_4(float8 a, float8 b, float8 c, float8 d) {
  return sum_lanes_of_4x8(a, b, c, d);
}
#else
static inline float4 sum_lanes_of_4(float16 a, float16 b, float16 c, float16 d) {
  return sum_lanes_of_4x8(a.lo + a.hi, b.lo + b.hi, c.lo + c.hi, d.lo + d.hi);
}
#endif
#endif
#endif

/// a * b + c, which compilers fuse where the device can. PoCL's own mad() is a product and a sum: its library
/// is compiled without contraction.
#define mad(a, b, c) ((a) * (b) + (c))

static inline realn square(realn x) { return x * x; }

/// `a` where the comparison holds, else `b`: select() with its arguments in the order of the ?: operator.
static inline realn choose(intn condition, realn a, realn b) { return select(b, a, condition); }

/// min and max for infinities too, where OpenCL leaves its own undefined; b where a is not a number.
static inline realn lesser(realn a, realn b) { return choose(a < b, a, b); }
static inline realn greater(realn a, realn b) { return choose(a > b, a, b); }

#if DPR_WIDTH != 1
/// 1.5 * 2^23: added to a number below 2^22 in magnitude it leaves the nearest integer in the low bits.
/// PoCL's rint() and the conversion to int are a dozen instructions.
#define DPR_ROUNDING 12582912.0f

/// 2^round(x / ln 2) times a polynomial of the rest (least maximum error on |f| <= ln 2 / 2), for
/// -87 <= x <= 88.
static inline realn exp_in_range(realn x) {
  const realn shifted = mad(x, M_LOG2E_F, DPR_ROUNDING);
  const realn n = shifted - DPR_ROUNDING;
  // ln 2 in two parts, the first exact in few bits: n * ln 2 would lose the low bits of f.
  const realn f = mad(n, -1.42860677e-6f, mad(n, -0.693145752f, x));
  realn p = 0.00138368784f;
  p = mad(p, f, 0.00837481394f);
  p = mad(p, f, 0.0416682251f);
  p = mad(p, f, 0.166664198f);
  p = mad(p, f, 0.499999911f);
  p = mad(p, f, 1.0f);
  p = mad(p, f, 1.0f);
  return as_realn(as_intn(p) + (as_intn(shifted) << 23));  // p * 2^n: adds to the exponent
}
#endif

/// Natural exponential. Relative error below 2e-7 for -87 < x < 88, 0 below. On a vector CPU OpenCL's own
/// exp() is a library call a lane; a polynomial stays in the registers.
static inline realn exp_n(realn x) {
#if DPR_WIDTH == 1
  return exp(x);
#else
  return choose(x < -87.0f, (realn)(0.0f), exp_in_range(clamp(x, -87.0f, 88.0f)));
#endif
}

/// The same for x <= 0, and not below exp(-87) = 1.6e-38.
static inline realn exp_of_negative(realn x) {
#if DPR_WIDTH == 1
  return exp(greater(x, -87.0f));
#else
  return exp_in_range(greater(x, -87.0f));
#endif
}

/// Natural logarithm of a positive normal number. Absolute error below 1e-7 + 6e-8 |ln x|; a polynomial for
/// the same reason: ln(1 + f) = f - f^2 / 2 + f^3 P(f), the least maximum relative error on [sqrt(1/2) - 1,
/// sqrt(2) - 1].
static inline realn log_n(realn x) {
#if DPR_WIDTH == 1
  return log(x);
#else
  const intn bits = as_intn(x);
  const intn exponent = (bits - 0x3f3504f3) >> 23; /* of x / sqrt(1/2) */
  const realn f = as_realn(bits - (exponent << 23)) - 1.0f;
  realn p = 0.0870029986f;
  p = mad(p, f, -0.142672828f);
  p = mad(p, f, 0.149147247f);
  p = mad(p, f, -0.165776079f);
  p = mad(p, f, 0.1996307f);
  p = mad(p, f, -0.250013364f);
  p = mad(p, f, 0.333339106f);
  const realn f2 = f * f;
  return mad(convert_realn(exponent), M_LN2_F, mad(f2 * f, p, mad(f2, -0.5f, f)));
#endif
}

/// ln(1 + x) for x from -1 to 1 with the relative precision of small x: what rounding 1 + x takes away is
/// added to the logarithm. Exact there up to a factor of 1 + x, which counts only where x is no longer small.
static inline realn log1p_n(realn x) {
#if DPR_WIDTH == 1
  return log1p(x);
#else
  const realn sum = 1.0f + x;
  return log_n(sum) + (x - (sum - 1.0f));
#endif
}

#endif
