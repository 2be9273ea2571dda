// Noise on poses and cameras, rigid renders of all samples in one batch, and the score estimator on their
// losses.
#include "experiments/pose/perturbed_pose.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "base/checks.hpp"
#include "dpr/error.hpp"
#include "dpr/pose.hpp"
#include "experiments/pose/score_estimator.hpp"
#include "scene/gradient_table.hpp"
#include "solve/polar.hpp"

namespace dpr::bench {
namespace {

constexpr std::size_t k_parameters = 17, k_fov = 12, k_intrinsics = 13;

using Flat = std::array<double, k_parameters>;

Flat flat(const PoseParameters& p) {
  Flat values{};
  std::size_t i = 0;
  for (const glm::dvec3& v : {p.mesh_rotation, p.mesh_translation, p.camera_rotation, p.camera_translation}) {
    for (int axis = 0; axis < 3; ++axis) values[i++] = v[axis];
  }
  values[k_fov] = p.fov_y_degrees;
  std::ranges::copy(p.intrinsics, values.begin() + k_intrinsics);
  return values;
}

PoseParameters structured(const Flat& values) {
  const auto vector = [&](std::size_t first) {
    return glm::dvec3(values[first], values[first + 1], values[first + 2]);
  };
  PoseParameters p{vector(0), vector(3), vector(6), vector(9), values[k_fov], {}};
  std::copy(values.begin() + k_intrinsics, values.end(), p.intrinsics.begin());
  return p;
}

glm::mat4 moved(const glm::mat4& matrix, const glm::dvec3& rotation, const glm::dvec3& translation) {
  const glm::dmat4 m(matrix);
  return affine(rotation_from_vector(rotation) * glm::dmat3(m), glm::dvec3(m[3]) + translation);
}

void move_projection(Camera& camera, const PoseParameters& step) {
  constexpr double k_smallest_angle = 0.01, k_largest_angle = 179.99;  // degrees
  constexpr float k_smallest_focal_length = 1e-3F;                     // pixels
  const double angle = static_cast<double>(camera.fov_y_degrees) + step.fov_y_degrees;
  camera.fov_y_degrees = static_cast<float>(std::clamp(angle, k_smallest_angle, k_largest_angle));
  if (!camera.intrinsics) return;
  Intrinsics& k = *camera.intrinsics;
  float* const numbers[] = {&k.fx, &k.fy, &k.cx, &k.cy};
  for (std::size_t i = 0; i < 4; ++i) {
    *numbers[i] = static_cast<float>(static_cast<double>(*numbers[i]) + step.intrinsics[i]);
  }
  k.fx = std::max(k.fx, k_smallest_focal_length);
  k.fy = std::max(k.fy, k_smallest_focal_length);
}

/// The parameters that are perturbed.
std::vector<std::size_t> perturbed(const Flat& scale) {
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < scale.size(); ++i) {
    if (scale[i] > 0) indices.push_back(i);
  }
  return indices;
}

void validate_scale(const Flat& scale, const Camera& camera) {
  for (const double s : scale) {
    require(s >= 0 && std::isfinite(s), "scale (perturbed pose)", s, "finite numbers >= 0");
  }
  require(!perturbed(scale).empty(), "scale (perturbed pose)", 0, "at least one number above 0");
  if (camera.orthographic_height && scale[k_fov] > 0) {
    throw InvalidArgument("scale (perturbed pose)", "noise on fov_y_degrees",
                          "none: the camera is orthographic");
  }
  const bool has_intrinsics = camera.intrinsics.has_value();
  const bool on_intrinsics =
      std::any_of(scale.begin() + k_intrinsics, scale.end(), [](double s) { return s > 0; });
  if (has_intrinsics ? scale[k_fov] > 0 : on_intrinsics) {
    throw InvalidArgument("scale (perturbed pose)",
                          has_intrinsics ? "noise on fov_y_degrees" : "noise on intrinsics",
                          has_intrinsics ? "noise on the intrinsics, which the camera has instead"
                                         : "noise on fov_y_degrees: the camera has no intrinsics");
  }
}

Scene rigid_scene(Scene scene) {
  scene.smoothing = rigid_smoothing();
  scene.gradients = no_gradients();
  return scene;
}

bool renders_rigid(const PerturbedPoseOptions& options) {
  return options.variance_reduction == VarianceReduction::rigid;
}

std::vector<Image> repeated(const Image& target, const PerturbedPoseOptions& options) {
  return std::vector<Image>(options.samples + (renders_rigid(options) ? 1 : 0), target);
}

NoiseOptions noise_options(const PerturbedPoseOptions& options, std::uint64_t seed) {
  return {options.prior, options.variance_reduction, options.draws, options.samples, seed};
}

}  // namespace

