// Isotropic remeshing on OpenMesh's halfedges. Everything goes in the order of handles, so the result is the
// same from run to run.
#include "mesh/remesh.hpp"

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "base/checks.hpp"
#include "dpr/error.hpp"
#include "mesh/silent_openmesh.hpp"

namespace dpr {
namespace {

struct Traits : OpenMesh::DefaultTraits {
  using Point = OpenMesh::Vec3d;
  using Normal = OpenMesh::Vec3d;
  using Color = OpenMesh::Vec3d;
  VertexAttributes(OpenMesh::Attributes::Status | OpenMesh::Attributes::Color);
  EdgeAttributes(OpenMesh::Attributes::Status);
  FaceAttributes(OpenMesh::Attributes::Status);
};

using Halfedges = OpenMesh::TriMesh_ArrayKernelT<Traits>;
using OpenMesh::EdgeHandle;
using OpenMesh::HalfedgeHandle;
using OpenMesh::Vec3d;
using OpenMesh::VertexHandle;

Vec3d to_openmesh(const glm::vec3& v) { return {v.x, v.y, v.z}; }
glm::vec3 to_glm(const Vec3d& v) { return {v[0], v[1], v[2]}; }

std::optional<Halfedges> make_halfedges(const Mesh& mesh) {
  const SilentOpenMesh silence;  // a refused face is an answer here
  Halfedges m;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const VertexHandle v = m.add_vertex(to_openmesh(mesh.positions[i]));
    m.set_color(v, mesh.vertex_colors.empty() ? Vec3d(1.0) : to_openmesh(mesh.vertex_colors[i]));
  }
  for (const glm::uvec3& f : mesh.faces) {
    if (f.x == f.y || f.y == f.z || f.z == f.x) return {};  // OpenMesh would link an edge to itself
    const auto corner = [&](int i) { return m.vertex_handle(f[i]); };
    if (!m.add_face(corner(0), corner(1), corner(2)).is_valid()) return {};
  }
  return m;
}

Mesh to_mesh(const Halfedges& m, bool has_colors) {
  Mesh mesh;
  for (const VertexHandle v : m.vertices()) {
    mesh.positions.push_back(to_glm(m.point(v)));
    if (has_colors) mesh.vertex_colors.push_back(to_glm(m.color(v)));
  }
  for (const auto f : m.faces()) {
    glm::uvec3& face = mesh.faces.emplace_back();
    int corner = 0;
    for (const VertexHandle v : m.fv_range(f)) face[corner++] = static_cast<unsigned>(v.idx());
  }
  return mesh;
}

/// Throws InvalidArgument where equilateral triangles of the surface's area would take all memory.
void require_room(const Mesh& mesh, float edge_length) {
  constexpr double k_most_faces = 1 << 22;
  double area = 0;
  for (const glm::uvec3& f : mesh.faces) {
    const glm::dvec3 a = mesh.positions[f.x], b = mesh.positions[f.y], c = mesh.positions[f.z];
    area += 0.5 * glm::length(glm::cross(b - a, c - a));
  }
  const double length = edge_length;
  if (area <= k_most_faces * 0.25 * std::sqrt(3.0) * length * length) return;
  throw InvalidArgument("edge length (remesh)",
                        checks::text(edge_length) + " for an area of " + checks::text(area),
                        "one that needs at most 2^22 triangles");
}

Vec3d normal_of(const Vec3d& a, const Vec3d& b, const Vec3d& c) { return OpenMesh::cross(b - a, c - a); }

struct Ends {
  VertexHandle from, to;
};
Ends ends_of(const Halfedges& m, HalfedgeHandle h) {
  return {m.from_vertex_handle(h), m.to_vertex_handle(h)};
}

void split_long_edges(Halfedges& m, double longest) {
  const std::size_t edges = m.n_edges();  // new ones wait for the next pass
  for (std::size_t i = 0; i < edges; ++i) {
    const EdgeHandle e = m.edge_handle(static_cast<unsigned>(i));
    if (m.calc_edge_length(e) <= longest) continue;
    const auto [a, b] = ends_of(m, m.halfedge_handle(e, 0));
    const Vec3d color = 0.5 * (m.color(a) + m.color(b));
    m.set_color(m.split_copy(e, m.calc_edge_midpoint(e)), color);
  }
}

/// True if `moved` can move to `target` without turning a face over or making an edge too long. Faces at
/// `other` do not count.
bool can_move(const Halfedges& m, VertexHandle moved, VertexHandle other, const Vec3d& target,
              double longest) {
  for (const VertexHandle v : m.vv_range(moved)) {
    if (v != other && (m.point(v) - target).norm() > longest) return false;
  }
  for (const HalfedgeHandle h : m.voh_range(moved)) {
    if (m.is_boundary(h)) continue;
    const VertexHandle b = m.to_vertex_handle(h), c = m.to_vertex_handle(m.next_halfedge_handle(h));
    if (b == other || c == other) continue;
    const Vec3d before = normal_of(m.point(moved), m.point(b), m.point(c));
    const Vec3d after = normal_of(target, m.point(b), m.point(c));
    if (OpenMesh::dot(before, after) <= 0) return false;
  }
  return true;
}

void collapse_short_edges(Halfedges& m, double shortest, double longest) {
  for (const EdgeHandle e : m.edges()) {
    if (m.status(e).deleted() || m.calc_edge_length(e) >= shortest) continue;
    const HalfedgeHandle h = m.halfedge_handle(e, 0);
    const auto [from, to] = ends_of(m, h);
    // A border stays where it is.
    if (m.is_boundary(from) || m.is_boundary(to) || !m.is_collapse_ok(h)) continue;
    const Vec3d middle = m.calc_edge_midpoint(e);
    if (!can_move(m, from, to, middle, longest) || !can_move(m, to, from, middle, longest)) continue;
    m.set_point(to, middle);
    m.set_color(to, 0.5 * (m.color(from) + m.color(to)));
    m.collapse(h);
  }
  m.garbage_collection();
}

/// Distance of the valences of two faces' four vertices from those of a regular mesh if the edge's own
/// ends lose that many edges, and those across gain them.
int irregularity(const Halfedges& m, const std::array<VertexHandle, 4>& vertices, int moved) {
  constexpr int k_regular = 6, k_regular_at_border = 4;
  int sum = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const int valence = static_cast<int>(m.valence(vertices[i])) + (i < 2 ? -moved : moved);
    sum += std::abs(valence - (m.is_boundary(vertices[i]) ? k_regular_at_border : k_regular));
  }
  return sum;
}

