#include "stages/edges.hpp"

#include <algorithm>
#include <array>
#include <bit>

#include "image/texture_words.hpp"
#include "mesh/face_texture.hpp"

namespace dpr {
namespace {

/// True if two coordinates are one place of a texture.
bool is_same_place(const glm::vec2& a, const glm::vec2& b, Wrap wrap) {
  const float period = period_of(wrap);
  if (period == 0) return a == b;
  const glm::vec2 periods = (a - b) / period;
  return periods == glm::round(periods);
}

/// Number of a vertex among a face's corners.
int corner_of(const Mesh& mesh, std::uint32_t face, std::uint32_t vertex) {
  int corner = 0;
  while (corner < 2 && mesh.faces[face][corner] != vertex) ++corner;
  return corner;
}

/// True if the texture jumps at the edge between two faces.
bool is_seam(const Mesh& mesh, const WeldedEdge& edge) {
  const std::uint32_t own = edge.face, other = *edge.other, texture = texture_of(mesh, own);
  if (texture != texture_of(mesh, other)) return true;
  if (texture == k_no_texture) return false;
  const auto coordinate = [&](std::uint32_t face, std::uint32_t vertex) {
    return mesh.texcoords[mesh.face_texcoords[face][corner_of(mesh, face, vertex)]];
  };
  return std::ranges::any_of(std::array{edge.first, edge.second}, [&](std::uint32_t end) {
    return !is_same_place(coordinate(own, end), coordinate(other, end), mesh.textures[texture].wrap);
  });
}

/// True if what the mesh says of how it is lit jumps at the edge between two faces: their materials, or the
/// normals that it gives.
bool light_may_jump(const Mesh& mesh, const WeldedEdge& edge) {
  const std::uint32_t own = edge.face, other = *edge.other;
  if (material_of(mesh, own) != material_of(mesh, other)) return true;
  if (mesh.face_normals.empty()) return false;
  return std::ranges::any_of(std::array{edge.first, edge.second}, [&](std::uint32_t end) {
    return mesh.normals[mesh.face_normals[own][corner_of(mesh, own, end)]] !=
           mesh.normals[mesh.face_normals[other][corner_of(mesh, other, end)]];
  });
}

/// The faces of a mesh that a view sees, from the row of its own on, and the number of the first among those of the
/// view.
struct SeenFaces {
  const Mesh& mesh;
  std::size_t first_row, faces, first_face;
  bool sees_through;

