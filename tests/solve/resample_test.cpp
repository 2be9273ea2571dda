// Images and cameras at another resolution.
#include "solve/resample.hpp"

#include <doctest/doctest.h>

#include <random>

namespace resample_test {

namespace {

dpr::Image random_image(int width, int height) {
  std::mt19937 generator(1);
  std::uniform_real_distribution<float> uniform;
  dpr::Image image(width, height);
  for (glm::vec4& p : image.pixels) {
    p = {uniform(generator), uniform(generator), uniform(generator), uniform(generator)};
  }
  return image;
}

glm::dvec4 mean(const dpr::Image& image) {
  glm::dvec4 sum(0);
  for (const glm::vec4& p : image.pixels) sum += glm::dvec4(p);
  return sum / static_cast<double>(image.pixels.size());
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("resampling keeps the mean, upwards and downwards and by any ratio") {
    const dpr::Image image = random_image(17, 11);
    for (const auto& [width, height] : {std::pair{17, 11}, {8, 5}, {1, 1}, {34, 12}}) {
      const dpr::Image result = dpr::resample(image, width, height);
      REQUIRE(result.pixels.size() == static_cast<std::size_t>(width * height));
      CHECK(glm::length(mean(result) - mean(image)) < 1e-6);
    }
  }

  TEST_CASE("medians are of what counts, and do not mix what lies before an edge with what lies behind") {
    dpr::Image image(4, 2);
    const float numbers[] = {1, 1, 9, 7, 1, 5, 0, 0};
    for (std::size_t i = 0; i < 8; ++i) image.pixels[i] = glm::vec4(numbers[i], 0, 0, numbers[i] > 0 ? 1 : 0);
    const dpr::Image half = dpr::resample_medians(image, 2, 1);
    CHECK(half.at(0, 0).x == 1);
    CHECK(half.at(0, 0).w == doctest::Approx(1));
    CHECK(half.at(1, 0).x == 9);
    CHECK(half.at(1, 0).w == doctest::Approx(0.5));
    CHECK(dpr::resample_medians(dpr::Image(4, 2), 2, 1).at(0, 0) == glm::vec4(0));
    CHECK(dpr::resample_medians(image, 4, 2).at(3, 0) == glm::vec4(7, 7, 7, 1));
  }

  TEST_CASE("half the resolution is the mean of two by two pixels") {
    const dpr::Image image = random_image(6, 4), half = dpr::resample(image, 3, 2);
    for (int row = 0; row < 2; ++row) {
      for (int column = 0; column < 3; ++column) {
        const glm::vec4 expected =
            0.25F * (image.at(2 * column, 2 * row) + image.at(2 * column + 1, 2 * row) +
                     image.at(2 * column, 2 * row + 1) + image.at(2 * column + 1, 2 * row + 1));
        CHECK(glm::length(half.at(column, row) - expected) < 1e-6F);
      }
    }
  }

  TEST_CASE("a resampled camera projects to the same part of the image") {
    dpr::Camera by_angle, by_pixels;
    by_pixels.intrinsics = dpr::Intrinsics{130, 120, 70, 40};
    const glm::vec3 point(0.3F, -0.2F, 2);  // x, y, and depth along the view
    for (const dpr::Camera& camera : {by_angle, by_pixels}) {
      const auto part = [&](const dpr::Camera& c, int width, int height) {
        const dpr::Projection p = dpr::projection(c, width, height);
        const glm::vec2 ndc = p.scale * glm::vec2(point) / point.z + p.offset;
        const auto side = static_cast<float>(std::min(width, height));
        return ndc * side / glm::vec2(width, height);
      };
      const dpr::Camera other = dpr::resample(camera, 120, 90, 41, 30);
      CHECK(glm::length(part(camera, 120, 90) - part(other, 41, 30)) < 1e-5F);
      const dpr::Camera longer = dpr::zoomed(camera, 1.5);
      const glm::vec2 centre = dpr::projection(camera, 120, 90).offset;
      const glm::vec2 scale = dpr::projection(longer, 120, 90).scale / dpr::projection(camera, 120, 90).scale;
      CHECK(glm::length(scale - glm::vec2(1.5F)) < 1e-5F);
      CHECK(glm::length(dpr::projection(longer, 120, 90).offset - centre) < 1e-6F);
    }
  }
}

}  // namespace resample_test
