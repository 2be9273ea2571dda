// Poses of pictures that another renderer made in light of its own, and of our own pictures in other light.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dpr/pose.hpp"
#include "dpr/renderer.hpp"
#include "support/data.hpp"
#include "support/reduced.hpp"

namespace {

glm::dmat3 rotation_of(const nlohmann::json& rows) {
  glm::dmat3 rotation;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) rotation[column][row] = rows.at(row).at(column).get<double>();
  }
  return rotation;
}

dpr::Scene cube_scene(int size) {
  dpr::Scene scene;
  scene.width = scene.height = size;
  scene.camera = dpr::orbit_camera(6.7F, 30, 120);
  scene.meshes.push_back({dpr::make_cube()});
  return scene;
}

dpr::Image rigid_image(const dpr::Device& device, dpr::Scene scene) {
  scene.smoothing = dpr::rigid_smoothing();
  dpr::Renderer renderer(device);
  renderer.set_scene(scene);
  renderer.forward();
  return renderer.image();
}

const dpr::Pose k_turned{dpr::rotation_from_vector({0.2, 0.4, -0.2}), {}};

double error_from_turned(const dpr::Device& device, const dpr::Scene& scene, const dpr::Image& target,
                         dpr::LeastSquares method) {
  method.rotations = 0;
  const dpr::PoseSolver solver(device, scene, target, {.method = method});
  return dpr::angle_degrees(solver.solve(k_turned).pose.rotation, glm::dmat3(1.0));
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("poses of path-traced pictures are found in light that the scene does not know") {
    if (dpr::test::is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    const std::filesystem::path folder = dpr::test::data_folder() / "foreign";
    std::ifstream stream(folder / "truth.json");
    const nlohmann::json truth = nlohmann::json::parse(stream);
    std::vector<double> errors;
    for (const auto& [picture, rows] : truth.items()) {
      const dpr::Scene scene =
          dpr::read_scene(folder / (picture.substr(0, picture.find_first_of("0123456789")) + ".json"));
      const dpr::Image target = dpr::read_image(folder / (picture + ".exr"));
      const dpr::PoseResult result = dpr::PoseSolver(device, scene, target).search();
      errors.push_back(dpr::angle_degrees(result.pose.rotation, rotation_of(rows)));
      CAPTURE(picture);
      CHECK(result.explained);
      CHECK(result.light == dpr::PoseLight::harmonics);
      CHECK(errors.back() < 2);
    }
    REQUIRE(errors.size() == 6);
    std::ranges::sort(errors);
    CHECK((errors[2] + errors[3]) / 2 < 0.5);
  }

  TEST_CASE("a target in another colour of light is explained by the gain, and by it alone") {
    if (dpr::test::is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = cube_scene(64);
    dpr::Image target = rigid_image(device, scene);
    for (glm::vec4& pixel : target.pixels) pixel *= glm::vec4(0.2F, 0.5F, 1.4F, 1);
    dpr::LeastSquares method;
    const double found = error_from_turned(device, scene, target, method);
    method.light = dpr::PoseLight::fixed;
    const double missed = error_from_turned(device, scene, target, method);
    CHECK(found < 0.5);
    CHECK(missed > 2 * found);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("a target that says nothing of the light has a finite answer in every light") {
    const dpr::Device device = dpr::open_device();
    const int size = dpr::test::reduced(16, 8);
    dpr::Scene dark = cube_scene(size);
    dark.meshes.front().mesh.face_colors.assign(12, glm::vec3(0));
    const std::array<dpr::Scene, 2> scenes{cube_scene(size), dark};
    for (const dpr::Scene& scene : scenes) {
      for (const float shade : {0.0F, 0.5F, 1e4F}) {
        for (const dpr::PoseLight light : {dpr::PoseLight::gain, dpr::PoseLight::harmonics}) {
          for (const bool robust : {false, true}) {
            dpr::LeastSquares method;
            method.rotations = 2;
            method.iterations = 1;
            method.coarsest = 8;
            method.light = light;
            method.robust = robust;
            const bool is_one =
                &scene == &scenes.front() && light == dpr::PoseLight::harmonics && robust && shade == 0;
            if (dpr::test::is_reduced() && !is_one) continue;
            const dpr::Image target(size, size, glm::vec4(shade, shade, shade, 1));
            const dpr::PoseResult result =
                dpr::PoseSolver(device, scene, target, {.method = method}).search();
            CHECK(std::isfinite(result.loss));
            CHECK(std::isfinite(result.pose.rotation[0][0]));
          }
        }
      }
    }
  }
}
