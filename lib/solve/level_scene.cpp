#include "solve/level_scene.hpp"

#include <algorithm>
#include <cmath>

#include "mesh/cluster_vertices.hpp"
#include "scene/gradient_table.hpp"
#include "solve/resample.hpp"

namespace dpr {
namespace {

int scaled(int size, int short_side, int shorter) {
  return std::max(1, static_cast<int>(std::lround(static_cast<double>(size) * shorter / short_side)));
}

/// World lengths over those of the object.
double object_scale(const Mesh& mesh, const PoseSpace& space) {
  double squared_radius = 0;
  for (const glm::vec3& p : mesh.positions) squared_radius = std::max(squared_radius, double{glm::dot(p, p)});
  return squared_radius > 0 ? space.radius() / std::sqrt(squared_radius) : 1;
}

/// The side of a triangle of mean area, object space.
double mean_side(const Mesh& mesh) {
  double area = 0;
  for (const glm::uvec3& face : mesh.faces) {
    const glm::dvec3 a(mesh.positions[face.x]), b(mesh.positions[face.y]), c(mesh.positions[face.z]);
    area += glm::length(glm::cross(b - a, c - a)) / 2;
  }
  return std::sqrt(2 * area / static_cast<double>(mesh.faces.size()));
}

/// The side of a pixel at the object, object space.
double pixel_at_object(const Scene& scene, const PoseSpace& space) {
  const double world_per_ndc = space.radius() / space.radius_ndc();
  return world_per_ndc * 2.0 / std::min(scene.width, scene.height) /
         object_scale(scene.meshes.front().mesh, space);
}

/// Triangles smaller than the pixels cost time and show little.
void simplify(Scene& scene, const PoseSpace& space) {
  constexpr double k_fine = 0.8, k_cell = 1;  // of a pixel
  Mesh& mesh = scene.meshes.front().mesh;
  const double pixel = pixel_at_object(scene, space);
  if (mean_side(mesh) < k_fine * pixel) mesh = cluster_vertices(mesh, static_cast<float>(k_cell * pixel));
}

/// The solver's own member of the family: the expected rigid image, edges blurred by a part of a pixel,
/// depths by the same length in the world. Where triangles have noise of their own, those smaller than the
/// blur would fade: it is no more than a part of their side.
Smoothing level_smoothing(const Scene& scene, const PoseSpace& space, const LeastSquares& options,
                          float blur) {
  constexpr double k_of_side = 0.25;
  // Fainter fragments cost as much and say little. With a robust loss a few degrees depend on them.
  constexpr float k_least_occupancy = 1e-2F;
  const double pixel_ndc = 2.0 / std::min(scene.width, scene.height);
  const double world_per_ndc = space.radius() / space.radius_ndc();
  const double side_pixels = mean_side(scene.meshes.front().mesh) / pixel_at_object(scene, space);
  const double least = static_cast<double>(std::min(blur, options.blur_end));
  const bool of_pixel = options.noise == Noise::pixel;
  const double most = of_pixel ? static_cast<double>(blur) : k_of_side * side_pixels;
  const double blur_ndc = std::clamp(most, least, static_cast<double>(blur)) * pixel_ndc;
  Smoothing smoothing = smoothing_preset(of_pixel ? "pixel" : "joint_gaussian");
  smoothing.distance = DistanceMetric::euclidean;
  smoothing.sigma = static_cast<float>(blur_ndc);
  if (!options.robust && !of_pixel) smoothing.occupancy_threshold = k_least_occupancy;
  smoothing.gamma = static_cast<float>(blur_ndc * world_per_ndc) / (scene.camera.zfar - scene.camera.znear);
  return smoothing;
}

}  // namespace

Scene level_scene(const Scene& scene, const PoseSpace& space, const LeastSquares& options,
                  const LevelShape& shape, PoseLight light) {
  const int full = std::min(scene.width, scene.height);
  Scene result = scene;
  result.width = shape.samples * scaled(scene.width, full, shape.short_side);
  result.height = shape.samples * scaled(scene.height, full, shape.short_side);
  result.camera = resample(scene.camera, scene.width, scene.height, result.width, result.height);
  if (shape.short_side < full) {  // the answer comes from the mesh and the textures themselves
    simplify(result, space);
    for (Texture& texture : result.meshes.front().mesh.textures) texture.filter = Filter::trilinear;
  }
  result.smoothing = level_smoothing(result, space, options, shape.blur);
  result.gradients = no_gradients();
  if (light != PoseLight::fixed) {  // unlit over black: NormalSums adds both
    result.lights.reset();
    result.background = glm::vec3(0);
  }
  return result;
}

}  // namespace dpr