  /// True if the opacities of neighbours may differ.
  bool fades() const { return sees_through && !mesh.face_opacities.empty(); }
};

/// With the mesh's rows for the faces seen.
WeldedEdge by_row(WeldedEdge edge, const SeenFaces& seen) {
  edge.face += to_uint(seen.first_row);
  if (edge.other) *edge.other += to_uint(seen.first_row);
  return edge;
}

cl_uint side_of(const WeldedEdge& edge, std::size_t first_face) {
  return 3 * (to_uint(first_face) + edge.face) + edge.corner;
}

cl_uint2 row_of(const SeenFaces& seen, const WeldedEdge& of_seen) {
  const Mesh& mesh = seen.mesh;
  const WeldedEdge edge = by_row(of_seen, seen);
  cl_uint2 row{{side_of(of_seen, seen.first_face), DPR_NO_FACE}};
  if (!edge.other) return row;
  row.s[1] = (to_uint(seen.first_face) + *of_seen.other) | (edge.same_direction ? DPR_EDGE_FLAG : 0);
  if (mesh.vertex_colors.empty() && !mesh.face_colors.empty()) row.s[0] |= DPR_EDGE_FLAG;
  if (is_seam(mesh, edge) || seen.fades()) row.s[0] |= DPR_EDGE_SEAM;
  if (light_may_jump(mesh, edge)) row.s[1] |= DPR_EDGE_SEAM;
  return row;
}

shared::OpenEdge open_edge(const SeenFaces& seen, const WeldedEdge& of_seen) {
  const Mesh& mesh = seen.mesh;
  const WeldedEdge edge = by_row(of_seen, seen);
  shared::OpenEdge open{};
  open.side = side_of(of_seen, seen.first_face);
  open.texture = texture_of(mesh, edge.face);
  open.material = to_uint(material_of(mesh, edge.face));
  if (seen.fades()) {
    open.texture = edge.face;  // another than any other face's: at all these edges it jumps
    return open;
  }
  if (open.texture == k_no_texture) return open;
  const float period = period_of(mesh.textures[open.texture].wrap);
  const auto place = [&](std::uint32_t corner) {
    const glm::vec2& uv = mesh.texcoords[mesh.face_texcoords[edge.face][static_cast<int>(corner % 3)]];
    return period == 0 ? uv : uv / period;
  };
  const glm::vec2 first = place(edge.corner), second = place(edge.corner + 1U);
  open.is_periodic = period == 0 ? 0 : 1;
  open.places = {{first.x, first.y, second.x, second.y}};
  return open;
}

/// Numbers a mesh's edges from `count` on, in the order of their sides: see DPR_FACE_SIDES.
std::vector<cl_uint> number_edges(std::span<const WeldedEdge> edges, std::size_t faces, std::size_t count) {
  std::vector<cl_uint> numbers(faces);
  for (const WeldedEdge& edge : edges) numbers[edge.face] |= 1U << edge.corner;
  for (cl_uint& of_face : numbers) {
    const cl_uint sides = of_face;
    of_face |= to_uint(count) * DPR_FACE_SIDES;
    count += static_cast<std::size_t>(std::popcount(sides));
  }
  return numbers;
}

/// As kernels/contour.h has it.
std::size_t number_of(const WeldedEdge& edge, std::span<const cl_uint> numbers) {
  const cl_uint sides = numbers[edge.face], before = sides & ((1U << edge.corner) - 1);
  return sides / DPR_FACE_SIDES + static_cast<std::size_t>(std::popcount(before));
}

}  // namespace

namespace {

/// Edges of what a view sees: in the order of their numbers, the open ones, and the numbers by face.
struct SeenEdges {
  std::vector<cl_uint2> rows;
  std::vector<shared::OpenEdge> open;
  std::vector<cl_uint> numbers;
};

/// Adds those of some more faces; returns the solid that they are.
Solid add_edges(const SeenFaces& seen, SeenEdges& edges) {
  const std::span faces(seen.mesh.faces.data() + seen.first_row, seen.faces);
  const std::vector<WeldedEdge> found = make_edges(faces, seen.mesh.positions.size());
  const std::vector<cl_uint> numbers = number_edges(found, seen.faces, edges.rows.size());
  edges.rows.resize(edges.rows.size() + found.size());
  for (const WeldedEdge& edge : found) {
    edges.rows[number_of(edge, numbers)] = row_of(seen, edge);
    if (edge.is_open) edges.open.push_back(open_edge(seen, edge));
  }
  edges.numbers.insert(edges.numbers.end(), numbers.begin(), numbers.end());
  const auto is_point = [](const glm::uvec3& face) { return face.x == face.y && face.y == face.z; };
  const auto last = std::ranges::find_if_not(faces.rbegin(), faces.rend(), is_point);  // behind it is padding
  return {found, static_cast<std::size_t>(faces.rend() - last)};
}

template <class Element>
void append(std::vector<Element>& all, std::vector<Element>&& more) {
  if (all.empty()) {
    all = std::move(more);
  } else {
    all.insert(all.end(), more.begin(), more.end());
  }
}

}  // namespace

Edges::Edges(Device::Impl& device, const Scene& scene, std::size_t views_of_faces, bool is_see_through)
    : sees_through(is_see_through), device_(device), launch_(device) {
  constexpr std::size_t k_most = std::min(DPR_EDGE_SEAM / 3, DPR_NO_MESH_EDGE / (3 * DPR_FACE_SIDES));
  std::vector<SeenEdges> all(views_of_faces);
  for (std::size_t view = 0; view < views_of_faces; ++view) {
    std::size_t first_face = 0;
    for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
      const Mesh& mesh = mesh_of(scene, m);
      const std::size_t faces = mesh.faces.size() / views_of_faces;
      if (first_face + faces > k_most) {
        throw InvalidArgument("faces (scene)", "more than " + std::to_string(k_most),
                              "at most that many with noise of the pixel");
      }
      solids.push_back(add_edges({mesh, view * faces, faces, first_face, sees_through}, all[view]));
      first_face += faces;
    }
    count = std::max(count, all[view].rows.size());
    open_count_ = std::max(open_count_, all[view].open.size());
  }
  std::vector<cl_uint2> rows;
  std::vector<cl_uint> numbers;
  std::vector<shared::OpenEdge> open;
  shared::OpenEdge none{};
  none.side = DPR_NO_SIDE;
  for (SeenEdges& of_view : all) {
    // Between a face and itself, which is never a contour; and one that is never read, but an argument all the same.
    of_view.rows.resize(std::max<std::size_t>(count, 1));
    of_view.open.resize(open_count_, none);
    append(rows, std::move(of_view.rows));
    append(numbers, std::move(of_view.numbers));
    append(open, std::move(of_view.open));
  }
  edges.upload(device, rows);
  face_edges.upload(device, numbers);
  open_.upload(device, open);
}

void Edges::join(const shared::FrameParams& p, const Geometry& geometry) {
  const std::size_t copies = p.position_stride != 0 ? p.views : 1, open = open_count_;
  const std::size_t rows = std::max<std::size_t>(count, 1);
  if (edges.size() != copies * rows) {
    Buffer<cl_uint2> copied(device_, copies * rows);
    edges.resize(device_, rows);
    for (std::size_t copy = 0; copy < copies; ++copy) edges.copy_to(copied, copy * rows);
    std::swap(edges, copied);
  }
  if (open == 0) return;
  const std::size_t buckets = std::bit_ceil(open);
  heads_.resize(device_, copies * buckets);
  next_.resize(device_, copies * open);
  heads_.fill(DPR_NO_OPEN_EDGE);
  const cl_uint4 sizes{{to_uint(copies), to_uint(open), to_uint(buckets), 0}};
  launch_(copies * open, kernel::edges_list{.p = p,
                                            .sizes = sizes,
                                            .open = open_,
                                            .faces = geometry.face_vertices,
                                            .places = geometry.places,
                                            .positions = geometry.positions_of(p),
                                            .heads = heads_,
                                            .next = next_});
  launch_(copies * open, kernel::edges_join{.p = p,
                                            .sizes = sizes,
                                            .mesh_edges = to_uint(count),
                                            .open = open_,
                                            .faces = geometry.face_vertices,
                                            .places = geometry.places,
                                            .positions = geometry.positions_of(p),
                                            .heads = heads_,
                                            .next = next_,
                                            .face_edges = face_edges,
                                            .edges = edges});
}

std::size_t Edges::bytes() const {
  return edges.capacity_bytes() + face_edges.capacity_bytes() + open_.capacity_bytes() +
         heads_.capacity_bytes() + next_.capacity_bytes();
}

}  // namespace dpr
