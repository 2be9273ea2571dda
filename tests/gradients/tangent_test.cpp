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
std::vector<Way> random_ways(SceneGradient& gradient, bool by_sigma, Draw& draw) {
  std::vector<Way> ways;
  for (const GradientRow& wanted : gradient_rows()) {
    if (!has_tangent(wanted) || (wanted.path == "sigma" && !by_sigma)) continue;
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

/// What <u, J v> and <J^T u, v> may differ by. gamma's is a sum of the depths' derivatives, which cancel, times
/// depths: that leaves fewer digits.
double tolerance_of(const Way& way) { return way.name == "gamma" ? 2e-4 : 1e-5; }

SceneTangent moved_along_x(const Renderer& renderer) {
  SceneTangent direction;
  direction.views.resize(renderer.views().size());
  for (ViewGradient& view : direction.views) {
    view.transforms.resize(renderer.scene().meshes.size());
    view.transforms[0].translation.x = 1;
  }
  return direction;
}

}  // namespace

TEST_SUITE("tangents") {
  TEST_CASE("<u, J v> = <J^T u, v> over random scenes") {
    Renderer renderer(open_device());
    std::map<std::string, unsigned> tried;
    const auto trials = static_cast<unsigned>(test::reduced(120, 2));
    for (unsigned seed = 1; seed <= trials; ++seed) {
      const Trial trial = random_trial(seed);
      CAPTURE(seed);
      CAPTURE(trial.description());
      Draw draw(seed);
      renderer.set_scene(trial.scene);
      renderer.set_views(trial.views);
      renderer.forward();
      const std::vector<Image> weights = random_images(trial, draw);
      SceneGradient gradient = renderer.backward(weights);
      const std::vector<Way> ways = random_ways(gradient, trial.has("noise of triangles"), draw);
      const std::vector<double> errors = errors_of(renderer, weights, ways);
      for (std::size_t k = 0; k < ways.size(); ++k) {
        CAPTURE(ways[k].name);
        CHECK(errors[k] < tolerance_of(ways[k]));
        ++tried[(trial.has("noise of triangles") ? "triangles: " : "pixel: ") + ways[k].name];
      }
    }
    CHECK(tried.size() > static_cast<std::size_t>(test::reduced(38, 4)));
  }

  TEST_CASE("directions in groups, frames in bands: the same tangents") {
    for (const char* preset : {"joint_gaussian", "gaussian", "pixel"}) {
      CAPTURE(std::string(preset));
      Scene scene = check::scene_cut_open(make_icosphere(2), 40, 33);
      scene.smoothing = smoothing_preset(preset);
      Device device = open_device();
      Renderer renderer(device);
      renderer.set_scene(scene);
      renderer.forward();
      const std::vector<SceneTangent> directions(3, moved_along_x(renderer));
      const std::vector<Image> wanted = renderer.tangent(directions);
      CHECK(std::ranges::any_of(wanted[0].pixels, [](const glm::vec4& p) { return p.x != 0; }));
      device.set_memory_budget(std::max<std::size_t>(renderer.statistics().fragments * 70, 28000));
      renderer.set_scene(scene);
      renderer.forward();
      const std::vector<Image> found = renderer.tangent(directions);
      CHECK(renderer.statistics().bands > 1);
      for (std::size_t d = 0; d < wanted.size(); ++d) CHECK(found[d].pixels == wanted[d].pixels);
    }
  }

  TEST_CASE("tangents leave the frame's gradient as it is") {
    for (const char* preset : {"gaussian", "pixel"}) {
      Scene scene = check::cube_scene(24, 24);
      scene.smoothing = smoothing_preset(preset);
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      renderer.forward();
      const std::vector<Image> weights{Image(24, 24, glm::vec4(0.5F))};
      const SceneGradient before = renderer.backward(weights);
      renderer.forward();
      renderer.tangent(std::vector{moved_along_x(renderer)});
      const SceneGradient after = renderer.backward(weights);
      CHECK(after.sigma == before.sigma);
      CHECK(after.meshes[0].positions == before.meshes[0].positions);
    }
  }

  TEST_CASE("what images do not follow is refused") {
    Scene scene = check::textured_scene(make_icosphere(1),
                                        check::random_texture(4, 4, Wrap::clamp, Filter::bilinear), 16, 16);
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    SceneTangent none, texels, infinite, shorter, sigma;
    const auto tangent = [&](const SceneTangent& along) { return renderer.tangent(std::span(&along, 1)); };
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, tangent(none), "forward() first");
    renderer.forward();
    CHECK(tangent(none).front().pixels == Image(16, 16).pixels);
    CHECK(renderer.tangent({}).empty());
    texels.meshes.resize(1);
    texels.meshes[0].textures = {std::vector<glm::vec3>(16, glm::vec3(1))};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, tangent(texels), "textures");
    infinite.background.x = INFINITY;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, tangent(infinite), "background (tangent)");
    shorter.meshes.resize(1);
    shorter.meshes[0].positions.resize(3);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, tangent(shorter), "meshes[0].positions");
    sigma.sigma = 1;
    Smoothing pixel = smoothing_preset("pixel");
    renderer.set_smoothing(pixel);
    renderer.forward();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, tangent(sigma), "sigma (tangent)");
    pixel.aggregation_estimator = Estimator::monte_carlo;
    renderer.set_smoothing(pixel);
    renderer.forward();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, tangent(none), "Monte Carlo");
  }
}
