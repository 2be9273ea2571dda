// Forward mode around shading of the caller's own, against backward: <u, J v> = <J^T u, v> of samples and of images
// that are resolved, over random scenes and layers.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "check/adjoint.hpp"
#include "gradients/random_scene.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

namespace own_shading_tangent_test {

using namespace dpr;
using namespace dpr::check;
using namespace dpr::test::gradients;

namespace {

constexpr std::size_t k_channels = 5;  // two groups

/// A random scene with noise on the pixel and without lights.
Trial plain_trial(unsigned seed) {
  Trial trial = random_trial(seed);
  const float sigma = trial.scene.smoothing.sigma;
  trial.scene.smoothing = smoothing_preset("pixel");
  trial.scene.smoothing.sigma = sigma;
  trial.scene.lights.reset();
  return trial;
}

std::vector<float> random_numbers(std::size_t count, Random& random) {
  std::vector<float> numbers(count);
  for (float& number : numbers) number = random(-1, 1);
  return numbers;
}

std::vector<glm::vec2> random_pairs(std::size_t count, Random& random) {
  std::vector<glm::vec2> pairs(count);
  for (glm::vec2& pair : pairs) pair = glm::vec2(random(-1, 1), random(-1, 1));
  return pairs;
}

/// A sum of products, and of their sizes.
struct Sum {
  double value = 0, size = 0;

