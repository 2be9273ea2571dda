#include "stages/contour.hpp"

#include <limits>

namespace dpr {

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
