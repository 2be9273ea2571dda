// Cameras by the pose solver, the world being the object's; light by linear least squares.
#include "dpr/photographs.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <utility>
#include <variant>
#include <vector>

#include "base/checks.hpp"
#include "dpr/renderer.hpp"
#include "mesh/bounding_box.hpp"
#include "mesh/opacity.hpp"
#include "renderer/frame.hpp"
#include "scene/gradient_table.hpp"
#include "solve/normal_equations.hpp"
#include "solve/polar.hpp"
#include "solve/scene_light.hpp"
#include "solve/shape_space.hpp"

namespace dpr {
namespace {

const Mesh& template_of(const ShapeViews& views) {
  if (!views.initial)
    throw InvalidArgument("initial mesh (photographs)", "none",
                          "a mesh to begin with, by which missing cameras and light are found");
  validate(*views.initial, "initial (photographs)");
  require_opaque(*views.initial, "initial mesh");
  return *views.initial;
}

/// In front of the mesh, which fills most of the image.
Camera front_camera(const Mesh& mesh, int width, int height) {
  constexpr float k_fov_degrees = 30, k_margin = 1.2F, k_depths = 10;
  const Bounds box = bounding_box(mesh.positions);
  const float half = glm::radians(0.5F * k_fov_degrees);  // of the short side
  const float distance = k_margin * 0.5F * glm::length(box.high - box.low) / std::sin(half);
  const float tall = static_cast<float>(height) / static_cast<float>(std::min(width, height));
  Camera camera = orbit_camera(distance, 0, 0, center(box));
  camera.fov_y_degrees = glm::degrees(2 * std::atan(tall * std::tan(half)));
  camera.znear = distance / k_depths;
  camera.zfar = distance * k_depths;
  return camera;
}

/// The mesh about its middle, which is what a pose turns it about.
Scene pose_scene(const ShapeViews& views, const ShapeView& view) {
  const Mesh& mesh = template_of(views);
  const glm::vec3 middle = center(bounding_box(mesh.positions));
  Scene scene;
  scene.width = views.width;
  scene.height = views.height;
  scene.background = views.background;
  scene.camera = view.knowledge == CameraKnowledge::unknown ? front_camera(mesh, views.width, views.height)
                                                            : view.camera;
  scene.meshes.push_back({mesh, affine(glm::dmat3(1.0), glm::dvec3(middle))});
  for (glm::vec3& p : scene.meshes.front().mesh.positions) p -= middle;
  scene.cull = Cull::back;  // a mask's inside, in a light that suits it, looks much like a face
  return scene;
}

/// An environment that is black.
Lights no_light() {
  Lights lights;
  lights.ambient = glm::vec3(0);
  lights.harmonics.assign(k_harmonics, glm::vec3(0));
  return lights;
}

/// A pixel's colours under each harmonic of radiance 1, and the colour that their sum should reach.
struct LitPixel {
  std::array<glm::vec3, k_harmonics> terms;
  glm::vec3 wanted;
  double weight;
};

/// The pixels that show the scene's meshes.
std::vector<LitPixel> lit_pixels(const Device& device, Scene scene, std::span<const ShapeView> views) {
  constexpr float k_shown = 0.99F;  // coverage: others show the background too
  const glm::vec3 background = std::exchange(scene.background, glm::vec3(0));
  scene.gradients = no_gradients();
  Renderer renderer(device);
  renderer.set_scene(scene);
  std::vector<LitPixel> pixels;
  for (const ShapeView& view : views) {
    View one{view.camera, {}};
    for (const Instance& instance : scene.meshes) one.transforms.push_back(instance.transform);
    renderer.set_views({&one, 1});
    std::vector<Image> images;
    for (std::size_t k = 0; k < k_harmonics; ++k) {
      Lights lights = no_light();
      lights.harmonics[k] = glm::vec3(1);
      renderer.set_lights(lights);
      renderer.forward();
      images.push_back(renderer.image());
    }
    for (std::size_t i = 0; i < view.image.pixels.size(); ++i) {
      const float alpha = images.front().pixels[i].a;
      const glm::vec4& target = view.image.pixels[i];
      const float weight =
          (view.mask.pixels.empty() ? 1.0F : view.mask.pixels[i].x) * (view.has_alpha ? target.a : 1.0F);
      if (alpha < k_shown || weight <= 0) continue;
      LitPixel pixel{{}, glm::vec3(target) - (1 - alpha) * background, static_cast<double>(weight)};
      for (std::size_t k = 0; k < k_harmonics; ++k) pixel.terms[k] = glm::vec3(images[k].pixels[i]);
      pixels.push_back(pixel);
    }
  }
  return pixels;
}

using Coefficients = Eigen::Matrix<double, k_harmonics, 3>;

glm::vec3 shown_in(const LitPixel& pixel, const Coefficients& light) {
  glm::vec3 color(0);
  for (std::size_t k = 0; k < k_harmonics; ++k) {
    for (int c = 0; c < 3; ++c)
      color[c] += pixel.terms[k][c] * static_cast<float>(light(static_cast<Eigen::Index>(k), c));
  }
  return color;
}

Coefficients weighted_least_squares(const std::vector<LitPixel>& pixels, const std::vector<double>& weights) {
  constexpr double k_prior_pixels = 10;  // as much as so many pixels say
  Coefficients light;
  for (int c = 0; c < 3; ++c) {
    Eigen::Matrix<double, k_harmonics, k_harmonics> normal;
    Eigen::Vector<double, k_harmonics> right;
    normal.setZero();
    right.setZero();
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      Eigen::Vector<double, k_harmonics> row;
      for (std::size_t k = 0; k < k_harmonics; ++k)
        row[static_cast<Eigen::Index>(k)] = static_cast<double>(pixels[i].terms[k][c]);
      normal += weights[i] * row * row.transpose();
      right += weights[i] * static_cast<double>(pixels[i].wanted[c]) * row;
    }
    const double least = std::max(normal(0, 0), 1e-20);  // a channel of no colour has no light
    normal.diagonal().array() += k_prior_pixels / static_cast<double>(pixels.size()) * least;
    light.col(c) = normal.llt().solve(right);
  }
  return light;
}

}  // namespace

