#include "scene/lens_sides.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "scene/lens.hpp"

namespace dpr {

LensSides::LensSides(const Camera& camera, const glm::mat4& model, int width, int height,
                     double tolerance_pixels)
    : to_camera_(glm::dmat4(camera.view) * glm::dmat4(model)),
      distortion_(camera.distortion.value_or(Distortion{})),
      projection_(projection(camera, width, height)),
      znear_(camera.znear),
      zfar_(camera.zfar),
      pixels_(0.5 * std::min(width, height) * glm::dvec2(projection_.scale)),
      tolerance_(tolerance_pixels),
      largest_radius_(largest_radius(distortion_)),
      visible_radius_(visible_radius(width, height)) {}

double LensSides::visible_radius(int width, int height) const {
  constexpr double k_widest = 1e4, k_least = 1e-4, k_step = 0.99;  // tangents
  const glm::dvec2 half = glm::dvec2(width, height) / static_cast<double>(std::min(width, height));
  double furthest = 0;  // of the image's corners
  for (const glm::dvec2 sign : {glm::dvec2(-1, -1), {-1, 1}, {1, -1}, {1, 1}}) {
    const glm::dvec2 corner = (sign * half - glm::dvec2(projection_.offset)) / glm::dvec2(projection_.scale);
    furthest = std::max(furthest, glm::length(corner));
  }
  const double tangential = 3 * std::hypot(distortion_.p1, distortion_.p2);
  double visible = std::numeric_limits<double>::infinity();
  for (double r = std::min(largest_radius_, k_widest); r > k_least; r *= k_step) {
    if (r * radial_factor(distortion_, r * r) - tangential * r * r < furthest)
      break;  // the least it is shown at
    visible = r;
  }
  return visible;
}

bool LensSides::clip(const glm::dvec3& a, const glm::dvec3& b, Segment& clipped) const {
  const double depth_a = -a.z, depth_b = -b.z;
  if (depth_a < znear_ && depth_b < znear_) return false;
  const auto tangent = [&](const glm::dvec3& p, double depth, const glm::dvec3& other, double other_depth) {
    if (depth >= znear_) return glm::dvec2(p) / depth;
    return glm::dvec2(glm::mix(p, other, (znear_ - depth) / (other_depth - depth))) / znear_;
  };
  clipped = {tangent(a, depth_a, b, depth_b), tangent(b, depth_b, a, depth_a)};
  return true;
}

bool LensSides::may_be_seen(const std::array<glm::dvec3, 3>& corners) const {
  if (-std::max({corners[0].z, corners[1].z, corners[2].z}) > zfar_) return false;
  constexpr double k_infinity = std::numeric_limits<double>::infinity();
  glm::dvec2 low(k_infinity), high(-k_infinity);  // of the tangents
  for (std::size_t side = 0; side < 3; ++side) {
    Segment s{};
    if (!clip(corners[side], corners[(side + 1) % 3], s)) continue;
    low = glm::min(low, glm::min(s.from, s.to));
    high = glm::max(high, glm::max(s.from, s.to));
  }
  if (!(low.x <= high.x)) return false;
  const glm::dvec2 nearest = glm::max(glm::max(low, -high), glm::dvec2(0));  // of the box, to the axis
  return glm::length(nearest) < visible_radius_;
}

/// At three points of it: the difference may be 0 in the middle alone.
bool LensSides::is_off(const Segment& side) const {
  const auto bend = [&](const glm::dvec2& tangents) {
    return distorted(tangents, distortion_, largest_radius_);
  };
  const glm::dvec2 from = bend(side.from), to = bend(side.to);
  return std::ranges::any_of(std::array{0.25, 0.5, 0.75}, [&](double part) {
    const glm::dvec2 shown = bend(glm::mix(side.from, side.to, part));
    return glm::length((shown - glm::mix(from, to, part)) * pixels_) > tolerance_;
  });
}

void LensSides::find(const std::array<glm::dvec3, 3>& corners, std::array<bool, 3>& is_off_side) const {
  std::array<glm::dvec3, 3> seen;
  std::ranges::transform(corners, seen.begin(),
                         [&](const glm::dvec3& p) { return glm::dvec3(to_camera_ * glm::dvec4(p, 1)); });
  if (!may_be_seen(seen)) return;
  for (std::size_t side = 0; side < 3; ++side) {
    Segment s{};
    if (!is_off_side[side] && clip(seen[side], seen[(side + 1) % 3], s)) is_off_side[side] = is_off(s);
  }
}

}  // namespace dpr
