// A smoke test of the speed: the pose experiment's iteration has no stage that is slow by orders of
// magnitude. Measurements are the benchmarks' business.
#include <doctest/doctest.h>

#include <algorithm>
#include <chrono>

#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "support/reduced.hpp"

using namespace dpr;

TEST_SUITE("bench-smoke") {
  TEST_CASE("speed: forward and backward of the cube at 128x128 take less than a second after a warm-up") {
    if (dpr::test::reduced(1, 0) == 0) return;
    Scene scene;
    scene.smoothing = smoothing_preset("gaussian");
    scene.camera = orbit_camera(6.7F, 30.0F, 120.0F);
    scene.meshes.push_back({make_cube(), glm::mat4(1.0F)});
    scene.smoothing.blur_radius = 9.21e-3F;
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    const Image grad = test::pipeline::random_image(scene.width, scene.height, -1.0F, 1.0F);
    double best = INFINITY;
    for (int iteration = 0; iteration < 4; ++iteration) {
      const auto start = std::chrono::steady_clock::now();
      renderer.forward();
      const SceneGradient gradient = renderer.backward(std::span(&grad, 1));
      const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
      CHECK(gradient.meshes[0].positions.size() == 24);
      if (iteration > 0) best = std::min(best, seconds.count());
    }
    CHECK(best < 1.0);
    CHECK(best > 0.0);
    MESSAGE("cube128, exact: " << 1e3 * best << " ms forward and backward");
  }
}