PoseResult find_camera(const Device& device, ShapeViews& views, std::size_t view, PoseOptions options,
                       const PoseSolver::Callback& callback) {
  require(view < views.views.size(), "view (photographs)", view, "one of the views");
  auto* method = std::get_if<LeastSquares>(&options.method);
  if (method == nullptr) throw InvalidArgument("method (photographs)", "a descent", "least squares");
  ShapeView& wanted = views.views[view];
  const Scene scene = pose_scene(views, wanted);
  const bool search = wanted.knowledge == CameraKnowledge::unknown;
  method->mask = wanted.mask;
  if (!search) method->rotations = 0;
  options.solve_translation = !scene.camera.orthographic_height;
  const PoseSolver solver(device, scene, wanted.image, options);
  PoseResult found = search ? solver.search(callback) : solver.solve(solver.scene_pose(), callback);
  wanted.camera = calibrated(scene.camera, found.focal_scale, found.radial);
  const glm::dmat4 moved(affine(found.pose.rotation, found.pose.translation));
  const glm::dmat4 to_world(scene.meshes.front().transform);
  wanted.camera.view = glm::mat4(glm::dmat4(scene.camera.view) * moved * glm::inverse(to_world));
  wanted.knowledge = CameraKnowledge::known;
  return found;
}

ShapeOptions template_shape_options() {
  ShapeOptions options;
  options.iterations = 400;  // small steps against a rigidity
  options.batch = 8;
  options.remesh_interval = 0;
  options.rigidity = 0.5F;
  options.lambda = 1;  // what rigidity holds together may move alone
  options.learning_rate = 0.01;
  options.color_learning_rate = 0;
  options.loss.ssim = 1;  // edges of what the template shows count wherever the light is wrong
  return options;
}

Lights find_light(const Device& device, const ShapeViews& views, float robust_scale) {
  require(robust_scale >= 0 && std::isfinite(robust_scale), "robust_scale (photographs)", robust_scale,
          "a finite number, at least 0");
  require_known_cameras(views, "photographs");
  Scene scene;
  scene.width = views.width;
  scene.height = views.height;
  scene.background = views.background;
  scene.meshes.push_back({with_vertex_colors(template_of(views))});
  scene.smoothing = finest_smoothing(views, {});
  const std::optional<Lights> found = find_light(device, scene, views.views, robust_scale);
  if (found) return *found;
  throw InvalidArgument("initial mesh (photographs)", "one that no image shows", "one that some image shows");
}

std::optional<Lights> find_light(const Device& device, const Scene& scene, std::span<const ShapeView> views,
                                 float robust_scale) {
  constexpr int k_reweighings = 10;
  const std::vector<LitPixel> pixels = lit_pixels(device, scene, views);
  if (pixels.empty()) return std::nullopt;
  std::vector<double> weights;
  for (const LitPixel& pixel : pixels) weights.push_back(pixel.weight);
  Coefficients light = weighted_least_squares(pixels, weights);
  for (int step = 0; robust_scale > 0 && step < k_reweighings; ++step) {
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const glm::vec3 r = (shown_in(pixels[i], light) - pixels[i].wanted) / robust_scale;
      const double slope = 1 / (1 + static_cast<double>(glm::dot(r, r)));
      weights[i] = pixels[i].weight * slope * slope;
    }
    light = weighted_least_squares(pixels, weights);
  }
  Lights lights = no_light();
  for (std::size_t k = 0; k < k_harmonics; ++k) {
    for (int c = 0; c < 3; ++c)
      lights.harmonics[k][c] = static_cast<float>(light(static_cast<Eigen::Index>(k), c));
  }
  return lights;
}

std::optional<ColorGain> find_gain(const Device& device, Scene scene, const ShapeView& view,
                                   float robust_scale) {
  WeighedTarget target;
  target.background = std::exchange(scene.background, glm::vec3(0));
  scene.lights.reset();
  scene.gradients = no_gradients();
  scene.camera = view.camera;
  Renderer renderer(device);
  renderer.set_scene(scene);
  renderer.forward();
  for (std::size_t i = 0; i < view.image.pixels.size(); ++i) {
    const glm::vec4& q = view.image.pixels[i];
    target.colors.push_back({{q.x, q.y, q.z, q.w}});
    target.weights.push_back(view.mask.pixels.empty() ? 1.0F : view.mask.pixels[i].x);
  }
  const Buffer<cl_float4>& image = last_frame(renderer, "find_gain").image;
  NormalSums sums(device, target, PoseLight::gain, 1);
  static_cast<void>(sums.losses({1, image, image, image}, {robust_scale}));
  ColorGain found;
  for (int c = 0; c < 3; ++c) {
    const ChannelLight& light = sums.lights().front()[static_cast<std::size_t>(c)];
    if (light.seen <= 0) return std::nullopt;
    found.gain[c] = light.light[0];
    found.offset[c] = light.light[1];
  }
  return found;
}

}  // namespace dpr
