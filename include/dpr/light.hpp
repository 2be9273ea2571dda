// Lights and the shading model.
#pragma once

#include <glm/glm.hpp>
#include <vector>

namespace dpr {

/// Where lighting is evaluated: per face, per fragment with interpolated normals, or per vertex.
enum class Shading { flat, phong, gouraud };

/// A point light in world space, without attenuation.
struct PointLight {
  glm::vec3 position{0.0F};
  glm::vec3 diffuse{0.3F};
  glm::vec3 specular{0.2F};
};

/// colour = base * (ambient + sum_l diffuse_l max(n.l, 0)) + sum_l specular_l [n.l > 0] max(v.r,
/// 0)^shininess, r = 2 (n.l) n - l (Phong 1975). Normals follow the winding of the faces and are not turned
/// to the viewer.
struct Lights {
  glm::vec3 ambient{0.5F};
  std::vector<PointLight> point;
  float shininess = 64.0F;  ///< >= 1
  Shading shading = Shading::phong;
};

/// Throws InvalidArgument where a value is not finite or shininess is below 1.
void validate(const Lights& lights);

}  // namespace dpr
