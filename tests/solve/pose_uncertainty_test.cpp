// Whether poses are as far off as their covariances say, in pictures with noise of several kinds.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <random>
#include <vector>

#include "dpr/pose.hpp"
#include "dpr/renderer.hpp"
#include "support/reduced.hpp"

namespace pose_uncertainty_test {

namespace {

using dpr::test::is_reduced;

constexpr int k_size = 64, k_samples = 4;

dpr::Scene cube_scene(int size) {
  dpr::Scene scene;
  scene.width = scene.height = size;
  scene.camera = dpr::orbit_camera(6.7F, 30, 120);
  scene.meshes.push_back({dpr::make_cube(), glm::mat4(1.0F)});
  return scene;
}

/// Normal noise of a deviation, whose neighbours go together over about `length` pixels; 0: not at all.
std::vector<glm::vec3> noise(std::mt19937& random, double deviation, double length) {
  const auto reach = static_cast<int>(std::ceil(3 * length));
  const int side = k_size + 2 * reach;
  std::normal_distribution<float> normal;
  std::vector<glm::vec3> white(static_cast<std::size_t>(side * side));
  for (glm::vec3& w : white) w = {normal(random), normal(random), normal(random)};
  std::vector<float> kernel;
  double squares = 0;
  for (int i = -reach; i <= reach; ++i) {
    kernel.push_back(length > 0 ? static_cast<float>(std::exp(-0.5 * i * i / (length * length))) : 1.0F);
    squares += std::pow(static_cast<double>(kernel.back()), 2);
  }
  std::vector<glm::vec3> result;
  for (int y = 0; y < k_size; ++y) {
    for (int x = 0; x < k_size; ++x) {
      glm::vec3 sum(0);
      for (int i = 0; i <= 2 * reach; ++i) {
        for (int j = 0; j <= 2 * reach; ++j) {
          sum += kernel[static_cast<std::size_t>(i)] * kernel[static_cast<std::size_t>(j)] *
                 white[static_cast<std::size_t>((y + i) * side + x + j)];
        }
      }
      result.push_back(static_cast<float>(deviation / squares) * sum);
    }
  }
  return result;
}

/// The mean over every pixel's area.
dpr::Image averaged(const dpr::Image& samples) {
  dpr::Image result(k_size, k_size, glm::vec4(0));
  for (int y = 0; y < k_samples * k_size; ++y) {
    for (int x = 0; x < k_samples * k_size; ++x) {
      result.pixels[static_cast<std::size_t>(y / k_samples * k_size + x / k_samples)] +=
          samples.pixels[static_cast<std::size_t>(y * k_samples * k_size + x)] /
          static_cast<float>(k_samples * k_samples);
    }
  }
  return result;
}

/// Parts of the errors below one and two deviations, all axes together.
struct Shares {
  double one = 0, two = 0;
};

Shares shares_of(double deviation, double length, const dpr::LeastSquares& method, unsigned runs) {
  const dpr::Device device = dpr::open_device();
  dpr::Scene scene = cube_scene(k_samples * k_size);
  scene.smoothing = dpr::rigid_smoothing();
  dpr::Renderer renderer(device);
  std::mt19937 random(1);
  Shares shares;
  for (unsigned run = 0; run < runs; ++run) {
    const dpr::Pose truth{dpr::rotation_from_vector({0.3 * run, 0.1 * run, 0.2}), {}};
    scene.meshes.front().transform = glm::mat4(glm::dmat4(truth.rotation));
    renderer.set_scene(scene);
    renderer.forward();
    dpr::Image target = averaged(renderer.image());
    const std::vector<glm::vec3> added = noise(random, deviation, length);
    for (std::size_t i = 0; i < added.size(); ++i) target.pixels[i] += glm::vec4(added[i], 0);
    const dpr::PoseSolver solver(device, cube_scene(k_size), target,
                                 {.method = method, .solve_translation = true});
    const dpr::PoseResult result = solver.solve(truth);
    REQUIRE(result.covariance.size() == 36);
    const glm::dvec3 turn = dpr::vector_from_rotation(result.pose.rotation * glm::transpose(truth.rotation));
    for (int axis = 0; axis < 6; ++axis) {
      const double error = axis < 3 ? turn[axis] : result.pose.translation[axis - 3];
      const double part = std::abs(error) / std::sqrt(result.covariance[static_cast<std::size_t>(7 * axis)]);
      shares.one += part < 1 ? 1.0 / (6 * runs) : 0;
      shares.two += part < 2 ? 1.0 / (6 * runs) : 0;
    }
  }
  return shares;
}

dpr::LeastSquares near_the_truth() {
  dpr::LeastSquares method;
  method.rotations = 0;
  method.coarsest = k_size;
  method.light = dpr::PoseLight::fixed;
  return method;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("a pose's deviation holds, whether pixels' noise is independent or goes together") {
    if (is_reduced()) return;
    for (const double length : {0.0, 1.0, 2.0}) {
      CAPTURE(length);
      const Shares shares = shares_of(0.15, length, near_the_truth(), 40);
      CHECK(shares.one > 0.58);
      CHECK(shares.one < (length > 0 ? 0.97 : 0.85));
      CHECK(shares.two > 0.9);
    }
  }

  TEST_CASE("a pose's deviation holds under a mask, with a robust loss, and in unknown light") {
    if (is_reduced()) return;
    dpr::LeastSquares masked = near_the_truth(), robust = near_the_truth(), lit = near_the_truth();
    masked.mask = dpr::Image(k_size, k_size, glm::vec4(1));
    for (int i = 0; i < k_size * k_size; ++i) {
      if (i % k_size < k_size / 2) masked.mask.pixels[static_cast<std::size_t>(i)] = glm::vec4(0);
    }
    robust.robust = true;
    robust.robust_scale = 0.5F;
    lit.light = dpr::PoseLight::harmonics;
    for (const dpr::LeastSquares& method : {masked, robust, lit}) {
      const Shares shares = shares_of(0.1, 0, method, 40);
      CHECK(shares.one > 0.58);
      CHECK(shares.one < 0.82);
      CHECK(shares.two > 0.84);
    }
  }
}

}  // namespace pose_uncertainty_test
