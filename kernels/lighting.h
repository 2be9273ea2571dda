// The light that reaches a surface point: Phong, "Illumination for computer generated pictures" (1975);
// Blinn, "Models of light reflection for computer synthesized pictures" (1977); microfacet.h; Ramamoorthi and
// Hanrahan, "An efficient representation for irradiance environment maps" (2001). On lanes. DPR_SHADING says which
// highlight, and DPR_LIGHTS what kinds of lights there are beyond points.
#ifndef DPR_LIGHTING_H
#define DPR_LIGHTING_H

#include "harmonics.h"
#include "shared_types.h"

#ifndef DPR_SHADING
#define DPR_SHADING DPR_PHONG
#endif
#ifndef DPR_LIGHTS
#define DPR_LIGHTS 0
#endif

/// Whether the highlight is about the direction halfway between light and eye, not about the mirrored light.
#if DPR_SHADING == DPR_MICROFACET
#include "microfacet.h"
#define DPR_HALFWAY 1
#else
#define DPR_HALFWAY (DPR_SHADING == DPR_BLINN)
#endif

/// What goes before a view's lights.
static inline global const Environment* environment_of(global const Light* lights) {
  return (global const Environment*)(lights - DPR_ENVIRONMENT_ROWS);
}

/// Least base of the highlight, which keeps the logarithm finite.
#define DPR_LEAST_BASE 1e-30f

/// One light at a point: everything that value and gradient share.
typedef struct {
  Vec3n to_light, to_eye;
  Vec3n mirror;                                       // reflected light; or halfway between light and eye
  realn inverse_light, inverse_eye, inverse_halfway;  // 1 / length
  realn lambert;                                      // max(n.l, 0)
#if DPR_SHADING == DPR_MICROFACET
  Facets facets;
#else
  realn base, highlight;  // max(v.r, 0) or max(n.h, 0), and its power; 0 on the side away from the light
  realn log_base;         // of the base, or of DPR_LEAST_BASE if that is more
#endif
  realn edge, cone;  // where in the cone's edge, 0 outside to 1 inside, and what comes through
} LightTerm;

/// `material` as Surface has it.
static inline LightTerm light_term(Vec3n position, Vec3n normal, float4 eye, global const Light* light,
                                   float4 material) {
  LightTerm t;
  t.to_light = (DPR_LIGHTS & DPR_LIGHTS_DISTANT)
                   ? mad3n(position, (realn)(-light->position.w), splat3(light->position))
                   : sub3n(splat3(light->position), position);
  t.inverse_light = normalize3n(&t.to_light);
  t.to_eye = mad3n(position, (realn)(-eye.w), splat3(eye));
  t.inverse_eye = normalize3n(&t.to_eye);
  const realn cosine = dot3n(normal, t.to_light);
  realn towards;
  if (DPR_HALFWAY) {
    t.mirror = mad3n(t.to_light, (realn)(1.0f), t.to_eye);
    t.inverse_halfway = normalize3n(&t.mirror);
    towards = dot3n(normal, t.mirror);
  } else {
    t.mirror = sub3n(scale3n(normal, 2.0f * cosine), t.to_light);
    towards = dot3n(t.to_eye, t.mirror);
  }
  t.lambert = max(cosine, 0.0f);
#if DPR_SHADING == DPR_MICROFACET
  t.facets = find_facets(t.lambert, normal, towards, t.to_eye, t.mirror, material.w);
#else
  t.base = choose(cosine > 0.0f, max(towards, 0.0f), (realn)(0.0f));
  t.log_base = log(max(t.base, DPR_LEAST_BASE));
  t.highlight = choose(t.base > 0.0f, exp(material.w * t.log_base), (realn)(0.0f));
#endif
  if (DPR_LIGHTS & DPR_LIGHTS_CONES) {
    const realn along = -dot3n(splat3(light->axis), t.to_light);
    t.edge = clamp((along - light->cos_outer) * light->inverse_edge, 0.0f, 1.0f);
    t.cone = square(t.edge) * mad(t.edge, -2.0f, 3.0f);  // smoothstep
  }
  return t;
}

/// Part of `v` that comes through the light's cone.
static inline realn through_cone(const LightTerm t, realn v) {
  return (DPR_LIGHTS & DPR_LIGHTS_CONES) ? v * t.cone : v;
}

