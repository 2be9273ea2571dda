// Vectors of three in each lane.
#ifndef DPR_VEC3N_H
#define DPR_VEC3N_H

#include "lanes.h"

/// Vectors whose length is below this have no direction and give no gradient, world units.
#define DPR_MIN_LENGTH 1e-20f

/// A vector of three in each lane.
typedef struct {
  realn x, y, z;
} Vec3n;

static inline Vec3n make_vec3n(realn x, realn y, realn z) {
  Vec3n v;
  v.x = x;
  v.y = y;
  v.z = z;
  return v;
}
static inline Vec3n splat3(float4 v) { return make_vec3n((realn)(v.x), (realn)(v.y), (realn)(v.z)); }
static inline Vec3n zero3n(void) { return make_vec3n(0.0f, 0.0f, 0.0f); }
static inline realn dot3n(Vec3n a, Vec3n b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline Vec3n sub3n(Vec3n a, Vec3n b) { return make_vec3n(a.x - b.x, a.y - b.y, a.z - b.z); }
static inline Vec3n mul3n(Vec3n a, Vec3n b) { return make_vec3n(a.x * b.x, a.y * b.y, a.z * b.z); }
static inline Vec3n scale3n(Vec3n a, realn s) { return make_vec3n(a.x * s, a.y * s, a.z * s); }
static inline realn channel_of(Vec3n v, uint channel) {
  return channel == 0 ? v.x : channel == 1 ? v.y : v.z;
}
/// a + b * s
static inline Vec3n mad3n(Vec3n b, realn s, Vec3n a) {
  return make_vec3n(mad(b.x, s, a.x), mad(b.y, s, a.y), mad(b.z, s, a.z));
}

/// Normalises, and returns 1 / length: 0 where there is no direction.
static inline realn normalize3n(Vec3n* v) {
  const realn length2 = dot3n(*v, *v);
  const realn inverse = choose(length2 > square((realn)(DPR_MIN_LENGTH)), rsqrt(length2), (realn)(0.0f));
  *v = scale3n(*v, inverse);
  return inverse;
}

/// The gradient of v from that of v / |v|.
static inline Vec3n normalize3n_backward(Vec3n unit, realn inverse_length, Vec3n grad) {
  return scale3n(mad3n(unit, -dot3n(unit, grad), grad), inverse_length);
}

#endif
