// The light that reaches a surface point: Phong, "Illumination for computer generated pictures" (1975). On
// lanes.
#ifndef DPR_LIGHTING_H
#define DPR_LIGHTING_H

#include "lanes.h"
#include "shared_types.h"

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

/// One light at a point: everything that value and gradient share.
typedef struct {
  Vec3n to_light, to_eye, reflected;
  realn inverse_light, inverse_eye;  // 1 / distance
  realn lambert;                     // max(n.l, 0)
  realn base, highlight;             // max(v.r, 0), and its power; 0 on the side away from the light
} LightTerm;

static inline LightTerm light_term(Vec3n position, Vec3n normal, float4 eye, float4 light, float shininess) {
  LightTerm t;
  t.to_light = sub3n(splat3(light), position);
  t.inverse_light = normalize3n(&t.to_light);
  t.to_eye = sub3n(splat3(eye), position);
  t.inverse_eye = normalize3n(&t.to_eye);
  const realn cosine = dot3n(normal, t.to_light);
  t.reflected = sub3n(scale3n(normal, 2.0f * cosine), t.to_light);
  t.lambert = max(cosine, 0.0f);
  t.base = choose(cosine > 0.0f, max(dot3n(t.to_eye, t.reflected), 0.0f), (realn)(0.0f));
  t.highlight = choose(t.base > 0.0f, exp(shininess * log(max(t.base, 1e-30f))), (realn)(0.0f));
  return t;
}

/// factor = ambient + sum diffuse * lambert, specular = sum specular * highlight, RGB each.
static inline void light_point(const LightingParams lp, global const Light* restrict lights, Vec3n position,
                               Vec3n normal, float4 eye, Vec3n* factor, Vec3n* specular) {
  *factor = splat3(lp.ambient);
  *specular = zero3n();
  for (uint l = 0; l < lp.lights; ++l) {
    const LightTerm t = light_term(position, normal, eye, lights[l].position, lp.shininess);
    *factor = mad3n(splat3(lights[l].diffuse), t.lambert, *factor);
    *specular = mad3n(splat3(lights[l].specular), t.highlight, *specular);
  }
}

/// Gradients of one light's terms: adds to those of the point, the unit normal, the eye and the light's
/// position.
static inline void light_term_backward(const LightTerm t, const Light light, float shininess, Vec3n normal,
                                       Vec3n grad_factor, Vec3n grad_specular, Vec3n* grad_position,
                                       Vec3n* grad_normal, Vec3n* grad_eye, Vec3n* grad_light) {
  const realn cosine = t.lambert;
  const realn grad_highlight = dot3n(grad_specular, splat3(light.specular));
  const realn grad_base =
      choose(t.base > 0.0f, grad_highlight * shininess * t.highlight / max(t.base, 1e-30f), (realn)(0.0f));
  const Vec3n grad_reflected = scale3n(t.to_eye, grad_base);
  const realn grad_cosine = choose(cosine > 0.0f, dot3n(grad_factor, splat3(light.diffuse)), (realn)(0.0f)) +
                            2.0f * dot3n(grad_reflected, normal);
  *grad_normal = mad3n(grad_reflected, 2.0f * cosine, mad3n(t.to_light, grad_cosine, *grad_normal));

  const Vec3n grad_to_light = sub3n(scale3n(normal, grad_cosine), grad_reflected);
  const Vec3n light_moves = normalize3n_backward(t.to_light, t.inverse_light, grad_to_light);
  const Vec3n eye_moves = normalize3n_backward(t.to_eye, t.inverse_eye, scale3n(t.reflected, grad_base));
  *grad_light = mad3n(light_moves, (realn)(1.0f), *grad_light);
  *grad_eye = mad3n(eye_moves, (realn)(1.0f), *grad_eye);
  *grad_position = sub3n(sub3n(*grad_position, light_moves), eye_moves);
}

#endif