/// The light at a point, RGB: colour = base * factor + coefficient_of(material) * specular.
typedef struct {
  Vec3n factor;        // ambient + environment + sum diffuse * lambert (microfacet: * (1 - F))
  Vec3n specular;      // sum specular * highlight (microfacet: * F)
  Vec3n by_shininess;  // d specular / d shininess
#if DPR_SHADING == DPR_MICROFACET
  Vec3n factor_by_straight, specular_by_straight;  // derivatives with respect to F0, channel by channel
#endif
} Lit;

/// Factor of `specular`: microfacet shading has the material's coefficient, F0, within.
static inline float4 coefficient_of(float4 material) {
  return DPR_SHADING == DPR_MICROFACET ? (float4)(1.0f) : material;
}

#if DPR_SHADING == DPR_MICROFACET
/// F = F0 + (1 - F0) p, channel by channel.
static inline Vec3n fresnel(Vec3n straight, realn grazing) {
  return mad3n(straight, 1.0f - grazing, make_vec3n(grazing, grazing, grazing));
}

static inline void add_reflection(const LightTerm t, global const Light* light, float4 material, Lit* lit) {
  const Facets f = t.facets;
  const Vec3n specular = splat3(light->specular), reflected = fresnel(splat3(material), f.grazing),
              gloss = mul3n(specular, reflected);
  const realn lobe = through_cone(t, f.lobe), past = 1.0f - f.grazing;
  const Vec3n scattered = scale3n(splat3(light->diffuse), through_cone(t, t.lambert) * past);
  lit->factor = mad3n(mul3n(scattered, splat3(1.0f - material)), (realn)(1.0f), lit->factor);
  lit->specular = mad3n(gloss, lobe, lit->specular);
  lit->by_shininess = mad3n(gloss, through_cone(t, f.by_shininess), lit->by_shininess);
  lit->factor_by_straight = sub3n(lit->factor_by_straight, scattered);
  lit->specular_by_straight = mad3n(specular, lobe * past, lit->specular_by_straight);
}
#endif

static inline Lit light_point(const LightingParams lp, global const Light* restrict lights, float4 material,
                              Vec3n position, Vec3n normal, float4 eye) {
  global const Environment* const around = environment_of(lights);
  Lit lit;
  lit.factor = splat3(around->ambient);
  lit.specular = lit.by_shininess = zero3n();
#if DPR_SHADING == DPR_MICROFACET
  lit.factor_by_straight = lit.specular_by_straight = zero3n();
#endif
  if (DPR_LIGHTS & DPR_LIGHTS_HARMONICS) {
    realn basis[DPR_HARMONICS];
    harmonic_basis(normal, basis);
#pragma unroll
    for (int k = 0; k < DPR_HARMONICS; ++k)
      lit.factor = mad3n(splat3(around->harmonics[k]), basis[k], lit.factor);
  }
  for (uint l = 0; l < lp.lights; ++l) {
    const LightTerm t = light_term(position, normal, eye, lights + l, material);
#if DPR_SHADING == DPR_MICROFACET
    add_reflection(t, lights + l, material, &lit);
#else
    const realn highlight = through_cone(t, t.highlight);
    lit.factor = mad3n(splat3(lights[l].diffuse), through_cone(t, t.lambert), lit.factor);
    lit.specular = mad3n(splat3(lights[l].specular), highlight, lit.specular);
    lit.by_shininess = mad3n(splat3(lights[l].specular), highlight * t.log_base, lit.by_shininess);
#endif
  }
  return lit;
}

/// Gradients of a point in the light.
typedef struct {
  Vec3n position, normal, eye;  // of the unit normal
} PointGradient;

/// Gradients of what is known of a light: of the unit axis.
typedef struct {
  Vec3n position, diffuse, specular, axis;
  realn cos_inner, cos_outer;
} LightGradient;

/// Adds those through a light's cone, and returns what reaches the direction to the light.
static inline Vec3n cone_backward(const LightTerm t, global const Light* light, realn grad_cone,
                                  LightGradient* g) {
  const realn grad_edge = grad_cone * 6.0f * t.edge * (1.0f - t.edge);  // smoothstep's slope
  const realn grad_along = grad_edge * light->inverse_edge;
  g->cos_inner -= grad_along * t.edge;
  g->cos_outer -= grad_along * (1.0f - t.edge);
  g->axis = mad3n(t.to_light, -grad_along, g->axis);
  return scale3n(splat3(light->axis), -grad_along);
}

