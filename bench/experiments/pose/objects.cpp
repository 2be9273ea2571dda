// The objects of pose problems.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <glm/gtc/constants.hpp>

#include "experiments/pose/problems.hpp"
#include "mesh/bounding_box.hpp"

namespace dpr::bench {
namespace {

using Ring = std::vector<glm::vec3>;

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

// A cap: a fan about the ring's centre, seen from its front if the ring runs counter-clockwise there.
void add_cap(Mesh& mesh, const Ring& ring, bool front, const glm::vec3& color) {
  glm::vec3 centre(0);
  for (const glm::vec3& point : ring) centre += point;
  const std::uint32_t middle = add_vertex(mesh, centre / static_cast<float>(ring.size()));
  std::vector<std::uint32_t> rim;
  for (const glm::vec3& point : ring) rim.push_back(add_vertex(mesh, point));
  for (std::size_t i = 0; i < rim.size(); ++i) {
    const std::uint32_t a = rim[i], b = rim[(i + 1) % rim.size()];
    add_triangle(mesh, middle, front ? a : b, front ? b : a, color);
  }
}

enum class Edges { sharp, round };  // of the sides: every quad its own vertices, or shared ones

// A closed body through rings of equally many points, counter-clockwise when seen from the last ring's
// outside.
void add_loft(Mesh& mesh, const std::vector<Ring>& rings, Edges edges, const glm::vec3& color) {
  const std::size_t n = rings.front().size();
  std::vector<std::vector<std::uint32_t>> shared;
  if (edges == Edges::round) {
    for (const Ring& ring : rings) {
      shared.emplace_back();
      for (const glm::vec3& point : ring) shared.back().push_back(add_vertex(mesh, point));
    }
  }
  const auto vertex = [&](std::size_t ring, std::size_t i) {
    return edges == Edges::round ? shared[ring][i] : add_vertex(mesh, rings[ring][i]);
  };
  for (std::size_t r = 0; r + 1 < rings.size(); ++r) {
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t next = (i + 1) % n;
      const std::uint32_t a = vertex(r, i), b = vertex(r, next), c = vertex(r + 1, next),
                          d = vertex(r + 1, i);
      add_triangle(mesh, a, b, c, color);
      add_triangle(mesh, a, c, d, color);
    }
  }
  add_cap(mesh, rings.front(), false, color);
  add_cap(mesh, rings.back(), true, color);
}

void add_box(Mesh& mesh, const glm::vec3& low, const glm::vec3& high, const glm::vec3& color) {
  const auto ring = [&](float z) {
    return Ring{{low.x, low.y, z}, {high.x, low.y, z}, {high.x, high.y, z}, {low.x, high.y, z}};
  };
  add_loft(mesh, {ring(low.z), ring(high.z)}, Edges::sharp, color);
}

// A round section along a path in the plane z = const, from left to right over the top.
void add_tube(Mesh& mesh, const std::vector<glm::vec3>& path, float radius, unsigned segments,
              const glm::vec3& color) {
  std::vector<Ring> rings;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const std::size_t before = i > 0 ? i - 1 : 0, after = std::min(i + 1, path.size() - 1);
    const glm::vec3 along = glm::normalize(path[after] - path[before]);
    const glm::vec3 across(0, 0, 1);
    const glm::vec3 outward = glm::cross(across, along);
    Ring& ring = rings.emplace_back();
    for (unsigned k = 0; k < segments; ++k) {
      const glm::vec2 direction = radius * on_circle(k, segments);
      ring.push_back(path[i] + direction.x * outward + direction.y * across);
    }
  }
  add_loft(mesh, rings, Edges::round, color);
}

// The arched outline of a mailbox at depth z: straight sides up to `spring`, half a circle above.
Ring arch(float half_width, float bottom, float spring, float z) {
  constexpr unsigned k_arc_steps = 16;
  Ring ring{{-half_width, bottom, z}, {half_width, bottom, z}};
  for (unsigned i = 0; i <= k_arc_steps; ++i) {
    const glm::vec2 direction = on_circle(i, 2 * k_arc_steps);
    ring.emplace_back(half_width * direction.x, spring + half_width * direction.y, z);
  }
  return ring;
}

