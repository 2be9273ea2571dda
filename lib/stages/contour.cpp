#include "stages/contour.hpp"

#include <algorithm>
#include <limits>

namespace dpr {

void set_edges(shared::FrameParams& p, const Edges& edges, const std::optional<Shading>& shading,
               float depth_reach) {
  p.mesh_edges = to_uint(edges.count);
  p.edges = to_uint(edges.count + (p.clips != 0 ? p.faces : 0));
  p.shading = shading ? static_cast<cl_uint>(*shading) + DPR_FLAT : DPR_UNLIT;
  p.depth_reach = depth_reach;
}

namespace {

std::size_t view_edges(const ContourInputs& in) { return std::size_t{in.p.views} * in.p.edges; }

constexpr const char* k_pairs = "pairs of tiles and contours (frame)";

}  // namespace

void Contour::forward(const ContourInputs& in) {
  count(in);
  const std::size_t found = read_total(pair_starts, view_edges(in), k_pairs);
  list(in, found, found);
  settle(found);
}

void Contour::forward_within(const ContourInputs& in, std::size_t capacity, std::size_t likely) {
  count(in);
  list(in, capacity, likely);
}

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
  kinds_.resize(device_, view_edges(in));
  launch_(view_edges(in), kernel::contour_count{.p = in.p,
                                                .edges = in.edges.edges,
                                                .facing = in.facing,
                                                .ndc = in.transform.ndc,
                                                .world = in.transform.world,
                                                .faces = in.geometry.face_vertices,
                                                .clipped = in.clipped,
                                                .colors = in.geometry.colors_of(in.p),
                                                .normal_faces = in.normal_faces,
                                                .normals = in.normals,
                                                .counts = pair_starts,
                                                .kinds = kinds_});
  scan_(view_edges(in), pair_starts);
}

void Contour::list(const ContourInputs& in, std::size_t capacity, std::size_t likely) {
  pairs = capacity;
  launched = std::min(capacity, likely);
  pair_count.resize(device_, 1);
  for (Buffer<cl_uint>* buffer : {&pair_contour, &pair_tile, &edge_pairs_, &place_contour_})
    buffer->resize(device_, Length::at_most(pairs));
  const Incidence& corners = in.geometry.vertex_corners;
  // Without edges one work-item still writes the count.
  launch_(std::max<std::size_t>(view_edges(in), 1), kernel::contour_fill{.p = in.p,
                                                                         .capacity = to_uint(capacity),
                                                                         .edges = in.edges.edges,
                                                                         .face_edges = in.edges.face_edges,
                                                                         .corner_starts = corners.starts,
                                                                         .corners = corners.corners,
                                                                         .ndc = in.transform.ndc,
                                                                         .faces = in.geometry.face_vertices,
                                                                         .clipped = in.clipped,
                                                                         .kinds = kinds_,
                                                                         .offsets = pair_starts,
                                                                         .pairs = pair_count,
                                                                         .place_contour = place_contour_,
                                                                         .place_tile = pair_tile});
  sort_(pairs, pair_count, std::size_t{in.p.views} * in.p.tiles_x * in.p.tiles_y, pair_tile, places_,
        tile_starts);
  launch_(launched, kernel::bin_link{.pairs = pair_count,
                                     .places = places_,
                                     .place_owner = place_contour_,
                                     .pair_owner = pair_contour,
                                     .owner_pairs = edge_pairs_});
}

void Contour::gather(const ContourInputs& in, const Buffer<cl_float4>& grad_ends, Buffer<cl_float4>& grad_ndc,
                     Buffer<cl_float4>& grad_clip) {
  const Incidence& corners = in.geometry.vertex_corners;
  launch_(2 * launched, kernel::contour_gather{.p = in.p,
                                               .pairs = pair_count,
                                               .pair_contour = pair_contour,
                                               .pair_starts = pair_starts,
                                               .edge_pairs = edge_pairs_,
                                               .edges = in.edges.edges,
                                               .faces = in.geometry.face_vertices,
                                               .face_edges = in.edges.face_edges,
                                               .corner_starts = corners.starts,
                                               .corners = corners.corners,
                                               .grad_ends = grad_ends,
                                               .grad_ndc = grad_ndc});
  if (in.p.clips == 0) return;
  const std::size_t vertices = std::size_t{in.p.views} * in.p.vertices;
  grad_cuts.resize(device_, in.p.distorts != 0 ? DPR_CUT_CHANNELS * vertices : 1);
  launch_(vertices, kernel::contour_drop_near{.p = in.p,
                                              .clipped = in.clipped,
                                              .corner_starts = corners.starts,
                                              .corners = corners.corners,
                                              .grad_ndc = grad_ndc});
  launch_(vertices, kernel::contour_gather_cuts{.p = in.p,
                                                .views = in.views.cameras,
                                                .edges = in.edges.edges,
                                                .faces = in.geometry.face_vertices,
                                                .ndc = in.transform.ndc,
                                                .clipped = in.clipped,
                                                .pair_starts = pair_starts,
                                                .edge_pairs = edge_pairs_,
                                                .face_edges = in.edges.face_edges,
                                                .corner_starts = corners.starts,
                                                .corners = corners.corners,
                                                .grad_ends = grad_ends,
                                                .grad_clip = grad_clip,
                                                .grad_cuts = grad_cuts});
}

std::size_t Contour::bytes() const {
  std::size_t bytes = scan_.bytes() + sort_.bytes() + kinds_.capacity_bytes() + grad_cuts.capacity_bytes();
  for (const Buffer<cl_uint>* buffer : {&pair_contour, &pair_tile, &tile_starts, &pair_count, &pair_starts,
                                        &edge_pairs_, &place_contour_, &places_}) {
    bytes += buffer->capacity_bytes();
  }
  return bytes;
}

}  // namespace dpr
