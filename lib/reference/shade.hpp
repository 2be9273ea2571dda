/// Reference for the shade stage: interpolated colours and lighting (lighting.hpp), evaluated per face
/// normal, per fragment or per vertex.
#pragma once

#include "lighting.hpp"
#include "rasterize.hpp"
#include "texture.hpp"
#include "vec.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

namespace dpr::reference {

/// Gradients of the shading of a whole mesh or scene, accumulated over fragments.
struct ShadeGradient {
  std::vector<Vec3d> world;              ///< world positions of the vertices
  std::vector<Vec3d> face_normals;       ///< unit normals, flat
  std::vector<Vec3d> vertex_normals;     ///< unit normals, but in flat shading
  std::vector<LightTerms> vertex_light;  ///< gouraud
  Vec3d camera;
  Lights lights = zero_like({});  ///< every number but shininess
};

/// Factor of the highlights (microfacet: F0), and their exponent if it is above 0.
struct Material {
  Vec3d specular{1.0, 1.0, 1.0};
  double shininess = 0.0;
};

/// A face's material, and the world-space unit normals of its corners if the mesh gives normals. Their gradients, and
/// of lights' specular under materials but in microfacet shading, are compared with finite differences instead.
struct FaceLook {
  Material material;
  std::optional<std::array<Vec3d, 3>> normals;
};

/// World-space geometry and what the lighting prepares once for all pixels. Without lights only colours are
/// interpolated.
struct ShadeScene {
  std::vector<Vec3d> world;
  std::vector<Face> faces;
  std::optional<Lights> lights;
  Vec3d camera;                          ///< world position of the camera
  std::vector<Vec3d> face_areas;         ///< cross(v1 - v0, v2 - v0)
  std::vector<Vec3d> vertex_areas;       ///< sums of face_areas over the faces of a vertex
  std::vector<LightTerms> vertex_light;  ///< gouraud
  std::vector<FaceLook> looks{};         ///< of every face; empty: none has anything of its own
};

inline ShadeScene shade_prepare(std::vector<Vec3d> world, std::vector<Face> faces,
                                std::optional<Lights> lights, const Vec3d& camera) {
  ShadeScene scene{std::move(world), std::move(faces), std::move(lights), camera, {}, {}, {}};
  if (!scene.lights) return scene;
  scene.vertex_areas.resize(scene.world.size());
  for (const Face& face : scene.faces) {
    const Vec3d& origin = scene.world[face[0]];
    scene.face_areas.push_back(cross(scene.world[face[1]] - origin, scene.world[face[2]] - origin));
    for (std::size_t vertex : face) scene.vertex_areas[vertex] += scene.face_areas.back();
  }
  if (scene.lights->shading == Shading::gouraud) {
    for (std::size_t i = 0; i < scene.world.size(); ++i) {
      scene.vertex_light.push_back(
          light_terms(*scene.lights, camera, scene.world[i], unit(scene.vertex_areas[i])));
    }
  }
  return scene;
}

/// Colours at the three corners of a triangle: three times the same for face colours.
using CornerColors = std::array<Vec3d, 3>;

/// Base colour of a triangle: its corners' colours times a texture.
struct BaseColor {
  BaseColor(const CornerColors& corners_) : corners(corners_) {}

  CornerColors corners;
  const Texture* texture = nullptr;
  std::array<Vec2d, 3> texcoords;

