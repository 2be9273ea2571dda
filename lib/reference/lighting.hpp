/// Reference for the light at a point of a surface.
///
///     colour = base * (ambient + environment + sum_l a_l diffuse_l max(n.l, 0))
///            + sum_l a_l specular_l [n.l > 0] max(m, 0)^shininess
///
/// l, v: unit vectors to the light and to the camera; a_l: what comes through a spot's cone; m = v.r,
/// r = 2 (n.l) n - l (Phong 1975), or n.h, h the direction of l + v (Blinn 1977). Normals are not turned to
/// the viewer. The environment is the irradiance over pi of radiance given by spherical harmonics
/// (Ramamoorthi and Hanrahan 2001). Microfacet shading is glTF's (microfacet.hpp), F being Schlick's term:
///
///     colour = base * (ambient + environment + sum_l a_l diffuse_l max(n.l, 0) (1 - F))
///            + sum_l a_l specular_l pi D V max(n.l, 0) F
#pragma once

#include "microfacet.hpp"
#include "vec.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

namespace dpr::reference {

/// flat: the normal of the face; phong, blinn, microfacet: vertex normals interpolated; all at the fragment's
/// interpolated world position. gouraud: light at the vertices, interpolated.
enum class Shading { flat, phong, gouraud, blinn, microfacet };

struct PointLight {
  Vec3d position;  ///< world space
  Vec3d diffuse{0.3, 0.3, 0.3};
  Vec3d specular{0.2, 0.2, 0.2};
};

struct DirectionalLight {
  Vec3d direction{0.0, -1.0, 0.0};  ///< away from the light
  Vec3d diffuse{0.3, 0.3, 0.3};
  Vec3d specular{0.2, 0.2, 0.2};
};

struct SpotLight {
  Vec3d position;
  Vec3d direction{0.0, -1.0, 0.0};  ///< away from the light
  double angle_degrees = 30.0;      ///< from the axis
  double inner_angle_degrees = 0.0;
  Vec3d diffuse{0.3, 0.3, 0.3};
  Vec3d specular{0.2, 0.2, 0.2};
};

struct Lights {
  Vec3d ambient{0.5, 0.5, 0.5};
  std::vector<PointLight> point;
  double shininess = 64.0;
  Shading shading = Shading::phong;
  std::vector<DirectionalLight> directional;
  std::vector<SpotLight> spot;
  std::vector<Vec3d> harmonics;  ///< 9, or none
  /// Of the lit surface at normal incidence, in microfacet shading: F0.
  Vec3d reflectance{1.0, 1.0, 1.0};
};

/// visit(name, value) for every vector and number of the lights that has a gradient.
template <class AnyLights, class Visit>
void for_each_light_value(AnyLights& lights, const Visit& visit) {
  visit("ambient", lights.ambient);
  for (auto& c : lights.harmonics) visit("harmonics", c);
  const auto visit_colors = [&](auto& light) {
    visit("light colors", light.diffuse);
    visit("light colors", light.specular);
  };
  for (auto& l : lights.point) {
    visit("light position", l.position);
    visit_colors(l);
  }
  for (auto& l : lights.directional) {
    visit("light direction", l.direction);
    visit_colors(l);
  }
  for (auto& l : lights.spot) {
    visit("light position", l.position);
    visit("light direction", l.direction);
    visit("angles", l.angle_degrees);
    visit("angles", l.inner_angle_degrees);
    visit_colors(l);
  }
}

/// visit(number), one after the other.
template <class AnyLights, class Visit>
void for_each_light_number(AnyLights& lights, const Visit& visit) {
  for_each_light_value(lights, [&](const char*, auto& value) {
    if constexpr (requires { value.x; }) {
      visit(value.x);
      visit(value.y);
      visit(value.z);
    } else {
      visit(value);
    }
  });
}

inline std::vector<double> numbers_of(const Lights& lights) {
  std::vector<double> numbers;
  for_each_light_number(lights, [&](double number) { numbers.push_back(number); });
  return numbers;
}

/// Lights moved by as many numbers.
inline Lights displaced(Lights lights, const std::vector<double>& by) {
  std::size_t i = 0;
  for_each_light_number(lights, [&](double& number) { number += by[i++]; });
  return lights;
}

inline Lights zero_like(Lights lights) {
  for_each_light_number(lights, [](double& number) { number = 0.0; });
  return lights;
}

/// The way from a position to a light, of any length, and which part of the light comes through.
struct Ray {
  Vec3d way;
  double through = 1.0;
};

inline Ray ray_to(const PointLight& light, const Vec3d& position) { return {light.position - position}; }

/// The light's share of the gradient is accumulated; the position's is returned.
inline Vec3d ray_backward(const PointLight&, const Vec3d&, const Ray& grad, PointLight& total) {
  total.position += grad.way;
  return -grad.way;
}

inline Ray ray_to(const DirectionalLight& light, const Vec3d&) { return {-light.direction}; }

inline Vec3d ray_backward(const DirectionalLight&, const Vec3d&, const Ray& grad, DirectionalLight& total) {
  total.direction += -grad.way;
  return {};
}

inline double radians(double degrees) { return degrees * std::numbers::pi / 180.0; }

/// Position of a ray in the soft edge of a spot's cone: 0 outside to 1 inside.
inline double in_edge(const SpotLight& light, const Vec3d& way) {
  const double outer = std::cos(radians(light.angle_degrees)),
               inner = std::cos(radians(light.inner_angle_degrees));
  return std::clamp((-dot(unit(light.direction), unit(way)) - outer) / (inner - outer), 0.0, 1.0);
}

inline Ray ray_to(const SpotLight& light, const Vec3d& position) {
  const Vec3d way = light.position - position;
  const double t = in_edge(light, way);
  return {way, t * t * (3.0 - 2.0 * t)};
}

inline Vec3d ray_backward(const SpotLight& light, const Vec3d& position, const Ray& grad, SpotLight& total) {
  const Vec3d way = light.position - position;
  const double outer = radians(light.angle_degrees), inner = radians(light.inner_angle_degrees);
  const double width = std::cos(inner) - std::cos(outer);
  const double t = in_edge(light, way), grad_t = grad.through * (6.0 * t - 6.0 * t * t);
  total.angle_degrees += radians(1.0) * grad_t * (1.0 - t) / width * std::sin(outer);
  total.inner_angle_degrees += radians(1.0) * grad_t * t / width * std::sin(inner);
  total.direction += unit_backward(light.direction, -(grad_t / width) * unit(way));
  const Vec3d grad_way = grad.way + unit_backward(way, -(grad_t / width) * unit(light.direction));
  total.position += grad_way;
  return -grad_way;
}

/// The basis, each function times the cosine lobe's coefficient over pi, as a polynomial in the direction
/// that is homogeneous of its order.
inline std::array<double, 9> harmonic_terms(const Vec3d& n) {
  constexpr double y0 = 0.28209479177387814, y1 = 0.4886025119029199, y2 = 1.0925484305920792,
                   y20 = 0.31539156525252005, y22 = 0.5462742152960396;
  constexpr double a1 = 2.0 / 3.0, a2 = 0.25;
  return {y0,
          a1 * y1 * n.y,
          a1 * y1 * n.z,
          a1 * y1 * n.x,
          a2 * y2 * n.x * n.y,
          a2 * y2 * n.y * n.z,
          a2 * y20 * (3.0 * n.z * n.z - dot(n, n)),
          a2 * y2 * n.x * n.z,
          a2 * y22 * (n.x * n.x - n.y * n.y)};
}

/// Their derivatives along an axis: polynomials of second order are exact in central differences.
inline std::array<double, 9> harmonic_slopes(const Vec3d& n, std::size_t axis) {
  Vec3d below = n, above = n;
  below[axis] -= 0.5;
  above[axis] += 0.5;
  std::array<double, 9> slopes = harmonic_terms(above);
  const std::array<double, 9> other = harmonic_terms(below);
  for (std::size_t k = 0; k < 9; ++k) slopes[k] -= other[k];
  return slopes;
}

/// colour = base * factor + specular.
struct LightTerms {
  Vec3d factor;
  Vec3d specular;
};

/// Base of the highlight's power.
inline double highlight_base(Shading shading, const Vec3d& l, const Vec3d& v, const Vec3d& n) {
  return shading == Shading::blinn ? dot(n, unit(l + v)) : dot(v, 2.0 * dot(n, l) * n - l);
}

/// Cosines n.l, n.v, n.h and v.h.
inline std::array<double, 4> cosines_of(const Vec3d& n, const Vec3d& l, const Vec3d& v) {
  const Vec3d h = unit(l + v);
  return {dot(n, l), dot(n, v), dot(n, h), dot(v, h)};
}

/// 1 - F0, channel by channel.
inline Vec3d scattered_share(const Lights& lights) { return Vec3d{1.0, 1.0, 1.0} - lights.reflectance; }

template <class Light>
void add_light(const Lights& lights, const Light& light, const Vec3d& v, const Vec3d& position,
               const Vec3d& normal, LightTerms& terms) {
  const Ray ray = ray_to(light, position);
  const Vec3d l = unit(ray.way);
  const double cosine = dot(normal, l);
  if (!(cosine > 0.0)) return;
  if (lights.shading == Shading::microfacet) {
    const Reflection r = reflection(cosines_of(normal, l, v), lights.shininess);
    terms.factor += ray.through * r.scattered.value * light.diffuse * scattered_share(lights);
    terms.specular += ray.through * (r.straight.value * lights.reflectance * light.specular +
                                     r.grazing.value * light.specular);
    return;
  }
  terms.factor += ray.through * cosine * light.diffuse;
  const double base = highlight_base(lights.shading, l, v, normal);
  if (base > 0.0) terms.specular += ray.through * std::pow(base, lights.shininess) * light.specular;
}

inline LightTerms light_terms(const Lights& lights, const Vec3d& camera, const Vec3d& position,
                              const Vec3d& normal) {
  LightTerms terms{lights.ambient, {}};
  const std::array<double, 9> harmonics = harmonic_terms(normal);
  for (std::size_t k = 0; k < lights.harmonics.size(); ++k)
    terms.factor += harmonics[k] * lights.harmonics[k];
  const Vec3d v = unit(camera - position);
  for (const auto& light : lights.point) add_light(lights, light, v, position, normal, terms);
  for (const auto& light : lights.directional) add_light(lights, light, v, position, normal, terms);
  for (const auto& light : lights.spot) add_light(lights, light, v, position, normal, terms);
  return terms;
}

/// Derivatives of `light_terms`; those of the lights are accumulated elsewhere.
struct SurfaceGradient {
  Vec3d position;
  Vec3d normal;
  Vec3d camera;
};

/// Gradient of the highlight's base to l, v and n.
struct HighlightGradient {
  Vec3d l, v, n;
};

inline HighlightGradient highlight_backward(Shading shading, const Vec3d& l, const Vec3d& v, const Vec3d& n) {
  if (shading == Shading::blinn) {
    const Vec3d grad_sum = unit_backward(l + v, n);
    return {grad_sum, grad_sum, unit(l + v)};
  }
  const double cosine = dot(n, l), facing = dot(n, v);
  return {2.0 * facing * n - v, 2.0 * cosine * n - l, 2.0 * (facing * l + cosine * v)};
}

/// Gradient of a light's reflection to its directions, to the normal and to what comes through.
struct ReflectionGradient {
  Vec3d l, v, n;
  double through = 0.0;
};

template <class Light>
ReflectionGradient reflection_backward(const Lights& lights, const Light& light, double through,
                                       const Vec3d& l, const Vec3d& v, const Vec3d& n, const LightTerms& grad,
                                       Light& total) {
  const Reflection r = reflection(cosines_of(n, l, v), lights.shininess);
  const Vec3d by_diffuse = grad.factor * scattered_share(lights),
              by_straight = grad.specular * lights.reflectance;
  total.diffuse += through * r.scattered.value * by_diffuse;
  total.specular += through * (r.straight.value * by_straight + r.grazing.value * grad.specular);
  const Dual sum = Dual{dot(by_diffuse, light.diffuse)} * r.scattered +
                   Dual{dot(by_straight, light.specular)} * r.straight +
                   Dual{dot(grad.specular, light.specular)} * r.grazing;
  const auto [by_light, by_eye, by_half, by_both] = sum.slope;
  const Vec3d h = unit(l + v), grad_sum = unit_backward(l + v, by_half * n + by_both * v);
  return {through * (by_light * n + grad_sum), through * (by_eye * n + by_both * h + grad_sum),
          through * (by_light * l + by_eye * v + by_half * h), sum.value};
}

/// Adds the gradients by way of a light's direction and the direction to the camera.
template <class Light>
void add_ways_backward(const Light& light, const Ray& ray, const Vec3d& camera, const Vec3d& position,
                       const ReflectionGradient& grad, SurfaceGradient& surface, Light& total) {
  surface.position += ray_backward(light, position, {unit_backward(ray.way, grad.l), grad.through}, total);
  const Vec3d grad_to_camera = unit_backward(camera - position, grad.v);
  surface.normal += grad.n;
  surface.camera += grad_to_camera;
  surface.position += -grad_to_camera;
}

template <class Light>
void add_light_backward(const Lights& lights, const Light& light, const Vec3d& camera, const Vec3d& position,
                        const Vec3d& normal, const LightTerms& grad, SurfaceGradient& surface, Light& total) {
  const Ray ray = ray_to(light, position);
  const Vec3d l = unit(ray.way), v = unit(camera - position);
  const double cosine = dot(normal, l);
  if (!(cosine > 0.0)) return;
  if (lights.shading == Shading::microfacet) {
    const ReflectionGradient ways =
        reflection_backward(lights, light, ray.through, l, v, normal, grad, total);
    return add_ways_backward(light, ray, camera, position, ways, surface, total);
  }
  total.diffuse += ray.through * cosine * grad.factor;
  const double by_diffuse = dot(grad.factor, light.diffuse), by_specular = dot(grad.specular, light.specular);
  ReflectionGradient ways{
      ray.through * by_diffuse * normal, {}, ray.through * by_diffuse * l, by_diffuse * cosine};
  const double base = highlight_base(lights.shading, l, v, normal);
  if (base > 0.0) {
    const double highlight = std::pow(base, lights.shininess);
    total.specular += ray.through * highlight * grad.specular;
    ways.through += by_specular * highlight;
    const double grad_base = ray.through * by_specular * lights.shininess * highlight / base;
    const HighlightGradient g = highlight_backward(lights.shading, l, v, normal);
    ways.l += grad_base * g.l;
    ways.v += grad_base * g.v;
    ways.n += grad_base * g.n;
  }
  add_ways_backward(light, ray, camera, position, ways, surface, total);
}

inline SurfaceGradient light_terms_backward(const Lights& lights, const Vec3d& camera, const Vec3d& position,
                                            const Vec3d& normal, const LightTerms& grad, Lights& total) {
  SurfaceGradient surface;
  total.ambient += grad.factor;
  const std::array<double, 9> harmonics = harmonic_terms(normal);
  for (std::size_t k = 0; k < lights.harmonics.size(); ++k) {
    total.harmonics[k] += harmonics[k] * grad.factor;
    for (std::size_t axis = 0; axis < 3; ++axis)
      surface.normal[axis] += harmonic_slopes(normal, axis)[k] * dot(grad.factor, lights.harmonics[k]);
  }
  const auto add = [&](const auto& list, auto& totals) {
    for (std::size_t i = 0; i < list.size(); ++i)
      add_light_backward(lights, list[i], camera, position, normal, grad, surface, totals[i]);
  };
  add(lights.point, total.point);
  add(lights.directional, total.directional);
  add(lights.spot, total.spot);
  return surface;
}

}  // namespace dpr::reference
