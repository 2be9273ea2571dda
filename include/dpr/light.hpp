// Lights and the shading model, and the lights' gradients.
#pragma once

#include <cstddef>
#include <vector>

#include "dpr/export.h"
#include "dpr/vectors.hpp"

namespace dpr {

/// Evaluation of lighting: per face, per fragment with interpolated normals, or per vertex; blinn is as
/// phong, with Blinn's highlight, and microfacet as phong, with glTF's reflection.
enum class Shading { flat, phong, gouraud, blinn, microfacet };

/// A point light in world space, without attenuation.
struct PointLight {
  vec3 position{0.0F};
  vec3 diffuse{0.3F};
  vec3 specular{0.2F};
};

/// A light infinitely far away.
struct DirectionalLight {
  vec3 direction{0.0F, -1.0F, 0.0F};  ///< world space, away from the light; its length does not matter
  vec3 diffuse{0.3F};
  vec3 specular{0.2F};
};

/// A point light within a cone: times smoothstep((c - c_outer) / (c_inner - c_outer)), smoothstep(t) = t^2 (3
/// - 2 t) for t clamped to [0, 1]; c is the cosine of the angle between the direction and the way to the
/// point, c_inner and c_outer those of the angles.
struct SpotLight {
  vec3 position{0.0F};
  vec3 direction{0.0F, -1.0F, 0.0F};  ///< world space, away from the light; its length does not matter
  float angle_degrees = 30.0F;        ///< from the axis to where the light ends; at most 180
  float inner_angle_degrees = 0.0F;   ///< to where it begins to fade; at least 0.1 less
  vec3 diffuse{0.3F};
  vec3 specular{0.2F};
};

/// Coefficients of an environment's spherical harmonics, up to the second order.
inline constexpr std::size_t k_harmonics = 9;

/// colour = base * (ambient + environment + sum_l a_l diffuse_l max(n.l, 0)) + sum_l a_l specular_l [n.l > 0]
/// max(m, 0)^shininess; a_l is 1 but in a spot's cone; m = v.r, r = 2 (n.l) n - l (Phong 1975), or of blinn
/// n.h, h = (l + v) / |l + v| (Blinn 1977). Materials (dpr/mesh.hpp) multiply the highlights and may have an
/// exponent of their own. Normals follow the winding of the faces, unless the mesh gives some, and are not
/// turned to the viewer.
///
/// microfacet is the reflection of glTF 2.0, appendix B: Lambert, GGX's distribution D, Smith's masking V, Schlick's
/// Fresnel term F = F0 + (1 - F0) (1 - v.h)^5. colour = base * (ambient + environment + sum_l a_l diffuse_l max(n.l, 0)
/// (1 - F)) + sum_l a_l specular_l pi D V max(n.l, 0) F. F0, the reflectance at normal incidence, is the material's
/// specular: 1 without materials, a white metal, on which lights have no diffuse part. D and V have alpha^2 = 2 /
/// (shininess + 1), at least 1e-6; the least shininess, 1, is glTF's roughness 1. A light's diffuse and specular are
/// its irradiance over pi. metallic_roughness() (dpr/mesh.hpp) makes colours and materials. A surface seen from behind
/// reflects as one seen edge-on, and such reflection begins steeply at n.l = 0. What is all around, ambient and
/// environment, reaches the base alone: a smooth metal, whose base is dark, shows its lights and little else.
///
/// The environment is distant light of radiance sum L_lm Y_lm(w) from the direction w, and what a white
/// diffuse surface reflects of it (Ramamoorthi and Hanrahan 2001): sum a_l L_lm Y_lm(n), a = 1, 2/3, 1/4,
/// which is the irradiance over pi, not clamped. Y_lm is the real orthonormal basis in world axes: Y_00 = 1/2
/// sqrt(1/pi); Y_1m = sqrt(3/(4 pi)) (y, z, x); Y_2m = 1/2 sqrt(15/pi) (x y, y z, (2 z^2 - x^2 - y^2) /
/// sqrt(12), x z, (x^2 - y^2) / 2), m from -l to l. Light of radiance 1 from everywhere is L_00 = sqrt(4 pi).
struct Lights {
  vec3 ambient{0.5F};
  std::vector<PointLight> point;
  float shininess = 64.0F;  ///< >= 1
  Shading shading = Shading::phong;
  std::vector<DirectionalLight> directional{};
  std::vector<SpotLight> spot{};
  std::vector<vec3> harmonics{};  ///< [k_harmonics] RGB of L_lm by l, then m from -l to l; or empty
};

struct PointLightGradient {
  dvec3 position{0.0}, diffuse{0.0}, specular{0.0};
};

struct DirectionalLightGradient {
  dvec3 direction{0.0}, diffuse{0.0}, specular{0.0};
};

struct SpotLightGradient {
  dvec3 position{0.0}, direction{0.0};
  double angle_degrees = 0, inner_angle_degrees = 0;
  dvec3 diffuse{0.0}, specular{0.0};
};

/// Throws InvalidArgument where a value is not finite, a direction has no length, a cone no edge, or
/// shininess is below 1.
DPR_API void validate(const Lights& lights);

}  // namespace dpr
