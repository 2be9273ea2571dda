#include "solve/shape_space.hpp"

#include <algorithm>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "base/checks.hpp"
#include "dpr/texture_map.hpp"
#include "mesh/bounding_box.hpp"
#include "mesh/face_texture.hpp"
#include "solve/resample.hpp"

namespace dpr {
namespace {

/// The point with the least sum of squared distances to the cameras' axes. Axes that are parallel, or one
/// alone, leave it open; then it is the nearest to the middle of the initial mesh, or to the origin.
glm::dvec3 meeting_point(const ShapeViews& views) {
  constexpr double k_towards_middle = 1e-9;
  glm::dmat3 sum(k_towards_middle);
  glm::dvec3 right(0.0);
  if (views.initial) right = k_towards_middle * glm::dvec3(center(bounding_box(views.initial->positions)));
  for (const ShapeView& view : views.views) {
    const Projection p = projection(view.camera, views.width, views.height);
    const glm::dmat4 to_world = glm::inverse(glm::dmat4(view.camera.view));
    const glm::dvec3 eye(to_world[3]);
    // An orthographic camera has no offset.
    const glm::dvec3 axis = glm::normalize(
        glm::dmat3(to_world) * glm::dvec3(-p.offset.x / p.scale.x, -p.offset.y / p.scale.y, -1.0));
    const glm::dmat3 across = glm::dmat3(1.0) - glm::outerProduct(axis, axis);
    sum += across;
    right += across * eye;
  }
  return glm::inverse(sum) * right;
}

constexpr glm::vec3 k_grey(0.5F);

/// The textures' colours of corners, [3 face + corner]; white where a face has no texture.
std::vector<glm::vec3> texture_colors(const Mesh& mesh) {
  std::vector<glm::vec3> colors(3 * mesh.faces.size(), glm::vec3(1));
  std::vector<std::vector<std::size_t>> corners_of(mesh.textures.size());
  for (std::size_t i = 0; i < colors.size(); ++i) {
    if (const std::uint32_t texture = texture_of(mesh, i / 3); texture != k_no_texture)
      corners_of[texture].push_back(i);
  }
  for (std::size_t t = 0; t < mesh.textures.size(); ++t) {
    const std::vector<std::size_t>& corners = corners_of[t];
    std::vector<float> coordinates;
    for (const std::size_t i : corners) {
      const glm::vec2 uv = mesh.texcoords[mesh.face_texcoords[i / 3][static_cast<int>(i % 3)]];
      coordinates.insert(coordinates.end(), {uv.x, uv.y});
    }
    const TextureMap map(mesh.textures[t]);
    const std::vector<float> values = map.values({coordinates});
    for (std::size_t k = 0; k < corners.size(); ++k) {
      for (int c = 0; c < 3; ++c)
        colors[corners[k]][c] = values[k * map.channels() + static_cast<std::size_t>(c)];
    }
  }
  return colors;
}

/// The mean of each vertex' colours in its faces, by their area.
std::vector<glm::vec3> mean_colors(const Mesh& mesh) {
  std::vector<glm::vec3> corners = texture_colors(mesh), colors;
  std::vector<glm::dvec4> sums(mesh.positions.size(), glm::dvec4(0));  // the last is the weight
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const glm::uvec3& face = mesh.faces[i / 3];
    const std::uint32_t vertex = face[static_cast<int>(i % 3)];
    if (!mesh.face_colors.empty()) corners[i] *= mesh.face_colors[i / 3];
    if (!mesh.vertex_colors.empty()) corners[i] *= mesh.vertex_colors[vertex];
    const glm::dvec3 a(mesh.positions[face.x]), b(mesh.positions[face.y]), c(mesh.positions[face.z]);
    // Faces without area count where there are no others.
    const double weight = glm::length(glm::cross(b - a, c - a)) + std::numeric_limits<double>::min();
    sums[vertex] += weight * glm::dvec4(corners[i], 1);
  }
  for (const glm::dvec4& sum : sums)
    colors.push_back(sum.w > 0 ? glm::vec3(glm::dvec3(sum) / sum.w) : k_grey);
  return colors;
}

}  // namespace

Mesh with_vertex_colors(Mesh mesh) {
  Mesh shape;
  if (!mesh.textures.empty() || !mesh.face_colors.empty()) {
    shape.vertex_colors = mean_colors(mesh);
  } else {
    shape.vertex_colors = std::move(mesh.vertex_colors);
  }
  shape.positions = std::move(mesh.positions);
  shape.faces = std::move(mesh.faces);
  if (shape.vertex_colors.empty()) shape.vertex_colors.assign(shape.positions.size(), k_grey);
  return shape;
}

void require_known_cameras(const ShapeViews& views, const std::string& where) {
  for (std::size_t i = 0; i < views.views.size(); ++i) {
    if (views.views[i].knowledge == CameraKnowledge::known) continue;
    throw InvalidArgument(checks::in(checks::element("views", i) + ".camera", where), "one that is not known",
                          "one that is: find_camera() finds it");
  }
}

CommonView common_view(const ShapeViews& views) {
  constexpr double k_part_of_view = 0.5, k_part_of_depth = 0.9;
  CommonView common;
  common.centre = meeting_point(views);
  common.radius = std::numeric_limits<double>::max();
  const auto count = static_cast<double>(views.views.size());
  for (std::size_t i = 0; i < views.views.size(); ++i) {
    const Camera& camera = views.views[i].camera;
    const Projection p = projection(camera, views.width, views.height);
    const double depth = view_depth(camera, common.centre);
    if (!(depth > camera.znear && depth < camera.zfar)) {
      throw InvalidArgument(
          checks::element("views", i) + ".camera (shape)",
          "a depth of " + checks::text(depth) + " of the point that the cameras look at",
          "between znear, " + checks::text(camera.znear) + ", and zfar, " + checks::text(camera.zfar));
    }
    const double divisor = camera.orthographic_height ? 1.0 : depth;
    const double world_per_ndc = divisor / static_cast<double>(std::max(p.scale.x, p.scale.y));
    const double to_planes = std::min(depth - camera.znear, camera.zfar - depth);
    common.radius = std::min({common.radius, k_part_of_view * world_per_ndc, k_part_of_depth * to_planes});
    common.pixel += 2.0 / std::min(views.width, views.height) * world_per_ndc / count;
    common.depth_range += static_cast<double>(camera.zfar - camera.znear) / count;
  }
  return common;
}

}  // namespace dpr
