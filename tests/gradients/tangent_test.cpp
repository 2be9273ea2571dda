// Forward mode against backward: <u, J v> = <J^T u, v> over random scenes, for every kind of direction alone;
// bands; and what is refused.
#include <doctest/doctest.h>

#include <cmath>
#include <map>
#include <string>

#include "gradients/random_scene.hpp"
#include "renderer/tangents.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

using namespace dpr;
using namespace dpr::test::gradients;

namespace {

std::vector<Image> random_images(const Trial& trial, Draw& draw) {
  std::vector<Image> images(trial.views.size(), Image(trial.scene.width, trial.scene.height));
  for (Image& image : images) {
    for (glm::vec4& p : image.pixels) p = glm::vec4(draw.vector(-1, 1), draw.between(-1, 1));
  }
  return images;
}

/// A direction along the numbers of one row of the table, and the derivative of <u, images> along it, by the
/// gradient.
struct Way {
  std::string name;
  SceneTangent direction;
  double derivative = 0;
};

/// One for every row with tangents that the gradient has numbers of.
std::vector<Way> random_ways(SceneGradient& gradient, Draw& draw) {
  std::vector<Way> ways;
  for (const GradientRow& wanted : gradient_rows()) {
    if (!has_tangent(wanted)) continue;
    Way way{wanted.path, gradient};
    std::size_t numbers = 0;
    for_each_array(way.direction, [&](const GradientRow& row, GradientIndex, const GradientArray& array) {
      transform_numbers(array, [&](double number) {
        if (&row != &wanted) return 0.0;
        const double by = static_cast<double>(draw.between(-1, 1));
        way.derivative += by * number;
        ++numbers;
        return static_cast<double>(static_cast<float>(by));
      });
    });
    if (numbers > 0) ways.push_back(std::move(way));
  }
  return ways;
}

/// The error of <u, J v>, relative to the sum of the sizes of what it is a sum of.
std::vector<double> errors_of(Renderer& renderer, const std::vector<Image>& weights,
                              const std::vector<Way>& ways) {
  std::vector<SceneTangent> directions;
  for (const Way& way : ways) directions.push_back(way.direction);
  const std::vector<Image> tangents = renderer.tangent(directions);
  std::vector<double> errors;
  for (std::size_t d = 0; d < ways.size(); ++d) {
    double sum = 0, size = 0;
    for (std::size_t v = 0; v < weights.size(); ++v) {
      for (std::size_t i = 0; i < weights[v].pixels.size(); ++i) {
        for (int c = 0; c < 4; ++c) {
          const double term = static_cast<double>(weights[v].pixels[i][c]) *
                              static_cast<double>(tangents[d * weights.size() + v].pixels[i][c]);
          sum += term;
          size += std::abs(term);
        }
      }
    }
    errors.push_back(size > 0 || ways[d].derivative != 0
                         ? std::abs(sum - ways[d].derivative) / std::max(size, std::abs(ways[d].derivative))
                         : 0);
  }
  return errors;
}

/// A random trial with noise of triangles.
Trial trial_of(unsigned seed) {
  for (;; seed += 1000) {
    Trial trial = random_trial(seed);
    if (trial.has("noise of triangles")) return trial;
  }
}

}  // namespace

TEST_SUITE("tangents") {
  TEST_CASE("<u, J v> = <J^T u, v> over random scenes") {
    Renderer renderer(open_device());
    std::map<std::string, std::pair<double, unsigned>> worst;
    const auto trials = static_cast<unsigned>(test::reduced(60, 2));
    for (unsigned seed = 1; seed <= trials; ++seed) {
      const Trial trial = trial_of(seed);
      CAPTURE(seed);
      CAPTURE(trial.description());
      Draw draw(seed);
      renderer.set_scene(trial.scene);
      renderer.set_views(trial.views);
      renderer.forward();
      const std::vector<Image> weights = random_images(trial, draw);
      SceneGradient gradient = renderer.backward(weights);
      const std::vector<Way> ways = random_ways(gradient, draw);
      const std::vector<double> errors = errors_of(renderer, weights, ways);
      for (std::size_t k = 0; k < ways.size(); ++k) {
        CAPTURE(ways[k].name);
        CHECK(errors[k] < 1e-5);
        auto& [error, where] = worst[ways[k].name];
        if (errors[k] > error) error = errors[k], where = seed;
      }
    }
    for (const auto& [name, found] : worst)
      MESSAGE(name << ": " << found.first << " (" << found.second << ")");
    CHECK(worst.size() > static_cast<std::size_t>(test::reduced(12, 4)));
  }
}
