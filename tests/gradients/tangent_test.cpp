// Forward mode against backward: <u, J v> = <J^T u, v> over random scenes, for every kind of direction alone;
// bands; and what is refused.
#include <doctest/doctest.h>

#include <cmath>
#include <map>
#include <string>

#include "check/adjoint.hpp"
#include "gradients/random_scene.hpp"
#include "renderer/attribute_images_impl.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

namespace tangent_test {

using namespace dpr;
using namespace dpr::check;
using namespace dpr::test::gradients;

namespace {

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

/// Under the simulator every third of them, from another one on for each seed.
std::vector<Way> some_of(std::vector<Way> ways, unsigned seed) {
  if (!test::is_reduced()) return ways;
  std::vector<Way> some;
  for (std::size_t k = seed % 3; k < ways.size(); k += 3) some.push_back(std::move(ways[k]));
  return some;
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
      Random random(seed);
      renderer.set_scene(trial.scene);
      renderer.set_views(trial.views);
      renderer.forward();
      const std::vector<Image> weights = random_images(renderer, random);
      SceneGradient gradient = renderer.backward(weights);
      const std::vector<Way> ways =
          some_of(random_ways(gradient, trial.has("noise of triangles"), random), seed);
      const std::vector<double> errors = errors_of(renderer, weights, ways);
      for (std::size_t k = 0; k < ways.size(); ++k) {
        CAPTURE(ways[k].name);
        CHECK(errors[k] < tolerance_of(ways[k]));
        ++tried[(trial.has("noise of triangles") ? "triangles: " : "pixel: ") + ways[k].name];
      }
    }
    CHECK(tried.size() > static_cast<std::size_t>(test::reduced(38, 4)));
  }

  TEST_CASE("<u, J v> = <J^T u, v> of depths, positions and normals over random scenes") {
    Renderer renderer(open_device());
    std::map<std::string, unsigned> tried;
    const auto trials = static_cast<unsigned>(test::reduced(24, 1));
    for (const Attribute attribute : {Attribute::depth, Attribute::position, Attribute::normal}) {
      if (test::is_reduced() && attribute == Attribute::position) continue;
      AttributeImages images(renderer.device(), attribute);
      for (unsigned seed = 1; seed <= trials; ++seed) {
        const Trial trial = random_trial(seed);
        CAPTURE(seed);
        CAPTURE(to_string(attribute));
        CAPTURE(trial.description());
        Random random(seed);
        renderer.set_scene(trial.scene);
        renderer.set_views(trial.views);
        renderer.forward();
        images.forward(renderer);
        Renderer& shown = impl_of(images).renderer;
        const std::vector<Image> weights = random_images(shown, random);
        SceneGradient gradient = shown.backward(weights);
        std::vector<Way> ways = random_ways(gradient, trial.has("noise of triangles"), random);
        std::erase_if(ways, [](const Way& way) { return way.name == "background"; });  // has none
        ways = some_of(std::move(ways), seed);
        const std::vector<double> errors = errors_of(shown, weights, ways);
        for (std::size_t k = 0; k < ways.size(); ++k) {
          CAPTURE(ways[k].name);
          CHECK(errors[k] < tolerance_of(ways[k]));
          ++tried[std::string(to_string(attribute)) + ": " + ways[k].name];
        }
      }
    }
    CHECK(tried.size() > static_cast<std::size_t>(test::reduced(18, 4)));
  }

