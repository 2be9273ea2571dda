// A smoke test of the speed: a step takes no longer than its pixels and triangles account for, measured as
// ratios within the test. Times are the benchmarks' business.
#include <doctest/doctest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>

#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "support/reduced.hpp"

namespace speed_test {

using namespace dpr;

namespace {

/// A renderer, and the shortest time that a forward and backward pass of it took.
class TimedStep {
 public:
  TimedStep(const std::string& preset, Mesh mesh, int size) {
    Scene scene;
    scene.width = scene.height = size;
    scene.smoothing = smoothing_preset(preset, size, size);
    scene.camera = orbit_camera(6.7F, 30.0F, 120.0F);
    scene.meshes.push_back({std::move(mesh), glm::mat4(1.0F)});
    renderer_.set_scene(scene);
    grad_ = test::pipeline::random_image(size, size, -1.0F, 1.0F);
    run();
    shortest = INFINITY;  // the first compiled kernels and made buffers
  }

  void run() {
    const auto start = std::chrono::steady_clock::now();
    renderer_.forward();
    renderer_.backward(std::span(&grad_, 1));
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    shortest = std::min(shortest, seconds.count());
  }

  double shortest = INFINITY;

 private:
  Renderer renderer_{open_device()};
  Image grad_;
};

/// How many times as long the second takes, from runs that alternate.
double ratio_of(TimedStep first, TimedStep second) {
  for (int i = 0; i < 8; ++i) {
    first.run();
    second.run();
  }
  return second.shortest / first.shortest;
}

}  // namespace

TEST_SUITE("bench-smoke") {
  TEST_CASE("speed: sixteen times the pixels, or triangles, take at most twice sixteen times as long") {
    if (dpr::test::reduced(1, 0) == 0) return;
    for (const std::string preset : {"pixel", "gaussian"}) {
      CAPTURE(preset);
      const double by_pixels = ratio_of({preset, make_cube(), 64}, {preset, make_cube(), 256});
      const double by_triangles = ratio_of({preset, make_icosphere(2), 64}, {preset, make_icosphere(4), 64});
      MESSAGE(preset << ": 16 times the pixels take " << by_pixels
                     << " times as long, 16 times the triangles " << by_triangles);
      CHECK(by_pixels < 32.0);
      CHECK(by_triangles < 32.0);
    }
  }
}

}  // namespace speed_test