/// Gradients of the directions to the light and to the eye, and of what comes through the cone; those of the normal
/// and of the light's colours are added.
typedef struct {
  Vec3n to_light, to_eye;
  realn cone;
} WayGradient;

#if DPR_SHADING == DPR_MICROFACET
static inline WayGradient ways_backward(const LightTerm t, global const Light* light, float4 material,
                                        Vec3n normal, Vec3n grad_factor, Vec3n grad_specular,
                                        Vec3n* grad_normal, LightGradient* g) {
  const Facets f = t.facets;
  const realn past = 1.0f - f.grazing;
  const Vec3n grad_scattered = mul3n(grad_factor, splat3(1.0f - material)),
              grad_reflected = mul3n(grad_specular, splat3(light->specular));
  const realn by_scattered = dot3n(grad_scattered, splat3(light->diffuse)),
              by_straight = dot3n(grad_reflected, splat3(material)),
              by_grazing = grad_reflected.x + grad_reflected.y + grad_reflected.z;
  const realn by_lobe = by_straight * past + by_grazing * f.grazing;
  const realn grad_lobe = through_cone(t, by_lobe);
  const realn grad_cosine =
      grad_lobe * f.by_light + choose(t.lambert > 0.0f, through_cone(t, by_scattered * past), (realn)(0.0f));
  const realn grad_facing = grad_lobe * f.by_eye, grad_half = grad_lobe * f.by_half;
  const realn grad_both =
      through_cone(t, f.lobe * (by_grazing - by_straight) - by_scattered * t.lambert) * f.by_both;
  const Vec3n both_move = normalize3n_backward(t.mirror, t.inverse_halfway,
                                               mad3n(t.to_eye, grad_both, scale3n(normal, grad_half)));
  WayGradient ways;
  ways.to_light = mad3n(normal, grad_cosine, both_move);
  ways.to_eye = mad3n(t.mirror, grad_both, mad3n(normal, grad_facing, both_move));
  ways.cone = by_scattered * t.lambert * past + by_lobe * f.lobe;
  *grad_normal =
      mad3n(t.mirror, grad_half, mad3n(t.to_eye, grad_facing, mad3n(t.to_light, grad_cosine, *grad_normal)));
  g->diffuse = mad3n(grad_scattered, through_cone(t, t.lambert * past), g->diffuse);
  g->specular =
      mad3n(mul3n(grad_specular, fresnel(splat3(material), f.grazing)), through_cone(t, f.lobe), g->specular);
  return ways;
}
#else
static inline WayGradient ways_backward(const LightTerm t, global const Light* light, float4 material,
                                        Vec3n normal, Vec3n grad_factor, Vec3n grad_specular,
                                        Vec3n* grad_normal, LightGradient* g) {
  const realn cosine = t.lambert;
  const realn by_diffuse = dot3n(grad_factor, splat3(light->diffuse)),
              by_specular = dot3n(grad_specular, splat3(light->specular));
  const realn grad_highlight = through_cone(t, by_specular);
  const realn grad_base = choose(
      t.base > 0.0f, grad_highlight * material.w * t.highlight / max(t.base, DPR_LEAST_BASE), (realn)(0.0f));
  realn grad_cosine = choose(cosine > 0.0f, through_cone(t, by_diffuse), (realn)(0.0f));
  WayGradient ways;
  if (DPR_SHADING == DPR_BLINN) {
    ways.to_eye = normalize3n_backward(t.mirror, t.inverse_halfway, scale3n(normal, grad_base));
    ways.to_light = mad3n(normal, grad_cosine, ways.to_eye);
    *grad_normal = mad3n(t.mirror, grad_base, mad3n(t.to_light, grad_cosine, *grad_normal));
  } else {
    const Vec3n grad_mirror = scale3n(t.to_eye, grad_base);
    grad_cosine += 2.0f * dot3n(grad_mirror, normal);
    ways.to_eye = scale3n(t.mirror, grad_base);
    ways.to_light = sub3n(scale3n(normal, grad_cosine), grad_mirror);
    *grad_normal = mad3n(grad_mirror, 2.0f * cosine, mad3n(t.to_light, grad_cosine, *grad_normal));
  }
  ways.cone = by_diffuse * t.lambert + by_specular * t.highlight;
  g->diffuse = mad3n(grad_factor, through_cone(t, t.lambert), g->diffuse);
  g->specular = mad3n(grad_specular, through_cone(t, t.highlight), g->specular);
  return ways;
}
#endif

