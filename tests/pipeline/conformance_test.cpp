// Images and gradients against the cases in tests/data/conformance, which other software computed in double
// precision.
#include <doctest/doctest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "dpr/dpr.hpp"
#include "support/data.hpp"
#include "support/reduced.hpp"

namespace conformance_test {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// The scenes. None under the simulator, where one takes minutes.
std::vector<fs::path> cases() {
  if (dpr::test::is_reduced()) return {};
  std::vector<fs::path> found = dpr::test::files_in(dpr::test::data_folder() / "conformance/scenes", ".json");
  std::erase_if(found, [](const fs::path& path) { return path.stem().extension() == ".grad"; });
  return found;
}

/// "dir/name.json" -> "dir/name" + suffix
fs::path beside(fs::path scene, const std::string& suffix) { return scene.replace_extension() += suffix; }

void flatten(const json& node, std::vector<double>& values) {
  if (node.is_array()) {
    for (const json& child : node) flatten(child, values);
  } else {
    values.push_back(node.get<double>());
  }
}

void flatten(const std::vector<glm::vec3>& rows, std::vector<double>& values) {
  for (const glm::vec3& v : rows) values.insert(values.end(), {v.x, v.y, v.z});
}
void flatten(const glm::dvec3& v, std::vector<double>& values) {
  values.insert(values.end(), {v.x, v.y, v.z});
}
void flatten(double v, std::vector<double>& values) { values.push_back(v); }

double norm(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v * v;
  return std::sqrt(sum);
}

/// Euclidean norm of the difference, relative to the reference's; or absolute, over 1e-7, where the reference
/// is tiny.
template <class Found>
double block_error(const json& expected, const Found& found, double relative) {
  if (expected.is_null()) return 0;
  std::vector<double> a, b;
  flatten(expected, a);
  flatten(found, b);
  REQUIRE(a.size() == b.size());
  for (std::size_t i = 0; i < a.size(); ++i) b[i] -= a[i];
  return norm(b) / std::max(norm(a), 1e-7 / relative);
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("conformance scenes: image, loss and every gradient") {
    const dpr::Device device = dpr::open_device();
    for (const fs::path& path : cases()) {
      CAPTURE(path.filename().string());
      const dpr::Scene scene = dpr::read_scene(path);
      const dpr::Image expected = dpr::read_image(beside(path, ".exr"));
      const dpr::Image target = dpr::read_image(beside(path, ".target.exr"));
      const json grad = json::parse(std::ifstream(beside(path, ".grad.json")));
      // Cauchy's heavy tails cost both programs digits.
      const double slack = scene.smoothing.depth_prior == dpr::Prior::cauchy ? 10 : 1;

      dpr::Renderer renderer(device);
      renderer.set_scene(scene);
      renderer.forward();
      const dpr::Image image = renderer.image();
      double largest = 0, sum = 0;
      for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        for (int c = 0; c < 4; ++c) {
          const double error = std::abs(image.pixels[i][c] - expected.pixels[i][c]);
          largest = std::max(largest, error);
          sum += error;
        }
      }
      const double mean = sum / static_cast<double>(4 * image.pixels.size());
      CHECK(largest < 1e-4 * slack);
      CHECK(mean < 1e-6 * slack);

      dpr::ImageLoss loss(
          device, dpr::LossWeights::only(dpr::parse_loss(grad["loss_kind"].get<std::string>(), "loss")),
          std::span(&target, 1));
      const double loss_error = std::abs(loss.evaluate(renderer) / grad["loss"].get<double>() - 1);
      CHECK(loss_error < 1e-5 * slack);

      const dpr::SceneGradient found = renderer.backward(loss);
      const dpr::PoseGradient& pose = found.views[0].transforms[0];
      const dpr::CameraGradient& camera = found.views[0].camera;
      const json& mesh = grad["meshes"][0];
      const double block = 1e-3 * slack, sensitivity = 1e-2 * slack;
      const std::vector<std::pair<const char*, double>> errors{
          {"positions", block_error(mesh["positions"], found.meshes[0].positions, block) / block},
          {"colors", block_error(mesh["colors"], found.meshes[0].colors, block) / block},
          {"rotation", block_error(mesh["rotation"], pose.rotation, block) / block},
          {"translation", block_error(mesh["translation"], pose.translation, block) / block},
          {"camera rotation", block_error(grad["camera"]["rotation"], camera.view.rotation, block) / block},
          {"camera translation",
           block_error(grad["camera"]["translation"], camera.view.translation, block) / block},
          {"fov", block_error(grad["camera"]["fov_y_degrees"], camera.fov_y_degrees, block) / block},
          {"background", block_error(grad["background"], found.background, block) / block},
          {"sigma", block_error(grad["sigma"], found.sigma, sensitivity) / sensitivity},
          {"gamma", block_error(grad["gamma"], found.gamma, sensitivity) / sensitivity},
          {"alpha", block_error(grad["alpha"], found.alpha, sensitivity) / sensitivity}};
      std::string report = path.stem().string() + ": image " + std::to_string(largest / (1e-4 * slack)) +
                           ", mean " + std::to_string(mean / (1e-6 * slack)) + ", loss " +
                           std::to_string(loss_error / (1e-5 * slack));
      for (const auto& [name, error] : errors) {
        CAPTURE(name);
        CHECK(error < 1);
        report += std::string(", ") + name + " " + std::to_string(error);
      }
      MESSAGE(report);
    }
  }
}

}  // namespace conformance_test
