// The shapes that the library makes itself.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <glm/gtc/constants.hpp>
#include <map>
#include <utility>

#include "base/checks.hpp"
#include "dpr/mesh.hpp"

namespace dpr {
namespace {

glm::vec2 on_circle(unsigned step, unsigned steps) {
  const double angle = 2 * glm::pi<double>() * step / steps;
  return {static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle))};
}

std::uint32_t add_vertex(Mesh& mesh, const glm::vec3& position) {
  mesh.positions.push_back(position);
  return static_cast<std::uint32_t>(mesh.positions.size() - 1);
}

void add_triangle(Mesh& mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c, const glm::vec3& color) {
  mesh.faces.emplace_back(a, b, c);
  mesh.face_colors.push_back(color);
}

glm::vec3 color_by_direction(const glm::vec3& direction) { return 0.5F + 0.5F * direction; }

// The vertex in the middle of an edge, pushed out to the unit sphere; made once for the two faces that share
// it.
std::uint32_t middle(Mesh& mesh, std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t>& made,
                     std::uint32_t a, std::uint32_t b) {
  const auto [entry, is_new] = made.try_emplace(std::minmax(a, b), 0);
  if (is_new) entry->second = add_vertex(mesh, glm::normalize(mesh.positions[a] + mesh.positions[b]));
  return entry->second;
}

Mesh icosahedron() {
  const float g = (1 + std::sqrt(5.0F)) / 2;
  Mesh mesh;
  mesh.positions = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                    {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  for (glm::vec3& position : mesh.positions) position = glm::normalize(position);
  mesh.faces = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  return mesh;
}

}  // namespace

Mesh make_cube() {
  // One colour a side, in the order +x, -x, +y, -y, +z, -z.
  constexpr std::array<glm::vec3, 6> k_colors{{{0.9F, 0.1F, 0.1F},
                                               {0.1F, 0.8F, 0.8F},
                                               {0.1F, 0.7F, 0.1F},
                                               {0.8F, 0.1F, 0.8F},
                                               {0.1F, 0.2F, 0.9F},
                                               {0.9F, 0.8F, 0.1F}}};
  Mesh mesh;
  for (unsigned side = 0; side < 6; ++side) {
    const int axis = static_cast<int>(side / 2);
    const float sign = side % 2 == 0 ? 1.0F : -1.0F;
    glm::vec3 normal(0), u(0), v(0);
    normal[axis] = sign;
    u[(axis + 1) % 3] = sign;  // u x v = normal for either sign
    v[(axis + 2) % 3] = 1;
    const std::uint32_t a = add_vertex(mesh, normal - u - v), b = add_vertex(mesh, normal + u - v);
    const std::uint32_t c = add_vertex(mesh, normal + u + v), d = add_vertex(mesh, normal - u + v);
    add_triangle(mesh, a, b, c, k_colors[side]);
    add_triangle(mesh, a, c, d, k_colors[side]);
  }
  return mesh;
}

Mesh make_icosphere(unsigned subdivisions, float radius) {
  constexpr unsigned k_most_subdivisions = 10;  // 20,971,520 triangles
  if (subdivisions > k_most_subdivisions) {
    throw InvalidArgument("subdivisions (make_icosphere)", std::to_string(subdivisions),
                          "at most " + std::to_string(k_most_subdivisions));
  }
  checks::require_positive(radius, "radius (make_icosphere)");
  Mesh mesh = icosahedron();
  for (unsigned level = 0; level < subdivisions; ++level) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> made;
    std::vector<glm::uvec3> finer;
    finer.reserve(4 * mesh.faces.size());
    for (const glm::uvec3& f : mesh.faces) {
      const std::uint32_t ab = middle(mesh, made, f.x, f.y), bc = middle(mesh, made, f.y, f.z);
      const std::uint32_t ca = middle(mesh, made, f.z, f.x);
      finer.insert(finer.end(), {{f.x, ab, ca}, {f.y, bc, ab}, {f.z, ca, bc}, {ab, bc, ca}});
    }
    mesh.faces = std::move(finer);
  }
  for (glm::vec3& position : mesh.positions) {
    mesh.vertex_colors.push_back(color_by_direction(position));
    position *= radius;
  }
  return mesh;
}

Mesh make_torus(float major_radius, float minor_radius, unsigned major_segments, unsigned minor_segments) {
  checks::require_positive(major_radius, "major_radius (make_torus)");
  checks::require_positive(minor_radius, "minor_radius (make_torus)");
  constexpr unsigned k_most_segments = 1U << 14U;
  for (const unsigned segments : {major_segments, minor_segments}) {
    if (segments >= 3 && segments <= k_most_segments) continue;
    throw InvalidArgument("segments (make_torus)", std::to_string(segments),
                          "3 to " + std::to_string(k_most_segments));
  }
  Mesh mesh;
  for (unsigned i = 0; i < major_segments; ++i) {
    const glm::vec2 around = on_circle(i, major_segments);
    for (unsigned k = 0; k < minor_segments; ++k) {
      const glm::vec2 section = on_circle(k, minor_segments);
      const float distance = major_radius + minor_radius * section.x;
      const glm::vec3 position(distance * around.y, minor_radius * section.y, distance * around.x);
      add_vertex(mesh, position);
      mesh.vertex_colors.push_back(color_by_direction(position / (major_radius + minor_radius)));
      const unsigned next_i = (i + 1) % major_segments, next_k = (k + 1) % minor_segments;
      const std::uint32_t a = i * minor_segments + k, b = next_i * minor_segments + k;
      const std::uint32_t c = next_i * minor_segments + next_k, d = i * minor_segments + next_k;
      mesh.faces.insert(mesh.faces.end(), {{a, b, c}, {a, c, d}});
    }
  }
  return mesh;
}

}  // namespace dpr
