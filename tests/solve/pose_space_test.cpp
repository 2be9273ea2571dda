// The pose solver's parameters as directions: tangents of the images against central differences along
// PoseSpace::moved().
#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "check/scenes.hpp"
#include "solve/pose_space.hpp"
#include "support/reduced.hpp"

namespace pose_space_test {

using namespace dpr;

namespace {

std::vector<glm::vec4> pixels_at(Renderer& renderer, const PoseSpace& space, const Hypothesis& hypothesis,
                                 const Camera& camera) {
  renderer.set_views(std::vector{space.view(hypothesis, camera)});
  renderer.forward();
  return renderer.image().pixels;
}

/// The error of all pixels, relative to the derivatives.
double error_of(Renderer& renderer, const PoseSpace& space, const Hypothesis& at, const Camera& camera,
                std::size_t parameter) {
  constexpr double k_step = 5e-4;  // of the image's half
  const double step = space.step_lengths(k_step)[parameter];
  PoseSpace::Step ahead{}, back{};
  ahead[parameter] = step;
  back[parameter] = -step;
  const std::vector<glm::vec4> after = pixels_at(renderer, space, space.moved(at, ahead), camera),
                               before = pixels_at(renderer, space, space.moved(at, back), camera);
  pixels_at(renderer, space, at, camera);
  SceneTangent direction;
  direction.views = {space.view_tangent(at, camera, parameter)};
  const std::vector<glm::vec4> found = renderer.tangent(std::span(&direction, 1)).front().pixels;
  double error = 0, size = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    for (int c = 0; c < 4; ++c) {
      const double difference = static_cast<double>(after[i][c] - before[i][c]) / (2 * step);
      error += std::pow(difference - static_cast<double>(found[i][c]), 2);
      size += std::pow(difference, 2);
    }
  }
  return size > 0 ? std::sqrt(error / size) : INFINITY;
}

}  // namespace

TEST_SUITE("solve") {
  TEST_CASE("pose space: tangents of the images along every parameter are those of differences") {
    Scene scene = check::cube_scene(test::reduced(48, 12), test::reduced(40, 10));
    scene.smoothing = smoothing_preset("joint_gaussian");
    scene.smoothing.distance = DistanceMetric::euclidean;
    scene.smoothing.sigma = 0.1F;                 // a few steps wide
    scene.smoothing.occupancy_threshold = 1e-7F;  // else they jump where a face comes within the blur radius
    scene.smoothing.gamma = 0.05F;
    scene.perspective_correct = false;  // else images jump at the horizon of a plane
    PoseOptions options;
    options.solve_translation = options.solve_focal = options.solve_distortion = true;
    const Camera pinhole = scene.camera;
    Camera calibrated = pinhole, orthographic = pinhole;
    const auto pixels = static_cast<float>(scene.height);
    calibrated.intrinsics = {1.1F * pixels, 1.25F * pixels, 0.6F * pixels, 0.48F * pixels};
    calibrated.distortion = Distortion{-0.1F, 0.02F, 0.01F, -0.01F, 0};
    orthographic.orthographic_height = 5.0F;
    const double tolerance = test::is_reduced() ? 5e-2 : 2e-2;  // of fewer pixels more lie on kinks
    Camera wide = calibrated;
    wide.distortion = fisheye(0.1F, -0.02F, 0.01F, 0);
    std::vector<Camera> cameras{calibrated};
    if (!test::is_reduced()) cameras.insert(cameras.end(), {pinhole, orthographic, wide});
    for (const Camera& camera : cameras) {
      scene.camera = camera;
      options.solve_distortion = !camera.orthographic_height;
      const Pose start{glm::dmat3(scene.meshes[0].transform), glm::dvec3(0.1, -0.2, 0.05)};
      const PoseSpace space(scene, start, options);
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      for (std::size_t k = 0; k < space.size(); ++k) {
        CAPTURE(k);
        CAPTURE(camera.intrinsics.has_value());
        // Orthographic cameras see nothing of a motion along their axis.
        if (camera.orthographic_height && k == 5) continue;
        CHECK(error_of(renderer, space, {start}, camera, k) < tolerance);
      }
    }
  }
}

}  // namespace pose_space_test
