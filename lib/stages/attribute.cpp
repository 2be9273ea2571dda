#include "stages/attribute.hpp"

#include <algorithm>
#include <array>

namespace dpr {

GeometryColors::GeometryColors(Device::Impl& device, Attribute attribute)
    : attribute_(attribute), device_(device), launch_(device) {}

void GeometryColors::forward(const shared::FrameParams& p, const Geometry& geometry,
                             const Transform& transform, Buffer<cl_float4>& colors) {
  const std::size_t count = std::size_t{p.views} * (is_of_faces() ? p.faces : p.vertices);
  colors.resize(device_, count);
  if (is_of_faces()) {
    launch_(count, kernel::attribute_normals_forward{.p = p,
                                                     .shown_views = to_uint(shown_views),
                                                     .faces = geometry.face_vertices,
                                                     .world = transform.world,
                                                     .colors = colors});
  } else {
    launch_(count, kernel::attribute_vertices_forward{.p = p,
                                                      .shows_depth = shows_depth(),
                                                      .shown_views = to_uint(shown_views),
                                                      .world = transform.world,
                                                      .ndc = transform.ndc,
                                                      .colors = colors});
  }
}

void GeometryColors::backward(const shared::FrameParams& p, const Geometry& geometry,
                              const Transform& transform, const Buffer<cl_float4>& grad_colors,
                              Buffer<cl_float4>& grad_depth, Buffer<cl_float4>& grad_world) {
  const std::size_t count = std::size_t{p.views} * p.vertices;
  grad_world.resize(device_, count);
  if (is_of_faces()) {
    launch_(count, kernel::attribute_normals_backward{.p = p,
                                                      .shown_views = to_uint(shown_views),
                                                      .faces = geometry.face_vertices,
                                                      .corner_starts = geometry.vertex_corners.starts,
                                                      .corners = geometry.vertex_corners.corners,
                                                      .world = transform.world,
                                                      .grad_colors = grad_colors,
                                                      .grad_world = grad_world});
  } else {
    launch_(count, kernel::attribute_vertices_backward{.p = p,
                                                       .shows_depth = shows_depth(),
                                                       .shown_views = to_uint(shown_views),
                                                       .grad_colors = grad_colors,
                                                       .grad_depth = grad_depth,
                                                       .grad_world = grad_world});
  }
}

void GeometryColors::tangent(const shared::FrameParams& p, const Geometry& geometry,
                             const Transform& transform, Tangents& tangents) {
  const std::size_t of_direction = std::size_t{p.views} * (is_of_faces() ? p.faces : p.vertices);
  const std::size_t count = tangents.params.directions * of_direction;
  tangents.params.colors = to_uint(of_direction);
  tangents.colors.resize(device_, count);
  if (is_of_faces()) {
    launch_(count, kernel::attribute_normals_tangent{.p = p,
                                                     .q = tangents.params,
                                                     .shown_views = to_uint(shown_views),
                                                     .faces = geometry.face_vertices,
                                                     .world = transform.world,
                                                     .world_tangents = tangents.world,
                                                     .color_tangents = tangents.colors});
  } else {
    launch_(count, kernel::attribute_vertices_tangent{.p = p,
                                                      .q = tangents.params,
                                                      .shows_depth = shows_depth(),
                                                      .shown_views = to_uint(shown_views),
                                                      .world_tangents = tangents.world,
                                                      .ndc_tangents = tangents.ndc,
                                                      .color_tangents = tangents.colors});
  }
}

RowMap::RowMap(Device::Impl& device, std::span<const cl_uint> row_of_shown, std::size_t row_count)
    : rows(row_count), shown(row_of_shown.size()) {
  std::vector<cl_uint> run_starts(rows + 1, 0), in_order(shown);
  for (const cl_uint row : row_of_shown) ++run_starts[row + 1];
  for (std::size_t row = 0; row < rows; ++row) run_starts[row + 1] += run_starts[row];
  std::vector<cl_uint> next(run_starts.begin(), run_starts.end() - 1);
  for (std::size_t i = 0; i < shown; ++i) in_order[next[row_of_shown[i]]++] = to_uint(i);
  row_of.upload(device, row_of_shown);
  starts.upload(device, run_starts);
  shown_by.upload(device, in_order);
}

namespace {

cl_uint4 sizes_of(std::size_t x, std::size_t y, std::size_t z, std::size_t w) {
  return {{to_uint(x), to_uint(y), to_uint(z), to_uint(w)}};
}

}  // namespace

void ShownRows::forward(const RowMap& map, std::size_t channels, const Buffer<float>& values,
                        std::size_t passes, std::size_t views, Buffer<cl_float4>& colors) {
  const std::size_t count = passes * views * map.shown;
  colors.resize(device_, count);
  launch_(count, kernel::attribute_rows_forward{.size = sizes_of(passes, views, map.shown, channels),
                                                .row_of = map.row_of,
                                                .values = values,
                                                .colors = colors});
}

void ShownRows::backward(const RowMap& map, std::size_t channels, std::size_t views,
                         const Buffer<cl_float4>& grad_colors, Buffer<float>& grad) {
  grad.resize(device_, map.rows * channels);
  launch_(map.rows * channels,
          kernel::attribute_rows_backward{.size = sizes_of(map.rows, views, map.shown, channels),
                                          .starts = map.starts,
                                          .shown_by = map.shown_by,
                                          .grad_colors = BufferRef<float>(grad_colors.cl_buffer()()),
                                          .grad = grad});
}

void ShownRows::move(const RowMap& map, std::size_t sources, const Buffer<cl_float4>& positions,
                     std::size_t copies, Buffer<cl_float4>& moved) {
  moved.resize(device_, copies * map.shown);
  launch_(copies * map.shown,
          kernel::attribute_positions_forward{.size = sizes_of(copies, sources, map.shown, map.rows),
                                              .vertex_of = map.row_of,
                                              .positions = positions,
                                              .moved = moved});
}

void ShownRows::move_backward(const RowMap& map, std::size_t sources, const Buffer<cl_float4>& grad_moved,
                              std::size_t copies, Buffer<cl_float4>& grad) {
  grad.resize(device_, sources * map.rows);
  launch_(sources * map.rows,
          kernel::attribute_positions_backward{.size = sizes_of(copies, sources, map.shown, map.rows),
                                               .starts = map.starts,
                                               .shown_by = map.shown_by,
                                               .grad_moved = grad_moved,
                                               .grad = grad});
}

CornerTexcoords::CornerTexcoords(Device::Impl& device, const Scene& scene) {
  std::vector<cl_uint> row_of_corner;
  std::vector<float> numbers;
  first = {0};
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const Mesh& mesh = mesh_of(scene, m);
    if (mesh.face_texcoords.empty()) return;
    const std::size_t base = first[scene.meshes[m].instance_of.value_or(m)];
    for (const glm::uvec3& face : mesh.face_texcoords) {
      for (int corner = 0; corner < 3; ++corner) row_of_corner.push_back(to_uint(base + face[corner]));
    }
    const std::vector<glm::vec2>& own = scene.meshes[m].mesh.texcoords;  // an instance has none
    for (const glm::vec2& uv : own) numbers.insert(numbers.end(), {uv.x, uv.y});
    first.push_back(first.back() + own.size());
  }
  values.upload(device, numbers);
  map = RowMap(device, row_of_corner, first.back());
}

void CornerTexcoords::update(const Geometry& geometry, Exchange& exchange) {
  for (std::size_t m = 0; !empty() && m < geometry.meshes.size(); ++m) {
    const MeshRange& range = geometry.meshes[m];
    // Without textures they are what the scene began with; an instance's are its mesh's.
    if (range.texcoords == 0 || first[m] == first[m + 1]) continue;
    exchange.give(vectors_of(geometry.textures.texcoord_values, range.first_texcoord, k_channels),
                  range.texcoords, vectors_of(values, k_channels * first[m], k_channels));
  }
}

}  // namespace dpr
