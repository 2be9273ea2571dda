#include "stages/contour.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>

#include "image/texture_words.hpp"

namespace dpr {
namespace {

/// Whether the colours of two faces can differ at the edge that they share: those of meshes with colours of
/// faces can, and those of vertices of the faces' own.
bool may_jump(const Mesh& mesh, const WeldedEdge& edge) {
  return !edge.shares_vertices || (mesh.vertex_colors.empty() && !mesh.face_colors.empty());
}

std::uint32_t texture_of(const Mesh& mesh, std::uint32_t face) {
  return mesh.face_textures.empty() ? 0 : mesh.face_textures[face];
}

/// Whether two coordinates are one place of a texture.
bool is_same_place(const glm::vec2& a, const glm::vec2& b, Wrap wrap) {
  const float period = period_of(wrap);
  if (period == 0) return a == b;
  const glm::vec2 periods = (a - b) / period;
  return periods == glm::round(periods);
}

/// Which corner of a face is where a vertex is.
int corner_at(const Mesh& mesh, std::span<const glm::vec3> positions, std::uint32_t face,
              std::uint32_t vertex) {
  int corner = 0;
  while (corner < 2 && positions[mesh.faces[face][corner]] != positions[vertex]) ++corner;
  return corner;
}

/// Whether the texture jumps at the edge between two faces.
bool is_seam(const Mesh& mesh, std::span<const glm::vec3> positions, const WeldedEdge& edge) {
  if (mesh.textures.empty()) return false;
  const std::uint32_t own = edge.face, other = *edge.other, texture = texture_of(mesh, own);
  if (texture != texture_of(mesh, other)) return true;
  if (texture == k_no_texture) return false;
  const auto coordinate = [&](std::uint32_t face, std::uint32_t vertex) {
    return mesh.texcoords[mesh.face_texcoords[face][corner_at(mesh, positions, face, vertex)]];
  };
  return std::ranges::any_of(std::array{edge.first, edge.second}, [&](std::uint32_t end) {
    return !is_same_place(coordinate(own, end), coordinate(other, end), mesh.textures[texture].wrap);
  });
}

/// Whether what the mesh says of how it is lit jumps at the edge between two faces: their materials, or the
/// normals that it gives.
bool light_may_jump(const Mesh& mesh, std::span<const glm::vec3> positions, const WeldedEdge& edge) {
  const std::uint32_t own = edge.face, other = *edge.other;
  if (material_of(mesh, own) != material_of(mesh, other)) return true;
  if (mesh.face_normals.empty()) return false;
  return std::ranges::any_of(std::array{edge.first, edge.second}, [&](std::uint32_t end) {
    return mesh.normals[mesh.face_normals[own][corner_at(mesh, positions, own, end)]] !=
           mesh.normals[mesh.face_normals[other][corner_at(mesh, positions, other, end)]];
  });
}

cl_uint2 joined(const Mesh& mesh, std::span<const glm::vec3> positions, const WeldedEdge& edge,
                std::size_t first_face) {
  cl_uint2 row{{3 * (to_uint(first_face) + edge.face) + edge.corner, DPR_NO_FACE}};
  if (!edge.other) return row;
  row.s[1] = (to_uint(first_face) + *edge.other) | (edge.same_direction ? DPR_EDGE_FLAG : 0);
  if (may_jump(mesh, edge)) row.s[0] |= DPR_EDGE_FLAG;
  if (is_seam(mesh, positions, edge)) row.s[0] |= DPR_EDGE_SEAM;
  if (light_may_jump(mesh, positions, edge)) row.s[1] |= DPR_EDGE_SEAM;
  return row;
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

Edges::Edges(Device::Impl& device, const Scene& scene, std::span<const MeshRange> meshes,
             std::span<const glm::vec3> positions) {
  constexpr std::size_t k_most = std::min(DPR_EDGE_SEAM / 3, DPR_NO_MESH_EDGE / (3 * DPR_FACE_SIDES));
  std::vector<cl_uint2> rows;
  std::vector<cl_uint> all_numbers;
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const Mesh& mesh = mesh_of(scene, m);
    const std::size_t first_face = all_numbers.size();
    if (first_face + mesh.faces.size() > k_most) {
      throw InvalidArgument("faces (scene)", "more than " + std::to_string(k_most),
                            "at most that many with noise of the pixel");
    }
    const std::span<const glm::vec3> own = positions.subspan(meshes[m].first_position, mesh.positions.size());
    const std::vector<WeldedEdge> welded = make_welded_edges(own, mesh.faces);
    const std::vector<cl_uint> numbers = number_edges(welded, mesh.faces.size(), rows.size());
    rows.resize(rows.size() + welded.size());
    for (const WeldedEdge& edge : welded)
      rows[number_of(edge, numbers)] = joined(mesh, own, edge, first_face);
    all_numbers.insert(all_numbers.end(), numbers.begin(), numbers.end());
    solids.emplace_back(welded, mesh.faces.size());
  }
  count = rows.size();
  if (rows.empty()) rows.emplace_back();  // never read, but an argument all the same
  edges.upload(device, rows);
  face_edges.upload(device, all_numbers);
}

std::size_t Edges::bytes() const { return edges.capacity_bytes() + face_edges.capacity_bytes(); }

Contour::Contour(Device::Impl& device)
    : device_(device),
      count_(device, "contour.cl", "contour_count"),
      fill_(device, "contour.cl", "contour_fill"),
      link_(device, "bin.cl", "bin_link"),
      gather_(device, "contour.cl", "contour_gather"),
      gather_cuts_(device, "contour.cl", "contour_gather_cuts"),
      scan_(device),
      sort_(device) {}

std::size_t edges_of_view(const ContourInputs& in) {
  return in.edges.count + (in.p.clips != 0 ? in.p.faces : 0);
}

namespace {

std::size_t view_edges(const ContourInputs& in) { return in.p.views * edges_of_view(in); }

shared::ContourParams params(const ContourInputs& in) {
  shared::ContourParams c{};
  c.edges = to_uint(edges_of_view(in));
  c.mesh_edges = to_uint(in.edges.count);
  c.shading = in.shading ? static_cast<cl_uint>(*in.shading) + DPR_FLAT : DPR_UNLIT;
  return c;
}

constexpr const char* k_pairs = "pairs of tiles and contours (frame)";

}  // namespace

void Contour::forward(const ContourInputs& in) {
  count(in);
  const std::size_t found = read_total(pair_starts, view_edges(in), k_pairs);
  list(in, found);
  settle(found);
}

void Contour::forward_within(const ContourInputs& in, std::size_t capacity) {
  count(in);
  list(in, capacity);
}

std::size_t Contour::read_count() const { return read_total(pair_starts, pair_starts.size() - 1, k_pairs); }

void Contour::settle(std::size_t known_pairs) {
  pairs = known_pairs;
  for (Buffer<cl_uint>* buffer : {&pair_contour, &pair_tile, &edge_pairs_, &place_contour_, &places_})
    buffer->settle(known_pairs);
}

std::size_t Contour::capacity_for(std::size_t count) const {
  return std::min(with_headroom(count), std::max(count, pair_contour.capacity()));
}

void Contour::count(const ContourInputs& in) {
  if (view_edges(in) > std::numeric_limits<cl_uint>::max() / DPR_CONTOUR_FLAGS) {
    throw InvalidArgument("edges (frame)", std::to_string(view_edges(in)),
                          "fewer, so that they can be counted");
  }
  pair_starts.resize(device_, view_edges(in) + 1);
  count_(view_edges(in), in.p, params(in), in.edges.edges, in.facing, in.transform.ndc, in.transform.world,
         in.geometry.face_vertices, in.clipped, in.geometry.face_colors(), in.geometry.colors_of(in.p),
         pair_starts);
  scan_(view_edges(in), pair_starts);
}

void Contour::list(const ContourInputs& in, std::size_t capacity) {
  pairs = capacity;
  pair_count.resize(device_, 1);
  for (Buffer<cl_uint>* buffer : {&pair_contour, &pair_tile, &edge_pairs_, &place_contour_, &places_})
    buffer->resize(device_, Length::at_most(pairs));
  const Incidence& corners = in.geometry.vertex_corners;
  // Without edges one work-item still writes the count.
  fill_(std::max<std::size_t>(view_edges(in), 1), in.p, params(in), to_uint(capacity), in.edges.edges,
        in.edges.face_edges, corners.starts, corners.corners, in.facing, in.transform.ndc, in.transform.world,
        in.geometry.face_vertices, in.clipped, in.geometry.face_colors(), in.geometry.colors_of(in.p),
        pair_starts, pair_count, place_contour_, pair_tile, places_);
  sort_(pairs, pair_count, std::size_t{in.p.views} * in.p.tiles_x * in.p.tiles_y, pair_tile, places_,
        tile_starts);
  link_(pairs, to_uint(capacity), pair_count, places_, place_contour_, pair_contour, edge_pairs_);
}

void Contour::gather(const ContourInputs& in, const Buffer<cl_float4>& grad_ends, Buffer<cl_float4>& grad_ndc,
                     Buffer<cl_float4>& grad_clip) {
  const Incidence& corners = in.geometry.vertex_corners;
  gather_(2 * pairs, in.p, params(in), pair_count, pair_contour, pair_starts, edge_pairs_, in.edges.edges,
          in.geometry.face_vertices, in.edges.face_edges, corners.starts, corners.corners, grad_ends,
          grad_ndc);
  if (in.p.clips == 0) return;
  gather_cuts_(std::size_t{in.p.views} * in.p.vertices, in.p, params(in), in.views.cameras, in.edges.edges,
               in.geometry.face_vertices, in.transform.ndc, in.clipped, pair_starts, edge_pairs_,
               in.edges.face_edges, corners.starts, corners.corners, grad_ends, grad_ndc, grad_clip);
}

std::size_t Contour::bytes() const {
  std::size_t bytes = scan_.bytes() + sort_.bytes();
  for (const Buffer<cl_uint>* buffer : {&pair_contour, &pair_tile, &tile_starts, &pair_count, &pair_starts,
                                        &edge_pairs_, &place_contour_, &places_}) {
    bytes += buffer->capacity_bytes();
  }
  return bytes;
}

}  // namespace dpr
