#include "solve/level_scene.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "mesh/cluster_vertices.hpp"
#include "mesh/opacity.hpp"
#include "mesh/solid.hpp"
#include "scene/gradient_table.hpp"
#include "solve/resample.hpp"

namespace dpr {
namespace {

int scaled(int size, int short_side, int shorter) {
  return std::max(1, static_cast<int>(std::lround(static_cast<double>(size) * shorter / short_side)));
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

/// How large a mesh is seen.
struct Seen {
  double radius = 0;         ///< about its origin, world
  double world_per_ndc = 0;  ///< where it is nearest
};

/// [mesh]. The body may be at its place alone, the others are where they stand.
std::vector<Seen> seen_meshes(const Scene& scene, const PoseSpace& space) {
  const double at_object = space.radius() / space.radius_ndc();
  std::vector<Seen> seen(scene.meshes.size());
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const glm::dmat4 view(scene.camera.view), transform(scene.meshes[i].transform);
    double squared_radius = 0, nearest = static_cast<double>(scene.camera.zfar);
    for (const glm::vec3& p : mesh_of(scene, i).positions) {
      const glm::dvec3 arm = glm::dmat3(transform) * glm::dvec3(p);
      squared_radius = std::max(squared_radius, glm::dot(arm, arm));
      nearest = std::min(nearest, -(view * (transform[3] + glm::dvec4(arm, 0))).z);
    }
    nearest = std::max(nearest, static_cast<double>(scene.camera.znear));
    seen[i] = {std::sqrt(squared_radius), at_object * space.relative_distance(nearest)};
  }
  for (const BodyPart& part : space.body().parts()) seen[part.mesh].world_per_ndc = at_object;
  if (seen.size() == 1) seen.front().radius = space.radius();
  return seen;
}

/// World lengths over those of the mesh.
double object_scale(const Mesh& mesh, const Seen& seen) {
  double squared_radius = 0;
  for (const glm::vec3& p : mesh.positions) squared_radius = std::max(squared_radius, double{glm::dot(p, p)});
  return squared_radius > 0 ? seen.radius / std::sqrt(squared_radius) : 1;
}

/// The least side of a pixel at the mesh, wherever it stands, object space.
double pixel_at(const Scene& scene, std::size_t mesh, const std::vector<Seen>& seen) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (scene.meshes[i].instance_of.value_or(i) != mesh) continue;
    const double world = seen[i].world_per_ndc * 2.0 / std::min(scene.width, scene.height);
    least = std::min(least, world / object_scale(mesh_of(scene, mesh), seen[i]));
  }
  return least;
}

/// Triangles smaller than the pixels cost time and show little.
void simplify(Scene& scene, const std::vector<Seen>& seen) {
  constexpr double k_fine = 0.8, k_cell = 1;  // of a pixel
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (scene.meshes[i].instance_of) continue;
    Mesh& mesh = scene.meshes[i].mesh;
    const double pixel = pixel_at(scene, i, seen);
    if (mean_side(mesh) < k_fine * pixel) mesh = cluster_vertices(mesh, static_cast<float>(k_cell * pixel));
    for (Texture& texture : mesh.textures) texture.filter = Filter::trilinear;
  }
}

/// The sides of faces that no sharp image shows: those inside solids, where all wind alike. None where a mesh is open
/// or seen through.
Cull inner_sides(const Scene& scene) {
  int winding = 0;
  for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
    const Mesh& mesh = mesh_of(scene, i);
    if (is_see_through(mesh)) return Cull::none;
    const Solid solid(make_edges(mesh.faces, mesh.positions.size()), mesh.faces.size());
    const bool is_mirrored = glm::determinant(glm::dmat3(glm::dmat4(scene.meshes[i].transform))) < 0;
    const int own = (is_mirrored ? -1 : 1) * solid.winding(mesh.positions, mesh.faces);
    if (own == 0 || own == -winding) return Cull::none;
    winding = own;
  }
  return winding > 0 ? Cull::back : Cull::front;
}

/// Least side of a mesh's triangle of mean area, in pixels.
double side_in_pixels(const Scene& scene, const std::vector<Seen>& seen) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (!scene.meshes[i].instance_of)
      least = std::min(least, mean_side(scene.meshes[i].mesh) / pixel_at(scene, i, seen));
  }
  return least;
}

/// The solver's own member of the family: the expected rigid image, edges blurred by a part of a pixel,
/// depths by the same length in the world. Where triangles have noise of their own, those smaller than the
/// blur would fade: it is no more than a part of their side.
Smoothing level_smoothing(const Scene& scene, const PoseSpace& space, const std::vector<Seen>& seen,
                          const LeastSquares& options, float blur) {
  constexpr double k_of_side = 0.25;
  // Fainter fragments cost as much and say little. With a robust loss a few degrees depend on them.
  constexpr float k_least_occupancy = 1e-2F;
  const double pixel_ndc = 2.0 / std::min(scene.width, scene.height);
  const double world_per_ndc = space.radius() / space.radius_ndc();
  const double side_pixels = side_in_pixels(scene, seen);
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
  const std::vector<Seen> seen = seen_meshes(scene, space);
  // The answer comes from the meshes and the textures themselves.
  const bool is_last = shape.short_side == full && shape.blur <= options.blur_end;
  // Images of depths without the far sides lose some of a solid's equal poses.
  const bool shows_depths = !options.depth.image.pixels.empty();
  if (!is_last && !shows_depths && scene.cull == Cull::none) result.cull = inner_sides(scene);
  if (shape.short_side < full) simplify(result, seen);
  result.smoothing = level_smoothing(result, space, seen, options, shape.blur);
  result.gradients = no_gradients();
  if (light != PoseLight::fixed) {  // unlit over black: NormalSums adds both
    result.lights.reset();
    result.background = glm::vec3(0);
  }
  return result;
}

}  // namespace dpr