  // The triangle and the pixel's size, by which trilinear filtering finds its level.
  NdcTriangle triangle;
  double pixel = 0.0;  ///< NDC
  bool perspective_correct = true;
};

inline Vec2d texcoord_at(const BaseColor& base, const Vec3d& c) {
  return c.x * base.texcoords[0] + c.y * base.texcoords[1] + c.z * base.texcoords[2];
}

template <class Values>
Vec3d interpolate(const Vec3d& barycentric, const Values& at_corner) {
  return barycentric.x * at_corner(0) + barycentric.y * at_corner(1) + barycentric.z * at_corner(2);
}

inline Vec3d fragment_position(const ShadeScene& scene, const Face& face, const Vec3d& c) {
  return interpolate(c, [&](std::size_t i) { return scene.world[face[i]]; });
}

inline Vec3d corner_normal(const ShadeScene& scene, std::size_t face, std::size_t i) {
  if (!scene.looks.empty() && scene.looks[face].normals) return (*scene.looks[face].normals)[i];
  return unit(scene.vertex_areas[scene.faces[face][i]]);
}

/// Sum of the unit normals of the corners weighted with c_i, before normalisation.
inline Vec3d fragment_normal_sum(const ShadeScene& scene, std::size_t face, const Vec3d& c) {
  return interpolate(c, [&](std::size_t i) { return corner_normal(scene, face, i); });
}

/// The lights as a face's material shows them.
inline Lights face_lights(const ShadeScene& scene, std::size_t face) {
  Lights lights = *scene.lights;
  if (scene.looks.empty()) return lights;
  const Material& material = scene.looks[face].material;
  const auto apply = [&](auto& list) {
    for (auto& light : list) light.specular = light.specular * material.specular;
  };
  if (lights.shading == Shading::microfacet) {
    lights.reflectance = material.specular;
  } else {
    apply(lights.point);
    apply(lights.directional);
    apply(lights.spot);
  }
  if (material.shininess > 0.0) lights.shininess = material.shininess;
  return lights;
}

/// gouraud
inline LightTerms corner_light(const ShadeScene& scene, std::size_t face, std::size_t i) {
  const std::size_t vertex = scene.faces[face][i];
  if (scene.looks.empty()) return scene.vertex_light[vertex];
  return light_terms(face_lights(scene, face), scene.camera, scene.world[vertex],
                     corner_normal(scene, face, i));
}

inline LightTerms fragment_light(const ShadeScene& scene, std::size_t face_index, const Vec3d& c) {
  const Face& face = scene.faces[face_index];
  if (scene.lights->shading == Shading::gouraud) {
    return {interpolate(c, [&](std::size_t i) { return corner_light(scene, face_index, i).factor; }),
            interpolate(c, [&](std::size_t i) { return corner_light(scene, face_index, i).specular; })};
  }
  const Vec3d normal = scene.lights->shading == Shading::flat
                           ? unit(scene.face_areas[face_index])
                           : unit(fragment_normal_sum(scene, face_index, c));
  return light_terms(face_lights(scene, face_index), scene.camera, fragment_position(scene, face, c), normal);
}

/// Texture coordinates at a point of the screen, also outside of the triangle.
inline Vec2d texcoord_on_screen(const BaseColor& base, const Vec2d& point) {
  RasterizeParameters p;
  p.perspective_correct = base.perspective_correct;
  const Vec3d n = barycentric_numerators(base.triangle, screen_barycentric(base.triangle, point), p).n;
  return texcoord_at(base, (1.0 / (n.x + n.y + n.z)) * n);
}

/// Logarithm to base 2 of the texels between neighbouring pixels, of the longer of the steps along rows and
/// columns.
inline double level_of_detail(const BaseColor& base, const Vec3d& c) {
  const NdcTriangle& t = base.triangle;
  Vec2d point;
  double sum = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    const double b = base.perspective_correct ? c[i] * t[i].z : c[i];
    point += b * screen(t[i]);
    sum += b;
  }
  point = (1.0 / sum) * point;
  constexpr double k_step = 1e-6;  // NDC
  double longest = 0.0;
  for (const Vec2d& d : {Vec2d{k_step, 0.0}, Vec2d{0.0, k_step}}) {
    const Vec2d uv = texcoord_on_screen(base, point + d) - texcoord_on_screen(base, point - d);
    const double scale = base.pixel / (2.0 * k_step);
    longest = std::max(longest, scale * std::hypot(uv.x * base.texture->width, uv.y * base.texture->height));
  }
  return std::log2(longest);
}

inline Vec3d base_color(const BaseColor& base, const Vec3d& c) {
  const Vec3d color = interpolate(c, [&](std::size_t i) { return base.corners[i]; });
  if (base.texture && base.texture->filter == Filter::trilinear)
    return color * sample_pyramid(*base.texture, texcoord_at(base, c), level_of_detail(base, c));
  return base.texture ? color * sample_texture(*base.texture, texcoord_at(base, c)).color : color;
}

/// Colour of a fragment with barycentrics `c`.
inline Vec3d shade_forward(const ShadeScene& scene, std::size_t face_index, const Vec3d& c,
                           const BaseColor& made_of) {
  const Vec3d base = base_color(made_of, c);
  if (!scene.lights) return base;
  const LightTerms light = fragment_light(scene, face_index, c);
  return base * light.factor + light.specular;
}

inline ShadeGradient make_shade_gradient(const ShadeScene& scene) {
  ShadeGradient grad;
  grad.world.resize(scene.world.size());
  grad.face_normals.resize(scene.faces.size());
  grad.vertex_normals.resize(scene.world.size());
  grad.vertex_light.resize(scene.world.size());
  if (scene.lights) grad.lights = zero_like(*scene.lights);
  return grad;
}

