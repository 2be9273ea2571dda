// Poses from several pictures: of an object that stands still before several cameras, and of one that moves before a
// camera whose focal length and lens are not known.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

#include "dpr/pose_views.hpp"
#include "dpr/renderer.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"
#include "support/rigid_image.hpp"

namespace pose_views_test {

namespace {

using dpr::test::is_reduced;
using dpr::test::reduced;
using dpr::test::rigid_image;

constexpr unsigned k_columns = 8, k_rows = 6;  // of squares

/// A board of squares, each of a colour of its own, that is 4 wide and 3 high.
dpr::Mesh board() {
  std::mt19937 engine(5);
  const auto channel = [&] { return static_cast<float>(engine() % 256U) / 255.0F; };
  dpr::Mesh mesh;
  for (unsigned row = 0; row <= k_rows; ++row) {
    for (unsigned column = 0; column <= k_columns; ++column)
      mesh.positions.emplace_back(0.5F * static_cast<float>(column) - 2,
                                  0.5F * static_cast<float>(row) - 1.5F, 0);
  }
  for (unsigned row = 0; row < k_rows; ++row) {
    for (unsigned column = 0; column < k_columns; ++column) {
      const unsigned first = row * (k_columns + 1) + column, above = first + k_columns + 1;
      mesh.faces.insert(mesh.faces.end(), {{first, first + 1, above + 1}, {first, above + 1, above}});
      const float red = channel(), green = channel();
      mesh.face_colors.insert(mesh.face_colors.end(), 2, glm::vec3(red, green, channel()));
    }
  }
  return mesh;
}

dpr::Scene board_scene() {
  dpr::Scene scene;
  scene.width = reduced(64, 16);
  scene.height = reduced(48, 12);
  scene.meshes = {{board()}};
  scene.camera.fov_y_degrees = 45;
  scene.camera.zfar = 20;
  return scene;
}

/// A camera that sees the board from that side, turned and shifted by a little.
dpr::Camera camera_at(const dpr::Camera& camera, const glm::dvec3& turn, const glm::dvec3& place) {
  dpr::Camera result = camera;
  glm::dmat4 view(dpr::rotation_from_vector(turn));
  view[3] = glm::dvec4(place, 1);
  result.view = glm::mat4(view);
  return result;
}

const std::array<glm::dvec3, 4> k_turns{
    {{0.5, 0.1, 0.1}, {-0.4, 0.5, 0}, {0.1, -0.6, -0.2}, {0.45, 0.5, 0.3}}};
const std::array<glm::dvec3, 4> k_places{
    {{0.2, 0.1, -5}, {-0.3, 0.2, -5.5}, {0.1, -0.2, -4.8}, {0, 0.2, -5.2}}};

/// Views of the board where it stands.
std::vector<dpr::PoseView> views_of(const dpr::Device& device, const dpr::Scene& scene, std::size_t count) {
  std::vector<dpr::PoseView> views;
  for (std::size_t i = 0; i < count; ++i) {
    dpr::Scene seen = scene;
    seen.camera = camera_at(scene.camera, k_turns[i], k_places[i]);
    views.push_back({seen.camera, rigid_image(device, seen)});
  }
  return views;
}

dpr::PoseOptions near_options() {
  dpr::LeastSquares method;
  method.rotations = 0;
  method.light = dpr::PoseLight::fixed;
  if (is_reduced()) method.iterations = 1;
  return {.method = method, .solve_translation = true};
}

const dpr::Pose k_start{dpr::rotation_from_vector({0.12, -0.1, 0.1}), {0.1, -0.1, 0.15}};

double size_of(const std::vector<double>& covariance, std::size_t first, std::size_t last) {
  const auto n = static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(covariance.size()))));
  double sum = 0;
  for (std::size_t i = first; i < last; ++i) sum += covariance[i * n + i];
  return std::sqrt(sum);
}

