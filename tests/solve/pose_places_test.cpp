// Objects whose place is not known: found in a box, in a mask, and anywhere in the picture.
#include "solve/pose_places.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "dpr/error.hpp"
#include "solve/extent.hpp"
#include "solve/polar.hpp"
#include "solve/pose_window.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"
#include "support/rigid_image.hpp"

namespace pose_places_test {

using namespace dpr;

namespace {

constexpr double k_radius = 1.7320508;  // of the cube

Scene cube_scene() {
  Scene scene;
  scene.width = 96;
  scene.height = 80;
  scene.camera = orbit_camera(6.7F, 30, 120);
  scene.camera.intrinsics = Intrinsics{70, 74, 52, 37};
  scene.meshes.push_back({make_cube(), glm::mat4(1.0F)});
  return scene;
}

/// A pose that is seen so many radii to the right, upwards and nearer than the middle of the scene.
Pose moved(const Scene& scene, const glm::dvec3& radii) {
  const glm::dmat3 camera_to_world = glm::transpose(glm::dmat3(scene.camera.view));
  return {rotation_from_vector({1.9, -0.7, 0.8}), camera_to_world * (k_radius * radii)};
}

Scene with(Scene scene, const Pose& pose) {
  scene.meshes.front().transform = affine(pose.rotation, pose.translation);
  return scene;
}

void check_found(const PoseResult& result, const Pose& truth) {
  CHECK(result.explained);
  CHECK(angle_degrees(result.pose.rotation, truth.rotation) < 0.5);
  CHECK(glm::length(result.pose.translation - truth.translation) < 0.03 * k_radius);
  CHECK(result.start.translation == glm::dvec3(0.0));
}

/// 1 at the object's pixels, and within so many columns and rows.
Image mask_of(const Image& target, int around = 0) {
  Image mask(target.width, target.height);
  for (int row = 0; row < mask.height; ++row) {
    for (int column = 0; column < mask.width; ++column) {
      if (!(target.at(column, row).w > 0.5F)) continue;
      for (int y = std::max(row - around, 0); y <= std::min(row + around, mask.height - 1); ++y) {
        for (int x = std::max(column - around, 0); x <= std::min(column + around, mask.width - 1); ++x)
          mask.at(x, y) = glm::vec4(1);
      }
    }
  }
  return mask;
}

LeastSquares in_box(const PoseBox& box) {
  LeastSquares method;
  method.box = box;
  return method;
}

/// Larger by so many pixels on every side.
PoseBox grown(PoseBox box, float by) {
  return {box.x - by, box.y - by, box.width + 2 * by, box.height + 2 * by};
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("from its place in a box an object fills the box, whatever its rotation") {
    const Scene scene = cube_scene();
    const PoseBox box{10, 20, 24, 18};
    const BoxPlaces places(scene, PoseBody(scene, {}), box);
    for (const glm::dvec3& r : {glm::dvec3(0), glm::dvec3(0.4, 0.9, -0.3), glm::dvec3(2, 0, 1)}) {
      const glm::dmat3 rotation = rotation_from_vector(r);
      const glm::dmat4 place(affine(rotation, places.translation(rotation)));
      glm::dvec2 low(1e9), high(-1e9);
      for (const glm::vec3& p : scene.meshes.front().mesh.positions) {
        const glm::dvec3 q(glm::dmat4(scene.camera.view) * place * glm::dvec4(p, 1));
        const glm::dvec2 pixel(52 + 70 * q.x / -q.z, 37 - 74 * q.y / -q.z);
        low = glm::min(low, pixel);
        high = glm::max(high, pixel);
      }
      CHECK(glm::length(0.5 * (low + high) - glm::dvec2(22, 29)) < 0.1);
      CHECK(glm::length(high - low) == doctest::Approx(30).epsilon(0.02));
    }
  }

  TEST_CASE("from its place in a box an object is seen there by a fisheye") {
    Scene scene = cube_scene();
    scene.camera.intrinsics = Intrinsics{30, 32, 52, 37};
    scene.camera.distortion = fisheye(0.05F, -0.02F, 0.01F, 0);
    for (const glm::dvec2& at : {glm::dvec2(52, 37), {40, 30}, {16, 50}}) {
      const auto x = static_cast<float>(at.x), y = static_cast<float>(at.y);
      const BoxPlaces places(scene, PoseBody(scene, {}), {x - 1, y - 1, 2, 2});
      const glm::dvec3 p(glm::dmat4(scene.camera.view) * glm::dvec4(places.translation(glm::dmat3(1)), 1));
      const double r = std::hypot(p.x, p.y) / -p.z, angle = std::atan(r);
      const double shown =
          angle + 0.05 * std::pow(angle, 3) - 0.02 * std::pow(angle, 5) + 0.01 * std::pow(angle, 7);
      const double factor = r > 0 ? shown / r / -p.z : 1;
      CHECK(glm::distance(glm::dvec2(52 + 30 * factor * p.x, 37 - 32 * factor * p.y), at) < 0.1);
    }
  }

  TEST_CASE("a problem cut to a box shows the same in fewer pixels") {
    if (test::is_reduced()) return;
    const Device device = open_device();
    const Scene scene = cube_scene();
    const Image whole = test::rigid_image(device, scene);
    const PoseOptions options{.method = in_box({30, 20, 40, 30})};
    const PoseProblem part = cut_to_box(scene, whole, options, {30, 20, 40, 30});
    CHECK(part.scene.width == 64);
    CHECK(part.scene.height == 54);
    CHECK(std::get<LeastSquares>(part.options.method).box->x == 12);
    const Image seen = test::rigid_image(device, part.scene);
    REQUIRE(seen.pixels.size() == part.target.pixels.size());
    double difference = 0;
    for (std::size_t i = 0; i < seen.pixels.size(); ++i)
      difference = std::max(difference, double{glm::length(seen.pixels[i] - part.target.pixels[i])});
    CHECK(difference < 1e-3);
    const auto box = extent(mask_of(whole));
    REQUIRE(box);
    CHECK(box->width > 20);
    CHECK_FALSE(extent(Image(3, 3)));
  }
}

TEST_SUITE("unit") {
  TEST_CASE("what differs from the background is found in noise, and nothing where nothing does") {
    std::mt19937 random(7);
    std::normal_distribution<float> noise(0, 0.08F);
    Image picture(90, 70);
    for (glm::vec4& pixel : picture.pixels)
      pixel = {0.2F + noise(random), 0.3F + noise(random), 0.1F + noise(random), 1};
    CHECK_FALSE(extent_before(picture, glm::vec3(0.2F, 0.3F, 0.1F)));
    for (int row = 20; row < 32; ++row) {
      for (int column = 50; column < 73; ++column) picture.at(column, row).y += 0.4F;
    }
    const auto box = extent_before(picture, glm::vec3(0.2F, 0.3F, 0.1F));
    REQUIRE(box);
    CHECK(std::abs(box->x - 50) <= 1);
    CHECK(std::abs(box->y - 20) <= 1);
    CHECK(std::abs(box->width - 23) <= 2);
    CHECK(std::abs(box->height - 12) <= 2);
    CHECK_FALSE(extent_before(Image(90, 70, glm::vec4(0.5F)), glm::vec3(0.5F)));
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("search: where an object shows whole before the background no other place is tried") {
    if (test::is_reduced()) return;
    const Device device = open_device();
    Scene scene = cube_scene();
    const auto search = [&](const Image& target) {
      return PoseSolver(device, scene, target, {.method = LeastSquares{}, .solve_translation = true})
          .search();
    };
    const Pose truth = moved(scene, {1.1, 0.3, -1.5});
    Image target = test::rigid_image(device, with(scene, truth));
    const PoseResult alone = search(target);
    check_found(alone, truth);
    constexpr unsigned k_of_box = 97;  // the best rotations, and the initial one
    CHECK(alone.history.front().hypotheses == k_of_box);

    for (int i = 0; i < 9; ++i) target.at(3 + i % 3, 75 + i / 3) = glm::vec4(1);
    check_found(search(target), truth);  // a speck is nothing

    scene.meshes.push_back({make_cube(), affine(glm::dmat3(0.6), glm::dvec3(0, -3, 0))});
    const Image two = test::rigid_image(device, with(scene, truth));
    scene.meshes.pop_back();
    const PoseResult beside = search(two);  // no cube fills the box of both
    CHECK(angle_degrees(beside.pose.rotation, truth.rotation) < 0.5);
    CHECK(beside.history.size() > alone.history.size());
    for (std::size_t i = 0; i < beside.history.size(); ++i) CHECK(beside.history[i].iteration == i);
  }

  TEST_CASE("search: a picture that every pose makes worse has a pose that does not explain it") {
    if (test::is_reduced()) return;
    const Device device = open_device();
    const Scene scene = cube_scene();
    Image grey(scene.width, scene.height, glm::vec4(0.5F, 0.5F, 0.5F, 1));
    for (std::size_t i = 0; i < grey.pixels.size(); ++i) grey.pixels[i].x += i % 7 == 0 ? 0.01F : 0;
    const PoseResult result =
        PoseSolver(device, scene, grey, {.method = LeastSquares{}, .solve_translation = true}).search();
    CHECK_FALSE(result.explained);
    CHECK(result.unexplained_part > 1);
    REQUIRE_FALSE(result.equals.empty());
    CHECK(result.equals.front().loss == result.loss);
    CHECK(glm::length(result.pose.translation - result.equals.front().pose.translation) == 0);
  }

  TEST_CASE("search: an object that the picture cuts is found") {
    if (test::is_reduced()) return;
    const Device device = open_device();
    const Scene scene = cube_scene();
    const Pose truth = moved(scene, {2.5, 0.2, 0.3});
    const Image target = test::rigid_image(device, with(scene, truth));
    const PoseBox seen = *extent(mask_of(target));
    CHECK(seen.x + seen.width == 96);
    CHECK(seen.width < 0.7F * seen.height);
    const PoseOptions options{.method = LeastSquares{}, .solve_translation = true};
    const PoseResult result = PoseSolver(device, scene, target, options).search();
    CHECK(result.explained);
    CHECK(angle_degrees(result.pose.rotation, truth.rotation) < 5);
    CHECK(glm::length(result.pose.translation - truth.translation) < 0.05 * k_radius);
  }

  TEST_CASE("search: an object of unknown place is found in a box, a mask, a silhouette or anywhere") {
    if (test::is_reduced()) return;
    const Device device = open_device();
    const Scene scene = cube_scene();
    for (const glm::dvec3& radii : {glm::dvec3(1.1, 0.3, -1.5), glm::dvec3(-1.6, -0.9, 0.5)}) {
      CAPTURE(radii.x);
      const Pose truth = moved(scene, radii);
      const Image target = test::rigid_image(device, with(scene, truth));
      const Image mask = mask_of(target);
      const auto search = [&](const LeastSquares& method) {
        return PoseSolver(device, scene, target, {.method = method, .solve_translation = true}).search();
      };
      LeastSquares masked, outlined;
      masked.mask = mask_of(target, 3);  // with less the size would not be seen
      outlined.silhouette.image = mask;
      for (const LeastSquares& method : {LeastSquares{}, masked, outlined, in_box(grown(*extent(mask), 2))})
        check_found(search(method), truth);
    }
  }

  TEST_CASE("solve: of what lies far outside the box nothing is seen") {
    if (test::is_reduced()) return;
    const Device device = open_device();
    const Scene scene = cube_scene();
    const Pose truth = moved(scene, {1.1, 0.3, -1.5});
    Image target = test::rigid_image(device, with(scene, truth));
    const PoseBox box = *extent(mask_of(target));
    for (int row = 0; row < target.height; ++row) {
      for (int column = 0; column < target.width; ++column) {
        const auto x = static_cast<float>(column), y = static_cast<float>(row);
        const float margin = 0.25F * std::max(box.width, box.height) + 3;
        const PoseBox seen = grown(box, margin);
        if (x >= seen.x && x < seen.x + seen.width && y >= seen.y && y < seen.y + seen.height) continue;
        target.at(column, row) = glm::vec4(column % 2, row % 3, 1, 1);
      }
    }
    const PoseSolver solver(device, scene, target, {.method = in_box(box), .solve_translation = true});
    check_found(solver.search(), truth);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("boxes without a pixel of the image are refused") {
    const Device device = open_device();
    Scene scene = cube_scene();
    const Image target(96, 80);
    const auto make = [&](const PoseBox& box) {
      return PoseSolver(device, scene, target, {.method = in_box(box)});
    };
    for (const PoseBox& box : {PoseBox{96, 0, 5, 5}, PoseBox{-5, 0, 5, 5}, PoseBox{0, 0, 0, 5},
                               PoseBox{0, 0, 5, INFINITY}, PoseBox{NAN, 0, 5, 5}}) {
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, make(box), "box (pose): got ");
    }
    scene.camera.intrinsics.reset();
    scene.camera.orthographic_height = 5.0F;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, make({0, 0, 5, 5}), "box (pose): got an orthographic camera");
  }
}

}  // namespace pose_places_test