void flip_towards_regular(Halfedges& m) {
  constexpr double k_flat = 0.7;  // cosine; sharper edges are features, and flipping them cuts them
  for (const EdgeHandle e : m.edges()) {
    if (m.is_boundary(e) || !m.is_flip_ok(e)) continue;
    const HalfedgeHandle h = m.halfedge_handle(e, 0), g = m.halfedge_handle(e, 1);
    const auto [a, b] = ends_of(m, h);
    const VertexHandle c = m.to_vertex_handle(m.next_halfedge_handle(h));
    const VertexHandle d = m.to_vertex_handle(m.next_halfedge_handle(g));
    if (irregularity(m, {a, b, c, d}, 1) >= irregularity(m, {a, b, c, d}, 0)) continue;
    const auto normal = [&](VertexHandle x, VertexHandle y, VertexHandle z) {
      return normal_of(m.point(x), m.point(y), m.point(z));
    };
    const Vec3d before = normal(a, b, c) + normal(b, a, d);
    const auto agrees = [&](const Vec3d& n) {
      return OpenMesh::dot(n, before) > k_flat * n.norm() * before.norm();
    };
    if (agrees(normal(c, d, b)) && agrees(normal(d, c, a))) m.flip(e);
  }
}

/// Every vertex goes to the mean of its one-ring, as far as that lies in its tangent plane.
void relax(Halfedges& m) {
  std::vector<Vec3d> moved;
  for (const VertexHandle v : m.vertices()) {
    Vec3d normal(0.0), mean(0.0);
    for (const HalfedgeHandle h : m.voh_range(v)) {
      mean += m.point(m.to_vertex_handle(h));
      if (m.is_boundary(h)) continue;
      normal += normal_of(m.point(v), m.point(m.to_vertex_handle(h)),
                          m.point(m.to_vertex_handle(m.next_halfedge_handle(h))));
    }
    const double squared = normal.sqrnorm();
    const bool stays = m.is_boundary(v) || m.valence(v) == 0 || !(squared > 0);
    const Vec3d step = stays ? Vec3d(0.0) : mean / static_cast<double>(m.valence(v)) - m.point(v);
    moved.push_back(m.point(v) + step -
                    (stays ? Vec3d(0.0) : normal * (OpenMesh::dot(step, normal) / squared)));
  }
  for (const VertexHandle v : m.vertices()) m.set_point(v, moved[static_cast<std::size_t>(v.idx())]);
}

}  // namespace

std::optional<Mesh> remesh(const Mesh& mesh, float edge_length, unsigned passes) {
  require_room(mesh, edge_length);
  std::optional<Halfedges> halfedges = make_halfedges(mesh);
  if (!halfedges) return {};
  const double longest = 4.0 / 3.0 * static_cast<double>(edge_length);
  const double shortest = 4.0 / 5.0 * static_cast<double>(edge_length);
  for (unsigned pass = 0; pass < passes; ++pass) {
    split_long_edges(*halfedges, longest);
    collapse_short_edges(*halfedges, shortest, longest);
    flip_towards_regular(*halfedges);
    relax(*halfedges);
  }
  return to_mesh(*halfedges, !mesh.vertex_colors.empty());
}

}  // namespace dpr