  void add(float a, float b) {
    const double term = static_cast<double>(a) * static_cast<double>(b);
    value += term;
    size += std::abs(term);
  }
  void add(std::span<const float> a, std::span<const float> b) {
    REQUIRE(a.size() == b.size());
    for (std::size_t i = 0; i < a.size(); ++i) add(a[i], b[i]);
  }
};

std::vector<Way> ways_of(SceneGradient& gradient, Random& random) {
  std::vector<Way> ways = random_ways(gradient, false, random);
  if (test::is_reduced() && ways.size() > 2) ways.erase(ways.begin() + 2, ways.end());
  return ways;
}

std::vector<SceneTangent> directions_of(const std::vector<Way>& ways) {
  std::vector<SceneTangent> directions;
  for (const Way& way : ways) directions.push_back(way.direction);
  return directions;
}

/// Up to rounding of the terms on both sides; `of_samples` are those that come with the samples' own change.
void check_equal(const Way& way, const Sum& sum, const Sum& of_samples) {
  CAPTURE(way.name);
  const double derivative = way.derivative + of_samples.value;
  CHECK(std::abs(sum.value - derivative) <=
        1e-5 * std::max({sum.size, of_samples.size, std::abs(way.derivative)}));
}

void check_samples(Renderer& renderer, Random& random) {
  const Samples samples = renderer.samples();
  const std::vector<glm::vec2> by_barycentrics = random_pairs(samples.faces.size(), random);
  const std::vector<float> by_depths = random_numbers(samples.faces.size(), random);
  SceneGradient gradient = renderer.samples_backward(by_barycentrics, by_depths);
  const std::vector<Way> ways = ways_of(gradient, random);
  REQUIRE(!ways.empty());
  const SamplesTangent found = renderer.samples_tangent(directions_of(ways));
  REQUIRE(found.depths.size() == ways.size() * by_depths.size());
  for (std::size_t d = 0; d < ways.size(); ++d) {
    Sum sum;
    for (std::size_t i = 0; i < by_depths.size(); ++i) {
      const std::size_t place = d * by_depths.size() + i;
      sum.add(by_depths[i], found.depths[place]);
      sum.add(by_barycentrics[i].x, found.barycentrics[place].x);
      sum.add(by_barycentrics[i].y, found.barycentrics[place].y);
    }
    check_equal(ways[d], sum, {});
  }
}

void check_images(Renderer& renderer, Random& random) {
  const Samples samples = renderer.samples();
  const std::size_t count = k_channels * samples.faces.size() / static_cast<std::size_t>(samples.layers);
  const std::vector<float> values = random_numbers(count, random);
  const std::vector<float> weights = random_numbers(renderer.resolve(values, k_channels).size(), random);
  ResolveGradient gradient = renderer.resolve_backward(values, k_channels, weights);
  const std::vector<Way> ways = ways_of(gradient.scene, random);
  REQUIRE(!ways.empty());
  // Samples change along every other way.
  std::vector<float> moved = random_numbers(ways.size() * count, random);
  for (std::size_t d = 0; d < ways.size(); d += 2)
    std::fill_n(moved.begin() + static_cast<std::ptrdiff_t>(d * count), count, 0.0F);
  const std::vector<float> found = renderer.resolve_tangent(values, k_channels, moved, directions_of(ways));
  REQUIRE(found.size() == ways.size() * weights.size());
  for (std::size_t d = 0; d < ways.size(); ++d) {
    Sum sum, of_samples;
    sum.add(weights, std::span(found).subspan(d * weights.size(), weights.size()));
    of_samples.add(gradient.samples, std::span(moved).subspan(d * count, count));
    check_equal(ways[d], sum, of_samples);
  }
}

}  // namespace

TEST_SUITE("tangents") {
  TEST_CASE("<u, J v> = <J^T u, v> around own shading, over random scenes") {
    Renderer renderer(open_device());
    const auto trials = static_cast<unsigned>(test::reduced(24, 1));
    unsigned tried = 0;
    for (unsigned seed = 1; tried < trials; ++seed) {
      REQUIRE(seed < 8 * trials);
      const Trial trial = plain_trial(seed);
      CAPTURE(seed);
      CAPTURE(trial.description());
      Random random(seed);
      renderer.set_scene(trial.scene);
      renderer.set_views(trial.views);
      renderer.set_layers(seed % 2 == 0 ? 1 : 3);
      renderer.forward();
      const Samples samples = renderer.samples();
      if (std::ranges::all_of(samples.faces, [](int face) { return face < 0; })) continue;
      check_samples(renderer, random);
      check_images(renderer, random);
      ++tried;
    }
  }

  TEST_CASE("many directions, bands, and none: as one by one") {
    Device device = open_device();
    Renderer renderer(device);
    const Trial trial = plain_trial(2);
    renderer.set_scene(trial.scene);
    renderer.forward();
    Random random(1);
    const Samples samples = renderer.samples();
    const std::vector<float> values = random_numbers(samples.faces.size(), random);
    std::vector<SceneTangent> directions(test::reduced(18, 3));  // more than share a pass
    for (SceneTangent& direction : directions) {
      direction.views.resize(1);
      direction.views[0].transforms.resize(trial.scene.meshes.size());
      direction.views[0].transforms[0].translation = random.vector(-1, 1);
    }
    const std::vector<float> moved = random_numbers(directions.size() * values.size(), random);
    const SamplesTangent together = renderer.samples_tangent(directions);
    const std::vector<float> images = renderer.resolve_tangent(values, 1, moved, directions);
    CHECK(renderer.samples_tangent({}).depths.empty());
    CHECK(renderer.resolve_tangent(values, 1, {}, {}).empty());
    const std::size_t pixels = images.size() / directions.size();
    const auto last = std::span(directions).last(1);
    const auto last_moved = std::span(moved).last(values.size());
    CHECK(std::ranges::equal(renderer.samples_tangent(last).depths,
                             std::span(together.depths).last(samples.depths.size())));
    CHECK(std::ranges::equal(renderer.resolve_tangent(values, 1, last_moved, last),
                             std::span(images).last(pixels)));
    device.set_memory_budget(std::max<std::size_t>(renderer.statistics().fragments * 60, 28000));
    renderer.set_scene(trial.scene);
    renderer.forward();
    CHECK(renderer.samples_tangent(directions).depths == together.depths);
    CHECK(renderer.resolve_tangent(values, 1, moved, directions) == images);
  }

  TEST_CASE("what is refused") {
    Scene scene = scene_of(make_cube(), 12, 9);
    scene.smoothing = smoothing_preset("pixel");
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    std::vector<SceneTangent> direction(1);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.samples_tangent(direction), "forward() first");
    renderer.forward();
    const std::vector<float> values(renderer.samples().faces.size());
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.resolve_tangent(values, 1, {}, direction),
                          "sample_tangents");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.resolve_tangent(values, 0, values, direction),
                          "channels");
    direction[0].sigma = 1;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.samples_tangent(direction), "sigma");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.resolve_tangent(values, 1, values, direction), "sigma");
  }
}

}  // namespace own_shading_tangent_test
