// A template and pictures of what it is a template of: cameras, light and shape, of renders whose truth is
// known and of a photograph.
#include "dpr/photographs.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "dpr/error.hpp"
#include "dpr/renderer.hpp"
#include "scene/gradient_table.hpp"
#include "support/data.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

namespace photographs_test {

namespace {

using dpr::Mesh;
using dpr::ShapeViews;
using dpr::test::reduced;

/// A lump without symmetry, with spots.
Mesh lump() {
  Mesh mesh = dpr::make_icosphere(dpr::test::is_reduced() ? 1 : 3);
  mesh.vertex_colors.clear();
  for (glm::vec3& p : mesh.positions) {
    const glm::vec3 n = p;
    const float spots = std::sin(5 * n.x + 1) * std::cos(4 * n.y - 2 * n.z);
    mesh.vertex_colors.push_back(spots > 0 ? glm::vec3(0.9F, 0.8F, 0.6F) : glm::vec3(0.5F, 0.3F, 0.5F));
    p = glm::vec3(1.0F, 1.3F, 0.8F) * n * (1 + 0.15F * std::sin(3 * n.y + n.x)) +
        glm::vec3(0.5F, -0.3F, 0.2F);
  }
  return mesh;
}

/// With a bump on its right side and a dent on top.
Mesh bent(Mesh mesh) {
  const auto push = [&](const glm::vec3& at, const glm::vec3& by) {
    for (glm::vec3& p : mesh.positions) p += by * std::exp(-3 * glm::dot(p - at, p - at));
  };
  push({1.5F, 0, 0.2F}, {0.35F, 0, 0});
  push({0.2F, 0.9F, 0.2F}, {0, -0.25F, 0});
  return mesh;
}

dpr::Lights warm_light() {
  dpr::Lights lights;
  lights.ambient = glm::vec3(0);
  lights.harmonics.assign(dpr::k_harmonics, glm::vec3(0));
  lights.harmonics[0] = {2.4F, 2.2F, 1.8F};
  lights.harmonics[1] = {0.5F, 0.5F, 0.4F};
  lights.harmonics[3] = {-0.6F, -0.4F, -0.3F};
  lights.harmonics[6] = {0.2F, 0.1F, 0.3F};
  return lights;
}

dpr::Camera true_camera(float azimuth = 12) {
  dpr::Camera camera = dpr::orbit_camera(7, 8, azimuth, {0.4F, -0.2F, 0.2F});
  camera.fov_y_degrees = 32;
  camera.zfar = 30;
  return camera;
}

/// The truth as these cameras see it, and the template.
ShapeViews photographs_of(const dpr::Device& device, const Mesh& truth,
                          const std::vector<dpr::Camera>& cameras) {
  ShapeViews views;
  views.width = reduced(64, 16);
  views.height = reduced(56, 16);
  views.background = glm::vec3(0.1F, 0.15F, 0.1F);
  views.initial = lump();
  dpr::Scene scene;
  scene.width = views.width;
  scene.height = views.height;
  scene.background = views.background;
  scene.meshes.push_back({truth});
  scene.lights = warm_light();
  scene.smoothing = dpr::rigid_smoothing();
  scene.gradients = dpr::no_gradients();
  dpr::Renderer renderer(device);
  for (const dpr::Camera& camera : cameras) {
    scene.camera = camera;
    renderer.set_scene(scene);
    renderer.forward();
    views.views.push_back({renderer.image(), camera});
  }
  return views;
}

glm::dvec2 place_in_picture(const dpr::Camera& camera, const ShapeViews& views, const glm::vec3& p) {
  const dpr::Projection projection = dpr::projection(camera, views.width, views.height);
  const glm::vec4 at = camera.view * glm::vec4(p, 1);
  const glm::dvec2 ndc(projection.scale.x * at.x / -at.z + projection.offset.x,
                       projection.scale.y * at.y / -at.z + projection.offset.y);
  return ndc * (0.5 * std::min(views.width, views.height));
}

/// Root mean square distance of the vertices in the two pictures, pixels.
double distance_pixels(const ShapeViews& views, const Mesh& a, const dpr::Camera& camera_a, const Mesh& b,
                       const dpr::Camera& camera_b) {
  double sum = 0;
  for (std::size_t v = 0; v < a.positions.size(); ++v) {
    const glm::dvec2 d =
        place_in_picture(camera_a, views, a.positions[v]) - place_in_picture(camera_b, views, b.positions[v]);
    sum += glm::dot(d, d);
  }
  return std::sqrt(sum / static_cast<double>(a.positions.size()));
}

/// The least angle of a triangle's, degrees.
double least_angle(const Mesh& mesh) {
  double least = 180;
  for (const glm::uvec3& f : mesh.faces) {
    for (int k = 0; k < 3; ++k) {
      const glm::dvec3 at(mesh.positions[f[k]]);
      const glm::dvec3 a = glm::dvec3(mesh.positions[f[(k + 1) % 3]]) - at;
      const glm::dvec3 b = glm::dvec3(mesh.positions[f[(k + 2) % 3]]) - at;
      least = std::min(least, glm::degrees(std::acos(glm::dot(a, b) / (glm::length(a) * glm::length(b)))));
    }
  }
  return least;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("the light of a template is found from views all around, also where a part of one is covered") {
    const dpr::Device device = dpr::open_device();
    ShapeViews views = photographs_of(device, lump(), {true_camera(0), true_camera(90), true_camera(200)});
    const auto error = [&](const dpr::Lights& found) {
      double most = 0;
      for (std::size_t k = 0; k < dpr::k_harmonics; ++k) {
        const glm::vec3 d = glm::abs(found.harmonics[k] - warm_light().harmonics[k]);
        most = std::max<double>(most, std::max({d.x, d.y, d.z}));
      }
      return most;
    };
    const dpr::Lights found = dpr::find_light(device, views);
    CHECK(found.ambient == glm::vec3(0));
    if (dpr::test::is_reduced()) return;
    CHECK(error(found) < 0.05);
    dpr::Image& first = views.views[0].image;
    for (int row = 20; row < 34; ++row) {
      for (int column = 24; column < 44; ++column) first.at(column, row) = glm::vec4(0, 1, 0, 1);
    }
    CHECK(error(dpr::find_light(device, views)) > 0.1);
    CHECK(error(dpr::find_light(device, views, 0.1F)) < 0.05);
    views.views[0].mask = dpr::Image(views.width, views.height, glm::vec4(1));
    for (int row = 20; row < 34; ++row) {
      for (int column = 24; column < 44; ++column) views.views[0].mask.at(column, row) = glm::vec4(0);
    }
    CHECK(error(dpr::find_light(device, views)) < 0.05);
  }

  TEST_CASE("a template is bent to a picture: camera, focal length and light first, then shape") {
    if (dpr::test::is_reduced()) return;  // too many frames for a simulator
    const dpr::Device device = dpr::open_device();
    const Mesh truth = bent(lump());
    ShapeViews views = photographs_of(device, truth, {true_camera()});
    dpr::ShapeView& view = views.views[0];
    view.camera = true_camera(4);
    view.camera.fov_y_degrees = 36;
    view.knowledge = dpr::CameraKnowledge::near;
    CHECK(distance_pixels(views, lump(), view.camera, truth, true_camera()) > 2);
    dpr::PoseOptions options;
    options.solve_focal = true;
    dpr::find_camera(device, views, 0, options);
    CHECK(view.knowledge == dpr::CameraKnowledge::known);
    CHECK(dpr::angle_degrees(glm::dmat3(view.camera.view), glm::dmat3(true_camera().view)) < 4);
    const dpr::Intrinsics found = view.camera.intrinsics.value_or(dpr::Intrinsics{});
    const double fov = view.camera.intrinsics ? 2 * std::atan(0.5 * views.height / found.fy)
                                              : glm::radians(double{view.camera.fov_y_degrees});
    CHECK(std::tan(fov / 2) == doctest::Approx(std::tan(glm::radians(16.0))).epsilon(0.15));
    const double posed = distance_pixels(views, lump(), view.camera, truth, true_camera());
    views.lights = dpr::find_light(device, views);
    dpr::ShapeOptions bending = dpr::template_shape_options();
    bending.levels = 1;
    bending.iterations = 150;
    const dpr::ShapeResult result = dpr::ShapeSolver(device, views, bending).solve();
    const double shaped = distance_pixels(views, result.mesh, view.camera, truth, true_camera());
    CAPTURE(posed);
    CAPTURE(shaped);
    CHECK(shaped < 0.7 * posed);
    CHECK(shaped < 1);
    CHECK(result.mesh.vertex_colors == lump().vertex_colors);
    CHECK(least_angle(result.mesh) > 10);
  }

  TEST_CASE("three pictures from known places bend a template in space, in a light that is found") {
    if (dpr::test::is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    const Mesh truth = bent(lump());
    ShapeViews views = photographs_of(device, truth, {true_camera(-20), true_camera(40), true_camera(100)});
    views.lights = dpr::find_light(device, views);
    dpr::ShapeOptions bending = dpr::template_shape_options();
    bending.levels = 1;
    bending.iterations = 150;
    const dpr::ShapeResult result = dpr::ShapeSolver(device, views, bending).solve();
    const auto most_off = [&](const Mesh& mesh) {
      float most = 0;
      for (std::size_t v = 0; v < mesh.positions.size(); ++v)
        most = std::max(most, glm::distance(mesh.positions[v], truth.positions[v]));
      return most;
    };
    CHECK(most_off(lump()) > 0.3F);
    CHECK(most_off(result.mesh) < 0.2F);
  }

  TEST_CASE("a face is bent to a photograph") {
    if (dpr::test::is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    ShapeViews views = dpr::read_views(dpr::test::data_folder() / "../../bench/data/face/views.json");
    CHECK(views.views[0].has_alpha);
    views.views[0].knowledge = dpr::CameraKnowledge::known;  // which is not far from it
    views.lights = dpr::find_light(device, views);
    dpr::ShapeOptions bending = dpr::template_shape_options();
    bending.levels = 1;
    bending.iterations = 150;
    const dpr::ShapeResult result = dpr::ShapeSolver(device, views, bending).solve();
    CHECK(result.history.back().image_loss < 0.7 * result.history.front().image_loss);
    CHECK(result.history.back().mesh_loss < 0.02);
    CHECK(least_angle(result.mesh) > 0.2);
  }

  TEST_CASE("a camera of which nothing is known is found from the front") {
    if (dpr::test::is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    ShapeViews views = photographs_of(device, lump(), {true_camera()});
    dpr::ShapeView& view = views.views[0];
    view.camera = {};
    view.knowledge = dpr::CameraKnowledge::unknown;
    dpr::PoseOptions options;
    options.solve_focal = true;
    std::get<dpr::LeastSquares>(options.method).rotations = 30;
    const dpr::PoseResult found = dpr::find_camera(device, views, 0, options);
    CHECK(found.explained);
    CHECK(distance_pixels(views, lump(), view.camera, lump(), true_camera()) < 1);
  }

  TEST_CASE("what photographs lack is said") {
    const dpr::Device device = dpr::open_device();
    ShapeViews views = photographs_of(device, lump(), {true_camera()});
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::find_camera(device, views, 1), "view");
    dpr::PoseOptions descent;
    descent.method = dpr::Descent{};
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::find_camera(device, views, 0, descent), "method");
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::find_light(device, views, -1), "robust_scale");
    dpr::ShapeOptions options;
    options.rigidity = 1;  // and its faces would not stay
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::ShapeSolver(device, views, options), "remesh_interval");
    options.rigidity = -1;
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::ShapeSolver(device, views, options), "rigidity");
    views.views[0].knowledge = dpr::CameraKnowledge::near;
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::find_light(device, views), "views[0].camera");
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::ShapeSolver(device, views), "views[0].camera");
    views.initial.reset();
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::find_camera(device, views, 0), "initial");
  }
}

}  // namespace photographs_test
