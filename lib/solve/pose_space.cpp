// Tangent steps of poses.
#include "solve/pose_space.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "scene/lens.hpp"
#include "solve/median.hpp"
#include "solve/polar.hpp"
#include "solve/resample.hpp"
#include "solve/rotation_grid.hpp"

namespace dpr {
namespace {

constexpr std::size_t k_translation = 3;  // where its parameters begin

/// The lens that a camera has, and where it is not known some as strong as there are.
std::vector<Camera> possible_lenses(const Camera& camera, bool is_unknown) {
  constexpr double k_strong = 0.3;
  std::vector<Camera> cameras;
  if (camera.distortion) cameras.push_back(camera);
  if (is_unknown) {
    for (const double k1 : {-k_strong, k_strong}) cameras.push_back(calibrated(camera, 1, {k1, 0}));
  }
  return cameras;
}

}  // namespace

Camera calibrated(const Camera& camera, double focal_scale, const glm::dvec2& radial) {
  Camera result = focal_scale == 1 ? camera : zoomed(camera, focal_scale);
  if (radial == glm::dvec2(0)) return result;
  Distortion distortion = camera.distortion.value_or(Distortion{});
  distortion.k1 += static_cast<float>(radial.x);
  distortion.k2 += static_cast<float>(radial.y);
  result.distortion = distortion;
  return result;
}

PoseSpace::PoseSpace(const Scene& scene, const Pose& initial, const PoseOptions& options)
    : body_(scene, options.meshes),
      initial_translation_(initial.translation),
      translation_(options.solve_translation),
      focal_(options.solve_focal),
      distortion_(options.solve_distortion),
      is_perspective_(!scene.camera.orthographic_height),
      focal_index_(k_translation + (translation_ ? 3 : 0)),
      radial_index_(focal_index_ + (focal_ ? 1 : 0)),
      size_(radial_index_ + (distortion_ ? 2 : 0)) {
  camera_axes_ = glm::transpose(polar_decomposition(glm::dmat3(glm::dmat4(scene.camera.view)))
                                    .rotation);  // columns: the axes in the world
  double squared_radius = 0;
  for (const glm::dvec3& p : body_.points(scene)) squared_radius = std::max(squared_radius, glm::dot(p, p));
  radius_ = std::sqrt(std::max(squared_radius, 1e-30));
  look(scene);
}

PoseSpace PoseSpace::seen_by(const Scene& scene) const {
  PoseSpace result = *this;
  result.look(scene);
  return result;
}

void PoseSpace::look(const Scene& scene) {
  // An object about or behind the camera still needs units to move in.
  const glm::dvec3 centre(glm::dmat4(scene.camera.view) * glm::dvec4(initial_translation_, 1.0));
  distance_ = std::max(-centre.z, static_cast<double>(scene.camera.znear));
  rim_ = (glm::length(glm::dvec2(centre)) + radius_) / distance_;
  if (is_fisheye(scene.camera)) rim_ = std::atan(rim_);
  const glm::vec2 scale = projection(scene.camera, scene.width, scene.height).scale;
  const double divisor = is_perspective_ ? distance_ : 1.0;
  ndc_per_tangent_ = static_cast<double>(std::max(scale.x, scale.y));
  radius_ndc_ = radius_ / divisor * ndc_per_tangent_;
}

Hypothesis PoseSpace::moved(const Hypothesis& from, const Step& step) const {
  Hypothesis result = from;
  const glm::dmat3 turned = rotation_from_vector({step[0], step[1], step[2]}) * from.pose.rotation;
  result.pose.rotation = polar_decomposition(turned).rotation;  // keeps rounding errors from adding up
  if (translation_) {
    result.pose.translation +=
        camera_axes_ * glm::dvec3(step[k_translation], step[k_translation + 1], step[k_translation + 2]);
  }
  if (focal_) result.focal_scale *= std::exp(step[focal_index_]);
  if (distortion_) result.radial += glm::dvec2(step[radial_index_], step[radial_index_ + 1]);
  return result;
}

PoseSpace::Step PoseSpace::step_lengths(double ndc) const {
  const double fraction = ndc / radius_ndc_;  // of the object's radius
  Step lengths{};
  std::fill_n(lengths.begin(), k_translation, fraction);
  if (translation_) {
    lengths[k_translation] = lengths[k_translation + 1] = fraction * radius_;
    lengths[k_translation + 2] = fraction * distance_;  // towards the camera an object only grows
  }
  if (focal_) lengths[focal_index_] = fraction;
  if (distortion_) {
    lengths[radial_index_] = ndc / (ndc_per_tangent_ * std::pow(rim_, 3));
    lengths[radial_index_ + 1] = ndc / (ndc_per_tangent_ * std::pow(rim_, 5));
  }
  return lengths;
}

double PoseSpace::length(const Step& step) const {
  const Step unit = step_lengths(1);
  double greatest = 0;
  for (std::size_t i = 0; i < size_; ++i) greatest = std::max(greatest, std::abs(step[i]) / unit[i]);
  return greatest;
}

double PoseSpace::distance(const Hypothesis& a, const Hypothesis& b) const {
  const glm::dvec3 r = vector_from_rotation(b.pose.rotation * glm::transpose(a.pose.rotation));
  Step step{r.x, r.y, r.z};
  if (translation_) {
    const glm::dvec3 t = glm::transpose(camera_axes_) * (b.pose.translation - a.pose.translation);
    for (int i = 0; i < 3; ++i) step[k_translation + static_cast<std::size_t>(i)] = t[i];
  }
  return length(step);
}

View PoseSpace::view(const Hypothesis& hypothesis, const Camera& camera) const {
  Camera seen = calibrated(camera, hypothesis.focal_scale, hypothesis.radial);
  if (distortion_ && !seen.distortion)
    seen.distortion.emplace();  // a perfect lens, whose tangents are asked for
  return {seen, body_.transforms(hypothesis.pose)};
}

ViewGradient PoseSpace::view_tangent(const Hypothesis& hypothesis, const Camera& camera,
                                     std::size_t parameter) const {
  ViewGradient tangent{.camera = {}, .transforms = body_.shifting(glm::dvec3(0))};
  if (parameter < k_translation) {
    tangent.transforms = body_.turning(hypothesis.pose, glm::dmat3(1.0)[static_cast<int>(parameter)]);
  } else if (parameter < focal_index_) {
    tangent.transforms = body_.shifting(camera_axes_[static_cast<int>(parameter - k_translation)]);
  } else if (parameter < radial_index_) {
    tangent.camera = zoom_tangent(calibrated(camera, hypothesis.focal_scale, hypothesis.radial));
  } else {
    const std::size_t k = parameter - radial_index_;
    (is_fisheye(camera) ? tangent.camera.fisheye[k] : tangent.camera.distortion[k]) = 1;
  }
  return tangent;
}

Hypothesis PoseSpace::absent(const Camera& camera) const {
  const glm::dmat4 to_world = glm::inverse(glm::dmat4(camera.view));
  return {{glm::dmat3(1.0), glm::dvec3(to_world[3]) + 2 * radius_ * glm::normalize(glm::dvec3(to_world[2]))}};
}

bool PoseSpace::may_cover(const Image& depths) const {
  constexpr double k_stray = 0.05;  // of a sensor's pixels
  std::vector<double> known;
  for (const glm::vec4& p : depths.pixels)
    if (has_depth(p)) known.push_back(static_cast<double>(p.x));
  if (known.empty()) return true;
  const double distance = translation_ ? median(known) : distance_,
               reach = translation_ ? 2 * radius_ : radius_;
  const double radius = radius_ndc_ / relative_distance(distance) * std::min(depths.width, depths.height) / 2;
  const auto further =
      std::ranges::count_if(known, [&](double depth) { return std::abs(depth - distance) > reach; });
  const auto count = static_cast<double>(known.size());
  return count <= std::numbers::pi * radius * radius && static_cast<double>(further) <= k_stray * count;
}

std::vector<View> PoseSpace::seen_through_lenses(const Camera& camera) const {
  constexpr std::size_t k_rotations = 16;
  std::vector<View> views;
  for (const Camera& lens : possible_lenses(camera, distortion_)) {
    for (const glm::dmat3& rotation : rotation_grid(k_rotations))
      views.push_back(view({{rotation, initial_translation_}}, lens));
  }
  return views;
}

std::vector<double> PoseSpace::to_world(std::span<const double> covariance) const {
  std::vector<double> result(covariance.begin(), covariance.end());
  if (!translation_) return result;
  // C <- A C A^T, where A turns the translation's block and leaves the rest.
  const auto turn = [&](auto element) {
    for (std::size_t other = 0; other < size_; ++other) {
      glm::dvec3 t;
      for (int i = 0; i < 3; ++i) t[i] = element(k_translation + static_cast<std::size_t>(i), other);
      t = camera_axes_ * t;
      for (int i = 0; i < 3; ++i) element(k_translation + static_cast<std::size_t>(i), other) = t[i];
    }
  };
  turn([&](std::size_t i, std::size_t j) -> double& { return result[i * size_ + j]; });
  turn([&](std::size_t i, std::size_t j) -> double& { return result[j * size_ + i]; });
  return result;
}

}  // namespace dpr
