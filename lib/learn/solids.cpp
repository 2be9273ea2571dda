#include "learn/solids.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mesh/bounding_box.hpp"

namespace dpr::learn {
namespace {

constexpr unsigned k_round = 16;  // corners of what is round

glm::vec3 place(Axis axis, float at, const glm::vec2& uv) {
  switch (axis) {
    case Axis::x:
      return {at, uv.x, uv.y};
    case Axis::y:
      return {uv.x, at, uv.y};
    case Axis::z:
      break;
  }
  return {uv.x, uv.y, at};
}

/// A corner of the cross-section [-1, 1]^2: of a square, or on its inscribed circle.
glm::vec2 corner(unsigned index, unsigned sides) {
  const float angle =
      2.0F * std::numbers::pi_v<float> * (static_cast<float>(index) + 0.5F) / static_cast<float>(sides);
  const float radius = sides == 4 ? std::numbers::sqrt2_v<float> : 1.0F;
  return radius * glm::vec2(std::cos(angle), std::sin(angle));
}

glm::vec2 across(Axis axis, const glm::vec3& v) {
  switch (axis) {
    case Axis::x:
      return {v.y, v.z};
    case Axis::y:
      return {v.x, v.z};
    case Axis::z:
      break;
  }
  return {v.x, v.y};
}

}  // namespace

void Solids::box(const glm::vec3& center, const glm::vec3& half, const glm::vec3& color) {
  const Section sections[] = {{center.y - half.y, across(Axis::y, center), across(Axis::y, half)},
                              {center.y + half.y, across(Axis::y, center), across(Axis::y, half)}};
  loft(Axis::y, sections, 4, color);
}

void Solids::cylinder(Axis axis, const glm::vec3& center, float half_length, float radius,
                      const glm::vec3& color) {
  const float middle = center[static_cast<int>(axis)];
  const Section sections[] = {{middle - half_length, across(axis, center), glm::vec2(radius)},
                              {middle + half_length, across(axis, center), glm::vec2(radius)}};
  loft(axis, sections, k_round, color);
}

void Solids::ellipsoid(const glm::vec3& center, const glm::vec3& half, const glm::vec3& color) {
  constexpr int k_sections = 8;
  std::vector<Section> sections;
  for (int i = 0; i < k_sections; ++i) {
    // Rings between the poles; the caps are small discs.
    const float angle = std::numbers::pi_v<float> * (static_cast<float>(i) + 0.35F) / (k_sections - 0.3F);
    sections.push_back({center.y - half.y * std::cos(angle), across(Axis::y, center),
                        std::sin(angle) * across(Axis::y, half)});
  }
  loft(Axis::y, sections, k_round, color);
}

void Solids::loft(Axis axis, std::span<const Section> sections, unsigned sides, const glm::vec3& color) {
  const auto base = static_cast<unsigned>(mesh_.positions.size());
  for (const Section& section : sections) {
    for (unsigned i = 0; i < sides; ++i) {
      mesh_.positions.push_back(place(axis, section.at, section.center + section.half * corner(i, sides)));
    }
  }
  // Seen along x or z the corners turn counter-clockwise in (u, v); along y, whose (x, z) is left-handed,
  // clockwise.
  const auto add = [&](unsigned a, unsigned b, unsigned c) {
    mesh_.faces.push_back(axis == Axis::y ? glm::uvec3(base + a, base + c, base + b)
                                          : glm::uvec3(base + a, base + b, base + c));
    mesh_.face_colors.push_back(color);
  };
  const auto rings = static_cast<unsigned>(sections.size());
  for (unsigned ring = 0; ring + 1 < rings; ++ring) {
    for (unsigned i = 0; i < sides; ++i) {
      const unsigned a = ring * sides + i, b = ring * sides + (i + 1) % sides;
      add(a, b, b + sides);
      add(a, b + sides, a + sides);
    }
  }
  const unsigned last = (rings - 1) * sides;
  for (unsigned i = 1; i + 1 < sides; ++i) {
    add(0, i + 1, i);
    add(last, last + i, last + i + 1);
  }
}

Mesh Solids::fitted(float side, float diagonal) const {
  const Bounds box = bounding_box(mesh_.positions);
  const glm::vec3 size = box.high - box.low, middle = center(box);
  const float scale = std::min(side / std::max({size.x, size.y, size.z}), diagonal / glm::length(size));
  Mesh mesh = mesh_;
  for (glm::vec3& p : mesh.positions) p = (p - middle) * scale;
  return mesh;
}

}  // namespace dpr::learn
