#include "solve/shape_space.hpp"

#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "base/checks.hpp"
#include "mesh/bounding_box.hpp"
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

}  // namespace

Mesh with_vertex_colors(Mesh mesh) {
  Mesh shape;
  shape.positions = std::move(mesh.positions);
  shape.faces = std::move(mesh.faces);
  shape.vertex_colors = std::move(mesh.vertex_colors);
  if (shape.vertex_colors.empty()) shape.vertex_colors.assign(shape.positions.size(), glm::vec3(0.5F));
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
