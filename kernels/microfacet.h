// Reflection of rough surfaces, glTF 2.0, appendix B: GGX's distribution of facets (Walter et al., "Microfacet models
// for refraction through rough surfaces", 2007), masked as Smith has it with heights that correlate (Heitz,
// "Understanding the masking-shadowing function", 2014), and Schlick's Fresnel term (1994). On lanes.
#ifndef DPR_MICROFACET_H
#define DPR_MICROFACET_H

#include "vec3n.h"

/// Least alpha^2: the highlight of a mirror would be infinite.
#define DPR_LEAST_ALPHA2 1e-6f
/// Least n.v: a surface seen from behind reflects as one seen along.
#define DPR_LEAST_FACING 1e-4f
/// Least sum of Smith's two terms, which keeps the quotient finite.
#define DPR_LEAST_MASKING 1e-6f

/// A light's reflection at a point, with its derivatives; those of clamped cosines are 0.
typedef struct {
  realn lobe;                       // pi D V max(n.l, 0)
  realn by_light, by_eye, by_half;  // d lobe / d n.l, n.v and n.h
  realn by_shininess;               // d lobe / d shininess
  realn grazing, by_both;           // p = (1 - v.h)^5, and d p / d v.h
} Facets;

/// `lambert` is max(n.l, 0), `half_cosine` n.h; alpha^2 = 2 / (shininess + 1).
static inline Facets find_facets(realn lambert, Vec3n normal, realn half_cosine, Vec3n to_eye, Vec3n halfway,
                                 float shininess) {
  const float own_alpha2 = 2.0f / (shininess + 1.0f), alpha2 = max(own_alpha2, DPR_LEAST_ALPHA2),
              rest = 1.0f - alpha2;
  const realn eye = dot3n(normal, to_eye);
  // sin^2 + alpha^2 cos^2, the sine of a difference of vectors: 1 - cos^2 loses the digits of small angles.
  const Vec3n across = mad3n(normal, -half_cosine, halfway);
  const realn spread =
      choose(half_cosine > 0.0f, mad(square(half_cosine), alpha2, dot3n(across, across)), (realn)(1.0f));
  const realn facing = max(eye, DPR_LEAST_FACING);
  const realn of_eye = sqrt(mad(square(facing), rest, (realn)(alpha2))),
              of_light = sqrt(mad(square(lambert), rest, (realn)(alpha2)));
  const realn masking = lambert * of_eye + facing * of_light;
  const realn inverse = choose(masking > DPR_LEAST_MASKING, 1.0f / masking, (realn)(0.0f));
  const realn ratio = 0.5f * alpha2 / (square(spread) * max(masking, DPR_LEAST_MASKING));
  Facets f;
  f.lobe = lambert * ratio;
  f.by_light = choose(lambert > 0.0f,
                      ratio * (1.0f - lambert * inverse * (of_eye + facing * lambert * rest / of_light)),
                      (realn)(0.0f));
  f.by_eye = choose(eye > DPR_LEAST_FACING, -f.lobe * inverse * (of_light + lambert * facing * rest / of_eye),
                    (realn)(0.0f));
  f.by_half = choose(half_cosine > 0.0f, 4.0f * f.lobe * half_cosine * rest / spread, (realn)(0.0f));
  const realn by_masking =
      0.5f * inverse *
      (lambert * (1.0f - square(facing)) / of_eye + facing * (1.0f - square(lambert)) / of_light);
  const realn by_spread = choose(half_cosine > 0.0f, 2.0f * square(half_cosine) / spread, (realn)(0.0f));
  const float slope =
      own_alpha2 > DPR_LEAST_ALPHA2 ? -0.5f * alpha2 * alpha2 : 0.0f;  // d alpha^2 / d shininess
  f.by_shininess = slope * f.lobe * (1.0f / alpha2 - by_spread - by_masking);
  const realn away = clamp(1.0f - dot3n(to_eye, halfway), 0.0f, 1.0f), away4 = square(square(away));
  f.grazing = away4 * away;
  f.by_both = choose(away < 1.0f, -5.0f * away4, (realn)(0.0f));
  return f;
}

#endif