dpr::Image noisy(dpr::Image image, unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<float> draw(0, 0.05F);
  for (glm::vec4& pixel : image.pixels) {
    for (int i = 0; i < 3; ++i) pixel[i] += draw(engine);
  }
  return image;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("pose: one view gives what a single picture does, to the bit") {
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = board_scene();
    const std::vector<dpr::PoseView> views = views_of(device, scene, 1);
    const dpr::PoseResult of_view =
        dpr::PoseSolver::of_views(device, scene, views, near_options()).solve(k_start);
    scene.camera = views.front().camera;
    const dpr::PoseResult single =
        dpr::PoseSolver(device, scene, views.front().target, near_options()).solve(k_start);
    CHECK(of_view.pose.rotation == single.pose.rotation);
    CHECK(of_view.pose.translation == single.pose.translation);
    CHECK(of_view.loss == single.loss);
    CHECK(of_view.covariance == single.covariance);
    CHECK(of_view.view_parts.empty());
  }

  TEST_CASE("pose: several views show where an object stands better than each of them") {
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = board_scene();
    std::vector<dpr::PoseView> views = views_of(device, scene, 3);
    for (std::size_t i = 0; i < views.size(); ++i)
      views[i].target = noisy(views[i].target, static_cast<unsigned>(i));
    const dpr::PoseResult all =
        dpr::PoseSolver::of_views(device, scene, views, near_options()).solve(k_start);
    REQUIRE(all.view_parts.size() == views.size());
    if (is_reduced()) return;
    CHECK(all.explained);
    for (const double part : all.view_parts) CHECK(part < 0.15);
    const double error = glm::length(all.pose.translation);
    double mean = 0;
    for (const dpr::PoseView& view : views) {
      const dpr::PoseResult one =
          dpr::PoseSolver::of_views(device, scene, {view}, near_options()).solve(k_start);
      mean += glm::length(one.pose.translation) / static_cast<double>(views.size());
      CHECK(size_of(all.covariance, 3, 6) < 0.7 * size_of(one.covariance, 3, 6));
    }
    CHECK(error < 0.7 * mean);
    CHECK(error < 2 * size_of(all.covariance, 3, 6));
    CHECK(dpr::angle_degrees(all.pose.rotation, glm::dmat3(1.0)) < 0.5);
  }

  TEST_CASE("pose: several views that do not go together are not explained, and the wrong one leaves most") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = board_scene();
    std::vector<dpr::PoseView> views = views_of(device, scene, 3);
    views[1].camera = camera_at(scene.camera, -k_turns[1], k_places[1]);
    const dpr::PoseResult all =
        dpr::PoseSolver::of_views(device, scene, views, near_options()).solve(k_start);
    CHECK_FALSE(all.explained);
    REQUIRE(all.view_parts.size() == 3);
    CHECK(all.view_parts[1] > 2 * all.view_parts[0]);
    CHECK(all.view_parts[1] > 2 * all.view_parts[2]);
  }

  TEST_CASE("pose: a search in several views knows nothing of the rotation") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = board_scene();
    const std::vector<dpr::PoseView> views = views_of(device, scene, 2);
    scene.meshes.front().transform = glm::mat4(glm::dmat4(dpr::rotation_from_vector({2, 1, -0.5})));
    dpr::PoseOptions options = near_options();
    std::get<dpr::LeastSquares>(options.method).rotations = 288;
    const dpr::PoseResult found = dpr::PoseSolver::of_views(device, scene, views, options).search();
    CHECK(found.explained);
    CHECK(dpr::angle_degrees(found.pose.rotation, glm::dmat3(1.0)) < 0.3);
    CHECK(glm::length(found.pose.translation) < 0.02);
  }

  TEST_CASE("pose: pictures of a moving board find the camera's focal length and lens together") {
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = board_scene();
    const dpr::Camera unknown = scene.camera;
    scene.camera = dpr::calibrated(unknown, 1.1, {-0.15, 0.02});
    std::vector<dpr::PoseView> views = views_of(device, scene, reduced(4, 2));
    // What is known: a camera of another focal length without lens, and poses that are off.
    for (std::size_t i = 0; i < views.size(); ++i) {
      const double sign = i % 2 == 0 ? 1 : -1;
      views[i].camera = camera_at(unknown, k_turns[i] + sign * glm::dvec3(0.08, -0.1, 0.06),
                                  k_places[i] + sign * glm::dvec3(0.05, -0.05, 0.1));
    }
    dpr::PoseOptions options = near_options();
    options.solve_focal = options.solve_distortion = true;
    std::size_t steps = 0;
    const auto count = [&](const dpr::PoseIteration& step) {
      CHECK(step.body < views.size());
      return ++steps > 0;
    };
    const auto results = dpr::solve_moving(device, scene, views, options, dpr::PoseStart::scene, count);
    REQUIRE(results.size() == views.size());
    CHECK(steps > views.size());
    if (is_reduced()) return;
    for (std::size_t i = 0; i < views.size(); ++i) {
      CAPTURE(i);
      const dpr::PoseResult& result = results[i];
      CHECK(result.explained);
      CHECK(result.focal_scale == results.front().focal_scale);
      CHECK(result.radial == results.front().radial);
      const glm::dmat4 view(views[i].camera.view);
      const glm::dmat3 rotation = glm::dmat3(view) * result.pose.rotation;
      CHECK(dpr::angle_degrees(rotation, dpr::rotation_from_vector(k_turns[i])) < 0.5);
      const glm::dvec3 place = glm::dvec3(view * glm::dvec4(result.pose.translation, 1));
      CHECK(glm::length(place - k_places[i]) < 0.06);
      REQUIRE(result.covariance.size() == 81);
      CHECK(size_of(result.covariance, 6, 7) < 0.05);
    }
    CHECK(results.front().focal_scale == doctest::Approx(1.1).epsilon(0.01));
    CHECK(results.front().radial.x == doctest::Approx(-0.15).epsilon(0.15));
  }

  TEST_CASE("pose: a picture that shows something else has no say in the camera") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = board_scene();
    const dpr::Camera unknown = scene.camera;
    scene.camera = dpr::calibrated(unknown, 0.95, glm::dvec2(0));
    std::vector<dpr::PoseView> views = views_of(device, scene, 3);
    for (dpr::PoseView& view : views) {
      const glm::mat4 at = view.camera.view;
      view.camera = unknown;
      view.camera.view = at;
    }
    dpr::PoseOptions options = near_options();
    options.solve_focal = true;
    const auto alone = dpr::solve_moving(device, scene, std::span(views).first(2), options);
    for (std::size_t i = 0; i < views[2].target.pixels.size(); ++i)
      views[2].target.pixels[i] = glm::vec4(glm::vec3(0.02F * static_cast<float>(i % 7 + i % 64 / 3)), 1);
    const auto results = dpr::solve_moving(device, scene, views, options);
    CHECK_FALSE(results[2].explained);
    CHECK(results[2].covariance.empty());
    CHECK(results[0].explained);
    CHECK(results[0].focal_scale == alone[0].focal_scale);
    CHECK(results[0].focal_scale == doctest::Approx(0.95).epsilon(0.01));
    CHECK(results[2].focal_scale == alone[0].focal_scale);
  }

  TEST_CASE("pose: views that cannot be compared are errors that name them") {
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = board_scene();
    std::vector<dpr::PoseView> views = views_of(device, scene, 2);
    const auto make = [&](const dpr::PoseOptions& options) {
      dpr::PoseSolver::of_views(device, scene, views, options);
    };
    dpr::PoseOptions options = near_options();
    std::get<dpr::LeastSquares>(options.method).mask = views[0].target;
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, make(options), "each view has its own");
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, make({.method = dpr::Descent{}}),
                          "a descent in several views");
    options = near_options();
    options.explained = 2;
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::solve_moving(device, scene, views, options),
                          "explained");
    views[1].target = dpr::Image(3, 3);
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, make(near_options()), "views[1]");
    views.clear();
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, make(near_options()), "at least one");
  }
}

}  // namespace pose_views_test