// A rectangle with round corners at height y, counter-clockwise when seen from above.
Ring rounded_rectangle(float half_width, float half_depth, float corner, float y) {
  constexpr unsigned k_corner_steps = 5;
  Ring ring;
  for (unsigned quarter = 0; quarter < 4; ++quarter) {
    const float side_x = quarter == 0 || quarter == 3 ? 1.0F : -1.0F;
    const float side_z = quarter < 2 ? -1.0F : 1.0F;
    for (unsigned i = 0; i <= k_corner_steps; ++i) {
      const glm::vec2 direction = on_circle(quarter * k_corner_steps + i, 4 * k_corner_steps);
      ring.emplace_back(side_x * (half_width - corner) + corner * direction.x, y,
                        side_z * (half_depth - corner) - corner * direction.y);
    }
  }
  return ring;
}

/// A mailbox on a post with a flag, in [-1, 1]^3, coloured by part: the stand-in for the paper's Figure 11.
Mesh make_mailbox() {
  constexpr glm::vec3 k_body(0.16F, 0.35F, 0.66F), k_door(0.80F, 0.82F, 0.85F), k_flag(0.85F, 0.12F, 0.10F);
  constexpr glm::vec3 k_wood(0.45F, 0.29F, 0.15F), k_brass(0.85F, 0.65F, 0.20F);
  Mesh mesh;
  add_box(mesh, {-0.10F, -1.00F, -0.14F}, {0.10F, 0.02F, 0.06F}, k_wood);  // the post,
  add_box(mesh, {-0.24F, -0.04F, -0.52F}, {0.24F, 0.04F, 0.46F}, k_wood);  // and the board it carries
  add_loft(mesh, {arch(0.36F, 0.03F, 0.42F, -0.80F), arch(0.36F, 0.03F, 0.42F, 0.72F)}, Edges::sharp, k_body);
  add_loft(mesh, {arch(0.39F, 0.00F, 0.42F, 0.70F), arch(0.39F, 0.00F, 0.42F, 0.80F)}, Edges::sharp, k_door);
  add_box(mesh, {-0.09F, 0.60F, 0.79F}, {0.09F, 0.66F, 0.90F}, k_brass);   // the door's knob
  add_box(mesh, {0.35F, 0.36F, 0.24F}, {0.43F, 0.44F, 0.32F}, k_brass);    // the flag's hinge,
  add_box(mesh, {0.37F, 0.40F, 0.25F}, {0.41F, 0.98F, 0.31F}, k_flag);     // its arm,
  add_box(mesh, {0.365F, 0.72F, -0.02F}, {0.415F, 1.00F, 0.28F}, k_flag);  // and the flag, up: there is mail
  return mesh;
}

