// Fingerprint of a fit's views, start and options, by which a checkpoint is recognised.
#include "base/hash.hpp"
#include "scene/lens.hpp"
#include "scene/light_table.hpp"
#include "solve/shape_state.hpp"

namespace dpr {
namespace {

void add(Hash& hash, const Camera& camera) {
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) hash.add(camera.view[column][row]);
  }
  const Intrinsics k = camera.intrinsics.value_or(Intrinsics{});
  for (const float value : {camera.fov_y_degrees, camera.znear, camera.zfar, k.fx, k.fy, k.cx, k.cy})
    hash.add(value);
  if (camera.distortion) {
    for (const float value : coefficients(*camera.distortion)) hash.add(value);
    if (is_fisheye(camera)) hash.add(1);  // not Brown's without k3
  }
  if (camera.orthographic_height) hash.add(*camera.orthographic_height);
}

void add(Hash& hash, const Mesh& mesh) {
  for (const auto* list : {&mesh.positions, &mesh.vertex_colors}) {
    for (const glm::vec3& v : *list) hash.add(v);
  }
  for (const glm::uvec3& f : mesh.faces) {
    for (int i = 0; i < 3; ++i) hash.add(f[i]);
  }
}

void add(Hash& hash, const Smoothing& s) {
  for (const int value :
       {static_cast<int>(s.occupancy_prior), static_cast<int>(s.depth_prior), static_cast<int>(s.composition),
        static_cast<int>(s.occupancy_estimator), static_cast<int>(s.aggregation_estimator),
        static_cast<int>(s.variance_reduction), static_cast<int>(s.draws), static_cast<int>(s.distance),
        static_cast<int>(s.occupancy_width), static_cast<int>(s.samples), static_cast<int>(s.noise),
        static_cast<int>(s.supersampling)}) {
    hash.add(value);
  }
  for (const float value : {s.sigma, s.gamma, s.alpha, s.occupancy_threshold, s.blur_radius.value_or(-1.0F),
                            s.background_depth}) {
    hash.add(value);
  }
  hash.add(s.seed);
}

void add(Hash& hash, const Lights& lights) {
  hash.add(lights.harmonics.size());
  for_each_light_kind([&](auto kind) { hash.add((lights.*kind.lights).size()); });
  Lights numbers = lights;
  for_each_light_number(numbers, [&](std::string_view, float number) { hash.add(number); });
  hash.add(lights.shininess);
  hash.add(static_cast<int>(lights.shading));
}

void add(Hash& hash, const ShapeOptions& o) {
  for (const unsigned value : {o.levels, o.iterations, o.batch, o.remesh_interval,
                               static_cast<unsigned>(o.steps), static_cast<unsigned>(o.schedule)})
    hash.add(value);
  for (const float value :
       {o.edge_pixels, o.blur, o.blur_end, o.lambda, o.loss.mse, o.loss.l1, o.loss.silhouette, o.loss.robust,
        o.loss.robust_scale, o.loss.ssim, o.regularizers.laplacian, o.regularizers.edge_length,
        o.regularizers.normal_consistency, o.regularizers.flatness, o.regularizers.edge_target, o.rigidity}) {
    hash.add(value);
  }
  hash.add(o.learning_rate);
  hash.add(o.learning_rate_end);
  hash.add(o.color_learning_rate);
  if (o.refine_cameras) hash.add(o.camera_learning_rate);
}

/// Depths or normals and what they weigh, if there are any.
void add_measured(Hash& hash, const Image& measured, float weight) {
  if (measured.pixels.empty()) return;
  hash.add(weight);
  for (const glm::vec4& pixel : measured.pixels) {
    for (int i = 0; i < 4; ++i) hash.add(pixel[i]);
  }
}

}  // namespace

std::uint64_t fingerprint(const ShapeViews& views, const Mesh& start, const ShapeOptions& options) {
  Hash hash;
  hash.add(views.width);
  hash.add(views.height);
  hash.add(views.background);
  for (const ShapeView& view : views.views) {
    for (const glm::vec4& pixel : view.image.pixels) {
      for (int i = 0; i < 4; ++i) hash.add(pixel[i]);
    }
    for (const glm::vec4& pixel : view.mask.pixels) hash.add(pixel.x);
    add_measured(hash, view.depth, options.depth);
    add_measured(hash, view.normal, options.normal);
    add(hash, view.camera);
    hash.add(static_cast<int>(view.has_alpha));
  }
  if (views.smoothing) add(hash, *views.smoothing);
  if (views.lights) add(hash, *views.lights);
  add(hash, start);
  add(hash, options);
  return hash.value();
}

}  // namespace dpr