/// Gradient of a fragment's light to its barycentrics (returned) and to the scene (accumulated).
inline Vec3d fragment_light_backward(const ShadeScene& scene, std::size_t face_index, const Vec3d& c,
                                     const LightTerms& grad_light, ShadeGradient& total) {
  const Face& face = scene.faces[face_index];
  Vec3d grad_c;
  if (scene.lights->shading == Shading::gouraud) {
    for (std::size_t i = 0; i < 3; ++i) {
      const LightTerms& light = scene.vertex_light[face[i]];
      grad_c[i] = dot(grad_light.factor, light.factor) + dot(grad_light.specular, light.specular);
      total.vertex_light[face[i]].factor += c[i] * grad_light.factor;
      total.vertex_light[face[i]].specular += c[i] * grad_light.specular;
    }
    return grad_c;
  }
  const bool flat = scene.lights->shading == Shading::flat;
  const Vec3d normal_sum = flat ? scene.face_areas[face_index] : fragment_normal_sum(scene, face_index, c);
  const SurfaceGradient surface =
      light_terms_backward(face_lights(scene, face_index), scene.camera, fragment_position(scene, face, c),
                           unit(normal_sum), grad_light, total.lights);
  total.camera += surface.camera;
  if (flat) total.face_normals[face_index] += surface.normal;
  const Vec3d grad_sum = flat ? Vec3d{} : unit_backward(normal_sum, surface.normal);
  for (std::size_t i = 0; i < 3; ++i) {
    grad_c[i] =
        dot(surface.position, scene.world[face[i]]) + dot(grad_sum, unit(scene.vertex_areas[face[i]]));
    total.world[face[i]] += c[i] * surface.position;
    total.vertex_normals[face[i]] += c[i] * grad_sum;
  }
  return grad_c;
}

struct ShadeFragmentGradient {
  Vec3d barycentric;
  CornerColors corners;
  std::array<Vec2d, 3> texcoords;
  std::vector<Vec3d> texels;  ///< of the texture, if there is one
};

/// Adds the gradients of what a base colour is made of. Those of trilinear filtering are not here: they are
/// compared with finite differences.
inline void base_color_backward(const BaseColor& base, const Vec3d& c, const Vec3d& grad_base,
                                ShadeFragmentGradient& grad) {
  Vec3d grad_color = grad_base;
  if (base.texture) {
    const TextureSample sample = sample_texture(*base.texture, texcoord_at(base, c));
    const Vec3d grad_sample = grad_base * interpolate(c, [&](std::size_t i) { return base.corners[i]; });
    const Vec2d grad_uv{dot(grad_sample, sample.by_u), dot(grad_sample, sample.by_v)};
    for (const double weight : sample.weight) grad.texels.push_back(weight * grad_sample);
    for (std::size_t i = 0; i < 3; ++i) {
      grad.texcoords[i] = c[i] * grad_uv;
      grad.barycentric[i] += dot(grad_uv, base.texcoords[i]);
    }
    grad_color = grad_base * sample.color;
  }
  for (std::size_t i = 0; i < 3; ++i) {
    grad.barycentric[i] += dot(grad_color, base.corners[i]);
    grad.corners[i] = c[i] * grad_color;
  }
}

/// Gradient of one fragment's colour. The rest goes into `total`, which `shade_finish_backward` completes.
inline ShadeFragmentGradient shade_backward(const ShadeScene& scene, std::size_t face_index, const Vec3d& c,
                                            const BaseColor& made_of, const Vec3d& grad_color,
                                            ShadeGradient& total) {
  ShadeFragmentGradient grad;
  Vec3d grad_base = grad_color;
  if (scene.lights) {
    const Vec3d base = base_color(made_of, c);
    const LightTerms light = fragment_light(scene, face_index, c);
    grad.barycentric = fragment_light_backward(scene, face_index, c, {grad_color * base, grad_color}, total);
    grad_base = grad_color * light.factor;
  }
  base_color_backward(made_of, c, grad_base, grad);
  return grad;
}

/// After all fragments: light at the vertices and normals to the world positions, in `total.world`.
inline void shade_finish_backward(const ShadeScene& scene, ShadeGradient& total) {
  if (!scene.lights) return;
  if (scene.lights->shading == Shading::gouraud) {
    for (std::size_t i = 0; i < scene.world.size(); ++i) {
      const SurfaceGradient surface =
          light_terms_backward(*scene.lights, scene.camera, scene.world[i], unit(scene.vertex_areas[i]),
                               total.vertex_light[i], total.lights);
      total.camera += surface.camera;
      total.world[i] += surface.position;
      total.vertex_normals[i] += surface.normal;
    }
  }
  for (std::size_t f = 0; f < scene.faces.size(); ++f) {
    const Face& face = scene.faces[f];
    Vec3d grad_area = unit_backward(scene.face_areas[f], total.face_normals[f]);
    for (std::size_t vertex : face) {
      grad_area += unit_backward(scene.vertex_areas[vertex], total.vertex_normals[vertex]);
    }
    const Vec3d grad_u = cross(scene.world[face[2]] - scene.world[face[0]], grad_area);
    const Vec3d grad_v = cross(grad_area, scene.world[face[1]] - scene.world[face[0]]);
    total.world[face[1]] += grad_u;
    total.world[face[2]] += grad_v;
    total.world[face[0]] += -(grad_u + grad_v);
  }
}

}  // namespace dpr::reference