/// A bag with a flap and a handle, likewise.
Mesh make_bag() {
  constexpr glm::vec3 k_leather(0.55F, 0.27F, 0.12F), k_flap(0.78F, 0.50F, 0.25F),
      k_base(0.28F, 0.14F, 0.08F);
  constexpr glm::vec3 k_handle(0.20F, 0.12F, 0.10F), k_brass(0.90F, 0.72F, 0.25F);
  Mesh mesh;
  // The body narrows from the base to the top.
  add_loft(mesh,
           {rounded_rectangle(0.90F, 0.40F, 0.12F, -1.00F), rounded_rectangle(0.90F, 0.40F, 0.12F, -0.86F)},
           Edges::round, k_base);
  add_loft(mesh,
           {rounded_rectangle(0.87F, 0.37F, 0.12F, -0.88F), rounded_rectangle(0.78F, 0.32F, 0.11F, -0.30F),
            rounded_rectangle(0.66F, 0.24F, 0.09F, 0.28F)},
           Edges::round, k_leather);
  // The flap: a strip over the top and down the front, a little wider than the body, thinning to its edge.
  const auto across = [](float half_width, const glm::vec2& inner, const glm::vec2& outer) {  // (z, y) each
    return Ring{{-half_width, inner.y, inner.x},
                {half_width, inner.y, inner.x},
                {half_width, outer.y, outer.x},
                {-half_width, outer.y, outer.x}};
  };
  add_loft(mesh,
           {across(0.69F, {-0.29F, 0.10F}, {-0.33F, 0.10F}), across(0.69F, {-0.26F, 0.28F}, {-0.30F, 0.34F}),
            across(0.69F, {0.26F, 0.28F}, {0.30F, 0.34F}), across(0.72F, {0.32F, 0.00F}, {0.38F, 0.00F}),
            across(0.66F, {0.36F, -0.26F}, {0.42F, -0.26F}), across(0.46F, {0.38F, -0.40F}, {0.42F, -0.40F})},
           Edges::sharp, k_flap);
  add_box(mesh, {-0.12F, -0.46F, 0.36F}, {0.12F, -0.20F, 0.48F}, k_brass);  // the buckle
  add_box(mesh, {-0.05F, -0.40F, 0.46F}, {0.05F, -0.26F, 0.50F}, k_handle);
  std::vector<glm::vec3> path;  // of the handle: up, half an ellipse, down
  path.emplace_back(-0.42F, 0.26F, 0.0F);
  constexpr unsigned k_bend_steps = 20;
  for (unsigned i = 0; i <= k_bend_steps; ++i) {
    const glm::vec2 direction = on_circle(k_bend_steps - i, 2 * k_bend_steps);
    path.emplace_back(0.42F * direction.x, 0.44F + 0.50F * direction.y, 0.0F);
  }
  path.emplace_back(0.42F, 0.26F, 0.0F);
  add_tube(mesh, path, 0.06F, 12, k_handle);
  for (const float side : {-0.42F, 0.42F}) {  // where the handle is held
    add_box(mesh, {side - 0.10F, 0.30F, -0.10F}, {side + 0.10F, 0.42F, 0.10F}, k_brass);
  }
  return mesh;
}

/// Colours a mesh without colours by position.
void color_by_position(Mesh& mesh) {
  for (const glm::vec3& p : mesh.positions)
    mesh.vertex_colors.push_back(glm::clamp(0.5F + 0.4F * p, 0.0F, 1.0F));
}

/// Moves the bounding box's centre to the origin and makes the rim as far away as the cube's corners.
void fit_to_cube(Mesh& mesh) {
  const glm::vec3 middle = center(bounding_box(mesh.positions));
  float radius = 0;
  for (glm::vec3& p : mesh.positions) p -= middle, radius = std::max(radius, glm::length(p));
  for (glm::vec3& p : mesh.positions) p *= glm::root_three<float>() / radius;
}

/// The published program's: eight shared vertices, whose normals are means of the sides', and a pure colour
/// a side.
Mesh make_published_cube() {
  constexpr std::array<glm::vec3, 6> k_colors{
      {{1, 0, 0}, {1, 1, 0}, {0, 0, 1}, {0, 1, 0}, {0, 1, 1}, {1, 0, 1}}};
  Mesh mesh;
  mesh.positions = {{-1, -1, 1}, {1, -1, 1}, {-1, 1, 1},   {1, 1, 1},
                    {-1, 1, -1}, {1, 1, -1}, {-1, -1, -1}, {1, -1, -1}};
  // In the order +z, +y, -z, -y, +x, -x.
  mesh.faces = {{0, 1, 2}, {2, 1, 3}, {2, 3, 4}, {4, 3, 5}, {4, 5, 6}, {6, 5, 7},
                {6, 7, 0}, {0, 7, 1}, {1, 7, 3}, {3, 7, 5}, {6, 0, 4}, {4, 0, 2}};
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) mesh.face_colors.push_back(k_colors[i / 2]);
  return mesh;
}

}  // namespace

Mesh make_object(const std::string& object) {
  if (object == "cube") return make_cube();
  if (object == "published_cube") return make_published_cube();
  if (object == "mailbox") return make_mailbox();
  if (object == "bag") return make_bag();
  Mesh mesh = read_mesh(object);
  fit_to_cube(mesh);
  if (mesh.vertex_colors.empty() && mesh.face_colors.empty()) color_by_position(mesh);
  return mesh;
}

}  // namespace dpr::bench
