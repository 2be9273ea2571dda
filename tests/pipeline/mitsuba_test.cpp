// A textured mesh against the picture that Mitsuba 3 made of the same files (tests/data/mitsuba).
#include <doctest/doctest.h>

#include <cmath>

#include "dpr/dpr.hpp"
#include "support/data.hpp"
#include "support/reduced.hpp"

namespace mitsuba_test {

using namespace dpr;

namespace {

/// The mean over squares of pixels.
Image shrunk(const Image& image, int factor) {
  Image small(image.width / factor, image.height / factor, glm::vec4(0));
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      const auto at = static_cast<std::size_t>(row * image.width + column),
                 to = static_cast<std::size_t>(row / factor * small.width + column / factor);
      small.pixels[to] += image.pixels[at] / static_cast<float>(factor * factor);
    }
  }
  return small;
}

double mean_difference(const Image& a, const Image& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    for (int channel = 0; channel < 3; ++channel)
      sum += std::abs(static_cast<double>(a.pixels[i][channel] - b.pixels[i][channel]));
  }
  return sum / (3 * static_cast<double>(a.pixels.size()));
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("a textured cube looks as Mitsuba 3 renders it, to a 255th on average") {
    if (dpr::test::is_reduced()) return;
    constexpr int k_samples = 8;  // of a pixel, along each axis
    const std::filesystem::path folder = dpr::test::data_folder() / "mitsuba";
    const Image expected = read_image(folder / "textured.exr");
    Scene scene;
    scene.meshes = {{read_mesh(folder / "textured.obj")}};
    scene.width = k_samples * expected.width;
    scene.height = k_samples * expected.height;
    scene.camera.view[3] = glm::vec4(0, 0, -4, 1);
    scene.camera.fov_y_degrees = 40;
    scene.smoothing = smoothing_preset("rigid");
    Renderer renderer(open_device());
    const auto difference = [&] {
      renderer.set_scene(scene);
      renderer.forward();
      return mean_difference(shrunk(renderer.image(), k_samples), expected);
    };
    const double found = difference();
    MESSAGE("mean difference times 255: " << 255 * found);
    CHECK(found < 1.0 / 255);
    // Half a texel is seen.
    for (glm::vec2& uv : scene.meshes[0].mesh.texcoords) uv.x += 0.5F / 12;
    CHECK(difference() > 3.0 / 255);
  }
}

}  // namespace mitsuba_test
