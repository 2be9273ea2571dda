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
#include "support/rigid_image.hpp"

namespace pose_foreign_test {

namespace {

using dpr::test::rigid_image;

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

const dpr::Pose k_turned{dpr::rotation_from_vector({0.2, 0.4, -0.2}), {}};

double error_from_turned(const dpr::Device& device, const dpr::Scene& scene, const dpr::Image& target,
                         dpr::LeastSquares method) {
  method.rotations = 0;
  const dpr::PoseSolver solver(device, scene, target, {.method = method});
  return dpr::angle_degrees(solver.solve(k_turned).pose.rotation, glm::dmat3(1.0));
}

}  // namespace

namespace {

/// White, of eight vertices: its sides share their normals, where the mesh gives none.
dpr::Mesh shared_box() {
  dpr::Mesh mesh;
  for (unsigned i = 0; i < 8; ++i)
    mesh.positions.emplace_back(i & 4U ? 1.0F : -1.0F, i & 2U ? 0.8F : -0.8F, i & 1U ? 0.6F : -0.6F);
  mesh.faces = {{0, 1, 3}, {0, 3, 2}, {4, 6, 7}, {4, 7, 5}, {0, 4, 5}, {0, 5, 1},
                {2, 3, 7}, {2, 7, 6}, {0, 2, 6}, {0, 6, 4}, {1, 5, 7}, {1, 7, 3}};
  return mesh;
}

/// Bright from one side.
dpr::Lights sky(dpr::Shading shading) {
  dpr::Lights lights;
  lights.shading = shading;
  lights.ambient = glm::vec3(0);
  lights.harmonics.assign(9, glm::vec3(0));
  lights.harmonics[0] = glm::vec3(1.8F);
  lights.harmonics[1] = glm::vec3(0.5F, 0.4F, 0.3F);
  lights.harmonics[3] = glm::vec3(0.7F, 0.7F, 0.8F);
  return lights;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE(
      "the pose of a box in unknown light is found whether its sides are shaded flat or as one surface") {
    if (dpr::test::is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = cube_scene(96);
    scene.meshes.front().mesh = shared_box();
    for (const dpr::Shading shading : {dpr::Shading::flat, dpr::Shading::phong}) {
      CAPTURE(static_cast<int>(shading));
      dpr::Scene lit = scene;
      lit.lights = sky(shading);
      CHECK(error_from_turned(device, scene, rigid_image(device, lit), {}) < 0.5);
    }
  }

  TEST_CASE("of poses that light of their own explains equally well the one at the start is the result") {
    if (dpr::test::is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = cube_scene(128);
    scene.camera = dpr::orbit_camera(3.7F, 30, 120);
    scene.camera.fov_y_degrees = 60;
    scene.lights.emplace();
    scene.lights->point.push_back(
        {.position = {3, 5, -4}, .diffuse = glm::vec3(0.5F), .specular = glm::vec3(0.1F)});
    dpr::Scene lit = scene;
    lit.lights.emplace();
    lit.lights->ambient = {0.2F, 0.2F, 0.25F};
    lit.lights->directional.push_back(
        {.direction = {-1, -0.5F, -0.6F}, .diffuse = {0.7F, 0.6F, 0.4F}, .specular = glm::vec3(0)});
    const dpr::Image target = rigid_image(device, lit);
    scene.meshes.front().transform = glm::mat4(glm::mat3(dpr::rotation_from_vector({0.1, -0.8, 0.2})));
    const dpr::PoseResult result = dpr::PoseSolver(device, scene, target).solve({glm::dmat3(1.0), {}});
    CHECK(dpr::angle_degrees(result.pose.rotation, glm::dmat3(1.0)) < 0.5);
  }

  TEST_CASE("normals that the mesh gives shade it in unknown light") {
    if (dpr::test::is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = cube_scene(96);
    dpr::Mesh& mesh = scene.meshes.front().mesh;
    mesh = shared_box();
    for (const glm::vec3 p : mesh.positions) mesh.normals.push_back(p * p * p);  // nothing like the faces'
    mesh.face_normals = mesh.faces;
    dpr::Scene lit = scene;
    lit.lights = sky(dpr::Shading::phong);
    CHECK(error_from_turned(device, scene, rigid_image(device, lit), {}) < 0.5);
  }

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

  TEST_CASE("a robust loss finds edges that are not yet aligned") {
    if (dpr::test::is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = dpr::read_scene(dpr::test::data_folder() / "foreign" / "spot.json");
    scene.width = scene.height = 96;
    dpr::LeastSquares method;
    method.rotations = 0;
    method.robust = true;
    const dpr::PoseOptions options{.method = method, .solve_translation = true};
    std::vector<double> errors;
    for (const glm::dvec3& turn :
         {glm::dvec3(1.1, 0.3, -0.8), {-0.4, 2, 0.9}, {0.2, -1.5, 1.4}, {2, 0.6, 0.1}}) {
      const glm::dmat3 truth = dpr::rotation_from_vector(turn);
      scene.meshes.front().transform = glm::mat4(glm::mat3(truth));
      const dpr::Image target = rigid_image(device, scene);
      const dpr::Pose start{dpr::rotation_from_vector({0.03, -0.03, 0.02}) * truth, {0.06, -0.06, 0.06}};
      const dpr::PoseResult result = dpr::PoseSolver(device, scene, target, options).solve(start);
      errors.push_back(dpr::angle_degrees(result.pose.rotation, truth));
    }
    std::ranges::sort(errors);
    CHECK((errors[1] + errors[2]) / 2 < 0.7);  // without the wider loss 1.4
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

}  // namespace pose_foreign_test