/// Gradients of one light's terms: adds to those of the point and of the light.
static inline void light_term_backward(const LightTerm t, float4 eye, global const Light* light,
                                       float4 material, Vec3n normal, Vec3n grad_factor, Vec3n grad_specular,
                                       PointGradient* point, LightGradient* g) {
  WayGradient ways = ways_backward(t, light, material, normal, grad_factor, grad_specular, &point->normal, g);
  if (DPR_LIGHTS & DPR_LIGHTS_CONES)
    ways.to_light = mad3n(cone_backward(t, light, ways.cone, g), (realn)(1.0f), ways.to_light);
  const Vec3n light_moves = normalize3n_backward(t.to_light, t.inverse_light, ways.to_light);
  const Vec3n eye_moves = normalize3n_backward(t.to_eye, t.inverse_eye, ways.to_eye);
  g->position = mad3n(light_moves, (realn)(1.0f), g->position);
  point->eye = mad3n(eye_moves, (realn)(1.0f), point->eye);
  point->position = (DPR_LIGHTS & DPR_LIGHTS_DISTANT)
                        ? mad3n(light_moves, (realn)(-light->position.w), point->position)
                        : sub3n(point->position, light_moves);
  point->position = mad3n(eye_moves, (realn)(-eye.w), point->position);
}

static inline LightGradient zero_light_gradient(void) {
  LightGradient g;
  g.position = g.diffuse = g.specular = g.axis = zero3n();
  g.cos_inner = g.cos_outer = 0.0f;
  return g;
}

static inline PointGradient zero_point_gradient(void) {
  PointGradient g;
  g.position = g.normal = g.eye = zero3n();
  return g;
}

/// Adds the gradients through the environment at a point.
static inline void harmonics_backward(global const Environment* around, Vec3n normal, Vec3n grad_factor,
                                      PointGradient* point) {
  realn grad_basis[DPR_HARMONICS];
#pragma unroll
  for (int k = 0; k < DPR_HARMONICS; ++k) grad_basis[k] = dot3n(grad_factor, splat3(around->harmonics[k]));
  point->normal = mad3n(harmonic_basis_backward(normal, grad_basis), (realn)(1.0f), point->normal);
}

/// Adds the gradients through the light at a point.
static inline void light_point_backward(const LightingParams lp, global const Light* restrict lights,
                                        float4 material, float4 eye, Vec3n position, Vec3n normal,
                                        Vec3n grad_factor, Vec3n grad_specular, PointGradient* point) {
  if (DPR_LIGHTS & DPR_LIGHTS_HARMONICS)
    harmonics_backward(environment_of(lights), normal, grad_factor, point);
  LightGradient unused = zero_light_gradient();
  for (uint l = 0; l < lp.lights; ++l) {
    const LightTerm t = light_term(position, normal, eye, lights + l, material);
    light_term_backward(t, eye, lights + l, material, normal, grad_factor, grad_specular, point, &unused);
  }
}

/// Adds the gradients of a light at a point.
static inline void add_light_gradient(global const Light* light, float4 material, float4 eye, Vec3n position,
                                      Vec3n normal, Vec3n grad_factor, Vec3n grad_specular,
                                      LightGradient* g) {
  const LightTerm t = light_term(position, normal, eye, light, material);
  PointGradient unused = zero_point_gradient();
  light_term_backward(t, eye, light, material, normal, grad_factor, grad_specular, &unused, g);
}

/// Adds the gradients of the harmonics at a normal.
static inline void add_harmonics_gradient(Vec3n normal, Vec3n grad_factor, Vec3n grad[DPR_HARMONICS]) {
  realn basis[DPR_HARMONICS];
  harmonic_basis(normal, basis);
#pragma unroll
  for (int k = 0; k < DPR_HARMONICS; ++k) grad[k] = mad3n(grad_factor, basis[k], grad[k]);
}

#endif
