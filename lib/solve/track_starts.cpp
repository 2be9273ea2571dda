// Starts of a search.
#include "solve/track_starts.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "scene/lens.hpp"
#include "solve/pose_beam.hpp"
#include "solve/resample.hpp"

namespace dpr {
namespace {

/// World place that a camera sees at a place of the image, at a depth.
glm::dvec3 seen_at(const Scene& scene, const glm::dvec2& ndc, double depth) {
  const Projection p = projection(scene.camera, scene.width, scene.height);
  const double unit = scene.camera.orthographic_height ? 1.0 : depth;
  const glm::dvec2 seen = (ndc - glm::dvec2(p.offset)) / glm::dvec2(p.scale);
  const glm::dvec2 xy = unit * undistorted(seen, scene.camera.distortion);
  return glm::dvec3(glm::inverse(glm::dmat4(scene.camera.view)) * glm::dvec4(xy.x, xy.y, -depth, 1));
}

/// Places of a lattice over the image, as close as the object is large, but few.
std::vector<glm::dvec2> lattice(const Scene& scene, double radius_ndc) {
  constexpr int k_most = 3;  // along an axis
  const double shorter = std::min(scene.width, scene.height);
  const glm::dvec2 half(scene.width / shorter, scene.height / shorter);  // NDC
  const auto count = [&](double side) {
    return std::clamp(static_cast<int>(std::lround(side / radius_ndc)), 1, k_most);
  };
  const glm::ivec2 counts(count(half.x), count(half.y));
  std::vector<glm::dvec2> result;
  for (int row = 0; row < counts.y; ++row) {
    for (int column = 0; column < counts.x; ++column)
      result.push_back(half * (2.0 * (glm::dvec2(column, row) + 0.5) / glm::dvec2(counts) - 1.0));
  }
  return result;
}

}  // namespace

std::vector<Hypothesis> hypotheses_about(const Pose& pose, const PoseSpace& space, const Scene& scene,
                                         bool solves_translation) {
  constexpr double k_turn = 0.7;   // radians
  constexpr double k_shift = 0.6;  // of the object's radius
  const glm::dmat3 axes = glm::transpose(glm::dmat3(scene.camera.view));
  std::vector<glm::dvec3> shifts{glm::dvec3(0)};
  if (solves_translation) {
    for (const double side : {-1.0, 1.0}) {
      for (int axis = 0; axis < 2; ++axis)
        shifts.push_back(side * k_shift * space.radius() * glm::normalize(axes[axis]));
    }
  }
  std::vector<Hypothesis> result;
  for (const glm::dvec3& shift : shifts) {
    result.push_back({{pose.rotation, pose.translation + shift}});
    for (const double side : {-1.0, 1.0}) {
      for (int axis = 0; axis < 3; ++axis) {
        glm::dvec3 turn(0);
        turn[axis] = side * k_turn;
        result.push_back({{rotation_from_vector(turn) * pose.rotation, pose.translation + shift}});
      }
    }
  }
  return result;
}

std::vector<Hypothesis> hypotheses_everywhere(const glm::dvec3& place, const PoseSpace& space,
                                              const Scene& scene, std::size_t rotations,
                                              bool solves_translation) {
  std::vector<glm::dvec3> places{place};
  const double depth = view_depth(scene.camera, place);
  if (solves_translation && depth > static_cast<double>(scene.camera.znear)) {
    for (const glm::dvec2& ndc : lattice(scene, space.radius_ndc()))
      places.push_back(seen_at(scene, ndc, depth));
  }
  std::vector<Hypothesis> result;
  for (const glm::dvec3& at : places) {
    const std::vector<Hypothesis> here =
        hypotheses_at(at, std::max<std::size_t>(rotations / places.size(), 1));
    result.insert(result.end(), here.begin(), here.end());
  }
  return result;
}

}  // namespace dpr