struct PerturbedPose::Impl {
  Impl(const Device& device, const Scene& scene, const Image& target, const PerturbedPoseOptions& wanted)
      : options(wanted), renderer(device), loss(device, wanted.loss, repeated(target, wanted)) {
    renderer.set_scene(rigid_scene(scene));
    scene_view = renderer.views().front();
  }

  PerturbedPoseOptions options;
  Renderer renderer;
  ImageLoss loss;  // a target for every sample
  View scene_view;
};

PerturbedPose::PerturbedPose(Device device, const Scene& scene, const Image& target,
                             const PerturbedPoseOptions& options) {
  validate(scene);
  validate(noise_options(options, 0));
  validate_scale(flat(options.scale), scene.camera);
  require(options.mesh < scene.meshes.size(), "mesh (perturbed pose)", options.mesh, "one of the scene's");
  if (target.width != scene.width || target.height != scene.height) {
    throw InvalidArgument("size of the target (perturbed pose)", checks::size(target.width, target.height),
                          checks::size(scene.width, scene.height) + ", the scene's");
  }
  impl_ = std::make_unique<Impl>(device, scene, target, options);
}

PerturbedPose::~PerturbedPose() = default;
PerturbedPose::PerturbedPose(PerturbedPose&&) noexcept = default;
PerturbedPose& PerturbedPose::operator=(PerturbedPose&&) noexcept = default;

const View& PerturbedPose::scene_view() const { return impl_->scene_view; }

void PerturbedPose::set_scale(const PoseParameters& scale) {
  validate_scale(flat(scale), impl_->scene_view.camera);
  if (perturbed(flat(scale)) != perturbed(flat(impl_->options.scale))) {
    throw InvalidArgument("scale (perturbed pose)", "other parameters than before",
                          "numbers above 0 for the same parameters");
  }
  impl_->options.scale = scale;
}

View moved(const View& view, std::size_t mesh, const PoseParameters& step) {
  require(mesh < view.transforms.size(), "mesh (moved)", mesh, "one of the view's");
  View result = view;
  result.transforms[mesh] = moved(view.transforms[mesh], step.mesh_rotation, step.mesh_translation);
  result.camera.view = moved(view.camera.view, step.camera_rotation, step.camera_translation);
  move_projection(result.camera, step);
  return result;
}

PerturbedPoseResult PerturbedPose::evaluate(const View& view, std::uint64_t seed) {
  Impl& m = *impl_;
  const Flat scale = flat(m.options.scale);
  const std::vector<std::size_t> indices = perturbed(scale);
  const NoiseOptions noise_of = noise_options(m.options, seed);
  const std::vector<double> noise = draw_noise(noise_of, indices.size());
  validate_scale(scale, view.camera);
  require(view.transforms.size() == m.scene_view.transforms.size(), "transforms (perturbed pose)",
          view.transforms.size(), "one for each mesh of the scene");

  std::vector<View> views;
  for (std::uint32_t sample = 0; sample < m.options.samples; ++sample) {
    Flat step{};
    for (std::size_t k = 0; k < indices.size(); ++k) {
      step[indices[k]] = scale[indices[k]] * noise[sample * indices.size() + k];
    }
    views.push_back(moved(view, m.options.mesh, structured(step)));
  }
  if (renders_rigid(m.options)) views.push_back(view);
  m.renderer.set_views(views);
  m.renderer.forward();
  m.loss.evaluate(m.renderer);
  const std::span<const double> losses = m.loss.per_view();
  const ScoreEstimate found = estimate(noise_of, losses.first(m.options.samples), noise, losses.back());

  Flat gradient{}, error{};
  for (std::size_t k = 0; k < indices.size(); ++k) {
    gradient[indices[k]] = found.gradient[k].value / scale[indices[k]];
    error[indices[k]] = found.gradient[k].error / scale[indices[k]];
  }
  return {found.value.value,
          found.value.error,
          structured(gradient),
          structured(error),
          found.sensitivity.value,
          found.sensitivity.error,
          static_cast<unsigned>(indices.size())};
}

}  // namespace dpr::bench