  TEST_CASE("directions in groups, frames in bands: the same tangents") {
    for (const char* preset : {"joint_gaussian", "gaussian", "pixel"}) {
      CAPTURE(std::string(preset));
      if (test::is_reduced() && std::string(preset) != "gaussian") continue;
      Scene scene = scene_cut_open(make_icosphere(2), test::reduced(40, 20), test::reduced(33, 17));
      scene.smoothing = smoothing_preset(preset);
      Device device = open_device();
      Renderer renderer(device);
      renderer.set_scene(scene);
      renderer.forward();
      const std::vector<SceneTangent> directions(3, moved_along_x(renderer));
      const std::vector<Image> wanted = renderer.tangent(directions);
      CHECK(std::ranges::any_of(wanted[0].pixels, [](const glm::vec4& p) { return p.x != 0; }));
      const std::size_t fragments = renderer.statistics().fragments;
      for (const std::size_t bytes_each : {70, 160}) {  // for the frame in bands, or for its tangents alone
        CAPTURE(bytes_each);
        if (test::is_reduced() && bytes_each > 70) continue;
        device.set_memory_budget(std::max<std::size_t>(fragments * bytes_each, 28000));
        renderer.set_scene(scene);
        renderer.forward();
        const std::vector<Image> found = renderer.tangent(directions);
        const bool is_small = std::string(preset) == "pixel" && bytes_each == 160;  // and fits even so
        CHECK((is_small || renderer.statistics().bands > 1));
        for (std::size_t d = 0; d < wanted.size(); ++d) CHECK(found[d].pixels == wanted[d].pixels);
        const std::vector<Image> again = renderer.tangent(std::span(directions).first(1));
        CHECK(again[0].pixels == wanted[0].pixels);
      }
    }
  }

  TEST_CASE("tangents leave the frame's gradient as it is") {
    for (const char* preset : {"gaussian", "pixel"}) {
      const int size = test::reduced(24, 9);
      Scene scene = cube_scene(size, size);
      scene.smoothing = smoothing_preset(preset);
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      renderer.forward();
      const std::vector<Image> weights{Image(size, size, glm::vec4(0.5F))};
      const SceneGradient before = renderer.backward(weights);
      renderer.forward();
      renderer.tangent(std::vector{moved_along_x(renderer)});
      const SceneGradient after = renderer.backward(weights);
      CHECK(after.sigma == before.sigma);
      CHECK(after.meshes[0].positions == before.meshes[0].positions);
    }
  }

  TEST_CASE("an empty frame follows the background alone") {
    for (const char* preset : {"gaussian", "joint_gaussian", "pixel"}) {
      Scene scene = cube_scene(12, 9);
      scene.smoothing = smoothing_preset(preset);
      scene.meshes[0].transform[3] = glm::vec4(0, 0, 1000, 1);
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      renderer.forward();
      SceneTangent direction = moved_along_x(renderer);
      direction.background = {1, 2, 3};
      const Image tangent = renderer.tangent({&direction, 1})[0];
      for (const glm::vec4& pixel : tangent.pixels)
        CHECK(glm::distance(pixel, glm::vec4(1, 2, 3, 0)) < 1e-6F);
    }
  }

  TEST_CASE("tangents are finite where a vertex lies in the camera's plane") {
    for (const char* preset : {"pixel", "rigid", "joint_gaussian"}) {
      CAPTURE(std::string(preset));
      const int size = test::reduced(32, 10);
      Scene scene = cube_scene(size, size);
      Mesh floor;
      floor.positions = {{-3, -1, 4}, {3, -1, 4}, {3, -1, -6}, {-3, -1, -6}};
      floor.faces = {{0, 1, 2}, {0, 2, 3}};
      scene.meshes = {{floor}};
      scene.camera = Camera{};
      scene.camera.view[3] = glm::vec4(0, 0, -4, 1);
      scene.smoothing = smoothing_preset(preset);
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      renderer.forward();
      const SceneTangent direction = moved_along_x(renderer);
      const Image tangent = renderer.tangent({&direction, 1})[0];
      const auto is_finite = [](const glm::vec4& p) { return std::isfinite(p.x + p.y + p.z + p.w); };
      CHECK(std::ranges::all_of(tangent.pixels, is_finite));
      CHECK(std::ranges::any_of(renderer.image().pixels, [](const glm::vec4& p) { return p.w > 0; }));
    }
  }

  TEST_CASE("what images do not follow is refused") {
    Scene scene =
        textured_scene(make_icosphere(1), random_texture(4, 4, Wrap::clamp, Filter::bilinear), 16, 16);
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

}  // namespace tangent_test
