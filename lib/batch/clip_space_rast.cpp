// What samples of positions in clip space show, as nvdiffrast has it.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>

#include "base/parallel.hpp"
#include "batch/batch.hpp"
#include "batch/inputs.hpp"
#include "c/handles.hpp"
#include "dpr/error.hpp"
#include "renderer/renderer_impl.hpp"

namespace dpr::batch {
namespace {

constexpr float k_plane_rounding = 1e-6F;
constexpr std::int64_t k_most_number = 1 << 24;  // which floats count to

/// One triangle in clip space.
class Corners {
 public:
  Corners(const glm::vec4& a, const glm::vec4& b, const glm::vec4& c)
      : z_(a.z, b.z, c.z), w_(a.w, b.w, c.w), inverse_w_(1 / a.w, 1 / b.w, 1 / c.w) {
    // Slopes of u / w, v / w and 1 / w over NDC: rows of the inverse of the corners' (x, y, w).
    const auto place = [](const glm::vec4& p) { return glm::dvec3(p.x, p.y, p.w); };
    const glm::dvec3 line0 = glm::cross(place(b), place(c)), line1 = glm::cross(place(c), place(a)),
                     line2 = glm::cross(place(a), place(b));
    const double area = glm::dot(line0, place(a)), scale = area == 0 ? 1 : 1 / area;
    of_u_ = glm::vec2(line0 * scale);
    of_v_ = glm::vec2(line1 * scale);
    of_all_ = glm::vec2((line0 + line1 + line2) * scale);
  }

  /// From weights that are linear on the screen to those with perspective.
  glm::vec3 with_perspective(glm::vec3 weights) const {
    weights *= inverse_w_;
    return weights / (weights.x + weights.y + weights.z);
  }
  float depth(const glm::vec3& weights) const { return glm::dot(z_, weights) / glm::dot(w_, weights); }
  /// Of u along x and y, then of v, over pixels of such a size in NDC.
  glm::vec4 steps(const glm::vec3& weights, const glm::vec2& pixel) const {
    const glm::vec2 scale = glm::dot(w_, weights) * pixel;
    return {(of_u_ - weights.x * of_all_) * scale, (of_v_ - weights.y * of_all_) * scale};
  }

 private:
  glm::vec3 z_, w_, inverse_w_;
  glm::vec2 of_u_, of_v_, of_all_;
};

}  // namespace

void Batch::clip_space_rast(NamedArrays arrays, NamedArrays outputs) {
  const dpr_raster size = raster();
  Renderer::Impl& m = impl_of(frame_.renderer());
  if (size.supersampling != 1)
    throw InvalidArgument("supersampling (clip space)", std::to_string(size.supersampling), "1");
  const std::size_t views = m.views.size(), width = static_cast<std::size_t>(m.scene.width),
                    height = static_cast<std::size_t>(m.scene.height);
  const NamedArray &positions = require(arrays, "positions"), &faces = require(arrays, "faces");
  require_form(positions, Element::float32, {{views, k_any, 4}}, "[" + std::to_string(views) + ", V, 4]");
  const bool are_of_views = faces.shape.size() == 3;
  const std::vector<glm::uvec3> corners = read_triples(faces, are_of_views ? views : 1);
  const std::size_t vertices = positions.shape[1], count = corners.size() / (are_of_views ? views : 1);
  if (count != m.frame.faces)
    throw InvalidArgument(argument(faces), text_of(faces.shape), std::to_string(m.frame.faces) + " faces");
  for (const glm::uvec3& face : corners)
    if (const glm::uint most = std::max({face.x, face.y, face.z}); most >= vertices)
      throw InvalidArgument(argument(faces), std::to_string(most),
                            "indices below " + std::to_string(vertices));
  const NamedArray* const firsts = find(arrays, "firsts");
  if (firsts) {
    require_form(*firsts, Element::int64, {{views}}, "[" + std::to_string(views) + "]");
    for (const std::int64_t first : std::span(static_cast<const std::int64_t*>(firsts->data), views))
      if (first < 0 || first > k_most_number)
        throw InvalidArgument(argument(*firsts), std::to_string(first),
                              "0 to " + std::to_string(k_most_number));
  }
  const NamedArray &rast = require(outputs, "rast"), &rast_db = require(outputs, "rast_db");
  for (const NamedArray* const output : {&rast, &rast_db})
    require_floats(*output, {views, height, width, 4}, "[N, H, W, 4]");

  m.find_samples();
  const MappedRead face_of(m.surface_samples->faces);
  const MappedRead places(m.surface_samples->places);
  const auto clip = positions.rows<const glm::vec4>();
  const auto found = rast.rows<glm::vec4>(), found_steps = rast_db.rows<glm::vec4>();
  const bool is_orthographic = m.frame.orthographic != 0;
  const glm::vec2 pixel(2.0F / static_cast<float>(width), 2.0F / static_cast<float>(height));
  const auto margin = static_cast<std::size_t>(size.margin),
             row_samples = static_cast<std::size_t>(size.width),
             view_samples = row_samples * static_cast<std::size_t>(size.height);
  const std::size_t of_layer = (static_cast<std::size_t>(size.layers) - 1) * views * view_samples;
  const auto fill_row = [&](std::size_t row) {
    const std::size_t view = row / height;
    const std::size_t from = of_layer + view * view_samples + (row % height + margin) * row_samples + margin;
    const std::size_t first =
        firsts ? static_cast<std::size_t>(static_cast<const std::int64_t*>(firsts->data)[view]) : 0;
    cl_uint known = DPR_NO_FACE;
    std::optional<Corners> triangle;
    for (std::size_t x = 0; x < width; ++x) {
      const cl_uint face = face_of[from + x];
      glm::vec4 &at = found[row * width + x], &steps = found_steps[row * width + x];
      at = steps = glm::vec4(0);
      if (face == DPR_NO_FACE) continue;
      if (face != known) {
        const glm::uvec3& c = corners[(are_of_views ? view * count : 0) + face];
        const glm::vec4* const shape = &clip[view * vertices];
        triangle.emplace(shape[c.x], shape[c.y], shape[c.z]);
        known = face;
      }
      const cl_float4& place = places[from + x];
      glm::vec3 weights(1 - place.s[0] - place.s[1], place.s[0], place.s[1]);
      if (is_orthographic) weights = triangle->with_perspective(weights);
      const float depth = triangle->depth(weights);
      if (!(std::abs(depth) <= 1 + k_plane_rounding)) continue;
      at = {weights.x, weights.y, depth, static_cast<float>(first + face + 1)};
      steps = triangle->steps(weights, pixel);
    }
  };
  for_each_in_parallel(views * height, fill_row, std::max<std::size_t>(k_least_of_thread / width, 1));
}

}  // namespace dpr::batch

using namespace dpr::c;

dpr_status dpr_clip_space_rast(dpr_frame* frame, const dpr_array* arrays, std::size_t count,
                               const dpr_array* outputs, std::size_t output_count) {
  return guarded([&] {
    deref(frame, "frame")
        .batch->clip_space_rast(dpr::batch::to_arrays(arrays, count, "arrays"),
                                dpr::batch::to_arrays(outputs, output_count, "outputs"));
  });
}
